"""pyYeti's `cbcheck` (extra `verify`) on a Craig-Bampton model whose boundary is made of nodes.

Its flags and printed free-free frequencies are not used: they are absolute, and shifted by 1.
"""

from io import StringIO
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

from rom.reduced_model import ReducedModel


class Checked(NamedTuple):
    """Of a free body; rigid-body modes are about the origin."""

    fixed_interface_hz: NDArray[np.float64]  # (n_modes,)
    rigid_mass: NDArray[np.float64]  # (6, 6) [kg, kg m, kg m^2]
    rigid_residual: float  # |K R| over |K| |R| of the stiffness-based rigid-body modes
    rigid_difference: float  # stiffness- beside geometry-based rigid-body modes


def cbcheck(reduced: ReducedModel, points: NDArray[np.float64]) -> Checked:
    """Check a model whose boundary is x, y, z of points (p, 3) [m], p >= 3, not in a line."""
    from pyyeti import cb
    from pyyeti.nastran import n2p

    n, coordinates = len(points), len(reduced.K)
    shifts = (6 * np.arange(n)[:, None] + np.arange(3)).ravel()  # turns of a node stay empty
    at = np.append(shifts, np.arange(6 * n, coordinates + 3 * n))
    K, M = np.zeros((2, coordinates + 3 * n, coordinates + 3 * n))
    K[np.ix_(at, at)], M[np.ix_(at, at)] = reduced.K, reduced.M
    uset = n2p.addgrid(None, np.arange(1, n + 1).tolist(), "b", 0, points, 0)
    reference = shifts[_determinate(points)]
    found = cb.cbcheck(
        StringIO(), M, K, np.arange(6 * n), reference, uset, rb_norm=True, n_freefree_modes=8
    )
    R = found.rbs
    return Checked(
        np.asarray(found.cb_frq).ravel(),
        R.T @ found.m @ R,
        float(np.abs(found.k @ R).max() / (np.abs(found.k).max() * np.abs(R).max())),
        float(np.abs(R[shifts] - found.rbg[shifts]).max() / np.abs(found.rbg).max()),
    )


def _determinate(points: NDArray[np.float64]) -> NDArray[np.int64]:
    """Six of the dofs that hold a rigid body: the best conditioned of its rigid motions."""
    shifts = np.tile(np.eye(3), (len(points), 1))
    turns = np.vstack([np.cross(np.eye(3), p).T for p in points])
    span = np.ptp(points, axis=0).max()
    _, _, order = qr(np.hstack([shifts, turns / span]).T, pivoting=True)
    return np.sort(order[:6])
