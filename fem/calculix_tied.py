"""A deck of tetrahedra that CalculiX ties by itself: *TIE from surface to surface, *DLOAD.

Nothing here is of our own elements, couplings or contact: a body's touching face is a surface of
element faces, a screw a *RIGID BODY on springs to the mean motion of what is under it, and the node
CONTACT moves as the area of the disc does in the mean. Pressure on the disc is a force of 1 N, so
that its displacement is a compliance.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain, count
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fem.materials import Material

FACES = ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0))  # corners of S1 to S4 of a C3D10
GAUSS = ((1 / 6, 1 / 6), (2 / 3, 1 / 6), (1 / 6, 2 / 3))  # of a triangle, of equal weights
REACH = 1e-6  # m, by which tied faces may miss each other


class Screw(NamedTuple):
    """Six springs between nodes that move as one and the mean motion of an area."""

    rigid: NDArray[np.int64]  # (n,) nodes
    under: NDArray[np.int64]  # (k, 6) triangles
    inside: Callable[[NDArray[np.float64]], NDArray[np.bool_]]  # of points (m, 3): on the area
    centre: NDArray[np.float64]  # (3,) [m]
    stiffness: NDArray[np.float64]  # (6,) [N/m], [N m/rad]


def tied_deck(
    points: NDArray[np.float64],
    cells: Mapping[str, NDArray[np.int64]],
    materials: Mapping[str, Material],
    *,
    ties: Sequence[tuple[NDArray[np.int64], NDArray[np.int64]]],
    held: NDArray[np.int64],
    disc: tuple[NDArray[np.int64], NDArray[np.float64]],
    screws: Sequence[Screw] = (),
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
        *(_screwed(points, element.number, i, screw) for i, screw in enumerate(screws)),
        ["*BOUNDARY", *(f"{node + 1}, 1, 3" for node in np.unique(held))],
        _mean(points, contact, *disc),
        *(_material(name, materials[name]) for name in cells),
        ["*STEP", "*FREQUENCY", "10", "*END STEP", "*STEP", "*STATIC", "*DLOAD"],
        _pressed(points, element, disc[0]),
        ["*NODE PRINT, NSET=CONTACT", "U", "*END STEP"],
    )
    return "\n".join(lines) + "\n"


class _Elements:
    """All cells, and which face of which one a triangle is."""

    def __init__(self, cells: Mapping[str, NDArray[np.int64]]) -> None:
        self.cells, self.number = cells, count(1)
        every = np.concatenate(list(cells.values()))
        self.face = {
            tuple(sorted(corners)): (number, side)
            for side, at in enumerate(FACES, start=1)
            for number, corners in enumerate(every[:, at].tolist(), start=1)
        }

    def lines(self) -> Iterator[str]:
        for body, nodes in self.cells.items():
            yield f"*ELEMENT, TYPE=C3D10, ELSET={body.upper()}"
            yield from (", ".join(map(str, [next(self.number), *cell])) for cell in nodes + 1)

    def faces(self, triangles: NDArray[np.int64]) -> Iterator[tuple[int, int]]:
        return (self.face[tuple(sorted(corners))] for corners in triangles[:, :3].tolist())


def _tied(i: int, element: _Elements, slave, master) -> Iterator[str]:
    for name, triangles in (("SLAVE", slave), ("MASTER", master)):
        yield f"*SURFACE, NAME={name}{i}, TYPE=ELEMENT"
        yield from (f"{number}, S{side}" for number, side in element.faces(triangles))
    yield f"*TIE, NAME=TIE{i}, POSITION TOLERANCE={REACH}, ADJUST=NO"
    yield f"SLAVE{i}, MASTER{i}"


def _quadrature(points: NDArray[np.float64], triangles: NDArray[np.int64]) -> Iterator[tuple]:
    """Shape functions (6,), places (k, 3) and areas (k,) at Gauss' points of curved triangles."""
    for a, b in GAUSS:
        c = 1 - a - b
        N = [c * (2 * c - 1), a * (2 * a - 1), b * (2 * b - 1), 4 * a * c, 4 * a * b, 4 * b * c]
        along_a = [1 - 4 * c, 4 * a - 1, 0, 4 * (c - a), 4 * b, -4 * b]
        along_b = [1 - 4 * c, 0, 4 * b - 1, -4 * a, 4 * a, 4 * (c - b)]
        place, *sides = (np.tensordot(d, points[triangles], (0, 1)) for d in (N, along_a, along_b))
        area = np.linalg.norm(np.cross(*sides), axis=1) / 2 / len(GAUSS)
        yield np.array(N), place, area


def _shares(points: NDArray[np.float64], triangles: NDArray[np.int64]) -> NDArray[np.float64]:
    """Integral of each shape function over the triangles, (n,) [m^2]."""
    share = np.zeros(len(points))
    for N, _, area in _quadrature(points, triangles):
        np.add.at(share, triangles, np.outer(area, N))
    return share


def _mean_motion(points: NDArray[np.float64], screw: Screw) -> NDArray[np.float64]:
    """(G^T W G)^-1 G^T W: the area's shift and turn (6) by displacements of nodes, (6, 3 n)."""
    GtWG, GtW = np.zeros((6, 6)), np.zeros((len(points), 3, 6))
    for N, place, area in _quadrature(points, screw.under):
        weight = area * screw.inside(place)
        away = place - screw.centre
        turned = [np.cross(axis, away) for axis in np.eye(3)]
        G = np.stack([np.broadcast_to(axis, away.shape) for axis in np.eye(3)] + turned, axis=2)
        GtWG += np.einsum("k,kai,kaj->ij", weight, G, G)
        np.add.at(GtW, screw.under, np.einsum("k,n,kai->knai", weight, N, G))
    return np.linalg.solve(GtWG, GtW.reshape(-1, 6).T)


def _screwed(points, number: Iterator[int], i: int, screw: Screw) -> Iterator[str]:
    first = len(points) + 2 + 4 * i
    rigid, turn, mean, mean_turn = range(first, first + 4)
    yield "*NODE"
    yield from (f"{node}, {', '.join(map(repr, screw.centre.tolist()))}" for node in
                range(first, first + 4))  # fmt: skip
    yield f"*NSET, NSET=SCREW{i}"
    yield from (f"{node + 1}," for node in np.unique(screw.rigid))
    yield f"*RIGID BODY, NSET=SCREW{i}, REF NODE={rigid}, ROT NODE={turn}"
    for j, row in enumerate(_mean_motion(points, screw)):
        ends, axis = ((rigid, mean), j) if j < 3 else ((turn, mean_turn), j - 3)
        used = np.flatnonzero(row)
        yield from ("*EQUATION", f"{len(used) + 1}", f"{ends[1]}, {axis + 1}, -1.")
        yield from (f"{dof // 3 + 1}, {dof % 3 + 1}, {row[dof]:.12e}" for dof in used)
        yield f"*ELEMENT, TYPE=SPRING2, ELSET=SPRING{i}_{j}"
        yield f"{next(number)}, {ends[0]}, {ends[1]}"
        yield f"*SPRING, ELSET=SPRING{i}_{j}"
        yield from (f"{axis + 1}, {axis + 1}", f"{screw.stiffness[j]:.12e}")


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
