"""A mesh with every element in eight, once or several times, its named boundaries kept.

The new vertices are the middles of edges, of quadrilaterals and of hexahedra, so that the shape
functions of the first mesh are among those of the second where elements are parallelepipeds. New
nodes of curved elements lie on the curve.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from beadwave.geometry.own_mesh.curved import is_curved, split, straight
from beadwave.geometry.own_mesh.facets import facets_of

if TYPE_CHECKING:  # see `lined`
    from skfem import Mesh


def refined(mesh: Mesh, times: int = 1) -> Mesh:
    """Tetrahedra or hexahedra half as large, each of the old facets in four, `times` over; names of
    boundaries and subdomains stay."""
    if times == 0:
        return mesh
    of_corners = straight(mesh)
    fine = replace(of_corners, _boundaries=None).refined()

    # the refined mesh numbers the middles of edges behind the vertices, by the edges' numbers
    n = mesh.nvertices
    ends = np.sort(mesh.edges, axis=0).astype(np.int64)
    keys = ends[0] * n + ends[1]
    order = np.argsort(keys)

    # four facets for each old one: a corner with the middles of its two edges, and of a triangle
    # the middle one, of a quadrilateral its own middle, numbered behind those of the edges
    boundaries = {}
    for name, facets in (mesh.boundaries or {}).items():
        corners = mesh.facets[:, facets]
        following = np.roll(corners, -1, axis=0)
        wanted = np.minimum(corners, following).astype(np.int64) * n
        wanted += np.maximum(corners, following)
        middles = n + order[np.searchsorted(keys, wanted, sorter=order)]
        previous = np.roll(middles, 1, axis=0)
        if len(corners) == 3:
            outer = np.stack([corners, middles, previous], axis=-1)
            quarters = np.concatenate([outer.reshape(-1, 3), middles.T])
        else:
            heart = np.broadcast_to(n + mesh.nedges + facets, corners.shape)
            quarters = np.stack([corners, middles, heart, previous], axis=-1).reshape(-1, 4)
        boundaries[name] = facets_of(fine, quarters)
    fine = fine.with_boundaries(boundaries)
    return refined(split(mesh, fine) if is_curved(mesh) else fine, times - 1)
