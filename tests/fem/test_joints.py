"""Two blocks, one above the other, joined in every way the assembly knows."""

from contextlib import nullcontext as calm

import numpy as np
import pytest
from scipy.sparse import csc_matrix, csr_matrix
from scipy.spatial.transform import Rotation
from skfem import MeshHex

from beadwave.fem import (
    Bushing,
    Connections,
    HeldFace,
    Joint,
    Side,
    SwayingTable,
    Tie,
    assemble,
    joined,
    modes,
    normal_frame,
)
from beadwave.fem.assembly.constraints import Constraint, claimed, eliminated
from beadwave.fem.assembly.joints import (
    _Coupling,
    _require_spread,
    distributing,
    mean_sides,
    rigid_motion,
    rigid_sides,
    tie,
)
from beadwave.fem.assembly.trace import face_nodes
from beadwave.fem.modes.modes import Modes, require_accurate

from known_models import STEEL, at, stacked

LOWER, UPPER = 0.05, 0.12  # m
NOWHERE = np.empty(0, np.int64)


TIE = Tie("upper:foot", "lower:top")
BASE = HeldFace("lower:base")


def blocks(fine=3, coarse=2):
    """A slender block of `fine` elements across on one of `coarse`, unmerged."""
    lower = MeshHex.init_tensor(*2 * [np.linspace(-0.03, 0.03, coarse + 1)], [0, LOWER / 2, LOWER])
    upper = MeshHex.init_tensor(
        *2 * [np.linspace(-0.01, 0.01, fine + 1)], np.linspace(LOWER, UPPER, 4)
    )
    return stacked(lower, upper, LOWER)


@pytest.fixture(scope="module")
def structure():
    return blocks()


def springs(structure, k, held=(BASE,)):
    under = Side("lower:top", "mean", over="upper:foot")
    joint = Joint("screw", Side("upper:foot"), under, np.array([0.0, 0.0, LOWER]), k)
    return joined(structure, Connections(joints=[joint], held=held))


def tied(structure, table=None):
    return joined(structure, Connections([TIE], held=[BASE], table=table))


def frequencies(model, n=4):
    return modes(model.K, model.M, n).frequency_hz


def test_a_rigid_motion_is_a_shift_and_the_cross_product_of_a_turn():
    rng = np.random.default_rng(0)
    points, centre, shift, turn = rng.normal(size=(9, 3)), np.ones(3), *rng.normal(size=(2, 3))
    moved = rigid_motion(points, centre) @ np.append(shift, turn)
    np.testing.assert_allclose(
        moved.reshape(-1, 3), shift + np.cross(turn, points - centre), atol=1e-14
    )


def test_the_mean_motion_of_a_face_is_the_nearest_rigid_motion():
    """Nearest in the weighted mean square: what is left has no weighted share in a rigid one."""
    rng = np.random.default_rng(1)
    points, weights, centre = rng.normal(size=(20, 3)), rng.uniform(1, 2, 20), np.ones(3)
    C, G = distributing(points, weights, centre), rigid_motion(points, centre)
    np.testing.assert_allclose(C @ G, np.eye(6), atol=1e-13)
    moved = rng.normal(size=60)
    left = np.repeat(weights, 3) * (moved - G @ (C @ moved))
    np.testing.assert_allclose(G.T @ left, 0.0, atol=1e-12)


def test_a_rigid_motion_costs_a_joint_no_energy(structure):
    model = springs(structure, Bushing(1e9, 1e9, 1e9, 1e5, 1e5, 1e5), held=())
    computed = modes(model.K, model.M, 7, shift_hz=100.0)
    # the shift's factorisation resolves zero to about 1e-9 of the first elastic eigenvalue
    assert np.all(computed.omega[:6] ** 2 < 1e-6 * computed.omega[6] ** 2)


