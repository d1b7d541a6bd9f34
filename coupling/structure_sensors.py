"""Signals of sensors on a structure: displacement, velocity and acceleration of points of its
faces.

    q_j'' + 2 zeta_j omega_j q_j' + omega_j^2 q_j = phi_j . F + load_j . f,    y = sense^T q

of a march that kept the modes; or, of a run along the chain alone, the modes driven by its contact
force, which is taken linear between fine instants, where each mode is advanced exactly (Nigam and
Jennings, Bull. Seismol. Soc. Am. 59 (1969) 909):

    q = (z_1 - z_2) / (lambda_1 - lambda_2),   z_i' = lambda_i z_i + phi F,
    lambda_i = -zeta omega +- i omega sqrt(1 - zeta^2).

Displacements count from the state at the start.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from beadwave.coupling.damping import Damping, damping_ratios, matrix_ratios
from beadwave.coupling.reduced_spatial_wall import modes_and_oscillators
from beadwave.coupling.spatial_wall import SpatialWall
from beadwave.rom import ReducedModel

# instants of the driven modes between two of a run, 1 us apart: 4 and 8 differ by 7e-6 of an
# acceleration by modes of 300 Hz to 17 kHz
FINER = 4


class SensorSignals(NamedTuple):
    """Motion of r sensors at k instants, (k, r) each."""

    displacement: NDArray[np.float64]  # [m] from the start
    velocity: NDArray[np.float64]  # [m/s]
    acceleration: NDArray[np.float64]  # [m/s^2]


def sensed_in_march(
    wall: SpatialWall,
    q: NDArray[np.float64],
    p: NDArray[np.float64],
    force: NDArray[np.float64],
    shakers: NDArray[np.float64],
) -> SensorSignals:
    """Signals of the sensors of a wall from its modes q [kg^1/2 m] and their rates p (k, n_modes),
    under forces (k, 3) at the contact and (k, s) of the shakers [N].

    The wall's residual motion enters displacements alone: it has no inertia.
    """
    rate = force @ wall.phi.T + shakers @ wall.load.T
    rate = rate - 2 * wall.zeta * wall.omega * p - wall.omega**2 * q
    residual = force @ wall.sense_residual.T + shakers @ wall.sense_load_residual.T
    displacement = q @ wall.sense + residual
    return SensorSignals(displacement - displacement[0], p @ wall.sense, rate @ wall.sense)


def sensed_in_run(
    reduced: ReducedModel,
    t: NDArray[np.float64],
    force: NDArray[np.float64],
    *,
    contacts: NDArray[np.float64] | None = None,
    damping: Damping | None = None,
    finer: int = FINER,
) -> SensorSignals:
    """Signals of the sensors of a reduced model of r coordinates in a run whose contact force along
    the normal is `force` (k,) [N] at equal times t (k,) [s], or of `contacts` (r, p) forces (k, p),
    with `finer` instants of the modes from one to the next.

    The structure starts at rest under the force of t[0]. Raises CouplingError where C couples the
    modes.
    """
    from scipy.signal import lfilter

    W = np.column_stack([reduced.w if contacts is None else contacts])
    modes = modes_and_oscillators(reduced, np.column_stack([W, reduced.columns.sense]))
    omega, phi, sense = modes.omega, *np.split(modes.phi, [W.shape[1]], axis=1)
    zeta = damping_ratios(damping, omega) + matrix_ratios(modes.damping, omega)
    n = finer * (len(t) - 1)
    h = (t[-1] - t[0]) / n
    force = np.column_stack([force])
    pushes = CubicSpline(t, force - force[0])(t[0] + h * np.arange(n + 1)) @ phi.T

    # over a step the push F on a mode is linear: z(h) = E z(0) + F_0 (E - 1) / lambda + the slope's
    # part
    q, p = np.zeros((2, n // finer + 1, len(omega)))
    critical = 1e-7  # distance from critical damping, where the two roots are one
    for j, (w, ratio, F) in enumerate(zip(omega, zeta, pushes.T, strict=True)):
        if w == 0.0:
            p_fine = np.append(0.0, np.cumsum(h / 2 * (F[1:] + F[:-1])))
            q_fine = np.cumsum(h * p_fine[:-1] + h**2 * (F[:-1] / 3 + F[1:] / 6))
            q[:, j], p[:, j] = np.append(0.0, q_fine)[::finer], p_fine[::finer]
            continue
        ratio = ratio if abs(ratio - 1.0) > critical else 1.0 - critical
        swing = 1j * w * np.sqrt(1.0 - ratio**2 + 0j)
        lambdas = -ratio * w + swing, -ratio * w - swing
        z = []
        for rate in lambdas:
            whole = np.expm1(rate * h) / rate
            rise = (whole / h - 1.0) / rate
            driven = np.append(0.0, whole * F[:-1] + rise * np.diff(F))
            z.append(lfilter([1.0], [1.0, -np.exp(rate * h)], driven)[::finer])
        q[:, j] = ((z[0] - z[1]) / (2 * swing)).real
        p[:, j] = ((lambdas[0] * z[0] - lambdas[1] * z[1]) / (2 * swing)).real
    rate = pushes[::finer] - 2 * zeta * omega * p - omega**2 * q
    return SensorSignals(q @ sense, p @ sense, rate @ sense)
