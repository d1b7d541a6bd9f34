"""Orthotropic solids: what their compliance says, turned, and refused where none can be so."""

import numpy as np
import pytest
from skfem import MeshHex, MeshTet

from beadwave.fem import Material, Orthotropic, assemble

PLY = Orthotropic((135e9, 9e9, 7e9), (0.3, 0.25, 0.45), (5e9, 4e9, 3.1e9), 1600.0)
TURNED = ((1.0, 2.0, -0.5), (0.3, 1.0, 4.0))


def test_equal_moduli_are_an_isotropic_solid_whatever_the_axes():
    steel = Material(210e9, 0.3, 7850.0)
    same = Orthotropic((210e9,) * 3, (0.3,) * 3, (steel.lame[1],) * 3, 7850.0, TURNED)
    # an inverse of condition 3 and four products with the axes: 5e-14 of the smallest entries
    np.testing.assert_allclose(same.elasticity, steel.elasticity, rtol=1e-12, atol=1e-3)


def strain(C, stress):
    """Voigt's 6 x 6 of C, solved: strains (3, 3) under stresses (3, 3)."""
    pairs = [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)]
    matrix = np.array([[C[a, c, b, d] for b, d in pairs] for a, c in pairs])
    computed = np.linalg.solve(matrix, [stress[a, c] for a, c in pairs])
    e = np.zeros((3, 3))
    for (a, c), value in zip(pairs, computed, strict=True):
        e[a, c] = e[c, a] = value if a == c else value / 2
    return e


@pytest.mark.parametrize("axes", [((1, 0, 0), (0, 1, 0)), TURNED])
def test_pulled_along_an_axis_it_stretches_by_its_modulus_and_narrows_by_its_ratios(axes):
    ply = PLY._replace(axes=axes)
    R, (E1, E2, _), (nu12, nu13, nu23) = ply.frame, PLY.young, PLY.poisson
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-14)
    for i, expected in (
        (0, [1 / E1, -nu12 / E1, -nu13 / E1]),
        (1, [-nu12 / E1, 1 / E2, -nu23 / E2]),
    ):
        local = R @ strain(ply.elasticity, np.outer(R[i], R[i])) @ R.T
        np.testing.assert_allclose(local, np.diag(expected), rtol=1e-10, atol=1e-24)
    sheared = np.outer(R[0], R[2]) + np.outer(R[2], R[0])
    local = R @ strain(ply.elasticity, sheared) @ R.T
    assert local[0, 2] * 2 * PLY.shear[1] == pytest.approx(1, rel=1e-10)


@pytest.mark.parametrize("kind", [MeshHex, MeshTet])
def test_elements_hold_the_energy_of_a_uniform_strain(kind):
    ply = PLY._replace(axes=TURNED)
    lines = np.linspace(0, 0.1, 4), np.linspace(0, 0.02, 3), np.linspace(0, 0.03, 2)
    structure = assemble({"ply": kind.init_tensor(*lines)}, {"ply": ply})
    gradient = 1e-3 * np.array([[1.0, 0.4, -0.2], [0.1, -0.3, 0.5], [0.7, 0.2, 0.6]])
    u = (structure.points @ gradient.T).ravel()
    exact = np.einsum("ac,acbd,bd", gradient, ply.elasticity, gradient) * 0.1 * 0.02 * 0.03 / 2
    assert u @ structure.K @ u / 2 == pytest.approx(exact, rel=1e-12)


@pytest.mark.parametrize(
    "wrong",
    [{"poisson": (3.9, 0.25, 0.45)}, {"poisson": (0.3, 0.25, 1.2)}, {"shear": (5e9, -4e9, 3e9)}],
)
def test_constants_of_no_solid_are_refused(wrong):
    with pytest.raises(ValueError, match="give no elastic solid"):
        assert PLY._replace(**wrong).elasticity


def test_axes_that_span_no_plane_are_refused():
    with pytest.raises(ValueError, match="two directions that differ"):
        assert PLY._replace(axes=((1, 0, 0), (-2, 0, 0))).elasticity
