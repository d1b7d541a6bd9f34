"""The march of a packing with a fixed step or to an error, and its trajectory.

An error C h^p makes marches by steps H > h differ by C (H^p - h^p), so that of the march by h is
safety times the difference over (H/h)^p - 1, for each sphere and contact from its own difference
(`dem.step_control` has the method of the chain). p = 5/2: a step in which a Hertz contact closes
misses an impulse of order h^(5/2); 2 where order 2 marches yield; 1 where the damping force jumps,
and with friction: slip has order 2, where it begins and ends less is left of it. Stated with p = 2,
6 of 100 random networks with friction were below their true error. Contacts that rub by exact
springs have order 2 in the step; what their cells miss is the difference to half as many of them,
which falls with order 1 (`dem.kernels.tangential`).
"""

import multiprocessing
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from beadwave.dem.checks import InvalidChain, positive, require, vector, whole
from beadwave.dem.friction import open_cells, redivided
from beadwave.dem.kernels.arguments import Array, Damping, Plastic, Steps
from beadwave.dem.kernels.compiled import CompiledFunction
from beadwave.dem.kernels.crew import Crew
from beadwave.dem.kernels.laws import DAMPING_LAWS
from beadwave.dem.kernels.tangential import HEAT, SpringCells
from beadwave.dem.richardson import richardson
from beadwave.dem.schemes import SCHEMES, Scheme
from beadwave.dem.space import kernel
from beadwave.dem.space.kernel import (
    Arms,
    ContactSprings,
    Friction,
    Numbers,
    SpaceArrays,
    SpaceMotion,
    SpaceSaved,
)
from beadwave.dem.space.packing import Packing, validate
from beadwave.dem.space.structure import (
    Structure,
    contact_forces_at_rest,
    modes_in_march,
    residual_matrices,
    residuals,
    structure_behind,
)
from beadwave.dem.stability import UnstableStep, stability_interval
from beadwave.dem.walls import Wall
from beadwave.system import free_cores

MOST_SAVED = 5e8  # numbers of a trajectory: 4 GB
# stated error over what the difference says: of 300 random networks none is below, of 100 with
# friction neither
SAFETY = 2.0
# the same of each sphere and contact, which may be alike in two marches by chance: of 1514 spheres
# 47 were below with 2, of 758 others 7 with 4
COLUMNS = 4.0
RATIO = 1.6  # of the coarser step to the finer one
LEAST = 1.0 / 30.0  # of the error asked: no less is stated, as marches are alike by chance
POINTS = "point", "point_v", "middle_point", "pressed_point"  # of a structure, in `SpaceMotion`
# contacts of a thread, at least: 30 to 100 us a step. Two threads that have one core between them,
# as other work takes the other, took 1.06 to 1.14 of one thread's time with 10,000 contacts and 1.2
# with 1400
LEAST_SHARE, MOST_WORKERS = 2000, 8
MOST_WORK = 2e11  # contacts computed in one search: an hour
MOST_UNSTABLE = 6  # marches that are not finite, each by a quarter of the step before
# of the error, what the ledger may leave open: where contacts rub by exact springs more, of which
# their cells make the largest part
LEDGER, LEDGER_OF_SPRINGS = 1e-2, 0.2
# of the error, what the cells of exact springs may miss; the most cells
OF_CELLS, MOST_CELLS = 0.5, 8192


class SpaceState(NamedTuple):
    """The state that a march has left, from which another one may begin, by any step."""

    motion: SpaceMotion
    springs: ContactSprings | None
    turns: Array | None  # (m, 3) [rad] of the arms
    plastic: Plastic | None
    q: Array | None  # (k,) [kg^1/2 m] of the structure's modes, from rest
    p: Array | None  # (k,)
    speed: float = 0.0  # [m/s] over which errors are stated, if more than that of its spheres


