"""Words that pick faces of bodies, made to survive a change of the CAD.

    body:+x            all faces in the outermost plane that looks along +x
    body@x,y,z         the face nearest to a point [m]
    body:hole          every bore; body:hole(6..7 mm) those of a diameter
    body:cylinder      every outer cylinder, body:cylinder(12 mm) likewise
    body:#name         the face of this name in the CAD; #name where one body has it
    a|b                where two bodies touch

A body's name may hold *, for any letters, where several are asked for.
"""

import re
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from fnmatch import fnmatchcase
from typing import NamedTuple

import numpy as np

from geometry.assembly import InvalidGeometry
from geometry.holes import bores
from geometry.solids import ALIGNED, SAME, Body, Face, described
from geometry.touching import Touch

ROUND = re.compile(
    r"(hole|cylinder)(?:\((?P<from>\d+(?:\.\d+)?)(?:\.\.(?P<to>\d+(?:\.\d+)?))? mm\))?"
)
POINT = re.compile(r"(.+)@([^,@]+),([^,@]+),([^,@]+)")


class Selected(NamedTuple):
    """Faces of one body, by their tags in the CAD model."""

    body: str
    tags: tuple[int, ...]


def bodies_named(pattern: str, bodies: Mapping[str, Body]) -> list[str]:
    """Names that a pattern with * fits; raises InvalidGeometry when there is none."""
    found = [name for name in bodies if fnmatchcase(name, _literal(pattern))]
    if not found:
        near = get_close_matches(pattern, bodies, 1)
        hint = f', perhaps "{near[0]}"' if near else ""
        raise InvalidGeometry(f'no body is called "{pattern}"{hint}; there are {_listed(bodies)}.')
    return found


def touches(pattern: str, bodies: Mapping[str, Body], found: Sequence[Touch]) -> list[Touch]:
    """The touching pairs that "a|b" fits, either way round; raises InvalidGeometry for none."""
    sides = pattern.split("|")
    if len(sides) != 2:
        raise InvalidGeometry(f'"{pattern}" must name two bodies, "a|b".')
    one, other = (set(bodies_named(side.strip(), bodies)) for side in sides)
    picked = [t for t in found if _between(t.bodies, one, other)]
    if not picked:
        raise InvalidGeometry(
            f'"{pattern}" do not touch; touching pairs are {_listed(t.name for t in found)}.'
        )
    return picked


def faces(selector: str, bodies: Mapping[str, Body]) -> Selected:
    """The faces of one body that a selector picks, inside the bodies' ``with model(...)``.

    Raises InvalidGeometry, with what there is, for one that picks nothing or cannot choose.
    """
    point = POINT.fullmatch(selector)
    if point:
        body = _one_body(point[1], selector, bodies)
        return Selected(body.name, _nearest(body, selector, _numbers(selector, point.groups()[1:])))
    if selector.startswith("#"):
        owners = [b for b in bodies.values() if any(f.name == selector[1:] for f in b.faces)]
        body = owners[0] if len(owners) == 1 else None
        if body is None:
            raise InvalidGeometry(_no_name(selector, selector[1:], bodies, owners))
        return Selected(body.name, _called(body, selector, selector[1:]))
    name, _, what = selector.partition(":")
    body = _one_body(name, selector, bodies)
    return Selected(body.name, _of_body(body, selector, what))


def _of_body(body: Body, selector: str, what: str) -> tuple[int, ...]:
    if re.fullmatch("[+-][xyz]", what):
        return _outermost(body, selector, what)
    if what.startswith("#"):
        return _called(body, selector, what[1:])
    round_faces = ROUND.fullmatch(what)
    if round_faces:
        return _round(body, selector, round_faces)
    raise InvalidGeometry(
        f'"{selector}" picks no face; write "{body.name}:+x" (or -x, +y, ...), '
        f'"{body.name}@x,y,z", "{body.name}:hole", "{body.name}:hole(6..7 mm)" or '
        f'"{body.name}:cylinder".'
    )


