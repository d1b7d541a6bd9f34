"""Masses on faces: rigid motions carry them whole, and a free beam with masses at its tips bends as
Euler and Bernoulli have it."""

import numpy as np
import pytest
from scipy.optimize import brentq
from skfem import MeshHex

from beadwave import fem
from beadwave.fem.assembly.joints import rigid_motion
from beadwave.fem.contact.disc_room import room_on_face
from beadwave.fem.modes.mac import body_forms
from beadwave.fem.updating.tuning import CARRIED, TuningParameter, spectrum, tuning_basis

STEEL = fem.Material(210e9, 0.0, 7850.0)  # without Poisson's ratio a thin beam is one of theory
LENGTH, SIDE = 0.5, 0.01
TIP = 0.15  # kg, of 0.39 kg of the beam


def beam(n=24):
    lines = np.linspace(0, LENGTH, n + 1), np.linspace(0, SIDE, 3), np.linspace(0, SIDE, 3)
    mesh = MeshHex.init_tensor(*lines)
    ends = {"left": lambda x: x[0] < 1e-9, "right": lambda x: x[0] > LENGTH - 1e-9}
    return fem.assemble({"beam": mesh.with_boundaries(ends)}, {"beam": STEEL})


def tip(name, face, mass=TIP, **more):
    return fem.CarriedMass(name, f"beam:{face}", (0.0, 0.0), 4e-3, mass, **more)


def test_rigid_motions_have_the_inertia_of_beam_and_masses_about_their_common_place():
    """m (l x)^T (l x) + J of a body at a place l, by hand; exact, as rigid motions are traced."""
    inertia, height = np.array([3e-5, 2e-5, 2.5e-5]), 0.02
    bare = beam(6)
    loaded = fem.with_carried(bare, [tip("a", "right", height=height, inertia=tuple(inertia))])
    R = rigid_motion(bare.points, np.zeros(3))
    added = R.T @ ((loaded.M - bare.M) @ R)
    x, y, z = LENGTH + height, SIDE / 2, SIDE / 2
    lever = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    exact = np.block(
        [[TIP * np.eye(3), -TIP * lever], [TIP * lever, np.diag(inertia) - TIP * lever @ lever]]
    )
    np.testing.assert_allclose(added, exact, atol=1e-12 * TIP)
    assert fem.rigid_body(loaded).mass == pytest.approx(7850 * LENGTH * SIDE**2 + TIP, rel=1e-12)


def test_a_free_beam_with_masses_at_its_tips_bends_at_the_roots_of_the_exact_equation():
    """EI w_xxxx = rho A omega^2 w; at the right end w_xx = 0 and EI w_xxx + m omega^2 w = 0. With
    b = k L and a the mass over the beam's, the symmetric w = A cos kx + B cosh kx and the
    antisymmetric one give a determinant of 2 each. Rotary inertia and shear of a beam of 50
    thicknesses are left out.
    """
    a = TIP / (7850 * LENGTH * SIDE**2)

    def symmetric(b):  # w = A cos(b x / L) + B cosh(b x / L), |x| <= L / 2
        c, C, s, S = np.cos(b / 2), np.cosh(b / 2), np.sin(b / 2), np.sinh(b / 2)
        return (-c) * (S + a * b * C) - C * (s + a * b * c)

    def antisymmetric(b):  # w = A sin + B sinh
        c, C, s, S = np.cos(b / 2), np.cosh(b / 2), np.sin(b / 2), np.sinh(b / 2)
        return (-s) * (C + a * b * S) - S * (-c + a * b * s)

    roots = [brentq(symmetric, 3.2, 4.72), brentq(antisymmetric, 6.0, 7.85)]
    bending = np.sqrt(210e9 * SIDE**2 / 12 / 7850) / LENGTH**2 / (2 * np.pi)
    exact = bending * np.array(roots) ** 2

    structure = fem.with_carried(beam(), [tip("a", "left"), tip("b", "right")])
    model = fem.joined(structure, fem.Connections())
    hz = fem.modes(model.K, model.M, 10).frequency_hz
    assert np.all(hz[:6] < 1e-4 * hz[6])  # rounding of K leaves 5 mHz
    np.testing.assert_allclose(hz[[6, 8]] / exact, 1, atol=6e-3)
    np.testing.assert_allclose(hz[[6, 8]], hz[[7, 9]], rtol=1e-6)  # in both planes of a square
    # without the masses it is the free beam, 29 % and more higher
    bare = fem.joined(beam(), fem.Connections())
    assert fem.modes(bare.K, bare.M, 10).frequency_hz[6] > 1.25 * hz[6]


