"""The thesis' rig as a template: dimensions in, the tables of an assembly of bodies out.

`--set`, sweeps and fits vary dimensions, which depend on each other; `RigScene` keeps them and has
what `as_bodies` makes of them: bodies with their grid lines, ties, joints, held faces, the strike
and the measured modes, in the words of `bodies`. What computes knows these alone.

A block on two bolted sheets above a sheets' support, support and plate. Axes: x = chain axis, y =
normal of the sheets, z = vertical. The origin lies in the middle of the block's lower face, so that
the sheets run from z = -(free length + foot overlap) to the head overlap, outside the faces
y = +-block_y/2.

              z
              |   +-----------------+
      chain ->x   |      block      |  z in [0, block_z]
                  +--||---------||--+  <- head joints (screws), upper clamp line at z = 0
                     ||  sheets ||
                  +--||---------||--+  <- foot joints, lower clamp line at z = -free length
                  | sheets' support |
                  +-----------------+
                       support
                ------- plate --------

The thesis gives no drawings; the dimensions here were inferred from its frequencies (tables 5.2
and 5.3), every field says so in its description.
"""

from collections.abc import Mapping
from itertools import pairwise
from math import isfinite
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self

import numpy as np
from pydantic import Field, SerializationInfo, create_model, model_serializer

from beadwave.workflows.scene.body_grid import BodyGrid, GridLine, Ring
from beadwave.workflows.scene.quantities import of
from beadwave.workflows.scene.scene import Scene
from beadwave.workflows.scene.scene_table import Density, InvalidScene, SceneTable
from beadwave.workflows.scene.tables.bodies import (
    SHARE,
    BodyTable,
    Bolts,
    Compressible,
    General,
    Hold,
    MeasuredMode,
    Meshing,
    Modulus,
    Solid,
    Strike,
    Tied,
)
from beadwave.workflows.scene.tables.joints import Joints
from beadwave.workflows.scene.tables.mesh import Mesh
from beadwave.workflows.scene.tables.reduction import Patch
from beadwave.workflows.scene.units import LENGTH
from beadwave.workflows.thesis import HAMMER_TEST

PARTS = ("block", "sheets", "sheets_support", "support", "plate")
SIDES = {"sheet-y": -1.0, "sheet+y": 1.0}
STRUCK = "block:+x"  # the face that the chain leans on
FITTED = "inferred: fitted to the frequencies of the thesis' table 5.2"
ASSUMED = "assumed: not in the thesis"
# largest usual ratio of a dimension to the rig's, either way; a mistaken unit makes it 1000
USUAL = 100.0
EXPANDED = ("materials", "bodies", "ties", "strike")  # tables that no rig is written in
MEASURED = {"hz", "hz_deviation", "zeta", "zeta_deviation"}  # of a mode, in place of the thesis'


DIMENSIONS = {  # m: the default, where it comes from, what it is
    "block_x": (0.1315, FITTED, "block along the chain"),
    "block_y": (0.0982, FITTED, "block across, between the sheets"),
    "block_z": (0.0415, FITTED, "block height"),
    "sheet_thickness": (0.847e-3, FITTED, "sheet thickness"),
    "sheet_width": (0.0655, FITTED, "sheet width along the chain"),
    "sheet_free_length": (0.0326, FITTED, "sheet between the clamp lines"),
    "head_overlap": (0.025, ASSUMED, "sheet on the block"),
    "foot_overlap": (0.025, ASSUMED, "sheet on the sheets' support"),
    "screw_x": ((-0.015, 0.015), FITTED, "screws along x, in each joint"),
    "head_screw_z": (0.01065, FITTED, "head screws above the block's lower edge"),
    "foot_screw_z": (0.0152, FITTED, "foot screws below the upper edge they hold to"),
    "hole_radius": (0.003, ASSUMED, "screw hole in the sheet"),
    "washer_radius": (0.0094, FITTED, "region held under a screw head"),
    "sheets_support_x": (0.090, ASSUMED, "sheets' support along the chain"),
    "sheets_support_y": (0.0982, FITTED, "sheets' support across, as the block"),
    "sheets_support_z": (0.030, ASSUMED, "sheets' support height"),
    "support_x": (0.078, FITTED, "support along the chain"),
    "support_y": (0.078, FITTED, "support across"),
    "support_z": (0.060, ASSUMED, "support height"),
    "stack_inset": (0.015, ASSUMED, "screws between the parts below, from both edges"),
    "stack_washer": (0.016, ASSUMED, "side of the square held under such a screw"),
    "plate_x": (0.200, ASSUMED, "plate along the chain"),
    "plate_y": (0.200, ASSUMED, "plate across"),
    "plate_z": (0.020, ASSUMED, "plate thickness"),
    "pad": (0.020, ASSUMED, "side of the pads under the plate's corners"),
    "bolt_inset": (0.020, ASSUMED, "plate's bolts, from both edges of a corner"),
    "bolt_washer": (0.018, ASSUMED, "side of the square held under a bolt"),
}


