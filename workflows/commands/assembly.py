"""`beadwave modes`, `look`, `hammer`, `tune` and `reduce`: the commands on an assembly."""

from pathlib import Path
from typing import Annotated

import typer

from beadwave.workflows.commands.options import (
    scene_names,
)
from beadwave.workflows.commands.terminal import (
    print_files,
    print_lines,
    print_report,
    print_result,
)
from beadwave.workflows.commands.verb import Call, Word, verb


@verb(
    "beadwave.workflows.structure.api.modes",
    json="{rows: [a mode or model each]}, of a crystal also {band_edges_hz, dispersion}; of --inp "
    "and --step {written}",
    out=Word("folder for the MAC matrix, a crystal's dispersion, or with --table 5.2 figure 5.7"),
)
def modes(
    call: Call,
    table: Annotated[
        str | None,
        typer.Option(help="Rebuild a table of the thesis with its numbers: 5.2 or 5.3."),
    ] = None,
    inp: Annotated[
        Path | None, typer.Option(help="Write the model for CalculiX or Abaqus (.inp).")
    ] = None,
    step: Annotated[Path | None, typer.Option(help="Write the geometry (.step).")] = None,
) -> None:
    """Frequencies, measured ones, MAC, participation."""
    from beadwave.workflows.scene import InvalidScene
    from beadwave.workflows.structure import api

    amplitude = call.given.pop("amplitude", False)
    if amplitude and (inp or step or table):
        raise InvalidScene("--amplitude is of modes alone; drop --inp, --step and --table.")
    if (inp or step) and (table or "out" in call.given):
        raise InvalidScene("--inp and --step write the model alone; drop --table and --out.")
    if inp or step:
        call.function = api.export
        print_files(call(inp=inp, step=step), call.json, call.quiet)
    elif table:
        call.function = api.thesis_table
        print_report(call(table=table), call.json, call.quiet)
    else:
        print_report(call(amplitude=amplitude).table, call.json, call.quiet)


@verb(
    "beadwave.workflows.structure.api.look",
    json="{bodies, touching, holes, meshed, dofs, unknowns, memory_bytes, seconds, remarks}",
    source=Word(metavar="FILE.step|SCENE", completes=scene_names),
    starter=Word(name="--scene"),
)
def look(call: Call) -> None:
    """Bodies, masses, touching pairs, holes, size of the mesh."""
    print_report(call().found, call.json, call.quiet)
    out, starter = call.given.get("out"), call.given.get("starter")
    files = [f"{out}/{name}" for name in ("faces.html", "figures/assembly.png")] if out else []
    files += [starter] if starter else []
    if files:
        print_lines(f"written: {', '.join(map(str, files))}", json=call.json, quiet=call.quiet)


@verb(
    "beadwave.workflows.structure.api.hammer",
    json="{file, title, rows: [a mode each], left_out, steps, remarks}; of --synthetic {written}, "
    "of --design {modes_hz, rows: [a point each], largest_mac, alike_hz}",
    files=Word(metavar="FILE"),
    scene=Word(option=True),
    band=Word(metavar="FROM:TO"),
)
def hammer(
    call: Call,
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
) -> None:
    """Modes of a hammer test from its hits or responses."""
    from beadwave.workflows.scene import InvalidScene
    from beadwave.workflows.structure import api

    if synthetic or design is not None:
        file, *others = call.given.pop("files")
        if others:
            raise InvalidScene("--synthetic and --design write one FILE; name one.")
        wanted = ("scene", "changes", "band", "overwrite", *(("points",) if synthetic else ()))
        call.given = {name: call.given[name] for name in wanted if name in call.given}
        call.function = api.write_hammer_test if synthetic else api.design_hammer_test
        if synthetic:
            path = call(file=file)
            line = f"written: {path} (synthetic, not measured)"
            print_result({"written": [str(path)]}, line, call.json, call.quiet)
        else:
            print_report(call(file=file, points=design), call.json, call.quiet)
            print_lines(f"written: {file}", json=call.json, quiet=call.quiet)
        return
    print_report(call().report, call.json, call.quiet)
    if out := call.given.get("out"):
        files = ("modes.json", "poles.html", "modes.uff", "targets.toml")
        names = [name for name in files if (out / name).exists()]
        line = f"written: {out}/{', '.join([*names, 'figures'])}"
        print_lines(line, json=call.json, quiet=call.quiet)


