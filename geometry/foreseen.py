"""How many nodes a body's mesh will have, before it is made.

Of quadratic elements of the size s in a body of the volume V and the thickness t = 2 V / area,

    n = V / s^3 (inner + outer s / t) + the finer elements around its cylinders

with factors measured on bodies of six kinds, at s from a third to all of the default seed.
"""

from math import log, pi

from geometry.assembly import InvalidGeometry
from geometry.gmsh_session import EDGES_AROUND
from geometry.sizes import GRADING, Size
from geometry.solids import Body, Face

INNER = {"hex": 3.9, "tet": 5.5}
OUTER = {"hex": 4.0, "tet": 8.5}
ON_CYLINDER = {False: 11.0, True: 20.0}  # nodes of tetrahedra over area / s^2, of pins and holes
MOST = 5e6  # nodes of a body: what no machine at hand solves


def foreseen_nodes(body: Body, size: Size, element: str) -> float:
    """Nodes of "hex" or "tet" within a factor of 2, without what imprints and fine points add."""
    thickness = 2 * body.volume / body.area
    grown = INNER[element] + OUTER[element] * size.seed / thickness
    bent = (face for face in body.faces if face.axis is not None)
    around = _around_hex if element == "hex" else _around_tet
    return body.volume / size.seed**3 * grown + sum(around(face, size.seed) for face in bent)


def require_few(body: Body, size: Size) -> None:
    """Raises InvalidGeometry for a seed that is too fine, with one that is not."""
    n = foreseen_nodes(body, size, "hex")
    if n > MOST:
        coarse = size.seed * (n / MOST) ** (1 / 3)
        raise InvalidGeometry(
            f'"{body.name}" with seed = {size.seed:.3g} m would have some {n:.1e} nodes, more '
            f"than {MOST:.0e}; take a seed above {coarse:.2g} m."
        )


def _around_tet(face: Face, seed: float) -> float:
    own = 2 * pi * face.radius / EDGES_AROUND
    return max(0.0, ON_CYLINDER[face.hollow] * face.area * (1 / own**2 - 1 / seed**2))


def _around_hex(face: Face, seed: float) -> float:
    """Rings of quadrilaterals that grow from the cylinder's size to the seed, in layers."""
    own = 2 * pi * face.radius / EDGES_AROUND
    if own >= seed:
        return 0.0
    long = face.along[1] - face.along[0]
    edges = EDGES_AROUND * face.area / (2 * pi * face.radius * long)
    rings = 1 - own / seed + log(seed / own) / GRADING
    if not face.hollow:  # inside a pin there is no room for more
        rings = min(rings, EDGES_AROUND / (4 * pi))
    return edges * rings * (4 * max(1, round(long / seed)) + 3)
