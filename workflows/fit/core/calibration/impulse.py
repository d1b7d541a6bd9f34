"""The impulse of the first wave in a record of a force, as a check of the record: what a bead hands
on is momentum, which contacts do not change."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dem.waves.arrivals import peaks

HIGH = 0.3  # of the largest force: crests above it are waves
PARTED = 0.1  # of the crest: a force that stays above it before the next wave belongs to both
GONE = 0.02  # of the crest: a wave has passed when the force is below it


class Impulse(NamedTuple):
    """Of the first wave."""

    impulse: float  # [N s]
    end: float  # [s] when it has passed
    samples: int  # from the start of the record to there


def incident_impulse(t: NDArray[np.float64], force: NDArray[np.float64]) -> Impulse | None:
    """Integral of a force (k,) [N] over t (k,) [s] from the start of a record to where its first
    wave has passed; None without a wave, or where the next one comes before that."""
    crests = peaks(force, HIGH * force.max(initial=0.0))
    if not crests:
        return None
    crest = crests[0]
    falling = force[crest : crests[1] if len(crests) > 1 else None]
    passed = np.flatnonzero(falling < GONE * force[crest])
    end = crest + int(passed[0] if passed.size else falling.argmin())
    if force[end] > PARTED * force[crest]:
        return None
    return Impulse(float(np.trapezoid(force[: end + 1], t[: end + 1])), float(t[end]), end + 1)
