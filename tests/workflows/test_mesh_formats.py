"""Meshes of other programs: formats with their names, sets that overlap, meshes with faults."""

import json
import re
from itertools import pairwise
from pathlib import Path

import gmsh
import meshio
import numpy as np
import pytest

from beadwave.geometry.meshing.gmsh_session import session
from beadwave.workflows.files.mesh_reader import volumes_of
from beadwave.workflows.scene import InvalidScene

from command_line import beadwave

pytestmark = pytest.mark.usefixtures("shared_cache", "files_read_here")

SCENE = """
name = "bar"
materials.steel = {{ young = 210e9, poisson = 0.3, density = 7850.0 }}
[assembly]
mesh = "{file}"
held = ["{held}"]
material = "steel"
touching = "tied"
{words}
"""
BLOCK = 0.1 * 0.03 * 0.02  # m^3, of either half


@pytest.fixture(scope="module")
def bars(tmp_path_factory):
    """Two blocks of tetrahedra, left and right, in the formats that gmsh writes."""
    folder = tmp_path_factory.mktemp("bars")
    with session():
        occ = gmsh.model.occ
        occ.addBox(0, 0, 0, 0.1, 0.03, 0.02)
        occ.addBox(0.1, 0, 0, 0.1, 0.03, 0.02)
        occ.fragment([(3, 1)], [(3, 2)])
        occ.synchronize()
        for tag, name in ((1, "left"), (2, "right")):
            gmsh.model.addPhysicalGroup(3, [tag], tag, name)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.02)
        gmsh.model.mesh.generate(3)
        for order in (1, 2):
            gmsh.model.mesh.setOrder(order)
            for ending in ("msh", "unv", "bdf", "inp", "med"):
                gmsh.write(str(folder / f"bar{order}.{ending}"))
    return folder


def volume(mesh):
    edges = mesh.p[:, mesh.t[1:4]] - mesh.p[:, mesh.t[:1]]
    return np.abs(np.linalg.det(np.moveaxis(edges, 2, 0))).sum() / 6


def bodies(path, *choice):
    return volumes_of(Path(path), *choice).meshes


def written(file, held="bar:-x", words=""):
    Path("bar.toml").write_text(SCENE.format(file=file, held=held, words=words), encoding="utf-8")
    return "bar.toml"


def table(capsys, *arguments):
    assert beadwave("modes", *arguments, "--json") == 0
    return json.loads(capsys.readouterr().out)


def hexes(path, *, t=((0, 1, 2, 3, 4, 5, 6, 7),), x=(0.0, 0.1, 0.2), sets=None, shared=True):
    """Cells of 0.1 x 0.02 x 0.02 m in a row along x; not `shared` each has nodes of its own."""
    section = np.array([[0, 0], [0.02, 0], [0.02, 0.02], [0, 0.02]])
    planes = [np.column_stack([np.full(4, a), section]) for a in x]
    if shared:
        points = np.vstack(planes)
        cells = [[*range(4 * i, 4 * i + 8)] for i in range(len(x) - 1)]
    else:
        pairs = pairwise(planes)
        points = np.vstack([plane for pair in pairs for plane in pair])
        cells = np.arange(len(points)).reshape(-1, 8).tolist()
    cells = np.array(cells)[:, list(t[0])]
    sets = sets or {"bar": [np.arange(len(cells))]}
    meshio.Mesh(points, [("hexahedron", cells)], cell_sets=sets).write(path)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("ending", ["msh", "unv", "inp", "med", "bdf"])
def test_bodies_have_the_names_that_the_format_holds(bars, ending, order):
    names = ["1", "2"] if ending == "bdf" else ["left", "right"]
    found = bodies(bars / f"bar{order}.{ending}")
    assert list(found) == names
    # coordinates of a deck have six digits
    assert [volume(mesh) for mesh in found.values()] == pytest.approx([BLOCK] * 2, rel=1e-5)


@pytest.mark.parametrize("ending", ["unv", "inp", "med", "bdf"])
def test_a_bar_has_its_frequency_in_every_format(bars, ending, capsys):
    """Euler's bar has 418.9 Hz, 418 with shear; ten tetrahedra along it are 0.3 % too stiff."""
    held = "1:-x" if ending == "bdf" else "left:-x"
    rows = table(capsys, written(bars / f"bar1.{ending}", held))["rows"]
    assert rows[0]["frequency_hz"] == pytest.approx(418, rel=5e-3)


