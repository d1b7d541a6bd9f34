"""What each optional part of a chain and of a wall adds to the seconds of a march."""

from collections.abc import Iterator

import dem
from workflows.evidence.accuracy.peers import Problem
from workflows.evidence.accuracy.problem_variants import with_parts
from workflows.evidence.accuracy.row import Row
from workflows.evidence.accuracy.runs import marched, observed, relative_error, timed


def part_rows(case: Problem, scheme: str) -> Iterator[Row]:
    """Of the bare chain, and of it with one part more, at one step."""
    return (_row(name, one, scheme) for name, one in with_parts(case).items())


def over_bare(rows: tuple[Row, ...], scheme: str) -> dict[str, float]:
    """Time with a part over that of the bare chain."""
    first, *others = (row for row in rows if row.method.startswith(f"{scheme},"))
    return {row.parameter: row.seconds / first.seconds for row in others}


def _row(name: str, case: Problem, scheme: str) -> Row:
    dt = case.duration / 20000
    run = timed(lambda: marched(case, scheme, dt))
    finer = observed(case, marched(case, scheme, dt / 2).v)
    error = relative_error(case, run.result.v, finer)
    steps = run.result.n_steps
    return Row(
        "parts", f"{scheme}, {name}", name, error, run.warm, run.result.energy_error, steps,
        steps * dem.SCHEMES[scheme].evaluations, run.cold, run.result.dt,
    )  # fmt: skip
