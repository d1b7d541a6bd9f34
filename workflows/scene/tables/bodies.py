"""Tables of any assembly: bodies, materials, joints, supports, the strike, measured modes.

Faces are picked by the selectors of `geometry.cad.selectors`, pairs of bodies by "a|b"; a * in a
name stands for any letters.
"""

from collections.abc import Iterator, Mapping
from fnmatch import fnmatchcase
from itertools import pairwise
from math import isinf
from re import split
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Discriminator, Field, Tag, model_validator

from beadwave.workflows.scene.named_files import FileName
from beadwave.workflows.scene.quantities import Quantity, of
from beadwave.workflows.scene.scene_table import (
    Density,
    Frequency,
    Length,
    NonNegative,
    Number,
    PatchRadius,
    Point,
    Positive,
    Ratio,
    SceneTable,
    Seed,
    Spring,
    Vector,
    YieldStress,
    one_or_each,
    text_or_table,
)
from beadwave.workflows.scene.tables.bolts import CONTACT, FromDrawing
from beadwave.workflows.scene.tables.mesh import AskedOfMesh
from beadwave.workflows.scene.tables.shakers import Face
from beadwave.workflows.scene.units import FORCE, FREQUENCY, LENGTH, PRESSURE

GROUND = "ground"
THREAD = "thread"  # a shank in a bore, in place of holes
SHARE = "share"  # of the common face, in place of a washer
SHAPES = ("box", "plate", "cylinder")
LONGEST_BAR = 20  # length of a bar drawn as a plate, over the longer side of its outline
Modulus = of(Positive, PRESSURE, 1e6, 2e12)  # rubber to diamond
Compressible = Annotated[float, Field(gt=-1, lt=0.5)]  # an incompressible solid locks
Ratio12 = Annotated[float, Field(gt=-10, lt=10)]  # of an orthotropic solid; its moduli bound it
Size = of(Positive, LENGTH, 1e-5, 50)
Place = of(Number, LENGTH, 0, 100)
PlaceOnFace = Annotated[tuple[Place, ...], Field(strict=False, min_length=2, max_length=3)]
Place3 = Annotated[tuple[Place, Place, Place], Field(strict=False, description="x, y, z")]
Corner = Annotated[tuple[Length, Length], Field(strict=False, description="x, y")]
AngleHeight = Annotated[
    tuple[float, Length], Field(strict=False, description="angle [degrees], height [m]")
]
Sides = Annotated[tuple[Size, Size, Size], Field(strict=False, description="lengths along x, y, z")]
Three = Annotated[tuple[Modulus, Modulus, Modulus], Field(strict=False)]


def _plain_name(name: str) -> str:
    """A name that is no part of a path and no selector."""
    special = set(name) & set(':|@#,"/\\') or not name.isprintable() or name != name.strip()
    if special or not name or name.startswith("."):
        raise ValueError(
            f'{name!r} must be free of : | @ # , " / and \\, without a blank at its ends or a dot '
            "at its start: rename it"
        )
    return name


def _body_name(name: str) -> str:
    if name == GROUND:
        raise ValueError(f"{name!r} is what bodies stand on: rename it")
    return _plain_name(name)  # of a STEP file it may have dots


def _material_name(name: str) -> str:
    if "." in name:
        raise ValueError(f"{name!r} must be free of dots, which part the words of a key: rename it")
    return _plain_name(name)


def _pair(between: str) -> str:
    sides = [side.strip() for side in between.split("|")]
    if len(sides) != 2 or not all(sides):
        raise ValueError(f'{between!r} must name two bodies: write "a|b"')
    return between


BodyName = Annotated[str, AfterValidator(_body_name)]
MaterialName = Annotated[str, AfterValidator(_material_name)]
Pair = Annotated[str, AfterValidator(_pair)]


