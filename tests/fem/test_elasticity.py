import pickle

import numpy as np
import pytest
from skfem import BilinearForm, MeshHex, MeshTet, asm
from skfem.helpers import dot
from skfem.models.elasticity import linear_elasticity

from beadwave.fem import Material, assemble
from beadwave.fem.assembly.joints import rigid_motion

STEEL = Material(210e9, 0.3, 7850.0)


def bar(kind):
    lines = (np.linspace(0, 0.1, 4), np.linspace(0, 0.02, 3), np.linspace(0, 0.03, 2))
    return {"bar": kind.init_tensor(*lines)}


@pytest.fixture(params=[MeshHex, MeshTet])
def structure(request):
    return assemble(bar(request.param), {"bar": STEEL})


def test_the_element_integrals_are_those_of_the_weak_form(structure):
    bar = structure.basis["bar"]
    order = 5 if isinstance(bar.mesh, MeshHex) else 4
    basis = bar.__class__(bar.mesh, bar.elem, intorder=order)
    K = asm(linear_elasticity(*STEEL.lame), basis)
    M = asm(BilinearForm(lambda u, v, _: STEEL.density * dot(u, v)), basis)
    assert abs(structure.K - K).max() < 1e-12 * abs(K).max()
    assert abs(structure.M - M).max() < 1e-12 * abs(M).max()


def test_a_rigid_motion_costs_no_energy_and_carries_the_mass(structure):
    R = rigid_motion(structure.points, np.zeros(3))
    assert np.abs(structure.K @ R).max() < 1e-9 * abs(structure.K).max()
    mass = STEEL.density * 0.1 * 0.02 * 0.03
    np.testing.assert_allclose(np.diag(R.T @ structure.M @ R)[:3], mass, rtol=1e-12)
    Ixx = mass * (0.02**2 + 0.03**2) / 3
    assert (R.T @ structure.M @ R)[3, 3] == pytest.approx(Ixx, rel=1e-12)


def test_uniform_stretch_has_its_exact_energy(structure):
    u = (structure.points * [1e-3, -0.3e-3, -0.3e-3]).ravel()
    exact = 0.5 * STEEL.young * 1e-6 * 0.1 * 0.02 * 0.03
    assert 0.5 * u @ structure.K @ u == pytest.approx(exact, rel=1e-12)


def test_a_body_without_material_is_named():
    with pytest.raises(ValueError, match=r"no material for \['bar'\]"):
        assemble(bar(MeshHex), {})


def test_a_structure_holds_no_shape_functions_of_its_elements(structure):
    """At one point of each they take nine tenths of what a basis holds."""
    kept = structure.basis["bar"]
    whole = kept.__class__(kept.mesh, kept.elem, intorder=1)
    assert len(pickle.dumps(kept)) < 0.3 * len(pickle.dumps(whole))
