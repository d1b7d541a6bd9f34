"""One wave over a map: which points of a face have it, by the continuity of its arrival.

At each point the first reflected wave above a threshold is picked. Where that wave fades below it a
later one is picked, and the time jumps there. Two crests of one sign in one record are at least
0.9 of a wave's width apart (closer ones have one crest), so that at neighbours i and j

    |t_i - t_j| <= SAME width    is a step along one wave,
    |t_i - t_j| > OTHER width    is a jump to another one,

where waves change by less than the rest of 0.9 from point to point. The points that steps connect
have one wave if no two neighbours among them jump. Where two do, continuity leads to two waves:
points at such jumps are left out until there are none.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

SAME, OTHER = 0.5, 0.75  # of a wave's full width at half maximum
NEAREST = 33  # points among which neighbours are sought: of a grid those within three steps
Mask = NDArray[np.bool_]


def same_wave(points: ArrayLike, time: ArrayLike, width: float) -> Mask:
    """The points (p, 2) of a face whose waves at the times (p,) [s] are one and the same, (p,).

    time is NaN where there is no wave; width [s] is that of a wave at half its height. Taken is
    the wave of most points. If these are no more than half of those with a wave, it must come
    before the others at most of its borders; otherwise it cannot be told, and no point has it. A
    point without others keeps its wave.
    """
    points, time = np.asarray(points, float), np.asarray(time, float)
    there = np.flatnonzero(np.isfinite(time))
    n_waves = len(there)
    while len(there):
        # none of a single point
        one, other = there[neighbours(points[there])].T
        jump = np.abs(time[one] - time[other])
        near, far = jump <= SAME * width, jump > OTHER * width
        links = coo_array((near[near], (one[near], other[near])), shape=(len(time),) * 2)
        _, group = connected_components(links, directed=False)
        counts = np.bincount(group[there])
        inside = group == counts.argmax()

        # of a wave at half of the points or fewer none may be the first before it
        later = time[other] > time[one]
        first, second = np.where(later, one, other), np.where(later, other, one)
        before = (~inside[first] & inside[second] & ~near).sum()
        after = (inside[first] & ~inside[second] & ~near).sum()
        if 2 * counts.max() <= n_waves and before > after:
            break

        # where continuity leads to both ends of a jump, the points with most of the jumps go
        torn = inside[one] & inside[other] & far
        if not torn.any():
            return inside
        jumps = np.bincount(np.concatenate([one[torn], other[torn]]), minlength=len(time))
        there = there[jumps[there] < jumps.max()]
    return np.zeros(len(time), bool)


def neighbours(points: ArrayLike) -> NDArray[np.int64]:
    """Pairs (m, 2) of points (p, 2) that have no other one in the circle between them, the edges of
    their Gabriel graph. Of an even grid these are the steps along it and both diagonals.

    K. R. Gabriel, R. R. Sokal, Systematic Zoology 18 (1969) 259.
    """
    points = np.asarray(points, float)
    tree = KDTree(points)
    n_near = min(len(points), NEAREST)
    near = tree.query(points, n_near)[1].reshape(len(points), n_near)
    pairs = np.column_stack([np.repeat(np.arange(len(points)), n_near), near.ravel()])
    pairs = np.unique(np.sort(pairs[pairs[:, 0] != pairs[:, 1]], axis=1), axis=0)
    one, other = points[pairs].transpose(1, 0, 2)
    radius = np.linalg.norm(one - other, axis=1) / 2
    empty = tree.query((one + other) / 2)[0] >= radius * (1 - 1e-9)
    return pairs[empty]