class SpaceErrors(NamedTuple):
    """Errors by the time step, largest over all saves, of each saved sphere and contact."""

    displacement: Array  # (s,) [m]
    velocity: Array  # (s,) [m/s]
    pair_force: Array  # (c,) [N]


class SpaceTrajectory(NamedTuple):
    """Saved states, forces and the energy ledger; k saves of s spheres and c contacts, and of a
    structure of m modes whose points move along r directions.

    A contact is saved if its spheres are; `pairs` are rows of the saved spheres, -1 for a plane at
    rest and -2 - i for point i of the structure.
    """

    t: Array  # (k,) [s]
    saved: Numbers  # (s,) the spheres, from 0
    displacement: Array  # (k, s, 3) [m] from the places at rest
    velocity: Array  # (k, s, 3) [m/s]
    angular_velocity: Array  # (k, s, 3) [rad/s]; (k, 0, 3) without friction
    contacts: Numbers  # (c,) the saved contacts, from 0
    pairs: Numbers  # (c, 2)
    pair_force: Array  # (k, c) [N] pushing, dampers included
    pair_friction: Array  # (k, c, 3) [N] on the second sphere; (k, 0, 3) without friction
    slip: Array  # (k, m, 2) [m] of the surfaces at the contacts that rub by exact springs
    stick_share: Array  # (k, m) of their area; 0 while they are open
    friction_heat: Array  # (k, m) [J] in them
    wall_x: Array  # (k, r) [m] of the structure's points from rest, its residual motion left out
    wall_v: Array  # (k, r) [m/s]
    wall_force: Array  # (k, r) [N] of all contacts on the points
    wall_q: Array  # (k, m) [kg^1/2 m] of the modes, what they have at rest included
    energy_kinetic: Array  # (k,) [J] of the spheres, without their spin
    energy_spin: Array  # (k,) [J]
    energy_contact: Array  # (k,) [J] of the contacts of two spheres
    energy_wall_contact: Array  # (k,) [J] of those with planes
    energy_shear: Array  # (k,) [J]
    energy_leaf: Array  # (k,) [J] of the springs that hold spheres and their turns, about rest
    energy_wall: Array  # (k,) [J] of the structure's modes
    energy_residual: Array  # (k,) [J] of what is in series with the contacts at the structure
    dissipated_contact: Array  # (k,) [J] by dampers and yield
    dissipated_friction: Array  # (k,) [J]
    dissipated_wall: Array  # (k,) [J]
    work_preload: Array  # (k,) [J] of the load without the weights
    work_gravity: Array  # (k,) [J]
    work_drive: Array  # (k,) [J] of what drives spheres
    work_shaker: Array  # (k,) [J] of the structure's shakers
    energy_total: Array  # (k,) [J] constant if exact
    dt: float  # [s]
    n_steps: int
    scheme: str
    # largest |energy_total - start| / kinetic energy there, or the largest that driven spheres and
    # those of an earlier state have
    energy_error: float
    error_estimate: float | None  # largest of `errors.velocity` over the scale; None: step given
    errors: SpaceErrors | None = None


def default_scheme(packing: Packing) -> Scheme:
    """The scheme that measures best: friction and yield have no way back in time, and the fewest
    kicks of order 6 need forces of positions alone."""
    if packing.spins or packing.yield_overlap is not None or packing.jumps:
        return SCHEMES["verlet"]
    return SCHEMES["rkn6" if dampers(packing) is None else "suzuki4"]


