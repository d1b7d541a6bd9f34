"""The parametric assembly: a block on two bolted sheets above a sheets' support, support and plate.

Axes: x = chain axis, y = normal of the sheets, z = vertical. The origin lies in the middle of the
block's lower face, so that the sheets run from z = -(free length + foot overlap) to the head
overlap, outside the faces y = +-block_y/2.

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
and 5.3), every field says so in its metadata.
"""

from dataclasses import dataclass, field, fields
from itertools import pairwise
from math import isfinite, pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

PARTS = ("block", "sheets", "sheets_support", "support", "plate")
SIDES = {"sheet-y": -1.0, "sheet+y": 1.0}


class InvalidGeometry(ValueError):
    """Dimensions that no assembly can have; the message names the offending numbers."""


def _length(value, provenance: str, description: str):
    """A dimension [m] with its default, where that comes from, and what it is."""
    return field(
        default=value,
        metadata={"unit": "m", "provenance": provenance, "description": description},
    )


FITTED = "inferred: fitted to the frequencies of the thesis' table 5.2"
ASSUMED = "assumed: not in the thesis"


@dataclass(frozen=True)
class Assembly:
    """Dimensions in metres; raises :class:`InvalidGeometry` when they cannot be built."""

    block_x: float = _length(0.1315, FITTED, "block along the chain")
    block_y: float = _length(0.0982, FITTED, "block across, between the sheets")
    block_z: float = _length(0.0415, FITTED, "block height")
    sheet_thickness: float = _length(0.847e-3, FITTED, "sheet thickness")
    sheet_width: float = _length(0.0655, FITTED, "sheet width along the chain")
    sheet_free_length: float = _length(0.0326, FITTED, "sheet between the clamp lines")
    head_overlap: float = _length(0.025, ASSUMED, "sheet on the block")
    foot_overlap: float = _length(0.025, ASSUMED, "sheet on the sheets' support")
    screw_x: tuple[float, ...] = _length((-0.015, 0.015), FITTED, "screws along x, in each joint")
    head_screw_z: float = _length(0.01065, FITTED, "head screws above the block's lower edge")
    foot_screw_z: float = _length(0.0152, FITTED, "foot screws below the upper edge they hold to")
    hole_radius: float = _length(0.003, ASSUMED, "screw hole in the sheet")
    washer_radius: float = _length(0.0094, FITTED, "region held under a screw head")
    sheets_support_x: float = _length(0.090, ASSUMED, "sheets' support along the chain")
    sheets_support_y: float = _length(0.0982, FITTED, "sheets' support across, as the block")
    sheets_support_z: float = _length(0.030, ASSUMED, "sheets' support height")
    support_x: float = _length(0.078, FITTED, "support along the chain")
    support_y: float = _length(0.078, FITTED, "support across")
    support_z: float = _length(0.060, ASSUMED, "support height")
    stack_inset: float = _length(0.015, ASSUMED, "screws between the parts below, from both edges")
    stack_washer: float = _length(0.016, ASSUMED, "side of the square held under such a screw")
    plate_x: float = _length(0.200, ASSUMED, "plate along the chain")
    plate_y: float = _length(0.200, ASSUMED, "plate across")
    plate_z: float = _length(0.020, ASSUMED, "plate thickness")
    pad: float = _length(0.020, ASSUMED, "side of the pads under the plate's corners")
    bolt_inset: float = _length(0.020, ASSUMED, "plate's bolts, from both edges of a corner")
    bolt_washer: float = _length(0.018, ASSUMED, "side of the square held under a bolt")
    parts: tuple[str, ...] = field(
        default=PARTS, metadata={"unit": "", "provenance": "thesis", "description": "built parts"}
    )

    def __post_init__(self) -> None:
        _check(self)


class Cuboid(NamedTuple):
    """A cuboid body between two corners."""

    lower: NDArray[np.float64]  # (3,) [m]
    upper: NDArray[np.float64]  # (3,) [m]


class Interface(NamedTuple):
    """Two faces that touch; the slave face lies inside the master face."""

    slave: str  # "body:face", as the mesh names it
    master: str
    screws: tuple[str, ...]  # faces on the slave side that screws press on
    halves: tuple[str, ...]  # of a sheet: each screw's share of the slave face
    centres: NDArray[np.float64]  # (n_halves, 3) [m], of the screws on the interface


def provenance(name: str) -> str:
    """Where the default of a dimension comes from, and what the dimension is."""
    metadata = {f.name: f.metadata for f in fields(Assembly)}[name]
    return f"{metadata['description']} ({metadata['provenance']})"


