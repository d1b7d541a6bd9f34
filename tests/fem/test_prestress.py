"""Solids under static load: stress stiffening against beams, plates and membranes."""

import numpy as np
import pytest
from skfem import MeshHex, MeshTet, MeshTet2

from beadwave import fem
from beadwave.fem.assembly.prestress import geometric_stiffness
from beadwave.fem.assembly.rods import tightened as tightening

# held faces would keep what shrinks across from doing so, one element deep
STEEL = fem.Material(210e9, 0.0, 7850.0)
LENGTH, SIDE = 0.3, 0.01
SECTION = fem.rectangle(SIDE, SIDE, 0.0)
HINGED, CLAMPED = fem.ENDS["hinged"], fem.ENDS["clamped"]


def boxed(*lines, kind=MeshHex):
    """Elements between lines along x, y and z, its faces named."""
    return kind.init_tensor(*lines).with_boundaries(
        {
            f"{sign}{letter}": lambda x, i=i, end=line[k]: np.abs(x[i] - end) < 1e-9
            for i, (letter, line) in enumerate(zip("xyz", lines, strict=True))
            for sign, k in (("-", 0), ("+", -1))
        }
    )


def bar(kind=MeshHex, n=24, ends=("yz", "yz")):
    """Hinged in both planes unless `ends` hold more, stopped along x by its left end's mean."""
    across = np.linspace(-SIDE / 2, SIDE / 2, 3)
    lines = (np.linspace(0, LENGTH, n + 1), across, across)
    structure = fem.assemble({"bar": boxed(*lines, kind=kind)}, {"bar": STEEL})
    stop = fem.Joint(
        "stop", fem.Side("bar:-x", "mean"), None, np.zeros(3), fem.Bushing(np.inf, 0, 0, 0, 0, 0)
    )
    held = [fem.HeldFace("bar:-x", ends[0]), fem.HeldFace("bar:+x", ends[1])]
    joints = [] if "x" in ends[0] else [stop]
    return fem.joined(structure, fem.Connections(joints=joints, held=held))


def pulled(model, force):
    load = fem.Load([fem.FaceForce("bar:+x", force, (2.0, 0.0, 0.0))])
    return fem.prestressed(model, {"bar": STEEL}, load)


def first_omega(model):
    return fem.modes(model.K, model.M, 1).omega[0]


def buckling_load(length):
    """Engesser's of a hinged beam."""
    euler = np.pi**2 * STEEL.young * SECTION.second_moment / length**2
    return euler / (1 + euler / (SECTION.shear_factor * STEEL.lame[1] * SECTION.area))


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "n"), [(MeshHex, 24), (MeshTet, 40)])
@pytest.mark.parametrize("share", [-0.9, -0.5, 2.0])
def test_a_solid_bar_under_a_force_has_timoshenkos_frequency(share, kind, n):
    """By the ratio to the bar at rest, which the mesh leaves in peace."""
    force, model = share * buckling_load(LENGTH), bar(kind, n)
    loaded, beams = pulled(model, force), []
    for N in (0.0, force):
        beams.append(fem.beam(LENGTH, SECTION, STEEL, (HINGED, HINGED), 0.1, axial_force=N))
    theory, computed = ((first_omega(one) / first_omega(two)) ** 2
                     for one, two in (beams[::-1], (loaded, model)))  # fmt: skip
    assert computed == pytest.approx(theory, abs=2e-3 * abs(share))
    assert loaded.load_factor == pytest.approx(max(-share, 0.0), rel=2e-3, abs=1e-12)


def test_a_load_beyond_buckling_is_refused():
    with pytest.raises(fem.Buckled, match="times that which buckles the structure"):
        pulled(bar(), -1.01 * buckling_load(LENGTH))


def test_a_clamped_bar_buckles_when_it_is_warmed():
    """N = E A alpha dT, at the load of a beam of half the length; sigma_x alone stays."""
    model, alpha = bar(n=40, ends=("xyz", "xyz")), 12e-6
    whole = buckling_load(LENGTH / 2) / (STEEL.young * SECTION.area * alpha)
    load = fem.Load(heat={"bar": fem.Heat(0.5 * whole, alpha)})
    loaded = fem.prestressed(model, {"bar": STEEL}, load)
    assert loaded.load_factor == pytest.approx(0.5, rel=5e-3)
    beam = fem.beam(
        LENGTH, SECTION, STEEL, (CLAMPED, CLAMPED), 0.1, axial_force=-buckling_load(LENGTH / 2) / 2
    )
    at_rest = fem.beam(LENGTH, SECTION, STEEL, (CLAMPED, CLAMPED), 0.1)
    theory = first_omega(beam) / first_omega(at_rest)
    assert first_omega(loaded) / first_omega(model) == pytest.approx(theory, rel=5e-3)


def test_a_bar_that_may_expand_does_not_notice_the_heat():
    """No stress anywhere: K_G is rounding."""
    model = bar(ends=("", ""))
    loose = fem.joined(
        model.structure,
        fem.Connections(joints=[
            fem.Joint("stop", fem.Side("bar:-x", "mean"), None, np.zeros(3), fem.Bushing())
        ]),
    )  # fmt: skip
    load = fem.Load(heat={"bar": fem.Heat(500.0, 12e-6)})
    loaded = fem.prestressed(loose, {"bar": STEEL}, load)
    assert np.abs((loaded.K0 - loose.K0).data).max() < 1e-9 * np.abs(loose.K0.data).max()
    assert loaded.load_factor == 0.0


