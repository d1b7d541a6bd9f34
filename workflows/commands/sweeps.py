"""`beadwave sweep` and `scan`: many cases of a scene, many points of a face."""

from pathlib import Path
from typing import Annotated, Any

import typer

from beadwave.system import file_name
from beadwave.workflows.commands.terminal import (
    StageProgress,
    print_lines,
    print_notes,
    print_result,
)
from beadwave.workflows.commands.verb import Call, Word, verb

Folder = Annotated[
    Path | None, typer.Option("--open", metavar="DIR", help="Show a finished sweep.")
]


@verb(
    "beadwave.workflows.sweep.api.sweep",
    json="{cases, status, folder, outputs: [...], effects: [...]}",
    sample=Word(metavar="KIND:N"),
)
def sweep(
    call: Call,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Only state cases, seconds and memory to expect.")
    ] = False,
    workers: Annotated[
        int | None, typer.Option(help="Processes of this machine, by Dask.", min=1)
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="A Dask scheduler, tcp://host:8786, instead."),
    ] = None,
    open_folder: Folder = None,
    of: Annotated[
        str | None, typer.Option(metavar="OUTPUT", help="With --open: draw this output.")
    ] = None,
    against: Annotated[
        str | None, typer.Option(metavar="KEY[,KEY]", help="With --open --of: over these keys.")
    ] = None,
) -> None:
    """Many cases into one table: grids, lists, samples."""
    if open_folder:
        _show(call, open_folder, of, against)
        return
    from beadwave.workflows.scene import InvalidScene

    if of or against:
        raise InvalidScene("--of and --against draw a finished sweep; name it by --open DIR.")
    if workers and scheduler:
        raise InvalidScene(
            f"--workers {workers} are processes of this machine, --scheduler {scheduler} has its "
            "own; give one of them."
        )
    if dry_run:
        from beadwave.workflows.report import tables
        from beadwave.workflows.sweep.api import sweep_price

        described = ("scene", "changes", "over", "sample", "cases", "seed")
        options = {name: call.given[name] for name in described if name in call.given}
        with StageProgress(quiet=call.quiet) as progress, progress.stage("first case"):
            price = sweep_price(**options, processes=workers)
        text = "\n\n".join([tables.text(price.table()), *price.notes])
        print_result(price._asdict(), text, call.json, call.quiet)
        return

    with StageProgress(quiet=call.quiet) as progress:
        with progress.counted("cases") as counter:
            result = call.function(**call.given, on=scheduler or workers or 1, told=counter)
    _print(call, result)


def _print(call: Call, result: Any) -> None:
    print_result(result.record(), result.text(), call.json, call.quiet)
    print_notes(result.notes)
    print_lines(f"written: {result.folder}/cases.parquet", json=call.json, quiet=call.quiet)
    counts = result.counts()
    if not counts.get("done"):
        sentence = next(iter(result.messages()), "")
        raise ValueError(
            f"none of {result.design.n_cases} cases has a result "
            f"({', '.join(f'{n} {status}' for status, n in counts.items())}); {sentence}"
        )


@verb(
    "beadwave.workflows.sweep.api.scan", json="{cases, status, folder, outputs: [...]}",
    face=Word(metavar="BODY:FACE"), grid=Word(metavar="NxM"),
)  # fmt: skip
def scan(call: Call) -> None:
    """Echo delay, echo ratio and force as maps over a face."""
    _print(call, call())


def _show(call: Call, folder: Path, of: str | None, against: str | None) -> None:
    """Print a finished sweep, or draw one of its outputs."""
    from beadwave.workflows.files.run_folder import RunFolder
    from beadwave.workflows.sweep.api import load_sweep

    result = load_sweep(folder)
    if not (of or against):
        print_result(result.record(), result.text(), call.json, call.quiet)
        print_notes(result.notes)
        return
    picture = result.plot(of, tuple(against.split(",")) if against else None)
    name = picture.name + (f"_over_{against.replace(',', '_')}" if against else "")
    file = f"figures/{file_name(name)}.png"
    with RunFolder(folder, overwrite=call.given["overwrite"]).held(file) as locked:
        path = locked.write(file, picture.png)
    print_result({"written": [str(path)]}, f"written: {path}", call.json, call.quiet)