class Steel(SceneTable):
    """The material of a body, where it differs from the assembly's."""

    young: Modulus | None = None  # [Pa] Young's modulus of the part
    poisson: Compressible | None = None  # Poisson's ratio of the part
    density: Density | None = None  # [kg/m^3] of the part


class _Rig(SceneTable):
    # of the rig that are there, from the block down
    parts: Annotated[tuple[Literal[PARTS], ...], Field(strict=False)] = PARTS  # type: ignore[valid-type]
    young: Modulus = 210e9  # [Pa] Young's modulus of all parts
    poisson: Compressible = 0.3  # Poisson's ratio of all parts
    density: Density = 7850.0  # [kg/m^3] of all parts
    block: Steel | None = None
    sheets: Steel | None = None
    sheets_support: Steel | None = None
    support: Steel | None = None
    plate: Steel | None = None
    # what joins the sheets: ties, tied screws, or springs (wires)
    constraint: Literal["full-tie", "screw-tie", "wires"] = "full-tie"
    fixing: Literal["flat", "corners", "bolted"] = "flat"  # how the plate is held

    def made_of(self, part: str) -> Steel:
        """The material of a part: the assembly's where its own table has no value."""
        steel = getattr(self, part) or Steel()
        return Steel(
            young=steel.young or self.young,
            poisson=self.poisson if steel.poisson is None else steel.poisson,
            density=steel.density or self.density,
        )


def _dimension(default: Any, provenance: str, description: str) -> tuple[Any, Any]:
    """Type and default of a dimension of the rig [m], usual within USUAL of the thesis' one."""
    is_list = isinstance(default, tuple)
    size = max(map(abs, default)) if is_list else default
    number = of(float, LENGTH, size / USUAL, size * USUAL)
    kind = Annotated[tuple[number, ...], Field(strict=False)] if is_list else number
    return kind, Field(default, description=f"{description} ({provenance})")


RigTable = create_model(
    "RigTable",
    __base__=_Rig,
    __doc__="Dimensions of the thesis' rig: in metres; its materials, ties and supports.",
    **{name: _dimension(*values) for name, values in DIMENSIONS.items()},
)


# Elements of a sheet on either side of a line where it is clamped: it bends there within some
# thicknesses. One row of a tenth of the seed in place of these left twice the error in the waves of
# rig-rom, at the same number of unknowns.
CLAMP_ROW = 1 / 30  # of the elements' size, of the first row
CLAMP_GROWTH = 2.0  # of neighbouring rows away from the line; 2.5 and 3 left more error
CLAMP_REACH = 0.4  # of the elements' size: the rows between the line and the rings of screws

# Elements at the edge of an imprint on a part, where stresses are singular: size of the first one
# over that of the part's elements, and of an element over its neighbour nearer to the edge. With
# them, and elements that match across interfaces, the mesh error of rig-rom fell from 4.4 to 0.7 %
# of the striker's speed; other values are not on record.
EDGE = 1 / 16, 3.0  # of the block
# of the parts below, whose elements are large. Of rig-rom with 60 mm there 1.5 mm and a growth of 5
# left an error of 1.1 % in the waves (38 000 unknowns), 2 mm and 6 left 1.6 % (37 000), 0.6 mm and
# 9 left 1.4 % (43 000)
EDGE_BELOW = 1 / 40, 5.0


