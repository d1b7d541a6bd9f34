"""pyYeti's `cbcheck` (extra `verify`) on a Craig-Bampton model whose boundary is made of nodes.

Its flags and printed free-free frequencies are not used: they are absolute, and shifted by 1.
"""

from io import StringIO
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

from rom.reduced_model import ReducedModel


class CbCheck(NamedTuple):
    """pyYeti's checks of a free body; rigid-body modes are about the origin."""

    fixed_interface_hz: NDArray[np.float64]  # (n_modes,)
    rigid_mass: NDArray[np.float64]  # (6, 6) [kg, kg m, kg m^2]
    rigid_residual: float  # |K R| over |K| |R| of the stiffness-based rigid-body modes
    rigid_difference: float  # stiffness- beside geometry-based rigid-body modes


def cbcheck(reduced: ReducedModel, points: NDArray[np.float64]) -> CbCheck:
    """Check a model whose boundary is x, y, z of points (p, 3) [m], p >= 3, not in a line.

    Raises ImportError without pyYeti.
    """
    from pyyeti import cb
    from pyyeti.nastran import n2p

    # pyYeti's nodes have six dofs: the turns of ours stay empty
    n, coordinates = len(points), len(reduced.K)
    shifts = (6 * np.arange(n)[:, None] + np.arange(3)).ravel()
    filled = np.append(shifts, np.arange(6 * n, coordinates + 3 * n))
    K, M = np.zeros((2, coordinates + 3 * n, coordinates + 3 * n))
    K[np.ix_(filled, filled)], M[np.ix_(filled, filled)] = reduced.K, reduced.M
    uset = n2p.addgrid(None, np.arange(1, n + 1).tolist(), "b", 0, points, 0)

    # six dofs that hold the body: those in which its rigid motions are the best conditioned
    turns = np.vstack([np.cross(np.eye(3), p).T for p in points])
    rigid = np.hstack([np.tile(np.eye(3), (n, 1)), turns / np.ptp(points, axis=0).max()])
    _, _, order = qr(rigid.T, pivoting=True)
    reference = shifts[np.sort(order[:6])]

    check = cb.cbcheck(
        StringIO(), M, K, np.arange(6 * n), reference, uset, rb_norm=True, n_freefree_modes=8
    )
    R = check.rbs
    return CbCheck(
        np.asarray(check.cb_frq).ravel(),
        R.T @ check.m @ R,
        float(np.abs(check.k @ R).max() / (np.abs(check.k).max() * np.abs(R).max())),
        float(np.abs(R[shifts] - check.rbg[shifts]).max() / np.abs(check.rbg).max()),
    )
