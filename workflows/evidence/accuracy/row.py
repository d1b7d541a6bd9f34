"""What a run costs beside its error."""

from typing import NamedTuple


class Row(NamedTuple):
    """One run: what it cost and how far off it was; None where it does not apply."""

    study: str
    method: str
    parameter: float | str  # step [s], tolerance, spheres, wall modes, part
    error: float | None  # largest velocity error over the largest initial speed
    seconds: float  # warm, the least of some repeats
    energy_error: float | None = None  # largest change over the kinetic energy at the start
    steps: int | None = None
    evaluations: int | None = None  # of all contact forces
    seconds_cold: float | None = None  # the first call in this process
    setting: float | None = None  # step [s] or tolerance where `parameter` is a size
