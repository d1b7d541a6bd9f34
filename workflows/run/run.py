"""A run: the stages a scene needs, and what each leaves in the run folder as it ends."""

from collections.abc import Iterator
from contextlib import nullcontext
from datetime import datetime
from platform import python_version

import dem
from coupling import CoupledWall
from coupling.saved_run import save_trajectory
from workflows.files.run_folder import RunFolder, write_pictures
from workflows.report.provenance import UNKNOWN, Origin
from workflows.report.report import CAPTIONS, write_report
from workflows.report.summary import ErrorEstimate, StageTime, Summary
from workflows.run.second_process import IMPACT, RUN, two_processes
from workflows.scene.toml import toml
from workflows.stages import warnings
from workflows.stages.chain import contact_radius
from workflows.stages.impact import require_start
from workflows.stages.pipeline import (
    LIBRARIES,
    Pipeline,
    library_versions,
    needs_structure,
)
from workflows.stages.waves import chain_contact, sphere_waves

IMPACT_FILES = ("given.toml", "summary.json", "trajectory.npz", "signals.csv")
FILES = (
    *IMPACT_FILES,
    "report.html",
    "rom.npz",
    "rom.mat",
    "response.npz",
    "modes.vtu",
    *(f"figures/{name}.png" for name in CAPTIONS),
)


def run(pipeline: Pipeline, folder: RunFolder, *, origin: Origin = UNKNOWN) -> Summary:
    """Fill the run folder with all that the scene gives."""
    scene = pipeline.scene
    if scene.chain and not pipeline.kept("impact"):
        require_start(scene)
    with folder.run(toml(scene), FILES) as folder:
        _write_given(folder, origin)
        with two_processes(pipeline, RUN) if needs_structure(scene) else nullcontext():
            unrendered = _write_assembly(pipeline, folder) if needs_structure(scene) else ()
            if scene.chain:
                _write_trajectory(pipeline, folder)
                write_pictures(folder, pipeline("figures"))
                if scene.output.sensors:
                    write_pictures(folder, (pipeline("signals"),))
            summary = summary_of(pipeline, unrendered, origin)
        folder.write("summary.json", summary.text())
        write_report(folder)
    return summary


def impact(pipeline: Pipeline, folder: RunFolder | None, *, origin: Origin = UNKNOWN) -> Summary:
    """The coupled run alone; the folder, if any, gets scene, trajectory and summary."""
    scene = pipeline.scene
    if not pipeline.kept("impact"):
        require_start(scene)
    with folder.run(toml(scene), IMPACT_FILES) if folder else nullcontext() as folder:
        with two_processes(pipeline, IMPACT) if needs_structure(scene) else nullcontext():
            summary = summary_of(pipeline, origin=origin)
        if folder:
            _write_given(folder, origin)
            _write_trajectory(pipeline, folder)
            folder.write("summary.json", summary.text())
    return summary


def _write_given(folder: RunFolder, origin: Origin) -> None:
    """The scene in the user's words; scene.toml is what they amount to, and a run of it keeps
    them."""
    given, scene = folder.base.path / "given.toml", folder.base.path / "scene.toml"
    words = origin.text.partition("\n")[2]
    kept = given.is_file() and scene.is_file() and scene.read_text("utf-8") == words
    text = given.read_text("utf-8") if kept else origin.text
    if text:
        folder.write(given.name, text)


def _write_assembly(pipeline: Pipeline, folder: RunFolder) -> tuple[str, ...]:
    """Modes, reduced model and pictures, each as soon as it is there; a warning without them."""
    from fem import mode_field
    from workflows.stages.pictures import NoPicture
    from workflows.stages.response import save_response
    from workflows.stages.wall import save

    with folder.writing("modes.vtu") as path:
        mode_field.write(path, pipeline("modes").field)
    for name in ("rom.npz", "rom.mat"):
        with folder.writing(name) as path:
            save(path, pipeline("reduction"), pipeline.scene.damping)
    with folder.writing("response.npz") as path:
        save_response(path, pipeline("response").found)
    write_pictures(folder, (pipeline("response").picture,))
    if pipeline.scene.measured_hz:
        pipeline("mac")
    try:
        write_pictures(folder, pipeline("pictures"))
    except NoPicture as missing:
        return (str(missing),)
    return ()


