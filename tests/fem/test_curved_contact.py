"""Faces in contact that are not plane, beside Hertz' formulas: the gap follows from the meshes."""

from dataclasses import replace

import numpy as np
import pytest
from skfem import MeshHex

from beadwave.fem import Connections, HeldFace, Material, assemble, joined
from beadwave.fem.assembly.trace import face_mean
from beadwave.fem.contact.facing_facets import facing_facets
from beadwave.fem.contact.preloaded_contact import condensed, preloaded_contact
from beadwave.fem.contact.round_face import fitted

E, NU = 210e9, 0.3
STEEL = Material(E, NU, 7850.0)
STAR = E / (2 * (1 - NU**2))
A = 1e-3  # m, radius or half width of the contact


def body(x, y, z, height):
    """A block over a grid whose face at z = 0 is moved to height(x, y), with named faces."""
    mesh = MeshHex.init_tensor(x, y, z)
    p, facets = mesh.p, mesh.boundary_facets()
    end = z[np.argmax(np.abs(z))]
    on = {
        "face": p[2] == 0,
        "far": p[2] == end,
        "x": p[0] == 0,
        "y": p[1] == 0,
        "y1": p[1] == y[-1],
    }
    named = {name: facets[of[mesh.facets[:, facets]].all(axis=0)] for name, of in on.items()}
    moved = p + [[0], [0], [1]] * (height(p[0], p[1]) * (1 - np.abs(p[2] / end)))
    return replace(MeshHex(moved, mesh.t), _boundaries=named)


def pressed(n_first, n_second, radii, line=False):
    """Half or a quarter of two bodies of 14 contact radii, of elements of 0.2 and more of these,
    with faces of radii (m; inf of a plane, < 0 hollow) about one axis or one point."""
    meshes = {}
    for name, n, side, R in (("a", n_second, -1, radii[1]), ("b", n_first, 1, radii[0])):
        fine = np.linspace(0, 1.6 * A, n + 1)
        x = np.concatenate([fine, 1.6 * A * np.geomspace(1.3, 14 / 1.6, 7)])
        z = side * np.concatenate([fine[:-1:2], 1.6 * A * np.geomspace(1.0, 14 / 1.6, 6)])
        y = np.linspace(0, A, 3) if line else x

        def height(x, y, side=side, R=R):
            r2 = x**2 if line else x**2 + y**2
            return side * np.sign(R) * (abs(R) - np.sqrt(R**2 - r2)) if np.isfinite(R) else 0 * x

        meshes[name] = body(x, y, np.sort(z), height)
    structure = assemble(meshes, dict.fromkeys(meshes, STEEL))
    held = [HeldFace(f"{name}:{face}", face) for name in meshes for face in "xy"]
    held += [HeldFace("a:far", "z"), *(HeldFace(f"{name}:y1", "y") for name in meshes if line)]
    model = joined(structure, Connections(held=held))
    facets = facing_facets(structure, "b:face", "a:face", gap=5e-4)
    contact = condensed(model.K, model.M, model.T, facets, 300 * E / np.sqrt(facets.whole))

    R = 1 / (1 / radii[0] + 1 / radii[1])
    p_0 = STAR * A / (2 * R) if line else 2 * STAR * A / (np.pi * R)
    force = np.pi / 2 * p_0 * A * A / 2 if line else 2 / 3 * p_0 * np.pi * A**2 / 4
    far, F = face_mean(structure, "b:far"), np.zeros((len(structure.points), 3))
    F[far.node, 2] = -far.share * force
    return preloaded_contact(contact, model.T.T @ F.ravel()), R, p_0, force


@pytest.mark.parametrize(
    ("n", "radii", "line"),
    [
        pytest.param((8, 8), (0.02, np.inf), True, id="cylinder on a plate"),
        pytest.param((8, 10), (0.02, np.inf), True, id="cylinder on a plate of another mesh"),
        pytest.param(
            (8, 10), (0.02, np.inf), False, id="ball on a plate of another mesh",
            marks=pytest.mark.slow,
        ),
        pytest.param((8, 8), (0.02, -0.03), False, id="ball in a seat", marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_round_faces_press_as_hertz_says(n, radii, line):
    """Facets of a fifth of the contact radius: their mean pressure within 3 %, the zone within a
    facet. The gap is that of the true faces, not that of the chords, which is up to 6 % of it."""
    state, R, p_0, force = pressed(*n, radii, line)
    x, y, _ = state.facets.points.T
    r2 = x**2 if line else x**2 + y**2
    near = r2 < (1.5 * A) ** 2
    np.testing.assert_allclose(state.facets.gap[near], (r2 / (2 * R))[near], rtol=0.02, atol=2e-7)
    # forces are along normals that turn by a fortieth at the edge of the contact
    assert state.force == pytest.approx(force, rel=1e-3)
    assert state.zone_area == pytest.approx(A * A if line else np.pi * A**2 / 4, rel=0.1)
    inner = r2 < (0.65 * A) ** 2
    exact = p_0 * np.sqrt(1 - r2[inner] / A**2)
    np.testing.assert_allclose(state.pressure[inner], exact, rtol=0.03)


def test_a_round_face_is_found_by_its_corners():
    """A ball's cap, a skew cylinder of triangles, a plane and a saddle."""
    rng = np.random.default_rng(0)

    def facets(surface, normal):
        u = rng.uniform(-0.4, 0.4, (40, 1, 2)) + 0.05 * rng.uniform(-1, 1, (40, 3, 2))
        return surface(u[..., 0], u[..., 1]), normal(u[:, 0, 0], u[:, 0, 1])

    def on_ball(u, v):
        n = np.stack([u, v, np.sqrt(1 - u**2 - v**2)], axis=-1)
        return n

    centre = np.array([1.0, 2.0, 3.0])
    ball = fitted(*facets(lambda u, v: centre + 0.5 * on_ball(u, v), on_ball))
    assert ball.axis is None and ball.radius == pytest.approx(0.5, rel=1e-9)
    np.testing.assert_allclose(ball.centre, centre, rtol=1e-9)

    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]

    def around(u, v):
        return np.stack([np.sin(u), 0 * u, np.cos(u)], axis=-1) @ turn.T

    def on_cylinder(u, v):
        return 0.2 * around(u, v) + np.multiply.outer(v, turn[:, 1])

    tube = fitted(*facets(on_cylinder, around))
    assert tube.radius == pytest.approx(0.2, rel=1e-6)
    assert abs(tube.axis @ turn[:, 1]) == pytest.approx(1.0, abs=1e-9)
    n, near = around(np.zeros(1), np.zeros(1)), np.zeros(1)
    assert tube.distance(0.25 * n, -n, near) == pytest.approx(0.05, rel=1e-6)

    plane = facets(
        lambda u, v: np.stack([u, v, 0 * u], -1), lambda u, v: np.tile([0, 0, 1.0], (40, 1))
    )
    assert fitted(*plane) is None

    def saddle(u, v):
        return np.stack([u, v, u * v], axis=-1)

    def of_saddle(u, v):
        n = np.stack([-v, -u, 1 + 0 * u], axis=-1)
        return n / np.linalg.norm(n, axis=1)[:, None]

    assert fitted(*facets(saddle, of_saddle)) is None
