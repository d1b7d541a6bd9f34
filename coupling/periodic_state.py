"""The periodic state that shakers bring chain, frictional contact and structure into.

By harmonic balance, proven by periods that are marched, or as a fixed point of the period map
(`coupling.period_map`).
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from beadwave.coupling.harmonic_balance import (
    N_LAPS,
    Balance,
    answer,
    balance,
    cycle_of,
    let_go,
    resampled,
)
from beadwave.coupling.period_map import (
    USUAL_PERIODIC_SEARCH,
    CycleNumbers,
    PeriodicCycle,
    PeriodicSearch,
    fixed_point,
    refined,
    settled,
)
from beadwave.coupling.spatial_march import Before, MarchState, PreparedImpact, along_normal
from beadwave.dem import UnstableStep
from beadwave.dem.friction import gross_slip, redivided, stick_stiffness
from beadwave.dem.kernels.arguments import Array, Steps
from beadwave.dem.kernels.spatial import (
    BEYOND_MODES,
    BY_CONTACT,
    BY_SHAKERS,
    DAMPED,
    RUBBED,
    SWING,
    SavedSpatial,
    SpatialSystem,
)
from beadwave.dem.kernels.tangential import HEAT
from beadwave.dem.lateral import Cycle
from beadwave.dem.prepared import prepare
from beadwave.dem.richardson import richardson


class PeriodicState(NamedTuple):
    """A state at t = 0 that comes back, and its last cycle."""

    moving: MarchState
    cycle: Cycle
    force: Array  # (k, 3) [N] on the wall along n, t1, t2 over the cycle
    slip_mean: Array  # (2,) [m] middle of the slip, from which that of the cycle counts
    wall_speed: float  # [m/s] largest, of the contact's point of the wall
    n_periods: int  # of the shakers until the state comes back
    impacting: bool  # the contact opens within the cycle
    # [J] a period, of the shakers and lost by friction, in contacts' dampers, in the wall's modes
    work: float
    heat: float
    lost_in_dampers: float
    lost_in_wall: float
    error_estimate: float  # of velocities over the largest, from the steps of a period

    @property
    def balance(self) -> float:
        """Difference of the shakers' work from all losses of a cycle, over that work."""
        lost = self.heat + self.lost_in_dampers + self.lost_in_wall
        return abs(self.work - lost) / (abs(self.work) or 1.0)


class Period(NamedTuple):
    """Marches of whole periods by equal steps: a `period_map.PeriodMap` of states z
    (2 (n + 2 n_directions + k),)."""

    body: PreparedImpact
    before: Before
    system: SpatialSystem
    steps: Steps

    def march(self, moving: MarchState) -> SavedSpatial:
        """A period on from t = -T, in place, to t = 0. Raises UnstableStep."""
        duration = self.steps.h * self.steps.n_save * self.steps.stride
        return self.body.march(moving, self.system, -duration, self.steps)

    def place(self, moving: MarchState, z: Array, *, sheared: bool = True) -> None:
        """Bring the bodies to z, in place, and the contact with them, or with its shear as it
        is."""
        shift_before = self.shift_of(moving)
        motion, n, d = moving.motion, moving.motion.x.size, moving.motion.u.size
        k = motion.q.size
        parts = np.split(z, np.cumsum([n, d, d, k, n, d, d]))
        rest = self.system.arrays.rest
        for values, part in zip(coordinates(moving), parts, strict=True):
            values[:] = part
        motion.x[:] += rest
        motion.pending[:] = 0.0
        if not sheared:
            motion.slip[:] += self.shift_of(moving) - shift_before
            motion.rolled[:] = motion.u - self.system.sphere.radius * motion.psi
        self.body.settle(moving, self.system, 0.0)

    def shift_of(self, moving: MarchState) -> Array:
        """(n_directions,) [m] of the sphere's contact point relative to the wall's modes."""
        motion, arrays = moving.motion, self.system.arrays
        surface = motion.u + self.system.sphere.radius * motion.psi
        return surface - (arrays.phi @ motion.q)[1:]

    def z_of(self, moving: MarchState) -> Array:
        """The bodies' displacements from rest and velocities, (2 (n + 2 n_directions + k),):
        x (n,), u, psi (n_directions,) each, q (k,), then their rates."""
        motion = moving.motion
        return np.concatenate([motion.x - self.system.arrays.rest, *coordinates(moving)[1:]])

    @property
    def rate(self) -> float:
        """[rad/s] of the fastest contact."""
        return self.body.rate

    def linear(self, saved: SavedSpatial | None) -> tuple[Array, Array]:
        """`linear_period`."""
        return linear_period(self, saved)

    def at_level(self, level: float) -> "Period":
        """The map with the shakers' forces times `level`."""
        forcing = self.system.shaking.at_level(level)
        return self._replace(system=self.system._replace(shaking=forcing))

    def work_scale(self, saved: SavedSpatial) -> float:
        """`work_scale`."""
        return work_scale(saved)

    def speeds_of(self, saved: SavedSpatial) -> Array:
        """`speeds_of`."""
        return speeds_of(saved)


