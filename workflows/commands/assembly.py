"""`beadwave modes`, `look`, `hammer`, `tune` and `reduce`: the commands on an assembly."""

from pathlib import Path
from typing import Annotated

import typer

from workflows.commands.options import (
    Changes,
    JsonFiles,
    Overwrite,
    Quiet,
    SceneName,
    json_of,
    scene_names,
)
from workflows.commands.terminal import (
    StageProgress,
    print_files,
    print_lines,
    print_report,
    print_result,
)


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
    quiet: Quiet = False,
    json: json_of("{rows: [a mode or model each]}; of --inp and --step {written}") = False,
) -> None:
    """Frequencies beside measured ones, MAC, participation."""
    from workflows.scene import InvalidScene
    from workflows.structure import api

    if (inp or step) and (table or out):
        raise InvalidScene("--inp and --step write the model alone; drop --table and --out.")
    with StageProgress(f"modes {scene} {table}", quiet=quiet) as progress:
        given = {"changes": changes or (), "overwrite": overwrite, "progress": progress.stage}
        if inp or step:
            print_files(api.export(scene, inp=inp, step=step, **given), json, quiet)
            return
        given |= {"out": out}
        result = api.thesis_table(table, scene, **given) if table else api.modes(scene, **given)
    print_report(result if table else result.table, json, quiet)


def look(
    source: Annotated[
        str,
        typer.Argument(metavar="FILE.step|SCENE", help="A STEP file, or a scene with an assembly."),
    ],
    starter: Annotated[
        Path | None, typer.Option("--scene", help="Write a scene of the file to start from.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for the picture with the names.")] = None,
    changes: Changes = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: json_of("{bodies, touching, holes, dofs, memory_bytes, seconds, remarks}") = False,
) -> None:
    """Bodies, masses, touching pairs, holes, size of the mesh."""
    from workflows.structure.api import look as look_at

    with StageProgress(f"look {source}", quiet=quiet) as progress:
        result = look_at(
            source, changes or (), starter=starter, out=out, overwrite=overwrite,
            progress=progress.stage,
        )  # fmt: skip
    print_report(result.found, json, quiet)


def span(text: str | None) -> tuple[float, float] | None:
    """The frequencies of "40:950"; raises ValueError for others."""
    if text is None:
        return None
    try:
        low, high = map(float, text.split(":"))
        if not 0 <= low < high < float("inf"):
            raise ValueError
    except ValueError:
        raise ValueError(f"--band {text} must be FROM:TO in Hz, as 40:950.") from None
    return low, high


def numbers(text: str | None, option: str) -> tuple[int, ...]:
    """The numbers of "3,7"; raises ValueError for others."""
    try:
        return tuple(int(part) for part in (text or "").split(",") if part.strip())
    except ValueError:
        raise ValueError(f"{option} {text} must be numbers of poles, as 3,7.") from None


