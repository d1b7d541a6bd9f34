"""The periodic state that shakers bring several chains and their structure into.

A fixed point of the period map (`coupling.period_map`) of a packing: displacements of its spheres
along what their guides leave free, turns of those that have arms, and modes. Contacts that rub by
exact springs keep what a period leaves in them. By longer and longer searches, each with half the
step and twice the cells, until two of them agree.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from beadwave.coupling.period_map import (
    USUAL_PERIODIC_SEARCH,
    CycleNumbers,
    FixedPoint,
    PeriodicCycle,
    PeriodicSearch,
    fixed_point,
    refined,
    settled,
    step_of,
)
from beadwave.dem import UnstableStep
from beadwave.dem.friction import stick_stiffness
from beadwave.dem.kernels.arguments import Array, Steps
from beadwave.dem.kernels.crew import Crew
from beadwave.dem.kernels.shaking import ModalShakerForces
from beadwave.dem.kernels.tangential import TangentialLaw
from beadwave.dem.lateral import Cycle
from beadwave.dem.schemes import SCHEMES
from beadwave.dem.space import Packing, RowRun, Rows, Structure, kernel, struck
from beadwave.dem.space.march import (
    SpaceErrors,
    SpaceState,
    SpaceTrajectory,
    arrays,
    dampers,
    fastest_rate,
    march,
    march_to_error,
    prepared,
    resume,
    room,
    state_of,
)
from beadwave.dem.space.structure import contact_forces_at_rest, residual_matrices, residuals

STICKS = 0.9  # share of a contact's area, from which on its cycle is near the linear one
CELLS = 128  # of each contact at first, doubled with the steps
# of a contact's normal force, over which smaller amplitudes are compared: of a contact that all but
# sticks, at 0.5 %, they change by 6e-5 of themselves still from 32,768 steps to 65,536
LEAST_FORCE = 0.02
SCHEME = SCHEMES["verlet"]


class MovingPacking(NamedTuple):
    """A packing on its way, changed in place."""

    motion: kernel.SpaceMotion
    parts: kernel.Parts

    def copied(self) -> "MovingPacking":
        """A copy in arrays of its own; what a march only reads is shared, and its working room."""
        springs, arms, plastic, modes = (
            getattr(self.parts, name) for name in ("springs", "arms", "plastic", "modes")
        )
        if springs is not None:
            names = ("u", "state", "slip", "rate", "pressed")
            springs = springs._replace(**{name: getattr(springs, name).copy() for name in names})
        if plastic is not None:
            plastic = type(plastic)(*(values.copy() for values in plastic))
        arms = arms and arms._replace(angle=arms.angle.copy())
        names = ("q", "p", "v", "work", "shaken")
        modes = modes._replace(**{name: getattr(modes, name).copy() for name in names})
        motion = type(self.motion)(*(values.copy() for values in self.motion))
        parts = self.parts._replace(springs=springs, arms=arms, plastic=plastic, modes=modes)
        return MovingPacking(motion, parts)


class PackingCycle(NamedTuple):
    """States saved over a cycle at k instants: of s spheres, r directions of a structure and c
    contacts, m of which rub by exact springs."""

    x: Array  # (k, 3 s) [m] displacements
    v: Array  # (k, 3 s) [m/s]
    turned: Array  # (k, 3 s) [m/s] of the surfaces by their spin
    wall_v: Array  # (k, r) [m/s]
    pressed: Array  # (k, c) [N] of all contacts, dampers included
    force: Array  # (k, r) [N] on the structure
    friction: Array  # (k, m, 2) [N] on the second body, along the contacts' frames
    slip: Array  # (k, m, 2) [m] of the first over the second surface
    stick: Array  # (k, m) share of the area; 1 where nothing rubs
    heat: Array  # (k, m) [J] of friction so far
    energy: Array  # (k, 16) [J] as of `dem.space.kernel`


class Coordinates(NamedTuple):
    """Free motions: a displacements and b turns of spheres."""

    sphere: Array  # (a,) which moves
    axis: Array  # (a, 3) unit vectors
    turner: Array  # (b,) which turns
    arm: Array  # (b,) the arm that knows its angle
    turn: Array  # (b, 3) unit vectors


class PackingPeriod(NamedTuple):
    """Marches of whole periods by equal steps: a `period_map.PeriodMap` of states z
    (2 (a + b + k),), displacements, turns and modes, then their rates."""

    packing: Packing
    structure: Structure
    in_march: kernel.SpaceArrays
    shaking: ModalShakerForces
    steps: Steps
    coordinates: Coordinates
    approach: Array  # (c, n) of the bodies at each contact, n = a + b + k
    way: Array  # (m, 2, n) of the second over the first surface, along the contact's frame
    turning: Array  # (n, n) [N/m] of forces at rest, as lines of centres turn
    rate: float  # [rad/s] of the fastest contact

    @property
    def duration(self) -> float:
        """[s] of the period."""
        return self.steps.h * self.steps.n_save * self.steps.stride

    def march(self, moving: MovingPacking) -> PackingCycle:
        """A period on, in place. Raises UnstableStep."""
        modes = moving.parts.modes._replace(shaking=self.shaking)
        parts = moving.parts._replace(modes=modes)
        spheres = np.arange(len(self.packing.mass))
        out = room(self.packing, spheres, self.steps.n_save + 1, self.structure)
        rule = (SCHEME.a, SCHEME.b), self.steps, out, alone()
        count = kernel.march(moving.motion, self.in_march, parts, *rule)
        if count < self.steps.n_save:
            raise UnstableStep(
                "the state under the shakers is not finite; take a softer arm, or weaker shakers"
            )
        return self._cycle(out)

    def _cycle(self, out: kernel.SpaceSaved) -> PackingCycle:
        k, springs = len(out.energy), self.packing.springs
        friction, stick = np.zeros((k, 0, 2)), np.ones((k, 1))
        if springs is not None:
            of_contacts = out.traction[:, np.searchsorted(out.contacts, springs.contact)]
            friction = np.einsum("kmx,mtx->kmt", of_contacts, springs.frame)
            stick = out.stick
        turned = self.packing.radius[:, None] * out.spin if out.spin.size else out.spin
        return PackingCycle(
            out.u.reshape(k, -1), out.v.reshape(k, -1), turned.reshape(k, -1), out.wall[:, 1],
            out.force, out.wall[:, 2], friction, out.slip, stick, out.rubbed, out.energy,
        )  # fmt: skip

    def place(self, moving: MovingPacking, z: Array, *, sheared: bool = True) -> None:
        """Bring spheres and modes to z, in place, and the contacts with them, or with their shear
        as it is."""
        motion, modes, arms = moving.motion, moving.parts.modes, moving.parts.arms
        to, before = self.coordinates, self.z_of(moving)
        a, b, k = len(to.sphere), len(to.turner), modes.q.size
        u, angle, q, v, spin, p = np.split(z, np.cumsum([a, b, k, a, b]))
        places, speeds = _in_space(to.sphere, to.axis, u, v, len(motion.u))
        turns, spins = _in_space(to.turner, to.turn, angle, spin, len(motion.u))
        modes.q[:] = q
        if sheared:
            # one drift of 1 s without any kick: velocities are ways, and modes are there already
            motion.v[:], motion.spin[:], modes.p[:] = places - motion.u, turns, 0.0
            if arms is not None:
                motion.spin[arms.sphere] -= arms.angle
            still = np.zeros_like(modes.propagator)
            still[:, [0, 3]] = 1.0
            at_rest = modes._replace(propagator=still, shaking=self.shaking.at_level(0.0))
            parts = moving.parts._replace(modes=at_rest)
            out = room(self.packing, np.zeros(0, np.int64), 2, self.structure)
            rule = (np.ones(1), np.zeros(2)), Steps(1.0, 1, 1), out, alone()
            kernel.march(motion, self.in_march, parts, *rule)
        else:
            if moving.parts.springs is not None:
                moved = (z - before)[: self.way.shape[2]]
                moving.parts.springs.slip[:] += self.way @ moved
            kernel.along_directions.py_func(modes.phi @ q, motion.point, modes)
            motion.pressed_point[:] = motion.point
        motion.u[:], motion.v[:], motion.spin[:], modes.p[:] = places, speeds, spins, p
        if arms is not None:
            arms.angle[:] = turns[arms.sphere]
        modes.v[:] = modes.phi @ p
        kernel.along_directions.py_func(modes.v, motion.point_v, modes)

    def z_of(self, moving: MovingPacking) -> Array:
        """Displacements, turns and modes, then their rates."""
        motion, of = moving.motion, self.coordinates
        modes, arms = moving.parts.modes, moving.parts.arms
        u, v = (np.einsum("ax,ax->a", of.axis, x[of.sphere]) for x in (motion.u, motion.v))
        angle, spin = np.zeros((2, 0))
        if arms is not None:
            angle = np.einsum("bx,bx->b", of.turn, arms.angle[of.arm])
            spin = np.einsum("bx,bx->b", of.turn, motion.spin[of.turner])
        return np.concatenate([u, angle, modes.q, v, spin, modes.p])

    def linear(self, saved: PackingCycle | None) -> tuple[Array, Array]:
        """Period map of the linear system, and the weights of its energy; contacts that rub have
        the stiffness T / X and the damping E / (pi omega X^2) of the cycle that was saved last,
        from half of peak to peak of force and way and the heat E; before, that of stick."""
        packing, structure, of = self.packing, self.structure, self.coordinates
        a, b, k = len(of.sphere), len(of.turner), len(structure.omega)
        pressed = contact_forces_at_rest(packing, structure)
        closed = pressed > 0.0
        k_n = 1.5 * (packing.A**2 * pressed) ** (1.0 / 3.0)
        damping, springs = dampers(packing), packing.springs
        c_n = np.zeros(len(k_n)) if damping is None else damping.gamma * pressed

        # contacts along their normals, and of those that rub all three directions together
        K = self.turning + np.diag(np.concatenate([np.zeros(a + b), structure.omega**2]))
        D = np.diag(np.concatenate([np.zeros(a + b), 2.0 * structure.zeta * structure.omega]))
        rubbing = np.zeros(0, np.int64) if springs is None else springs.contact
        along = np.setdiff1d(np.flatnonzero(closed), rubbing)
        share = 1.0 / (1.0 / k_n[along] + residuals(packing, structure)[0][along])
        K += self.approach[along].T @ (share[:, None] * self.approach[along])
        D += self.approach.T @ (c_n[:, None] * self.approach)
        for m in np.flatnonzero(closed[rubbing]):
            c = rubbing[m]
            law = TangentialLaw(*(values[m] for values in springs.law), 0.0)
            radius = math.sqrt(law.radius) * (pressed[c] / packing.A[c]) ** (1.0 / 3.0)
            k_t, c_t = np.full(2, float(stick_stiffness(law, radius))), np.zeros(2)
            if saved is not None:
                force, way = (0.5 * np.ptp(x[:, m], axis=0) for x in (saved.friction, saved.slip))
                moves = way > 1e-3 * way.max(initial=0.0)
                k_t[moves] = np.minimum(force[moves] / way[moves], k_t[moves])
                omega = float(self.shaking.omega.min())
                heat = float(saved.heat[-1, m] - saved.heat[0, m])
                c_t[moves] = heat / (math.pi * omega * max(float(way @ way), 1e-300))
            B = np.vstack([self.approach[c], self.way[m]])
            S = residual_matrices(packing, structure, np.array([c]))[0]
            S[0, 1:], S[1:, 0] = -S[0, 1:], -S[1:, 0]  # the force across is on the first body
            stiff = np.append(k_n[c], k_t)
            acts = stiff > 0.0
            K += B[acts].T @ np.linalg.solve(
                np.diag(1.0 / stiff[acts]) + S[np.ix_(acts, acts)], B[acts]
            )
            D += self.way[m].T @ (c_t[:, None] * self.way[m])
        for sphere, line in zip(packing.held.sphere, packing.held.line, strict=True):
            pull = np.zeros(len(K))
            pull[:a] = (of.sphere == sphere) * (of.axis @ line)
            K += np.outer(pull, pull)
        if b:
            K[a : a + b, a : a + b] += np.diag(packing.arms.stiffness[of.arm])

        mass = np.concatenate([packing.mass[of.sphere], packing.inertia[of.turner], np.ones(k)])
        zero, one = np.zeros(K.shape), np.eye(len(K))
        rates = np.block([[zero, one], [-K / mass[:, None], -D / mass[:, None]]])
        weights = np.sqrt(np.concatenate([np.maximum(np.diag(K), 0.0), mass]))
        return expm(rates * self.duration), weights

    def at_level(self, level: float) -> "PackingPeriod":
        """The map with the shakers' forces times `level`."""
        return self._replace(shaking=self.shaking.at_level(level))

    def work_scale(self, saved: PackingCycle) -> float:
        """[J] Work of the shakers in a cycle, or a tenth of what the contacts' tangential forces do
        over slip if both are in phase."""
        work = float(saved.energy[-1, kernel.OF_SHAKERS] - saved.energy[0, kernel.OF_SHAKERS])
        in_phase = np.ptp(saved.friction, axis=0) * np.ptp(saved.slip, axis=0)
        return max(abs(work), 0.1 * float(in_phase.max(initial=0.0)))

    def speeds_of(self, saved: PackingCycle) -> Array:
        """(k, n) [m/s] of the spheres, of their surfaces by their turns, and of the structure."""
        return np.hstack([saved.v, saved.turned, saved.wall_v])


