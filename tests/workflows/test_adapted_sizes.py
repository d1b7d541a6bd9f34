"""Sizes of elements from mesh.error: what is stated, true, counted and refused."""

import numpy as np
import pytest

import beadwave
from beadwave.workflows.files.scene import scene
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.engine.progress import quiet
from beadwave.workflows.stages.errors import adapted_sizes
from beadwave.workflows.stages.structure import assembly, bodies
from beadwave.workflows.stages.structure.meshed_parts import SolvedMesh

pytestmark = pytest.mark.usefixtures("shared_cache")

L = """
[assembly]
held = ["leg:-x"]
touching = "tied"
material = "steel"
[materials.steel]
young = 210e9
poisson = 0.3
density = 7800.0
[bodies.leg]
box = [0.02, 0.06, 0.1]
[bodies.arm]
box = [0.1, 0.06, 0.012]
at = [0.06, 0.0, 0.044]
"""


def of(name, *changes):
    return pipeline_of(scene(name, changes), quiet)


def hz(held, n=12):
    return held("modes").omega[:n] / (2 * np.pi)


def test_a_held_beam_meets_the_error_with_less_than_even_elements_leave():
    """Its clamped edge is singular. The frequency of the limit is that of mesh.error = 1e-3 with
    30 096 unknowns, 109.9387 Hz, less its own error by the order of three such meshes."""
    limit = 109.93
    adapted = of("cantilever", "mesh.error=0.003")
    sizes = adapted("sizes")
    assert sizes.bounded_by is None
    assert sizes.stated <= 0.003
    counts = [mesh.unknowns for mesh in sizes.meshes]
    assert np.all(np.diff(counts) > 0)
    assert adapted("model").K.shape[0] == counts[-1]

    # what is stated covers the way to the limit; as many even elements leave thrice as much
    error = 1 - limit / hz(adapted, 1)[0]
    stated = adapted("missed-energy").of_frequencies(adapted("modes").omega)[0]
    assert 0 < error < stated <= 0.003
    even = of("cantilever", "mesh.scale=0.5")
    assert 0.8 * counts[-1] < even("model").K.shape[0] < 1.2 * counts[-1]
    assert 1 - limit / hz(even, 1)[0] > 2.5 * error


def test_the_same_scene_has_the_same_mesh(tmp_path, monkeypatch):
    meshes = []
    for folder in "ab":
        monkeypatch.setenv("BEADWAVE_CACHE_DIR", str(tmp_path / folder))
        meshes.append(of("cantilever", "mesh.error=0.01")("mesh").meshes["beam"])
    assert np.array_equal(meshes[0].p, meshes[1].p)


@pytest.mark.slow
def test_tied_tetrahedra_meet_the_error(tmp_path):
    """Beside all elements of the found mesh split in eight."""
    file = tmp_path / "l.toml"
    file.write_text(L)
    held = of(file, "mesh.element=tet", "mesh.error=0.02")
    sizes = held("sizes")
    assert sizes.stated <= 0.02
    assert sizes.bounded_by is None

    from beadwave import fem, geometry
    from beadwave.workflows.stages.structure import assembly

    mesh = held("mesh")
    split = mesh._replace(meshes={b: geometry.refined(m, 1) for b, m in mesh.meshes.items()})
    model = assembly.model(held.scene, split)
    finer = fem.modes(model.K, model.M, 12).omega / (2 * np.pi)
    stated = held("missed-energy").of_frequencies(held("modes").omega)[:12]
    assert np.all(1 - finer / hz(held) < stated)


def test_a_bound_is_said_with_what_the_error_would_take():
    result = beadwave.modes("cantilever", {"mesh.error": 1e-4, "mesh.unknowns": 6000}).table
    assert result.mesh.bounded_by == "unknowns"
    assert result.mesh.stated > result.mesh.asked == 1e-4
    assert result.mesh.unknowns_for_asked > 6000
    assert result.mesh.seconds_for_asked > 0
    assert result.mesh.meshes[-1].unknowns < 1.2 * 6000
    assert any("more than mesh.unknowns allows" in said for said in result.warnings)
    assert "asked" in result.text()


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        (
            ("mesh.error=0.02", "mesh.scale=0.5"),
            "mesh.error and mesh.scale = 0.5 exclude each other",
        ),
        (
            ("mesh.error=0.02", "strike.weights=thesis"),
            'strike.weights = "thesis" belongs to one mesh',
        ),
        (("mesh.error=0",), "mesh.error = 0 .*greater than 0"),
        (("mesh.error=1.5",), "mesh.error = 1.5 .*less than 1"),
        (("mesh.unknowns=10",), "mesh.unknowns = 10 .*1000"),
    ],
)
def test_what_contradicts_an_error_of_the_mesh_is_refused(changes, sentence):
    with pytest.raises(InvalidScene, match=sentence):
        scene("cantilever", changes)


def test_a_floor_ends_the_search_once_meshes_have_done_their_part():
    """Of dents under springs of 0.8 %, 1 % asked: a coarse mesh of 5 % is refined all the same."""

    def ended(stated):
        found = adapted_sizes.Indicators(stated, 0.008, {}, {}, None)
        return adapted_sizes._ended([SolvedMesh(1000, 100, stated, 1.0)], found, 0.01)

    assert ended(0.05) is None
    assert ended(0.015) == "floor"


def test_the_last_mesh_of_the_search_is_not_solved_again(tmp_path, monkeypatch):
    """A later run, which knows the sizes alone, has the same mesh."""
    monkeypatch.setenv("BEADWAVE_CACHE_DIR", str(tmp_path))
    held = of("cantilever", "mesh.error=0.02")
    n_unknowns = held("sizes").meshes[-1].unknowns
    with monkeypatch.context() as patched:
        for module, name in ((bodies, "parts"), (assembly, "model"), (assembly, "modes")):
            patched.setattr(module, name, lambda *a: pytest.fail("solved again"))
        assert len(held("modes").phi) == n_unknowns
        assert held("contact").w.shape == (n_unknowns,)

    later = of("cantilever", "mesh.error=0.02")
    assert np.array_equal(later("mesh").meshes["beam"].p, held("mesh").meshes["beam"].p)
    assert {stage.name for stage in later.reports} == {"mesh"}
