"""Shape of elements: the scaled Jacobian of their corners.

At a corner with edges a, b, c it is |det(a, b, c)| / (|a| |b| |c|), negative for a corner turned
inside out: 1 for a box, sqrt(2) times that for a tetrahedron, 1 for the regular one.
P. Knupp, SIAM J. Sci. Comput. 23 (2001) 193.
"""

import numpy as np
from numpy.typing import NDArray
from skfem import Mesh, MeshTet


def smallest_quality(mesh: Mesh) -> float:
    """The worst corner of a mesh of tetrahedra or hexahedra."""
    edges = _tet_edges(mesh) if isinstance(mesh, MeshTet) else _hex_edges(mesh)
    volume = np.linalg.det(edges) / np.prod(np.linalg.norm(edges, axis=-1), axis=-1)
    whole = np.sqrt(2) if isinstance(mesh, MeshTet) else 1.0
    return float(whole * (np.sign(np.sum(volume)) * volume).min())


def _tet_edges(mesh: Mesh) -> NDArray[np.float64]:
    """(corners, elements, 3, 3): from each corner to the others, all the same way round."""
    p = mesh.p.T[mesh.t]
    around = [(0, 1, 2, 3), (1, 0, 3, 2), (2, 3, 0, 1), (3, 2, 1, 0)]
    return np.array([np.stack([p[j] - p[i] for j in others], axis=1) for i, *others in around])


def _hex_edges(mesh: Mesh) -> NDArray[np.float64]:
    """(corners, elements, 3, 3): the derivatives of the mapping at each corner."""
    J = mesh.mapping().DF(np.ascontiguousarray(mesh.elem().doflocs.T))
    return J.transpose(3, 2, 1, 0)
