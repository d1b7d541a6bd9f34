"""Modes told by what a body does, by number and by measured shapes."""

import numpy as np
import pytest
from skfem import MeshHex, MeshTet

from beadwave.fem import (
    BodyMotion,
    Connections,
    HeldFace,
    Material,
    Number,
    Shape,
    Tie,
    assemble,
    effective_mass,
    joined,
    modes,
    outer_nodes,
    pair,
    target_mac,
)
from beadwave.fem.assembly.trace import at_node
from beadwave.fem.modes.mac import mac, mac_near_double, measured_pairs

STEEL = Material(210e9, 0.3, 7850.0)
LENGTH = 0.2  # m


def at(axis, value):
    return lambda x: np.abs(x[axis] - value) < 1e-9


@pytest.fixture(scope="module")
def model():
    """A heavy cube of tetrahedra at the end of a bar of hexahedra, wider along y than along z."""
    bar = MeshHex.init_tensor(
        np.linspace(0, LENGTH, 13), np.linspace(-0.01, 0.01, 3), np.linspace(-0.005, 0.005, 3)
    )
    side = np.linspace(-0.02, 0.02, 4)
    cube = MeshTet.init_tensor(side + LENGTH + 0.02, side, side)
    meshes = {
        "bar": bar.with_boundaries({"start": at(0, 0.0), "end": at(0, LENGTH)}),
        "cube": cube.with_boundaries({"back": at(0, LENGTH)}),
    }
    structure = assemble(meshes, {"bar": STEEL, "cube": STEEL._replace(young=210e11)})
    tie = Tie("bar:end", "cube:back")
    return joined(structure, Connections([tie], held=[HeldFace("bar:start")]))


@pytest.fixture(scope="module")
def computed(model):
    return modes(model.K, model.M, 8, shift_hz=20.0)


def test_a_beam_with_a_mass_bends_flat_then_upright_then_twists(model, computed):
    targets = [BodyMotion("cube", m) for m in ("z+ry", "y+rz", "rx", "x")]
    pairing = pair(model, computed, targets)
    np.testing.assert_array_equal(pairing.index[:3], [0, 1, 2])
    assert pairing.index[3] > 3 and np.all(pairing.score > 0.5)
    assert np.all(pairing.character.sum(axis=0) < 1 + 1e-6)  # shares of one energy


def test_strain_is_where_the_soft_body_is(model, computed):
    of_bar, of_cube = pair(
        model, computed, [BodyMotion(b, "strain") for b in ("bar", "cube")]
    ).character
    np.testing.assert_allclose(of_bar + of_cube, 1.0, rtol=1e-6)
    assert of_bar[0] > 0.99


def test_numbers_count_modes_that_strain_something(model, computed):
    assert list(pair(model, computed, [Number(1), Number(5), Number(9)]).index) == [0, 4, -1]
    free = joined(model.structure, Connections([Tie("bar:end", "cube:back")]))
    floating = modes(free.K, free.M, 8, shift_hz=20.0)
    assert list(pair(free, floating, [Number(1)]).index) == [6]


def test_a_measured_shape_is_paired_by_its_mac(model, computed):
    """Read at four points across, with a phase of its own and noise of a twentieth."""
    spots = [(x, 0.0, 0.0) for x in (0.05, 0.1, 0.15, 0.2)]
    directions = [np.eye(3)[i] for i in (1, 2)]
    rows = [at_node(model.structure, np.array(s), d) for s in spots for d in directions]
    reading = np.array(rows) @ model.T
    rng = np.random.default_rng(3)
    for mode in (0, 1, 3):
        shape = reading @ computed.phi[:, mode]
        noise = np.abs(shape).max() / 20 * rng.standard_normal(len(shape))
        target = Shape(reading, (shape + noise) * np.exp(0.7j), float(computed.frequency_hz[mode]))
        pairing = pair(model, computed, [target])
        assert pairing.index[0] == mode and pairing.score[0] > 0.95
    stranger = Shape(reading, np.array([1.0, -1, -1, 1, 1, -1, -1, 1]), 100.0)
    assert pair(model, computed, [stranger]).score[0] < 0.3


