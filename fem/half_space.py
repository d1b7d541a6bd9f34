"""The half-space under a contact patch, as a mesh holds it.

A body loaded over a patch contains the local compliance of a half-space, which the Hertz law of
the contact holds already. Near the patch a mesh coarser than a fraction of its radius gets that
part wrong, by the same amount in the body and in a half-space meshed alike. So the half-space is
solved on the body's own mesh, with Boussinesq's exact displacements prescribed on every face but
the struck one: taken off the body's compliance, it takes its discretisation error along.

Boussinesq's solution: Johnson, Contact Mechanics (1985), eq. 3.18, for a force P into the solid,

    u_r = (1 + nu) P / (2 pi E) (r z / R^3 - (1 - 2 nu) r / (R (R + z)))
    u_z = (1 + nu) P / (2 pi E) (z^2 / R^3 + 2 (1 - nu) / R).
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fem.contact_patch import ContactPatch, disc_quadrature
from fem.elasticity import Material
from fem.factorisation import factorised
from fem.mirror import normal_dofs
from fem.model import Model


def boussinesq(
    points: NDArray[np.float64], source: NDArray[np.float64], inward: float, material: Material
) -> NDArray[np.float64]:
    """Displacements (n, 3) [m] at points (n, 3) by a unit force at `source` (3,) on a face
    normal to x, pushing towards `inward` (+1 or -1).
    """
    E, nu = material.young, material.poisson
    along = points - source
    z = inward * along[:, 0]
    r = np.hypot(along[:, 1], along[:, 2])
    R = np.hypot(r, z)
    radial = z / R**3 - (1 - 2 * nu) / (R * (R + z))  # u_r / r
    u = np.column_stack(
        [inward * (z**2 / R**3 + 2 * (1 - nu) / R), along[:, 1] * radial, along[:, 2] * radial]
    )
    return (1 + nu) / (2 * np.pi * E) * u


def half_space_on_mesh(
    model: Model,
    face: str,
    patch: ContactPatch,
    material: Material,
    *,
    mirrors: Sequence[str] = (),
    within: float = np.inf,
) -> float:
    """Compliance [m/N] of a half-space at a patch, read and loaded by w, on the body's mesh.

    `mirrors` are the faces where the mesh ends at a mirror plane through the patch. Elements
    farther than `within` [m] along an axis are left out: the exact field takes their place.
    """
    basis, K, _ = model.structure
    cells = _near(basis.mesh, basis.mesh.subdomains[face.split(":")[0]], patch, within)
    dofs = np.unique(basis.element_dofs[:, cells])
    prescribed = _other_faces(basis, (face, *mirrors), cells)
    still = [normal_dofs(basis, mirror) for mirror in mirrors]
    free = np.setdiff1d(dofs, np.concatenate([prescribed, *still]))
    u = np.zeros(basis.N)
    u[prescribed] = _far_field(basis, prescribed, patch, material)
    load = patch.on_mesh - K @ u
    u[free] = factorised(K[free][:, free].tocsc()).solve(load[free])
    return float(patch.on_mesh @ u)


def _near(mesh, cells, patch: ContactPatch, within: float) -> NDArray[np.int64]:
    """Those of the cells whose middle is near the patch."""
    middle = mesh.p[:, mesh.t[:, cells]].mean(axis=1)
    return cells[np.abs(middle - patch.point[:, None]).max(axis=0) <= within]


def _other_faces(basis, faces: Sequence[str], cells) -> NDArray[np.int64]:
    mesh = basis.mesh
    facets, sides = np.unique(mesh.t2f[:, cells], return_counts=True)
    outside = facets[sides == 1]
    others = np.setdiff1d(outside, np.concatenate([mesh.boundaries[face] for face in faces]))
    return np.unique(basis.get_dofs(others).all())


def _far_field(basis, dofs, patch: ContactPatch, material: Material) -> NDArray[np.float64]:
    """The exact displacement of each dof, by all points of the patch."""
    nodes, node = np.unique(dofs // 3, return_inverse=True)
    points = basis.doflocs[:, 3 * nodes].T
    total = np.zeros((len(nodes), 3))
    for source, part in zip(*_sources(basis, patch), strict=True):
        total += part * boussinesq(points, source, patch.inward, material)
    return total[node, dofs % 3]


def _sources(basis, patch: ContactPatch) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points (n, 3) [m] and shares (n,) of the force on a patch."""
    if patch.weights == "nodes":
        loaded = np.flatnonzero(patch.on_mesh)
        return basis.doflocs[:, loaded].T, np.abs(patch.on_mesh[loaded])
    disc, share = disc_quadrature(patch.weights, 6, 18)
    return patch.point + patch.radius * np.column_stack([np.zeros(len(disc)), disc]), share
