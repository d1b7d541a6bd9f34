"""The steel assembly against the thesis' table 5.2, and its contact."""

import numpy as np
import pytest
from skfem import MeshHex

from beadwave.fem import (
    Connections,
    HeldFace,
    Material,
    assemble,
    contact_patch,
    disc_quadrature,
    factorised,
    joined,
    mac,
    modes,
    node_patch,
    pair,
    receptance,
)
from beadwave.fem.modes.solver import receptance as response
from beadwave.workflows.files.scene import scene

from known_models import RIG_TARGETS, rig, steel

STEEL = Material(210e9, 0.3, 7850.0)
SIZES = ("mesh.block_seed=14e-3", "mesh.support_seed=25e-3")
STAGE_1 = ("assembly.parts=['block', 'sheets']", *SIZES, "mesh.contact_seed=14e-3")
FINE = ("mesh.block_seed=14e-3", "mesh.support_seed=25e-3", "mesh.contact_seed=3e-3")


def model(*changes, of="rig-full-tie"):
    parts = rig(*changes, of=of)
    return joined(assemble(parts.meshes, steel(parts.meshes)), parts.connections)


@pytest.fixture(scope="module")
def full():
    return model(*STAGE_1)


@pytest.fixture(scope="module")
def bolted():
    springs = ("joints.head.ky=1.1e6", "joints.head.kz=2.56e7", "joints.head.kry=100.0")
    return model(*FINE, *springs, of="rig-rom")


@pytest.mark.slow
def test_full_tie_matches_the_first_row_of_table_5_2(full):
    computed = modes(full.K, full.M, 18)
    f = computed.frequency_hz[pair(full, computed, RIG_TARGETS).index]
    np.testing.assert_allclose(f[:3], [55.105, 630, 1134], rtol=0.03)
    assert f[3] == pytest.approx(8171.6, rel=0.01)


@pytest.mark.slow
def test_screw_tie_matches_its_first_row_of_table_5_2():
    screwed = model(*STAGE_1, "mesh.seed=5e-3", "assembly.constraint=screw-tie")
    computed = modes(screwed.K, screwed.M, 29)
    f = computed.frequency_hz[pair(screwed, computed, RIG_TARGETS).index]
    np.testing.assert_allclose(f, [35.9, 480.5, 905, 8140], rtol=0.03)


@pytest.mark.slow
def test_modes_are_identified_by_shape_not_by_order(bolted):
    computed = modes(bolted.K, bolted.M, 6)
    pairing = pair(bolted, computed, RIG_TARGETS)
    np.testing.assert_array_equal(pairing.index[:3], [0, 1, 4])
    np.testing.assert_allclose(computed.frequency_hz[[0, 1, 4]], [51, 269, 907], rtol=0.05)
    assert pairing.index[3] == -1 and pairing.score[3] == 0.0


def test_the_structure_has_the_mass_of_its_bodies(full):
    x = np.zeros(full.structure.n_dofs)
    x[0::3] = 1.0
    a = scene("rig-full-tie").rig.assembly
    solid = a.block_x * a.block_y * a.block_z * STEEL.density
    mass = x @ full.structure.M @ x
    sheets = 2 * a.sheet_thickness * a.sheet_width * STEEL.density
    sheets *= a.head_overlap + a.sheet_free_length + a.foot_overlap
    assert solid < mass < solid + sheets


def test_a_free_block_strains_in_no_rigid_mode():
    block = model("assembly.parts=['block']", *SIZES)
    computed = modes(block.K, block.M, 9)
    pairing = pair(block, computed, RIG_TARGETS)
    assert pairing.index[3] >= 6 and pairing.score.max() < 1 + 1e-6
    np.testing.assert_array_equal(pairing.character[3, :6], 0.0)


@pytest.mark.slow
def test_mac_of_modes_with_themselves_is_the_identity_on_its_diagonal(full):
    phi = modes(full.K, full.M, 4).phi
    np.testing.assert_allclose(np.diag(mac(phi, -2 * phi)), 1.0)
    assert mac(phi[:, :1], phi[:, 1:2]).item() < 0.1


@pytest.mark.parametrize(("weights", "second_moment"), [("hertz", 0.4), ("area", 0.5)])
def test_disc_weights_integrate_pressure_exactly(weights, second_moment):
    # <r^2> = int r^2 p dA / int p dA: 2/5 for Hertz' pressure, 1/2 for a uniform one
    points, share = disc_quadrature(weights, 4, 12)
    assert share.sum() == pytest.approx(1.0, abs=1e-14)
    assert share @ np.sum(points**2, axis=1) == pytest.approx(second_moment, abs=1e-14)
    # 48 terms of 1/48 each: eps
    np.testing.assert_allclose(share @ points, 0.0, atol=1e-15)


