"""The one exception of this room: a wall that a chain cannot be marched against."""


class CouplingError(ValueError):
    """The wall or the run cannot work as asked; one sentence says what was found and what to do."""
