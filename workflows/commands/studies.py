"""`beadwave accuracy`, `stability` and `verify`, the commands on evidence.

Their studies are modules of `workflows.evidence`.
"""

from typing import Annotated

import typer

from beadwave.workflows.commands.options import case_names, group_names, stage_names
from beadwave.workflows.commands.terminal import print_result
from beadwave.workflows.commands.verb import Call, Word, verb


@verb(
    "beadwave.workflows.evidence.api.accuracy",
    json="{rows: [{study, method, parameter, error, ...}], ...}",
    stage=Word("only this study; --list names them", completes=stage_names),
)  # fmt: skip
def accuracy(
    call: Call,
    listed: Annotated[bool, typer.Option("--list", help="The studies, a line each.")] = False,
) -> None:
    """Error against run time, beside other integrators."""
    if listed:
        _list("accuracy", "studies", call.json)
        return
    from beadwave.workflows.evidence.accuracy.folder import machine
    from beadwave.workflows.report import finding

    result = call()
    record = finding.record(result, machine=machine())
    print_result(record, finding.text(result), call.json, call.quiet)


@verb(
    "beadwave.workflows.evidence.api.stability",
    json="{rows: [{case, parameter, verdict, value, ...}]}",
    cases=Word(
        "only this case; may be repeated. --list names them", "--case", None, case_names,
        option=True,
    ),
)  # fmt: skip
def stability(
    call: Call,
    listed: Annotated[bool, typer.Option("--list", help="The cases, a line each.")] = False,
    all_trials: Annotated[
        bool, typer.Option("--all", help="Print each trial; without it a line for each case.")
    ] = False,
) -> None:
    """Stiff and extreme cases with a verdict each."""
    if listed:
        _list("stability", "cases", call.json)
        return
    from beadwave.workflows.evidence.harness import brief
    from beadwave.workflows.report import finding

    result = call()
    text = finding.text(result if all_trials else brief(result))
    print_result(finding.record(result), text, call.json, call.quiet)


@verb(
    "beadwave.workflows.evidence.api.verify",
    json="{rows: [{group, quantity, ours, theirs, difference, ...}]}",
    groups=Word(
        "only this group; may be repeated. --list names them",
        "--group",
        None,
        group_names,
        option=True,
    ),
)
def verify(
    call: Call,
    listed: Annotated[bool, typer.Option("--list", help="The groups, a line each.")] = False,
) -> None:
    """Our results beside published and exact ones."""
    if listed:
        _list("verify", "groups", call.json)
        return
    from beadwave.workflows.evidence.harness import wrong
    from beadwave.workflows.report import finding

    result = call()
    print_result(finding.record(result), finding.text(result), call.json, call.quiet)
    if sentence := wrong(result):
        raise ValueError(sentence)


def _list(folder: str, called: str, json: bool) -> None:
    from beadwave.workflows.evidence.groups import shown

    rows = [{"name": name, "shows": shows} for name, shows in shown(folder).items()]
    text = "\n".join(f"{row['name']:20}{row['shows']}" for row in rows)
    print_result({called: rows}, text, json)