def boxes(assembly: Assembly) -> dict[str, Cuboid]:
    """The cuboid bodies that the assembly is built of, by name."""
    a = assembly
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


def sheets(assembly: Assembly) -> dict[str, float]:
    """The sheets by name, with the y of the face that leans on the block [m]."""
    if "sheets" not in assembly.parts:
        return {}
    return {name: side * assembly.block_y / 2 for name, side in SIDES.items()}


def screw_z(assembly: Assembly) -> dict[str, float]:
    """Height z [m] of the screws of the joints "head" and "foot"."""
    a = assembly
    return {"head": a.head_screw_z, "foot": -a.sheet_free_length - a.foot_screw_z}


def interfaces(assembly: Assembly) -> tuple[Interface, ...]:
    """All pairs of touching faces, from the block downwards."""
    a = assembly
    pairs = []

    # sheets bolted to the block and to their support
    numbers = range(1, len(a.screw_x) + 1)
    for joint, body in (("head", "block"), ("foot", "sheets_support")):
        for sheet in sheets(a) if body in a.parts else ():
            y, z = SIDES[sheet] * a.block_y / 2, screw_z(a)[joint]
            pairs.append(
                Interface(
                    f"{sheet}:{joint}",
                    f"{body}:{sheet[-2:]}",
                    tuple(f"{sheet}:{joint}-washer-{i}" for i in numbers),
                    tuple(f"{sheet}:{joint}-share-{i}" for i in numbers),
                    np.array([[x, y, z] for x in a.screw_x]),
                )
            )

    # parts that stand on each other: the smaller face is the slave
    stack = [name for name in PARTS[2:] if name in a.parts]
    for upper, lower in pairwise(stack):
        top, bottom = boxes(a)[upper], boxes(a)[lower]
        inside = np.all(top.lower[:2] >= bottom.lower[:2]) and np.all(
            top.upper[:2] <= bottom.upper[:2]
        )
        faces = (f"{upper}:-z", f"{lower}:+z")
        slave, master = faces if inside else faces[::-1]
        pairs.append(Interface(slave, master, (f"{slave}-screws",), (), np.empty((0, 3))))
    return tuple(pairs)


def held_faces(
    assembly: Assembly, *, fixing: str = "flat", under_washers: bool = False
) -> tuple[str, ...]:
    """Faces fixed to the ground: the lowest part's underside; of a plate also only the pads under
    its corners (`fixing` "corners") or the squares around its bolts ("bolted").

    Without a sheets' support the sheets are held where they would be bolted to it, over the whole
    overlap or only under the washers; a block alone is free.
    """
    lowest = assembly.parts[-1]
    if lowest == "block":
        return ()
    if lowest == "sheets":
        spots = [f"foot-washer-{i + 1}" for i in range(len(assembly.screw_x))]
        return tuple(
            f"{sheet}:{spot}"
            for sheet in sheets(assembly)
            for spot in (spots if under_washers else ["foot"])
        )
    spots = {"corners": "pads", "bolted": "bolts"}
    return (f"{lowest}:{spots.get(fixing, '-z') if lowest == 'plate' else '-z'}",)


def corner_squares(assembly: Assembly, body: str) -> dict[str, tuple[str, float, float]]:
    """Squares at the corners of a part's upper and lower face, by name: "pads", "-z-screws", ...

    Each has the face that it lies on, and its nearest and farthest distance from both edges [m].
    """
    a = assembly
    if body == "plate":
        half = a.bolt_washer / 2
        bolts = ("-z", a.bolt_inset - half, a.bolt_inset + half)
        return {"pads": ("-z", 0.0, a.pad), "bolts": bolts}
    half = a.stack_washer / 2
    screwed = [i.slave.split(":") for i in interfaces(a) if not len(i.halves)]
    span = (a.stack_inset - half, a.stack_inset + half)
    return {f"{face}-screws": (face, *span) for name, face in screwed if name == body}


def washer_z_range(assembly: Assembly, joint: str) -> tuple[float, float]:
    """The strip of sheet on the body that a joint holds to, lower and upper z [m]."""
    a = assembly
    if joint == "head":
        return 0.0, a.head_overlap
    return -a.sheet_free_length - a.foot_overlap, -a.sheet_free_length


def screw_cells(assembly: Assembly) -> list[tuple[float, float]]:
    """The x-range of sheet around each screw, split half-way between neighbours [m]."""
    a = assembly
    x = np.array(a.screw_x)
    edges = [-a.sheet_width / 2, *(x[1:] + x[:-1]) / 2, a.sheet_width / 2]
    return list(pairwise(edges))


