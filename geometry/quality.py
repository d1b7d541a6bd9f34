"""Volume of a mesh, and shape of its elements: the scaled Jacobian of their corners.

At a corner with edges a, b, c it is det(a, b, c) / (|a| |b| |c|): 1 for a box, negative for a
corner turned inside out. Of a tetrahedron it is sqrt(2) times the size of that, 1 for the regular
one: a straight tetrahedron is never inside out, only numbered one way or the other.
P. Knupp, SIAM J. Sci. Comput. 23 (2001) 193.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:  # see `lined`
    from skfem import Mesh


def volume_of(mesh: Mesh) -> float:
    """Volume [m^3] of straight or curved elements."""
    from skfem.quadrature import get_quadrature

    # det DF of a curved tetrahedron of 10 nodes has the degree 3, of a hexahedron of 27 more
    X, W = get_quadrature(mesh.elem(), 6)
    return float(np.sum(np.abs(mesh.mapping().detDF(X)) @ W))


def smallest_quality(mesh: Mesh) -> float:
    """Scaled Jacobian of the worst corner of a mesh: 0 to 1 of tetrahedra, -1 to 1 of hexahedra."""
    from skfem import MeshTet

    # edges (corners, elements, 3, 3) from each corner to its neighbours, all the same way round
    if isinstance(mesh, MeshTet):
        p = mesh.p.T[mesh.t]
        around = [(0, 1, 2, 3), (1, 0, 3, 2), (2, 3, 0, 1), (3, 2, 1, 0)]
        edges = np.array([np.stack([p[j] - p[i] for j in ends], axis=1) for i, *ends in around])
    else:
        # the derivatives of the mapping at each corner
        J = mesh.mapping().DF(np.ascontiguousarray(mesh.elem().doflocs.T))
        edges = J.transpose(3, 2, 1, 0)
    volume = np.linalg.det(edges) / np.prod(np.linalg.norm(edges, axis=-1), axis=-1)

    # scikit-fem's refinement numbers some tetrahedra the other way round, which reverses their sign
    # alone; of hexahedra a whole mesh may be, and the sign of the sum counts as positive
    if isinstance(mesh, MeshTet):
        return float(np.sqrt(2) * np.abs(volume).min())
    return float((np.sign(np.sum(volume)) * volume).min())
