"""Distance of straight edges from the curved face, or the curved rim, that they approximate.

The arc over a chord of a length s, whose tangents turn by theta along it, rises above it by

    s/2 tan(theta / 4).

Facets side by side are chords of the face, edges end to end along its rim those of the rim.
"""

import numpy as np
from numpy.typing import NDArray

from beadwave.fem.assembly.elasticity import Structure


def sagging(structure: Structure, face: str, *, corner: float = 50.0) -> float:
    """The largest distance [m] of a face "body:face" from its mesh: 0 of a plane polygon.

    Where facets or edges turn by more than `corner` degrees the face itself has an edge or a
    corner; not varied.
    """
    # edges of the facets, each once, with the number of facets that it belongs to: two inside of
    # the face, one on its rim
    body, facets = structure.facets(face)
    mesh = structure.basis[body].mesh
    nodes = mesh.facets[:, facets]
    ends = np.sort([nodes, np.roll(nodes, -1, axis=0)], axis=0).reshape(2, -1)
    ends, side, count = np.unique(ends, axis=1, return_inverse=True, return_counts=True)
    along = np.diff(mesh.p[:, ends], axis=1)[:, 0].T
    length = np.linalg.norm(along, axis=1)

    # facets on either side of an edge are chords of the face, as long as they are wide there
    area = area_vectors(mesh.p[:, nodes])
    meeting = _pairs(side)
    across = np.linalg.norm(area, axis=1)[meeting % len(area)] / length[side[meeting]]
    width = across * (2 if len(nodes) == 3 else 1)
    inside = _largest_gap(area[meeting % len(area)], width, corner)

    # edges end to end are chords of the rim
    rim = np.flatnonzero(count == 1)
    following = rim[_pairs(ends[:, rim].ravel()) % max(len(rim), 1)]
    return max(inside, _largest_gap(along[following], length[following], corner))


def area_vectors(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Normals (n, 3) of facets (3, 3 or 4, n), as long as their areas [m^2]."""
    p = corners.transpose(1, 2, 0)
    return np.cross(p[-2] - p[0], p[-1] - p[1]) / 2


def _pairs(label: NDArray[np.int64]) -> NDArray[np.int64]:
    """Positions (k, 2) of labels that occur twice."""
    order = np.argsort(label, kind="stable")
    _, first, count = np.unique(label[order], return_index=True, return_counts=True)
    return order[first[count == 2][:, None] + [0, 1]]


def _largest_gap(vectors: NDArray[np.float64], chord: NDArray[np.float64], corner: float) -> float:
    """The largest s/2 tan(theta / 4) [m] of pairs of chords (k, 2) [m] whose vectors (k, 2, 3)
    turn by theta; 0 where there is no pair, or only corners."""
    unit = vectors / np.linalg.norm(vectors, axis=2, keepdims=True)
    turn = np.arccos(np.minimum(np.abs(np.sum(unit[:, 0] * unit[:, 1], axis=1)), 1.0))
    gap = chord.max(axis=1) / 2 * np.tan(turn / 4)
    return float(np.max(gap, where=turn < np.radians(corner), initial=0.0))
