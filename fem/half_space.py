"""The half-space under a contact patch, as a mesh holds it.

A body loaded over a patch contains the local compliance of a half-space, which the Hertz law of
the contact holds already. Near the patch a mesh coarser than a fraction of its radius gets that
part wrong, by the same amount in the body and in a half-space meshed alike. So the half-space is
solved on the body's own mesh, with Boussinesq's exact displacements prescribed on every face but
the struck one: taken off the body's compliance, it takes its discretisation error along. On a face
of a radius of curvature R that is done within R/2 of the patch, whose plane the face leaves beyond.
Of an orthotropic solid the displacements are those of `fem.anisotropic_half_space`.

Boussinesq's solution: Johnson, Contact Mechanics (1985), eq. 3.18, for a force P into the solid,

    u_r = (1 + nu) P / (2 pi E) (r z / R^3 - (1 - 2 nu) r / (R (R + z)))
    u_z = (1 + nu) P / (2 pi E) (z^2 / R^3 + 2 (1 - nu) / R).
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from fem.anisotropic_half_space import surface_force
from fem.contact_patch import ContactPatch, disc_quadrature
from fem.elasticity import Structure
from fem.factorisation import factorised
from fem.materials import Material, Orthotropic
from fem.mirror import normal_dofs
from fem.model import Model
from fem.spot import Spot

Field = Callable[..., NDArray[np.float64]]  # of points (n, 3), sources (m, 3), their shares (m,)
AT_ONCE = 128, 32  # points of a field, which stay in the cache; patches of a solution
LARGE = 100_000  # dofs of a body, of which the elements near the patch will do
REACH = 30  # radii of the patch: beyond, the mesh errs by 5e-6 of the half-space
NEAR = 0.5  # of the smallest radius of curvature; 0.3 and 0.8 make a difference of 4e-4 of the rest


def boussinesq(
    points: NDArray[np.float64],
    sources: NDArray[np.float64],
    shares: NDArray[np.float64],
    inward: NDArray[np.float64],
    material: Material,
) -> NDArray[np.float64]:
    """Displacements (n, 3) [m] at points (n, 3) by shares (m,) of a unit force at `sources` (m, 3)
    on a plane whose unit normal into the solid is `inward` (3,), pushing that way.
    """
    E, nu = material.young, material.poisson
    frame = np.vstack([inward, np.linalg.svd(inward[None])[2][1:]])
    origin, u = (sources @ frame.T).T[:, None], np.empty((len(points), 3))
    for first in range(0, len(points), AT_ONCE[0]):
        at = slice(first, first + AT_ONCE[0])
        z, x, y = (points[at] @ frame.T).T[:, :, None] - origin
        inverse = 1 / np.sqrt(x * x + y * y + z * z)  # 1 / R
        c = z * inverse
        radial = inverse**2 * (c - (1 - 2 * nu) / (1 + c))  # u_r / r
        u[at, 0] = (inverse * (c * c + 2 * (1 - nu))) @ shares
        u[at, 1], u[at, 2] = (radial * x) @ shares, (radial * y) @ shares
    return (1 + nu) / (2 * np.pi * E) * u @ frame


def half_space_on_mesh(
    model: Model,
    face: str,
    patch: ContactPatch,
    material: Material | Orthotropic,
    *,
    mirrors: Sequence[str] = (),
    within: float = np.inf,
) -> float:
    """Compliance [m/N] of a half-space at a patch, read and loaded by w, on the body's mesh.

    `mirrors` are the faces where the mesh ends at a mirror plane through the patch. Elements
    farther than `within` [m] along an axis are left out, as are those beyond half a radius of
    curvature of the face and, of a large body, beyond 30 radii of the patch: the exact field takes
    their place.
    Raises ValueError for a curved face of a material that is not isotropic.
    """
    return half_spaces_on_mesh(model, face, [patch], material, mirrors=mirrors, within=within)[0]


def half_spaces_on_mesh(
    model: Model,
    face: str,
    patches: Sequence[ContactPatch],
    material: Material | Orthotropic,
    *,
    mirrors: Sequence[str] = (),
    within: float = np.inf,
) -> list[float]:
    """The same [m/N] at several patches of one face, for one factorisation."""
    field = _point_force(face, patches[0].spot, material)
    large = model.structure.basis[face.partition(":")[0]].N > LARGE
    reach = [min(within, NEAR * min(map(abs, p.spot.radii))) for p in patches]
    around = [
        (p, min(r, REACH * p.radius) if large and p.radius else r)
        for p, r in zip(patches, reach, strict=True)
    ]
    free, prescribed = _held_around(model.structure, face, around, mirrors)
    K = model.structure.K[free]
    factor = factorised(K[:, free].tocsc()) if len(free) else None
    found = []
    for first in range(0, len(patches), AT_ONCE[1]):
        part = patches[first : first + AT_ONCE[1]]
        w = np.column_stack([patch.on_mesh for patch in part])
        u = np.column_stack([_far_field(model.structure, prescribed, p, field) for p in part])
        compliance = (w[prescribed] * u).sum(axis=0)
        if factor:
            near = factor.solve(w[free] - K[:, prescribed] @ u)
            compliance += (w[free] * near).sum(axis=0)
        found += compliance.tolist()
    return found


def _held_around(
    structure: Structure,
    face: str,
    near: Sequence[tuple[ContactPatch, float]],
    mirrors: Sequence[str],
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Dofs of the elements near any patch: those that are free, and those on the outside."""
    body, struck = structure.facets(face)
    basis, first = structure.basis[body], structure.first[body]
    cells = np.unique(np.concatenate([_near(basis.mesh, *one) for one in near]))
    ended = [structure.facets(mirror)[1] for mirror in mirrors]
    prescribed = first + _other_faces(basis, [struck, *ended], cells)
    still = [normal_dofs(structure, mirror) for mirror in mirrors]
    dofs = first + np.unique(basis.element_dofs[:, cells])
    return np.setdiff1d(dofs, np.concatenate([prescribed, *still])), prescribed