def hammer(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...",
            help="Time records of hits: .csv with a header line time [s], force 12+z [N], "
            "response 3+x [m/s^2], ...; .uff (data set 58), .mat, .wav. Or frequency responses: "
            ".uff, .mat, or .csv with a header line, then frequency_hz, re_1, im_1, re_2, im_2, "
            "... on each line (Hz; receptance, mobility or accelerance in any unit).",
        ),
    ],
    scene: Annotated[
        str | None,
        typer.Option(
            help="The scene whose modes they are paired with; default: rig-rom.",
            autocompletion=scene_names,
        ),
    ] = None,
    synthetic: Annotated[
        bool,
        typer.Option(
            "--synthetic",
            help="Write a computed test to FILE instead: responses (.csv, .uff), or with --points "
            "records of hits there (.mat).",
        ),
    ] = False,
    design: Annotated[
        int | None,
        typer.Option(
            metavar="POINTS",
            help="Write to FILE (.csv) at which points to hit and watch for the modes in --band.",
        ),
    ] = None,
    points: Annotated[
        Path | None,
        typer.Option(help="Points of the nodes: .csv (node, x, y, z in metres) or .uff."),
    ] = None,
    band: Annotated[
        str | None, typer.Option(metavar="FROM:TO", help="Frequencies to identify in [Hz].")
    ] = None,
    estimator: Annotated[str, typer.Option(help="H1, H2 or Hv.")] = "H1",
    window: Annotated[
        float | None,
        typer.Option(help="What an exponential window leaves at a record's end, as 0.01."),
    ] = None,
    force_channel: Annotated[
        int, typer.Option(help="Channel of the force in .wav files; 0: ring-downs.")
    ] = 1,
    reject: Annotated[
        str | None, typer.Option(help="Poles to leave out by their numbers, as 3,7.")
    ] = None,
    accept: Annotated[
        str | None, typer.Option(help="Poles to take, though they were left out.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for modes.json, modes.uff, targets.toml and pictures: stability diagram, "
            "responses measured and of the modes, coherence, AutoMAC."
        ),
    ] = None,
    changes: Changes = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: json_of(
        "{file, title, rows: [a mode each], left_out, steps, remarks}; of --synthetic {written}, "
        "of --design {modes_hz, rows: [a point each], largest_mac, alike_hz}"
    ) = False,
) -> None:
    """Read a hammer test: modes from hits or responses, with deviations."""
    from workflows.structure import api

    with StageProgress(f"hammer {scene}", quiet=quiet) as progress:
        given = {"changes": changes or (), "progress": progress.stage, "overwrite": overwrite}
        if (synthetic or design) and len(files) > 1:
            raise ValueError("--synthetic and --design write one FILE; name one.")
        if design is not None:
            result = api.design_hammer_test(files[0], design, scene, band=span(band), **given)
            print_report(result, json, quiet)
            print_lines(f"written: {files[0]}", json=json, quiet=quiet)
            return
        if synthetic:
            path = api.write_hammer_test(files[0], scene, points=points, band=span(band), **given)
            line = f"written: {path} (synthetic, not measured)"
            print_result({"written": [str(path)]}, line, json, quiet)
            return
        from workflows.files.hammer import Reading
        from workflows.structure.hammer import Choice

        result = api.hammer(
            files, scene, reading=Reading(estimator, window, force_channel, points),
            choice=Choice(
                span(band), numbers(reject, "--reject"), numbers(accept, "--accept")
            ),
            out=out, **given,
        )  # fmt: skip
    print_report(result.report, json, quiet)
    if out:
        names = [
            name for name in ("modes.json", "modes.uff", "targets.toml") if (out / name).exists()
        ]
        print_lines(f"written: {out}/{', '.join([*names, 'figures'])}", json=json, quiet=quiet)


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
        typer.Option(
            help="What to vary: joints.NAME.kz,materials.NAME.young; of the rig head.ky, head.kz, "
            "head.kry, head.kt (kx and kz as one), foot.ky, ..., block.young, block.density."
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="The tuned scene; default NAME-tuned.toml.")
    ] = None,
    changes: Changes = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: json_of("{match, modes_hz, full_order_hz, stiffness, undetermined, mac, ...}") = False,
) -> None:
    """Fit joint stiffnesses to chosen modes and write a scene."""
    from workflows.structure import api

    with StageProgress(f"tune {scene}", quiet=quiet) as progress:
        result = api.tune(
            scene, changes or (), match=match, free=() if free is None else free,
            hammer=hammer_file, out=out or api.USUAL, overwrite=overwrite,
            progress=progress.stage,
        )  # fmt: skip
    print_report(result.report, json, quiet)
    for sentence in result.report.failures:
        raise ValueError(f"no scene is written: {sentence}")
    print_lines(f"written: {result.file}", json=json, quiet=quiet)


def reduce(
    out: Annotated[Path, typer.Option(help="rom.npz, .mat or .h5.")],
    scene: SceneName = None,
    matrices: Annotated[
        Path | None, typer.Option(help="Write the full model's K, M, w beside it (.mat, .npz).")
    ] = None,
    changes: Changes = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: JsonFiles = False,
) -> None:
    """Write the reduced model: M, K, C, w, and the outer nodes' T."""
    from workflows.structure.api import reduce as reduced

    with StageProgress(f"reduce {scene}", quiet=quiet) as progress:
        reduced(
            scene, changes or (), out=out, matrices=matrices, overwrite=overwrite,
            progress=progress.stage,
        )  # fmt: skip
    print_files([path for path in (out, matrices) if path], json, quiet)
