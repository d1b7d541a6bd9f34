"""The `beadwave` command.

Exit status 0 = done, 1 = the computation failed and says why, 2 = bad input; 130 = interrupted.
What computes is imported by the command that runs, so that each pays only for what it needs.
"""

import gc
import logging
import sys
import warnings
from collections.abc import Callable
from errno import EDQUOT, EFBIG, ENAMETOOLONG, ENOSPC
from functools import partial, wraps
from itertools import pairwise
from os import environ
from pathlib import Path
from re import fullmatch
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from beadwave.system import too_long
from beadwave.workflows.commands.assembly import hammer, look, modes, reduce, tune_joints
from beadwave.workflows.commands.examples import EXAMPLES
from beadwave.workflows.commands.fits import calibrate, design, inspect
from beadwave.workflows.commands.interrupts import Stopped, stopped_by
from beadwave.workflows.commands.options import (
    JsonFiles,
    Overwrite,
    Quiet,
    Verbose,
    json_of,
    scene_names,
)
from beadwave.workflows.commands.studies import accuracy, stability, verify
from beadwave.workflows.commands.sweeps import scan, sweep
from beadwave.workflows.commands.terminal import (
    SummaryPrinter,
    folded,
    print_files,
    print_lines,
    print_notes,
    print_report,
    print_result,
)
from beadwave.workflows.commands.verb import Call, Verb, Word, verb

if TYPE_CHECKING:
    from beadwave.workflows.run.api import Run

INTERRUPTED = 130
LONGEST = 200  # characters of a path in a sentence


class Commands(TyperGroup):
    """Commands that are built when they are called."""

    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[str | None, Any, list[str]]:
        """Name, command and arguments of a line."""
        name, command, arguments = super().resolve_command(ctx, args)
        return name, built(name) if name else command, arguments


