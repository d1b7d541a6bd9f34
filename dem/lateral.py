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
from dem.checks import InvalidChain, positive, require, scalar, vector
from dem.friction import open_cells, open_row, stick_stiffness
from dem.kernels.arguments import Array, Steps
from dem.kernels.lateral import Across, Pressing, SavedAcross, Sphere, Springs, march_across
from dem.kernels.oscillators import oscillator_propagator
from dem.kernels.tangential import (
    HEAT,
    TangentialLaw,
    cell_force,
    slide,
    slide_cells,
    tangential_force,
)
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


class WallMotion(NamedTuple):
    """The wall moves along itself by the sum of amplitude cos(2 pi frequency t + phase)."""

    amplitude: Array  # (n, 2) [m] along t1, t2
    frequency: Array  # (n,) [Hz]
    phase: Array  # (n,) [rad]

    def displacement(self, t: ArrayLike) -> Array:
        """(k, 2) [m] at the times t (k,) [s]."""
        angle = 2.0 * np.pi * np.multiply.outer(t, self.frequency) + self.phase
        return np.cos(angle) @ np.asarray(self.amplitude, float)

    @property
    def speed(self) -> Array:
        """(n, 2) [m/s] amplitudes of the velocity."""
        return 2.0 * np.pi * np.asarray(self.frequency)[:, None] * self.amplitude

    @property
    def period(self) -> float:
        """[s] shortest common period; raises InvalidChain where 100 cycles of the slowest motion
        hold none."""
        slowest = float(np.min(self.frequency))
        for cycles in range(1, 101):
            numbers = cycles * np.asarray(self.frequency) / slowest
            if np.abs(numbers - np.round(numbers)).max() < 1e-9 * cycles:
                return cycles / slowest
        raise InvalidChain(
            f"frequencies {', '.join(f'{f:g}' for f in self.frequency)} Hz have no common period "
            "within 100 cycles; take others"
        )


