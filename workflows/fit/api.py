"""Models fitted to records: chains calibrated, structures inspected, measurements designed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from beadwave.workflows.files.run_folder import Picture, RunFolder, picture_named
from beadwave.workflows.files.scene import Changes, Source, files_read
from beadwave.workflows.files.scene import scene as load_scene
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.scene.required_parts import with_chain, with_chains
from beadwave.workflows.stages.engine.progress import Progress, quiet

if TYPE_CHECKING:
    import xarray

    from beadwave.workflows.fit.calibrate import CalibrationOutcome
    from beadwave.workflows.fit.inspect import InspectionResult
    from beadwave.workflows.fit.joints_posterior import JointsPosterior
    from beadwave.workflows.fit.report import CalibrationReport, InspectionReport
    from beadwave.workflows.report.finding import Finding
    from beadwave.workflows.stages.engine.pipeline import Pipeline

STARTS = 1, 1000  # of a search
SEEDS = 0, 10**18


@dataclass(frozen=True, repr=False)
class Calibration:
    """A scene fitted to velocities: `report.parameters` one by one with their bars, `data` as
    signals, `plot()` data against model."""

    scene: Scene
    report: CalibrationReport
    found: CalibrationOutcome

    @property
    def data(self) -> xarray.Dataset:
        """Velocity [m/s] measured, at the start of the fit and found, over time and sphere; of
        other sensors their signals, over time and sensor."""
        from beadwave.workflows.report.arrays import dataset

        fit, signals = self.found.fit, self.found.signals
        kinds = {"measured": fit.data, "start": fit.start, "found": fit.model}
        if signals.channels:
            scale, units = signals.channels.scale, ", ".join(signals.channels.units)
            over = {n: (("time", "sensor"), scale * y, units) for n, y in kinds.items()}
            return dataset(over, time=signals.t, sensor=list(signals.names))
        over = {name: (("time", "sphere"), v, "m/s") for name, v in kinds.items()}
        return dataset(over, time=signals.t, sphere=[n + 1 for n in signals.spheres])

    def plot(self, name: str | None = None) -> Picture:
        """signals, parameters, correlation, scan or posterior; the first without a name."""

        from beadwave.workflows.fit.fit_pictures import calibration_pictures

        return picture_named(calibration_pictures(self.found), name)

    def __repr__(self) -> str:
        return self.report.text()


def calibrate(
    scene: Source,
    data: str | Path,
    changes: Changes = (),
    *,
    free: str | None = None,
    bounds: str | None = None,
    trigger: str = "fit",
    band: float | None = None,
    instrument: float | None = None,
    hold_out: str | Iterable[int] = (),
    two_stage: bool = False,
    scan: str | tuple[float, float, int] | None = None,
    starts: int = 12,
    posterior: bool = False,
    seed: int = 0,
    out: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress = quiet,
) -> Calibration:
    """Contact stiffnesses and wall parameters fitted to measured velocities (`beadwave calibrate`).

    data        velocities, forces, their rates, displacements or voltages with units in the header:
                .csv, .mat, .uff; for bands and gains see [[output.sensors]]
    free        what to vary: contacts, contact.N, contact.stiffness, contact.exponent, preload,
                dissipation, striker, trigger, wall.frequency, wall.mass, wall.damping; default
                contacts,striker,trigger and the frequency of a 1dof wall
    bounds      bounds of what varies, as contacts=0.5:2
    trigger     first touch on the data's clock: fit, estimate, or seconds as text
    band        low-pass [Hz] without phase on data and model alike
    instrument  low-pass [Hz] that the data has passed in the instrument
    hold_out    spheres left out of the fit and predicted, as 4,14
    two_stage   as in the thesis: keep the chain as the first waves determine it
    scan        misfit over the wall's frequency [Hz], as 100:1000:60: low, high, points
    starts      largest number of starts of the search; it ends once the data is explained
    posterior   sample the posterior (extra posterior): quantiles and the two-sigma bars; minutes
    seed        random seed of the starts after the first and of the posterior samples
    out         folder for the calibrated scene, tables and figures

    Raises InvalidScene for bad input, and for data that cannot be what it says.
    """
    _require_possible(posterior, two_stage)
    file = Path(data)
    from beadwave.workflows.fit.better_walls import better_walls
    from beadwave.workflows.fit.calibrate import CalibrationRequest, calibrated
    from beadwave.workflows.fit.folder import CALIBRATION_FILES, write_calibration
    from beadwave.workflows.fit.measured_record import measured as record
    from beadwave.workflows.stages.engine.pipeline import pipeline_of

    request = CalibrationRequest(
        free, bounds, trigger, band, instrument, _spheres("--hold-out", hold_out), two_stage,
        _within("--starts", starts, *STARTS), _within("--seed", seed, *SEEDS), _scan(scan),
    )  # fmt: skip
    start, measured = with_chain(load_scene(scene, changes)), record(file)
    folder = _folder(out, (*files_read(start, scene), file), overwrite)
    with _renewed(folder, CALIBRATION_FILES):
        start, wall = _with_wall(start, pipeline_of(start, progress))
        better = better_walls(start, progress)
        with progress("calibration"):
            result = calibrated(start, wall, measured, file.name, request, better)
        result = _sampled(result, posterior, request.seed, progress)
        if folder:
            write_calibration(result, folder)
    return Calibration(result.scene, result.report, result)


def _require_possible(posterior: bool, two_stage: bool) -> None:
    """Raise InvalidScene for a posterior that cannot be sampled."""
    if not posterior:
        return
    from beadwave.workflows.fit.nested import require_nested_sampler

    require_nested_sampler()
    if two_stage:
        raise InvalidScene(
            "--posterior is of all parameters and all waves together; leave out --two-stage."
        )


def _within(option: str, value: int, low: int, high: int) -> int:
    """The number; raises InvalidScene where it is not between low and high."""
    if not low <= value <= high:
        text = str(value) if abs(value) < 10**20 else "a number of more than 20 digits"
        raise InvalidScene(f"{option} {text} must be between {low} and {high}; change it.")
    return value


def _spheres(option: str, spheres: str | Iterable[int]) -> tuple[int, ...]:
    """Numbers of spheres, as (4, 14) or "4,14"; raises InvalidScene for others."""
    try:
        return tuple(map(int, spheres.split(",") if isinstance(spheres, str) else spheres))
    except (TypeError, ValueError):
        raise InvalidScene(f"{option} {spheres} must name spheres, as 4,14.") from None


def _scan(scan: str | tuple[float, float, int] | None) -> tuple[float, float, int] | None:
    """Low, high [Hz] and points, as (100, 1000, 60) or "100:1000:60"; raises InvalidScene."""
    if scan is None:
        return None
    try:
        low, high, points = scan.split(":") if isinstance(scan, str) else scan
        return float(low), float(high), int(points)
    except (TypeError, ValueError):
        raise InvalidScene(f"--scan {scan} is not low:high:points; write 100:1000:60.") from None


def _sampled(
    result: CalibrationOutcome, posterior: bool, seed: int, progress: Progress
) -> CalibrationOutcome:
    """With samples of the posterior, where they are wanted."""
    if not posterior:
        return result
    from beadwave.workflows.fit.calibrate import with_posterior

    with progress("posterior"):
        return with_posterior(result, seed)


def _folder(out: str | Path | None, inputs: tuple[Path, ...], overwrite: bool) -> RunFolder | None:
    return RunFolder(Path(out), inputs=inputs, overwrite=overwrite) if out else None


def _with_wall(scene: Scene, pipeline: Pipeline) -> tuple[Scene, Any]:
    """The scene with the curvatures of the face that it strikes, and its wall."""
    from beadwave.workflows.stages.chain.chain import flat, on_surface
    from beadwave.workflows.stages.engine.stage_table import needs_structure

    flat(scene)  # refuses materials before anything is computed
    meshed = needs_structure(scene) and scene.bending is None
    surface = pipeline("surface") if meshed else None
    return on_surface(scene, surface), pipeline("wall")


def _renewed(folder: RunFolder | None, files: tuple[str, ...]) -> AbstractContextManager:
    """The folder, where there is one, closed to others; what an earlier command left goes."""
    return folder.renewed(*files) if folder else nullcontext()


@dataclass(frozen=True, repr=False)
class Inspection:
    """A scene whose numbers were found: `report.numbers` one by one with their bars, `plot()`
    signals, numbers, or bars over the records' length."""

    scene: Scene
    report: InspectionReport
    found: InspectionResult

    def plot(self, name: str | None = None) -> Picture:
        """signals, numbers or length; the first without a name."""
        from beadwave.workflows.fit.fit_pictures import inspection_pictures

        return picture_named(inspection_pictures(self.found, self.report), name)

    def __repr__(self) -> str:
        return self.report.text()


