"""A run: the stages a scene needs, and what each leaves in the run folder as it ends."""

from pathlib import Path
from platform import python_version

from coupling import CoupledWall, Impact
from workflows.chain_stages import (
    contact_radius,
    require_start,
    save_trajectory,
    spoilt,
    yielded,
)
from workflows.chain_waves import chain_contact, doubtful, sphere_waves
from workflows.report import write_report
from workflows.run_folder import RunFolder, write_pictures
from workflows.scene import Scene
from workflows.scene_file import toml
from workflows.stages import (
    LIBRARIES,
    Pipeline,
    Watch,
    library_versions,
    needs_assembly,
    pipeline_of,
    unkept,
)
from workflows.summary import ErrorEstimate, SphereWaves, StageTime, Summary

LARGE = 0.1  # error of the velocities, over the striker's
CURES = {
    "reduction": "keep more modes (reduction.modes, reduction.to_hz, wall.cutoff)",
    "mesh": "take smaller elements (mesh.seed, mesh.block_seed, mesh.support_seed)",
}


def run(scene: Scene, out: Path, *, source: Path | None, watch: Watch) -> Summary:
    """Fill the run folder with all that the scene gives."""
    if scene.chain:
        require_start(scene)
    folder = RunFolder(out)
    folder.begin(toml(scene), source)
    pipeline = pipeline_of(scene, watch)
    warnings: tuple[str, ...] = ()
    if needs_assembly(scene):
        from workflows.assembly_report import write_assembly

        warnings = write_assembly(pipeline, folder)
    if scene.chain:
        _write_trajectory(pipeline, folder)
        write_pictures(folder, pipeline("figures"))
    summary = summary_of(pipeline, warnings)
    folder.write("summary.json", summary.text())
    write_report(folder.path)
    return summary


def impact(scene: Scene, out: Path | None, *, source: Path | None, watch: Watch) -> Summary:
    """The coupled run alone; the folder, if any, gets scene, trajectory and summary."""
    require_start(scene)
    folder = RunFolder(out) if out else None
    if folder:
        folder.begin(toml(scene), source)
    pipeline = pipeline_of(scene, watch)
    pipeline("impact")
    summary = summary_of(pipeline)
    if folder:
        _write_trajectory(pipeline, folder)
        folder.write("summary.json", summary.text())
    return summary


def _write_trajectory(pipeline: Pipeline, folder: RunFolder) -> None:
    trajectory = pipeline("impact").trajectory
    with folder.writing("trajectory.npz") as path:
        save_trajectory(path, trajectory)


def summary_of(pipeline: Pipeline, warnings: tuple[str, ...] = ()) -> Summary:
    """The numbers of a run; a stage that the run did not need is left at its absence."""
    scene = pipeline.scene
    found: dict = {}
    warnings = (*warnings, *unkept(pipeline))
    if scene.chain:
        found |= _chain_numbers(pipeline)
        warnings = (
            *warnings,
            *found.pop("of_errors"),
            *_judged(pipeline("impact")),
            *spoilt(scene, pipeline("impact")),
            *doubtful(scene, pipeline("waves"), pipeline("impact")),
        )
    if needs_assembly(scene):
        from workflows.assembly_report import assembly_numbers

        found |= assembly_numbers(pipeline)
        warnings = (*warnings, *found["reduction"].findings)
    elif getattr(scene.wall, "file", None):
        from workflows.reduction_health import reduction_health
        from workflows.wall_file import loaded

        found["reduction"] = reduction_health(loaded(scene.wall))
    return Summary(
        scene=scene.name,
        stages=tuple(StageTime(**report._asdict()) for report in pipeline.reports),
        warnings=warnings,
        versions={"python": python_version(), **library_versions(("beadwave", *LIBRARIES))},
        **found,
    )


def _judged(impact: Impact) -> tuple[str, ...]:
    """What spoils the run, and the energy it made where the wall is not passive."""
    judged, gain = impact.verdict, impact.energy_gain
    if judged.passive:
        return judged.findings
    made = (
        f"This wall does not keep energy: the largest gain is {gain.largest:.3g} of the striker's "
        f"at {gain.time * 1e3:.3g} ms, at the end it is {gain.final:+.3g}."
    )
    return (*judged.findings, made)


def _chain_numbers(pipeline: Pipeline) -> dict:
    scene, trajectory, wall = pipeline.scene, pipeline("impact").trajectory, pipeline("wall")
    errors, of_errors = _errors(pipeline, trajectory.error_estimate)
    numbers = {
        "n_wall_modes": 0 if wall is None else len(wall.omega),
        "dt_s": trajectory.dt,
        "n_steps": trajectory.n_steps,
        "energy_error": trajectory.energy_error,
        "error_estimate": errors,
        "of_errors": of_errors,
        "verdict": (*pipeline("impact").verdict.sentences, *yielded(scene, trajectory)),
        "waves": {str(sphere): _waves(pipeline, sphere) for sphere in scene.output.spheres},
        "wall_contact": chain_contact(scene, pipeline("waves")),
    }
    if wall is None:
        return numbers
    if getattr(scene.wall, "prune", False):
        numbers["wall_modes_left_out"] = pipeline("pruning").sentences
    peak = float(trajectory.contact_force[:, -1].max())
    return numbers | {"peak_wall_force_N": peak, "contact_radius_m": contact_radius(scene, peak)}


def _errors(pipeline: Pipeline, time: float | None) -> tuple[ErrorEstimate, tuple[str, ...]]:
    """The estimates, and a sentence for each that could not be made, the run stands without it, or
    that is large."""
    if not needs_assembly(pipeline.scene) or isinstance(pipeline("wall"), CoupledWall):
        return ErrorEstimate(time=time), ()
    own = pipeline.scene.mesh.file is not None  # nobody knows how to coarsen it
    found, told = {}, []
    for name in ("reduction",) if own else ("reduction", "mesh"):
        try:
            found[name] = pipeline(f"{name}-error")
            if found[name] > LARGE:
                share = f"{100 * found[name]:.0f} % of the striker's speed"
                told.append(f"The error of the {name} is about {share}: {CURES[name]}.")
        except ValueError as reason:
            told.append(f"The error of the {name} could not be estimated: {reason}")
    return ErrorEstimate(time=time, **found), tuple(told)


def _waves(pipeline: Pipeline, sphere: int) -> SphereWaves:
    run = pipeline("impact").trajectory
    return sphere_waves(pipeline("waves"), run.t, run.v[:, sphere - 1], sphere)
