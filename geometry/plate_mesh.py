"""A plate of hexahedra, fine where it is struck; a mirror plane may end it at that point.

    z
    |________________________
   /|                        |     struck on +x, at z = 0
x / |________________________| y   body "plate", faces "plate:-x" .. "plate:+z"
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from skfem import MeshHex

from geometry.grid_lines import graded

LAYERS = 2  # of elements through the thickness, at least
ON_EDGE = 1e-9  # m


class Extent(NamedTuple):
    """Where a plate's edges lie [m]."""

    y: tuple[float, float]
    z: tuple[float, float]


def plate_mesh(
    thickness: float,
    extent: Extent,
    *,
    seed: float,
    contact_seed: float,
    struck_y: tuple[float, float] = (0.0, 0.0),
) -> MeshHex:
    """A plate between x = -thickness and x = 0.

    Elements have `contact_seed` [m] at the struck face, at z = 0 and from one to the other of
    `struck_y` [m], and grow to `seed` away from there.
    """
    lines = (
        graded(-thickness, 0.0, 0.0, contact_seed, min(seed, thickness / LAYERS)),
        _fine_between(extent.y, struck_y, contact_seed, seed),
        graded(*extent.z, 0.0, contact_seed, seed),
    )
    mesh = MeshHex.init_tensor(*lines)
    faces = {
        f"plate:{sign}{letter}": _facets_at(mesh, axis, lines[axis][end])
        for axis, letter in enumerate("xyz")
        for sign, end in (("-", 0), ("+", -1))
    }
    return mesh.with_subdomains({"plate": np.arange(mesh.nelements)}).with_boundaries(faces)


def _fine_between(
    edges: tuple[float, float], struck: tuple[float, float], fine: float, coarse: float
) -> NDArray[np.float64]:
    (lower, upper), (first, last) = edges, struck
    before = graded(lower, first, first, fine, coarse)[:-1]
    between = np.linspace(first, last, round((last - first) / fine) + 1)
    after = graded(last, upper, last, fine, coarse)[1:]
    return np.concatenate([before, between, after])


def _facets_at(mesh: MeshHex, axis: int, value: float) -> NDArray[np.int32]:
    return mesh.facets_satisfying(lambda x: np.abs(x[axis] - value) < ON_EDGE, boundaries_only=True)
