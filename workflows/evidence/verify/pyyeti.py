"""A Craig-Bampton model of a free block in pyYeti, whose returned arrays are taken relatively."""

from collections.abc import Iterator
from functools import partial
from itertools import product

import numpy as np
from skfem import MeshHex

import fem
import rom
from workflows.evidence.verify.cbcheck import cbcheck
from workflows.evidence.verify.comparisons import Comparison, compared, require_module

SOURCE = "pyYeti, cb.cbcheck"
EXACT = "the block's density and sides"


def pyyeti() -> Iterator[Comparison]:
    """Fixed-interface frequencies, rigid-body motions, mass and inertia of a free block."""
    require_module("pyyeti")
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

    row = partial(compared, allowed=1e-9)
    hz = np.sqrt(np.diag(reduced.K)[reduced.n_boundary :]) / (2 * np.pi)
    yield row("free block, fixed-interface frequencies [Hz]", hz, theirs.fixed_interface_hz,
              source=SOURCE)  # fmt: skip
    a, b, h = sides
    m = steel.density * a * b * h
    inertia = m / 3 * np.array([b * b + h * h, a * a + h * h, a * a + b * b])
    rigid = np.diag(theirs.rigid_mass)
    yield row("free block, mass by its rigid motions [kg]", rigid[:3], np.full(3, m), source=EXACT)
    yield row("free block, inertia by its rigid motions [kg m^2]", rigid[3:], inertia, source=EXACT)
    yield row("free block, K on rigid motions", theirs.rigid_residual, 0.0, of=1.0, source=SOURCE)
    yield row("free block, rigid motions of K and of places", theirs.rigid_difference, 0.0,
              of=1.0, source=SOURCE)  # fmt: skip
