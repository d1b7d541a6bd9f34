"""Meshes of quadratic elements whose midside nodes lie on a curve."""

import json
from math import pi
from pathlib import Path

import gmsh
import meshio
import numpy as np
import pytest
from skfem import Basis, MeshHex, MeshHex2, MeshTet, MeshTet2
from skfem.io.meshio import HEX_MAPPING

from beadwave import fem, geometry
from beadwave.fem.modes.mode_field import ModeField, write
from beadwave.geometry.meshing.gmsh_session import session
from beadwave.geometry.own_mesh.curved import _holding, is_curved
from beadwave.workflows.files.mesh_reader import volumes_of

from command_line import beadwave

pytestmark = pytest.mark.usefixtures("shared_cache", "files_read_here")

INNER, OUTER, HEIGHT, DENSITY = 0.04, 0.05, 0.02, 7850.0
RING = """
name = "ring"
materials.steel = {{ young = 210e9, poisson = 0.3, density = 7850.0 }}
[assembly]
mesh = "{file}"
held = []
material = "steel"
{words}
"""


def ring(path, *, around=12, levels=2, curved=True):
    """A ring of bricks of 20 nodes, as a deck: nodes on a circle or on the chords."""
    x = [np.linspace(INNER, OUTER, 2), np.linspace(0, 2 * pi, around + 1)]
    mesh = MeshHex.init_tensor(*x, np.linspace(0, HEIGHT, levels + 1))
    r, angle, z = mesh.p
    corners = mesh.t[HEX_MAPPING[:8]].T
    edges = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4)]
    edges += [(i, i + 4) for i in range(4)]

    def placed(r, angle, z):
        return np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=-1)

    vertices = placed(r, angle, z)
    ends = corners[:, edges]
    middles = vertices[ends].mean(axis=2)
    if curved:
        middles = placed(*(a[ends].mean(axis=2) for a in (r, angle, z)))
    points = np.concatenate([vertices, middles.reshape(-1, 3)])
    # nodes at one place are one
    _, first, number = np.unique(points.round(9), axis=0, return_index=True, return_inverse=True)
    n = len(vertices)
    nodes = np.column_stack([corners, n + np.arange(12 * len(corners)).reshape(-1, 12)])
    cells = [("hexahedron20", number.ravel()[nodes])]
    sets = {"ring": [np.arange(len(corners))]}
    meshio.Mesh(points[first], cells, cell_sets=sets).write(path)


def modes(capsys, file, words=""):
    Path("ring.toml").write_text(RING.format(file=file, words=words), encoding="utf-8")
    assert beadwave("modes", "ring.toml", "--json") == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    return [row for row in rows if row["frequency_hz"] > 1]


def look(capsys):
    assert beadwave("look", "ring.toml", "--json") == 0
    return json.loads(capsys.readouterr().out)


def test_a_ring_of_curved_bricks_has_the_modes_that_calculix_computes(capsys):
    """CalculiX 2.20 on this mesh of C3D20: 3321.9 and 4623.1 Hz. On finer meshes the first one
    comes to 3100.8 Hz, which the stated error covers."""
    ring("ring.inp")
    rows = modes(capsys, "ring.inp")
    hz = [row["frequency_hz"] for row in rows[:4]]
    assert hz == pytest.approx([3321.9, 3321.9, 4623.1, 4623.1], rel=2e-5)
    assert 0.01 * rows[0]["error_percent"] > 3321.9 / 3100.8 - 1
    report = look(capsys)
    mass = DENSITY * pi * (OUTER**2 - INNER**2) * HEIGHT
    # parabolas over 30 degrees are 1.6e-4 of the area inside of the circle
    assert report["bodies"][0]["mass_kg"] == pytest.approx(mass, rel=2e-4)
    (hole,) = report["holes"]
    assert hole["diameter_m"] == pytest.approx(2 * INNER, rel=1e-6)


