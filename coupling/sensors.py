"""Sensors on a chain: signals of contact forces and motions of spheres, and the waves in them.

    y = gain * h(t) * s(t),   s = (F_i-1 + F_i) / 2,  its time derivative,  v_i  or  x_i

with the impulse response h of the instrument's band. A bead with a sensor inside measures the mean
F of its two contact forces: C. Daraio, V. F. Nesterenko, E. B. Herbold, S. Jin, Phys. Rev. E 72
(2005) 016603. Forces and displacements count from the state that the run starts from, as those of
an amplifier set to zero. All but `recorded` is linear in the run, so that derivatives by parameters
may take the run's place, along further axes.

A further quantity of a sphere is a row of QUANTITIES; its unit is a row of OF_SPHERES in
`workflows/scene/tables/sensors.py`, that of its gain a row of GAINS in `units.py`.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from beadwave import dem
from beadwave.coupling.band import Band, filtered
from beadwave.coupling.errors import CouplingError
from beadwave.dem.space import RowRun
from beadwave.dem.waves.labels import Label, labels
from beadwave.dem.waves.tracks import WaveTrack

if TYPE_CHECKING:
    from beadwave.coupling.structure_sensors import SensorSignals

NO_BAND = Band()


class Quantity(NamedTuple):
    """Signal that a sensor shows of a sphere i, counted from 0, and the part of it that has one
    crest a wave."""

    # (k, ...) of a run t, x, v, contact_force and i, as `measured` has them
    of_run: Callable[..., NDArray[np.float64]]
    # (k,) from a signal (k,), its step [s] and the samples to both sides of a crest
    crested: Callable[..., NDArray[np.float64]] = lambda y, dt, reach: y
    presses: bool = False  # crests are positive in either direction; else of the velocity's sign
    sums_forces: bool = False  # of the contacts, which a fit has from the accelerations


def mean_force(contact_force: NDArray[np.float64], sphere: int) -> NDArray[np.float64]:
    """(k, ...) [N] mean of the forces on both sides of a sphere, counted from 0, above that at the
    start; there is none on the outer side of an end of the chain."""
    sides = contact_force[:, max(sphere - 1, 0) : sphere + 1]
    force = 0.5 * sides.sum(axis=1)
    return force - force[0]


def force_rate(
    t: NDArray[np.float64], contact_force: NDArray[np.float64], sphere: int
) -> NDArray[np.float64]:
    """(k, ...) [N/s] slope of a spline through the mean force of a sphere."""
    return CubicSpline(t, mean_force(contact_force, sphere))(t, 1)


def integral(y: NDArray[np.float64], dt: float, reach: int) -> NDArray[np.float64]:
    """(k,) integral of a signal from its start, by trapezoids."""
    return np.concatenate([[0.0], np.cumsum(0.5 * dt * (y[1:] + y[:-1]))])


def slope(y: NDArray[np.float64], dt: float, reach: int) -> NDArray[np.float64]:
    """(k,) slope of a signal over `reach` samples to both sides; within `reach` of an end, beyond
    which the signal is taken to stay, too small: by half at the end itself."""
    ends = np.pad(y, reach, mode="edge")
    return (ends[2 * reach :] - ends[: -2 * reach]) / (2 * reach * dt)


QUANTITIES = {
    "force": Quantity(lambda t, x, v, F, i: mean_force(F, i), presses=True, sums_forces=True),
    "force-rate": Quantity(
        lambda t, x, v, F, i: force_rate(t, F, i), integral, presses=True, sums_forces=True
    ),
    "velocity": Quantity(lambda t, x, v, F, i: v[:, i]),
    "displacement": Quantity(lambda t, x, v, F, i: x[:, i] - x[0, i], slope),
}


class Sensor(NamedTuple):
    """One channel of an instrument; its signal is in V where it has a gain [V per unit], else in
    the unit of its quantity."""

    sphere: int | None  # counted from 0, as in a run's columns; None of one on a structure
    quantity: str  # one of QUANTITIES
    gain: float = 1.0
    band: Band = NO_BAND
    noise: float = 0.0  # rms over the largest value of the signal, of a synthetic record
    range: float | None = None  # largest value that is shown; None: what fits the signal
    column: int | None = None  # of one on a structure, in `structure_sensors.SensorSignals`
    chain: int = 0  # of several chains the one whose sphere it is, counted from 0


def measured(
    sensors: Sequence[Sensor],
    t: NDArray[np.float64],
    x: NDArray[np.float64],
    v: NDArray[np.float64],
    contact_force: NDArray[np.float64],
    structure: "SensorSignals | None" = None,
) -> NDArray[np.float64]:
    """(k, m, ...) the quantities of m sensors at the instants t (k,) of a run or of its
    derivatives: x, v (k, n, ...), contact_force (k, n or n - 1, ...); those on a structure as it
    moves.

    Raises CouplingError for a quantity that is none of QUANTITIES.
    """
    quantities = []
    for sensor in sensors:
        if sensor.column is not None:
            quantities.append(getattr(structure, sensor.quantity)[:, sensor.column])
            continue
        if sensor.quantity not in QUANTITIES:
            raise CouplingError(
                f"a sensor of {sensor.quantity!r} is unknown; take one of {', '.join(QUANTITIES)}."
            )
        of_run = QUANTITIES[sensor.quantity].of_run
        quantities.append(of_run(t, x, v, contact_force, sensor.sphere))
    return np.stack(quantities, axis=1)


def measured_in_runs(
    sensors: Sequence[Sensor],
    runs: Sequence[dem.Trajectory | RowRun],
    structure: "SensorSignals | None" = None,
) -> NDArray[np.float64]:
    """`measured` (k, m) of a run of each chain, at the same instants; a sensor on a sphere names
    its chain."""
    quantities = []
    for sensor in sensors:
        run = runs[sensor.chain]
        quantities.append(measured([sensor], run.t, run.x, run.v, run.contact_force, structure))
    return np.hstack(quantities)


def instants(t: NDArray[np.float64], sampling: float) -> NDArray[np.float64]:
    """(k,) [s] of an instrument that takes `sampling` [Hz] from the start of a run t to its end."""
    return t[0] + np.arange(int((t[-1] - t[0]) * sampling * (1 + 1e-12)) + 1) / sampling


def signals(
    sensors: Sequence[Sensor],
    t: NDArray[np.float64],
    quantities: NDArray[np.float64],
    at: NDArray[np.float64],
    order: int = 0,
) -> NDArray[np.float64]:
    """(len(at), m, ...) what sensors show of their quantities (k, m, ...) at the times `at` [s]:
    behind their bands, times their gains; their time derivatives of an order above 0."""
    columns = [
        sensor.gain * CubicSpline(t, filtered(sensor.band, t, quantities[:, i]))(at, order)
        for i, sensor in enumerate(sensors)
    ]
    return np.stack(columns, axis=1)


def recorded(
    sensors: Sequence[Sensor],
    y: NDArray[np.float64],
    bits: int | None = None,
    seed: int | Sequence[int] = 0,
) -> NDArray[np.float64]:
    """Signals y (k, m) as a record of `bits` holds them, with the noise of the sensors, normal and
    white, drawn from `seed`; not rounded where bits is None. A range that a sensor does not state
    is the least that cuts nothing off."""
    rng = np.random.default_rng(seed)
    largest = np.abs(y).max(axis=0)
    rms = np.array([sensor.noise for sensor in sensors]) * largest
    noisy = y + rms * rng.standard_normal(y.shape)
    if bits is None:
        return noisy
    fitting = np.abs(noisy).max(axis=0) / (1.0 - 2.0 ** (1 - bits))  # nothing is cut off
    ranges = [sensor.range or fit for sensor, fit in zip(sensors, fitting, strict=True)]
    return quantised(noisy, bits, np.array(ranges))


def quantised(
    y: NDArray[np.float64], bits: int, range_: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Signals (k, m) in the 2^bits steps from -range_ to range_ (m,), cut off at its ends; an empty
    range has no steps."""
    step = np.where(range_ > 0, range_, 1.0) / 2.0 ** (bits - 1)
    return np.clip(np.round(y / step), -(2.0 ** (bits - 1)), 2.0 ** (bits - 1) - 1) * step