class Cuboid(NamedTuple):
    """A cuboid part between two corners."""

    lower: np.ndarray  # (3,) [m]
    upper: np.ndarray  # (3,) [m]


class Rig(SceneTable):
    """The tables of a rig, as a user writes them."""

    assembly: RigTable  # type: ignore[valid-type]
    joints: Joints | None
    targets: tuple[MeasuredMode, ...] | None
    mesh: Mesh
    patch: Patch


class RigScene(Scene):
    """A scene whose bodies, and what joins, holds and strikes them, follow from a rig.

    It is written as the rig; `but` takes tables of the rig and expands them again.
    """

    strike_table: ClassVar[str] = "patch"

    rig: Rig

    @classmethod
    def of(cls, written: Scene) -> Self:
        """The scene of a rig from its tables as they are written."""
        rig = Rig.model_construct(**{name: getattr(written, name) for name in Rig.model_fields})
        return cls.model_construct(**{**dict(written), **as_bodies(rig)}, rig=rig)

    def but(self, **values: Any) -> Self:
        """A copy with other values, which are not checked, those of the rig expanded again."""
        of_rig = {name: values.pop(name) for name in Rig.model_fields if name in values}
        rig = self.rig.but(**of_rig)
        return super().but(**values, **(as_bodies(rig) | {"rig": rig} if of_rig else {}))

    def with_joints(self, value: Mapping[str, float]) -> Self:
        """A copy with these stiffnesses and dashpots, "head.kz", which are not checked."""
        joints = self.rig.joints
        for name, x in value.items():
            joint, _, key = name.rpartition(".")
            joints = joints.but(**{joint: {key: x}})
        return self.but(joints=joints)

    def with_materials(self, value: Mapping[str, Mapping[str, float]]) -> Self:
        """A copy with these numbers of parts' materials, which are not checked."""
        part_of = {name: getattr(self.rig.assembly, name) or Steel() for name in value}
        return self.but(assembly={name: part_of[name].but(**x) for name, x in value.items()})

    def remeasured(self, value: Mapping[int, Mapping[str, Any]]) -> Self:
        """A copy with other frequencies of the modes with these numbers, and their standard
        deviations; of the thesis' modes nothing else is written."""
        modes = {mode.number: mode for mode in self.rig.targets or ()}
        for n, values in value.items():
            of_hz = {key: x for key, x in values.items() if key in ("hz", "hz_deviation")}
            modes[n] = modes.get(n, MeasuredMode(number=n, hz=of_hz["hz"])).remeasured(**of_hz)
        return self.but(targets=tuple(modes[n] for n in sorted(modes)))

    @property
    def grids(self) -> dict[str, BodyGrid]:
        """The grids of all bodies; none of tetrahedra and of a mesh that is read."""
        if self.rig.mesh.element == "tet" or self.rig.mesh.file:
            return {}
        return {name: _grid(self.rig, name) for name in self.bodies}

    @property
    def written(self) -> Scene:
        """The scene as a user writes it: the tables of the rig in place of its bodies."""
        tables = {**dict(self), **dict.fromkeys(EXPANDED), **dict(self.rig)}
        return Scene.model_construct(**{name: tables[name] for name in Scene.model_fields})

    @model_serializer
    def _as_written(self, info: SerializationInfo) -> dict[str, Any]:
        return self.written.model_dump(mode=info.mode, exclude_none=info.exclude_none)


