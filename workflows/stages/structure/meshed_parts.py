"""The result of the mesh stage."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from skfem import Mesh

from beadwave import fem
from beadwave.fem.contact.facing_facets import FacingFacets
from beadwave.geometry.cad.removals import Removal
from beadwave.geometry.cad.struck_face import Struck
from beadwave.geometry.drawing import nodes_of
from beadwave.geometry.meshing.size_field import SizeField
from beadwave.workflows.stages.structure.bolted_joints import BoltedPlace, FacesInContact

STRIKE = "strike"  # name of the face that the chain leans on


class ElementSizes(NamedTuple):
    """Sizes of elements in place of those by a body's shape."""

    fields: Mapping[str, SizeField] = MappingProxyType({})  # by body
    # times the sizes by a body's shape, of bodies without a seed: with a field its upper bound
    usual: float = 1.0
    scale: float = 1.0  # times all sizes, of prescribed lines as well
    # (2, 3) [m] lower and upper corner of each body that a field is of: the field of a body that
    # has another box now is stretched onto it
    boxes: Mapping[str, NDArray[np.float64]] = MappingProxyType({})
    curved: bool = False  # whether elements follow curved faces, with fewer edges around circles
    # whether elements at a contact are as small as its patch; else only where its seed is given
    fine: bool = True


class SolvedMesh(NamedTuple):
    """A mesh of the search, and what was stated of it."""

    unknowns: int
    elements: int
    stated: float  # the largest relative error
    seconds: float


class LeftOutPart(NamedTuple):
    """A feature that a mesh leaves out, and what that changes."""

    body: str
    faces: tuple[str, ...]  # "body@x,y,z"
    size_m: float
    error: float  # relative, of what it changes most


class AdaptedSizes(NamedTuple):
    """The sizes chosen, and how they were found."""

    sizes: ElementSizes
    asked: float
    stated: float
    floor: float  # of the stated error, which no mesh lowers
    bounded_by: str | None  # what ended the search above the error asked; None where it is met
    unknowns_for_asked: float | None  # foreseen, where a bound ended it
    seconds_for_asked: float | None
    where: str  # the place of most of the error
    meshes: tuple[SolvedMesh, ...]
    left_out: tuple[LeftOutPart, ...] = ()


class Parts(NamedTuple):
    """Meshed bodies, and how they are joined, held, struck and loaded."""

    meshes: dict[str, Mesh]  # by body, with named faces
    materials: dict[str, fem.Material | fem.Orthotropic]  # by body
    connections: fem.Connections
    rigid: fem.Connections  # with rigid joints, and with ties over all that touches
    struck: Struck | None = None  # None: a scene without a strike
    struck_by_chains: Mapping[str, Struck] = MappingProxyType({})  # by name, of several chains
    load: fem.Load | None = None  # static, before the impact
    sizes: ElementSizes = ElementSizes()  # that it was meshed with
    bolted: tuple[BoltedPlace, ...] = ()  # places of bolts that are known from their drawing
    closed: tuple[fem.Tie, ...] = ()  # the faces that these bolts press, as if they were tied
    in_contact: tuple[FacesInContact, ...] = ()  # under these bolts and loads, of `contacts`
    boxes: Mapping[str, NDArray[np.float64]] = MappingProxyType({})  # as those of `ElementSizes`
    # by body the volume of its mesh over its own, less 1: elements cut curved faces short
    chords: Mapping[str, float] = MappingProxyType({})
    left_out: tuple[Removal, ...] = ()  # features that the meshes have not

    @property
    def assembled(self) -> fem.Connections:
        """The connections without the joints whose faces are in contact."""
        pressed = {place.number for place in self.bolted if place.in_contact}
        joints = [j for i, j in enumerate(self.connections.joints) if i not in pressed]
        return self.connections._replace(joints=joints)

    @property
    def contacts(self) -> tuple[fem.Tie, ...]:
        """Pairs of faces in contact, in the order of `in_contact`; the slave carries the
        pressure."""
        return tuple(
            next(tie for tie in self.closed if tie.slave.partition(":")[2] == faces.pair)
            for faces in self.in_contact
        )

    @property
    def touching_alone(self) -> list[tuple[str, str]]:
        """Pairs of bodies whose faces are in contact and that no bolt joins."""
        return [
            (faces.pair.split("|")[0], faces.pair.split("|")[1])
            for faces in self.in_contact
            if not self.bolts_of(faces)
        ]

    @property
    def rods(self) -> tuple[fem.Rod, ...]:
        """Bolts that press faces in contact."""
        return tuple(place.rod for place in self.bolted if place.rod is not None)

    def bolts_of(self, faces: FacesInContact) -> list[BoltedPlace]:
        """The bolts between two faces in contact."""
        bodies = {*faces.pair.split("|")}
        return [p for p in self.bolted if p.in_contact and {*p.pair.split("|")} == bodies]

    def pressed_groups(
        self, facets: FacingFacets
    ) -> tuple[list[tuple[str, BoltedPlace | None]], NDArray[np.int64]]:
        """Groups of facets in contact that one bolt presses, the nearest one of those between its
        two faces, or all of a pair of faces without bolts: their joints with the bolts, and the
        group (m,) of each facet."""
        groups: list[tuple[str, BoltedPlace | None]] = []
        of_facet = np.zeros(len(facets.area), np.int64)
        for i, faces in enumerate(self.in_contact):
            mine, bolts = facets.pair == i, self.bolts_of(faces)
            nearest = 0
            if bolts:
                centres = np.array([place.centre for place in bolts])
                off = facets.points[mine][:, None] - centres
                nearest = np.linalg.norm(off, axis=2).argmin(axis=1)
            of_facet[mine] = len(groups) + nearest
            groups += [(place.joint, place) for place in bolts] or [(faces.joint, None)]
        return groups, of_facet

    def face(self, name: str) -> str:
        """A named face as "body:name"."""
        return next(f"{b}:{name}" for b, m in self.meshes.items() if name in (m.boundaries or {}))

    def facets(self, name: str) -> NDArray[np.int64]:
        """Numbers (m,) in their body's mesh of the facets of a face "body:name"."""
        body, _, face = name.partition(":")
        return np.asarray(self.meshes[body].boundaries[face])

    @property
    def nodes(self) -> dict[str, float]:
        """Number of nodes of quadratic elements by body: corners and middles of edges."""
        return nodes_of(self.meshes)
