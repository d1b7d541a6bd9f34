"""Bodies drawn from shapes or read from a STEP file, held by gmsh's kernel (OpenCASCADE).

Everything that takes a :class:`~geometry.solids.Body` and asks the kernel works inside one
``with model(...)``. Lengths in metres; a file in other units is converted, and says so.
"""

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import gmsh
import numpy as np

from geometry.assembly import InvalidGeometry
from geometry.gmsh_session import session, silent
from geometry.shapes import Box, Cylinder, Plate, Shape
from geometry.solids import Body, Face, off_axis
from geometry.step_file import check_step, face_names, n_solids, name_solids, unit

KINDS = {"Plane": "plane", "Cylinder": "cylinder", "Cone": "cone", "Sphere": "sphere"}
KINDS |= {"Torus": "torus"}
FORBIDDEN = re.compile(r"[^\w.+-]+")  # in a name: what a selector or a table's key would trip over
UNNAMED = re.compile(r"(open cascade step translator.*|solid|body|compound|=>.*|\d*)", re.I)
THINNEST = 1e-6  # m, of a solid: less is a surface drawn twice


class Model(NamedTuple):
    """The bodies by name, and the unit that a file gave its lengths in."""

    bodies: dict[str, Body]
    unit: str | None = None


@contextmanager
def model(shapes: Mapping[str, Shape], step: Path | None = None) -> Iterator[Model]:
    """Every shape under its name and every solid of the STEP file under the file's.

    Raises InvalidGeometry for a file without solids, for a name that is in both, and for solids
    of no volume; ValueError for what gmsh cannot draw.
    """
    with session("gmsh could not build the geometry"):
        tags = {name: _drawn(shape) for name, shape in shapes.items()}
        read = {} if step is None else _read(step)
        twice = sorted(tags.keys() & read.keys())
        if twice:
            raise InvalidGeometry(
                f'{step.name} holds a body "{twice[0]}", and one of this name is drawn as well; '
                "rename the drawn one."
            )
        gmsh.model.occ.synchronize()
        bodies = {name: body_of(name, tag) for name, tag in (tags | read).items()}
        yield Model(bodies, None if step is None else unit(step))


def write_step(shapes: Mapping[str, Shape], path: Path) -> None:
    """The shapes as a STEP file in mm, each solid under its name."""
    with model(shapes) as drawn, silent():
        gmsh.write(str(path))
        name_solids(path, list(drawn.bodies))


def body_of(name: str, tag: int) -> Body:
    """What the kernel knows of a volume; raises InvalidGeometry when it has none."""
    occ = gmsh.model.occ
    lower, upper = _box(3, tag)
    volume = occ.getMass(3, tag)
    faces = gmsh.model.getBoundary([(3, tag)], oriented=False)
    area = sum(occ.getMass(*face) for face in faces)
    if not 2 * volume > THINNEST * area:
        size = " x ".join(f"{side:.3g}" for side in upper - lower)
        raise InvalidGeometry(
            f'body "{name}" ({size} m) has no volume ({volume:.3g} m^3): its thickness is zero or '
            "its faces are inside out; repair it in the CAD."
        )
    return Body(
        name,
        tag,
        volume,
        np.array(occ.getCenterOfMass(3, tag)),
        np.reshape(occ.getMatrixOfInertia(3, tag), (3, 3)),
        lower,
        upper,
        tuple(face_of(face) for _, face in faces),
        distance,
    )


def face_of(tag: int) -> Face:
    """What the kernel knows of a face."""
    kind = KINDS.get(gmsh.model.getType(2, tag), "other")
    _, numbers = gmsh.model.getEntityProperties(2, tag)
    point, normal = _point_and_normal(tag)
    face = Face(
        tag=tag,
        kind=kind,
        area=gmsh.model.occ.getMass(2, tag),
        centre=np.array(gmsh.model.occ.getCenterOfMass(2, tag)),
        normal=normal if kind == "plane" else None,
        axis=None,
        on_axis=None,
        radius=None,
        hollow=False,
        along=(0.0, 0.0),
        lower=_box(2, tag)[0],
        upper=_box(2, tag)[1],
        name=gmsh.model.getEntityName(2, tag).split("/")[-1],
    )
    if kind == "sphere":
        centre, radius = numbers[:3], numbers[3]
        return face._replace(
            on_axis=centre, radius=radius, hollow=bool(normal @ (point - centre) < 0)
        )
    if kind != "cylinder":
        return face
    return _on_cylinder(face, numbers[:3], numbers[3:6], point, normal)


def distance(point, face: int) -> float:
    """Of a point from the nearest point of a face, by its tag [m]."""
    tag = gmsh.model.occ.addPoint(*point)
    away, *_ = gmsh.model.occ.getDistance(0, tag, 2, face)
    gmsh.model.occ.remove([(0, tag)])
    return away


def _on_cylinder(face: Face, on_axis, axis, point, normal) -> Face:
    along = _along(face.tag, on_axis, axis)
    radial = point - on_axis - ((point - on_axis) @ axis) * axis
    return face._replace(
        axis=axis,
        on_axis=on_axis,
        radius=off_axis(point, on_axis, axis),
        hollow=bool(normal @ radial < 0),
        along=along,
    )


