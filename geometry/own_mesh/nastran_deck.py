"""Meshes of Nastran bulk data: nodes, and elements by their property.

A property is called as the comment says that HyperMesh, ANSA, Femap or Patran write next to it,
else by its number. Fields may be free, small or large; lines before BEGIN BULK are skipped.
"""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from beadwave.geometry.errors import InvalidGeometry
from beadwave.geometry.own_mesh.cell_groups import CellGroup, MeshFile, Origin

# dimension and nodes of the elements with corners alone and with middles of edges
ELEMENTS = {
    "CTETRA": (3, 4, 10), "CHEXA": (3, 8, 20), "CPENTA": (3, 6, 15), "CPYRAM": (3, 5, 13),
    "CPYRA": (3, 5, 13), "CTRIA3": (2, 3, 3), "CTRIAR": (2, 3, 3), "CTRIA6": (2, 6, 6),
    "CQUAD4": (2, 4, 4), "CQUADR": (2, 4, 4), "CQUAD8": (2, 8, 8),
}  # fmt: skip
# Nastran has the middles of the upright edges of a hexahedron before those of the upper ones
HEXAHEDRON_20 = [*range(12), *range(16, 20), *range(12, 16)]

NAMED = (  # comments with the number of a property and its name
    re.compile(r'\$HMNAME\s+PROP\w*\s+(\d+)\s*"([^"]*)"', re.I),
    re.compile(r"\$ANSA_NAME_COMMENT;(\d+);PSOLID;([^;]*);", re.I),
    re.compile(r"\$.*\bproperty:?\s+(\d+)\s*(?::|name:)\s*(.+)", re.I),
)
# a component of HyperMesh has its property's number behind its name, or is called by it
COMPONENT = re.compile(r'\$HMNAME\s+COMP\w*\s+(\d+)\s*"([^"]*)"(?:\s+(\d+))?', re.I)
REGION = re.compile(r"\$.*properties for region\s*:\s*(.+)", re.I)  # of the next property
ANSA = re.compile(r"\$ANSA_NAME;(\d+);PSOLID;", re.I)  # of the next comment
EXPONENT = re.compile(r"(?<=[\d.])([+-]\d+)$")  # 1.5-3 is 1.5e-3


def read(path: Path) -> MeshFile:
    """Points and groups of a deck; raises InvalidGeometry, naming the card, for what is wrong with
    it and for nodes in a coordinate system of their own."""
    content = path.read_bytes()
    try:
        lines = content.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        lines = content.decode("latin-1").splitlines()
    points, rows = [], {}
    cells: dict[tuple[int, int, int], list] = {}  # numbers of nodes by property, dimension, nodes
    for name, fields in _cards(lines):
        try:
            if name in ("GRID", "GRDSET"):
                number, system, *x = [*fields, *[""] * 5][:5]
                if system not in ("", "0"):
                    raise InvalidGeometry(
                        f"{name} {number} is in the coordinate system {system}; write the nodes in "
                        "the basic system"
                    )
                if name == "GRID":
                    rows[int(number)] = len(points)
                    points.append([_real(word) for word in x])
            elif name in ELEMENTS:
                dimension, n_corners, n_nodes = ELEMENTS[name]
                label, property_, *words = fields
                numbers = [int(word or 0) for word in words]
                n = n_nodes if any(numbers[n_corners:n_nodes]) else n_corners
                numbers = [*numbers, *[0] * n][:n]
                if not all(numbers[: min(n_corners, 4)]):
                    raise ValueError
                key = (int(property_ or label), dimension, n)
                cells.setdefault(key, []).append(numbers)
            elif name == "INCLUDE":
                raise InvalidGeometry(f"it includes {' '.join(fields)}; write one file")
        except (ValueError, IndexError) as odd:
            if isinstance(odd, InvalidGeometry):
                raise
            raise InvalidGeometry(f"{name} {' '.join(fields)[:60]} cannot be read") from None

    # -1 for middles of edges that are left out, which Nastran allows for
    names, groups = _names(lines), []
    for (property_, dimension, n), numbers in cells.items():
        try:
            nodes = np.array([[rows[k] if k else -1 for k in cell] for cell in numbers])
        except KeyError as missing:
            raise InvalidGeometry(f"an element has the node {missing}, which is no GRID") from None
        if n == 20:
            nodes = nodes[:, HEXAHEDRON_20]
        name = names.get(property_) or f"{property_}"
        groups.append(CellGroup(name, dimension, nodes, Origin.NAME))
    return MeshFile(np.reshape(points, (-1, 3)).astype(float), groups)


def _cards(lines: list[str]) -> Iterator[tuple[str, list[str]]]:
    """Names of cards and their fields, without those of continuations."""
    bulk = [i for i, line in enumerate(lines) if line.upper().split()[:2] == ["BEGIN", "BULK"]]
    name, fields = "", []
    for line in lines[bulk[0] + 1 if bulk else 0 :]:
        line = line.partition("$")[0].rstrip()
        if not line.strip():
            continue
        if line.upper().startswith("ENDDATA"):
            break
        # fields of a line: free ones between commas, else eight columns, or sixteen where the
        # first one has an asterisk; the tenth is the mark of a continuation
        if "," in line:
            head, *words = line.split(",")
            words = words[: 4 if "*" in head else 8]
        else:
            line = line.expandtabs(8)
            head, width = line[:8], 16 if "*" in line[:8] else 8
            words = [line[k : k + width] for k in range(8, min(len(line), 72), width)]
        words = [word.strip() for word in words]
        head = head.strip()
        if head[:1] in ("", "+", "*"):
            full = -len(fields) % (4 if "*" in head else 8)
            fields += [""] * full + words
            continue
        if name:
            yield name, fields
        name, fields = head.rstrip("*").upper(), words
    if name:
        yield name, fields


def _real(word: str) -> float:
    """A number of Nastran's: 1.5-3, 1.5D-3 or 1.5e-3; empty for 0."""
    if not word:
        return 0.0
    return float(EXPONENT.sub(r"e\1", word.upper().replace("D", "E")))


def _names(lines: list[str]) -> dict[int, str]:
    """Names of properties by number, as comments of writers have them."""
    named: dict[int, str] = {}
    components: dict[int, str] = {}
    region = of_next = None
    for line in lines:
        if line.startswith("$"):
            if of_next is not None:
                named[of_next] = line[1:].strip()
                of_next = None
            if match := ANSA.match(line):
                of_next = int(match[1])
            elif match := next(filter(None, (p.match(line) for p in NAMED)), None):
                named[int(match[1])] = match[2].strip()
            elif match := COMPONENT.match(line):
                components[int(match[3] or match[1])] = match[2].strip()
            elif match := REGION.match(line):
                region = match[1].strip()
        elif region and line.upper().startswith("PSOLID"):
            words = line.replace(",", " ").replace("*", " ").split()
            named.setdefault(int(words[1]), region)
            region = None
    return {n: name for n, name in (components | named).items() if name.lower() != "untitled"}
