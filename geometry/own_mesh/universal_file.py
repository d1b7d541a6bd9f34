"""Meshes of universal files (I-DEAS): nodes, elements, groups, and the unit of length.

Data sets 15, 781 and 2411 (nodes), 780 and 2412 (elements), 164 (units), and of permanent groups
those that list the number of an entity after its type: 2429 to 2435 in pairs, 2452, 2467 and 2477
in fours. SDRC, I-DEAS Universal File Datasets.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from beadwave.geometry.errors import InvalidGeometry
from beadwave.geometry.own_mesh.cell_groups import CellGroup, MeshFile, Origin

# dimension and nodes by the number of a kind of element
ELEMENTS = {
    **{kind: (2, 3) for kind in (41, 51, 61, 74, 81, 91)},
    **{kind: (2, 6) for kind in (42, 52, 62, 72, 82, 92)},
    **{kind: (2, 4) for kind in (44, 54, 64, 71, 84, 94)},
    **{kind: (2, 8) for kind in (45, 55, 65, 75, 85, 95)},
    111: (3, 4), 118: (3, 10), 112: (3, 6), 113: (3, 15), 115: (3, 8), 116: (3, 20),
}  # fmt: skip
# VTK's order: universal files go around a face, corners and middles in turn
ORDER = {
    (2, 6): [0, 2, 4, 1, 3, 5],
    (2, 8): [0, 2, 4, 6, 1, 3, 5, 7],
    (3, 10): [0, 2, 4, 9, 1, 3, 5, 6, 7, 8],
    (3, 20): [0, 2, 4, 6, 12, 14, 16, 18, 1, 3, 5, 7, 13, 15, 17, 19, 8, 9, 10, 11],
}
BEAMS = (11, 21, 22, 23, 24)  # have a line of orientation before their nodes
ENTRY = {**dict.fromkeys((2429, 2430, 2432), 2), **dict.fromkeys((2435, 2452, 2467, 2477), 4)}
OF_ELEMENT = 8  # type of an entity of a group


def read(path: Path) -> MeshFile:
    """Points in metres by the file's own unit, and its groups of elements; elements of no group by
    the number of their property. Raises InvalidGeometry, naming the data set, for what cannot be
    read."""
    content = path.read_bytes()
    try:
        lines = content.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        lines = content.decode("latin-1").splitlines()
    rows: dict[int, int] = {}
    points: list[list[float]] = []
    elements: dict[int, tuple[int, list[int], int]] = {}  # dimension, nodes, property
    sets: list[tuple[str, list[int]]] = []
    metre = 1.0  # the file's units in one
    for kind, body in _data_sets(lines):
        try:
            if kind == 164:
                metre = _real(body[1].split()[0])
            elif kind == 15:
                for line in body:
                    number, *_, x, y, z = line.split()
                    rows[int(number)] = len(points)
                    points.append([_real(x), _real(y), _real(z)])
            elif kind in (781, 2411):
                for head, line in zip(body[::2], body[1::2], strict=True):
                    rows[int(head.split()[0])] = len(points)
                    points.append([_real(word) for word in line.split()[:3]])
            elif kind in (780, 2412):
                _add_elements(kind, body, elements)
            elif kind in ENTRY:
                sets += _groups(body, ENTRY[kind])
        except (ValueError, IndexError):
            raise InvalidGeometry(f"its data set {kind} cannot be read") from None

    def cells(labels: list[int]) -> Iterator[tuple[int, np.ndarray]]:
        """Dimension and nodes (n, k) of these elements, those of one kind together."""
        of_kind: dict[tuple[int, int], list] = {}
        for label in dict.fromkeys(labels):
            if label in elements:
                dimension, nodes, _ = elements[label]
                of_kind.setdefault((dimension, len(nodes)), []).append([rows[n] for n in nodes])
        for (dimension, n), table in of_kind.items():
            yield dimension, np.array(table)[:, ORDER.get((dimension, n), slice(None))]

    try:
        groups = [CellGroup(name, d, nodes) for name, labels in sets for d, nodes in cells(labels)]
        properties: dict[int, list[int]] = {}
        for label, (dimension, _, number) in elements.items():
            if dimension == 3:
                properties.setdefault(number, []).append(label)
        for number, labels in properties.items():
            groups += [CellGroup(f"{number}", d, n, Origin.NUMBER) for d, n in cells(labels)]
    except KeyError as missing:
        raise InvalidGeometry(f"an element has the node {missing}, which is not there") from None
    return MeshFile(np.reshape(points, (-1, 3)) / metre, groups)


def _add_elements(kind: int, body: list[str], elements: dict) -> None:
    """Adds the elements of a data set by label; those of other kinds are skipped."""
    lines = iter(body)
    for head in lines:
        words = [int(word) for word in head.split()]
        label, element = words[:2]
        number, n = (words[2], words[5]) if kind == 2412 else (words[3], words[7])
        if element in BEAMS:
            next(lines)
        nodes: list[int] = []
        while len(nodes) < n:
            nodes += [int(word) for word in next(lines, "x").split()]
        if ELEMENTS.get(element, (0, 0))[1] == n:
            elements[label] = (ELEMENTS[element][0], nodes, number)


def _groups(body: list[str], entry: int) -> Iterator[tuple[str, list[int]]]:
    """Names of groups and the labels of their elements; `entry` numbers describe a member."""
    lines = iter(body)
    for head in lines:
        n = int(head.split()[-1])
        name, members = next(lines, "").strip(), []
        while len(members) < entry * n:
            members += [int(word) for word in next(lines, "x").split()]
        table = np.reshape(members, (-1, entry))
        yield name, table[table[:, 0] == OF_ELEMENT, 1].tolist()


def _real(word: str) -> float:
    return float(word.upper().replace("D", "E"))


def _data_sets(lines: list[str]) -> Iterator[tuple[int, list[str]]]:
    """Numbers of data sets and their lines; raises InvalidGeometry for one that does not end."""
    start = None
    for i, line in enumerate(lines):
        if line.strip() == "-1" and line.startswith("    -1"):
            if start is None:
                start = i + 1
                continue
            kind = lines[start].split()[0].rstrip("b") if start < i else ""
            if kind.isdecimal():
                yield int(kind), lines[start + 1 : i]
            start = None
    if start is not None:
        raise InvalidGeometry("it is cut off within a data set")