class LateralSearch(NamedTuple):
    """How the step of a lateral march is searched for.

    The error that is asked for is that of velocities: across the chain the energy ledger closes to
    a few times that error, not to a hundredth of it as along the chain.
    """

    dt: float | None = None  # [s] a step that is given, in place of an error
    safety: float = 2.0  # stated error over what the difference says: orders of 2 to 2.5 were seen
    phase: float = 0.2  # of the stiffest contact with the sphere, a first step; not varied
    most_steps: float = 3e8  # about a minute to ten
    capacity: int = 1024  # nodes of the contact at an error of 1e-5, see `open_row`
    n_cells: int = 256  # of the contact in two directions
    chunk: int = 20_000  # steps of the march along the chain that are held in memory
    # steps of a period, at least: they miss the largest displacement by up to (pi/4096)^2 / 2
    cycle_steps: int = 4096
    cycle_saves: int = 512  # instants of a period that are kept
    ramp_periods: int = 4  # over which the wall's motion begins; not varied
    most_periods: int = 200  # after these there is no periodic state
    periodicity: float = 1e-9  # change of the force between periods, over its largest
    nudge: float = 1e-5  # of a period's largest motion: differences for Newton's matrix; not varied


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
    wall_t: Array  # (k, 2) [m] displacement of the wall
    energy_lateral: Array  # (k,) [J] kinetic, of the centre
    energy_rotation: Array  # (k,) kinetic
    energy_arm: Array  # (k,)
    energy_tangential: Array  # (k,) of the contact
    dissipated_friction: Array  # (k,)
    work_shaker: Array  # (k,) of the wall's motion on the contact
    dt: float
    n_steps: int
    error_estimate: float  # of the velocities, relative to the largest speed at the start
    cycle: "Cycle | None" = None  # before the striker, where the wall moves

    @property
    def energy(self) -> Array:
        """(k,) [J] of all of it less the wall's work, constant if exact."""
        terms = (self.energy_lateral, self.energy_rotation, self.energy_arm)
        return sum(terms) + self.energy_tangential + self.dissipated_friction - self.work_shaker


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
    motion: WallMotion | None = None,
    error: float | None = None,
    search: LateralSearch = USUAL_LATERAL_SEARCH,
) -> LateralTrajectory:
    """The last sphere across the chain, at the instants of the trajectory along it.

    `error` is relative to the largest speed at the start, across or along; without it `search.dt`
    is the step [s] of the coarser of two marches, which state the error of the finer. Moves along
    one line are exact in the contact, others take cells. Where the wall has a `motion`, all is
    periodic before the striker. Raises InvalidChain for a chain whose contact has no such law,
    UnstableStep where the error takes too many steps, or no state is periodic.
    """
    require(
        chain.yield_overlap is None and not chain.jumps and chain.elastic.shape is None,
        "friction at the wall takes Hertz contacts that are elastic, or damped by hunt-crossley",
    )
    simple = wall is not None and wall.omega.size < 2 and wall.mobility == 0.0
    require(
        simple and wall.residual_compliance == 0.0 and not chain.slides,
        "friction at the wall takes a rigid wall or one of one mode, and no guides; change them",
    )
    dt = search.dt
    require(
        (error is None) != (dt is None), "give either error or search.dt to say how finely to march"
    )
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
    moves = [velocity] if motion is None else [velocity, *np.asarray(motion.amplitude, float)]
    line = max(moves, key=lambda vector: float(np.hypot(*vector)))
    line = line / np.hypot(*line) if line.any() else np.array([1.0, 0.0])
    straight = stiffness[0] == stiffness[1] or 0.0 in line
    straight = straight and all(
        abs(line[0] * y - line[1] * x) <= 1e-12 * np.hypot(x, y) for x, y in moves
    )
    frame = line[None] if straight else np.eye(2)  # (n_directions, 2)
    k = np.array([stiffness[int(np.abs(line).argmax())]]) if straight else stiffness

    contact = pressing(chain, wall, v0, trajectory, search.chunk)
    body = MarchedSphere(chain, last, k, frame, 1e-5 if error is None else error, search)
    speed = max(float(np.abs(v0).max()), float(np.hypot(*velocity)))
    if motion is not None:
        speed = max(speed, float(np.abs(motion.speed).max()))
    speed = speed or 1.0
    n_save, duration = trajectory.t.size - 1, float(trajectory.t[-1])
    spacing = duration / n_save

    # before the striker: at rest, or the wall's motion has become periodic
    state, springs, cycle = Across(*np.zeros((6, len(frame)))), body.open_springs(), None
    if motion is not None:
        state, springs, cycle = periodic_state(body, float(contact.overlap[0]), motion)
    state.v[:] += frame @ velocity

    def run(stride: int) -> tuple[SavedAcross, float]:
        """The march with so many steps between saves."""
        steps = Steps(spacing / stride, n_save, stride)
        return body.march(copied(state), copied_springs(springs), contact, motion, steps), steps.h

    # a first step from the stiffest contact
    rate = body.rate(float(contact.overlap.max()))
    first = search.phase / rate if rate > 0.0 else spacing
    stride = max(1, math.ceil(spacing / (first if dt is None else dt) * (1 - 1e-9)))
    coarse, _ = run(stride)
    shorter, spent = 2.0, stride
    while True:
        finer = max(stride + 1, math.ceil(shorter * stride))
        spent += finer
        if spent * n_save > search.most_steps:
            target = f"dt = {search.dt:g} s" if search.dt else f"error {error:g}"
            raise UnstableStep(
                f"{target} of the lateral motion over {duration:g} s takes more than "
                f"{search.most_steps:.1e} steps; ask for a larger error or for less time"
            )
        saved, h = run(finer)
        change = max(
            float(np.abs(saved.v - coarse.v).max()),
            float(chain.radius[-1]) * float(np.abs(saved.spin - coarse.spin).max()),
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
        np.zeros((n_save + 1, 2)) if motion is None else motion.displacement(trajectory.t),
        *saved.energy.T,
        h,
        n_save * finer,
        estimate,
        cycle,
    )