def _in_space(of: Array, axis: Array, values: Array, rates: Array, s: int) -> tuple[Array, Array]:
    """Vectors (s, 3) whose components along the axes (a, 3) of spheres `of` (a,) these are."""
    out = np.zeros((2, s, 3))
    for vectors, components in zip(out, (values, rates), strict=True):
        np.add.at(vectors, of, components[:, None] * axis)
    return out[0], out[1]


def alone() -> Crew:
    """A march in one thread."""
    return Crew(0, 1, np.zeros(3, np.int64))


def coordinates_of(packing: Packing) -> Coordinates:
    """The displacements that the guides leave free, and the turns of spheres with arms."""

    def free(projectors: Array) -> tuple[Array, Array]:
        values, vectors = np.linalg.eigh(projectors)
        which, column = np.nonzero(values > 0.5)
        return which, vectors[which, :, column]

    arms, guides = packing.arms, packing.guides
    if arms is None:
        return Coordinates(*free(guides.motion), *np.zeros((2, 0), np.int64), np.zeros((0, 3)))
    arm, turn = free(guides.turn[arms.sphere])
    return Coordinates(*free(guides.motion), arms.sphere[arm], arm, turn)


def deformations(
    packing: Packing, structure: Structure, of: Coordinates
) -> tuple[Array, Array, Array]:
    """Approach (c, n) of the bodies at each contact, and way (m, 2, n) of the second over the first
    surface at those that rub by springs, of displacements, turns and modes; and the stiffness
    (n, n) [N/m] of two spheres pressed by N at a distance r, whose line turns: -N/r across it."""
    a, b = len(of.sphere), len(of.turner)
    e = packing.arm / np.linalg.norm(packing.arm, axis=1)[:, None]

    def seen(body: int, line: Array) -> Array:
        """(n,) displacement along a line (3,) of a sphere, or of a point of the structure."""
        row = np.zeros(a + b + len(structure.omega))
        if body >= 0:
            row[:a] = (of.sphere == body) * (of.axis @ line)
        else:
            of_point = structure.point == -2 - body
            row[a + b :] = (structure.direction[of_point] @ line) @ structure.phi[of_point]
        return row

    approach = np.array([
        seen(i, line) - (0.0 if j == -1 else seen(j, line))
        for (i, j), line in zip(packing.pairs, e, strict=True)
    ])  # fmt: skip
    turning = np.zeros((approach.shape[1],) * 2)
    pressed = contact_forces_at_rest(packing, structure)[: packing.n_pairs]
    for c in np.flatnonzero(pressed > 0.0):
        i, j = packing.pairs[c]
        for line in np.linalg.svd(e[c][None])[2][1:]:
            row = seen(j, line) - seen(i, line)
            if row.any():
                turning -= pressed[c] / packing.length[c] * np.outer(row, row)
    springs = packing.springs
    if springs is None:
        return approach, np.zeros((0, 2, approach.shape[1])), turning
    way = np.zeros((len(springs.contact), 2, approach.shape[1]))
    share = arrays(packing, structure).share
    for m, c in enumerate(springs.contact):
        i, j = packing.pairs[c]
        for t, line in enumerate(springs.frame[m]):
            row = seen(j, line) - seen(i, line)
            lever = np.cross(e[c], line) * packing.length[c]  # of a turn s: -(s x e) . t
            for sphere, part in ((i, share[c, 0]), (j, share[c, 1])):
                row[a : a + b] -= part * (of.turner == sphere) * (of.turn @ lever)
            way[m, t] = row
    return approach, way, turning


