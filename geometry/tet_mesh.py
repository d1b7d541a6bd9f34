"""Tetrahedra for any assembly, by gmsh.

Screw holes, washers, the lines between screws and the clamp lines are imprinted on the sheets,
the pads on the plate; the block is refined towards the contact.
"""

import gmsh
import numpy as np
from numpy.typing import NDArray
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

TETRAHEDRON = 4  # gmsh's element type
CONTACT_GRADING = 0.35  # growth of the element size per distance from the contact


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
    with session(), mesh_options({"MeshSizeFromCurvature": EDGES_AROUND / coarser}):
        sizes = {"block": block_seed}
        volumes = _bodies(a)
        gmsh.model.occ.synchronize()
        for name, tags in volumes.items():
            _sized(tags, seed if name in sheets(a) else sizes.get(name, support_seed))
        if contact_seed is not None:
            _refined(a, contact_point, contact_seed, block_seed)
        return _meshed(assembly, volumes)


def _bodies(a: Assembly) -> dict[str, list[int]]:
    """Volumes of every body in the current gmsh model."""
    solid = {name: _box(a, name) for name in boxes(a)}
    return solid | {name: _sheet(a, y) for name, y in sheets(a).items()}


def _box(a: Assembly, name: str) -> list[int]:
    box = boxes(a)[name]
    volume = (3, gmsh.model.occ.addBox(*box.lower, *(box.upper - box.lower)))
    squares = [(2, _square(*s)) for s in _squares(a, name, box)]
    if not squares:
        return [volume[1]]
    return [tag for dim, tag in gmsh.model.occ.fragment([volume], squares)[0] if dim == 3]


def _squares(a: Assembly, name: str, box) -> list[tuple[float, float, float, float]]:
    """Lower corner x, y, z and side of every square to imprint on a part."""
    found = []
    for face, near, far in corner_squares(a, name).values():
        z = (box.lower if face == "-z" else box.upper)[2]
        x = (box.lower[0] + near, box.upper[0] - far)
        y = (box.lower[1] + near, box.upper[1] - far)
        found += [(i, j, z, far - near) for i in x for j in y]
    return found


def _square(x: float, y: float, z: float, side: float) -> int:
    return gmsh.model.occ.addRectangle(x, y, z, side, side)


def _sheet(a: Assembly, y: float) -> list[int]:
    """A sheet drawn in its plane, all lines imprinted, and extruded away from the block."""
    outlines, washers, holes = [], [], []
    width = a.sheet_width
    free = (-width / 2, -a.sheet_free_length, width, a.sheet_free_length)
    outlines.append(_rectangle(*free, y))
    for joint in ("head", "foot"):
        lower, upper = washer_z_range(a, joint)
        for x, (left, right) in zip(a.screw_x, screw_cells(a), strict=True):
            outlines.append(_rectangle(left, lower, right - left, upper - lower, y))
            washers.append(_disc(x, screw_z(a)[joint], a.washer_radius, y))
            holes.append(_disc(x, screw_z(a)[joint], a.hole_radius, y))
    occ = gmsh.model.occ
    flat = occ.fragment(outlines, washers)[0]
    flat = occ.cut(flat, holes)[0]
    # one layer, meshed by extrusion: free tetrahedra would be slivers in so thin a sheet
    solid = occ.extrude(flat, 0, np.sign(y) * a.sheet_thickness, 0, numElements=[1])
    return [tag for dim, tag in solid if dim == 3]


def _rectangle(x: float, z: float, dx: float, dz: float, y: float) -> tuple[int, int]:
    occ = gmsh.model.occ
    tag = occ.addRectangle(x, z, 0, dx, dz)
    return _stood_up(tag, y)


def _disc(x: float, z: float, radius: float, y: float) -> tuple[int, int]:
    return _stood_up(gmsh.model.occ.addDisk(x, z, 0, radius, radius), y)


def _stood_up(tag: int, y: float) -> tuple[int, int]:
    """From the plane x-y drawn in, to the plane x-z at height y."""
    entity = (2, tag)
    gmsh.model.occ.rotate([entity], 0, 0, 0, 1, 0, 0, np.pi / 2)
    gmsh.model.occ.translate([entity], 0, y, 0)
    return entity


def _sized(volumes: list[int], size: float) -> None:
    solids = [(3, tag) for tag in volumes]
    points = gmsh.model.getBoundary(solids, combined=False, oriented=False, recursive=True)
    gmsh.model.mesh.setSize(points, size)


def _refined(a: Assembly, point, fine: float, coarse: float) -> None:
    """Element size fine + grading * distance to the contact, nowhere larger than elsewhere set."""
    x, y, z = a.block_x / 2, point[0], a.block_z / 2 + point[1]
    distance = f"sqrt((x-({x}))^2+(y-({y}))^2+(z-({z}))^2)"
    field = gmsh.model.mesh.field
    tag = field.add("MathEval")
    field.setString(tag, "F", f"{fine} + {CONTACT_GRADING} * {distance}")
    field.setAsBackgroundMesh(tag)


def _meshed(assembly: Assembly, volumes: dict[str, list[int]]) -> MeshTet:
    gmsh.model.mesh.generate(3)
    tags, points, _ = gmsh.model.mesh.getNodes()
    t = {name: np.concatenate([_cells(tag) for tag in v]) for name, v in volumes.items()}
    number = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    number[tags.astype(np.int64)] = np.arange(len(tags))
    cells = number[np.concatenate(list(t.values()))]
    used, cells = np.unique(cells, return_inverse=True)
    first = np.cumsum([0, *map(len, t.values())])
    body = {name: np.arange(*first[i : i + 2]) for i, name in enumerate(t)}
    p = points.reshape(-1, 3)[used].T
    mesh = MeshTet(np.ascontiguousarray(p), np.ascontiguousarray(cells.reshape(-1, 4).T))
    return named(mesh, assembly, body)


def _cells(volume: int) -> NDArray[np.int64]:
    _, nodes = gmsh.model.mesh.getElementsByType(TETRAHEDRON, volume)
    return nodes.astype(np.int64).reshape(-1, 4)
