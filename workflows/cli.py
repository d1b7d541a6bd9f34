"""The `beadwave` command.

Exit status 0 = done, 1 = the computation failed and says why, 2 = bad input; 130 = interrupted.
Solvers and plotting are imported by the stage that runs them, so that a command pays only for
what its scene holds.
"""

import sys
from errno import EDQUOT, EFBIG, ENOSPC
from json import dumps
from os import environ
from pathlib import Path
from typing import Annotated

import typer

from workflows.assembly_commands import hammer, modes, reduce, tune_joints
from workflows.calibration_commands import calibrate, twin
from workflows.options import Changes, Json, SceneName
from workflows.progress import StageProgress, printed
from workflows.scene import InvalidScene
from workflows.scene_file import built_in, scene_text
from workflows.scene_file import scene as load
from workflows.study_commands import accuracy, run_study, stability

INTERRUPTED = 130

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
    json: Json = False,
) -> None:
    """Run every stage that the scene needs and fill a run folder."""
    chosen = load(scene, tuple(changes or ()))
    from workflows.run import run as run_stages  # a scene that is refused loads no solver

    folder = out or Path("runs") / chosen.name
    with StageProgress(sys.stderr) as progress:
        summary = run_stages(chosen, folder, source=_file(scene), watch=progress.stage)
    printed(summary, json)
    if not json:
        typer.echo(f"written: {folder}/report.html")


def impact(
    scene: SceneName = None,
    rom: Annotated[
        Path | None,
        typer.Option(help="A reduced model (.npz, .mat, .h5) as the wall."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Run folder to write.")] = None,
    changes: Changes = None,
    json: Json = False,
) -> None:
    """The coupled run alone."""
    wall = (f'wall={{kind = "rom", file = {dumps(str(rom.absolute()))}}}',) if rom else ()
    chosen = load(scene, (*wall, *(changes or ())))
    from workflows.run import impact as run_impact

    with StageProgress(sys.stderr) as progress:
        summary = run_impact(chosen, out, source=_file(scene), watch=progress.stage)
    printed(summary, json)


def scenes() -> None:
    """Built-in scenes, a line each."""
    for name, text in built_in().items():
        typer.echo(f"{name:16}{text.splitlines()[0].removeprefix('# ')}")


def scene(name: Annotated[str, typer.Argument(help="A built-in scene.")]) -> None:
    """Print a scene as commented TOML."""
    typer.echo(scene_text(name).text, nl=False)


def report(folder: Annotated[Path, typer.Argument(metavar="DIR", help="A run folder.")]) -> None:
    """Write report.html of a run folder."""
    from workflows.report import write_report

    typer.echo(f"written: {write_report(folder)}")


COMMANDS = {
    "run": run, "scenes": scenes, "scene": scene, "modes": modes, "tune": tune_joints,
    "hammer": hammer, "reduce": reduce, "impact": impact, "accuracy": accuracy,
    "stability": stability, "study": run_study, "calibrate": calibrate, "twin": twin,
    "report": report,
}  # fmt: skip
for name, command in COMMANDS.items():
    app.command(name=name)(command)


def _file(scene: str | None) -> Path | None:
    return Path(scene) if scene and scene not in built_in() else None


def main() -> None:
    """Run the command; every failure is one sentence on stderr."""
    # factors of sparse matrices call BLAS on small blocks, where its threads cost three times more
    environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # the cache of joblib is used, its processes are not: no probe of shared memory, no warning
    environ.setdefault("JOBLIB_MULTIPROCESSING", "0")
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
        # typer keeps its own copy of click, so a usage error is told by what it can do
        if hasattr(error, "format_message"):
            return _failed(2, error.format_message() or "say which command.")
        if environ.get("BEADWAVE_DEBUG"):
            raise
        return _failed(1, _sentence(error))

    if status == INTERRUPTED:
        return _failed(130, "interrupted; finished stages are kept, the same command goes on.")
    return status


def _sentence(error: Exception) -> str:
    if isinstance(error, OSError) and error.errno in (ENOSPC, EDQUOT, EFBIG):
        return f"{error.strerror}; make room, finished stages are kept, the same command goes on."
    if isinstance(error, OSError) and error.filename and error.strerror:
        return f"{error.filename}: {error.strerror}; choose another place or mend it."
    return f"{error}" if isinstance(error, ValueError) else _unexpected(error)


def _unexpected(error: Exception) -> str:
    first = (str(error).splitlines() or [""])[0]
    return f"{type(error).__name__}: {first} (BEADWAVE_DEBUG=1 shows where)"


def _failed(status: int, sentence: str) -> int:
    print(f"beadwave: {sentence}", file=sys.stderr)
    return status