# Range in which a wave's crest is sought, in widths of the wave
PARABOLA_WIDTH = 0.15  # to both sides of the crest, through which a parabola is laid
CREST_BEFORE = 0.7  # before the wave's time
CREST_AFTER = 1.3  # behind it: a band delays what it shows


class SensedWave(NamedTuple):
    """A wave as a sensor shows it: the crest of the force or velocity in the signal's unit, times s
    where the sensor shows its rate, over s where its integral."""

    name: str
    time: float  # [s]
    height: float


def sensed_waves(
    sensor: Sensor,
    t: NDArray[np.float64],
    y: NDArray[np.float64],
    named: Sequence[Label],
) -> tuple[SensedWave, ...]:
    """The waves named at the sensor's sphere that have a crest of their own in its signal (k,).

    A crest at the end of what is searched belongs to another wave, or to none.
    """
    if not named:
        return ()
    times = [label.arrival.time for label in named]
    midways = [-np.inf, *(0.5 * (a + b) for a, b in pairwise(times)), np.inf]
    quantity = QUANTITIES[sensor.quantity]
    dt, signal, waves = t[1] - t[0], np.sign(sensor.gain) * y, []
    for label, (start, end) in zip(named, pairwise(midways), strict=True):
        time, velocity, width, _ = label.arrival
        if not np.isfinite(width):
            continue

        # one crest a wave, positive in either direction
        reach = max(1, round(PARABOLA_WIDTH * width / dt))  # samples
        direction = 1.0 if quantity.presses else np.sign(velocity)
        shape = direction * quantity.crested(signal, dt, reach)

        # the highest sample near the wave's time, no nearer to another wave's
        low, high = max(time - CREST_BEFORE * width, start), min(time + CREST_AFTER * width, end)
        inside = np.flatnonzero((t > low) & (t < high))
        if not len(inside):
            continue
        k = inside[shape[inside].argmax()]
        if k - reach <= inside[0] or k + reach >= inside[-1] or shape[k] <= 0.0:
            continue

        # a parabola through the top, between samples and less of the noise
        top = slice(k - reach, k + reach + 1)
        a, b, c = np.polyfit(t[top] - t[k], shape[top], 2)
        if a >= 0.0:
            continue
        crest, height = float(t[k] - 0.5 * b / a), float(direction * (c - 0.25 * b * b / a))
        waves.append(SensedWave(label.name, crest, height))
    return tuple(waves)


