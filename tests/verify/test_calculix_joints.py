"""Mesh, constraints and springs of ours in CalculiX (Debian: calculix-ccx), to its digits."""

import numpy as np
import pytest
from scipy.sparse import block_diag, csr_matrix
from skfem import ElementTetP2, MeshHex, MeshTet

from beadwave.fem import (
    Bushing,
    Connections,
    HeldFace,
    Joint,
    Material,
    Model,
    Orthotropic,
    Side,
    SwayingTable,
    assemble,
    contact_patch,
    dashpots,
    factorised,
    joined,
    modes,
    normal_frame,
)
from beadwave.fem.assembly.constraints import congruent, eliminated, fixed
from beadwave.fem.assembly.elasticity import ELEMENTS
from beadwave.fem.assembly.joints import mean_sides
from beadwave.fem.assembly.trace import face_nodes
from beadwave.fem.exchange.abaqus import input_deck

from known_models import rig, steel
from peer_programs import require_program
from programs.calculix import PACKAGE, PROGRAM, answer

pytestmark = pytest.mark.peer
PRINTED = 1e-6  # CalculiX prints seven digits; 4.6e-7 was the largest difference seen
LOWER = 0.05  # m, height of the wide block
NOTHING = np.empty(0, int)
BLOCKS = dict.fromkeys(("lower", "upper"), Material(210e9, 0.3, 7850.0))


@pytest.fixture(autouse=True, scope="module")
def needed():
    require_program(PROGRAM, PACKAGE)


def two_blocks():
    """A slender block on a wider one, meshes that do not match, unmerged."""
    wide, slender = np.linspace(-0.03, 0.03, 3), np.linspace(-0.01, 0.01, 4)
    lower = MeshHex.init_tensor(wide, wide, [0, LOWER / 2, LOWER])
    upper = MeshHex.init_tensor(slender, slender, np.linspace(LOWER, 0.12, 4))
    meshes = {
        "lower": lower.with_boundaries({"base": at(0.0), "top": at(LOWER)}),
        "upper": upper.with_boundaries({"foot": at(LOWER)}),
    }
    return assemble(meshes, BLOCKS)


def at(z):
    return lambda x: np.abs(x[2] - z) < 1e-9


UNDER = Side("lower:top", "mean", over="upper:foot")
SCREW = Joint("screw", Side("upper:foot"), UNDER, np.array([0.0, 0.0, LOWER]))


def with_rigid_body_and_springs(structure, k):
    """The joint as CalculiX knows it: *RIGID BODY on the slender block, springs of two nodes
    to the mean motion of the wide one's face, which stays an equation.
    """
    n = structure.n_dofs
    means = mean_sides(structure, [SCREW], NOTHING, n + 12)
    held = np.concatenate([face_nodes(structure, "lower:base").ravel(), n + np.arange(6)])
    supports = fixed(held, n + 12, "the supports")
    reduction, empty = eliminated(n + 12, [*means, supports]), csr_matrix((12, 12))
    K, M = (
        congruent(reduction.T, block_diag([A, empty], format="csr"))
        for A in (structure.K, structure.M)
    )
    T = reduction.T[:n].tocsr()
    loose = Model(K, M, T, reduction.free, structure, NOTHING, np.empty(0), ())
    shift, turn = (n + 6) // 3 + 1, (n + 9) // 3 + 1  # nodes of the mean motion
    rigid, rotation = turn + 1, turn + 2
    share = face_nodes(structure, "upper:foot")[:, 0] // 3 + 1
    lines = ["*NSET, NSET=SHARE", *(f"{node}," for node in share), "*NODE"]
    lines += [f"{node}, 0, 0, {LOWER}" for node in (rigid, rotation)]
    lines += [f"*RIGID BODY, NSET=SHARE, REF NODE={rigid}, ROT NODE={rotation}"]
    n_elements = sum(basis.nelems for basis in structure.basis.values())
    for i, stiffness in enumerate(k):
        ends = (rigid, shift) if i < 3 else (rotation, turn)
        number, dof = n_elements + 1 + i, i % 3 + 1
        lines += [f"*ELEMENT, TYPE=SPRING2, ELSET=S{i}", f"{number}, {ends[0]}, {ends[1]}"]
        lines += [f"*SPRING, ELSET=S{i}", f"{dof}, {dof}", f"{stiffness:.6e}"]
    return input_deck(loose, BLOCKS).replace("*STEP", "\n".join([*lines, "*STEP"]))


