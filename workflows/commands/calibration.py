"""`beadwave calibrate` and `beadwave twin`."""

from pathlib import Path
from typing import Annotated, Any

import typer

from workflows.commands.options import (
    Changes,
    Overwrite,
    Quiet,
    RequiredScene,
    json_of,
    scene_names,
)
from workflows.commands.terminal import StageProgress, print_lines

Free = Annotated[
    str | None,
    typer.Option(
        help="What to vary: contacts, contact.N, contact.stiffness, contact.exponent, preload, "
        "dissipation, striker, trigger, wall.frequency, wall.mass, wall.damping; "
        "default contacts,striker,trigger and the frequency of a 1dof wall."
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
    scene: RequiredScene,
    data: Annotated[
        Path, typer.Argument(metavar="DATA", help="Velocities, forces, voltages: .csv, .mat, .uff.")
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
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Fit contacts and wall to measured velocities."""
    from workflows.fit.api import calibrate as fitted

    with StageProgress(f"calibrate {scene}", quiet=quiet) as progress:
        result = fitted(
            scene, data, changes or (), free=free, bounds=bounds, trigger=trigger, band=band,
            instrument=instrument, hold_out=_spheres(hold_out), two_stage=two_stage,
            starts=_within("--starts", starts, 1, 1000), seed=_within("--seed", seed, 0, 10**18),
            scan=_scan(scan), posterior=posterior, out=out, overwrite=overwrite,
            progress=progress.stage,
        )  # fmt: skip
    _print(result, out, json, quiet)


def twin(
    scene: Annotated[
        str | None,
        typer.Argument(
            metavar="SCENE",
            help="The scene that is fitted; default: rig-1dof.",
            autocompletion=scene_names,
        ),
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
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Calibrate to SYNTHETIC data of a known rig."""
    from workflows.fit.api import twin as experiment

    rig = {
        "scatter": scatter, "frequency": frequency, "noise": noise, "sampling": sampling,
        "instrument": instrument, "repeats": _within("--repeats", repeats, 1, 1000),
        "jitter": jitter, "seed": _within("--seed", seed, 0, 10**18),
    }  # fmt: skip
    watched = (("output.spheres", list(_spheres(spheres, "--spheres"))),) if spheres else ()
    with StageProgress(f"twin {scene}", quiet=quiet) as progress:
        result = experiment(
            scene or "rig-1dof", (*watched, *(changes or ())), rig=rig,
            runs=_within("--runs", runs, 0, 100_000), free=free, bounds=bounds, band=band,
            hold_out=_spheres(hold_out), two_stage=two_stage,
            starts=_within("--starts", starts, 1, 1000), scan=_scan(scan), posterior=posterior,
            out=out, overwrite=overwrite, progress=progress.stage,
        )  # fmt: skip
    _print(result, out, json, quiet)


def _print(result: Any, out: Path | None, json: bool, quiet: bool) -> None:
    if json or not quiet:
        print(result.report.model_dump_json(indent=1) if json else result)
    if out:
        print_lines(f"written: {out}/scene.toml", json=json, quiet=quiet)


def _spheres(text: str | None, option: str = "--hold-out") -> tuple[int, ...]:
    try:
        return tuple(int(n) for n in text.split(",")) if text else ()
    except ValueError:
        raise _invalid(f"{option} {text} must name spheres, as 4,14.") from None


def _within(option: str, value: int, low: int, high: int) -> int:
    if not low <= value <= high:
        text = str(value) if abs(value) < 10**20 else "a number of more than 20 digits"
        raise _invalid(f"{option} {text} must be between {low} and {high}; change it.")
    return value


def _scan(text: str | None) -> tuple[float, float, int] | None:
    if not text:
        return None
    try:
        low, high, points = text.split(":")
        return float(low), float(high), int(points)
    except ValueError:
        raise _invalid(f"--scan {text} is not low:high:points; write 100:1000:60.") from None


def _invalid(sentence: str) -> Exception:
    from workflows.scene import InvalidScene  # which loads the tables of scenes

    return InvalidScene(sentence)
