"""Two processes compute what one does, and a run needs none but its own."""

from contextlib import nullcontext
from subprocess import DEVNULL, Popen

import numpy as np
import pytest

from beadwave.workflows.files.run_folder import RunFolder
from beadwave.workflows.files.scene import scene
from beadwave.workflows.run import second_process
from beadwave.workflows.run.run import impact
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.stages.engine.pipeline import pipeline_of

COARSE = (
    "mesh.seed=0.02", "mesh.block_seed=0.05", "mesh.support_seed=0.1",
    "mesh.contact_seed=0.012", "patch.radius=0.006",
    'assembly.parts=["block","sheets"]', "reduction.modes=8", "time.duration=3e-4",
    "output.samples=301", "chain.count=5", "output.spheres=[1, 4]",
)  # fmt: skip


BEAM = ("mesh.scale=3", "reduction.modes=8", "time.duration=3e-4", "output.samples=301",
        "chain.count=5", "output.spheres=[1, 4]")  # fmt: skip


@pytest.fixture(params=["rig", "bodies"])
def assembly(request):
    return scene("rig-rom", COARSE) if request.param == "rig" else scene("cantilever", BEAM)


@pytest.fixture
def rig():
    return scene("rig-rom", COARSE)


@pytest.fixture
def two(monkeypatch, tmp_path):
    """A machine of two cores and much memory, no result kept."""
    monkeypatch.setattr("beadwave.workflows.scene.rules.size.free_memory", lambda: 1e12)
    monkeypatch.setenv("BEADWAVE_PROCESSES", "2")
    monkeypatch.setenv("BEADWAVE_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setenv("MKL_NUM_THREADS", "1")
    monkeypatch.setattr(second_process, "free_cores", lambda: 2)


def ran(rig, folder):
    """Trajectory and the stages of a run, by name."""
    summary = impact(pipeline_of(rig, lambda name: nullcontext()), RunFolder(folder))
    with np.load(folder / "trajectory.npz") as held:
        return dict(held), {stage.name: stage for stage in summary.stages}


def alone(rig, folder, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setenv("BEADWAVE_PROCESSES", "1")
        patch.setenv("BEADWAVE_CACHE_DIR", str(folder / "own-cache"))
        return ran(rig, folder)


@pytest.mark.slow
def test_two_processes_give_the_numbers_of_one_bit_for_bit(assembly, two, tmp_path, monkeypatch):
    begun = []

    def noted(*arguments):
        begun.append(arguments)
        return open_one(*arguments)

    open_one = second_process.while_open
    monkeypatch.setattr(second_process, "while_open", noted)
    found, stages = ran(assembly, tmp_path / "two")
    single, of_one = alone(assembly, tmp_path / "one", monkeypatch)
    assert len(begun) == 1
    assert stages.keys() == of_one.keys() >= {"compilation", "impact"}
    assert not any(stage.cached for stage in stages.values())
    for name, values in single.items():
        np.testing.assert_array_equal(found[name], values)


def test_what_another_process_does_not_finish_is_computed_by_the_run(rig, two, tmp_path):
    dead = Popen(["false"], stdout=DEVNULL)
    dead.wait()
    (tmp_path / "work").mkdir()
    (tmp_path / "work" / "second-mesh").touch()  # begun by it, never ended
    pipeline = pipeline_of(rig, lambda name: nullcontext())
    pipeline.worker = second_process.SecondProcess(tmp_path / "work", dead, second_process.IMPACT)
    assert pipeline("second-mesh").reduced.w.size
    report = pipeline.reports[-1]  # after that of the mesh
    assert report.name == "second-mesh" and not report.cached


def test_a_stage_is_computed_by_one_process_only(tmp_path):
    assert [second_process.claim(tmp_path, "modes") for _ in range(3)] == [True, False, False]


def test_what_needs_the_stage_that_is_waited_for_is_not_computed_meanwhile(tmp_path):
    nobody = second_process.SecondProcess(tmp_path, None, ("figures", "pictures"))
    assert nobody.claim_ready(lambda name: name == "pictures") == "pictures"
    assert nobody.claim_ready(lambda name: False) is None and nobody.has("figures")


@pytest.mark.parametrize("number", ["0", "x", "-1"])
def test_a_number_of_processes_other_than_one_or_two_is_refused(rig, two, monkeypatch, number):
    monkeypatch.setenv("BEADWAVE_PROCESSES", number)
    pipeline = pipeline_of(rig, lambda name: nullcontext())
    with (
        pytest.raises(InvalidScene, match=f"BEADWAVE_PROCESSES = '{number}' must be 1 or 2"),
        second_process.two_processes(pipeline, second_process.RUN),
    ):
        pass


def test_a_second_process_waits_for_what_its_stage_needs(rig, two):
    pipeline = pipeline_of(rig, lambda name: nullcontext())
    assert all(map(pipeline.ready, ("second-mesh", "compilation")))
    assert not pipeline.ready("pictures") and not pipeline.ready("response")
    pipeline("modes")
    assert not pipeline.ready("pictures")
    pipeline("contact")
    assert not pipeline.ready("pictures")
    pipeline("missed-energy")
    assert pipeline.ready("pictures") and not pipeline.ready("response")


def test_a_second_process_prepares_mesh_and_model_before_it_claims_what_needs_them(rig, two):
    run, other = (pipeline_of(rig, lambda name: nullcontext()) for _ in range(2))
    stages = ("half-space", "missed-energy")
    assert not any(map(other.at_hand, stages))
    assert other.prepare(stages) and not other.at_hand("half-space")  # the mesh
    assert other.prepare(stages) and other.at_hand("half-space")  # the model
    other("half-space")
    assert not other.prepare(stages)  # modes and static shape are the run's to compute
    run("static-shape")
    assert other.at_hand("missed-energy")
    np.testing.assert_allclose(
        other("missed-energy").energy, run("missed-energy").energy, rtol=0, atol=0
    )


@pytest.mark.parametrize("lack", ["a core", "memory", "a cache", "the user's leave", "a chain"])
def test_a_run_is_one_process_where_two_lack_something(lack, rig, two, monkeypatch):
    match lack:
        case "a core":
            monkeypatch.setattr(second_process, "free_cores", lambda: 1)
        case "memory":
            monkeypatch.setattr("beadwave.workflows.scene.rules.size.free_memory", lambda: 0.0)
        case "a cache":
            monkeypatch.setenv("BEADWAVE_CACHE_DIR", "/dev/null/cache")
        case "the user's leave":
            monkeypatch.setenv("BEADWAVE_PROCESSES", "1")
        case "a chain":
            rig = rig.model_copy(update={"chain": None})
    pipeline = pipeline_of(rig, lambda name: nullcontext())
    with second_process.two_processes(pipeline, second_process.IMPACT):
        assert pipeline.worker is None
