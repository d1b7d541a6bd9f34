"""The stated error of the mesh beside that against a finer one, where second meshes are hard to
make: of few elements, of bodies that bores and thickness bound, of the user's own."""

from contextlib import nullcontext
from dataclasses import replace
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest
from skfem import Basis, FacetBasis, MeshHex, MeshTet

from beadwave import fem, geometry, rom
from beadwave.workflows.files.scene import scene
from beadwave.workflows.stages.chain.walls import wall_of
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.errors import better_walls
from beadwave.workflows.stages.errors import second_mesh as errors
from beadwave.workflows.stages.structure import assembly, bodies
from beadwave.workflows.stages.structure.reduction import TO_HZ, contact_of

from meshed_boxes import SCENE, boxes

pytestmark = pytest.mark.usefixtures("shared_cache")

CHAIN = """
chain = { count = 5, radius = 0.005, density = 7800.0, young = 210e9, poisson = 0.3 }
striker = { velocity = 0.2 }
wall = { kind = "rom" }
damping = { kind = "modal", ratio = 0.01 }
time = { duration = 4e-4 }
"""


def pipeline(*changes):
    return pipeline_of(scene(*changes), lambda name: nullcontext())


def against(held, finer):
    """Difference of the run's mesh (Parts) from a finer one, both in 60 modes."""
    scene, begun, run = held.scene, held("start"), held("impact")

    def velocities(mesh):
        model = assembly.model(scene, mesh)
        contact = assembly.contact(scene, mesh, model)
        asked = rom.Selection(n_modes=60, choice="contact", to_hz=TO_HZ)
        found = rom.free_modes(model.K, model.M, contact.w, asked, factorise=fem.factorised)
        found = found._replace(T=None, contact=contact_of(scene, model, contact))
        before = better_walls.march_before(wall_of(scene, found), begun, run.trajectory)
        return better_walls.observed_velocities(scene, before)

    off = velocities(held("mesh")) - velocities(finer)
    return float(np.abs(off).max() / np.abs(begun.velocity).max())


@pytest.mark.parametrize("scale", [1000, 30, 8, pytest.param(4, marks=pytest.mark.slow)])
def test_the_error_stated_of_a_few_elements_is_that_against_many(scale):
    """One to eight of them along a cantilever; measured 1.1, 1.3, 1.3 and 1.9 of the true one."""
    held = pipeline("cantilever", (f"mesh.scale={scale}",))
    finer = bodies.parts(held.scene, coarser=1.5 / scale)
    assert 1 < held("mesh-error") / against(held, finer) < 2.5


@pytest.mark.slow
def test_the_static_compliance_of_a_few_elements_misses_what_is_stated(tmp_path):
    """A box of 24 elements, without the half-space under its patch, against K^-1 w of meshes whose
    elements are split in 8 and in 64, with the order that these show: 1.3 times the true error."""
    path = Path(__file__).parents[2] / "examples" / "mesh_errors.py"
    spec = spec_from_file_location("mesh_errors", path)
    example = module_from_spec(spec)
    spec.loader.exec_module(example)
    box = example.structure(6151, 0, tmp_path)
    held = pipeline_of(box.but(mesh={"scale": 2.4 * box.mesh.scale}), lambda name: nullcontext())
    value, of_mesh, _ = example.stated(held)["static_compliance_m_per_N"]

    compliances, own = [], held("mesh")
    for times in range(3):
        split = {n: geometry.refined(m, times) for n, m in own.meshes.items()}
        mesh = own._replace(meshes=split)
        model = assembly.model(held.scene, mesh)
        contact = assembly.contact(held.scene, mesh, model)
        half_space = contact_of(held.scene, model, contact).half_space
        solved = fem.factorised(model.K).solve(contact.w)
        compliances.append(float(contact.w @ solved) - half_space)
    assert value == pytest.approx(compliances[0], rel=1e-6)
    coarse, middle, fine = compliances
    limit = fine + (fine - middle) ** 2 / (2 * middle - coarse - fine)
    assert 1 < of_mesh / (limit - value) < 1.7


@pytest.mark.slow
@pytest.mark.parametrize("element", ["hex", "tet"])
def test_bores_and_thin_bodies_do_not_keep_the_second_mesh_fine(element):
    """Twice the seeds alone change 2 % of the nodes of plates that are thin and bored."""
    bolted = scene("plate-on-bolts", ("mesh.scale=4", f"mesh.element={element}"))
    mesh = assembly.mesh(bolted)
    second, left = errors.other_mesh(bolted, mesh)
    assert left == pytest.approx(1 / (2**1.5 - 1))
    for body, nodes in second.nodes.items():
        assert nodes < 0.55 * mesh.nodes[body]
        holes = [part.meshes[body] for part in (mesh, second)]
        volumes = [Basis(m, m.elem(), intorder=3).dx.sum() for m in holes]
        assert volumes[1] == pytest.approx(volumes[0], rel=1e-9)


def test_a_mesh_that_is_hardly_coarser_tells_no_error(monkeypatch):
    """If none is made finer either, a sentence stands in place of a number too small."""
    held, whole = pipeline("cantilever"), bodies.parts
    monkeypatch.setattr(
        bodies, "parts", lambda scene, sizes, coarser: whole(scene, sizes, coarser**0.1)
    )
    monkeypatch.setattr(errors, "MAX_UNKNOWNS", 3e4)
    with pytest.raises(ValueError, match=r"cannot be made larger, .* 3\.1e\+04 unknowns"):
        errors.other_mesh(held.scene, whole(held.scene))


