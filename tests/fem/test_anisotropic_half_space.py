"""A half-space of any elastic solid: Boussinesq's, published moduli, and what a mesh holds."""

import numpy as np
import pytest
from skfem import MeshHex

from beadwave.fem import (
    Connections,
    HeldFace,
    Material,
    Orthotropic,
    assemble,
    contact_patch,
    factorised,
    half_space_on_mesh,
    indentation_modulus,
    joined,
)
from beadwave.fem.contact.anisotropic_half_space import half_space, surface_force
from beadwave.fem.contact.half_space import boussinesq

STEEL = Material(210e9, 0.3, 7850.0)
PLY = Orthotropic((135e9, 9e9, 9e9), (0.3, 0.3, 0.45), (5e9, 5e9, 3.1e9), 1600.0)
TURNED = PLY._replace(axes=((1, 0.3, 0.2), (0, 1, 0.5)))
TILTED = np.array([1.0, 2.0, 3.0]) / np.sqrt(14)
ALONG, ACROSS = np.eye(3)[:2]


def mean_modulus(material, inward):
    """2 / mean(h) [Pa]: the E / (1 - nu^2) of an isotropic solid on which a round patch under the
    same pressure has the same depth."""
    return float(2 / half_space(material, inward).h.mean())


def test_an_isotropic_solid_has_boussinesqs_field_and_its_own_modulus():
    rng = np.random.default_rng(1)
    points = rng.normal(size=(300, 3))
    points -= 2 * np.outer(np.minimum(points @ TILTED, 0.0), TILTED)
    exact = boussinesq(points, np.zeros((1, 3)), np.ones(1), TILTED, STEEL)
    computed = surface_force(STEEL, TILTED)(points, np.zeros(3))
    off = np.linalg.norm(computed - exact, axis=1) / np.linalg.norm(exact, axis=1)
    assert off.max() < 1e-5  # cubic splines between 32 heights and 96 directions
    for modulus in (mean_modulus, indentation_modulus):
        assert modulus(STEEL, TILTED) / 210e9 * 0.91 == pytest.approx(1.0, rel=1e-12)


def test_on_its_axis_a_transversely_isotropic_solid_has_the_modulus_of_the_literature():
    """Elliott's solution as Delafargue and Ulm write it (Int. J. Solids Struct. 41 (2004) 7351)."""
    C = PLY.elasticity
    c11, c33, c13, c44 = C[1, 1, 1, 1], C[0, 0, 0, 0], C[0, 0, 1, 1], C[0, 1, 1, 0]
    c31 = np.sqrt(c11 * c33)
    published = 2 * np.sqrt((c31**2 - c13**2) / c11 / (1 / c44 + 2 / (c31 + c13)))
    plane = PLY._replace(shear=(5e9, 5e9, 9e9 / 2 / 1.45))  # G23 of isotropy across the fibres
    assert indentation_modulus(plane, ALONG) / published == pytest.approx(1.0, rel=1e-6)


def test_across_the_fibres_the_ellipse_is_stiffer_than_the_round_patch():
    """By the square of what h varies: a half of 1 %. h is 1.5 times as large at its largest."""
    ratio = indentation_modulus(PLY, ACROSS) / mean_modulus(PLY, ACROSS)
    assert 1.002 < ratio < 1.006
    soft = PLY._replace(shear=(5e9, 5e9, 0.31e9))
    assert indentation_modulus(soft, ACROSS) / mean_modulus(soft, ACROSS) > ratio


def block(material, n):
    """A cube held at its base, fine in the middle of its top."""
    fine = np.geomspace(0.0016, 0.03, n)
    x, z = np.concatenate([-fine[::-1], [0], fine]), np.concatenate([-fine[::-1], [0]])
    faces = {"top": lambda x: x[2] > -1e-9, "base": lambda x: x[2] < -0.03 + 1e-9}
    mesh = MeshHex.init_tensor(x, x, z).with_boundaries(faces)
    structure = assemble({"block": mesh}, {"block": material})
    return joined(structure, Connections(held=[HeldFace("block:base")]))


@pytest.mark.slow
def test_compliance_beyond_the_half_space_of_an_orthotropic_block_does_not_depend_on_the_patch():
    """As little as of a block of steel, where the local part alone goes as one over the radius."""
    spread = {}
    for name, material in (("ply", TURNED), ("steel", STEEL)):
        model = block(material, 6)
        factor, left = factorised(model.K), []
        for radius in (1e-3, 4e-3):
            patch = contact_patch(model, "block:top", (0.0, 0.0), radius)
            local = half_space_on_mesh(model, "block:top", patch, material)
            left.append(patch.w @ factor.solve(patch.w) - local)
        spread[name] = abs(left[1] / left[0] - 1)
    assert spread["ply"] < 1.1 * spread["steel"] < 0.01


@pytest.mark.slow
def test_the_meshed_half_space_approaches_that_of_the_mean_modulus():
    exact, error = 0.6 / (mean_modulus(TURNED, np.array([0, 0, -1.0])) * 4e-3), []
    for n in (4, 7):
        model = block(TURNED, n)
        patch = contact_patch(model, "block:top", (0.0, 0.0), 4e-3)
        error.append(abs(half_space_on_mesh(model, "block:top", patch, TURNED) / exact - 1))
    assert error[1] < 0.5 * error[0] and error[1] < 0.006


def test_moduli_that_differ_too_much_are_refused():
    extreme = Orthotropic((500e9, 1e9, 1e9), (0.3, 0.3, 0.3), (0.2e9, 0.2e9, 0.2e9), 1600.0)
    with pytest.raises(ValueError, match=r"known to .* only, allowed is 0.001"):
        surface_force(extreme, ALONG)