def test_a_suffix_in_capitals_is_the_same_format(bars, tmp_path):
    for ending in ("MSH", "Unv", "MED", "INP", "BDF"):
        copy = tmp_path / f"bar.{ending}"
        copy.write_bytes((bars / f"bar1.{ending.lower()}").read_bytes())
        assert len(bodies(copy)) == 2


@pytest.mark.parametrize("ending", ["unv", "med", "UNV", "Med", "inp", "bdf", "Msh"])
def test_a_script_of_gmsh_is_run_under_no_suffix(tmp_path, ending):
    script = tmp_path / f"script.{ending}"
    script.write_text(f'SystemCall "touch {tmp_path}/ran";\nBox(1) = {{0, 0, 0, 1, 1, 1}};\n')
    with pytest.raises(InvalidScene):
        volumes_of(script)
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize("kind", [2435, 2452, 2467, 2477])
def test_groups_of_universal_files_name_bodies_whose_elements_have_one_property(
    bars, tmp_path, kind
):
    lines = (bars / "bar1.unv").read_text().replace("  2477\n", f"  {kind}\n").splitlines()
    start = lines.index("  2412")
    for i in range(start + 1, lines.index("    -1", start), 2):
        words = lines[i].split()
        lines[i] = "".join(f"{word:>10}" for word in (words[0], words[1], 1, 1, 7, words[5]))
    (tmp_path / "bar.unv").write_text("\n".join(lines) + "\n")
    assert list(bodies(tmp_path / "bar.unv")) == ["left", "right"]
    # without groups both are the property 1
    groups = lines[: lines.index(f"  {kind}") - 1]
    (tmp_path / "plain.unv").write_text("\n".join(groups) + "\n")
    (whole,) = bodies(tmp_path / "plain.unv").items()
    assert whole[0] == "1" and volume(whole[1]) == pytest.approx(2 * BLOCK)


def test_a_universal_file_in_millimetres_is_converted(bars, tmp_path):
    text = (bars / "bar1.unv").read_text()
    number = r"\d\.\d+D[+-]\d\d"
    text = re.sub(number, lambda m: f"{1e3 * float(m[0].replace('D', 'E')):.16E}", text)
    text = text.replace("E+", "D+").replace("E-", "D-")
    units = ["    -1", "   164", "         5mm (milli-newton)            2",
             "  1.0000000000000000D+03  1.0000000000000000D+03  1.0000000000000000D+00",
             "  2.7314999999999998D+02", "    -1", ""]  # fmt: skip
    (tmp_path / "mm.unv").write_text("\n".join(units) + text)
    assert volume(bodies(tmp_path / "mm.unv")["left"]) == pytest.approx(BLOCK)


@pytest.mark.parametrize(
    "comments",
    [
        ['$HMNAME PROP                   1"left" 4', '$HMNAME COMP 1"part"'],
        ['$HMNAME COMP                   7"left" 1 "p1"'],
        ["$ANSA_NAME_COMMENT;1;PSOLID;left;;NO;NO;"],
        ["$ANSA_NAME;1;PSOLID;~", "$left"],
        ["$ Femap Property 1 : left", "$ Femap Property 2 : Untitled"],
        ["$ FEMAP with NX Nastran Property 1 : left"],
        ["$ Elements and Element Properties for region : left", "PSOLID   1       1       0"],
        ["$* Property: 1 name: left"],
    ],
)
def test_a_property_is_called_as_its_writers_comment_says(bars, tmp_path, comments):
    deck = (bars / "bar1.bdf").read_text()
    head = ["SOL 103", "CEND", "BEGIN BULK", *comments, ""]
    (tmp_path / "bar.nas").write_text("\n".join(head) + deck)
    assert list(bodies(tmp_path / "bar.nas")) == ["left", "2"]


