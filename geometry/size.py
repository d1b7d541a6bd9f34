"""How many nodes a mesh of the assembly will have, from its dimensions and seeds alone.

Boxes of hexahedra are counted line by line; sheets, and tetrahedra, by the volume that an element
of the seed fills, with factors measured on meshes from half to twice the default seeds.
"""

from itertools import pairwise
from math import log, prod

import numpy as np

from geometry.assembly import PARTS, Assembly, Box, boxes, corner_squares, screw_cells, sheets
from geometry.hex_mesh import GROWTH

SHEET = {"hex": 15.0, "tet": 11.0}  # nodes over area / seed^2
TET = 13.0  # nodes over volume / seed^3
REFINED = 650.0  # nodes of tetrahedra over the logarithm of the block's seed over the contact's
AROUND = {"hex": 300.0, "tet": 1500.0}  # nodes around a screw, however large the seed
IMPRINTED = 500.0  # nodes of tetrahedra around the squares on a part below, as large


def n_nodes(
    assembly: Assembly,
    element: str,
    *,
    seed: float,
    block_seed: float,
    support_seed: float,
    contact_seed: float,
    contact_point: tuple[float, float] = (0.0, 0.0),
) -> dict[str, float]:
    """Nodes of quadratic elements by body, for "hex" within a tenth, for "tet" a third."""
    a = assembly
    found = {}
    for name, box in boxes(a).items():
        size = block_seed if name == "block" else support_seed
        fine = contact_seed if name == "block" else None
        if element == "tet":
            found[name] = TET * prod(box.upper - box.lower) / size**3
            found[name] += REFINED * log(max(1.0, size / fine)) if fine else IMPRINTED
        else:
            found[name] = _serendipity(_divisions(a, name, box, size, fine, contact_point))
    length = a.head_overlap + a.sheet_free_length + a.foot_overlap
    flat = SHEET[element] * length * a.sheet_width / seed**2
    return found | {name: flat + 2 * len(screw_cells(a)) * AROUND[element] for name in sheets(a)}


def _serendipity(n) -> float:
    """Corners and edges of a grid of n (3,) cells."""
    corners = prod(k + 1 for k in n)
    return corners * (1 + sum(k / (k + 1) for k in n))


def _divisions(a: Assembly, name: str, box: Box, size: float, fine: float | None, point):
    spans = list(zip(box.lower, box.upper, strict=True))
    if fine is None:
        stops = [_stops(a, name, axis, span) for axis, span in enumerate(spans)]
        return [sum(max(1, round((v - u) / size)) for u, v in pairwise(s)) for s in stops]
    centre = (spans[0][1], point[0], a.block_z / 2 + point[1])
    return [
        sum(_graded(length, fine, size) for length in (c - lower, upper - c))
        for c, (lower, upper) in zip(centre, spans, strict=True)
    ]


def _stops(a: Assembly, name: str, axis: int, span: tuple[float, float]) -> list[float]:
    """Where the lines of a part below must pass: its neighbours' edges and its screws."""
    if axis == 2:
        return list(span)
    stack = [part for part in PARTS[2:] if part in a.parts]
    i = stack.index(name)
    edges = [boxes(a)[part][end][axis] for part in stack[max(0, i - 1) : i + 2] for end in (0, 1)]
    for _, near, far in corner_squares(a, name).values():
        edges += [span[0] + near, span[0] + far, span[1] - near, span[1] - far]
    return np.unique(np.clip([*span, *edges], *span).round(9)).tolist()


def _graded(length: float, fine: float, coarse: float) -> float:
    """Cells of a line that grow from one size to the other."""
    if length <= 0:
        return 0.0
    growing = max(0.0, log(coarse / fine) / log(GROWTH)) if fine < coarse else 0.0
    first = min(fine, coarse)
    covered = first * (GROWTH**growing - 1) / (GROWTH - 1)
    if covered > length:
        return log(1 + (GROWTH - 1) * length / first) / log(GROWTH)
    return growing + (length - covered) / coarse
