"""What each optional part of a scene costs: the same step and scheme with one part more."""

import dem
from workflows.evidence.accuracy.problems import bare, modal_wall, problem, with_parts
from workflows.evidence.accuracy.row import AccuracyRow, table_of
from workflows.evidence.accuracy.runs import marched, observed, relative_error, timed
from workflows.evidence.prose import rendered
from workflows.report.finding import Finding
from workflows.scene import Scene
from workflows.stages.progress import Progress

SCENE = "rig-rigid"
SCHEMES = ("verlet", "suzuki4")


def parts(scene: Scene, progress: Progress) -> Finding:
    """Run time at a given step with each optional part of a chain and of a wall."""
    case = problem(scene, progress)
    case = case._replace(wall=modal_wall(None, 0), chain=bare(case.chain))
    dt = case.duration / 20000
    rows, ratios = [], {}
    for scheme in SCHEMES:
        seconds = {}
        for part, extended in with_parts(case).items():
            run, warm, cold = timed(lambda p=extended, scheme=scheme: marched(p, scheme, dt))
            finer = observed(extended, marched(extended, scheme, dt / 2).v)
            rows.append(AccuracyRow(
                "parts", f"{scheme}, {part}", part, relative_error(extended, run.v, finer),
                warm, run.energy_error, run.n_steps,
                run.n_steps * dem.SCHEMES[scheme].evaluations, cold, run.dt,
            ))  # fmt: skip
            seconds[part] = warm
        bare_seconds = seconds.pop("bare")
        ratios[scheme] = {part: warm / bare_seconds for part, warm in seconds.items()}
    return Finding((table_of(tuple(rows)),), rendered(__file__, ratios=ratios))
