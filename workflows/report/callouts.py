"""Where the names of bodies stand in a picture: beside it, each with a line to its body.

Seen from one direction in parallel projection, points may move towards the eye without moving in
the picture: lines and names lie before all bodies.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

CELLS = 45  # across the picture, in which the nearest point hides the others
FEW = 3  # cells in which a body must be the nearest to be seen
MARGIN = 0.1  # of the picture's width, between bodies and names
LINES = 16  # of text that fit on its height


class Callout(NamedTuple):
    """A line from a body to its name."""

    anchor: NDArray[np.float64]  # (3,) on what is seen of the body
    text: NDArray[np.float64]  # (3,)
    left: bool  # of the picture
    seen: bool  # False of a body behind others


def callouts(
    bodies: Sequence[NDArray[np.float64]], towards: Sequence[float], up: Sequence[float]
) -> list[Callout]:
    """For points (n, 3) of each body's surface, seen from the direction `towards`."""
    axes = _screen(np.asarray(towards, dtype=float), np.asarray(up, dtype=float))
    seen = [points @ axes.T for points in bodies]
    whole = np.concatenate(seen)
    lower, upper = whole.min(axis=0), whole.max(axis=0)
    anchors, is_seen = _anchors(seen, lower, (upper - lower)[:2].max() / CELLS)
    anchors[:, 2] = upper[2]
    order = np.argsort(anchors[:, 0], kind="stable")
    is_left = np.isin(np.arange(len(bodies)), order[: len(bodies) // 2])
    text = anchors.copy()
    margin = MARGIN * (upper[0] - lower[0])
    text[:, 0] = np.where(is_left, lower[0] - margin, upper[0] + margin)
    least = (upper - lower)[:2].max() / LINES
    for side in (is_left, ~is_left):
        text[side, 1] = _apart(anchors[side, 1], least)
    told = zip(anchors @ axes, text @ axes, is_left.tolist(), is_seen, strict=True)
    return [Callout(*one) for one in told]


def _screen(towards: NDArray[np.float64], up: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rows to the right, upwards and to the eye."""
    eye = towards / np.linalg.norm(towards)
    right = np.cross(up, eye)
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(eye, right), eye])


def _anchors(
    seen: list[NDArray], lower: NDArray, cell: float
) -> tuple[NDArray[np.float64], list[bool]]:
    """The point (k, 3) of each body nearest to the middle of what is seen of it, if any is."""
    body = np.repeat(np.arange(len(seen)), [len(points) for points in seen])
    whole = np.concatenate(seen)
    column = np.floor((whole[:, :2] - lower[:2]) / cell).astype(np.int64) @ [1, 10 * CELLS]
    order = np.lexsort((-whole[:, 2], column))
    first = order[np.unique(column[order], return_index=True)[1]]
    found, visible = [], []
    for i, points in enumerate(seen):
        front = whole[first[body[first] == i]]
        visible.append(len(front) > FEW)
        front = front if visible[-1] else points
        off = front[:, :2] - np.median(front[:, :2], axis=0)
        found.append(front[np.linalg.norm(off, axis=1).argmin()])
    return np.array(found), visible


def _apart(y: NDArray[np.float64], least: float) -> NDArray[np.float64]:
    """Heights in the same order, no two nearer than `least`, about where they were."""
    order = np.argsort(-y, kind="stable")
    placed = np.empty_like(y)
    last = np.inf
    for i in order:
        placed[i] = last = min(y[i], last - least)
    return placed + (y - placed).mean() if len(y) else placed
