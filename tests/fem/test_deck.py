"""Content of an input deck besides its mesh, read back from its text: no solver needed."""

import numpy as np
import pytest
from skfem import MeshHex

from beadwave.fem import Connections, SwayingTable, assemble, contact_patch, dashpots, joined
from beadwave.fem.exchange.abaqus import input_deck

from known_models import rig, steel

POINT, RADIUS, DAMPING = (0.03, 0.0), 2e-3, 120.0


@pytest.fixture(scope="module")
def model():
    sizes = ("mesh.seed=0.02", "mesh.block_seed=0.05", "mesh.contact_seed=0.05")
    springs = ("joints.head.ky=6.6e5", "joints.head.kz=inf", "joints.head.kry=100.0")
    parts = rig(*sizes, *springs)
    structure = assemble(parts.meshes, steel(parts.meshes))
    return joined(structure, parts.connections._replace(table=SwayingTable(6.5, 1000.0)))


def deck(model, **more):
    return input_deck(model, steel(model.structure.basis), **more).splitlines()


def after(lines, head):
    """Lines below each line that begins so, up to the next keyword."""
    starts = [i + 1 for i, line in enumerate(lines) if line.startswith(head)]
    ends = [next(j for j in range(i, len(lines)) if lines[j].startswith("*")) for i in starts]
    return [lines[i:j] for i, j in zip(starts, ends, strict=True)]


def test_a_table_is_a_mass_that_two_springs_hold(model):
    """The table's own mass, and the stiffness that gives table and assembly 6.5 Hz together."""
    lines = deck(model)
    assert [float(m) for (m,) in after(lines, "*MASS")] == [1000.0]
    moving = model.structure.M.sum() / 3 + 1000.0
    springs = [(d, float(k)) for d, k in after(lines, "*SPRING, ELSET=SWAY")]
    k = pytest.approx((2 * np.pi * 6.5) ** 2 * moving)
    assert springs == [("1", k), ("2", k)]


def test_every_dashpot_lies_along_the_spring_of_its_direction(model):
    lines = deck(model, C=dashpots(model, {"head.ky": DAMPING}))
    ends = [row.split(", ") for (row,) in after(lines, "*ELEMENT, TYPE=DASHPOTA")]
    nodes = [row for rows in after(lines, "*NODE") for row in rows if "," in row]
    places = dict(row.split(", ", 1) for row in nodes)
    beside = {row.split(", ")[1] for (row,) in after(lines, "*ELEMENT, TYPE=SPRING1")}
    assert len(ends) == model.spring.count("head.ky") == 4
    for _, joint, ground in ends:
        assert joint in beside
        assert (places[joint], places[ground]) == ("0, 0, 0", "0, 1, 0")
    assert [float(c) for _, c in after(lines, "*DASHPOT,")] == [DAMPING] * 4
    assert not after(deck(model), "*DASHPOT")


def test_the_node_of_the_contact_reads_what_the_chain_reads(model):
    w = contact_patch(model, "block:strike", POINT, RADIUS).w
    lines = deck(model, w=w)
    ((row,),) = after(lines, "*NODE, NSET=CONTACT")
    node = row.split(", ")[0]
    (terms,) = [
        " ".join(rows[1:]).replace(",", "").split()
        for rows in after(lines, "*EQUATION")
        if rows[1].startswith(f"{node}, 1,")
    ]
    computed = np.zeros(3 * int(node))
    for n, dof, c in zip(*(terms[i::3] for i in range(3)), strict=True):
        computed[3 * (int(n) - 1) + int(dof) - 1] = float(c)
    assert computed[3 * (int(node) - 1)] == -1
    np.testing.assert_allclose(computed[model.free], w, rtol=1e-11)
    assert after(lines, "*CLOAD") == [[f"{node}, 1, 1.0"]]


def test_bodies_whose_names_become_equal_in_a_deck_are_numbered():
    cube = MeshHex.init_tensor(*[np.linspace(0, 1, 2)] * 3)
    meshes = dict.fromkeys(("gear box", "gear_box", "Gear/box"), cube)
    alone = joined(assemble(meshes, steel(meshes)), Connections())
    lines = input_deck(alone, steel(meshes)).splitlines()
    sets = [line.split("ELSET=")[1] for line in lines if line.startswith("*ELEMENT")]
    assert len(set(sets)) == 3 and all(name.replace("_", "").isalnum() for name in sets)
    filled = [line.split("ELSET=")[1].split(",")[0] for line in lines if "SOLID SECTION" in line]
    assert set(filled) == set(sets)
