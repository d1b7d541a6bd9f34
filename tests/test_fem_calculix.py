"""The same mesh, constraints and springs in CalculiX (Debian: calculix-ccx), to its digits."""

from shutil import which
from subprocess import run
from typing import NamedTuple

import numpy as np
import pytest
from scipy.sparse import block_diag, csr_matrix
from skfem import MeshHex

from fem import (
    Joint,
    Material,
    Model,
    Table,
    assemble,
    contact_patch,
    dashpots,
    factorised,
    full_tie,
    modes,
    wires,
)
from fem.abaqus import input_deck
from fem.constraints import congruent, eliminated
from fem.joints import Screw, screws
from fem.trace import face_nodes
from geometry import PARTS, Assembly, held_faces, hex_mesh, interfaces

pytestmark = pytest.mark.skipif(
    which("ccx") is None, reason="the independent code is not installed (Debian: calculix-ccx)"
)
PRINTED = 1e-6  # CalculiX prints seven digits; 4.6e-7 was the largest difference seen
LOWER = 0.05  # m, height of the wide block
NOTHING = np.empty(0, int)
BLOCKS = dict.fromkeys(("lower", "upper"), Material(210e9, 0.3, 7850.0))


def calculix_hz(deck, folder):
    (folder / "deck.inp").write_text(deck)
    run(["ccx", "deck"], cwd=folder, capture_output=True, check=True, timeout=300)
    rows = [line.split() for line in (folder / "deck.dat").read_text().splitlines()]
    return np.array([float(row[3]) for row in rows if len(row) == 5 and row[0].isdigit()])


class Touching(NamedTuple):
    slave: str = "upper:foot"
    master: str = "lower:top"
    screws: tuple = ("upper:foot",)
    halves: tuple = ("upper:foot",)
    centres: np.ndarray = np.array([[0.0, 0.0, LOWER]])


def two_blocks():
    """A slender block on a wider one, meshes that do not match, unmerged."""
    wide, slender = np.linspace(-0.03, 0.03, 3), np.linspace(-0.01, 0.01, 4)
    lower = MeshHex.init_tensor(wide, wide, [0, LOWER / 2, LOWER])
    upper = MeshHex.init_tensor(slender, slender, np.linspace(LOWER, 0.12, 4))
    n = lower.nelements
    p = np.concatenate([lower.p, upper.p], axis=1)
    t = np.concatenate([lower.t, upper.t + lower.p.shape[1]], axis=1)
    mesh = MeshHex(p, t)
    z = mesh.p[2, mesh.facets].mean(axis=0)
    touching = np.abs(z - LOWER) < 1e-9
    faces = {
        "upper:foot": np.flatnonzero(touching & (mesh.f2t[0] >= n)),
        "lower:top": np.flatnonzero(touching & (mesh.f2t[0] < n) & (mesh.f2t[1] == -1)),
        "lower:base": np.flatnonzero(np.abs(z) < 1e-9),
    }
    bodies = {"lower": np.arange(n), "upper": np.arange(n, mesh.nelements)}
    return assemble(mesh.with_subdomains(bodies).with_boundaries(faces), BLOCKS)