def as_bodies(rig: Rig) -> dict[str, Any]:
    """The tables of a scene that the rig stands for: bodies and what joins, holds and strikes
    them."""
    a, mesh, patch, cuboids = rig.assembly, rig.mesh, rig.patch, boxes(rig.assembly)
    sheets = list(SIDES) if "sheets" in a.parts else []
    below = [name for name in cuboids if name != "block"]

    # materials: of a part where it has values of its own
    part_of = {name: name for name in cuboids} | dict.fromkeys(sheets, "sheets")
    materials = {part: Solid(**a.made_of(part).model_dump()) for part in a.parts}

    # what touches: sheets on the block and on their support, parts that stand on each other
    joined = {"head": "block", "foot": "sheets_support"}
    bolted = {name: f"sheet*|{on}" for name, on in joined.items() if sheets and on in a.parts}
    stacked = list(pairwise(below))
    ties, joints = [], []
    for name, between in bolted.items():
        at = tuple((x, 0.0, screw_z(a)[name]) for x in a.screw_x)
        if a.constraint == "wires":
            # a screw joins its share of the sheet, which moves rigidly, to the mean motion of the
            # face below
            springs = getattr(rig.joints or Joints(), name).model_dump()
            joints.append(
                Bolts(name=name, between=between, at=at, washer=SHARE, frame="global", **springs)
            )
        elif a.constraint == "screw-tie":
            under = {"at": at, "radius": a.washer_radius}
            ties.append(Tied(between=between, under=under))
        else:
            ties.append(Tied(between=between))
    for upper, lower in stacked:
        tie = {"between": f"{upper}|{lower}"}
        if a.constraint == "screw-tie":
            half = min(
                cuboids[upper].upper, cuboids[lower].upper, key=lambda corner: tuple(corner[:2])
            )
            z = cuboids[upper].lower[2]
            tie["under"] = _in_corners(half, z, a.stack_inset, a.stack_washer)
        ties.append(Tied(**tie))

    # on the ground: the lowest part's underside, of a plate also pads or bolts; without a sheets'
    # support the sheets where they would be bolted to it
    lowest = a.parts[-1]
    held: list[Any] = []
    if lowest == "sheets":
        lower, upper = overlap(a, "foot")
        for sheet, side in SIDES.items():
            y = side * a.block_y / 2
            under = {
                "at": ((0.0, y, (lower + upper) / 2),),
                "sides": (a.sheet_width, upper - lower),
            }
            if a.constraint == "screw-tie":
                at = tuple((x, y, screw_z(a)["foot"]) for x in a.screw_x)
                under = {"at": at, "radius": a.washer_radius}
            inner = "+y" if side < 0 else "-y"
            held.append(Hold(on=f"{sheet}:{inner}", under=under))
    elif lowest != "block":
        hold: dict[str, Any] = {"on": f"{lowest}:-z"}
        half, z = cuboids[lowest].upper, cuboids[lowest].lower[2]
        if lowest == "plate" and a.fixing == "corners":
            hold["under"] = _in_corners(half, z, a.pad / 2, a.pad)
        elif lowest == "plate" and a.fixing == "bolted":
            hold["under"] = _in_corners(half, z, a.bolt_inset, a.bolt_washer)
        held.append(Hold(**hold))

    # measured modes: those of the thesis, with the frequencies that the scene gives in their place
    target_of = {target.number: target for target in rig.targets or ()}
    rows = zip(HAMMER_TEST["hz"], HAMMER_TEST["motion"], HAMMER_TEST["shape"], strict=True)
    targets = tuple(
        MeasuredMode(
            **(target_of[i].model_dump(include=MEASURED) if i in target_of else {"hz": measured}),
            body=HAMMER_TEST["body"], motion=motion, title=shape,
        )
        for i, (measured, motion, shape) in enumerate(rows, start=1)
    )  # fmt: skip

    mesh_file = mesh.file
    bodies = {
        name: BodyTable(material=part, **({} if mesh_file else _shape(rig, name)))
        for name, part in part_of.items()
    }
    strike = {key: getattr(patch, key) for key in ("radius", "weights", "nodes")}
    return {
        "assembly": General(mesh=mesh_file, held=tuple(held)),
        "materials": materials,
        "bodies": bodies,
        "ties": tuple(ties) or None,
        "joints": tuple(joints) or None,
        "strike": Strike(on=STRUCK, at=patch.point, seed=mesh.contact_seed, **strike),
        "targets": targets,
        "mesh": Meshing(**mesh.asked)
        if mesh_file
        else Meshing(element=mesh.element, scale=mesh.scale, **mesh.asked),
        "patch": None,
    }


