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
from scipy.sparse import coo_matrix, csc_matrix, csr_matrix, vstack
from scipy.sparse.csgraph import connected_components

from fem.constraints import Constraint
from fem.elasticity import Structure
from fem.sagging import sagging
from fem.trace import OffFace, face_nodes, face_quadrature, trace

DIRECTIONS = ("kx", "ky", "kz", "krx", "kry", "krz")
NOWHERE = np.empty(0, np.int64)
LAST = 1e-4  # weight of dofs that follow a face only where all else of it is held
ALONG = 0.9  # cosine: an axis nearer than this to another lies along it


class Bushing(NamedTuple):
    """Six stiffnesses of one joint, in its frame; inf is a rigid direction, 0 a free one."""

    kx: float = np.inf  # [N/m]
    ky: float = np.inf
    kz: float = np.inf
    krx: float = np.inf  # [N m/rad]
    kry: float = np.inf
    krz: float = np.inf


class Side(NamedTuple):
    """What a joint holds to on one body."""

    face: str  # "body:face"
    coupling: Literal["rigid", "mean"] = "rigid"
    over: str | None = None  # the mean is taken over the footprint of this face; None: its own
    within: float = np.inf  # [m] of the joint's centre: a washer's radius
    gap: float = 0.0  # [m] by which that other face may miss this one


class Joint(NamedTuple):
    """A bolt, or anything else that six springs stand for, where it sits."""

    name: str  # its springs are "name.kx", ...; joints of one name share their stiffnesses
    first: Side
    second: Side | None  # None is the ground
    centre: NDArray[np.float64]  # (3,) [m]
    springs: Bushing = Bushing()
    frame: NDArray[np.float64] = np.eye(3)  # rows along the joint's x, y, z


class Tie(NamedTuple):
    """Two faces in contact that stay together."""

    slave: str  # lies on the other, and follows it: the finer mesh, or the smaller face
    master: str
    gap: float = 0.0  # [m] by which they may miss each other


class _Coupling(NamedTuple):
    """A side whose motion about the centre is B @ U[columns]."""

    side: Side
    name: str
    centre: NDArray[np.float64]
    columns: NDArray[np.int64]
    B: NDArray[np.float64]  # (6, len(columns))
    spare: NDArray[np.int64]  # of these, what may follow the face where all else of it is held
    follows: bool = False  # all of these may: the joint's other side is a mean as well


