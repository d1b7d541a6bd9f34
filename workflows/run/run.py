"""A run: the stages a scene needs, and what each leaves in the run folder as it ends."""

from collections.abc import Callable
from contextlib import nullcontext
from datetime import datetime
from platform import python_version
from typing import TYPE_CHECKING

import numpy as np

import dem
from coupling import CoupledWall
from coupling.saved_run import save_trajectory
from workflows.files.run_folder import RunFolder, write_pictures
from workflows.report.provenance import UNKNOWN, Origin
from workflows.report.report import CAPTIONS, write_report
from workflows.report.summary import ErrorEstimate, NumberError, StageTime, Summary
from workflows.run.second_process import IMPACT, RUN, two_processes
from workflows.scene.toml import toml
from workflows.stages import warnings
from workflows.stages.cache import LIBRARIES, library_versions
from workflows.stages.chain import contact_radius
from workflows.stages.impact import require_start
from workflows.stages.pipeline import Pipeline, needs_structure
from workflows.stages.waves import chain_contact, sphere_waves

if TYPE_CHECKING:  # loads the finite elements
    from workflows.stages.quantity_errors import QuantityError

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


def run(
    pipeline: Pipeline,
    folder: RunFolder,
    *,
    origin: Origin = UNKNOWN,
    waves_known: Callable[[Summary], None] = lambda summary: None,
) -> Summary:
    """Fill the run folder with all that the scene gives: waves first, then errors, checks and
    pictures. `waves_known` is called with a summary without errors, unless these are kept."""
    scene, structure = pipeline.scene, needs_structure(pipeline.scene)
    if scene.chain and not pipeline.kept("impact"):
        require_start(scene)
    with folder.run(toml(scene), FILES) as folder:
        _write_given(folder, origin)
        with two_processes(pipeline, RUN) if structure else nullcontext():
            # the chain: the impact, and what its sensors record
            if scene.chain:
                _write_trajectory(pipeline, folder)
                if not (structure and pipeline.kept("mesh-error")):
                    waves_known(summary_of(pipeline, origin=origin, with_errors=False))

            # the assembly: modes, reduced model, response and pictures, each as soon as it is there
            unrendered: tuple[str, ...] = ()
            if structure:
                from fem import mode_field
                from workflows.stages.pictures import NoPicture
                from workflows.stages.response import save_response
                from workflows.stages.walls import save

                with folder.writing("modes.vtu") as path:
                    mode_field.write(path, pipeline("modes").field)
                for name in ("rom.npz", "rom.mat"):
                    with folder.writing(name) as path:
                        save(path, pipeline("reduction"), scene.damping)
                with folder.writing("response.npz") as path:
                    save_response(path, pipeline("response").found)
                write_pictures(folder, (pipeline("response").picture,))
                if scene.measured_hz:
                    pipeline("mac")
                try:
                    write_pictures(folder, pipeline("pictures"))
                except NoPicture as missing:  # the run stands without them
                    unrendered = (str(missing),)

            if structure and scene.bending is None:
                pipeline("missed-energy")  # while its shapes are in memory
            pipeline.release()

            # pictures of the chain
            if scene.chain:
                write_pictures(folder, pipeline("figures"))
                if scene.output.sensors:
                    write_pictures(folder, (pipeline("signals"),))

            # the errors of its models, the waves, the warnings
            summary = summary_of(pipeline, unrendered, origin)
        folder.write("summary.json", summary.text())
        write_report(folder)
    return summary


def impact(
    pipeline: Pipeline,
    folder: RunFolder | None,
    *,
    origin: Origin = UNKNOWN,
    waves_known: Callable[[Summary], None] = lambda summary: None,
) -> Summary:
    """The coupled run alone; the folder, if any, gets scene, trajectory and summary. `waves_known`
    as of `run`."""
    scene = pipeline.scene
    if not pipeline.kept("impact"):
        require_start(scene)
    with folder.run(toml(scene), IMPACT_FILES) if folder else nullcontext() as folder:
        with two_processes(pipeline, IMPACT) if needs_structure(scene) else nullcontext():
            if not (needs_structure(scene) and pipeline.kept("mesh-error")):
                waves_known(summary_of(pipeline, origin=origin, with_errors=False))
            if needs_structure(scene) and scene.bending is None:
                pipeline("missed-energy")  # while its shapes are in memory
            pipeline.release()
            summary = summary_of(pipeline, origin=origin)
        if folder:
            _write_given(folder, origin)
            _write_trajectory(pipeline, folder)
            folder.write("summary.json", summary.text())
    return summary


def _write_given(folder: RunFolder, origin: Origin) -> None:
    """The scene in the user's words, as given.toml; scene.toml beside it has every default. A run
    of that scene.toml keeps the given.toml of the run that wrote it."""
    given, scene = folder.base.path / "given.toml", folder.base.path / "scene.toml"
    words = origin.text.partition("\n")[2]
    of_this_scene = given.is_file() and scene.is_file() and scene.read_text("utf-8") == words
    text = given.read_text("utf-8") if of_this_scene else origin.text
    if text:
        folder.write(given.name, text)


