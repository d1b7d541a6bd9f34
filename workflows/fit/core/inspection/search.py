"""The way of an inspection to its answer, around the local minima that waves have.

Structures are drawn all over the bounds and run against the beginning of one record, up to the
first wave that has felt them; the nearest are candidates. The record is then looked at farther and
farther: candidates that do not meet what is new are fitted anew, those that are left far behind are
dropped, and what the waves so far leave open is filled up again with draws from it,

    theta ~ N(theta_best, WIDER^2 (J^T J + B)^-1),   B of the bounds,

so that no valley of the later waves is missed for want of a candidate in it. A window in which even
the best is lost has grown too fast: it is tried again shorter, from more draws. A wall between
computed ones is computed anew between narrower bounds as soon as candidates leave the most of the
old ones. What is left at the end of the record is taken on to all records.
"""

from collections.abc import Sequence
from contextlib import suppress
from operator import attrgetter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from workflows.fit.core.calibration.fitting import rms
from workflows.fit.core.inspection.fitting import HUGE, Fitted, RecordFit
from workflows.fit.core.inspection.forward import IMPOSSIBLE, StructureForward

MISFIT = attrgetter("misfit")
RISE = 0.3  # of the largest signal: the first wave has come
COARSE = 2.0  # steps of the search, in those of the answer
PER_NUMBER = 5  # log2 of structures drawn: doubled for each number of the structure but the first
MOST_DRAWN = 8  # log2
SAMPLES = 1500  # of a record that a search looks at
ROUGH = 1e-3  # share of its misfit that a further step of a candidate must gain
FINE = 1e-5  # the same, of what is taken for a valley's ground
STEPS, LAST_STEPS = 6, 30  # of a candidate in a window, in the last
FELT = 30.0  # by which draws differ, over the noise, where waves have felt the structure
GROWTH = 1.12  # of the window
MET = 1.06  # squares over the noise's of what a candidate meets, and three deviations of them
FINEST = 0.01  # growth of a window
MANY = 8  # times as many draws for a window in which the best was lost
PATIENCE = 8  # such windows on the way along a record
BEHIND = 0.3, 200.0  # of the best sum of squares, and besides: what drops a candidate
WIDER = 1.5  # draws, in standard deviations
ALIKE, SPREAD = 0.005, 0.02  # of the bounds: two candidates that are one, that are apart
NARROWER = 0.05  # volume between bounds over the old one, at which walls are computed anew
REACH = 4.0  # of narrower bounds, standard deviations
NARROWINGS = 3  # at most
LEAST_WIDTH = 0.01  # of narrower bounds, in those given
TRIES = 3  # times that a record is followed
ENDS = 3  # candidates taken on to all records
HOPELESS = 1.5  # misfit over the best: an end that no better wall would make an answer


class Searched(NamedTuple):
    """The valleys that are left, the best first, and the model they were found with."""

    ends: tuple[Fitted, ...]
    starts: int  # candidates
    forward: StructureForward

    @property
    def fitted(self) -> Fitted:
        """The best."""
        return self.ends[0]


def rise(t: NDArray[np.float64], y: NDArray[np.float64]) -> float:
    """Time [s] at which the first of the signals y (k, m) has risen to its first wave."""
    share = np.abs(y - y[0]).max(axis=1) / np.abs(y - y[0]).max()
    i = max(int(np.argmax(share > RISE)), 1)
    return float(np.interp(RISE, share[i - 1 : i + 1], t[i - 1 : i + 1]))


