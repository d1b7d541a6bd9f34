"""The search of an inspection for the valleys of its misfit, around the local minima of waves.

Structures are drawn all over the bounds and compared with the beginning of one record, up to the
first wave that has felt them; the nearest are the candidates. The window then grows along the
record: candidates that do not explain its new samples are fitted again, those that fall far behind
are dropped, and the set is filled up again with draws from what the window leaves open,

    theta ~ N(theta_best, wider^2 (J^T J + B)^-1),   B the precision that the bounds give,

so that no valley of the later waves is missed for want of a candidate in it. A window in which even
the best candidate is lost has grown too fast: it is tried again shorter, from more draws. A wall
between computed ones is computed anew between narrower bounds as soon as the candidates leave most
of the old ones. The candidates that are left at the end of the record are fitted to all records.
"""

from collections.abc import Sequence
from contextlib import suppress
from operator import attrgetter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from beadwave.workflows.fit.aligned_signals import rise
from beadwave.workflows.fit.forward import StructureForward
from beadwave.workflows.fit.least_squares import HUGE, IMPOSSIBLE, RecordFit, Solution, rms

MISFIT = attrgetter("misfit")


# Numbers of the search; none was varied systematically unless its comment says so. Misfits and
# residuals are over the noise.
# the first draws
LOG2_DRAWS = 5  # Sobol points for one number of the structure, doubled for each further
MAX_LOG2_DRAWS = 8  # largest such power: 256 runs of the model
FELT_SPREAD = 30.0  # spread of the draws' signals above which a wave has felt the structure

# the record that is followed
N_SAMPLES = 1500  # a longer record is thinned to about as many
STEP_FACTOR = 2.0  # time step of the search over that of the answer
MAX_TRIES = 3  # records followed until what is found explains all of them

# windows
WINDOW_GROWTH = 1.12  # length of a window, from the first touch on, over the last one's
FINEST_GROWTH = 0.01  # share of a window below which it is not made shorter again
PATIENCE = 8  # windows tried again shorter, along one record
MORE_DRAWS = 8  # times as many draws for a window in which the best candidate was lost
WIDER = 1.5  # standard deviation of the draws over that of the covariance

# fits of a candidate to a window
N_STEPS = 6  # Gauss-Newton steps, but in the last window
N_LAST_STEPS = 30  # the same in the last one
ROUGH_FALL = 1e-3  # relative fall of the misfit below which such a fit ends
FINE_FALL = 1e-5  # the same for the bottom of a valley: in the last window and of all records

# which candidates are kept
NOISE_SQUARE = 1.06  # mean square of a residual that is noise, whose rms is known to 3 %
BEHIND = 0.3  # excess over the best sum of squares at which a candidate is dropped ...
BEHIND_SQUARES = 200.0  # ... in addition to so many squares of the noise
SAME_DISTANCE = 0.005  # distance, in widths of the bounds, below which two candidates are one
SPREAD_DISTANCE = 0.02  # the same, to thin a crowd that is not to be all of one valley

# walls computed anew between narrower bounds
MAX_NARROWINGS = 3  # at most
NARROWER = 0.05  # volume between the new bounds over that between the old ones
BOUNDS_REACH = 4.0  # standard deviations that the new bounds leave to the candidates
MIN_WIDTH = 0.01  # of the new bounds over the given ones

# the end
N_ENDS = 3  # candidates fitted to all records
HOPELESS_MISFIT = 1.5  # misfit over the best of an end that no better wall would make an answer


class SearchResult(NamedTuple):
    """The valleys that are left, the best first, and the model that they were found with."""

    ends: tuple[Solution, ...]
    starts: int  # candidates that were followed
    forward: StructureForward

    @property
    def fitted(self) -> Solution:
        """The best."""
        return self.ends[0]


