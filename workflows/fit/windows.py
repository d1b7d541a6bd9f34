"""The search of a calibration: stages from the first waves to all, in windows that grow.

As the thesis does (section 7.3), waves that do not depend on the wall come first, for the chain;
then the rest, for the wall; at last all together. A start whose chain leaves more than the noise in
the first waves has ended in a wrong valley: it is given up for another, scattered around the first,
until one explains the data or several have ended alike. The search runs on a coarse model; each
stage ends with a fit on the fine one.

A wave is fitted before those that it has changed. Contacts between the same two measured spheres
can be swapped at little cost in misfit, so that a fit may end with some in each other's place: the
best swaps of two, and cycles of three, are tried and kept where the misfit falls. The frequency of
a wall of one mass is scanned, as the thesis found its 240 Hz.
"""

from collections.abc import Callable, Sequence
from time import perf_counter
from typing import NamedTuple

import numpy as np

from beadwave.workflows.fit.aligned_signals import first_waves_end
from beadwave.workflows.fit.least_squares import Solution, WindowFit, rms
from beadwave.workflows.fit.parameter import Parameter

# Trial swaps of contacts; not varied systematically
N_SWAPS_TRIED = 6  # swaps that are fitted in a round, those of the least guessed misfit
SWAP_ROUNDS = 5
WORSE_GUESS = 2.0  # guessed misfit, over that of now, above which a swap is not fitted
BETTER_SWAP = 0.97  # misfit of a swap, over that of now, that counts as progress
ACCEPTED_AT_ONCE = 0.5  # the same, at which the other swaps of the round are not fitted any more


class GrowingWindows:
    """Fits of one problem; `budget` counts down the model runs that swaps may still take, and
    `enough` is the misfit [m/s] of so many samples that needs no further search."""

    def __init__(
        self,
        fit: WindowFit,
        enough: Callable[[int], float],
        budget: int,
    ) -> None:
        self.fit, self.enough, self.budget = fit, enough, budget
        self.tried: list[Solution] = []  # every swap that was fitted

    def on_windows(
        self, z: np.ndarray, free: np.ndarray, windows: Sequence[np.ndarray], goal: float
    ) -> tuple[np.ndarray, float, int]:
        """z (p,), misfit [m/s] in the last window and model runs of a fit that goes on from window
        (k, m) to window; swaps contacts where a window leaves more than `enough` and the goal
        [m/s]."""
        runs = 0
        for i, window in enumerate(windows):
            # all but the last: contacts that no wave has reached are held by a weak spring
            prior = i < len(windows) - 1
            step = self.fit.solved(z, free, window, max_runs=8, prior=prior, tolerance=1e-4)
            enough = max(goal, self.enough(int(window.sum())))
            best, swap_runs = self.swapped(step, free, window, enough, prior=prior)
            runs += step.evaluations + swap_runs
            z = best.point
        return z, best.misfit, runs

    def swapped(
        self,
        best: Solution,
        free: np.ndarray,
        window: np.ndarray,
        enough: float,
        *,
        prior: bool = False,
        rounds: int | None = None,
    ) -> tuple[Solution, int]:
        """The best of a fit and of those with contacts swapped, as long as that helps, and the
        model runs: two at a time, then cycles of three, then two again."""
        runs, cycles = 0, False
        for _ in range(SWAP_ROUNDS if rounds is None else rounds):
            if best.misfit <= enough or self.budget <= 0:
                break

            # the most promising swaps to first order, each fitted
            guesses = self.fit.swapped(best.point, free, window, cycles=cycles)
            trial, swap_runs = best, len(guesses)
            for guess, z in guesses[:N_SWAPS_TRIED]:
                if guess > WORSE_GUESS * best.misfit:
                    break
                swap = self.fit.solved(z, free, window, max_runs=8, prior=prior, tolerance=1e-4)
                swap_runs += swap.evaluations
                self.tried.append(swap)
                trial = min(trial, swap, key=lambda solution: solution.misfit)
                if trial.misfit < ACCEPTED_AT_ONCE * best.misfit:
                    break
            runs += swap_runs
            self.budget -= swap_runs

            progress = trial.misfit < BETTER_SWAP * best.misfit
            best = min(best, trial, key=lambda solution: solution.misfit)
            if not progress and cycles:
                break
            cycles = not progress
        return best, runs


IMPOSSIBLE = 10.0  # misfit over the fastest sphere that only an impossible run has


