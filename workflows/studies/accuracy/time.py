"""Every scheme over its step beside general-purpose integrators over their tolerance."""

from collections.abc import Iterable

import dem
from coupling import peers
from coupling.peers import Problem
from coupling.work_precision.growth import growth_exponent
from coupling.work_precision.problems import pressed
from coupling.work_precision.ratios import ratios
from coupling.work_precision.rows import Row
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
        opening=_orders(rows, 1e-8, last=4), ratios=ratios(rows), sundials=peers.has_sundials(),
    )  # fmt: skip
    return Finding((table_of(rows),), sentences, (picture("accuracy_time", rows, scene.name),))


def orders_closed(case: Problem) -> dict[str, float]:
    """Observed order of each scheme while all contacts are pressed shut."""
    shut = pressed(case)
    truth = reference(shut, independent=False)
    return _orders(scheme_rows("order", shut, truth, dem.SCHEMES, until=2e-9), 2e-9, last=2)


def _orders(rows: Iterable[Row], floor: float, last: int) -> dict[str, float]:
    rows = tuple(rows)
    return {name: _order(rows, name, floor, last) for name in dem.SCHEMES}


def _order(rows: tuple[Row, ...], scheme: str, floor: float, last: int) -> float:
    """Over the smallest steps whose error stands above the floor; nan where it cannot be told."""
    clear = [row for row in rows if row.method == scheme and floor < row.error < 0.1][-last:]
    if len(clear) < 2:
        return float("nan")
    return growth_exponent((r.setting for r in clear), (r.error for r in clear))
