"""One wave over a map: the points of a face that show it, by the continuity of its arrival time.

At each point the first reflected wave above a threshold is picked. Where that wave fades below the
threshold a later one is picked, and the time jumps there. Two crests of one sign in one record are
at least 0.9 of a wave's width apart (closer ones merge), so that at neighbours i and j

    |t_i - t_j| <= same width    is a step along one wave,
    |t_i - t_j| > other width    is a jump to another one,

where waves change by less than the rest of 0.9 from point to point. The points that steps connect
have one wave if no two neighbours among them jump. Where two do, continuity leads to two waves:
points at such jumps are left out until there are none.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

Mask = NDArray[np.bool_]


# One wave from point to point of a map
SAME_WAVE = 0.5  # of a wave's full width at half maximum: a step along one wave
OTHER_WAVE = 0.75  # of the same width: a jump to another wave; two crests are 0.9 apart
N_NEAREST = 33  # points among which neighbours are sought: of a grid those within 3 steps


def same_wave(points: ArrayLike, time: ArrayLike, width: float) -> Mask:
    """The points (p, 2) of a face whose waves at the times (p,) [s] are one and the same, (p,).

    time is NaN where there is no wave; width [s] is that of a wave at half its height. The result
    is the wave of most points. If these are no more than half of those with a wave, it must come
    before the others at most of its borders; otherwise it cannot be told, and no point has it. A
    point without others keeps its wave.
    """
    points, time = np.asarray(points, float), np.asarray(time, float)
    remaining = np.flatnonzero(np.isfinite(time))
    n_waves = len(remaining)
    while len(remaining):
        # groups of points that steps along one wave connect; a single point has no neighbours
        i, j = remaining[neighbours(points[remaining], N_NEAREST)].T
        jump = np.abs(time[i] - time[j])
        step, torn = jump <= SAME_WAVE * width, jump > OTHER_WAVE * width
        links = coo_array((step[step], (i[step], j[step])), shape=(len(time),) * 2)
        _, group = connected_components(links, directed=False)
        counts = np.bincount(group[remaining])
        inside = group == counts.argmax()

        # a wave of half of the points or fewer must be the first one: count the borders at which
        # another wave comes earlier, and those at which it does itself
        j_later = time[j] > time[i]
        first, second = np.where(j_later, i, j), np.where(j_later, j, i)
        n_preceded = (~inside[first] & inside[second] & ~step).sum()
        n_preceding = (inside[first] & ~inside[second] & ~step).sum()
        if 2 * counts.max() <= n_waves and n_preceded > n_preceding:
            break

        # where continuity leads to both ends of a jump, the points with most of the jumps go
        torn &= inside[i] & inside[j]
        if not torn.any():
            return inside
        jumps = np.bincount(np.concatenate([i[torn], j[torn]]), minlength=len(time))
        remaining = remaining[jumps[remaining] < jumps.max()]
    return np.zeros(len(time), bool)


def neighbours(points: ArrayLike, nearest: int = N_NEAREST) -> NDArray[np.int64]:
    """Pairs (m, 2) of points (p, 2) that have no other one in the circle between them, the edges of
    their Gabriel graph. Of an even grid these are the steps along it and both diagonals. Partners
    are sought among the `nearest` points of each.

    K. R. Gabriel, R. R. Sokal, Systematic Zoology 18 (1969) 259.
    """
    points = np.asarray(points, float)
    tree = KDTree(points)
    n_nearest = min(len(points), nearest)
    nearby = tree.query(points, n_nearest)[1].reshape(len(points), n_nearest)
    pairs = np.column_stack([np.repeat(np.arange(len(points)), n_nearest), nearby.ravel()])
    pairs = np.unique(np.sort(pairs[pairs[:, 0] != pairs[:, 1]], axis=1), axis=0)

    # the circle over a pair is empty if no point lies nearer to its centre than the pair itself
    a, b = points[pairs].transpose(1, 0, 2)
    radius = np.linalg.norm(a - b, axis=1) / 2
    empty = tree.query((a + b) / 2)[0] >= radius * (1 - 1e-9)
    return pairs[empty]
