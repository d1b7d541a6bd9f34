"""Contact under preload: patch tests, Hertz, bodies that contact and bolts alone hold."""

import numpy as np
import pytest
from skfem import MeshHex

from beadwave.fem import Connections, HeldFace, Load, Material, Rod, Tie, assemble, joined, modes
from beadwave.fem.assembly.trace import face_mean
from beadwave.fem.contact.facing_facets import clipped, facing_facets
from beadwave.fem.contact.further_states import modes_about
from beadwave.fem.contact.preloaded_contact import (
    OPEN,
    SLIDING,
    condensed,
    preloaded_contact,
    with_friction,
)
from beadwave.fem.contact.pressed_model import PairInContact, pressed_assembly, pressed_model

E = 210e9
STEEL = Material(E, 0.3, 7850.0)
SIDE, HEIGHT = 0.02, 0.01


def block(x, z, tetrahedra=False):
    """A block over a grid x in both directions of the plane, with named faces."""
    mesh = MeshHex.init_tensor(x, x, z)
    if tetrahedra:
        mesh = mesh.to_meshtet()
    at = {"bottom": (2, z[0]), "top": (2, z[-1]), "x": (0, x[0]), "y": (1, x[0])}
    named = {
        name: (lambda p, axis=axis, value=value: np.isclose(p[axis], value, atol=1e-12))
        for name, (axis, value) in at.items()
    }
    return mesh.with_boundaries(named)


def two_blocks(first, second, tetrahedra=False):
    """One block on another, of `first` and `second` elements across."""
    grids = [np.linspace(0, SIDE, n + 1) for n in (first, second)]
    heights = np.linspace(0, HEIGHT, 3), np.linspace(HEIGHT, 2 * HEIGHT, 3)
    meshes = {
        name: block(grid, z, tetrahedra)
        for name, grid, z in zip(("a", "b"), grids, heights, strict=True)
    }
    return assemble(meshes, dict.fromkeys(meshes, STEEL))


SLIDES = [HeldFace(f"{body}:{face}", face) for body in "ab" for face in "xy"]


