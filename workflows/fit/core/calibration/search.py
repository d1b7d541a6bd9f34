"""The way of a calibration to its answer, stage by stage.

As the thesis does (section 7.3), waves that do not depend on the wall come first, for the chain;
then the rest, for the wall; at last all together. A start whose chain leaves more than the noise in
the first waves has ended beside the answer: it is given up for another, scattered around the first,
until one explains the data or several have ended alike.
"""

from collections.abc import Sequence
from time import perf_counter
from typing import NamedTuple

import numpy as np

from workflows.fit.core.calibration.fitting import WindowFit, rms
from workflows.fit.core.calibration.growing_windows import ROUNDS, GrowingWindows
from workflows.fit.core.calibration.parameters import Parameter
from workflows.fit.core.calibration.scan import Scan, scanned
from workflows.fit.core.calibration.signals import first_waves_end

WINDOWS = 8
BEFORE = 2.0  # contact time scales: where windows begin before the first touch
MOST = 100  # model runs of a fit on the fine model: a slow one may end at the truth yet
REFINABLE = 1e-4  # of the fastest sphere: misfit of the first waves that the last stage can better
COARSE = (5.0, 2.5)  # steps of a search, in usual ones
COVERED = 0.1  # of the noise: error of large steps
RUNS = 600  # of the model that a start may put into swaps
LAST_RUNS = 3000  # the same where no start explains the data
NEAR = 1.5  # times the noise: a misfit that the right contacts would better
ALIKE = 3  # starts with the same misfit that end a search
ENDED = 1.5  # sigmas above the noise at which a search has ended
CORRELATED = 5.0  # samples of noise, at most, that go together
ALMOST = 1.02  # of what first waves may leave, for a chain to be taken further
SCATTER = 0.5  # of a further start, in scales
SAME = 1.002  # misfits of two starts that found the same
DECISIVE = 1.5e-3  # of the fastest sphere: noise above which a wrong chain may leave no more
PER_SPHERE = 6.0  # contacts to a measured sphere, above which a wrong chain may leave no more
EXACT = 1e-5  # of the fastest sphere: a misfit that needs no further search


class FitStage(NamedTuple):
    """One fit; misfit is the rms over its windows [m/s]."""

    name: str
    parameters: tuple[str, ...]
    misfit: float
    evaluations: int
    seconds: float
    converged: bool


class SearchEnd(NamedTuple):
    """Where a start led."""

    z: np.ndarray
    misfit: float
    stages: tuple[FitStage, ...]
    scan: Scan | None


class Options(NamedTuple):
    """Waves of the chain first or all at once; `joint` frees all at the end, else the chain stays
    as the first waves gave it. Further starts are drawn around the first."""

    staged: bool = True
    joint: bool = True
    starts: int = 12
    seed: int = 0
    local: bool = False  # only from the start on, for repeats of a fit that has been found
    scan: tuple[float, float, int] | None = None  # of the wall's frequency [Hz]: low, high, points
    noise: float | None = None  # rms [m/s] in the mean signals: a misfit that cannot be bettered


def decisive(
    noise: float, largest: float, parameters: Sequence[Parameter], data: np.ndarray
) -> bool:
    """Whether a chain that leaves no more than the noise [m/s] in the data (k, m) must be the right
    one: where little is measured, contacts may be swapped at a misfit that hides in it."""
    contacts = sum(p.kind == "contact" for p in parameters)
    return noise <= DECISIVE * largest and contacts <= PER_SPHERE * data.shape[1]


