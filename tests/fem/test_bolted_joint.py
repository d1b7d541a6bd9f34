"""Stiffness of a bolted joint by formula: printed numbers, integrals over the cones, limits."""

import numpy as np
import pytest
from scipy.integrate import quad

from beadwave.fem import (
    Bolt,
    Material,
    Member,
    PressedFaces,
    fastener_masses,
    joint_stiffness_by_formula,
)
from beadwave.fem.contact.bolted_joint import (
    bolt_stiffness,
    deviation_of_ln,
    huth_stiffness,
    members_stiffness,
    rocking_difference,
    tangential_share,
    wileman_stiffness,
)
from beadwave.workflows.scene.named_bolts import named_bolt

STEEL = Material(210e9, 0.3, 7850.0)
ALUMINIUM = Material(70e9, 0.33, 2700.0)
M8 = Bolt(*named_bolt("M8-8.8"))
PLATES = (Member(0.01, STEEL, 0.009), Member(0.01, STEEL, 0.009))
FACES = PressedFaces(0, 0.15)


def test_members_of_an_m8_with_a_grip_of_20_mm():
    """Shigley's cones and Wileman's fit of finite elements, E = 210 GPa: they are 0.7 % apart."""
    k = members_stiffness(PLATES, 0.008, 0.012)
    assert k == pytest.approx(1.6894e9, rel=1e-4)
    assert wileman_stiffness(PLATES, 0.008) == pytest.approx(1.7005e9, rel=1e-4)


@pytest.mark.parametrize("d", [0.006, 0.01, 0.02])
@pytest.mark.parametrize("grip", [0.005, 0.02, 0.1])
def test_equal_plates_have_the_stiffness_that_shigley_prints(d, grip):
    """Eq. 8-22, k = 0.5774 pi E d / (2 ln[5 (0.5774 l + 0.5 d) / (0.5774 l + 2.5 d)])."""
    plates = [Member(grip / 2, STEEL, d)] * 2
    shigley = 0.5774 * np.pi * 210e9 * d
    shigley /= 2 * np.log(5 * (0.5774 * grip + 0.5 * d) / (0.5774 * grip + 2.5 * d))
    assert members_stiffness(plates, d, 1.5 * d) == pytest.approx(shigley, rel=1e-4)


@pytest.mark.parametrize(
    "members",
    [
        [Member(0.004, STEEL, 0.009), Member(0.016, STEEL, 0.009)],
        [Member(0.012, ALUMINIUM, 0.009), Member(0.004, STEEL, 0.009)],
        [Member(0.002, STEEL, 0.009), Member(0.011, ALUMINIUM, 0.009), Member(0.006, STEEL, 0.009)],
    ],
)
def test_stacked_frusta_are_the_integral_over_both_cones(members):
    """1 / k = int dz / (E A), with the cones from head and nut, of the bolt's own hole."""
    ends = np.cumsum([0.0, *(m.thickness for m in members)])

    def compliance(z):
        E = members[min(np.searchsorted(ends, z, side="right") - 1, len(members) - 1)]
        r = 0.006 + min(z, ends[-1] - z) * np.tan(np.pi / 6)
        return 1 / (E.material.young * np.pi * (r**2 - 0.004**2))

    points = sorted({*ends[1:-1], ends[-1] / 2})
    exact = quad(compliance, 0, ends[-1], points=points, epsrel=1e-10)[0]
    assert members_stiffness(members, 0.008, 0.012) == pytest.approx(1 / exact, rel=1e-8)


def test_a_bolt_is_its_shank_and_thread_in_series():
    """M8x35 for 20 mm with washer, nut and two threads: 13 mm of shank, 7 mm of thread."""
    assert M8.length(0.02) == pytest.approx(0.035)
    shank = 0.013 / (210e9 * np.pi * 0.004**2)
    thread = 0.007 / (210e9 * 36.6e-6)
    assert bolt_stiffness(M8, 0.02) == pytest.approx(1 / (shank + thread), rel=1e-3)


@pytest.mark.parametrize(
    ("name", "area", "proof"),
    [
        # mm^2 and kN that ISO 898-1 prints, tables 4 and 5
        ("M5-8.8", 14.2, 8.23), ("M6-10.9", 20.1, 16.7), ("M8-8.8", 36.6, 21.2),
        ("M10-12.9", 58.0, 56.3), ("M16-8.8", 157, 91.0), ("M20-8.8", 245, 147),
        ("M36-10.9", 817, 678), ("M8x1-8.8", 39.2, 22.7), ("M12x1.5-10.9", 88.1, 73.1),
        # in^2 in mm^2 and lbf in kN that ASME B1.1 and SAE J429 print
        ("1/2-13 grade 5", 0.1419 * 645.16, 0.1419 * 85 * 4.44822),
        ("1/4-28 grade 8", 0.0364 * 645.16, 0.0364 * 120 * 4.44822),
        ("1-8 grade 2", 0.606 * 645.16, 0.606 * 33 * 4.44822),
    ],
)  # fmt: skip
def test_stress_areas_and_proof_loads_are_those_of_the_standards(name, area, proof):
    bolt = Bolt(*named_bolt(name))
    assert 1e6 * bolt.stress_area == pytest.approx(area, rel=5e-3)
    assert 1e-3 * bolt.proof_load == pytest.approx(proof, rel=6e-3)


def test_a_contact_is_softer_along_itself_by_mindlin_s_ratio():
    assert tangential_share(STEEL, STEEL) == pytest.approx(2 * 0.7 / 1.7, rel=1e-12)
    # a rigid partner leaves the ratio of one material
    rigid = STEEL._replace(young=1e30)
    assert tangential_share(ALUMINIUM, rigid) == pytest.approx(2 * 0.67 / 1.67, rel=1e-9)


