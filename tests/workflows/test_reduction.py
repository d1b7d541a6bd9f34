"""Keys of a scene for patch and reduction, run on a coarse mesh."""

from contextlib import nullcontext
from importlib import import_module

import numpy as np
import pytest
from joblib import Memory
from scipy.io import loadmat
from scipy.sparse.linalg import spsolve
from scipy.spatial import KDTree

from beadwave import coupling, dem, fem, rom
from beadwave.fem.modes.assembly_modes import AssemblyModes
from beadwave.fem.modes.solver.factorisation import factorised
from beadwave.rom.truncation import LOSS, frequencies, rms, size
from beadwave.workflows.files.output_file import OutputFile
from beadwave.workflows.files.run_folder import RunFolder
from beadwave.workflows.files.scene import scene
from beadwave.workflows.run.run import run, summary_of
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.stages.chain.chain import chain, initial_velocity, start
from beadwave.workflows.stages.chain.impact import impact as chain_impact
from beadwave.workflows.stages.chain.walls import wall_of
from beadwave.workflows.stages.engine.pipeline import Pipeline, pipeline_of
from beadwave.workflows.stages.errors import better_walls, second_mesh
from beadwave.workflows.stages.structure import assembly as assembly_stages
from beadwave.workflows.stages.structure import reduction as reductions
from beadwave.workflows.stages.structure.health import reduction_health
from beadwave.workflows.stages.structure.reduction import (
    SecondModel,
    contact_of,
    reduction,
    targets_kept,
)
from beadwave.workflows.structure.export import write_reduced

from command_line import COARSE_RIG

pytestmark = pytest.mark.usefixtures("shared_cache")

COARSE = (
    *COARSE_RIG,
    "output.samples=601", "time.duration=1e-3",
)  # fmt: skip


def pipeline(*changes):
    return pipeline_of(scene("rig-rom", (*COARSE, *changes)), lambda name: nullcontext())


@pytest.mark.slow
def test_an_error_picks_the_modes_and_is_met_by_the_full_model():
    """Asked for 1e-3 to 8 kHz; the direct solution of the full model has the last word."""
    run = pipeline("reduction.kind=free-modes", "reduction.error=1e-3", "reduction.to_hz=8000.0")
    model, w, reduced = run("model"), run("contact").w, run("reduction")
    f = np.array([300.0, 1500.0, 5000.0, 7900.0])
    full = fem.receptance(model.K, model.M, w, f, loss_factor=0.01)
    found = rom.receptance(reduced, None, f, loss=0.01)
    assert np.linalg.norm(found - full) < 1e-3 * np.linalg.norm(full)
    assert reduced.error < 1e-3
    tighter = pipeline("reduction.kind=free-modes", "reduction.error=1e-5", "reduction.to_hz=8e3")
    assert len(tighter("reduction").w) > len(reduced.w)


@pytest.mark.parametrize("kind", ["craig-bampton", "free-modes"])
def test_modes_reduction_mac_and_response_of_a_held_assembly_share_one_factor(kind, monkeypatch):
    """The half-space under the patch, a part of the body struck, is factorised for itself."""
    sizes = []

    def counting(A):
        sizes.append(A.shape[0])
        return factorised(A)

    for module in (
        "beadwave.fem",
        "beadwave.fem.modes.modes",
        "beadwave.fem.modes.solver.receptance",
    ):
        monkeypatch.setattr(import_module(module), "factorised", counting)
    changes = ("mesh.scale=2", f"reduction.kind={kind}")
    run = Pipeline(scene("cantilever", changes), Memory(None, verbose=0))
    reduced = run("reduction")
    run("full-response"), run("mac")
    assert sizes == [run("model").K.shape[0]]
    run("missed-energy")
    n_factors = len(sizes)
    # as large as all else together
    assert not {"factor", "krylov-space"} & run._results.keys()
    alone = reduction(run.scene, run("model"), run("contact"), run("modes"))
    assert len(sizes) == n_factors + 1
    # the modes chosen come from two spaces, each with an error below 2e-8; rounding leaves 1e-9 of
    # a frequency, which a resonance of this loss factor multiplies by 100
    f = frequencies(20e3)
    shared, separate = (rom.receptance(one, None, f, loss=LOSS) for one in (reduced, alone))
    assert max(reduced.error, alone.error) < 2e-8
    assert rms(shared - separate) < 1e-6 * size(separate)


def test_what_floats_or_is_held_softly_has_no_factor_to_share():
    run = pipeline('assembly.parts=["block"]', "reduction.kind=free-modes", "preload.force=0.0")
    K, M = run("model").K, run("model").M
    assert fem.held(K, M) is None
    assert fem.held((K + (2 * np.pi * 4.0) ** 2 * M).tocsc(), M) is None
    assert fem.held((K + (2 * np.pi * 6.0) ** 2 * M).tocsc(), M) is not None


