"""Bodies drawn from shapes or read from a STEP file, held by gmsh's kernel (OpenCASCADE).

Everything that takes a :class:`~geometry.cad.solids.Body` and asks the kernel works inside one
``with model(...)``. Lengths in metres; a file in other units is converted, and says so.
"""

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import gmsh
import numpy as np
from numpy.typing import NDArray

from beadwave.geometry.cad.shapes import Box, Cylinder, Hole, Shape
from beadwave.geometry.cad.solids import Body, Face, Vector, off_axis
from beadwave.geometry.cad.step_file import (
    check_step,
    face_names,
    n_solids,
    name_solids,
    other_files,
    plainly_named,
    text_of,
    unit,
)
from beadwave.geometry.cad.step_splines import analytic
from beadwave.geometry.errors import InvalidGeometry
from beadwave.geometry.meshing.gmsh_session import session, silent

# gmsh's names of surfaces, and ours
KINDS = {"Plane": "plane", "Cylinder": "cylinder", "Cone": "cone", "Sphere": "sphere"}
KINDS |= {"Torus": "torus"}
FORBIDDEN = re.compile(
    r"[^\w.+-]+"
)  # in a name: letters that have a meaning in selectors or in keys of tables
# words of a solid's path in a STEP file that name no solid: those of translators, numbers
UNNAMED = re.compile(r"(open cascade step translator.*|solid|body|compound|=>.*|\d*)", re.I)


# of volume and area, by which solids with recognised surfaces may differ from those with B-splines,
# over which OpenCASCADE integrates to 1e-3 around holes, to 5e-3 on a torus
SAME_SOLID = 0.01
LONGEST = 60  # letters of a name that are kept: they stand in tables and pictures


class CadModel(NamedTuple):
    """The bodies by name, and the unit of length of the STEP file, None without one."""

    bodies: dict[str, Body]
    unit: str | None = None
    elsewhere: tuple[str, ...] = ()  # other files that the file refers to, which are not read


@contextmanager
def model(shapes: Mapping[str, Shape], step: Path | None = None) -> Iterator[CadModel]:
    """Bodies of all shapes under their names and of all solids of a STEP file under its names.

    They exist in gmsh's kernel until the context ends. Raises InvalidGeometry for a file without
    solids, for a name that is in both, and for solids without volume; ValueError for what gmsh
    cannot draw.
    """
    with session("gmsh could not build the geometry"):
        tags = {name: _solid(shape) for name, shape in shapes.items()}
        imported = {} if step is None else _imported(step)
        twice = sorted(tags.keys() & imported.keys())
        if twice:
            raise InvalidGeometry(
                f'{step.name} holds a body "{twice[0]}", and one of this name is drawn as well; '
                "rename the drawn one."
            )
        gmsh.model.occ.synchronize()
        bodies = {name: body_of(name, tag) for name, tag in (tags | imported).items()}
        if step is None:
            yield CadModel(bodies)
        else:
            yield CadModel(bodies, unit(step), tuple(other_files(step)))


def write_step(shapes: Mapping[str, Shape], path: Path) -> None:
    """The shapes as a STEP file in mm, each solid under its name; raises as `model`."""
    with model(shapes) as cad, silent():
        gmsh.write(str(path))
        name_solids(path, list(cad.bodies))


