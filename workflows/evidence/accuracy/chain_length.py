"""Chains of more and more spheres for a fixed duration, at a fixed step or tolerance."""

from beadwave.workflows.evidence.accuracy import peers
from beadwave.workflows.evidence.accuracy.curves import over_size
from beadwave.workflows.evidence.accuracy.growth import growths
from beadwave.workflows.evidence.accuracy.problems import lengthened, problem
from beadwave.workflows.evidence.accuracy.row import table_of
from beadwave.workflows.evidence.accuracy.runs import FIXED, limit, peer_rows, reference, scheme_row
from beadwave.workflows.evidence.study import rendered
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.progress import Progress

SCENE = "rig-rigid"
LENGTHS = (17, 100, 1000, 10000)


def chain_length(scene: Scene, progress: Progress) -> Finding:
    """Run time against the number of spheres."""
    case = problem(scene, progress)
    solvers = {name: peers.SCIPY[name] for name in ("RK45", "DOP853")}
    rows = []
    for length in LENGTHS:
        chain = lengthened(case, length)
        n = chain.v0.size
        # a long chain's reference takes larger steps, and is not checked by DOP853 beyond 1000
        finer = 512.0 if n <= 100 else 128.0 if n <= 1000 else 32.0
        truth = reference(chain, finer=finer, independent=n <= 1000)
        for scheme, share in ((FIXED, 8.0), ("verlet", 64.0)):
            dt = limit(chain, scheme) / share
            rows.append(scheme_row("chain-length", chain, truth, scheme, dt, n))
        rows += peer_rows("chain-length", chain, truth, solvers, parameter=n, tolerances=(1e-8,))
    rows = tuple(rows)
    curves = over_size("accuracy_chain_length", rows, "spheres")
    return Finding((table_of(rows),), rendered(__file__, growths=growths(rows)), (curves,))