def march(
    packing: Packing,
    wall: Wall | Structure | None,
    v0: ArrayLike | SpaceState,
    *,
    duration: float,
    dt: float,
    n_save: int = 1000,
    saved: ArrayLike | None = None,
    scheme: str | None = None,
) -> SpaceTrajectory:
    """Trajectory from the places at rest with velocities v0 (s, 3) [m/s], or with spins behind them
    (s, 6) [rad/s], at n_save + 1 equal times from 0 to `duration` [s], by the longest steps that
    divide their spacing and are not above dt [s].

    `saved` are the spheres that are kept (all without it), from 0. The planes that move do so with
    the modes of `wall`, a structure or a wall of one point. In place of velocities v0 may be a
    state, which an earlier march has left. Raises InvalidChain, and
    UnstableStep where a state is not finite.
    """
    begin, v0 = (v0, v0.motion.v) if isinstance(v0, SpaceState) else (None, v0)
    v0, spin = np.hsplit(np.asarray(v0, float), [3]) if np.ndim(v0) == 2 else (v0, None)
    v0, structure = validate(packing, v0), structure_behind(packing, wall)
    positive("duration", duration, " s")
    positive("dt", dt, " s")
    whole("n_save", n_save)
    spheres = np.arange(len(packing.mass)) if saved is None else np.unique(saved).astype(np.int64)
    require(
        spheres.size and 0 <= spheres[0] and spheres[-1] < len(packing.mass),
        f"saved spheres are {saved!r}; give numbers from 0 to {len(packing.mass) - 1}",
    )
    needed = memory(packing, spheres, n_save, structure) / 8
    if needed > MOST_SAVED:
        raise InvalidChain(
            f"{n_save} saves of {spheres.size} spheres are {needed:.2g} numbers, allowed are "
            f"{MOST_SAVED:.0e}; save fewer spheres or instants"
        )
    method = default_scheme(packing) if scheme is None else SCHEMES[scheme]
    stride = max(1, int(np.ceil(duration / (n_save * dt) * (1 - 1e-9))))
    steps = Steps(duration / (n_save * stride), n_save, stride)

    motion, parts = prepared(packing, structure, v0, steps.h * method.a)
    if spin is not None and spin.size:
        motion.spin[:] = vector("spin", spin.ravel(), v0.size).reshape(-1, 3)
    if begin is not None:
        resume(begin, motion, parts)
    out = room(packing, spheres, n_save + 1, structure)
    in_march = arrays(packing, structure)
    task = motion, in_march, parts, (method.a, method.b), steps, out
    count = marched_by(n_workers(packing), kernel.march, task)
    if count < n_save:
        raise UnstableStep(
            f"the state is not finite at t = {count * stride * steps.h:.4g} s with "
            f"dt = {steps.h:.4g} s; take a smaller dt"
        )
    return trajectory(packing, out, steps, duration, method, begun=begin is not None)


def prepared(
    packing: Packing, structure: Structure | None, v0: Array, spans: Array
) -> tuple[SpaceMotion, kernel.Parts]:
    """State at rest with velocities v0 (s, 3) [m/s] and the packing's parts, for drifts over
    `spans` (n,) [s]."""
    motion, driving, modes = start(packing, v0, structure), None, None
    if packing.driven is not None:
        driving = packing.driven._replace(work=np.zeros(1))
        kernel.place_driven.py_func(0.0, motion, driving)
    if structure is not None:
        modes = modes_in_march(packing, structure, spans)
    parts = kernel.Parts(
        None, plastic(packing), dampers(packing), friction(packing, structure),
        springs(packing, structure), 1.0 / packing.inertia if packing.spins else None,
        packing.guides, loaded(packing), packing.weight, packing.held, arms(packing), modes,
        driving,
    )  # fmt: skip
    return motion, parts


def state_of(motion: SpaceMotion, parts: kernel.Parts) -> SpaceState:
    """The state of a march, not copied."""
    modes = parts.modes
    q, p = (None, None) if modes is None else (modes.q, modes.p)
    turns = None if parts.arms is None else parts.arms.angle
    return SpaceState(motion, parts.springs, turns, parts.plastic, q, p)


