"""The last sphere across the chain, with friction at the wall: its march to an error.

Directions t1, t2 lie in the wall and n points into it, t2 = n x t1. Friction leaves the motion
along the chain alone (Cattaneo and Mindlin take both problems as uncoupled), so that it follows
from that motion: the march along the chain is repeated for the ends of its steps, and a polynomial
is the overlap of the last contact between them. A march across by steps h is of order 2, and errs
by

    e = safety |v_h - v_H| / ((H/h)^2 - 1)

against a coarser one by H, in the velocity of the centre and that of the turn at the surface. In
two directions the coarser one has cells as many times wider, and the powers are 1.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from beadwave.dem.chain import Chain
from beadwave.dem.checks import InvalidChain, positive, require, scalar, vector
from beadwave.dem.friction import open_cells, open_row, redivided, stick_stiffness
from beadwave.dem.kernels.arguments import Array, Steps
from beadwave.dem.kernels.lateral import (
    BY_WALL,
    IN_ARM,
    IN_CONTACTS,
    MOVING,
    RUBBED,
    TURNING,
    Across,
    Pressing,
    SavedAcross,
    Sphere,
    Springs,
    Touch,
    march_across,
)
from beadwave.dem.kernels.oscillators import oscillator_propagator
from beadwave.dem.kernels.tangential import (
    HEAT,
    TangentialLaw,
    cell_force,
    slide,
    slide_cells,
    tangential_force,
)
from beadwave.dem.richardson import richardson
from beadwave.dem.stability import UnstableStep
from beadwave.dem.trajectory import Trajectory, march
from beadwave.dem.walls import Wall


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
        """[s] Shortest common period; raises InvalidChain without one, see `common_period`."""
        return common_period(self.frequency)


def common_period(frequency: ArrayLike, most_cycles: int = 100) -> float:
    """Shortest common period [s] of frequencies (n,) [Hz]: k cycles of the slowest, the least k for
    which the cycles of all others in that time are whole numbers to 1e-9 k. Raises InvalidChain
    where no k up to `most_cycles` is one."""
    frequency = np.asarray(frequency, float)
    slowest = float(frequency.min())
    for cycles in range(1, most_cycles + 1):
        numbers = cycles * frequency / slowest
        if np.abs(numbers - np.round(numbers)).max() < 1e-9 * cycles:
            return cycles / slowest
    raise InvalidChain(
        f"frequencies {', '.join(f'{f:g}' for f in frequency)} Hz have no common period "
        f"within {most_cycles} cycles; take others"
    )


class LateralSearch(NamedTuple):
    """Step-size search of a lateral march.

    The error that is asked for is that of velocities, and of the energy ledger.
    """

    # [s] a step that is given, in place of an error; a periodic state then takes two times the
    # fewest steps that `cycle_steps` and `cycle_phase` allow
    dt: float | None = None
    safety: float = 2.0  # stated error over what the difference says: orders of 2 to 2.5 were seen
    phase: float = 0.2  # of the stiffest contact with the sphere, a first step; not varied
    most_steps: float = 3e8  # about a minute to ten
    # nodes of the contact at an error of 1e-5, as its inverse root, at least a quarter of
    # them: half or a quarter change velocities by less than a thousandth of the error
    capacity: int = 1024
    # of the contact in two directions at an error of 1e-4, as its inverse root; the march
    # that states the error takes half of them and twice the step
    n_cells: int = 128
    chunk: int = 20_000  # steps of the march along the chain that are held in memory

    # the periodic state before the striker, see `state_on_moving_wall`
    # steps of a period, at least: N miss the largest displacement by up to (pi/N)^2 / 2, and the
    # first N is pi / sqrt(error), so that the last of 2 N misses an eighth of the error
    cycle_steps: int = 512
    cycle_phase: float = 0.4  # of the contact that sticks, in a step: its own swing is small
    cycle_saves: int = 512  # instants of a period that are kept
    ramp_periods: int = 4  # over which the wall's motion begins; not varied
    # change of the force between periods, over its largest and over the error that is asked for:
    # of the state that is stated, and of those that are searched for first
    periodicity: float = 1e-3
    rough: float = 1e-1
    nudge: float = 1e-5  # of a period's largest motion: differences for Newton's matrix; not varied
    broyden_periods: int = 8  # with a matrix, until differences make another; not varied
    newton_periods: int = 40  # of the search, before the march of most_periods; not varied
    most_periods: int = 200  # after these there is no periodic state
    subharmonics: int = 4  # periods after which the motion may repeat itself
    # of other starts, which give the range of mean forces to about a hundredth: pushes over gross
    # slip, from 1 on all slips; nodes of the contact; periods after which the force is taken. Not
    # varied
    pushed: float = 2.0
    pushed_capacity: int = 128
    pushed_periods: int = 2


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


class Overlaps(NamedTuple):
    """Of the last sphere's contacts along the chain; None where there is no friction before it."""

    wall: Pressing
    before: Pressing | None

    @classmethod
    def steady(cls, wall: float, before: float | None, duration: float) -> "Overlaps":
        """Constant ones [m]."""
        return cls(
            *(
                None
                if overlap is None
                else Pressing(np.full(2, overlap), np.zeros(2), np.zeros(2), duration, 0.0)
                for overlap in (wall, before)
            )
        )


