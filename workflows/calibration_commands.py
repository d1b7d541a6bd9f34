"""`beadwave calibrate` and `beadwave twin`."""

import sys
from pathlib import Path
from typing import Annotated, Optional

import typer

from workflows.progress import StageProgress
from workflows.scene import InvalidScene
from workflows.scene_file import scene as load

Free = Annotated[
    Optional[str],  # noqa: UP045  typer reads the annotation
    typer.Option(
        help="What to vary: contacts, contact.N, preload, dissipation, striker, trigger, "
        "wall.frequency, wall.mass, wall.damping; default contacts,striker,trigger and the "
        "frequency of a 1dof wall."
    ),
]
Bounds = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option(metavar="KEY=LOW:HIGH,..", help="Bounds, as contacts=0.5:2."),
]
Scan = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option(metavar="LOW:HIGH:POINTS", help="Scan of the wall's frequency [Hz]."),
]
HoldOut = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option(metavar="SPHERES", help="Spheres left out of the fit and predicted, as 4,14."),
]
Band = Annotated[
    Optional[float],  # noqa: UP045
    typer.Option(help="Low-pass [Hz] without phase on data and model alike."),
]
Out = Annotated[
    Optional[Path],  # noqa: UP045
    typer.Option(help="Folder for the calibrated scene, tables and figures."),
]
Changes = Annotated[
    Optional[list[str]],  # noqa: UP045
    typer.Option("--set", metavar="KEY=VALUE", help="Change a value of the scene, dotted key."),
]
Json = Annotated[bool, typer.Option("--json", help="Print the result for machines.")]
TwoStage = Annotated[
    bool,
    typer.Option("--two-stage", help="As the thesis: the chain stays as the first waves gave it."),
]
Posterior = Annotated[
    bool,
    typer.Option(
        "--posterior",
        help="Sample the posterior (emcee): quantiles beside the two-sigma bars; minutes.",
    ),
]
Starts = Annotated[int, typer.Option(help="Starts of the search, until one explains the data.")]


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
        Optional[float],  # noqa: UP045
        typer.Option(help="Low-pass [Hz] that the data has passed in the instrument."),
    ] = None,
    hold_out: HoldOut = None,
    two_stage: TwoStage = False,
    scan: Scan = None,
    starts: Starts = 12,
    posterior: Posterior = False,
    seed: Annotated[
        int, typer.Option(help="Of the starts after the first and of the posterior's samples.")
    ] = 0,
    out: Out = None,
    changes: Changes = None,
    json: Json = False,
) -> None:
    """Contact stiffnesses and wall parameters fitted to measured velocities."""
    _possible(posterior, two_stage)
    from workflows.calibration.calibrate import Request, calibrated
    from workflows.calibration.velocity_file import record
    from workflows.stages import pipeline_of

    chosen = _with_chain(load(scene, tuple(changes or ())))
    measured = record(data)
    request = Request(
        free, bounds, trigger, band, instrument, _spheres(hold_out), two_stage, _positive(starts),
        _seed(seed), _scan(scan),
    )  # fmt: skip
    _writable(out, scene, data)
    with StageProgress(sys.stderr) as progress:
        wall = pipeline_of(chosen, progress.stage)("wall")
        with progress.stage("calibration"):
            found = calibrated(chosen, wall, measured, data.name, request)
        found = _sampled(found, posterior, seed, progress)
    _told(found, out, json)