def _check(a: Assembly) -> None:
    """Raises InvalidGeometry, with the numbers in question, for parts that do not fit together."""
    for f in fields(a):
        value = getattr(a, f.name)
        if f.name not in ("parts", "screw_x") and not (isfinite(value) and value > 0):
            raise InvalidGeometry(f"{f.name} = {value} m must be a positive finite length.")
    if not a.screw_x or not np.all(np.isfinite(a.screw_x)) or np.any(np.diff(a.screw_x) <= 0):
        raise InvalidGeometry(
            f"screw_x = {list(a.screw_x)} must list finite positions, at least one, ascending."
        )
    if a.parts != PARTS[: len(a.parts)] or not a.parts:
        raise InvalidGeometry(
            f"parts = {list(a.parts)} must be the first of {list(PARTS)}: each stands on the next."
        )
    if "sheets" in a.parts:
        _check_sheets(a)

    # parts that stand on each other
    for pair in pairwise(name for name in PARTS[2:] if name in a.parts):
        spans = [(boxes(a)[name].upper - boxes(a)[name].lower)[:2] for name in pair]
        if np.any(spans[0] < spans[1]) and np.any(spans[0] > spans[1]):
            raise InvalidGeometry(
                f"{pair[0]} ({spans[0][0]} x {spans[0][1]} m) and {pair[1]} ({spans[1][0]} x "
                f"{spans[1][1]} m) overhang each other; one of the faces must contain the other."
            )

    # squares at their corners: under the screws between them, under the plate
    near = a.stack_inset - a.stack_washer / 2
    far = a.stack_inset + a.stack_washer / 2
    sides = [(b.upper - b.lower)[:2].min() for name, b in boxes(a).items() if name in PARTS[2:4]]
    if near < 0 or (sides and 2 * far >= min(sides)):
        raise InvalidGeometry(
            f"stack_inset = {a.stack_inset} m with stack_washer = {a.stack_washer} m puts screws "
            f"off a part of {min(sides, default=0.0):.6g} m."
        )
    if "plate" not in a.parts:
        return
    if 2 * a.pad >= min(a.plate_x, a.plate_y):
        raise InvalidGeometry(
            f"pad = {a.pad} m must be less than half of the plate's sides "
            f"({a.plate_x} x {a.plate_y} m)."
        )
    _, near, far = corner_squares(a, "plate")["bolts"]
    if near < 0 or 2 * far >= min(a.plate_x, a.plate_y):
        raise InvalidGeometry(
            f"bolt_inset = {a.bolt_inset} m with bolt_washer = {a.bolt_washer} m puts the bolts' "
            f"washers off a plate of {a.plate_x} x {a.plate_y} m."
        )


def _check_sheets(a: Assembly) -> None:
    """Raises InvalidGeometry for washers that do not fit the sheets, and for sheets that reach past
    what they are bolted to."""
    if a.hole_radius >= a.washer_radius:
        raise InvalidGeometry(
            f"hole_radius = {a.hole_radius} m must be below washer_radius = {a.washer_radius} m."
        )

    # washers lie within the overlap, and within the part of the sheet that belongs to their screw
    for joint, z in screw_z(a).items():
        lower, upper = washer_z_range(a, joint)
        if z - a.washer_radius <= lower or z + a.washer_radius >= upper:
            raise InvalidGeometry(
                f"{joint}_screw_z puts a washer at z = {z:.6g} m +- {a.washer_radius} m not in "
                f"the overlap [{lower:.6g}, {upper:.6g}] m; move it or widen {joint}_overlap."
            )
    for x, (lower, upper) in zip(a.screw_x, screw_cells(a), strict=True):
        if x - a.washer_radius <= lower or x + a.washer_radius >= upper:
            raise InvalidGeometry(
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
            raise InvalidGeometry(
                f"sheets_support_y = {a.sheets_support_y} m must equal block_y = {a.block_y} m: "
                "the flat sheets touch both."
            )
    for name, value, limit_name, limit in limits:
        if value > limit:
            raise InvalidGeometry(f"{name} = {value} m must not exceed {limit_name} = {limit} m.")


def volume(assembly: Assembly) -> float:
    """Volume of the assembly [m^3]."""
    a = assembly
    solid = sum(float(np.prod(box.upper - box.lower)) for box in boxes(a).values())
    length = a.foot_overlap + a.sheet_free_length + a.head_overlap
    holes = 2 * len(a.screw_x) * pi * a.hole_radius**2
    sheet = (length * a.sheet_width - holes) * a.sheet_thickness
    return solid + len(sheets(a)) * sheet
