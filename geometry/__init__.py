"""Shapes, bodies and where they touch, meshes. Lengths in m.

    boxes, interfaces      bodies of the thesis' rig (an `Assembly` of dimensions), and their faces
    hex_mesh, plate_mesh   hexahedra of the rig, and of a plate refined at a point
    geometry.shapes        bodies to be drawn; geometry.cad: drawn, or read from STEP files
    geometry.touching      which bodies touch, on which faces
    geometry.joints        faces, touching pairs and places of joints that a scene names
    geometry.body_mesh     bodies meshed, faces that touch imprinted on each other
    geometry.own_mesh      bodies, faces and touching pairs of a mesh file, found on its facets

A mesh is a `skfem.Mesh` with named boundaries, a face is called "body:face". Dimensions that
nobody can build raise InvalidGeometry, with one sentence.

>>> float(boxes(Assembly())["block"].upper[0])  # m, half of its 131.5 mm along the chain
0.06575
"""

from geometry.assembly import (
    PARTS,
    Assembly,
    Cuboid,
    Interface,
    InvalidGeometry,
    boxes,
    held_faces,
    interfaces,
    provenance,
    volume,
)
from geometry.cell_groups import CellGroup
from geometry.hex_mesh import hex_mesh
from geometry.naming import by_body, named
from geometry.plate_mesh import Extent, plate_mesh
from geometry.quality import smallest_quality
from geometry.refined import refined
from geometry.thinning import thinned

__all__ = [
    "PARTS",
    "Assembly",
    "CellGroup",
    "Cuboid",
    "Extent",
    "Interface",
    "InvalidGeometry",
    "boxes",
    "by_body",
    "held_faces",
    "hex_mesh",
    "interfaces",
    "named",
    "plate_mesh",
    "provenance",
    "refined",
    "smallest_quality",
    "thinned",
    "volume",
]