class CoarseToFine:
    """A search on a coarse model, then the same fits on the fine one."""

    def __init__(self, fine: WindowFit, options: Options) -> None:
        self.fine, self.options = fine, options
        self.noise = options.noise or 0.0
        self.parameters = fine.parameters
        self.coarse, coarseness = self._coarse()
        self.of_wall = np.array([p.of_wall for p in self.parameters])
        self.every = np.ones(len(self.parameters), bool)
        self.first_waves = _first_waves(fine)
        self.stages: list[FitStage] = []
        self.same_starts = self.starts = 0
        self.scan: Scan | None = None
        self.steps = GrowingWindows(self.coarse, self.enough, RUNS)
        self.exact = 1.1 * max(coarseness, EXACT * fine.largest)

    def _coarse(self) -> tuple[WindowFit, float]:
        """The problem on the largest steps that noise covers, and the rms [m/s] they are off."""
        forward = self.fine.forward
        finer = forward.coarser(1.0).velocities(forward.start)
        for steps in COARSE:
            model = forward.coarser(steps)
            off = rms(model.velocities(forward.start) - finer)
            if off <= COVERED * self.noise:
                break
        return WindowFit(model), off

    def enough(self, samples: int, sigmas: float = 0.5) -> float:
        """Misfit [m/s] that needs no further search, so many sigmas above the noise."""
        spread = sigmas * np.sqrt(CORRELATED / (2.0 * samples))
        return float(np.hypot(self.noise * (1.0 + spread), self.exact))

    def windows(self, fit: WindowFit, end: float = np.inf) -> np.ndarray:
        """(k, m) samples of the first waves, up to a time [s]."""
        t = fit.forward.signals.t[:, None]
        return (t <= self.first_waves) & (t <= end)

    def found(self, z: np.ndarray) -> np.ndarray:
        """z of the least misfit over the starts, with the fine model."""
        if self.options.local:
            everything = np.ones_like(self.fine.data, bool)
            return self._polished("all, all waves", z, self.every, everything, perf_counter())
        begins = list(self._starts(z))
        ends = self._ends(begins)
        least = min(end.misfit for end in ends)
        self.same_starts = sum(end.misfit <= SAME * least for end in ends)
        best = next(end for end in ends if end.misfit == least)
        self.stages, self.scan = list(best.stages), best.scan
        return best.z

    def _ends(self, begins: list[np.ndarray]) -> list[SearchEnd]:
        """Where starts led that were not given up; the most promising at least, at any cost."""
        explained, ends, given_up = self.enough(self.fine.data.size, ENDED), [], []
        for self.starts, begin in enumerate(begins, 1):
            self.stages, self.steps.budget = [], RUNS
            chain, misfit = self._first(begin)
            if misfit <= self._promising():
                ends.append(self._end(chain, begin))
                if min(e.misfit for e in ends) <= explained and self._confirmed(ends):
                    return ends
            else:
                given_up.append((misfit, chain, begin, self.stages))
            if self._settled([e.misfit for e in ends]) or self._settled([g[0] for g in given_up]):
                break
        if given_up:
            _, chain, begin, self.stages = min(given_up, key=lambda g: g[0])
            self.steps.budget = LAST_RUNS
            ends.append(self._end(chain, begin))
        return ends

    def _confirmed(self, ends: list[SearchEnd]) -> bool:
        """Whether a misfit as small as the noise is enough; else other starts must find it too."""
        least = min(end.misfit for end in ends)
        alike = sum(end.misfit <= SAME * least for end in ends)
        return alike >= ALIKE or decisive(
            self.noise, self.fine.largest, self.parameters, self.fine.data
        )

    def _promising(self) -> float:
        """Misfit [m/s] in the first waves of a chain that is worth the other waves."""
        refinable = REFINABLE * self.fine.largest if self.options.joint else 0.0
        return max(refinable, ALMOST * self.enough(int(self.windows(self.coarse).sum())))

    def _settled(self, misfits: list[float]) -> bool:
        """Whether the least has come often enough; not so near the noise that more must exist."""
        least = min(misfits, default=0.0)
        near = self.options.joint and least <= NEAR * self.noise
        return not near and sum(m <= 1.01 * least for m in misfits) >= ALIKE

    def _first(self, z: np.ndarray) -> tuple[np.ndarray, float]:
        """The chain of the first waves and its misfit there [m/s]."""
        if not self.options.staged:
            return z, 0.0
        chain = self._chain(z)
        return chain, self.stages[-1].misfit

    def _end(self, chain: np.ndarray, begin: np.ndarray) -> SearchEnd:
        """A start from its chain on to its end."""
        z, scan = self._wall(chain, begin) if self.options.staged else (chain, None)
        if self.options.joint or not self.options.staged:
            z = self._all(z)
        return SearchEnd(z, self.stages[-1].misfit, tuple(self.stages), scan)

    def _chain(self, z: np.ndarray) -> np.ndarray:
        """The chain from the first waves; the little that the wall has to say in them is let in
        where it is fitted anyhow, and thrown away."""
        began, chain = perf_counter(), ~self.of_wall
        ends = self._lengths(0.1, self.first_waves.max(), WINDOWS)
        windows = [self.windows(self.coarse, end) for end in ends]
        free = self.every if self.options.joint else chain
        enough = REFINABLE * self.fine.largest if self.options.joint else 0.0
        z_chain, misfit, spent = self.steps.on_windows(z, free, windows, enough)
        if not self.options.joint:
            whole = self.windows(self.fine)
            return self._polished("chain, first waves", z_chain, free, whole, began)
        self._note("chain, first waves", chain, misfit, spent, began, True)
        return z_chain

    def _lengths(self, share: float, last: float, n: int) -> np.ndarray:
        """Ends [s] of windows that grow, from a share of the time since before the first touch."""
        forward = self.fine.forward
        begin = max(forward.touch - BEFORE * forward.time_scale, forward.signals.t[0])
        return np.linspace((1.0 - share) * begin + share * last, last, n)

    def _starts(self, z: np.ndarray):
        rng = np.random.default_rng(self.options.seed)
        yield z
        for _ in range(self.options.starts - 1):
            moved = z + SCATTER * ~self.of_wall * rng.standard_normal(len(z))
            yield np.clip(moved, self.fine.low, self.fine.high)

    def _wall(self, z: np.ndarray, start: np.ndarray) -> tuple[np.ndarray, Scan | None]:
        """The wall from all waves: as the first waves left it, or as it started, or from the
        valleys of the scan on."""
        if not self.of_wall.any():
            return z, None
        began, scan = perf_counter(), None
        everything = np.ones_like(self.coarse.data, bool)
        choices = [z, np.where(self.of_wall, start, z)]
        if self.options.scan is not None:
            valleys, scan = scanned(self.coarse, choices[1], *self.options.scan)
            choices += valleys
        tried = [
            self.coarse.solved(choice, self.of_wall, everything, most=8, tolerance=1e-3)
            for choice in choices
        ]
        z = min(tried, key=lambda solution: solution.misfit).z
        whole = np.ones_like(self.fine.data, bool)
        return self._polished("wall, all waves", z, self.of_wall, whole, began), scan

    def _all(self, z: np.ndarray) -> np.ndarray:
        """Everything from all waves: at once, and where that does not explain them in steps."""
        began = perf_counter()
        t = self.coarse.forward.signals.t[:, None]
        everything = np.ones_like(self.coarse.data, bool)
        best = self.coarse.solved(z, self.every, everything, most=12, tolerance=1e-5)
        enough = self.enough(self.coarse.data.size, ENDED)
        # two rigs that differ by a swap may both leave no more than noise: the least is meant
        rounds = 1 if best.misfit <= enough else ROUNDS
        best, _ = self.steps.swapped(best, self.every, everything, self.exact, rounds=rounds)
        if best.misfit > enough:
            ends = self._lengths(0.5, t[-1, 0], WINDOWS)
            windows = [(t <= end) | (t <= self.first_waves) for end in ends]
            other, misfit, _ = self.steps.on_windows(z, self.every, windows, 0.0)
            best = best if best.misfit <= misfit else best._replace(z=other, misfit=misfit)
        whole = np.ones_like(self.fine.data, bool)
        return self._polished("all, all waves", best.z, self.every, whole, began)

    def _polished(self, name, z, free, windows, began) -> np.ndarray:
        done = self.fine.solved(z, free, windows, most=MOST)
        self._note(name, free, done.misfit, done.evaluations, began, done.converged)
        return done.z

    def _note(self, name, free, misfit, evaluations, began, converged) -> None:
        names = tuple(p.name for p, f in zip(self.parameters, free, strict=True) if f)
        seconds = perf_counter() - began
        self.stages.append(FitStage(name, names, misfit, evaluations, seconds, converged))


def _first_waves(fit: WindowFit) -> np.ndarray:
    """(m,) [s] when the first reflected wave has passed, by the model that the fit starts from."""
    forward = fit.forward.of_velocities()
    modelled = forward.velocities(forward.start)
    return first_waves_end(forward.signals.t, modelled, 0.3 * forward.time_scale)
