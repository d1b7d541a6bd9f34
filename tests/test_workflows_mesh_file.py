"""A mesh of the user's own, made here by our mesher and read back from a file of another format."""

from contextlib import nullcontext

import meshio
import numpy as np
import pytest
from skfem.io.meshio import HEX_MAPPING

from geometry import Assembly, hex_mesh
from workflows.scene import InvalidScene
from workflows.scene_file import scene
from workflows.stages import pipeline_of

STAGE_1 = ('assembly.parts=["block", "sheets"]', "mesh.seed=0.012", "mesh.block_seed=0.04")


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("BEADWAVE_CACHE_DIR", str(tmp_path / "cache"))


def modes_hz(*changes):
    found = pipeline_of(scene("rig-full-tie", changes), lambda name: nullcontext())("modes")
    return found.omega[:4] / (2 * np.pi)


@pytest.fixture
def file(tmp_path):
    """Block and sheets as gmsh writes them: named volumes, and one named surface."""
    mesh = hex_mesh(Assembly(parts=("block", "sheets")), seed=0.012, block_seed=0.04,
                    support_seed=0.03, contact_seed=4e-3, contact_point=(0.03, 0.0))  # fmt: skip
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
    whole = meshio.Mesh(mesh.p.T, cells, cell_data=data, field_data=names)
    whole.write(path, file_format="gmsh22", binary=False)
    return path


def test_a_mesh_with_our_names_gives_the_same_modes(file):
    np.testing.assert_allclose(
        modes_hz(*STAGE_1, f"mesh.file={file}"), modes_hz(*STAGE_1), rtol=1e-9
    )


def test_a_mesh_without_a_name_is_refused_with_that_name(file):
    with pytest.raises(InvalidScene, match="no volume named 'plate'"):
        modes_hz('assembly.parts=["block","sheets","sheets_support","support","plate"]',
                 f"mesh.file={file}")  # fmt: skip


@pytest.mark.parametrize(("text", "sentence"), [(None, "no such file"), ("x", "cannot be read")])
def test_a_file_that_is_no_mesh_is_refused(tmp_path, text, sentence):
    path = tmp_path / "none.msh"
    if text:
        path.write_text(text)
    with pytest.raises(InvalidScene, match=sentence):
        modes_hz(f"mesh.file={path}")


def test_a_table_adds_its_two_slow_modes(file):
    plain = modes_hz(*STAGE_1)
    on_table = modes_hz(*STAGE_1, "table.frequency=6.5", "table.mass=1000.0")
    np.testing.assert_allclose(on_table[:2], 6.5, rtol=0.02)
    np.testing.assert_allclose(on_table[2:], plain[:2], rtol=0.02)
