"""The misfit over the frequency of a wall of one mass, as the thesis found its 240 Hz."""

from typing import NamedTuple

import numpy as np

from coupling.fitting import Fit

IMPOSSIBLE = 10.0  # misfit over the fastest sphere of a run that cannot be


class Scan(NamedTuple):
    """Misfit [m/s] over one parameter, the others held."""

    name: str
    value: np.ndarray
    misfit: np.ndarray


def scanned(
    fit: Fit, z: np.ndarray, low: float, high: float, points: int
) -> tuple[np.ndarray, Scan]:
    """z with the frequency [Hz] of the least misfit of all waves, and the misfits of those tried
    that a run is possible with."""
    where = next(i for i, p in enumerate(fit.parameters) if p.kind == "frequency")
    everything = np.ones_like(fit.data, bool)
    value = np.geomspace(low, high, points)
    tried = np.tile(z, (points, 1))
    tried[:, where] = np.log(value) / fit.parameters[where].relative
    misfit = np.array([fit.misfit(one, everything) for one in tried])
    possible = misfit < IMPOSSIBLE * fit.largest
    found = Scan(fit.parameters[where].name, value[possible], misfit[possible])
    return tried[misfit.argmin()], found
