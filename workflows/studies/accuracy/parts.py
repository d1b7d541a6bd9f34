"""What each optional part of a scene costs: the same step and scheme with one part more."""

import dem
from coupling.peers import Problem
from coupling.work_precision.problems import bare, modal_wall, with_parts
from coupling.work_precision.rows import Row
from coupling.work_precision.runs import marched, observed, relative_error, timed
from workflows.pipeline.pipeline import Progress
from workflows.scene import Scene
from workflows.studies.accuracy.problems import problem
from workflows.studies.accuracy.rows import table_of
from workflows.studies.finding import Finding
from workflows.studies.prose import rendered

SCENE = "rig-rigid"
SCHEMES = ("verlet", "suzuki4")


def parts(scene: Scene, progress: Progress) -> Finding:
    """Run time at a given step with each optional part of a chain and of a wall."""
    case = problem(scene, progress)
    case = case._replace(wall=modal_wall(None, 0), chain=bare(case.chain))
    rows = tuple(
        _part_row(name, one, scheme) for scheme in SCHEMES for name, one in with_parts(case).items()
    )
    sentences = rendered(__file__, ratios={scheme: _over_bare(rows, scheme) for scheme in SCHEMES})
    return Finding((table_of(rows),), sentences)


def _over_bare(rows: tuple[Row, ...], scheme: str) -> dict[str, float]:
    """Time with a part over that of the bare chain."""
    first, *others = (row for row in rows if row.method.startswith(f"{scheme},"))
    return {row.parameter: row.seconds / first.seconds for row in others}


def _part_row(name: str, case: Problem, scheme: str) -> Row:
    dt = case.duration / 20000
    run = timed(lambda: marched(case, scheme, dt))
    finer = observed(case, marched(case, scheme, dt / 2).v)
    error = relative_error(case, run.result.v, finer)
    steps = run.result.n_steps
    return Row(
        "parts", f"{scheme}, {name}", name, error, run.warm, run.result.energy_error, steps,
        steps * dem.SCHEMES[scheme].evaluations, run.cold, run.result.dt,
    )  # fmt: skip