def _write_trajectory(pipeline: Pipeline, folder: RunFolder) -> None:
    """The impact's arrays, and what sensors record of them."""
    trajectory = pipeline("impact").trajectory
    with folder.writing("trajectory.npz") as path:
        save_trajectory(path, trajectory, pipeline("wall"))
    if pipeline.scene.output.sensors:
        from workflows.stages.signals import csv_text  # scipy's filters, a second

        folder.write("signals.csv", csv_text(pipeline.scene, pipeline("record")))


def _error_of(error: "QuantityError") -> NumberError:
    """A number's errors as the summary has them."""
    known = error.by_cause
    return NumberError(
        name=error.name, value=error.value, unit=error.unit, total=sum(known.values()), **known
    )


def summary_of(
    pipeline: Pipeline,
    warned: tuple[str, ...] = (),
    origin: Origin = UNKNOWN,
    *,
    with_errors: bool = True,
) -> Summary:
    """The numbers of a run, without errors of reduction and mesh where these are not wanted; a
    stage that the run did not need is left at its absence."""
    scene, structure, numbers = pipeline.scene, needs_structure(pipeline.scene), {}
    number_errors: list[NumberError] = []
    sentences = [*warned, *(() if pipeline.keeps else warnings.results_not_kept())]

    if scene.chain:
        # errors: of the time step, and by a second model each of reduction and mesh
        errors = {"time": pipeline("impact").trajectory.error_estimate}
        doubts: list[str] = []
        estimated = with_errors and structure and not isinstance(pipeline("wall"), CoupledWall)
        models = ("reduction", "mesh", *(("theory",) if scene.bending else ()))
        for name in models if estimated else ():
            try:
                errors[name] = pipeline(f"{name}-error")
                doubts += warnings.large_model_error(name, errors[name])
            except ValueError as reason:  # the run stands without it
                doubts += warnings.unknown_model_error(name, reason)

        if estimated:
            try:
                quantities = pipeline("quantity-errors")
                if scene.bending is None:
                    quantities = quantities.quantities
                number_errors += map(_error_of, quantities)
            except ValueError:  # said above
                pass

        # the march and its waves
        wall, waves, (run, verdict, *_) = pipeline("wall"), pipeline("waves"), pipeline("impact")
        start = pipeline("start")
        numbers |= {
            "n_wall_modes": 0 if wall is None else len(wall.omega),
            "dt_s": run.dt,
            "n_steps": run.n_steps,
            "energy_error": run.energy_error,
            "error_estimate": ErrorEstimate(**errors),
            "verdict": (*verdict.sentences, *dem.yielding(start.chain, run)),
            "waves": {str(s): sphere_waves(waves, run.t, run.v[:, s - 1], s) for s in waves.labels},
            "wall_contact": chain_contact(scene, waves),
        }
        if scene.output.sensors:
            from workflows.stages.signals import sensor_waves

            numbers["sensors"] = sensor_waves(scene, pipeline("record"))

        # the contact at the wall
        if wall is not None:
            if getattr(scene.wall, "prune", False):
                numbers["wall_modes_left_out"] = pipeline("pruning").sentences
            peak = float(run.contact_force[:, -1].max())
            radius = start.ellipse.size * contact_radius(scene, start, peak)
            numbers |= {"peak_wall_force_N": peak, "contact_radius_m": radius}
        chain_warnings = warnings.of_chain(scene, start, pipeline("impact"), waves)
        sentences += [*doubts, *chain_warnings]

    # the assembly, or a wall from a file
    if structure:
        from workflows.stages.health import modes_found, reduction_health

        modes, health = pipeline("modes"), reduction_health(pipeline("reduction"))
        if with_errors and scene.bending is not None:
            number_errors += map(_error_of, pipeline("structure-errors"))
        elif with_errors:
            missed, hz = pipeline("missed-energy"), modes.omega / (2 * np.pi)
            for i, relative in enumerate(missed.of_frequencies(modes.omega)):
                if np.isfinite(relative):
                    error = float(relative * hz[i])
                    number_errors.append(
                        NumberError(
                            name=f"mode {i + 1}", value=hz[i], unit="Hz", mesh=error, total=error
                        )
                    )
            if missed.of_compliance is not None:
                value = health.static_compliance_m_per_N - health.half_space_compliance_m_per_N
                number_errors.append(
                    NumberError(
                        name="static_compliance_m_per_N",
                        value=value,
                        unit="m/N",
                        mesh=missed.of_compliance,
                        total=missed.of_compliance,
                    )
                )
        numbers |= {
            "modes_hz": modes.paired_hz,
            "modes": modes_found(pipeline),
            "dofs": modes.n_dofs,
            "load_factor": modes.load_factor,
            "reduction": health,
        }
        sentences += warnings.of_structure(modes, health)
    elif getattr(scene.wall, "file", None):
        from workflows.files.wall_file import measured
        from workflows.stages.health import reduction_health

        numbers["reduction"] = reduction_health(*measured(scene.wall))

    return Summary(
        errors=tuple(number_errors),
        scene=scene.name,
        command=origin.command,
        date=datetime.now().astimezone().isoformat(timespec="seconds"),
        sources=origin.sources,
        seconds=pipeline.elapsed,
        stages=tuple(StageTime(**report._asdict()) for report in pipeline.reports),
        warnings=tuple(sentences),
        versions={"python": python_version(), **library_versions(("beadwave", *LIBRARIES))},
        **numbers,
    )
