"""Parts moved as one rigid body: their mass and centre, and joints that would hold them back."""

import numpy as np
import pytest
from skfem import MeshHex

from beadwave.fem import (
    Connections,
    HeldFace,
    Joint,
    Side,
    Tie,
    assemble,
    joined,
    loose_bodies,
    rigid_body,
)
from beadwave.fem.assembly.grounding import require_free_joints
from beadwave.fem.assembly.joints import rigid_motion, tie

from known_models import STEEL, stacked

SIDE, HEIGHT = 0.06, 0.05  # m


TIE = Tie("upper:foot", "lower:top")
UNDER = Side("lower:top", "mean", over="upper:foot")
JOINT = Joint("screw", Side("upper:foot"), UNDER, np.array([0.0, 0.0, HEIGHT]))


def two_blocks(gap=0.0):
    """Two equal blocks, one above the other, `gap` [m] between them."""
    across = np.linspace(-SIDE / 2, SIDE / 2, 3)
    lower = MeshHex.init_tensor(across, across, [0, HEIGHT])
    upper = lower.translated((0.0, 0.0, HEIGHT + gap))
    return stacked(lower, upper, HEIGHT, gap)


def test_a_rigid_body_has_the_mass_and_centre_of_its_volume():
    computed = rigid_body(two_blocks())
    assert computed.mass == pytest.approx(2 * STEEL.density * SIDE**2 * HEIGHT, rel=1e-12)
    np.testing.assert_allclose(computed.centre, [0, 0, HEIGHT], atol=1e-12)
    assert computed.grounding < 1e-13


@pytest.mark.parametrize("how", [Connections([TIE]), Connections(joints=[JOINT])])
def test_joints_follow_rigid_motions_and_are_refused_across_a_gap(how):
    held = how._replace(held=[HeldFace("lower:base")])
    assert joined(two_blocks(), held).M.shape[0]
    with pytest.raises(ValueError, match="'upper:foot' does not lie on 'lower:top'"):
        joined(two_blocks(gap=1e-3), held)


def test_a_tie_across_a_gap_that_is_allowed_follows_rigid_motions_exactly():
    """The field of the element below is continued over the gap: a turn stays a turn."""
    structure, gap = two_blocks(gap=1e-3), TIE._replace(gap=1.1e-3)
    model = joined(structure, Connections([gap]))
    R = rigid_motion(structure.points, np.zeros(3))
    np.testing.assert_allclose(model.T @ R[model.free], R, atol=1e-12)


def ring(inner, outer, around, faces):
    """A quarter of a ring, `around` elements along its arc."""
    angle, z = np.linspace(0, np.pi / 2, around + 1), [0, 0.01, 0.02]
    mesh = MeshHex.init_tensor(angle, np.linspace(inner, outer, 3), z)
    named = {name: mesh.facets_satisfying(test) for name, test in faces.items()}
    phi, r, height = mesh.p
    bent = np.array([r * np.cos(phi), r * np.sin(phi), height])
    return MeshHex(bent, mesh.t).with_boundaries(named)


def test_a_pin_tied_in_its_bore_follows_rigid_motions_though_their_facets_miss():
    """9 and 7 elements along a quarter: chords 0.1 to 0.3 mm off each other."""
    meshes = {
        "pin": ring(0.01, 0.03, 9, {"out": lambda x: x[1] > 0.03 - 1e-9}),
        "hub": ring(0.03, 0.05, 7, {"bore": lambda x: x[1] < 0.03 + 1e-9}),
    }
    structure = assemble(meshes, dict.fromkeys(meshes, STEEL))
    model = joined(structure, Connections([Tie("pin:out", "hub:bore")]))
    R = rigid_motion(structure.points, np.zeros(3))
    np.testing.assert_allclose(model.T @ R[model.free], R, atol=1e-11)
    assert not loose_bodies(structure, Connections([Tie("pin:out", "hub:bore")]))


@pytest.mark.parametrize("wrong", [1.001, 0.999])
def test_a_tie_that_does_not_follow_a_rigid_motion_is_noticed(wrong):
    """One that carries 1.001 m for each m would ground the upper block like a spring."""
    structure = two_blocks()
    sound = tie(structure, TIE, structure.n_dofs)
    require_free_joints(structure, [sound], np.empty((0, 3)))
    with pytest.raises(
        ValueError, match="tie upper:foot to lower:top restrains rigid-body motions"
    ):
        require_free_joints(structure, [sound._replace(A=wrong * sound.A)], np.empty((0, 3)))