def test_a_joint_of_no_stiffness_leaves_two_free_bodies(structure):
    model = springs(structure, Bushing(0, 0, 0, 0, 0, 0))
    omega2 = modes(model.K, model.M, 7, shift_hz=100.0).omega ** 2
    assert np.all(omega2[:6] < 1e-6 * omega2[6])
    model = springs(structure, Bushing(0, 0, 0, 0, 0, 0), held=())
    omega2 = modes(model.K, model.M, 13, shift_hz=100.0).omega ** 2
    assert np.all(omega2[:12] < 1e-6 * omega2[12])


def test_stiff_joints_approach_the_rigid_one_like_one_over_k(structure):
    rigid = frequencies(springs(structure, Bushing()))

    def error(k):
        soft = frequencies(springs(structure, Bushing(*3 * [k], *3 * [k * 1e-4])))
        return np.abs(soft / rigid - 1).max()

    errors = [error(k) for k in (1e12, 1e13, 1e14)]
    assert errors[0] / errors[1] == pytest.approx(10, rel=0.05)
    assert errors[1] / errors[2] == pytest.approx(10, rel=0.05)
    assert error(1e16) < 1e-6


def test_frequencies_rise_with_stiffness_over_sixteen_decades(structure):
    k = 10.0 ** np.arange(0, 17, 2)
    f = np.array([frequencies(springs(structure, Bushing(kx=x)))[:2] for x in k])
    assert np.all(np.diff(f, axis=0) > -1e-9 * f[1:])


def test_sensitivity_to_a_stiffness_is_the_squared_elongation(structure):
    def omega2(k):
        model = springs(structure, Bushing(kx=k))
        computed = modes(model.K, model.M, 2)
        return computed.omega**2, computed.phi[model.elongation[0]] ** 2

    k, h = 1e8, 1e3
    numeric = (omega2(k + h)[0] - omega2(k - h)[0]) / (2 * h)
    np.testing.assert_allclose(numeric, omega2(k)[1], rtol=1e-5, atol=1e-9)


def test_a_tie_between_meshes_that_match_is_the_merged_mesh():
    # the same prism cut in two, and in one piece
    z = np.linspace(0, UPPER, 7)
    line = np.linspace(-0.01, 0.01, 4)
    whole = MeshHex.init_tensor(line, line, z)
    whole = assemble({"whole": whole.with_boundaries({"base": at(0.0)})}, {"whole": STEEL})
    single = joined(whole, Connections(held=[HeldFace("whole:base")]))
    cut = stacked(*(MeshHex.init_tensor(line, line, part) for part in (z[:4], z[3:])), z[3])
    np.testing.assert_allclose(frequencies(tied(cut)), frequencies(single), rtol=1e-9)


def test_a_tie_bridges_what_the_kernel_draws_one_rectangle_apart_on_two_bodies():
    """Edges of a box imprinted on another one lay 1.5e-7 of an element outside of that one's."""
    z = np.linspace(0, UPPER, 7)
    line = np.linspace(-0.01, 0.01, 4)
    meshes = [MeshHex.init_tensor(line, line, part) for part in (z[:4], z[3:])]
    same = frequencies(tied(stacked(*meshes, z[3])))
    wider = [meshes[0], meshes[1].scaled((1 + 1e-6, 1 + 1e-6, 1.0))]
    np.testing.assert_allclose(frequencies(tied(stacked(*wider, z[3]))), same, rtol=1e-5)


def test_constraints_in_a_circle_are_refused():
    def follow(slave, master):
        A = np.zeros((1, 3))
        A[0, master] = 1.0
        return Constraint(np.array([slave]), csr_matrix(A), f"{slave} to {master}")

    with pytest.raises(ValueError, match="circle"):
        eliminated(3, [follow(0, 1), follow(1, 0)])
    with pytest.raises(ValueError, match="slave of two"):
        eliminated(3, [follow(0, 1), follow(0, 2)])
    kept, twice = claimed(3, [follow(0, 1), follow(0, 2)])
    assert [(t.kept, t.dropped, list(t.slaves)) for t in twice] == [("0 to 1", "0 to 2", [0])]
    np.testing.assert_array_equal(eliminated(3, kept).free, [1, 2])