def inspect(
    scene: Source,
    data: Sequence[str | Path] | str | Path,
    changes: Changes = (),
    *,
    find: str,
    bounds: str | None = None,
    each: str | None = None,
    starts: int = 12,
    seed: int = 0,
    out: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress = quiet,
) -> Inspection:
    """Numbers of the structure found from records of sensors on the chain (`beadwave inspect`).

    data     records of sensors, .csv, one for each impact, or left.csv+right.csv; of several chains
             a column names its own
    find     numbers to find, keys of the scene: beam.thickness,beam.young
    bounds   where they lie, as beam.thickness=8mm:12mm; default 0.7 to 1.4 of the scene's value
    each     numbers that every record has for itself, and where they start, as
             striker.velocity=0.3,0.35; several with semicolons, or none; default striker.velocity
    starts   candidates that the search follows
    seed     random seed of the starts
    out      folder for the scene found, tables and pictures

    Raises InvalidScene for bad input.
    """
    from beadwave.workflows.fit.folder import INSPECTION_FILES, write_inspection
    from beadwave.workflows.fit.inspect import InspectionRequest, inspected
    from beadwave.workflows.fit.measured_record import files_of_strike, recorded
    from beadwave.workflows.fit.plausibility import with_distinct_names
    from beadwave.workflows.fit.report import inspection_report
    from beadwave.workflows.sweep.cases import base_of

    request = InspectionRequest(
        find, bounds, each, _within("--starts", starts, *STARTS), _within("--seed", seed, *SEEDS)
    )
    strikes = [files_of_strike(one) for one in ([data] if isinstance(data, str | Path) else data)]
    base = base_of(scene, changes)
    start = with_chains(base.with_values({}))
    files = [file for strike in strikes for file in strike]
    folder = _folder(out, (*files_read(start, scene), *files), overwrite)
    with _renewed(folder, INSPECTION_FILES):
        records = with_distinct_names(tuple(recorded(*strike) for strike in strikes))
        result = inspected(base, records, request, progress)
        report = inspection_report(result, records)
        if folder:
            write_inspection(result, report, folder)
    return Inspection(result.scene, report, result)


