"""Places of the names of bodies in a picture: beside the bodies, each with a line to its body.

Seen from one direction in parallel projection, points may move towards the eye without moving in
the picture: lines and names lie before all bodies.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

# Sizes of a picture's callouts, chosen by eye
N_CELLS = 45  # across the picture, in which the nearest point hides the others
MIN_VISIBLE_CELLS = 3  # a body is visible that is the nearest in more cells than these
MARGIN = 0.2  # of the picture's width, between bodies and names
N_LINES = 16  # of text that fit on its height
ASLANT = 0.3  # of a unit direction in the picture, from which on it points to a side


class Callout(NamedTuple):
    """A line from a body to its name."""

    anchor: NDArray[np.float64]  # (3,) on the visible part of the body
    text: NDArray[np.float64]  # (3,)
    left: bool  # of the picture
    seen: bool  # False of a body behind others


def callouts(
    bodies: Sequence[NDArray[np.float64]],
    towards: Sequence[float],
    up: Sequence[float],
    *,
    occupied: Sequence[float] | None = None,
) -> list[Callout]:
    """For points (n, 3) of each body's surface, seen from the direction `towards`; names stand on
    the right, those of more bodies than lines of text on both sides, and across from a direction
    (3,) that is occupied by something else."""
    # coordinates to the right, upwards and to the eye
    eye = np.asarray(towards, dtype=float)
    eye = eye / np.linalg.norm(eye)
    right = np.cross(np.asarray(up, dtype=float), eye)
    right /= np.linalg.norm(right)
    axes = np.array([right, np.cross(eye, right), eye])
    projected = [points @ axes.T for points in bodies]
    points = np.concatenate(projected)
    body = np.repeat(np.arange(len(bodies)), [len(points) for points in projected])
    lower, upper = points.min(axis=0), points.max(axis=0)
    size = (upper - lower)[:2].max()

    # the point nearest to the eye in each cell of the picture
    cell = np.floor((points[:, :2] - lower[:2]) / (size / N_CELLS)).astype(np.int64)
    column = cell @ [1, 10 * N_CELLS]
    order = np.lexsort((-points[:, 2], column))
    nearest = order[np.unique(column[order], return_index=True)[1]]

    # each body's anchor: of its visible points, or of all, the one nearest to their median
    anchors, visible = [], []
    for i, own_points in enumerate(projected):
        front = points[nearest[body[nearest] == i]]
        visible.append(len(front) > MIN_VISIBLE_CELLS)
        front = front if visible[-1] else own_points
        distance = np.linalg.norm(front[:, :2] - np.median(front[:, :2], axis=0), axis=1)
        anchors.append(front[distance.argmin()])
    anchors = np.array(anchors)
    anchors[:, 2] = upper[2]

    # names beside the picture, spread so that lines of text do not overlap; of both sides the left
    # half of the anchors on the left
    is_left = np.zeros(len(bodies), bool)
    if len(bodies) > N_LINES:
        is_left[np.argsort(anchors[:, 0], kind="stable")[: len(bodies) // 2]] = True
    along = 0.0 if occupied is None else float(right @ np.asarray(occupied, dtype=float))
    if abs(along) > ASLANT:
        is_left[:] = along > 0
    text = anchors.copy()
    margin = MARGIN * (upper[0] - lower[0])
    text[:, 0] = np.where(is_left, lower[0] - margin, upper[0] + margin)
    for side in (is_left, ~is_left):
        text[side, 1] = spread(anchors[side, 1], size / N_LINES)

    rows = zip(anchors @ axes, text @ axes, is_left.tolist(), visible, strict=True)
    return [Callout(*row) for row in rows]


def spread(y: NDArray[np.float64], distance: float) -> NDArray[np.float64]:
    """Heights (n,) in the same order, no two nearer than `distance`, about where they were."""
    heights = np.empty_like(y)
    last = np.inf
    for i in np.argsort(-y, kind="stable"):
        heights[i] = last = min(y[i], last - distance)
    return heights + (y - heights).mean() if len(y) else heights