def period_of(
    packing: Packing, structure: Structure, n_steps: int, search: PeriodicSearch
) -> tuple[PackingPeriod, MovingPacking]:
    """Marches of periods by n_steps steps at least, and the packing at rest."""
    stride = -(-n_steps // search.cycle_saves)
    steps = Steps(
        structure.shakers.period / (search.cycle_saves * stride), search.cycle_saves, stride
    )
    still = np.zeros((len(packing.mass), 3))
    motion, parts = prepared(packing, structure, still, steps.h * SCHEME.a)
    of = coordinates_of(packing)
    period = PackingPeriod(
        packing, structure, arrays(packing, structure), parts.modes.shaking, steps, of,
        *deformations(packing, structure, of), fastest_rate(packing, still),
    )  # fmt: skip
    return period, MovingPacking(motion, parts)


def repeated(
    period: PackingPeriod,
    begin: MovingPacking,
    search: PeriodicSearch,
    tolerance: float,
    before: FixedPoint | None,
    *,
    at_rest: bool,
) -> FixedPoint | None:
    """A state that a period brings back, near `begin`, with the Jacobian of the search `before`, or
    from rest; None where no march is finite.

    From rest first by the linear system's own cycle: where contacts all but stick they are lightly
    damped resonators, in which levels of the shakers leave oscillations far beyond their cycle.
    Where slip reaches far, that cycle may shear contacts more than the true one does, and the
    search by rising levels finds it.
    """
    at_once, jacobian = search._replace(levels=(), settling=0), before and before.jacobian
    ways = (True, False) if at_rest else (False,)
    best = None
    for linear in ways:
        try:
            start = linear_cycle(period, begin) if linear else begin.copied()
            how = search if at_rest and not linear else at_once
            point = fixed_point(period, start, how, tolerance, jacobian)
        except UnstableStep:  # a Newton step may lead to where spheres meet at any speed
            continue
        if best is None or point.change <= max(tolerance, best.change):
            best = point
        if point.change <= tolerance and point.saved.stick.min() > STICKS:
            break
    return best


def linear_cycle(period: PackingPeriod, at_rest: MovingPacking) -> MovingPacking:
    """The packing where the linear system's period brings it back, from contacts at rest."""
    first, moving = at_rest.copied(), at_rest.copied()
    period.march(first)
    M, weights = period.linear(None)
    period.place(moving, step_of(M, weights, period.z_of(first)))
    return moving


def numbers_of(period: PackingPeriod, saved: PackingCycle, speed: float) -> CycleNumbers:
    """Of a cycle; speeds are over `speed` [m/s] where no body is faster, and amplitudes of a
    contact at least LEAST_FORCE of its normal force at rest, and the way that this shears it."""
    speeds = period.speeds_of(saved)
    scale = max(speed, float(np.abs(speeds).max())) or 1.0
    loops = saved.heat[-1] - saved.heat[0]
    force, way = (np.ptp(x, axis=0).max(axis=1, initial=0.0) for x in (saved.friction, saved.slip))
    springs = period.packing.springs
    if springs is None:
        return CycleNumbers(speeds / scale, np.zeros(0), 0.0, loops)
    pressed = contact_forces_at_rest(period.packing, period.structure)[springs.contact]
    modulus, _, radius = springs.law
    depth = (pressed / period.packing.A[springs.contact]) ** (2.0 / 3.0)
    k = 2.0 * modulus * np.sqrt(radius * depth)
    least = LEAST_FORCE * pressed
    both = np.maximum(force, least), np.maximum(way, least / np.where(k > 0.0, k, np.inf))
    work = period.work_scale(saved) or 1.0
    logs = np.log(np.maximum(np.concatenate(both), 1e-300))
    return CycleNumbers(speeds / scale, logs, float(loops.sum()) / work, loops)


class ShakenState(NamedTuple):
    """A state at t = 0 that comes back, and its last cycle."""

    state: SpaceState
    saved: PackingCycle
    duration: float  # [s] of the cycle
    n_periods: int  # of the shakers until it comes back
    n_steps: int  # of the cycle
    n_cells: int  # of each contact that rubs
    change: float  # from cycle to cycle, over the largest
    fastest: float  # [m/s] of all bodies
    error_estimate: float  # of velocities over the largest, amplitudes and heat; inf: unknown
    loop_errors: Array  # (m,) [J] of friction's heat in the cycle of each contact
    unbalanced: float  # [J] shakers' work less all losses of a period


def shaken_state(
    packing: Packing,
    structure: Structure,
    *,
    error: float,
    speed: float = 0.0,
    dt: float | None = None,
    n_cells: int = CELLS,
    search: PeriodicSearch = USUAL_PERIODIC_SEARCH,
) -> ShakenState:
    """The state at t = 0 that the structure's shakers keep up, to an error: of velocities over the
    largest or `speed` [m/s], of amplitudes, at least 2 % of a contact's normal force, and of
    friction's heat over the shakers' work. Or by steps of dt [s] at most with n_cells of each
    contact, whose error is infinite: not known.

    From contacts that were pressed and never sheared. Raises UnstableStep where 200 periods, one
    after the other, lead to none.
    """
    rubs, rate = packing.springs is not None, fastest_rate(packing, np.zeros_like(packing.rest))
    T = structure.shakers.period
    n_steps = max(search.cycle_steps, math.ceil(T * rate / search.phase))
    if dt is not None:
        n_steps = max(search.cycle_saves, math.ceil(T / dt))
    at_rest = contact_forces_at_rest(packing, structure) > 0.0

    def found(n_steps: int, n_cells: int, last: PeriodicCycle | None) -> PeriodicCycle:
        """The cycle by n_steps a period, from the one before if there is one."""
        divided = packing
        if rubs:
            divided = packing._replace(springs=packing.springs._replace(n_cells=n_cells))
        period, begin = period_of(divided, structure, n_steps, search)
        if last is not None:
            resume(state_of(*last.moving), *begin)
        point = repeated(
            period, begin, search, search.periodicity * error, last and last.point,
            at_rest=last is None,
        )  # fmt: skip
        return settled(period, begin, point, opens, speed, error, search)

    def opens(saved: PackingCycle) -> bool:
        """True if a contact opens that is closed at rest."""
        return bool((saved.pressed.min(axis=0) <= 0.0)[at_rest].any())

    if dt is not None:
        cycle = found(n_steps, n_cells, None)
        estimate, loop_errors = math.inf, np.full(cycle.saved.heat.shape[1], np.inf)
    else:
        cycle, estimate, loop_errors = refined(
            found, lambda cycle: numbers_of(cycle.period, cycle.saved, speed),
            n_steps, n_cells, error, 1.0 if rubs else 2.0, search,
        )  # fmt: skip
    period, moving, saved, _, change, n_periods, _ = cycle
    gained = (saved.energy[-1] - saved.energy[0]) / n_periods
    lost = gained[[kernel.IN_CONTACTS, kernel.IN_FRICTION, kernel.IN_WALL]].sum()
    return ShakenState(
        state=state_of(*moving),
        saved=saved,
        duration=T * n_periods,
        n_periods=n_periods,
        n_steps=period.steps.n_save * period.steps.stride * n_periods,
        n_cells=period.packing.springs.n_cells if rubs else 0,
        change=change,
        fastest=float(np.abs(period.speeds_of(saved)).max()),
        error_estimate=estimate + change,
        loop_errors=loop_errors / n_periods,
        unbalanced=float(abs(gained[kernel.OF_SHAKERS] - lost)),
    )


def march_shaken_rows(
    rows: Rows,
    structure: Structure,
    before: ShakenState,
    *,
    duration: float,
    error: float | None = None,
    dt: float | None = None,
    n_save: int = 1000,
) -> SpaceTrajectory:
    """Rows with their velocities added at t = 0 to the state that shakers keep up before: to an
    error relative to the largest speed, that state's included, or by steps of dt [s].

    Strikers come as they would to a structure at rest, their place that of the next sphere at
    t = 0. Raises InvalidChain, and UnstableStep as `space.march_to_error`.
    """
    speed = max(float(np.linalg.norm(rows.velocity, axis=1).max()), before.fastest)
    start = struck(rows, before.state)._replace(speed=speed)
    run = {"duration": duration, "n_save": n_save}
    arguments = rows.packing, structure, start
    if dt is not None:
        return march(*arguments, dt=dt, **run)

    # the march takes what the periodic state leaves of the error, at least half of it; the state's
    # own is an error of each motion and force
    of_march = max(error - before.error_estimate, 0.5 * error)
    trajectory = march_to_error(*arguments, error=of_march, **run)
    share, errors = before.error_estimate, trajectory.errors
    errors = SpaceErrors(
        errors.displacement + share * float(np.ptp(trajectory.displacement, axis=0).max()),
        errors.velocity + share * speed,
        errors.pair_force + share * float(np.ptp(trajectory.pair_force, axis=0).max()),
    )
    stated = trajectory.error_estimate + before.error_estimate
    return trajectory._replace(error_estimate=stated, errors=errors)


def with_cycles(runs: Sequence[RowRun], rows: Rows, before: ShakenState) -> tuple[RowRun, ...]:
    """The runs of rows, those with friction with the cycle of their last sphere, from the middle of
    which slip counts."""
    packing, saved, completed = rows.packing, before.saved, []
    k = len(saved.stick)
    for i, run in enumerate(runs):
        if run.across is None:
            completed.append(run)
            continue
        last = np.flatnonzero(rows.row == i)[-1]
        m = int(np.flatnonzero(packing.springs.contact == rows.contact[last])[0])
        slip = saved.slip[:, m]  # of the sphere, the first body, over the structure
        middle = 0.5 * (slip.max(axis=0) + slip.min(axis=0))
        sphere = saved.x.reshape(k, -1, 3)[:, last] @ packing.springs.frame[m].T
        cycle = Cycle(
            t=np.linspace(-before.duration, 0.0, k),
            friction_force=saved.friction[:, m],
            slip=slip - middle,
            sphere_t=sphere,
            stick_share=saved.stick[:, m],
            energy=float(saved.heat[-1, m] - saved.heat[0, m]) / before.n_periods,
            periodicity_error=before.change,
            drift=float(np.hypot(*(sphere[-1] - sphere[0]))),
            error_estimate=before.error_estimate,
            n_steps=before.n_steps,
            periods=before.n_periods,
            energy_error=float(before.loop_errors[m]),
        )
        across = run.across._replace(slip=run.across.slip - middle, cycle=cycle)
        completed.append(run._replace(across=across))
    return tuple(completed)
