"""Signals of sensors on the spheres of a calibration, and their derivatives by its parameters.

A run with sensitivities leaves velocities and accelerations of the spheres; forces follow from
Newton's law, summed from the striker on,

    F_i - F_i(0) = -sum_(j <= i) m_j (a_j - a_j(0)),

steady forces cancel, and displacements by Hermite's quadrature of the velocities.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from beadwave.coupling.errors import CouplingError
from beadwave.coupling.sensors import QUANTITIES, Sensor, measured, signals
from beadwave.dem.sensitivities import Sensitivities
from beadwave.workflows.fit.marched_system import Rig
from beadwave.workflows.fit.parameter import Parameter


class Channels(NamedTuple):
    """Sensors that a calibration fits. Their gains make velocities of the signals, so that all
    count alike: `scale` takes them back. `groups` names the unknown gain of each, or is None."""

    sensors: tuple[Sensor, ...]
    scale: np.ndarray  # (m,) units of the signal for 1 m/s
    labels: tuple[str, ...]
    units: tuple[str, ...]
    groups: tuple[str | None, ...]

    def only(self, columns: Sequence[int]) -> "Channels":
        """These columns alone."""
        sensors, labels, units, groups = (
            tuple(field[c] for c in columns)
            for field in (self.sensors, self.labels, self.units, self.groups)
        )
        return Channels(sensors, self.scale[columns], labels, units, groups)

    @property
    def observed(self) -> range:
        """Spheres that a run must record: forces sum over all up to the last sensor's."""
        return range(max(sensor.sphere for sensor in self.sensors) + 1)


def require_summable(rig: Rig, channels: Channels) -> None:
    """Raise CouplingError where forces do not follow from the spheres' accelerations."""
    known = [QUANTITIES[s.quantity] for s in channels.sensors if s.quantity in QUANTITIES]
    forces = any(quantity.sums_forces for quantity in known)
    if forces and rig.chain.springs[0].any():
        raise CouplingError("no forces are fitted of spheres on leaf springs; drop [leaf_springs].")


def sensed(
    run: Sensitivities,
    rig: Rig,
    channels: Channels,
    parameters: Sequence[Parameter],
    at: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Signals (k, m) at the times `at` (k,) [s] of a run that recorded the spheres `observed`,
    their rates (k, m), and their derivatives (k, m, p) by the parameters."""
    sensors = channels.sensors
    quantities = _quantities(run, run.v, run.a, rig, sensors)
    y, rate = (signals(sensors, run.t, quantities, at, order) for order in (0, 1))
    if not parameters:
        return y, rate, np.zeros((*y.shape, 0))
    dy = signals(sensors, run.t, _quantities(run, run.dv, run.da, rig, sensors), at)
    for j, p in enumerate(parameters):
        if p.kind == "trigger":  # a later start shows the signal later; before it nothing moves
            dy[:, :, j] = -np.where((at > 0)[:, None], rate, 0.0)
    return y, rate, dy


def with_gains(
    y: np.ndarray,
    dy: np.ndarray,
    channels: Channels,
    parameters: Sequence[Parameter],
    theta: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Signals (k, m) and derivatives (k, m, p) with the gains that are among the parameters; the
    derivatives are empty (p = 0) for signals alone."""
    gain = np.ones(y.shape[1])
    dy_by_gain = {}
    for j, (p, value) in enumerate(zip(parameters, theta, strict=True)):
        if p.kind == "gain":
            has_gain = np.array([f"gain {group}" == p.name for group in channels.groups])
            gain[has_gain] = value / p.start
            dy_by_gain[j] = y * (has_gain / p.start)
    if not dy.size:
        return y * gain, dy
    dy = dy * gain[:, None]
    for j, slope in dy_by_gain.items():
        dy[:, :, j] = slope
    return y * gain, dy


def _quantities(
    run: Sensitivities, v: np.ndarray, a: np.ndarray, rig: Rig, sensors: Sequence[Sensor]
) -> np.ndarray:
    """Quantities (steps, m, ...) that the sensors measure of velocities and accelerations (steps,
    n, ...) or of their derivatives."""
    h, n = run.t[1], v.shape[1]

    # Newton's law summed from the striker on, and Hermite's quadrature of the velocities
    mass = rig.chain.mass[:n].reshape(-1, *[1] * (v.ndim - 2))
    force = np.cumsum(-mass * a, axis=1)
    steps = 0.5 * h * (v[1:] + v[:-1]) + h**2 / 12 * (a[:-1] - a[1:])
    x = np.concatenate([0.0 * v[:1], np.cumsum(steps, axis=0)])
    return measured(sensors, run.t, x, v, force)
