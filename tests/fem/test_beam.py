"""Timoshenko's beam on a line against its closed forms and its transfer matrix."""

import numpy as np
import pytest
from scipy.linalg import expm

from beadwave import fem
from beadwave.fem.bending.beam import ORDER
from beadwave.fem.modes.mac import RIGID as STILL

STEEL = fem.Material(210e9, 0.3, 7850.0)
HINGED, CLAMPED, FREE = (fem.ENDS[name] for name in ("hinged", "clamped", "free"))
SECTION = fem.rectangle(0.02, 0.012, 0.3)
LENGTH = 0.4


def stiffnesses(section, material=STEEL):
    """kappa G A and E I."""
    shear = section.shear_factor * material.young / (2 * (1 + material.poisson)) * section.area
    return shear, material.young * section.second_moment


def hinged_omega(section, length, force, n):
    """w = sin k x: the lower root of (kGA + N) k^2 - rho A s, kGA k, EI k^2 + kGA - rho I s."""
    k, (kGA, EI) = np.arange(1, n + 1) * np.pi / length, stiffnesses(section)
    rho_A, rho_I = STEEL.density * section.area, STEEL.density * section.second_moment
    p, q = (kGA + force) * k**2 / rho_A, (EI * k**2 + kGA) / rho_I
    return np.sqrt((p + q) / 2 - np.sqrt((p - q) ** 2 / 4 + (kGA * k) ** 2 / (rho_A * rho_I)))


def buckling_load(section, length):
    """Engesser's."""
    kGA, EI = stiffnesses(section)
    euler = np.pi**2 * EI / length**2
    return euler / (1 + euler / kGA)


def omega(beam, n):
    return fem.modes(beam.K, beam.M, n).omega


@pytest.mark.parametrize("share", [0.0, -0.9, 3.0])
@pytest.mark.parametrize("thickness", [0.004, 0.04])
def test_ten_modes_of_a_hinged_beam_are_those_of_the_closed_form(share, thickness):
    section = fem.rectangle(0.02, thickness, 0.3)
    force = share * buckling_load(section, LENGTH)
    beam = fem.beam(LENGTH, section, STEEL, (HINGED, HINGED), 0.13, axial_force=force)
    exact = hinged_omega(section, LENGTH, force, 10)
    # 5e-9: what the elements leave; rounding, eps of the highest eigenvalue, moves that by 2e-10
    assert np.abs(omega(beam, 10) / exact - 1).max() < 1e-7


def test_the_first_frequency_is_zero_at_engessers_load():
    """Its square falls linearly with the force, at 1 - 1e-8 of the load to a hundred-millionth."""
    section, last = fem.rectangle(0.02, 0.06, 0.3), 1 - 1e-8
    load = buckling_load(section, LENGTH)
    at_rest = fem.beam(LENGTH, section, STEEL, (HINGED, HINGED), 0.2)
    pressed = fem.beam(LENGTH, section, STEEL, (HINGED, HINGED), 0.2, axial_force=-last * load)
    assert abs(pressed.load_factor - last) < 1e-10
    K = pressed.K.toarray()
    lowest, highest = np.linalg.eigvalsh(K)[[0, -1]]
    assert 0 < lowest < 1e-7 * np.linalg.eigvalsh(at_rest.K.toarray())[0] < 1e-7 * highest
    with pytest.raises(fem.Buckled, match="of the buckling load of"):
        fem.beam(LENGTH, section, STEEL, (HINGED, HINGED), 0.2, axial_force=-1.00000001 * load)


BUCKLING = {(HINGED, HINGED): 1.0, (CLAMPED, CLAMPED): 0.5, (CLAMPED, FREE): 2.0}


@pytest.mark.parametrize("ends", BUCKLING)
def test_a_slender_beam_buckles_at_eulers_load_of_its_ends(ends):
    slender, euler = fem.rectangle(0.02, 0.001, 0.3), BUCKLING[ends]
    load = buckling_load(slender, euler * LENGTH)
    beam = fem.beam(LENGTH, slender, STEEL, ends, 0.1, axial_force=-load / 2)
    # what the elements leave, 3e-9; rounding, eps of the highest eigenvalue, moves that by 4e-10
    assert abs(beam.load_factor - 0.5) < 1e-7


