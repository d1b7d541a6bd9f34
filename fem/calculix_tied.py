"""A deck of tetrahedra that CalculiX ties by itself: *TIE from surface to surface, *DLOAD.

Nothing here is of our own elements, couplings or contact: a body's touching face is a surface of
element faces, and the node CONTACT moves as the area of the disc does in the mean. Pressure on the
disc is a force of 1 N, so that its displacement is a compliance.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import chain, count

import numpy as np
from numpy.typing import NDArray

from fem.materials import Material

FACES = ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0))  # corners of S1 to S4 of a C3D10
GAUSS = ((1 / 6, 1 / 6), (2 / 3, 1 / 6), (1 / 6, 2 / 3))  # of a triangle, of equal weights
REACH = 1e-6  # m, by which tied faces may miss each other


def tied_deck(
    points: NDArray[np.float64],
    cells: Mapping[str, NDArray[np.int64]],
    materials: Mapping[str, Material],
    *,
    ties: Sequence[tuple[NDArray[np.int64], NDArray[np.int64]]],
    held: NDArray[np.int64],
    disc: tuple[NDArray[np.int64], NDArray[np.float64]],
    n_modes: int = 10,
) -> str:
    """Points (n, 3) [m], cells (m, 10) by body; ties of a slave's triangles (k, 6) to a master's;
    held nodes; the disc's triangles (k, 6) and the direction (3,) that its pressure pushes in.
    """
    element = _Elements(cells)
    contact = len(points) + 1
    lines = chain(
        ["*NODE"],
        (f"{i}, {x:.13g}, {y:.13g}, {z:.13g}" for i, (x, y, z) in enumerate(points, start=1)),
        element.lines(),
        *(_tied(i, element, *pair) for i, pair in enumerate(ties)),
        ["*BOUNDARY", *(f"{node + 1}, 1, 3" for node in np.unique(held))],
        _mean(points, contact, *disc),
        *(_material(name, materials[name]) for name in cells),
        ["*STEP", "*FREQUENCY", f"{n_modes}", "*END STEP", "*STEP", "*STATIC", "*DLOAD"],
        _pressed(points, element, disc[0]),
        ["*NODE PRINT, NSET=CONTACT", "U", "*END STEP"],
    )
    return "\n".join(lines) + "\n"


class _Elements:
    """All cells, and which face of which one a triangle is."""

    def __init__(self, cells: Mapping[str, NDArray[np.int64]]) -> None:
        self.cells = cells
        every = np.concatenate(list(cells.values()))
        self.face = {
            tuple(sorted(corners)): (number, side)
            for side, at in enumerate(FACES, start=1)
            for number, corners in enumerate(every[:, at].tolist(), start=1)
        }

    def lines(self) -> Iterator[str]:
        number = count(1)
        for body, nodes in self.cells.items():
            yield f"*ELEMENT, TYPE=C3D10, ELSET={body.upper()}"
            yield from (", ".join(map(str, [next(number), *cell])) for cell in nodes + 1)

    def faces(self, triangles: NDArray[np.int64]) -> Iterator[tuple[int, int]]:
        return (self.face[tuple(sorted(corners))] for corners in triangles[:, :3].tolist())


def _tied(i: int, element: _Elements, slave, master) -> Iterator[str]:
    for name, triangles in (("SLAVE", slave), ("MASTER", master)):
        yield f"*SURFACE, NAME={name}{i}, TYPE=ELEMENT"
        yield from (f"{number}, S{side}" for number, side in element.faces(triangles))
    yield f"*TIE, NAME=TIE{i}, POSITION TOLERANCE={REACH}, ADJUST=NO"
    yield f"SLAVE{i}, MASTER{i}"


def _shares(points: NDArray[np.float64], triangles: NDArray[np.int64]) -> NDArray[np.float64]:
    """Integral of each shape function over curved triangles of six nodes, (n,) [m^2]."""
    share = np.zeros(len(points))
    for a, b in GAUSS:
        c = 1 - a - b
        N = [c * (2 * c - 1), a * (2 * a - 1), b * (2 * b - 1), 4 * a * c, 4 * a * b, 4 * b * c]
        along_a = [1 - 4 * c, 4 * a - 1, 0, 4 * (c - a), 4 * b, -4 * b]
        along_b = [1 - 4 * c, 0, 4 * b - 1, -4 * a, 4 * a, 4 * (c - b)]
        sides = (np.tensordot(d, points[triangles], (0, 1)) for d in (along_a, along_b))
        area = np.linalg.norm(np.cross(*sides), axis=1) / 2 / len(GAUSS)
        np.add.at(share, triangles, np.outer(area, N))
    return share


def _mean(points, contact: int, triangles, inward) -> Iterator[str]:
    """Displacement 1 of a node of its own: that of the disc's area along `inward`."""
    share = _shares(points, triangles)
    share /= share.sum()
    terms = [(contact, 1, -1.0)]
    terms += [
        (node + 1, axis + 1, share[node] * inward[axis])
        for node in np.flatnonzero(share)
        for axis in np.flatnonzero(inward)
    ]
    yield from ("*NODE, NSET=CONTACT", f"{contact}, 0, 0, 0", "*EQUATION", f"{len(terms)}")
    yield from (f"{node}, {direction}, {factor:.12e}" for node, direction, factor in terms)
    yield from ("*BOUNDARY", f"{contact}, 2, 3")


def _pressed(points, element: _Elements, triangles) -> Iterator[str]:
    pressure = 1.0 / _shares(points, triangles).sum()
    return (f"{number}, P{side}, {pressure:.12e}" for number, side in element.faces(triangles))


def _material(body: str, material: Material) -> Iterator[str]:
    name = body.upper()
    yield from (f"*MATERIAL, NAME={name}", "*ELASTIC", f"{material.young}, {material.poisson}")
    yield from ("*DENSITY", f"{material.density}")
    yield f"*SOLID SECTION, ELSET={name}, MATERIAL={name}"