def test_a_stiff_pair_of_blocks_sways_with_its_table_at_the_table_s_frequency(structure):
    table = SwayingTable(frequency_hz=6.5, mass=2.0)
    on_table = tied(structure, table)
    computed = modes(on_table.K, on_table.M, 3, shift_hz=1.0)
    np.testing.assert_allclose(computed.frequency_hz[:2], 6.5, rtol=1e-4)
    assert computed.frequency_hz[2] > 500
    heavy = tied(structure, table._replace(mass=1e6))
    held = tied(structure)
    swaying = modes(heavy.K, heavy.M, 6, shift_hz=1.0).frequency_hz[2:]
    np.testing.assert_allclose(swaying, frequencies(held), rtol=1e-4)


def test_a_load_that_buckles_is_refused_with_what_to_do():
    """A third oscillator whose stiffness the load has made negative."""
    K = csc_matrix(np.diag((2 * np.pi * np.arange(1.0, 41.0)) ** 2))
    K[2, 2] *= -4.0
    with pytest.raises(ValueError, match=r"buckle the structure: a motion grows at 37\.7 1/s"):
        modes(K, csc_matrix(np.eye(40)), 4)


def test_a_mode_that_rounding_has_turned_is_refused_with_what_to_do():
    """Two modes of 1 and 9 Hz turned into one another by 0.1 rad: K phi is off by tenths."""
    K = csc_matrix(np.diag((2 * np.pi * np.array([1.0, 9.0])) ** 2))
    turned = np.array([[np.cos(0.1), -np.sin(0.1)], [np.sin(0.1), np.cos(0.1)]])
    computed = Modes(np.sqrt(K.diagonal()), turned)
    with pytest.raises(ValueError, match=r"lost in the rounding of K .*stiffen the softest joints"):
        require_accurate(computed, K, csc_matrix(np.eye(2)), -((2 * np.pi * 5.0) ** 2))
    require_accurate(
        computed._replace(phi=np.eye(2)), K, csc_matrix(np.eye(2)), -((2 * np.pi * 5.0) ** 2)
    )


def turned_blocks(turn):
    """The two blocks, turned as a whole about the origin."""
    plain = blocks()
    meshes = {
        body: MeshHex(turn @ basis.mesh.p, basis.mesh.t).with_boundaries(basis.mesh.boundaries)
        for body, basis in plain.basis.items()
    }
    return assemble(meshes, dict.fromkeys(meshes, STEEL))


@pytest.mark.parametrize("coupling", ["rigid", "mean"])
def test_springs_stand_along_the_frame_of_their_joint(coupling):
    """Turned with its frame, the assembly keeps its frequencies; in a global one it does not."""
    turn = Rotation.from_euler("xyz", [30.0, -50.0, 80.0], degrees=True).as_matrix()
    sides = Side("upper:foot", coupling), Side("lower:top", "mean", within=0.012)
    k = Bushing(1e7, 3e7, 9e7, 1e3, 2e3, 5e2)

    def hz(turn, frame):
        centre = turn @ [0.0, 0.0, LOWER]
        how = Connections(joints=[Joint("bolt", *sides, centre, k, frame)], held=[BASE])
        return frequencies(joined(turned_blocks(turn), how), 6)

    plain = hz(np.eye(3), np.eye(3))
    np.testing.assert_allclose(hz(turn, turn.T), plain, rtol=1e-8)
    assert np.abs(hz(turn, np.eye(3)) / plain - 1).max() > 0.05


