"""Mindlin's rectangular plate against closed forms, and against the solid in three dimensions."""

import numpy as np
import pytest

from beadwave import fem
from beadwave.fem.modes.mac import RIGID

STEEL = fem.Material(210e9, 0.3, 7850.0)
HINGED = ("hinged",) * 4


def stiffnesses(sheet):
    """kappa G h and D."""
    E, nu, _ = sheet.material
    shear = 5 / (6 - nu) * E / (2 * (1 + nu)) * sheet.thickness
    return shear, E * sheet.thickness**3 / (12 * (1 - nu**2))


def hinged_omega(sheet, n):
    """w = sin mx sin ny with k^2 = m^2 + n^2: (S k^2 - rho h s)(D k^2 + S - rho I s) = S^2 k^2."""
    count, (S, D) = np.arange(1, 40), stiffnesses(sheet)
    sides = (np.pi * count / side for side in sheet[:2])
    k2 = np.sort(np.add.outer(*(side**2 for side in sides)).ravel())[:n]
    h, rho = sheet.thickness, sheet.material.density
    p, q = S * k2 / (rho * h), 12 * (D * k2 + S) / (rho * h**3)
    return np.sqrt((p + q) / 2 - np.sqrt((p - q) ** 2 / 4 + 12 * S**2 * k2 / (rho**2 * h**4)))


def pressed_omega(sheet, in_plane, n):
    """`omega` with forces N_x, N_y in the plane: S k^2 + N_x kx^2 + N_y ky^2 in place of S k^2."""
    count, (S, D) = np.arange(1, 40), stiffnesses(sheet)
    kx2, ky2 = np.meshgrid(*((np.pi * count / side) ** 2 for side in sheet[:2]), indexing="ij")
    k2, N = kx2 + ky2, in_plane[0] * kx2 + in_plane[1] * ky2
    h, rho = sheet.thickness, sheet.material.density
    p, q = (S * k2 + N) / (rho * h), 12 * (D * k2 + S) / (rho * h**3)
    root = np.sqrt((p - q) ** 2 / 4 + 12 * S**2 * k2 / (rho**2 * h**4))
    return np.sqrt(np.sort(((p + q) / 2 - root).ravel())[:n])


def buckling_force(sheet, m, n):
    """N_x [N/m] that presses a hinged plate into m half-waves along x and n along y."""
    S, D = stiffnesses(sheet)
    kx2, ky2 = (m * np.pi / sheet.length) ** 2, (n * np.pi / sheet.width) ** 2
    k2 = kx2 + ky2
    return D * k2**2 / (1 + D * k2 / S) / kx2


@pytest.mark.parametrize("in_plane", [(-0.9, 0.0), (-0.5, -0.2), (0.0, 2.0), (1.0, -0.4)])
def test_a_plate_under_forces_in_its_plane_has_the_modes_of_the_closed_form(in_plane):
    """In buckling forces along x."""
    sheet = fem.Sheet(0.3, 0.23, 0.01, STEEL)
    in_plane = tuple(share * buckling_force(sheet, 1, 1) for share in in_plane)
    plate = fem.mindlin_plate(sheet, HINGED, (0.11, 0.1), in_plane=in_plane)
    computed = fem.modes(plate.K, plate.M, 10).omega
    assert np.abs(computed / pressed_omega(sheet, in_plane, 10) - 1).max() < 1e-5


@pytest.mark.parametrize(("length", "m"), [(0.2, 1), (0.4, 2)])
@pytest.mark.parametrize("thickness", [0.001, 0.01])
def test_a_hinged_plate_buckles_at_four_pi_squared_over_its_width(length, m, thickness):
    """k = 4 where it is thin, in squares; less by Mindlin's shear where it is thick."""
    sheet = fem.Sheet(length, 0.2, thickness, STEEL)
    exact = buckling_force(sheet, m, 1)
    thin = 4 * np.pi**2 * sheet.bending_stiffness / 0.2**2
    assert exact / thin == pytest.approx(1, abs=2e-4) if thickness == 0.001 else exact < 0.99 * thin
    plate = fem.mindlin_plate(sheet, HINGED, (0.1, 0.1), in_plane=(-0.5 * exact, 0.0), coarser=2.0)
    assert plate.load_factor == pytest.approx(0.5, rel=1e-5)
    with pytest.raises(fem.Buckled, match="times those that buckle it"):
        fem.mindlin_plate(sheet, HINGED, (0.1, 0.1), in_plane=(-1.01 * exact, 0.0), coarser=2.0)


def compliance(plate):
    return plate.patch.w @ fem.factorised(plate.K).solve(plate.patch.w)


@pytest.mark.parametrize("thickness", [0.002, 0.01])
def test_ten_modes_of_a_hinged_plate_are_those_of_the_closed_form(thickness):
    """No locking where it is thin."""
    sheet = fem.Sheet(0.3, 0.23, thickness, STEEL)
    plate = fem.mindlin_plate(sheet, HINGED, (0.11, 0.1))
    computed = fem.modes(plate.K, plate.M, 10).omega
    assert np.abs(computed / hinged_omega(sheet, 10) - 1).max() < 5e-6


def hertz(x):
    return 3 * (np.sin(x) - x * np.cos(x)) / x**3


