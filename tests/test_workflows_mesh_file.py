"""A mesh of the user's own, made here by our mesher and read back from a file of another format."""

from contextlib import nullcontext

import gmsh
import meshio
import numpy as np
import pytest
from skfem.io.meshio import HEX_MAPPING

from geometry import Assembly, hex_mesh, tet_mesh
from geometry.gmsh_session import session
from workflows.files.mesh import mesh_of
from workflows.files.scene import scene
from workflows.scene import InvalidScene
from workflows.stages.pipeline import pipeline_of

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


def modes_hz(*changes):
    computed = pipeline_of(scene("rig-full-tie", changes), lambda name: nullcontext())("modes")
    return computed.omega[:4] / (2 * np.pi)


@pytest.fixture
def file(tmp_path):
    """Block and sheets as gmsh writes them: named volumes, and one named surface."""
    mesh = hex_mesh(Assembly(parts=("block", "sheets")), seed=0.012, block_seed=0.04,
                    support_seed=0.03, contact_seed=5e-3, contact_point=(0.03, 0.0),
                    glued=True)  # fmt: skip
    cells, tags, names = [], [], {}
    for group, kind, dim, nodes in (
        (mesh.subdomains, "hexahedron", 3, mesh.t[HEX_MAPPING[:8]]),
        ({"block:+x": mesh.boundaries["block:+x"]}, "quad", 2, mesh.facets),
    ):
        for name, members in group.items():
            names[name] = np.array([len(names) + 1, dim])
            cells.append((kind, nodes[:, members].T))
            tags.append(np.full(len(members), len(names)))
    path = tmp_path / "mine.msh"
    data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
    complete = meshio.Mesh(mesh.p.T, cells, cell_data=data, field_data=names)
    complete.write(path, file_format="gmsh22", binary=False)
    return path


@pytest.mark.slow
def test_a_mesh_with_our_names_gives_the_same_modes(file):
    np.testing.assert_allclose(
        modes_hz(*STAGE_1, f"mesh.file={file}"), modes_hz(*STAGE_1), rtol=1e-8
    )


def test_a_mesh_without_a_name_is_refused_with_that_name(file):
    with pytest.raises(InvalidScene, match="no volume named 'plate'"):
        modes_hz('assembly.parts=["block","sheets","sheets_support","support","plate"]',
                 f"mesh.file={file}")  # fmt: skip


@pytest.fixture(scope="module")
def by_gmsh(tmp_path_factory):
    """Block and sheets in tetrahedra, written by gmsh itself in its versions, orders and modes."""
    folder, parts = tmp_path_factory.mktemp("gmsh"), Assembly(parts=("block", "sheets"))
    with session():
        volumes = tet_mesh.volumes_of(parts)
        gmsh.model.occ.synchronize()
        for name, tags in volumes.items():
            solids = [(3, tag) for tag in tags]
            points = gmsh.model.getBoundary(solids, combined=False, oriented=False, recursive=True)
            gmsh.model.mesh.setSize(points, 0.02)
            gmsh.model.addPhysicalGroup(3, tags, name=name)
        solids = [(3, tag) for tag in volumes["block"]]
        x = {t: gmsh.model.occ.getCenterOfMass(d, t)[0] for d, t in gmsh.model.getBoundary(solids)}
        gmsh.model.addPhysicalGroup(2, [max(x, key=x.get)], name="block:+x")
        gmsh.model.mesh.generate(3)
        for name, (version, order, binary, all_cells) in WRITTEN.items():
            gmsh.model.mesh.setOrder(order)
            gmsh.option.setNumber("Mesh.MshFileVersion", version)
            gmsh.option.setNumber("Mesh.Binary", binary)
            gmsh.option.setNumber("Mesh.SaveAll", all_cells)
            gmsh.write(str(folder / f"{name}.msh"))
    return folder


def read(path, *named):
    return mesh_of(path, Assembly(parts=("block", "sheets")), set(named))