def test_fields_of_nastran_decks_may_be_free_small_or_large(tmp_path):
    x = [(0, 0, 0), (0.1, 0, 0), (0, 0.1, 0), (0, 0, 0.1)]
    free = [f"GRID,{i},,{a},{b},{c}" for i, (a, b, c) in enumerate(x, 1)]
    small = [f"GRID    {i:<8}        {a:<8}{b:<8}{c:<8}" for i, (a, b, c) in enumerate(x, 1)]
    large = []
    for i, (a, b, c) in enumerate(x, 1):
        large += [f"GRID*   {i:<16}{'':16}{a:<16}{b:<16}*A{i}", f"*A{i:<6}{c:<16}"]
    short = [line.replace("0.1", "1.-1") for line in small]
    for deck in (free, small, large, short):
        long = f"CTETRA* {1:<16}{5:<16}{1:<16}{2:<16}*B\n*B      {3:<16}{4:<16}"
        for cell in ("CTETRA,1,5,1,2,3,4", long):
            (tmp_path / "one.bdf").write_text("\n".join([*deck, cell, "ENDDATA", ""]))
            (one,) = bodies(tmp_path / "one.bdf").values()
            assert volume(one) == pytest.approx(1e-3 / 6)


def test_a_node_in_a_coordinate_system_of_its_own_is_refused(tmp_path):
    (tmp_path / "one.bdf").write_text("GRID,1,3,0.,0.,0.\nENDDATA\n")
    with pytest.raises(InvalidScene, match="GRID 1 is in the coordinate system 3"):
        volumes_of(tmp_path / "one.bdf")


DECK = """*Heading
*Node
1, 0, 0, 0
2, .1, 0, 0
3, 0, .1, 0
4, 0, 0, .1
*Node, nset=more
5, .1, .1, .1
6, .3, .1, .1
*Element, type=MASS, elset=spots
90, 1
*Element, type=c3d4
1, 1, 2, 3, 4
*ELEMENT, TYPE=C3D4, ELSET=Solid
2, 2, 3, 4, 5
*Element, Type=C3D4, Elset=other
3, 2, 3, 5, 6
*Element, type=C3D4H, elset=SOLID
1, 1, 2, 3, 4
*Elset, elset=pair, generate
1, 2
*Elset, elset=_internal, internal
1, 2, 3
*Elset, elset=whole
pair, 3
"""


def test_a_deck_with_repeated_keywords_keeps_every_element(tmp_path):
    """Blocks of nodes and of elements may repeat, and a set may name sets and numbers."""
    deck = tmp_path / "one.inp"
    deck.write_text(DECK)
    found = volumes_of(deck)
    assert list(found.meshes) == ["whole"] and found.meshes["whole"].nelements == 3
    halves = bodies(deck, ["Solid", "other"])
    assert {name: mesh.nelements for name, mesh in halves.items()} == {"Solid": 2, "other": 1}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("2, 2, 3, 4, 5", "2, 2, 3, 4, 55"), r"\*ELEMENT refers to"),
        (("1, 0, 0, 0", "1, 0, 0, x"), r"the data of a \*NODE cannot be read"),
        (("Type=C3D4, ", ""), r"\*ELEMENT refers to 'TYPE'"),
        (("pair, 3", "nothing, 3"), r"\*ELSET refers to"),
        (
            ("*Heading", "*Include, input=other.inp"),
            "it includes other.inp, which is not in the same folder",
        ),
    ],
)
def test_a_damaged_deck_is_refused_with_its_keyword(tmp_path, change, message):
    (tmp_path / "one.inp").write_text(DECK.replace(*change))
    with pytest.raises(InvalidScene, match=message):
        volumes_of(tmp_path / "one.inp")


def test_parts_of_a_deck_have_their_own_numbers(tmp_path):
    part = "*Part, name={}\n*Node\n1,{x},0,0\n2,{y},0,0\n3,{x},.1,0\n4,{x},0,.1\n"
    part += "*Element, type=C3D4\n1,1,2,3,4\n*Elset, elset=Set-1\n1\n*End Part\n"
    places = "*Assembly\n*Instance, name={0}-1, part={0}\n*End Instance\n*End Assembly\n"
    text = part.format("Lid", x=0, y=0.1) + part.format("Base", x=1, y=0.7)
    deck = tmp_path / "two.inp"
    deck.write_text(text + places.format("Lid") + places.format("Base"))
    found = bodies(deck)
    assert list(found) == ["Lid", "Base"]
    assert [volume(m) for m in found.values()] == pytest.approx([1e-3 / 6, 3e-3 / 6])
    deck.write_text(text + places.format("Lid").replace("*End I", "0.1, 0., 0.\n*End I"))
    with pytest.raises(InvalidScene, match="moves the instance 'Lid-1'"):
        volumes_of(deck)


