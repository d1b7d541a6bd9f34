"""Points and area vectors on facets, in the coordinates of the elements behind them.

scikit-fem finds these coordinates by Newton's method, which does not end in rounding where a
curved cell has two edges of one smooth curve; a facet's corners among those of its element say
them at once.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from skfem import Mesh, MeshHex
from skfem.quadrature import get_quadrature


class FacetRule(NamedTuple):
    """A quadrature rule on m facets."""

    cells: NDArray[np.int64]  # (m,) the elements
    X: NDArray[np.float64]  # (3, m, points) in their coordinates
    area: NDArray[np.float64]  # (3, m, points) [m^2] times the rule's weights, out of side 0


def facet_rule(mesh: Mesh, facets: NDArray[np.int64], order: int, side: int = 0) -> FacetRule:
    """Facets as the elements of side 0 or 1 see them, with a rule that is exact up to the order."""
    (a, b), weights = get_quadrature(mesh.brefdom, order)

    # shape functions of a facet's corners and their slopes along a and b, at the rule's points
    one = np.ones_like(a)
    if isinstance(mesh, MeshHex):  # corners one after another around a facet
        N = np.stack([(1 - a) * (1 - b), a * (1 - b), a * b, (1 - a) * b])
        along_a, along_b = np.stack([b - 1, 1 - b, b, -b]), np.stack([a - 1, -a, a, 1 - a])
    else:
        N = np.stack([1 - a - b, a, b])
        along_a, along_b = np.stack([-one, one, 0 * one]), np.stack([-one, 0 * one, one])

    # the same points in the element's own coordinates, by which of its corners the facet has:
    # both sides of a facet then have their points in one order
    corners, cells = mesh.facets[:, facets], mesh.f2t[side, facets]
    at = (mesh.t[:, cells][:, None] == corners).argmax(axis=0)  # (corner, m) in the element
    X = np.einsum("vp,dvm->dmp", N, mesh.elem().refdom.p[:, at])

    # area vectors, all out of side 0, however the facet is numbered; of a curved one by the
    # mapping of its element
    p, slopes = mesh.p[:, corners], (along_a, along_b)
    if mesh.doflocs.shape[1] == mesh.nvertices:
        tangents = [np.einsum("vp,dvm->dmp", slope, p) for slope in slopes]
    else:
        J, local = mesh.mapping().DF(X, tind=cells), mesh.elem().refdom.p[:, at]
        tangents = [
            np.einsum("dcmp,cmp->dmp", J, np.einsum("vp,dvm->dmp", slope, local))
            for slope in slopes
        ]
    area = np.cross(*tangents, axis=0)
    first = mesh.p[:, mesh.t[:, mesh.f2t[0, facets]]].mean(axis=1)
    outward = np.einsum("dm,dmp->m", p.mean(axis=1) - first, area)
    return FacetRule(cells, X, np.sign(outward)[:, None] * area * weights)