def _in_corners(half: np.ndarray, z: float, inset: float, side: float) -> dict[str, Any]:
    """Squares around the points `inset` [m] from both edges of a rectangle's four corners."""
    x, y = half[0] - inset, half[1] - inset
    return {"at": ((-x, -y, z), (x, -y, z), (-x, y, z), (x, y, z)), "sides": (side, side)}


def _shape(rig: Rig, name: str) -> dict[str, Any]:
    """Shape and element size of a body. A sheet is an outline with z as its second axis, which a
    turn by 90 degrees about x puts upright; its thickness then goes along -y."""
    a, mesh = rig.assembly, rig.mesh
    if name not in SIDES:
        box = boxes(a)[name]
        return {
            "box": tuple((box.upper - box.lower).tolist()),
            "at": tuple(((box.lower + box.upper) / 2).tolist()),
            "seed": mesh.block_seed if name == "block" else mesh.support_seed,
        }
    half, lower, y = a.sheet_width / 2, -a.sheet_free_length - a.foot_overlap, a.block_y / 2
    top = a.head_overlap
    corners = ((-half, lower), (half, lower), (half, top), (-half, top))
    at = tuple((x, z) for z in screw_z(a).values() for x in a.screw_x)
    return {
        "plate": {"outline": corners, "thickness": a.sheet_thickness},
        "at": (0.0, y + a.sheet_thickness if SIDES[name] > 0 else -y, 0.0),
        "turn": (90.0, 0.0, 0.0),
        "holes": {"diameter": 2 * a.hole_radius, "at": at},
        "seed": mesh.seed,
    }


def _grid(rig: Rig, name: str) -> BodyGrid:
    """The grid of a body along its own axes."""
    if name in SIDES:
        return _grid_of_sheet(rig.assembly, rig.mesh.seed)
    box = boxes(rig.assembly)[name]
    middle = (box.lower + box.upper) / 2
    size = rig.mesh.block_seed if name == "block" else rig.mesh.support_seed
    lines = _lines(rig, name, size)
    return BodyGrid(
        *(
            tuple(line._replace(at=float(line.at - middle[i])) for line in lines[i])
            for i in range(3)
        )
    )


def _lines(rig: Rig, name: str, size: float) -> list[list[GridLine]]:
    """Grid lines along x, y and z that the box `name` must have, for elements of `size` [m]
    elsewhere; of several at one place the first counts."""
    a, cuboids = rig.assembly, boxes(rig.assembly)
    box = cuboids[name]
    finest, growth = EDGE if name == "block" else EDGE_BELOW
    singular: list[list[float]] = [[], [], []]  # where stresses are
    lines: list[list[GridLine]] = [[], [], []]
    plain: list[list[GridLine]] = [[], [], []]

    # the edges of the sheets' faces on the part that they are glued to
    joint = {"block": "head", "sheets_support": "foot"}.get(name)
    if a.constraint == "full-tie" and "sheets" in a.parts and joint:
        x, y = a.sheet_width / 2, a.block_y / 2
        singular = [[-x, x], [-y, y], [*overlap(a, joint)]]
    if name != "block":
        # where parts below end on each other, and where they meet; the squares at the corners of
        # all of them: neighbours' grids match
        stack = {part: below for part, below in cuboids.items() if part != "block"}
        pairs = list(pairwise(stack.values()))
        for i in range(2):
            singular[i] += [max(u.lower[i], v.lower[i]) for u, v in pairs]
            singular[i] += [min(u.upper[i], v.upper[i]) for u, v in pairs]
        singular[2] += [u.lower[2] for u, _ in pairs]
        screwed = {
            min(pair, key=lambda part: tuple(stack[part].upper[:2])) for pair in pairwise(stack)
        }
        for part, below in stack.items():
            half = a.stack_washer / 2
            ends = [a.stack_inset - half, a.stack_inset + half] if part in screwed else []
            if part == "plate":
                half = a.bolt_washer / 2
                ends = [0.0, a.pad, a.bolt_inset - half, a.bolt_inset + half]
            for i in range(2):
                places = [at for d in ends for at in (below.lower[i] + d, below.upper[i] - d)]
                plain[i] += [GridLine(float(at)) for at in places]
    elif rig.mesh.contact_seed is not None:
        centre = (box.upper[0], rig.patch.point[0], a.block_z / 2 + rig.patch.point[1])
        lines = [[GridLine(float(at), rig.mesh.contact_seed)] for at in centre]
    for i in range(3):
        lines[i] += [GridLine(float(at), finest * size, growth) for at in singular[i]] + plain[i]
        lower, upper = box.lower[i] - 1e-9, box.upper[i] + 1e-9
        lines[i] = [line for line in lines[i] if lower < line.at < upper]
    return lines


