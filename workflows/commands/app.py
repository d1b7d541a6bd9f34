"""The `beadwave` command.

Exit status 0 = done, 1 = the computation failed and says why, 2 = bad input; 130 = interrupted.
What computes is imported by the command that runs, so that each pays only for what it needs.
"""

import sys
from collections.abc import Callable
from errno import EDQUOT, EFBIG, ENAMETOOLONG, ENOSPC
from functools import wraps
from itertools import pairwise
from os import environ
from pathlib import Path
from re import fullmatch
from typing import Annotated

import typer

from workflows.commands.assembly import hammer, look, modes, reduce, tune_joints
from workflows.commands.calibration import calibrate, twin
from workflows.commands.examples import EXAMPLES
from workflows.commands.inspection import design, inspect
from workflows.commands.options import (
    Changes,
    Json,
    JsonFiles,
    Overwrite,
    Quiet,
    SceneName,
    Verbose,
    json_of,
    scene_names,
)
from workflows.commands.signals import Stopped, stopped_by
from workflows.commands.studies import accuracy, run_study, stability, verify
from workflows.commands.sweeps import scan, sweep
from workflows.commands.terminal import (
    StageProgress,
    SummaryPrinter,
    print_files,
    print_lines,
    print_notes,
    print_report,
    print_result,
)

INTERRUPTED = 130
LONGEST = 200  # characters of a path in a sentence

app = typer.Typer(
    name="beadwave",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"beadwave {version('beadwave')}")
        raise typer.Exit


@app.callback(epilog="In Python: import beadwave; help(beadwave). What is missing: beadwave doctor")
def beadwave(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="The version.")
    ] = False,
) -> None:
    """A chain of spheres hits a structure: from geometry to the solitary waves that come back."""


