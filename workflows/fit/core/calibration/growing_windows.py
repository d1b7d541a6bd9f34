"""Fits on windows that grow, with contacts swapped where a fit has ended beside the answer.

A wave is met before those that it has changed. Contacts between the same two lasers can be
swapped at little cost in misfit, so that a fit may end with some in each other's place: the best
swaps of two, and cycles of three, are tried and kept where the misfit falls.
"""

from collections.abc import Callable, Sequence

import numpy as np

from workflows.fit.core.calibration.fitting import Solution, WindowFit

TRIED = 6  # swaps fitted in a round
ROUNDS = 5
WORSE = 2.0  # misfit guessed for a swap that is not worth a fit
BETTER = 0.97  # misfit of a swap worth keeping


class GrowingWindows:
    """Fits of one problem; `budget` counts down the model runs that swaps may still take, and
    `enough` is the misfit [m/s] of so many samples that needs no further search."""

    def __init__(self, fit: WindowFit, enough: Callable[[int], float], budget: int) -> None:
        self.fit, self.enough, self.budget = fit, enough, budget

    def on_windows(
        self, z: np.ndarray, free: np.ndarray, windows: Sequence[np.ndarray], least: float
    ) -> tuple[np.ndarray, float, int]:
        """z, misfit and model runs; contacts are swapped where a new piece does not fit."""
        spent = 0
        for i, window in enumerate(windows):
            prior = i < len(windows) - 1
            step = self.fit.solved(z, free, window, most=8, prior=prior, tolerance=1e-4)
            enough = max(least, self.enough(int(window.sum())))
            best, more = self.swapped(step, free, window, enough, prior=prior)
            spent += step.evaluations + more
            z = best.z
        return z, best.misfit, spent

    def swapped(
        self, best: Solution, free, window, enough: float, *, prior=False, rounds=ROUNDS
    ) -> tuple[Solution, int]:
        """The best of a fit and of those with contacts swapped, as long as that helps, and the
        model runs: two at a time, then cycles of three, then two again."""
        spent, cycles = 0, False
        for _ in range(rounds):
            if best.misfit <= enough or self.budget <= 0:
                break
            swaps = self.fit.swapped(best.z, free, window, cycles=cycles)
            trial, more = self._least(best, swaps, free, window, prior)
            spent += len(swaps) + more
            self.budget -= len(swaps) + more
            helped = trial.misfit < BETTER * best.misfit
            best = min(best, trial, key=lambda solution: solution.misfit)
            if not helped and cycles:
                break
            cycles = not helped
        return best, spent

    def _least(self, before, swaps, free, window, prior) -> tuple[Solution, int]:
        """The best fit from the most promising swaps."""
        best, spent = before, 0
        for guess, other in swaps[:TRIED]:
            if guess > WORSE * before.misfit:
                break
            trial = self.fit.solved(other, free, window, most=8, prior=prior, tolerance=1e-4)
            spent += trial.evaluations
            best = min(best, trial, key=lambda solution: solution.misfit)
            if best.misfit < 0.5 * before.misfit:
                break
        return best, spent
