"""Displacements on the outside of a structure, at its points nearest to given ones.

Facets are bilinear, x(s, t) = sum_i N_i(s, t) x_i over the unit square; of a triangle the last
corner stands twice.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.sparse import csr_matrix, vstack

from fem.elasticity import Structure
from fem.trace import interpolation, local_coordinates

SAMPLES = 5  # along each side of a facet, of which the nearest tells the facet


class OnSurface(NamedTuple):
    """Points of the outside, and how far away those are that they are nearest to."""

    P: csr_matrix  # (3 n, ndof) displacements x, y, z point by point
    distance: NDArray[np.float64]  # (n,) [m]


def on_surface(structure: Structure, points: NDArray[np.float64]) -> OnSurface:
    """The outside of all bodies at its points nearest to `points` (n, 3) [m]."""
    outside = {body: _outside(basis.mesh) for body, basis in structure.basis.items()}
    rows, distance = [], []
    for point in points:
        found = {body: _nearest(corners, point) for body, (_, corners) in outside.items()}
        body = min(found, key=lambda body: found[body].distance)
        facet = outside[body][0][found[body].facet]
        rows.append(_displacements(structure, body, facet, found[body].at))
        distance.append(found[body].distance)
    return OnSurface(vstack(rows, format="csr"), np.array(distance))


class _Foot(NamedTuple):
    facet: int
    at: NDArray[np.float64]  # (3,) [m]
    distance: float


def _outside(mesh) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Facets (m,) and their corners (3, 4, m)."""
    facets = mesh.boundary_facets()
    corners = mesh.p[:, mesh.facets[:, facets]]
    return facets, np.concatenate([corners, corners[:, -1:]], axis=1)[:, :4]


def _nearest(corners: NDArray[np.float64], point: NDArray[np.float64]) -> _Foot:
    line = np.linspace(0, 1, SAMPLES)
    weights = np.array([_shape(s, t) for s in line for t in line])
    samples = np.einsum("ki,dim->kmd", weights, corners)
    away = np.linalg.norm(samples - point, axis=2)
    sample, facet = np.unravel_index(away.argmin(), away.shape)
    start = np.array([line[sample // SAMPLES], line[sample % SAMPLES]])
    found = least_squares(
        lambda st: corners[:, :, facet] @ _shape(*st) - point, start, bounds=(0, 1), xtol=1e-12
    )
    at = point + found.fun
    return _Foot(int(facet), at, float(np.linalg.norm(found.fun)))


def _shape(s: float, t: float) -> NDArray[np.float64]:
    return np.array([(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t])


def _displacements(structure: Structure, body: str, facet: int, at) -> csr_matrix:
    """(3, ndof)"""
    basis = structure.basis[body]
    cell = basis.mesh.f2t[[0], facet]
    X = local_coordinates(basis.mapping, at[:, None, None], cell)
    P = interpolation(basis, X[:, :, 0], cell)
    shape = (3, structure.n_dofs)
    return csr_matrix((P.data, P.indices + structure.first[body], P.indptr), shape)