class Solid(SceneTable):
    """A material. An orthotropic one has three moduli along its axes 1, 2, 3, the ratios 12, 13
    and 23, the shear moduli 12, 13 and 23, and `axes`: the direction of 1, and another one for 2.
    """

    young: one_or_each(Modulus)  # [Pa] Young's modulus, or three of an orthotropic material
    poisson: one_or_each(Ratio12)  # Poisson's ratio, or those of 12, 13, 23
    density: Density  # [kg/m^3] mass over volume
    yield_stress: YieldStress | None = None  # [Pa] beyond which a run warns
    shear: Three | None = None  # [Pa] shear moduli 12, 13, 23
    # directions of the axis 1 and of another one for 2
    axes: Annotated[tuple[Vector, Vector], Field(strict=False)] | None = None
    # [1/K] thermal expansion of its length
    expansion: Annotated[float, Field(gt=-1e-3, lt=1e-3)] | None = None

    @property
    def is_isotropic(self) -> bool:
        return not isinstance(self.young, tuple)

    @model_validator(mode="after")
    def _isotropic_or_orthotropic(self) -> "Solid":
        """One modulus and ratio, between the limits of positive energy, or three with three G."""
        if self.is_isotropic and (self.shear or self.axes):
            raise ValueError("shear and axes belong to three moduli: drop them, or give three")
        numbers = self.young, self.poisson
        if not self.is_isotropic and not all(isinstance(x, tuple) and len(x) == 3 for x in numbers):
            raise ValueError("young and poisson must be one number or three, both alike: change it")
        if not self.is_isotropic and self.shear is None:
            raise ValueError("three moduli need shear = [G12, G13, G23] in Pa: add it")
        if self.is_isotropic and (isinstance(self.poisson, tuple) or not -1 < self.poisson < 0.5):
            raise ValueError(f"poisson = {self.poisson} must be between -1 and 0.5: change it")
        return self


class PlateTable(SceneTable):
    """A plate: its outline in its own x-y plane, extruded along z."""

    # [m] corners in its x-y plane; its origin is that of these coordinates, on its lower face
    outline: Annotated[tuple[Corner, ...], Field(strict=False, min_length=3)]
    thickness: Size  # [m] along its z, from z = 0 up

    def narrowed(self, name: str, quantity: Quantity) -> Quantity:
        """The usual range of its number `name`: a thickness is at most that of a bar with this
        outline, so that one in millimetres in an outline in metres is asked about."""
        if name != "thickness":
            return quantity
        side = max(max(along) - min(along) for along in zip(*self.outline, strict=True))
        if not quantity.low < LONGEST_BAR * side < quantity.high:
            return quantity
        of_high = f"{LONGEST_BAR} times the longer side of its outline"
        return quantity._replace(high=float(f"{LONGEST_BAR * side:.3g}"), of_high=of_high)


class Holes(SceneTable):
    """Round holes of one diameter through a plate or a cylinder; several of these tables,
    [[bodies.NAME.holes]], for several diameters."""

    diameter: Size  # [m] of all holes that this table drills
    # [m] x, y of holes along z: of a plate as in its outline, of a cylinder from its axis
    at: Annotated[tuple[Corner, ...], Field(strict=False, min_length=1)] | None = None
    # [degrees, m] of holes into the round face of a cylinder, towards its axis: the angle about its
    # z in degrees, from x, and the height on z from its middle
    around: Annotated[tuple[AngleHeight, ...], Field(strict=False, min_length=1)] | None = None
    # [m] below the upper face, z of the plate or cylinder, or below the round one; without it
    # through the whole body
    depth: Size | None = None

    @model_validator(mode="after")
    def _placed(self) -> "Holes":
        if (self.at is None) == (self.around is None):
            raise ValueError(
                "holes are placed by at = [[x, y]], or around = [[angle, height]] into the round "
                "face of a cylinder: give one of the two"
            )
        return self


OneOrMoreHoles = Annotated[
    Annotated[Holes, Tag("one")]
    | Annotated[tuple[Holes, ...], Field(strict=False, min_length=1), Tag("several")],
    Discriminator(lambda value: "several" if isinstance(value, list | tuple) else "one"),
]


class UnderTable(SceneTable):
    """Parts of a plane face: discs of a radius, or rectangles, around points of it."""

    at: Annotated[tuple[Place3, ...], Field(strict=False, min_length=1)]  # [m] middles
    radius: Size | None = None  # [m] of discs
    # [m] of rectangles, along the two global axes that span the face
    sides: Annotated[tuple[Size, Size], Field(strict=False)] | None = None

    @model_validator(mode="after")
    def _one_form(self) -> "UnderTable":
        if (self.radius is None) == (self.sides is None):
            raise ValueError("under needs the radius of discs or the sides of rectangles: give one")
        return self


class CylinderTable(SceneTable):
    """A cylinder along its own z, or with a `bore` a tube."""

    radius: Size  # [m] outer radius
    length: Size  # [m] along its z; its origin is on the axis, half-way
    bore: of(Annotated[Number, Field(ge=0)], LENGTH, 1e-5, 50) = 0.0  # [m] inner radius of a tube


