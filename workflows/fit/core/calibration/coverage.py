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
    """What all repeats share: the rig fitted, what the instrument saw of the known one."""

    rig: Rig
    twin: Twin
    band: float | None  # [Hz] low-pass of data and model
    made: Clean
    start: tuple[Parameter, ...]

    def fitted(self, runs: Sequence[int]) -> np.ndarray:
        """(runs, 2, p): what was found and its two-sigma bar, each with noise of its own."""
        filters, found = Filter(self.band, self.twin.instrument), []
        for run in runs:
            t, v = repeated(self.made, self.twin, run)
            laid = aligned(t, v, tuple(n - 1 for n in self.made.spheres))
            fit = calibrate(self.rig, self.start, laid.signals, filters, Options(local=True))
            found.append([fit.value, fit.uncertainty.two_sigma])
        return np.array(found)


def refitted(repeats: Repeats, runs: int) -> np.ndarray:
    """`Repeats.fitted` of the runs after the first, in two processes, which end with this one's
    interruption."""
    parts = [range(1 + part, 1 + runs, 2) for part in range(2)]
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        unblocked = pthread_sigmask(SIG_BLOCK, {SIGINT})  # inherited: Ctrl-C is this one's to tell
        try:
            found = pool.map(partial(Repeats.fitted, repeats), parts)
        finally:
            pthread_sigmask(SIG_SETMASK, unblocked)
        try:
            return np.vstack([part for part in found if len(part)])
        except BaseException:
            for process in active_children():
                process.terminate()
            raise
