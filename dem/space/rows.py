"""Rows of spheres that lean on points of one structure: chains in space, coupled through it.

Each row moves along its direction, into the structure; with friction its last sphere moves across
it too, and turns (`dem.lateral`). A first sphere that comes later than the others' stands farther
off by what it flies until then.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from beadwave.dem.chain import Chain
from beadwave.dem.checks import InvalidChain, require
from beadwave.dem.kernels.arguments import Array
from beadwave.dem.kernels.tangential import TangentialLaw
from beadwave.dem.lateral import Cycle, LastSphere, checked_last_sphere, require_hertz
from beadwave.dem.prepared import prepare
from beadwave.dem.space.kernel import Arms, Guides, HoldingSprings, Numbers
from beadwave.dem.space.march import SpaceState, SpaceTrajectory
from beadwave.dem.space.packing import MOVING, NO_YIELD, Packing, RubbingContacts, line_guides
from beadwave.dem.space.structure import Structure, residual_matrices, rest_forces
from beadwave.dem.statics import NoEquilibrium
from beadwave.dem.walls import Wall


class Row(NamedTuple):
    """A chain in space; its last sphere leans on a point of the structure, of its own."""

    chain: Chain
    velocity: Array  # (n,) [m/s] at the start; of a first sphere with a delay, on arrival
    at: Array  # (3,) [m] where it touches the structure
    direction: Array  # (3,) into the structure
    delay: float = 0.0  # [s] after which the first sphere arrives at the second
    name: str = "row"  # by which refusals call it
    last: LastSphere | None = None  # its motion across; None: no friction, it stays on the line


class Rows(NamedTuple):
    """The rows as one packing, in their order."""

    packing: Packing
    velocity: Array  # (s, 3) [m/s]
    row: Numbers  # (s,) of each sphere, from 0
    direction: Array  # (s, 3) unit vectors
    start: Array  # (s,) [m] along it, from where a sphere touches the next at rest
    contact: Numbers  # (s,) the contact behind each sphere, at the structure of the last of a row
    names: tuple[str, ...]  # of the rows


def before_striker(rows: Rows, upstream_held: Sequence[bool]) -> Packing:
    """The packing with strikers held and their contacts open; with `upstream_held`, all but the
    last sphere of that row are held as well.

    Raises InvalidChain for a row that nothing presses on the structure, and for a sphere that
    nothing holds while the structure moves.
    """
    packing, s = rows.packing, len(rows.row)
    held, overlap = np.zeros(s, bool), packing.overlap.copy()
    firsts = strikers(rows)
    held[firsts], overlap[rows.contact[firsts]] = True, -1.0
    for i, still in enumerate(upstream_held):
        held[np.flatnonzero(rows.row == i)[:-1]] |= still
    pressed = packing.overlap[rows.contact] > 0.0
    for i, name in enumerate(rows.names):
        require(
            pressed[np.flatnonzero(rows.row == i)[-1]],
            f"nothing presses the last sphere of {name} on the structure that the shakers move; "
            "add a preload",
        )
    sprung = np.isin(np.arange(s), packing.held.sphere)
    loose = ~held & ~sprung & ~pressed
    behind = np.flatnonzero((rows.row[1:] == rows.row[:-1]) & pressed[:-1]) + 1
    loose[behind] = False
    if loose.any():
        i = int(loose.argmax())
        number, name = int(np.sum(rows.row[:i] == rows.row[i])) + 1, rows.names[rows.row[i]]
        raise InvalidChain(
            f"sphere {number} of {name} is held by nothing while the shakers move the structure; "
            'add leaf springs, or with friction set its upstream to "held"'
        )
    free = (~held)[:, None, None]
    guides = Guides(packing.guides.motion * free, packing.guides.turn * free)
    return packing._replace(guides=guides, overlap=overlap)


def strikers(rows: Rows) -> Numbers:
    """The first spheres that move towards their row while nothing presses them."""
    _, firsts = np.unique(rows.row, return_index=True)
    towards = np.einsum("sx,sx->s", rows.velocity, rows.direction)[firsts] > 0.0
    return firsts[towards & (rows.packing.overlap[rows.contact[firsts]] <= 0.0)]


def struck(rows: Rows, state: SpaceState) -> SpaceState:
    """The state with the rows' velocities, and strikers on the places of the spheres that they will
    touch, along the rows."""
    u, motion = state.motion.u.copy(), state.motion
    for first in strikers(rows):
        u[first] = (u[first + 1] @ rows.direction[first]) * rows.direction[first]
    return state._replace(motion=motion._replace(u=u, v=motion.v + rows.velocity))


class AcrossRun(NamedTuple):
    """The last sphere of a row across it, with fields of `dem.lateral.LateralTrajectory`: along t1
    and t2, the further directions of its point."""

    sphere_t: Array  # (k, 2) [m] displacement of the centre
    sphere_t_v: Array  # (k, 2) [m/s]
    sphere_spin: Array  # (k, 2) [rad/s] about t1, t2
    friction_force: Array  # (k, 2) [N] on the structure
    slip: Array  # (k, 2) [m] of the sphere's surface relative to the structure's
    stick_share: Array  # (k,) of the contact's area; 0 while it is open
    wall_t: Array  # (k, 2) [m] displacement of the point
    dissipated_friction: Array  # (k,) [J]
    cycle: Cycle | None = None  # before the striker, where shakers move the structure


class RowRun(NamedTuple):
    """One row of a march, as a `dem.Trajectory` has it; k saves of n spheres."""

    t: Array  # (k,) [s]
    x: Array  # (k, n) [m]
    v: Array  # (k, n) [m/s]
    contact_force: Array  # (k, n) [N]
    wall_x: Array  # (k,) [m] of its point from rest
    wall_v: Array  # (k,) [m/s]
    across: AcrossRun | None = None  # of a row with friction


def rows_of(rows: Sequence[Row], structure: Structure) -> Rows:
    """Rows before they are struck; row i leans on point i of the structure, along its first
    direction, and rubs along the two others. Raises InvalidChain for chains of laws that are not
    marched here, NoEquilibrium for a preload that nothing holds.

    Loads, weights and springs are given where they are none, too: each that is absent would be
    compiled for anew, some ten seconds.
    """
    parts = []
    for i, row in enumerate(rows):
        try:
            parts.append(_at_rest(row, structure, i))
        except (InvalidChain, NoEquilibrium) as error:
            raise type(error)(f"{row.name}: {error}") from None
    counts = [len(row.chain.mass) for row in rows]
    n = sum(counts)
    of_row = np.repeat(np.arange(len(rows)), counts)
    last = np.cumsum(counts) - 1
    sphere = np.arange(n)
    inner = np.setdiff1d(sphere, last)

    # contacts of two spheres first, then those with the structure
    contact = np.empty(n, np.int64)
    contact[inner], contact[last] = np.arange(inner.size), inner.size + np.arange(last.size)
    order = np.concatenate([inner, last])
    direction = np.array([row.direction / np.linalg.norm(row.direction) for row in rows])[of_row]
    joined = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    way = joined["place"]
    rest = np.array([row.at for row in rows])[of_row] + way[:, None] * direction
    arm = direction[order].copy()
    arm[: inner.size] *= (way[inner + 1] - way[inner])[:, None]
    second = np.concatenate([inner + 1, MOVING - np.arange(len(rows))])

    laws = {row.chain.dissipation for row in rows if np.any(row.chain.gamma)}
    require(len(laws) < 2, f"rows are damped by {' and '.join(sorted(laws))}; give all one law")
    fields = {}
    if laws:
        fields = {"dissipation": laws.pop(), "gamma": joined["gamma"][order]}
    if np.any(joined["yield_overlap"] < NO_YIELD):
        fields["yield_overlap"] = joined["yield_overlap"][order]
    load, weight = (joined[name][:, None] * direction for name in ("load", "weight"))
    leaf = np.flatnonzero(joined["leaf"])
    lines = np.sqrt(joined["leaf"][leaf])[:, None] * direction[leaf]
    across = _across(rows, structure, joined["mass"], joined["radius"], contact)
    held = HoldingSprings(np.append(leaf, across.held.sphere), np.vstack([lines, across.held.line]))
    packing = Packing(
        rest, joined["radius"], joined["mass"], np.column_stack([order, second]), inner.size, arm,
        joined["overlap"][order], joined["A"][order], np.zeros(n), guides=across.guides,
        springs=across.springs, held=held, arms=across.arms, added_inertia=across.added_inertia,
        load=load, weight=weight, **fields,
    )  # fmt: skip
    velocity = joined["velocity"][:, None] * direction + across.velocity
    names = tuple(row.name for row in rows)
    return Rows(packing, velocity, of_row, direction, joined["start"], contact, names)


class _Across(NamedTuple):
    """Last spheres that move across their rows, as parts of the packing; None where none rubs."""

    guides: Guides
    held: HoldingSprings  # of the arms, across
    velocity: Array  # (s, 3) [m/s] across
    springs: RubbingContacts | None = None
    arms: Arms | None = None
    added_inertia: Array | None = None


def _across(
    rows: Sequence[Row], structure: Structure, mass: Array, radius: Array, contact: Numbers
) -> _Across:
    """The last spheres of rows with friction, contact (s,) behind each sphere."""
    counts, s = [len(row.chain.mass) for row in rows], len(mass)
    along = np.array([row.direction / np.linalg.norm(row.direction) for row in rows])
    guides = line_guides(np.repeat(along, counts, axis=0))
    velocity, added, rubbing = np.zeros((s, 3)), np.zeros(s), []
    held, arms = [], []  # sphere and line, sphere and stiffness
    for i, (row, end) in enumerate(zip(rows, np.cumsum(counts) - 1, strict=True)):
        last = row.last
        if last is None:
            continue
        frame = structure.direction[structure.point == i][1:]
        require(
            len(frame) == 2,
            f"{row.name}: friction takes three directions of the structure at its point",
        )
        try:
            require_hertz(row.chain)
            across, stiffness = checked_last_sphere(last)
            require(
                last.before is None or counts[i] > 1,
                "friction between spheres takes a chain of two or more; drop it, or add spheres",
            )
        except InvalidChain as error:
            raise InvalidChain(f"{row.name}: {error}") from None

        # what moves and turns it, and what holds it; an infinite stiffness clamps
        velocity[end] = across @ frame
        added[end] = last.inertia - 0.4 * mass[end] * radius[end] ** 2
        for k, t in zip(stiffness, frame, strict=True):
            if np.isfinite(k):
                guides.motion[end] += np.outer(t, t)
                held += [(end, np.sqrt(k) * t)] if k > 0.0 else []
        if np.isfinite(last.arm_rotation):
            guides.turn[end] = frame.T @ frame
            arms.append((end, last.arm_rotation))  # of 0 N m/rad as well: it knows the angle
        rubbing.append((contact[end], frame, last.law))
        if last.before is not None:
            rubbing.append((contact[end - 1], frame, last.before))

    spheres = HoldingSprings(
        np.array([sphere for sphere, _ in held], np.int64),
        np.reshape([line for _, line in held], (-1, 3)),
    )
    if not rubbing:
        return _Across(guides, spheres, velocity)
    where, frames, laws = zip(*rubbing, strict=True)
    of_laws = tuple(np.array([getattr(law, name) for law in laws])
                    for name in TangentialLaw._fields[:3])  # fmt: skip
    springs = RubbingContacts(np.array(where), np.array(frames), of_laws)
    turned = Arms(
        np.array([sphere for sphere, _ in arms], np.int64),
        np.array([stiffness for _, stiffness in arms], float),
        np.zeros((len(arms), 3)),
    )
    return _Across(guides, spheres, velocity, springs, turned, added)


def _at_rest(row: Row, structure: Structure, point: int) -> dict[str, Array]:
    """Arrays (n,) of a row at rest: of its spheres, and of the contact behind each."""
    chain, n = row.chain, len(row.chain.mass)
    require(len(chain.A) == n, "a row leans on a structure; give its last contact")
    for name, given in {
        "a law other than Hertz'": chain.exponent is not None or chain.table is not None,
        "friction of guides": chain.slides,
    }.items():
        if given:
            raise InvalidChain(f"rows on one structure are not marched with {name}; leave it out")
    require(row.delay >= 0.0, f"the delay is {row.delay:g} s; give 0 s or more")

    # forces at rest: of this row alone, as those of leaf springs change by what the structure gives
    # way under the others' preloads, some 1e-8 m, alone
    phi = structure.phi[np.flatnonzero(structure.point == point)[0]]
    wall = Wall(structure.omega, structure.zeta, phi, structure.residual[point, 0])
    prepared = prepare(chain, wall)
    static, force = prepared.static, prepared.static.force
    # leaf springs may hold spheres apart; of those that press the difference of places would lose
    # digits
    gap = -np.diff(static.x, append=wall.phi @ static.q)
    overlap = np.where(force > 0.0, chain.elastic.overlap(force), np.minimum(gap, 0.0))
    overlap[-1] += structure.residual[point, 0] * force[-1]
    apart, velocity = np.zeros(n), np.array(row.velocity, float)
    if row.delay > 0.0:
        # it arrives with its velocity, which its weight has changed on the way
        gained, late = chain.gravity * row.delay, f"the first sphere comes {row.delay:g} s later"
        require(velocity[0] > 0.0, f"{late}; give it a velocity, or let it come at 0 s")
        require(
            velocity[0] > gained,
            f"{late} and gains {gained:.3g} m/s by its weight until then, its velocity is "
            f"{velocity[0]:g} m/s; give it more, or less time",
        )
        require(
            not chain.springs[0][0] and force[0] == 0.0,
            f"{late}, and a leaf spring or a force holds it; give leaf springs to the others alone "
            "(the first stiffness 0), or let it come at 0 s",
        )
        apart[0] = -(velocity[0] - 0.5 * gained) * row.delay
        velocity[0] -= gained
        overlap[0] += apart[0]

    # places along the direction from the point on the structure
    R = chain.radius
    between = np.append(R[:-1] + R[1:], R[-1]) - np.append(overlap[:-1], overlap[-1])
    mass, load = np.asarray(chain.mass, float), prepared.load
    return {
        "place": -np.cumsum(between[::-1])[::-1],
        "radius": np.asarray(R, float),
        "mass": mass,
        "A": np.asarray(chain.A, float),
        "gamma": np.broadcast_to(0.0 if chain.gamma is None else chain.gamma, n),
        "leaf": chain.springs[0],
        "yield_overlap": np.broadcast_to(
            NO_YIELD if chain.yield_overlap is None else chain.yield_overlap, n
        ),
        "load": np.zeros(n) if load is None else load,
        "weight": chain.gravity * mass,
        "overlap": overlap,
        "velocity": velocity,
        "start": apart,
    }


def row_runs(rows: Rows, structure: Structure, march: SpaceTrajectory) -> tuple[RowRun, ...]:
    """Each row of a march that saved all spheres."""
    x = np.einsum("ksx,sx->ks", march.displacement, rows.direction) + rows.start
    v = np.einsum("ksx,sx->ks", march.velocity, rows.direction)
    force = march.pair_force[:, rows.contact]
    runs = []
    for i in range(rows.row[-1] + 1):
        of_row, direction = rows.row == i, np.flatnonzero(structure.point == i)[0]
        of_wall = march.wall_x[:, direction], march.wall_v[:, direction]
        across = _across_run(rows, structure, march, i)
        runs.append(RowRun(march.t, x[:, of_row], v[:, of_row], force[:, of_row], *of_wall, across))
    return tuple(runs)


def _across_run(
    rows: Rows, structure: Structure, march: SpaceTrajectory, i: int
) -> AcrossRun | None:
    """The last sphere of row i across it; None without friction."""
    last = np.flatnonzero(rows.row == i)[-1]
    contact, rubbing = rows.contact[last], rows.packing.springs
    if rubbing is None or contact not in rubbing.contact:
        return None
    m = int(np.flatnonzero(rubbing.contact == contact)[0])
    frame, tangents = rubbing.frame[m], np.flatnonzero(structure.point == i)[1:]
    friction = march.pair_friction[:, contact] @ frame.T
    force = np.column_stack([march.wall_force[:, tangents[0] - 1], friction])
    S = residual_matrices(rows.packing, structure, np.array([contact]))[0]
    at_rest = rest_forces(rows.packing, structure)[np.append(tangents[0] - 1, tangents)]
    return AcrossRun(
        sphere_t=march.displacement[:, last] @ frame.T,
        sphere_t_v=march.velocity[:, last] @ frame.T,
        sphere_spin=march.angular_velocity[:, last] @ frame.T,
        friction_force=friction,
        slip=march.slip[:, m],
        stick_share=march.stick_share[:, m],
        wall_t=march.wall_x[:, tangents] + (force - at_rest) @ S[:, 1:],
        dissipated_friction=march.friction_heat[:, m],
    )