class Contacts(NamedTuple):
    """Springs of the last sphere's contacts, the second None without friction there."""

    wall: Springs
    before: Springs | None


def pressing(
    chain: Chain, wall: Wall, v0: ArrayLike, trajectory: Trajectory, chunk: int, contact: int = -1
) -> Pressing:
    """Overlap of the last contact, or with -2 of the one before, at the ends of the steps of a
    trajectory from velocities v0 (n,) [m/s], which is marched again, `chunk` steps at a time, where
    these were not saved. Its first two derivatives by time follow from velocities and forces."""
    gamma = 0.0 if chain.gamma is None else float(np.asarray(chain.gamma)[contact])
    n, h = trajectory.n_steps, float(trajectory.t[-1]) / trajectory.n_steps
    gap, rate, bend = np.empty((3, n + 1))
    spring, anchor = chain.springs
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
        # motion of the spheres, of forces before and behind each, and of the wall
        force = np.concatenate([np.zeros((steps + 1, 1)), run.contact_force], axis=1)
        net = force[:, :-1] - force[:, 1:] + chain.steady - spring * (run.x - anchor)
        wall_a = np.zeros(steps + 1)
        if wall.omega.size:  # one oscillator, of the mass 1/phi^2
            omega, decay = wall.omega[0], 2.0 * wall.zeta[0] * wall.omega[0]
            wall_a = wall.phi[0] ** 2 * force[:, -1] - omega**2 * run.wall_x - decay * run.wall_v
        x = np.concatenate([run.x, run.wall_x[:, None]], axis=1)
        v = np.concatenate([run.v, run.wall_v[:, None]], axis=1)
        a = np.concatenate([net / chain.mass, wall_a[:, None]], axis=1)
        rows = slice(first, first + steps + 1)
        for overlap, motion in ((gap, x), (rate, v), (bend, a)):
            overlap[rows] = motion[:, contact - 1] - motion[:, contact]
        first += steps
    return Pressing(gap, rate, bend, h, gamma)


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


