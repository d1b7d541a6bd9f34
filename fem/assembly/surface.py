"""Displacements on the outside of a structure, at its points nearest to given ones.

Facets are bilinear, x(s, t) = sum_i N_i(s, t) x_i over the unit square; of a triangle the last
corner stands twice.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.sparse import csr_matrix, vstack

from beadwave.fem.assembly.elasticity import Structure
from beadwave.fem.assembly.trace import interpolation, local_coordinates


class OnSurface(NamedTuple):
    """Points on the outside of a structure, and their distances from the given points."""

    P: csr_matrix  # (3 n, ndof) displacements x, y, z point by point
    distance: NDArray[np.float64]  # (n,) [m]


def on_surface(
    structure: Structure, points: NDArray[np.float64], *, n_samples: int = 5
) -> OnSurface:
    """The outside of all bodies at its points nearest to `points` (n, 3) [m].

    The facet is that of the nearest of n_samples x n_samples points on every facet of the outside:
    near a sharp edge that may be the neighbour of the nearest one, and the point found is then off
    by less than the samples are apart.
    """
    # facets (m,) of the outside of each body and their corners (3, 4, m)
    outside = {}
    for body, basis in structure.basis.items():
        facets = basis.mesh.boundary_facets()
        corners = basis.mesh.p[:, basis.mesh.facets[:, facets]]
        outside[body] = facets, np.concatenate([corners, corners[:, -1:]], axis=1)[:, :4]
    line = np.linspace(0, 1, n_samples)
    weights = np.array([_bilinear(s, t) for s in line for t in line])

    rows, distances = [], []
    for point in points:
        # of each body the nearest sample, and from there the nearest point of its facet
        feet = {}
        for body, (facets, corners) in outside.items():
            samples = np.einsum("ki,dim->kmd", weights, corners)
            away = np.linalg.norm(samples - point, axis=2)
            sample, i = np.unravel_index(away.argmin(), away.shape)
            fit = least_squares(
                lambda st, x, point: x @ _bilinear(*st) - point,
                np.array([line[sample // n_samples], line[sample % n_samples]]),
                args=(corners[:, :, i], point), bounds=(0, 1), xtol=1e-12,
            )  # fmt: skip
            feet[body] = float(np.linalg.norm(fit.fun)), facets[i], point + fit.fun
        body = min(feet, key=lambda body: feet[body][0])
        distance, facet, foot = feet[body]

        basis = structure.basis[body]
        cell = basis.mesh.f2t[[0], facet]
        X = local_coordinates(basis.mapping, foot[:, None, None], cell)
        P = interpolation(basis, X[:, :, 0], cell)
        shape = (3, structure.n_dofs)
        rows.append(csr_matrix((P.data, P.indices + structure.first[body], P.indptr), shape))
        distances.append(distance)
    return OnSurface(vstack(rows, format="csr"), np.array(distances))


def _bilinear(s: float, t: float) -> NDArray[np.float64]:
    """Shape functions (4,) of the corners of a facet."""
    return np.array([(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t])