def test_nodes_in_the_middles_of_straight_edges_change_nothing(capsys):
    ring("ring.inp", curved=False)
    meshes = volumes_of(Path("ring.inp")).meshes
    assert not is_curved(meshes["ring"])
    quadratic = [row["frequency_hz"] for row in modes(capsys, "ring.inp")]
    file = meshio.read("ring.inp")
    cells = [("hexahedron", file.cells[0].data[:, :8])]
    meshio.Mesh(file.points, cells, cell_sets=file.cell_sets).write("corners.inp")
    assert quadratic == [row["frequency_hz"] for row in modes(capsys, "corners.inp")]


@pytest.mark.parametrize("around", [4, 6, 12])
def test_curved_faces_are_found_however_few_elements_are_around(tmp_path, around):
    """Chords of a square would make four planes; at the edges the elements are smooth."""
    from beadwave.geometry.own_mesh.mesh_bodies import own_mesh

    ring(tmp_path / "ring.inp", around=around)
    (body,) = own_mesh(volumes_of(tmp_path / "ring.inp").meshes, 1e-5).bodies.values()
    kinds = sorted((face.kind, face.hollow) for face in body.faces)
    assert kinds == [("cylinder", False), ("cylinder", True), ("plane", False), ("plane", False)]
    bore = next(face for face in body.faces if face.hollow)
    assert bore.radius == pytest.approx(INNER, rel=1e-6)
    parabola = {4: 2e-2, 6: 4e-3, 12: 3e-4}[around]
    assert bore.area == pytest.approx(2 * pi * INNER * HEIGHT, rel=parabola)


def sphere(path, order):
    """A ball of tetrahedra by gmsh, whose nodes lie on it."""
    with session():
        gmsh.model.occ.addSphere(0, 0, 0, OUTER)
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(3, [1], name="ball")
        gmsh.option.setNumber("Mesh.MeshSizeMax", OUTER / 2)
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 8)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(order)
        gmsh.write(str(path))


@pytest.mark.parametrize("ending", ["msh", "unv", "bdf", "inp", "med"])
def test_a_ball_of_curved_tetrahedra_has_its_volume_in_every_format(tmp_path, ending):
    """Corners alone enclose 13 % less."""
    sphere(tmp_path / f"ball.{ending}", 2)
    (mesh,) = volumes_of(tmp_path / f"ball.{ending}").meshes.values()
    assert isinstance(mesh, MeshTet2)
    volume = Basis(mesh, mesh.elem(), intorder=6).dx.sum()
    assert volume == pytest.approx(4 / 3 * pi * OUTER**3, rel=5e-3)


def test_curved_elements_of_order_three_are_refused(tmp_path):
    sphere(tmp_path / "ball.msh", 3)
    with pytest.raises(ValueError, match="curved elements of order 3; write order 1 or 2"):
        volumes_of(tmp_path / "ball.msh")


@pytest.mark.parametrize("kind", ["hex", "tet"])
def test_a_refined_curved_mesh_is_the_same_body(tmp_path, kind):
    """Each element in eight, nodes on the curve: volume and named faces stay."""
    if kind == "hex":
        ring(tmp_path / "body.inp", around=6)
    else:
        sphere(tmp_path / "body.inp", 2)
    (mesh,) = volumes_of(tmp_path / "body.inp").meshes.values()
    mesh = mesh.with_boundaries({"outside": mesh.boundary_facets()})
    fine = geometry.refined(mesh)
    assert isinstance(fine, MeshHex2 if kind == "hex" else MeshTet2)
    volumes = [Basis(m, m.elem(), intorder=6).dx.sum() for m in (mesh, fine)]
    assert volumes[1] == pytest.approx(volumes[0], rel=1e-9)
    assert len(fine.boundaries["outside"]) == 4 * len(mesh.boundaries["outside"])