def _outermost(body: Body, selector: str, what: str) -> tuple[int, ...]:
    direction = np.eye(3)["xyz".index(what[1])] * (1 if what[0] == "+" else -1)
    flat = [f for f in body.faces if f.normal is not None and f.normal @ direction > 1 - ALIGNED]
    if not flat:
        raise InvalidGeometry(
            f'"{selector}" finds no planar face that looks along {what}; {body.name} has '
            f"{_some(body.faces)}."
        )
    outermost = max(f.centre @ direction for f in flat)
    return tuple(f.tag for f in flat if f.centre @ direction > outermost - SAME)


def _nearest(body: Body, selector: str, point) -> tuple[int, ...]:
    away = {face.tag: body.distance(point, face.tag) for face in body.faces}
    first = body.face(min(away, key=lambda tag: away[tag]))
    tied = [f for f in body.faces if away[f.tag] < away[first.tag] + SAME]
    round_about = [bore.tags for hollow in (True, False) for bore in bores(body, hollow=hollow)]
    whole = next((tags for tags in round_about if first.tag in tags), (first.tag,))
    others = [f for f in tied if f.tag not in whole]
    if others:
        raise InvalidGeometry(
            f'"{selector}" is as near to {described(first)} as to {described(others[0])}; '
            "move the point into the middle of the face that is meant."
        )
    return whole


def _round(body: Body, selector: str, match: re.Match) -> tuple[int, ...]:
    there = bores(body, hollow=match[1] == "hole")
    low, high = match["from"] or 0.0, match["to"] or match["from"] or np.inf
    low, high = 1e-3 * float(low) - SAME, 1e-3 * float(high) + SAME
    found = [bore for bore in there if low <= bore.diameter <= high]
    if not found:
        have = sorted({f"{1e3 * bore.diameter:.6g}" for bore in there}, key=float)
        what = "holes" if match[1] == "hole" else "outer cylinders"
        sizes = f"{what} of diameter {', '.join(have)} mm" if have else f"no {what}"
        raise InvalidGeometry(f'"{selector}" finds nothing; {body.name} has {sizes}.')
    return tuple(tag for bore in found for tag in bore.tags)


def _called(body: Body, selector: str, name: str) -> tuple[int, ...]:
    found = tuple(f.tag for f in body.faces if f.name == name)
    if not found:
        raise InvalidGeometry(_no_name(selector, name, {body.name: body}, []))
    return found


def _no_name(selector: str, name: str, bodies: Mapping[str, Body], owners: list[Body]) -> str:
    if owners:
        return (
            f'"{selector}" names faces of {_listed(b.name for b in owners)}; write '
            f'"{owners[0].name}:#{name}".'
        )
    names = sorted({f.name for b in bodies.values() for f in b.faces if f.name})
    return f'"{selector}" finds no face of this name; the CAD names {_listed(names) or "none"}.'


def _one_body(name: str, selector: str, bodies: Mapping[str, Body]) -> Body:
    found = bodies_named(name.strip(), bodies)
    if len(found) > 1:
        raise InvalidGeometry(
            f'"{selector}" fits {_listed(found)}; it must pick faces of one body, name it.'
        )
    return bodies[found[0]]


def _between(pair: tuple[str, str], one: set[str], other: set[str]) -> bool:
    a, b = pair
    return (a in one and b in other) or (b in one and a in other)


def _numbers(selector: str, words: Sequence[str]) -> list[float]:
    return [_number(selector, word) for word in words]


def _number(selector: str, word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise InvalidGeometry(f'"{selector}" holds "{word}" where a finite number belongs.')
    return value


def _literal(pattern: str) -> str:
    """Only * has a meaning, [ and ? are letters."""
    return pattern.replace("[", "[[]").replace("?", "[?]")


def _listed(names) -> str:
    return ", ".join(f'"{name}"' for name in names)


def _some(found: Sequence[Face], n: int = 6) -> str:
    more = f" and {len(found) - n} more faces" if len(found) > n else ""
    return "; ".join(described(face) for face in found[:n]) + more
