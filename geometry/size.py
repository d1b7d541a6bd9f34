"""Number of nodes that a mesh of the assembly will have, from its dimensions and seeds alone.

Nodes of boxes of hexahedra are counted along their grid lines; those of sheets and of tetrahedra
are estimated from the volume over that of an element of the seed.
"""

from collections.abc import Mapping
from math import log, prod
from typing import NamedTuple

from geometry.assembly import Assembly, boxes, screw_cells, sheets
from geometry.grid_lines import n_cells
from geometry.hex_mesh import box_stops


class RigCount(NamedTuple):
    """Factors of the number of nodes, measured on meshes from half to twice the default seeds."""

    sheet: Mapping[str, float] = {"hex": 15.0, "tet": 11.0}  # nodes over area / seed^2
    # nodes around a screw, however large the seed
    screw: Mapping[str, float] = {"hex": 300.0, "tet": 1500.0}
    tet: float = 13.0  # nodes over volume / seed^3
    # nodes of tetrahedra over the logarithm of the block's seed over the contact's
    refined: float = 650.0
    imprinted: float = 500.0  # nodes of tetrahedra around the squares on a part below, as large


COUNT = RigCount()


def n_nodes(
    assembly: Assembly,
    element: str,
    *,
    seed: float,
    block_seed: float,
    support_seed: float,
    contact_seed: float,
    contact_point: tuple[float, float] = (0.0, 0.0),
    glued: bool = False,
) -> dict[str, float]:
    """Nodes of quadratic elements by body, for "hex" within a tenth, for "tet" a third."""
    a = assembly
    nodes = {}
    for name, box in boxes(a).items():
        size = block_seed if name == "block" else support_seed
        fine = contact_seed if name == "block" else None
        if element == "tet":
            nodes[name] = COUNT.tet * prod(box.upper - box.lower) / size**3
            nodes[name] += COUNT.refined * log(max(1.0, size / fine)) if fine else COUNT.imprinted
            continue
        stops = box_stops(
            a, name, size, contact_seed=fine, contact_point=contact_point, glued=glued
        )
        # corners and edges of a grid of so many cells
        n = [n_cells(along, size) for along in stops]
        corners = prod(k + 1 for k in n)
        nodes[name] = corners * (1 + sum(k / (k + 1) for k in n))
    length = a.head_overlap + a.sheet_free_length + a.foot_overlap
    flat = COUNT.sheet[element] * length * a.sheet_width / seed**2
    n_screws = 2 * len(screw_cells(a))
    return nodes | {name: flat + n_screws * COUNT.screw[element] for name in sheets(a)}