def _solid(shape: Shape) -> int:
    """Tag of a shape built in the kernel, turned about x, y, z in turn, then moved to its place."""
    occ = gmsh.model.occ

    def upright(radius: float, length: float) -> int:
        return occ.addCylinder(0, 0, -length / 2, 0, 0, length, radius)

    def drill(hole: Hole, top: float, height: float) -> int:
        """A cylinder along z that cuts a hole into the upper face, at z = `top`, of a body of this
        height. Through holes are cut upwards, with both ends outside of the body: cut downwards,
        hexahedra had 20 edges around a hole in place of 30, and were half as many."""
        if hole.depth is None:
            return occ.addCylinder(*hole.at, top - 3 * height, 0, 0, 4 * height, hole.diameter / 2)
        length = height + hole.depth
        return occ.addCylinder(*hole.at, top + height, 0, 0, -length, hole.diameter / 2)

    # the shape at the origin, and the cylinders to be cut out of it
    drills: list[int] = []
    if isinstance(shape, Box):
        sides = np.array(shape.sides)
        tag = occ.addBox(*(-sides / 2), *sides)
    elif isinstance(shape, Cylinder):
        tag = upright(shape.radius, shape.length)
        if shape.bore:
            drills = [upright(shape.bore, shape.length)]
        drills += [drill(hole, shape.length / 2, shape.length) for hole in shape.holes]
        for hole in shape.radial_holes:
            a = np.radians(hole.angle)
            outward = np.array([np.cos(a), np.sin(a), 0.0])
            # from outside of the round face, half a radius off it, to the depth below it
            start = 1.5 * shape.radius * outward + [0, 0, hole.height]
            reach = 3 * shape.radius if hole.depth is None else 0.5 * shape.radius + hole.depth
            drills.append(occ.addCylinder(*start, *(-reach * outward), hole.diameter / 2))
    else:
        points = [occ.addPoint(x, y, 0) for x, y in shape.outline]
        ends = zip(points, points[1:] + points[:1], strict=True)
        face = occ.addPlaneSurface([occ.addCurveLoop([occ.addLine(*pair) for pair in ends])])
        extruded = occ.extrude([(2, face)], 0, 0, shape.thickness)
        (tag,) = [tag for dimension, tag in extruded if dimension == 3]
        drills = [drill(hole, shape.thickness, shape.thickness) for hole in shape.holes]
    if drills:
        pieces, _ = occ.cut([(3, tag)], [(3, tool) for tool in drills])
        if len(pieces) != 1:
            raise InvalidGeometry(
                f"holes cut a body into {len(pieces)} pieces; move them, or make them smaller."
            )
        ((_, tag),) = pieces

    for axis, degrees in zip(np.eye(3), shape.turn, strict=True):
        occ.rotate([(3, tag)], 0, 0, 0, *axis, np.radians(degrees))
    occ.translate([(3, tag)], *shape.at)
    return tag


def _imported(step: Path) -> dict[str, int]:
    """Tags of a STEP file's solids by name; their faces get the names that the file gives them.

    The name of a solid is the last word of its path in the file that is no translator's default;
    equal names are numbered. Raises InvalidGeometry for a file that cannot be read, that holds no
    solid, or of whose solids some could not be read.
    """
    check_step(step)
    try:
        with TemporaryDirectory() as folder, silent():
            strings = plainly_named(step, copy := Path(folder) / "plain.step")
            entities = _shapes(copy if strings else step, Path(folder) / "analytic.step")
    except Exception as error:
        raise InvalidGeometry(f"{step} could not be read as STEP: {error}") from None
    gmsh.model.occ.synchronize()
    solids = [tag for dimension, tag in entities if dimension == 3]
    if not solids:
        if others := other_files(step):
            listed = ", ".join(others[:8]) + (", ..." if len(others) > 8 else "")
            raise InvalidGeometry(
                f"{step} holds no solids: its parts are in other files ({listed}); export the "
                "assembly as one file, or give a file that holds a part."
            )
        content = "surfaces without a volume" if entities else "nothing"
        raise InvalidGeometry(f"{step} holds {content}; export its bodies as solids.")
    if (n_described := n_solids(step)) > len(solids):
        raise InvalidGeometry(
            f"{step} is damaged: it describes {n_described} solids, of which {len(solids)} can be "
            "read; export it again."
        )

    # gmsh reads no names of faces, but keeps the order of solids and faces in the file; a file
    # that places one solid several times has another order, and its faces stay without names
    boundaries = [gmsh.model.getBoundary([(3, tag)], oriented=False) for tag in solids]
    names_of_faces = face_names(step)
    if list(map(len, boundaries)) == list(map(len, names_of_faces)):
        for faces, of_solid in zip(boundaries, names_of_faces, strict=True):
            for (_, tag), name in zip(faces, of_solid, strict=True):
                gmsh.model.setEntityName(2, tag, name)

    names = []
    for tag in solids:
        path = [strings.get(word, word) for word in gmsh.model.getEntityName(3, tag).split("/")]
        words = [word for word in path if not UNNAMED.fullmatch(word.strip())]
        # the first word is the file's
        name = FORBIDDEN.sub("-", words[-1].strip()).strip("-") if words[1:] else ""
        names.append(name[:LONGEST].strip("-") or "body")
    # equal names are numbered, past numbers that other names end in
    count, number, tags = Counter(names), Counter(), {}
    for name, tag in zip(names, solids, strict=True):
        full = name
        while count[name] > 1 and (full == name or full in count or full in tags):
            number[name] += 1
            full = f"{name}-{number[name]}"
        tags[full] = tag
    return tags


