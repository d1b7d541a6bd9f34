"""Receptances of parts joined, against the matrices of the whole."""

import numpy as np
import pytest
from skfem import FacetBasis, LinearForm, MeshHex

from beadwave import fem, rom

YOUNG, DENSITY, LOSS = 210e9, 7850.0, 0.01
WIDTH, THICKNESS = 0.02, 0.01
HZ = np.array([100.0])


def bending_receptance(length, clamped, n=60):
    """Euler and Bernoulli's beam of n cubic elements: (1, 4, 4) at w, theta of both ends, (1, 2, 2)
    at w, theta of the second end if the first is clamped. H at 100 Hz is right to 1e-9."""
    h, A, I = length / n, WIDTH * THICKNESS, WIDTH * THICKNESS**3 / 12
    k = [[12, 6 * h, -12, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2],
         [-12, -6 * h, 12, -6 * h], [6 * h, 2 * h**2, -6 * h, 4 * h**2]]  # fmt: skip
    m = [[156, 22 * h, 54, -13 * h], [22 * h, 4 * h**2, 13 * h, -3 * h**2],
         [54, 13 * h, 156, -22 * h], [-13 * h, -3 * h**2, -22 * h, 4 * h**2]]  # fmt: skip
    D = np.zeros((2 * n + 2, 2 * n + 2), complex)
    omega = 2 * np.pi * HZ[0]
    for e in range(n):
        part = slice(2 * e, 2 * e + 4)
        D[part, part] += YOUNG * (1 + 1j * LOSS) * I / h**3 * np.array(k)
        D[part, part] -= omega**2 * DENSITY * A * h / 420 * np.array(m)
    ends = [2 * n, 2 * n + 1] if clamped else [0, 1, 2 * n, 2 * n + 1]
    first = 2 if clamped else 0
    H = np.linalg.inv(D[first:, first:])
    return H[np.ix_(np.array(ends) - first, np.array(ends) - first)][None]


def beams():
    """A clamped 0.4 m, B free 0.3 m, and their interface in w and theta."""
    parts = bending_receptance(0.4, True), bending_receptance(0.3, False)
    return parts, rom.compatibility((2, 4), [((0, 0), (1, 0)), ((0, 1), (1, 1))])


@pytest.mark.parametrize(
    ("turning", "size", "degrees"),
    [(np.inf, 5.69436e-5, -5.256), (2000.0, 4.76908e-5, -178.887)],
)
def test_joined_beams_have_the_tip_receptance_of_the_whole(turning, size, degrees):
    """The numbers are of independent dynamic stiffness matrices, to the digits shown."""
    parts, B = beams()
    Y = rom.joint_receptance(HZ, [np.inf, turning])
    tip = rom.joined_receptance(parts, B, Y)[0, 4, 4]
    assert abs(abs(tip) / size - 1) < 1e-6
    assert abs(np.degrees(np.angle(tip)) - degrees) < 5e-4


def test_a_rigid_joint_moves_as_one_and_receptances_stay_symmetric():
    parts, B = beams()
    H = rom.joined_receptance(parts, B)[0]
    assert np.abs(B @ H).max() < 1e-9 * np.abs(H).max()
    assert np.abs(H - H.T).max() < 1e-8 * np.abs(H).max()


def test_three_masses_on_springs_and_a_dashpot_are_their_matrices():
    """Substructures 0, 1, 2 are masses, 0 on a spring to the ground, joined in a row."""
    f = np.array([3.0, 11.0, 40.0])
    w, m, k, c = 2 * np.pi * f, np.array([2.0, 0.7, 1.1]), np.array([900.0, 4e3]), 15.0
    parts = [1 / (5e3 - m[0] * w**2), -1 / (m[1] * w**2), -1 / (m[2] * w**2)]
    B = rom.compatibility((1, 1, 1), [((0, 0), (1, 0)), ((1, 0), (2, 0))])
    H = rom.joined_receptance(
        [part[:, None, None] for part in parts], B, rom.joint_receptance(f, k, [0.0, c])
    )
    for i in range(len(f)):
        a, b = k[0], k[1] + 1j * w[i] * c
        D = np.array([[5e3 + a, -a, 0], [-a, a + b, -b], [0, -b, b]]) - np.diag(m * w[i] ** 2)
        assert np.abs(H[i] @ D - np.eye(3)).max() < 1e-11