def with_triggers(fit: RecordFit, theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """theta (p,) with triggers at which the first waves of model and records rise together."""
    low, high = fit.unknowns.ends()
    signals = fit.forward.signals(fit.unknowns, theta, fit.shots)
    theta_new = theta.copy()
    for shot, model, i in zip(fit.shots, signals, fit.unknowns.trigger, strict=True):
        lag = rise(shot.t, shot.y) - rise(shot.t, model)
        theta_new[i] = np.clip(theta[i] + lag, low[i], high[i])
    return theta_new


def searched(fit: RecordFit, *, n_shared: int, starts: int, seed: int) -> SearchResult:
    """Ends of `starts` candidates; a single one begins at the start values.

    The first n_shared numbers of theta are those of the structure. The loudest record is followed
    first, and the next one, or the same from other draws, where the result does not explain all
    records.
    """
    rng = np.random.default_rng(seed)
    by_loudness = np.argsort([-np.abs(shot.y).max() for shot in fit.shots], kind="stable")
    tries = MAX_TRIES if starts > 1 else 1
    results: list[SearchResult] = []
    for i in range(tries):
        record, last_try = int(by_loudness[i % len(by_loudness)]), i == tries - 1
        result = along_record(
            fit, record, n_shared, starts, rng, to_the_end=last_try and not results
        )
        if result is None:
            continue
        results.append(result)
        if _explains(fit._replace(forward=result.forward), result.fitted.point, 0):
            break
    return min(results, key=lambda result: result.fitted.misfit)


def structures_within(
    record_fit: RecordFit,
    n_shared: int,
    starts: int,
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """Structures all over their bounds by Sobol's sequence, all else as it starts, (draws, p); the
    start itself is the first, and the only one of a single start."""
    low, high = (end[:n_shared] for end in record_fit.unknowns.ends())
    start = np.array([p.start for p in record_fit.unknowns.parameters])
    draws = start[None]
    if starts > 1:
        power = min(LOG2_DRAWS + n_shared - 1, MAX_LOG2_DRAWS)
        unit = qmc.Sobol(n_shared, rng=rng).random_base2(power)
        draws = np.tile(start, (len(unit) + 1, 1))
        draws[1:, :n_shared] = low + (high - low) * unit
    return draws


def along_record(
    fit: RecordFit,
    record: int,
    n_shared: int,
    starts: int,
    rng: np.random.Generator,
    *,
    to_the_end: bool,
) -> SearchResult | None:
    """Candidates followed along one record in growing windows, then fitted to all records; None
    where they lose the record before its end, unless they are to go on `to_the_end`."""
    record_fit = _one_record(fit, record)
    n_samples = record_fit.data.shape[1]
    trigger = record_fit.unknowns.parameters[record_fit.unknowns.trigger[0]].start
    touch = int(np.searchsorted(record_fit.shots[0].t, trigger))  # samples before the first touch
    low, high = (end[:n_shared] for end in record_fit.unknowns.ends())

    draws = structures_within(record_fit, n_shared, starts, rng)
    possible, models = [], []
    for theta in draws:
        with suppress(*IMPOSSIBLE):
            models.append(record_fit.forward.signals(record_fit.unknowns, theta, record_fit.shots))
            possible.append(theta)

    # the first window ends where the draws differ: before, no wave has felt the structure
    weighted = record_fit.gains(models[0]) * np.array(models) * record_fit.weight
    felt = np.cumsum(weighted.var(axis=0).sum(axis=(0, 2))) > FELT_SPREAD**2
    n = int(felt.argmax()) + 1 if felt.any() else len(felt)
    first_window = record_fit.until(n)
    squares = [np.sum(first_window.off(model[:, :n]) ** 2) for model in models]
    thetas = [possible[i] for i in np.argsort(squares, kind="stable")[:starts]]

    candidates: list[Solution] = []
    root, box = None, (low, high)
    n_explained, on_track = 0, False  # samples of the last window, and whether it was explained
    retries, narrowings = 0, MAX_NARROWINGS if fit.forward.within else 0
    while True:
        window, is_last = record_fit.until(n), n == n_samples

        # candidates that explain the window need no fit, unless it is the last one
        explaining, others = [], []
        for theta in thetas:
            residual = window.residual(theta).reshape(window.data.shape)
            explains = not is_last and is_noise(residual, n_explained, window.rounded)
            # one that explains the window counts as converged: it is not fitted
            candidate = Solution(theta, rms(residual), 1, explains)
            (explaining if explains else others).append(candidate)

        # of the others the nearest are fitted; of a crowd those that are apart from each other,
        # so that they are not all of one valley
        others.sort(key=MISFIT)
        if len(thetas) > starts:
            others = distinct(window, others, n_shared, SPREAD_DISTANCE)[:starts]
        else:
            others = others[: starts // 2 + 1]
        refitted = [_refitted(window, candidate, is_last) for candidate in others]
        ends = sorted([*explaining, *refitted], key=MISFIT)
        if ends[0].converged:
            ends[0] = _refitted(window, ends[0], is_last)
        besides = BEHIND_SQUARES / window.data.size
        largest = np.sqrt((1.0 + BEHIND) * ends[0].misfit ** 2 + besides)
        ends = distinct(
            window, [end for end in ends if end.misfit <= largest], n_shared, SAME_DISTANCE
        )
        explained = _explains(window, ends[0].point, n_explained)

        # the best does not explain the window: it has grown too fast. Take half of the new samples,
        # and more draws from what the last window leaves open
        too_long = n - n_explained > max(1, FINEST_GROWTH * (n - touch))
        if on_track and not explained and too_long and retries < PATIENCE:
            thetas = with_draws(record_fit, candidates, root, MORE_DRAWS * starts, rng)
            n, retries = n_explained + (n - n_explained) // 2, retries + 1
            continue
        if on_track and not explained and not to_the_end and not is_last:
            return None
        if is_last:
            break

        # what the window leaves open, and walls between narrower bounds where it is little
        candidates, on_track = ends, explained
        root = posterior_root(window, candidates[0].point)
        inner = narrower_bounds(record_fit, candidates, root, n_shared)
        volume, volume_now = (float(np.prod(b[1] - b[0])) for b in (inner, box))
        if narrowings and volume < NARROWER * volume_now:
            box, narrowings = inner, narrowings - 1
            fit = fit._replace(forward=fit.forward.narrowed(*box))
            record_fit = _one_record(fit, record)
        thetas = with_draws(record_fit, candidates, root, starts, rng)
        n_explained, n = n, min(n_samples, touch + int(np.ceil(WINDOW_GROWTH * (n - touch))))

    # the best candidates to all records, with the triggers that the others need
    begins = [with_triggers(fit, end.point) for end in ends[:N_ENDS]]
    ends = sorted((fit.solved(theta, tolerance=FINE_FALL) for theta in begins), key=MISFIT)
    hopeful = [end for end in ends if end.misfit <= HOPELESS_MISFIT * ends[0].misfit]
    return SearchResult(tuple(distinct(fit, hopeful, n_shared, SAME_DISTANCE)), starts, fit.forward)


def _one_record(fit: RecordFit, record: int) -> RecordFit:
    """One record, thinned, and the model by longer time steps."""
    stride = max(1, len(fit.shots[0].t) // N_SAMPLES)
    forward = fit.forward.with_steps(STEP_FACTOR)
    return fit.of_shots([record], stride)._replace(forward=forward)


def _refitted(window: RecordFit, end: Solution, is_last: bool) -> Solution:
    """A candidate fitted to the window, to the bottom of its valley where that is the last; as it
    was where its model cannot run."""
    steps = N_LAST_STEPS if is_last else N_STEPS
    tolerance = FINE_FALL if is_last else ROUGH_FALL
    with suppress(*IMPOSSIBLE):
        if end.misfit < HUGE:
            return window.solved(end.point, max_runs=steps, tolerance=tolerance, about=end.point)
    return end


def distinct(
    fit: RecordFit, ends: Sequence[Solution], n_shared: int, distance: float
) -> list[Solution]:
    """Those that are no double of one before them: farther off than the distance, in widths of the
    bounds, in at least one number of the structure."""
    low, high = fit.unknowns.ends()
    chosen: list[Solution] = []
    for end in ends:
        distances = [np.abs((end.point - c.point) / (high - low))[:n_shared].max() for c in chosen]
        if min(distances, default=1.0) > distance:
            chosen.append(end)
    return chosen


def _explains(fit: RecordFit, theta: NDArray[np.float64], n_explained: int) -> bool:
    """True if the residual at theta (p,) is noise."""
    residual = fit.residual(theta).reshape(fit.data.shape)
    return is_noise(residual, n_explained, fit.rounded)


def is_noise(
    residual: NDArray[np.float64],
    n_explained: int,
    rounded: float = 0.0,
) -> bool:
    """True if a residual (S, k, m), and its samples after the first n_explained, are noise.

    Mean squares may exceed 1 by what the rms of the noise is uncertain, by what rounding may add,
    and by three standard deviations sqrt(2 / n) of the mean of n squares.
    """
    return all(
        np.mean(r**2) <= NOISE_SQUARE + rounded + 3.0 * np.sqrt(2.0 / r.size)
        for r in (residual, residual[:, n_explained:])
    )


def posterior_root(window: RecordFit, theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """L (p, p) with covariance L L^T = (J^T J + B)^-1 of theta (p,) by the samples of a window and
    by the bounds; rows of numbers of other records are 0."""
    J, B = window.jacobian(theta), (window.unknowns.pull * window.unknowns.scale) ** 2
    values, vectors = np.linalg.eigh(J.T @ J + np.diag(np.maximum(B, 1e-12)))
    concerned = J.any(axis=0) | np.isin(np.arange(len(B)), window.unknowns.of_system)
    return concerned[:, None] * vectors / np.sqrt(values) * window.unknowns.scale[:, None]


def narrower_bounds(
    fit: RecordFit,
    candidates: Sequence[Solution],
    root: NDArray[np.float64],
    n_shared: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lower and upper bounds (n_shared,) that hold the candidates and what is left open around
    them; root (p, p) is that of the covariance."""
    low, high = (end[:n_shared] for end in fit.unknowns.ends())
    thetas = np.array([end.point[:n_shared] for end in candidates])
    reach = BOUNDS_REACH * np.linalg.norm(root[:n_shared], axis=1)
    reach = np.maximum(reach, 0.5 * MIN_WIDTH * (high - low))
    lower, upper = (thetas - reach).min(axis=0), (thetas + reach).max(axis=0)
    return np.maximum(low, lower), np.minimum(high, upper)


def with_draws(
    fit: RecordFit,
    candidates: Sequence[Solution],
    root: NDArray[np.float64],
    count: int,
    rng: np.random.Generator,
) -> list[NDArray[np.float64]]:
    """theta (p,) of the candidates, and draws around them in turn until they are `count`; draws
    beyond the bounds are thrown away, at most four times as many as are wanted are made."""
    thetas = [end.point for end in candidates]
    low, high = fit.unknowns.ends()
    for i in range(4 * (count - len(candidates))):
        theta = thetas[i % len(candidates)] + WIDER * root @ rng.standard_normal(len(root))
        if ((theta >= low) & (theta <= high)).all() and len(thetas) < count:
            thetas.append(theta)
    return thetas