class MarchedSphere(NamedTuple):
    """The last sphere as it is marched: in one direction along a line, or in two."""

    chain: Chain
    last: LastSphere
    stiffness: Array  # (n_directions,) [N/m] of the arm; inf clamps
    frame: Array  # (n_directions, 2) of the directions in t1, t2
    error: float
    search: LateralSearch

    @property
    def mobility(self) -> tuple[Array, float]:
        """Inverse masses (n_directions,) [1/kg] and inverse inertia; 0 where the arm clamps."""
        clamped = np.isinf(self.stiffness)
        inverse_mass = np.where(clamped, 0.0, 1.0 / float(self.chain.mass[-1]))
        turns = not math.isinf(self.last.arm_rotation)
        return inverse_mass, 1.0 / self.last.inertia if turns else 0.0

    def rate(self, overlap: float) -> float:
        """[rad/s] of the sphere on a contact that sticks, by the mass that its force meets."""
        a = math.sqrt(self.last.law.radius * max(overlap, 0.0))
        inverse_mass, inverse_inertia = self.mobility
        meets = float(inverse_mass.max()) + float(self.chain.radius[-1]) ** 2 * inverse_inertia
        return math.sqrt(float(stick_stiffness(self.last.law, a)) * meets)

    def open_springs(self) -> Springs:
        """A contact that has not closed yet, with room for the error."""
        if len(self.frame) == 2:
            return Springs(None, None, open_cells(self.search.n_cells))
        fine = math.sqrt(1e-5 / self.error)
        capacity = int(self.search.capacity * min(max(fine, 1.0), 16.0))
        return Springs(open_row(capacity), open_row(capacity), None)

    def displace(self, state: Across, springs: Springs, overlap: float, by: Array) -> None:
        """Shift u, v, psi, spin by (4 n_directions,), in place; the contact follows the sphere."""
        u, v, psi, spin = np.split(by, 4)
        for values, shift in ((state.u, u), (state.v, v), (state.psi, psi), (state.spin, spin)):
            values += shift
        law, way = self.last.law, u + float(self.chain.radius[-1]) * psi
        if springs.cells is not None:
            slide_cells(springs.cells, law, overlap, 1.0, *way)
            state.force[:] = [cell_force(springs.cells, law, j) for j in range(2)]
        else:
            slide(springs.row, springs.room, law, overlap, 1.0, *way)
            state.force[:] = tangential_force(springs.row, law)

    def march(
        self, state: Across, springs: Springs, contact: Pressing, motion: WallMotion | Array | None,
        steps: Steps,
    ) -> SavedAcross:  # fmt: skip
        """March state and springs on, in place; `motion` of the wall may be its displacements
        (n_steps + 1, 2) [m]. Raises UnstableStep."""
        h, n_save, stride = steps
        n, last = len(self.frame), self.last
        inverse_mass, inverse_inertia = self.mobility
        k = np.where(np.isinf(self.stiffness), 0.0, self.stiffness)
        kappa = 0.0 if inverse_inertia == 0.0 else float(last.arm_rotation)
        swing = oscillator_propagator(np.sqrt(k * inverse_mass), np.zeros(n), h)
        turn = oscillator_propagator(np.sqrt([kappa * inverse_inertia]), np.zeros(1), h)
        radius = float(self.chain.radius[-1])
        sphere = Sphere(inverse_mass, inverse_inertia, radius, k, kappa, swing, turn)
        if isinstance(motion, WallMotion):
            motion = motion.displacement(h * np.arange(n_save * stride + 1))
        wall = None if motion is None else np.ascontiguousarray(motion @ self.frame.T)
        saved = SavedAcross(
            *np.empty((6, n_save + 1, n)), np.empty(n_save + 1), np.empty((n_save + 1, 6))
        )
        count = march_across(state, sphere, contact, last.law, springs, wall, steps, saved)
        if count < n_save:
            raise UnstableStep(
                f"the lateral motion is not finite at t = {count * stride * h:.4g} s; take a "
                "softer arm or a smaller step"
            )
        return saved


def copied(state: Across) -> Across:
    """The state in arrays of its own."""
    return Across(*(values.copy() for values in state))


def copied_springs(springs: Springs) -> Springs:
    """The contact in arrays of its own."""
    return Springs(
        *(
            None if contact is None else type(contact)(*(a.copy() for a in contact))
            for contact in springs
        )
    )


class Cycle(NamedTuple):
    """A period of the wall's motion before the striker, (k, 2) along t1, t2."""

    t: Array  # (k,) [s] from a period before the striker to its touch
    friction_force: Array  # [N]
    slip: Array  # [m] of the sphere's surface relative to the wall
    sphere_t: Array  # [m]
    stick_share: Array  # (k,)
    energy: float  # [J] heat of friction in the period
    periodicity_error: float  # change of the force from period to period, over its largest
    drift: float  # [m] of the sphere in a period

    @property
    def axis(self) -> int:
        """0 or 1: t1 or t2, along which the surface moves most."""
        return int(np.ptp(self.slip, axis=0).argmax())


