"""Every scheme over its step beside general-purpose integrators over their tolerance."""

import dem
from coupling import peers
from coupling.work_precision.orders import orders, orders_closed
from coupling.work_precision.ratios import ratios
from coupling.work_precision.runs import controlled_rows, peer_rows, reference, scheme_rows
from workflows.pipeline.pipeline import Progress
from workflows.scene import Scene
from workflows.studies.accuracy.curves import picture
from workflows.studies.accuracy.problems import problem
from workflows.studies.accuracy.rows import table_of
from workflows.studies.finding import Finding
from workflows.studies.prose import rendered

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
