"""Signals of sensors on a structure: displacement, velocity and acceleration of points of its
faces.

    q_j'' + 2 zeta_j omega_j q_j' + omega_j^2 q_j = phi_j . F + load_j . f,    y = sense^T q

of a march that kept the modes; or, of a run along the chain alone, the modes driven by its contact
force (`coupling.modes_at_amplitude.driven_modes`). Displacements count from the state at the start.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.coupling.damping import Damping, damping_ratios, matrix_ratios
from beadwave.coupling.modes_at_amplitude import FINER, ModeAtAmplitude, driven_modes, moved
from beadwave.coupling.reduced_spatial_wall import modes_and_oscillators
from beadwave.coupling.spatial_wall import SpatialWall
from beadwave.dem import Wall
from beadwave.rom import ReducedModel


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
    at_amplitude: Sequence[ModeAtAmplitude] = (),
    finer: int = FINER,
) -> SensorSignals:
    """Signals of the sensors of a reduced model of r coordinates in a run whose contact force along
    the normal is `force` (k,) [N] at equal times t (k,) [s], or of `contacts` (r, p) forces (k, p),
    with `finer` instants of the modes from one to the next, and modes `at_amplitude`.

    The structure starts at rest under the force of t[0]. Raises CouplingError where C couples the
    modes.
    """
    W = np.column_stack([reduced.w if contacts is None else contacts])
    modes = modes_and_oscillators(reduced, np.column_stack([W, reduced.columns.sense]))
    omega, phi, sense = modes.omega, *np.split(modes.phi, [W.shape[1]], axis=1)
    zeta = damping_ratios(damping, omega) + matrix_ratios(modes.damping, omega)
    wall = moved(Wall(omega, zeta, phi, 0.0, 0.0), at_amplitude)
    force = np.column_stack([force])
    q, p = driven_modes(wall, t, force, finer=finer)
    rate = (force - force[0]) @ phi.T - 2 * wall.zeta * wall.omega * p - wall.omega**2 * q
    return SensorSignals(q @ sense, p @ sense, rate @ sense)