class Scan(NamedTuple):
    """Misfit [m/s] over one parameter, the others fixed."""

    name: str
    value: np.ndarray  # (k,) [Hz] of a frequency, at those of the points where a run is possible
    misfit: np.ndarray  # (k,)


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
    # the rest of the wall is fitted from 4 minima of the misfit on, at most
    return [trials[possible][i] for i in local_minima(scan.misfit)[:4]], scan


def local_minima(misfit: np.ndarray) -> np.ndarray:
    """Indices of values that neither neighbour is below, the least first."""
    padded = np.concatenate([[np.inf], misfit, [np.inf]])
    minima = np.flatnonzero((misfit <= padded[:-2]) & (misfit <= padded[2:]))
    return minima[np.argsort(misfit[minima])]


class Options(NamedTuple):
    """Choices of a caller: waves of the chain first or all at once; `joint` frees all parameters at
    the end, else the chain stays as the first waves gave it. Further starts are drawn around the
    first."""

    staged: bool = True
    joint: bool = True
    starts: int = 12
    seed: int = 0
    local: bool = False  # only from the start on, for repeats of a fit that has been found
    scan: tuple[float, float, int] | None = None  # of the wall's frequency [Hz]: low, high, points
    noise: float | None = None  # rms [m/s] in the mean signals: a misfit that cannot be bettered


# Tuned numbers of the search; not varied systematically. Velocities are over that of the fastest
# sphere.
# the coarse model and its windows
COARSE_STEPS = (5.0, 2.5)  # time steps in usual ones, the first that will do
COVERED_ERROR = 0.1  # rms error of large steps, over the noise, that will do
N_WINDOWS = 8  # that grow to the end of the first waves, or of the record
WINDOW_LEAD = 2.0  # contact time scales before the first touch at which windows begin

# starts
START_SCATTER = 0.5  # standard deviation of a further start around the first, in scales
SWAP_RUNS = 600  # of the model that a start may put into swaps of contacts
LAST_SWAP_RUNS = 3000  # the same for the best of starts of which none explains the data

# misfits at which a search goes on or ends
EXACT_MISFIT = 1e-5  # a misfit that needs no further search, even without noise
N_CORRELATED = 5.0  # samples over which noise is correlated, at most
EXPLAINED_SIGMAS = 1.5  # sigmas above the noise at which the data are explained
REFINABLE_MISFIT = 1e-4  # misfit of the first waves that the last stage can still better
ALMOST_MISFIT = 1.02  # misfit of first waves over the noise, of a chain worth the others
NEAR_NOISE_MISFIT = 1.5  # misfit over the noise that the right contacts would better
N_ALIKE_STARTS = 3  # starts with the same misfit that end the search
ALIKE_MISFIT = 1.01  # misfits over the least of starts that ended alike
SAME_MISFIT = 1.002  # the same, of starts that found the same answer
# the same, of starts whose answers have a part in the bars where little is measured. In 15
# virtual tests with one drop, or ten drops and two spheres (twins of rig-1dof, seeds 0 to 10
# and 0 to 3), bars of the best answer alone held 67 % of 300 true values, with the others up
# to 1.03, 1.1 and 1.2 times its misfit 80, 83 and 88 %
RIVAL_MISFIT = 1.2
DISTINCT_SCALES = 0.02  # scales by which a parameter of two different answers differs at least
# misfit of an answer with contacts swapped over that of the best, up to which the data do not
# decide between them: of 9000 samples whose noise is correlated over five, chi^2 grows by 18
NEIGHBOUR_MISFIT = 1.005
SWAPPED_SCALES = 0.1  # scales by which a contact of such an answer differs at least
FINE_RUNS = 100  # of the fine model in a fit: a slow one may still end at the truth

# noise and measured spheres with which a wrong chain cannot hide in the noise
DECISIVE_NOISE = 1.5e-3  # largest such noise
MAX_CONTACTS_PER_SPHERE = 6.0  # largest such number of contacts to a measured sphere


class FitStage(NamedTuple):
    """One fit; misfit is the rms over its windows [m/s]."""

    name: str
    parameters: tuple[str, ...]
    misfit: float
    evaluations: int
    seconds: float
    converged: bool


