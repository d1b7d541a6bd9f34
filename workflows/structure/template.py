"""A scene to start from, of a STEP file: bodies of steel, a support, and a place that the chain
strikes."""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from itertools import chain, islice, product
from json import dumps
from os.path import relpath
from pathlib import Path
from re import sub
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.fem.contact.impact_point import MAX_PATCH_SHARE, spanning
from beadwave.geometry.cad.contacts import joined_groups
from beadwave.geometry.cad.holes import concentric
from beadwave.geometry.cad.selectors import faces as selected
from beadwave.geometry.cad.solids import ALIGNED, Body, Face
from beadwave.geometry.errors import InvalidGeometry
from beadwave.workflows.files.output_file import OutputFile
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.stages.structure.bodies import Drawing
from beadwave.workflows.stages.structure.strike import around
from beadwave.workflows.structure.face_page import words

PATCH = 2e-3  # [m] radius of the patch that is struck
SMALLER = (1e-3, 0.5e-3, 0.25e-3)  # [m] on a face that has no room for it, as the rim of a tube


class StartStrike(NamedTuple):
    """Place that the chain strikes."""

    face: Face
    on: str  # selector
    at: list[float]  # [m] from the middle of a plane face, or a point [x, y, z]
    radius: float  # [m] of the patch
    outward: NDArray[np.float64]  # (3,) normal there


def starter(geometry: Drawing, source: Path, gap: float) -> str | None:
    """TOML that runs: the chain strikes the highest bare plane face, if possible one that looks up,
    else a round one; held is the lowest plane face that looks down, else the one opposite, and so
    one of each group of bodies that touches none of the others. Pairs whose holes, off each other
    by up to `gap` [m], take bolts have them as a comment. None where no face has room for a patch.
    """
    strike = next(_strikes(geometry), None)
    if strike is None:
        return None

    # the support: faces that look down, lower ones first, then those that look away from the
    # chain, the farthest ones first
    supports = [
        (
            (0, face.centre[2]) if face.normal[2] < -0.5
            else (1 + face.normal @ strike.outward, round(face.centre @ strike.outward, 6)),
            body,
            face,
        )
        for body, face in _planes(geometry)
        if face.tag != strike.face.tag
        and (face.normal[2] < -0.5 or face.normal @ strike.outward < 0.5)
    ]  # fmt: skip
    supports.sort(key=lambda support: support[0])

    # of each group of bodies that touch the first of them that a selector picks alone, else a
    # round face
    touching = [touch.bodies for touch in geometry.near.touching]
    groups, held = joined_groups(geometry.bodies, touching), []
    for group in groups:
        planes = (
            (body, face, point)
            for _, body, face in supports
            if body.name in group
            for _, point in islice(_places(body, face, 0.0), 1)
        )
        rounds = (
            (body, face, point)
            for body, face, point, _ in _rounds(geometry)
            if body.name in group and len(groups) > 1
        )
        words_of = (_word(geometry.bodies, *place) for place in chain(planes, rounds))
        held += islice(filter(None, words_of), 1)
    return STARTER.format(
        name=source.stem.replace(" ", "-"),
        source=source.absolute().as_posix(),
        held=dumps(held),
        apart=APART if len(groups) > 1 else "",
        floats="" if held else FLOATS,
        bolts="".join(
            BOLTS.format(
                n=n,
                s="s" * (n > 1),
                of=" and ".join(touch.bodies),
                pair=touch.name,
                name=sub(r"[^\w-]+", "-", "-".join(touch.bodies)),
            )
            for touch in geometry.near.touching
            if (n := len(concentric(touch, geometry.bodies, gap)))
        ),
        struck=strike.on,
        at=f"at = {strike.at}\n" if any(strike.at) else "",
        radius=f"{strike.radius:g}",
    )


def _planes(geometry: Drawing) -> list[tuple[Body, Face]]:
    """All plane faces with their bodies, higher ones first."""
    planes = [(b, f) for b in geometry.bodies.values() for f in b.faces if f.normal is not None]
    return sorted(planes, key=lambda pair: -pair[1].centre[2])


def _strikes(geometry: Drawing) -> Iterator[StartStrike]:
    """Places for the chain, the best first: a plane face with room for a patch of usual size or
    half of it, one that looks up before others, a round face, a plane one with room for a smaller
    patch."""
    first, *others = SMALLER
    for up in (True, False):
        for radius in (PATCH, first):
            yield from _on_planes(geometry, radius, up)
    yield from _on_rounds(geometry)
    for radius, up in product(others, (True, False)):
        yield from _on_planes(geometry, radius, up)


def _on_planes(geometry: Drawing, radius: float, up: bool) -> Iterator[StartStrike]:
    """Places on plane faces that look up, or on the others, where a patch and some room around it
    lie on the face and on no other body: the nearest one to the middle of each."""
    room = 1.5  # radius about the place that must lie on the face, over that of the patch
    for body, face in _planes(geometry):
        if (face.normal[2] > 0.5) != up:
            continue
        for place, point in _places(body, face, room * radius):
            points = around(point, face.normal, room * radius)
            if geometry.near.over(body.name, points, geometry.bodies, radius):
                continue
            word = _word(geometry.bodies, body, face, point)
            # a place from the middle of a face across an axis; a point in space of another one
            along_axis = np.abs(face.normal).max() > 1 - ALIGNED
            at = (place if along_axis else point).round(6) + 0.0
            if word:
                yield StartStrike(face, word, at.tolist(), radius, face.normal)
            break


