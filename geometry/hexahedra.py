"""Hexahedra of a body that is an extrusion: quadrilaterals of its base, in layers.

Layers end where a part of a side that a partner touches ends.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from skfem import MeshHex

from geometry.cad import distance
from geometry.facets import facets_of, triangles
from geometry.hex_mesh import EXTRUDED
from geometry.imprint import Region
from geometry.prism import Imprints, Prism, SidePatch, imprints, prisms
from geometry.quads import Flat, flat_mesh, spaced
from geometry.roundness import enclosing, full_cylinders
from geometry.selectors import Selected
from geometry.sizes import Size, size_at
from geometry.solids import SAME, Body, Face, off_axis


class Layers(NamedTuple):
    """A base and its copies above each other; node i of layer k has the number i + k n."""

    prism: Prism
    flat: Flat
    edges: NDArray[np.int64]  # (m, 2) around the base
    under: NDArray[np.int64]  # (m,) tag of the side that stands on each
    heights: NDArray[np.float64]  # (k,) [m]

    def cap(self, part: int, on: int) -> NDArray[np.int64]:
        """Corners (., 4) of a part of the face `on`, base or top."""
        below = any(face.tag == on for face in self.prism.base)
        top = 0 if below else (len(self.heights) - 1) * len(self.flat.p)
        return self.flat.quads[self.flat.parts[part]] + top

    def wall(self, edges: NDArray[np.int64], lower: float, upper: float) -> NDArray[np.int64]:
        """Corners (., 4) above edges, from one height to another."""
        middle = (self.heights[1:] + self.heights[:-1]) / 2
        layers = np.flatnonzero((middle > lower) & (middle < upper))
        low = (edges[None] + layers[:, None, None] * len(self.flat.p)).reshape(-1, 2)
        return np.concatenate([low, low[:, ::-1] + len(self.flat.p)], axis=1)

    def face(self, tag: int) -> NDArray[np.int64]:
        """Corners (., 4) of a whole face."""
        if tag in self.flat.parts:
            return self.cap(tag, tag)
        return self.wall(self.edges[self.under == tag], 0, self.prism.height)

    def patch(self, patch: SidePatch, gap: float) -> NDArray[np.int64]:
        """Corners (., 4) of a part of a side, given to within the gap."""
        side = next(face for face in self.prism.sides if face.tag == patch.region.on)
        edges = self.edges[self.under == side.tag]
        between = (patch.lower + patch.upper) / 2 * self.prism.axis
        middle = _on(side, self.flat.p[edges].mean(axis=1)) + between
        inside = [distance(point, patch.region.tag) < SAME + 2 * gap for point in middle]
        return self.wall(edges[np.array(inside, dtype=bool)], patch.lower, patch.upper)


def hexahedra(
    body: Body,
    wanted: Mapping[str, Sequence[Region]],
    named: Mapping[str, Selected],
    size: Size,
    gap: float,
) -> MeshHex | None:
    """The body in hexahedra with its boundaries, None where it is no extrusion.

    The same boundaries as of tetrahedra; the regions are left for those.
    """
    for prism in prisms(body):
        marks = imprints(prism, wanted)
        flat = flat_mesh(prism, marks, _below(prism, size), gap) if marks else None
        if flat is not None:
            layers = _layers(prism, marks, flat, size)
            corners = _corners(layers, marks, wanted, gap)
            corners |= {
                name: np.concatenate([layers.face(tag) for tag in picked.tags])
                for name, picked in named.items()
                if picked.body == body.name
            }
            return _mesh(body, layers, corners, gap)
    return None


def _below(prism: Prism, size: Size) -> Size:
    fine = (f._replace(point=prism.foot(f.point)) for f in size.fine)
    return size._replace(fine=tuple(fine))


def _layers(prism: Prism, marks: Imprints, flat: Flat, size: Size) -> Layers:
    stops = [end for patch in marks.sides.values() for end in (patch.lower, patch.upper)]
    foot = prism.base[0].centre @ prism.axis
    edges = [] if size.edge else [*_sharp_heights(prism, marks)]
    heights = spaced(
        [0.0, prism.height, *stops],
        lambda z: size_at(size, z + foot, prism.axis, np.add(foot, edges)),
    )
    flat = _anticlockwise(flat, prism)
    sides = np.sort(flat.quads[:, [[0, 1], [1, 2], [2, 3], [3, 0]]].reshape(-1, 2))
    edges, count = np.unique(sides, axis=0, return_counts=True)
    rim = edges[count == 1]
    return Layers(prism, flat, rim, _standing(prism, flat.p[rim]), heights)


def _sharp_heights(prism: Prism, marks: Imprints) -> Iterator[float]:
    """Where stresses are singular, above the base."""
    for patch in marks.sharp:
        yield from (patch.lower, patch.upper)
    below = {face.tag for face in prism.base}
    for region in marks.base.values():
        if region.sharp:
            yield 0.0 if region.on in below else prism.height


def _anticlockwise(flat: Flat, prism: Prism) -> Flat:
    """Seen against the axis, so that all hexahedra are right-handed."""
    p, q = flat.p, flat.quads.copy()
    diagonals = p[q[:, 2]] - p[q[:, 0]], p[q[:, 3]] - p[q[:, 1]]
    turned = np.cross(*diagonals) @ prism.axis < 0
    q[turned] = q[turned][:, ::-1]
    return flat._replace(quads=q)


def _standing(prism: Prism, ends: NDArray[np.float64]) -> NDArray[np.int64]:
    """Tag of the side that stands on each edge (m, 2, 3)."""
    off = np.array([_off(side, ends).max(axis=1) for side in prism.sides])
    tags = np.array([side.tag for side in prism.sides])
    under = tags[np.argmin(off, axis=0)]
    # of sides in one plane, or on one cylinder, the nearest
    for i in np.flatnonzero(np.sum(off < 2 * SAME, axis=0) > 1):
        middle = ends[i].mean(axis=0)[None] + prism.height / 2 * prism.axis
        near = [side for side, away in zip(prism.sides, off[:, i], strict=True) if away < 2 * SAME]
        under[i] = min(near, key=lambda side, p=middle: distance(_on(side, p)[0], side.tag)).tag
    return under


def _off(side: Face, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance of points (..., 3) from the surface of a side."""
    if side.normal is not None:
        return np.abs((points - side.centre) @ side.normal)
    return np.abs(off_axis(points, side.on_axis, side.axis) - side.radius)