def twin(
    scene: Annotated[
        Optional[str],  # noqa: UP045
        typer.Argument(metavar="[SCENE]", help="The scene that is fitted; default: rig-1dof."),
    ] = None,
    scatter: Annotated[float, typer.Option(help="Of the contacts' stiffness, to a side.")] = 0.1,
    frequency: Annotated[float, typer.Option(help="True frequency of a 1dof wall [Hz].")] = 240.0,
    noise: Annotated[float, typer.Option(help="rms of one repeat, in m/s.")] = 1e-3,
    sampling: Annotated[float, typer.Option(help="Samples in a second [Hz].")] = 1e6,
    instrument: Annotated[float, typer.Option(help="Low-pass of the vibrometer [Hz].")] = 100e3,
    repeats: Annotated[int, typer.Option(help="Signals per sphere.")] = 10,
    jitter: Annotated[float, typer.Option(help="Standard deviation of the trigger, in s.")] = 2e-6,
    seed: Annotated[int, typer.Option(help="Of the known rig and of the noise.")] = 0,
    spheres: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(help="Spheres measured, as 1,4,14; default: those of the scene."),
    ] = None,
    runs: Annotated[
        int, typer.Option(help="Repeats of the whole experiment, for the bars' coverage.")
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
    json: Json = False,
) -> None:
    """A known rig makes SYNTHETIC data, and a calibration has to find it again."""
    _possible(posterior, two_stage)
    from workflows.calibration import twin as experiment
    from workflows.calibration.calibrate import Request
    from workflows.stages import pipeline_of

    watched = (f"output.spheres=[{spheres}]",) if spheres else ()
    chosen = _with_chain(load(scene or "rig-1dof", (*watched, *(changes or ()))))
    setting = experiment.checked(
        experiment.Twin(
            scatter, frequency, noise, sampling, instrument, repeats, jitter, seed=_seed(seed)
        )
    )
    request = Request(
        free, bounds, band=band, hold_out=_spheres(hold_out), two_stage=two_stage,
        starts=_positive(starts), scan=_scan(scan),
    )  # fmt: skip
    _writable(out, scene)
    covered = None
    with StageProgress(sys.stderr) as progress:
        wall = pipeline_of(chosen, progress.stage)("wall")
        with progress.stage("calibration"):
            found, data = experiment.twin_run(chosen, wall, setting, request)
        found = _sampled(found, posterior, seed, progress)
        if runs:
            with progress.stage(f"{runs} repeats"):
                covered = experiment.coverage(chosen, wall, setting, request, found, runs)
    if out:
        from workflows.calibration.folder import write_data

        write_data(out, data, covered)
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
    from workflows.calibration.folder import write

    report = found.report
    if covered is not None:
        report.coverage = covered.model_dump()
    if out:
        write(found, out)
    typer.echo(report.model_dump_json(indent=1) if json else report.text())
    if covered is not None and not json:
        typer.echo(covered.text())
    if out and not json:
        typer.echo(f"written: {out}/scene.toml")


def _with_chain(scene):
    if scene.chain is None:
        raise InvalidScene(f"the scene {scene.name} has no [chain]; add one, or take rig-1dof.")
    return scene


def _writable(out: Path | None, *sources: Path | str | None) -> None:
    """Make the folder; raises InvalidScene where it cannot be one or would overwrite a source."""
    if not out:
        return
    from workflows.calibration.folder import FILES
    from workflows.run_folder import RunFolder, checked_folder

    for source in (Path(name) for name in sources if name):
        if any((out / name).exists() and source.exists() and source.samefile(out / name)
               for name in FILES):  # fmt: skip
            raise InvalidScene(f"--out {out} would overwrite {source}; choose another.")
    RunFolder(checked_folder(out)).make()


def _spheres(text: str | None) -> tuple[int, ...]:
    try:
        return tuple(int(n) for n in text.split(",")) if text else ()
    except ValueError:
        raise InvalidScene(f"--hold-out {text} must name spheres, as 4,14.") from None


def _positive(starts: int) -> int:
    if not 1 <= starts <= 1000:
        raise InvalidScene(f"--starts {starts} must be between 1 and 1000; change it.")
    return starts


def _seed(seed: int) -> int:
    if seed < 0:
        raise InvalidScene(f"--seed {seed} must be 0 or above; change it.")
    return seed


def _scan(text: str | None) -> tuple[float, float, int] | None:
    if not text:
        return None
    try:
        low, high, points = text.split(":")
        return float(low), float(high), int(points)
    except ValueError:
        raise InvalidScene(f"--scan {text} is not low:high:points; write 100:1000:60.") from None
