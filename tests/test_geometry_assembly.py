import pytest

from geometry import PARTS, Assembly, InvalidGeometry, held_faces, interfaces, provenance


@pytest.mark.parametrize(
    ("dimension", "sentence"),
    [
        ({"sheet_thickness": -1e-3}, r"sheet_thickness = -0.001 m must be a positive"),
        ({"block_x": float("nan")}, r"block_x = nan m must be a positive"),
        ({"screw_x": (-0.03, 0.03)}, r"screw_x = -0.03 m .* does not fit"),
        ({"screw_x": ()}, r"screw_x = \[\] must list"),
        ({"screw_x": (0.015, -0.015)}, r"screw_x = .* ascending"),
        ({"head_screw_z": 0.005}, r"head_screw_z puts a washer .* not in the overlap"),
        ({"hole_radius": 0.02}, r"hole_radius = 0.02 m must be below washer_radius"),
        ({"sheet_width": 0.2}, r"sheet_width = 0.2 m must not exceed block_x"),
        ({"head_overlap": 0.05}, r"head_overlap = 0.05 m must not exceed block_z"),
        ({"block_y": 0.09}, r"sheets_support_y = 0.0982 m must equal block_y = 0.09"),
        ({"support_x": 0.2}, r"overhang each other"),
        ({"pad": 0.1}, r"pad = 0.1 m must be less than half"),
        ({"stack_inset": 0.004}, r"stack_inset = 0.004 m .* off a part of 0.078 m"),
        ({"bolt_inset": 0.005}, r"bolt_inset = 0.005 m .* off a plate"),
        ({"parts": ("sheets", "block")}, r"parts = .* must be the first of"),
    ],
)
def test_impossible_dimensions_are_refused_with_their_numbers(dimension, sentence):
    with pytest.raises(InvalidGeometry, match=sentence):
        Assembly(**dimension)


def test_parts_touch_from_the_block_down_to_the_plate():
    touching = [(i.slave, i.master) for i in interfaces(Assembly())]
    assert touching == [
        ("sheet-y:head", "block:-y"),
        ("sheet+y:head", "block:+y"),
        ("sheet-y:foot", "sheets_support:-y"),
        ("sheet+y:foot", "sheets_support:+y"),
        ("support:+z", "sheets_support:-z"),
        ("support:-z", "plate:+z"),
    ]


def test_the_lowest_part_is_held():
    held = [held_faces(Assembly(parts=PARTS[:n])) for n in range(1, 6)]
    assert held[0] == ()
    assert held[1] == ("sheet-y:foot", "sheet+y:foot")
    assert held[2:] == [("sheets_support:-z",), ("support:-z",), ("plate:-z",)]
    assert held_faces(Assembly(), fixing="corners") == ("plate:pads",)
    assert held_faces(Assembly(), fixing="bolted") == ("plate:bolts",)
    under = held_faces(Assembly(parts=PARTS[:2]), under_washers=True)
    assert under[0] == "sheet-y:foot-washer-1" and len(under) == 4


def test_every_dimension_tells_where_it_comes_from():
    for name in Assembly.__dataclass_fields__:
        assert "(" in provenance(name)
