"""The parametric assembly as shapes to be drawn, a body for every part."""

from geometry.assembly import Assembly, boxes, screw_z, sheets
from geometry.shapes import Box, Hole, Shape, Slab


def shapes(assembly: Assembly) -> dict[str, Shape]:
    """Boxes, and the sheets as plates with a hole for every screw."""
    a = assembly
    solids: dict[str, Shape] = {}
    for name, box in boxes(a).items():
        middle = (box.lower + box.upper) / 2
        solids[name] = Box(tuple(box.upper - box.lower), at=tuple(middle))

    # a sheet's outline is drawn with z as its second axis: turned by 90 degrees about x it stands
    # upright, and its thickness goes along -y
    half, lower = a.sheet_width / 2, -a.sheet_free_length - a.foot_overlap
    corners = ((-half, lower), (half, lower), (half, a.head_overlap), (-half, a.head_overlap))
    holes = tuple(Hole(2 * a.hole_radius, (x, z)) for z in screw_z(a).values() for x in a.screw_x)
    for name, y in sheets(a).items():
        place = (0.0, y + a.sheet_thickness if y > 0 else y, 0.0)
        upright = (90.0, 0.0, 0.0)
        solids[name] = Slab(corners, a.sheet_thickness, holes, at=place, turn=upright)
    return solids
