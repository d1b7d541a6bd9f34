"""A plate of hexahedra, fine where it is struck; a mirror plane may end it at that point.

    z
    |________________________
   /|                        |     struck on +x, at z = 0
x / |________________________| y   body "plate", faces "plate:-x" .. "plate:+z"
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from beadwave.geometry.meshing.grid_lines import Stop, graded, lines_through, refined

if TYPE_CHECKING:  # see `lined`
    from skfem import MeshHex


class Extent(NamedTuple):
    """Position of a plate's edges [m]."""

    y: tuple[float, float]
    z: tuple[float, float]


def plate_mesh(
    thickness: float,
    extent: Extent,
    *,
    seed: float,
    contact_seed: float,
    struck_y: tuple[float, float] = (0.0, 0.0),
    end_seed: float | None = None,
) -> MeshHex:
    """A plate between x = -thickness and x = 0.

    Elements have `contact_seed` [m] at the struck face, at z = 0 and from one to the other of
    `struck_y` [m], and grow to `seed` away from there; at both ends of y they have `end_seed` [m].
    """
    from skfem import MeshHex

    # along y even elements over what is struck, growing to either side of it
    (lower, upper), (start, end) = extent.y, struck_y
    even = np.linspace(start, end, round((end - start) / contact_seed) + 1)
    ends = [Stop(at) if end_seed is None else refined(at, end_seed) for at in extent.y]
    struck = refined(start, contact_seed), refined(end, contact_seed)
    # a mirror in the middle of the strike leaves nothing on its other side
    below = lines_through([ends[0], struck[0]], seed)[:-1] if start - lower > 1e-12 else []
    above = lines_through([struck[1], ends[1]], seed)[1:] if upper - end > 1e-12 else []
    lines = (
        # at least two layers of elements through the thickness
        graded(-thickness, 0.0, 0.0, contact_seed, min(seed, thickness / 2)),
        np.concatenate([below, even, above]),
        graded(*extent.z, 0.0, contact_seed, seed),
    )
    mesh = MeshHex.init_tensor(*lines)
    faces = {}
    for axis, letter in enumerate("xyz"):
        for sign, side in (("-", 0), ("+", -1)):
            level = lines[axis][side]
            faces[f"plate:{sign}{letter}"] = mesh.facets_satisfying(
                lambda x, axis=axis, level=level: np.abs(x[axis] - level) < 1e-9,
                boundaries_only=True,
            )
    return mesh.with_subdomains({"plate": np.arange(mesh.nelements)}).with_boundaries(faces)