def test_huth_s_flexibility_of_two_steel_plates():
    """f = (2 t / 2 d)^(2/3) 3 (2 / (t E) + 2 / (2 t E)) with t = 10 mm, d = 8 mm."""
    f = 1.25 ** (2 / 3) * 3 * 3 / (0.01 * 210e9)
    assert huth_stiffness(*PLATES, M8) == pytest.approx(1 / f, rel=1e-12)


def test_springs_and_mesh_together_have_the_compliance_of_bolt_and_members():
    j = joint_stiffness_by_formula(M8, PLATES, FACES, 12e3)
    assert j.held == pytest.approx(0.006 + 0.01 * np.tan(np.pi / 6), rel=1e-12)
    assert 1 / j.springs.kz + j.mesh == pytest.approx(1 / (j.bolt + j.members), rel=1e-12)
    # two discs of steel, one rigid, one a mean
    assert j.mesh == pytest.approx((0.5 + 16 / (3 * np.pi**2)) * 0.91 / (210e9 * j.held), rel=1e-12)
    assert j.springs.krx == j.springs.kry == pytest.approx(j.springs.kz * j.held**2 / 4, rel=1e-12)
    assert j.springs.krz == pytest.approx(j.springs.kx * j.held**2 / 2, rel=1e-12)
    assert np.isfinite(j.springs).all() and (j.deviation > 0).all()


def test_thin_plates_have_spreads_of_a_few_decades():
    """The mesh has nearly all of their compliance, so that what is left is uncertain many times
    over: of plates of 1 mm the factor was 4e6 along and 5e126 about the bolt."""
    spreads = []
    for thickness in (3e-3, 2e-3, 1e-3):
        plate = Member(thickness, STEEL, 0.009)
        spreads.append(joint_stiffness_by_formula(M8, (plate, plate), FACES, 1e3).deviation)
    assert np.all(np.diff(spreads, axis=0)[:, 3:5] > 0)  # thinner, less certain
    assert np.max(spreads) < np.log(1e3)
    assert deviation_of_ln(0.3) == 0.3 and deviation_of_ln(1.0) == 1.0
    assert deviation_of_ln(1 + 1e-6) == pytest.approx(1 + 1e-6, rel=1e-9)  # without a kink


def test_discs_wider_than_the_foot_have_softer_springs_by_what_they_take_from_the_mesh():
    """The whole compliance along and about each axis stays: rigid discs on half-spaces, and plates
    around them."""
    foot = joint_stiffness_by_formula(M8, PLATES, FACES, 12e3)
    wide = joint_stiffness_by_formula(M8, PLATES, FACES._replace(held=0.016), 12e3)
    assert wide.held == 0.016
    assert (
        joint_stiffness_by_formula(M8, PLATES, FACES._replace(held=0.007), 12e3).springs
        == foot.springs
    )
    assert 1 / wide.springs.kz + wide.mesh == pytest.approx(1 / foot.springs.kz + foot.mesh)
    taken = 2 * rocking_difference(PLATES[0], foot.held, 0.016)
    assert 1 / wide.springs.krx - 1 / foot.springs.krx == pytest.approx(taken)


def test_a_rough_layer_is_in_series_and_stiffens_with_preload():
    """lambda / F with lambda = 0.4 of the rms height, along the faces 1.214 times as much."""
    hard = joint_stiffness_by_formula(M8, PLATES, FACES, 12e3)
    rough = joint_stiffness_by_formula(M8, PLATES, FACES._replace(rms=2e-6), 12e3)
    layer = 0.4 * 2e-6 / 12e3
    assert 1 / rough.springs.kz - 1 / hard.springs.kz == pytest.approx(layer, rel=1e-9)
    assert 1 / rough.springs.kx - 1 / hard.springs.kx == pytest.approx(layer * 1.7 / 1.4, rel=1e-9)


def test_two_deviations_along_the_faces_reach_the_slipped_bolt():
    j = joint_stiffness_by_formula(M8, PLATES, FACES, 12e3)
    assert j.springs.kx * np.exp(-2 * j.deviation[0]) == pytest.approx(j.slipped.kx)
    assert j.slipped.kx == pytest.approx(huth_stiffness(*PLATES, M8))
    assert j.slip_load == pytest.approx(0.15 * 12e3)


def test_head_nut_and_washer_have_the_mass_and_inertia_of_their_volumes():
    """Against sums over layers of 0.1 mm along the axis."""
    head, nut = fastener_masses(M8, 0.02)
    hexagon, hole = np.sqrt(3) / 2 * 0.013**2, np.pi * 0.004**2
    core = M8.stress_area
    z = (np.arange(-100, 200) + 0.5) * 1e-4

    def within(low, high):
        return (z > low) & (z < high)

    A = np.where(within(0, 0.0053), hexagon, 0) + np.where(within(-0.01, 0), hole, 0)
    check(head, z, A)
    A = np.where(within(0, 0.0016), np.pi * 0.008**2 - hole, 0)
    A = A + np.where(within(0.0016, 0.0084), hexagon - hole, 0)
    A = A + np.where(within(-0.01, 0.015), core, 0)
    check(nut, z, A)


def check(end, z, A):
    m = 7850.0 * A * 1e-4
    centre = m @ z / m.sum()
    assert end.mass == pytest.approx(m.sum(), rel=1e-9)
    assert end.height == pytest.approx(centre, abs=1e-9)
    # cylinders of the same area: the washer and the nut are rings of a hole that the core fills
    across = m @ ((z - centre) ** 2 + 1e-8 / 12)
    assert end.inertia[0] - end.inertia[2] / 2 == pytest.approx(across, rel=1e-6)