app = typer.Typer(
    name="beadwave",
    cls=Commands,
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


@verb("beadwave.workflows.run.api.run", json="summary.json")
def run(call: Call, verbose: Verbose = False) -> None:
    """Run every stage that the scene needs and fill a run folder."""
    result = _printed(call, verbose)
    print_lines(f"written: {result.folder}/report.html", json=call.json, quiet=call.quiet)


@verb("beadwave.workflows.run.api.impact", json="summary.json")
def impact(call: Call, verbose: Verbose = False) -> None:
    """The coupled run alone, without pictures and report."""
    _printed(call, verbose)
    if out := call.given.get("out"):
        print_lines(f"written: {out}/trajectory.npz", json=call.json, quiet=call.quiet)


def _printed(call: Call, verbose: bool) -> "Run":
    """A run whose waves are printed as soon as they are known, then the rest of its summary."""
    printer = SummaryPrinter(json=call.json, quiet=call.quiet, verbose=verbose)
    result = call(waves_known=printer.waves)
    printer.whole(result.summary)
    print_notes(result.notes)
    return result


def scenes(json: json_of("{scenes: [{name, shows}]}") = False) -> None:
    """Built-in scenes, a line each."""
    from beadwave.workflows.run.api import scenes as built_in

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
    from beadwave.workflows.files.scene import checked_text, tables

    if key is not None:
        from beadwave.workflows.scene.reference import entries_of

        entries = entries_of(key)
        text = "\n\n".join(entry.text() for entry in entries)
        print_result({"keys": [entry._asdict() for entry in entries]}, text, json)
    elif name is None:
        from beadwave.workflows.scene import InvalidScene

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
    from beadwave.workflows.files.run_folder import RunFolder
    from beadwave.workflows.report.report import require_summary, write_report

    require_summary(folder)
    with RunFolder(folder, overwrite=overwrite).held("report.html") as locked:
        page = write_report(locked)
    print_files([page], json, quiet)


@verb("beadwave.workflows.run.api.film", json="{written: [files]}", folder=Word(metavar="DIR"))
def film(call: Call) -> None:
    """The impact of a run folder as a film (MP4, GIF, ParaView)."""
    print_files(call(), call.json, call.quiet)


@verb(
    "beadwave.workflows.installation.doctor.doctor",
    json="{installed, missing: [{name, costs, remedy}], cache, ...}",
)
def doctor(call: Call) -> None:
    """Installed and missing packages, and what the missing ones cost."""
    print_report(call(), call.json, call.quiet)


COMMANDS = {
    "run": run, "scenes": scenes, "scene": scene, "look": look, "modes": modes, "tune": tune_joints,
    "hammer": hammer, "reduce": reduce, "impact": impact, "accuracy": accuracy,
    "stability": stability, "verify": verify, "calibrate": calibrate, "inspect": inspect,
    "design": design, "sweep": sweep, "scan": scan, "report": report, "film": film,
    "doctor": doctor,
}  # fmt: skip
# commands of earlier versions, and what to use instead
REMOVED = {
    "twin": "python examples/twin.py of the sources makes synthetic records and fits them",
    "study": "the scripts in examples/gallery of the sources compute the figures of the thesis",
}


def _without_end_of_file(command: Callable) -> Callable:
    """The command; typer would take an EOFError of any library for Ctrl-D and call it an abort."""

    @wraps(command)
    def run(*arguments, **options):
        try:
            return command(*arguments, **options)
        except EOFError as error:
            raise ValueError(f"a file ends before its content does ({error}); mend it.") from error

    return run


def built(name: str) -> Any:
    """The command of that name with its arguments; imports what they are read from."""
    command = COMMANDS[name]
    examples = "\n".join(f"  beadwave {line}" for line in EXAMPLES.get(name, ()))
    alone = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
    alone.command(name=name, epilog=f"\b\nExamples:\n{examples}")(
        _without_end_of_file(command.signed(name) if isinstance(command, Verb) else command)
    )
    command = typer.main.get_command(alone)
    for parameter in command.params:
        if label := getattr(parameter, "display_type", None):  # of typer before 0.26 none
            parameter.display_type = partial(_in_words, label)
    return command


def _in_words(label: Callable[[Any], str], context: Any) -> str:
    """Type of a value in the help, in plain words in place of typer's."""
    words = {"str": "text", "float": "number", "int": "integer", "Path": "path"}
    inner = label(context).strip("<>").removeprefix("list[").removesuffix("]")
    return f"<{words.get(inner.removesuffix(' range'), inner)}>"


for name, command in COMMANDS.items():
    # for the list of commands; what it does comes when it is called
    app.command(name=name, help=command.__doc__)(lambda: None)


def main() -> None:
    """Run the command; every failure is one sentence on stderr."""
    # factors of sparse matrices call BLAS on small blocks, where its threads cost three times more
    environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # the cache of joblib is used, its processes are not: no probe of shared memory, no warning
    environ.setdefault("JOBLIB_MULTIPROCESSING", "0")
    # no child, and none of its children, imports anything from the working directory
    environ.setdefault("PYTHONSAFEPATH", "1")
    # what libraries have to say of deprecations, fonts and digits is not for a user's terminal
    if not (sys.warnoptions or environ.get("BEADWAVE_DEBUG")):
        warnings.simplefilter("ignore")
        logging.getLogger().addHandler(logging.NullHandler())
    # a terminal without ± and µ shows ? in their place
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            stream.reconfigure(errors="replace")
    status = _status(app)
    # else the interpreter's last collections walk through all that libraries hold: 0.3 s of a run
    gc.freeze()
    sys.exit(status)


def _require_values(words: list[str]) -> None:
    """Raise InvalidScene for an empty word: a shell's variable that is not set; a folder of no name
    would be this one."""
    for previous, word in pairwise(["beadwave", *words]):
        if not word or fullmatch("--[a-z-]+=", word):
            from beadwave.workflows.scene import InvalidScene

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
        print(folded(f"beadwave: {sentence}", sys.stderr), file=sys.stderr)
        return status

    if status == INTERRUPTED:
        sentence = "interrupted; finished stages are kept, the same command goes on."
        print(folded(f"beadwave: {sentence}", sys.stderr), file=sys.stderr)
    return status


def _failure(error: Exception) -> tuple[int, str]:
    """Exit status and sentence of a command that failed; raises the error again for
    BEADWAVE_DEBUG, unless it is bad input."""
    # a usage error, with what was probably meant; typer keeps its own copy of click, so it is
    # recognised by what it can do
    if hasattr(error, "format_message"):
        if type(error).__name__ == "NoArgsIsHelpError":
            return 2, "a command is missing; `beadwave -h` lists them."
        message = (error.format_message() or "say which command").rstrip(".?!)")
        word = message.split("'")[1] if message.startswith("No such command") else None
        if word in REMOVED:
            return 2, f"{word} is no command any more: {REMOVED[word]}."
        if word and "Did you mean" not in message:
            from beadwave.workflows.scene import nearest

            return 2, f"{message}; {nearest(word, COMMANDS)}."
        bracket = ")" if message.count("(") > message.count(")") else ""
        return 2, f"{message}{bracket}{'?' if 'Did you mean' in message else '.'}"

    # bad input
    from beadwave.workflows.scene import InvalidScene

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
        if too_long(f"{error.filename}"):
            return 2, f"{name}: the path has over 259 letters; choose a folder of a shorter path."
        return status, f"{name}: {error.strerror}; choose another place or mend it."

    # what a computation refuses says why itself; anything else is a defect of the program
    if isinstance(error, ValueError):
        return status, f"{error}"
    first_line = (str(error).splitlines() or [""])[0]
    return status, f"{type(error).__name__}: {first_line} (BEADWAVE_DEBUG=1 shows where)"
