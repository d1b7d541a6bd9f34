"""The way of a calibration to its answer, stage by stage.

As the thesis does (section 7.3), waves that do not depend on the wall come first, for the chain;
then the rest, for the wall; at last all together. Two things keep the search from ending beside the
answer. The first windows are lengthened in steps, so that a wave is met before those that it has
changed. And contacts between the same two lasers can be exchanged at little cost in misfit: the
best exchanges of two contacts are tried, and kept where the misfit falls.
"""

from time import perf_counter
from typing import NamedTuple

import numpy as np

from coupling.fitting import Fit, Solution, rms
from coupling.signals import first_waves_end

LENGTHENINGS = 8
MOST = 25  # model runs of a fit on the fine model
ROUGH = 1e-4  # of the fastest sphere: misfit of the first waves that the last stage can better
COARSE = (5.0, 2.5)  # steps of a search, in usual ones
COVERED = 0.1  # of the noise: error of large steps
TRIED = 6  # exchanges fitted in a round
ROUNDS = 5
MOST_TRIED = 3000  # model runs of a start that go into exchanges
ENDED = 1.5  # sigmas above the noise at which a search has ended
CORRELATED = 5.0  # samples of noise, at most, that go together
SCATTER = 0.5  # of a further start, in scales
SAME = 1.05  # misfits of two starts that found the same
EXACT = 1e-5  # of the fastest sphere: a misfit that needs no further search
WORSE = 2.0  # misfit guessed for an exchange that is not worth a fit
BETTER = 0.97  # misfit of an exchange worth keeping


class Stage(NamedTuple):
    """One fit; misfit is the rms over its windows [m/s]."""

    name: str
    parameters: tuple[str, ...]
    misfit: float
    evaluations: int
    seconds: float
    converged: bool


class Scan(NamedTuple):
    """Misfit [m/s] over one parameter, the others held."""

    name: str
    value: np.ndarray
    misfit: np.ndarray


class End(NamedTuple):
    """Where a start led."""

    z: np.ndarray
    misfit: float
    stages: tuple[Stage, ...]
    scan: Scan | None


class Options(NamedTuple):
    """Waves of the chain first or all at once; `joint` frees all at the end, else the chain stays
    as the first waves gave it. Further starts are drawn around the first."""

    staged: bool = True
    joint: bool = True
    starts: int = 2
    seed: int = 0
    local: bool = False  # only from the start on, for repeats of a fit that has been found
    scan: tuple[float, float, int] | None = None  # of the wall's frequency [Hz]: low, high, points
    noise: float | None = None  # rms [m/s] in the mean signals: a misfit that cannot be bettered


