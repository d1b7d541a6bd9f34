"""A mesh of the user's own, made here by our mesher and read back from a file of another format."""

from contextlib import nullcontext

import gmsh
import meshio
import numpy as np
import pytest
from skfem import MeshHex
from skfem.io.meshio import HEX_MAPPING, INV_HEX_MAPPING

from beadwave.geometry.cad.occ import model
from beadwave.workflows.files.mesh_reader import volumes_of
from beadwave.workflows.files.scene import scene
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.scene.body_shapes import shapes
from beadwave.workflows.stages.engine.pipeline import pipeline_of

from known_models import rig

WRITTEN = {  # version, order, binary, all cells or those in groups
    "plain": (2.2, 1, 0, 0),
    "first": (4.1, 1, 0, 1),
    "binary": (4.1, 1, 1, 0),
    "second": (4.1, 2, 0, 1),
    "second-2.2": (2.2, 2, 1, 0),
}
STAGE_1 = ('assembly.parts=["block", "sheets"]', "mesh.seed=0.012", "mesh.block_seed=0.04")


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("BEADWAVE_CACHE_DIR", str(tmp_path / "cache"))


def bodies(path):
    return volumes_of(path).meshes


def modes_hz(*changes):
    computed = pipeline_of(scene("rig-full-tie", changes), lambda name: nullcontext())("modes")
    return computed.omega[:4] / (2 * np.pi)


@pytest.fixture
def file(tmp_path):
    """Block and sheets as gmsh writes them: named volumes, and one named surface."""
    meshes = rig(*STAGE_1, of="rig-full-tie").meshes
    cells, tags, names, points, offset = [], [], {}, [], 0
    for name, mesh in meshes.items():
        names[name] = np.array([len(names) + 1, 3])
        cells.append(("hexahedron", mesh.t[HEX_MAPPING[:8]].T + offset))
        if name == "block":
            faces = mesh.facets[:, mesh.boundaries["strike"]].T + offset
        points.append(mesh.p.T)
        offset += mesh.nvertices
    names["block:+x"] = np.array([len(names) + 1, 2])
    cells.append(("quad", faces))
    tags = [np.full(len(members), i) for i, (_, members) in enumerate(cells, start=1)]
    path = tmp_path / "mine.msh"
    data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
    complete = meshio.Mesh(np.concatenate(points), cells, cell_data=data, field_data=names)
    complete.write(path, file_format="gmsh22", binary=False)
    return path


@pytest.mark.slow
def test_a_mesh_with_our_names_gives_the_same_modes(file):
    np.testing.assert_allclose(
        modes_hz(*STAGE_1, f"mesh.file={file}"), modes_hz(*STAGE_1), rtol=1e-8
    )


def test_a_mesh_without_a_name_is_refused_with_that_name(file):
    with pytest.raises(InvalidScene, match='no body is called "sheets_support"'):
        modes_hz('assembly.parts=["block","sheets","sheets_support","support","plate"]',
                 f"mesh.file={file}")  # fmt: skip


