"""Parts moved as one rigid body: their mass and centre, and joints that would hold them back."""

import numpy as np
import pytest
from skfem import MeshHex

from fem import Connections, Held, Joint, Material, Side, Tie, assemble, joined, rigid_body
from fem.grounding import require_free_joints
from fem.joints import rigid_motion, tie

STEEL = Material(210e9, 0.3, 7850.0)
SIDE, HEIGHT = 0.06, 0.05  # m


TIE = Tie("upper:foot", "lower:top")
UNDER = Side("lower:top", "mean", over="upper:foot")
JOINT = Joint("screw", Side("upper:foot"), UNDER, np.array([0.0, 0.0, HEIGHT]))


def two_blocks(gap=0.0):
    """Two equal blocks, one above the other, `gap` [m] between them."""
    across = np.linspace(-SIDE / 2, SIDE / 2, 3)
    lower = MeshHex.init_tensor(across, across, [0, HEIGHT])
    upper = lower.translated((0.0, 0.0, HEIGHT + gap))
    meshes = {
        "lower": lower.with_boundaries({"base": at(0.0), "top": at(HEIGHT)}),
        "upper": upper.with_boundaries({"foot": at(HEIGHT + gap)}),
    }
    return assemble(meshes, dict.fromkeys(meshes, STEEL))


def at(z):
    return lambda x: np.abs(x[2] - z) < 1e-9


def test_a_rigid_body_has_the_mass_and_centre_of_its_volume():
    found = rigid_body(two_blocks())
    assert found.mass == pytest.approx(2 * STEEL.density * SIDE**2 * HEIGHT, rel=1e-12)
    np.testing.assert_allclose(found.centre, [0, 0, HEIGHT], atol=1e-12)
    assert found.grounding < 1e-13


@pytest.mark.parametrize("how", [Connections([TIE]), Connections(joints=[JOINT])])
def test_joints_follow_rigid_motions_and_are_refused_across_a_gap(how):
    held = how._replace(held=[Held("lower:base")])
    assert joined(two_blocks(), held).M.shape[0]
    with pytest.raises(ValueError, match="'upper:foot' does not lie on 'lower:top'"):
        joined(two_blocks(gap=1e-3), held)


def test_a_tie_across_a_gap_that_is_allowed_follows_rigid_motions_exactly():
    """The field of the element below is continued over the gap: a turn stays a turn."""
    structure, gap = two_blocks(gap=1e-3), TIE._replace(gap=1.1e-3)
    model = joined(structure, Connections([gap]))
    R = rigid_motion(structure.points, np.zeros(3))
    np.testing.assert_allclose(model.T @ R[model.free], R, atol=1e-12)


@pytest.mark.parametrize("wrong", [1.001, 0.999])
def test_a_tie_that_does_not_follow_a_rigid_motion_is_noticed(wrong):
    """One that carries 1.001 m for each m would ground the upper block like a spring."""
    structure = two_blocks()
    sound = tie(structure, TIE, structure.n_dofs)
    require_free_joints(structure, [sound], np.empty((0, 3)))
    with pytest.raises(ValueError, match="tie upper:foot to lower:top holds rigid motions back"):
        require_free_joints(structure, [sound._replace(A=wrong * sound.A)], np.empty((0, 3)))