def test_a_set_of_everything_beside_the_body_changes_nothing(tmp_path, capsys):
    """Euler's bar has 418.9 Hz; four cells along it state an error that covers the difference."""
    sets = {"output": [[0, 2]], "bar": [[0, 1, 2, 3]], "Eall": [[0, 1, 2, 3]]}
    hexes("bar.inp", x=np.linspace(0, 0.2, 5), sets=sets)
    row = table(capsys, written("bar.inp"))["rows"][0]
    miss = row["frequency_hz"] / 417.0 - 1
    assert 0 < miss < 0.01 * row["error_percent"]
    assert beadwave("look", "bar.toml") == 0
    assert "are no bodies: 'output', 'Eall'" in capsys.readouterr().out


def test_bodies_are_the_fewest_sets_with_each_cell_once_or_those_chosen(tmp_path):
    file = tmp_path / "bar.inp"
    sets = {"all": [[0, 1, 2, 3]], "a": [[0, 1]], "b": [[2, 3]], "probe": [[1]]}
    hexes(file, x=np.linspace(0, 0.2, 5), sets=sets)
    assert list(bodies(file)) == ["all"]
    assert list(bodies(file, ["b", "a"])) == ["b", "a"]
    del sets["all"]
    hexes(file, x=np.linspace(0, 0.2, 5), sets=sets)
    assert list(bodies(file)) == ["a", "b"]
    with pytest.raises(InvalidScene, match=r"1 cells in two volumes of assembly\.volumes"):
        volumes_of(file, ["a", "probe"])
    with pytest.raises(InvalidScene, match=r"no volume 'c' .* there are 'a', 'b'"):
        volumes_of(file, ["c"])
    # two families of the same size, and none at all
    hexes(file, sets={"a": [[0]], "b": [[1, 2, 3]], "c": [[0, 1]], "d": [[2, 3]]},
          x=np.linspace(0, 0.2, 5))  # fmt: skip
    with pytest.raises(InvalidScene, match=r"\['a', 'b'\] as well as \['c', 'd'\] have each cell"):
        volumes_of(file)
    hexes(file, sets={"a": [[0, 1]], "b": [[1, 2, 3]]}, x=np.linspace(0, 0.2, 5))
    with pytest.raises(InvalidScene, match="1 cells in two volumes, as 'a' and 'b'"):
        volumes_of(file)


def test_a_body_in_two_pieces_is_refused_and_its_nodes_merged_on_demand(tmp_path, capsys):
    hexes("bar.inp", shared=False)
    message = r"'bar' of the mesh .* is 2 pieces that nothing joins, with their middles at "
    message += r"\[0.05, 0.01, 0.01\], \[0.15, 0.01, 0.01\] m; the nearest nodes of two are 0 mm"
    with pytest.raises(InvalidScene, match=message):
        volumes_of(Path("bar.inp"))
    apart = bodies("bar.inp", (), 0.0)["bar"]
    whole = bodies("bar.inp", (), 1e-6)["bar"]
    assert (apart.nvertices, whole.nvertices) == (16, 12)
    # taken as it is, the far half floats: six modes of no frequency are remarked
    found = table(capsys, written("bar.inp", words="merge = 0"))
    assert any("Modes 1, 2, 3, 4, 5, 6 have no frequency" in w for w in found["warnings"])
    merged = table(capsys, written("bar.inp", words='merge = "1 um"'))
    assert merged["rows"][0]["frequency_hz"] > 100 and not merged["warnings"]
    with pytest.raises(InvalidScene, match="merges nodes of one cell"):
        volumes_of(Path("bar.inp"), (), 0.03)


def test_pieces_that_share_an_edge_alone_are_refused(tmp_path):
    square = [(0, 0), (1, 0), (1, 1), (0, 1)]
    points = [(0.01 * x, 0.01 * y, 0.01 * z) for z in (0, 1) for x, y in square]
    points += [(0.01 * x + 0.01, 0.01 * y + 0.01, 0.01 * z) for z in (0, 1) for x, y in square]
    second = [6 - 4, 9, 10, 11, 6, 13, 14, 15]  # on the edge from node 2 to node 6
    cells = [("hexahedron", [[*range(8)], second])]
    sets = {"hinge": [[0, 1]]}
    meshio.Mesh(np.array(points), cells, cell_sets=sets).write(tmp_path / "hinge.inp")
    with pytest.raises(InvalidScene, match=r"nodes in common .* but no face"):
        volumes_of(tmp_path / "hinge.inp")