SPRINGS = fem.BeamEnd(3e6, 200.0)
SECTIONS = (SECTION, fem.tube(0.03, 0.02, 0.3), fem.section(3e-4, 4e-9, 0.6))


@pytest.mark.parametrize("section", SECTIONS)
@pytest.mark.parametrize(
    "ends", [(CLAMPED, FREE), (FREE, FREE), (CLAMPED, HINGED), (SPRINGS, HINGED), (FREE, SPRINGS)]
)
def test_modes_are_roots_of_the_transfer_matrix(ends, section):
    """Of w, theta, M, V; the determinant changes its sign within 1e-7 of each frequency."""
    force = 0.0 if ends == (FREE, FREE) else 2e4
    beam = fem.beam(LENGTH, section, STEEL, ends, 0.21, axial_force=force)
    for computed in [w for w in omega(beam, 6) if w > 1.0]:
        signs = [
            np.sign(determinant(ends, section, force, computed * f)) for f in (1 - 1e-7, 1 + 1e-7)
        ]
        assert signs[0] == -signs[1] != 0, computed


def determinant(ends, section, force, s):
    (kGA, EI), rho = stiffnesses(section), STEEL.density
    A = np.zeros((4, 4))
    A[0, 1], A[0, 3] = kGA / (kGA + force), 1 / (kGA + force)  # V = kGA (w' - theta) + N w'
    A[1, 2] = 1 / EI
    A[2] = -kGA * A[0]
    A[2, 1] += kGA - rho * section.second_moment * s**2
    A[3, 0] = -rho * section.area * s**2
    scale = np.array([LENGTH, 1.0, EI / LENGTH, EI / LENGTH**2])
    through = np.eye(4)
    for _ in range(64):
        through = expm(LENGTH / 64 * A * scale / scale[:, None]) @ through
    left, right = (motions(end, side, scale) for end, side in zip(ends, (1, -1), strict=True))
    return np.linalg.det(right @ through @ np.linalg.svd(left)[2][2:].T)


def motions(end, side, scale):
    """Rows (2, 4) that vanish: V = k w and M = -c theta on the left, the other way on the right."""
    rows = np.array([[end.shift, 0, 0, -side], [0, end.turn, side * -1, 0]])
    for row, stiffness, place in zip(rows, end, (0, 1), strict=True):
        if np.isinf(stiffness):
            row[:] = np.arange(4) == place
    rows = rows * scale
    return rows / np.linalg.norm(rows, axis=1)[:, None]


RIGID = STEEL._replace(poisson=0.0)  # whose sections do not bulge
STATIC = {
    ((CLAMPED, FREE), 0.3): lambda kGA, EI: 0.3**3 / (3 * EI) + 0.3 / kGA,
    ((HINGED, HINGED), 0.2): lambda kGA, EI: LENGTH**3 / (48 * EI) + LENGTH / (4 * kGA),
    ((CLAMPED, CLAMPED), 0.2): lambda kGA, EI: LENGTH**3 / (192 * EI) + LENGTH / (4 * kGA),
    ((fem.BeamEnd(1e6, 0.0), fem.BeamEnd(3e6, 0.0)), 0.1): lambda kGA, EI: (
        (3 / 4) ** 2 / 1e6
        + (1 / 4) ** 2 / 3e6
        + 3 * LENGTH**3 / (256 * EI)
        + 3 * LENGTH / (16 * kGA)
    ),
}


@pytest.mark.parametrize(("ends", "at"), STATIC)
def test_the_static_deflection_is_that_of_the_textbook(ends, at):
    beam = fem.beam(LENGTH, SECTION, RIGID, ends, at)
    compliance = beam.patch.w @ fem.factorised(beam.K).solve(beam.patch.w)
    assert abs(compliance / STATIC[ends, at](*stiffnesses(SECTION, RIGID)) - 1) < 1e-9