@pytest.fixture(scope="module")
def by_gmsh(tmp_path_factory):
    """Block and sheets in tetrahedra, written by gmsh itself in its versions, orders and modes."""
    folder = tmp_path_factory.mktemp("gmsh")
    with model(shapes(scene("rig-full-tie"))) as cad:
        for name, body in cad.bodies.items():
            solid = [(3, body.tag)]
            points = gmsh.model.getBoundary(solid, combined=False, oriented=False, recursive=True)
            gmsh.model.mesh.setSize(points, 0.02)
            gmsh.model.addPhysicalGroup(3, [body.tag], name=name)
        block = cad.bodies["block"]
        (end,) = (f.tag for f in block.faces if f.normal is not None and f.normal[0] > 0.9)
        gmsh.model.addPhysicalGroup(2, [end], name="block:+x")
        gmsh.model.mesh.generate(3)
        for name, (version, order, binary, all_cells) in WRITTEN.items():
            gmsh.model.mesh.setOrder(order)
            gmsh.option.setNumber("Mesh.MshFileVersion", version)
            gmsh.option.setNumber("Mesh.Binary", binary)
            gmsh.option.setNumber("Mesh.SaveAll", all_cells)
            gmsh.write(str(folder / f"{name}.msh"))
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("name", list(WRITTEN)[1:])
def test_a_mesh_keeps_its_names_in_every_version_and_order(by_gmsh, name):
    """4.1 with its lines, points and bounding entities, and elements of second order."""
    ours, plain = bodies(by_gmsh / f"{name}.msh"), bodies(by_gmsh / "plain.msh")
    assert {body: mesh.nelements for body, mesh in ours.items()} == {
        body: mesh.nelements for body, mesh in plain.items()
    }
    block = ours["block"]
    middle = block.p[0, block.facets[:, block.boundaries["block:+x"]]]
    np.testing.assert_allclose(middle, scene("rig-rom").rig.assembly.block_x / 2)
    assert len(middle.T) == len(plain["block"].boundaries["block:+x"]) > 0
    filled = [
        [np.sum(np.abs(np.linalg.det(corners(m)))) for m in case.values()] for case in (ours, plain)
    ]
    np.testing.assert_allclose(*filled, rtol=1e-9)


def corners(mesh):
    return np.moveaxis(mesh.p[:, mesh.t[1:]] - mesh.p[:, mesh.t[:1]], 2, 0)


@pytest.mark.parametrize("share", [0.2, 0.5, 0.9])
@pytest.mark.parametrize("end", [b"", b"\n$EndElements\n"])
def test_a_mesh_that_is_cut_off_is_refused(by_gmsh, tmp_path, share, end):
    """One that meshio and gmsh once waited for the end of, for ever."""
    complete = (by_gmsh / "binary.msh").read_bytes()
    (tmp_path / "cut.msh").write_bytes(complete[: int(share * len(complete))] + end)
    with pytest.raises(InvalidScene, match="cannot be read as a mesh"):
        volumes_of(tmp_path / "cut.msh")


def test_a_mesh_that_takes_for_ever_is_refused(by_gmsh, monkeypatch):
    monkeypatch.setattr("beadwave.workflows.files.foreign.START", 0.05)
    monkeypatch.setattr("beadwave.workflows.files.foreign.RATE", 1e9)
    with pytest.raises(InvalidScene, match="reading it does not end within"):
        volumes_of(by_gmsh / "plain.msh")


def test_a_script_that_is_named_as_a_mesh_is_not_run(tmp_path):
    (tmp_path / "script.msh").write_text(f'SystemCall "touch {tmp_path}/ran";\n')
    with pytest.raises(InvalidScene, match="does not begin with"):
        volumes_of(tmp_path / "script.msh")
    assert not (tmp_path / "ran").exists()


def with_others(file, tmp_path, kind, name, nodes, apart=None):
    """The file with a point, a line and one cell of another kind in a volume of this name, or a
    cube of 10 mm so far [m] off."""
    mesh = meshio.read(file)
    if apart is not None:
        cube = [
            [0, 0, 0],
            [1, 0, 0],
            [1, 1, 0],
            [0, 1, 0],
            [0, 0, 1],
            [1, 0, 1],
            [1, 1, 1],
            [0, 1, 1],
        ]
        nodes = list(range(len(mesh.points), len(mesh.points) + 8))
        mesh.points = np.vstack([mesh.points, apart + 0.01 * np.array(cube)])
    names = {**mesh.field_data, "spots": np.array([98, 0]), "lines": np.array([97, 1])}
    number = 99 if name is None else names.setdefault(name, np.array([99, 3]))[0]
    tags = [*mesh.cell_data["gmsh:physical"], *([t] for t in (98, 97, number))]
    tags = [np.asarray(t) for t in tags]
    cells = [("vertex", [[0]]), ("line", [[0, 1]]), (kind, [nodes])]
    data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
    blocks = [*((block.type, block.data) for block in mesh.cells), *cells]
    complete = meshio.Mesh(mesh.points, blocks, cell_data=data, field_data=names)
    complete.write(tmp_path / "more.msh", file_format="gmsh22", binary=False)
    return tmp_path / "more.msh"


