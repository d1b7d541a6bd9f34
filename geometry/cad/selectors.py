"""Selectors: words for faces of bodies that stay right when dimensions of the CAD model change.

    body:+x            all faces in the outermost plane that looks along +x
    body@x,y,z         the face nearest to a point [m]
    body:hole          every bore; body:hole(6..7 mm) those of a diameter
    body:cylinder      every outer cylinder, body:cylinder(12 mm) likewise
    body:#name         the face of this name in the CAD; #name where one body has it
    a|b                where two bodies touch

A body's name may hold *, for any letters, where a key takes several.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from fnmatch import fnmatchcase
from typing import NamedTuple

import numpy as np

from beadwave.geometry.cad.contacts import TouchingPair
from beadwave.geometry.cad.holes import bores
from beadwave.geometry.cad.solids import ALIGNED, SAME, Body, described
from beadwave.geometry.errors import InvalidGeometry

# "hole", "cylinder(12 mm)" or "hole(6..7 mm)"
ROUND = re.compile(
    r"(hole|cylinder)(?:\((?P<from>\d+(?:\.\d+)?)(?:\.\.(?P<to>\d+(?:\.\d+)?))? mm\))?"
)
POINT = re.compile(r"(.+)@([^,@]+),([^,@]+),([^,@]+)")  # "body@x,y,z"


class FaceSelection(NamedTuple):
    """Faces of one body, by their tags in the CAD model."""

    body: str
    tags: tuple[int, ...]


def bodies_named(pattern: str, bodies: Iterable[str]) -> list[str]:
    """Names of bodies that match a pattern, in which * stands for any letters; raises
    InvalidGeometry when there is none."""
    bodies = list(bodies)
    # only * has a meaning, [ and ? are letters
    literal = pattern.replace("[", "[[]").replace("?", "[?]")
    names = [name for name in bodies if fnmatchcase(name, literal)]
    if not names:
        close = get_close_matches(pattern, bodies, 1)
        hint = f', perhaps "{close[0]}"' if close else ""
        raise InvalidGeometry(f'no body is called "{pattern}"{hint}; there are {_listed(bodies)}.')
    return names


def touches(
    pattern: str, bodies: Mapping[str, Body], touching: Sequence[TouchingPair]
) -> list[TouchingPair]:
    """The touching pairs that "a|b" matches, in either order; raises InvalidGeometry for none."""
    sides = pattern.split("|")
    if len(sides) != 2:
        raise InvalidGeometry(f'"{pattern}" must name two bodies, "a|b".')
    first, second = (set(bodies_named(side.strip(), bodies)) for side in sides)
    pairs = [
        touch
        for touch in touching
        for a, b in [touch.bodies]
        if (a in first and b in second) or (b in first and a in second)
    ]
    if not pairs:
        listed = _listed(touch.name for touch in touching)
        # between the boxes around them: the bodies are at least so far apart
        gap = min(
            float(np.linalg.norm(np.maximum(np.maximum(a.lower - b.upper, b.lower - a.upper), 0)))
            for a in map(bodies.get, first)
            for b in map(bodies.get, second)
        )
        apart = f" and are at least {1e3 * gap:.3g} mm apart" if gap > 1e-6 else ""
        raise InvalidGeometry(
            f'"{pattern}" do not touch{apart}; '
            + (f"touching pairs are {listed}." if touching else "no bodies do.")
            + " Move them together, or bridge a small gap by assembly.gap; `beadwave look` says "
            "how far faces miss each other, and round ones that touch along a line or at a point "
            'take a joint of model = "contact".'
        )
    return pairs


def faces(selector: str, bodies: Mapping[str, Body]) -> FaceSelection:
    """The faces of one body that a selector names; to be called in the bodies' ``with model(...)``.

    Raises InvalidGeometry, with what there is, for one that picks nothing or cannot choose.
    """
    # "#name": of the one body that has a face of this name
    if selector.startswith("#") and not POINT.fullmatch(selector):
        name = selector[1:]
        owners = [b for b in bodies.values() if any(f.name == name for f in b.faces)]
        if len(owners) > 1:
            raise InvalidGeometry(
                f'"{selector}" names faces of {_listed(b.name for b in owners)}; write '
                f'"{owners[0].name}:#{name}".'
            )
        if not owners:
            raise _no_name(selector, bodies)
        return FaceSelection(owners[0].name, _with_name(owners[0], selector, name))

    # "body@x,y,z" or "body:what"
    point = POINT.fullmatch(selector)
    pattern, _, what = selector.partition(":")
    names = bodies_named((point[1] if point else pattern).strip(), bodies)
    if len(names) > 1:
        raise InvalidGeometry(
            f'"{selector}" fits {_listed(names)}; it must pick faces of one body, name it.'
        )

    # the faces of that body: nearest to a point, outermost, of a name in the CAD, round
    body = bodies[names[0]]
    if point:
        tags = _nearest(body, selector, point.groups()[1:])
    elif re.fullmatch("[+-][xyz]", what):
        tags = _outermost(body, selector, what)
    elif what.startswith("#"):
        tags = _with_name(body, selector, what[1:])
    elif round_faces := ROUND.fullmatch(what):
        tags = _round(body, selector, round_faces)
    else:
        raise InvalidGeometry(
            f'"{selector}" picks no face; write "{body.name}:+x" (or -x, +y, ...), '
            f'"{body.name}@x,y,z", "{body.name}:hole", "{body.name}:hole(6..7 mm)" or '
            f'"{body.name}:cylinder".'
        )
    return FaceSelection(body.name, tags)


def _nearest(body: Body, selector: str, words: Sequence[str]) -> tuple[int, ...]:
    """Tags of the face nearest to a point; if it belongs to a bore or shank, of all its faces."""
    point = []
    for word in words:
        try:
            point.append(float(word))
        except ValueError:
            point.append(np.nan)
        if not np.isfinite(point[-1]):
            raise InvalidGeometry(f'"{selector}" holds "{word}" where a finite number belongs.')

    distances = {face.tag: body.distance(point, face.tag) for face in body.faces}
    first = body.face(min(distances, key=lambda tag: distances[tag]))
    cylinders = [bore.tags for hollow in (True, False) for bore in bores(body, hollow=hollow)]
    tags = next((tags for tags in cylinders if first.tag in tags), (first.tag,))
    equal = [f for f in body.faces if distances[f.tag] < distances[first.tag] + SAME]
    rivals = [f for f in equal if f.tag not in tags]
    if rivals:
        raise InvalidGeometry(
            f'"{selector}" is as near to {described(first)} as to {described(rivals[0])}; '
            "move the point into the middle of the face that is meant."
        )
    return tags


def _outermost(body: Body, selector: str, what: str) -> tuple[int, ...]:
    """Tags of all faces in the outermost plane whose normal points along "+x", "-y", ..."""
    direction = np.eye(3)["xyz".index(what[1])] * (1 if what[0] == "+" else -1)
    planes = [f for f in body.faces if f.normal is not None and f.normal @ direction > 1 - ALIGNED]
    if not planes:
        n = 6  # faces that the message lists
        faces = "; ".join(described(face) for face in body.faces[:n])
        unlisted = f" and {len(body.faces) - n} more faces" if len(body.faces) > n else ""
        raise InvalidGeometry(
            f'"{selector}" finds no planar face that looks along {what}; {body.name} has '
            f"{faces}{unlisted}."
        )
    outermost = max(f.centre @ direction for f in planes)
    return tuple(f.tag for f in planes if f.centre @ direction > outermost - SAME)


def _round(body: Body, selector: str, match: re.Match) -> tuple[int, ...]:
    """Tags of bores or outer cylinders, of all or of those with the selector's diameters [mm]."""
    cylinders = bores(body, hollow=match[1] == "hole")
    low, high = match["from"] or 0.0, match["to"] or match["from"] or np.inf
    low, high = 1e-3 * float(low) - SAME, 1e-3 * float(high) + SAME
    fitting = [bore for bore in cylinders if low <= bore.diameter <= high]
    if not fitting:
        diameters = sorted({f"{1e3 * bore.diameter:.6g}" for bore in cylinders}, key=float)
        what = "holes" if match[1] == "hole" else "outer cylinders"
        sizes = f"{what} of diameter {', '.join(diameters)} mm" if diameters else f"no {what}"
        raise InvalidGeometry(f'"{selector}" finds nothing; {body.name} has {sizes}.')
    return tuple(tag for bore in fitting for tag in bore.tags)


def _with_name(body: Body, selector: str, name: str) -> tuple[int, ...]:
    """All faces of this name in the CAD."""
    tags = tuple(f.tag for f in body.faces if f.name == name)
    if not tags:
        raise _no_name(selector, {body.name: body})
    return tags


def _no_name(selector: str, bodies: Mapping[str, Body]) -> InvalidGeometry:
    names = sorted({f.name for b in bodies.values() for f in b.faces if f.name})
    return InvalidGeometry(
        f'"{selector}" finds no face of this name; the CAD names {_listed(names) or "none"}.'
    )


def _listed(names: Iterable[str]) -> str:
    return ", ".join(f'"{name}"' for name in names)
