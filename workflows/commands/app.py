"""The `beadwave` command.

Exit status 0 = done, 1 = the computation failed and says why, 2 = bad input; 130 = interrupted.
Solvers and plotting are imported by the stage that runs them, so that a command pays only for
what its scene holds.
"""

import sys
from collections.abc import Callable
from errno import EDQUOT, EFBIG, ENAMETOOLONG, ENOSPC
from functools import wraps
from json import dumps
from os import environ
from pathlib import Path
from typing import Annotated

import typer

from workflows.commands.assembly import hammer, look, modes, reduce, tune_joints
from workflows.commands.calibration import calibrate, twin
from workflows.commands.options import Changes, Json, JsonFiles, Overwrite, SceneName, json_of
from workflows.commands.signals import Stopped, stopped_by
from workflows.commands.studies import accuracy, run_study, stability
from workflows.commands.terminal import StageProgress, printed, told, written
from workflows.files.run_folder import RunFolder, other_scene, own_folder
from workflows.files.scene import built_in, files_read, scene_text, tables
from workflows.files.scene import scene as load
from workflows.scene import InvalidScene, Scene
from workflows.scene.parts import with_chain
from workflows.scene.toml import toml

INTERRUPTED = 130
LONGEST = 200  # characters of a path in a sentence
RUNS = Path("runs")  # of runs without --out

app = typer.Typer(
    name="beadwave",
    help="A chain of steel spheres hits a bolted steel assembly: from geometry to impact.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


def run(
    scene: SceneName = None,
    out: Annotated[Path | None, typer.Option(help="Run folder; default runs/NAME.")] = None,
    changes: Changes = None,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Run every stage that the scene needs and fill a run folder."""
    chosen = load(scene, tuple(changes or ()))
    from workflows.pipeline.run import run as run_stages  # a scene that is refused loads no solver

    path = out or own_folder(RUNS, chosen.name, toml(chosen))
    folder = RunFolder(path, inputs=files_read(chosen, scene), overwrite=overwrite)
    note = _replaced(path, chosen) if out else _beside(path, chosen)
    with StageProgress(sys.stderr) as progress:
        summary = run_stages(chosen, folder, progress=progress.stage)
    printed(summary, json)
    typer.echo(note, nl=False, err=True)
    if not json:
        typer.echo(f"written: {path}/report.html")


def _replaced(path: Path, chosen: Scene) -> str:
    """What a run takes the place of, a line or nothing."""
    other = other_scene(path, toml(chosen))
    return f"replaced: the run of another scene, {other}, in {path}\n" if other else ""


def _beside(path: Path, chosen: Scene) -> str:
    """Why a run is not where its name says, a line or nothing."""
    usual = RUNS / chosen.name
    return f"{usual} is left as it is: it holds another scene\n" if path != usual else ""


def impact(
    scene: SceneName = None,
    rom: Annotated[
        Path | None, typer.Option(help="A reduced model (.npz, .mat, .h5) as the wall.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Run folder to write.")] = None,
    changes: Changes = None,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """The coupled run alone."""
    wall = (f'wall={{kind = "rom", file = {dumps(str(rom.absolute()))}}}',) if rom else ()
    chosen = with_chain(load(scene, (*wall, *(changes or ()))))
    from workflows.pipeline.run import impact as run_impact

    inputs = files_read(chosen, scene)
    folder = RunFolder(out, inputs=inputs, overwrite=overwrite) if out else None
    note = _replaced(out, chosen) if out else ""
    with StageProgress(sys.stderr) as progress:
        summary = run_impact(chosen, folder, progress=progress.stage)
    printed(summary, json)
    typer.echo(note, nl=False, err=True)


def scenes(json: json_of("{scenes: [{name, shows}]}") = False) -> None:
    """Built-in scenes, a line each."""
    shown = {name: text.splitlines()[0].removeprefix("# ") for name, text in built_in().items()}
    rows = [{"name": name, "shows": line} for name, line in shown.items()]
    lines = "\n".join(f"{name:16}{line}" for name, line in shown.items())
    told({"scenes": rows}, lines, json)


def scene(
    name: Annotated[str, typer.Argument(help="A built-in scene.")],
    json: json_of("its tables as written; inf and nan as text") = False,
) -> None:
    """Print a scene as commented TOML."""
    if json:
        told(tables(name), "", json)
    else:
        typer.echo(scene_text(name).text, nl=False)


def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A run folder.")],
    overwrite: Overwrite = False,
    json: JsonFiles = False,
) -> None:
    """Write report.html of a run folder."""
    from workflows.results.report import require_summary, write_report

    require_summary(folder)
    with RunFolder(folder, overwrite=overwrite).held("report.html") as held:
        page = write_report(held)
    written([page], json)


COMMANDS = {
    "run": run, "scenes": scenes, "scene": scene, "look": look, "modes": modes, "tune": tune_joints,
    "hammer": hammer, "reduce": reduce, "impact": impact, "accuracy": accuracy,
    "stability": stability, "study": run_study, "calibrate": calibrate, "twin": twin,
    "report": report,
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
    app.command(name=name)(_without_end_of_file(command))


def main() -> None:
    """Run the command; every failure is one sentence on stderr."""
    # factors of sparse matrices call BLAS on small blocks, where its threads cost three times more
    environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # the cache of joblib is used, its processes are not: no probe of shared memory, no warning
    environ.setdefault("JOBLIB_MULTIPROCESSING", "0")
    # no child, and none of its children, imports anything from the working directory
    environ.setdefault("PYTHONSAFEPATH", "1")
    sys.exit(_status(app))


def _status(command) -> int:
    try:
        status = command(standalone_mode=False) or 0  # typer turns Ctrl-C into a silent 130
    except (KeyboardInterrupt, typer.Abort):
        status = INTERRUPTED
    except InvalidScene as error:
        return _failed(2, str(error))
    except BrokenPipeError:
        return 1
    except Exception as error:
        if number := stopped_by(error):
            raise Stopped(number) from error
        # typer keeps its own copy of click, so a usage error is told by what it can do
        if hasattr(error, "format_message"):
            return _failed(2, (error.format_message() or "say which command").rstrip(".") + ".")
        if environ.get("BEADWAVE_DEBUG"):
            raise
        named_too_long = isinstance(error, OSError) and error.errno == ENAMETOOLONG
        return _failed(2 if named_too_long else 1, _sentence(error))

    if status == INTERRUPTED:
        return _failed(130, "interrupted; finished stages are kept, the same command goes on.")
    return status


def _sentence(error: Exception) -> str:
    if isinstance(error, OSError) and error.errno in (ENOSPC, EDQUOT, EFBIG):
        return f"{error.strerror}; make room, finished stages are kept, the same command goes on."
    if isinstance(error, MemoryError):
        return "this machine has too little memory for it; take a coarser mesh, less time or data."
    if isinstance(error, OSError) and error.filename and error.strerror:
        name = f"{error.filename}"
        shown = name if len(name) <= LONGEST else f"{name[:LONGEST]}..."
        return f"{shown}: {error.strerror}; choose another place or mend it."
    return f"{error}" if isinstance(error, ValueError) else _unexpected(error)


def _unexpected(error: Exception) -> str:
    first = (str(error).splitlines() or [""])[0]
    return f"{type(error).__name__}: {first} (BEADWAVE_DEBUG=1 shows where)"


def _failed(status: int, sentence: str) -> int:
    print(f"beadwave: {sentence}", file=sys.stderr)
    return status
