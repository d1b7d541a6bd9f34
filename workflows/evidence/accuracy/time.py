"""Every scheme over its step beside general-purpose integrators over their tolerance."""

import dem
from workflows.evidence.accuracy import peers
from workflows.evidence.accuracy.curves import picture
from workflows.evidence.accuracy.orders import orders, orders_closed
from workflows.evidence.accuracy.problems import problem
from workflows.evidence.accuracy.ratios import ratios
from workflows.evidence.accuracy.rows import table_of
from workflows.evidence.accuracy.runs import controlled_rows, peer_rows, reference, scheme_rows
from workflows.evidence.prose import rendered
from workflows.report.finding import Finding
from workflows.scene import Scene
from workflows.stages.pipeline import Progress

SCENE = "rig-rigid"


def time(scene: Scene, progress: Progress) -> Finding:
    """Error of every scheme and of general-purpose integrators against their run time."""
    case = problem(scene, progress)
    truth = reference(case)
    rows = (
        *scheme_rows("time", case, truth, dem.SCHEMES),
        *controlled_rows("time", case, truth),
        *peer_rows("time", case, truth, peers.peers()),
    )
    sentences = rendered(
        __file__, scene=scene.name, reference=truth, closed=orders_closed(case),
        opening=orders(rows, 1e-8, last=4), ratios=ratios(rows), sundials=peers.has_sundials(),
    )  # fmt: skip
    return Finding((table_of(rows),), sentences, (picture("accuracy_time", rows, scene.name),))
