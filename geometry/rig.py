"""The parametric assembly drawn from shapes, as any other: a body for every part."""

from geometry.assembly import Assembly, boxes, screw_z, sheets
from geometry.shapes import Box, Hole, Plate, Shape


def shapes(assembly: Assembly) -> dict[str, Shape]:
    """Boxes, and the sheets as plates with a hole for every screw."""
    drawn: dict[str, Shape] = {}
    for name, box in boxes(assembly).items():
        middle = (box.lower + box.upper) / 2
        drawn[name] = Box(tuple(box.upper - box.lower), at=tuple(middle))
    return drawn | {name: _sheet(assembly, y) for name, y in sheets(assembly).items()}


def _sheet(a: Assembly, y: float) -> Plate:
    """Drawn in x and z: turned upright, its thickness goes along -y."""
    half, lower = a.sheet_width / 2, -a.sheet_free_length - a.foot_overlap
    corners = ((-half, lower), (half, lower), (half, a.head_overlap), (-half, a.head_overlap))
    holes = [Hole(2 * a.hole_radius, (x, z)) for z in screw_z(a).values() for x in a.screw_x]
    outer = y + a.sheet_thickness if y > 0 else y
    return Plate(
        corners, a.sheet_thickness, tuple(holes), at=(0.0, outer, 0.0), turn=(90.0, 0.0, 0.0)
    )