def test_shapes_that_look_alike_at_the_points_are_paired_by_frequency_and_once_each(
    model, computed
):
    """Read at one place in y and z all modes of one plane are alike: MAC 1. The largest MAC alone
    would pair all targets with one mode."""
    rows = [at_node(model.structure, np.array([0.2, 0.0, 0.0]), np.eye(3)[i]) for i in (1, 2)]
    reading = np.array(rows) @ model.T
    seen = reading @ computed.phi
    alike = mac(seen, seen)
    first = next(i for i in range(8) if np.count_nonzero(alike[i] > 0.999) > 1)
    modes = np.flatnonzero(alike[first] > 0.999)
    targets = [Shape(reading, seen[:, i], 1.1 * float(computed.frequency_hz[i])) for i in modes]
    assert pair(model, computed, targets).index.tolist() == modes.tolist()


def test_target_mac_is_one_for_the_mode_itself_on_the_body_that_tells_it(model, computed):
    targets = [BodyMotion("cube", "z"), Number(3)]
    shapes = computed.phi[:, [0, 2]]
    table = target_mac((model, model), (computed.phi, -2 * shapes), targets)
    assert table.shape == (8, 2)
    np.testing.assert_allclose([table[0, 0], table[2, 1]], 1.0)
    assert table[0, 1] < 0.1


def test_a_motion_of_no_direction_is_refused():
    with pytest.raises(ValueError, match="motion = 'x-ry' of cube must be a sum of x, y, z"):
        assert BodyMotion("cube", "x-ry").directions