def _write_trajectory(pipeline: Pipeline, folder: RunFolder) -> None:
    trajectory = pipeline("impact").trajectory
    with folder.writing("trajectory.npz") as path:
        save_trajectory(path, trajectory, pipeline("wall"))
    if pipeline.scene.output.sensors:
        from workflows.stages.signals import csv_text  # scipy's filters, a second

        folder.write("signals.csv", csv_text(pipeline.scene, pipeline("record")))


def summary_of(pipeline: Pipeline, told: tuple[str, ...] = (), origin: Origin = UNKNOWN) -> Summary:
    """The numbers of a run; a stage that the run did not need is left at its absence."""
    scene, found = pipeline.scene, {}
    told = [*told, *(() if pipeline.keeps else warnings.results_not_kept())]
    if scene.chain:
        errors, doubts = _errors(pipeline)
        found |= _chain_numbers(pipeline) | {"error_estimate": errors}
        needed = [pipeline(name) for name in ("start", "impact", "waves")]
        told += [*doubts, *warnings.of_chain(scene, *needed)]
    found |= _model_numbers(pipeline)
    if needs_structure(scene):
        told += found["reduction"].findings
        told += warnings.overconstrained(pipeline("modes").overconstrained)
    return Summary(
        scene=scene.name,
        command=origin.command,
        date=datetime.now().astimezone().isoformat(timespec="seconds"),
        sources=origin.sources,
        seconds=pipeline.elapsed,
        stages=tuple(StageTime(**report._asdict()) for report in pipeline.reports),
        warnings=tuple(told),
        versions={"python": python_version(), **library_versions(("beadwave", *LIBRARIES))},
        **found,
    )


def _chain_numbers(pipeline: Pipeline) -> dict:
    scene, wall, found = pipeline.scene, pipeline("wall"), pipeline("waves")
    run, verdict, *_ = pipeline("impact")
    begun = pipeline("start")
    numbers = {
        "n_wall_modes": 0 if wall is None else len(wall.omega),
        "dt_s": run.dt,
        "n_steps": run.n_steps,
        "energy_error": run.energy_error,
        "verdict": (*verdict.sentences, *dem.yielding(begun.chain, run)),
        "waves": {str(s): sphere_waves(found, run.t, run.v[:, s - 1], s) for s in found.labels},
        "wall_contact": chain_contact(scene, found),
    }
    if scene.output.sensors:
        from workflows.stages.signals import sensor_waves

        numbers["sensors"] = sensor_waves(scene, pipeline("record"))
    if wall is None:
        return numbers
    if getattr(scene.wall, "prune", False):
        numbers["wall_modes_left_out"] = pipeline("pruning").sentences
    peak = float(run.contact_force[:, -1].max())
    radius = begun.ellipse.size * contact_radius(scene, begun, peak)
    return numbers | {"peak_wall_force_N": peak, "contact_radius_m": radius}


def _errors(pipeline: Pipeline) -> tuple[ErrorEstimate, list[str]]:
    """The estimates, and warnings of those that are large or that could not be made."""
    found, told = {"time": pipeline("impact").trajectory.error_estimate}, []
    for name in _estimated(pipeline):
        try:
            found[name] = pipeline(f"{name}-error")
            told += warnings.large_model_error(name, found[name])
        except ValueError as reason:  # the run stands without it
            told.append(f"The error of the {name} could not be estimated: {reason}")
    return ErrorEstimate(**found), told


def _estimated(pipeline: Pipeline) -> Iterator[str]:
    """Models whose error a second one tells."""
    if needs_structure(pipeline.scene) and not isinstance(pipeline("wall"), CoupledWall):
        yield from ("reduction", "mesh")


def _model_numbers(pipeline: Pipeline) -> dict:
    """The assembly's part of the summary, or that of a wall from a file."""
    scene = pipeline.scene
    if needs_structure(scene):
        from workflows.stages.health import modes_found, reduction_health

        modes, health = pipeline("modes"), reduction_health(pipeline("reduction"))
        return {
            "modes_hz": modes.paired_hz,
            "modes": modes_found(pipeline),
            "dofs": modes.n_dofs,
            "load_factor": modes.load_factor,
            "reduction": health,
        }
    if getattr(scene.wall, "file", None):
        from workflows.files.wall import measured
        from workflows.stages.health import reduction_health

        return {"reduction": reduction_health(*measured(scene.wall))}
    return {}
