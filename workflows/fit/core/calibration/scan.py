"""The misfit over the frequency of a wall of one mass, as the thesis found its 240 Hz."""

from typing import NamedTuple

import numpy as np

from workflows.fit.core.calibration.fitting import WindowFit

VALLEYS = 4  # minima of the misfit from which on the rest of the wall is fitted, at most
IMPOSSIBLE = 10.0  # misfit over the fastest sphere that only an impossible run has


class Scan(NamedTuple):
    """Misfit [m/s] over one parameter, the others fixed."""

    name: str
    value: np.ndarray
    misfit: np.ndarray


def scanned(
    fit: WindowFit, z: np.ndarray, low: float, high: float, points: int
) -> tuple[list[np.ndarray], Scan]:
    """z (p,) with the frequencies [Hz] of the least misfits of all waves, the best first, and the
    misfits of all frequencies at which a run is possible."""
    place = next(i for i, p in enumerate(fit.parameters) if p.kind == "frequency")
    everything = np.ones_like(fit.data, bool)
    frequencies = np.geomspace(low, high, points)
    trials = np.tile(z, (points, 1))
    trials[:, place] = np.log(frequencies) / fit.parameters[place].relative
    misfit = np.array([fit.misfit(trial, everything) for trial in trials])
    possible = misfit < IMPOSSIBLE * fit.largest
    scan = Scan(fit.parameters[place].name, frequencies[possible], misfit[possible])
    return [trials[possible][i] for i in local_minima(scan.misfit)[:VALLEYS]], scan


def local_minima(misfit: np.ndarray) -> np.ndarray:
    """Indices of values that neither neighbour is below, the least first."""
    padded = np.concatenate([[np.inf], misfit, [np.inf]])
    minima = np.flatnonzero((misfit <= padded[:-2]) & (misfit <= padded[2:]))
    return minima[np.argsort(misfit[minima])]
