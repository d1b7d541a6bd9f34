"""The compliance of the half-space under a contact patch, as a mesh contains it.

A body loaded over a patch contains the local compliance of a half-space, which the Hertz law of
the contact holds already. Near the patch a mesh coarser than a fraction of its radius gets that
part wrong, by the same amount in the body and in a half-space meshed alike. So the half-space is
solved on the body's own mesh, with Boussinesq's exact displacements prescribed on every face but
the struck one: subtracted from the body's compliance, it takes its discretisation error along. On a
face of a radius of curvature R only elements within R/2 of the patch count, beyond which the face
leaves the plane of the patch.
Of an orthotropic solid the displacements are those of `fem.contact.anisotropic_half_space`.

Boussinesq's solution: Johnson, Contact Mechanics (1985), eq. 3.18, for a force P into the solid,

    u_r = (1 + nu) P / (2 pi E) (r z / R^3 - (1 - 2 nu) r / (R (R + z)))
    u_z = (1 + nu) P / (2 pi E) (z^2 / R^3 + 2 (1 - nu) / R).

Cerruti's, eq. 3.75, for a force P along x in the plane, with the shear modulus G:

    u_x = P / (4 pi G) (1 / R + x^2 / R^3 + (1 - 2 nu) (1 / (R + z) - x^2 / (R (R + z)^2)))
    u_y = P / (4 pi G) (x y / R^3 - (1 - 2 nu) x y / (R (R + z)^2))
    u_z = P / (4 pi G) (x z / R^3 + (1 - 2 nu) x / (R (R + z))).
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.fem.assembly.materials import Material, Orthotropic
from beadwave.fem.assembly.mirror import normal_dofs
from beadwave.fem.assembly.model import Model
from beadwave.fem.contact.anisotropic_half_space import surface_force
from beadwave.fem.contact.contact_patch import ContactPatch, disc_quadrature
from beadwave.fem.modes.solver.factorisation import factorised


class HalfSpaceMesh(NamedTuple):
    """Elements of the body that the half-space is solved on, and the number of fields at a time."""

    large: int = 100_000  # dofs of a body beyond which only elements near the patch are used
    # distance from the patch, in its radii, up to which elements of a large body are used: the mesh
    # error of all others is 5e-6 of the compliance
    reach: float = 30.0
    # the same over the smallest radius of curvature of the face: 0.3 and 0.8 change the compliance
    # that is left by 4e-4
    curved: float = 0.5
    patches_at_once: int = 32  # right-hand sides of one solution


def boussinesq(
    points: NDArray[np.float64],
    sources: NDArray[np.float64],
    shares: NDArray[np.float64],
    inward: NDArray[np.float64],
    material: Material,
    *,
    at_once: int = 128,
) -> NDArray[np.float64]:
    """Displacements (n, 3) [m] at points (n, 3) by shares (m,) of a unit force at `sources` (m, 3)
    on a plane whose unit normal into the solid is `inward` (3,), pushing that way; `at_once` points
    at a time, whose distances stay in the cache.
    """
    E, nu = material.young, material.poisson
    frame = np.vstack([inward, np.linalg.svd(inward[None])[2][1:]])
    origin, u = (sources @ frame.T).T[:, None], np.empty((len(points), 3))
    for first in range(0, len(points), at_once):
        at = slice(first, first + at_once)
        z, x, y = (points[at] @ frame.T).T[:, :, None] - origin
        inverse = 1 / np.sqrt(x * x + y * y + z * z)  # 1 / R
        c = z * inverse
        radial = inverse**2 * (c - (1 - 2 * nu) / (1 + c))  # u_r / r
        u[at, 0] = (inverse * (c * c + 2 * (1 - nu))) @ shares
        u[at, 1], u[at, 2] = (radial * x) @ shares, (radial * y) @ shares
    return (1 + nu) / (2 * np.pi * E) * u @ frame


def cerruti(
    points: NDArray[np.float64],
    sources: NDArray[np.float64],
    shares: NDArray[np.float64],
    inward: NDArray[np.float64],
    along: NDArray[np.float64],
    material: Material,
    *,
    at_once: int = 128,
) -> NDArray[np.float64]:
    """Displacements (n, 3) [m] as those of `boussinesq`, by a unit force along the unit vector
    `along` (3,) in the plane."""
    G, nu = material.young / (2 * (1 + material.poisson)), material.poisson
    frame = np.vstack([inward, along, np.cross(inward, along)])
    origin, u = (sources @ frame.T).T[:, None], np.empty((len(points), 3))
    for first in range(0, len(points), at_once):
        at = slice(first, first + at_once)
        z, x, y = (points[at] @ frame.T).T[:, :, None] - origin
        R = np.sqrt(x * x + y * y + z * z)
        # x / R^3 and what the free surface adds to it, in the plane and along the normal
        whole = x / R**3
        surface = (1 - 2 * nu) / (R + z)
        across = whole - surface * x / (R * (R + z))
        u[at, 0] = (whole * z + surface * x / R) @ shares
        u[at, 1] = (1 / R + surface + across * x) @ shares
        u[at, 2] = (across * y) @ shares
    return u @ frame / (4 * np.pi * G)


def half_space_matrix(
    model: Model,
    face: str,
    patch: ContactPatch,
    material: Material,
    *,
    options: HalfSpaceMesh = HalfSpaceMesh(),
) -> NDArray[np.float64]:
    """Compliance (3, 3) [m/N] of a half-space at a patch along n, t1 and t2, on the body's mesh.

    Of the exact half-space it is diagonal: 0.6 (1 - nu^2) / (E b) along the normal and
    0.15 (2 - nu) / (G b) in the plane under Hertz' weights over a radius b. On a mesh its parts
    off the diagonal are the mesh's, which the body's compliance contains as well. Raises
    ValueError for a material that is not isotropic.
    """
    if not isinstance(material, Material):
        raise ValueError(
            f"{face!r} is a face of an orthotropic material, whose compliance along the face is "
            "not known here; take an isotropic body."
        )
    patches = [patch, *patch.across(model)]
    (field,) = half_space_fields(model, face, patches, material, options=options)
    w = np.column_stack([patch.on_mesh[field.dofs] for patch in patches])
    compliance = w.T @ field.u
    return (compliance + compliance.T) / 2


def half_space_on_mesh(
    model: Model,
    face: str,
    patch: ContactPatch,
    material: Material | Orthotropic,
    *,
    mirrors: Sequence[str] = (),
    within: float = np.inf,
    options: HalfSpaceMesh = HalfSpaceMesh(),
) -> float:
    """Compliance [m/N] of a half-space at a patch, read and loaded by w, on the body's mesh.

    `mirrors` are the faces where the mesh ends at a mirror plane through the patch. Elements
    farther than `within` [m] along an axis are left out, as are those beyond half a radius of
    curvature of the face and, of a large body, beyond 30 radii of the patch: the exact field takes
    their place.
    Raises ValueError for a curved face of a material that is not isotropic.
    """
    return half_spaces_on_mesh(
        model, face, [patch], material, mirrors=mirrors, within=within, options=options
    )[0]


def half_spaces_on_mesh(
    model: Model,
    face: str,
    patches: Sequence[ContactPatch],
    material: Material | Orthotropic,
    *,
    mirrors: Sequence[str] = (),
    within: float = np.inf,
    options: HalfSpaceMesh = HalfSpaceMesh(),
) -> list[float]:
    """`half_space_on_mesh` [m/N] at several patches of one face, by one factorisation."""
    compliances: list[float] = []
    for field in half_space_fields(
        model, face, patches, material, mirrors=mirrors, within=within, options=options
    ):
        together = patches[len(compliances) : len(compliances) + field.u.shape[1]]
        compliances += field.compliances(together)
    return compliances


class HalfSpaceField(NamedTuple):
    """A half-space under patches, solved on elements of the body that is struck."""

    body: str
    cells: NDArray[np.int64]  # the elements
    ends: NDArray[np.int64]  # facets on which they end, other than the struck face
    dofs: NDArray[np.int64]  # (n,) of the structure
    u: NDArray[np.float64]  # (n, m) [m] by a unit force on each of m patches

    def compliances(self, patches: Sequence[ContactPatch]) -> list[float]:
        """w^T u [m/N] of each of these m patches."""
        w = np.column_stack([patch.on_mesh[self.dofs] for patch in patches])
        return (w * self.u).sum(axis=0).tolist()


def half_space_fields(
    model: Model,
    face: str,
    patches: Sequence[ContactPatch],
    material: Material | Orthotropic,
    *,
    mirrors: Sequence[str] = (),
    within: float = np.inf,
    options: HalfSpaceMesh = HalfSpaceMesh(),
) -> Iterator[HalfSpaceField]:
    """The displacements whose compliance `half_space_on_mesh` is, of a few patches at a time.

    u (n, m) [m] of each is prescribed as the exact field on the outside of the elements, zero along
    the normals of mirrors, and elsewhere the solution of K u = w. Raises ValueError for a curved
    face of a material that is not isotropic.
    """
    structure, spot = model.structure, patches[0].spot
    if not isinstance(material, Material) and np.isfinite(spot.radii).any():
        raise ValueError(
            f"{face!r} is a curved face of an orthotropic material, for which the contact's law is "
            "not known here; strike a plane face."
        )
    table = None if isinstance(material, Material) else surface_force(material, spot.inward)

    # cells around any patch that are solved for: all, but where the exact field is good enough
    body, struck = structure.facets(face)
    basis, mesh, first = structure.basis[body], structure.basis[body].mesh, structure.first[body]
    middle = mesh.p[:, mesh.t].mean(axis=1)
    near_patches = []
    for patch in patches:
        reach = min(within, options.curved * min(map(abs, patch.spot.radii)))
        if basis.N > options.large and patch.radius:
            reach = min(reach, options.reach * patch.radius)
        distance = np.abs(middle - patch.spot.point[:, None]).max(axis=0)
        near_patches.append(np.flatnonzero(distance <= reach))
    cells = np.unique(np.concatenate(near_patches))

    # their dofs: prescribed on their outside but for the struck face and mirrors, still normal to
    # mirrors, else free
    facets, n_sides = np.unique(mesh.t2f[:, cells], return_counts=True)
    ends = [struck, *(structure.facets(mirror)[1] for mirror in mirrors)]
    outside = np.setdiff1d(facets[n_sides == 1], np.concatenate(ends))
    prescribed = first + np.unique(basis.get_dofs(outside).all())
    still = [normal_dofs(structure, mirror) for mirror in mirrors]
    dofs = first + np.unique(basis.element_dofs[:, cells])
    free = np.setdiff1d(dofs, np.concatenate([prescribed, *still]))
    nodes, node = np.unique(prescribed // 3, return_inverse=True)
    points = structure.points[nodes]

    K = structure.K[free]
    factor = factorised(K[:, free].tocsc()) if len(free) else None
    for start in range(0, len(patches), options.patches_at_once):
        group = patches[start : start + options.patches_at_once]
        w, u = np.column_stack([patch.on_mesh for patch in group]), []
        for patch in group:
            # the force on a patch as shares of it at points, and the exact displacements by these
            if patch.weights == "nodes":
                direction = patch.spot.inward if patch.tangent is None else patch.tangent
                share = patch.on_mesh.reshape(-1, 3) @ direction
                sources, share = structure.points[share > 0], share[share > 0]
            else:
                disc, share = disc_quadrature(patch.weights, 6, 18)
                sources = patch.spot.point + patch.radius * disc @ patch.spot.axes
            if patch.tangent is not None:
                exact = cerruti(points, sources, share, spot.inward, patch.tangent, material)
            elif table is None:
                exact = boussinesq(points, sources, share, spot.inward, material)
            else:
                exact = sum(
                    p * table(points, source) for source, p in zip(sources, share, strict=True)
                )
            u.append(exact[node, prescribed % 3])
        u = np.column_stack(u)

        # K u = w on the free dofs
        u_free = np.empty((0, len(group)))
        if factor:
            u_free = factor.solve(w[free] - K[:, prescribed] @ u)
        where = np.concatenate([prescribed, free])
        yield HalfSpaceField(body, cells, outside, where, np.concatenate([u, u_free]))
