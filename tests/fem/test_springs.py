"""Springs between points: rigid motions elongate them as by hand, a box on cords has the six modes
of a rigid body, and statics are those of springs in series."""

import numpy as np
import pytest
from scipy.linalg import eigh
from skfem import MeshHex

from beadwave import fem
from beadwave.fem.assembly.joints import rigid_motion
from beadwave.fem.modes.mac import SPRINGS, strained
from beadwave.fem.updating.tuning import TuningParameter, spectrum, tuning_basis

STEEL = fem.Material(210e9, 0.3, 7850.0)
SIDES = np.array([0.3, 0.2, 0.05])
CORDS = [(0.12, 0.07), (-0.12, 0.07), (-0.12, -0.08), (0.11, -0.08)]
K_CORD = np.diag([800.0, 900.0, 4000.0])


def box(middle=(0.0, 0.0, 0.0), n=(6, 4, 2), sides=SIDES):
    lines = [np.linspace(-side / 2, side / 2, m + 1) for side, m in zip(sides, n, strict=True)]
    faces = {
        f"{sign}{axis}": (lambda x, i=i, s=s: s * x[i] > sides[i] / 2 - 1e-9)
        for i, axis in enumerate("xyz")
        for s, sign in ((1, "+"), (-1, "-"))
    }
    return MeshHex.init_tensor(*lines).with_boundaries(faces).translated(middle)


def on_cords(structure, factor=1.0, dashpot=0.0):
    springs = [
        fem.PointSpring(
            f"cord.k{axis}", fem.SpringEnd("box:+z", at, 0.01), None, factor * k, e, dashpot
        )
        for at in CORDS
        for axis, k, e in zip("xyz", np.diag(K_CORD), np.eye(3), strict=True)
    ]
    return fem.with_springs(structure, springs)


def suspended(factor=1.0):
    return fem.joined(on_cords(fem.assemble({"box": box()}, {"box": STEEL}), factor), LOOSE)


LOOSE = fem.Connections()


def rigid_matrices(factor=1.0):
    """K and M (6, 6) of a rigid box on the cords about its centre of mass, by hand."""
    (a, b, c), m = SIDES, 7850 * SIDES.prod()
    inertia = m / 12 * np.array([b * b + c * c, a * a + c * c, a * a + b * b])
    K = np.zeros((6, 6))
    for x, y in CORDS:
        z = c / 2
        moved = np.hstack([np.eye(3), [[0, z, -y], [-z, 0, x], [y, -x, 0]]])
        K += factor * moved.T @ K_CORD @ moved
    return K, np.diag([m] * 3 + list(inertia))


def test_rigid_motions_elongate_cords_as_by_hand():
    model = suspended()
    R = rigid_motion(model.structure.points, np.zeros(3))
    K, M = rigid_matrices()
    np.testing.assert_allclose(R.T @ (model.K @ R), K, rtol=1e-7, atol=1e-6 * K.max())
    np.testing.assert_allclose(R.T @ (model.M @ R), M, rtol=1e-10, atol=1e-12)
    # what the structure itself has does not know of them
    assert fem.rigid_body(model.structure).grounding < 1e-12


def test_a_box_on_four_cords_has_the_six_modes_of_a_rigid_body():
    """Elasticity lowers them by 2e-6: the corners' compliance beside the cords'."""
    model = suspended()
    omega = fem.modes(model.K, model.M, 12).omega
    exact = np.sqrt(eigh(*rigid_matrices(), eigvals_only=True))
    np.testing.assert_allclose(omega[:6], exact, rtol=1e-5)


def test_stiffer_cords_shift_elastic_modes_by_the_energy_that_they_take():
    """d omega^2 = phi^T B^T k B phi to first order (Rayleigh); cords a hundred times as stiff move
    the first bending mode by 3e-4."""
    free = fem.joined(fem.assemble({"box": box()}, {"box": STEEL}), LOOSE)
    before = fem.modes(free.K, free.M, 10)
    stiff = suspended(100.0)
    after = fem.modes(stiff.K, stiff.M, 10)
    u = free.T @ before.phi[:, 6:8]
    energy = sum(s.stiffness * np.sum((s.B @ u) ** 2, axis=0) for s in stiff.structure.springs)
    shift = after.omega[6:8] ** 2 - before.omega[6:8] ** 2
    assert np.all(shift / before.omega[6:8] ** 2 > 1e-5)
    np.testing.assert_allclose(shift, energy, rtol=2e-2)


def test_a_spring_in_series_adds_its_compliance_and_nothing_else():
    """A bar on one axial spring at its far end, guided across: u = F / k + what the bar gives. Of
    two stiffnesses the difference is 1 / k_1 - 1 / k_2, exactly."""
    sides = np.array([0.2, 0.02, 0.02])
    bar = fem.assemble({"bar": box(n=(8, 2, 2), sides=sides)}, {"bar": STEEL})
    held = [fem.HeldFace("bar:-y", "y"), fem.HeldFace("bar:-z", "z")]
    end = fem.SpringEnd("bar:+x", (0.0, 0.0), 0.005)
    compliance = []
    for k in (1e5, 3e5):
        spring = fem.PointSpring("far.k", end, None, k, "normal")
        model = fem.joined(fem.with_springs(bar, [spring]), fem.Connections(held=held))
        w = fem.contact_patch(model, "bar:-x", (0.0, 0.0), 0.005).w
        compliance.append(w @ fem.factorised(model.K).solve(w))
    assert compliance[0] - compliance[1] == pytest.approx(1 / 1e5 - 1 / 3e5, rel=1e-9)
    assert 0 < compliance[0] - 1e-5 < 2e-8  # the bar's own, L / EA = 2.4e-9, and the dents


