"""Every scheme over its step beside general-purpose integrators over their tolerance."""

from collections.abc import Iterable

from beadwave import dem
from beadwave.workflows.evidence.accuracy import peers
from beadwave.workflows.evidence.accuracy.curves import picture, ratios
from beadwave.workflows.evidence.accuracy.growth import growth_exponent
from beadwave.workflows.evidence.accuracy.peers import Problem
from beadwave.workflows.evidence.accuracy.problems import pressed, problem
from beadwave.workflows.evidence.accuracy.row import AccuracyRow, table_of
from beadwave.workflows.evidence.accuracy.runs import (
    controlled_rows,
    peer_rows,
    reference,
    scheme_rows,
)
from beadwave.workflows.evidence.study import rendered
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.progress import Progress

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


def orders_closed(case: Problem) -> dict[str, float]:
    """Observed order of each scheme while all contacts are pressed shut."""
    shut = pressed(case)
    truth = reference(shut, independent=False)
    return orders(scheme_rows("order", shut, truth, dem.SCHEMES, until=2e-9), 2e-9, last=2)


def orders(rows: Iterable[AccuracyRow], floor: float, last: int) -> dict[str, float]:
    """Observed order of each scheme: the slope of log error over log step of its `last` smallest
    steps whose error stands above the floor of rounding; nan where fewer than two do."""
    rows, slopes = tuple(rows), {}
    for scheme in dem.SCHEMES:
        clear = [row for row in rows if row.method == scheme and floor < row.error < 0.1][-last:]
        steps, errors = [row.setting for row in clear], [row.error for row in clear]
        slopes[scheme] = growth_exponent(steps, errors) if len(clear) > 1 else float("nan")
    return slopes
