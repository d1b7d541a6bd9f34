"""Every body meshed on its own, straight elements for quadratic shape functions.

Hexahedra for boxes, extruded outlines and tubes, tetrahedra for all else. Elements have the body's
seed, less where it is bent or thin, and grow away from fine points. Nodes on full cylinders are
moved out so that the facets enclose the cylinder's volume: chords alone make holes and pins too
small by 2 pi^2 / (3 n^2) for n edges around.
"""

from collections.abc import Mapping, Sequence

from skfem import Basis, Mesh

from geometry.foreseen import require_few
from geometry.gmsh_session import failing
from geometry.hexahedra import hexahedra
from geometry.imprint import Disc, Share, regions
from geometry.roundness import rimmed
from geometry.selectors import Selected
from geometry.sizes import Sizes
from geometry.solids import Body
from geometry.tetrahedra import tetrahedra
from geometry.touching import Touch

DEFAULT = Sizes()


def body_meshes(
    bodies: Mapping[str, Body],
    touching: Sequence[Touch] = (),
    *,
    gap: float,
    sizes: Sizes = DEFAULT,
    named: Mapping[str, Selected] | None = None,
    patches: Mapping[str, Disc | Share] | None = None,
    element: str | None = None,
) -> dict[str, Mesh]:
    """A mesh for every body, in metres, to call in the bodies' ``with model(...)``, once.

    Its boundaries are the `named` faces and the `patches` of the body, and "a|b" where it touches
    another, under the same key in both. `element` "tet" takes tetrahedra for all. Raises
    InvalidGeometry for a seed that is too fine, ValueError, naming the body, for what gmsh cannot
    mesh.
    """
    for body in bodies.values():
        require_few(body, sizes.of(body))
    meshes = {}
    for name, body in bodies.items():
        size = sizes.of(body)
        with failing(f'"{name}" could not be meshed with elements of {size.seed:.3g} m'):
            wanted = regions(body, touching, patches or {}, gap)
            order = (body, wanted, named or {}, size, gap)
            mesh = (None if element == "tet" else hexahedra(*order)) or tetrahedra(*order)
        for key, disc in (patches or {}).items():
            round_one = isinstance(disc, Disc) and disc.on.body == name
            mesh = rimmed(mesh, key, disc, size.around) if round_one else mesh
        meshes[name] = mesh
    return meshes


def facet_error(mesh: Mesh, body: Body) -> float:
    """Relative difference of the mesh's volume from the body's, which straight facets leave."""
    return float(Basis(mesh, mesh.elem(), intorder=3).dx.sum() / body.volume - 1)
