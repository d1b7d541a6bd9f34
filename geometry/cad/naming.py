"""Bodies of one mesh as meshes of their own."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:  # see `lined`
    from skfem import Mesh


def by_body(mesh: Mesh) -> dict[str, Mesh]:
    """The mesh of every subdomain, its boundaries "body:face" as "face".

    Nodes that bodies share are doubled: nothing is joined by its mesh.
    """
    meshes = {}
    for name in mesh.subdomains:
        body = mesh.restrict(mesh.subdomains[name], skip_subdomains=True)
        faces = {}
        for boundary, facets in (body.boundaries or {}).items():
            owner, _, face = boundary.partition(":")
            if owner == name and len(facets):
                faces[face] = facets
        meshes[name] = body.with_boundaries(faces)
    return meshes
