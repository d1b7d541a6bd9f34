"""Signals of sensors on the spheres of a calibration, and their derivatives by its parameters.

A run with sensitivities leaves velocities and accelerations of the spheres; forces follow from
Newton's law, summed from the striker on,

    F_i - F_i(0) = -sum_(j <= i) m_j (a_j - a_j(0)),

steady forces cancel, and displacements by Hermite's quadrature of the velocities.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from coupling.errors import CouplingError
from coupling.sensors import Sensor, measured, signals
from dem.sensitivities import Sensitivities
from workflows.fit.core.calibration.parameters import Parameter, Rig


class Channels(NamedTuple):
    """Sensors that a calibration fits. Their gains make velocities of the signals, so that all
    count alike: `scale` takes them back. `group` names the unknown gain of each, or is None."""

    sensors: tuple[Sensor, ...]
    scale: np.ndarray  # (m,) units of the signal for 1 m/s
    labels: tuple[str, ...]
    units: tuple[str, ...]
    groups: tuple[str | None, ...]

    def only(self, columns: Sequence[int]) -> "Channels":
        """Some of them."""
        parts = (tuple(part[c] for c in columns) for part in (self.sensors, *self[2:]))
        sensors, labels, units, groups = parts
        return Channels(sensors, self.scale[columns], labels, units, groups)

    @property
    def observed(self) -> range:
        """Spheres that a run must record."""
        return range(max(sensor.sphere for sensor in self.sensors) + 1)


def require_summable(rig: Rig, channels: Channels) -> None:
    """Raise CouplingError where forces do not follow from the spheres' accelerations."""
    forces = any(sensor.quantity.startswith("force") for sensor in channels.sensors)
    if forces and rig.chain.springs[0].any():
        raise CouplingError("no forces are fitted of spheres on leaf springs; drop [leaf_springs].")


def sensed(
    run: Sensitivities, rig: Rig, channels: Channels, parameters: Sequence[Parameter], at
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Signals (k, m) at the times `at` (k,) [s] of a run that recorded the spheres `observed`,
    their rates, and their derivatives (k, m, p)."""
    own = channels.sensors
    y = _quantities(run, run.v, run.a, rig, own)
    shown, rate = (signals(own, run.t, y, at, order) for order in (0, 1))
    if not parameters:
        return shown, rate, np.zeros((*shown.shape, 0))
    slopes = signals(own, run.t, _quantities(run, run.dv, run.da, rig, own), at)
    for j, p in enumerate(parameters):
        if p.kind == "trigger":
            slopes[:, :, j] = -np.where((at > 0)[:, None], rate, 0.0)
    return shown, rate, slopes


def with_gains(
    shown: np.ndarray, slopes: np.ndarray, channels: Channels, parameters, theta
) -> tuple[np.ndarray, np.ndarray]:
    """Signals and derivatives with the gains that are among the parameters."""
    gain, by_gain = np.ones(shown.shape[1]), []
    for j, (p, value) in enumerate(zip(parameters, theta, strict=True)):
        if p.kind == "gain":
            own = np.array([f"gain {group}" == p.name for group in channels.groups])
            gain[own] = value / p.start
            by_gain.append((j, own / p.start))
    for j, share in by_gain if slopes.size else ():
        slopes[:, :, j] = shown * share
    fixed = np.array([p.kind == "gain" for p in parameters], bool)
    return shown * gain, np.where(fixed, slopes, slopes * gain[:, None]) if slopes.size else slopes


def _quantities(run, v, a, rig, sensors):
    """(steps, m, ...) of velocities and accelerations (steps, n, ...) or their derivatives."""
    h, n = run.t[1], v.shape[1]
    mass = rig.chain.mass[:n].reshape(-1, *[1] * (v.ndim - 2))
    force = np.cumsum(-mass * a, axis=1)
    moved = 0.5 * h * (v[1:] + v[:-1]) + h**2 / 12 * (a[:-1] - a[1:])
    x = np.concatenate([0.0 * v[:1], np.cumsum(moved, axis=0)])
    return measured(sensors, run.t, x, v, force)
