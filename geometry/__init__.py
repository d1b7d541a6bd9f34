from geometry.assembly import (
    PARTS,
    Assembly,
    Box,
    Interface,
    InvalidGeometry,
    boxes,
    held_faces,
    interfaces,
    provenance,
    volume,
)
from geometry.bodies import by_body
from geometry.cell_groups import CellGroup
from geometry.hex_mesh import hex_mesh
from geometry.naming import named
from geometry.plate_mesh import Extent, plate_mesh
from geometry.quality import smallest_quality

__all__ = [
    "PARTS",
    "Assembly",
    "Box",
    "CellGroup",
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
    "smallest_quality",
    "volume",
]