def run(
    scene: SceneName = None,
    out: Annotated[Path | None, typer.Option(help="Run folder; default runs/NAME.")] = None,
    changes: Changes = None,
    overwrite: Overwrite = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Run every stage that the scene needs and fill a run folder."""
    from workflows.run.api import run as run_stages

    printer = SummaryPrinter(json=json, quiet=quiet, verbose=verbose)
    with StageProgress(f"run {scene}", quiet=quiet) as progress:
        result = run_stages(
            scene, changes or (), out=out, overwrite=overwrite, progress=progress.stage,
            planned=progress.planned, waves_known=printer.waves,
        )  # fmt: skip
    printer.whole(result.summary)
    print_notes(result.notes)
    print_lines(f"written: {result.folder}/report.html", json=json, quiet=quiet)


def impact(
    scene: SceneName = None,
    rom: Annotated[
        Path | None, typer.Option(help="A reduced model (.npz, .mat, .h5) as the wall.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for scene.toml, summary.json and trajectory.npz.")
    ] = None,
    changes: Changes = None,
    overwrite: Overwrite = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """The coupled run alone, without pictures and report."""
    from workflows.run.api import impact as run_impact

    printer = SummaryPrinter(json=json, quiet=quiet, verbose=verbose)
    with StageProgress(f"impact {scene}", quiet=quiet) as progress:
        result = run_impact(
            scene, changes or (), rom=rom, out=out, overwrite=overwrite, progress=progress.stage,
            planned=progress.planned, waves_known=printer.waves,
        )  # fmt: skip
    printer.whole(result.summary)
    print_notes(result.notes)
    if out:
        print_lines(f"written: {out}/trajectory.npz", json=json, quiet=quiet)


def scenes(json: json_of("{scenes: [{name, shows}]}") = False) -> None:
    """Built-in scenes, a line each."""
    from workflows.run.api import scenes as built_in

    titles = built_in()
    rows = [{"name": name, "shows": line} for name, line in titles.items()]
    lines = "\n".join(f"{name:16}{line}" for name, line in titles.items())
    print_result({"scenes": rows}, lines, json)


def scene(
    name: Annotated[
        str | None,
        typer.Argument(help="A built-in scene, or a TOML file.", autocompletion=scene_names),
    ] = None,
    key: Annotated[
        str | None,
        typer.Option(
            "--key",
            help="Explain a key, or all keys of a table, in place of a scene: bodies.NAME.box.",
        ),
    ] = None,
    json: json_of("its tables as written, inf as text; with --key {keys: [{key, ...}]}") = False,
) -> None:
    """Print a scene as commented TOML, or what a key of scenes is."""
    from workflows.files.scene import checked_text, tables

    if key is not None:
        from workflows.scene.reference import entries_of

        entries = entries_of(key)
        text = "\n\n".join(entry.text() for entry in entries)
        print_result({"keys": [entry._asdict() for entry in entries]}, text, json)
    elif name is None:
        from workflows.scene import InvalidScene

        raise InvalidScene(
            "scene needs a NAME or a --key; `beadwave scenes` lists the built-in scenes, write "
            "--key chain.radius for what a key is."
        )
    elif json:
        print_result(tables(name), "", json)
    else:
        print(checked_text(name).text, end="")


def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A run folder.")],
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: JsonFiles = False,
) -> None:
    """Write report.html of a run folder."""
    from workflows.files.run_folder import RunFolder
    from workflows.report.report import require_summary, write_report

    require_summary(folder)
    with RunFolder(folder, overwrite=overwrite).held("report.html") as locked:
        page = write_report(locked)
    print_files([page], json, quiet)


def film(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A run folder.")],
    out: Annotated[
        str | None, typer.Option(help="File in DIR, .mp4 (extra film) or .gif; default film.*.")
    ] = None,
    pvd: Annotated[
        bool, typer.Option("--pvd", help="Write film.pvd and its surfaces for ParaView instead.")
    ] = False,
    seconds: Annotated[float, typer.Option(min=0.5, max=60.0, help="How long the film is.")] = 8.0,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: JsonFiles = False,
) -> None:
    """The impact of a run folder as a film (MP4, GIF, ParaView)."""
    from workflows.run.api import film as draw

    with StageProgress("film", quiet=quiet) as progress:
        files = draw(
            folder, out=out, pvd=pvd, seconds=seconds, overwrite=overwrite, progress=progress.stage
        )
    print_files(files, json, quiet)


def doctor(
    json: json_of("{installed, missing: [{name, costs, remedy}], cache, ...}") = False,
) -> None:
    """What is installed, what is missing, what that costs."""
    from workflows.installation.doctor import doctor as examine

    print_report(examine(), json)


COMMANDS = {
    "run": run, "scenes": scenes, "scene": scene, "look": look, "modes": modes, "tune": tune_joints,
    "hammer": hammer, "reduce": reduce, "impact": impact, "accuracy": accuracy,
    "stability": stability, "verify": verify, "study": run_study, "calibrate": calibrate,
    "twin": twin, "inspect": inspect, "design": design, "sweep": sweep, "scan": scan,
    "report": report, "film": film, "doctor": doctor,
}  # fmt: skip


def _without_end_of_file(command: Callable) -> Callable:
    """The command; typer would take an EOFError of any library for Ctrl-D and call it an abort."""

    @wraps(command)
    def run(*arguments, **options):
        try:
            return command(*arguments, **options)
        except EOFError as error:
            raise ValueError(f"a file ends before its content does ({error}); mend it.") from error

    return run


for name, command in COMMANDS.items():
    examples = "\b\nExamples:\n" + "\n".join(
        f"  beadwave {line}" for line in EXAMPLES.get(name, ())
    )
    app.command(name=name, epilog=examples)(_without_end_of_file(command))


def main() -> None:
    """Run the command; every failure is one sentence on stderr."""
    # factors of sparse matrices call BLAS on small blocks, where its threads cost three times more
    environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # the cache of joblib is used, its processes are not: no probe of shared memory, no warning
    environ.setdefault("JOBLIB_MULTIPROCESSING", "0")
    # no child, and none of its children, imports anything from the working directory
    environ.setdefault("PYTHONSAFEPATH", "1")
    sys.exit(_status(app))


def _require_values(words: list[str]) -> None:
    """Raise InvalidScene for an empty word: a shell's variable that is not set; a folder of no name
    would be this one."""
    for previous, word in pairwise(["beadwave", *words]):
        if not word or fullmatch("--[a-z-]+=", word):
            from workflows.scene import InvalidScene

            raise InvalidScene(
                f"the word after {word or previous} is empty; fill it or leave it out."
            )


def _status(command: Callable) -> int:
    """Exit status of the command; a failure is one sentence on stderr."""
    try:
        _require_values(sys.argv[1:])
        status = command(standalone_mode=False) or 0  # typer turns Ctrl-C into a silent 130
    except (KeyboardInterrupt, typer.Abort):
        status = INTERRUPTED
    except BrokenPipeError:
        return 1
    except Exception as error:
        if number := stopped_by(error):
            raise Stopped(number) from error
        status, sentence = _failure(error)
        print(f"beadwave: {sentence}", file=sys.stderr)
        return status

    if status == INTERRUPTED:
        sentence = "interrupted; finished stages are kept, the same command goes on."
        print(f"beadwave: {sentence}", file=sys.stderr)
    return status


def _failure(error: Exception) -> tuple[int, str]:
    """Exit status and sentence of a command that failed; raises the error again for
    BEADWAVE_DEBUG, unless it is bad input."""
    # a usage error, with what was probably meant; typer keeps its own copy of click, so it is
    # recognised by what it can do
    if hasattr(error, "format_message"):
        message = (error.format_message() or "say which command").rstrip(".?!)")
        word = message.split("'")[1] if message.startswith("No such command") else None
        if word and "Did you mean" not in message:
            from workflows.scene import nearest

            return 2, f"{message}; {nearest(word, COMMANDS)}."
        bracket = ")" if message.count("(") > message.count(")") else ""
        return 2, f"{message}{bracket}."

    # bad input
    from workflows.scene import InvalidScene

    if isinstance(error, InvalidScene):
        return 2, str(error)
    if environ.get("BEADWAVE_DEBUG"):
        raise error

    # what the machine refuses; a name that is too long is the user's
    errno = error.errno if isinstance(error, OSError) else None
    status = 2 if errno == ENAMETOOLONG else 1
    if errno in (ENOSPC, EDQUOT, EFBIG):
        remedy = "make room, finished stages are kept, the same command goes on."
        return status, f"{error.strerror}; {remedy}"
    if isinstance(error, MemoryError):
        remedy = "take a coarser mesh, less time or data."
        return status, f"this machine has too little memory for it; {remedy}"
    if isinstance(error, OSError) and error.filename and error.strerror:
        name = f"{error.filename}"
        name = name if len(name) <= LONGEST else f"{name[:LONGEST]}..."
        return status, f"{name}: {error.strerror}; choose another place or mend it."

    # what a computation refuses says why itself; anything else is a defect of the program
    if isinstance(error, ValueError):
        return status, f"{error}"
    first_line = (str(error).splitlines() or [""])[0]
    return status, f"{type(error).__name__}: {first_line} (BEADWAVE_DEBUG=1 shows where)"
