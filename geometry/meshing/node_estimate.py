"""Number of nodes that a mesh of a drawn body will have, from its shape and seed alone.

Nodes of hexahedra are counted along their grid lines, those of tetrahedra estimated from the volume
over that of an element of the seed.
"""

from math import log, prod

from beadwave.geometry.cad.shapes import Box, Cylinder, Shape, Slab, volume
from beadwave.geometry.meshing.grid_lines import n_cells
from beadwave.geometry.meshing.lined_blocks import Lines, stops_of

# Factors of the number of nodes of tetrahedra, measured on meshes of the thesis' rig from half to
# twice the default seeds.
SOLID_NODES = 13.0  # nodes over volume / seed^3
PLATE_NODES = 11.0  # of a plate thinner than the seed, nodes over area / seed^2
HOLE_NODES = 1500.0  # nodes around a hole of a plate, however large the seed
# around a hole besides, times its length over its diameter; from 1560 to 2460 on cylinders with
# one or four holes of 4 to 9 mm, 12 to 80 mm deep
DRILLED_NODES = 2300.0
# of a cylinder without a bore, however large the seed, times its length over its diameter; from
# 1590 to 2010 where the length is half to ten times the diameter
ROUND_NODES = 1700.0
REFINED_NODES = 650.0  # over the logarithm of the seed over that at the contact
IMPRINT_NODES = 500.0  # around imprints on a body that is not struck, as large as the rig's


def n_nodes(shape: Shape, lines: Lines, seed: float) -> float:
    """Nodes of quadratic hexahedra between grid lines, within a tenth; exact without holes."""
    # vertices, and on each of the three families of edges their middles: serendipity elements of 20
    # nodes
    n = [n_cells(stops, seed) for stops in stops_of(shape, lines)]
    grid = prod(k + 1 for k in n) * (1 + sum(k / (k + 1) for k in n))
    # 300 nodes of hexahedra around a hole, however large the seed; measured as above
    return grid + 300.0 * len(lines.rings)


def n_nodes_of_tetrahedra(shape: Shape, seed: float, fine: float | None = None) -> float:
    """Nodes of quadratic tetrahedra, within a third, of cylinders within a factor of 2.2; `fine` is
    the size [m] where it is struck."""
    slenderness = 0.0  # lengths over diameters of holes and bore
    if not isinstance(shape, Box):
        height = shape.thickness if isinstance(shape, Slab) else shape.length
        slenderness = sum((h.depth or height) / h.diameter for h in shape.holes)
    if isinstance(shape, Cylinder):
        chord = 2 * (shape.radius - shape.bore)
        slenderness += sum(min(h.depth or chord, chord) / h.diameter for h in shape.radial_holes)
        slenderness += shape.length / (2 * shape.bore) if shape.bore else 0.0
    drilled = DRILLED_NODES * slenderness

    if isinstance(shape, Slab) and shape.thickness < seed:
        flat = PLATE_NODES * volume(shape) / shape.thickness / seed**2
        return flat + HOLE_NODES * len(shape.holes) + drilled
    around = IMPRINT_NODES if fine is None else REFINED_NODES * log(max(1.0, seed / fine))
    solid = SOLID_NODES * volume(shape) / seed**3
    if isinstance(shape, Cylinder) and not shape.bore:
        solid = max(solid, ROUND_NODES * shape.length / (2 * shape.radius))
    return solid + drilled + around
