"""The last sphere of a chain across it: what holds it there, and its motion in a march."""

import math
from typing import NamedTuple

import numpy as np

from beadwave.dem.chain import Chain
from beadwave.dem.checks import positive, require, scalar, vector
from beadwave.dem.kernels.arguments import Array
from beadwave.dem.kernels.lateral import Sphere
from beadwave.dem.kernels.oscillators import oscillator_propagator
from beadwave.dem.kernels.tangential import TangentialLaw
from beadwave.dem.trajectory import Trajectory


class LastSphere(NamedTuple):
    """The last sphere across the chain, and the arm that holds it there."""

    law: TangentialLaw  # of the contact with the wall
    inertia: float  # [kg m^2] about its centre, the arm's included
    velocity: Array  # (2,) [m/s] along t1, t2 at the start
    arm_stiffness: Array = np.zeros(2)  # (2,) [N/m] along t1, t2; inf clamps
    arm_rotation: float = 0.0  # [N m/rad]; inf clamps
    before: TangentialLaw | None = None  # of the contact with the sphere before; None: no friction

    def mobility(self, mass: float, stiffness: Array) -> tuple[Array, float]:
        """Inverse masses (n_directions,) [1/kg] of a sphere of a mass [kg] in directions of an
        arm's stiffness (n_directions,) [N/m], and inverse inertia [1/(kg m^2)]; 0 where the arm
        clamps."""
        inverse_mass = np.where(np.isinf(stiffness), 0.0, 1.0 / mass)
        return inverse_mass, 0.0 if math.isinf(self.arm_rotation) else 1.0 / self.inertia

    def on_arm(self, mass: float, radius: float, stiffness: Array, h: float) -> Sphere:
        """The sphere of a mass [kg] and a radius [m] and its arm in directions of a stiffness
        (n_directions,) [N/m], which swing exactly over steps of h [s]."""
        inverse_mass, inverse_inertia = self.mobility(mass, stiffness)
        k = np.where(inverse_mass > 0.0, stiffness, 0.0)
        kappa = float(self.arm_rotation) if inverse_inertia > 0.0 else 0.0
        return Sphere(
            inverse_mass=inverse_mass,
            inverse_inertia=inverse_inertia,
            radius=radius,
            stiffness=k,
            turn_stiffness=kappa,
            swing=oscillator_propagator(np.sqrt(k * inverse_mass), np.zeros(k.size), h),
            turn=oscillator_propagator(np.sqrt([kappa * inverse_inertia]), np.zeros(1), h),
        )


class LateralTrajectory(NamedTuple):
    """The last sphere across the chain at k saves, along t1 and t2."""

    t: Array  # (k,)
    sphere_t: Array  # (k, 2) [m] displacement of the centre
    sphere_t_v: Array  # (k, 2) [m/s]
    sphere_rotation: Array  # (k, 2) [rad] about t1, t2
    sphere_spin: Array  # (k, 2) [rad/s]
    friction_force: Array  # (k, 2) [N] on the wall
    slip: Array  # (k, 2) [m] of the sphere's surface relative to the wall
    stick_share: Array  # (k,) of the contact's area; 0 while it is open
    wall_t: Array  # (k, 2) [m] displacement of the wall
    energy_lateral: Array  # (k,) [J] kinetic, of the centre
    energy_rotation: Array  # (k,) [J] kinetic
    energy_arm: Array  # (k,) [J]
    energy_tangential: Array  # (k,) [J] of the contact
    dissipated_friction: Array  # (k,) [J]
    work_shaker: Array  # (k,) [J] of the wall's motion on the contact
    dt: float  # [s]
    n_steps: int
    error_estimate: float  # of the velocities, relative to the largest speed at the start
    # what the ledger leaves open, over the kinetic energy of the chain at the start, or over the
    # largest that any part of the motion across the chain reaches, if that is more
    energy_error: float
    cycle: "Cycle | None" = None  # before the striker, where the wall moves
    n_cells: int = 0  # of the contact in two directions

    @property
    def energy(self) -> Array:
        """(k,) [J] of all of it less the wall's work, constant if exact."""
        terms = (self.energy_lateral, self.energy_rotation, self.energy_arm)
        return sum(terms) + self.energy_tangential + self.dissipated_friction - self.work_shaker


def at_rest_across(trajectory: Trajectory) -> LateralTrajectory:
    """The LateralTrajectory of a chain that nothing moves across: no force, and a contact that
    sticks all over while it is closed."""
    t, still = trajectory.t, np.zeros((trajectory.t.size, 2))
    sticks = np.where(trajectory.contact_force[:, -1] > 0.0, 1.0, 0.0)
    none = np.zeros(t.size)
    return LateralTrajectory(
        t, *(still,) * 6, sticks, still, *(none,) * 6, trajectory.dt, trajectory.n_steps, 0.0, 0.0
    )


def require_hertz(chain: Chain) -> None:
    """Raise InvalidChain for a chain whose contacts have no tangential law."""
    require(
        chain.yield_overlap is None and not chain.jumps and chain.elastic.shape is None,
        "friction at the wall takes Hertz contacts that are elastic, or damped by hunt-crossley",
    )


def checked_last_sphere(last: LastSphere) -> tuple[Array, Array]:
    """Velocity (2,) [m/s] and the arm's stiffness (2,) [N/m] along t1, t2. Raises InvalidChain for
    an inertia that is not positive, a negative stiffness, a clamp on a sphere that moves."""
    positive("inertia", last.inertia, " kg m^2")
    velocity = vector("lateral velocity", last.velocity, 2)
    stiffness = np.asarray(last.arm_stiffness, float)
    require(stiffness.shape == (2,), "arm_stiffness takes two values, along t1 and t2")
    for name, value in zip(
        ("arm_stiffness",) * 2 + ("arm_rotation",), (*stiffness, last.arm_rotation), strict=True
    ):
        if value != math.inf:
            scalar(name, float(value), at_least=0.0)
    clamped = np.isinf(stiffness)
    require(not velocity[clamped].any(), "the arm clamps the sphere that moves across; drop one")
    return velocity, stiffness


class Cycle(NamedTuple):
    """Periodic motion before the striker arrives, (k, 2) along t1, t2."""

    t: Array  # (k,) [s] from `periods` periods before the striker to its touch
    friction_force: Array  # [N]
    slip: Array  # [m] of the sphere's surface relative to the wall
    sphere_t: Array  # [m]
    stick_share: Array  # (k,)
    energy: float  # [J] heat of friction in a period of the wall's motion
    periodicity_error: float  # change of the force from one to the next, over its largest
    drift: float  # [m] of the sphere from one to the next
    error_estimate: float  # of the velocities, as that of `LateralTrajectory`
    n_steps: int  # of the march that left it
    periods: int = 1  # of the wall's motion until all repeats itself
    # [N] least and largest mean force along `axis`, also of contacts that were pushed beforehand;
    # None where what these come into is not known
    mean_force_range: tuple[float, float] | None = None
    unbalanced: float | None = None  # [J] shakers' work less all losses of a period, of a structure
    # [J] of `energy`: from half as many steps, or samples, and cells; infinite where not known
    energy_error: float = math.inf

    @property
    def axis(self) -> int:
        """0 or 1: t1 or t2, along which the surface moves most."""
        return int(np.ptp(self.slip, axis=0).argmax())
