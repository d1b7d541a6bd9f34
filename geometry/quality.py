"""Shape of elements: the scaled Jacobian of their corners.

At a corner with edges a, b, c it is |det(a, b, c)| / (|a| |b| |c|), negative for a corner turned
inside out: 1 for a box, sqrt(2) times that for a tetrahedron, 1 for the regular one.
P. Knupp, SIAM J. Sci. Comput. 23 (2001) 193.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:  # see `lined`
    from skfem import Mesh


def smallest_quality(mesh: Mesh) -> float:
    """Scaled Jacobian of the worst corner of a mesh of tetrahedra or hexahedra, -1 to 1."""
    from skfem import MeshTet

    # edges (corners, elements, 3, 3) from each corner to its neighbours, all the same way round
    if isinstance(mesh, MeshTet):
        p = mesh.p.T[mesh.t]
        around = [(0, 1, 2, 3), (1, 0, 3, 2), (2, 3, 0, 1), (3, 2, 1, 0)]
        edges = np.array([np.stack([p[j] - p[i] for j in ends], axis=1) for i, *ends in around])
        regular = np.sqrt(2)
    else:
        # the derivatives of the mapping at each corner
        J = mesh.mapping().DF(np.ascontiguousarray(mesh.elem().doflocs.T))
        edges = J.transpose(3, 2, 1, 0)
        regular = 1.0
    volume = np.linalg.det(edges) / np.prod(np.linalg.norm(edges, axis=-1), axis=-1)
    return float(regular * (np.sign(np.sum(volume)) * volume).min())