def periodic_state(
    body: MarchedSphere, overlap: float, motion: WallMotion
) -> tuple[Across, Springs, Cycle]:
    """State and contact that the wall's motion has become periodic in, at its phase of t = 0.

    The motion is ramped up over some periods from a contact that was pressed and never sheared.
    Then each period is followed by a step of Newton's method for the sphere's motion, its matrix
    from differences; the contact keeps what the period has left in it, as its memory does not
    reach beyond the largest motion. A sphere without an arm drifts freely: the step is the least
    one. Raises UnstableStep where no period is found.
    """
    search, period = body.search, motion.period
    n = len(body.frame)
    n_steps = max(search.cycle_steps, math.ceil(period * body.rate(overlap) / search.phase))
    contact = Pressing(np.full(2, overlap), np.zeros(2), np.zeros(2), period, 0.0)
    stride = -(-n_steps // search.cycle_saves)
    steps = Steps(period / (search.cycle_saves * stride), search.cycle_saves, stride)
    t = steps.h * np.arange(steps.n_save * steps.stride + 1)
    full = motion.displacement(t)

    # ramped up, from the middle of the motion
    state, springs = Across(*np.zeros((6, n))), body.open_springs()
    for i in range(search.ramp_periods):
        share = (i + t / period) / search.ramp_periods
        body.march(state, springs, contact, full * (share**2 * (3.0 - 2.0 * share))[:, None], steps)

    moving = (state.u, state.v, state.psi, state.spin)
    mass, inertia = body.mobility
    free = bool(mass.any()) or inertia > 0.0
    saved = None
    for _ in range(search.most_periods):
        first = np.concatenate(moving)
        state_0, springs_0 = copied(state), copied_springs(springs)
        previous, saved = saved, body.march(state, springs, contact, full, steps)
        scale = float(np.abs(saved.force).max()) or 1.0
        if previous is not None:
            error = float(np.abs(saved.force - previous.force).max()) / scale
            # u and psi of a sphere without an arm may drift
            if error <= search.periodicity:
                break
        if not free:
            continue

        # Newton: (1 - J) dz = Phi(z) - z, columns of J from periods that start a little beside
        residual = np.concatenate(moving) - first
        sizes = [np.abs(values).max() for values in (saved.u, saved.v, saved.psi, saved.spin)]
        nudges = search.nudge * np.repeat(sizes, n)
        J = np.zeros((4 * n, 4 * n))
        for column in np.flatnonzero(nudges):
            beside, springs_beside = copied(state_0), copied_springs(springs_0)
            nudge = np.where(np.arange(4 * n) == column, nudges, 0.0)
            body.displace(beside, springs_beside, overlap, nudge)
            body.march(beside, springs_beside, contact, full, steps)
            after = np.concatenate((beside.u, beside.v, beside.psi, beside.spin))
            J[:, column] = (after - first - residual) / nudges[column]
        units = np.where(nudges > 0.0, nudges, 1.0)
        matrix = (np.eye(4 * n) - J) * units / units[:, None]
        step = units * np.linalg.lstsq(matrix, residual / units, rcond=1e-6)[0]
        body.displace(state, springs, overlap, first + step - np.concatenate(moving))
    else:
        raise UnstableStep(
            f"the wall's motion leads to no periodic state within {search.most_periods} periods: "
            f"the force still changes by {error:.1g} of its largest; hold the sphere by [arm], or "
            "change the amplitude"
        )
    frame = body.frame
    cycle = Cycle(
        t[:: steps.stride] - period,
        saved.force @ frame,
        (saved.slip - saved.slip.mean(axis=0)) @ frame,
        saved.u @ frame,
        saved.stick,
        float(saved.energy[-1, 4] - saved.energy[0, 4]),
        error,
        float(np.hypot(*((state.u - state_0.u) @ frame))),
    )
    # slip counts from the middle of the period, heat from the striker on
    state.slip[:] = (saved.slip - saved.slip.mean(axis=0))[-1]
    (springs.row if springs.cells is None else springs.cells).state[HEAT] = 0.0
    return state, springs, cycle
