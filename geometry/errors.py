"""Errors of a geometry that a user gave."""


class InvalidGeometry(ValueError):
    """Bodies that nobody can build, pick or join; the message says which, with the numbers."""
