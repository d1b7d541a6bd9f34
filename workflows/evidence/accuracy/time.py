"""Every scheme over its step beside general-purpose integrators over their tolerance."""

from collections.abc import Iterable

import numpy as np

from beadwave import dem
from beadwave.system import adding
from beadwave.workflows.evidence.accuracy import peers
from beadwave.workflows.evidence.accuracy.curves import picture, ratios, slope
from beadwave.workflows.evidence.accuracy.problems import Problem, pressed, problem
from beadwave.workflows.evidence.accuracy.runs import (
    AccuracyRow,
    controlled_rows,
    peer_rows,
    reference,
    scheme_rows,
    table_of,
)
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.engine.progress import Progress


def time(scene: Scene, progress: Progress) -> Finding:
    """Error of every scheme and of general-purpose integrators against their run time."""
    case = problem(scene, progress)
    truth = reference(case)
    rows = (
        *scheme_rows("time", case, truth, dem.SCHEMES),
        *controlled_rows("time", case, truth),
        *peer_rows("time", case, truth, peers.peers()),
    )
    closed, opening = orders_closed(case), orders(rows, 1e-8, last=4)
    sentences = [
        f"{scene.name}: the reference solution, {truth.scheme} with a small step, differs from "
        f"{truth.checked_by} by {truth.difference:.2g}.",
        f"Observed order of convergence while all contacts stay closed: {_listed(closed)}.",
        f"Observed order where contacts open and close: {_listed(opening)}.",
        *ratios(rows, scene.name),
    ]
    if not peers.has_sundials():
        sentences.append(f"CVODE is not installed; `{adding('peers')}` adds it to the comparison.")
    pictures = (picture("accuracy_time", rows, scene.name),)
    return Finding((table_of(rows),), tuple(sentences), pictures)


def orders_closed(case: Problem) -> dict[str, float]:
    """Observed order of each scheme while all contacts are pressed shut."""
    shut = pressed(case)
    truth = reference(shut, independent=False)
    return orders(scheme_rows("order", shut, truth, dem.SCHEMES, until=2e-9), 2e-9, last=2)


def orders(rows: Iterable[AccuracyRow], floor: float, last: int) -> dict[str, float]:
    """Observed order of each scheme: the slope of log error over log step of its `last` smallest
    steps whose error is above the floor of rounding; nan where fewer than two are."""
    rows, slopes = tuple(rows), {}
    for scheme in dem.SCHEMES:
        above = [row for row in rows if row.method == scheme and floor < row.error < 0.1][-last:]
        steps, errors = [row.setting for row in above], [row.error for row in above]
        slopes[scheme] = slope(steps, errors) if len(above) > 1 else np.nan
    return slopes


def _listed(orders: dict[str, float]) -> str:
    return ", ".join(
        f"{scheme} {'-' if np.isnan(order) else f'{order:.2f}'}" for scheme, order in orders.items()
    )