def normal_frame(axis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rows (3, 3): z along an axis (3,), x along the first global axis beside it."""
    z = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    beside = np.eye(3)[np.flatnonzero(np.abs(z) < ALONG)[0]]
    x = beside - (beside @ z) * z
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
    """C = (G^T W G)^-1 G^T W (6, 3 n): rigid motion nearest to displacements of points (RBE3)."""
    G = rigid_motion(points, centre)
    GtW = G.T * np.repeat(weights, 3)
    return np.linalg.solve(GtW @ G, GtW)


def tie(structure: Structure, pair: Tie, n_total: int) -> Constraint:
    """The nodes of the slave face follow the displacement of the master face.

    Facets of curved faces, and rims, may miss each other by what straight edges leave.
    """
    dofs = face_nodes(structure, pair.slave)
    gap = pair.gap + sagging(structure, pair.slave) + sagging(structure, pair.master)
    P = _on(structure, pair.master, pair.slave, _positions(structure, dofs), gap)
    return Constraint(dofs.ravel(), widened(P, n_total), f"the tie {pair.slave} to {pair.master}")


def rigid_sides(structure: Structure, joints: Sequence[Joint], n_total: int) -> list[Constraint]:
    """The nodes of all rigid sides; a node between several follows their mean."""
    held = [c for c in _couplings(structure, joints) if c.side.coupling == "rigid"]
    nodes = [_nodes_within(structure, c) for c in held]
    count = np.bincount(np.concatenate([NOWHERE, *(d[:, 0] for d in nodes)]), minlength=1)
    slaves = np.unique(np.concatenate([NOWHERE, *(d.ravel() for d in nodes)]))
    A = csr_matrix((len(slaves), n_total))
    for coupling, dofs in zip(held, nodes, strict=True):
        G = rigid_motion(_positions(structure, dofs), coupling.centre)
        _require_spread(G, coupling)
        G /= np.repeat(count[dofs[:, 0]], 3)[:, None]
        rows = np.searchsorted(slaves, dofs.ravel())
        A = A + _placed(rows, coupling.columns, G @ coupling.B, A.shape)
    names = " and ".join(dict.fromkeys(c.name for c in held))
    return [Constraint(slaves, A.tocsr(), f"joint {names}")] if held else []


def mean_sides(
    structure: Structure, joints: Sequence[Joint], taken: NDArray[np.int64], n_total: int
) -> Iterator[Constraint]:
    """B U = C u of all mean sides, solved for six dofs of each, none of those `taken`; dofs of the
    face keep the matrices sparse.

    Sides whose faces have dofs in common are solved for together. Of two mean sides of one joint
    the motion q of the second is written in dofs of its face, q = C u: to solve for six of these
    instead multiplies entries of K by the square of their number, 1e3 and more, and rigid motions
    of a small body then drown in the rounding.
    """
    held = [c for c in _couplings(structure, joints) if c.side.coupling == "mean"]
    C = [_mean_motion(structure, coupling) for coupling in held]
    if held:
        reads = csr_matrix([np.bincount(c.indices, minlength=c.shape[1]) > 0 for c in C], dtype=int)
        group = connected_components(reads @ reads.T, directed=False)[1]
        for i in range(group.max() + 1):
            here = np.flatnonzero(group == i)
            if len(here) == 1 and held[here[0]].follows:
                name = f"joint {held[here[0]].name}"
                yield Constraint(held[here[0]].columns, widened(C[here[0]], n_total), name)
                continue
            rows = vstack([C[j] for j in here]).tocsc()
            yield _solved(structure, [held[j] for j in here], rows, taken, n_total)


def _couplings(structure: Structure, joints: Sequence[Joint]) -> Iterator[_Coupling]:
    for i, joint in enumerate(joints):
        r = structure.n_dofs + 6 * i + np.arange(6)
        q = r + 6 * len(joints)
        turned = block_diag(joint.frame, joint.frame).T
        moved = np.hstack([turned, np.eye(6)])
        open_ones = r[np.array(joint.springs) == 0]
        yield _Coupling(joint.first, joint.name, joint.centre, np.append(r, q), moved, open_ones)
        if joint.second:
            both = joint.first.coupling == joint.second.coupling == "mean"
            yield _Coupling(joint.second, joint.name, joint.centre, q, np.eye(6), q, both)


def _nodes_within(structure: Structure, coupling: _Coupling) -> NDArray[np.int64]:
    """Dofs (n, 3) of the nodes that a rigid side holds."""
    dofs = face_nodes(structure, coupling.side.face)
    away = np.linalg.norm(_positions(structure, dofs) - coupling.centre, axis=1)
    return dofs[away <= coupling.side.within * (1 + 1e-9)]


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


def _mean_motion(structure: Structure, coupling: _Coupling) -> csr_matrix:
    """C (6, ndof): the face's mean motion over a footprint."""
    side = coupling.side
    points, weights = face_quadrature(structure, side.over or side.face)
    near = np.linalg.norm(points - coupling.centre, axis=1) <= side.within * (1 + 1e-9)
    points, weights = points[near], weights[near]
    _require_spread(rigid_motion(points, coupling.centre), coupling)
    C = distributing(points, weights, coupling.centre)
    found = csr_matrix(C) @ _on(structure, side.face, side.over or side.face, points, side.gap)
    found.eliminate_zeros()
    return found


def _solved(
    structure: Structure, held: list[_Coupling], C: csc_matrix, taken, n_total: int
) -> Constraint:
    """C u = B U for the best-conditioned dofs that are not taken, of the faces where possible."""
    used = np.flatnonzero(np.diff(C.indptr))
    columns = np.concatenate([used, *(c.columns for c in held)])
    spare = np.concatenate([c.spare for c in held])
    weight = np.where(np.isin(columns, spare), LAST, 1.0 * (columns < structure.n_dofs))
    weight[np.isin(columns, taken)] = 0.0
    A = np.hstack([C[:, used].toarray(), -block_diag(*(c.B for c in held))])
    # rows of one unit: turns count as shifts at the distance of the face's size
    size = np.ptp(structure.points[used // 3], axis=0).max()
    A *= np.tile([1.0] * 3 + [size] * 3, len(held))[:, None]
    R, pivots = qr(A * weight, mode="r", pivoting=True)
    name = "joint " + " and ".join(dict.fromkeys(c.name for c in held))
    free = np.abs(np.diag(R))  # falling
    if not free[-1] > LAST**2 * free[0]:
        raise ValueError(f"{name}: what it holds to is held by supports or ties; remove one.")
    at, rest = pivots[: len(A)], pivots[len(A) :]
    solved = -np.linalg.solve(A[:, at], A[:, rest])
    shape = (len(at), n_total)
    return Constraint(columns[at], _placed(np.arange(len(at)), columns[rest], solved, shape), name)


def _on(
    structure: Structure, face: str, footprint: str, points: NDArray[np.float64], gap: float = 0.0
) -> csr_matrix:
    """The trace of a face at points of another; raises ValueError across a gap."""
    try:
        return trace(structure, face, points, gap=gap)
    except OffFace as apart:
        raise ValueError(
            f"the face {footprint!r} does not lie on {face!r}, which it is joined to: {apart} Let "
            "them touch."
        ) from None


def _positions(structure: Structure, dofs: NDArray[np.int64]) -> NDArray[np.float64]:
    return structure.points[dofs[:, 0] // 3]


def _placed(rows, columns, block, shape) -> csr_matrix:
    """A dense block at the given rows and columns of a sparse matrix; equal columns add up."""
    i, j = np.meshgrid(rows, columns, indexing="ij")
    return coo_matrix((block.ravel(), (i.ravel(), j.ravel())), shape=shape).tocsr()


def widened(A: csr_matrix, n_total: int) -> csr_matrix:
    """The same rows among more dofs."""
    return csr_matrix((A.data, A.indices, A.indptr), shape=(A.shape[0], n_total))
