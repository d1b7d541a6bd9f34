"""Fits on windows that grow, with contacts swapped where a fit has ended in a wrong valley.

A wave is fitted before those that it has changed. Contacts between the same two measured spheres
can be swapped at little cost in misfit, so that a fit may end with some in each other's place: the
best swaps of two, and cycles of three, are tried and kept where the misfit falls.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from workflows.fit.core.calibration.fitting import WindowFit
from workflows.fit.core.least_squares import Solution


class Swaps(NamedTuple):
    """When swaps of contacts are tried; none of these numbers has been varied systematically."""

    tried: int = 6  # swaps that are fitted in a round, those of the least guessed misfit
    rounds: int = 5
    worse: float = 2.0  # guessed misfit, over that of now, above which a swap is not fitted
    better: float = 0.97  # misfit of a swap, over that of now, that counts as progress
    at_once: float = 0.5  # the same, at which the other swaps of the round are not fitted any more


SWAPS = Swaps()


class GrowingWindows:
    """Fits of one problem; `budget` counts down the model runs that swaps may still take, and
    `enough` is the misfit [m/s] of so many samples that needs no further search."""

    def __init__(
        self,
        fit: WindowFit,
        enough: Callable[[int], float],
        budget: int,
        swaps: Swaps = SWAPS,
    ) -> None:
        self.fit, self.enough, self.budget, self.swaps = fit, enough, budget, swaps

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
            best, more = self.swapped(step, free, window, enough, prior=prior)
            runs += step.evaluations + more
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
        for _ in range(self.swaps.rounds if rounds is None else rounds):
            if best.misfit <= enough or self.budget <= 0:
                break

            # the most promising swaps to first order, each fitted
            guesses = self.fit.swapped(best.point, free, window, cycles=cycles)
            trial, more = best, len(guesses)
            for guess, z in guesses[: self.swaps.tried]:
                if guess > self.swaps.worse * best.misfit:
                    break
                swap = self.fit.solved(z, free, window, max_runs=8, prior=prior, tolerance=1e-4)
                more += swap.evaluations
                trial = min(trial, swap, key=lambda solution: solution.misfit)
                if trial.misfit < self.swaps.at_once * best.misfit:
                    break
            runs += more
            self.budget -= more

            progress = trial.misfit < self.swaps.better * best.misfit
            best = min(best, trial, key=lambda solution: solution.misfit)
            if not progress and cycles:
                break
            cycles = not progress
        return best, runs