@verb(
    "beadwave.workflows.structure.api.tune",
    json="{match, modes_hz, full_order_hz, stiffness, undetermined, mac, ...}; of --rank "
    "{parameters: [{name, frequency, rank, gain, condition, deviation}], onsets, determined, ...}; "
    "of --posterior {parameters: [{name, median, low, high, says}], lobes, log_evidence, ...}; "
    "of --damping {factors: [{name, value, deviation, says}], modes, ...}; of --frf {values: "
    "[{name, value, low, high}], resonances, before, after, ...}",
    out=Word("the tuned scene; default NAME-tuned.toml"),
)
def tune_joints(
    call: Call,
    rank: Annotated[
        bool,
        typer.Option(
            "--rank",
            help="Fit nothing: list how each mode depends on each value of --free, by default all, "
            "and which are worth freeing.",
        ),
    ] = False,
    posterior: Annotated[
        bool,
        typer.Option(
            "--posterior",
            help="Write no scene: sample all values that fit, with their probability (extra "
            "posterior; a minute).",
        ),
    ] = False,
    damping: Annotated[
        bool,
        typer.Option(
            "--damping",
            help="Fit loss factors of materials and joints to the damping ratios (zeta) of the "
            "targets, and nothing else.",
        ),
    ] = False,
    frf: Annotated[
        list[Path] | None,
        typer.Option(
            help="Fit to the responses of a hammer test themselves, magnitude and phase, and to "
            "their resonances: .uff, .csv, .mat or .wav, responses or hits. --match then numbers "
            "resonances from the lowest; --free may name damping.ratio, damping.joints.NAME, "
            "joints.NAME.cz, ... as well.",
        ),
    ] = None,
    points: Annotated[
        Path | None,
        typer.Option(help="Of --frf, points of the nodes: .csv (node, x, y, z in m) or .uff."),
    ] = None,
    band: Annotated[
        str | None,
        typer.Option(metavar="FROM:TO", help="Of --frf, frequencies to fit in [Hz], as 40:950."),
    ] = None,
    pictures: Annotated[
        Path | None,
        typer.Option(
            help="Of --frf, a folder for the picture of responses, measured, before and after."
        ),
    ] = None,
    bounds: Annotated[
        str | None,
        typer.Option(help="Of --posterior, ends of log-uniform priors: joints.cover.kz=1e6:1e9."),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(help="Of --posterior, of its random numbers; default 0.")
    ] = None,
) -> None:
    """Fit joint stiffnesses to chosen modes and write a scene."""
    from beadwave.workflows.scene import InvalidScene
    from beadwave.workflows.structure import api

    if rank + posterior + damping + bool(frf) > 1:
        raise InvalidScene(
            "--rank, --posterior, --damping and --frf are different answers; keep one."
        )
    of_frf = {"--points": points, "--band": band, "--pictures": pictures}
    if not frf and (alone := [name for name, value in of_frf.items() if value is not None]):
        raise InvalidScene(f"{alone[0]} is an option of --frf; add it, or drop {alone[0]}.")
    if not posterior and (bounds is not None or seed is not None):
        raise InvalidScene("--bounds and --seed are those of --posterior; add it, or drop them.")
    if frf:
        if "hammer" in call.given:
            raise InvalidScene("--hammer and --frf both name a test; keep one.")
        call.function = api.tune_to_responses
        call.given.setdefault("out", api.USUAL)
        result = call(files=frf, points=points, band=band, pictures=pictures)
        print_report(result.report, call.json, call.quiet)
        files = [str(result.file), *([f"{pictures}/figures/responses.png"] if pictures else [])]
        print_lines(f"written: {', '.join(files)}", json=call.json, quiet=call.quiet)
        return
    if damping:
        if call.given.keys() & {"match", "free"}:
            raise InvalidScene("--damping takes all targets with zeta; drop --match and --free.")
        call.function = api.fit_losses
        result = call()
        print_report(result.report, call.json, call.quiet)
        if result.file:
            print_lines(f"written: {result.file}", json=call.json, quiet=call.quiet)
        return
    if rank or posterior:
        option = "--rank" if rank else "--posterior"
        if call.given.pop("overwrite", False) or "out" in call.given:
            raise InvalidScene(f"{option} writes no scene; drop --out and --overwrite.")
        if rank:
            call.function = api.rank_parameters
            print_report(call(), call.json, call.quiet)
            return
        from beadwave.workflows.fit.api import joints_posterior

        call.function = joints_posterior
        print_report(call(bounds=bounds, seed=seed or 0).report, call.json, call.quiet)
        return
    call.given.setdefault("out", api.USUAL)
    result = call()
    print_report(result.report, call.json, call.quiet)
    for sentence in result.report.failures:
        raise ValueError(f"no scene is written: {sentence}")
    print_lines(f"written: {result.file}", json=call.json, quiet=call.quiet)


@verb(
    "beadwave.workflows.structure.api.reduce",
    json="{written: [files]}, with mesh.error also {mesh}",
    out=Word(required=True),
)
def reduce(call: Call) -> None:
    """Write the reduced model: M, K, C, w, and the outer nodes' T."""
    mesh = call().mesh
    files = (call.given.get(name) for name in ("out", "matrices"))
    of_mesh = {} if mesh is None else {"mesh": mesh.model_dump()}
    print_files([path for path in files if path], call.json, call.quiet, **of_mesh)
