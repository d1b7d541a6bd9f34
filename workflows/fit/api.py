"""Models fitted to records: chains calibrated, structures inspected, measurements designed."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from workflows.files.run_folder import Picture, RunFolder, picture_named
from workflows.files.scene import Changes, Source, files_read
from workflows.files.scene import scene as load_scene
from workflows.scene import InvalidScene, Scene
from workflows.scene.parts import with_chain
from workflows.stages.progress import Progress, quiet

if TYPE_CHECKING:
    import xarray

    from workflows.fit.calibrate import Calibrated
    from workflows.fit.inspect import Inspected
    from workflows.fit.report import CalibrationReport, InspectionReport
    from workflows.fit.twin import Coverage
    from workflows.report.finding import Finding
    from workflows.stages.pipeline import Pipeline


@dataclass(frozen=True, repr=False)
class Calibration:
    """A scene fitted to velocities: `report.parameters` one by one with their bars, `data` as
    signals, `plot()` data against model; `coverage` of a twin that was repeated."""

    scene: Scene
    report: CalibrationReport
    found: Calibrated
    coverage: Coverage | None = None

    @property
    def data(self) -> xarray.Dataset:
        """Velocity [m/s] measured, at the start of the fit and found, over time and sphere; of
        other sensors their signals, over time and sensor."""
        from workflows.report.arrays import dataset

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

        from workflows.fit.figures import calibration_pictures

        return picture_named(calibration_pictures(self.found), name)

    def __repr__(self) -> str:
        texts = (self.report.text(), self.coverage.text() if self.coverage else "")
        return "\n".join(filter(None, texts))


def calibrate(
    scene: Source,
    data: str | Path,
    changes: Changes = (),
    *,
    posterior: bool = False,
    out: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress = quiet,
    **options: Any,
) -> Calibration:
    """Contact stiffnesses and wall parameters fitted to measured velocities (`beadwave calibrate`).

    `data` is .csv, .mat or .uff with units in its header; forces, their rates, displacements and
    voltages as well, see `[[output.sensors]]` for bands and gains. options, all optional:

    free        "contacts,striker,trigger,wall.frequency": what to vary
    bounds      "contacts=0.5:2"
    trigger     "fit", "estimate", or the time of the first touch [s] as text
    band        low-pass [Hz] on data and model alike; instrument [Hz], what the data has passed
    hold_out    spheres left out of the fit and predicted, (4, 14)
    two_stage   keep the chain as the first waves determine it
    starts, seed, scan    of the search; scan = (low, high, points) of the wall's frequency [Hz]

    `posterior` samples it (extra `posterior`). `out` gets scene, tables and pictures. Raises
    InvalidScene for bad input, and for data that cannot be what it says.
    """
    _require_possible(posterior, options)
    file = Path(data)
    from workflows.fit.better_walls import better_walls
    from workflows.fit.calibrate import calibrated
    from workflows.fit.folder import CALIBRATION_FILES, write_calibration
    from workflows.fit.record import measured as record
    from workflows.stages.pipeline import pipeline_of

    start = with_chain(load_scene(scene, changes))
    measured, request = record(file), _request(options)
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


def twin(
    scene: Source = "rig-1dof",
    changes: Changes = (),
    *,
    rig: dict[str, Any] | None = None,
    runs: int = 0,
    posterior: bool = False,
    out: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress = quiet,
    **options: Any,
) -> Calibration:
    """A known rig makes SYNTHETIC data, and a calibration has to find it again (`beadwave twin`).

    rig      of {scatter, frequency, noise, sampling, instrument, repeats, jitter, seed}: the known
             rig and its instrument; see workflows.fit.twin.Twin for units and defaults;
             measured are the spheres of output.spheres
    runs     repeats of the whole experiment, that count how often the bars hold the truth
    options  of the calibration, as in `calibrate`
    """
    _require_possible(posterior, options)
    from workflows.fit import twin as experiment
    from workflows.fit.better_walls import better_walls
    from workflows.fit.folder import TWIN_FILES, write_calibration, write_data
    from workflows.stages.pipeline import pipeline_of

    start = with_chain(load_scene(scene, changes))
    setting, request = experiment.checked(experiment.Twin(**(rig or {}))), _request(options)
    folder = _folder(out, files_read(start, scene), overwrite)
    coverage = None
    with _renewed(folder, TWIN_FILES):
        start, wall = _with_wall(start, pipeline_of(start, progress))
        better = better_walls(start, progress)
        with progress("calibration"):
            result, data = experiment.twin_run(start, wall, setting, request, better)
        result = _sampled(result, posterior, setting.seed, progress)
        if runs:
            with progress(f"{runs} repeats"):
                coverage = experiment.coverage(start, wall, setting, request, result, runs)
            result.report.coverage = coverage.model_dump()
        if folder:
            write_data(folder, data, coverage)
            write_calibration(result, folder)
    return Calibration(result.scene, result.report, result, coverage)


def _require_possible(posterior: bool, options: dict[str, Any]) -> None:
    """Raise InvalidScene for a posterior that cannot be sampled."""
    if not posterior:
        return
    from workflows.fit.posterior import require_sampler

    require_sampler()
    if options.get("two_stage"):
        raise InvalidScene(
            "--posterior is of all parameters and all waves together; leave out --two-stage."
        )


def _request(options: dict[str, Any]):
    """The options of a calibration; raises InvalidScene for a name that is none."""
    from workflows.fit.calibrate import CalibrationRequest
    from workflows.scene import nearest

    for name in options:
        if name not in CalibrationRequest._fields:
            raise InvalidScene(f"{name} is not known, {nearest(name, CalibrationRequest._fields)}.")
    return CalibrationRequest(**options)


def _sampled(result: Calibrated, posterior: bool, seed: int, progress: Progress) -> Calibrated:
    """With samples of the posterior, where they are wanted."""
    if not posterior:
        return result
    from workflows.fit.posterior import with_posterior

    with progress("posterior"):
        return with_posterior(result, seed)


def _folder(out: str | Path | None, inputs: tuple[Path, ...], overwrite: bool) -> RunFolder | None:
    return RunFolder(Path(out), inputs=inputs, overwrite=overwrite) if out else None


def _with_wall(scene: Scene, pipeline: Pipeline) -> tuple[Scene, Any]:
    """The scene with the curvatures of the face that it strikes, and its wall."""
    from workflows.stages.chain import flat, on_surface
    from workflows.stages.pipeline import needs_structure

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
    found: Inspected

    def plot(self, name: str | None = None) -> Picture:
        """signals, numbers or length; the first without a name."""
        from workflows.fit.figures import inspection_pictures

        return picture_named(inspection_pictures(self.found, self.report), name)

    def __repr__(self) -> str:
        return self.report.text()


def inspect(
    scene: Source,
    data: str | Path | Sequence[str | Path],
    changes: Changes = (),
    *,
    out: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress = quiet,
    **options: str | int | None,
) -> Inspection:
    """Numbers of the structure found from records of sensors on the chain (`beadwave inspect`).

    `data` is a file or several, one for each impact. options:

    find      "beam.thickness,beam.young": keys of the scene whose values are one number
    bounds    "beam.thickness=8mm:12mm"; 0.7 to 1.4 of the scene's value without
    each      "striker.velocity=0.3,0.35": numbers that every record has for itself, and where they
              start; "none" for none
    starts, seed    of the search

    `out` gets scene, tables and pictures. Raises InvalidScene for bad input.
    """
    from workflows.fit.folder import INSPECTION_FILES, write_inspection
    from workflows.fit.inspect import InspectionRequest, inspected
    from workflows.fit.plausibility import called_apart
    from workflows.fit.record import recorded
    from workflows.fit.report import inspection_report
    from workflows.sweep.cases import base_of

    files = [Path(file) for file in ([data] if isinstance(data, str | Path) else data)]
    base = base_of(scene, changes)
    start = with_chain(base.with_values({}))
    folder = _folder(out, (*files_read(start, scene), *files), overwrite)
    with _renewed(folder, INSPECTION_FILES):
        records = called_apart(tuple(recorded(file) for file in files))
        result = inspected(base, records, InspectionRequest(**options), progress)
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
    """Which sphere to watch, in which chain, at which velocity (`beadwave design`).

    Bars of the numbers in `find`, key by key, from each sphere alone, before anything is measured.
    `over` varies the chain, as in a sweep: ["chain.count=9,17", "striker.velocity=0.2:0.5:4"].
    `out` is a folder for the table (CSV, JSON) and the picture. Raises InvalidScene for bad input.
    """
    from workflows.fit.design import designed
    from workflows.report import finding
    from workflows.sweep.cases import base_of

    base = base_of(scene, changes)
    start = with_chain(base.with_values({}))
    folder = _folder(out, files_read(start, scene), overwrite)
    if folder:
        folder.require(*finding.files("design"))
    result = designed(base, find, bounds, over, progress)
    if folder:
        finding.write(result, folder, scene=start.name, find=find)
    return result
