"""What each optional part of a scene costs: the same step and scheme with one part more."""

from beadwave.workflows.evidence.accuracy.problems import bare, modal_wall, problem, with_parts
from beadwave.workflows.evidence.accuracy.row import table_of
from beadwave.workflows.evidence.accuracy.runs import ReferenceRun, marched, observed, scheme_row
from beadwave.workflows.evidence.study import rendered
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.progress import Progress

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
            finer = observed(extended, marched(extended, scheme, dt / 2).v)
            truth = ReferenceRun(finer, 0.0, "half the step", scheme)
            row = scheme_row("parts", extended, truth, scheme, dt, part)
            rows.append(row._replace(method=f"{scheme}, {part}"))
            seconds[part] = row.seconds
        bare_seconds = seconds.pop("bare")
        ratios[scheme] = {part: warm / bare_seconds for part, warm in seconds.items()}
    return Finding((table_of(tuple(rows)),), rendered(__file__, ratios=ratios))