def with_rigid_body_and_springs(structure, k):
    """The same joint as CalculiX knows it: *RIGID BODY on the slender block, springs of two nodes
    to the mean motion of the wide one's face, which stays an equation.
    """
    basis, n = structure.basis, structure.basis.N
    means = screws(basis, [Screw("upper:foot", "lower:top", Touching().centres[0])], NOTHING)[1:]
    held = np.concatenate([face_nodes(basis, "lower:base").ravel(), n + np.arange(6)])
    reduction, empty = eliminated(n + 12, means, held), csr_matrix((12, 12))
    K, M = (
        congruent(reduction.T, block_diag([A, empty], format="csr"))
        for A in (structure.K, structure.M)
    )
    T = reduction.T[:n].tocsr()
    loose = Model(K, M, T, reduction.free, structure, NOTHING, np.empty(0), ())
    shift, turn = (n + 6) // 3 + 1, (n + 9) // 3 + 1  # nodes of the mean motion
    rigid, rotation = turn + 1, turn + 2
    share = face_nodes(basis, "upper:foot")[:, 0] // 3 + 1
    lines = ["*NSET, NSET=SHARE", *(f"{node}," for node in share), "*NODE"]
    lines += [f"{node}, 0, 0, {LOWER}" for node in (rigid, rotation)]
    lines += [f"*RIGID BODY, NSET=SHARE, REF NODE={rigid}, ROT NODE={rotation}"]
    for i, stiffness in enumerate(k):
        ends = (rigid, shift) if i < 3 else (rotation, turn)
        number, dof = basis.mesh.nelements + 1 + i, i % 3 + 1
        lines += [f"*ELEMENT, TYPE=SPRING2, ELSET=S{i}", f"{number}, {ends[0]}, {ends[1]}"]
        lines += [f"*SPRING, ELSET=S{i}", f"{dof}, {dof}", f"{stiffness:.6e}"]
    return input_deck(loose, BLOCKS).replace("*STEP", "\n".join([*lines, "*STEP"]))


def test_a_screw_is_calculix_rigid_body_and_its_springs(tmp_path):
    structure, k = two_blocks(), Joint(1e8, 3e8, 2e8, 2e4, 3e4, 1e4)
    model = wires(structure, [Touching()], ["lower:base"], {"lower": k})
    theirs = calculix_hz(with_rigid_body_and_springs(structure, k), tmp_path)
    np.testing.assert_allclose(modes(model.K, model.M, 10).frequency_hz, theirs[:10], rtol=PRINTED)


def bolted(structure, assembly, table=None):
    joint = {
        "block": Joint(kx=1e9, ky=6.6e5, kz=2.5e7, kry=100.0),
        "sheets_support": Joint(),
    }
    return wires(structure, interfaces(assembly), held_faces(assembly), joint, table=table)


def test_a_table_dashpots_and_the_contact_are_in_the_deck(tmp_path):
    """The table's two slow modes, and the static compliance at the contact by CalculiX's solver."""
    assembly = Assembly()
    mesh = hex_mesh(assembly, seed=20e-3, block_seed=50e-3, support_seed=60e-3)
    steel = {body: Material(210e9, 0.3, 7850.0) for body in mesh.subdomains}
    model = bolted(assemble(mesh, steel), assembly, Table(6.5, 1000.0))
    w = contact_patch(model, "block:+x", (0.03, 0.0), 2e-3).w
    C = dashpots(model, {"block.ky": 100.0, "block.kry": 3.0})
    theirs = calculix_hz(input_deck(model, steel, w=w, C=C), tmp_path)
    ours = modes(model.K, model.M, 10).frequency_hz
    np.testing.assert_allclose(ours[:2], 6.5, rtol=1e-3)
    np.testing.assert_allclose(ours, theirs[:10], rtol=PRINTED)
    printed = (tmp_path / "deck.dat").read_text().split("set CONTACT")[1].split()
    compliance = w @ factorised(model.K).solve(w)
    assert float(printed[printed.index("time") + 3]) == pytest.approx(compliance, rel=PRINTED)


def tied(structure, assembly):
    return full_tie(structure, interfaces(assembly), held_faces(assembly))


@pytest.mark.parametrize(("join", "n_parts"), [(tied, 2), (bolted, 5)])
def test_calculix_finds_the_same_ten_frequencies(join, n_parts, tmp_path):
    assembly = Assembly(parts=PARTS[:n_parts])
    mesh = hex_mesh(assembly, seed=10e-3, block_seed=35e-3, support_seed=60e-3)
    steel = {body: Material(210e9, 0.3, 7850.0) for body in mesh.subdomains}
    model = join(assemble(mesh, steel), assembly)
    theirs = calculix_hz(input_deck(model, steel), tmp_path)
    ours = modes(model.K, model.M, 10).frequency_hz
    np.testing.assert_allclose(ours, theirs[:10], rtol=PRINTED)
