"""Two blocks, one above the other, joined in every way the assembly knows."""

from typing import NamedTuple

import numpy as np
import pytest
from scipy.sparse import csc_matrix
from skfem import MeshHex

from fem import Joint, Material, Table, assemble, full_tie, modes, wires
from fem.constraints import Constraint, eliminated
from fem.joints import distributing, rigid_motion
from fem.modes import Modes, _check

STEEL = Material(210e9, 0.3, 7850.0)
LOWER, UPPER = 0.05, 0.12  # m


class Touching(NamedTuple):
    slave: str = "upper:foot"
    master: str = "lower:top"
    screws: tuple = ("upper:foot",)
    halves: tuple = ("upper:foot",)
    centres: np.ndarray = np.array([[0.0, 0.0, LOWER]])


def blocks(fine=3, coarse=2):
    """A slender block of `fine` elements across on one of `coarse`, unmerged."""
    lower = MeshHex.init_tensor(*2 * [np.linspace(-0.03, 0.03, coarse + 1)], [0, LOWER / 2, LOWER])
    upper = MeshHex.init_tensor(
        *2 * [np.linspace(-0.01, 0.01, fine + 1)], np.linspace(LOWER, UPPER, 4)
    )
    n, m = lower.nelements, upper.nelements
    mesh = MeshHex(
        np.concatenate([lower.p, upper.p], axis=1),
        np.concatenate([lower.t, upper.t + lower.p.shape[1]], axis=1),
    ).with_subdomains({"lower": np.arange(n), "upper": np.arange(n, n + m)})
    of_upper = np.isin(mesh.f2t[0], mesh.subdomains["upper"])
    z = mesh.p[2, mesh.facets].mean(axis=0)
    on_joint = np.abs(z - LOWER) < 1e-9
    faces = {
        "upper:foot": np.flatnonzero(on_joint & of_upper),
        "lower:top": np.flatnonzero(on_joint & ~of_upper & (mesh.f2t[1] == -1)),
        "lower:base": np.flatnonzero(np.abs(z) < 1e-9),
    }
    return assemble(mesh.with_boundaries(faces), {"lower": STEEL, "upper": STEEL})


@pytest.fixture(scope="module")
def structure():
    return blocks()


def springs(structure, k, held=("lower:base",)):
    return wires(structure, [Touching()], held, {"lower": k})


def frequencies(model, n=4):
    return modes(model.K, model.M, n).frequency_hz


def test_coupling_means_of_a_rigid_motion_are_that_motion():
    rng = np.random.default_rng(1)
    points, weights, centre = rng.normal(size=(20, 3)), rng.uniform(1, 2, 20), np.ones(3)
    C = distributing(points, weights, centre)
    np.testing.assert_allclose(C @ rigid_motion(points, centre), np.eye(6), atol=1e-13)


def test_a_rigid_motion_costs_a_joint_no_energy(structure):
    model = springs(structure, Joint(1e9, 1e9, 1e9, 1e5, 1e5, 1e5), held=())
    found = modes(model.K, model.M, 7, shift_hz=100.0)
    # the shift's factorisation resolves zero to about 1e-9 of the first elastic eigenvalue
    assert np.all(found.omega[:6] ** 2 < 1e-6 * found.omega[6] ** 2)


def test_a_joint_of_no_stiffness_leaves_two_free_bodies(structure):
    model = springs(structure, Joint(0, 0, 0, 0, 0, 0))
    omega2 = modes(model.K, model.M, 7, shift_hz=100.0).omega ** 2
    assert np.all(omega2[:6] < 1e-6 * omega2[6])
    model = springs(structure, Joint(0, 0, 0, 0, 0, 0), held=())
    omega2 = modes(model.K, model.M, 13, shift_hz=100.0).omega ** 2
    assert np.all(omega2[:12] < 1e-6 * omega2[12])


def test_stiff_joints_approach_the_rigid_one_like_one_over_k(structure):
    rigid = frequencies(springs(structure, Joint()))

    def error(k):
        soft = frequencies(springs(structure, Joint(*3 * [k], *3 * [k * 1e-4])))
        return np.abs(soft / rigid - 1).max()

    errors = [error(k) for k in (1e12, 1e13, 1e14)]
    assert errors[0] / errors[1] == pytest.approx(10, rel=0.05)
    assert errors[1] / errors[2] == pytest.approx(10, rel=0.05)
    assert error(1e16) < 1e-6


def test_frequencies_rise_with_stiffness_over_sixteen_decades(structure):
    k = 10.0 ** np.arange(0, 17, 2)
    f = np.array([frequencies(springs(structure, Joint(kx=x)))[:2] for x in k])
    assert np.all(np.diff(f, axis=0) > -1e-9 * f[1:])