@pytest.mark.parametrize("direction", [None, np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 2.0])])
def test_no_rigid_motion_of_both_bodies_elongates_what_is_between_them(direction):
    far = box((0.5, 0.03, 0.02))
    both = fem.assemble({"a": box(), "b": far}, {"a": STEEL, "b": STEEL})
    ends = fem.SpringEnd("a:+x", (0.02, 0.01), 0.008), fem.SpringEnd("b:-x", (0.05, 0.0), 0.008)
    spring = fem.PointSpring("s.k", *ends, 1e4, direction)
    (one,) = fem.with_springs(both, [spring]).springs
    R = rigid_motion(both.points, np.array([0.1, 0.2, 0.3]))
    # next to the terms of the sum, of up to 31 here
    assert np.abs(one.B @ R).max() < 1e-12 * (abs(one.B) @ np.abs(R)).max()
    # a shift of one of them alone does
    alone = R[:, :3].copy()
    alone[both.dofs("b")] = 0.0
    assert np.linalg.norm(one.B @ alone) == pytest.approx(1.0, rel=1e-9)


def test_two_free_boxes_on_a_spring_swing_against_each_other():
    """omega^2 = k (1 / m_1 + 1 / m_2), the spring on the line through both centres."""
    meshes = {"a": box(), "b": box((0.5, 0.0, 0.0), sides=np.array([0.1, 0.2, 0.05]))}
    both = fem.assemble(meshes, dict.fromkeys(meshes, STEEL))
    ends = (fem.SpringEnd(face, at, 0.008) for face, at in (("a:+x", (0.0, 0.0)), ("b:-x", None)))
    model = fem.joined(fem.with_springs(both, [fem.PointSpring("s.k", *ends, 1e5, None)]), LOOSE)
    hz = fem.modes(model.K, model.M, 14).frequency_hz
    masses = 7850 * SIDES.prod() * np.array([1, 1 / 3])
    exact = np.sqrt(1e5 * np.sum(1 / masses)) / (2 * np.pi)
    assert np.min(np.abs(hz / exact - 1)) < 3e-5
    assert np.count_nonzero(hz > 1.0) == 3  # this one, and two that bend


def test_dashpots_take_power_as_by_hand():
    structure = on_cords(fem.assemble({"box": box()}, {"box": STEEL}), dashpot=2.0)
    model = fem.joined(structure, LOOSE)
    C, R = fem.dashpots(model, {}), rigid_motion(structure.points, np.zeros(3))
    translations = (R.T @ (C @ R))[:3, :3]
    np.testing.assert_allclose(translations, 4 * 2.0 * np.eye(3), atol=1e-9)


def test_the_basis_follows_stiffer_cords_without_a_new_solution():
    basis = tuning_basis(suspended(), [])
    names = tuple(name for name in basis.forms if name.startswith(SPRINGS))
    assert len(names) == 3
    scaled = TuningParameter("cords", (), 1.0, 0.1, 10.0, names, "young")
    trial = spectrum(basis, [scaled], np.array([4.0])).frequency_hz
    other = suspended(4.0)
    np.testing.assert_allclose(trial[:10], fem.modes(other.K, other.M, 10).frequency_hz, rtol=1e-6)


def test_numbers_count_modes_that_strain_the_box_and_not_those_of_its_cords():
    model = suspended()
    computed = fem.modes(model.K, model.M, 10)
    targets = [fem.Number(1), fem.Number(2)]
    assert fem.pair(model, computed, targets).index.tolist() == [6, 7]
    assert strained(model, computed).tolist() == [False] * 6 + [True] * 4


def test_a_body_on_springs_in_all_directions_is_kept_and_one_on_a_single_spring_is_not():
    structure = fem.assemble({"box": box(), "b": box((0.0, 0.0, 0.2))}, {"box": STEEL, "b": STEEL})
    hung = on_cords(structure)
    assert [loose.body for loose in fem.loose_bodies(hung, LOOSE)] == ["b"]
    ends = fem.SpringEnd("box:+z", (0.0, 0.0), 0.01), fem.SpringEnd("b:-z", None, 0.01)
    one = fem.with_springs(hung, [fem.PointSpring("s.k", *ends, 1e4, None)])
    (loose,) = fem.loose_bodies(one, LOOSE)
    assert loose.body == "b" and "z" not in loose.motions and {"x", "y"} <= set(loose.motions)


def test_a_disc_that_leaves_its_face_and_ends_at_one_point_are_refused():
    structure = fem.assemble({"box": box()}, {"box": STEEL})
    out = fem.SpringEnd("box:+z", (0.148, 0.0), 0.01)
    with pytest.raises(ValueError, match=r"nearest place for it is .*; move it or make it smaller"):
        fem.with_springs(structure, [fem.PointSpring("s.k", out, None, 1e3, "normal")])
    end = fem.SpringEnd("box:+z", (0.0, 0.0), 0.01)
    with pytest.raises(ValueError, match="both ends lie at"):
        fem.with_springs(structure, [fem.PointSpring("s.k", end, end, 1e3, None)])
