"""`beadwave sweep` and `scan`: many cases of a scene, many points of a face."""

from pathlib import Path
from typing import Annotated

import typer

from workflows.commands.options import (
    Changes,
    Overwrite,
    Quiet,
    SceneName,
    dotted_keys,
    json_of,
)
from workflows.commands.terminal import StageProgress, print_lines, print_notes, print_result
from workflows.commands.verb import Call, Word, verb

Over = Annotated[
    list[str] | None,
    typer.Option(
        "--over",
        metavar="KEY=VALUES",
        help="A key that varies: start:stop:n, start:stop:n:log, or a list a,b,c; beside --sample "
        "a range low:high or low:high:log. May be repeated; a unit is optional.",
        autocompletion=dotted_keys,
    ),
]


def sweep(
    scene: SceneName = None,
    over: Over = None,
    sample: Annotated[
        str | None,
        typer.Option(
            metavar="KIND:N",
            help="lhs:N, a Latin hypercube; sobol:N, N (keys + 2) cases for Sobol's indices.",
        ),
    ] = None,
    cases: Annotated[
        Path | None, typer.Option(help="A CSV of cases: a line of keys, then values.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Random seed of --sample.", min=0)] = 0,
    again: Annotated[
        bool, typer.Option("--again", help="Compute cases that have no result once more.")
    ] = False,
    out: Annotated[Path | None, typer.Option(help="Folder; default sweeps/NAME.")] = None,
    signals: Annotated[
        bool, typer.Option("--signals", help="Keep velocities and wall force: signals.nc.")
    ] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Only tell cases, seconds and memory to expect.")
    ] = False,
    workers: Annotated[
        int | None, typer.Option(help="Processes of this machine, by Dask.", min=1)
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="A Dask scheduler, tcp://host:8786, instead."),
    ] = None,
    open_folder: Annotated[
        Path | None, typer.Option("--open", metavar="DIR", help="Show a finished sweep.")
    ] = None,
    of: Annotated[
        str | None, typer.Option(metavar="OUTPUT", help="With --open: draw this output.")
    ] = None,
    against: Annotated[
        str | None, typer.Option(metavar="KEY[,KEY]", help="With --open --of: over these keys.")
    ] = None,
    changes: Changes = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: json_of("{cases, status, folder, outputs: [...], effects: [...]}") = False,
) -> None:
    """Many cases into one table: grids, lists, samples."""
    if open_folder:
        _show(open_folder, of, against, overwrite, quiet, json)
        return
    if of or against:
        from workflows.scene import InvalidScene

        raise InvalidScene("--of and --against draw a finished sweep; name it by --open DIR.")
    from workflows.sweep.api import Cases
    from workflows.sweep.api import sweep as compute

    if workers and scheduler:
        from workflows.scene import InvalidScene

        raise InvalidScene(
            f"--workers {workers} are processes of this machine, --scheduler {scheduler} has its "
            "own; give one of them."
        )
    design = Cases(over or (), sample, cases, seed, again)
    if dry_run:
        from workflows.report import tables
        from workflows.sweep.api import sweep_price

        with StageProgress(f"sweep {scene}", quiet=quiet) as progress, progress.stage("first case"):
            price = sweep_price(scene, changes or (), cases=design, processes=workers)
        text = "\n\n".join([tables.text(price.table()), *price.notes])
        print_result(price._asdict(), text, json, quiet)
        return

    with StageProgress(f"sweep {scene}", quiet=quiet) as progress:
        with progress.counted("cases") as counter:
            result = compute(
                scene, changes or (), cases=design, out=out, on=scheduler or workers or 1,
                signals=signals, overwrite=overwrite, told=counter,
            )  # fmt: skip
    print_result(result.record(), result.text(), json, quiet)
    print_notes(result.notes)
    print_lines(f"written: {result.folder}/cases.parquet", json=json, quiet=quiet)


@verb(
    "workflows.sweep.api.scan", json="{cases, status, folder, outputs: [...]}",
    face=Word(metavar="BODY:FACE"), grid=Word(metavar="NxM"),
)  # fmt: skip
def scan(call: Call) -> None:
    """The chain over a face: echo delay, echo ratio and force as a map."""
    result = call()
    print_result(result.record(), result.text(), call.json, call.quiet)
    print_notes(result.notes)
    print_lines(f"written: {result.folder}/cases.parquet", json=call.json, quiet=call.quiet)


def _show(
    folder: Path, of: str | None, against: str | None, overwrite: bool, quiet: bool, json: bool
) -> None:
    """Print a finished sweep, or draw one of its outputs."""
    from workflows.files.run_folder import RunFolder
    from workflows.sweep.api import load_sweep

    result = load_sweep(folder)
    if not (of or against):
        print_result(result.record(), result.text(), json, quiet)
        print_notes(result.notes)
        return
    picture = result.plot(of, tuple(against.split(",")) if against else None)
    name = picture.name + (f"_over_{against.replace(',', '_')}" if against else "")
    with RunFolder(folder, overwrite=overwrite).held(f"figures/{name}.png") as locked:
        path = locked.write(f"figures/{name}.png", picture.png)
    print_result({"written": [str(path)]}, f"written: {path}", json, quiet)