def _places(
    body: Body, face: Face, radius: float
) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Places (2,) [m] from the middle of a plane face and their points (3,) [m] in space, around
    which a circle of a radius [m] lies on the face; those near the middle first."""
    # the patch is tried at 9 places along each side of a face
    steps = np.linspace(-0.5, 0.5, 9)
    grid = np.array(np.meshgrid(steps, steps)).reshape(2, -1).T
    axes, middle = spanning(face.normal), (face.lower + face.upper) / 2
    places = grid * (np.abs(axes) @ (face.upper - face.lower))
    for place in places[np.argsort(np.linalg.norm(places, axis=1), kind="stable")]:
        point = middle + place @ axes
        rim = around(point, face.normal, radius, 16)
        if all(body.distance(p, face.tag) < 1e-9 for p in rim):
            yield place, point


def _on_rounds(geometry: Drawing) -> Iterator[StartStrike]:
    """Places on outer cylinders and spheres, half-way along them and as high as they are bare."""
    struck = set()
    for body, face, point, outward in _rounds(geometry):
        radius = min(PATCH, float(f"{0.9 * MAX_PATCH_SHARE * face.radius:.2g}"))
        # on a cylinder or a sphere at least 0.5 mm, a tenth of its radius at most
        if radius < 0.5e-3 or face.tag in struck:
            continue
        points = around(point, outward, radius)
        if geometry.near.over(body.name, points, geometry.bodies, radius):
            continue
        struck.add(face.tag)
        if word := _word(geometry.bodies, body, face, point):
            at = (point.round(6) + 0.0).tolist()
            yield StartStrike(face, word, at, radius, outward)


def _rounds(
    geometry: Drawing,
) -> Iterator[tuple[Body, Face, NDArray[np.float64], NDArray[np.float64]]]:
    """Outer cylinders and spheres with points (3,) [m] on them, half-way along, and the normals
    (3,) there, the highest point of each face first."""
    n_round = 16  # directions about an axis or a centre in which a round face is tried
    for body in geometry.bodies.values():
        rounds = [f for f in body.faces if f.kind in ("cylinder", "sphere") and not f.hollow]
        for face in sorted(rounds, key=lambda face: -face.area):
            axis = np.eye(3)[1] if face.axis is None else face.axis
            middle = face.on_axis
            if face.axis is not None:
                middle = middle + ((face.centre - middle) @ axis) * axis

            # the highest direction first, in which the face is there and no body lies over it
            angles = 2 * np.pi * np.arange(n_round) / n_round
            outwards = np.column_stack([np.cos(angles), np.sin(angles)]) @ spanning(axis)
            for outward in outwards[np.argsort(-outwards[:, 2].round(9), kind="stable")]:
                point = middle + face.radius * outward
                if body.distance(point, face.tag) < 1e-9:
                    yield body, face, point, outward


def _word(bodies: Mapping[str, Body], body: Body, face: Face, point: np.ndarray) -> str | None:
    """The first selector that picks this face and, of a plane one, no other; see `words`."""
    for text in words(body, face, point):
        try:
            tags = selected(text, bodies).tags
        except InvalidGeometry:
            continue
        if tags == (face.tag,) or (face.normal is None and face.tag in tags):
            return text
    return None


def write_starter(file: OutputFile, text: str | None, source: Path) -> None:
    """Write the scene to start from; raises InvalidScene where no face offers itself."""
    if text is None:
        raise InvalidScene(
            f"{source} has no plane face, outer cylinder or sphere with room for a patch of "
            f"{SMALLER[-1]:g} m; write the scene by hand."
        )
    # the file by a path from the scene, so that both can be moved together
    absolute = source.absolute()
    with suppress(ValueError):  # on another drive of Windows
        relative = Path(relpath(absolute, file.path.absolute().parent))
        text = text.replace(absolute.as_posix(), relative.as_posix())
    with file.writing() as path:
        path.write_text(text, encoding="utf-8", newline="\n")


APART = "  # each of a group that touches no other"
FLOATS = 'reduction = { kind = "free-modes" }  # of a structure that nothing holds\n'
BOLTS = """
# {n} hole{s} through both {of}: bolts in place of the tie
# [[joints]]
# name = "{name}"
# between = "{pair}"
# kz = 1e8                     # N/m, along each bolt; directions that are not listed are rigid
"""
STARTER = """\
# To start from: {source}. Materials, support, chain and strike are assumed; change them.
name = "{name}"
chain = {{ count = 10, radius = 0.00635, density = 7800.0, young = 210e9, poisson = 0.3 }}
striker = {{ velocity = 0.3 }}
wall = {{ kind = "rom" }}
damping = {{ kind = "modal", ratio = 0.005 }}
time = {{ duration = 1e-3 }}
output = {{ spheres = [1, 5] }}
{floats}
[assembly]
step = "{source}"
touching = "tied"              # pairs that no [[ties]] or [[joints]] names: "tied", "free", "ask"
held = {held}{apart}
material = "steel"

[materials.steel]
young = 210e9                  # Pa
poisson = 0.3
density = 7850.0               # kg/m^3
{bolts}
[strike]
on = "{struck}"
{at}radius = {radius}
"""