def with_triggers(fit: RecordFit, theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """theta with triggers at which the first waves of model and records rise together."""
    low, high = fit.unknowns.ends()
    shown = fit.forward.signals(fit.unknowns, theta, fit.shots)
    found = theta.copy()
    for shot, model, i in zip(fit.shots, shown, fit.unknowns.trigger, strict=True):
        late = rise(shot.t, shot.y) - rise(shot.t, model)
        found[i] = np.clip(theta[i] + late, low[i], high[i])
    return found


def searched(fit: RecordFit, *, n_shared: int, starts: int, seed: int) -> Searched:
    """Where so many candidates end; a single one begins where the numbers start.

    They follow the loudest record, and the next, or others the same, where what they find does not
    meet all records.
    """
    rng = np.random.default_rng(seed)
    loudest = np.argsort([-np.abs(shot.y).max() for shot in fit.shots], kind="stable")
    tries, found = TRIES if starts > 1 else 1, []
    for i in range(tries):
        record, last = int(loudest[i % len(loudest)]), i == tries - 1
        one = _followed(fit, record, n_shared, starts, rng, to_the_end=last and not found)
        if one is None:
            continue
        found.append(one)
        if _meets(fit._replace(forward=one.forward), one.fitted.theta):
            break
    return min(found, key=lambda one: one.fitted.misfit)


def _followed(
    fit: RecordFit, record: int, n_shared: int, starts: int, rng, *, to_the_end: bool
) -> Searched | None:
    """Candidates along one record; None where they lose it before its end."""
    one = _of_one(fit, record)
    thetas, n = _nearest(one, n_shared, starts, rng)
    touch, end = _touch(one), one.data.shape[1]
    met, follows, narrowings = 0, False, NARROWINGS if fit.forward.within else 0
    kept, spread, lost = [], None, 0
    box = [ends[:n_shared] for ends in one.unknowns.ends()]
    while True:
        tried = _kept(one.until(n), met, thetas, n_shared, starts, n == end)
        meets = _meets(one.until(n), tried[0].theta, met)
        if follows and not meets and n - met > max(1, FINEST * (n - touch)) and lost < PATIENCE:
            thetas = _filled(one, kept, spread, MANY * starts, rng)
            n, lost = met + (n - met) // 2, lost + 1
            continue
        if follows and not meets and not to_the_end and n < end:
            return None
        if n == end:
            return Searched(_ends(fit, tried, n_shared), starts, fit.forward)
        kept, follows = tried, meets
        spread = _spread(one.until(n), kept[0].theta)
        inner = _inner(one, kept, spread, n_shared)
        if narrowings and _volume(inner) < NARROWER * _volume(box):
            box, narrowings = inner, narrowings - 1
            fit = fit._replace(forward=fit.forward.narrowed(*box))
            one = _of_one(fit, record)
        thetas = _filled(one, kept, spread, starts, rng)
        met, n = n, min(end, touch + int(np.ceil(GROWTH * (n - touch))))


def _of_one(fit: RecordFit, record: int) -> RecordFit:
    """One record, thinned, by long steps."""
    every = max(1, len(fit.shots[0].t) // SAMPLES)
    return fit.of_shots([record], every)._replace(forward=fit.forward.with_steps(COARSE))


def _touch(one: RecordFit) -> int:
    """Samples of the record before the first touch."""
    trigger = one.unknowns.parameters[one.unknowns.trigger[0]].start
    return int(np.searchsorted(one.shots[0].t, trigger))


def _nearest(
    one: RecordFit, n_shared: int, starts: int, rng
) -> tuple[list[NDArray[np.float64]], int]:
    """The draws nearest to the beginning of the record, and its samples."""
    first = np.array([p.start for p in one.unknowns.parameters])
    drawn, models = [], []
    for theta in _drawn(one, first, n_shared, rng) if starts > 1 else first[None]:
        with suppress(*IMPOSSIBLE):
            models.append(one.forward.signals(one.unknowns, theta, one.shots))
            drawn.append(theta)
    shown = one.gains(models[0]) * np.array(models) * one.weight
    felt = np.cumsum(shown.var(axis=0).sum(axis=(0, 2))) > FELT**2
    n = int(felt.argmax()) + 1 if felt.any() else len(felt)
    window = one.until(n)
    off = [np.sum(window.off(model[:, :n]) ** 2) for model in models]
    return [drawn[i] for i in np.argsort(off, kind="stable")[:starts]], n


def _kept(
    window: RecordFit, met: int, thetas: Sequence, n_shared: int, starts: int, last: bool
) -> list[Fitted]:
    """Candidates of the window that are not far behind nor one another's double, best first.

    The nearest of those that do not meet the window and what is new in it are fitted anew; of a
    crowd those that are apart, so that they are not all of one valley.
    """
    ends: dict[bool, list[Fitted]] = {True: [], False: []}
    for theta in thetas:
        left = _left(window, theta)
        meets = not last and _noise(left, met, window.rounded)
        ends[meets].append(Fitted(theta, rms(left), 1, meets))
    crowd = len(thetas) > starts
    near = sorted(ends[False], key=MISFIT)
    near = _distinct(window, near, n_shared, SPREAD)[:starts] if crowd else near[: starts // 2 + 1]
    found = sorted([*ends[True], *(_anew(window, end, last) for end in near)], key=MISFIT)
    if found[0].converged:
        found[0] = _anew(window, found[0], last)
    share, besides = BEHIND
    most = np.sqrt((1.0 + share) * found[0].misfit ** 2 + besides / window.data.size)
    return _distinct(window, [end for end in found if end.misfit <= most], n_shared)


def _anew(window: RecordFit, end: Fitted, last: bool) -> Fitted:
    """A candidate fitted to the window, to its ground where that is the last."""
    most, tolerance = (LAST_STEPS, FINE) if last else (STEPS, ROUGH)
    with suppress(*IMPOSSIBLE):
        if end.misfit < HUGE:
            return window.solved(end.theta, most=most, tolerance=tolerance, about=end.theta)
    return end


def _distinct(
    fit: RecordFit, ends: Sequence[Fitted], n_shared: int, least: float = ALIKE
) -> list[Fitted]:
    """Those that are no double of one before, by their least distance in widths of the bounds."""
    low, high = fit.unknowns.ends()
    found: list[Fitted] = []
    for end in ends:
        apart = [np.abs((end.theta - one.theta) / (high - low))[:n_shared].max() for one in found]
        if min(apart, default=1.0) > least:
            found.append(end)
    return found


def _left(fit: RecordFit, theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """(S, k, m) residual."""
    return fit.residual(theta).reshape(fit.data.shape)


def _meets(fit: RecordFit, theta: NDArray[np.float64], met: int = 0) -> bool:
    """Whether what theta leaves is noise."""
    return _noise(_left(fit, theta), met, fit.rounded)


def _noise(left: NDArray[np.float64], met: int, rounded: float = 0.0) -> bool:
    """Whether the whole and what is new in it are noise, whose rms is known to a few per cent."""
    return all(
        np.mean(part**2) <= MET + rounded + 3.0 * np.sqrt(2.0 / part.size)
        for part in (left, left[:, met:])
    )


def _spread(window: RecordFit, theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """(p, p) that makes of normal numbers what the window leaves open, 0 of other records'."""
    J, B = window.jacobian(theta), (window.unknowns.pull * window.unknowns.scale) ** 2
    values, vectors = np.linalg.eigh(J.T @ J + np.diag(np.maximum(B, 1e-12)))
    looked_at = J.any(axis=0) | np.isin(np.arange(len(B)), window.unknowns.of_system)
    return looked_at[:, None] * vectors / np.sqrt(values) * window.unknowns.scale[:, None]


def _inner(one: RecordFit, kept: Sequence[Fitted], spread, n_shared: int):
    """Ends (p_shared,) of bounds that hold the candidates and what is left open."""
    low, high = (end[:n_shared] for end in one.unknowns.ends())
    there = np.array([end.theta[:n_shared] for end in kept])
    reach = REACH * np.linalg.norm(spread[:n_shared], axis=1)
    reach = np.maximum(reach, 0.5 * LEAST_WIDTH * (high - low))
    ends = (there - reach).min(axis=0), (there + reach).max(axis=0)
    return np.maximum(low, ends[0]), np.minimum(high, ends[1])


def _volume(box) -> float:
    low, high = box
    return float(np.prod(high - low))


def _filled(one: RecordFit, kept: Sequence[Fitted], spread, starts: int, rng) -> list:
    """The candidates, and draws of what is left open until they are as many as the starts."""
    thetas = [end.theta for end in kept]
    low, high = one.unknowns.ends()
    for i in range(4 * (starts - len(kept))):
        theta = thetas[i % len(kept)] + WIDER * spread @ rng.standard_normal(len(spread))
        if ((theta >= low) & (theta <= high)).all() and len(thetas) < starts:
            thetas.append(theta)
    return thetas


def _ends(fit: RecordFit, kept: Sequence[Fitted], n_shared: int) -> tuple[Fitted, ...]:
    """The best candidates taken on to all records, with the triggers that the others need."""
    begins = (with_triggers(fit, end.theta) for end in kept[:ENDS])
    ends = sorted((fit.solved(theta, tolerance=FINE) for theta in begins), key=MISFIT)
    near = [end for end in ends if end.misfit <= HOPELESS * ends[0].misfit]
    return tuple(_distinct(fit, near, n_shared))


def _drawn(fit: RecordFit, first, n_shared: int, rng) -> NDArray[np.float64]:
    """(n, p) numbers of the structure all over their bounds, the others as they start."""
    low, high = (end[:n_shared] for end in fit.unknowns.ends())
    power = min(PER_NUMBER + n_shared - 1, MOST_DRAWN)
    unit = qmc.Sobol(n_shared, rng=rng).random_base2(power)
    found = np.tile(first, (len(unit) + 1, 1))
    found[1:, :n_shared] = low + (high - low) * unit
    return found