def _grid_of_sheet(a: Any, seed: float) -> BodyGrid:
    """Thin rows along both clamp lines of a sheet, where stresses are singular, and rings around
    the screws in the rest of either overlap."""
    lower, top, foot = -a.sheet_free_length - a.foot_overlap, a.head_overlap, -a.sheet_free_length

    # where the thin rows end and the rings begin
    r, screws = a.washer_radius, screw_z(a)
    head_rows = min(CLAMP_REACH * seed, (screws["head"] - r) / 2)
    foot_rows = foot - min(CLAMP_REACH * seed, (foot - screws["foot"] - r) / 2)
    rings = [
        Ring(r, (left, z), (right, end))
        for z, end in ((head_rows, top), (lower, foot_rows))
        for left, right in screw_cells(a)
    ]

    # lines of the outline's own axes: between the screws, and rows that shrink towards both clamps
    clamp = CLAMP_ROW * seed, CLAMP_GROWTH
    return BodyGrid(
        x=tuple(GridLine(left) for left, _ in screw_cells(a)),
        y=(
            GridLine(foot_rows), GridLine(foot, *clamp), GridLine(foot / 2), GridLine(0.0, *clamp),
            GridLine(head_rows),
        ),
        rings=tuple(rings),
    )  # fmt: skip


def boxes(a: Any) -> dict[str, Cuboid]:
    """The cuboid bodies that the assembly is built of, by name."""
    # sides, and z of the upper face; between block and support there are only the sheets
    stacked = {"block": ((a.block_x, a.block_y, a.block_z), a.block_z)}
    top = -a.sheet_free_length
    for name, sides in (
        ("sheets_support", (a.sheets_support_x, a.sheets_support_y, a.sheets_support_z)),
        ("support", (a.support_x, a.support_y, a.support_z)),
        ("plate", (a.plate_x, a.plate_y, a.plate_z)),
    ):
        if name in a.parts:
            stacked[name] = sides, top
            top -= sides[2]
    return {
        name: Cuboid(np.array([-x / 2, -y / 2, top - z]), np.array([x / 2, y / 2, top]))
        for name, ((x, y, z), top) in stacked.items()
    }


def screw_z(a: Any) -> dict[str, float]:
    """Height z [m] of the screws of the joints "head" and "foot"."""
    return {"head": a.head_screw_z, "foot": -a.sheet_free_length - a.foot_screw_z}


def overlap(a: Any, joint: str) -> tuple[float, float]:
    """The strip of sheet on the body that a joint holds to, lower and upper z [m]."""
    if joint == "head":
        return 0.0, a.head_overlap
    return -a.sheet_free_length - a.foot_overlap, -a.sheet_free_length


def screw_cells(a: Any) -> list[tuple[float, float]]:
    """The x-range of sheet around each screw, split half-way between neighbours [m]."""
    x = np.array(a.screw_x)
    edges = [-a.sheet_width / 2, *(x[1:] + x[:-1]) / 2, a.sheet_width / 2]
    return list(pairwise(edges))


