"""A run: the stages a scene needs, and what each leaves in the run folder as it ends."""

from collections.abc import Callable
from contextlib import nullcontext, suppress
from datetime import datetime
from math import isnan
from platform import python_version

from beadwave.workflows.files.run_folder import NoPicture, RunFolder, write_pictures
from beadwave.workflows.report.provenance import UNKNOWN, Origin
from beadwave.workflows.report.report import CAPTIONS, write_report
from beadwave.workflows.report.summary import ErrorEstimate, NumberError, StageTime, Summary
from beadwave.workflows.report.summary_rows import spelled
from beadwave.workflows.run.second_process import IMPACT, RUN, two_processes
from beadwave.workflows.scene import MeasuredWall, Scene
from beadwave.workflows.scene.places import has_friction
from beadwave.workflows.scene.toml import toml
from beadwave.workflows.stages import warnings
from beadwave.workflows.stages.engine.cache import LIBRARIES, library_versions
from beadwave.workflows.stages.engine.pipeline import Pipeline
from beadwave.workflows.stages.engine.stage_table import (
    has_sizes_chosen,
    in_contact,
    needs_structure,
    slips,
)

IMPACT_FILES = ("given.toml", "summary.json", "trajectory.npz", "signals.csv", "arrivals.csv")
FILES = (
    *IMPACT_FILES,
    "report.html",
    "rom.npz",
    "rom.mat",
    "response.npz",
    "modes.vtu",
    "sizes.npz",
    "missed.npz",
    "contact.npz",
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
    _require_start(pipeline)
    with folder.run(toml(scene), FILES) as folder:
        _write_given(folder, origin)
        with two_processes(pipeline, RUN) if structure else nullcontext():
            if structure:
                _begin_mesh_error(pipeline)

            # the chain: the impact, and what its sensors record
            if scene.chain:
                _write_files(pipeline, folder, "chain-files")
                if structure and not pipeline.kept("mesh-error"):
                    waves_known(summary_of(pipeline, origin=origin, with_errors=False))

            # the assembly: modes and reduced model, then all that needs its factor and its shapes
            if structure:
                _write_files(pipeline, folder, "mode-files", "model-files")
                if has_sizes_chosen(scene):
                    _write_files(pipeline, folder, "size-files")
                pipeline("full-response")
                if scene.measured_hz:
                    pipeline("mac")
                if scene.bending is None:
                    pipeline("structure-errors")
                    _write_files(pipeline, folder, "missed-files")
                if in_contact(scene):
                    _write_files(pipeline, folder, "contact-files")
            if scene.crystal:
                _write_files(pipeline, folder, "crystal-files")
            if scene.chains:
                _write_files(pipeline, folder, "chains-files")
            pipeline.release()
            summary_of(pipeline, origin=origin)  # the errors, before the pictures are waited for

            # pictures, most of them by the second process
            unrendered: tuple[str, ...] = ()
            if structure:
                _write_files(pipeline, folder, "response-files")
                try:
                    write_pictures(folder, pipeline("pictures"))
                except NoPicture as missing:  # the run stands without them
                    unrendered = (str(missing),)
            if scene.chain:
                write_pictures(folder, pipeline("figures"))
            if scene.crystal:
                write_pictures(folder, pipeline("crystal-figures"))
            if scene.chains:
                write_pictures(folder, pipeline("chains-figures"))
            if scene.output and scene.output.sensors:
                write_pictures(folder, (pipeline("signals"),))

            # once more, with pictures that are missing
            summary = summary_of(pipeline, unrendered, origin)
        folder.write("summary.json", summary.text())
        write_report(folder, pipeline("page"))
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
    _require_start(pipeline)
    with folder.run(toml(scene), IMPACT_FILES) if folder else nullcontext() as folder:
        with two_processes(pipeline, IMPACT) if needs_structure(scene) else nullcontext():
            if needs_structure(scene):
                _begin_mesh_error(pipeline)
            if needs_structure(scene) and not pipeline.kept("mesh-error"):
                waves_known(summary_of(pipeline, origin=origin, with_errors=False))
            if needs_structure(scene) and scene.bending is None:
                pipeline("structure-errors")  # while its shapes are in memory
            pipeline.release()
            summary = summary_of(pipeline, origin=origin)
        if folder:
            _write_given(folder, origin)
            _write_files(pipeline, folder, f"{spheres(scene)}-files")
            folder.write("summary.json", summary.text())
    return summary


def spheres(scene: Scene) -> str:
    """Name of the spheres in the names of stages: "chain", "chains" or "crystal"."""
    return "crystal" if scene.crystal else "chains" if scene.chains else "chain"


def _begin_mesh_error(pipeline: Pipeline) -> None:
    """Compute what a second process needs to estimate the mesh's error, which it does while this
    one reduces the assembly."""
    if pipeline.scene.bending is None and not pipeline.kept("missed-energy"):
        pipeline("static-shape")


def _require_start(pipeline: Pipeline) -> None:
    """Raise InvalidScene for a chain or a crystal that cannot be marched, unless it has been."""
    if pipeline.scene.crystal and not pipeline.kept("crystal-march"):
        from beadwave.workflows.stages.crystal.march import require_crystal

        require_crystal(pipeline.scene)
    if pipeline.scene.chain and not pipeline.kept("impact"):
        from beadwave.workflows.stages.chain.impact import (
            require_start,  # kept results load no march
        )

        require_start(pipeline.scene)


def _write_given(folder: RunFolder, origin: Origin) -> None:
    """The scene in the user's words, as given.toml; scene.toml next to it has every default. A run
    of that scene.toml keeps the given.toml of the run that wrote it."""
    in_words, scene = folder.base.path / "given.toml", folder.base.path / "scene.toml"
    words = origin.text.partition("\n")[2]
    of_this_scene = in_words.is_file() and scene.is_file() and scene.read_text("utf-8") == words
    text = in_words.read_text("utf-8") if of_this_scene else origin.text
    if text:
        folder.write(in_words.name, text)


def _write_files(pipeline: Pipeline, folder: RunFolder, *stages: str) -> None:
    """The files that these stages make."""
    for stage in stages:
        for name, content in pipeline(stage).items():
            folder.write(name, content)


def summary_of(
    pipeline: Pipeline,
    warned: tuple[str, ...] = (),
    origin: Origin = UNKNOWN,
    *,
    with_errors: bool = True,
) -> Summary:
    """The numbers of a run, without errors of reduction and mesh where these are not wanted; a
    stage that the run did not need is left at its absence.

    Errors that cannot be estimated are warnings, not failures: the run stands without them.
    """
    scene, structure, numbers = pipeline.scene, needs_structure(pipeline.scene), {}
    number_errors: list[NumberError] = []
    sentences = [*warned, *(() if pipeline.keeps else warnings.results_not_kept())]

    if scene.chain:
        # errors: of the time step, and by a second model each of reduction and mesh
        chain = pipeline("chain-numbers")
        errors = {"time": chain.time_error}
        estimated = with_errors and structure and not chain.coupled and not scene.friction
        models = ("reduction", "mesh", *(("theory",) if scene.bending else ()))
        for name in models if estimated else ():
            try:
                errors[name] = pipeline(f"{name}-error")
                sentences += warnings.large_model_error(name, errors[name])
            except ValueError as reason:  # the run stands without it
                sentences += warnings.unknown_model_error(name, reason)

        # errors of single numbers, and why there are none: friction and coupled modes have no
        # second model, a simple wall has the error of its time step alone
        if estimated:
            with suppress(ValueError):  # said above
                number_errors += pipeline("quantity-errors")
        if structure and scene.friction:
            sentences += warnings.model_errors_left_out()
        elif structure and with_errors and chain.coupled:
            sentences += warnings.model_errors_of_coupled_modes()
        if not structure and not has_friction(scene):
            number_errors += pipeline("quantity-errors")

        # measured responses, of the wall or of a part: the error of their fits, and their band
        of_wall = isinstance(scene.wall, MeasuredWall)
        if with_errors and (of_wall or (structure and scene.measured and not scene.friction)):
            errors["receptance"] = pipeline("receptance-error")
            sentences += warnings.large_model_error("receptance", errors["receptance"])
        if with_errors and of_wall:
            sentences += warnings.narrow_band(scene, pipeline("impact").trajectory)

        # the march and its waves
        numbers |= chain.numbers | {"error_estimate": ErrorEstimate(**errors)}
        if slips(scene):
            from beadwave.workflows.stages.structure.amplitudes import mode_numbers

            numbers["amplitudes"], of_amplitudes = mode_numbers(pipeline("amplitudes"))
            sentences += of_amplitudes
        if scene.output.sensors:
            numbers["sensors"] = pipeline("sensor-numbers")
        sentences += chain.warnings

    # spheres in space
    if scene.crystal:
        crystal, errors = pipeline("crystal-numbers"), {}
        if structure and with_errors:
            errors["reduction"] = pipeline("crystal-error")
            sentences += warnings.large_model_error("reduction", errors["reduction"])
        errors["time"] = crystal.time_error
        numbers |= crystal.numbers | {"error_estimate": ErrorEstimate(**errors)}
        sentences += crystal.warnings

    # several chains: the error of the reduction holds for all contacts together
    if scene.chains:
        chains = pipeline("chains-numbers")
        errors, each = {"time": chains.time_error}, chains.numbers["chains"]
        if with_errors:
            of_chains: list[dict[str, float | None]] = [dict(errors) for _ in each]
            for cause, stage in (("reduction", "chains-errors"), ("mesh", "chains-mesh-errors")):
                try:
                    found = pipeline(stage)
                except ValueError as reason:  # no other mesh tells the error of this one
                    sentences += warnings.unknown_model_error(cause, reason)
                    continue
                errors[cause] = found.largest
                sentences += warnings.large_model_error(cause, found.largest)
                for of_chain, error in zip(of_chains, found.of_chains, strict=True):
                    of_chain[cause] = error
            each = {
                name: numbers.model_copy(update={"errors": ErrorEstimate(**of_chain)})
                for (name, numbers), of_chain in zip(each.items(), of_chains, strict=True)
            }
        numbers |= chains.numbers | {"chains": each, "error_estimate": ErrorEstimate(**errors)}
        if scene.output.sensors:
            numbers["sensors"] = pipeline("sensor-numbers")
        sentences += chains.warnings

    # the assembly, or a wall from a file
    if structure:
        of_structure = pipeline("structure-numbers")
        if with_errors:
            number_errors += pipeline("structure-errors")
            if has_sizes_chosen(scene):
                numbers["mesh"] = pipeline("mesh-numbers")
                sentences += warnings.mesh_above_asked(numbers["mesh"])
        numbers |= of_structure.numbers
        sentences += of_structure.warnings
        sentences += warnings.overloaded_bolts(scene.utilisations)
        if in_contact(scene):
            numbers["contact"] = tuple(pipeline("contact-numbers"))
        if scene.measured:
            from beadwave.workflows.files.part_receptances import receptances

            parts = {table.name: receptances(table) for table in scene.measured}
            numbers["synthetic"] = tuple(name for name, part in parts.items() if part.synthetic)

        # MAC of the modes that are targets, where it is there without computing it
        if any(mode.target for mode in numbers["modes"]) and pipeline.kept("mac"):
            mac = pipeline("mac")
            column = {n: j for j, n in enumerate(scene.measured_numbers)}
            numbers["modes"] = tuple(
                mode.model_copy(update={"mac": float(mac[mode.number - 1, column[mode.target]])})
                if mode.target and not isnan(mac[mode.number - 1, column[mode.target]])
                else mode
                for mode in numbers["modes"]
            )
    elif getattr(scene.wall, "file", None):
        from beadwave.workflows.files.wall_file import measured
        from beadwave.workflows.stages.structure.health import reduction_health

        numbers["reduction"] = reduction_health(*measured(scene.wall))

    # of numbers whose mesh error is explained the worst one is told, the others are counted
    explained = [error for error in number_errors if error.why]
    if explained:
        worst = max(explained, key=lambda error: error.relative or 0.0)
        name, others = spelled(worst.name), len(explained) - 1
        further_causes = f" Causes of {others} smaller errors are under `errors` in summary.json."
        sentences.append(
            f"{name[0].upper()}{name[1:]}: {worst.why}{further_causes if others else ''}"
        )
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
