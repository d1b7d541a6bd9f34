"""`beadwave calibrate`, `inspect` and `design`: models fitted to records.

Arguments, defaults and help of each are those of the function that it names (`verb.py`).
"""

from beadwave.workflows.commands.terminal import print_lines, print_report, print_result
from beadwave.workflows.commands.verb import Call, Word, verb

BOUNDS, SPHERES = Word(metavar="KEY=LOW:HIGH,.."), Word(metavar="SPHERES")
SCENE = Word("a built-in scene (beadwave scenes lists them) or a TOML file")
SCAN, FIND = Word(metavar="LOW:HIGH:POINTS"), Word(metavar="KEY,...")


@verb(
    "beadwave.workflows.fit.api.calibrate",
    json="the report, {parameters: [...], ...}, see report.json",
    scene=SCENE, data=Word(metavar="DATA"), bounds=BOUNDS, hold_out=SPHERES, scan=SCAN,
)  # fmt: skip
def calibrate(call: Call) -> None:
    """Fit contacts and wall to measured velocities."""
    print_report(call().report, call.json, call.quiet)
    _print_scene(call)


def _print_scene(call: Call) -> None:
    if out := call.given.get("out"):
        print_lines(f"written: {out}/scene.toml", json=call.json, quiet=call.quiet)


@verb(
    "beadwave.workflows.fit.api.inspect", json="the report, {numbers: [...], ...}, see report.json",
    scene=SCENE, data=Word(metavar="DATA"), find=FIND, bounds=BOUNDS,
    each=Word(metavar="KEY=V1,V2,.."),
)  # fmt: skip
def inspect(call: Call) -> None:
    """Numbers of the structure from measured waves."""
    print_report(call().report, call.json, call.quiet)
    _print_scene(call)


@verb(
    "beadwave.workflows.fit.api.design", json="{rows: [{sphere, ...}], findings: [...]}",
    scene=SCENE, find=FIND, bounds=BOUNDS,
)  # fmt: skip
def design(call: Call) -> None:
    """Choose the sphere, chain and velocity that determine a number best."""
    from beadwave.workflows.report import finding

    result = call()
    print_result(finding.record(result), finding.text(result), call.json, call.quiet)
