"""The impulse of the first wave in a record of a force, as a check of the record: what a bead hands
on is momentum, which contacts do not change."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dem.waves.arrivals import peaks

HIGH = 0.3  # of the largest force: a wave
PARTED = 0.1  # of the crest, between waves that do not overlap
GONE = 0.02  # of the crest, after it


class Impulse(NamedTuple):
    """Of the first wave."""

    impulse: float  # [N s]
    end: float  # [s]
    samples: int


def incident_impulse(t: NDArray[np.float64], force: NDArray[np.float64]) -> Impulse | None:
    """From the start of a record (k,) to where its first wave has gone; None where there is none,
    or where the next one comes before that."""
    tops = peaks(force, HIGH * force.max(initial=0.0))
    if not tops:
        return None
    top = tops[0]
    after = force[top : tops[1] if len(tops) > 1 else None]
    gone = np.flatnonzero(after < GONE * force[top])
    end = top + int(gone[0] if gone.size else after.argmin())
    if force[end] > PARTED * force[top]:
        return None
    return Impulse(float(np.trapezoid(force[: end + 1], t[: end + 1])), float(t[end]), end + 1)