def test_rigid_motions_of_curved_elements_store_no_energy(tmp_path):
    ring(tmp_path / "ring.inp", around=6)
    steel = fem.Material(210e9, 0.3, DENSITY)
    structure = fem.assemble(volumes_of(tmp_path / "ring.inp").meshes, {"ring": steel})
    x, y, z = structure.points.T
    turn = np.column_stack([-y, x, 0 * z]).ravel()
    stretched = np.column_stack([x, 0 * y, 0 * z]).ravel()
    energy = turn @ structure.K @ turn
    assert abs(energy) < 1e-12 * (stretched @ structure.K @ stretched)
    along = np.tile([1.0, 0.0, 0.0], len(x))
    volume = along @ structure.M @ along / DENSITY
    assert volume == pytest.approx(pi * (OUTER**2 - INNER**2) * HEIGHT, rel=3e-3)


@pytest.mark.parametrize("kind", ["hex", "tet"])
def test_pictures_show_the_nodes_of_curved_facets(tmp_path, kind):
    """The area of the drawn surface comes closer to the body's than its corners alone."""
    from beadwave.fem.assembly.trace import outer_nodes

    if kind == "hex":
        ring(tmp_path / "body.inp", around=6, levels=1)
        area = 2 * pi * (OUTER**2 - INNER**2) + 2 * pi * (OUTER + INNER) * HEIGHT
    else:
        sphere(tmp_path / "body.inp", 2)
        area = 4 * pi * OUTER**2
    (mesh,) = volumes_of(tmp_path / "body.inp").meshes.values()
    structure = fem.assemble({"body": mesh}, {"body": fem.Material(210e9, 0.3, DENSITY)})
    outer = outer_nodes(structure)
    a, b, c, d = (outer.points[outer.faces[:, i]] for i in (0, 1, 2, -1))
    drawn = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    drawn += np.linalg.norm(np.cross(c - a, d - a), axis=1) / 2
    assert drawn.sum() == pytest.approx(area, rel=0.03)
    np.testing.assert_allclose(structure.points[outer.dofs[:, 0] // 3], outer.points)


@pytest.mark.slow
def test_a_curved_body_is_struck_on_its_round_face(capsys):
    """The chain leans on a patch of the outer cylinder, held at the lower plane."""
    ring("ring.inp", around=12, levels=4)
    words = 'strike = { on = "ring:cylinder", at = [0.05, 0.0, 0.01], radius = 1e-3 }'
    text = RING.format(file="ring.inp", words="").replace("held = []", 'held = ["ring:-z"]')
    Path("ring.toml").write_text(f"{words}\n{text}", encoding="utf-8")
    assert beadwave("modes", "ring.toml", "--json") == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert rows[0]["participation"] is not None and rows[0]["frequency_hz"] > 1e3


@pytest.mark.parametrize("kind", [MeshHex2, MeshTet2])
def test_modes_of_curved_cells_are_written_at_their_corners(kind, tmp_path):
    mesh = kind.from_mesh(kind.__base__())
    u = np.zeros((1, mesh.nvertices, 3), np.float32)
    one = np.ones(1, int)
    write(tmp_path / "modes.vtu", ModeField({"body": mesh}, one, 100.0 * one, u, one))
    grid = meshio.read(tmp_path / "modes.vtu")
    assert len(grid.points) == mesh.nvertices
    assert [len(block.data) for block in grid.cells] == [mesh.nelements]


def test_cells_of_a_flat_mesh_are_found_where_middles_of_others_are_nearer():
    """Tetrahedra a hundred times as long as thick; eight small ones lie in each that was split."""
    mesh = MeshTet.init_tensor(np.linspace(0, 1, 4), np.linspace(0, 0.01, 9), np.linspace(0, 1, 4))
    fine = mesh.refined()
    middles = fine.p[:, fine.t].mean(axis=1)
    holding = _holding(mesh, middles)
    assert np.all(np.bincount(holding, minlength=mesh.nelements) == 8)
    X = mesh.mapping().invF(middles[:, :, None], tind=holding)[:, :, 0]
    assert X.min() > -1e-9 and X.sum(axis=0).max() < 1 + 1e-9