def coordinates(moving: MarchState) -> tuple[Array, ...]:
    """The arrays of a state, not copied: x (n,), u, psi (n_directions,), q (k,) and their rates, in
    the order of `Period.z_of`."""
    motion = moving.motion
    return (
        motion.x, motion.u, motion.psi, motion.q, motion.v, motion.u_v, motion.spin, motion.p
    )  # fmt: skip


def period_of(body: PreparedImpact, before: Before, n_steps: int, search: PeriodicSearch) -> Period:
    """Marches of periods by n_steps steps at least, from the instant of the striker."""
    stride = -(-n_steps // search.cycle_saves)
    h = body.shakers.period / (search.cycle_saves * stride)
    system = body.stepped(h, before_striker=before)
    return Period(body, before, system, Steps(h, search.cycle_saves, stride))


def linear_period(period: Period, saved: SavedSpatial | None) -> tuple[Array, Array]:
    """Period map M (2 m, 2 m) of the linear system with m = n + 2 n_directions + k, and weights
    (2 m,) with which sum (weight z)^2 is twice the energy, of the stiffness its diagonal alone.

    The contact across has the stiffness and damping of the cycle that was saved last,
    k = T / X and c = E / (pi omega X^2) with half of peak to peak of force and slip and the heat E;
    before, that of stick.
    """
    body, arrays, sphere = period.body, period.system.arrays, period.system.sphere
    chain, static = body.prepared.chain, body.prepared.static
    n, d, k = chain.mass.size, len(body.frame), body.wall.omega.size
    size = n + 2 * d + k
    inverse = np.concatenate(
        [arrays.inverse_mass, sphere.inverse_mass, np.full(d, sphere.inverse_inertia), np.ones(k)]
    )

    # springs on bodies alone
    leaf = chain.springs[0]
    K = np.diag(
        np.concatenate([leaf, sphere.stiffness, np.full(d, sphere.turn_stiffness), arrays.omega**2])
    )
    D = np.diag(np.concatenate([np.zeros(n + 2 * d), 2.0 * body.wall.zeta * arrays.omega]))

    # contacts of spheres under their static forces
    A, force = arrays.A, static.force
    stiffness = 1.5 * (A**2 * np.maximum(force, 0.0)) ** (1.0 / 3.0)
    for i in range(n - 1):
        b = np.zeros(size)
        b[i], b[i + 1] = 1.0, -1.0
        K += stiffness[i] * np.outer(b, b)
        D += arrays.gamma[i] * force[i] * np.outer(b, b)

    # the contact at the wall, its residual compliance in series
    B = np.zeros((1 + d, size))
    B[0, n - 1] = 1.0
    for j in range(d):
        B[1 + j, n + j], B[1 + j, n + d + j] = 1.0, sphere.radius
    B[:, n + 2 * d :] = -arrays.phi
    a = (max(force[-1], 0.0) / A[-1]) ** (1.0 / 3.0) * math.sqrt(body.last.law.radius)
    springs = np.full(1 + d, float(stick_stiffness(body.last.law, a)))
    springs[0] = stiffness[-1]
    dampers = np.zeros(1 + d)
    dampers[0] = arrays.gamma[-1] * force[-1]
    if saved is not None:
        amplitude, way = 0.5 * np.ptp(saved.force, axis=0)[1:], 0.5 * np.ptp(saved.slip, axis=0)
        moves = way > 1e-3 * way.max(initial=0.0)
        springs[1:][moves] = np.minimum(amplitude[moves] / way[moves], springs[1:][moves])
        heat = float(saved.energy[-1, RUBBED] - saved.energy[0, RUBBED])
        duration = period.steps.h * period.steps.n_save * period.steps.stride
        shakers = period.system.shaking.omega
        omega = float(shakers.min()) if shakers.size else 2.0 * math.pi / duration
        dampers[1:] = heat / (math.pi * omega * max(float(way @ way), 1e-300)) if way.any() else 0.0
    closed = springs > 0.0
    C = np.zeros((1 + d, 1 + d))
    S = arrays.residual[np.ix_(closed, closed)]
    C[np.ix_(closed, closed)] = np.linalg.inv(np.diag(1.0 / springs[closed]) + S)
    K += B.T @ C @ B
    D += B.T @ (dampers[:, None] * B)
    before = body.last.before
    if before is not None:
        a = math.sqrt(before.radius) * (max(force[-2], 0.0) / A[-2]) ** (1.0 / 3.0)
        for j in range(d):
            b = np.zeros(size)
            b[n + j], b[n + d + j] = 1.0, -sphere.radius
            K += float(stick_stiffness(before, a)) * np.outer(b, b)

    # z' = rates z over a period; bodies that are held fast (inverse mass 0) have no weight
    zero, one = np.zeros((size, size)), np.eye(size)
    rates = np.block([[zero, one], [-inverse[:, None] * K, -inverse[:, None] * D]])
    M = expm(rates * (period.steps.h * period.steps.n_save * period.steps.stride))
    mass = np.where(inverse > 0.0, 1.0 / np.where(inverse > 0.0, inverse, 1.0), 0.0)
    stored = np.where(inverse > 0.0, np.diag(K), 0.0)
    weights = np.sqrt(np.concatenate([stored, mass]))
    return M, weights


class RepeatedMotion(NamedTuple):
    """A state that comes back, what a cycle from it saves, and how far both may be trusted."""

    moving: MarchState
    saved: SavedSpatial
    change: float  # from cycle to cycle, over the largest
    error_estimate: float
    n_periods: int
    impacting: bool
    n_steps: int  # of the cycle
    loop_error: float  # [J] of friction's heat in the cycle, from half as many steps and cells
    # (k, n_directions) [N] tangential forces of the cycles that contacts come into which were
    # pushed to either side before; empty where all come into one, None where that is not known
    pushed: list[Array] | None


def periodic_state(
    body: PreparedImpact,
    before: Before,
    *,
    error: float,
    speed: float = 0.0,
    search: PeriodicSearch = USUAL_PERIODIC_SEARCH,
) -> PeriodicState:
    """The state at t = 0 that the shakers keep up, to an error: of velocities over the largest or
    `speed` [m/s], of tangential force and friction's heat over their largest and the shakers' work.

    From a contact that was pressed and never sheared. Raises UnstableStep where 200 periods, one
    after the other, lead to none.
    """
    # by harmonic balance, or where that finds none, or does not know friction between spheres, by
    # Newton's method on marches of a period
    motion, nearby = None, NearbyStates(None, None)
    if body.last.before is None:
        motion, nearby = balanced(body, before, error, speed, search)
    if motion is None:
        motion = shot(body, before, error, speed, search, nearby)
    state, saved, n_periods, T = motion.moving, motion.saved, motion.n_periods, body.shakers.period

    # heat counts from the striker on
    contacts = state.contacts
    for springs in (contacts.row, contacts.cells, contacts.before_row, contacts.before_cells):
        if springs is not None:
            springs.state[HEAT] = 0.0
    state.motion.ledger[:] = 0.0

    # energies of a period of the shakers; a period leaves the bodies as they are, so that the modes
    # lose what contact and shakers do on them, less what their energy still changes by
    frame, Q = body.frame, body.to_frame
    gained = (saved.energy[-1] - saved.energy[0]) / n_periods
    work = float(gained[BY_SHAKERS] + gained[BEYOND_MODES])
    heat, in_dampers = float(gained[RUBBED]), float(gained[DAMPED])
    in_wall = float(gained[BY_CONTACT] + gained[BY_SHAKERS] - gained[SWING])
    middle = 0.5 * (saved.slip.max(axis=0) + saved.slip.min(axis=0)) @ frame
    cycle = Cycle(
        t=np.linspace(-T * n_periods, 0.0, len(saved.stick)),
        friction_force=saved.force[:, 1:] @ frame,
        slip=saved.slip @ frame - middle,
        sphere_t=saved.across[:, 0] @ frame,
        stick_share=saved.stick,
        energy=heat,
        periodicity_error=motion.change,
        drift=float(np.hypot(*((saved.across[-1, 0] - saved.across[0, 0]) @ frame))),
        error_estimate=motion.error_estimate,
        n_steps=motion.n_steps,
        periods=n_periods,
        unbalanced=abs(work - heat - in_dampers - in_wall),
        energy_error=motion.loop_error / n_periods,
    )
    if motion.pushed is not None:
        forces = [saved.force[:-1, 1:], *motion.pushed]
        means = [float((force @ frame)[:, cycle.axis].mean()) for force in forces]
        cycle = cycle._replace(mean_force_range=(min(means), max(means)))
    return PeriodicState(
        moving=state,
        cycle=cycle,
        force=saved.force @ Q,
        slip_mean=middle,
        wall_speed=float(np.abs(saved.wall[:, 1]).max()),
        n_periods=n_periods,
        impacting=motion.impacting,
        work=work,
        heat=heat,
        lost_in_dampers=in_dampers,
        lost_in_wall=in_wall,
        error_estimate=motion.error_estimate,
    )


def work_scale(saved: SavedSpatial) -> float:
    """[J] Work of the shakers in a cycle, or a tenth of what the tangential force does over slip if
    both are in phase: of a contact that all but sticks work and losses are next to rounding."""
    gained = saved.energy[-1] - saved.energy[0]
    in_phase = float(np.max(np.ptp(saved.force[:, 1:], axis=0) * np.ptp(saved.slip, axis=0)))
    return max(abs(float(gained[BY_SHAKERS] + gained[BEYOND_MODES])), 0.1 * in_phase)


def stick_at_rest(body: PreparedImpact) -> tuple[float, float]:
    """Stiffness [N/m] of the contact at rest where all of it sticks, and its bound mu P [N]: two
    thirds of that stiffness times the displacement at gross slip."""
    law, P = body.last.law, float(body.prepared.static.force[-1])
    overlap = (P / float(body.prepared.chain.A[-1])) ** (2.0 / 3.0)
    k = float(stick_stiffness(law, math.sqrt(law.radius * overlap)))
    return k, (2.0 / 3.0) * float(gross_slip(law, overlap)) * k


def least_cycle(body: PreparedImpact) -> tuple[float, float]:
    """Tangential force [N] and slip [m] over which those of smaller cycles are compared: a
    thousandth of the bound, or of the normal force if that is less. A sphere that rolls has next to
    none."""
    k, bound = stick_at_rest(body)
    force = 1e-3 * min(bound, float(body.prepared.static.force[-1]))
    return force, force / (k or math.inf)


def swing_of_force(body: PreparedImpact) -> float:
    """[m/s / N] Speed of the last sphere on its contact after a force that is off: forces
    that differ by dT let a contact of stiffness k swing by dT / k at its rate w, and k = w^2 m. The
    velocities of a cycle do not show that: they are as slow as the wall."""
    inverse_mass, inverse_inertia = body.mobility()
    R = float(body.prepared.chain.radius[-1])
    meets = float(inverse_mass.max()) + R**2 * inverse_inertia
    return meets / body.rate if body.rate > 0.0 else 0.0


def numbers_of(saved: SavedSpatial, speed: float, body: PreparedImpact) -> CycleNumbers:
    """Of a cycle; speeds, and what `swing_of_force` makes of forces, are over `speed` [m/s] where
    no body is faster, and force and slip at least `least_cycle`."""
    speeds, swings = speeds_of(saved), swing_of_force(body) * saved.force[:, 1:]
    largest = np.array([np.ptp(x, axis=0).max() for x in (saved.force[:, 1:], saved.slip)])
    heat = float(saved.energy[-1, RUBBED] - saved.energy[0, RUBBED])
    return CycleNumbers(
        np.column_stack([speeds, swings]) / (max(speed, float(np.abs(speeds).max())) or 1.0),
        np.log(np.maximum(np.maximum(largest, least_cycle(body)), 1e-300)),
        heat / (work_scale(saved) or 1.0),
        np.array([heat]),
    )


def speeds_of(saved: SavedSpatial) -> Array:
    """(k, m) [m/s] of all bodies and the wall's point over a cycle."""
    return np.concatenate([saved.v, saved.across[:, 1], saved.wall[:, 1]], axis=1)


class NearbyStates(NamedTuple):
    """States near to the one that is looked for, on a cycle of harmonic balance."""

    balanced: MarchState | None  # of a cycle that is balanced, but not to the tolerance asked
    unbalanced: MarchState | None  # of one that is not, or whose contact opens


def balanced(
    body: PreparedImpact, before: Before, error: float, speed: float, search: PeriodicSearch
) -> tuple[RepeatedMotion | None, NearbyStates]:
    """The state by harmonic balance (`coupling.harmonic_balance`), to an error, compared with a
    cycle of half as many samples and cells; None where that finds none, or a contact that opens,
    and then states near to it where there are any.

    Periods marched from it by two steps prove it: what they change by vanishes with the step.
    """
    T = body.shakers.period
    nowhere = NearbyStates(None, None)
    if body.prepared.static.force[-1] <= 0.0:
        return None, nowhere
    resolved = search.samples * T * body.rate / (2.0 * math.pi)
    n_samples = search.cycle_saves * 2 ** max(
        1, math.ceil(math.log2(resolved / search.cycle_saves))
    )
    few_samples = n_samples
    two_directions, n_cells, cycle, coarse = len(body.frame) == 2, search.cells, None, None
    order, estimates = 1.0 if two_directions else 2.0, []
    tolerance = search.periodicity * error

    # samples and cells are doubled, each cycle from the one before, until the error is met
    while True:
        divided = body._replace(search=body.search._replace(n_cells=n_cells))
        cycle = balance(divided, before, n_samples, tolerance, search.creep * error, start=cycle)
        if not math.isfinite(cycle.change):
            return None, nowhere
        moving, saved = cycle_of(divided, cycle, search.cycle_saves)
        opens = cycle.answer.elastic[:, -1 - len(body.frame)].min() <= 0.0
        if opens or cycle.change > tolerance:
            near = moving.divided(body.search.n_cells)
            if opens or cycle.change > search.accepted * error:
                return None, NearbyStates(None, near)
            return None, NearbyStates(near, None)
        numbers, estimate = numbers_of(saved, speed, body), math.inf
        if coarse is not None:
            # a turning point that no sample comes nearer to makes cycles alike by chance, more so
            # the swings that its forces excite: by order 1 the difference itself is the error, of
            # which a third, as order 2 says, was half of what the next doubling changed
            missed = abs(heat_of_path(divided, before, cycle) - numbers.loops[0])
            estimate = richardson(numbers.difference(coarse), 2.0, 1.0)
            estimate = max(estimate, missed / (work_scale(saved) or 1.0))
            estimates.append(estimate)
            loop_error = richardson(abs(numbers.loops[0] - coarse.loops[0]), 2.0, order)
            loop_error = max(loop_error, missed)
        if estimate <= search.share * error:
            break
        coarse, n_samples, n_cells = numbers, 2 * n_samples, 2 * n_cells
        # forces as near to each other as bodies that swing by what they differ by may be: the n-th
        # harmonic, half a harmonic off the resonance, moves them by n times its force over k
        fastest = max(speed, float(np.abs(speeds_of(saved)).max()))
        size = float(np.sqrt(np.sum(np.square(cycle.cut.K * cycle.y)) / len(cycle.y)))
        resonant = max(1.0, body.rate * T / (2.0 * math.pi))
        swing = resonant * swing_of_force(body) * size / (search.swing * error)
        tolerance = min(tolerance, fastest / swing) if swing > 0.0 else tolerance
        stuck = len(estimates) > 2 and estimate > search.hopeless * estimates[-3]
        if stuck or n_samples > search.most_samples:
            return None, NearbyStates(moving.divided(body.search.n_cells), None)

    # half the step, four times nearer: what is left of both is not of the steps
    slow, slow_moving = still(body), None
    largest = max(float(np.abs(saved.force[:, 1:]).max()), least_cycle(body)[0])
    off = []
    for times in (1, 2):
        n_steps = max(search.cycle_steps, math.ceil(T * body.rate / search.phase))
        period = period_of(slow, before, times * n_steps, search)
        slow_moving = without_still(body, moving.divided(n_cells))
        period.body.settle(slow_moving, period.system, 0.0)
        marched = period.march(slow_moving)
        off.append((marched.force - saved.force)[:, 1:] / largest)
    extrapolated = np.abs((4.0 * off[1] - off[0]) / 3.0).max()
    if extrapolated > max(search.proven, 2.0 * error):
        return None, NearbyStates(moving.divided(body.search.n_cells), None)
    change = max(cycle.change, cycle.answer.creep)
    if two_directions:
        fine = max(search.ring_cells, 2 * divided.search.n_cells)
        loop_error += abs(heat_of_path(divided, before, cycle, fine) - cycle.answer.heat)
        loop_error += least_heat(body, search.ring_cells)
    pushed = pushed_forces(
        body._replace(search=body.search._replace(n_cells=search.cells)),
        before, few_samples, cycle, search,
    )  # fmt: skip
    repeated = RepeatedMotion(
        moving, saved, change, estimate + change, 1, False, n_samples, loop_error, pushed
    )
    return repeated, nowhere


def remembers(body: PreparedImpact, stick: Array) -> bool:
    """True if a mean force may stay that a cycle with these shares (k,) of sticking area began
    with: where all slips it is forgotten, and a sphere that is free to move or to turn lets it
    go."""
    turns = body.mobility()[1] > 0.0 and body.last.arm_rotation == 0.0
    return bool(stick.min() > 0.0 and body.arm_stiffness().all() and not turns)


def pushed_forces(
    body: PreparedImpact, before: Before, n_samples: int, cycle: Balance, search: PeriodicSearch
) -> list[Array] | None:
    """Tangential forces (n_samples, n_directions) [N] of the neighbouring cycles from contacts
    that were pushed before to either side of what slips most; empty where all come into one, None
    where a cycle is not found."""
    if not remembers(body, cycle.answer.stick):
        return []
    n, law = body.prepared.chain.mass.size, body.last.law
    push = search.pushed * float(gross_slip(law, cycle.cut.rest[n - 1]))
    axis = int(np.ptp(cycle.y[:, n:], axis=0).argmax())
    amplitude = 0.5 * np.ptp(cycle.answer.force[:, n:], axis=0).max()
    forces = []
    for way in (push, -push):
        pushed = np.zeros(len(body.frame))
        pushed[axis] = way
        # its first guess: at one turning point the force reaches its bound
        _, shift, bound = let_go(body, cycle.cut, pushed)
        y = cycle.y.copy()
        y[:, n:] += shift * max(1.0 - amplitude / np.linalg.norm(bound), 0.0)
        pushed_cycle = balance(
            body, before, n_samples, search.pushed_change, search.pushed_creep,
            start=cycle._replace(y=y), pushed=pushed,
        )  # fmt: skip
        if pushed_cycle.change > search.pushed_change:
            return None
        forces.append(pushed_cycle.answer.force[:, n:])
    return forces


def heat_of_path(
    body: PreparedImpact, before: Before, cycle: Balance, n_cells: int | None = None
) -> float:
    """[J] of friction in a period on the path of a cycle, followed between its samples as well; in
    two directions by n_cells cells, None for those that it has."""
    cut, memory, n_samples = cycle.cut, cycle.answer, 4 * len(cycle.y)
    if memory.contacts.cells is not None and n_cells is not None:
        cells = redivided(memory.contacts.cells, n_cells)
        memory = memory._replace(contacts=memory.contacts._replace(cells=cells))
    cut = cut._replace(omega=cut.omega[1] * np.arange(n_samples // 2 + 1))
    return answer(body, before, cut, resampled(cycle.y, n_samples), memory, N_LAPS).heat


def least_heat(body: PreparedImpact, n_cells: int) -> float:
    """[J] that a period loses whose slip reaches one cell in: (2/9) (Q / mu P)^3 (mu P)^2 / k, what
    Mindlin's loop becomes for small forces Q, which slip in 2 Q / (3 mu P) of the area (K. L.
    Johnson, Contact Mechanics (1985), 7.57)."""
    k, bound = stick_at_rest(body)
    return (2.0 / 9.0) * (1.5 / n_cells) ** 3 * bound**2 / k


def still(body: PreparedImpact) -> PreparedImpact:
    """The body, its wall's modes that are much faster than all contacts at rest in their forces:
    their static answer joins the residual compliance. Marches by steps near their period would
    feed them."""
    wall, fast = body.wall, still_modes(body)
    phi, load = (part[fast] / wall.omega[fast, None] for part in (wall.phi, wall.load))
    wall = wall._replace(
        omega=wall.omega[~fast],
        zeta=wall.zeta[~fast],
        phi=wall.phi[~fast],
        load=wall.load[~fast],
        sense=wall.sense[~fast],
        residual_compliance=wall.residual_compliance + phi.T @ phi,
        load_residual=wall.load_residual + phi.T @ load,
    )
    return body._replace(wall=wall, prepared=prepare(body.prepared.chain, along_normal(wall)))


def still_modes(body: PreparedImpact) -> Array:
    """(k,) mask of the modes that `still` leaves at rest."""
    # modes faster than 8 times the contacts' rate are at rest in the forces of a march of periods,
    # whose motion they would change by the square of the inverse; at 4 or less steps of `phase`
    # miss no period
    return np.asarray(body.wall.omega) > 8.0 * body.rate


def without_still(body: PreparedImpact, moving: MarchState) -> MarchState:
    """A state of the body as one of `still(body)`."""
    fast, motion = still_modes(body), moving.motion
    return moving._replace(motion=motion._replace(q=motion.q[~fast], p=motion.p[~fast]))


def with_still(body: PreparedImpact, moving: MarchState, rate: Array) -> MarchState:
    """A state of `still(body)` at t = 0 as one of the body, whose fast modes follow their forces:
    q = push / omega^2, and its rate by that of the push; `rate` (1 + n_directions,) [N/s] of those
    at the wall."""
    fast, motion, wall, shakers = still_modes(body), moving.motion, body.wall, body.shakers
    phi = wall.phi[fast] @ body.to_frame.T
    angle, turning = np.asarray(shakers.phase), 2.0 * np.pi * np.asarray(shakers.frequency)
    from_rest = motion.force - np.append(body.prepared.static.force[-1], np.zeros(len(rate) - 1))
    push = phi @ from_rest + wall.load[fast] @ (shakers.force * np.cos(angle))
    push_rate = phi @ rate - wall.load[fast] @ (shakers.force * turning * np.sin(angle))
    q, p = np.empty((2, fast.size))
    q[~fast], p[~fast] = motion.q, motion.p
    q[fast], p[fast] = push / wall.omega[fast] ** 2, push_rate / wall.omega[fast] ** 2
    return moving._replace(motion=motion._replace(q=q, p=p))


def shot(
    whole: PreparedImpact, before: Before, error: float, speed: float, search: PeriodicSearch,
    nearby: NearbyStates = NearbyStates(None, None),
) -> RepeatedMotion:  # fmt: skip
    """The state by Newton's method on periods marched, from rest or nearby states, to an error
    compared with longer steps and half as many cells; by periods one after the other where it finds
    none. Raises UnstableStep."""
    body = still(whole)
    T = body.shakers.period
    tolerance = search.periodicity * error

    def found(n_steps: int, n_cells: int, last: PeriodicCycle | None) -> PeriodicCycle:
        """The cycle by n_steps a period, from the one before if there is one."""
        period, point = period_of(body, before, n_steps, search), last and last.point
        if last is None:
            state = body._replace(search=body.search._replace(n_cells=n_cells)).at_rest()
        else:
            state = last.moving.divided(n_cells)
        if point is None:
            # from a balanced cycle, from rest, from one that is not balanced: on the way from rest
            # slip may go farther than in the cycle, and left a mean force of 1 % of its amplitude
            # in what sticks. A step of Newton's method may lead to where contacts meet at any
            # speed: then periods are marched one by one
            begins = [(state.copied(), search)]
            for place, near in ((0, nearby.balanced), (1, nearby.unbalanced)):
                if near is not None:
                    near = without_still(whole, near).divided(n_cells)
                    body.settle(near, period.system, 0.0)
                    begins.insert(place, (near, search._replace(levels=())))
            for begin, options in begins:
                try:
                    point = fixed_point(period, begin, options, tolerance)
                except UnstableStep:
                    continue
                if point.change <= search.accepted * error:
                    break
        else:
            point = fixed_point(period, state, search, tolerance, point.jacobian)
        return settled(period, state, point, opens, speed, error, search)

    def opens(saved: SavedSpatial) -> bool:
        """True if the contact at the wall opens."""
        return float(saved.force[:, 0].min()) <= 0.0

    cycle, estimate, loop_errors = refined(
        found, lambda cycle: numbers_of(cycle.saved, speed, body),
        max(search.cycle_steps, math.ceil(T * body.rate / search.phase)),
        body.search.n_cells // 2, error, 1.0 if len(body.frame) == 2 else 2.0, search,
    )  # fmt: skip
    saved, steps = cycle.saved, cycle.period.steps
    rate = (saved.force[-1] - saved.force[-2]) * (search.cycle_saves / T)
    return RepeatedMotion(
        with_still(whole, cycle.moving, rate), saved, cycle.change,
        # what it still changes by from period to period is an error as well
        estimate + cycle.change,
        cycle.n_periods, cycle.impacting, steps.n_save * steps.stride * cycle.n_periods,
        float(loop_errors[0]), None if remembers(whole, saved.stick) else [],
    )  # fmt: skip