class Search:
    """A search on a coarse model, then the same fits on the fine one."""

    def __init__(self, fine: Fit, options: Options) -> None:
        self.fine, self.options = fine, options
        self.noise = options.noise or 0.0
        self.parameters = fine.parameters
        self.coarse, coarseness = self._coarse()
        self.of_wall = np.array([p.of_wall for p in self.parameters])
        self.every = np.ones(len(self.parameters), bool)
        self.first_waves = _first_waves(fine)
        self.stages: list[Stage] = []
        self.same_starts = self.starts = self.tried = 0
        self.scan: Scan | None = None
        self.exact = 1.1 * max(coarseness, EXACT * fine.largest)

    def _coarse(self) -> tuple[Fit, float]:
        """The problem on the largest steps that noise covers, and the rms [m/s] they are off."""
        forward = self.fine.forward
        finer = forward.coarser(1.0).velocities(forward.start)
        for steps in COARSE:
            model = forward.coarser(steps)
            off = rms(model.velocities(forward.start) - finer)
            if off <= COVERED * self.noise:
                break
        return Fit(model), off

    def enough(self, samples: int, sigmas: float = 0.5) -> float:
        """Misfit [m/s] that needs no further search, so many sigmas above the noise."""
        spread = sigmas * np.sqrt(CORRELATED / (2.0 * samples))
        return float(np.hypot(self.noise * (1.0 + spread), self.exact))

    def windows(self, fit: Fit, end: float = np.inf) -> np.ndarray:
        """(k, m) samples of the first waves, up to a time [s]."""
        t = fit.forward.signals.t[:, None]
        return (t <= self.first_waves) & (t <= end)

    def found(self, z: np.ndarray) -> np.ndarray:
        """z of the least misfit over the starts, with the fine model."""
        if self.options.local:
            everything = np.ones_like(self.fine.data, bool)
            return self._polished("all, all waves", z, self.every, everything, perf_counter())
        tried = []
        for begin in self._starts(z):
            tried.append(self._once(begin))
            if tried[-1].misfit <= self.enough(self.fine.data.size, ENDED):
                break
        least = min(end.misfit for end in tried)
        self.starts, self.same_starts = len(tried), sum(e.misfit <= SAME * least for e in tried)
        best = next(end for end in tried if end.misfit == least)
        self.stages, self.scan = list(best.stages), best.scan
        return best.z

    def _once(self, z: np.ndarray) -> End:
        """One start to its end."""
        self.stages, self.tried, scan = [], 0, None
        if self.options.staged:
            z, scan = self._wall(self._chain(z), z)
        if self.options.joint or not self.options.staged:
            z = self._all(z)
        return End(z, self.stages[-1].misfit, tuple(self.stages), scan)

    def _chain(self, z: np.ndarray) -> np.ndarray:
        """The chain from the first waves; the little that the wall has to say in them is let in
        where it is fitted anyhow, and thrown away."""
        began, chain = perf_counter(), ~self.of_wall
        ends = self._ends(0.1, self.first_waves.max(), LENGTHENINGS)
        windows = [self.windows(self.coarse, end) for end in ends]
        free = self.every if self.options.joint else chain
        enough = ROUGH * self.fine.largest if self.options.joint else 0.0
        z_chain, misfit, spent = self._lengthened(z, free, windows, enough)
        if not self.options.joint:
            whole = self.windows(self.fine)
            return self._polished("chain, first waves", z_chain, free, whole, began)
        self._note("chain, first waves", chain, misfit, spent, began, True)
        return z_chain

    def _ends(self, share: float, last: float, n: int) -> np.ndarray:
        t = self.fine.forward.signals.t
        return np.linspace(t[0] + share * (last - t[0]), last, n)

    def _starts(self, z: np.ndarray):
        rng = np.random.default_rng(self.options.seed)
        yield z
        for _ in range(self.options.starts - 1):
            moved = z + SCATTER * ~self.of_wall * rng.standard_normal(len(z))
            yield np.clip(moved, self.fine.low, self.fine.high)

    def _lengthened(self, z, free, windows, least) -> tuple[np.ndarray, float, int]:
        """Fitted on windows that grow; contacts are exchanged where a new piece does not fit."""
        spent = 0
        for i, window in enumerate(windows):
            prior = i < len(windows) - 1
            step = self.coarse.solved(z, free, window, most=8, prior=prior, tolerance=1e-4)
            spent += step.evaluations
            enough = max(least, self.enough(int(window.sum())))
            if step.misfit > enough:
                step, more = self._by_exchanges(step, free, window, prior, enough)
                spent += more
            z = step.z
        return z, step.misfit, spent

    def _by_exchanges(
        self, best, free, windows, prior, enough, rounds=ROUNDS
    ) -> tuple[Solution, int]:
        """The best of a fit and of those with contacts exchanged, as long as that helps: two at a
        time, then cycles of three, then two again."""
        spent, cycles = 0, False
        for _ in range(rounds):
            if best.misfit <= enough or self.tried + spent > MOST_TRIED:
                break
            exchanges = self.coarse.exchanged(best.z, free, windows, cycles=cycles)
            trial, more = self._least(best, exchanges, free, windows, prior)
            spent += len(exchanges) + more
            helped = trial.misfit < BETTER * best.misfit
            best = min(best, trial, key=lambda solution: solution.misfit)
            if not helped and cycles:
                break
            cycles = not helped
        self.tried += spent
        return best, spent

    def _least(self, before, exchanges, free, windows, prior) -> tuple[Solution, int]:
        """The best fit from the most promising exchanges."""
        best, spent = before, 0
        for guess, other in exchanges[:TRIED]:
            if guess > WORSE * before.misfit:
                break
            trial = self.coarse.solved(other, free, windows, most=8, prior=prior, tolerance=1e-4)
            spent += trial.evaluations
            best = min(best, trial, key=lambda solution: solution.misfit)
            if best.misfit < 0.5 * before.misfit:
                break
        return best, spent

    def _wall(self, z: np.ndarray, start: np.ndarray) -> tuple[np.ndarray, Scan | None]:
        """The wall from all waves: as the first waves left it, or as it started, or from the least
        misfit of the scan on."""
        if not self.of_wall.any():
            return z, None
        began, scan = perf_counter(), None
        everything = np.ones_like(self.coarse.data, bool)
        choices = [z, np.where(self.of_wall, start, z)]
        if self.options.scan is not None:
            least, scan = self._scanned(choices[1])
            choices.append(least)
        tried = [
            self.coarse.solved(choice, self.of_wall, everything, most=8, tolerance=1e-3)
            for choice in choices
        ]
        z = min(tried, key=lambda solution: solution.misfit).z
        whole = np.ones_like(self.fine.data, bool)
        return self._polished("wall, all waves", z, self.of_wall, whole, began), scan

    def _scanned(self, z: np.ndarray) -> tuple[np.ndarray, Scan]:
        low, high, points = self.options.scan
        where = next(i for i, p in enumerate(self.parameters) if p.kind == "frequency")
        everything = np.ones_like(self.coarse.data, bool)
        value, misfit, best, least = np.geomspace(low, high, points), [], z, np.inf
        for hz in value:
            other = z.copy()
            other[where] = np.log(hz) / self.parameters[where].relative
            misfit.append(self.coarse.misfit(other, everything))
            if misfit[-1] < least:
                best, least = other, misfit[-1]
        misfit = np.array(misfit)
        possible = misfit < 10.0 * self.fine.largest
        return best, Scan(self.parameters[where].name, value[possible], misfit[possible])

    def _all(self, z: np.ndarray) -> np.ndarray:
        """Everything from all waves: at once, and where that does not explain them in steps."""
        began = perf_counter()
        t = self.coarse.forward.signals.t[:, None]
        everything = np.ones_like(self.coarse.data, bool)
        best = self.coarse.solved(z, self.every, everything, most=12, tolerance=1e-5)
        enough = self.enough(self.coarse.data.size, ENDED)
        # two rigs that differ by an exchange may both leave no more than noise: the least is meant
        rounds = 1 if best.misfit <= enough else ROUNDS
        best, _ = self._by_exchanges(best, self.every, everything, False, self.exact, rounds)
        if best.misfit > enough:
            ends = self._ends(0.5, t[-1, 0], LENGTHENINGS)
            windows = [(t <= end) | (t <= self.first_waves) for end in ends]
            other, misfit, _ = self._lengthened(z, self.every, windows, 0.0)
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
        self.stages.append(Stage(name, names, misfit, evaluations, seconds, converged))


def _first_waves(fit: Fit) -> np.ndarray:
    """(m,) [s] when the first reflected wave has passed, by the model that the fit starts from."""
    forward = fit.forward
    modelled = forward.velocities(forward.start)
    return first_waves_end(forward.signals.t, modelled, 0.3 * forward.radian)