def test_the_contact_reads_a_rigid_shift_as_that_shift():
    a = scene("rig-full-tie").rig.assembly
    free = model("assembly.parts=['block']", *FINE)
    patch = contact_patch(free, "block:strike", (0.03, 0.0), 2e-3)
    u = np.zeros(len(patch.w))
    u[0::3] = -1.0  # the chain comes from +x and pushes along -x
    # the weights add up to one to 1.2e-13 on any processor
    assert patch.w @ u == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(patch.spot.point, [a.block_x / 2, 0.03, a.block_z / 2])
    read = np.flatnonzero(np.abs(patch.w) > 1e-12)
    assert np.isin(read, patch.boundary).all() and len(patch.boundary) % 3 == 0


@pytest.mark.slow
def test_less_the_half_space_the_contact_does_not_feel_the_patch(bolted):
    factor = factorised(bolted.K)
    left = []
    for b in (4e-3, 6e-3):
        w = contact_patch(bolted, "block:strike", (0.03, 0.0), b).w
        left.append(w @ factor.solve(w) - 0.6 * (1 - 0.3**2) / (210e9 * b))
    assert left[0] == pytest.approx(left[1], rel=0.01)
    node = node_patch(bolted, "block:strike", [(0.03, 0.0)]).w
    assert node @ factor.solve(node) > 1.02 * left[0]


@pytest.mark.slow
def test_the_quadrature_of_the_patch_leaves_less_than_1e_5_of_the_compliance():
    """The disc crosses edges of elements, where shape functions have kinks."""
    tied = model(STAGE_1[0], *FINE, "mesh.seed=12e-3")
    solve = factorised(tied.K).solve
    usual = contact_patch(tied, "block:strike", (0.03, 0.0), 2e-3).w
    exact = contact_patch(tied, "block:strike", (0.03, 0.0), 2e-3, n_radial=96, n_around=288).w
    assert usual @ solve(usual) / (exact @ solve(exact)) == pytest.approx(1.0, abs=1e-5)


def test_the_radius_of_a_node_patch_is_the_root_of_the_mean_square_that_it_reads(full):
    """Two nodes lie equally far from their middle: w reads that distance squared."""
    points = [(0.03, 0.0), (0.01, 0.006)]
    patch = node_patch(full, "block:strike", points)
    squared = ((full.structure.points - patch.spot.point) ** 2)[:, 1:].sum(axis=1)
    assert patch.spot.inward[0] * (patch.on_mesh[0::3] @ squared) == pytest.approx(
        patch.radius**2, rel=1e-12
    )
    assert patch.radius > 5e-3
    assert node_patch(full, "block:strike", points[:1]).radius == 0.0


def test_a_patch_over_the_edge_is_refused(full):
    with pytest.raises(ValueError, match=r"\[0.03, 0.0199\] m from the middle .* leaves the face"):
        contact_patch(full, "block:strike", (0.03, 0.0199), 2e-3)


@pytest.fixture(scope="module")
def held_bar():
    """Of steel, 200 x 20 x 20 mm, held at one end."""
    lines = [np.linspace(-0.01, 0.01, 5)] * 2
    mesh = MeshHex.init_tensor(np.linspace(0.0, 0.2, 21), *lines)
    ends = {"-x": lambda x: x[0] < 1e-9, "+x": lambda x: x[0] > 0.2 - 1e-9}
    bar = assemble({"bar": mesh.with_boundaries(ends)}, {"bar": STEEL})
    return joined(bar, Connections(held=[HeldFace("bar:-x")]))


def test_receptance_at_rest_is_the_static_compliance_and_peaks_at_a_mode(held_bar):
    K, M = held_bar.K, held_bar.M
    w = contact_patch(held_bar, "bar:+x", (0.0, 0.0), 6e-3).w
    static = w @ factorised(K).solve(w)
    assert receptance(K, M, w, [0.0])[0] / static == pytest.approx(1, rel=1e-9)
    lowest = modes(K, M, 12)
    along = np.argmax(np.abs(w @ lowest.phi))  # the first mode that stretches the bar
    omega, phi = lowest.omega[along], w @ lowest.phi[:, along]
    H = receptance(K, M, w, [omega / (2 * np.pi)], loss_factor=0.02)[0]
    peak = phi**2 / omega**2 / 0.02
    assert abs(H.imag) == pytest.approx(peak, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("loss", [0.0, 0.02])
@pytest.mark.parametrize(("vectors", "factors"), [(response.KrylovSettings().vectors, 1), (10, 2)])
def test_projected_receptance_is_the_direct_one_also_where_its_space_ends_too_early(
    held_bar, monkeypatch, loss, vectors, factors
):
    K, M = held_bar.K, held_bar.M
    w = contact_patch(held_bar, "bar:+x", (0.0, 0.0), 6e-3).w
    f = np.array([0.0, 400.0, 18e3])
    too_small = response.KrylovSettings(smallest=len(w) + 1)
    direct = receptance(K, M, w, f, loss_factor=loss, settings=too_small)
    matrices = []
    monkeypatch.setattr(response, "factorised", lambda A: matrices.append(A) or factorised(A))
    settings = response.KrylovSettings(smallest=len(w), vectors=vectors)
    projected = receptance(K, M, w, f, loss_factor=loss, settings=settings)
    assert np.abs(projected / direct - 1).max() < 1e-8
    assert len(matrices) == factors