def _near(mesh, patch: ContactPatch, within: float) -> NDArray[np.int64]:
    """The cells whose middle is near the patch."""
    middle = mesh.p[:, mesh.t].mean(axis=1)
    return np.flatnonzero(np.abs(middle - patch.spot.point[:, None]).max(axis=0) <= within)


def _other_faces(basis, ended: Sequence[NDArray[np.int64]], cells) -> NDArray[np.int64]:
    """Dofs on the outside of the cells, but for what lies on the facets given alone."""
    facets, sides = np.unique(basis.mesh.t2f[:, cells], return_counts=True)
    others = np.setdiff1d(facets[sides == 1], np.concatenate(ended))
    return np.unique(basis.get_dofs(others).all())


def _point_force(face: str, spot: Spot, material: Material | Orthotropic) -> Field:
    """Displacements by a unit force into a face; raises ValueError where they are not known."""
    if isinstance(material, Material):
        return lambda points, *loads: boussinesq(points, *loads, spot.inward, material)
    if np.isfinite(spot.radii).any():
        raise ValueError(
            f"{face!r} is a curved face of an orthotropic material, for which the contact's law is "
            "not known here; strike a plane face."
        )
    force = surface_force(material, spot.inward)
    return lambda points, sources, shares: sum(
        share * force(points, source) for source, share in zip(sources, shares, strict=True)
    )


def _far_field(
    structure: Structure, dofs, patch: ContactPatch, field: Field
) -> NDArray[np.float64]:
    """The exact displacement of each dof, by all points of the patch."""
    nodes, node = np.unique(dofs // 3, return_inverse=True)
    return field(structure.points[nodes], *_sources(structure, patch))[node, dofs % 3]


def _sources(
    structure: Structure, patch: ContactPatch
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points (n, 3) [m] and shares (n,) of the force on a patch."""
    if patch.weights == "nodes":
        share = patch.on_mesh.reshape(-1, 3) @ patch.spot.inward
        return structure.points[share > 0], share[share > 0]
    disc, share = disc_quadrature(patch.weights, 6, 18)
    return patch.spot.point + patch.radius * disc @ patch.spot.axes, share