@pytest.mark.parametrize("tetrahedra", [False, True])
@pytest.mark.parametrize(("first", "second"), [(2, 2), (2, 3), (3, 5)])
def test_an_even_pressure_passes_matching_and_other_faces_exactly(tetrahedra, first, second):
    """Uniaxial stress, of which both elements have the displacements: to rounding. The upper block
    has nothing below it but the contact."""
    structure = two_blocks(first, second, tetrahedra)
    model = joined(structure, Connections(held=[HeldFace("a:bottom", "z"), *SLIDES]))
    facets = facing_facets(structure, "a:top", "b:bottom")
    assert facets.area.sum() == pytest.approx(SIDE**2, rel=1e-12)
    layer = np.full(len(facets.area), 1e3 * E / HEIGHT)
    contact = condensed(model.K, model.M, model.T, facets, layer)

    p, top = 1e8, face_mean(structure, "b:top")
    F = np.zeros((len(structure.points), 3))
    F[top.node, 2] = -top.share * p * SIDE**2
    state = preloaded_contact(contact, model.T.T @ F.ravel())
    np.testing.assert_allclose(state.pressure, p, rtol=1e-9)
    u = (model.T @ state.u).reshape(-1, 3)
    exact = -p / E * structure.points[:, 2]
    exact[structure.first["b"] // 3 :] -= p / layer[0]
    np.testing.assert_allclose(u[:, 2], exact, atol=1e-9 * np.abs(exact).max())


def test_other_layers_change_the_interface_as_in_a_model_assembled_anew():
    """Woodbury's formula against K + C^T k C, of layers that open, soften and stiffen."""
    structure = two_blocks(2, 3)
    model = joined(structure, Connections(held=[HeldFace("a:bottom"), HeldFace("b:x", "x")]))
    facets = facing_facets(structure, "a:top", "b:bottom")
    contact = condensed(model.K, model.M, model.T, facets, np.full(len(facets.area), 1e13))
    rng, C = np.random.default_rng(0), contact.C.toarray()
    other = contact.interface.layers * rng.choice([0.0, 0.2, 1.0, 3.0], len(C))
    F = rng.standard_normal(model.K.shape[0])
    anew = np.linalg.inv(model.K.toarray() + (C.T * other) @ C)
    rows = rng.permutation(len(C))[: len(C) // 2]
    W, d = contact.interface.changed(other, rows, C @ contact.factor.solve(F))
    exact = C[rows] @ anew @ F
    np.testing.assert_allclose(d, exact, atol=1e-7 * np.abs(exact).max())
    exact = C[rows] @ anew @ C[rows].T
    np.testing.assert_allclose(W, exact, atol=1e-7 * np.abs(exact).max())


def test_a_clipped_polygon_has_the_area_that_both_have_in_common():
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    part = clipped(square[None], square[None] + 0.25)[0]
    x, y = part.T
    area = (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2
    assert area == pytest.approx(0.75**2, rel=1e-12)
    apart = clipped(square[None], square[None] + 2.0)[0]
    assert np.ptp(apart, axis=0).max() == 0.0


@pytest.mark.slow
def test_a_gap_of_a_sphere_gives_hertz_pressure_and_zone():
    """A quarter of two blocks of 14 contact radii with the gap r^2 / 2R; p_0 and a of Hertz'
    formulas. Facets at the middle are a fifth of a: their mean pressure is 1 % below p_0, and the
    zone ends within a facet."""
    a = 1e-3
    fine = np.linspace(0, 1.6 * a, 9)
    x = np.concatenate([fine, 1.6 * a * np.geomspace(1.3, 14 / 1.6, 7)])
    z = np.concatenate([fine[:-1:2], 1.6 * a * np.geomspace(1.0, 14 / 1.6, 6)])
    meshes = {"a": block(x, -z[::-1]), "b": block(x, z)}
    structure = assemble(meshes, dict.fromkeys(meshes, STEEL))
    model = joined(structure, Connections(held=[HeldFace("a:bottom", "z"), *SLIDES]))
    facets = facing_facets(structure, "a:top", "b:bottom")
    contact = condensed(model.K, model.M, model.T, facets, 300 * E / np.sqrt(facets.area))
    star = E / (2 * (1 - 0.3**2))
    p_0 = 2e9
    R = 2 * star * a / (np.pi * p_0)
    P = 2 / 3 * p_0 * np.pi * a**2
    top = face_mean(structure, "b:top")
    F = np.zeros((len(structure.points), 3))
    F[top.node, 2] = -top.share * P / 4
    r = np.linalg.norm(facets.points[:, :2], axis=1)
    state = preloaded_contact(contact, model.T.T @ F.ravel(), gap=r**2 / (2 * R))
    assert state.force == pytest.approx(P / 4, rel=1e-9)
    assert state.zone_area == pytest.approx(np.pi * a**2 / 4, rel=0.1)
    inner = r < 0.65 * a
    hertz = p_0 * np.sqrt(1 - (r[inner] / a) ** 2)
    np.testing.assert_allclose(state.pressure[inner], hertz, rtol=0.03)
    assert np.all(state.gap[state.state == OPEN] >= 0)


@pytest.mark.parametrize("share", [0.3, 0.6])
def test_a_pressed_bar_slips_from_its_pulled_end_as_far_as_friction_asks(share):
    """A bar that an even pressure holds on a rigid base by friction f per length, pulled by
    F < f L: it slips over F / f. Facets are a 60th of the bar; it is a 100th high."""
    L, w, h, mu, p, n = 0.1, 2e-3, 1e-3, 0.3, 1e6, 60
    material = Material(E, 0.0, 7850.0)
    x, y = np.linspace(0, L, n + 1), np.linspace(0, w, 3)
    meshes = {}
    for body, z in (("base", [-h, 0.0]), ("bar", [0.0, h])):
        mesh = MeshHex.init_tensor(x, y, np.array(z))
        at = {"bottom": (2, z[0]), "top": (2, z[1]), "end": (0, L)}
        meshes[body] = mesh.with_boundaries(
            {
                name: (lambda q, axis=axis, value=value: np.isclose(q[axis], value, atol=1e-9))
                for name, (axis, value) in at.items()
            }
        )
    structure = assemble(meshes, dict.fromkeys(meshes, material))
    model = joined(structure, Connections(held=[HeldFace("base:bottom"), HeldFace("base:top")]))
    facets = facing_facets(structure, "bar:bottom", "base:top")
    contact = condensed(model.K, model.M, model.T, facets, np.full(2 * n, 300 * E / h))

    f, F = mu * p * w, np.zeros((len(structure.points), 3))
    pull = share * f * L
    top, end = face_mean(structure, "bar:top"), face_mean(structure, "bar:end")
    F[top.node, 2] = -top.share * p * w * L
    F[end.node, 0] = end.share * pull
    load = model.T.T @ F.ravel()
    state = with_friction(contact, preloaded_contact(contact, load), load, np.full(2 * n, mu))
    sliding, shear = state.state == SLIDING, np.hypot(*state.shear)
    P = state.pressure * facets.area
    assert facets.points[sliding, 0].min() > facets.points[~sliding, 0].max()
    assert state.zone_area == pytest.approx(L * w)
    assert facets.area[sliding].sum() == pytest.approx(share * L * w, abs=1.5 * L * w / n)
    np.testing.assert_allclose(shear[sliding], mu * P[sliding], rtol=1e-6)
    assert np.all(shear[~sliding] <= mu * P[~sliding] * (1 + 1e-9))
    # a 1e-8 of the layers is left where they slide
    assert shear.sum() == pytest.approx(pull, rel=2e-3)


def pressing(tension, friction, rough=0.0, flatness=0.0):
    """The rod between the outer faces of two blocks, and the faces that it presses."""
    load = Load(rods=[Rod("a:bottom", "b:top", tension, 1e8)])
    pair, bolt = Tie("b:bottom", "a:top"), (np.array([0.01, 0.01, HEIGHT]), 1e7)
    return load, [PairInContact(pair, friction, rough, [bolt], flatness)]


def condensed_blocks(first=2, second=3):
    """Two free blocks whose faces are condensed."""
    open_model = joined(two_blocks(first, second), Connections())
    return pressed_assembly(open_model, {"a": STEEL, "b": STEEL}, *pressing(1.0, 0.0))


def pressed(tension, friction, rough=0.0):
    """Two free blocks that a rod between their outer faces presses."""
    return pressed_model(condensed_blocks(), *pressing(tension, friction, rough))


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_free_bodies_that_a_rod_presses_keep_six_rigid_motions(friction):
    """The geometric stiffness of the rod's tension, of the compression and of the pressure that
    turns with its face cancel in every rigid motion: below a millionth of the first elastic mode's
    omega^2 at 1 MN."""
    model = pressed(1e6, friction)
    assert model.contact.force == pytest.approx(1e6, rel=1e-6)
    hz = modes(model.K, model.M, 8).frequency_hz
    assert np.all(hz[:6] < 1e-3 * hz[6])


def test_the_zone_and_the_frequencies_of_hard_faces_do_not_follow_the_preload():
    """1 N and 10 kN: equal but for the geometric stiffness, which is 1e-5 of K here."""
    weak, strong = pressed(1.0, 0.3), pressed(1e4, 0.3)
    assert np.array_equal(weak.contact.state, strong.contact.state)
    hz = [modes(model.K, model.M, 10).frequency_hz[6:] for model in (weak, strong)]
    np.testing.assert_allclose(hz[0], hz[1], rtol=1e-3)


def test_rough_faces_stiffen_with_preload_and_friction_adds_stiffness():
    weak, strong, hard = (
        modes(m.K, m.M, 8).frequency_hz[6:]
        for m in (pressed(100.0, 0.3, 1e-6), pressed(1e4, 0.3, 1e-6), pressed(1e4, 0.3))
    )
    assert np.all(weak < strong) and np.all(strong < hard)
    model = pressed(1e4, 0.0)
    assert set(model.contact.state) == {SLIDING}
    assert np.all(modes(model.K, model.M, 8).frequency_hz[6:] < hard)


@pytest.mark.parametrize("further", [(1e4, 0.3, 1e-6), (1e6, 0.0, 0.0), (10.0, 0.3, 1e-7)])
def test_modes_about_further_states_are_those_of_a_factor_of_their_own(further):
    """From modes about another state, to the error that is asked; geometric stiffness included,
    which at 1 MN is a thousandth of K."""
    blocks = condensed_blocks()
    first = pressed_model(blocks, *pressing(1e4, 0.3))
    known = modes(first.K, first.M, 24).phi
    other = pressed_model(blocks, *pressing(*further))
    found = modes_about(blocks, other, known, 16, error=1e-7)
    exact = modes(other.K, other.M, 16).omega
    assert found.error < 1e-7
    np.testing.assert_allclose(found.modes.omega[6:], exact[6:], rtol=1e-7)
    assert np.all(found.modes.omega[:6] < 1e-3 * exact[6])
    phi = found.modes.phi[:, 6:]
    residual = other.K @ phi - (other.M @ phi) * found.modes.omega[6:] ** 2
    force = np.linalg.norm((other.M @ phi) * found.modes.omega[6:] ** 2, axis=0)
    assert np.all(np.linalg.norm(residual, axis=0) < 1e-2 * force)


def test_crowned_faces_flatten_under_the_preload():
    """Touching in the middle or at the rim, by 0.2 um: the zone and the frequencies rise with the
    preload towards those of plane faces, which 1 MN reaches within 1 %."""
    blocks = condensed_blocks(4, 6)
    flat = pressed_model(blocks, *pressing(1e4, 0.3))
    for flatness in (2e-7, -2e-7):
        states = [
            pressed_model(blocks, *pressing(tension, 0.3, 0.0, flatness))
            for tension in (10.0, 1e3, 1e6)
        ]
        areas = [model.contact.zone_area for model in states]
        assert areas[0] < areas[1] <= areas[2] == pytest.approx(flat.contact.zone_area)
        r = np.linalg.norm(blocks.contact.facets.points - [0.01, 0.01, HEIGHT], axis=1)
        opened = states[0].contact.state == OPEN
        assert (r[opened].min() > r[~opened].min()) == (flatness > 0)
        hz = [modes(m.K, m.M, 8).frequency_hz[6:] for m in (*states, flat)]
        assert np.all(hz[0] < hz[1] * (1 + 1e-9)) and np.all(hz[0] < hz[3])
        np.testing.assert_allclose(hz[2], hz[3], rtol=0.02)


def test_forces_that_open_the_contact_are_refused():
    with pytest.raises(ValueError, match="open all of the contact"):
        pressed(-1e3, 0.3)
