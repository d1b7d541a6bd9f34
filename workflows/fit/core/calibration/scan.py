"""The misfit over the frequency of a wall of one mass, as the thesis found its 240 Hz."""

from typing import NamedTuple

import numpy as np

from workflows.fit.core.calibration.fitting import WindowFit

VALLEYS = 4  # of the misfit, tried with the rest of the wall free
IMPOSSIBLE = 10.0  # misfit over the fastest sphere of a run that cannot be


class Scan(NamedTuple):
    """Misfit [m/s] over one parameter, the others held."""

    name: str
    value: np.ndarray
    misfit: np.ndarray


def scanned(
    fit: WindowFit, z: np.ndarray, low: float, high: float, points: int
) -> tuple[list[np.ndarray], Scan]:
    """z with the frequencies [Hz] of the least misfits of all waves, the best first, and all
    misfits, of those tried that a run is possible with."""
    where = next(i for i, p in enumerate(fit.parameters) if p.kind == "frequency")
    everything = np.ones_like(fit.data, bool)
    value = np.geomspace(low, high, points)
    tried = np.tile(z, (points, 1))
    tried[:, where] = np.log(value) / fit.parameters[where].relative
    misfit = np.array([fit.misfit(one, everything) for one in tried])
    possible = misfit < IMPOSSIBLE * fit.largest
    found = Scan(fit.parameters[where].name, value[possible], misfit[possible])
    return [tried[possible][i] for i in _minima(found.misfit)[:VALLEYS]], found


def _minima(misfit: np.ndarray) -> np.ndarray:
    """Indices of values below both neighbours, the least first."""
    beside = np.concatenate([[np.inf], misfit, [np.inf]])
    low = np.flatnonzero((misfit <= beside[:-2]) & (misfit <= beside[2:]))
    return low[np.argsort(misfit[low])]