def _along(tag: int, on_axis, axis) -> tuple[float, float]:
    """A cylinder's second parameter is the length along its axis, one way or the other."""
    (_, first), (_, last) = gmsh.model.getParametrizationBounds(2, tag)
    ends = gmsh.model.getValue(2, tag, [0.0, first, 0.0, last]).reshape(2, 3)
    lengths = (ends - on_axis) @ axis
    return float(lengths.min()), float(lengths.max())


def _point_and_normal(tag: int):
    """A point of the face's surface and the normal there, out of the body."""
    lower, upper = gmsh.model.getParametrizationBounds(2, tag)
    middle = list((lower + upper) / 2)
    return gmsh.model.getValue(2, tag, middle), gmsh.model.getNormal(tag, middle)


def _box(dimension: int, tag: int):
    box = np.array(gmsh.model.occ.getBoundingBox(dimension, tag))
    return box[:3], box[3:]


def _drawn(shape: Shape) -> int:
    draw = {Box: _box_drawn, Plate: _plate_drawn, Cylinder: _cylinder_drawn}
    tag = draw[type(shape)](shape)
    for axis, degrees in zip(np.eye(3), shape.turn, strict=True):
        gmsh.model.occ.rotate([(3, tag)], 0, 0, 0, *axis, np.radians(degrees))
    gmsh.model.occ.translate([(3, tag)], *shape.at)
    return tag


def _box_drawn(box: Box) -> int:
    sides = np.array(box.sides)
    return gmsh.model.occ.addBox(*(-sides / 2), *sides)


def _cylinder_drawn(cylinder: Cylinder) -> int:
    solid = _upright(cylinder.radius, cylinder.length)
    if not cylinder.bore:
        return solid
    return _cut(solid, [_upright(cylinder.bore, cylinder.length)])


def _upright(radius: float, length: float, x: float = 0.0, y: float = 0.0) -> int:
    return gmsh.model.occ.addCylinder(x, y, -length / 2, 0, 0, length, radius)


def _plate_drawn(plate: Plate) -> int:
    occ = gmsh.model.occ
    points = [occ.addPoint(x, y, 0) for x, y in plate.outline]
    ends = zip(points, points[1:] + points[:1], strict=True)
    face = occ.addPlaneSurface([occ.addCurveLoop([occ.addLine(*pair) for pair in ends])])
    solid = occ.extrude([(2, face)], 0, 0, plate.thickness)
    (tag,) = [tag for dimension, tag in solid if dimension == 3]
    drills = [_upright(h.diameter / 2, 4 * plate.thickness, *h.at) for h in plate.holes]
    return _cut(tag, drills) if drills else tag


def _cut(solid: int, tools: list[int]) -> int:
    ((_, tag),), _ = gmsh.model.occ.cut([(3, solid)], [(3, tool) for tool in tools])
    return tag


def _read(step: Path) -> dict[str, int]:
    check_step(step)
    try:
        with silent():
            read = gmsh.model.occ.importShapes(str(step), highestDimOnly=False, format="step")
    except Exception as error:
        raise InvalidGeometry(f"{step} could not be read as STEP: {error}") from None
    gmsh.model.occ.synchronize()
    volumes = [tag for dimension, tag in read if dimension == 3]
    if not volumes:
        found = "surfaces without a volume" if read else "nothing"
        raise InvalidGeometry(f"{step} holds {found}; export its bodies as solids.")
    if (told := n_solids(step)) > len(volumes):
        raise InvalidGeometry(
            f"{step} is damaged: it describes {told} solids, of which {len(volumes)} can be read; "
            "export it again."
        )
    _name_faces(volumes, face_names(step))
    return _named(volumes)


def _name_faces(volumes: list[int], names: list[list[str]]) -> None:
    """gmsh does not read them, but keeps the order of solids and faces in the file.

    A file that places one solid several times has another order: its faces stay without names.
    """
    boundaries = [gmsh.model.getBoundary([(3, tag)], oriented=False) for tag in volumes]
    if list(map(len, boundaries)) != list(map(len, names)):
        return
    for faces, given in zip(boundaries, names, strict=True):
        for (_, tag), name in zip(faces, given, strict=True):
            gmsh.model.setEntityName(2, tag, name)


def _named(volumes: list[int]) -> dict[str, int]:
    """The last word of a solid's path in the file; equal names are numbered."""
    names = [_name(gmsh.model.getEntityName(3, tag)) for tag in volumes]
    count, seen, named = Counter(names), Counter(), {}
    for name, tag in zip(names, volumes, strict=True):
        seen[name] += 1
        named[f"{name}-{seen[name]}" if count[name] > 1 else name] = tag
    return named


def _name(path: str) -> str:
    words = [word for word in path.split("/") if not UNNAMED.fullmatch(word.strip())]
    return FORBIDDEN.sub("-", words[-1].strip()).strip("-") if words[1:] else "body"
