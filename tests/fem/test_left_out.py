"""Energy of features that a mesh leaves out, of motions whose strains and velocities are known."""

import numpy as np
import pytest
from skfem import MeshHex, MeshTet

from beadwave import fem
from beadwave.fem.errors.left_out import LEFT_OUT_SAFETY, nearest_in_elements

STEEL = fem.Material(210e9, 0.3, 7850.0)
SIDES = np.array([0.1, 0.02, 0.03])
PLACES = np.array([[0.02, 0.0, 0.011], [0.05, 0.02, 0.02], [0.1, 0.01, 0.004]])


def box(kind):
    return kind.init_tensor(
        *(np.linspace(0, side, n) for side, n in zip(SIDES, (5, 3, 4), strict=True))
    )


@pytest.mark.parametrize("kind", [MeshHex, MeshTet])
def test_a_hole_that_is_filled_has_the_energy_of_its_volume(kind):
    """u = (x, -nu y, -nu z) of uniaxial tension has eps : C : eps = E; u = (0, 1, 0) has none; both
    move with omega. Elements hold both exactly."""
    structure = fem.assemble({"bar": box(kind)}, {"bar": STEEL})
    model = fem.joined(structure, fem.Connections())
    pulled = structure.points * [1.0, -STEEL.poisson, -STEEL.poisson]
    moved = np.tile([0.0, 1.0, 0.0], (len(pulled), 1))
    u, omega = np.column_stack([pulled.ravel(), moved.ravel()]), np.array([3e4, 5e3])
    feature = fem.LeftOut("bar", PLACES, 2e-7, 1.7)
    (G,) = fem.energy_left_out(model, {"bar": STEEL}, [feature], u, omega)

    at = PLACES * [1.0, -STEEL.poisson, -STEEL.poisson]
    square = np.array(
        [[np.mean(np.sum(at**2, axis=1)), np.mean(at[:, 1])], [np.mean(at[:, 1]), 1.0]]
    )
    expected = STEEL.density * square * np.outer(omega, omega)
    expected[0, 0] += 1.7 * STEEL.young
    # rounding of single precision
    assert pytest.approx(LEFT_OUT_SAFETY * 2e-7 * expected, rel=1e-5) == G


@pytest.mark.parametrize("kind", [MeshHex, MeshTet])
def test_places_are_found_in_their_elements_and_outside_on_the_surface(kind):
    mesh, outside = box(kind), np.array([[0.11, 0.013, 0.017], [0.03, -0.004, 0.032]])
    inside = np.random.default_rng(0).uniform(0.0, 1.0, (40, 3)) * SIDES
    cells, X = nearest_in_elements(mesh, np.vstack([inside, outside]))
    x = mesh.mapping().F(X, tind=cells)[:, :, 0].T
    off = np.linalg.norm(x[:40] - inside, axis=1)
    assert off.max() < 1e-12
    assert X.min() > -1e-12 and (X.max() if kind is MeshHex else X.sum(axis=0).max()) < 1 + 1e-12
    # no farther from the surface than an element is long
    away = np.linalg.norm(x[40:] - np.clip(outside, 0.0, SIDES), axis=1)
    assert np.all(away < (1e-12 if kind is MeshHex else 0.025))
