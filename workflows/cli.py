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
from re import sub
from typing import Annotated, Optional

import typer

from workflows.calibration_commands import calibrate, twin
from workflows.progress import StageProgress, printed
from workflows.scene import InvalidScene
from workflows.scene_file import built_in, scene_text
from workflows.scene_file import scene as load

INTERRUPTED = 130

app = typer.Typer(
    name="beadwave",
    help="A chain of steel spheres hits a bolted steel assembly: from geometry to impact.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

SceneName = Annotated[
    Optional[str],  # noqa: UP045  typer reads the annotation
    typer.Argument(metavar="[SCENE]", help="A built-in scene or a TOML file; default: rig-rom."),
]
Changes = Annotated[
    Optional[list[str]],  # noqa: UP045
    typer.Option("--set", metavar="KEY=VALUE", help="Change a value of the scene, dotted key."),
]
Json = Annotated[bool, typer.Option("--json", help="Print the result for machines.")]


@app.command()
def run(
    scene: SceneName = None,
    out: Annotated[Optional[Path], typer.Option(help="Run folder; default runs/NAME.")] = None,  # noqa: UP045
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


@app.command()
def impact(
    scene: SceneName = None,
    rom: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(help="A reduced model (.npz, .mat, .h5) as the wall."),
    ] = None,
    out: Annotated[Optional[Path], typer.Option(help="Run folder to write.")] = None,  # noqa: UP045
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


@app.command()
def scenes() -> None:
    """Built-in scenes, a line each."""
    for name, text in built_in().items():
        typer.echo(f"{name:16}{text.splitlines()[0].removeprefix('# ')}")


@app.command()
def scene(name: Annotated[str, typer.Argument(help="A built-in scene.")]) -> None:
    """Print a scene as commented TOML."""
    typer.echo(scene_text(name).text, nl=False)


@app.command()
def modes(
    scene: SceneName = None,
    table: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(help="Rebuild a table of the thesis beside its numbers: 5.2 or 5.3."),
    ] = None,
    inp: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(help="Write the model for CalculiX or Abaqus (.inp)."),
    ] = None,
    step: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(help="Write the geometry (.step)."),
    ] = None,
    out: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(help="Folder for the MAC matrix, or with --table 5.2 for figure 5.7."),
    ] = None,
    changes: Changes = None,
    json: Json = False,
) -> None:
    """Frequencies beside the hammer test, MAC and participation at the contact."""
    from workflows.assembly_report import mac_picture, mode_table, write_model
    from workflows.run_folder import write_pictures_to
    from workflows.stages import pipeline_of
    from workflows.thesis_tables import effects, table_52, table_53

    tables = {"5.2": table_52, "5.3": table_53}
    if table is not None and table not in tables:
        raise InvalidScene(f"--table {table} is not known; known are 5.2 and 5.3.")
    chosen = _with_assembly(load(scene, tuple(changes or ())))
    with StageProgress(sys.stderr) as progress:
        if inp or step:
            write_model(pipeline_of(chosen, progress.stage), inp, step)
            return
        if table:
            found = tables[table](chosen, progress.stage)
            pictures = (effects(found),) if out and table == "5.2" else ()
        else:
            pipeline = pipeline_of(chosen, progress.stage)
            found = mode_table(pipeline)
            pictures = (mac_picture(pipeline),) if out else ()
    if out:
        write_pictures_to(out, pictures)
    typer.echo(found.model_dump_json(indent=2) if json else found.text())


@app.command()
def hammer(
    file: Annotated[Path, typer.Argument(help="Frequency responses, .csv or .uff.")],
    scene: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(help="The scene whose modes they are paired with; default: rig-rom."),
    ] = None,
    synthetic: Annotated[
        bool, typer.Option("--synthetic", help="Write a computed test to FILE (.uff) instead.")
    ] = False,
    changes: Changes = None,
    json: Json = False,
) -> None:
    """Read a hammer test: frequencies and damping by two methods."""
    from workflows.hammer import hammer_test, virtual_test
    from workflows.hammer_file import write_synthetic
    from workflows.summary import HAMMER_TEST_HZ

    if synthetic:
        chosen = _with_assembly(load(scene, tuple(changes or ())))
        from workflows.stages import pipeline_of

        with StageProgress(sys.stderr) as progress:
            write_synthetic(file, virtual_test(pipeline_of(chosen, progress.stage)))
        typer.echo(f"written: {file} (synthetic, not measured)")
        return
    report = hammer_test(file, dict(enumerate(HAMMER_TEST_HZ, start=1)))
    typer.echo(report.model_dump_json(indent=2) if json else report.text())