def design(
    scene: Source,
    changes: Changes = (),
    *,
    find: str,
    bounds: str | None = None,
    over: Sequence[str] = (),
    out: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress = quiet,
) -> Finding:
    """Choice of sphere, chain and velocity for a measurement (`beadwave design`).

    Bars of the numbers to find, key by key, from each sphere alone, before anything is measured.

    find    numbers to find, keys of the scene: beam.thickness,beam.young
    bounds  where they lie, as beam.thickness=8mm:12mm; default 0.7 to 1.4 of the scene's value
    over    a key that varies, as chain.count=9,17 or striker.velocity=0.2:0.5:4; may be repeated
    out     folder for tables (CSV, JSON) and pictures

    Raises InvalidScene for bad input.
    """
    from beadwave.workflows.fit.design import designed
    from beadwave.workflows.report import finding
    from beadwave.workflows.sweep.cases import base_of

    base = base_of(scene, changes)
    start = with_chain(base.with_values({}))
    folder = _folder(out, files_read(start, scene), overwrite)
    if folder:
        folder.require(*finding.files("design"))
    result = designed(base, find, bounds, over, progress)
    if folder:
        finding.write(result, folder, scene=start.name, find=find)
    return result


def joints_posterior(
    scene: Source = None,
    changes: Changes = (),
    *,
    hammer: str | Path | None = None,
    match: str | Iterable[int] | Mapping[int, float] | None = None,
    free: str | Iterable[str] = (),
    bounds: str | None = None,
    seed: int = 0,
    progress: Progress = quiet,
) -> JointsPosterior:
    """Posterior of joint stiffnesses and materials given measured modes, with its lobes, evidence,
    and what the modes do not determine (`beadwave tune --posterior`; extra posterior).

    `report` has it in numbers, `posterior` the weighted samples. `hammer`, `match` and `free` as
    `tune` takes them; `bounds` are those of log-uniform priors, as joints.cover.kz=1e6:1e9. Raises
    InvalidScene for bad input.
    """
    from beadwave.workflows.fit.joints_posterior import posterior_of
    from beadwave.workflows.structure.api import names_of, with_modes

    chosen, wanted, remarks = with_modes(scene, changes, hammer, match, progress)
    if not SEEDS[0] <= seed <= SEEDS[1]:
        raise InvalidScene(f"--seed {seed} must be a number from 0 to 1e18.")
    result = posterior_of(chosen, wanted, names_of(free), progress, seed=seed, bounds=bounds)
    remarks = [*remarks, *result.report.remarks]
    return result._replace(report=result.report.model_copy(update={"remarks": remarks}))