def frame_of_motion(
    velocity: Array, stiffness: Array, motion: WallMotion | None
) -> tuple[Array, Array]:
    """Directions (n_directions, 2), in t1 and t2, in which the sphere moves, and the arm's
    stiffness (n_directions,) [N/m] along each; velocity and stiffness (2,) along t1, t2.

    One direction where all motion is along one line and the arm pulls back along it: a contact in
    one direction is exact at any length of a step, that in two takes cells.
    """
    moves = [velocity] if motion is None else [velocity, *np.asarray(motion.amplitude, float)]
    line = max(moves, key=lambda vector: float(np.hypot(*vector)))
    line = line / np.hypot(*line) if line.any() else np.array([1.0, 0.0])
    straight = stiffness[0] == stiffness[1] or 0.0 in line
    straight = straight and all(
        abs(line[0] * y - line[1] * x) <= 1e-12 * np.hypot(x, y) for x, y in moves
    )
    if not straight:
        return np.eye(2), stiffness
    return line[None], np.array([stiffness[int(np.abs(line).argmax())]])


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
    """The last sphere across the chain, at the instants of the trajectory along it from velocities
    v0 (n,) [m/s].

    `error` is relative to the largest speed at the start, across or along; without it `search.dt`
    is the step [s] of the coarser of two marches, which state the error of the finer. Moves along
    one line are exact in the contact, others take cells. Where the wall has a `motion`, all is
    periodic before the striker. Raises InvalidChain for a chain whose contact has no such law,
    UnstableStep where the error takes too many steps, or no state is periodic.
    """
    require_hertz(chain)
    simple = wall is not None and wall.omega.size < 2 and wall.mobility == 0.0
    require(
        simple and wall.residual_compliance == 0.0 and not chain.slides,
        "friction at the wall takes a rigid wall or one of one mode, and no guides; change them",
    )
    dt = search.dt
    require(
        (error is None) != (dt is None), "give either error or search.dt to say how finely to march"
    )
    velocity, stiffness = checked_last_sphere(last)

    frame, k = frame_of_motion(velocity, stiffness, motion)
    straight = len(frame) == 1

    # overlaps of its contacts from the motion along the chain, which friction leaves alone; the
    # speed and the energy that errors are relative to
    n_save, duration = trajectory.t.size - 1, float(trajectory.t[-1])
    if motion is None and not velocity.any():
        return at_rest_across(trajectory)
    require(
        last.before is None or chain.mass.size > 1,
        "friction between spheres takes a chain of two or more; drop it, or add spheres",
    )
    overlaps = Overlaps(pressing(chain, wall, v0, trajectory, search.chunk), None)
    if last.before is not None:
        before = pressing(chain, wall, v0, trajectory, search.chunk, -2)
        overlaps = overlaps._replace(before=before)
    body = MarchedSphere(chain, last, k, frame, 1e-5 if error is None else error, search)
    speed = max(float(np.abs(v0).max()), float(np.hypot(*velocity)))
    if motion is not None:
        speed = max(speed, float(np.abs(motion.speed).max()))
    speed = speed or 1.0
    kinetic = 0.5 * float(np.sum(chain.mass * np.square(v0)))
    spacing = duration / n_save

    # before the striker: at rest, or the wall's motion has become periodic
    state, springs, cycle, before = at_rest(len(frame)), body.open_springs(), None, 0.0
    if motion is not None:
        steady = [None if one is None else float(one.overlap[0]) for one in overlaps]
        state, springs, cycle = state_on_moving_wall(body, steady, motion, speed)
        before = cycle.error_estimate
    state.v[:] += frame @ velocity

    def run(stride: int, n_cells: int) -> tuple[SavedAcross, float]:
        """The march by `stride` steps from save to save, with n_cells cells in two directions."""
        steps = Steps(spacing / stride, n_save, stride)
        divided = copied_springs(springs)
        if not straight:
            divided = Contacts(
                *(one and Springs(None, None, redivided(one.cells, n_cells)) for one in divided)
            )
        return body.march(copied(state), divided, overlaps, motion, steps), steps.h

    # a first step from the stiffest contact
    rate = body.rate([one and float(one.overlap.max()) for one in overlaps])
    first = search.phase / rate if rate > 0.0 else spacing
    stride = max(1, math.ceil(spacing / (first if dt is None else dt) * (1 - 1e-9)))

    # finer marches, each compared with the one before, until velocities and the ledger are right
    n_cells = body.n_cells // 2
    order = 2.0 if straight else 1.0  # cells, 40 and 80 of them, left errors of order 1.1
    coarse, _ = run(stride, n_cells)
    shorter, spent = 2.0, stride
    while True:
        finer = max(stride + 1, math.ceil(shorter * stride))
        if not straight:  # cells and steps together
            finer = stride * 2 ** math.ceil(math.log2(finer / stride))
            n_cells *= finer // stride
        spent += finer * (1 if straight else n_cells // 8)
        if spent * n_save > search.most_steps:
            target = f"dt = {search.dt:g} s" if search.dt else f"error {error:g}"
            raise UnstableStep(
                f"{target} of the lateral motion over {duration:g} s takes more than "
                f"{search.most_steps:.1e} steps; ask for a larger error or for less time"
            )
        saved, h = run(finer, n_cells)
        change = max(
            float(np.abs(saved.v - coarse.v).max()),
            float(chain.radius[-1]) * float(np.abs(saved.spin - coarse.spin).max()),
        )
        estimate = before + richardson(search.safety * change / speed, finer / stride, order)
        total = saved.energy[:, :BY_WALL].sum(axis=1) - saved.energy[:, BY_WALL]
        scale = max(kinetic, float(np.abs(saved.energy).max())) or 1.0
        ledger = float(np.abs(total - total[0]).max()) / scale
        if dt is not None:
            break
        if estimate <= error and ledger <= 0.8 * error:
            break
        excess = max((estimate - before) / (error - before), ledger / (0.8 * error))
        shorter = min(max(1.2, 1.1 * math.sqrt(excess)), 16.0)
        coarse, stride = saved, finer

    # psi is the turn by which the surface moves along t1, t2; about the axes it is n x that
    turned = saved.psi @ frame
    spun = saved.spin @ frame
    return LateralTrajectory(
        t=trajectory.t,
        sphere_t=saved.u @ frame,
        sphere_t_v=saved.v @ frame,
        sphere_rotation=np.stack([0.0 - turned[:, 1], turned[:, 0]], axis=1),
        sphere_spin=np.stack([0.0 - spun[:, 1], spun[:, 0]], axis=1),
        friction_force=saved.force @ frame,
        slip=saved.slip @ frame,
        stick_share=saved.stick,
        wall_t=np.zeros((n_save + 1, 2)) if motion is None else motion.displacement(trajectory.t),
        energy_lateral=saved.energy[:, MOVING],
        energy_rotation=saved.energy[:, TURNING],
        energy_arm=saved.energy[:, IN_ARM],
        energy_tangential=saved.energy[:, IN_CONTACTS],
        dissipated_friction=saved.energy[:, RUBBED],
        work_shaker=saved.energy[:, BY_WALL],
        dt=h,
        n_steps=n_save * finer,
        error_estimate=estimate,
        energy_error=ledger,
        cycle=cycle,
        n_cells=0 if straight else n_cells,
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
        return self.last.mobility(float(self.chain.mass[-1]), self.stiffness)

    @property
    def n_cells(self) -> int:
        """Of the contact in two directions, a multiple of 8."""
        return 8 * math.ceil(self.search.n_cells * math.sqrt(1e-4 / self.error) / 8.0)

    @property
    def laws(self) -> tuple[TangentialLaw, TangentialLaw | None]:
        """Of the contacts at the wall and with the sphere before."""
        return self.last.law, self.last.before

    def rate(self, overlaps: Sequence[float | None]) -> float:
        """[rad/s] of the sphere on contacts that stick, by the mass that their forces meet."""
        k = 0.0
        for law, overlap in zip(self.laws, overlaps, strict=True):
            if law is not None:
                k += float(stick_stiffness(law, math.sqrt(law.radius * max(overlap, 0.0))))
        inverse_mass, inverse_inertia = self.mobility
        meets = float(inverse_mass.max()) + float(self.chain.radius[-1]) ** 2 * inverse_inertia
        return math.sqrt(k * meets)

    def swing(
        self, one: SavedAcross, other: SavedAcross, overlaps: Sequence[float | None]
    ) -> float:
        """[m/s] by which two cycles differ: in velocities of the centre and, by the turn, of the
        surface, and in those of the free motion that starts where the forces of one meet the
        displacements of the other.

        Forces that differ by dT let a contact of stiffness k swing by dT / k at its rate, and the
        arm swings by what displacements and turns differ by, at its own. The velocities of a cycle
        do not show that: they are as slow as the wall.
        """
        R, m = float(self.chain.radius[-1]), float(self.chain.mass[-1])
        inverse_mass, inverse_inertia = self.mobility
        rate, parts = self.rate(overlaps), [one.v - other.v, R * (one.spin - other.spin)]
        if rate > 0.0:
            meets = inverse_mass + R**2 * inverse_inertia  # 1/m of what the force moves: k = w^2 m
            parts.append(meets / rate * (one.force - other.force))
        arm = np.where(inverse_mass > 0.0, np.sqrt(self.stiffness / m), 0.0)
        parts.append(arm * (one.u - other.u))
        if inverse_inertia > 0.0:
            turning = math.sqrt(self.last.arm_rotation * inverse_inertia)
            parts.append(R * turning * (one.psi - other.psi))
        return max(float(np.abs(part).max()) for part in parts)

    def open_springs(self) -> Contacts:
        """Contacts that have not closed yet, with room for the error."""
        fine = math.sqrt(1e-5 / self.error)
        capacity = int(self.search.capacity * min(max(fine, 0.25), 16.0))
        return Contacts(
            *(
                None
                if law is None
                else Springs(None, None, open_cells(self.n_cells))
                if len(self.frame) == 2
                else Springs(open_row(capacity), open_row(capacity), None)
                for law in self.laws
            )
        )

    def displace(
        self, state: Across, springs: Contacts, overlaps: Sequence[float | None], by: Array
    ) -> None:
        """Shift u, v, psi, spin by (4 n_directions,), in place; the contacts, of the overlaps [m],
        follow the sphere, and their forces with them."""
        u, v, psi, spin = np.split(by, 4)
        for values, shift in ((state.u, u), (state.v, v), (state.psi, psi), (state.spin, spin)):
            values += shift
        turned = float(self.chain.radius[-1]) * psi
        sides = zip(self.laws, springs, overlaps, (u + turned, u - turned), strict=True)
        for force, (law, contact, overlap, way) in zip(
            (state.force, state.behind), sides, strict=True
        ):
            if contact is None:
                continue
            if contact.cells is not None:
                slide_cells(contact.cells, law, overlap, 1.0, *way)
                force[:] = cell_force(contact.cells, law)
            else:
                slide(contact.row, contact.room, law, overlap, 1.0, *way)
                force[:] = tangential_force(contact.row, law)

    def march(
        self, state: Across, springs: Contacts, overlaps: Overlaps,
        motion: WallMotion | Array | None, steps: Steps,
    ) -> SavedAcross:  # fmt: skip
        """March state and springs on, in place; `motion` of the wall may be its displacements
        (n_steps + 1, 2) [m]. Raises UnstableStep where a state is not finite."""
        h, n_save, stride = steps
        n, chain = len(self.frame), self.chain
        sphere = self.last.on_arm(float(chain.mass[-1]), float(chain.radius[-1]), self.stiffness, h)
        if isinstance(motion, WallMotion):
            motion = motion.displacement(h * np.arange(n_save * stride + 1))
        wall = None if motion is None else np.ascontiguousarray(motion @ self.frame.T)
        saved = SavedAcross(
            *np.empty((6, n_save + 1, n)), np.empty(n_save + 1), np.empty((n_save + 1, 6))
        )
        contact, before = (
            None if law is None else Touch(law, overlap, contact)
            for law, overlap, contact in zip(self.laws, overlaps, springs, strict=True)
        )
        count = march_across(state, sphere, contact, before, wall, steps, saved)
        if count < n_save:
            raise UnstableStep(
                f"the lateral motion is not finite at t = {count * stride * h:.4g} s; take a "
                "softer arm or a smaller step"
            )
        return saved


def at_rest(n_directions: int) -> Across:
    """A sphere that nothing has moved."""
    return Across(*np.zeros((7, n_directions)))


def copied(state: Across) -> Across:
    """The state in arrays of its own."""
    return Across(*(values.copy() for values in state))


def copied_springs(contacts: Contacts) -> Contacts:
    """The contacts in arrays of their own."""
    return Contacts(
        *(
            springs
            and Springs(*(part and type(part)(*(a.copy() for a in part)) for part in springs))
            for springs in contacts
        )
    )


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


class MarchedPeriod(NamedTuple):
    """A sphere and its contact after a march of a period, and what the march has saved."""

    state: Across
    springs: Contacts
    saved: SavedAcross


class Shaken(NamedTuple):
    """A sphere that is pressed by a constant force on a wall that moves periodically."""

    body: MarchedSphere
    overlaps: Sequence[float | None]  # [m] at the wall and with the sphere before, see `Contacts`
    motion: WallMotion
    periods: int  # of the motion in a march
    n_steps: int  # of a march

    @property
    def pressed(self) -> Overlaps:
        """The overlaps over a march, constant: nothing comes down the chain yet."""
        return Overlaps.steady(*self.overlaps, self.periods * self.motion.period)

    @property
    def steps(self) -> Steps:
        """The steps of a march, at least n_steps, a whole number of them from save to save."""
        n_save = self.body.search.cycle_saves
        stride = -(-self.n_steps // n_save)
        return Steps(self.periods * self.motion.period / (n_save * stride), n_save, stride)

    def displacements(self) -> Array:
        """(n_steps + 1, 2) [m] of the wall at the ends of the steps."""
        h, n_save, stride = self.steps
        return self.motion.displacement(h * np.arange(n_save * stride + 1))

    def march(self, start: Across, springs: Contacts, wall: Array) -> MarchedPeriod:
        """One march from a state, which stays as it is, over the displacements of the wall
        (n_steps + 1, 2) [m]. Raises UnstableStep."""
        state, contact = copied(start), copied_springs(springs)
        saved = self.body.march(state, contact, self.pressed, wall, self.steps)
        return MarchedPeriod(state, contact, saved)

    def ramped(self, pushed: Array) -> tuple[Across, Contacts]:
        """State after ramping the wall's motion up over some periods, on a contact that was
        pressed, pushed to and fro by (n_directions,) [m], and let go where the arm rests under the
        force that it then holds."""
        body, R = self.body, float(self.body.chain.radius[-1])
        state, springs = at_rest(len(body.frame)), body.open_springs()
        if pushed.any():
            for way in (np.zeros_like(pushed), pushed, -pushed):
                body.displace(state, springs, self.overlaps, stacked(u=way))
            state.u[:] = -state.force / body.stiffness
            state.psi[:] = -R * state.force / body.last.arm_rotation
            state.slip[:] = state.u + R * state.psi
        wall, ramp = self.displacements(), self.body.search.ramp_periods
        share = np.linspace(0.0, 1.0, len(wall))[:, None]
        for i in range(ramp):
            x = (i + share) / ramp
            state, springs, _ = self.march(state, springs, wall * x**2 * (3.0 - 2.0 * x))
        return state, springs


def stacked(u: Array) -> Array:
    """A displacement u (n_directions,) [m] of the centre as a change (4 n_directions,) of u, v, psi
    and spin."""
    return np.concatenate((u, np.zeros(3 * u.size)))


def motion_of(state: Across) -> Array:
    """u [m], v [m/s], psi [rad] and spin [rad/s] one after the other, (4 n_directions,)."""
    return np.concatenate((state.u, state.v, state.psi, state.spin))


class ReturningState(NamedTuple):
    """A state that a period leaves as it is, up to `change` of its force over the largest, and of
    its velocities over the wall's."""

    state: Across
    springs: Contacts
    last: MarchedPeriod  # the period that ends there
    change: float
    matrix: Array | None  # (4 n, 4 n) 1 - J in units of the free motion, None where all is held


def returning_state(
    shaken: Shaken, state: Across, springs: Contacts, matrix: Array | None, periodicity: float
) -> ReturningState | None:
    """The periodic state that a start leads to, in which the force changes by `periodicity` of its
    largest from period to period; None where the search does not find it. `matrix` is B
    (4 n_directions, 4 n_directions) of an earlier search, None for none.

    Unknown is the sphere's motion z at the start of a period, which becomes Phi(z). The contact
    keeps what a period has left in it: its memory does not reach beyond the largest motion. Steps
    are those of Broyden's method,

        B dz = Phi(z) - z,    B <- B + (y - B dz) dz^T / dz^T dz,    y = change of z - Phi(z)

    (C. G. Broyden, Math. Comp. 19 (1965) 577), from a B of differences at first and after some
    periods without success. A sphere without an arm drifts freely: dz is the least one.
    """
    body, search, wall = shaken.body, shaken.body.search, shaken.displacements()
    n, R = len(body.frame), float(body.chain.radius[-1])
    mass, inertia = body.mobility
    free = bool(mass.any()) or inertia > 0.0
    B, g, dz = matrix, None, None

    # the free motion between arm and contact has one size in all units: a matrix in units of the
    # slow motion of the wall is so stretched that least squares leave that motion out
    speed = float(np.abs(shaken.motion.speed).max()) or 1.0
    rate = max(body.rate(shaken.overlaps), 2.0 * math.pi / shaken.motion.period)
    units = speed * np.repeat([1.0 / rate, 1.0, 1.0 / (R * rate), 1.0 / R], n)
    previous, age = None, 0
    for i in range(search.newton_periods):
        z = motion_of(state)
        end = shaken.march(state, springs, wall)
        saved = end.saved
        if previous is not None:
            scale = float(np.abs(saved.force).max()) or 1.0
            change = float(np.abs(saved.force - previous).max()) / scale
            # forces of two starts that hardly differ are alike, whether they come back or not
            if free:
                jumps = (z - motion_of(end.state)) / units
                change = max(change, float(np.abs(jumps[n : 2 * n]).max()))
                change = max(change, float(np.abs(jumps[3 * n :]).max()))
            # after so many periods a change is accepted that is small against the error
            late = i == search.newton_periods - 1
            if change <= (max(periodicity, search.rough * body.error) if late else periodicity):
                return ReturningState(end.state, end.springs, end, change, B)
        previous = saved.force
        if not free:
            state, springs = end.state, end.springs
            continue

        # B: column by column from starts next to this one, or Broyden's update from the last step
        g_before, g = g, (z - motion_of(end.state)) / units
        if B is None or age >= search.broyden_periods:
            B, age = np.eye(4 * n), 0
            moves = np.array([saved.u, saved.v, saved.psi, saved.spin]).any(axis=(1, 2))
            for column in np.flatnonzero(np.repeat(moves, n)):
                nudge = np.where(np.arange(4 * n) == column, search.nudge, 0.0)
                neighbour, contact = copied(state), copied_springs(springs)
                body.displace(neighbour, contact, shaken.overlaps, nudge * units)
                after = shaken.march(neighbour, contact, wall)
                moved = (z - motion_of(after.state)) / units + nudge - g
                B[:, column] = moved / search.nudge
        elif g_before is not None:
            y = g - g_before
            B = B + np.outer(y - B @ dz, dz) / (dz @ dz)

        # the step from the end of the period, whose contact it keeps; the least one of a sphere
        # that drifts, whose B is singular
        age += 1
        dz = np.linalg.lstsq(B, -g, rcond=1e-6)[0]
        if not dz.any():
            dz = -g
        state, springs = end.state, end.springs
        body.displace(state, springs, shaken.overlaps, z + units * dz - motion_of(state))
        if not dz.any():
            g = None
    return None


def marched_until_repeated(
    shaken: Shaken, state: Across, springs: Contacts
) -> tuple[ReturningState, int]:
    """State after a march of many periods, each from the end of the last, and the number of them
    after which it repeats itself. Raises UnstableStep where it does not within four."""
    search, wall = shaken.body.search, shaken.displacements()
    forces: list[Array] = []
    for _ in range(search.most_periods):
        end = shaken.march(state, springs, wall)
        state, springs = end.state, end.springs
        forces = [*forces[-search.subharmonics :], end.saved.force]
        changes = repetition(forces)
        for i, change in enumerate(changes):
            if change <= search.rough * shaken.body.error:
                return ReturningState(state, springs, end, change, None), i + 1
    last_changes = ", ".join(f"{change:.1g}" for change in changes)
    raise UnstableStep(
        f"the wall's motion leads to no periodic state: after a march of {search.most_periods} "
        f"periods the force still changes by {last_changes} of its largest from one period, two, "
        "three and four before; hold the sphere by [arm], or change the amplitude"
    )


def repetition(forces: list[Array]) -> list[float]:
    """Changes of the last of several periods' forces, (k, n_directions) [N] each, from that of one,
    two, ... periods before, over its largest."""
    scale = float(np.abs(forces[-1]).max()) or 1.0
    return [float(np.abs(forces[-1] - before).max()) / scale for before in forces[-2::-1]]


def remembers(body: MarchedSphere, stick: Array) -> bool:
    """True if forces of a start may stay, of shares (k,) that stick: a contact that slips as a
    whole in each period forgets them, and a sphere that is free to move or to turn lets them go."""
    turns = body.mobility[1] > 0.0 and body.last.arm_rotation == 0.0
    return stick.min() > 0.0 and body.stiffness.all() and not turns


def pushed_forces(shaken: Shaken, overlap: float) -> list[Array]:
    """Forces (k, n_directions) [N] of the last period, by few steps, from contacts of an overlap
    [m] that were sheared to either side before the wall moved."""
    body = shaken.body
    search = body.search
    push = search.pushed * body.last.law.bound * overlap
    fewer = search._replace(capacity=search.pushed_capacity)
    quick = shaken._replace(body=body._replace(search=fewer))
    forces = []
    for way in (push, -push):
        # periods one after the other: Newton's steps would shear the contact anew
        state, springs = quick.ramped(np.full(len(body.frame), way))
        for _ in range(search.pushed_periods):
            end = quick.march(state, springs, quick.displacements())
            state, springs = end.state, end.springs
        forces.append(end.saved.force)
    return forces


def state_on_moving_wall(
    body: MarchedSphere, overlaps: Sequence[float | None], motion: WallMotion, speed: float
) -> tuple[Across, Contacts, Cycle]:
    """State and contact that the wall's motion has become periodic in, at its phase of t = 0.

    The motion is ramped up over some periods from a contact that was pressed and never sheared;
    the state that follows is searched for by few steps a period and again by twice as many, in two
    directions with twice as many cells, until velocities and heat differ by less than the error:
    both are of order 2, and 1 in the cells. Where the search fails, a march of 200 periods finds
    what repeats itself, or raises UnstableStep.
    """
    search, period, straight = body.search, motion.period, len(body.frame) == 1
    if not straight:
        search = search._replace(n_cells=max(search.n_cells // 2, 1))
        body = body._replace(search=search)
    fewest = max(search.cycle_steps, math.ceil(math.pi / math.sqrt(body.error)))
    n_steps = max(fewest, math.ceil(period * body.rate(overlaps) / search.cycle_phase))
    shaken = Shaken(body, overlaps, motion, 1, n_steps)
    state, springs = shaken.ramped(np.zeros(len(body.frame)))

    # the first search, by few steps, is rough: it only has to lead to the right state
    periodicity = search.periodicity * body.error
    rough = max(periodicity, search.rough * body.error)
    coarse = returning_state(shaken, state, springs, None, rough)
    if coarse is None:
        coarse, periods = marched_until_repeated(shaken, state, springs)
        shaken = shaken._replace(periods=periods, n_steps=periods * n_steps)

    forces = [coarse.last.saved.force]
    if remembers(body, coarse.last.saved.stick) and shaken.periods == 1:
        forces += pushed_forces(shaken, overlaps[0])

    # twice as many steps, until nothing changes by more than half of the error; in two directions
    # both steps and, after them, cells have a quarter. Cells need no further safety besides order
    # 1: 56 to 856 of them left differences of order 1.2 to 1.5
    orders = {"steps": 2.0} if straight else {"steps": 2.0, "cells": 1.0}
    share = 0.5 / len(orders)
    estimate, off = 0.0, 0.0
    for doubled, order in orders.items():
        while True:
            before = coarse.last.saved
            if doubled == "steps":
                shaken = shaken._replace(n_steps=2 * shaken.n_steps)
            else:
                search = search._replace(n_cells=2 * search.n_cells)
                body = body._replace(search=search)
                divided = [
                    contact and Springs(None, None, redivided(contact.cells, body.n_cells))
                    for contact in coarse.springs
                ]
                shaken = shaken._replace(body=body)
                coarse = coarse._replace(springs=Contacts(*divided))
            if shaken.n_steps * (1 if straight else body.n_cells / 8) > search.most_steps:
                raise UnstableStep(
                    f"the periodic state takes more than {search.most_steps:.1e} steps a period, "
                    "or as many cells; ask for a larger error"
                )
            finer = returning_state(
                shaken, coarse.state, coarse.springs, coarse.matrix, periodicity
            )
            if finer is None:
                finer, repeats = marched_until_repeated(shaken, coarse.state, coarse.springs)
                if repeats > 1:  # by these steps all repeats itself later: cycles of that length
                    shaken = shaken._replace(
                        periods=repeats * shaken.periods, n_steps=repeats * shaken.n_steps
                    )
                    end = shaken.march(finer.state, finer.springs, shaken.displacements())
                    coarse = finer._replace(state=end.state, springs=end.springs, last=end)
                    continue
            saved = finer.last.saved
            safety = search.safety if doubled == "steps" else 1.0
            swing = safety * body.swing(saved, before, overlaps) / speed
            heat = np.array([np.ptp(cycle.energy[[0, -1], RUBBED]) for cycle in (before, saved)])
            of_speeds = richardson(swing, 2.0, order)
            of_heat = richardson(safety * abs(heat[1] - heat[0]), 2.0, order)
            close = of_heat <= share * body.error * float(np.abs(saved.energy).max())
            coarse = finer
            if search.dt is not None or (of_speeds <= share * body.error and close):
                break
        estimate, off = estimate + of_speeds, off + of_heat

    saved, frame = finer.last.saved, body.frame
    slip = saved.slip - saved.slip.mean(axis=0)
    h, _, stride = shaken.steps
    times = h * stride * np.arange(len(saved.u)) - shaken.periods * period
    cycle = Cycle(
        t=times,
        friction_force=saved.force @ frame,
        slip=slip @ frame,
        sphere_t=saved.u @ frame,
        stick_share=saved.stick,
        energy=float(heat[1]) / shaken.periods,
        periodicity_error=finer.change,
        drift=float(np.hypot(*((saved.u[-1] - saved.u[0]) @ frame))),
        error_estimate=estimate,
        energy_error=off / shaken.periods,
        n_steps=shaken.steps.n_save * shaken.steps.stride,
        periods=shaken.periods,
    )
    forces[0] = saved.force
    means = [float((force @ frame)[:-1, cycle.axis].mean()) for force in forces]
    cycle = cycle._replace(mean_force_range=(min(means), max(means)))
    # slip counts from the middle of the period, heat from the striker on
    state, springs = copied(finer.state), copied_springs(finer.springs)
    state.slip[:] = slip[-1]
    for contact in springs:
        if contact is not None:
            (contact.row if contact.cells is None else contact.cells).state[HEAT] = 0.0
    return state, springs, cycle