def test_effective_masses_of_a_free_structure_are_those_of_its_rigid_modes():
    structure = fem.with_carried(beam(6), [tip("a", "left", inertia=(1e-5, 1e-5, 1e-5))])
    model = fem.joined(structure, fem.Connections())
    share = fem.effective_mass(model, fem.modes(model.K, model.M, 9).phi)
    np.testing.assert_allclose(share[:6].sum(axis=0), 1, atol=1e-9)
    np.testing.assert_allclose(share[6:], 0, atol=1e-9)


def test_the_basis_of_a_free_structure_follows_a_mass_without_a_new_solution():
    """The frequencies at 0.7 of the mass against a model that was assembled with that mass."""
    masses = [tip("a", "left"), tip("b", "right")]
    model = fem.joined(fem.with_carried(beam(10), masses), fem.Connections())
    basis = tuning_basis(model, [])
    light = TuningParameter("a", (), 1.0, 0.5, 2.0, (f"{CARRIED}a",), "density")
    trial = spectrum(basis, [light], np.array([0.7])).frequency_hz
    masses[0] = tip("a", "left", 0.7 * TIP)
    other = fem.joined(fem.with_carried(beam(10), masses), fem.Connections())
    np.testing.assert_allclose(
        trial[6:12], fem.modes(other.K, other.M, 12).frequency_hz[6:], rtol=1e-5
    )


def test_a_density_leaves_masses_on_faces_as_they_are():
    model = fem.joined(fem.with_carried(beam(6), [tip("a", "left")]), fem.Connections())
    bare = fem.joined(beam(6), fem.Connections())
    V = np.eye(model.K.shape[0])[:, :3]
    forms = [body_forms(one, "beam", V).M for one in (model, bare)]
    np.testing.assert_allclose(*forms, atol=1e-15)


def test_a_disc_that_leaves_its_face_is_refused():
    wide = fem.CarriedMass("a", "beam:left", (0.003, 0.0), 4e-3, TIP)
    with pytest.raises(ValueError, match=r"that face; the face is 0\.01 x 0\.01 m along y"):
        fem.with_carried(beam(6), [wide])
    with pytest.raises(ValueError, match=r"for it is \[0\.001, 0\.0\]; move it or make it smaller"):
        fem.with_carried(beam(6), [wide])
    with pytest.raises(ValueError, match="where such a disc has no room"):
        fem.with_carried(beam(6), [wide._replace(radius=6e-3)])


def test_the_nearest_place_for_a_disc_beside_a_hole_is_as_far_from_it_as_its_radius():
    """A square of 60 mm without its middle one of 20 mm; the grid of places is 2.2 mm wide."""
    lines = np.linspace(-0.03, 0.03, 13), np.linspace(-0.03, 0.03, 13), [0.0, 0.01]
    mesh = MeshHex.init_tensor(*map(np.asarray, lines))
    middle = np.abs(mesh.p[:2, mesh.t].mean(axis=1)).max(axis=0) < 0.01
    mesh = mesh.remove_elements(np.flatnonzero(middle))
    mesh = mesh.with_boundaries({"top": lambda x: x[2] > 0.01 - 1e-9})
    frame = fem.assemble({"frame": mesh}, {"frame": STEEL})
    clause = room_on_face(frame, "frame:top", (0.002, 0.001), 4e-3)
    place = [float(x) for x in clause.partition("nearest place for it is [")[2][:-1].split(",")]
    assert 0.014 <= max(map(abs, place)) <= 0.014 + 2.2e-3