@pytest.mark.parametrize("name", list(WRITTEN)[1:])
def test_a_mesh_keeps_its_names_in_every_version_and_order(by_gmsh, name):
    """4.1 with its lines, points and bounding entities, and elements of second order."""
    ours, plain = read(by_gmsh / f"{name}.msh", "block:+x"), read(by_gmsh / "plain.msh")
    cells = {body: len(computed) for body, computed in ours.subdomains.items()}
    assert cells == {body: len(computed) for body, computed in plain.subdomains.items()}
    middle = ours.p[0, ours.facets[:, ours.boundaries["block:+x"]]]
    np.testing.assert_allclose(middle, Assembly().block_x / 2)
    assert len(middle.T) == len(plain.boundaries["block:+x"]) > 0
    volumes = [np.sum(np.abs(np.linalg.det(corners(m)))) for m in (ours, plain)]
    np.testing.assert_allclose(*volumes, rtol=1e-9)


def corners(mesh):
    return np.moveaxis(mesh.p[:, mesh.t[1:]] - mesh.p[:, mesh.t[:1]], 2, 0)


@pytest.mark.parametrize("share", [0.2, 0.5, 0.9])
@pytest.mark.parametrize("end", [b"", b"\n$EndElements\n"])
def test_a_mesh_that_is_cut_off_is_refused(by_gmsh, tmp_path, share, end):
    """One that meshio and gmsh once waited for the end of, for ever."""
    complete = (by_gmsh / "binary.msh").read_bytes()
    (tmp_path / "cut.msh").write_bytes(complete[: int(share * len(complete))] + end)
    with pytest.raises(InvalidScene, match="cannot be read as a mesh"):
        read(tmp_path / "cut.msh")


def test_a_mesh_that_takes_for_ever_is_refused(by_gmsh, monkeypatch):
    monkeypatch.setattr("workflows.files.foreign.START", 0.05)
    monkeypatch.setattr("workflows.files.foreign.RATE", 1e9)
    with pytest.raises(InvalidScene, match="reading it does not end within"):
        read(by_gmsh / "plain.msh")


def test_a_script_that_is_named_as_a_mesh_is_not_run(tmp_path):
    (tmp_path / "script.msh").write_text(f'SystemCall "touch {tmp_path}/ran";\n')
    with pytest.raises(InvalidScene, match="does not begin with"):
        read(tmp_path / "script.msh")
    assert not (tmp_path / "ran").exists()


def with_others(file, tmp_path, kind, name, nodes):
    """The file with a point, a line and one cell of another kind in a volume of this name."""
    mesh = meshio.read(file)
    names = {**mesh.field_data, "spots": np.array([98, 0]), "lines": np.array([97, 1])}
    names.setdefault(name, np.array([99, 3]))
    tags = [*mesh.cell_data["gmsh:physical"], *([t] for t in (98, 97, names[name][0]))]
    tags = [np.asarray(t) for t in tags]
    cells = [("vertex", [[0]]), ("line", [[0, 1]]), (kind, [nodes])]
    data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
    blocks = [*((block.type, block.data) for block in mesh.cells), *cells]
    complete = meshio.Mesh(mesh.points, blocks, cell_data=data, field_data=names)
    complete.write(tmp_path / "more.msh", file_format="gmsh22", binary=False)
    return tmp_path / "more.msh"


def test_cells_outside_the_bodies_are_left_out(file, tmp_path):
    more = with_others(file, tmp_path, "pyramid", "air", [0, 1, 2, 3, 4])
    before, after = read(file, "block:+x"), read(more, "block:+x")
    assert (before.nelements, before.nvertices) == (after.nelements, after.nvertices)
    assert len(before.boundaries["block:+x"]) == len(after.boundaries["block:+x"]) > 0


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
        read(with_others(file, tmp_path, kind, name, nodes))


@pytest.mark.parametrize("ending", ["vtu", "inp"])
def test_names_of_scikit_fem_and_of_sets_are_kept(file, tmp_path, ending):
    plain = read(file, "block:+x")
    path = tmp_path / f"mine.{ending}"
    if ending == "vtu":
        plain.save(path)
    else:
        sets = {name: [cells] for name, cells in plain.subdomains.items()}
        cells = [("hexahedron", plain.t[HEX_MAPPING[:8]].T)]
        meshio.Mesh(plain.p.T, cells, cell_sets=sets).write(path)
    again = read(path, "block:+x")
    for name in ("block", "sheet-y", "sheet+y"):
        assert len(again.subdomains[name]) == len(plain.subdomains[name])
    assert len(again.boundaries["block:+x"]) == len(plain.boundaries["block:+x"])


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