def resume(state: SpaceState, motion: SpaceMotion, parts: kernel.Parts) -> None:
    """Bring a march to a state; losses, and the works of shakers and contacts, begin at 0."""
    for to, values in zip(motion, state.motion, strict=True):
        to[:] = values
    motion.lost[:] = motion.heat[:] = 0.0
    if state.springs is not None:
        for name in ("slip", "rate", "pressed"):
            getattr(parts.springs, name)[:] = getattr(state.springs, name)
        for m, (u, of_cells) in enumerate(zip(state.springs.u, state.springs.state, strict=True)):
            cells = redivided(SpringCells(u, of_cells), parts.springs.u.shape[1] - 1)
            parts.springs.u[m], parts.springs.state[m] = cells
        parts.springs.state[:, HEAT] = 0.0
    if state.turns is not None:
        parts.arms.angle[:] = state.turns
    if state.plastic is not None:
        for to, values in zip(parts.plastic, state.plastic, strict=True):
            to[:] = values
    if state.q is not None:
        modes = parts.modes
        modes.q[:], modes.p[:] = state.q, state.p
        modes.v[:] = modes.phi @ modes.p
        kernel.along_directions.py_func(modes.v, motion.point_v, modes)
        # their energy came in before
        modes.work[0] = 0.5 * np.sum(modes.p**2 + (modes.omega * modes.q) ** 2)


def march_to_error(
    packing: Packing,
    wall: Wall | Structure | None,
    v0: ArrayLike | SpaceState,
    *,
    duration: float,
    error: float,
    n_save: int = 1000,
    saved: ArrayLike | None = None,
) -> SpaceTrajectory:
    """`march` whose velocities are off by less than `error` times the largest speed at the start,
    or that of a state, and whose ledger closes to a hundredth of it, with exact springs of friction
    to a fifth; `errors` has those of each sphere and contact.

    Raises InvalidChain, UnstableStep where no march is finite or the error takes too much work.
    """
    v = np.asarray(v0.motion.v if isinstance(v0, SpaceState) else v0, float)
    v = validate(packing, v[:, :3] if v.ndim == 2 else v)
    positive("error", error)
    positive("duration", duration, " s")
    speed = max(float(np.linalg.norm(v, axis=1).max()), packing.fastest_drive)
    speed = (max(speed, v0.speed) if isinstance(v0, SpaceState) else speed) or 1.0
    order = event_order(packing)
    run = {"duration": duration, "n_save": n_save, "saved": saved}
    step, coarse, spent = first_step(packing, v, duration), None, 0.0
    of_cells, unstable = None, 0  # SpaceErrors of the cells; marches that were not finite
    ledger = LEDGER if packing.springs is None else LEDGER_OF_SPRINGS
    best: tuple[float, float] | None = (
        None  # step and excess of the march from which none is better
    )

    while True:
        spent += work(packing, duration, step)
        if spent > MOST_WORK:
            raise UnstableStep(
                f"error {error:g} over {duration:g} s is not reached within {MOST_WORK:.0e} "
                f"contacts computed; the next march, with dt = {step:.3g} s, takes more: ask for a "
                "larger error or less time"
            )
        try:
            fine = march(packing, wall, v0, dt=step, **run)
        except UnstableStep:
            unstable += 1
            if unstable > MOST_UNSTABLE:
                raise
            step, coarse = step / 4.0, None
            continue
        if packing.springs is not None and of_cells is None:
            packing, fine, of_cells = divided(packing, wall, v0, fine, error, speed, run)
        if coarse is None or coarse.dt < 1.2 * fine.dt:
            coarse = coarse or fine
            step = min(step, fine.dt) / RATIO
            continue

        # errors of the finer march, column by column
        ratio, changes = coarse.dt / fine.dt, largest_changes(packing, coarse, fine)
        errors = SpaceErrors(*(COLUMNS * richardson(change, ratio, order) for change in changes))
        estimate = SAFETY / COLUMNS * float(errors.velocity.max(initial=0.0)) / speed
        left = 0.0  # by the cells
        if of_cells is not None:
            left = float(of_cells.velocity.max(initial=0.0)) / speed
            errors = SpaceErrors(*(a + b for a, b in zip(errors, of_cells, strict=True)))
        unbalanced = max(fine.energy_error - rounding(fine), 0.0)
        excess = max(estimate / (error - left), unbalanced / (ledger * error))
        if excess <= 1.0:
            stated = max(estimate + left, LEAST * error)
            return fine._replace(error_estimate=stated, errors=errors)
        if best is None or excess < 0.5 * best[1]:
            best = fine.dt, excess
        elif fine.dt < best[0] / 64.0:
            raise UnstableStep(
                f"error {error:g} over {duration:g} s is not reached: dt = {fine.dt:.3g} s leaves "
                f"{estimate:.3g} in velocity and {fine.energy_error:.3g} in energy, as a step 64 "
                "times as long does; ask for a larger error or less time"
            )
        shorter = max(RATIO, min((1.3 * excess) ** (1.0 / max(order, 1.5)), 8.0))
        step, coarse = fine.dt / shorter, fine


