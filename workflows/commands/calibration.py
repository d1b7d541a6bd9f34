"""`beadwave calibrate` and `beadwave twin`."""

import sys
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Annotated

import typer

from workflows.commands.options import Changes, Overwrite, json_of
from workflows.commands.terminal import StageProgress
from workflows.files.run_folder import RunFolder
from workflows.files.scene import files_read
from workflows.files.scene import scene as load
from workflows.scene import InvalidScene
from workflows.scene.parts import with_chain

Free = Annotated[
    str | None,
    typer.Option(
        help="What to vary: contacts, contact.N, preload, dissipation, striker, trigger, "
        "wall.frequency, wall.mass, wall.damping; default contacts,striker,trigger and the "
        "frequency of a 1dof wall."
    ),
]
Bounds = Annotated[
    str | None, typer.Option(metavar="KEY=LOW:HIGH,..", help="Bounds, as contacts=0.5:2.")
]
Scan = Annotated[
    str | None, typer.Option(metavar="LOW:HIGH:POINTS", help="Scan of the wall's frequency [Hz].")
]
HoldOut = Annotated[
    str | None,
    typer.Option(metavar="SPHERES", help="Spheres left out of the fit and predicted, as 4,14."),
]
Band = Annotated[
    float | None, typer.Option(help="Low-pass [Hz] without phase on data and model alike.")
]
Out = Annotated[
    Path | None, typer.Option(help="Folder for the calibrated scene, tables and figures.")
]
Json = json_of("the report, {parameters: [...], ...}, see report.json")
TwoStage = Annotated[
    bool,
    typer.Option(
        "--two-stage", help="As in the thesis: keep the chain as the first waves determine it."
    ),
]
Posterior = Annotated[
    bool,
    typer.Option(
        "--posterior",
        help="Sample the posterior (emcee): quantiles beside the two-sigma bars; minutes.",
    ),
]
Starts = Annotated[
    int,
    typer.Option(
        help="Largest number of starts of the search; it ends once the data is explained."
    ),
]