def test_the_static_deflection_is_that_of_naviers_series():
    """The disc under Hertz' pressure, read by the same weights."""
    sheet, at = fem.Sheet(0.3, 0.23, 0.01, STEEL), (0.11, 0.1)
    (S, D), b = stiffnesses(sheet), sheet.patch_radius
    waves = [np.arange(1, 1200) * np.pi / side for side in sheet[:2]]
    k2 = np.add.outer(*(k**2 for k in waves))
    shape = np.multiply.outer(*(np.sin(k * x) for k, x in zip(waves, at, strict=True)))
    read = (shape * hertz(np.sqrt(k2) * b)) ** 2 * 4 / (sheet.length * sheet.width)
    exact = (read * (1 / (D * k2**2) + 1 / (S * k2))).sum()
    assert abs(compliance(fem.mindlin_plate(sheet, HINGED, at)) / exact - 1) < 1e-5


def solid_compliance(side, h, material):
    """Of a hinged square plate under a point force in its middle, less that of the half-space, in
    three dimensions: waves of a free layer, and the half-space's images by the Madelung sum of a
    square of alternating charges, -1.6155426."""
    E, nu, _ = material
    m = np.arange(1, int(30 * side / h / np.pi), 2) * np.pi / side
    x = np.hypot(m[:, None], m) * h
    layer = (np.sinh(x) * np.cosh(x) + x) / (np.sinh(x) ** 2 - x**2)
    each = 4 / side**2 * 2 * (1 - nu**2) * h / (E * x) * (layer - 1)
    return each.sum() - 1.6155426 * (1 - nu**2) / (np.pi * E * side)


@pytest.mark.parametrize("poisson", [0.0, 0.2, 0.3, 0.45])
@pytest.mark.parametrize("slenderness", [40, 10])
def test_the_compliance_at_the_contact_is_that_of_the_solid(slenderness, poisson):
    """Beyond the half-space, within 1e-3; without poisson the disc is wider than it should
    be, which leaves a logarithm."""
    material = STEEL._replace(poisson=poisson)
    sheet = fem.Sheet(0.4, 0.4, 0.4 / slenderness, material)
    plate = fem.mindlin_plate(sheet, HINGED, (0.2, 0.2))
    left = compliance(plate) - plate.half_space
    exact = solid_compliance(0.4, sheet.thickness, material)
    assert abs(left / exact - 1) < (1e-3 if poisson else 1e-2)
    assert abs(compliance(plate) / exact - 1) > 1e-3  # what is taken off is seen


def test_compliance_beyond_the_half_space_of_a_plate_does_not_depend_on_the_disc():
    """Of another shear factor the disc is another, the compliance left the same."""
    left = []
    for factor in (0.8, 0.86):
        sheet = fem.Sheet(0.4, 0.4, 0.01, STEEL, factor)
        plate = fem.mindlin_plate(sheet, HINGED, (0.2, 0.2))
        left.append(compliance(plate) - plate.half_space)
    assert abs(left[0] / left[1] - 1) < 1e-4
    assert sheet.patch_radius < 0.98 * fem.Sheet(0.4, 0.4, 0.01, STEEL, 0.8).patch_radius


LITERATURE = {  # omega a^2 sqrt(rho h / D) of thin square plates, Leissa, NASA SP-160 (1969)
    ("clamped",) * 4: 35.985,
    ("hinged",) * 4: 19.739,
    ("clamped", "clamped", "hinged", "hinged"): 28.951,
    ("free", "free", "hinged", "hinged"): 9.631,
}


@pytest.mark.parametrize("edges", LITERATURE)
def test_a_thin_square_plate_has_the_frequency_of_the_literature(edges):
    sheet = fem.Sheet(0.4, 0.4, 0.002, STEEL)
    plate = fem.mindlin_plate(sheet, edges, (0.17, 0.2), coarser=2.0)
    unit = np.sqrt(stiffnesses(sheet)[1] / (STEEL.density * sheet.thickness)) / 0.4**2
    assert abs(fem.modes(plate.K, plate.M, 1).omega[0] / unit / LITERATURE[edges] - 1) < 1.5e-3


def test_a_plate_that_floats_has_three_rigid_motions_and_moves_as_drawn():
    sheet = fem.Sheet(0.3, 0.2, 0.01, STEEL)
    plate = fem.mindlin_plate(sheet, ("free",) * 4, (0.1, 0.1), coarser=2.0)
    computed = fem.modes(plate.K, plate.M, 6)
    rigid = computed.omega < RIGID * computed.omega.max()
    assert np.count_nonzero(rigid) == 3
    assert abs(plate.effective_mass(computed.phi)[rigid, 2].sum() - 1) < 1e-9
    x, y, z = plate.drawn.p
    one = np.ones_like(x)
    basis = [np.stack(u, 1).ravel() for u in ((0 * x, 0 * x, one), (-z, 0 * x, x), (0 * x, -z, y))]
    u = plate.T @ computed.phi[:, rigid]
    left = u - np.transpose(basis) @ np.linalg.lstsq(np.transpose(basis), u, rcond=None)[0]
    assert np.abs(left).max() < 1e-6 * np.abs(u).max()
