"""The contact functional: one vector w that reads the wall and loads it, u_w = w^T u, f = w F.

A contact with friction has three of them, along the normal n into the wall and along t1 and t2 in
the face, with the same weights: t1 is the first global axis laid into the plane, t2 = n x t1.

w is the pressure-weighted mean displacement of a disc on a face, along the face's inward normal:
Hertz' pressure p ~ sqrt(1 - r^2/b^2), or the plain area mean. It is integrated by a quadrature
of the disc itself, whose points are looked up in the elements of the face, so that a mesh coarser
than the disc is loaded as well as a finer one. On a curved face the disc lies in the tangent plane.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, csr_matrix

from beadwave.fem.assembly.model import Model
from beadwave.fem.assembly.trace import OffFace, face_nodes, trace
from beadwave.fem.contact.impact_point import SurfacePoint, planar_spot, require_flat


class ContactPatch(NamedTuple):
    """The contact functional on the free dofs of a model."""

    w: NDArray[np.float64]  # (n,) u_w = w @ u [1]
    boundary: NDArray[np.int64]  # free dofs of the recovery nodes, those that w reads
    on_mesh: NDArray[np.float64]  # (ndof,) the same functional on the displacements of the mesh
    spot: SurfacePoint  # point, inward normal and curvature of the face there
    radius: float  # [m]
    weights: str  # "hertz", "area" or "nodes"
    # (3, ndof) averages of the mesh's displacements along x, y and z; None of a bent structure
    mean: csr_array | None = None
    # (3,) unit vector in the face along which it reads and loads; None: along its inward normal
    tangent: NDArray[np.float64] | None = None

    @property
    def axes(self) -> NDArray[np.float64]:
        """(3, 3): unit vectors n, t1 and t2 in rows."""
        n, t1 = self.spot.inward, self.spot.axes[0]
        return np.array([n, t1, np.cross(n, t1)])

    def across(self, model: Model) -> "tuple[ContactPatch, ContactPatch]":
        """Averages of the displacements along t1 and t2, as two patches; of a patch with its
        `mean`, which bent structures have not."""
        patches = []
        for tangent in self.axes[1:]:
            on_mesh = tangent @ self.mean
            w = model.T.T @ on_mesh
            patches.append(self._replace(w=w, on_mesh=on_mesh, tangent=tangent))
        return tuple(patches)


def disc_quadrature(
    weights: str, n_radial: int, n_around: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points (n, 2) of the unit disc and weights (n,) of sum 1, for the pressure `weights`.

    In s = r^2 both pressures are smooth after s = 1 - t^2 (Hertz: p dA ~ t^2 dt; area: t dt), a
    Gauss rule in t and equal angles integrate polynomials of degree 2 n_radial - 4 exactly.
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
    at: tuple[float, float] | SurfacePoint,
    radius: float,
    *,
    weights: str = "hertz",
    n_radial: int = 48,
    n_around: int = 144,
    mirrors: str = "",
) -> ContactPatch:
    """The patch of `radius` [m] on a face, at a point [m] from the middle of a plane along its two
    axes (`fem.planar_spot`), or at a spot of a round face (`fem.round_spot`).

    Displacement counts along the chain's direction of travel, into the wall. `mirrors` names the
    axes, "y", "z" or "yz", along which a mirror plane at the point ends the mesh: the disc folds
    onto the upper side of it. Raises OffFace when the disc leaves the face, ValueError when it is
    not plane, or curved too much for so large a patch. The default quadrature leaves some 4e-6 of
    the compliance where the disc crosses edges of elements, an error that falls as 1 / n^2.
    """
    spot = at if isinstance(at, SurfacePoint) else planar_spot(model.structure, face, at)
    require_flat(spot.radii, radius)

    # points of the disc; half of them, or a quarter, on each side of a mirror are one
    disc, share = disc_quadrature(weights, n_radial, n_around)
    for axis in mirrors:
        i = int(np.abs(spot.axes[:, "xyz".index(axis)]).argmax())
        disc[:, i] = np.abs(disc[:, i])
    try:
        P = trace(model.structure, face, spot.point + radius * disc @ spot.axes, gap=spot.gap)
    except OffFace:
        place = f"{list(at)} m from the middle"
        if isinstance(at, SurfacePoint):
            place = f"{np.round(at.point, 6).tolist()} m"
        raise OffFace(
            f"the contact patch at {place} with radius {radius} m leaves the face "
            f"{face!r}; move it or make it smaller."
        ) from None
    mean = np.array([share @ P[axis::3] for axis in range(3)])  # (3, ndof) along x, y and z
    return _patch(model, mean, spot, radius, weights)


def node_patch(model: Model, face: str, points: Sequence[tuple[float, float]]) -> ContactPatch:
    """The plain mean of the nodes nearest to points [m] from the middle of a plane face.

    Its compliance grows like 1/h: nodes carry no area. The radius is that of the farthest node
    from their middle.
    """
    nodes = face_nodes(model.structure, face)
    positions = model.structure.points[nodes[:, 0] // 3]
    spots = [planar_spot(model.structure, face, at) for at in points]
    nearest = [np.linalg.norm(positions - spot.point, axis=1).argmin() for spot in spots]
    middle = positions[nearest].mean(axis=0)
    radius = float(np.linalg.norm(positions[nearest] - middle, axis=1).max())
    mean = np.zeros((3, model.structure.n_dofs))
    for node in nodes[nearest]:
        mean[[0, 1, 2], node] += 1 / len(nearest)
    return _patch(model, mean, spots[0]._replace(point=middle), radius, "nodes")


def _patch(model: Model, mean, spot: SurfacePoint, radius: float, weights: str) -> ContactPatch:
    """The functional with its recovery nodes: all three displacements of every node it reads."""
    on_mesh = spot.inward @ mean
    nodes = np.unique(np.flatnonzero(on_mesh) // 3)
    dofs = (3 * nodes[:, None] + np.arange(3)).ravel()
    boundary = np.unique(csr_matrix(model.T[dofs]).indices)
    w = model.T.T @ on_mesh
    return ContactPatch(w, boundary, on_mesh, spot, radius, weights, csr_array(mean))
