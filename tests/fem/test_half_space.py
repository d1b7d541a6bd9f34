"""The contact singularity and its cure: a steel block struck in the middle of a held bar's end."""

from typing import NamedTuple

import numpy as np
import pytest
from skfem import MeshHex

from beadwave.fem import (
    Connections,
    HeldFace,
    Material,
    Model,
    assemble,
    contact_patch,
    factorised,
    half_space_matrix,
    half_space_on_mesh,
    joined,
    node_patch,
)
from beadwave.fem.contact import half_space
from beadwave.fem.contact.half_space import boussinesq, cerruti
from beadwave.fem.modes.solver.factorisation import Factor
from beadwave.geometry.meshing.grid_lines import graded

STEEL = Material(210e9, 0.3, 7850.0)
A, B, H = 0.131, 0.099, 0.041  # m


def held_block(contact_seed):
    lines = [graded(-L / 2, L / 2, 0.0, contact_seed, 12e-3) for L in (B, H)]
    x = graded(0.0, A, A, contact_seed, 12e-3)
    mesh = MeshHex.init_tensor(x, *lines)
    faces = {
        "+x": lambda x: np.abs(x[0] - A) < 1e-9,
        "-x": lambda x: np.abs(x[0]) < 1e-9,
    }
    block = assemble({"block": mesh.with_boundaries(faces)}, {"block": STEEL})
    return joined(block, Connections(held=[HeldFace("block:-x")]))


class Solved(NamedTuple):
    model: Model
    factor: Factor

    def compliance(self, w):
        return w @ self.factor.solve(w)

    def of_patch(self, radius, weights="hertz", **options):
        """Of the whole block, and of the half-space on the same mesh."""
        patch = contact_patch(self.model, "block:+x", (0.0, 0.0), radius, weights=weights)
        local = half_space_on_mesh(self.model, "block:+x", patch, STEEL, **options)
        return self.compliance(patch.w), local


@pytest.fixture(scope="module")
def blocks():
    models = {seed: held_block(seed) for seed in (8e-3, 4e-3)}
    return {seed: Solved(model, factorised(model.K)) for seed, model in models.items()}


@pytest.mark.parametrize("weights", ["hertz", "area"])
def test_compliance_beyond_the_half_space_does_not_depend_on_the_patch(blocks, weights):
    # patches from an eighth of an element to more than an element wide
    radii = (1e-3, 3.2e-3, 6.4e-3)
    pairs = np.array([[b.of_patch(radius, weights) for radius in radii] for b in blocks.values()])
    left = pairs[..., 0] - pairs[..., 1]
    assert np.ptp(left[0]) < 0.05 * left.mean()
    assert np.ptp(left[1]) < 0.01 * left.mean()
    # the exact half-space leaves the same as far as the mesh resolves the patch
    exact = {"hertz": 0.6, "area": 16 / (3 * np.pi**2)}[weights]
    exact *= (1 - STEEL.poisson**2) / (STEEL.young * radii[-1])
    assert pairs[1, 2, 0] - exact == pytest.approx(left[1, 2], rel=0.15)


def test_of_a_large_body_the_elements_near_the_patch_are_enough(blocks, monkeypatch):
    solved, sizes = blocks[4e-3], []

    def counting(K):
        sizes.append(K.shape[0])
        return factorised(K)

    monkeypatch.setattr(half_space, "factorised", counting)
    _, full = solved.of_patch(1e-3)
    _, local = solved.of_patch(1e-3, options=half_space.HalfSpaceMesh(large=1000))
    assert sizes[1] < 0.5 * sizes[0]
    assert abs(local / full - 1) < 2e-4  # 5e-6 on a mesh fine enough to make a body that large


def test_the_meshed_half_space_approaches_the_exact_one(blocks):
    exact = 0.6 * (1 - STEEL.poisson**2) / (STEEL.young * 6.4e-3)
    error = [abs(b.of_patch(6.4e-3)[1] / exact - 1) for b in blocks.values()]
    assert error[1] < 0.5 * error[0] and error[1] < 0.02


def test_the_single_node_diverges_like_one_over_the_seed(blocks):
    c = [b.compliance(node_patch(b.model, "block:+x", [(0.0, 0.0)]).w) for b in blocks.values()]
    assert c[1] / c[0] > 1.8


def test_boussinesq_is_the_surface_and_axis_solution_of_the_textbooks():
    E, nu, r = STEEL.young, STEEL.poisson, 0.01
    points, inward = np.array([[0.0, r, 0.0], [-r, 0.0, 0.0]]), np.array([-1.0, 0, 0])
    on_surface, on_axis = boussinesq(points, np.zeros((1, 3)), np.ones(1), inward, STEEL)
    # u_z = (1 - nu^2) / (pi E r), u_r = -(1 + nu)(1 - 2 nu) / (2 pi E r) on the surface;
    # u_z = (1 + nu)(3 - 2 nu) / (2 pi E z) below the force
    assert -on_surface[0] == pytest.approx((1 - nu**2) / (np.pi * E * r))
    assert on_surface[1] == pytest.approx(-(1 + nu) * (1 - 2 * nu) / (2 * np.pi * E * r))
    assert -on_axis[0] == pytest.approx((1 + nu) * (3 - 2 * nu) / (2 * np.pi * E * r))


