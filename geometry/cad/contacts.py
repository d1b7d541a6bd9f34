"""Numbers of bodies that touch, nearly touch or overlap, for every way of finding them.

`geometry.cad.touching` finds it on the CAD, `geometry.own_mesh.faceted_touching` on the facets of
meshes.
"""

from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from beadwave.geometry.cad.solids import SAME, Body
from beadwave.geometry.errors import InvalidGeometry

NEARLY_TOUCHING = 1e-3  # m, bodies closer than this that do not touch are reported; not varied
# of the smaller face: a smaller common area is the rounding of an intersection, and faces whose
# areas differ by less end together; not varied
MIN_COMMON_AREA = 1e-6


class FaceContact(NamedTuple):
    """Two faces that touch."""

    faces: tuple[int, int]  # tags
    area: float  # m^2
    gap: float  # m, mean distance of the two
    regions: tuple[int, ...]  # tags of their common part, surfaces in the CAD model
    flush: bool  # both faces end where the other does


class TouchingPair(NamedTuple):
    """Two bodies that touch."""

    bodies: tuple[str, str]
    contacts: tuple[FaceContact, ...]

    @property
    def name(self) -> str:
        """Names of both bodies, "a|b"."""
        return "|".join(self.bodies)

    @property
    def area(self) -> float:
        """Area in common [m^2]."""
        return sum(contact.area for contact in self.contacts)

    @property
    def gap(self) -> float:
        """Largest mean distance of two faces that touch [m]."""
        return max(contact.gap for contact in self.contacts)

    def covers(self, body: str) -> Iterator[tuple[str, int]]:
        """Faces (body, tag) of the partner that touch one of this body."""
        if body in self.bodies:
            i = 1 - self.bodies.index(body)
            yield from ((self.bodies[i], contact.faces[i]) for contact in self.contacts)


class NearMiss(NamedTuple):
    """Two bodies that do not touch over an area: a line or a point where the distance is 0."""

    bodies: tuple[str, str]
    distance: float  # m
    at: np.ndarray  # (3,) [m], where they are closest

    @property
    def sentence(self) -> str:
        """The pair, its distance and where, as a sentence."""
        a, b = self.bodies
        at = "[{:.4g}, {:.4g}, {:.4g}] m".format(*(self.at.round(9) + 0.0))
        if self.distance < SAME:
            return (
                f'"{a}" and "{b}" meet along a line or at a point, near {at}, and touch over no '
                "area: nothing can be tied there."
            )
        return (
            f'"{a}" and "{b}" miss each other by {1e3 * self.distance:.4g} mm, near {at}; '
            "faces closer than gap touch."
        )


class Overlap(NamedTuple):
    """Two bodies of which one fills part of the other."""

    bodies: tuple[str, str]
    volume: float  # m^3
    inside: str | None  # the body that lies wholly in the other


class Neighbours(NamedTuple):
    """All pairs of bodies that touch, nearly touch, or overlap."""

    touching: tuple[TouchingPair, ...]
    misses: tuple[NearMiss, ...]
    overlaps: tuple[Overlap, ...]

    def free(self, bodies: Mapping[str, Body]) -> tuple[str, ...]:
        """Bodies that touch none."""
        touched = {name for touch in self.touching for name in touch.bodies}
        return tuple(name for name in bodies if name not in touched)

    def over(
        self, body: str, points: np.ndarray, bodies: Mapping[str, Body], gap: float
    ) -> str | None:
        """The body that touches this one at one of the points (n, 3) of its surface, if any."""
        faces = (face for touch in self.touching for face in touch.covers(body))
        return next(
            (name for name, tag in faces for p in points if bodies[name].distance(p, tag) <= gap),
            None,
        )


def joined_groups(names: Iterable[str], pairs: Iterable[tuple[str, str]]) -> list[list[str]]:
    """The names in groups that pairs join, in their order."""
    names = list(names)
    number = {name: i for i, name in enumerate(names)}
    i, j = np.array([(number[a], number[b]) for a, b in pairs], np.int64).reshape(-1, 2).T
    joined = csr_array((np.ones(len(i)), (i, j)), shape=(len(names), len(names)))
    n, group = connected_components(joined, directed=False)
    return [[name for name, g in zip(names, group, strict=True) if g == k] for k in range(n)]


def require_apart(neighbours: Neighbours) -> None:
    """Raises InvalidGeometry for bodies that overlap, with the volume and what to do."""
    for overlap in neighbours.overlaps:
        a, b = overlap.bodies
        if overlap.inside:
            outer = b if overlap.inside == a else a
            raise InvalidGeometry(
                f'"{overlap.inside}" lies inside "{outer}", which is solid there; cut it out of '
                f'"{outer}" or remove it.'
            )
        raise InvalidGeometry(
            f'"{a}" and "{b}" overlap by {1e9 * overlap.volume:.4g} mm^3; cut one out of the '
            "other or move it."
        )