class BodyTable(SceneTable):
    """A body drawn here, or one of the file: what it is made of and how finely it is meshed."""

    material: str | None = None  # a name in [materials], or a named material
    seed: Seed | None = None  # [m] size of its elements
    # [m] lengths along x, y, z; its origin is its middle
    box: Sides | None = None
    plate: PlateTable | None = None
    cylinder: CylinderTable | None = None
    holes: OneOrMoreHoles | None = None
    # [m] where its origin is: the middle of a box or a cylinder, that of a plate's outline
    at: Place3 | None = None
    turn: Vector | None = None  # [degrees] about the global x, then y, then z

    @property
    def drawn(self) -> str | None:
        """Name of its shape."""
        return next((shape for shape in SHAPES if getattr(self, shape) is not None), None)

    @property
    def all_holes(self) -> tuple[Holes, ...]:
        """The tables of its holes, one for each diameter."""
        return (self.holes,) if isinstance(self.holes, Holes) else self.holes or ()

    @model_validator(mode="after")
    def _one_shape(self) -> "BodyTable":
        """One shape, with the holes and places that this shape can have."""
        shapes = [shape for shape in SHAPES if getattr(self, shape) is not None]
        if len(shapes) > 1:
            raise ValueError(f"{' and '.join(shapes)} exclude each other: keep one of them")
        if self.holes and not (self.plate or self.cylinder):
            raise ValueError(
                "holes belong to a plate or a cylinder: drop them, draw the body as a plate, or "
                "drill it in a STEP file"
            )
        if self.plate and any(holes.around for holes in self.all_holes):
            raise ValueError(
                "holes.around are in the round face of a cylinder: place those of a plate by at"
            )
        if not shapes and (self.at or self.turn):
            raise ValueError("at and turn place a body drawn here: add box, plate or cylinder")
        return self


def fitting(body: str, tables: Mapping[str, BodyTable]) -> Iterator[BodyTable]:
    """The tables whose names fit a body's, its very own first."""
    names = [name for name in tables if fnmatchcase(body, name)]
    yield from (tables[name] for name in sorted(names, key=lambda name: name != body))


LOADS = {  # keys that a kind of load needs, and keys that it may have besides
    ("on", "force"): ("direction",),
    ("body", "temperature"): (),
    ("on", "to", "tension"): ("stiffness",),
}


class StaticLoad(SceneTable):
    """A static load before the strike: a force on a face, a body that is warmer than when it was
    made and expands, or a rod in tension between two faces.

    `force` pushes along `direction`, without one into the plane face `on`; names with * are all
    that fit. `stiffness` is the rod's own.
    """

    name: Annotated[str, Field(pattern=r"^\w[\w-]*$")]  # by which keys and results call it
    on: str | None = None  # the face that is pushed, or one end of the rod
    force: of(Number, FORCE, 0, 1e9) | None = None  # [N] spread evenly
    direction: Vector | None = None  # of the force; without it, into the face
    body: str | None = None  # the body that is warmer
    # [K] above that at which it was made
    temperature: Annotated[Number, Field(ge=-1000, le=3000)] | None = None
    to: str | None = None  # the face at the rod's other end
    tension: of(Number, FORCE, 0, 1e9) | None = None  # [N] in the rod
    stiffness: Spring | None = None  # [N/m] of the rod, E A / L

    @model_validator(mode="after")
    def _one_kind(self) -> "StaticLoad":
        """The keys of one kind of load, all that it needs and no others."""
        keys = {key for key in type(self).model_fields if getattr(self, key) is not None} - {"name"}
        if not any(
            set(needed) <= keys <= {*needed, *optional} for needed, optional in LOADS.items()
        ):
            kinds = ", ".join(" and ".join(needed) for needed in LOADS)
            raise ValueError(
                f"has {', '.join(sorted(keys)) or 'nothing'}; it needs one of {kinds}: give these "
                "and no others"
            )
        if self.direction and not any(self.direction):
            raise ValueError(f"direction = {list(self.direction)} must not be zero: change it")
        if self.stiffness is not None and isinf(self.stiffness):
            raise ValueError("stiffness = inf is no rod's: give E A / L, or tie the faces")
        return self


class Hold(SceneTable):
    """A face, or parts of it, on the ground in some directions: "z" is a roller."""

    on: str  # a face, "body:-z"
    under: UnderTable | None = None
    directions: Annotated[str, Field(pattern="^[xyz]{1,3}$")] = "xyz"  # those that are held


EitherHold = Annotated[
    Annotated[str, Tag("text")] | Annotated[Hold, Tag("table")], Discriminator(text_or_table)
]


