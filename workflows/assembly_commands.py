"""`beadwave modes`, `hammer`, `tune` and `reduce`: what a scene's assembly is asked for."""

import sys
from pathlib import Path
from re import sub
from typing import Annotated

import typer

from workflows.options import Changes, Json, SceneName
from workflows.progress import StageProgress
from workflows.scene import InvalidScene
from workflows.scene_file import scene as load


def modes(
    scene: SceneName = None,
    table: Annotated[
        str | None,
        typer.Option(help="Rebuild a table of the thesis beside its numbers: 5.2 or 5.3."),
    ] = None,
    inp: Annotated[
        Path | None,
        typer.Option(help="Write the model for CalculiX or Abaqus (.inp)."),
    ] = None,
    step: Annotated[
        Path | None,
        typer.Option(help="Write the geometry (.step)."),
    ] = None,
    out: Annotated[
        Path | None,
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
    if (inp or step) and (table or out):
        raise InvalidScene("--inp and --step write the model alone; drop --table and --out.")
    chosen = _with_assembly(load(scene, tuple(changes or ())))
    with StageProgress(sys.stderr) as progress:
        if inp or step:
            write_model(pipeline_of(chosen, progress.stage), inp, step)
            if not json:
                typer.echo(f"written: {', '.join(str(path) for path in (inp, step) if path)}")
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


def hammer(
    file: Annotated[Path, typer.Argument(help="Frequency responses, .csv or .uff.")],
    scene: Annotated[
        str | None,
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


def tune_joints(
    scene: SceneName = None,
    hammer_file: Annotated[
        Path | None,
        typer.Option("--hammer", help="A hammer test (.csv, .uff) to take frequencies from."),
    ] = None,
    match: Annotated[
        str | None,
        typer.Option(help="Modes to meet, as 1,3,4 or 1=51.2,3=905 [Hz]; default all four."),
    ] = None,
    free: Annotated[
        str | None,
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


def _with_assembly(scene):
    if scene.assembly is None:
        raise InvalidScene(f"the scene {scene.name} has no [assembly]; add one, or take rig-rom.")
    return scene