def test_a_block_that_nothing_holds_is_reduced_by_free_modes():
    """Its modes are there already: six rigid motions, orthonormal in mass like the others."""
    run = pipeline('assembly.parts=["block"]', "reduction.kind=free-modes", "preload.force=0.0")
    model, w, reduced = run("model"), run("contact").w, run("reduction")
    f = np.array([1.0, 2e3, 8e3])
    full = fem.receptance(model.K, model.M, w, f, loss_factor=0.01)
    found = rom.receptance(reduced, None, f, loss=0.01)
    assert np.all(np.abs(found / full - 1) < 1e-3)


@pytest.mark.slow
def test_the_boundary_of_the_reduction_holds_what_the_contact_reads():
    run = pipeline()
    reduced, contact = run("reduction"), run("contact")
    assert reduced.n_boundary == np.count_nonzero(contact.w) == len(contact.boundary) // 3
    np.testing.assert_array_equal(reduced.w[: reduced.n_boundary], contact.w[contact.w != 0])


@pytest.mark.slow
def test_the_structure_under_a_node_is_that_under_a_patch():
    """A node's compliance is another one, what it has beyond the half-space is the same."""
    node, patch = pipeline("patch.nodes=[[0.03, 0.0]]")("reduction"), pipeline()("reduction")
    local = [r.contact.half_space for r in (node, patch)]
    whole = [rom.static_compliance(r) for r in (node, patch)]
    assert local[0] > 2 * local[1]
    assert whole[0] - local[0] == pytest.approx(whole[1] - local[1], rel=5e-3)


@pytest.mark.slow
def test_the_scheme_of_the_thesis_runs_with_a_warning_and_its_gain(tmp_path):
    thesis = scene("rig-rom", (*COARSE, "patch.weights=thesis"))
    summary = run(pipeline_of(thesis, lambda name: nullcontext()), RunFolder(tmp_path))
    assert any("not passive" in sentence for sentence in summary.warnings)
    assert any("largest gain" in sentence for sentence in summary.warnings)
    assert summary.energy_error > 1e-4  # 1e-10 with one functional
    assert len(summary.verdict) > 2


@pytest.mark.slow
def test_the_thesis_reads_beside_the_node_that_it_pushes():
    wall = pipeline("patch.weights=thesis")("wall")
    assert isinstance(wall, coupling.CoupledWall) and not wall.reciprocal
    read = pipeline("patch.weights=thesis", "patch.nodes=[[0.03, 0.0]]")("wall")
    np.testing.assert_allclose(read.reading, read.force)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("reduction.kind=free-modes", "craig-bampton"),
        ("time.dt=1e-6", "time.error"),
        ("patch.nodes=[[0.06, 0.0]]", "patch.nodes"),
    ],
)
def test_what_the_thesis_scheme_cannot_do_is_refused(change, words):
    with pytest.raises(InvalidScene, match=words):
        scene("rig-rom", (*COARSE, "patch.weights=thesis", change))


def test_a_key_of_earlier_scenes_is_refused_with_its_replacement():
    with pytest.raises(InvalidScene, match=r"prune is no key any more; drop it: reduction\.error"):
        scene("rig-rom", ("wall.prune=true",))


@pytest.mark.slow
def test_the_summary_holds_the_health_of_the_reduction(tmp_path):
    rig = pipeline_of(scene("rig-rom", COARSE), lambda name: nullcontext())
    summary = run(rig, RunFolder(tmp_path))
    health = summary.reduction
    assert health.coordinates == 61 and health.rigid_modes == 0
    assert health.asymmetry < 1e-12 and not health.findings
    assert 0.5 < health.effective_mass_captured < 1
    more = pipeline("reduction.modes=80")("reduction").mass.captured
    assert health.effective_mass_captured < more < 1
    assert "effective mass" in (tmp_path / "report.html").read_text()


@pytest.mark.slow
def test_the_parts_are_weighed_and_no_joint_grounds_them():
    """The mass by the volumes of blocks and plates, the sheets are a twentieth of one of them."""
    health = reduction_health(pipeline()("reduction"))
    a = scene("rig-rom", COARSE).rig.assembly
    block = a.block.density * a.block_x * a.block_y * a.block_z
    below = [("support", "xyz"), ("sheets_support", "xyz"), ("plate", "xyz")]
    rest = sum(np.prod([getattr(a, f"{n}_{axis}") for axis in axes]) for n, axes in below)
    assert block + a.density * rest == pytest.approx(health.mass_kg, rel=0.01)
    assert np.abs(health.centre_m[:2]).max() < 1e-9 and -0.2 < health.centre_m[2] < 0
    assert health.grounding < 1e-12
    assert health.fixed_interface_hz[0] == pytest.approx(51, rel=0.1)


