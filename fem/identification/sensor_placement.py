"""Points at which to hit and measure a structure, so that few of them tell its modes apart.

Of candidate points with shapes Phi (c, n) those are kept that carry most of the determinant of the
information matrix Phi^T Phi (effective independence):

    E = diag(Phi (Phi^T Phi)^-1 Phi^T),   0 <= E_i <= 1,   sum E = n:

what a point adds to the rank. The one that adds least is left out, until as many are left as are
wanted. Kammer, J. Guid. Control Dyn. 14 (1991) 251.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from beadwave.fem.assembly.model import Model
from beadwave.fem.assembly.trace import outer_nodes


class Candidates(NamedTuple):
    """Points of the outside, once for each axis that is normal to it there."""

    points: NDArray[np.float64]  # (c, 3) [m]
    axes: NDArray[np.int64]  # (c,) 0, 1, 2
    reading: NDArray[np.int64]  # (c,) dof of the structure that moves along it


# Spread of candidates over the outside
MAX_CANDIDATES = 400  # points; 200 to 1000 end in points of like determinants
MIN_DISTANCE = 0.75  # edges of the mesh between a candidate and another body: room for a sensor
MIN_COSINE = 0.9  # cosine between a facet's normal and the axis along which it is hit


def outside(model: Model) -> Candidates:
    """Points of the outside away from other bodies, each as far from the others as can be.

    Raises ValueError where no face looks along an axis.
    """
    outer = outer_nodes(model.structure)
    corners = outer.points[outer.faces]
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 1] - corners[:, 0])
    normal = np.abs(normal) / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    edge = np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1)

    # a node can be hit along the axis of each face around it that looks along one
    along = np.zeros((len(outer.points), 3), bool)
    for a in range(3):
        along[np.unique(outer.faces[normal[:, a] > MIN_COSINE]), a] = True
    usable, length = along.any(axis=1), np.zeros(len(outer.points))
    np.maximum.at(length, outer.faces.ravel(), np.repeat(edge, outer.faces.shape[1]))
    for body in np.unique(outer.body):
        on_body = outer.body == body
        if not on_body.all():
            distance = cKDTree(outer.points[~on_body]).query(outer.points[on_body])[0]
            usable[on_body] &= distance > MIN_DISTANCE * length[on_body]
    nodes = np.flatnonzero(usable)
    if not len(nodes):
        raise ValueError("no face of the outside looks along x, y or z; name points by hand")

    # the farthest from those taken, from a corner on: no two candidates are then close together
    # before the whole outside is covered
    points = outer.points[nodes]
    chosen = [int(np.argmin(points.sum(axis=1)))]
    distance = np.linalg.norm(points - points[chosen[0]], axis=1)
    while len(chosen) < min(MAX_CANDIDATES, len(nodes)) and distance.max() > 0:
        chosen.append(int(distance.argmax()))
        distance = np.minimum(distance, np.linalg.norm(points - points[chosen[-1]], axis=1))
    place, axes = np.nonzero(along[nodes[chosen]])
    nodes = nodes[chosen][place]
    return Candidates(outer.points[nodes], axes, outer.dofs[nodes, axes])


def effective_independence(
    phi: NDArray[np.float64], count: int, *, alike: float = 0.05
) -> NDArray[np.int64]:
    """The `count` candidates, of shapes phi (c, n), that tell the modes apart best, ascending.

    Of candidates that move alike, as those on both faces of a sheet, to within the share `alike` of
    the largest motion in each mode, one is left, as far as there are enough. Raises ValueError
    where there are fewer points than modes, or modes that no point sees.
    """
    c, n = phi.shape
    if not n <= count <= c:
        raise ValueError(f"{count} points; {n} modes need {n} to {c} points")

    # modes of one length, so that all count alike in the order in which candidates are looked at
    phi = phi / np.linalg.norm(phi, axis=0)
    if np.linalg.matrix_rank(phi) < n:
        raise ValueError("some of the modes look alike at all candidates; take fewer modes")
    scaled = phi / np.abs(phi).max(axis=0)
    chosen: list[int] | NDArray[np.int64] = []
    for i in np.argsort(-np.sum(phi**2, axis=1)).tolist():
        distance = np.abs(scaled[chosen] - scaled[i]).max(axis=1) if len(chosen) else np.ones(1)
        if distance.min() > alike:
            chosen.append(i)
    chosen = np.sort(chosen)
    if len(chosen) < count or np.linalg.matrix_rank(phi[chosen]) < n:
        chosen = np.arange(c)

    # E_i = |row i of Q|^2 with phi = Q R, anew after each point that is left out
    while len(chosen) > count:
        q = np.linalg.qr(phi[chosen])[0]
        chosen = np.delete(chosen, int(np.sum(q**2, axis=1).argmin()))
    return chosen


def one_more_point(phi: NDArray[np.float64], candidates: NDArray[np.float64]) -> tuple[int, float]:
    """The candidate of c that tells two modes apart best in addition to the present points: its
    position, and the MAC of both with it; from their shapes phi (p, 2) and candidates (c, 2)."""
    cross = (phi[:, 0] @ phi[:, 1] + candidates[:, 0] * candidates[:, 1]) ** 2
    sizes = np.sum(phi**2, axis=0) + candidates**2
    mac = cross / np.maximum(sizes[:, 0] * sizes[:, 1], 1e-300)
    best = int(mac.argmin())
    return best, float(mac[best])
