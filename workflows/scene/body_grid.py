"""Grids of hexahedra that a template prescribes for its bodies."""

from typing import NamedTuple


class GridLine(NamedTuple):
    """A line that the hexahedra of a body end on, across one of its own axes."""

    at: float  # [m]
    size: float | None = None  # [m] of the elements next to it; None is the body's
    growth: float = 1.7  # size of each next element over its own


class Ring(NamedTuple):
    """A rectangle around a hole of a plate, between lines, that two rings of elements fill: from
    the hole to the circle of a washer, and on to the rectangle."""

    washer: float  # [m] radius
    lower: tuple[float, float]  # [m] its corners, along the plate's own axes
    upper: tuple[float, float]


class BodyGrid(NamedTuple):
    """The lines of a body's hexahedra along its own axes; its ends need not be among them."""

    x: tuple[GridLine, ...] = ()
    y: tuple[GridLine, ...] = ()
    z: tuple[GridLine, ...] = ()
    rings: tuple[Ring, ...] = ()  # one for every hole of a plate, in their order