def test_a_force_shared_by_points_moves_what_its_parts_move_together():
    rng = np.random.default_rng(1)
    inward = np.array([0.6, 0.0, 0.8])
    across = np.array([[0.0, 1.0, 0.0], [0.8, 0.0, -0.6]])
    sources, shares = rng.uniform(-1e-3, 1e-3, (7, 2)) @ across, rng.uniform(0.1, 1.0, 7)
    points = rng.uniform(-0.1, 0.1, (300, 3))
    points -= 2 * np.outer(np.minimum(points @ inward, 0.0), inward)
    together = boussinesq(points, sources, shares, inward, STEEL)
    each = (
        boussinesq(points - source, np.zeros((1, 3)), np.ones(1), inward, STEEL)
        for source in sources
    )
    apart = sum(share * u for share, u in zip(shares, each, strict=True))
    assert np.abs(together - apart).max() < 1e-13 * np.abs(apart).max()


def in_face_left(solved, radius):
    """Compliance (2,) along t1 and t2 without the half-space, and the half-space's (3, 3)."""
    patch = contact_patch(solved.model, "block:+x", (0.01, 0.0), radius)
    local = half_space_matrix(solved.model, "block:+x", patch, STEEL)
    whole = [solved.compliance(each.w) for each in patch.across(solved.model)]
    return np.array(whole) - np.diag(local)[1:], local


def test_compliance_in_the_face_does_not_depend_on_the_patch_nor_on_the_mesh(blocks):
    radii = (1e-3, 2e-3, 4e-3, 6e-3)
    left = np.array([[in_face_left(b, radius)[0] for radius in radii] for b in blocks.values()])
    # over radii 1e-3 on elements of 4 mm and 1.7e-3 on those of 8 mm, wider than the patches;
    # measured 3.2e-4 and 1.6e-3
    spread = np.ptp(left, axis=1) / left.mean(axis=1)
    assert spread[0].max() < 2.5e-3 and spread[1].max() < 1e-3
    # between the meshes, of patches on which the coarse one has an element; measured 6e-4
    assert np.abs(left[0, 2:] / left[1, 2:] - 1).max() < 1e-3


def test_the_meshed_half_space_in_the_face_approaches_the_exact_one(blocks):
    """0.15 (2 - nu) / (G b) along both directions, nothing between directions."""
    b, nu = 6.4e-3, STEEL.poisson
    G = STEEL.young / (2 * (1 + nu))
    for i, solved in enumerate(blocks.values()):
        _, local = in_face_left(solved, b)
        error = np.diag(local)[1:] / (0.15 * (2 - nu) / (G * b)) - 1
        assert np.abs(error).max() < (0.12, 0.05)[i]
        # a mesh is not symmetric beside the place where it is fine: measured 3.9e-3 and 6.2e-3
        assert np.abs(local - np.diag(np.diag(local))).max() < 1e-2 * local[0, 0]


def test_cerruti_and_boussinesq_are_reciprocal():
    """A force along the face moves another point along the normal by as much as that force along
    the normal there moves this point along the face; so do two forces along the face."""
    inward, along = np.array([0.0, 0.6, 0.8]), np.array([1.0, 0.0, 0.0])
    here, there = np.zeros((1, 3)), np.array([[0.004, 0.0024, -0.0018]])
    one = np.ones(1)
    (by_tangential,) = cerruti(there, here, one, inward, along, STEEL)
    (by_normal,) = boussinesq(here, there, one, inward, STEEL)
    assert by_tangential @ inward == pytest.approx(by_normal @ along, rel=1e-12)
    across = np.cross(inward, along)
    (by_other,) = cerruti(here, there, one, inward, across, STEEL)
    assert by_tangential @ across == pytest.approx(by_other @ along, rel=1e-12)


def test_cerruti_holds_the_body_in_equilibrium():
    """(1 - 2 nu) laplacian u + grad div u = 0 inside, by central differences."""
    inward, along, h = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]), 3e-5
    at = np.array([0.003, -0.002, 0.004])

    def u(point):
        return cerruti(point[None], np.zeros((1, 3)), np.ones(1), inward, along, STEEL)[0]

    steps = h * np.eye(3)
    second = np.empty((3, 3, 3))  # d2 u_k / dx_i dx_j
    for i in range(3):
        for j in range(3):
            ends = [(a, b) for a in (1, -1) for b in (1, -1)]
            second[i, j] = sum(a * b * u(at + a * steps[i] + b * steps[j]) for a, b in ends)
    second /= 4 * h * h
    laplacian, of_divergence = np.einsum("iik->k", second), np.einsum("ikk->i", second)
    # the differences leave some (2 h / distance)^2, 1e-4
    residual = (1 - 2 * STEEL.poisson) * laplacian + of_divergence
    assert np.abs(residual).max() < 2e-3 * np.abs(of_divergence).max()
