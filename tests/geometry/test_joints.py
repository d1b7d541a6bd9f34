"""Words of an assembly against the places that its shapes were drawn with."""

import numpy as np
import pytest

from beadwave.geometry import InvalidGeometry
from beadwave.geometry.cad.joints import JointWords, TieWords, Words, picked
from beadwave.geometry.cad.occ import model
from beadwave.geometry.cad.patches import Disc, Share, ThreadBand
from beadwave.geometry.cad.shapes import Cylinder, Hole, Slab
from beadwave.geometry.cad.touching import neighbours

GAP = 1e-5
RECTANGLE = ((0, 0), (0.2, 0), (0.2, 0.1), (0, 0.1))
AT = ((0.03, 0.05), (0.17, 0.05))  # of the holes
LENGTH = 0.03  # of the stud, from below the base to above the nut


def slab(thickness, z, diameter, at=AT):
    return Slab(RECTANGLE, thickness, tuple(Hole(diameter, point) for point in at), at=(0, 0, z))


@pytest.fixture(scope="module")
def bolted():
    """A cover on a base, two holes through both; a nut on a stud, away from them."""
    shapes = {
        "base": slab(0.02, -0.02, 7e-3),
        "cover": slab(0.01, 0.0, 9e-3),
        "stud": Cylinder(4e-3, LENGTH, at=(0.1, 0.3, 0.0)),
        "nut": Cylinder(9e-3, 6e-3, 4.1e-3, at=(0.1, 0.3, 0.01)),
    }
    with model(shapes) as cad:
        yield cad.bodies, neighbours(cad.bodies, GAP).touching


def places(bolted, *joints, **words):
    bodies, touching = bolted
    return picked(Words(joints=joints, **words), bodies, touching, GAP)


def test_a_bolt_sits_where_both_holes_meet_and_points_from_first_to_second(bolted):
    selection = places(bolted, JointWords("m6", "joints.m6", "cover", "base"))
    assert [place.bodies for place in selection.joints] == 2 * [("cover", "base")]
    for place, (x, y) in zip(sorted(selection.joints, key=lambda p: p.centre[0]), AT, strict=True):
        np.testing.assert_allclose(place.centre, [x, y, 0], atol=1e-9)
        np.testing.assert_allclose(place.axis, [0, 0, -1], atol=1e-9)
    assert selection.jointed == {"base|cover": "m6"}
    # without a washer of its own a bolt presses on the larger of the two holes
    assert {type(patch) for patch in selection.patches.values()} == {Disc}
    assert [d.radius for d in selection.patches.values()] == pytest.approx(4 * [9e-3])


def test_the_faces_of_a_joint_are_named_by_joint_number_and_body(bolted):
    selection = places(bolted, JointWords("m6", "joints.m6", "base", "cover", washer=5e-3))
    assert selection.joints[0].faces == ("base:m6-1-base", "cover:m6-1-cover")
    assert list(selection.patches) == [
        f"m6-{number}-{body}" for number in (1, 2) for body in ("base", "cover")
    ]
    assert all(patch.radius == 5e-3 for patch in selection.patches.values())


def test_a_share_drawn_on_one_side_bounds_the_footprint_on_the_partner(bolted):
    selection = places(bolted, JointWords("m6", "joints.m6", "cover", "base", shares=(0,)))
    place = selection.joints[0]
    assert place.over == (None, place.faces[0])
    assert {type(patch) for patch in selection.patches.values()} == {Share}
    (other,) = next(iter(selection.patches.values())).others
    np.testing.assert_allclose(other, selection.joints[1].centre)
    assert selection.faces["m6-1-base"].body == "base"


def test_a_thread_sits_in_the_middle_of_the_length_in_common(bolted):
    selection = places(bolted, JointWords("m8", "joints.m8", "nut", "stud", "thread"))
    (place,) = selection.joints
    # from the nut's lower end, z = 7 mm, to its upper one, 13 mm; the stud ends at 15 mm
    np.testing.assert_allclose(place.centre, [0.1, 0.3, 0.01], atol=1e-9)
    assert selection.jointed == {"nut|stud": "m8", "stud|nut": "m8"}
    assert all(isinstance(patch, ThreadBand) for patch in selection.patches.values())
    assert [patch.length for patch in selection.patches.values()] == pytest.approx(2 * [6e-3])


def test_holes_held_to_the_ground_are_held_one_by_one(bolted):
    selection = places(bolted, JointWords("foot", "joints.foot", "base:hole", None))
    assert [place.faces for place in selection.joints] == [("base:foot-1",), ("base:foot-2",)]
    assert sorted(place.centre[0] for place in selection.joints) == pytest.approx([0.03, 0.17])


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"bodies": ["lid"]}, 'no body is called "lid"'),
        ({"groups": {"loads.sun": "lid"}}, 'loads.sun: no body is called "lid"'),
        ({"ties": [TieWords("cover|stud")]}, '"cover|stud" do not touch'),
        (
            {"joints": [JointWords("a", "joints.a", "base", "stud", "thread")]},
            'joints.a.at = "thread" finds no shank',
        ),
        (
            {"joints": [JointWords("a", "joints.a", "base", "cover", [AT[0] + (0,)] * 2)]},
            "points 1 and 2 of joints.a.at are 0 m apart",
        ),
    ],
)
def test_words_that_pick_nothing_are_refused_by_the_key_that_holds_them(bolted, words, message):
    bodies, touching = bolted
    with pytest.raises(InvalidGeometry) as refused:
        picked(Words(**words), bodies, touching, GAP)
    assert message in str(refused.value)
