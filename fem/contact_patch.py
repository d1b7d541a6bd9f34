"""The contact functional: one vector w that reads the wall and loads it, u_w = w^T u, f = w F.

w is the pressure-weighted mean displacement of a disc on a face, along the face's inward normal:
Hertz' pressure p ~ sqrt(1 - r^2/b^2), or the plain area mean. It is integrated by a quadrature
of the disc itself, whose points are looked up in the elements of the face, so that a mesh coarser
than the disc is loaded as well as a finer one.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from skfem import Basis

from fem.model import Model
from fem.trace import trace


class ContactPatch(NamedTuple):
    """What stands at the contact, on the free dofs of a model."""

    w: NDArray[np.float64]  # (n,) u_w = w @ u [1]
    boundary: NDArray[np.int64]  # free dofs of the recovery nodes, those that w reads
    on_mesh: NDArray[np.float64]  # (ndof,) the same functional on the displacements of the mesh
    inward: float  # direction of the chain's travel along x, +1 or -1
    point: NDArray[np.float64]  # (3,) [m]
    radius: float  # [m]
    weights: str  # "hertz", "area" or "nodes"


def disc_quadrature(
    weights: str, n_radial: int, n_around: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points (n, 2) of the unit disc and weights (n,) of sum 1, for the pressure `weights`.

    In s = r^2 both pressures are smooth after s = 1 - t^2 (Hertz: p dA ~ t^2 dt; area: t dt), a
    Gauss rule in t and equal angles integrate polynomials of degree 2 n_radial - 2 exactly.
    """
    t, dt = np.polynomial.legendre.leggauss(n_radial)
    t, dt = (t + 1) / 2, dt / 2
    share = dt * {"hertz": 3 * t**2, "area": 2 * t}[weights]
    angle = 2 * np.pi * (np.arange(n_around) + 0.5) / n_around
    r = np.sqrt(1 - t**2)
    points = np.column_stack(
        [np.outer(r, np.cos(angle)).ravel(), np.outer(r, np.sin(angle)).ravel()]
    )
    return points, np.repeat(share / n_around, n_around)


def contact_patch(
    model: Model,
    face: str,
    point: tuple[float, float],
    radius: float,
    *,
    weights: str = "hertz",
    n_radial: int = 16,
    n_around: int = 48,
    mirrors: str = "",
) -> ContactPatch:
    """The patch of `radius` [m] at `point` (y, z) [m] from the middle of a face normal to x.

    Displacement counts along the chain's direction of travel, into the wall. `mirrors` names the
    axes, "y", "z" or "yz", along which a mirror plane at the point ends the mesh: the disc folds
    onto the upper side of it. Raises ValueError when the disc leaves the face.
    """
    basis = model.structure.basis
    centre, inward = _middle(basis, face)
    centre = centre + [0.0, *point]
    disc, share = disc_quadrature(weights, n_radial, n_around)
    for axis in mirrors:
        disc[:, "yz".index(axis)] = np.abs(disc[:, "yz".index(axis)])
    spots = centre + radius * np.column_stack([np.zeros(len(disc)), disc])
    try:
        P = trace(basis, face, spots)
    except ValueError as outside:
        raise ValueError(
            f"the contact patch at [y, z] = {list(point)} m with radius {radius} m leaves the face "
            f"{face!r}; move it or make it smaller ({outside})"
        ) from outside
    on_mesh = inward * (share @ P[0::3])
    boundary = _recovery_dofs(model, on_mesh)
    return ContactPatch(model.T.T @ on_mesh, boundary, on_mesh, inward, centre, radius, weights)


def node_patch(model: Model, face: str, points: Sequence[tuple[float, float]]) -> ContactPatch:
    """The plain mean of the nodes nearest to points (y, z) [m] from the middle of a face.

    Its compliance grows like 1/h: nodes carry no area. The radius is that of the farthest node
    from their middle.
    """
    basis = model.structure.basis
    centre, inward = _middle(basis, face)
    dofs = [_nearest(basis, face, centre + [0.0, *point]) for point in points]
    on_mesh = np.zeros(basis.N)
    np.add.at(on_mesh, dofs, inward / len(dofs))
    spots = basis.doflocs[:, dofs].T
    middle = spots.mean(axis=0)
    radius = float(np.linalg.norm(spots - middle, axis=1).max())
    boundary = _recovery_dofs(model, on_mesh)
    return ContactPatch(model.T.T @ on_mesh, boundary, on_mesh, inward, middle, radius, "nodes")


def _middle(basis: Basis, face: str) -> tuple[NDArray[np.float64], float]:
    mesh = basis.mesh
    corners = mesh.p[:, mesh.facets[:, mesh.boundaries[face]]].reshape(3, -1)
    middle = (corners.min(axis=1) + corners.max(axis=1)) / 2
    cell = mesh.f2t[0, mesh.boundaries[face][0]]
    return middle, float(np.sign(mesh.p[0, mesh.t[:, cell]].mean() - middle[0]))


def _recovery_dofs(model: Model, on_mesh: NDArray[np.float64]) -> NDArray[np.int64]:
    """All three displacements of every node that w reads, as free dofs of the model."""
    basis = model.structure.basis
    x_dofs = np.flatnonzero(on_mesh)
    nodes = _all_directions(basis)[np.isin(_all_directions(basis)[:, 0], x_dofs)]
    return np.unique(csr_matrix(model.T[nodes.ravel()]).indices)


def _all_directions(basis: Basis) -> NDArray[np.int64]:
    """The three dofs of every node, (n_nodes, 3)."""
    return basis.element_dofs.reshape(-1, 3, basis.nelems).transpose(0, 2, 1).reshape(-1, 3)


def _nearest(basis: Basis, face: str, spot: NDArray[np.float64]) -> int:
    """The x displacement of the node of a face that is nearest to a spot (3,) [m]."""
    dofs = np.unique(basis.get_dofs(face).all(["u^1"]))
    return int(dofs[np.argmin(np.linalg.norm(basis.doflocs[:, dofs].T - spot, axis=1))])