def test_a_stretched_plate_is_a_membrane_with_stiffness():
    """Hinged square sheet, pulled on all sides by S [N/m]: rho h omega^2 = D k^4 + S k^2."""
    side, h, S = 0.2, 0.001, 1e5
    across = np.linspace(0, side, 9)
    mesh = boxed(across, across, np.array([-h / 2, h / 2]))
    structure = fem.assemble({"sheet": mesh}, {"sheet": STEEL})
    centre = np.array([side / 2, side / 2, 0.0])
    stop = fem.Joint(
        "stop", fem.Side("sheet:+z", "mean"), None, centre,
        fem.Bushing(np.inf, np.inf, 0, 0, 0, np.inf),
    )  # fmt: skip
    edges = ("-x", "+x", "-y", "+y")
    held = [fem.HeldFace(f"sheet:{face}", "z") for face in edges]
    model = fem.joined(structure, fem.Connections(joints=[stop], held=held))
    forces = [fem.FaceForce(f"sheet:{face}", -S * side) for face in edges]  # pulls, away from it
    loaded = fem.prestressed(model, {"sheet": STEEL}, fem.Load(forces))
    D, k2 = STEEL.young * h**3 / 12, 2 * (np.pi / side) ** 2
    added = first_omega(loaded) ** 2 - first_omega(model) ** 2
    assert added == pytest.approx(S * k2 / (STEEL.density * h), rel=5e-3)
    assert S * k2 > 10 * D * k2**2 and loaded.load_factor == 0.0


def tightened(model, tension, stiffness=0.0):
    load = fem.Load(rods=[fem.Rod("bar:-x", "bar:+x", tension, stiffness)])
    return fem.prestressed(model, {"bar": STEEL}, load)


@pytest.mark.parametrize("share", [0.5, 0.9])
def test_a_tendon_from_foot_to_tip_buckles_a_cantilever_as_a_hinged_bar(share):
    """Its force passes through the foot: four times the load that keeps its direction. A spring
    along the bar leaves bending alone, and stiffens what stretches."""
    model = bar(ends=("xyz", ""))
    critical = buckling_load(LENGTH)
    loaded = tightened(model, share * critical)
    assert loaded.load_factor == pytest.approx(share, rel=5e-3)
    with pytest.raises(fem.Buckled):
        pulled(model, -share * critical)
    locked = tightened(model, share * critical, 1e8)
    assert first_omega(locked) / first_omega(loaded) == pytest.approx(1, abs=1e-6)
    stretched = np.zeros(model.structure.n_dofs)
    stretched[0::3] = model.structure.points[:, 0]
    u = model.T.T @ stretched / np.asarray(model.T.power(2).sum(axis=0)).ravel()
    assert u @ (locked.K - loaded.K) @ u == pytest.approx(1e8 * LENGTH**2, rel=1e-6)


def test_a_rod_in_the_open_is_a_string_and_a_spring():
    """Two blocks that move as wholes: N / L sideways, k along, and no energy of turning both."""
    apart, N, k = 0.1, 500.0, 3e6
    lines = [np.linspace(0, 0.02, 3) for _ in "xyz"]
    boxes = {"a": boxed(*lines), "b": boxed(lines[0] + apart, *lines[1:])}
    structure = fem.assemble(boxes, dict.fromkeys(boxes, STEEL))
    rod = tightening(structure, [fem.Rod("a:+z", "b:+z", N, k)])
    ahead = (structure.points[:, 0] > apart / 2).astype(float)
    for axis, stiffness in enumerate((0.0, N / apart, N / apart)):
        u = np.kron(ahead, np.eye(3)[axis])
        assert u @ rod.K_G @ u == pytest.approx(stiffness, rel=1e-9)
        assert u @ rod.K @ u == pytest.approx(k * (axis == 0), rel=1e-9)
        assert u @ rod.f == pytest.approx(-N * (axis == 0), rel=1e-9)
    assert np.abs(rod.K_G @ np.kron(np.ones_like(ahead), np.ones(3))).max() < 1e-9 * N / apart


def test_a_rod_without_a_length_is_refused():
    model = bar(ends=("xyz", ""))
    load = fem.Load(rods=[fem.Rod("bar:-y", "bar:+y", 1.0), fem.Rod("bar:+x", "bar:+x", 1.0)])
    with pytest.raises(ValueError, match="has no length"):
        fem.prestressed(model, {"bar": STEEL}, load)


def test_curved_elements_without_a_curve_have_the_geometric_stiffness_of_straight_ones():
    """As a mesh chosen by its error has them, of a stretch along x."""
    straight = MeshTet.init_tensor(*3 * (np.linspace(0, 0.1, 3),))
    stiffnesses = []
    for mesh in (straight, MeshTet2.from_mesh(straight)):
        structure = fem.assemble({"bar": mesh}, {"bar": STEEL})
        u = np.zeros_like(structure.points)
        u[:, 0] = 1e-3 * structure.points[:, 0]
        K_G = geometric_stiffness(structure, "bar", u.ravel(), STEEL, None)
        # energy of a turn about z under the stretch, which no numbering of nodes changes
        turn = np.cross([0, 0, 1.0], structure.points).ravel()
        stiffnesses.append(turn @ K_G @ turn)
    assert stiffnesses[1] == pytest.approx(stiffnesses[0], rel=1e-9)
