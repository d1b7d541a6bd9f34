"""What each optional part of a scene costs: the same step and scheme with one part more."""

from workflows.evidence.accuracy.part_rows import over_bare, part_rows
from workflows.evidence.accuracy.problem_variants import bare, modal_wall
from workflows.evidence.accuracy.problems import problem
from workflows.evidence.accuracy.rows import table_of
from workflows.evidence.prose import rendered
from workflows.report.finding import Finding
from workflows.scene import Scene
from workflows.stages.pipeline import Progress

SCENE = "rig-rigid"
SCHEMES = ("verlet", "suzuki4")


def parts(scene: Scene, progress: Progress) -> Finding:
    """Run time at a given step with each optional part of a chain and of a wall."""
    case = problem(scene, progress)
    case = case._replace(wall=modal_wall(None, 0), chain=bare(case.chain))
    rows = tuple(row for scheme in SCHEMES for row in part_rows(case, scheme))
    sentences = rendered(__file__, ratios={scheme: over_bare(rows, scheme) for scheme in SCHEMES})
    return Finding((table_of(rows),), sentences)
