"""A Craig-Bampton model of a free block in pyYeti, by its `cbcheck` (extra `verify`).

Its arrays are taken relatively; its flags and printed free-free frequencies are not used: they are
absolute, and shifted by 1.
"""

from io import StringIO
from itertools import product
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import qr
from skfem import MeshHex

from beadwave import fem, rom

from peer_programs import require_module

SOURCE = "pyYeti, cb.cbcheck"
EXACT = "the block's density and sides"

pytestmark = pytest.mark.peer


@pytest.fixture(autouse=True, scope="module")
def needed():
    require_module("pyyeti")


class CbCheck(NamedTuple):
    """pyYeti's checks of a free body; rigid-body modes are about the origin."""

    fixed_interface_hz: NDArray[np.float64]  # (n_modes,)
    rigid_mass: NDArray[np.float64]  # (6, 6) [kg, kg m, kg m^2]
    rigid_residual: float  # |K R| over |K| |R| of the stiffness-based rigid-body modes
    rigid_difference: float  # stiffness- beside geometry-based rigid-body modes


def cbcheck(reduced: rom.ReducedModel, points: NDArray[np.float64]) -> CbCheck:
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


def test_pyyeti_finds_frequencies_mass_and_inertia_of_a_free_block(compare):
    """Fixed-interface frequencies, rigid-body motions, mass and inertia."""
    sides, steel = (0.13, 0.10, 0.04), fem.Material(210e9, 0.3, 7850.0)  # m
    lines = [np.linspace(0, side, n) for side, n in zip(sides, (5, 4, 3), strict=True)]
    block = fem.assemble({"block": MeshHex.init_tensor(*lines)}, {"block": steel})

    # Craig-Bampton with the nodes at the block's eight corners as boundary
    corners = np.array([*product(*((0.0, side) for side in sides))])
    distance = np.linalg.norm(block.points[None] - corners[:, None], axis=2)
    boundary = (3 * distance.argmin(axis=1)[:, None] + np.arange(3)).ravel()
    w = np.eye(1, block.n_dofs, boundary[0])[0]
    boundary = np.sort(boundary)
    reduced = rom.craig_bampton(block.K, block.M, w, boundary, rom.Selection(n_modes=40))
    theirs = cbcheck(reduced, block.points[boundary[::3] // 3])

    hz = np.sqrt(np.diag(reduced.K)[reduced.n_boundary :]) / (2 * np.pi)
    compare("free block, fixed-interface frequencies [Hz]", hz, theirs.fixed_interface_hz,
            allowed=1e-9, source=SOURCE)  # fmt: skip
    a, b, h = sides
    m = steel.density * a * b * h
    inertia = m / 3 * np.array([b * b + h * h, a * a + h * h, a * a + b * b])
    rigid = np.diag(theirs.rigid_mass)
    compare("free block, mass by its rigid motions [kg]", rigid[:3], np.full(3, m),
            allowed=1e-9, source=EXACT)  # fmt: skip
    compare("free block, inertia by its rigid motions [kg m^2]", rigid[3:], inertia,
            allowed=1e-9, source=EXACT)  # fmt: skip
    compare("free block, K on rigid motions", theirs.rigid_residual, 0.0,
            allowed=1e-9, of=1.0, source=SOURCE)  # fmt: skip
    compare("free block, rigid motions of K and of places", theirs.rigid_difference, 0.0,
            allowed=1e-9, of=1.0, source=SOURCE)  # fmt: skip
