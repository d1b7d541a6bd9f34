"""Bodies of a STEP file as tetrahedra that share no node, and CalculiX' own tie between them."""

import numpy as np
import pytest
from skfem import MeshHex

from beadwave import fem
from beadwave.geometry.cad.occ import write_step
from beadwave.geometry.cad.shapes import Box, Cylinder

from peer_programs import require_program
from programs.calculix import PACKAGE, PROGRAM, answer
from programs.calculix_tied import Screw, tied_deck
from programs.step_tetrahedra import ElementSizes, StepPatch, step_tetrahedra

STEEL = fem.Material(210e9, 0.3, 7850.0)
HALF, SLENDER, LOWER, UPPER = 0.03, 0.01, 0.05, 0.12  # m
RADIUS = 4e-3  # m
IN = np.array([0.0, 0.0, -1.0])
SIZES = ElementSizes({"lower": 15e-3, "upper": 8e-3}, rim=3e-3, disc=1.5e-3)


def meshed(folder, upper):
    """A wide block on the ground, which is left out, and something on top that is pressed."""
    shapes = {
        "lower": Box((2 * HALF, 2 * HALF, LOWER), at=(0.0, 0.0, LOWER / 2)),
        "ground": Box((0.2, 0.2, 0.1), at=(0.0, 0.0, -0.05)),
        "upper": upper,
    }
    write_step(shapes, folder / "blocks.step")
    top = StepPatch("upper", np.array([0.0, 0.0, UPPER]), -IN, RADIUS)
    return step_tetrahedra(folder / "blocks.step", SIZES, top)


def area(mesh, triangles):
    a, b, c = mesh.points[triangles[:, :3]].swapaxes(0, 1)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


def volume(mesh, body):
    a, b, c, d = mesh.points[mesh.cells[body][:, :4]].swapaxes(0, 1)
    return np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a).sum() / 6


def test_touching_faces_and_the_disc_are_imprinted_on_bodies_that_share_no_node(tmp_path):
    """Straight chords leave 1 % of the areas of circles."""
    at = (0.0, 0.0, (LOWER + UPPER) / 2)
    mesh = meshed(tmp_path, Cylinder(0.02, UPPER - LOWER, at=at))
    assert volume(mesh, "lower") == pytest.approx((2 * HALF) ** 2 * LOWER, rel=1e-9)
    assert set(mesh.cells) == {"lower", "upper"}
    lower, upper = (set(mesh.cells[body].ravel()) for body in ("lower", "upper"))
    assert not lower & upper
    circle = np.pi * 0.02**2
    assert set(mesh.touching) == {("lower", "ground"), ("lower", "upper"), ("upper", "lower")}
    for pair, true in {("lower", "upper"): circle, ("upper", "lower"): circle,
                       ("lower", "ground"): (2 * HALF) ** 2}.items():  # fmt: skip
        assert area(mesh, mesh.touching[pair]) == pytest.approx(true, rel=0.02), pair
        assert set(mesh.touching[pair].ravel()) <= {"lower": lower, "upper": upper}[pair[0]]
    assert area(mesh, mesh.disc) == pytest.approx(np.pi * RADIUS**2, rel=0.03)


SLENDER_BLOCK = Box((2 * SLENDER, 2 * SLENDER, UPPER - LOWER), at=(0.0, 0.0, (LOWER + UPPER) / 2))


def blocks(n):
    wide, slender = np.linspace(-HALF, HALF, 3 * n + 1), np.linspace(-SLENDER, SLENDER, 4 * n + 1)
    lower = MeshHex.init_tensor(wide, wide, np.linspace(0, LOWER, 2 * n + 1))
    upper = MeshHex.init_tensor(slender, slender, np.linspace(LOWER, UPPER, 6 * n + 1))
    return (
        lower.with_boundaries({"base": at(0.0), "top": at(LOWER)}),
        upper.with_boundaries({"foot": at(LOWER), "top": at(UPPER)}),
    )


def ours(n):
    """Ten frequencies and the compliance of the pressed disc by our hexahedra and tie."""
    meshes = dict(zip(("lower", "upper"), blocks(n), strict=True))
    structure = fem.assemble(meshes, dict.fromkeys(meshes, STEEL))
    how = fem.Connections(
        ties=[fem.Tie("upper:foot", "lower:top")], held=[fem.HeldFace("lower:base")]
    )
    model = fem.joined(structure, how)
    w = fem.contact_patch(model, "upper:top", (0.0, 0.0), RADIUS, weights="area").w
    return fem.modes(model.K, model.M, 10).frequency_hz, w @ fem.factorised(model.K).solve(w)


def at(z):
    return lambda x: np.abs(x[2] - z) < 1e-9


def by_calculix(mesh, ties=(), screws=()):
    held = mesh.touching["lower", "ground"]
    require_program(PROGRAM, PACKAGE)
    deck = tied_deck(mesh.points, mesh.cells, dict.fromkeys(mesh.cells, STEEL),
                     ties=ties, held=held, disc=(mesh.disc, IN), screws=screws)  # fmt: skip
    return answer(deck)


@pytest.mark.peer
def test_calculix_ties_the_tetrahedra_to_what_our_tied_hexahedra_are(tmp_path):
    """Frequencies and the compliance of a pressed disc, by meshes that have nothing in common: the
    corner where one block stands on the other leaves 1.5 % in ours, which is even."""
    mesh = meshed(tmp_path, SLENDER_BLOCK)
    pair = mesh.touching["upper", "lower"], mesh.touching["lower", "upper"]
    theirs = by_calculix(mesh, [pair])
    hz, compliance = ours(2)
    np.testing.assert_allclose(hz, theirs.frequency_hz[:10], rtol=0.02)
    assert compliance == pytest.approx(theirs.compliance, rel=0.02)
    loose = by_calculix(mesh, [tuple(faces[: len(faces) // 2] for faces in pair)])
    assert loose.frequency_hz[0] < 0.95 * hz[0]


@pytest.mark.peer
def test_a_screw_is_a_rigid_body_of_calculix_on_springs_to_the_mean_motion_under_it(tmp_path):
    """Any of the six halved moves one of the ten frequencies by more than 1 %."""
    k, centre = np.array([1e8, 3e8, 2e8, 2e4, 3e4, 1e4]), np.array([0.0, 0.0, LOWER])
    lower, upper = blocks(2)
    structure = fem.assemble({"lower": lower, "upper": upper}, dict.fromkeys(SIZES.inside, STEEL))
    under = fem.Side("lower:top", "mean", over="upper:foot")
    joint = fem.Joint("screw", fem.Side("upper:foot"), under, centre, fem.Bushing(*k))
    model = fem.joined(
        structure, fem.Connections(joints=[joint], held=[fem.HeldFace("lower:base")])
    )
    hz = fem.modes(model.K, model.M, 10).frequency_hz
    mesh = meshed(tmp_path, SLENDER_BLOCK)

    sides = mesh.touching["upper", "lower"], mesh.touching["lower", "upper"]
    theirs = by_calculix(mesh, screws=[Screw(*sides, lambda x: x[:, 2] > 0.0, centre, k)])
    np.testing.assert_allclose(hz, theirs.frequency_hz[:10], rtol=6e-3)
