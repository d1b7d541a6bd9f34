"""An experiment repeated and fitted again and again: do its two-sigma bars hold the truth?"""

from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import active_children, get_context
from signal import SIG_BLOCK, SIG_SETMASK, SIGINT, pthread_sigmask
from typing import NamedTuple

import numpy as np

from workflows.fit.core.calibration.calibration import calibrate
from workflows.fit.core.calibration.instrument import Clean, Twin, repeated
from workflows.fit.core.calibration.parameters import Parameter, Rig
from workflows.fit.core.calibration.search import Options
from workflows.fit.core.calibration.signals import Filter, aligned


class Repeats(NamedTuple):
    """What all repeats share: the rig fitted, what the instrument shows of the known one."""

    rig: Rig
    twin: Twin
    band: float | None  # [Hz] low-pass of data and model
    clean: Clean
    start: tuple[Parameter, ...]

    def fitted(self, runs: Sequence[int]) -> np.ndarray:
        """(runs, 2, p): values and their two-sigma bars, each run with noise of its own."""
        filters, rows = Filter(self.band, self.twin.instrument), []
        for run in runs:
            t, v = repeated(self.clean, self.twin, run)
            signals = aligned(t, v, tuple(n - 1 for n in self.clean.spheres)).signals
            fit = calibrate(self.rig, self.start, signals, filters, Options(local=True))
            rows.append([fit.value, fit.uncertainty.two_sigma])
        return np.array(rows)


def refitted(repeats: Repeats, runs: int) -> np.ndarray:
    """`Repeats.fitted` of the runs after the first, (runs, 2, p), in two processes, which end with
    this one's interruption."""
    halves = [range(1 + first, 1 + runs, 2) for first in range(2)]
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        # what is blocked is inherited: Ctrl-C reaches this process alone, which ends the others
        unblocked = pthread_sigmask(SIG_BLOCK, {SIGINT})
        try:
            results = pool.map(partial(Repeats.fitted, repeats), halves)
        finally:
            pthread_sigmask(SIG_SETMASK, unblocked)
        try:
            return np.vstack([rows for rows in results if len(rows)])
        except BaseException:
            for process in active_children():
                process.terminate()
            raise