class General(SceneTable):
    """[assembly] of bodies: where they come from, what touching means, what holds them."""

    step: FileName | None = None  # a STEP file
    # or a mesh in metres: .msh, .med, .unv, .inp, .bdf, .nas, or what meshio reads
    mesh: FileName | None = None
    # the sets of the mesh that are bodies; without it the fewest that have each cell once
    volumes: Annotated[tuple[str, ...], Field(strict=False, min_length=1)] | None = None
    # [m] distance up to which nodes of a body of the mesh are merged; 0 takes a body in pieces, or
    # with a crack, as it is
    merge: of(NonNegative, LENGTH, 0, 1e-2) | None = None
    touching: Literal["ask", "tied", "free"] = "ask"  # what touching pairs are that nothing names
    gap: of(Positive, LENGTH, 1e-8, 1e-3) = 1e-5  # [m] up to which faces touch
    # faces on the ground, a roller as { on = "foot:-z", directions = "z" }; [] for a structure that
    # floats
    held: Annotated[tuple[EitherHold, ...], Field(strict=False)] | None = None
    material: str | None = None  # of bodies that name none

    @property
    def file(self) -> str | None:
        """File of bodies that are not drawn."""
        return self.step or self.mesh

    @property
    def holds(self) -> tuple[Hold, ...]:
        """Held faces, as tables."""
        return tuple(Hold(on=h) if isinstance(h, str) else h for h in self.held or ())


class Meshing(AskedOfMesh):
    """Elements of bodies: quadratic, hexahedra where a body is a box, an extruded outline or a
    tube, else tetrahedra; or "tet" for all. `scale` is a factor on all sizes of elements."""

    # hexahedra where a body allows for them, or tetrahedra everywhere
    element: Literal["hex", "tet"] = "hex"
    scale: Positive = 1.0  # factor on all sizes of elements


class Tied(SceneTable):
    """Pairs of touching bodies that stay together where they touch, or under parts of that."""

    between: Pair  # the pair, "a|b"
    under: UnderTable | None = None


class Bolts(FromDrawing):
    """Bolts between two bodies that touch, or from a body's holes to the ground; or a thread, a
    shank of one body in a bore of the other.

    `sides` say how the first and the second body are held under a washer: rigid (RBE2) or by the
    mean of their motion (RBE3). In place of a washer a bolt may hold its "share" of the common
    face, half-way to the next bolts. Both sides of a thread move by their mean over the length that
    shank and bore have in common. `frame` "normal" has z along the bolt. Stiffnesses are
    those of one bolt. With a `bolt` those that are not listed follow from the drawing.
    """

    name: Annotated[str, Field(pattern=r"^\w[\w-]*$")]  # by which keys and results call it
    # the pair, "lid|base"; of holes and the ground "lid:hole|ground"
    between: Pair | None = None
    # bodies of one bolt from its head to its nut, in place of a pair: ["plate", "left", "right"]
    stack: Annotated[tuple[str, ...], Field(strict=False, min_length=3)] | None = None
    at: (
        Literal["holes", "thread"]
        | Annotated[tuple[Place3, ...], Field(strict=False, min_length=1)]
    ) = "holes"  # [m] "holes" through both, a "thread", or the points of the bolts
    # [m] radius that is held, without one that of the holes, of a bolt at least that of the foot
    # of its pressure cone; or a "share" of the face
    washer: of(Positive, LENGTH, 1e-4, 0.3) | Literal["share"] | None = None
    # how each side is held: rigid (RBE2), or by its mean (RBE3)
    sides: Annotated[
        tuple[Literal["rigid", "mean"], Literal["rigid", "mean"]], Field(strict=False)
    ] = ("rigid", "mean")
    # axes of the springs: "normal" has z along the bolt, which is normal to the faces, and x near
    # the first global axis that is more than 26 degrees off it; or the global axes
    frame: Literal["normal", "global"] = "normal"

    @model_validator(mode="before")
    @classmethod
    def _mean_of_a_thread(cls, table: Any) -> Any:
        """A thread moves with the mean of its bore unless `sides` say otherwise."""
        if isinstance(table, Mapping) and table.get("at") == THREAD:
            return {"sides": ("mean", "mean"), **table}
        return table

    @model_validator(mode="after")
    def _a_pair_or_a_stack(self) -> "Bolts":
        """Bodies that are named once; a stack is that of a bolt."""
        if (self.between is None) == (self.stack is None):
            raise ValueError('needs between = "a|b", or the stack of a bolt: give one of the two')
        if self.stack and len({*self.stack}) < len(self.stack):
            raise ValueError(f"stack = {list(self.stack)} names a body twice: name each once")
        if self.stack and self.bolt is None:
            raise ValueError('stack is that of a bolt: add bolt = "M8-8.8", or write between')
        return self

    @property
    def only_touches(self) -> bool:
        """True of faces in contact that have no bolt of their own."""
        return self.model == CONTACT and self.bolt is None

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """The pairs that it joins, from the head on: one, or of a stack those that follow each
        other."""
        if self.stack:
            return tuple(pairwise(self.stack))
        first, second = (side.strip() for side in self.between.split("|"))
        return ((first, second),)

    @property
    def partners(self) -> tuple[str, str]:
        """The first body, and the last or the ground."""
        return self.pairs[0][0], self.pairs[-1][1]


