"""How far straight edges lie off the curved face, or the curved rim, that they stand for.

A chord of a length s between tangents that turn by theta leaves of its arc

    s/2 tan(theta / 4).

Facets side by side are chords of the face, edges end to end along its rim those of the rim.
"""

import numpy as np
from numpy.typing import NDArray

from fem.elasticity import Structure

CORNER = 50.0  # degrees: a face or rim that turns by more has an edge or a corner there


def sagging(structure: Structure, face: str) -> float:
    """The most that the mesh of a face "body:face" leaves of it [m]: 0 of a plane polygon."""
    body, facets = structure.facets(face)
    mesh = structure.basis[body].mesh
    nodes = mesh.facets[:, facets]
    ends = np.sort([nodes, np.roll(nodes, -1, axis=0)], axis=0).reshape(2, -1)
    ends, side, count = np.unique(ends, axis=1, return_inverse=True, return_counts=True)
    along = np.diff(mesh.p[:, ends], axis=1)[:, 0].T
    length = np.linalg.norm(along, axis=1)
    area = area_vectors(mesh.p[:, nodes])
    meeting = _twins(side)
    across = np.linalg.norm(area, axis=1)[meeting % len(area)] / length[side[meeting]]
    inside = _left(area[meeting % len(area)], across * (2 if len(nodes) == 3 else 1))
    rim = np.flatnonzero(count == 1)
    ahead = rim[_twins(ends[:, rim].ravel()) % max(len(rim), 1)]
    return max(inside, _left(along[ahead], length[ahead]))


def area_vectors(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Normals (n, 3) of facets (3, 3 or 4, n), as long as their areas [m^2]."""
    p = corners.transpose(1, 2, 0)
    return np.cross(p[-2] - p[0], p[-1] - p[1]) / 2


def _twins(label: NDArray[np.int64]) -> NDArray[np.int64]:
    """Positions (k, 2) of labels that are there twice."""
    order = np.argsort(label, kind="stable")
    _, first, count = np.unique(label[order], return_index=True, return_counts=True)
    return order[first[count == 2][:, None] + [0, 1]]


def _left(vectors: NDArray[np.float64], chord: NDArray[np.float64]) -> float:
    """The most of pairs of chords (k, 2) whose vectors (k, 2, 3) turn as the arc does [m]."""
    unit = vectors / np.linalg.norm(vectors, axis=2, keepdims=True)
    turn = np.arccos(np.minimum(np.abs(np.sum(unit[:, 0] * unit[:, 1], axis=1)), 1.0))
    left = chord.max(axis=1) / 2 * np.tan(turn / 4)
    return float(np.max(left, where=turn < np.radians(CORNER), initial=0.0))
