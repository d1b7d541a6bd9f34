"""`beadwave modes`, `look`, `hammer`, `tune` and `reduce`: the commands on an assembly."""

from pathlib import Path
from typing import Annotated

import typer

from workflows.commands.options import (
    Changes,
    Overwrite,
    Quiet,
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
from workflows.commands.verb import Call, Word, verb


@verb(
    "workflows.structure.api.modes",
    json="{rows: [a mode or model each]}; of --inp and --step {written}",
    out=Word("folder for the MAC matrix, or with --table 5.2 for figure 5.7"),
)
def modes(
    call: Call,
    table: Annotated[
        str | None,
        typer.Option(help="Rebuild a table of the thesis beside its numbers: 5.2 or 5.3."),
    ] = None,
    inp: Annotated[
        Path | None, typer.Option(help="Write the model for CalculiX or Abaqus (.inp).")
    ] = None,
    step: Annotated[Path | None, typer.Option(help="Write the geometry (.step).")] = None,
) -> None:
    """Frequencies beside measured ones, MAC, participation."""
    from workflows.scene import InvalidScene
    from workflows.structure import api

    if (inp or step) and (table or "out" in call.given):
        raise InvalidScene("--inp and --step write the model alone; drop --table and --out.")
    if inp or step:
        call.function = api.export
        print_files(call(inp=inp, step=step), call.json, call.quiet)
    elif table:
        call.function = api.thesis_table
        print_report(call(table=table), call.json, call.quiet)
    else:
        print_report(call().table, call.json, call.quiet)


@verb(
    "workflows.structure.api.look",
    json="{bodies, touching, holes, dofs, memory_bytes, seconds, remarks}",
    source=Word(metavar="FILE.step|SCENE", completes=scene_names),
    starter=Word(name="--scene"),
)
def look(call: Call) -> None:
    """Bodies, masses, touching pairs, holes, size of the mesh."""
    print_report(call().found, call.json, call.quiet)


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


@verb(
    "workflows.structure.api.tune",
    json="{match, modes_hz, full_order_hz, stiffness, undetermined, mac, ...}",
    out=Word("the tuned scene; default NAME-tuned.toml"),
)
def tune_joints(call: Call) -> None:
    """Fit joint stiffnesses to chosen modes and write a scene."""
    from workflows.structure.api import USUAL

    call.given.setdefault("out", USUAL)
    result = call()
    print_report(result.report, call.json, call.quiet)
    for sentence in result.report.failures:
        raise ValueError(f"no scene is written: {sentence}")
    print_lines(f"written: {result.file}", json=call.json, quiet=call.quiet)


@verb("workflows.structure.api.reduce", json="{written: [files]}", out=Word(required=True))
def reduce(call: Call) -> None:
    """Write the reduced model: M, K, C, w, and the outer nodes' T."""
    call()
    files = (call.given.get(name) for name in ("out", "matrices"))
    print_files([path for path in files if path], call.json, call.quiet)
