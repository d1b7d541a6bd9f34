"""Joints between faces of bodies: ties, and bolts as springs of six stiffnesses.

Tie: the slave face's nodes follow the master face, u_slave = P u_master; the meshes need not match.

Joint: either side holds its face rigidly (kinematic coupling, RBE2: u = G q over the nodes of the
face) or moves as the face does in the mean (distributing coupling, RBE3: q = C u). In the joint's
frame R the elongation of the springs

    r = R (q_first - q_second)                                       (three shifts, three turns)

is a degree of freedom of its own: with q_first = q_second + R^T r the springs stand on the
diagonal, K(k) = K0 + sum_j k_j e_j e_j^T, so that a stiffness of 1 or of 1e16 N/m costs no digit,
an infinite one removes its r, and d lambda / d k_j = phi_j^2. The ground is a second side of
q = 0. All dofs are U = [u (ndof), r (6 a joint), q_second (6 a joint), ...].
"""

from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, qr
from scipy.sparse import coo_matrix, csr_matrix, vstack
from scipy.sparse.csgraph import connected_components

from beadwave.fem.assembly.chord_height import sagging
from beadwave.fem.assembly.constraints import Constraint
from beadwave.fem.assembly.elasticity import Structure
from beadwave.fem.assembly.trace import OffFace, face_nodes, face_quadrature, trace

# of the chord heights of both faces, by which their meshes may be apart: triangles askew on a
# cylinder turn less from their neighbours than their edges do on it; 1.18 was needed on a round bar
ASKEW = 1.5
DIRECTIONS = ("kx", "ky", "kz", "krx", "kry", "krz")


class Bushing(NamedTuple):
    """Six stiffnesses of one joint, in its frame; inf is a rigid direction, 0 a free one."""

    kx: float = np.inf  # [N/m]
    ky: float = np.inf
    kz: float = np.inf
    krx: float = np.inf  # [N m/rad]
    kry: float = np.inf
    krz: float = np.inf


class Side(NamedTuple):
    """One side of a joint: the face of a body that it moves with."""

    face: str  # "body:face"
    coupling: Literal["rigid", "mean"] = "rigid"
    over: str | None = None  # face whose footprint the mean is taken over; None: its own
    within: float = np.inf  # [m] of the joint's centre: a washer's radius
    gap: float = 0.0  # [m] by which the footprint may miss this face


class Joint(NamedTuple):
    """A bolt or another connection that acts as six springs at one point."""

    name: str  # its springs are "name.kx", ...; joints of one name share their stiffnesses
    first: Side
    second: Side | None  # None is the ground
    centre: NDArray[np.float64]  # (3,) [m]
    springs: Bushing = Bushing()
    frame: NDArray[np.float64] = np.eye(3)  # rows along the joint's x, y, z


class Tie(NamedTuple):
    """Two faces in contact that stay together."""

    slave: str  # lies on the master and follows it: the finer mesh, or the smaller face
    master: str
    gap: float = 0.0  # [m] by which they may miss each other


class _Coupling(NamedTuple):
    """A side of a joint, whose motion about the centre is B @ U[columns]."""

    side: Side
    name: str  # of the joint
    centre: NDArray[np.float64]
    columns: NDArray[np.int64]
    B: NDArray[np.float64]  # (6, len(columns))
    spare: NDArray[np.int64]  # columns that may follow the face where all else of it is held
    follows: bool = False  # whether all of them may: the joint's other side is a mean as well


