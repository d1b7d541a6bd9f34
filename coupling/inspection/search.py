"""The way of an inspection to its answer, around the local minima that waves have.

Structures are drawn all over the bounds and run against one record; those whose running sums come
nearest are starts. Each is fitted by its running sums, then by the signals; those that leave no
more than the noise are taken on to all records, until one leaves no more there either.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from coupling.inspection.fitting import Fit, Fitted
from coupling.inspection.forward import IMPOSSIBLE

RISE = 0.3  # of the largest signal: the first wave has come
COARSE = 2.0  # steps of the search, in those of the answer
PER_NUMBER = 5  # log2 of structures drawn: doubled for each number of the structure but the first
MOST_DRAWN = 8  # log2
EXPLAINED = 1.1  # misfit over noise at which no further start is needed
SAME = 1.01  # misfits that two starts share
SAMPLES = 1500  # of a record that a search looks at
ROUGH = 1e-4


class Searched(NamedTuple):
    """The answer, and how it was found."""

    fitted: Fitted
    starts: int  # that were fitted
    same: int  # of these that ended alike
    drawn: NDArray[np.float64]  # (n, p_shared) structures run before
    misfits: NDArray[np.float64]  # (n,) of their running sums, over the noise


def rise(t: NDArray[np.float64], y: NDArray[np.float64]) -> float:
    """Time [s] at which the first of the signals y (k, m) has risen to its first wave."""
    share = np.abs(y - y[0]).max(axis=1) / np.abs(y - y[0]).max()
    i = max(int(np.argmax(share > RISE)), 1)
    return float(np.interp(RISE, share[i - 1 : i + 1], t[i - 1 : i + 1]))


def with_triggers(fit: Fit, theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """theta with triggers at which the first waves of model and records rise together."""
    low, high = fit.unknowns.ends()
    shown = fit.forward.signals(fit.unknowns, theta, fit.shots)
    found = theta.copy()
    for shot, model, i in zip(fit.shots, shown, fit.unknowns.trigger, strict=True):
        late = rise(shot.t, shot.y) - rise(shot.t, model)
        found[i] = np.clip(theta[i] + late, low[i], high[i])
    return found


def searched(fit: Fit, *, n_shared: int, starts: int, seed: int) -> Searched:
    """The least misfit that up to so many starts find; the first is where the numbers start."""
    first = np.array([p.start for p in fit.unknowns.parameters])
    every = max(1, len(fit.shots[0].t) // SAMPLES)
    coarse = fit.of_shots([0], every)._replace(forward=fit.forward.with_steps(COARSE))
    begins = _drawn(fit, first, n_shared, seed) if starts > 1 else first[None]
    summed = coarse._replace(summed=True)
    begins, misfits = zip(*(_begun(summed, theta) for theta in begins), strict=True)
    singles, ends = [], []
    for i in np.argsort(misfits, kind="stable")[:starts]:
        near = summed.solved(begins[i], most=12, tolerance=ROUGH)
        singles.append(coarse.solved(near.theta, most=30, tolerance=ROUGH))
        if singles[-1].misfit <= EXPLAINED:
            ends.append(_of_all(fit, singles[-1]))
            if ends[-1].misfit <= EXPLAINED:
                break
    best = min(singles, key=lambda end: end.misfit)
    ends = ends or [_of_all(fit, best)]
    same = sum(end.misfit <= SAME * best.misfit for end in singles)
    found = min(ends, key=lambda end: end.misfit)
    return Searched(found, len(singles), same, np.array(begins)[:, :n_shared], np.array(misfits))


def _of_all(fit: Fit, single: Fitted) -> Fitted:
    """What one record has found taken on to all, with the triggers that the others need."""
    return fit.solved(with_triggers(fit, single.theta))


def _begun(fit: Fit, theta: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Numbers with the triggers they need and their misfit, infinite where no run is possible."""
    try:
        theta = with_triggers(fit, theta)
        return theta, fit.misfit(theta)
    except IMPOSSIBLE:
        return theta, np.inf


def _drawn(fit: Fit, first, n_shared: int, seed: int) -> NDArray[np.float64]:
    """(n, p) numbers of the structure all over their bounds, the others as they start."""
    low, high = (end[:n_shared] for end in fit.unknowns.ends())
    power = min(PER_NUMBER + n_shared - 1, MOST_DRAWN)
    unit = qmc.Sobol(n_shared, rng=np.random.default_rng(seed)).random_base2(power)
    found = np.tile(first, (len(unit) + 1, 1))
    found[1:, :n_shared] = low + (high - low) * unit
    return found
