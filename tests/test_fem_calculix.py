"""The same mesh, constraints and springs in CalculiX (Debian: calculix-ccx), to its digits."""

from shutil import which
from subprocess import run

import numpy as np
import pytest

from fem import Joint, Material, assemble, full_tie, modes, wires
from fem.abaqus import input_deck
from geometry import PARTS, Assembly, held_faces, hex_mesh, interfaces

pytestmark = pytest.mark.skipif(
    which("ccx") is None, reason="the independent code is not installed (Debian: calculix-ccx)"
)
PRINTED = 2e-6  # half a unit of the last of seven printed digits, on both sides of the rounding


def calculix_hz(deck, folder):
    (folder / "deck.inp").write_text(deck)
    run(["ccx", "deck"], cwd=folder, capture_output=True, check=True, timeout=300)
    rows = [line.split() for line in (folder / "deck.dat").read_text().splitlines()]
    return np.array([float(row[3]) for row in rows if len(row) == 5 and row[0].isdigit()])


def bolted(structure, assembly):
    joint = {
        "block": Joint(kx=1e9, ky=6.6e5, kz=2.5e7, kry=100.0),
        "sheets_support": Joint(),
    }
    return wires(structure, interfaces(assembly), held_faces(assembly), joint)


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
