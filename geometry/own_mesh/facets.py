"""Facets of a mesh found by their corners."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # see `lined`
    from skfem import Mesh

# skfem's order of the corners of a hexahedron, from the quadrilateral (0..3) and its copy (4..7)
EXTRUDED = [0, 4, 3, 1, 7, 5, 2, 6]


def facets_of(mesh: Mesh, corners: NDArray[np.int64]) -> NDArray[np.int64]:
    """Numbers (n,) of the outer facets with these corners (n, 3 or 4), in any order around each.

    Every one of them must be an outer facet of the mesh: for another the number is undefined.
    """
    outer = mesh.boundary_facets()
    both = np.concatenate([np.sort(mesh.facets[:, outer].T), np.sort(corners)])
    _, same = np.unique(both, axis=0, return_inverse=True)
    at = np.empty(same.max() + 1, dtype=np.int64)
    at[same[: len(outer)]] = outer
    return at[same[len(outer) :]]


def triangles(quads: NDArray[np.int64]) -> NDArray[np.int64]:
    """Triangles (2 n, 3) of quadrilaterals (n, 4), each cut along a diagonal."""
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
