"""Meshes of Abaqus and CalculiX input decks: nodes, elements and sets of elements.

Keywords may be in any order and repeated; a set that is named twice is the union. Node and element
numbers belong to their part where the deck has parts. A part, a set (*ELSET) and the set of a block
of elements (*ELEMENT, ELSET=) are each a group; sets that the writer marks as internal are not.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from beadwave.geometry.errors import InvalidGeometry
from beadwave.geometry.own_mesh.cell_groups import CellGroup, MeshFile, Origin

SOLID = re.compile(r"C3D(4|6|8|10|15|20)\D*$")
SURFACE = re.compile(r"(?:STRI|SFM3D|M3D|R3D|CPS|CPE|CAX|DS|S)(3|4|6|8|65)\D*$")
DEPTH = 5  # of *INCLUDE in files that are included


class Block(NamedTuple):
    """A keyword line and the lines of data below it."""

    keyword: str  # "NODE", in capitals
    parameters: dict[str, str]  # by names in capitals, values as written
    lines: list[str]


def read(path: Path) -> MeshFile:
    """Points and groups of a deck; raises InvalidGeometry, naming the keyword, for what it lacks or
    what is not taken: parts that are moved or used twice."""
    nodes: dict[tuple[str, int], int] = {}  # rows of points by part and number
    points: list[list[float]] = []
    # of elements by part and number: dimension and rows of points
    elements: dict[tuple[str, int], tuple[int, list[int]]] = {}
    sets: dict[tuple[str, str], tuple[Origin, list[tuple[str, int]]]] = {}  # by part and name
    part_of_instance: dict[str, str] = {}
    part = ""

    def joined(name: str, scope: str, origin: Origin, members: list[tuple[str, int]]) -> None:
        """Adds members to a set, whose name has no case."""
        old = next((key for key in sets if key == (scope, name) or _same(key, scope, name)), None)
        before, content = sets.pop(old) if old else (origin, [])
        sets[old or (scope, name)] = (min(before, origin), content + members)

    try:
        for keyword, parameters, lines in _blocks(path):
            if keyword == "PART":
                part = parameters.get("NAME", "")
            elif keyword in ("END PART", "END INSTANCE"):
                part = ""
            elif keyword == "INSTANCE":
                name, of = parameters.get("NAME", ""), parameters.get("PART", "")
                if of in part_of_instance.values():
                    raise InvalidGeometry(f"it uses the part {of!r} twice; write a flat deck")
                if any(float(x or 0) for line in lines[:1] for x in line.split(",")):
                    raise InvalidGeometry(f"it moves the instance {name!r}; write a flat deck")
                part_of_instance[name] = of
                part = of
            elif keyword == "NODE":
                for line in lines:
                    number, *x = line.strip().strip(",").split(",")
                    nodes[part, int(number)] = len(points)
                    points.append([*map(float, x), 0.0, 0.0][:3])
            elif keyword == "ELEMENT":
                kind = parameters["TYPE"].upper()
                solid, surface = SOLID.match(kind), SURFACE.match(kind)
                if not solid and not surface:
                    continue
                n = int((solid or surface)[1])
                n = {65: 6}.get(n, n)
                numbers = [int(word) for line in lines for word in line.split(",") if word.strip()]
                table = np.reshape(numbers, (-1, n + 1)).tolist()
                for label, *corners in table:
                    rows = [nodes[part, corner] for corner in corners]
                    elements[part, label] = (3 if solid else 2, rows)
                members = [(part, row[0]) for row in table]
                if name := parameters.get("ELSET"):
                    joined(name, part, Origin.BLOCK, members)
                if part:
                    joined(part, part, Origin.NAME, members)
            elif keyword == "ELSET" and "INTERNAL" not in parameters:
                scope = part_of_instance.get(parameters.get("INSTANCE", ""), part)
                words = [word.strip() for line in lines for word in line.split(",")]
                members = []
                if "GENERATE" in parameters:
                    for line in lines:
                        first, last, *step = (int(w) for w in line.strip().strip(",").split(","))
                        step = range(first, last + 1, *step)
                        members += [(scope, k) for k in step if (scope, k) in elements]
                else:
                    for word in filter(None, words):
                        if word.isdecimal():
                            members.append((scope, int(word)))
                        else:
                            named = [key for key in sets if _same(key, scope, word)]
                            if not named:
                                raise KeyError(word)
                            members += sets[named[0]][1]
                joined(parameters["ELSET"], scope, Origin.NAME, members)
    except InvalidGeometry:
        raise
    except (ValueError, IndexError):
        raise InvalidGeometry(f"the data of a *{keyword} cannot be read") from None
    except KeyError as missing:
        raise InvalidGeometry(f"*{keyword} refers to {missing}, which it does not hold") from None

    # sets of one name in several parts are told apart by the part; cells of one kind are a group
    names = [name for _, name in sets]
    groups = []
    for (scope, name), (origin, members) in sets.items():
        full = name if names.count(name) == 1 or not scope else f"{scope}.{name}"
        rows: dict[tuple[int, int], list] = {}
        for member in dict.fromkeys(members):
            if member in elements:
                dimension, cell = elements[member]
                rows.setdefault((dimension, len(cell)), []).append(cell)
        groups += [CellGroup(full, d, np.array(cells), origin) for (d, _), cells in rows.items()]
    unnamed: dict[int, list] = {}
    for dimension, cell in elements.values():
        if dimension == 3:
            unnamed.setdefault(len(cell), []).append(cell)
    groups += [CellGroup("1", 3, np.array(c), Origin.NUMBER) for c in unnamed.values()]
    return MeshFile(np.reshape(points, (-1, 3)), groups)


def _same(key: tuple[str, str], scope: str, name: str) -> bool:
    """True if a set's key is this name in this part; names have no case."""
    return key[0] == scope and key[1].upper() == name.upper()


def _blocks(path: Path, depth: int = 0) -> Iterator[Block]:
    """Keyword lines with their data, files that are included in their places."""
    if depth > DEPTH:
        raise InvalidGeometry(f"its files include each other more than {DEPTH} deep")
    content = path.read_bytes()
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    block = None
    for line in text.splitlines():
        if line.startswith("**") or not line.strip():
            continue
        if not line.lstrip().startswith("*"):
            if block is None:
                continue
            # a keyword line that ends in a comma goes on
            if not block.lines and block.parameters.pop("", None) is not None:
                _add(block.parameters, line)
            else:
                block.lines.append(line)
            continue
        if block:
            yield from _included(block, path, depth)
        keyword, _, rest = line.strip().lstrip("*").partition(",")
        block = Block(" ".join(keyword.upper().split()), {}, [])
        _add(block.parameters, rest)
    if block:
        yield from _included(block, path, depth)


def _included(block: Block, path: Path, depth: int) -> Iterator[Block]:
    if block.keyword != "INCLUDE":
        yield block
        return
    other = path.parent / block.parameters.get("INPUT", "").strip("\"'")
    if not other.is_file():
        raise InvalidGeometry(f"it includes {other.name}, which is not in the same folder")
    yield from _blocks(other, depth + 1)


def _add(parameters: dict[str, str], line: str) -> None:
    """Adds the parameters of a keyword line; an empty name stands for a comma at its end."""
    for word in line.split(","):
        key, _, value = word.partition("=")
        parameters[key.strip().upper()] = value.strip().strip('"')
    if line.strip() and not line.rstrip().endswith(","):
        parameters.pop("", None)
    elif not line.strip():
        parameters.clear()
