"""How many nodes a mesh of the assembly will have, from its dimensions and seeds alone.

Boxes of hexahedra are counted line by line; sheets, and tetrahedra, by the volume that an element
of the seed fills, with factors measured on meshes from half to twice the default seeds.
"""

from math import log, prod

from geometry.assembly import Assembly, boxes, screw_cells, sheets
from geometry.grid_lines import n_cells
from geometry.hex_mesh import box_stops

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
    glued: bool = False,
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
            stops = box_stops(
                a, name, size, contact_seed=fine, contact_point=contact_point, glued=glued
            )
            found[name] = _serendipity([n_cells(along, size) for along in stops])
    length = a.head_overlap + a.sheet_free_length + a.foot_overlap
    flat = SHEET[element] * length * a.sheet_width / seed**2
    return found | {name: flat + 2 * len(screw_cells(a)) * AROUND[element] for name in sheets(a)}


def _serendipity(n) -> float:
    """Corners and edges of a grid of n (3,) cells."""
    corners = prod(k + 1 for k in n)
    return corners * (1 + sum(k / (k + 1) for k in n))
