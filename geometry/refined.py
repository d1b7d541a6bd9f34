"""A mesh with every element in eight, once or several times, its named boundaries kept.

The new vertices are the middles of edges, of quadrilaterals and of hexahedra, so that the shape
functions of the first mesh are among those of the second where elements are parallelepipeds.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from skfem import Mesh

from geometry.facets import facets_of


def refined(mesh: Mesh, times: int = 1) -> Mesh:
    """Tetrahedra or hexahedra half as large, each of the old facets in four, `times` over."""
    if times == 0:
        return mesh
    fine, named = replace(mesh, _boundaries=None).refined(), mesh.boundaries or {}
    quarters = {name: facets_of(fine, _parts(mesh, at)) for name, at in named.items()}
    return refined(fine.with_boundaries(quarters), times - 1)


def _parts(mesh: Mesh, facets: NDArray[np.int64]) -> NDArray[np.int64]:
    """Corners (4 n, 3 or 4) of the facets' quarters, by the numbers of the refined mesh."""
    corners = mesh.facets[:, facets]
    middles = _middles(mesh, corners, np.roll(corners, -1, axis=0))
    before = np.roll(middles, 1, axis=0)
    if len(corners) == 3:
        outer = np.stack([corners, middles, before], axis=-1)
        return np.concatenate([outer.reshape(-1, 3), middles.T])
    heart = np.broadcast_to(mesh.nvertices + mesh.nedges + facets, corners.shape)
    return np.stack([corners, middles, heart, before], axis=-1).reshape(-1, 4)


def _middles(mesh: Mesh, one: NDArray[np.int64], other: NDArray[np.int64]) -> NDArray[np.int64]:
    """Numbers of the vertices half-way between two of an edge."""
    n = mesh.nvertices
    keys = np.sort(mesh.edges, axis=0).astype(np.int64)
    keys = keys[0] * n + keys[1]
    order = np.argsort(keys)
    wanted = np.minimum(one, other).astype(np.int64) * n + np.maximum(one, other)
    return n + order[np.searchsorted(keys, wanted, sorter=order)]