def calibrate(
    scene: Annotated[str, typer.Argument(metavar="SCENE", help="A built-in scene or a file.")],
    data: Annotated[
        Path, typer.Argument(metavar="DATA", help="Velocities: .csv, .mat or .uff, with units.")
    ],
    free: Free = None,
    bounds: Bounds = None,
    trigger: Annotated[
        str, typer.Option(help="First touch on the data's clock: fit, estimate, or seconds.")
    ] = "fit",
    band: Band = None,
    instrument: Annotated[
        float | None, typer.Option(help="Low-pass [Hz] that the data has passed in the instrument.")
    ] = None,
    hold_out: HoldOut = None,
    two_stage: TwoStage = False,
    scan: Scan = None,
    starts: Starts = 12,
    posterior: Posterior = False,
    seed: Annotated[
        int,
        typer.Option(
            help="Random seed of the starts after the first and of the posterior samples."
        ),
    ] = 0,
    out: Out = None,
    changes: Changes = None,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Contact stiffnesses and wall parameters fitted to measured velocities."""
    _possible(posterior, two_stage)
    from workflows.calibration.calibrate import Request, calibrated
    from workflows.calibration.folder import FILES, write
    from workflows.files.velocities import record
    from workflows.pipeline.pipeline import pipeline_of

    chosen = with_chain(load(scene, tuple(changes or ())))
    measured = record(data)
    request = Request(
        free, bounds, trigger, band, instrument, _spheres(hold_out), two_stage, _positive(starts),
        _seed(seed), _scan(scan),
    )  # fmt: skip
    folder = _folder(out, (*files_read(chosen, scene), data), overwrite)
    with _held(folder, FILES), StageProgress(sys.stderr) as progress:
        wall = pipeline_of(chosen, progress.stage)("wall")
        with progress.stage("calibration"):
            found = calibrated(chosen, wall, measured, data.name, request)
        found = _sampled(found, posterior, seed, progress)
        if folder:
            write(found, folder)
    _told(found, out, json)


def twin(
    scene: Annotated[
        str | None,
        typer.Argument(metavar="[SCENE]", help="The scene that is fitted; default: rig-1dof."),
    ] = None,
    scatter: Annotated[
        float, typer.Option(help="Relative scatter of the contact stiffnesses, plus or minus.")
    ] = 0.1,
    frequency: Annotated[float, typer.Option(help="True frequency of a 1dof wall [Hz].")] = 240.0,
    noise: Annotated[float, typer.Option(help="rms of one repeat, in m/s.")] = 1e-3,
    sampling: Annotated[float, typer.Option(help="Sampling rate [Hz].")] = 1e6,
    instrument: Annotated[float, typer.Option(help="Low-pass of the vibrometer [Hz].")] = 100e3,
    repeats: Annotated[int, typer.Option(help="Signals per sphere.")] = 10,
    jitter: Annotated[float, typer.Option(help="Standard deviation of the trigger, in s.")] = 2e-6,
    seed: Annotated[int, typer.Option(help="Random seed of the known rig and of the noise.")] = 0,
    spheres: Annotated[
        str | None, typer.Option(help="Spheres measured, as 1,4,14; default: those of the scene.")
    ] = None,
    runs: Annotated[
        int,
        typer.Option(help="Repeats of the whole experiment that give the coverage of the bars."),
    ] = 0,
    free: Free = None,
    bounds: Bounds = None,
    band: Band = None,
    hold_out: HoldOut = None,
    two_stage: TwoStage = False,
    scan: Scan = None,
    starts: Starts = 12,
    posterior: Posterior = False,
    out: Out = None,
    changes: Changes = None,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """A known rig makes SYNTHETIC data, and a calibration has to find it again."""
    _possible(posterior, two_stage)
    from workflows.calibration import twin as experiment
    from workflows.calibration.calibrate import Request
    from workflows.calibration.folder import TWIN_FILES, write, write_data
    from workflows.pipeline.pipeline import pipeline_of

    watched = (f"output.spheres=[{spheres}]",) if spheres else ()
    chosen = with_chain(load(scene or "rig-1dof", (*watched, *(changes or ()))))
    setting = experiment.checked(
        experiment.Twin(
            scatter, frequency, noise, sampling, instrument,
            _within("--repeats", repeats, 1, 1000), jitter, seed=_seed(seed),
        )
    )  # fmt: skip
    _within("--runs", runs, 0, 100_000)
    request = Request(
        free, bounds, band=band, hold_out=_spheres(hold_out), two_stage=two_stage,
        starts=_positive(starts), scan=_scan(scan),
    )  # fmt: skip
    folder = _folder(out, files_read(chosen, scene), overwrite)
    covered = None
    with _held(folder, TWIN_FILES), StageProgress(sys.stderr) as progress:
        wall = pipeline_of(chosen, progress.stage)("wall")
        with progress.stage("calibration"):
            found, data = experiment.twin_run(chosen, wall, setting, request)
        found = _sampled(found, posterior, seed, progress)
        if runs:
            with progress.stage(f"{runs} repeats"):
                covered = experiment.coverage(chosen, wall, setting, request, found, runs)
        if covered is not None:
            found.report.coverage = covered.model_dump()
        if folder:
            write_data(folder, data, covered)
            write(found, folder)
    _told(found, out, json, covered)


def _possible(posterior: bool, two_stage: bool) -> None:
    """Raise InvalidScene for a posterior that cannot be sampled."""
    if not posterior:
        return
    from workflows.calibration.posterior import require_sampler

    require_sampler()
    if two_stage:
        raise InvalidScene(
            "--posterior is of all parameters and all waves together; leave out --two-stage."
        )


def _sampled(found, posterior: bool, seed: int, progress: StageProgress):
    if not posterior:
        return found
    from workflows.calibration.posterior import with_posterior

    with progress.stage("posterior"):
        return with_posterior(found, seed)


def _told(found, out: Path | None, json: bool, covered=None) -> None:
    report = found.report
    typer.echo(report.model_dump_json(indent=1) if json else report.text())
    if covered is not None and not json:
        typer.echo(covered.text())
    if out and not json:
        typer.echo(f"written: {out}/scene.toml")


def _folder(out: Path | None, inputs: tuple[Path, ...], overwrite: bool) -> RunFolder | None:
    return RunFolder(out, inputs=inputs, overwrite=overwrite) if out else None


def _held(folder: RunFolder | None, files: tuple[str, ...]) -> AbstractContextManager:
    """The folder, where there is one, closed to others; what an earlier command left goes."""
    return folder.renewed(*files) if folder else nullcontext()


def _spheres(text: str | None) -> tuple[int, ...]:
    try:
        return tuple(int(n) for n in text.split(",")) if text else ()
    except ValueError:
        raise InvalidScene(f"--hold-out {text} must name spheres, as 4,14.") from None


def _positive(starts: int) -> int:
    return _within("--starts", starts, 1, 1000)


def _seed(seed: int) -> int:
    return _within("--seed", seed, 0, 10**18)


def _within(option: str, value: int, least: int, most: int) -> int:
    if not least <= value <= most:
        shown = str(value) if abs(value) < 10**20 else "a number of more than 20 digits"
        raise InvalidScene(f"{option} {shown} must be between {least} and {most}; change it.")
    return value


def _scan(text: str | None) -> tuple[float, float, int] | None:
    if not text:
        return None
    try:
        low, high, points = text.split(":")
        return float(low), float(high), int(points)
    except ValueError:
        raise InvalidScene(f"--scan {text} is not low:high:points; write 100:1000:60.") from None
