"""Joints between two touching faces: ties, and screws as springs of six stiffnesses.

Tie: the slave face's nodes follow the master face, u_slave = P u_master; the meshes need not match.

Screw: the sheet side is a rigid patch of motion q (kinematic coupling, RBE2), the other side's
motion is the area-weighted mean C u (distributing coupling, RBE3). The elongation of the joint

    r = q - p,    p = C u                                            (three shifts, three turns)

is a degree of freedom of its own: with q = r + p put into the rigid patch, the springs stand on
the diagonal, K(k) = K0 + sum_j k_j e_j e_j^T, so that a stiffness of 1 or of 1e16 N/m costs no
digit, an infinite one removes its r, and d lambda / d k_j = phi_j^2.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr
from scipy.sparse import coo_matrix, csr_matrix, hstack, vstack
from skfem import Basis

from fem.constraints import Constraint
from fem.trace import face_nodes, face_quadrature, trace

DIRECTIONS = ("kx", "ky", "kz", "krx", "kry", "krz")


class Joint(NamedTuple):
    """Stiffnesses of one screw; inf is a rigid direction, 0 a free one."""

    kx: float = np.inf  # [N/m]
    ky: float = np.inf
    kz: float = np.inf
    krx: float = np.inf  # [N m/rad]
    kry: float = np.inf
    krz: float = np.inf


class Screw(NamedTuple):
    """Where a joint sits: a rigid share of the slave face, the master face, the screw's centre."""

    share: str
    master: str
    centre: NDArray[np.float64]  # (3,) [m]


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


def tie(basis: Basis, slave: str, master: str) -> Constraint:
    """The nodes of face `slave` follow the displacement of face `master`."""
    dofs = face_nodes(basis, slave)
    return Constraint(dofs.ravel(), _on(basis, master, slave, _positions(basis, dofs)))


def _on(basis: Basis, master: str, slave: str, points: NDArray[np.float64]) -> csr_matrix:
    """The trace of face `master` at points of face `slave`; raises ValueError across a gap."""
    try:
        return trace(basis, master, points)
    except ValueError as apart:
        raise ValueError(
            f"the face {slave!r} does not lie on {master!r}, which it is joined to: {apart} Let "
            "them touch."
        ) from None


def screws(basis: Basis, layout: Sequence[Screw], taken: NDArray[np.int64]) -> list[Constraint]:
    """The rigid shares of all screws and the mean motions of the faces they hold to.

    All dofs are U = [u (ndof), r (6 a screw), p (6 a screw)]: elongations r, mean motions p = C u.
    The shares follow q = r + p; p = C u is solved for six dofs of the master face (none of
    `taken`), so that the stiffness stays sparse. A node between two screws follows both's mean.
    """
    n_screws, ndof = len(layout), basis.N
    n_total = ndof + 12 * n_screws
    shares = [face_nodes(basis, s.share) for s in layout]
    count = np.bincount(np.concatenate([d[:, 0] for d in shares]), minlength=ndof)
    rows = csr_matrix((ndof, n_total))
    for i, (screw, dofs) in enumerate(zip(layout, shares, strict=True)):
        G = rigid_motion(_positions(basis, dofs), screw.centre)
        G /= np.repeat(count[dofs[:, 0]], 3)[:, None]
        r = ndof + 6 * i + np.arange(6)
        columns = np.concatenate([r, r + 6 * n_screws])
        rows = rows + _placed(dofs.ravel(), columns, np.hstack([G, G]), (ndof, n_total))
    slaves = np.unique(np.concatenate([d.ravel() for d in shares]))
    masters = list(dict.fromkeys(s.master for s in layout))
    means = [_mean_motions(basis, layout, m, np.union1d(taken, slaves)) for m in masters]
    return [Constraint(slaves, rows.tocsr()[slaves]), *means]


def _mean_motions(basis: Basis, layout: Sequence[Screw], master: str, taken) -> Constraint:
    """p = C u of all screws on one face, solved for the best-conditioned dofs u_D of that face."""
    here = [i for i, s in enumerate(layout) if s.master == master]
    n_total = basis.N + 12 * len(layout)
    C = vstack([_mean_motion(basis, layout[i]) for i in here]).tocsc()
    C.eliminate_zeros()
    used = np.flatnonzero(np.diff(C.indptr))
    eligible = np.setdiff1d(used, taken)
    # pivoted QR on rows of one unit: turns count as shifts at the distance of the face's size
    scale = np.tile([1.0] * 3 + [np.ptp(basis.doflocs[:, used], axis=1).max()] * 3, len(here))
    dense = scale[:, None] * C[:, eligible].toarray()
    pivots = qr(dense, mode="r", pivoting=True)[1][: C.shape[0]]
    dependent, rest = eligible[pivots], np.setdiff1d(used, eligible[pivots])
    C_D, C_R = C[:, dependent].toarray(), C[:, rest].toarray()
    p = np.concatenate([basis.N + 6 * (len(layout) + i) + np.arange(6) for i in here])
    solved = np.linalg.solve(C_D, np.hstack([np.eye(len(p)), -C_R]))
    n = len(dependent)
    A = _placed(np.arange(n), np.concatenate([p, rest]), solved, (n, n_total))
    return Constraint(dependent, A)


def _mean_motion(basis: Basis, screw: Screw) -> csr_matrix:
    """C (6, ndof): the master face's mean motion over the screw's share."""
    points, weights = face_quadrature(basis, screw.share)
    C = distributing(points, weights, screw.centre)
    return csr_matrix(C) @ _on(basis, screw.master, screw.share, points)


def _positions(basis: Basis, dofs: NDArray[np.int64]) -> NDArray[np.float64]:
    return basis.doflocs[:, dofs[:, 0]].T


def _placed(rows, columns, block, shape) -> csr_matrix:
    """A dense block at the given rows and columns of a sparse matrix."""
    i, j = np.meshgrid(rows, columns, indexing="ij")
    return coo_matrix((block.ravel(), (i.ravel(), j.ravel())), shape=shape).tocsr()


def widened(constraint: Constraint, n_total: int) -> Constraint:
    """The same constraint among more dofs."""
    n = n_total - constraint.A.shape[1]
    empty = csr_matrix((constraint.A.shape[0], n))
    return Constraint(constraint.slaves, hstack([constraint.A, empty]).tocsr())
