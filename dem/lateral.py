"""The last sphere across the chain, with friction at the wall: its march to an error.

Directions t1, t2 lie in the wall and n points into it, t2 = n x t1. Friction leaves the motion
along the chain alone (Cattaneo and Mindlin take both problems as uncoupled), so that it follows
from that motion: the march along the chain is repeated for the ends of its steps, and a polynomial
is the overlap of the last contact between them. A march across by steps h is of order 2, and errs
by

    e = safety |v_h - v_H| / ((H/h)^2 - 1)

beside a coarser one by H, in the velocity of the centre and that of the turn at the surface.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dem.chain import Chain
from dem.checks import positive, require, scalar, vector
from dem.friction import open_cells, open_row, stick_stiffness
from dem.kernels.arguments import Array, Steps
from dem.kernels.lateral import Across, Pressing, SavedAcross, Sphere, Springs, march_across
from dem.kernels.oscillators import oscillator_propagator
from dem.kernels.tangential import TangentialLaw
from dem.stability import UnstableStep
from dem.trajectory import Trajectory, march
from dem.walls import Wall


class LastSphere(NamedTuple):
    """The last sphere across the chain, and the arm that holds it there."""

    law: TangentialLaw  # of the contact with the wall
    inertia: float  # [kg m^2] about its centre, the arm's included
    velocity: Array  # (2,) [m/s] along t1, t2 at the start
    arm_stiffness: Array = np.zeros(2)  # (2,) [N/m] along t1, t2; inf clamps
    arm_rotation: float = 0.0  # [N m/rad]; inf clamps


class LateralSearch(NamedTuple):
    """How the step of a lateral march is searched for; of 40 random oblique impacts none was off by
    more than its stated error."""

    safety: float = 2.0  # stated error over what the difference says: orders of 2 to 2.5 were seen
    phase: float = 0.2  # of the stiffest contact with the sphere, a first step; not varied
    most_steps: float = 3e8  # about a minute to ten
    capacity: int = 1024  # nodes of the contact at an error of 1e-5, see `open_row`
    n_cells: int = 256  # of the contact in two directions
    chunk: int = 20_000  # steps of the march along the chain that are held in memory


USUAL_LATERAL_SEARCH = LateralSearch()


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
    energy_lateral: Array  # (k,) [J] kinetic, of the centre
    energy_rotation: Array  # (k,) kinetic
    energy_arm: Array  # (k,)
    energy_tangential: Array  # (k,) of the contact
    dissipated_friction: Array  # (k,)
    dt: float
    n_steps: int
    error_estimate: float  # of the velocities, relative to the largest speed at the start

    @property
    def energy(self) -> Array:
        """(k,) [J] of all of it, constant if exact."""
        terms = (self.energy_lateral, self.energy_rotation, self.energy_arm)
        return sum(terms) + self.energy_tangential + self.dissipated_friction


def pressing(
    chain: Chain, wall: Wall, v0: ArrayLike, trajectory: Trajectory, chunk: int
) -> Pressing:
    """Overlap of the last contact at the ends of the steps of a trajectory, which is marched again
    where these were not saved."""
    gamma = 0.0 if chain.gamma is None else float(np.asarray(chain.gamma)[-1])
    n, h = trajectory.n_steps, float(trajectory.t[-1]) / trajectory.n_steps
    gap, rate, bend = np.empty((3, n + 1))
    spring, anchor = (values[-1] for values in chain.springs)
    state, first = None, 0
    while first < n:
        run, steps = trajectory, n
        if trajectory.t.size != n + 1:
            steps = min(chunk, n - first)
            run = march(
                chain, wall, v0, duration=steps * h, dt=h * (1 + 1e-12), scheme=trajectory.scheme,
                n_save=steps, state=state,
            )  # fmt: skip
            state = run.final
        behind = run.contact_force[:, -2] if run.contact_force.shape[1] > 1 else 0.0
        force = run.contact_force[:, -1]
        net = behind - force + chain.steady[-1] - spring * (run.x[:, -1] - anchor)
        wall_a = np.zeros(steps + 1)
        if wall.omega.size:  # one oscillator, of the mass 1/phi^2
            omega, decay = wall.omega[0], 2.0 * wall.zeta[0] * wall.omega[0]
            wall_a = wall.phi[0] ** 2 * force - omega**2 * run.wall_x - decay * run.wall_v
        rows = slice(first, first + steps + 1)
        gap[rows], rate[rows] = run.x[:, -1] - run.wall_x, run.v[:, -1] - run.wall_v
        bend[rows] = net / chain.mass[-1] - wall_a
        first += steps
    return Pressing(gap, rate, bend, h, gamma)


def march_lateral(
    chain: Chain,
    wall: Wall,
    v0: ArrayLike,
    trajectory: Trajectory,
    last: LastSphere,
    *,
    error: float | None = None,
    dt: float | None = None,
    search: LateralSearch = USUAL_LATERAL_SEARCH,
) -> LateralTrajectory:
    """The last sphere across the chain, at the instants of the trajectory along it.

    `error` is relative to the largest speed at the start, across or along; with `dt` [s] instead,
    that step is taken and its error estimated by twice the step. Moves along one line are exact in
    the contact, others take cells. Raises InvalidChain for a chain whose contact has no such law,
    UnstableStep where the error takes too many steps.
    """
    require(
        chain.yield_overlap is None and chain.dissipation in ("none", "hunt-crossley"),
        "friction at the wall takes contacts that are elastic, or damped by hunt-crossley",
    )
    simple = wall is not None and wall.omega.size < 2 and wall.mobility == 0.0
    require(
        simple and wall.residual_compliance == 0.0 and not chain.slides,
        "friction at the wall takes a rigid wall or one of one mode, and no guides; change them",
    )
    require((error is None) != (dt is None), "give either error or dt to say how finely to march")
    positive("inertia", last.inertia, " kg m^2")
    velocity = vector("lateral velocity", last.velocity, 2)
    stiffness = np.asarray(last.arm_stiffness, float)
    for name, value in (("arm_stiffness", stiffness[0]), ("arm_stiffness", stiffness[1])):
        if math.isfinite(value):
            scalar(name, float(value), at_least=0.0)
    if math.isfinite(last.arm_rotation):
        scalar("arm_rotation", float(last.arm_rotation), at_least=0.0)
    clamped = np.isinf(stiffness)
    require(not velocity[clamped].any(), "the arm clamps the sphere that moves across; drop one")

    # one direction where all motion is along one line
    size = float(np.hypot(*velocity))
    line = velocity / size if size else np.array([1.0, 0.0])
    straight = stiffness[0] == stiffness[1] or 0.0 in line
    frame = line[None] if straight else np.eye(2)  # (n_directions, 2)
    k = np.array([stiffness[int(np.abs(line).argmax())]]) if straight else stiffness

    contact = pressing(chain, wall, v0, trajectory, search.chunk)
    R = float(chain.radius[-1])
    inverse_mass = np.where(np.isinf(k), 0.0, 1.0 / float(chain.mass[-1]))
    inverse_inertia = 0.0 if math.isinf(last.arm_rotation) else 1.0 / last.inertia
    k = np.where(np.isinf(k), 0.0, k)
    kappa = 0.0 if math.isinf(last.arm_rotation) else float(last.arm_rotation)
    speed = max(float(np.abs(v0).max()), size) or 1.0
    n_save, duration = trajectory.t.size - 1, float(trajectory.t[-1])
    spacing = duration / n_save

    def run(stride: int) -> tuple[SavedAcross, float]:
        """The march with so many steps between saves."""
        h, n = spacing / stride, len(frame)
        swing = oscillator_propagator(np.sqrt(k * inverse_mass), np.zeros(n), h)
        turn = oscillator_propagator(np.sqrt([kappa * inverse_inertia]), np.zeros(1), h)
        swing[1, inverse_mass == 0.0] = 0.0
        sphere = Sphere(inverse_mass, inverse_inertia, R, k, kappa, swing, turn)
        if straight:
            fine = 1.0 if error is None else math.sqrt(1e-5 / error)
            capacity = int(search.capacity * min(max(fine, 1.0), 16.0))
            springs = Springs(open_row(capacity), open_row(capacity), None)
        else:
            springs = Springs(None, None, open_cells(search.n_cells))
        state = Across(*np.zeros((6, n)))
        state.v[:] = frame @ velocity
        saved = SavedAcross(
            *np.empty((6, n_save + 1, n)), np.empty(n_save + 1), np.empty((n_save + 1, 5))
        )
        count = march_across(
            state, sphere, contact, last.law, springs, None, Steps(h, n_save, stride), saved
        )
        if count < n_save:
            raise UnstableStep(f"the lateral motion is not finite at t = {count * spacing:.4g} s")
        return saved, h

    # a first step from the stiffest contact, by the mass that its force meets
    deepest = max(float(contact.overlap.max()), 0.0)
    a = math.sqrt(last.law.radius * deepest)
    mobility = float(inverse_mass.max()) + R * R * inverse_inertia
    rate = math.sqrt(float(stick_stiffness(last.law, a)) * mobility)
    first = search.phase / rate if rate > 0.0 else spacing
    stride = max(1, math.ceil(spacing / (first if dt is None else dt) * (1 - 1e-9)))
    coarse, _ = run(stride)
    shorter, spent = 2.0, stride
    while True:
        finer = max(stride + 1, math.ceil(shorter * stride))
        spent += finer
        if spent * n_save > search.most_steps:
            raise UnstableStep(
                f"error {error:g} of the lateral motion over {duration:g} s takes more than "
                f"{search.most_steps:.1e} steps; ask for a larger error or for less time"
            )
        saved, h = run(finer)
        change = max(
            float(np.abs(saved.v - coarse.v).max()),
            R * float(np.abs(saved.spin - coarse.spin).max()),
        )
        estimate = search.safety * change / speed / ((finer / stride) ** 2 - 1.0)
        if dt is not None:
            break
        if estimate <= error:
            break
        shorter = min(max(1.2, 1.1 * math.sqrt(estimate / error)), 16.0)
        coarse, stride = saved, finer

    turned = saved.psi @ frame  # by which the surface moves along t1, t2
    spun = saved.spin @ frame
    return LateralTrajectory(
        trajectory.t,
        saved.u @ frame,
        saved.v @ frame,
        np.stack([0.0 - turned[:, 1], turned[:, 0]], axis=1),
        np.stack([0.0 - spun[:, 1], spun[:, 0]], axis=1),
        saved.force @ frame,
        saved.slip @ frame,
        saved.stick,
        *saved.energy.T,
        h,
        n_save * finer,
        estimate,
    )
