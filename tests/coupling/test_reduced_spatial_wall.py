"""The wall along n, t1 and t2: statics, the half-space, turned structures, refusals."""

import numpy as np
import pytest
from skfem import MeshHex

from beadwave.coupling import CouplingError, ModalDamping
from beadwave.coupling.reduced_spatial_wall import half_space_of, spatial_wall_of, with_stingers
from beadwave.coupling.reduced_wall import wall_from_reduced
from beadwave.fem import (
    Connections,
    HeldFace,
    assemble,
    contact_patch,
    factorised,
    half_space_matrix,
    joined,
)
from beadwave.rom import (
    LOSS,
    ColumnOptions,
    Columns,
    Contact,
    Selection,
    craig_bampton,
    free_modes,
    with_columns,
)

from known_models import STEEL

TO_HZ = 12e3
SIZE = {"x": 0.131, "y": 0.099, "z": 0.041}  # m
CELLS = {"x": 6, "y": 7, "z": 4}


def held_block(order="xyz"):
    """A block held at -x; `order` names which of its lengths lies along x, y and z."""
    mesh = MeshHex.init_tensor(
        *[np.linspace(-SIZE[a] / 2, SIZE[a] / 2, CELLS[a] + 1) for a in order]
    )
    ends = {
        f"{sign}{axis}": (lambda x, i=i, at=s * SIZE[order[i]] / 2: np.abs(x[i] - at) < 1e-9)
        for i, axis in enumerate("xyz")
        for sign, s in (("+", 1), ("-", -1))
    }
    structure = assemble({"block": mesh.with_boundaries(ends)}, {"block": STEEL})
    return joined(structure, Connections(held=[HeldFace("block:-x")]))


def reduced_block(model, at, shaker_on, shaker_at, radius=3e-3, kind="free-modes"):
    """The block struck on +x and shaken normal to another face, with a sensor at its middle."""
    patch = contact_patch(model, "block:+x", at, radius)
    shaker = contact_patch(model, shaker_on, shaker_at, 4e-3, weights="area").w
    B = np.column_stack([*(each.w for each in patch.across(model)), shaker])
    factor = factorised(model.K)
    selection = Selection(25, to_hz=TO_HZ, choice="contact")
    options = {"factor": factor, "factorise": factorised}
    if kind == "free-modes":
        reduced = free_modes(model.K, model.M, patch.w, selection, **options)
    else:
        boundary = np.flatnonzero(patch.w)
        reduced = craig_bampton(model.K, model.M, patch.w, boundary, selection, **options)
    reduced, columns = with_columns(
        reduced, model.K, model.M, B, options=ColumnOptions(TO_HZ), **options
    )
    half_space = half_space_matrix(model, "block:+x", patch, STEEL)
    return reduced._replace(
        columns=Columns(columns[:, :2], half_space, patch.axes, load=columns[:, 2:])
    )


def receptance(wall, hz):
    """(4, 4) between n, t1, t2 and the shaker, without what follows the force at once."""
    P = np.column_stack([wall.phi, wall.load])
    return (P.T / (wall.omega**2 * (1 + 1j * LOSS) - (2 * np.pi * hz) ** 2)) @ P


@pytest.mark.parametrize("kind", ["craig-bampton", "free-modes"])
@pytest.mark.parametrize("cutoff_hz", [None, 6e3])
def test_the_static_compliance_in_all_directions_is_the_structures_less_the_half_space(
    kind, cutoff_hz
):
    model = held_block()
    reduced = reduced_block(model, (0.012, 0.003), "block:+y", (0.01, 0.0), kind=kind)
    wall = spatial_wall_of(reduced, cutoff_hz=cutoff_hz)
    patch = contact_patch(model, "block:+x", (0.012, 0.003), 3e-3)
    W = np.column_stack([patch.w, *(each.w for each in patch.across(model))])
    exact = W.T @ factorised(model.K).solve(np.asfortranarray(W))
    of_wall = receptance(wall, 0.0)[:3, :3].real * (1 + LOSS**2)
    assert np.abs(of_wall - exact).max() < 1e-10 * exact.max()
    np.testing.assert_array_equal(wall.residual_compliance, -reduced.columns.half_space)


def test_oscillators_for_the_modes_above_the_cutoff_have_their_moments():
    """Between all functionals, sum Phi Phi / omega^2 and omega^4 of all modes."""
    reduced = reduced_block(held_block(), (0.012, 0.003), "block:+y", (0.01, 0.0))
    whole, cut = (spatial_wall_of(reduced, cutoff_hz=hz) for hz in (1e9, 6e3))
    assert len(cut.omega) < 0.5 * len(whole.omega)
    for power in (2, 4):
        first, second = (
            (np.column_stack([w.phi, w.load]) / w.omega[:, None] ** power).T
            @ np.column_stack([w.phi, w.load])
            for w in (whole, cut)
        )
        assert np.abs(second - first).max() < 1e-10 * np.abs(first).max()