def test_the_normal_frame_has_z_along_the_bolt_and_x_along_the_first_axis_beside_it():
    np.testing.assert_allclose(normal_frame([0, 0, 2.0]), np.eye(3))
    np.testing.assert_allclose(normal_frame([1, 0, 0]), [[0, 1, 0], [0, 0, 1], [1, 0, 0]])
    frame = normal_frame([1.0, 2.0, -1.0])
    # unit vectors to eps each
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(frame) == pytest.approx(1.0) and frame[0, 0] > 0.8
    np.testing.assert_allclose(frame[2] * np.sqrt(6), [1, 2, -1])


@pytest.mark.parametrize(("key", "axis"), [("kx", 0), ("ky", 1), ("kz", 2)])
def test_a_body_on_a_spring_to_the_ground_is_a_mass_on_a_spring(structure, key, axis):
    """All but one direction rigid: sqrt(k / m), the body's own give of 1e-5 or so apart."""
    k, centre = 1e4, np.array([0.0, 0.0, 0.0])
    earth = Joint("earth", Side("lower:base"), None, centre, Bushing(**{key: k}))
    model = joined(structure, Connections([TIE], [earth]))
    assert model.spring == (f"earth.{key}",)
    mass = model.structure.M.sum() / 3
    first = frequencies(model, 1)[0]
    assert first == pytest.approx(np.sqrt(k / mass) / (2 * np.pi), rel=1e-4)
    moved = model.T @ modes(model.K, model.M, 1).phi[:, 0]
    assert np.sum(moved[axis::3] ** 2) > 0.999 * np.sum(moved**2)


def test_a_washer_that_holds_too_few_nodes_is_refused(structure):
    small = Side("upper:foot", "rigid", within=2e-3)
    joint = Joint("bolt", small, Side("lower:top", "mean"), np.array([0.0, 0.0, LOWER]))
    with pytest.raises(ValueError, match=r"joint bolt holds \d nodes of upper:foot within 0.002 m"):
        joined(structure, Connections(joints=[joint]))


@pytest.mark.parametrize("unit", [1e-4, 1e4])
def test_whether_nodes_hold_a_turn_is_no_matter_of_their_size(unit):
    """A face does, an edge of it does not."""
    line = unit * np.linspace(0, 1, 4)
    lower, upper = (MeshHex.init_tensor(line, line, line + z * unit) for z in (0, 1))
    small = stacked(lower.with_boundaries({}), upper, unit)
    face = Joint("bolt", Side("upper:foot"), None, np.array([0.0, 0.0, unit]))
    assert len(rigid_sides(small, [face], small.n_dofs + 12)) == 1
    edge = small.basis["upper"].mesh.with_boundaries(
        {"edge": lambda x: (x[2] < 1.001 * unit) & (x[1] < 0.3 * unit)}
    )
    narrow = assemble({"upper": edge}, {"upper": STEEL})
    within = Side("upper:edge", within=0.1 * unit)
    with pytest.raises(ValueError, match="hold no turn"):
        rigid_sides(narrow, [face._replace(first=within)], narrow.n_dofs + 12)


@pytest.mark.parametrize("n", [4, 400])
@pytest.mark.parametrize(("off", "refused"), [(1.6e-6, True), (1.9e-6, False)])
def test_a_line_of_points_holds_a_turn_from_two_millionths_of_its_reach_on(n, off, refused):
    """sqrt(3) 1e-6, however many they are: those at either end off it one way, the others the
    other way, so that their own best line is the one between."""
    along = np.linspace(-1, 1, n)
    side = np.where(np.abs(along) > 0.6, 1.0, -1.0)
    side = side - side.mean()
    points = np.column_stack([along, off * side / np.sqrt(np.mean(side**2)), 0 * along])
    what = _Coupling(Side("body:face"), "bolt", np.zeros(3), NOWHERE, np.eye(6), NOWHERE)
    G = rigid_motion(points, np.zeros(3))
    with pytest.raises(ValueError, match=f"holds {n} nodes .* hold no turn") if refused else calm():
        _require_spread(G, what)