class Strike(SceneTable):
    """Place that the last sphere touches: a plane face, and a point from its middle along the two
    global axes that span it; or a plane, a cylinder or a sphere, and the point of it that is
    nearest to [x, y, z]. "body@x,y,z" of a round face tells both.

    `nodes` takes the mean of the nodes nearest to these points of a plane face in place of a
    pressure. "thesis" pushes at the node nearest to the point and reads the mean of two others, one
    radius to either side along the first axis, or of `nodes`. It makes energy out of nothing and
    serves comparisons alone."""

    on: Face  # the face, "body:+x"; or "body@x,y,z"
    # [m] from the middle of a plane face, or [x, y, z]
    at: PlaceOnFace = (0.0, 0.0)
    radius: PatchRadius = 2e-3  # [m] of the patch
    weights: Literal["hertz", "area", "thesis"] = "hertz"  # of the mean over the patch
    # [m] points from the middle of the face whose nearest nodes are read
    nodes: Annotated[tuple[Point, ...], Field(strict=False, min_length=1)] | None = None
    seed: Seed | None = None  # [m] of the elements there; twice the radius

    @property
    def body(self) -> str:
        """The body that is struck."""
        return split("[:@]", self.on)[0]

    @property
    def point(self) -> tuple[float, ...] | None:
        """The point whose nearest point on the face is struck; None where the place is given
        from the middle of a plane face."""
        return self.at if len(self.at) == 3 else None

    @property
    def selected_at(self) -> tuple[float, ...] | None:
        """The point that selects the face, if one does."""
        words = self.on.partition("@")[2].split(",")
        return tuple(map(float, words)) if len(words) == 3 else None

    @property
    def size(self) -> float:
        """Of the elements there [m]."""
        return self.seed or 2 * self.radius


class MeasuredMode(SceneTable):
    """A measured mode and what identifies it: a body's motion ("x", "x+ry", "strain"), its number,
    or a file of measured shapes (.uff), whose MAC with the modes of the assembly is computed."""

    hz: Frequency  # [Hz] measured frequency
    body: str | None = None  # the body whose motion tells the mode
    motion: str | None = None  # of that body: "x", "x+ry", "strain"
    number: Annotated[int, Field(ge=1, le=200)] | None = None  # of the mode, in place of a motion
    # file of measured shapes (.uff), in place of a motion
    shape: Annotated[FileName, Field(min_length=1)] | None = None
    title: str | None = None  # what tables call it; body and motion
    # [Hz] its standard deviation, for bars of what is fitted; without one 0.1 % of it
    hz_deviation: of(Positive, FREQUENCY) | None = None
    zeta: Ratio | None = None  # measured damping ratio, for loss factors
    zeta_deviation: Ratio | None = None  # its standard deviation; without one a tenth of it

    def remeasured(self, **values: Any) -> "MeasuredMode":
        """The mode with other values; a standard deviation does not go with another frequency."""
        moved = values.get("hz", self.hz) != self.hz
        return self.but(**({"hz_deviation": None} if moved else {}) | values)

    @model_validator(mode="after")
    def _one_identity(self) -> "MeasuredMode":
        """One way to tell the mode from others, and a deviation below its frequency."""
        if (self.body is None) != (self.motion is None):
            raise ValueError("body and motion belong together: add the other")
        if sum(key is not None for key in (self.body, self.number, self.shape)) != 1:
            raise ValueError(
                "needs what tells the mode from others: give one of its number, its shape, and "
                "body with motion"
            )
        if self.hz_deviation is not None and self.hz_deviation >= self.hz:
            raise ValueError(
                f"hz_deviation = {self.hz_deviation:g} Hz is not below hz = {self.hz:g} Hz: give "
                "the standard deviation of the frequency, or drop it"
            )
        return self
