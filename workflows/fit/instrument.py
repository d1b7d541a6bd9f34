"""Signals that an instrument shows of computed velocities, and bars of fits to repeats of these.

The velocities are marched by another scheme than that of the fits, at an error of 1e-8 and with
more samples than the instrument takes; its low-pass acts on those, and each repeat is sampled from
them with its own trigger and its own noise. Repeats of the whole experiment, fitted again and
again, tell whether two-sigma bars hold the truth.
"""

from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import active_children, get_context
from signal import SIG_IGN, SIGINT, signal
from typing import NamedTuple

import numpy as np
from scipy.signal import butter, sosfilt, sosfilt_zi

from beadwave.dem import Chain, Wall, march_to_error
from beadwave.system import interrupts_blocked
from beadwave.workflows.fit.chain_fit import calibrate
from beadwave.workflows.fit.parameter import Parameter
from beadwave.workflows.fit.rig import Rig
from beadwave.workflows.fit.signals import Filter, aligned
from beadwave.workflows.fit.windows import Options

OVERSAMPLED = 4  # samples of the march per sample of the instrument


class Twin(NamedTuple):
    """The rig that makes the data, and the instrument; all of it assumed, none of it measured."""

    scatter: float = 0.1  # of the contacts' stiffness, uniform to either side
    frequency: float = 240.0  # Hz, of a 1dof wall: what the thesis found
    noise: float = 1e-3  # m/s rms in the instrument's band, of one repeat
    sampling: float = 1e6  # Hz
    instrument: float = 100e3  # Hz, low-pass of order 4 in the vibrometer
    repeats: int = 10
    jitter: float = 2e-6  # s, standard deviation of the trigger
    before: float = 50e-6  # s of record before the first touch
    seed: int = 0


class Clean(NamedTuple):
    """Signals of the instrument without noise and with a perfect trigger, oversampled."""

    t: np.ndarray  # (k,) [s] on the record's clock
    v: np.ndarray  # (k, m) [m/s]
    spheres: tuple[int, ...]


def clean_signals(
    chain: Chain,
    wall: Wall | None,
    v0: np.ndarray,
    twin: Twin,
    spheres: tuple[int, ...],
    duration: float,
) -> Clean:
    """The known rig marched from v0 (n,) [m/s] for a duration [s] and filtered; spheres (m,) are
    counted from 1. Raises what the march raises of a chain that it cannot follow."""
    rate, observed = OVERSAMPLED * twin.sampling, [n - 1 for n in spheres]
    n = round(duration * rate)
    # 1e-8: relative velocity error of the march that makes the data
    run = march_to_error(chain, wall, v0, duration=n / rate, error=1e-8, n_save=n)
    return shown(run.trajectory.v[:, observed], v0[observed], twin, spheres)


def shown(v: np.ndarray, v0: np.ndarray, twin: Twin, spheres: tuple[int, ...]) -> Clean:
    """Velocities v (k, m) [m/s] of a march from v0 (m,) as the instrument would show them."""
    rate = OVERSAMPLED * twin.sampling
    v = np.vstack([np.tile(v0, (round(twin.before * rate), 1)), v])
    sos = butter(4, twin.instrument, fs=rate, output="sos")
    v = sosfilt(sos, v, axis=0, zi=sosfilt_zi(sos)[:, :, None] * v[0])[0]
    lag = Filter(instrument=twin.instrument).lag(1.0 / rate)
    return Clean(np.arange(len(v)) / rate + lag, v, spheres)


def repeated(clean: Clean, twin: Twin, run: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Times (k,) [s] and velocities (repeats, k, m) [m/s] of one experiment, with jitter of the
    trigger and noise; `run` seeds both."""
    rng = np.random.default_rng([twin.seed, 1, run])

    # the record ends four standard deviations of the trigger before the march does
    edge = int(np.ceil(4 * twin.jitter * twin.sampling * OVERSAMPLED)) if twin.repeats > 1 else 0
    last = len(clean.t) - 1 - edge
    t = np.arange(0, int((clean.t[last] - clean.t[0]) * twin.sampling) + 1) / twin.sampling
    late = twin.jitter * rng.standard_normal(twin.repeats) if twin.repeats > 1 else np.zeros(1)
    late -= late.mean()
    signals = [np.array([np.interp(t - s, clean.t, x) for x in clean.v.T]).T for s in late]

    # white noise through the instrument's low-pass, without its first 400 samples, scaled to the
    # rms that is wanted
    white = rng.standard_normal((twin.repeats, OVERSAMPLED * len(t) + 400, len(clean.spheres)))
    sos = butter(4, twin.instrument, fs=OVERSAMPLED * twin.sampling, output="sos")
    noise = sosfilt(sos, white, axis=1)[:, 400:]
    return t, np.array(signals) + twin.noise * (noise / noise.std())[:, ::OVERSAMPLED]


class Repeats(NamedTuple):
    """Common part of all repeats: the fitted rig, and the signals of the known one."""

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
    # Ctrl-C is for this process alone, which ends the others
    with ProcessPoolExecutor(2, get_context("spawn"), signal, (SIGINT, SIG_IGN)) as pool:
        with interrupts_blocked():
            results = pool.map(partial(Repeats.fitted, repeats), halves)
        try:
            return np.vstack([rows for rows in results if len(rows)])
        except BaseException:
            for process in active_children():
                process.terminate()
            raise
