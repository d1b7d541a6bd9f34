"""Find a known rig again: SYNTHETIC records of a chain, and a calibration to them.

You will see, for a rig whose contacts are drawn at random, what `beadwave calibrate` finds from ten
noisy records of three spheres, next to the true values; `twin.csv` holds the records. With a number
you will also see how often the two-sigma bars hold the truth in so many repeats of the experiment,
each with its own noise and fitted from what the first one found.

    known rig -> march at an error of 1e-8 -> low-pass of the instrument -> trigger, noise -> CSV

The data do not come from the model that is fitted: they are marched by another scheme, with more
samples than the instrument takes, and its low-pass acts on those.

Run it: python examples/twin.py          seconds
        python examples/twin.py 200      and 200 repeats, minutes
"""

import sys
from collections.abc import Sequence
from pathlib import Path
from textwrap import fill
from typing import Any, NamedTuple

import numpy as np
from scipy.signal import butter, sosfilt, sosfilt_zi

import beadwave
from beadwave import dem
from beadwave.workflows.files.record import SYNTHETIC, Record, csv_text
from beadwave.workflows.fit import scene_parameters
from beadwave.workflows.fit.aligned_signals import Filter, aligned
from beadwave.workflows.fit.api import Calibration
from beadwave.workflows.fit.chain_fit import calibrate
from beadwave.workflows.fit.marched_system import Rig
from beadwave.workflows.fit.parameter import Parameter
from beadwave.workflows.fit.report import COLUMNS
from beadwave.workflows.fit.windows import Options
from beadwave.workflows.report.tables import aligned_text
from beadwave.workflows.scene import OneDofWall, Scene
from beadwave.workflows.stages.chain.chain import chain, initial_velocity
from beadwave.workflows.stages.chain.walls import wall_of

OVERSAMPLED = 4  # samples of the march per sample of the instrument


class Twin(NamedTuple):
    """The known rig and the instrument; all of it assumed, none of it measured."""

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
    spheres: tuple[int, ...]  # (m,) counted from 1


def main(
    runs: int = 0,
    changes: Any = (),
    twin: Twin = Twin(),
    file: str | Path = "twin.csv",
    **request: Any,
) -> tuple[Calibration, dict[str, float]]:
    """The calibration of rig-1dof with these changes to its twin's records, which are written to
    `file`, and the true values by the parameters' names; `request` are options of `calibrate`."""
    scene = beadwave.scene("rig-1dof", changes)
    true_contacts = contacts(scene, twin)
    signals = clean(scene, wall_of(scene), twin, true_contacts)
    Path(file).write_text(csv_text(measured(signals, twin)))

    found = beadwave.calibrate(scene, file, instrument=twin.instrument, **request)
    true = truth(scene, twin, true_contacts)
    columns = ("found", "two sigma", "identifiable")
    rows = [
        (p.name, *(COLUMNS[column](p) for column in columns), f"{true[p.name]:.6g}")
        for p in found.report.parameters
    ]
    print(SYNTHETIC)
    print(aligned_text(("parameter", *columns, "truth"), rows))
    print("\n".join(fill(remark, 96, subsequent_indent="  ") for remark in found.report.remarks))

    if runs:
        fit = found.found.fit
        start = [p._replace(start=float(x)) for p, x in zip(fit.parameters, fit.value, strict=True)]
        rig = scene_parameters.rig(scene, wall_of(scene), twin.before)
        fits = np.array([refitted(rig, start, signals, twin, run) for run in range(1, 1 + runs)])
        inside = np.abs(fits[:, 0] - [true[p.name] for p in start]) <= fits[:, 1]
        for p, share in zip(start, inside.mean(axis=0), strict=True):
            print(f"{p.name:16}{100 * share:6.1f} % within two sigma")
        print(f"of all {100 * inside.mean():.1f} % in {runs} repeats")
    return found, true


def contacts(scene: Scene, twin: Twin) -> np.ndarray:
    """Factors (n_contacts,) on the scene's contact stiffnesses, drawn by the twin's seed."""
    rng = np.random.default_rng([twin.seed, 0])
    return 1.0 + twin.scatter * rng.uniform(-1.0, 1.0, scene.n_contacts)


