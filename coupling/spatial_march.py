"""A chain against a structure in three directions, with friction at the last contact, and shakers.

The march is that of `dem.kernels.spatial`, of order 2: marches by H > h differ, and that by h errs
by

    e = safety max |v_h - v_H| / speed / ((H/h)^2 - 1)

in the velocities of all spheres along the chain, of the last one across it, and of its turn at the
surface. In two directions the difference to half as many cells is added. Before the striker shakers
bring all into a periodic state, see `coupling.periodic_state`.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from beadwave.coupling.errors import CouplingError
from beadwave.coupling.spatial_wall import SpatialWall, require_one_solution
from beadwave.dem import ArrayErrors, Chain, Trajectory, UnstableStep, Wall
from beadwave.dem.chain import State
from beadwave.dem.checks import require, saves
from beadwave.dem.friction import open_cells, open_row, redivided, stick_stiffness
from beadwave.dem.kernels.arguments import Array, Steps
from beadwave.dem.kernels.oscillators import oscillator_propagator
from beadwave.dem.kernels.spatial import (
    FrictionalContact,
    SavedSpatial,
    SpatialArrays,
    SpatialMotion,
    SpatialSystem,
    Trials,
    march_spatial,
    settle,
)
from beadwave.dem.lateral import (
    LastSphere,
    LateralTrajectory,
    checked_last_sphere,
    require_hertz,
)
from beadwave.dem.prepared import PreparedChain, prepare
from beadwave.dem.richardson import richardson
from beadwave.dem.shakers import Oscillators, ShakerForces, modal_shaker_forces
from beadwave.dem.stability import fastest_rate


class SpatialSearch(NamedTuple):
    """Step-size search, and division of the contact."""

    dt: float | None = None  # [s] a step that is given, in place of an error
    safety: float = 2.0  # stated error over what the difference says, as `dem.lateral`'s
    phase: float = 0.3  # of the fastest contact, a first step; not varied
    most_steps: float = 1e8  # some minutes
    capacity: int = 2048  # nodes of the contact in one direction
    # of the contact in two directions: 128, 512 and 2048 left amplitudes of a cycle of partial slip
    # 1e-4, 4e-6 and 0 apart, and its heat 8e-5, 1e-5 and 0; doubled until half as many differ by
    # `share` of the error
    n_cells: int = 256
    most_cells: int = 8192
    share: float = 0.5  # of the error, for the cells; not varied


USUAL_SPATIAL_SEARCH = SpatialSearch()
LEAST = 1.0 / 30.0  # of the error asked: no less is stated, as marches are alike by chance


class SpatialRun(NamedTuple):
    """A march along and across the chain at the same k instants; the ledger closes over both:
    trajectory.energy_total + lateral.energy is constant if exact."""

    trajectory: Trajectory  # along the chain
    lateral: LateralTrajectory  # of the last sphere, across
    wall_q: Array  # (k, n_modes) [kg^1/2 m] from rest
    wall_p: Array  # (k, n_modes)
    contact_force: Array  # (k, 3) [N] on the wall along n, t1, t2, without dampers


class PreparedImpact(NamedTuple):
    """Chain, last sphere and wall, prepared for marches by any step."""

    prepared: PreparedChain
    wall: SpatialWall
    last: LastSphere
    shakers: ShakerForces | None
    frame: Array  # (n_directions, 2) directions across in t1, t2
    rate: float  # [rad/s] of the fastest contact
    search: SpatialSearch
    stiffness: float = 0.0  # [N/m] of the contact at the wall under its largest force

    @property
    def to_frame(self) -> Array:
        """Q (1 + n_directions, 3), from n, t1, t2 to n and the directions across; its transpose
        leads back."""
        out = np.zeros((1 + len(self.frame), 3))
        out[0, 0], out[1:, 1:] = 1.0, self.frame
        return out

    def mobility(self) -> tuple[Array, float]:
        """Inverse masses (n_directions,) across [1/kg], inverse inertia; 0 where the arm clamps."""
        return self.last.mobility(float(self.prepared.chain.mass[-1]), self.arm_stiffness())

    def arm_stiffness(self) -> Array:
        """(n_directions,) [N/m] of the arm in the directions across; inf clamps."""
        k = np.asarray(self.last.arm_stiffness, float)
        return k if len(self.frame) == 2 else k[[int(np.abs(self.frame[0]).argmax())]]

    def at_rest(self) -> "MarchState":
        """The static state, its contact pressed and never sheared."""
        static, n, d = self.prepared.static, self.prepared.chain.mass.size, len(self.frame)
        k = self.wall.omega.size
        force = np.append(static.force[-1], np.zeros(d))
        motion = SpatialMotion(
            x=static.x.copy(), v=np.zeros(n), u=np.zeros(d), u_v=np.zeros(d), psi=np.zeros(d),
            spin=np.zeros(d), q=np.zeros(k), p=np.zeros(k), f=np.zeros(n + 1), force=force,
            slip=np.zeros(d), pending=np.zeros(1 + d), wall=np.zeros((2, 1 + d)),
            ledger=np.zeros(4), behind=np.zeros(d), rolled=np.zeros(d),
        )  # fmt: skip
        rubbed_before = self.last.before is not None
        if d == 2:
            cells, trial, before = (open_cells(self.search.n_cells) for _ in range(3))
            contacts = FrictionalContact(None, None, cells, None, trial)
            if rubbed_before:
                contacts = contacts._replace(before_cells=before)
        else:
            row, room, trial, before = (open_row(self.search.capacity) for _ in range(4))
            contacts = FrictionalContact(row, room, None, trial, None)
            if rubbed_before:
                contacts = contacts._replace(before_row=before)
        return MarchState(motion, contacts)

    def stepped(self, h: float, *, before_striker: "Before | None" = None) -> SpatialSystem:
        """System for a march by steps of h [s]."""
        chain, static = self.prepared.chain, self.prepared.static
        wall, Q = self.wall, self.to_frame
        n, d = chain.mass.size, len(Q)

        # spheres that are held have no inverse mass, contacts that are left out no coefficient
        inverse_mass = 1.0 / np.asarray(chain.mass, float)
        A = np.array(chain.A, float)
        if before_striker is not None:
            inverse_mass[before_striker.held] = 0.0
            A[: before_striker.n_absent] = 0.0
        leaf = chain.springs[0] * (inverse_mass > 0.0)
        gamma = np.zeros(n) if chain.gamma is None else np.array(chain.gamma, float)
        if chain.dissipation == "none":
            gamma[:] = 0.0

        # modes and residual compliance in the directions across that are marched
        phi = np.ascontiguousarray(Q @ wall.phi.T)
        S = Q @ wall.residual_compliance @ Q.T
        arrays = SpatialArrays(
            inverse_mass=inverse_mass, A=A, gamma=gamma,
            load=np.zeros(n) if self.prepared.load is None else self.prepared.load,
            rest=static.x.copy(),
            swing=oscillator_propagator(np.sqrt(leaf * inverse_mass), np.zeros(n), h),
            offset=float(wall.phi[:, 0] @ static.q), rest_force=float(static.force[-1]),
            omega=np.asarray(wall.omega, float), phi=phi, square=phi @ phi.T,
            propagator=oscillator_propagator(wall.omega, wall.zeta, h),
            residual=S, soft=bool(S.any()),
        )  # fmt: skip

        sphere = self.last.on_arm(
            float(chain.mass[-1]), float(chain.radius[-1]), self.arm_stiffness(), h
        )
        modes = Oscillators(wall.omega, wall.zeta, wall.load, Q @ wall.load_residual)
        trials = Trials(*np.zeros((5, d)), *np.zeros((2, d, d)), *np.zeros((6, d)))
        return SpatialSystem(
            arrays, sphere, self.last.law, modal_shaker_forces(modes, self.shakers, h), trials,
            self.last.before,
        )  # fmt: skip

    def march(
        self,
        moving: "MarchState",
        system: SpatialSystem,
        t: float,
        steps: Steps,
        *,
        modes: bool = False,
    ) -> SavedSpatial:
        """March on from the time t [s], in place, the modes saved if asked for. Raises
        UnstableStep."""
        k, n, d = steps.n_save + 1, moving.motion.x.size, moving.motion.force.size
        n_modes = self.wall.omega.size if modes else 0
        saved = SavedSpatial(
            x=np.empty((k, n)), v=np.empty((k, n)), contact_force=np.empty((k, n)),
            across=np.empty((k, 4, d - 1)), force=np.empty((k, d)), slip=np.empty((k, d - 1)),
            wall=np.empty((k, 2, d)), stick=np.empty(k), motion=np.empty((k, d)),
            energy=np.empty((k, 9)), q=np.empty((k, n_modes)), p=np.empty((k, n_modes)),
        )  # fmt: skip
        count = march_spatial(t, moving.motion, system, moving.contacts, steps, saved)
        if count < steps.n_save:
            raise UnstableStep(
                f"the state is not finite at t = {t + count * steps.stride * steps.h:.4g} s; take "
                "a smaller step, a softer arm, or a wall whose residual compliance is larger"
            )
        return saved

    def settle(self, moving: "MarchState", system: SpatialSystem, t: float) -> None:
        """Bring contact and forces to the positions of bodies and modes, in place."""
        settle(t, moving.motion, system, moving.contacts)


class Before(NamedTuple):
    """The chain before the striker."""

    held: Array  # (n,) mask of the spheres that rest: the striker, those held until it comes
    n_absent: (
        int  # contacts from the first on that are left out: 1 with a striker besides the chain
    )


class MarchState(NamedTuple):
    """State and contact, changed in place by marches."""

    motion: SpatialMotion
    contacts: FrictionalContact

    def divided(self, n_cells: int) -> "MarchState":
        """A copy in arrays of its own, a contact in two directions in n_cells cells."""
        moving, contacts = self.copied(), self.contacts
        if contacts.cells is None:
            return moving
        cells, trial = (redivided(contacts.cells, n_cells) for _ in range(2))
        before = contacts.before_cells and redivided(contacts.before_cells, n_cells)
        contacts = FrictionalContact(None, None, cells, None, trial, before_cells=before)
        return MarchState(moving.motion, contacts)

    def copied(self) -> "MarchState":
        """A copy in arrays of its own."""
        motion = SpatialMotion(*(values.copy() for values in self.motion))
        return MarchState(motion, self.contacts.copied())


def body_of(
    chain: Chain, wall: SpatialWall, v0: ArrayLike, last: LastSphere,
    shakers: ShakerForces | None = None, search: SpatialSearch = USUAL_SPATIAL_SEARCH,
) -> PreparedImpact:  # fmt: skip
    """Chain with velocities v0 (n,) [m/s], last sphere and wall, checked, and the directions across
    in which anything moves.

    Raises NoEquilibrium; InvalidChain for a chain or a last sphere out of range, contacts without a
    tangential law, guides; CouplingError for a wall that makes energy, and for a residual
    compliance that leaves no unique force (`require_one_solution`).
    """
    require_hertz(chain)
    require(not chain.slides, "friction at the wall takes no guides; leave them out")
    require(
        last.before is None or chain.mass.size > 1,
        "friction between spheres takes a chain of two or more; drop it, or add spheres",
    )
    velocity, stiffness = checked_last_sphere(last)
    S = np.asarray(wall.residual_compliance, float)
    if np.any(wall.zeta < 0.0):
        raise CouplingError(
            "a mode of the wall has a negative damping ratio; it would make energy."
        )
    prepared = prepare(chain, along_normal(wall))

    # one direction across where nothing leads out of it: no mode that moves along it or that the
    # chain or a shaker drives moves the wall sideways, and nothing sideways moves the sphere
    frame, scale = np.eye(2), np.abs(wall.phi).max(initial=0.0)
    moves, largest = wall.load_residual[1:].T, float(np.abs(wall.load_residual).max(initial=0.0))
    lines = [velocity / np.hypot(*velocity)] if velocity.any() else [*np.eye(2)]
    if moves.any() and not velocity.any():
        moved = max(moves, key=lambda move: float(np.hypot(*move)))
        lines.append(moved / np.hypot(*moved))
    for line in lines:
        sideways = np.array([-line[1], line[0]])
        driven = np.abs(np.column_stack([wall.phi[:, 0], wall.phi[:, 1:] @ line, wall.load]))
        stray = np.abs(wall.phi[:, 1:] @ sideways) > 1e-12 * scale
        residual = np.append(S[1:, 0], S[1:, 1:] @ line).reshape(2, 2, order="F")
        straight = stiffness[0] == stiffness[1] or 0.0 in line
        straight &= not np.any(driven[stray] > 1e-12 * np.abs(wall.phi).max(initial=0.0))
        straight &= bool((np.abs(sideways @ residual) <= 1e-12 * np.abs(S).max(initial=0.0)).all())
        straight &= not np.any(np.abs(moves @ sideways) > 1e-12 * largest)
        if straight:
            frame = line[None]
            break

    # the fastest contact: along the chain, or across where it sticks
    overlap = float(
        chain.elastic.at(np.s_[-1:]).overlap(np.array([largest_force(prepared, v0)]))[0]
    )
    a = math.sqrt(last.law.radius * overlap)
    k_t, k_n = float(stick_stiffness(last.law, a)), 1.5 * float(chain.A[-1]) * math.sqrt(overlap)
    if overlap > 0.0 and S.any():
        coefficient = last.law.bound * last.law.modulus * math.sqrt(last.law.radius) * 4.0 / 3.0
        require_one_solution(S, (k_n, k_t), coefficient / float(chain.A[-1]))
    slow = np.asarray(wall.omega) ** 2 <= k_t / float(chain.mass[-1])
    meets = 1.0 / float(chain.mass[-1]) + float(chain.radius[-1]) ** 2 / last.inertia
    meets += float(np.square(wall.phi[slow, 1:]).sum(axis=0).max(initial=0.0))
    sticking = k_t * meets
    if last.before is not None:
        before = largest_force(prepared, v0, -2)
        pressed = float(chain.elastic.at(np.s_[-2:-1]).overlap(np.array([before]))[0])
        a = math.sqrt(last.before.radius * pressed)
        sticking += float(stick_stiffness(last.before, a)) * (
            1.0 / float(chain.mass[-1]) + float(chain.radius[-1]) ** 2 / last.inertia
        )
    rate = max(fastest_rate(prepared, v0), math.sqrt(sticking))
    return PreparedImpact(prepared, wall, last, shakers, frame, rate, search, max(k_n, k_t))


def along_normal(wall: SpatialWall) -> Wall:
    """The wall as a chain sees it without friction."""
    return Wall(
        np.asarray(wall.omega, float),
        np.asarray(wall.zeta, float),
        np.ascontiguousarray(wall.phi[:, 0]),
        float(wall.residual_compliance[0, 0]),
    )


def largest_force(prepared: PreparedChain, v0: ArrayLike, contact: int = -1) -> float:
    """Upper estimate [N] of the force at the wall, or of another contact counted from it, from
    velocities v0 (n,) [m/s]: all kinetic energy in it, on top of the overlap at rest."""
    chain = prepared.chain
    energy = 0.5 * float(np.asarray(chain.mass) @ np.square(np.asarray(v0, float)))
    place = np.s_[contact : contact + 1 or None]
    law = chain.elastic.at(place)
    deepest = float(law.overlap_of_energy(np.array([energy]))[0]) if energy > 0.0 else 0.0
    deepest += float(law.overlap(prepared.static.force[place])[0])
    return float(law.force(np.array([deepest]))[0])


def march_space(
    chain: Chain,
    wall: SpatialWall,
    v0: ArrayLike,
    last: LastSphere,
    *,
    duration: float,
    error: float | None = None,
    n_save: int = 1000,
    search: SpatialSearch = USUAL_SPATIAL_SEARCH,
) -> SpatialRun:
    """A chain with velocities v0 (n,) [m/s], its last sphere with `last.velocity` across, against a
    structure without shakers, from rest; at n_save + 1 equal times.

    `error` is relative to the largest speed at the start; without it `search.dt` is the step [s] of
    the coarser of two marches, which state the error of the finer. Raises InvalidChain,
    NoEquilibrium, CouplingError, UnstableStep.
    """
    saves(n_save, chain.mass.size)
    body = body_of(chain, wall, v0, last, None, search)
    start = body.at_rest()
    start.motion.v[:] = v0
    start.motion.u_v[:] = body.frame @ np.asarray(last.velocity, float)
    return march_to_error(body, start, duration=duration, error=error, n_save=n_save)


def march_to_error(
    body: PreparedImpact, start: MarchState, *, duration: float, error: float | None, n_save: int,
    speed: float | None = None, measure: Callable[..., float] | None = None,
) -> SpatialRun:  # fmt: skip
    """March from a state at t = 0 for `duration` [s], at n_save + 1 equal times; errors are
    relative to `speed` [m/s], None for the largest at the start, and those of all velocities, or
    what `measure` takes as the difference of two marches (`difference`).

    Without `error`, `search.dt` is the step of the coarser of two marches. Raises InvalidChain
    where both or none are given, UnstableStep where a state is not finite or the error takes too
    many steps or cells.
    """
    search, measure = body.search, measure or difference
    require(
        (error is None) != (search.dt is None),
        "give either error or search.dt to say how finely to march",
    )
    if speed is None:
        speeds = np.concatenate([start.motion.v, start.motion.u_v])
        speed = float(np.abs(speeds).max()) or 1.0
    spacing, radius = duration / n_save, float(body.prepared.chain.radius[-1])
    two_directions, n_cells = len(body.frame) == 2, search.n_cells

    def run(stride: int, n_cells: int) -> tuple[SavedSpatial, MarchState]:
        """The march by `stride` steps from save to save, with n_cells cells in two directions."""
        moving, system = start.divided(n_cells), body.stepped(spacing / stride)
        body.settle(moving, system, 0.0)
        steps = Steps(spacing / stride, n_save, stride)
        return body.march(moving, system, 0.0, steps, modes=True), moving

    # a contact that nothing presses or strikes has no rate
    first = search.dt or (search.phase / body.rate if body.rate > 0.0 else spacing)
    if search.dt is None:
        # kicks of the contact near a multiple of half a mode's period feed it, by a rate of
        # k phi^2 / 2 omega less its damping: below 2 / omega there is none
        omega, phi = np.asarray(body.wall.omega, float), np.asarray(body.wall.phi, float)
        square = np.square(phi).sum(axis=1)
        growth = body.stiffness * square / (2.0 * np.maximum(omega, 1e-300))
        fed = omega[(growth - body.wall.zeta * omega) * duration > 1.0]
        first = min(first, 2.0 / fed.max(initial=1e-300))
    stride = max(1, math.ceil(spacing / first * (1 - 1e-9)))
    coarse, _ = run(stride, n_cells)

    # the part of the cells, compared with half as many: of order 1, see `dem.lateral`
    of_cells, halved = 0.0, run(stride, n_cells // 2)[0] if two_directions else None
    while halved is not None:
        of_cells = search.safety * measure(coarse, halved, radius) / speed
        if search.dt is not None or of_cells <= search.share * error:
            break
        if 2 * n_cells > search.most_cells:
            raise UnstableStep(
                f"error {error:g} over {duration:g} s takes more than {search.most_cells} cells of "
                "the contact in two directions; ask for a larger error"
            )
        n_cells, halved = 2 * n_cells, coarse
        coarse, _ = run(stride, n_cells)
    last_cells = coarse

    # the part of the steps: finer marches, each compared with the one before
    shorter, spent = 2.0, stride
    while True:
        finer = max(stride + 1, math.ceil(shorter * stride))
        spent += finer
        if spent * n_save > search.most_steps:
            target = f"dt = {search.dt:g} s" if search.dt else f"error {error:g}"
            raise UnstableStep(
                f"{target} over {duration:g} s takes more than {search.most_steps:.1e} steps; ask "
                "for a larger error or for less time"
            )
        saved, moving = run(finer, n_cells)
        change = measure(saved, coarse, radius)
        of_steps = richardson(search.safety * change / speed, finer / stride, 2.0)
        estimate = of_cells + of_steps
        if search.dt is not None or estimate <= error:
            break
        excess = of_steps / (error - of_cells)
        shorter = min(max(1.2, 1.1 * math.sqrt(excess)), 16.0)
        coarse, stride = saved, finer
    if error is not None:
        estimate = max(estimate, LEAST * error)
    steps = Steps(spacing / finer, n_save, finer)
    body = body._replace(search=search._replace(n_cells=n_cells))
    run = spatial_run(body, saved, moving, steps, estimate)
    if search.dt is not None:
        return run

    # the error of every sphere and contact, by the same differences
    def column_errors(name: str) -> Array:
        by_steps = np.abs(getattr(saved, name) - getattr(coarse, name)).max(axis=0)
        errors = search.safety * richardson(by_steps, finer / stride, 2.0)
        if halved is not None:
            by_cells = getattr(last_cells, name) - getattr(halved, name)
            errors += search.safety * np.abs(by_cells).max(axis=0)
        return errors

    errors = ArrayErrors(*(column_errors(name) for name in ArrayErrors._fields))
    return run._replace(trajectory=run.trajectory._replace(errors=errors))


def difference(a: SavedSpatial, b: SavedSpatial, radius: float) -> float:
    """Largest difference [m/s] of velocities along and across, and of the turn at the surface."""
    return max(float(np.abs(a.v - b.v).max()), across_alone(a, b, radius))


def across_alone(a: SavedSpatial, b: SavedSpatial, radius: float) -> float:
    """Largest difference [m/s] of velocities across, and of the turn at the surface."""
    across = np.abs(a.across - b.across)
    turning = radius * float(across[:, 3].max(initial=0.0))
    return max(float(across[:, 1].max(initial=0.0)), turning)


def spatial_run(
    body: PreparedImpact, saved: SavedSpatial, moving: MarchState, steps: Steps, estimate: float
) -> SpatialRun:
    """Saved run of a march, in n, t1, t2, with all energies."""
    chain, static, wall = body.prepared.chain, body.prepared.static, body.wall
    frame, Q = body.frame, body.to_frame
    duration = steps.h * steps.n_save * steps.stride
    t = np.arange(steps.n_save + 1) * (duration / steps.n_save)
    t[-1] = duration
    leaf, anchor = chain.springs
    S, F0 = wall.residual_compliance, float(static.force[-1])
    force, motion = saved.force @ Q, saved.motion @ Q
    hertz, tangential, heat, swing, dampers, on_modes, shaken, beyond, _ = saved.energy.T
    mass, last = np.asarray(chain.mass, float), body.last

    # along: the modes' energy in all is that about rest, and what the static force adds
    offset = float(wall.phi[:, 0] @ static.q)
    normal = saved.wall[:, :, 0]
    moved = saved.x - saved.x[0]
    ledger = (
        0.5 * saved.v**2 @ mass,
        hertz,
        0.5 * (saved.x - anchor) ** 2 @ leaf,
        swing + F0 * normal[:, 0] + 0.5 * F0 * offset,
        0.5 * np.einsum("ki,ij,kj->k", force, S, force) + np.sum(force * motion, axis=1),
        dampers,
        on_modes + shaken - (swing - swing[0]),
        np.zeros(len(t)),  # guides
        chain.preload * moved[:, -1],
        chain.gravity * moved @ mass,
    )
    total = sum(ledger[:8]) - ledger[8] - ledger[9]

    # across
    u, u_v, psi, spin = (saved.across[:, i] @ frame for i in range(4))
    inverse, inverse_inertia = body.mobility()
    kinetic = 0.5 * mass[-1] * np.sum(saved.across[:, 1] ** 2 * (inverse > 0.0), axis=1)
    turning = 0.5 * last.inertia * np.sum(spin**2, axis=1) * (inverse_inertia > 0.0)
    k = np.where(inverse > 0.0, body.arm_stiffness(), 0.0)
    kappa = float(last.arm_rotation) if inverse_inertia > 0.0 else 0.0
    arm = 0.5 * (saved.across[:, 0] ** 2 @ k + kappa * np.sum(psi**2, axis=1))
    residual_t = (force - F0 * np.eye(3)[0]) @ S[:, 1:] + motion[:, 1:]
    lateral = LateralTrajectory(
        t=t,
        sphere_t=u,
        sphere_t_v=u_v,
        sphere_rotation=np.stack([0.0 - psi[:, 1], psi[:, 0]], axis=1),
        sphere_spin=np.stack([0.0 - spin[:, 1], spin[:, 0]], axis=1),
        friction_force=force[:, 1:],
        slip=saved.slip @ frame,
        stick_share=saved.stick,
        wall_t=saved.wall[:, 0, 1:] @ frame + residual_t,
        energy_lateral=kinetic,
        energy_rotation=turning,
        energy_arm=arm,
        energy_tangential=tangential,
        dissipated_friction=heat - heat[0],
        work_shaker=shaken + beyond,
        dt=steps.h,
        n_steps=steps.n_save * steps.stride,
        error_estimate=estimate,
        energy_error=0.0,
        n_cells=body.search.n_cells if len(frame) == 2 else 0,
    )

    # the ledger of both motions, over the energy at the start or over what any part of it moves by
    # if that is more: of a rig that only its shakers move the start says nothing
    everything = total + lateral.energy
    terms = (*ledger, kinetic, turning, arm, tangential, lateral.dissipated_friction, shaken)
    started = float(ledger[0][0] + kinetic[0] + turning[0])
    scale = max(started, *(float(np.ptp(term)) for term in terms)) or 1.0
    ledger_error = float(np.abs(everything - everything[0]).max()) / scale
    lateral = lateral._replace(energy_error=ledger_error)
    state = moving.motion
    trajectory = Trajectory(
        t, saved.x, saved.v, saved.contact_force, offset + normal[:, 0], normal[:, 1],
        (saved.q + static.q).astype(np.float32), *ledger, total, steps.h,
        steps.n_save * steps.stride, "verlet",
        ledger_error, estimate,
        State(state.x, state.v, state.q, state.p, np.zeros(4)),
    )  # fmt: skip
    return SpatialRun(trajectory, lateral, saved.q, saved.p, force)
