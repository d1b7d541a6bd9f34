"""`beadwave modes`, `hammer`, `tune` and `reduce`: what a scene's assembly is asked for."""

import sys
from os.path import isfile
from pathlib import Path
from re import sub
from typing import Annotated

import typer

from workflows.commands.options import Changes, JsonFiles, Overwrite, SceneName, json_of
from workflows.commands.terminal import StageProgress, told, written
from workflows.files.run_folder import RunFolder, checked_file, write_pictures
from workflows.files.scene import files_read
from workflows.files.scene import scene as load
from workflows.scene import InvalidScene
from workflows.scene.parts import with_assembly, with_targets
from workflows.scene.scene import LONGEST_NAME


def modes(
    scene: SceneName = None,
    table: Annotated[
        str | None,
        typer.Option(help="Rebuild a table of the thesis beside its numbers: 5.2 or 5.3."),
    ] = None,
    inp: Annotated[
        Path | None, typer.Option(help="Write the model for CalculiX or Abaqus (.inp).")
    ] = None,
    step: Annotated[Path | None, typer.Option(help="Write the geometry (.step).")] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for the MAC matrix, or with --table 5.2 for figure 5.7."),
    ] = None,
    changes: Changes = None,
    overwrite: Overwrite = False,
    json: json_of("{rows: [a mode or model each]}; of --inp and --step {written}") = False,
) -> None:
    """Frequencies beside the measured ones, MAC and participation at the contact."""
    from workflows.assembly.export import write_model
    from workflows.assembly.mode_table import mac_picture, mode_table
    from workflows.assembly.thesis_tables import effects, table_52, table_53
    from workflows.pipeline.pipeline import pipeline_of

    tables = {"5.2": table_52, "5.3": table_53}
    if table is not None and table not in tables:
        raise InvalidScene(f"--table {table} is not known; known are 5.2 and 5.3.")
    if (inp or step) and (table or out):
        raise InvalidScene("--inp and --step write the model alone; drop --table and --out.")
    chosen = with_assembly(load(scene, tuple(changes or ())))
    inputs = files_read(chosen, scene)
    for option, path in (("--inp", inp), ("--step", step)):
        if path:
            checked_file(path, option, inputs=inputs)
    folder = RunFolder(out, inputs=inputs, overwrite=overwrite) if out else None
    if folder:
        folder.require("figures/component_effects.png" if table else "figures/mac.png")
    with StageProgress(sys.stderr) as progress:
        if inp or step:
            write_model(pipeline_of(chosen, progress.stage), inp, step)
            written([path for path in (inp, step) if path], json)
            return
        if table:
            found = tables[table](chosen, progress.stage)
            pictures = (effects(found),) if out and table == "5.2" else ()
        else:
            pipeline = pipeline_of(chosen, progress.stage)
            found = mode_table(pipeline)
            pictures = (mac_picture(pipeline),) if out else ()
    if folder:
        write_pictures(folder, pictures)
    typer.echo(found.model_dump_json(indent=2) if json else found.text())


def look(
    source: Annotated[
        str, typer.Argument(metavar="FILE.step|SCENE", help="A STEP file, or a scene of bodies.")
    ],
    starter: Annotated[
        Path | None, typer.Option("--scene", help="Write a scene of the file to start from.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for the picture with the names.")] = None,
    changes: Changes = None,
    overwrite: Overwrite = False,
    json: json_of("{bodies, touching, holes, dofs, memory_bytes, remarks}") = False,
) -> None:
    """Bodies, masses, touching pairs, holes and the size of the mesh, before anything is said."""
    from workflows.assembly import look as looking

    is_file = Path(source).suffix.lower() in looking.ENDINGS
    chosen = looking.of_file(Path(source)) if is_file else load(source, tuple(changes or ()))
    if starter and not is_file:
        raise InvalidScene(f"--scene starts a scene of a STEP file; {source} is a scene already.")
    if starter:
        checked_file(starter, "--scene", inputs=(Path(source),))
    folder = RunFolder(out, inputs=(Path(source),), overwrite=overwrite) if out else None
    if folder:
        folder.require("figures/assembly.png")
    with StageProgress(sys.stderr) as progress, progress.stage("look"):
        seen = looking.look(with_assembly(chosen), source)
        pictures = (looking.picture(seen),) if folder else ()
    if folder:
        write_pictures(folder, pictures)
    if starter:
        looking.write_starter(starter, seen, Path(source))
    typer.echo(seen.look.model_dump_json(indent=2) if json else seen.look.text())


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
    json: json_of("{file, title, rows: [a resonance each]}; of --synthetic {written}") = False,
) -> None:
    """Read a hammer test: frequencies and damping by two methods."""
    from workflows.assembly.hammer import hammer_test, virtual_test
    from workflows.files.hammer import checked_synthetic, write_synthetic

    chosen = with_assembly(load(scene, tuple(changes or ())))
    if synthetic:
        checked_synthetic(file)
        from workflows.pipeline.pipeline import pipeline_of

        with StageProgress(sys.stderr) as progress:
            write_synthetic(file, virtual_test(pipeline_of(chosen, progress.stage)))
        told({"written": [str(file)]}, f"written: {file} (synthetic, not measured)", json)
        return
    report = hammer_test(file, dict(enumerate(with_targets(chosen).measured_hz, start=1)))
    typer.echo(report.model_dump_json(indent=2) if json else report.text())


