"""Chains of more and more spheres for a fixed duration, at a fixed step or tolerance."""

from itertools import chain as joined

from coupling import peers
from coupling.peers import Problem
from coupling.work_precision.growth import growths
from coupling.work_precision.problems import lengthened
from coupling.work_precision.rows import Row
from coupling.work_precision.runs import limit, peer_rows, reference, scheme_row
from workflows.pipeline.pipeline import Progress
from workflows.scene import Scene
from workflows.studies.accuracy.curves import FIXED, PEER_TOLERANCE, over_size
from workflows.studies.accuracy.problems import problem
from workflows.studies.accuracy.rows import table_of
from workflows.studies.finding import Finding
from workflows.studies.prose import rendered

SCENE = "rig-rigid"
LENGTHS = (17, 100, 1000, 10000)


def chain_length(scene: Scene, progress: Progress) -> Finding:
    """Run time against the number of spheres."""
    case = problem(scene, progress)
    rows = tuple(joined.from_iterable(_length_rows(lengthened(case, n)) for n in LENGTHS))
    drawn = over_size("accuracy_chain_length", rows, "spheres")
    return Finding((table_of(rows),), rendered(__file__, growths=growths(rows)), (drawn,))


def _length_rows(case: Problem) -> tuple[Row, ...]:
    n = case.v0.size
    finer = 512.0 if n <= 100 else 128.0 if n <= 1000 else 32.0
    truth = reference(case, finer=finer, independent=n <= 1000)
    solvers = {name: peers.SCIPY[name] for name in ("RK45", "DOP853")}
    return (
        scheme_row("chain-length", case, truth, FIXED, limit(case, FIXED) / 8.0, n),
        scheme_row("chain-length", case, truth, "verlet", limit(case, "verlet") / 64.0, n),
        *peer_rows("chain-length", case, truth, solvers, parameter=n, tolerances=(PEER_TOLERANCE,)),
    )