def test_no_points_hold_no_turn():
    what = _Coupling(Side("body:face"), "bolt", np.zeros(3), NOWHERE, np.eye(6), NOWHERE)
    with pytest.raises(ValueError, match="holds 0 nodes"):
        _require_spread(rigid_motion(np.zeros((0, 3)), np.zeros(3)), what)


def sector(inner, outer, angles):
    """Hexahedra between two radii, a layer of them, with straight edges from angle to angle."""
    plain = MeshHex.init_tensor([inner, outer], np.radians(angles), [0, 0.02])
    r, angle, z = plain.p
    p = np.array([r * np.cos(angle), r * np.sin(angle), z])
    ends = {"in": plain.facets_satisfying(lambda x: np.abs(x[0] - inner) < 1e-9),
            "out": plain.facets_satisfying(lambda x: np.abs(x[0] - outer) < 1e-9)}  # fmt: skip
    return MeshHex(p, plain.t).with_boundaries(ends)


@pytest.mark.parametrize("slave", ["pin", "eye"])
def test_a_tie_of_a_pin_in_an_eye_bears_what_straight_edges_of_both_leave(slave):
    """The corners of one stand in the middle of the facets of the other, 0.2 mm off them."""
    meshes = {
        "pin": sector(0.03, 0.05, np.arange(10, 51, 10)),
        "eye": sector(0.05, 0.07, np.arange(5, 56, 10)),
    }
    if slave == "eye":
        meshes = {"pin": sector(0.03, 0.05, np.arange(5, 56, 10)),
                  "eye": sector(0.05, 0.07, np.arange(10, 51, 10))}  # fmt: skip
    bodies = assemble(meshes, dict.fromkeys(meshes, STEEL))
    faces = ["pin:out", "eye:in"] if slave == "pin" else ["eye:in", "pin:out"]
    held = tie(bodies, Tie(*faces), bodies.n_dofs)
    still = rigid_motion(bodies.points, np.zeros(3))
    shifted = held.A @ still[:, :3]
    np.testing.assert_allclose(shifted, still[held.slaves, :3], atol=1e-10)
    farther = meshes[slave].scaled(0.99 if slave == "pin" else 1.01)
    apart = assemble({**meshes, slave: farther}, dict.fromkeys(meshes, STEEL))
    with pytest.raises(ValueError, match=f"'{faces[0]}' does not lie on '{faces[1]}'"):
        tie(apart, Tie(*faces), apart.n_dofs)


def lifted(gap):
    lower = MeshHex.init_tensor(*2 * [np.linspace(-0.03, 0.03, 3)], [0, LOWER])
    upper = MeshHex.init_tensor(*2 * [np.linspace(-0.01, 0.01, 3)], [LOWER + gap, UPPER])
    return stacked(lower, upper, LOWER, gap)


@pytest.mark.parametrize("allowed", [0.9e-3, 1.1e-3])
def test_a_footprint_may_miss_its_face_by_the_gap_of_the_joint(allowed):
    apart = lifted(1e-3)
    under = Side("lower:top", "mean", over="upper:foot", gap=allowed)
    joint = Joint("screw", Side("upper:foot"), under, np.array([0.0, 0.0, LOWER]))
    words = "'upper:foot' does not lie on 'lower:top'"
    with pytest.raises(ValueError, match=words) if allowed < 1e-3 else calm():
        (solved,) = mean_sides(apart, [joint], NOWHERE, apart.n_dofs + 12)
        assert len(solved.slaves) == 6
    with pytest.raises(ValueError, match=words) if allowed < 1e-3 else calm():
        assert len(tie(apart, TIE._replace(gap=allowed), apart.n_dofs).slaves) == 3 * 21