def test_outer_nodes_have_triangles_and_quadrilaterals(model):
    """Every facet turns around its own body's outside; their areas are those of the bodies."""
    outer = outer_nodes(model.structure)
    corners = outer.points[outer.faces]
    np.testing.assert_allclose(model.structure.points[outer.dofs[:, 0] // 3], outer.points)
    triangles = outer.faces[:, 2] == outer.faces[:, 3]
    halves = [np.cross(corners[:, i] - corners[:, 0], corners[:, i + 1] - corners[:, 0])
              for i in (1, 2)]  # fmt: skip
    areas = sum(np.linalg.norm(half, axis=1) / 2 for half in halves)
    assert areas[triangles].sum() == pytest.approx(6 * 0.04**2)
    assert areas[~triangles].sum() == pytest.approx(2 * (0.2 * 0.03 + 0.02 * 0.01))


def test_rigid_motions_carry_all_of_a_floating_mass_and_elastic_modes_none():
    block = MeshHex.init_tensor(*(np.linspace(0, size, 3) for size in (0.05, 0.04, 0.03)))
    floating = joined(assemble({"block": block}, {"block": STEEL}), Connections())
    share = effective_mass(floating, modes(floating.K, floating.M, 9).phi)
    np.testing.assert_allclose(share[:6].sum(axis=0), 1.0, rtol=1e-6)
    assert share[6:].max() < 1e-6


def test_outer_nodes_say_which_body_they_are_of(model):
    outer = outer_nodes(model.structure)
    names = np.array(list(model.structure.basis))[outer.body]
    assert np.all(outer.points[names == "bar", 0] < LENGTH + 1e-9)
    assert np.all(outer.points[names == "cube", 0] > LENGTH - 1e-9)


def random_test(rng):
    """A test of 20 modes at 3 to 30 points, where few points alias; shapes differ by 40 %,
    frequencies by 15 % (one standard deviation), as before a model is updated."""
    computed_hz = np.sort(rng.uniform(30, 4000, 20))
    phi = rng.normal(size=(int(rng.integers(3, 31)), 20))
    modes = rng.permutation(20)[:8]
    measured = phi[:, modes] + 0.4 * rng.normal(size=(len(phi), 8))
    measured_hz = computed_hz[modes] * np.exp(rng.normal(0, 0.15, 8))
    return measured_hz, computed_hz, mac(measured, phi), mac(phi, phi), modes


def test_pairs_are_one_to_one_and_those_apart_in_frequency_are_named_doubtful():
    rng = np.random.default_rng(0)
    for _ in range(200):
        measured_hz, computed_hz, likeness, auto_mac, _ = random_test(rng)
        pairs = measured_pairs(measured_hz, computed_hz, likeness, auto_mac)
        i = np.flatnonzero(pairs.index >= 0)
        assert len({*pairs.index[i]}) == len(i)
        apart = np.abs(computed_hz[pairs.index[i]] / measured_hz[i] - 1)
        said = [any("% apart" in doubt for doubt in pairs.doubts[k]) for k in i]
        np.testing.assert_array_equal(apart > 0.2, said)


def test_pairs_by_shape_and_frequency_are_right_more_often_than_by_the_largest_mac():
    """The truth is known. Errors that neither a doubt nor an alias names are below 1 in 100."""
    rng = np.random.default_rng(1)
    wrong, by_mac, unnamed, total = 0, 0, 0, 0
    for _ in range(200):
        measured_hz, computed_hz, likeness, auto_mac, modes = random_test(rng)
        pairs = measured_pairs(measured_hz, computed_hz, likeness, auto_mac)
        off = (pairs.index != modes) & (pairs.index >= 0)
        total, wrong = total + len(modes), wrong + off.sum()
        by_mac += np.sum(likeness.argmax(axis=1) != modes)
        unnamed += sum(not pairs.doubts[i] for i in np.flatnonzero(off))
    assert wrong < by_mac / 2 and unnamed < 0.01 * total, (wrong, by_mac, unnamed, total)


def test_an_alias_of_a_distant_frequency_is_no_pair_but_a_shape_that_points_cannot_tell():
    """62 Hz is the mode at 65 Hz of MAC 0.9, not that at 2452 Hz of MAC 0.98."""
    computed_hz = np.array([65.0, 2452.0])
    auto_mac = np.array([[1.0, 0.88], [0.88, 1.0]])
    pairs = measured_pairs(np.array([62.0]), computed_hz, np.array([[0.9, 0.98]]), auto_mac)
    assert pairs.index.tolist() == [0]
    assert pairs.doubts == [("these points cannot tell its shape from 2452.00 Hz",)]


def turned(degrees, noise=0.0):
    """Shapes of a pair and of two more modes at 20 readings, and the pair turned in its plane."""
    rng = np.random.default_rng(0)
    phi = rng.normal(size=(20, 4))
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    measured = phi[:, 1:3] @ np.array([[c, -s], [s, c]])
    return phi, measured + noise * rng.normal(size=measured.shape)


@pytest.mark.parametrize("degrees", [0.0, 20.0, 45.0, 70.0])
def test_a_double_mode_in_any_turn_has_the_mac_1_with_its_plane(degrees):
    phi, measured = turned(degrees)
    hz = np.array([80.0, 100.0, 100.0, 140.0])
    np.testing.assert_allclose(mac_near_double(measured, phi, hz)[:, 1:3], 1.0, atol=1e-9)
    pairs = measured_pairs(
        np.array([99.0, 101.0]), hz, mac_near_double(measured, phi, hz), mac(phi, phi)
    )
    assert pairs.index.tolist() == [1, 2]
    assert not any("doubtful" in doubt for doubts in pairs.doubts for doubt in doubts)


def test_modes_that_are_alone_have_their_mac():
    phi, measured = turned(30.0, noise=0.2)
    hz = np.array([80.0, 100.0, 104.1, 140.0])
    np.testing.assert_array_equal(mac_near_double(measured, phi, hz), mac(measured, phi))


def test_the_plane_fades_smoothly_as_the_pair_comes_apart():
    """From the plane's angle to that of the single mode, by no step a mesh could fall on."""
    phi, measured = turned(50.0)
    apart = np.linspace(0.0, 0.045, 200)
    values = np.array(
        [
            mac_near_double(measured, phi, np.array([80.0, 100.0, 100.0 * (1 + d), 140.0]))[0, 1]
            for d in apart
        ]
    )
    assert values[0] > 1 - 1e-9
    assert values[-1] == pytest.approx(mac(measured, phi)[0, 1], abs=1e-9)
    assert np.all(np.diff(values) < 1e-12) and np.diff(values).min() > -0.02
    assert values[apart < 0.005].min() > 0.98  # what meshes do to a double mode
