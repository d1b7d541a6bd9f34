"""A mesh of several bodies as one mesh for each."""

from skfem import Mesh


def by_body(mesh: Mesh) -> dict[str, Mesh]:
    """The mesh of every subdomain, its boundaries "body:face" as "face".

    Nodes that bodies share are doubled: nothing is joined by its mesh.
    """
    return {name: _alone(mesh, name) for name in mesh.subdomains}


def _alone(mesh: Mesh, name: str) -> Mesh:
    body = mesh.restrict(mesh.subdomains[name], skip_subdomains=True)
    own = {face: facets for face, facets in (body.boundaries or {}).items() if len(facets)}
    faces = [(face.partition(":"), facets) for face, facets in own.items()]
    return body.with_boundaries({face: f for (owner, _, face), f in faces if owner == name})
