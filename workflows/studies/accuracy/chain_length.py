"""Chains of more and more spheres for a fixed duration, at a fixed step or tolerance."""

from itertools import chain as joined

from coupling.work_precision.growth import growths
from coupling.work_precision.problems import lengthened
from coupling.work_precision.sizes import length_rows
from workflows.pipeline.pipeline import Progress
from workflows.scene import Scene
from workflows.studies.accuracy.curves import over_size
from workflows.studies.accuracy.problems import problem
from workflows.studies.accuracy.rows import table_of
from workflows.studies.finding import Finding
from workflows.studies.prose import rendered

SCENE = "rig-rigid"
LENGTHS = (17, 100, 1000, 10000)


def chain_length(scene: Scene, progress: Progress) -> Finding:
    """Run time against the number of spheres."""
    case = problem(scene, progress)
    rows = tuple(joined.from_iterable(length_rows(lengthened(case, n)) for n in LENGTHS))
    drawn = over_size("accuracy_chain_length", rows, "spheres")
    return Finding((table_of(rows),), rendered(__file__, growths=growths(rows)), (drawn,))