def _shapes(step: Path, copy: Path) -> list[tuple[int, int]]:
    """Dimensions and tags of what a STEP file holds, with B-splines that are planes, cylinders and
    the like as such, by a copy of the file, if its solids are the same."""

    def read(path: Path) -> tuple[list[tuple[int, int]], NDArray[np.float64]]:
        """Shapes, and volumes [m^3] and areas [m^2] of solids (n, 2)."""
        occ = gmsh.model.occ
        shapes = occ.importShapes(str(path), highestDimOnly=False, format="step")
        occ.synchronize()
        solids = [shape for shape in shapes if shape[0] == 3]
        boundaries = [gmsh.model.getBoundary([solid], oriented=False) for solid in solids]
        areas = [sum(occ.getMass(*face) for face in faces) for faces in boundaries]
        volumes = [occ.getMass(*solid) for solid in solids]
        return shapes, np.array([volumes, areas]).T

    text = analytic(text_of(step))
    if text is None:
        return gmsh.model.occ.importShapes(str(step), highestDimOnly=False, format="step")
    copy.write_text(text, encoding="utf-8", newline="\n")
    _, original = read(step)
    gmsh.clear()
    try:
        shapes, recognised = read(copy)
        same = np.allclose(recognised, original, rtol=SAME_SOLID) and len(original)
    except Exception:  # OpenCASCADE refuses what it took before
        same = False
    if same:
        return shapes
    gmsh.clear()
    return gmsh.model.occ.importShapes(str(step), highestDimOnly=False, format="step")


def body_of(name: str, tag: int) -> Body:
    """Volume [m^3], centre [m], inertia of unit density [m^5], box and faces of a solid in the
    kernel, by its tag; raises InvalidGeometry for one without volume."""
    occ = gmsh.model.occ
    lower, upper = _bounding_box(3, tag)
    volume = occ.getMass(3, tag)
    faces = gmsh.model.getBoundary([(3, tag)], oriented=False)
    area = sum(occ.getMass(*face) for face in faces)
    # a mean thickness 2 V / A below 1 um: a surface that was drawn twice
    if not 2 * volume > 1e-6 * area:
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
    """Kind, area, centre, normal or axis, radius and box of a face in the kernel, by its tag."""
    kind = KINDS.get(gmsh.model.getType(2, tag), "other")
    _, properties = gmsh.model.getEntityProperties(2, tag)

    # a point of its surface and the normal there, out of the body
    (u_lower, v_lower), (u_upper, v_upper) = gmsh.model.getParametrizationBounds(2, tag)
    uv = [(u_lower + u_upper) / 2, (v_lower + v_upper) / 2]
    point, normal = gmsh.model.getValue(2, tag, uv), gmsh.model.getNormal(tag, uv)

    lower, upper = _bounding_box(2, tag)
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
        lower=lower,
        upper=upper,
        name=gmsh.model.getEntityName(2, tag).split("/")[-1],
    )

    # sphere and cylinder: hollow where the normal out of the body points inwards
    if kind == "sphere":
        centre, radius = properties[:3], properties[3]
        return face._replace(
            on_axis=centre, radius=radius, hollow=bool(normal @ (point - centre) < 0)
        )
    if kind != "cylinder":
        return face

    # v runs along a cylinder's axis, one way or the other
    on_axis, axis = properties[:3], properties[3:6]
    ends = gmsh.model.getValue(2, tag, [0.0, v_lower, 0.0, v_upper]).reshape(2, 3)
    heights = (ends - on_axis) @ axis
    radial = point - on_axis - ((point - on_axis) @ axis) * axis
    return face._replace(
        axis=axis,
        on_axis=on_axis,
        radius=off_axis(point, on_axis, axis),
        hollow=bool(normal @ radial < 0),
        along=(float(heights.min()), float(heights.max())),
    )


def distance(point: Sequence[float], face: int) -> float:
    """Distance [m] of a point (3,) from a face in the kernel, by its tag."""
    tag = gmsh.model.occ.addPoint(*point)
    nearest, *_ = gmsh.model.occ.getDistance(0, tag, 2, face)
    gmsh.model.occ.remove([(0, tag)])
    return nearest


def _bounding_box(dimension: int, tag: int) -> tuple[Vector, Vector]:
    """Lower and upper corner (3,) of the box around an entity [m]."""
    box = np.array(gmsh.model.occ.getBoundingBox(dimension, tag))
    return box[:3], box[3:]