@pytest.mark.parametrize(("coarse", "groups"), [(2, 1), (6, 2)])
def test_mean_sides_are_solved_for_dofs_of_their_faces_and_never_for_those_taken(coarse, groups):
    """Six dofs of each joint, whose springs stay free; together where elements are shared."""
    block, places = blocks(coarse=coarse), np.array([[-0.02, 0, LOWER], [0.02, 0, LOWER]])
    washer = Side("lower:top", "mean", within=0.008)
    bolts = [Joint(f"bolt {i}", washer, None, spot) for i, spot in enumerate(places)]
    n_total = block.n_dofs + 24
    plain = list(mean_sides(block, bolts, NOWHERE, n_total))
    taken = np.concatenate([one.slaves for one in plain])
    others = list(mean_sides(block, bolts, taken, n_total))
    assert not np.isin(np.concatenate([one.slaves for one in others]), taken).any()
    for solved in plain, others:
        assert [len(np.unique(one.slaves)) for one in solved] == [12 // groups] * groups
        for one in solved:
            assert one.slaves.max() < block.n_dofs
            assert np.abs(block.points[one.slaves // 3, 2] - LOWER).max() < 1e-9
    if groups == 2:
        for one, spot in zip(plain, places, strict=True):
            assert np.abs(block.points[one.slaves // 3] - spot).max() < 0.011


def test_three_nodes_that_are_no_line_hold_a_joint(structure):
    """The corner of a face and its two neighbours."""
    spots = structure.points[face_nodes(structure, "upper:foot")[:, 0] // 3]
    corner = spots[np.lexsort(spots.T)[0]]
    radius = np.sort(np.linalg.norm(spots - corner, axis=1))[2]
    joint = Joint("bolt", Side("upper:foot", "rigid", within=radius), None, corner)
    (held,) = rigid_sides(structure, [joint], structure.n_dofs + 12)
    assert len(held.slaves) == 9


def test_a_joint_on_a_face_that_is_held_already_is_refused(structure):
    joint = Joint("bolt", Side("upper:foot"), Side("lower:base", "mean"), np.zeros(3), Bushing())
    earth = joint._replace(first=Side("lower:base", "mean"), second=None)
    with pytest.raises(ValueError, match="joint bolt: what it holds to is held by supports"):
        joined(structure, Connections([TIE], [earth], [BASE]))


@pytest.mark.parametrize("rigid", [None, 0, 4])
def test_on_a_held_face_a_joint_is_no_more_than_free(structure, rigid):
    """Six open springs follow what holds the face; with one of them rigid, one asks too much."""
    k = np.where(np.arange(6) == rigid, np.inf, 0.0)
    earth = Joint("bolt", Side("lower:base", "mean"), None, np.zeros(3), Bushing(*k))
    taken, n = np.arange(structure.n_dofs), structure.n_dofs
    words = "joint bolt: what it holds to is held by supports"
    with calm() if rigid is None else pytest.raises(ValueError, match=words):
        (solved,) = mean_sides(structure, [earth], taken, n + 12)
        np.testing.assert_array_equal(np.sort(solved.slaves), n + np.arange(6))


@pytest.mark.parametrize("share", [1.0, 0.99])
def test_a_washer_holds_the_nodes_within_its_radius_of_the_bolt_and_those_on_it(structure, share):
    """The bolt sits beside the middle; its radius ends at a node, or just before that."""
    centre = np.array([0.01, -0.02, 0.0])
    points = structure.points[face_nodes(structure, "lower:base")[:, 0] // 3]
    away = np.linalg.norm(points - centre, axis=1)
    radius = share * np.sort(away)[5]
    washer = Side("lower:base", "rigid", within=radius)
    joint = Joint("bolt", washer, None, centre)
    (held,) = rigid_sides(structure, [joint], structure.n_dofs + 12)
    nodes = np.unique(held.slaves // 3)
    np.testing.assert_array_equal(
        np.sort(np.linalg.norm(structure.points[nodes] - centre, axis=1)),
        np.sort(away[away < radius * (1 + 1e-12)]),
    )
    assert len(held.slaves) == 3 * len(nodes) < 3 * len(points)
