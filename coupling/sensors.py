"""Sensors on a chain: contact forces and motions of spheres as signals of an instrument.

    y = gain * h(t) * s(t),   s = (F_i-1 + F_i) / 2,  its time derivative,  v_i  or  x_i

A bead with a sensor inside measures the mean F of its two contact forces: C. Daraio, V. F.
Nesterenko, E. B. Herbold, S. Jin, Phys. Rev. E 72 (2005) 016603. Forces and displacements count
from the state that the run starts from, as those of a zeroed amplifier. All but `recorded` is
linear in the run: derivatives by parameters may be passed in its place, along further axes.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from coupling.band import Band, filtered

UNITS = {"force": "N", "force-rate": "N/s", "velocity": "m/s", "displacement": "m"}
NO_BAND = Band()


class Sensor(NamedTuple):
    """One channel of an instrument; its signal is in V where it has a gain [V per unit], else in
    the unit of its quantity."""

    sphere: int  # counted from 0, as in a run's columns
    quantity: str  # one of UNITS
    gain: float = 1.0
    band: Band = NO_BAND
    noise: float = 0.0  # rms over the largest value of the signal, of a synthetic record
    range: float | None = None  # largest value that is shown; None: what fits the signal


def measured(
    sensors: Sequence[Sensor],
    t: NDArray[np.float64],
    x: NDArray[np.float64],
    v: NDArray[np.float64],
    contact_force: NDArray[np.float64],
) -> NDArray[np.float64]:
    """(k, m, ...) the quantities of m sensors at the instants t (k,) of a run or of its
    derivatives: x, v (k, n, ...), contact_force (k, n or n - 1, ...)."""
    quantities = []
    for sensor in sensors:
        i = sensor.sphere
        if sensor.quantity == "velocity":
            quantities.append(v[:, i])
        elif sensor.quantity == "displacement":
            quantities.append(x[:, i] - x[0, i])
        elif sensor.quantity == "force":
            quantities.append(mean_force(contact_force, i))
        else:  # the slope of a spline, as smooth as the force itself
            quantities.append(CubicSpline(t, mean_force(contact_force, i))(t, 1))
    return np.stack(quantities, axis=1)


def mean_force(contact_force: NDArray[np.float64], sphere: int) -> NDArray[np.float64]:
    """(k, ...) [N] mean of the forces on both sides of a sphere, counted from 0, above that at the
    start; there is none on the outer side of an end of the chain."""
    sides = contact_force[:, max(sphere - 1, 0) : sphere + 1]
    force = 0.5 * sides.sum(axis=1)
    return force - force[0]


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
    """Signals y (k, m) as a record of `bits` holds them, with the noise of the sensors."""
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