@pytest.mark.slow
def test_a_wall_of_too_few_modes_is_told_with_what_to_do():
    """With a cutoff of 60 Hz the block hardly moves within 3 ms; once a number alone said so."""
    summary = summary_of(pipeline("wall.cutoff=60.0", "time.duration=3e-3"))
    assert summary.error_estimate.reduction > 0.1
    assert any("error of the reduction is about" in words for words in summary.warnings)
    assert not any("error of the" in words for words in summary_of(pipeline()).warnings)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (("joints.head.ky=0.0",), "joints.head.ky = 0 leaves free; give it a stiffness"),
        (('assembly.parts=["block"]',), "of the rig: assembly.parts"),
        (("patch.weights=thesis", "patch.radius=1e-5"), "would read the node that it pushes"),
    ],
)
def test_a_reduction_that_fails_names_the_keys_of_the_scene(changes, words):
    with pytest.raises(ValueError, match=words):
        pipeline(*changes)("reduction")


@pytest.mark.slow
def test_a_boundary_too_large_for_memory_is_refused_before_it_is_solved_for(monkeypatch):
    """A contact seed of 10 um under a patch of 2 mm once filled the memory for minutes."""
    monkeypatch.setattr(reductions, "MAX_VALUES", 1e4)
    monkeypatch.setattr("beadwave.rom.craig_bampton", None)
    with pytest.raises(ValueError, match=r"radius = 0.006 m holds 21 nodes .* GB, allowed"):
        pipeline("reduction.modes=41")("reduction")


@pytest.mark.slow
def test_an_error_that_cannot_be_estimated_is_a_warning(monkeypatch):
    """The run is there, its mesh's coarser fellow has no modes to be found."""

    def stuck(*_):
        raise ValueError("the coarse mesh is singular.")

    monkeypatch.setattr("beadwave.workflows.stages.errors.better_walls.of_missed_energy", stuck)
    summary = summary_of(pipeline("output.samples=602"))  # whose mesh error nobody has kept
    assert summary.error_estimate.mesh is None and summary.error_estimate.reduction is not None
    assert any("mesh could not be estimated: the coarse" in words for words in summary.warnings)


@pytest.mark.slow
@pytest.mark.parametrize("source", ["reduction", "missed-energy"])
def test_errors_of_reduction_and_mesh_are_those_up_to_the_horizon(source):
    """Beyond it two runs part whatever the reduction; a run that left there is told no error."""
    held = pipeline("time.duration=1.5e-3", "time.horizon=1e-3", "output.samples=301")
    impact, model = held("impact"), held(source)
    run = impact.trajectory
    parted = np.where(run.t[:, None] > 1e-3 * (1 + 1e-9), 1.0, run.v)
    away = impact._replace(trajectory=run._replace(v=parted))

    def error(of):
        if source == "missed-energy":
            better = better_walls.of_missed_energy(held.scene, model, held("reduction"))
        else:
            better = better_walls.of_reduction(held.scene, model)
        marches = better_walls.marched(held.scene, held("start"), of, better)
        return better_walls.velocity_error(held.scene, held("start"), marches)

    assert 0.0 < error(away) == error(impact) < 0.5


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("reduction.cutoff=1e9", "reduction.cutoff = 1e.09 Hz must be up to"),
        ("reduction.error=1e-12", "reduction.error = 1e-12 must be at least"),
        ("reduction.modes=100000", "reduction.modes = 100000 must be up to"),
        ("reduction.modes=3", "reduction.modes = 3 must be at least 4, the measured modes"),
        ("patch.radius=1.0", "patch.radius = 1.0 m must be below 0.02075 m"),
    ],
)
def test_a_reduction_that_cannot_be_or_would_run_for_hours_is_refused(change, words):
    with pytest.raises(InvalidScene, match=words):
        scene("rig-rom", (change,))