def _on(side: Face, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (n, 3) of chords moved onto the side."""
    if side.axis is None:
        return points
    rho = points - side.on_axis
    rho -= np.outer(rho @ side.axis, side.axis)
    return points + (side.radius / np.linalg.norm(rho, axis=1, keepdims=True) - 1) * rho


def _corners(
    layers: Layers, marks: Imprints, wanted: Mapping[str, Sequence[Region]], gap: float
) -> dict[str, NDArray[np.int64]]:
    found = {}
    for name, regions in wanted.items():
        parts = [
            layers.patch(marks.sides[region.tag], gap)
            if region.tag in marks.sides
            else layers.cap(region.tag, region.on)
            for region in regions
        ]
        found[name] = np.unique(np.concatenate(parts), axis=0)
    return found


def _mesh(body: Body, layers: Layers, corners: dict, gap: float) -> MeshHex:
    n = len(layers.flat.p)
    p = layers.flat.p + layers.heights[:, None, None] * layers.prism.axis
    p = _enclosing(p.reshape(-1, 3), body, layers, gap)
    quads = layers.flat.quads + np.arange(len(layers.heights) - 1)[:, None, None] * n
    quads = quads.reshape(-1, 4).T
    t = np.concatenate([quads, quads + n])[EXTRUDED]
    mesh = MeshHex(np.ascontiguousarray(p.T), np.ascontiguousarray(t))
    return mesh.with_boundaries({name: facets_of(mesh, found) for name, found in corners.items()})


def _enclosing(p, body: Body, layers: Layers, gap: float) -> NDArray[np.float64]:
    cylinders = full_cylinders(body.tag, gap)
    tags = [face.tag for cylinder in cylinders for face in cylinder.faces]
    return enclosing(p, {tag: triangles(layers.face(tag)) for tag in tags}, cylinders)
