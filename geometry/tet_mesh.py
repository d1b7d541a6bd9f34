"""Tetrahedra for any assembly, by gmsh.

Screw holes, washers, the lines between screws and the clamp lines are imprinted on the sheets,
the pads on the plate; the block is refined towards the contact.
"""

import gmsh
import numpy as np
from skfem import MeshTet

from geometry.assembly import (
    Assembly,
    boxes,
    corner_squares,
    screw_cells,
    screw_z,
    sheets,
    washer_z_range,
)
from geometry.gmsh_session import EDGES_AROUND, mesh_options, session
from geometry.naming import named
from geometry.sizes import GROWTH

TETRAHEDRON = 4  # gmsh's element type


def tet_mesh(
    assembly: Assembly,
    *,
    seed: float,
    block_seed: float,
    support_seed: float,
    contact_seed: float | None = None,
    contact_point: tuple[float, float] = (0.0, 0.0),
    coarser: float = 1.0,
) -> MeshTet:
    """Every part meshed on its own, with the names and the sizes of :func:`geometry.hex_mesh`,
    circles of `coarser` times fewer edges than usual.

    Raises ValueError when gmsh cannot mesh a part.
    """
    a = assembly
    occ = gmsh.model.occ
    with session(), mesh_options({"MeshSizeFromCurvature": EDGES_AROUND / coarser}):
        volumes: dict[str, list[int]] = {}  # by body, in as many pieces as its imprints make

        # boxes, the squares at their corners imprinted
        for name, box in boxes(a).items():
            volume = (3, occ.addBox(*box.lower, *(box.upper - box.lower)))
            squares = []
            for face, near, far in corner_squares(a, name).values():
                z = (box.lower if face == "-z" else box.upper)[2]
                for x in (box.lower[0] + near, box.upper[0] - far):
                    for y in (box.lower[1] + near, box.upper[1] - far):
                        squares.append((2, occ.addRectangle(x, y, z, far - near, far - near)))
            pieces = occ.fragment([volume], squares)[0] if squares else [volume]
            volumes[name] = [tag for dimension, tag in pieces if dimension == 3]
        for name, y in sheets(a).items():
            volumes[name] = _sheet(a, y)
        occ.synchronize()

        # element sizes at the corners of the bodies, and fine + grading * distance to the contact,
        # nowhere larger than there
        for name, tags in volumes.items():
            size = seed if name in sheets(a) else support_seed
            size = block_seed if name == "block" else size
            solids = [(3, tag) for tag in tags]
            points = gmsh.model.getBoundary(solids, combined=False, oriented=False, recursive=True)
            gmsh.model.mesh.setSize(points, size)
        if contact_seed is not None:
            x, y, z = a.block_x / 2, contact_point[0], a.block_z / 2 + contact_point[1]
            distance = f"sqrt((x-({x}))^2+(y-({y}))^2+(z-({z}))^2)"
            field = gmsh.model.mesh.field
            tag = field.add("MathEval")
            field.setString(tag, "F", f"{contact_seed} + {GROWTH.grading} * {distance}")
            field.setAsBackgroundMesh(tag)

        gmsh.model.mesh.generate(3)
        tags, points, _ = gmsh.model.mesh.getNodes()
        t = {}
        for name, pieces in volumes.items():
            nodes = [gmsh.model.mesh.getElementsByType(TETRAHEDRON, tag)[1] for tag in pieces]
            t[name] = np.concatenate(nodes).astype(np.int64).reshape(-1, 4)
    number = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    number[tags.astype(np.int64)] = np.arange(len(tags))
    cells = number[np.concatenate(list(t.values()))]
    used, cells = np.unique(cells, return_inverse=True)
    first = np.cumsum([0, *map(len, t.values())])
    body = {name: np.arange(*first[i : i + 2]) for i, name in enumerate(t)}
    p = points.reshape(-1, 3)[used].T
    mesh = MeshTet(np.ascontiguousarray(p), np.ascontiguousarray(cells.reshape(-1, 4).T))
    return named(mesh, assembly, body)


def _sheet(a: Assembly, y: float) -> list[int]:
    """A sheet drawn in its plane, all lines imprinted, and extruded away from the block."""
    occ = gmsh.model.occ

    def stood_up(tag: int) -> tuple[int, int]:
        """From the plane x-y drawn in, to the plane x-z at height y."""
        occ.rotate([(2, tag)], 0, 0, 0, 1, 0, 0, np.pi / 2)
        occ.translate([(2, tag)], 0, y, 0)
        return 2, tag

    width, free = a.sheet_width, a.sheet_free_length
    outlines, washers, holes = (
        [stood_up(occ.addRectangle(-width / 2, -free, 0, width, free))],
        [],
        [],
    )
    for joint in ("head", "foot"):
        lower, upper = washer_z_range(a, joint)
        z = screw_z(a)[joint]
        for x, (left, right) in zip(a.screw_x, screw_cells(a), strict=True):
            rectangle = occ.addRectangle(left, lower, 0, right - left, upper - lower)
            outlines.append(stood_up(rectangle))
            washers.append(stood_up(occ.addDisk(x, z, 0, a.washer_radius, a.washer_radius)))
            holes.append(stood_up(occ.addDisk(x, z, 0, a.hole_radius, a.hole_radius)))
    flat = occ.fragment(outlines, washers)[0]
    flat = occ.cut(flat, holes)[0]
    # one layer, meshed by extrusion: free tetrahedra would be slivers in so thin a sheet
    solid = occ.extrude(flat, 0, np.sign(y) * a.sheet_thickness, 0, numElements=[1])
    return [tag for dimension, tag in solid if dimension == 3]