@pytest.mark.slow
def test_the_surface_moves_as_the_full_model_under_the_chain(tmp_path):
    """T_surface K_r^-1 w against T K^-1 w of the written matrices: a static force at the contact,
    which a Craig-Bampton model answers exactly, to the single precision of T_surface."""
    damped = "damping={kind = 'modal', ratio = 0.01}"
    pipeline = pipeline_of(scene("rig-full-tie", (*COARSE, damped)), lambda name: nullcontext())
    write_reduced(pipeline, OutputFile(tmp_path / "rom.mat"), OutputFile(tmp_path / "full.mat"))
    small, full = (
        loadmat(tmp_path / "rom.mat", spmatrix=False),
        loadmat(tmp_path / "full.mat", spmatrix=False),
    )
    w = full["w"].ravel()
    u = full["T_mesh"] @ spsolve(full["K"].tocsc(), w)
    moved = (small["T_surface"] @ np.linalg.solve(small["K"], small["w"])).reshape(-1, 3)
    at = KDTree(full["mesh_points"]).query(small["surface_points"])[1]
    np.testing.assert_allclose(moved, u.reshape(-1, 3)[at], atol=3e-6 * np.abs(u).max())
    assert small["surface_faces"].min() == 1
    assert small["surface_faces"].max() == len(small["surface_points"])
    names = [str(name[0]) for name in small["coordinates"].ravel()]
    assert len(names) == len(small["K"]) and names[0].startswith("u_x at x = 0.06575")
    assert (tmp_path / "rom.mat").stat().st_size < 2e6
    wall = rom.modal(rom.load_mat(tmp_path / "rom.mat"))
    zeta = np.diag(wall.vectors.T @ small["C_damping"] @ wall.vectors) / (2 * wall.omega)
    np.testing.assert_allclose(zeta, 0.01, rtol=1e-6)


@pytest.fixture(scope="module")
def whole():
    """As good as the full model of the coarse rig."""
    rig = scene("rig-rom", COARSE)
    mesh = assembly_stages.mesh(rig)
    model = assembly_stages.model(rig, mesh)
    contact = assembly_stages.contact(rig, mesh, model)
    asked = rom.Selection(n_modes=120, choice="contact", to_hz=20e3)
    found = rom.free_modes(model.K, model.M, contact.w, asked, factorise=fem.factorised)
    return found._replace(T=None, n_residual=1, contact=contact_of(rig, model, contact))


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [
        ("reduction.modes=10",),
        ("reduction.modes=20", "reduction.choice=lowest"),
        ("reduction.modes=10", "reduction.choice=lowest", "reduction.kind=free-modes"),
    ],
)
def test_the_stated_error_of_a_reduction_is_no_less_than_the_true_one(changes, whole):
    """Beside 120 Krylov vectors marched at a fortieth of the step; stated over true is the margin
    of 1.25 but for what the finer model misses."""
    held = pipeline(*changes, "output.samples=303")
    impact, scene = held("impact"), held.scene
    run = impact.trajectory
    exact = dem.march(
        chain(scene), wall_of(scene, whole), initial_velocity(scene),
        duration=scene.time.duration, dt=run.dt / 40, n_save=len(run.t) - 1,
    )  # fmt: skip
    observed = [sphere - 1 for sphere in scene.output.spheres]
    true = np.abs(exact.v - run.v)[:, observed].max() / scene.striker.velocity
    assert true < held("reduction-error") < 1.6 * true


def test_a_mode_that_bears_two_characters_of_the_hammer_test_is_kept_once():
    """As the rigid motions of a block that nothing holds do."""
    omega, phi = np.array([0.0, 1e-3, 2e-3, 5e4]), np.eye(6)[:, :4]
    found = AssemblyModes(omega, phi, np.array([1, 2, 2, 3]), np.ones(4), 6, None, None)
    kept = targets_kept(found)
    np.testing.assert_array_equal(kept[0], omega[1:])
    np.testing.assert_array_equal(kept[1].T @ kept[1], np.eye(3))


@pytest.mark.parametrize("order", [1.5, 2.0, 2.3])
def test_the_stated_error_of_the_mesh_is_one_to_three_times_the_true_one(order):
    """Walls of one mode whose stiffness converges with the order; (2^p - 1) / (2^1.5 - 1) by
    theory, 1.0, 1.6 and 2.1, a percent of it for what is not linear."""
    rig = scene("rig-rom", (*COARSE, "time.error=1e-9"))  # below what the walls differ by

    def wall(h):
        stiffness = np.array([[(2 * np.pi * 900.0) ** 2 * (1 + 1e-3 * h**order)]])
        return rom.ReducedModel(
            stiffness, np.eye(1), None, np.array([1.5]), None, "free-modes", 0, {}
        )

    run = chain_impact(rig, start(rig), wall_of(rig, wall(1.0)))
    exact = dem.march(
        chain(rig), wall_of(rig, wall(0.0)), initial_velocity(rig), duration=rig.time.duration,
        dt=run.trajectory.dt, n_save=rig.output.samples - 1,
    )  # fmt: skip
    observed = [sphere - 1 for sphere in rig.output.spheres]
    true = np.abs(exact.v - run.trajectory.v)[:, observed].max() / rig.striker.velocity
    second = SecondModel(wall(2.0), 1 / (second_mesh.COARSER**second_mesh.ORDER - 1))
    better = better_walls.of_second_mesh(rig, second)
    marches = better_walls.marched(rig, start(rig), run, better)
    stated = better_walls.velocity_error(rig, start(rig), marches)
    assert stated / true == pytest.approx((2**order - 1) / (2**1.5 - 1), rel=0.02)
    assert 0.98 < stated / true < 3