@pytest.mark.parametrize(
    ("Y", "B", "sentence"),
    [
        (None, np.array([[1.0, -1.0], [2.0, -2.0]]), "repeat each other"),
        (None, np.ones((1, 3)), "do not fit B"),
    ],
)
def test_interfaces_that_are_none_are_refused(Y, B, sentence):
    part = np.ones((1, 1, 1), complex)
    with pytest.raises(rom.ReductionError, match=sentence):
        rom.joined_receptance([part, 2 * part], B, Y)


def test_a_joint_without_stiffness_is_refused():
    with pytest.raises(rom.ReductionError, match="carries no force"):
        rom.joint_receptance(HZ, [0.0])


def solid_receptance(length, clamped):
    """The beam as hexahedra: mean u_z and mean turn of the end faces, (1, m, m)."""
    mesh = MeshHex.init_tensor(
        np.linspace(0, length, round(length / 0.0125) + 1),
        np.linspace(-WIDTH / 2, WIDTH / 2, 3),
        np.linspace(-THICKNESS / 2, THICKNESS / 2, 3),
    ).with_boundaries({"near": lambda x: x[0] == 0.0, "far": lambda x: np.isclose(x[0], length)})
    structure = fem.assemble({"beam": mesh}, {"beam": fem.Material(YOUNG, 0.3, DENSITY)})
    held = [fem.HeldFace("beam:near")] if clamped else []
    model = fem.joined(structure, fem.Connections(held=held))

    # w = 1/A int u_z, theta = -1/I int z u_x
    second_moment = WIDTH * THICKNESS**3 / 12
    columns = []
    for face in ("far",) if clamped else ("near", "far"):
        b = FacetBasis(mesh, structure.basis["beam"].elem, facets=mesh.boundaries[face])
        mean = LinearForm(lambda v, w: v[2] / (WIDTH * THICKNESS)).assemble(b)
        turn = LinearForm(lambda v, w: -w.x[2] * v[0] / second_moment).assemble(b)
        columns += [model.T.T @ mean, model.T.T @ turn]
    W = np.array(columns).T
    D = model.K * (1 + 1j * LOSS) - (2 * np.pi * HZ[0]) ** 2 * model.M
    return (W.T @ fem.factorised(D.tocsc()).solve(W.astype(complex)))[None]


def test_joined_solids_are_the_whole_solid_and_timoshenkos_beam_within_its_theory():
    """Means of the interface alone are joined: 1e-3 of the whole solid.

    A clamped root stiffens a solid against the theory by about 0.3 nu of its thickness, 0.15 % of
    the length, its frequencies by twice this: 0.6 % of the square. The resonance is at 107 Hz, so
    that H at 100 Hz is 0.6 % / (1 - (100 / 107)^2) = 4.7 % off.
    """
    B = rom.compatibility((2, 4), [((0, 0), (1, 0)), ((0, 1), (1, 1))])
    parts = solid_receptance(0.4, True), solid_receptance(0.3, False)
    tip = rom.joined_receptance(parts, B)[0, 4, 4]
    assert abs(tip / solid_receptance(0.7, True)[0, 0, 0] - 1) < 1e-5

    material = fem.Material(YOUNG, 0.3, DENSITY)
    ends = fem.ENDS["clamped"], fem.ENDS["free"]
    whole = fem.beam(0.7, fem.rectangle(WIDTH, THICKNESS, 0.3), material, ends, 0.7)
    theory = fem.receptance(whole.K, whole.M, whole.patch.w, HZ, loss_factor=LOSS)[0]
    assert abs(tip / theory - 1) < 0.06
