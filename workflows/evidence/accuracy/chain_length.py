"""Chains of more and more spheres for a fixed duration, at a fixed step or tolerance."""

from itertools import chain as joined

from workflows.evidence.accuracy.curves import over_size
from workflows.evidence.accuracy.growth import growths
from workflows.evidence.accuracy.problem_variants import lengthened
from workflows.evidence.accuracy.problems import problem
from workflows.evidence.accuracy.rows import table_of
from workflows.evidence.accuracy.size_rows import length_rows
from workflows.evidence.prose import rendered
from workflows.report.finding import Finding
from workflows.scene import Scene
from workflows.stages.pipeline import Progress

SCENE = "rig-rigid"
LENGTHS = (17, 100, 1000, 10000)


def chain_length(scene: Scene, progress: Progress) -> Finding:
    """Run time against the number of spheres."""
    case = problem(scene, progress)
    rows = tuple(joined.from_iterable(length_rows(lengthened(case, n)) for n in LENGTHS))
    drawn = over_size("accuracy_chain_length", rows, "spheres")
    return Finding((table_of(rows),), rendered(__file__, growths=growths(rows)), (drawn,))