def test_along_the_normal_it_is_the_wall_of_one_direction():
    reduced = reduced_block(held_block(), (0.012, 0.003), "block:+y", (0.01, 0.0))
    half_space = float(reduced.columns.half_space[0, 0])
    along = wall_from_reduced(reduced, half_space=half_space, damping=ModalDamping(0.01))
    wall = spatial_wall_of(reduced, damping=ModalDamping(0.01))
    low = wall.omega < 2 * np.pi * TO_HZ
    n = np.count_nonzero(low)
    np.testing.assert_allclose(wall.omega[low], along.omega[:n], rtol=1e-12)
    np.testing.assert_allclose(wall.phi[low, 0] ** 2, along.phi[:n] ** 2, atol=1e-12)
    np.testing.assert_array_equal(wall.zeta, 0.01)
    assert wall.residual_compliance[0, 0] == along.residual_compliance


def test_a_structure_turned_by_a_right_angle_gives_the_turned_wall():
    """Turned about x by 90 degrees y becomes z and z becomes -y. The struck face is +x, so that n
    is -x, t1 = y and t2 = -z: what t1 was is -t2 now, and what t2 was is t1."""
    walls = [
        spatial_wall_of(reduced_block(held_block(), (0.012, 0.003), "block:+y", (0.01, 0.004))),
        spatial_wall_of(
            # (y, z) = (0.012, 0.003) goes to (-0.003, 0.012); on +y (x, z) to (x, y) on +z
            reduced_block(held_block("xzy"), (-0.003, 0.012), "block:+z", (0.01, -0.004))
        ),
    ]
    Q = np.eye(4)
    Q[1:3, 1:3] = [[0.0, -1.0], [1.0, 0.0]]  # t1 -> -t2', t2 -> t1'
    for hz in (0.0, 900.0, 3e3, 9e3):
        first, second = (receptance(wall, hz) for wall in walls)
        assert np.abs(Q @ second @ Q.T - first).max() < 1e-9 * np.abs(first).max()
    first, second = (wall.residual_compliance for wall in walls)
    Q = Q[:3, :3]
    assert np.abs(Q @ second @ Q.T - first).max() < 1e-9 * np.abs(first).max()


def test_a_mirrored_structure_gives_the_mirrored_wall():
    """A contact on the plane z = 0 of symmetry: forces along n and t1 = y move nothing along t2."""
    reduced = reduced_block(held_block(), (0.012, 0.0), "block:+y", (0.01, 0.0))
    wall = spatial_wall_of(reduced)
    for hz in (0.0, 3e3):
        H = np.abs(receptance(wall, hz))
        assert H[2, [0, 1, 3]].max() < 1e-8 * H[2, 2]
        assert H[0, 1] > 0.01 * H[0, 0]


def test_damping_of_the_model_and_of_the_law_add_up():
    reduced = reduced_block(held_block(), (0.012, 0.003), "block:+y", (0.01, 0.0))
    stiffness = reduced._replace(C=1e-7 * reduced.K)
    wall = spatial_wall_of(stiffness, damping=ModalDamping(0.01))
    np.testing.assert_allclose(wall.zeta, 0.01 + 0.5e-7 * wall.omega, rtol=1e-6)


def test_the_half_space_in_the_face_follows_from_that_along_the_normal():
    reduced = reduced_block(held_block(), (0.012, 0.003), "block:+y", (0.01, 0.0))
    nu, b, E = 0.25, 3e-3, 1e11
    G = E / (2 * (1 + nu))
    normal = 0.6 * (1 - nu**2) / (E * b)
    stated = reduced._replace(
        columns=reduced.columns._replace(half_space=None), contact=Contact(normal, poisson=nu)
    )
    in_face = 0.15 * (2 - nu) / (G * b)
    np.testing.assert_allclose(half_space_of(stated), np.diag([normal, in_face, in_face]))


def test_a_model_of_one_direction_is_refused():
    model = held_block()
    patch = contact_patch(model, "block:+x", (0.0, 0.0), 3e-3)
    reduced = free_modes(model.K, model.M, patch.w, Selection(5))
    with pytest.raises(CouplingError, match="along the normal only"):
        spatial_wall_of(reduced)


def test_a_stinger_is_a_spring_to_the_ground_at_its_shaker():
    model, k = held_block(), 5e9
    reduced = reduced_block(model, (0.012, 0.003), "block:+y", (0.01, 0.0))
    wall = spatial_wall_of(with_stingers(reduced, np.array([k])))
    patch = contact_patch(model, "block:+x", (0.012, 0.003), 3e-3)
    shaker = contact_patch(model, "block:+y", (0.01, 0.0), 4e-3, weights="area").w
    W = np.column_stack([patch.w, *(each.w for each in patch.across(model)), shaker])
    # the compliance C of the structure alone, and that with the spring by Sherman and Morrison
    C = W.T @ factorised(model.K).solve(np.asfortranarray(W))
    exact = C - np.outer(C[:, 3], C[3]) * k / (1 + k * C[3, 3])
    of_wall = receptance(wall, 0.0).real * (1 + LOSS**2)
    assert np.abs(of_wall - exact).max() < 1e-9 * exact.max()
    assert np.abs(exact - C).max() > 0.05 * C[3, 3]