def divided(
    packing: Packing, wall: Wall | Structure | None, v0: ArrayLike | SpaceState,
    fine: SpaceTrajectory,
    error: float, speed: float, run: dict,
) -> tuple[Packing, SpaceTrajectory, SpaceErrors]:  # fmt: skip
    """The packing with cells of exact springs of which half as many change velocities, over
    `speed` [m/s], and the ledger by their shares of the error at most; its march by the step of
    `fine`, that by the cells it has, and SAFETY times the changes. Raises UnstableStep where that
    takes more than MOST_CELLS."""
    rubbing = packing.springs
    halved = packing._replace(springs=rubbing._replace(n_cells=rubbing.n_cells // 2))
    coarse = march(halved, wall, v0, dt=fine.dt, **run)
    while True:
        changes = SpaceErrors(*(SAFETY * x for x in largest_changes(packing, coarse, fine)))
        left_open = np.abs(fine.energy_total - coarse.energy_total).max()
        left_open /= fine.energy_kinetic.max() or left_open or 1.0
        within = changes.velocity.max(initial=0.0) <= OF_CELLS * error * speed
        if within and left_open <= 0.5 * LEDGER_OF_SPRINGS * error:
            return packing, fine, changes
        n_cells = 2 * packing.springs.n_cells
        if n_cells > MOST_CELLS:
            raise UnstableStep(
                f"the error takes more than {MOST_CELLS} cells of a contact with friction; ask for "
                "a larger error"
            )
        packing = packing._replace(springs=rubbing._replace(n_cells=n_cells))
        coarse, fine = fine, march(packing, wall, v0, dt=fine.dt, **run)


def n_workers(packing: Packing) -> int:
    """Threads that march a packing: one for each LEAST_SHARE of contacts, up to the cores; one with
    dampers, whose kicks go through all contacts at once, and in a child process, which is one of
    several already."""
    alone = dampers(packing) is not None or multiprocessing.parent_process() is not None
    cores = 1 if alone else min(free_cores(), MOST_WORKERS)
    return max(1, min(cores, len(packing.A) // LEAST_SHARE))


def marched_by(workers: int, march: CompiledFunction, task: tuple) -> int:
    """Result of the kernel's march for a task, shared out among threads."""
    gate = np.zeros(3, np.int64)
    crew = [Crew(worker, workers, gate) for worker in range(workers)]
    if workers == 1:
        return march(*task, crew[0])
    march.prepare(*task, crew[0])  # compiled once
    with ThreadPoolExecutor(workers - 1) as pool:
        others = [pool.submit(march, *task, one) for one in crew[1:]]
        count = march(*task, crew[0])
        for other in others:
            other.result()
    return count


def rounding(march: SpaceTrajectory) -> float:
    """Energy that rounding alone may leave in the ledger, over the largest kinetic energy: of
    tiny motions in a pressed packing that is much."""
    parts = (march.energy_contact, march.energy_wall_contact, march.energy_wall)
    stored = sum(float(np.abs(part).max()) for part in parts)
    scale = march.energy_kinetic.max() or stored or 1.0
    return 30.0 * float(np.finfo(float).eps) * stored / scale


def first_step(packing: Packing, v0: Array, duration: float) -> float:
    """Step [s] of the first march of `march_to_error`: a quarter of the longest stable one."""
    rate = max(fastest_rate(packing, v0), 1.0 / duration)
    return 0.25 * stability_interval(default_scheme(packing)) / rate


def work(packing: Packing, duration: float, step: float) -> float:
    """Contacts that a march of steps [s] computes."""
    evaluations = default_scheme(packing).evaluations
    return duration / step * evaluations * max(len(packing.A), 1)


def memory(
    packing: Packing, saved: Numbers, n_save: int, structure: Structure | None = None
) -> float:
    """Bytes of a trajectory of the saved spheres (numbers from 0), and of the march."""
    contacts = saved_contacts(packing, saved).size
    of_save = saved.size * (9 if packing.spins else 6) + contacts * (4 if packing.spins else 1) + 17
    modes = 0
    if structure is not None:
        of_save += 3 * len(structure.phi) + len(structure.omega)
        modes = structure.phi.size + 30 * len(structure.omega)
    of_march = 15 * len(packing.mass) + 25 * len(packing.A) + modes
    return 8.0 * ((n_save + 1) * of_save + of_march)


def saved_contacts(packing: Packing, spheres: Numbers) -> Numbers:
    """The contacts whose spheres are all among these."""
    i, j = packing.pairs.T
    return np.flatnonzero(np.isin(i, spheres) & ((j < 0) | np.isin(j, spheres)))


def event_order(packing: Packing) -> float:
    """Power of the step by which the velocities' error falls, see the head of the module."""
    if packing.rubs or (dampers(packing) is not None and packing.jumps):
        return 1.0
    return 2.5 if default_scheme(packing).name != "verlet" else 2.0


def fastest_rate(packing: Packing, v0: Array) -> float:
    """Upper estimate of the largest contact frequency [rad/s]: sqrt(k (1/m_1 + 1/m_2)) of each
    contact with the energy of its fastest neighbour in it on top of its force at rest, times the
    root of the contacts that share a sphere."""
    if not len(packing.A):
        return 0.0
    i, j = packing.pairs.T
    pair = inverse_masses(packing)
    speed = max(np.linalg.norm(v0, axis=1).max(), packing.fastest_drive)
    # the heaviest sphere's energy at that speed, in one contact
    energy = 0.5 * packing.mass.max() * speed**2
    depth = (2.5 * energy / packing.A) ** 0.4 + np.maximum(packing.overlap, 0.0)
    degree = np.bincount(np.concatenate([i, j[j >= 0]]), minlength=len(packing.mass))
    shared = np.maximum(degree[i], np.where(j >= 0, degree[np.maximum(j, 0)], 1))
    squares = 1.5 * packing.A * np.sqrt(depth) * pair * np.maximum(shared / 2, 1)
    if packing.springs is not None:  # across, a sphere gives way by its turn as well
        c, law = packing.springs.contact, packing.springs.law
        k = 2.0 * law[0] * np.sqrt(law[2] * depth[c])
        giving = 1.0 / packing.mass + packing.radius**2 / packing.inertia
        squares = np.append(squares, k * giving[i[c]])
    return float(np.sqrt(squares.max()))


def inverse_masses(packing: Packing) -> Array:
    """(c,) [1/kg] of both spheres at each contact together; a plane has none."""
    inverse = 1.0 / packing.mass
    i, j = packing.pairs.T
    return inverse[i] + np.where(j >= 0, inverse[np.maximum(j, 0)], 0.0)


def start(packing: Packing, v0: Array, structure: Structure | None) -> SpaceMotion:
    """The state at rest with velocities v0 (s, 3) [m/s], along the guides."""
    s, c = len(packing.mass), len(packing.A)
    v = v0.copy()
    if packing.guides is not None:
        v = np.einsum("ijk,ik->ij", packing.guides.motion, v)
    zeros = {name: np.zeros((s, 3)) for name in ("u", "spin", "middle", "change", "steady")}
    zeros |= {name: np.zeros((c, 3)) for name in ("force", "moment", "traction", "damper")}
    zeros |= {name: np.zeros(c) for name in ("lost", "heat", "bound", "stiffness", "compliance")}
    points = 0 if structure is None else structure.n_points
    zeros |= {name: np.zeros((points, 3)) for name in POINTS}
    return SpaceMotion(v=np.ascontiguousarray(v), depth=packing.overlap.copy(), **zeros)


def arrays(packing: Packing, structure: Structure | None) -> SpaceArrays:
    """The packing as the kernel reads it: contacts of each sphere in ascending order."""
    s, c, n = len(packing.mass), len(packing.A), packing.n_pairs
    i, j = packing.pairs.T
    contact = np.arange(c)
    sphere = np.concatenate([i, j[:n]])
    signed = np.concatenate([contact, -1 - contact[:n]])
    order = np.lexsort((np.concatenate([contact, contact[:n]]), sphere))
    begin = np.concatenate([[0], np.cumsum(np.bincount(sphere, minlength=s))])
    R = packing.radius
    share = np.ones((c, 2))
    share[:n, 0] = R[i[:n]] / (R[i[:n]] + R[j[:n]])
    share[:n, 1] = 1.0 - share[:n, 0]
    mass, inverse = packing.mass.copy(), 1.0 / packing.mass
    if packing.driven is not None:  # no force moves these, and their energy is nobody's
        mass[packing.driven.spheres] = inverse[packing.driven.spheres] = 0.0
    return SpaceArrays(
        mass, inverse, packing.inertia, np.ascontiguousarray(i),
        np.ascontiguousarray(j), n, packing.arm, packing.length, share, packing.overlap, packing.A,
        residuals(packing, structure)[0], begin.astype(np.int64), signed[order].astype(np.int64),
    )  # fmt: skip


def plastic(packing: Packing) -> Plastic | None:
    """Contacts that have not yielded yet."""
    if packing.yield_overlap is None:
        return None
    limit = np.asarray(packing.yield_overlap, float)
    return Plastic(limit, limit.copy(), packing.A.copy(), np.zeros_like(limit))


def dampers(packing: Packing) -> Damping | None:
    """Dampers of the contacts; None without."""
    if packing.dissipation == "none" or not np.any(packing.gamma):
        return None
    law = DAMPING_LAWS[packing.dissipation].number
    return Damping(np.asarray(packing.gamma, float), law, inverse_masses(packing))


def friction(packing: Packing, structure: Structure | None) -> Friction | None:
    """Friction of the contacts; None without."""
    if not packing.rubs:
        return None
    in_series = residuals(packing, structure)[1]
    return Friction(np.asarray(packing.friction, float), packing.shear, in_series)


def springs(packing: Packing, structure: Structure | None) -> ContactSprings | None:
    """Contacts that rub by exact springs, not sheared yet; None without."""
    rubbing = packing.springs
    if rubbing is None:
        return None
    m = len(rubbing.contact)
    u, state = open_cells(rubbing.n_cells)
    u, state = np.tile(u, (m, 1, 1)), np.tile(state, (m, 1))
    return ContactSprings(
        np.asarray(rubbing.contact, np.int64), np.ascontiguousarray(rubbing.frame), rubbing.law,
        residual_matrices(packing, structure, rubbing.contact), u, state, u.copy(), state.copy(),
        np.zeros((m, 2)), np.zeros(m), contact_forces_at_rest(packing, structure)[rubbing.contact],
        np.zeros((m, 7, 3)),
    )  # fmt: skip


def loaded(packing: Packing) -> Array | None:
    """The load (s, 3) [N], there where springs hold spheres; None without."""
    if packing.load is None and packing.held is not None:
        return np.zeros_like(packing.rest)
    return packing.load


def arms(packing: Packing) -> Arms | None:
    """Springs against turns, not turned yet; None without."""
    if packing.arms is None:
        return None
    return packing.arms._replace(angle=np.zeros((len(packing.arms.sphere), 3)))


def room(packing: Packing, spheres: Numbers, k: int, structure: Structure | None) -> SpaceSaved:
    """Room for k saves of these spheres, the contacts between them, and the structure."""
    contacts = saved_contacts(packing, spheres)
    s, c = spheres.size, contacts.size
    spinning, rubbing = (s, c) if packing.spins else (0, 0)
    m = 0 if packing.springs is None else len(packing.springs.contact)
    rows, modes = (0, 0) if structure is None else structure.phi.shape
    return SpaceSaved(
        spheres, contacts, np.zeros((k, s, 3)), np.zeros((k, s, 3)), np.zeros((k, spinning, 3)),
        np.zeros((k, m, 2)), *np.zeros((2, k, m)), np.zeros((k, c)), np.zeros((k, rubbing, 3)),
        np.zeros((k, 3, rows)), np.zeros((k, modes)), np.zeros((k, 16)),
    )  # fmt: skip


def trajectory(
    packing: Packing, out: SpaceSaved, steps: Steps, duration: float, scheme: Scheme, *, begun: bool
) -> SpaceTrajectory:
    """The trajectory of what a march saved; of one that has `begun` with an earlier state."""
    k = len(out.energy)
    t = np.arange(k) * (duration / (k - 1))
    t[-1] = duration
    row = np.full(len(packing.mass), -1)
    row[out.spheres] = np.arange(out.spheres.size)
    pairs = packing.pairs[out.contacts]
    pairs = np.where(pairs < 0, pairs, row[np.maximum(pairs, 0)])
    energy = out.energy.T
    # of a driven packing, at rest at the start, and of one that swings, the largest it has
    scale = energy[0].max() if packing.driven is not None or begun else energy[0, 0]
    scale = scale or np.abs(energy[-1]).max() or 1.0
    return SpaceTrajectory(
        t, out.spheres, out.u, out.v, out.spin, out.contacts, pairs, out.force, out.traction,
        out.slip, out.stick, out.rubbed, *np.ascontiguousarray(out.wall.transpose(1, 0, 2)),
        out.modes, *energy,
        dt=steps.h,
        n_steps=steps.n_save * steps.stride,
        scheme=scheme.name,
        energy_error=float(np.abs(energy[-1] - energy[-1, 0]).max() / scale),
        error_estimate=None,
    )  # fmt: skip


def largest_changes(
    packing: Packing, coarse: SpaceTrajectory, fine: SpaceTrajectory
) -> SpaceErrors:
    """Largest differences over all saves; of spheres that rub by exact springs the turn of their
    surface [m/s] counts as a velocity."""
    displacement, velocity, force = (
        _largest_change(coarse, fine, name) for name in SpaceErrors._fields
    )
    if packing.springs is not None:
        turning = packing.radius[fine.saved] * _largest_change(coarse, fine, "angular_velocity")
        velocity = np.maximum(velocity, turning)
    return SpaceErrors(displacement, velocity, force)


def _largest_change(coarse: SpaceTrajectory, fine: SpaceTrajectory, name: str) -> Array:
    """Largest difference of each column of an array over all saves; of vectors its length."""
    change = getattr(fine, name) - getattr(coarse, name)
    if change.ndim == 3:
        return np.sqrt(np.einsum("ksx,ksx->ks", change, change).max(axis=0, initial=0.0))
    return np.abs(change).max(axis=0, initial=0.0)
