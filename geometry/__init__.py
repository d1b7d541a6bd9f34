"""Shapes, bodies and where they touch, meshes. Lengths in m.

    geometry.shapes        bodies to be drawn; geometry.cad: drawn, or read from STEP files
    geometry.lined         hexahedra between prescribed grid lines
    geometry.drawing       the bodies of an assembly, from shapes, STEP or a mesh, and their meshes
    geometry.touching      which bodies touch, on which faces
    geometry.joints        faces, touching pairs and places of joints that a scene names
    geometry.body_mesh     bodies meshed, faces that touch imprinted on each other
    geometry.own_mesh      bodies, faces and touching pairs of a mesh, found on its facets
    plate_mesh             a plate refined at a point

A mesh is a `skfem.Mesh` with named boundaries, a face is called "body:face". Dimensions that
nobody can build raise InvalidGeometry, with one sentence.
"""

from beadwave.geometry.cad.naming import by_body
from beadwave.geometry.errors import InvalidGeometry
from beadwave.geometry.meshing.refined import refined
from beadwave.geometry.own_mesh.cell_groups import CellGroup
from beadwave.geometry.own_mesh.thinning import thinned
from beadwave.geometry.plate_mesh import Extent, plate_mesh
from beadwave.geometry.quality import smallest_quality

__all__ = [
    "CellGroup",
    "Extent",
    "InvalidGeometry",
    "by_body",
    "plate_mesh",
    "refined",
    "smallest_quality",
    "thinned",
]