def check(a: Any) -> None:
    """Raises InvalidScene, with the numbers in question, for parts that do not fit together."""
    for name in DIMENSIONS.keys() - {"screw_x"}:
        value = getattr(a, name)
        if not (isfinite(value) and value > 0):
            raise InvalidScene(f"{name} = {value} m must be a positive finite length.")
    if not a.screw_x or not np.all(np.isfinite(a.screw_x)) or np.any(np.diff(a.screw_x) <= 0):
        raise InvalidScene(
            f"screw_x = {list(a.screw_x)} must list finite positions, at least one, ascending."
        )
    if a.parts != PARTS[: len(a.parts)] or not a.parts:
        raise InvalidScene(
            f"parts = {list(a.parts)} must be the first of {list(PARTS)}: each stands on the next."
        )
    if "sheets" in a.parts:
        _check_sheets(a)

    # parts that stand on each other
    for pair in pairwise(name for name in PARTS[2:] if name in a.parts):
        spans = [(boxes(a)[name].upper - boxes(a)[name].lower)[:2] for name in pair]
        if np.any(spans[0] < spans[1]) and np.any(spans[0] > spans[1]):
            raise InvalidScene(
                f"{pair[0]} ({spans[0][0]} x {spans[0][1]} m) and {pair[1]} ({spans[1][0]} x "
                f"{spans[1][1]} m) overhang each other; one of the faces must contain the other."
            )

    # squares at their corners: under the screws between them, under the plate
    near = a.stack_inset - a.stack_washer / 2
    far = a.stack_inset + a.stack_washer / 2
    sides = [(b.upper - b.lower)[:2].min() for name, b in boxes(a).items() if name in PARTS[2:4]]
    if near < 0 or (sides and 2 * far >= min(sides)):
        raise InvalidScene(
            f"stack_inset = {a.stack_inset} m with stack_washer = {a.stack_washer} m puts screws "
            f"off a part of {min(sides, default=0.0):.6g} m."
        )
    if "plate" not in a.parts:
        return
    if 2 * a.pad >= min(a.plate_x, a.plate_y):
        raise InvalidScene(
            f"pad = {a.pad} m must be less than half of the plate's sides "
            f"({a.plate_x} x {a.plate_y} m)."
        )
    near, far = a.bolt_inset - a.bolt_washer / 2, a.bolt_inset + a.bolt_washer / 2
    if near < 0 or 2 * far >= min(a.plate_x, a.plate_y):
        raise InvalidScene(
            f"bolt_inset = {a.bolt_inset} m with bolt_washer = {a.bolt_washer} m puts the bolts' "
            f"washers off a plate of {a.plate_x} x {a.plate_y} m."
        )


def _check_sheets(a: Any) -> None:
    """Raises InvalidScene for washers that do not fit the sheets, and for sheets that reach past
    what they are bolted to."""
    if a.hole_radius >= a.washer_radius:
        raise InvalidScene(
            f"hole_radius = {a.hole_radius} m must be below washer_radius = {a.washer_radius} m."
        )

    # washers lie within the overlap, and within the part of the sheet that belongs to their screw
    for joint, z in screw_z(a).items():
        lower, upper = overlap(a, joint)
        if z - a.washer_radius <= lower or z + a.washer_radius >= upper:
            raise InvalidScene(
                f"{joint}_screw_z puts a washer at z = {z:.6g} m +- {a.washer_radius} m not in "
                f"the overlap [{lower:.6g}, {upper:.6g}] m; move it or widen {joint}_overlap."
            )
    for x, (lower, upper) in zip(a.screw_x, screw_cells(a), strict=True):
        if x - a.washer_radius <= lower or x + a.washer_radius >= upper:
            raise InvalidScene(
                f"screw_x = {x} m with washer_radius = {a.washer_radius} m does not fit its part "
                f"[{lower:.6g}, {upper:.6g}] m of the sheet (sheet_width = {a.sheet_width} m)."
            )

    # sheets end where the parts end that they are bolted to
    limits = [("sheet_width", a.sheet_width, "block_x", a.block_x)]
    limits += [("head_overlap", a.head_overlap, "block_z", a.block_z)]
    if "sheets_support" in a.parts:
        limits += [("sheet_width", a.sheet_width, "sheets_support_x", a.sheets_support_x)]
        limits += [("foot_overlap", a.foot_overlap, "sheets_support_z", a.sheets_support_z)]
        if abs(a.sheets_support_y - a.block_y) > 1e-9:
            raise InvalidScene(
                f"sheets_support_y = {a.sheets_support_y} m must equal block_y = {a.block_y} m: "
                "the flat sheets touch both."
            )
    for name, value, limit_name, limit in limits:
        if value > limit:
            raise InvalidScene(f"{name} = {value} m must not exceed {limit_name} = {limit} m.")