class SearchEnd(NamedTuple):
    """End of a start: z (p,) of the parameters in scales, its misfit [m/s], the way there."""

    z: np.ndarray
    misfit: float
    stages: tuple[FitStage, ...]
    scan: Scan | None
    neighbours: tuple[np.ndarray, ...] = ()  # (p,) each: contacts swapped at hardly more misfit


def decisive(
    noise: float,
    largest: float,
    parameters: Sequence[Parameter],
    data: np.ndarray,
) -> bool:
    """True if a chain that leaves no more than the noise [m/s] in the data (k, m) must be the right
    one: where little is measured, contacts may be swapped at a misfit that hides in it. `largest`
    is the velocity of the fastest sphere [m/s]."""
    contacts = sum(p.kind == "contact" for p in parameters)
    if not contacts:
        return True
    measured = data.shape[1]
    return noise <= DECISIVE_NOISE * largest and contacts <= MAX_CONTACTS_PER_SPHERE * measured


class CoarseToFine:
    """A search on a coarse model, then the same fits on the fine one.

    After `solution`: `stages` and `scan` of the best start, `starts` tried and `same_starts` of
    them that found its misfit; whether it is `confirmed`, by its misfit or by other starts; and
    the `others` (p, k), what further answers differ by from it, in scales, where a wrong chain can
    hide in the noise.
    """

    def __init__(self, fine: WindowFit, options: Options) -> None:
        self.fine, self.options = fine, options
        self.noise = options.noise or 0.0
        self.parameters = fine.parameters
        self.of_wall = np.array([p.of_wall for p in self.parameters])
        self.every = np.ones(len(self.parameters), bool)
        self.sure = decisive(self.noise, fine.largest, self.parameters, fine.data)
        self.stages: list[FitStage] = []
        self.same_starts = self.starts = 0
        self.confirmed, self.others = True, np.zeros((len(self.parameters), 0))
        self.scan: Scan | None = None

        # the coarse model: the largest steps whose rms error [m/s] the noise covers
        forward = fine.forward
        usual_steps = forward.coarser(1.0).velocities(forward.start)
        for steps in COARSE_STEPS:
            coarse = forward.coarser(steps)
            error = rms(coarse.velocities(forward.start) - usual_steps)
            if error <= COVERED_ERROR * self.noise:
                break
        self.coarse = WindowFit(coarse)
        self.exact = 1.1 * max(error, EXACT_MISFIT * fine.largest)
        self.growing = GrowingWindows(self.coarse, self.enough, SWAP_RUNS)

        # (m,) [s] when the first reflected wave has passed, by the model at the start
        modelled = forward.of_velocities()
        v = modelled.velocities(modelled.start)
        self.first_waves = first_waves_end(modelled.signals.t, v, 0.3 * modelled.time_scale)

    def enough(self, samples: int, sigmas: float = 0.5) -> float:
        """Misfit [m/s] that needs no further search: so many sigmas above the noise, whose rms over
        n samples has the relative deviation sqrt(correlated / (2 n))."""
        deviation = sigmas * np.sqrt(N_CORRELATED / (2.0 * samples))
        return float(np.hypot(self.noise * (1.0 + deviation), self.exact))

    def first_wave_window(self, fit: WindowFit, end: float = np.inf) -> np.ndarray:
        """(k, m) samples of the first waves, up to a time [s]."""
        t = fit.forward.signals.t[:, None]
        return (t <= self.first_waves) & (t <= end)

    def solution(self, z: np.ndarray) -> np.ndarray:
        """z (p,) of the least misfit over the starts, with the fine model; the first start is z."""
        options = self.options
        if options.local:
            everything = np.ones_like(self.fine.data, bool)
            return self._polished("all, all waves", z, self.every, everything, perf_counter())

        # further starts: the chain scattered around the first, the wall as it is
        rng = np.random.default_rng(options.seed)
        starts = [z]
        for _ in range(options.starts - 1):
            moved = z + START_SCATTER * ~self.of_wall * rng.standard_normal(len(z))
            starts.append(np.clip(moved, self.fine.low, self.fine.high))

        explained = self.enough(self.fine.data.size, EXPLAINED_SIGMAS)
        refinable = REFINABLE_MISFIT * self.fine.largest if options.joint else 0.0
        noise_of_first = self.enough(int(self.first_wave_window(self.coarse).sum()))
        promising = max(refinable, ALMOST_MISFIT * noise_of_first)

        ends: list[SearchEnd] = []
        given_up = []  # (misfit, chain, start, stages) of chains not worth the other waves
        confirmed = False
        for self.starts, start in enumerate(starts, 1):
            self.stages, self.growing.budget = [], SWAP_RUNS
            chain, misfit = self.chain_from_first_waves(start)
            if misfit <= promising:
                ends.append(self._end(chain, start))
                best_misfit = min(end.misfit for end in ends)

                # a misfit as small as the noise is enough, else other starts must find it too
                same = sum(end.misfit <= SAME_MISFIT * best_misfit for end in ends)
                confirmed = best_misfit <= explained and (self.sure or same >= N_ALIKE_STARTS)
            else:
                given_up.append((misfit, chain, start, self.stages))
            if confirmed:
                break
            if self._settled([e.misfit for e in ends]) or self._settled([g[0] for g in given_up]):
                break

        # none is confirmed: the most promising of those given up goes on, at any cost
        if given_up and not confirmed:
            _, chain, start, self.stages = min(given_up, key=lambda g: g[0])
            self.growing.budget = LAST_SWAP_RUNS
            ends.append(self._end(chain, start))
        best = min(ends, key=lambda end: end.misfit)
        self.same_starts = sum(end.misfit <= SAME_MISFIT * best.misfit for end in ends)
        self.stages, self.scan = list(best.stages), best.scan
        self.confirmed = confirmed and all(stage.converged for stage in best.stages)
        # swaps that fit as well: the data do not say which contact is where
        neighbours = [SearchEnd(z, best.misfit, (), None) for z in best.neighbours]
        self.confirmed = self.confirmed and not neighbours
        ends += neighbours
        if not (self.sure and self.confirmed):
            near = [end for end in ends if end.misfit <= RIVAL_MISFIT * best.misfit]
            distinct = [best.z]
            for end in sorted(near, key=lambda end: end.misfit):
                if all(np.abs(end.z - z).max() > DISTINCT_SCALES for z in distinct):
                    distinct.append(end.z)
            self.others = np.array(distinct[1:]).reshape(-1, len(best.z)).T - best.z[:, None]
        return best.z

    def _settled(self, misfits: list[float]) -> bool:
        """True if the least misfit [m/s] has come often enough; never so near the noise that a
        better one must exist."""
        best_misfit = min(misfits, default=0.0)
        if self.options.joint and best_misfit <= NEAR_NOISE_MISFIT * self.noise:
            return False
        return sum(m <= ALIKE_MISFIT * best_misfit for m in misfits) >= N_ALIKE_STARTS

    def _end(self, chain: np.ndarray, start: np.ndarray) -> SearchEnd:
        """A start (p,) from its chain (p,) on to its end."""
        z, scan, neighbours = chain, None, ()
        if self.options.staged and self.of_wall.any():
            z, scan = self.wall_from_all_waves(chain, start)
        if self.options.joint or not self.options.staged:
            z, neighbours = self.all_from_all_waves(z)
            # where noise may hide a wrong chain it may hide a wrong wall
            if scan is not None and not self.sure:
                valley = self._deeper_valley(z)
                if valley is not None:
                    z, neighbours = self.all_from_all_waves(valley)
        return SearchEnd(z, self.stages[-1].misfit, tuple(self.stages), scan, neighbours)

    def chain_from_first_waves(self, z: np.ndarray) -> tuple[np.ndarray, float]:
        """z (p,) with the chain of the first waves, and its misfit there [m/s]; z and 0 where the
        fit is not staged.

        The wall hardly moves the first waves: where its parameters are fitted anyhow they move
        along here, and the values that they take are thrown away.
        """
        if not self.options.staged:
            return z, 0.0
        began, of_chain = perf_counter(), ~self.of_wall
        ends = self._window_ends(0.1, self.first_waves.max())
        windows = [self.first_wave_window(self.coarse, end) for end in ends]
        free = self.every if self.options.joint else of_chain
        goal = REFINABLE_MISFIT * self.fine.largest if self.options.joint else 0.0
        z, misfit, runs = self.growing.on_windows(z, free, windows, goal)
        if self.options.joint:  # the last stage fits the chain again, with the fine model
            self._note("chain, first waves", of_chain, misfit, runs, began, True)
        else:
            window = self.first_wave_window(self.fine)
            z = self._polished("chain, first waves", z, free, window, began)
        return z, self.stages[-1].misfit

    def wall_from_all_waves(
        self, z: np.ndarray, start: np.ndarray
    ) -> tuple[np.ndarray, Scan | None]:
        """z (p,) with the wall of all waves: from the wall that the first waves left, from that of
        the start (p,), or from the valleys of the scan on, whichever leaves the least."""
        began, scan = perf_counter(), None
        everything = np.ones_like(self.coarse.data, bool)
        begins = [z, np.where(self.of_wall, start, z)]
        if self.options.scan is not None:
            valleys, scan = scanned(self.coarse, begins[1], *self.options.scan)
            begins += valleys
        trials = [
            self.coarse.solved(begin, self.of_wall, everything, max_runs=8, tolerance=1e-3)
            for begin in begins
        ]
        z = min(trials, key=lambda solution: solution.misfit).point
        everything = np.ones_like(self.fine.data, bool)
        return self._polished("wall, all waves", z, self.of_wall, everything, began), scan

    def _deeper_valley(self, z: np.ndarray) -> np.ndarray | None:
        """A point (p,) of less misfit at another frequency of the wall, scanned again beside the
        chain that all waves gave at z (p,); None where there is none.

        The chain of the first waves may be wrong enough to mistake the valley: of 20 twins of two
        materials at 4 mm/s of noise two ended at 403 and 428 Hz in place of 240.
        """
        everything = np.ones_like(self.coarse.data, bool)
        here = self.coarse.misfit(z, everything)
        valleys, _ = scanned(self.coarse, z, *self.options.scan)
        trials = [
            self.coarse.solved(valley, self.every, everything, max_runs=12, tolerance=1e-5)
            for valley in valleys
        ]
        best = min(trials, key=lambda trial: trial.misfit)
        return best.point if here > SAME_MISFIT * best.misfit else None

    def all_from_all_waves(self, z: np.ndarray) -> tuple[np.ndarray, tuple[np.ndarray, ...]]:
        """z (p,) with everything from all waves: at once, and where that does not explain them in
        windows that grow; and those with contacts swapped that leave hardly more."""
        began = perf_counter()
        t = self.coarse.forward.signals.t[:, None]
        everything = np.ones_like(self.coarse.data, bool)
        best = self.coarse.solved(z, self.every, everything, max_runs=12, tolerance=1e-5)
        enough = self.enough(self.coarse.data.size, EXPLAINED_SIGMAS)

        # two rigs that differ by a swap may both leave no more than noise: the least is meant
        rounds = 1 if best.misfit <= enough else None
        self.growing.tried = [best]
        best, _ = self.growing.swapped(best, self.every, everything, self.exact, rounds=rounds)
        likely = NEIGHBOUR_MISFIT * best.misfit
        moves = [swap.point - best.point for swap in self.growing.tried if swap.misfit <= likely]
        if best.misfit > enough:
            ends = self._window_ends(0.5, t[-1, 0])
            windows = [(t <= end) | (t <= self.first_waves) for end in ends]
            z_grown, misfit, _ = self.growing.on_windows(z, self.every, windows, 0.0)
            if misfit < best.misfit:
                best, moves = best._replace(point=z_grown, misfit=misfit), []
        everything = np.ones_like(self.fine.data, bool)
        z = self._polished("all, all waves", best.point, self.every, everything, began)
        # less than that is no swap, see `WindowFit.swapped`, but the same valley by fewer runs
        return z, tuple(z + move for move in moves if np.abs(move).max() > SWAPPED_SCALES)

    def _window_ends(self, share: float, last: float) -> np.ndarray:
        """Ends [s] of windows that grow, from a share of the time since before the first touch."""
        forward = self.fine.forward
        lead = WINDOW_LEAD * forward.time_scale
        begin = max(forward.touch - lead, forward.signals.t[0])
        first = (1.0 - share) * begin + share * last
        return np.linspace(first, last, N_WINDOWS)

    def _polished(self, name, z, free, windows, began) -> np.ndarray:
        """z (p,) of a fit with the fine model, noted as a stage."""
        fit = self.fine.solved(z, free, windows, max_runs=FINE_RUNS)
        self._note(name, free, fit.misfit, fit.evaluations, began, fit.converged)
        return fit.point

    def _note(self, name, free, misfit, evaluations, began, converged) -> None:
        names = tuple(p.name for p, f in zip(self.parameters, free, strict=True) if f)
        seconds = perf_counter() - began
        self.stages.append(FitStage(name, names, misfit, evaluations, seconds, converged))