@pytest.mark.slow
def test_cells_in_no_named_volume_are_left_out(file, tmp_path):
    more = with_others(file, tmp_path, "pyramid", None, [0, 1, 2, 3, 4])
    before, after = bodies(file), bodies(more)
    for body, mesh in before.items():
        assert (mesh.nelements, mesh.nvertices) == (after[body].nelements, after[body].nvertices)
    faces = [len(case["block"].boundaries["block:+x"]) for case in (before, after)]
    assert list(before) == list(after) and faces[0] == faces[1] > 0


def test_a_named_volume_beside_those_of_the_rig_is_refused(file, tmp_path):
    nodes = meshio.read(file).points
    apart = with_others(file, tmp_path, "hexahedron", "air", None, 10 + np.ptp(nodes))
    with pytest.raises(InvalidScene, match=r'"?air"?'):
        modes_hz(*STAGE_1, f"mesh.file={apart}")


@pytest.mark.parametrize(
    ("kind", "name", "nodes", "sentence"),
    [
        ("pyramid", "block", [0, 1, 2, 3, 4], "'block' with pyramids and hexahedra"),
        ("tetra", "block", [0, 1, 2, 3], "'block' with tetrahedra and hexahedra"),
        ("hexahedron", "sheet+y", None, "1 cells in two volumes"),
    ],
)
def test_cells_that_would_be_lost_or_count_twice_are_refused(
    file, tmp_path, kind, name, nodes, sentence
):
    nodes = meshio.read(file).cells[0].data[0] if nodes is None else nodes
    with pytest.raises(InvalidScene, match=sentence):
        volumes_of(with_others(file, tmp_path, kind, name, nodes))


@pytest.mark.parametrize("ending", ["vtu", "inp"])
def test_names_of_scikit_fem_and_of_sets_are_kept(file, tmp_path, ending):
    plain, given = bodies(file), meshio.read(file)
    path = tmp_path / f"mine.{ending}"
    pairs = zip(given.cells, given.cell_data["gmsh:physical"], strict=True)
    solid, tags = zip(*((b.data, t) for b, t in pairs if b.type == "hexahedron"), strict=True)
    sets = {
        name: np.flatnonzero(np.concatenate(tags) == number)
        for name, (number, dimension) in given.field_data.items()
        if dimension == 3
    }
    if ending == "vtu":
        mesh = MeshHex(given.points.T, np.concatenate(solid).T[INV_HEX_MAPPING[:8]])
        mesh = mesh.with_subdomains(sets)
        at = scene("rig-rom").rig.assembly.block_x / 2
        end = mesh.facets_satisfying(lambda x: np.abs(x[0] - at) < 1e-9, boundaries_only=True)
        mesh.with_boundaries({"end": end}).save(path)
    else:
        cells = [("hexahedron", np.concatenate(solid))]
        cell_sets = {name: [cells] for name, cells in sets.items()}
        meshio.Mesh(given.points, cells, cell_sets=cell_sets).write(path)
    again = bodies(path)
    for name in ("block", "sheet-y", "sheet+y"):
        assert again[name].nelements == plain[name].nelements
    if ending == "vtu":
        assert len(again["block"].boundaries["end"]) > 0


@pytest.mark.parametrize(("text", "sentence"), [(None, "does not exist"), ("x", "cannot be read")])
def test_a_file_that_is_no_mesh_is_refused(tmp_path, text, sentence):
    path = tmp_path / "none.msh"
    if text:
        path.write_text(text)
    with pytest.raises(InvalidScene, match=sentence):
        modes_hz(f"mesh.file={path}")


@pytest.mark.slow
def test_a_table_adds_its_two_slow_modes(file):
    plain = modes_hz(*STAGE_1)
    on_table = modes_hz(*STAGE_1, "table.frequency=6.5", "table.mass=1000.0")
    np.testing.assert_allclose(on_table[:2], 6.5, rtol=0.02)
    np.testing.assert_allclose(on_table[2:], plain[:2], rtol=0.02)