def truth(scene: Scene, twin: Twin, true_contacts: np.ndarray) -> dict[str, float]:
    """True values of what a calibration frees by default, by the parameters' names."""
    true = {f"contact {i}": float(x) for i, x in enumerate(true_contacts, 1)}
    true |= {"striker": scene.striker.velocity, "trigger": twin.before}
    return true | {"wall.frequency": twin.frequency}


def clean(scene: Scene, wall: dem.Wall | None, twin: Twin, true_contacts: np.ndarray) -> Clean:
    """The known rig marched and shown by the instrument."""
    if isinstance(scene.wall, OneDofWall):
        wall = wall._replace(omega=np.array([2 * np.pi * twin.frequency]))
    row, v0 = chain(scene), initial_velocity(scene)
    row = row._replace(A=row.A * true_contacts)
    return clean_signals(row, wall, v0, twin, scene.output.spheres, scene.time.duration)


def clean_signals(
    row: dem.Chain,
    wall: dem.Wall | None,
    v0: np.ndarray,
    twin: Twin,
    spheres: tuple[int, ...],
    duration: float,
) -> Clean:
    """A chain marched from v0 (n,) [m/s] for a duration [s], as the instrument shows the spheres
    (m,), counted from 1."""
    rate, observed = OVERSAMPLED * twin.sampling, [n - 1 for n in spheres]
    n = round(duration * rate)
    # 1e-8: relative velocity error of the march that makes the data
    run = dem.march_to_error(row, wall, v0, duration=n / rate, error=1e-8, n_save=n)
    return shown(run.trajectory.v[:, observed], v0[observed], twin, spheres)


def shown(v: np.ndarray, v0: np.ndarray, twin: Twin, spheres: tuple[int, ...]) -> Clean:
    """Velocities v (k, m) [m/s] of a march from v0 (m,) as the instrument would show them."""
    rate = OVERSAMPLED * twin.sampling
    v = np.vstack([np.tile(v0, (round(twin.before * rate), 1)), v])
    sos = butter(4, twin.instrument, fs=rate, output="sos")
    v = sosfilt(sos, v, axis=0, zi=sosfilt_zi(sos)[:, :, None] * v[0])[0]
    lag = Filter(instrument=twin.instrument).lag(1.0 / rate)
    return Clean(np.arange(len(v)) / rate + lag, v, spheres)


def measured(signals: Clean, twin: Twin, run: int = 0) -> Record:
    """The record of one experiment: repeats with jitter of the trigger and noise; `run` seeds
    both."""
    rng = np.random.default_rng([twin.seed, 1, run])

    # the record ends four standard deviations of the trigger before the march does
    edge = int(np.ceil(4 * twin.jitter * twin.sampling * OVERSAMPLED)) if twin.repeats > 1 else 0
    last = len(signals.t) - 1 - edge
    t = np.arange(0, int((signals.t[last] - signals.t[0]) * twin.sampling) + 1) / twin.sampling
    late = twin.jitter * rng.standard_normal(twin.repeats) if twin.repeats > 1 else np.zeros(1)
    late -= late.mean()
    v = [np.array([np.interp(t - s, signals.t, x) for x in signals.v.T]).T for s in late]

    # white noise through the instrument's low-pass, without its first 400 samples, scaled to the
    # rms that is wanted
    white = rng.standard_normal((twin.repeats, OVERSAMPLED * len(t) + 400, len(signals.spheres)))
    sos = butter(4, twin.instrument, fs=OVERSAMPLED * twin.sampling, output="sos")
    noise = sosfilt(sos, white, axis=1)[:, 400:]
    v = np.array(v) + twin.noise * (noise / noise.std())[:, ::OVERSAMPLED]
    return Record(t, v, signals.spheres, SYNTHETIC)


def refitted(
    rig: Rig, start: Sequence[Parameter], signals: Clean, twin: Twin, run: int
) -> list[np.ndarray]:
    """Values (p,) and two-sigma bars (p,) of one more experiment, fitted from `start` on: the
    search is not repeated."""
    record = measured(signals, twin, run)
    repeats = aligned(record.t, record.v, tuple(n - 1 for n in signals.spheres))
    filters = Filter(instrument=twin.instrument)
    fit = calibrate(rig, start, repeats.signals, filters, Options(local=True))
    return [fit.value, fit.uncertainty.two_sigma]


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]))