def test_nodes_at_one_place_within_a_body_are_a_crack(tmp_path):
    """A ring of four blocks, joined by three faces; at the fourth the nodes are not shared."""
    from skfem import MeshHex
    from skfem.io.meshio import HEX_MAPPING

    x = np.linspace(0, 0.03, 4)
    mesh = MeshHex.init_tensor(x, x, x[:2])
    middle = mesh.elements_satisfying(lambda p: np.hypot(*(p[:2] - 0.015)) < 1e-3)
    ring = mesh.remove_elements(middle)
    t, points = ring.t.copy(), ring.p.T
    # the face x = 0.01 between the first two cells at y = 0 is cut open
    cut = [i for i, p in enumerate(points) if abs(p[0] - 0.01) < 1e-9 and p[1] < 0.011]
    beyond = ring.p[0, ring.t].mean(axis=0) > 0.01
    below = ring.p[1, ring.t].mean(axis=0) < 0.01
    for node in cut:
        points = np.vstack([points, points[node]])
        chosen = t[:, beyond & below]
        t[:, beyond & below] = np.where(chosen == node, len(points) - 1, chosen)
    cells = [("hexahedron", t[HEX_MAPPING[:8]].T)]
    sets = {"ring": [np.arange(t.shape[1])]}
    meshio.Mesh(points, cells, cell_sets=sets).write(tmp_path / "ring.inp")
    with pytest.raises(InvalidScene, match=r"has 4 pairs of nodes at one place .* a crack"):
        volumes_of(tmp_path / "ring.inp")
    assert bodies(tmp_path / "ring.inp", (), 1e-6)["ring"].nvertices == ring.nvertices
    assert bodies(tmp_path / "ring.inp", (), 0.0)["ring"].nvertices == len(points)


@pytest.mark.parametrize(
    ("t", "x", "message"),
    [
        ((0, 1, 2, 3, 6, 7, 4, 5), (0.0, 0.1, 0.2), "2 of 2 cells turned inside out"),
        ((0, 1, 3, 2, 4, 5, 7, 6), (0.0, 0.1, 0.2), "2 of 2 cells turned inside out"),
        ((0, 1, 2, 3, 4, 5, 6, 7), (0.0, 0.1, 0.1), "1 of 2 cells of no volume"),
        ((0, 1, 2, 2, 4, 5, 6, 6), (0.0, 0.1, 0.2), "2 cells in 'bar' that name a node twice"),
    ],
)
def test_cells_without_volume_or_inside_out_are_refused(tmp_path, t, x, message):
    hexes(tmp_path / "bar.inp", t=(t,), x=x)
    with pytest.raises(InvalidScene, match=message):
        volumes_of(tmp_path / "bar.inp")


def test_cells_numbered_as_in_a_mirror_are_taken(tmp_path):
    hexes(tmp_path / "bar.inp", t=((4, 5, 6, 7, 0, 1, 2, 3),))
    assert bodies(tmp_path / "bar.inp")["bar"].nelements == 2


def test_a_key_of_meshes_without_a_mesh_is_refused(capsys):
    scene = SCENE.replace('mesh = "{file}"\n', "").format(file="", held="bar:-x", words="merge = 0")
    Path("bar.toml").write_text(scene + "[bodies.bar]\nbox = [0.1, 0.02, 0.02]\n")
    assert beadwave("modes", "bar.toml") == 2
    assert "assembly.merge says how assembly.mesh is read" in capsys.readouterr().err


@pytest.mark.parametrize("ending", ["inp", "msh", "step"])
def test_a_file_larger_than_memory_is_refused_by_its_size(tmp_path, capsys, ending):
    """A file of 10 TB without content on the disk."""
    with open(tmp_path / f"large.{ending}", "wb") as file:
        file.truncate(10**13)
    words = f'step = "{tmp_path}/large.step"' if ending == "step" else ""
    name = written(f"{tmp_path}/large.{ending}", words=words)
    if words:
        text = Path(name).read_text().replace(f'mesh = "{tmp_path}/large.step"\n', "")
        Path(name).write_text(text)
    assert beadwave("modes", name) == 2
    assert "it has 1e+04 GB, to be read twice that" in capsys.readouterr().err