@app.command(name="tune")
def tune_joints(
    scene: SceneName = None,
    hammer_file: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option("--hammer", help="A hammer test (.csv, .uff) to take frequencies from."),
    ] = None,
    match: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(help="Modes to meet, as 1,3,4 or 1=51.2,3=905 [Hz]; default all four."),
    ] = None,
    free: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(help="What to vary, as head.ky,head.kt,block.young; default by the modes."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="The tuned scene; default NAME-tuned.toml.")
    ] = None,
    changes: Changes = None,
    json: Json = False,
) -> None:
    """Fit joint stiffnesses to chosen modes and write a scene."""
    from workflows.run_folder import checked_file
    from workflows.tuning import targets, tuned, write_scene

    chosen = _with_assembly(load(scene, tuple(changes or ())))
    names = tuple(free.split(",")) if free else ()
    wanted = targets(match or "1,2,3,4")
    if hammer_file:
        from workflows.hammer import applied, hammer_test

        chosen, wanted = applied(chosen, hammer_test(hammer_file, wanted), match)
    path = checked_file(out or Path(f"{chosen.name}-tuned.toml"))
    with StageProgress(sys.stderr) as progress:
        result, report = tuned(chosen, wanted, names, progress.stage)
    name = sub(r"[^\w.-]", "-", path.stem)
    write_scene(result.model_copy(update={"name": name}), path, report)
    typer.echo(report.model_dump_json(indent=2) if json else report.text())
    if not json:
        typer.echo(f"written: {path}")


@app.command()
def reduce(
    out: Annotated[Path, typer.Option(help="rom.npz, .mat or .h5.")],
    scene: SceneName = None,
    changes: Changes = None,
) -> None:
    """Write the reduced model: M, K, C, w."""
    from workflows.assembly_report import write_reduced
    from workflows.stages import pipeline_of

    chosen = _with_assembly(load(scene, tuple(changes or ())))
    with StageProgress(sys.stderr) as progress:
        write_reduced(pipeline_of(chosen, progress.stage), out)
    typer.echo(f"written: {out}")


@app.command()
def accuracy(
    scene: Annotated[
        Optional[str],  # noqa: UP045
        typer.Argument(metavar="[SCENE]", help="A scene; default: the one each study is made for."),
    ] = None,
    stage: Annotated[
        str,
        typer.Option(help="time, chain-length, wall-modes, batch, parts, reduction, or all."),
    ] = "all",
    out: Annotated[Optional[Path], typer.Option(help="Folder for table, CSV and plots.")] = None,  # noqa: UP045
    changes: Changes = None,
    json: Json = False,
) -> None:
    """Error against run time, beside general-purpose integrators measured in the same run."""
    from workflows import accuracy as studies

    with StageProgress(sys.stderr) as progress:
        study = studies.accuracy(
            stage, lambda usual: load(scene or usual, tuple(changes or ())), progress.stage
        )
    if out:
        studies.write(study, out)
    typer.echo(studies.json(study) if json else studies.text(study))


@app.command()
def stability(
    case: Annotated[
        Optional[list[str]],  # noqa: UP045
        typer.Option(help="Only this case; may be repeated."),
    ] = None,
    out: Annotated[Optional[Path], typer.Option(help="Folder for the table as CSV.")] = None,  # noqa: UP045
    json: Json = False,
) -> None:
    """Stiff and extreme cases, a verdict each."""
    from workflows import stability as cases

    with StageProgress(sys.stderr) as progress:
        rows = cases.stability(cases.chosen(case), progress.stage)
    if out:
        cases.write(rows, out)
    typer.echo(cases.json(rows) if json else cases.text(rows))


@app.command(name="study")
def run_study(
    name: Annotated[
        Optional[str],  # noqa: UP045
        typer.Argument(metavar="[NAME]", help="A study; without it they are listed."),
    ] = None,
    scene: SceneName = None,
    out: Annotated[Optional[Path], typer.Option(help="Folder for table, CSV and plots.")] = None,  # noqa: UP045
    changes: Changes = None,
    json: Json = False,
) -> None:
    """Figures of the thesis made again, each beside its cure."""
    from workflows import study
    from workflows.run_folder import checked_folder

    if name is None:
        typer.echo(study.listing())
        return
    folder = checked_folder(out or Path("studies"))
    with StageProgress(sys.stderr) as progress:
        found = study.study(name, load(scene, tuple(changes or ())), progress.stage)
    study.write(found, folder)
    typer.echo(study.json(found) if json else study.text(found))
    if not json:
        typer.echo(f"written: {folder}/figures/{found.pictures[0].name}.png")


@app.command()
def report(folder: Annotated[Path, typer.Argument(metavar="DIR", help="A run folder.")]) -> None:
    """Write report.html of a run folder."""
    from workflows.report import write_report

    typer.echo(f"written: {write_report(folder)}")


app.command()(calibrate)
app.command()(twin)


def _file(scene: str | None) -> Path | None:
    return Path(scene) if scene and scene not in built_in() else None


def _with_assembly(scene):
    if scene.assembly is None:
        raise InvalidScene(f"the scene {scene.name} has no [assembly]; add one, or take rig-rom.")
    return scene


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
            return _failed(2, error.format_message())
        if environ.get("BEADWAVE_DEBUG"):
            raise
        return _failed(1, _sentence(error))

    if status == INTERRUPTED:
        return _failed(130, "interrupted; finished stages are kept, the same command goes on.")
    return status


def _sentence(error: Exception) -> str:
    if isinstance(error, OSError) and error.errno in (ENOSPC, EDQUOT, EFBIG):
        return f"{error.strerror}; make room, finished stages are kept, the same command goes on."
    return f"{error}" if isinstance(error, ValueError) else _unexpected(error)


def _unexpected(error: Exception) -> str:
    first = (str(error).splitlines() or [""])[0]
    return f"{type(error).__name__}: {first} (BEADWAVE_DEBUG=1 shows where)"


def _failed(status: int, sentence: str) -> int:
    print(f"beadwave: {sentence}", file=sys.stderr)
    return status
