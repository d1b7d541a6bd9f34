"""Walls that the last sphere of a chain hits: `Wall`, and those that closed formulas give.

    u_w = sum_j phi_j q_j + s F + mobility * integral of F dt

A wall of a reduced model is made by `coupling.reduced_wall`. How far a half-space of the wall's
material is indented is part of the contact's stiffness, see `dem.Flat`. A kind of wall of a
scene has its constructor here, its table in `workflows.scene.tables.walls`, its case in
`workflows.stages.chain.walls` and its words in `workflows.report.first_screen`; CONTRIBUTING.md has
every step.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from beadwave.dem.checks import above_0, vector
from beadwave.dem.kernels.arguments import Array


class Wall(NamedTuple):
    """n_modes oscillators q'' + 2 zeta omega q' + omega^2 q = phi F in parallel, u_w = phi q.

    No modes: immovable. `residual_compliance` is a massless spring in series with the last contact,
    `mobility` a dashpot that gives way at  mobility * F  (Zener's infinite plate).
    """

    omega: Array  # (n_modes,) [rad/s]
    zeta: Array  # (n_modes,)
    phi: Array  # (n_modes,) [kg^-1/2] participation, mass-normalised
    residual_compliance: float = 0.0  # [m/N], may be slightly negative
    mobility: float = 0.0  # [m/(N s)]


def rigid_wall() -> Wall:
    """A wall that does not move: no modes, no compliance."""
    return Wall(np.zeros(0), np.zeros(0), np.zeros(0))


def one_dof_wall(frequency: ArrayLike, mass: ArrayLike, damping_ratio: ArrayLike = 0.0) -> Wall:
    """One mass on a spring to the ground; frequency in Hz (0: a free mass). Raises InvalidChain.

    Values (n_chains, 1) make the walls of a batch.
    """
    for name, value in (("frequency", frequency), ("damping_ratio", damping_ratio)):
        vector(f"wall {name}", np.ravel(value), np.size(value), at_least=0.0)
    vector("wall mass", np.ravel(mass), np.size(mass), positive=True)
    omega = 2.0 * np.pi * np.atleast_1d(np.asarray(frequency, float))
    zeta, phi = np.atleast_1d(np.asarray(damping_ratio, float)), np.atleast_1d(np.power(mass, -0.5))
    return Wall(omega, zeta, phi)


def dashpot_wall(coefficient: ArrayLike) -> Wall:
    """A wall that resists with coefficient [N s/m] times its velocity; coefficients (n_chains,)
    make the walls of a batch. Raises InvalidChain for one that is not above 0."""
    vector("dashpot coefficient", np.ravel(coefficient), np.size(coefficient), positive=True)
    return rigid_wall()._replace(mobility=1.0 / coefficient)


def plate_wall(young: float, poisson: float, density: float, thickness: float) -> Wall:
    """Infinite thin plate, young [Pa], density [kg/m^3], thickness h [m]: a dashpot of
    8 sqrt(D rho h) with the bending stiffness D = E h^3 / (12 (1 - nu^2)) (C. Zener, Phys. Rev.
    59 (1941) 669). Right until a wave comes back from an edge. Raises InvalidChain."""
    for name, value in (("young", young), ("density", density), ("thickness", thickness)):
        above_0(f"plate {name}", value)
    D = young * thickness**3 / (12.0 * (1.0 - poisson**2))
    return dashpot_wall(8.0 * np.sqrt(D * density * thickness))


def static_compliance(wall: Wall | None) -> float:
    """Static compliance  sum (phi / omega)^2 + residual  [m/N] of the wall behind the last contact;
    inf for a wall that drifts, 0 without one. Modes that do not move it count for nothing."""
    if wall is None:
        return 0.0
    moving = wall.phi != 0.0
    if wall.mobility > 0.0 or (wall.omega[moving] == 0.0).any():
        return np.inf
    modes = (wall.phi[moving] / wall.omega[moving]) ** 2
    return float(modes.sum() + wall.residual_compliance)