@pytest.mark.slow
def test_the_error_stated_of_a_mesh_of_the_users_own_is_that_against_a_finer_one():
    """Hexahedra below, tetrahedra above, each in eight, against each in 64."""
    boxes(Path("boxes.inp"))
    words = 'mesh = "boxes.inp"\ntouching = "tied"'
    Path("mine.toml").write_text(CHAIN + SCENE.format(top="cover", words=words))
    held = pipeline("mine.toml")
    own = held("mesh")
    finer = own._replace(meshes={n: geometry.refined(m, 2) for n, m in own.meshes.items()})
    assert 1 < held("mesh-error") / against(held, finer) < 2.5


@pytest.mark.parametrize("kind", [MeshTet, MeshHex])
def test_a_refined_mesh_keeps_volume_and_named_faces(kind):
    """Of a skewed body: neither its edges nor its faces are along the axes."""
    axes = np.linspace(0, 1, 4), np.linspace(0, 2, 3), np.linspace(0, 0.5, 2)
    box = kind.init_tensor(*axes).with_boundaries({"end": lambda x: x[0] == 0})
    skew = np.array([[1.0, 0.2, 0.0], [0.3, 1.0, 0.1], [0.0, 0.4, 1.0]])
    skewed = replace(box, doflocs=skew @ box.p)
    fine = geometry.refined(skewed, 2)
    assert fine.nelements == 64 * skewed.nelements
    assert len(fine.boundaries["end"]) == 16 * len(skewed.boundaries["end"])
    volume, area = (
        (Basis(m, m.elem()).dx.sum() for m in (skewed, fine)),
        (FacetBasis(m, m.elem(), facets="end").dx.sum() for m in (skewed, fine)),
    )
    for first, second in (volume, area):
        assert second == pytest.approx(first, rel=1e-12)


THIN_BOX = """
# a box of 121 x 76 x 31 mm with walls of 3 mm and a lid on four screws, whose washers end 0.1 mm
# from the edges of the walls: there the mesh has slivers
[assembly]
held = []
touching = "free"
material = "aluminium"

[materials.aluminium]
young = 70e9
poisson = 0.33
density = 2700.0

[bodies.floor]
box = [0.121, 0.076, 0.003]
at = [0.0, 0.0, 0.0015]
[bodies.left]
box = [0.003, 0.076, 0.028]
at = [-0.059, 0.0, 0.017]
[bodies.right]
box = [0.003, 0.076, 0.028]
at = [0.059, 0.0, 0.017]
[bodies.front]
box = [0.115, 0.003, 0.028]
at = [0.0, -0.0365, 0.017]
[bodies.back]
box = [0.115, 0.003, 0.028]
at = [0.0, 0.0365, 0.017]
[bodies.lid]
box = [0.121, 0.076, 0.003]
at = [0.0, 0.0, 0.0325]

[[ties]]
between = "floor|left"
[[ties]]
between = "floor|right"
[[ties]]
between = "floor|front"
[[ties]]
between = "floor|back"
[[ties]]
between = "left|front"
[[ties]]
between = "left|back"
[[ties]]
between = "right|front"
[[ties]]
between = "right|back"

[[joints]]
name = "screws"
between = "lid|left"
at = [[-0.059, -0.03, 0.031], [-0.059, 0.03, 0.031]]
washer = 0.0014
kz = 2e8
[[joints]]
name = "screws2"
between = "lid|right"
at = [[0.059, -0.03, 0.031], [0.059, 0.03, 0.031]]
washer = 0.0014
kz = 2e8
"""


@pytest.mark.slow
def test_slivers_between_washers_and_edges_do_not_make_the_error_stated(tmp_path):
    """Half of the true error is seen against elements of 0.4 of the size (246 646 unknowns: 775.2,
    1394.8, ... Hz), whose own error is as large again. Without the bound by the strain energy of
    the elements there, 41, 24, 2.7, 42, 75 and 3.9 % are stated."""
    file = tmp_path / "box.toml"
    file.write_text(THIN_BOX)
    run = pipeline(file)
    modes = run("modes")
    stated = run("missed-energy").of_frequencies(modes.omega)[6:12]
    finer = np.array([775.209, 1394.765, 2056.490, 2131.507, 2308.393, 2756.376])
    seen = 1 - finer / (modes.omega[6:12] / (2 * np.pi))
    assert np.all(stated > 2 * seen)
    assert np.all(stated < 6.5 * seen)


def test_the_energies_of_elements_add_up_to_the_errors_stated():
    """Of one mode and of the static response, of which each element has the larger part."""
    held = pipeline("cantilever", ("mesh.error=0.001", "mesh.unknowns=3000", "mesh.modes=1"))
    missed = held("missed-energy")
    (energy,) = missed.of_cells.values()
    assert energy.shape == (held("mesh").meshes["beam"].nelements,)
    relative = np.diag(missed.energy) / missed.omega**2
    assert (1 - missed.of_frequencies(held("modes").omega[:1])[0]) ** -2 - 1 == pytest.approx(
        relative[0]
    )
    first, static = relative[0], relative[-1]
    assert max(first, static) < 1.001 * energy.sum() < 1.002 * (first + static)
