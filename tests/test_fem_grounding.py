"""Parts moved as one rigid body: their mass and centre, and joints that would hold them back."""

from typing import NamedTuple

import numpy as np
import pytest
from skfem import MeshHex

from fem import Joint, Material, assemble, full_tie, rigid_body, wires
from fem.grounding import require_free_joints
from fem.joints import tie

STEEL = Material(210e9, 0.3, 7850.0)
SIDE, HEIGHT = 0.06, 0.05  # m


class Touching(NamedTuple):
    slave: str = "upper:foot"
    master: str = "lower:top"
    screws: tuple = ("upper:foot",)
    halves: tuple = ("upper:foot",)
    centres: np.ndarray = np.array([[0.0, 0.0, HEIGHT]])


def two_blocks(gap=0.0):
    """Two equal blocks, one above the other, `gap` [m] between them."""
    across = np.linspace(-SIDE / 2, SIDE / 2, 3)
    lower = MeshHex.init_tensor(across, across, [0, HEIGHT])
    upper = lower.translated((0.0, 0.0, HEIGHT + gap))
    n = lower.nelements
    mesh = MeshHex(
        np.concatenate([lower.p, upper.p], axis=1),
        np.concatenate([lower.t, upper.t + lower.p.shape[1]], axis=1),
    ).with_subdomains({"lower": np.arange(n), "upper": np.arange(n, 2 * n)})
    z, of_upper = mesh.p[2, mesh.facets].mean(axis=0), mesh.f2t[0] >= n
    faces = {
        "upper:foot": np.flatnonzero(of_upper & (np.abs(z - HEIGHT - gap) < 1e-9)),
        "lower:top": np.flatnonzero(~of_upper & (np.abs(z - HEIGHT) < 1e-9)),
        "lower:base": np.flatnonzero(np.abs(z) < 1e-9),
    }
    return assemble(mesh.with_boundaries(faces), {"lower": STEEL, "upper": STEEL})


def test_a_rigid_body_has_the_mass_and_centre_of_its_volume():
    found = rigid_body(two_blocks())
    assert found.mass == pytest.approx(2 * STEEL.density * SIDE**2 * HEIGHT, rel=1e-12)
    np.testing.assert_allclose(found.centre, [0, 0, HEIGHT], atol=1e-12)
    assert found.grounding < 1e-13


@pytest.mark.parametrize("join", [full_tie, lambda *parts: wires(*parts, {"lower": Joint()})])
def test_joints_follow_rigid_motions_and_are_refused_across_a_gap(join):
    held = ("lower:base",)
    assert join(two_blocks(), [Touching()], held).M.shape[0]
    with pytest.raises(ValueError, match="'upper:foot' does not lie on 'lower:top'"):
        join(two_blocks(gap=1e-3), [Touching()], held)


@pytest.mark.parametrize("wrong", [1.001, 0.999])
def test_a_tie_that_does_not_follow_a_rigid_motion_is_noticed(wrong):
    """One that carries 1.001 m for each m would ground the upper block like a spring."""
    basis = two_blocks().basis
    sound = tie(basis, "upper:foot", "lower:top")
    require_free_joints(basis, [sound], np.empty((0, 3)))
    with pytest.raises(ValueError, match="holds rigid motions back"):
        require_free_joints(basis, [sound._replace(A=wrong * sound.A)], np.empty((0, 3)))