def test_the_surface_bulges_where_the_section_bends():
    """Read and loaded at two points whose mean deflection is nu (2 h^2 + b^2) / 24 times the
    curvature less:
    Maxwell's influence function of a hinged beam between them."""
    p, squares = 0.17, (2 * SECTION.thickness**2 + SECTION.width**2) / 12
    aside = np.sqrt(STEEL.poisson * squares)
    beam = fem.beam(LENGTH, SECTION, STEEL, (HINGED, HINGED), p)
    computed = beam.patch.w @ fem.factorised(beam.K).solve(beam.patch.w)
    kGA, EI = stiffnesses(SECTION)

    def influence(a, b):
        a, c = min(a, b), LENGTH - max(a, b)
        bent = a * c * (LENGTH**2 - c**2 - a**2) / (6 * EI * LENGTH)
        return bent + a * c / (LENGTH * kGA)

    places = (p - aside, p + aside)
    assert abs(computed / np.mean([influence(a, b) for a in places for b in places]) - 1) < 1e-9
    curvature = p * (LENGTH - p) / (LENGTH * EI)
    bulge = STEEL.poisson * squares / 2 * curvature
    shear_less = influence(p, p) - computed - 2 * bulge
    assert abs(shear_less) < 0.5 * bulge and bulge > 4e-4 * computed


def test_a_beam_that_floats_has_two_rigid_motions_that_carry_its_mass():
    beam = fem.beam(LENGTH, SECTION, STEEL, (FREE, FREE), 0.1)
    computed = fem.modes(beam.K, beam.M, 6)
    assert np.count_nonzero(computed.omega < STILL * computed.omega.max()) == 2
    assert abs(beam.effective_mass(computed.phi)[:2, 2].sum() - 1) < 1e-9
    assert abs(beam.mass / (STEEL.density * SECTION.area * LENGTH) - 1) < 1e-12


def test_elements_are_as_long_as_the_wave_that_they_resolve():
    """Halved they change no frequency up to it, and a longer beam has more of them."""
    n = {length: fem.beam(length, SECTION, STEEL, (FREE, FREE), length / 3).K.shape[0]
         for length in (0.5, 5.0)}  # fmt: skip
    assert n[0.5] < n[5.0] / 5
    one, two = (
        omega(fem.beam(0.5, SECTION, STEEL, (HINGED, HINGED), 0.2, coarser=c), 24) for c in (1, 0.5)
    )
    assert one[-1] > 2 * np.pi * 40e3 and np.abs(one / two - 1).max() < 1e-5
    assert ORDER == 10


def test_the_drawn_beam_moves_as_its_sections_do():
    """A rigid turn about the left hinge: u = -z turn along, x turn across."""
    beam = fem.beam(LENGTH, SECTION, STEEL, (HINGED, FREE), 0.1)
    computed = fem.modes(beam.K, beam.M, 3)
    u = (beam.T @ computed.phi[:, 0]).reshape(-1, 3)
    x, _, z = beam.drawn.p
    turn = u[np.argmax(x), 2] / LENGTH
    assert np.allclose(u, turn * np.column_stack([-z, 0 * x, x]), atol=1e-6 * abs(turn) * LENGTH)


def test_a_rectangle_has_the_shear_factor_of_its_width():
    """5 (1 + nu) / (6 + 5 nu) of a narrow one; of a square that with which a wave of k h = 0.1 has
    the frequency of three-dimensional elasticity within 3e-8; from 2.5 thicknesses on it stays."""
    nu = 0.3
    narrow = fem.rectangle(1e-3, 1e-2, nu).shear_factor
    assert abs(narrow / (5 * (1 + nu) / (6 + 5 * nu)) - 1) < 1e-5
    assert abs(fem.rectangle(1e-2, 1e-2, nu).shear_factor - 0.87227) < 1e-5
    widest = fem.rectangle(2.5e-2, 1e-2, nu).shear_factor
    assert widest == pytest.approx(fem.rectangle(8e-2, 1e-2, nu).shear_factor, rel=1e-12)


def test_shear_factors_of_round_sections_are_hutchinsons():
    """J. Appl. Mech. 68 (2001) 87: of a rod, and (1 + nu) / (2 + nu) of a thin tube."""
    nu = 0.3
    rod = 6 * (1 + nu) ** 2 / (7 + 12 * nu + 4 * nu**2)
    assert abs(fem.tube(0.02, 0.0, nu).shear_factor / rod - 1) < 1e-12
    thin = fem.tube(0.02, 0.01999, nu)
    assert abs(thin.shear_factor / ((1 + nu) / (2 + nu)) - 1) < 1e-5
    assert abs(thin.second_moment / (thin.area * 0.01**2 / 2) - 1) < 1e-3
