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
from geometry.hex_mesh import hex_mesh
from geometry.naming import named

__all__ = [
    "PARTS",
    "Assembly",
    "Box",
    "Interface",
    "InvalidGeometry",
    "boxes",
    "held_faces",
    "hex_mesh",
    "interfaces",
    "named",
    "provenance",
    "volume",
]