def echo(waves: Sequence[SensedWave]) -> tuple[float | None, float | None]:
    """Time [s] from the incident to the first reflected wave and the ratio of their heights; None
    where the sensor does not show both."""
    by_name = {wave.name: wave for wave in waves}
    incident, reflected = (by_name.get(name) for name in ("incident", "reflected 1"))
    if incident is None or reflected is None:
        return None, None
    return reflected.time - incident.time, abs(reflected.height / incident.height)


class SensorRecord(NamedTuple):
    """Signals (k, m) at the instrument's instants t (k,) [s], and the waves that each shows."""

    t: NDArray[np.float64]
    y: NDArray[np.float64]
    waves: tuple[tuple[SensedWave, ...], ...]


def sensor_record(
    sensors: Sequence[Sensor],
    runs: Sequence[tuple[dem.Trajectory | RowRun, Sequence[WaveTrack]]],
    *,
    sampling: float,
    bits: int | None,
    seed: int,
    structure: "SensorSignals | None" = None,
) -> SensorRecord:
    """Signals of a run of each chain, with its waves, at a sampling rate [Hz], rounded to `bits`
    (None: not rounded), with noise from `seed`, and the waves in them; `structure` is the motion
    that sensors on it read, in which no waves are named."""
    t = runs[0][0].t
    at = instants(t, sampling)
    quantities = measured_in_runs(sensors, [run for run, _ in runs], structure)
    y = recorded(sensors, signals(sensors, t, quantities, at), bits, seed)
    waves = []
    for sensor, signal in zip(sensors, y.T, strict=True):
        run, tracks = runs[sensor.chain]
        if sensor.sphere is None:
            waves.append(())
            continue
        named = labels(tracks, run.t, run.v[:, sensor.sphere], sensor.sphere + 1)
        waves.append(sensed_waves(sensor, at, signal, named))
    return SensorRecord(at, y, tuple(waves))