def tune_joints(
    scene: SceneName = None,
    hammer_file: Annotated[
        Path | None,
        typer.Option("--hammer", help="A hammer test (.csv, .uff) to take frequencies from."),
    ] = None,
    match: Annotated[
        str | None,
        typer.Option(help="Modes to meet, as 1,3,4 or 1=51.2,3=905 [Hz]; default all."),
    ] = None,
    free: Annotated[
        str | None,
        typer.Option(help="What to vary: joints.NAME.kz,materials.NAME.young; of the rig head.ky."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="The tuned scene; default NAME-tuned.toml.")
    ] = None,
    changes: Changes = None,
    json: json_of("{match, modes_hz, full_order_hz, stiffness, mac, remarks, ...}") = False,
) -> None:
    """Fit joint stiffnesses to chosen modes and write a scene."""
    from workflows.assembly.tuning import targets, tuned, write_scene

    chosen = with_assembly(load(scene, tuple(changes or ())))
    names = tuple(free.split(",")) if free is not None else ()
    measured_hz = with_targets(chosen).measured_hz
    every = ",".join(map(str, range(1, len(measured_hz) + 1)))
    wanted = targets(every if match is None else match, measured_hz)
    if hammer_file:
        from workflows.assembly.hammer import applied, hammer_test

        chosen, wanted = applied(chosen, hammer_test(hammer_file, wanted), match)
    path = out or Path(f"{chosen.name}-tuned.toml")
    read = (*files_read(chosen, scene), *((hammer_file,) if hammer_file else ()))
    checked_file(path, inputs=read)
    if not out:
        _require_tuned(path)
    with StageProgress(sys.stderr) as progress:
        result, report = tuned(chosen, wanted, names, progress.stage)
    typer.echo(report.model_dump_json(indent=2) if json else report.text())
    for sentence in report.failures:
        raise ValueError(f"no scene is written: {sentence}")
    name = sub(r"[^\w.-]", "-", path.stem).lstrip(".-")[:LONGEST_NAME] or "tuned"
    write_scene(result.model_copy(update={"name": name}), path, report)
    if not json:
        typer.echo(f"written: {path}")


def _require_tuned(path: Path) -> None:
    """Raise InvalidScene where another file than a tuned scene bears the name nobody chose."""
    if isfile(path) and not path.read_bytes().startswith(b"# Joints inferred"):
        raise InvalidScene(f"{path} is there and no tuned scene; name another by --out.")


def reduce(
    out: Annotated[Path, typer.Option(help="rom.npz, .mat or .h5.")],
    scene: SceneName = None,
    matrices: Annotated[
        Path | None, typer.Option(help="Write the full model's K, M, w beside it (.mat, .npz).")
    ] = None,
    changes: Changes = None,
    json: JsonFiles = False,
) -> None:
    """Write the reduced model: M, K, C, w, and the outer nodes' T."""
    from workflows.assembly.export import write_reduced
    from workflows.pipeline.pipeline import pipeline_of

    chosen = with_assembly(load(scene, tuple(changes or ())))
    for option, path in (("--out", out), ("--matrices", matrices)):
        if path:
            checked_file(path, option, inputs=files_read(chosen, scene))
    with StageProgress(sys.stderr) as progress:
        write_reduced(pipeline_of(chosen, progress.stage), out, matrices)
    written([path for path in (out, matrices) if path], json)