def test_a_screw_is_calculix_rigid_body_and_its_springs():
    structure, k = two_blocks(), Bushing(1e8, 3e8, 2e8, 2e4, 3e4, 1e4)
    screw = SCREW._replace(springs=k)
    model = joined(structure, Connections(joints=[screw], held=[HeldFace("lower:base")]))
    theirs = answer(with_rigid_body_and_springs(structure, k)).frequency_hz
    np.testing.assert_allclose(modes(model.K, model.M, 10).frequency_hz, theirs[:10], rtol=PRINTED)


SPRINGS = tuple(f"joints.head.{k}" for k in ("kx=1e9", "ky=6.6e5", "kz=2.5e7", "kry=100.0"))


def test_a_table_dashpots_and_the_contact_are_in_the_deck():
    """The table's two slow modes, and the static compliance at the contact by CalculiX's solver."""
    sizes = ("mesh.seed=20e-3", "mesh.block_seed=50e-3", "mesh.contact_seed=50e-3")
    parts = rig(*sizes, *SPRINGS)
    materials = steel(parts.meshes)
    table = parts.connections._replace(table=SwayingTable(6.5, 1000.0))
    model = joined(assemble(parts.meshes, materials), table)
    w = contact_patch(model, "block:strike", (0.03, 0.0), 2e-3).w
    C = dashpots(model, {"head.ky": 100.0, "head.kry": 3.0})
    theirs = answer(input_deck(model, materials, w=w, C=C))
    ours = modes(model.K, model.M, 10).frequency_hz
    np.testing.assert_allclose(ours[:2], 6.5, rtol=1e-3)
    np.testing.assert_allclose(ours, theirs.frequency_hz[:10], rtol=PRINTED)
    compliance = w @ factorised(model.K).solve(w)
    assert theirs.compliance == pytest.approx(compliance, rel=PRINTED, abs=0.0)


@pytest.mark.parametrize(("of", "springs"), [("rig-full-tie", ()), ("rig-rom", SPRINGS)])
def test_calculix_finds_the_same_ten_frequencies(of, springs):
    sizes = ("mesh.seed=10e-3", "mesh.block_seed=35e-3", "mesh.contact_seed=35e-3")
    parts = rig(*sizes, *springs, of=of)
    materials = steel(parts.meshes)
    model = joined(assemble(parts.meshes, materials), parts.connections)
    theirs = answer(input_deck(model, materials)).frequency_hz
    ours = modes(model.K, model.M, 10).frequency_hz
    np.testing.assert_allclose(ours, theirs[:10], rtol=PRINTED)


def test_tetrahedra_plies_turned_joints_and_the_ground_are_in_the_deck(monkeypatch):
    """A ply of tetrahedra on a steel block, by a bolt in a frame of its own, mean on both sides.

    CalculiX integrates the masses of C3D10 with the 4 points of order 2: so do we here.
    """
    monkeypatch.setitem(ELEMENTS, MeshTet, (ElementTetP2(), 2, 2))
    line = np.linspace(-0.03, 0.03, 3)
    lower = MeshHex.init_tensor(line, line, [0, LOWER / 2, LOWER])
    upper = MeshTet.init_tensor(*2 * [np.linspace(-0.02, 0.02, 4)], np.linspace(LOWER, 0.08, 3))
    meshes = {
        "lower": lower.with_boundaries({"base": at(0.0), "top": at(LOWER)}),
        "upper": upper.with_boundaries({"foot": at(LOWER), "top": at(0.08)}),
    }
    axes = ((1, 1, 0), (-1, 1, 0.2))
    ply = Orthotropic((135e9, 9e9, 7e9), (0.3, 0.25, 0.4), (5e9, 4e9, 3e9), 1600.0, axes)
    materials = {"lower": BLOCKS["lower"], "upper": ply}
    k, frame = Bushing(1e8, 3e8, 2e8, 2e4, 3e4, 1e4), normal_frame(np.array([1.0, 2.0, 2.0]))
    middle = np.array([0.0, 0.0, LOWER])
    sides = Side("upper:foot", "mean"), Side("lower:top", "mean", within=0.025)
    bolt = Joint("bolt", *sides, middle, k, frame)
    earth = Joint("earth", Side("lower:base"), None, np.zeros(3), Bushing(kx=1e7, kz=5e7))
    model = joined(assemble(meshes, materials), Connections(joints=[bolt, earth]))
    theirs = answer(input_deck(model, materials)).frequency_hz
    np.testing.assert_allclose(modes(model.K, model.M, 10).frequency_hz, theirs[:10], rtol=PRINTED)


def test_a_deck_that_calculix_refuses_ends_in_one_sentence():
    with pytest.raises(ValueError, match="CalculiX gives up"):
        answer("*NODE\n1, 0, 0, 0\n*STEP\n*FREQUENCY\n1\n*END STEP\n")