def normal_frame(axis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rows (3, 3): z along an axis (3,), x nearest to the first global axis that lies 26 degrees or
    more off it: a fixed rule, so that kx and ky of a joint mean the same on every mesh."""
    z = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    first = np.eye(3)[np.flatnonzero(np.abs(z) < 0.9)[0]]
    x = first - (first @ z) * z
    x /= np.linalg.norm(x)
    return np.array([x, np.cross(z, x), z])


def rigid_motion(points: NDArray[np.float64], centre: NDArray[np.float64]) -> NDArray[np.float64]:
    """G (3 n, 6): displacements of points (n, 3) under three shifts and turns about a centre."""
    x, y, z = (points - centre).T
    G = np.zeros((len(points), 3, 6))
    G[:, range(3), range(3)] = 1.0
    G[:, 0, 4], G[:, 0, 5] = z, -y
    G[:, 1, 3], G[:, 1, 5] = -z, x
    G[:, 2, 3], G[:, 2, 4] = y, -x
    return G.reshape(-1, 6)


def distributing(
    points: NDArray[np.float64], weights: NDArray[np.float64], centre: NDArray[np.float64]
) -> NDArray[np.float64]:
    """C (6, 3 n) with q = C u: the rigid motion nearest to the displacements u of points (RBE3).

    q minimises sum_n w_n |u_n - G_n q|^2 over the points (n, 3) with weights w (n,), so that
    G^T W G q = G^T W u, C = (G^T W G)^-1 G^T W. A force and moment F (6,) at the centre act on the
    points as C^T F: by virtual work they are in balance with F, and add no stiffness to the face.
    """
    G = rigid_motion(points, centre)
    GtW = G.T * np.repeat(weights, 3)
    return np.linalg.solve(GtW @ G, GtW)


def tie(structure: Structure, pair: Tie, n_total: int) -> Constraint:
    """The nodes of the slave face follow the displacement of the master face: a constraint among
    n_total dofs, u_slave = P u with the master's shape functions at the slave's nodes as rows of P.

    The straight edges of both meshes cut curved faces and rims short; the gap allowed includes
    these distances (`fem.assembly.chord_height`). Raises ValueError where the faces miss each other
    by more.
    """
    dofs = face_nodes(structure, pair.slave)
    P = _trace_on(
        structure,
        pair.master,
        pair.slave,
        _positions(structure, dofs),
        tied_across(structure, pair),
    )
    return Constraint(dofs.ravel(), widened(P, n_total), f"the tie {pair.slave} to {pair.master}")


def tied_across(structure: Structure, pair: Tie) -> float:
    """[m] by which the meshes of two tied faces may be apart: their gap, and the distances by which
    both cut a curved face short."""
    return pair.gap + ASKEW * (sagging(structure, pair.slave) + sagging(structure, pair.master))


def rigid_sides(structure: Structure, joints: Sequence[Joint], n_total: int) -> list[Constraint]:
    """u = G B U of the nodes of all rigid sides (RBE2); a node of several follows their mean.

    Raises ValueError for a side of too few nodes.
    """
    couplings = [c for c in _couplings(structure, joints) if c.side.coupling == "rigid"]
    if not couplings:
        return []

    # nodes (n, 3 dofs) of each side, within the washer's radius
    nodes = []
    for coupling in couplings:
        dofs = face_nodes(structure, coupling.side.face)
        radii = np.linalg.norm(_positions(structure, dofs) - coupling.centre, axis=1)
        nodes.append(dofs[radii <= coupling.side.within * (1 + 1e-9)])
    n_sides = np.bincount(np.concatenate([dofs[:, 0] for dofs in nodes]), minlength=1)
    slaves = np.unique(np.concatenate([dofs.ravel() for dofs in nodes]))

    # u = G B U of each side; a node of several sides has their mean, not the last one's motion
    A = csr_matrix((len(slaves), n_total))
    for coupling, dofs in zip(couplings, nodes, strict=True):
        G = rigid_motion(_positions(structure, dofs), coupling.centre)
        _require_spread(G, coupling)
        G /= np.repeat(n_sides[dofs[:, 0]], 3)[:, None]
        rows = np.searchsorted(slaves, dofs.ravel())
        A = A + _scattered(rows, coupling.columns, G @ coupling.B, A.shape)
    names = " and ".join(dict.fromkeys(c.name for c in couplings))
    return [Constraint(slaves, A.tocsr(), f"joint {names}")]


def mean_sides(
    structure: Structure,
    joints: Sequence[Joint],
    claimed: NDArray[np.int64],
    n_total: int,
    *,
    last: float = 1e-4,
) -> list[Constraint]:
    """B U = C u of all mean sides (RBE3) as constraints that give six slave dofs of each side, none
    of those `claimed` by other constraints, by the others. Slaves are dofs of the faces where
    possible, which keeps the matrices sparse.

    Sides whose faces have dofs in common are solved for together. Where both sides of a joint are
    means, the slaves of the second side are its motion, q = C u. Six dofs of the face as slaves
    would multiply entries of K by the square of the number of nodes, 1e3 and more, in which the
    rigid motions of a small body are lost by rounding. `last` is the weight in the pivoting of dofs
    that become slaves only where all others of the face are held; not varied. Raises ValueError
    where too few dofs of a face are unclaimed.
    """
    couplings = [c for c in _couplings(structure, joints) if c.side.coupling == "mean"]
    if not couplings:
        return []

    # C (6, ndof) of each side: the face's mean motion over a footprint
    C = []
    for coupling in couplings:
        side = coupling.side
        footprint = side.over or side.face
        points, weights = face_quadrature(structure, footprint)
        inside = np.linalg.norm(points - coupling.centre, axis=1) <= side.within * (1 + 1e-9)
        points, weights = points[inside], weights[inside]
        _require_spread(rigid_motion(points, coupling.centre), coupling)
        mean = csr_matrix(distributing(points, weights, coupling.centre))
        mean = mean @ _trace_on(structure, side.face, footprint, points, side.gap)
        mean.eliminate_zeros()
        C.append(mean)

    # groups of sides whose faces share dofs
    reads = csr_matrix([np.bincount(c.indices, minlength=c.shape[1]) > 0 for c in C], dtype=int)
    group = connected_components(reads @ reads.T, directed=False)[1]
    constraints = []
    for i in range(group.max() + 1):
        members = np.flatnonzero(group == i)
        sides = [couplings[j] for j in members]
        name = "joint " + " and ".join(dict.fromkeys(c.name for c in sides))
        if len(sides) == 1 and sides[0].follows:
            q = sides[0].columns
            constraints.append(Constraint(q, widened(C[members[0]], n_total), name))
            continue

        # A U = [C, -B] U = 0, rows of one unit: turns count as shifts at the distance of the
        # face's size
        rows = vstack([C[j] for j in members]).tocsc()
        used = np.flatnonzero(np.diff(rows.indptr))
        columns = np.concatenate([used, *(c.columns for c in sides)])
        A = np.hstack([rows[:, used].toarray(), -block_diag(*(c.B for c in sides))])
        size = np.ptp(structure.points[used // 3], axis=0).max()
        A *= np.tile([1.0] * 3 + [size] * 3, len(sides))[:, None]

        # the best-conditioned dofs become slaves: those of the faces where possible
        spare = np.concatenate([c.spare for c in sides])
        weight = np.where(np.isin(columns, spare), last, 1.0 * (columns < structure.n_dofs))
        weight[np.isin(columns, claimed)] = 0.0
        R, pivots = qr(A * weight, mode="r", pivoting=True)
        diagonal = np.abs(np.diag(R))  # falling
        if not diagonal[-1] > last**2 * diagonal[0]:
            raise ValueError(f"{name}: what it holds to is held by supports or ties; remove one.")
        slaves, masters = pivots[: len(A)], pivots[len(A) :]
        solution = -np.linalg.solve(A[:, slaves], A[:, masters])
        shape = (len(slaves), n_total)
        equations = _scattered(np.arange(len(slaves)), columns[masters], solution, shape)
        constraints.append(Constraint(columns[slaves], equations, name))
    return constraints


def _couplings(structure: Structure, joints: Sequence[Joint]) -> Iterator[_Coupling]:
    """Both sides of every joint: q_first = q_second + R^T r, and q_second itself."""
    for i, joint in enumerate(joints):
        r = structure.n_dofs + 6 * i + np.arange(6)
        q = r + 6 * len(joints)
        turned = block_diag(joint.frame, joint.frame).T
        both = np.hstack([turned, np.eye(6)])
        free = r[np.array(joint.springs) == 0]
        yield _Coupling(joint.first, joint.name, joint.centre, np.append(r, q), both, free)
        if joint.second:
            means = joint.first.coupling == joint.second.coupling == "mean"
            yield _Coupling(joint.second, joint.name, joint.centre, q, np.eye(6), q, means)


def _require_spread(G: NDArray[np.float64], coupling: _Coupling) -> None:
    """Raise ValueError where points (G of them) cannot hold a turn."""
    size = np.abs(G[:, 3:]).max(initial=1e-300)
    unit = G / np.array([1.0] * 3 + [size] * 3)
    if len(G) < 9 or np.linalg.svd(unit, compute_uv=False)[-1] < 1e-6 * len(G) ** 0.5:
        raise ValueError(
            f"joint {coupling.name} holds {len(G) // 3} nodes of {coupling.side.face} within "
            f"{coupling.side.within:g} m, which lie on a line at most and hold no turn; take a "
            "larger washer or a finer mesh there."
        )


def _trace_on(
    structure: Structure, face: str, footprint: str, points: NDArray[np.float64], gap: float
) -> csr_matrix:
    """The trace of a face at points of another; raises ValueError across a gap."""
    try:
        return trace(structure, face, points, gap=gap)
    except OffFace as error:
        raise ValueError(
            f"the face {footprint!r} does not lie on {face!r}, which it is joined to: {error} Let "
            "them touch."
        ) from None


def _positions(structure: Structure, dofs: NDArray[np.int64]) -> NDArray[np.float64]:
    """Points (n, 3) [m] of nodes by their dofs (n, 3)."""
    return structure.points[dofs[:, 0] // 3]


def _scattered(rows, columns, block, shape) -> csr_matrix:
    """A dense block at the given rows and columns of a sparse matrix; equal columns add up."""
    i, j = np.meshgrid(rows, columns, indexing="ij")
    return coo_matrix((block.ravel(), (i.ravel(), j.ravel())), shape=shape).tocsr()


def widened(A: csr_matrix, n_total: int) -> csr_matrix:
    """The rows of A (k, n) among more dofs, (k, n_total): zeros beyond the first n."""
    return csr_matrix((A.data, A.indices, A.indptr), shape=(A.shape[0], n_total))
