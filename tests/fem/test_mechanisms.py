"""Bodies that nothing holds are named with their motions, and what holds them is not."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from skfem import MeshHex, MeshTet

from beadwave.fem import (
    Bushing,
    Connections,
    HeldFace,
    Joint,
    Material,
    Side,
    Tie,
    assemble,
    joined,
    loose_bodies,
    modes,
)

STEEL = Material(210e9, 0.3, 7850.0)
ALL = ("x", "y", "z", "rx", "ry", "rz")
TIE, BASE = Tie("upper:-z", "lower:+z"), HeldFace("lower:-z")
MIDDLE = np.array([0.05, 0.05, 0.1])


def box(kind, lower, upper, n):
    lines = [np.linspace(*ends) for ends in zip(lower, upper, n, strict=True)]
    faces = {
        f"{sign}{letter}": lambda x, i=i, end=end: np.abs(x[i] - end) < 1e-9
        for i, letter in enumerate("xyz")
        for sign, end in (("-", lower[i]), ("+", upper[i]))
    }
    return kind.init_tensor(*lines).with_boundaries(faces)


@pytest.fixture(scope="module")
def stack():
    """Tetrahedra on hexahedra."""
    meshes = {
        "lower": box(MeshHex, (0, 0, 0), (0.1, 0.1, 0.1), (3, 3, 3)),
        "upper": box(MeshTet, (0.02, 0.02, 0.1), (0.08, 0.08, 0.2), (3, 4, 3)),
    }
    return assemble(meshes, dict.fromkeys(meshes, STEEL))


def joint(**springs):
    under = Side("lower:+z", "mean", over="upper:-z")
    return Joint("pin", Side("upper:-z"), under, MIDDLE, Bushing(**springs))


def told(structure, *how):
    return {one.body: one.motions for one in loose_bodies(structure, Connections(*how))}


def test_a_body_tied_to_nothing_is_named_with_its_six_motions(stack):
    assert told(stack, (), (), [BASE]) == {"upper": ALL}
    assert told(stack) == {"lower": ALL, "upper": ALL}


def test_bodies_of_held_and_of_floating_assemblies_are_not_loose(stack):
    assert told(stack, [TIE], (), [BASE]) == told(stack, [TIE]) == {}
    assert told(stack, (), [joint(kx=1.0, krz=1e-3)], [BASE]) == {}


def test_a_hinge_leaves_its_turn_and_a_roller_its_plane(stack):
    assert told(stack, (), [joint(krz=0.0)], [BASE]) == {"upper": ("rz",)}
    assert told(stack, (), [joint(krz=0.0)]) == {"lower": ("rz",), "upper": ("rz",)}
    rolling = told(stack, [TIE], (), [HeldFace("lower:-z", "z")])
    assert rolling == {"lower": ("x", "y", "rz"), "upper": ("x", "y", "rz")}


def test_every_mechanism_is_a_mode_of_no_frequency(stack):
    earth = Joint("earth", Side("lower:-z"), None, np.array([0.05, 0.05, 0]), Bushing(kx=0.0))
    how = Connections((), [earth, joint(ky=0.0)])
    assert told(stack, *how[:2]) == {"lower": ("x",), "upper": ("x", "y")}
    model = joined(stack, how)
    hz = modes(model.K, model.M, 3, shift_hz=50.0).frequency_hz
    assert hz[1] < 1e-2 * hz[2]


def test_a_node_on_a_support_leaves_its_tie_and_is_reported(stack):
    model = joined(stack, Connections([TIE], held=[HeldFace("upper:-x", "x"), BASE]))
    (twice,) = model.overconstrained
    assert (twice.kept, twice.dropped) == ("the supports", "the tie upper:-z to lower:+z")
    spots = stack.points[twice.slaves // 3]
    np.testing.assert_allclose(spots[:, [0, 2]] - [0.02, 0.1], 0.0, atol=1e-12)
    assert set(twice.slaves % 3) == {0}
    assert not joined(stack, Connections([TIE], held=[BASE])).overconstrained


def test_a_small_body_that_floats_has_the_modes_of_a_large_one():
    """A turned cube of 0.5 mm: the rounding of its stiffness is 1.9e-2 of a shift of 5 Hz."""
    turn, hz = Rotation.from_euler("xyz", [10, 20, 30], degrees=True).as_matrix(), []
    for side in (5e-4, 5e-2):
        cube = box(MeshTet, (0, 0, 0), (side, side, side), (6, 6, 6))
        cube = replace(cube, doflocs=turn @ cube.p + side / 10)
        model = joined(assemble({"cube": cube}, {"cube": STEEL}), Connections())
        hz.append(modes(model.K, model.M, 10).frequency_hz * side)
    assert max(hz[0][:6]) < 1e-6 * hz[0][6]
    np.testing.assert_allclose(hz[0][6:], hz[1][6:], rtol=1e-6)