def test_sensitivity_to_a_stiffness_is_the_squared_elongation(structure):
    def omega2(k):
        model = springs(structure, Joint(kx=k))
        found = modes(model.K, model.M, 2)
        return found.omega**2, found.phi[model.elongation[0]] ** 2

    k, h = 1e8, 1e3
    numeric = (omega2(k + h)[0] - omega2(k - h)[0]) / (2 * h)
    np.testing.assert_allclose(numeric, omega2(k)[1], rtol=1e-5, atol=1e-9)


def test_a_tie_between_meshes_that_match_is_the_merged_mesh():
    # the same prism cut in two, and in one piece
    z = np.linspace(0, UPPER, 7)
    line = np.linspace(-0.01, 0.01, 4)
    whole = MeshHex.init_tensor(line, line, z)
    base = {"whole:base": lambda x: np.abs(x[2]) < 1e-9}
    whole = whole.with_subdomains({"whole": np.arange(whole.nelements)}).with_boundaries(base)
    single = full_tie(assemble(whole, {"whole": STEEL}), [], ["whole:base"])

    lower, upper = (MeshHex.init_tensor(line, line, part) for part in (z[:4], z[3:]))
    n = lower.nelements
    cut = MeshHex(
        np.concatenate([lower.p, upper.p], axis=1),
        np.concatenate([lower.t, upper.t + lower.p.shape[1]], axis=1),
    ).with_subdomains({"lower": np.arange(n), "upper": np.arange(n, 2 * n)})
    middle = np.flatnonzero(np.abs(cut.p[2, cut.facets].mean(axis=0) - z[3]) < 1e-9)
    owner = cut.f2t[0, middle] < n
    cut = cut.with_boundaries(
        {
            "lower:top": middle[owner],
            "upper:foot": middle[~owner],
            "lower:base": lambda x: np.abs(x[2]) < 1e-9,
        }
    )
    tied = full_tie(assemble(cut, {"lower": STEEL, "upper": STEEL}), [Touching()], ["lower:base"])
    np.testing.assert_allclose(frequencies(tied), frequencies(single), rtol=1e-9)


def test_constraints_in_a_circle_are_refused():
    def follow(slave, master):
        A = np.zeros((1, 3))
        A[0, master] = 1.0
        return Constraint(np.array([slave]), A)

    from scipy.sparse import csr_matrix

    circle = [Constraint(c.slaves, csr_matrix(c.A)) for c in (follow(0, 1), follow(1, 0))]
    with pytest.raises(ValueError, match="circle"):
        eliminated(3, circle, np.empty(0, int))
    twice = [Constraint(c.slaves, csr_matrix(c.A)) for c in (follow(0, 1), follow(0, 2))]
    with pytest.raises(ValueError, match="slave of two"):
        eliminated(3, twice, np.empty(0, int))


def test_a_stiff_pair_of_blocks_sways_with_its_table_at_the_table_s_frequency(structure):
    table = Table(frequency_hz=6.5, mass=2.0)
    on_table = full_tie(structure, [Touching()], ["lower:base"], table=table)
    found = modes(on_table.K, on_table.M, 3, shift_hz=1.0)
    np.testing.assert_allclose(found.frequency_hz[:2], 6.5, rtol=1e-4)
    assert found.frequency_hz[2] > 500
    heavy = full_tie(structure, [Touching()], ["lower:base"], table=table._replace(mass=1e6))
    held = full_tie(structure, [Touching()], ["lower:base"])
    swaying = modes(heavy.K, heavy.M, 6, shift_hz=1.0).frequency_hz[2:]
    np.testing.assert_allclose(swaying, frequencies(held), rtol=1e-4)


def test_a_mode_that_rounding_has_turned_is_refused_with_what_to_do():
    """Two modes of 1 and 9 Hz turned into one another by 0.1 rad: K phi is off by tenths."""
    K = csc_matrix(np.diag((2 * np.pi * np.array([1.0, 9.0])) ** 2))
    turned = np.array([[np.cos(0.1), -np.sin(0.1)], [np.sin(0.1), np.cos(0.1)]])
    found = Modes(np.sqrt(K.diagonal()), turned)
    with pytest.raises(ValueError, match=r"lost in the rounding of K .*stiffen the softest joints"):
        _check(found, K, csc_matrix(np.eye(2)), -((2 * np.pi * 5.0) ** 2))
    _check(found._replace(phi=np.eye(2)), K, csc_matrix(np.eye(2)), -((2 * np.pi * 5.0) ** 2))
