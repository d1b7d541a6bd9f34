"""A deck of tetrahedra that CalculiX ties by itself: *TIE from surface to surface, *DLOAD.

It uses none of our elements, couplings or contact functionals: touching faces are surfaces of
element faces, a screw is a *RIGID BODY on springs to the mean motion of the area under it, and the
node CONTACT has the mean displacement of the disc. The pressure on the disc is a force of 1 N, so
that this displacement is a compliance.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import count
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.fem.assembly.materials import Material
from beadwave.fem.exchange.deck import PRINT_CONTACT, Deck

FACES = ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0))  # corners of S1 to S4 of a C3D10
GAUSS = ((1 / 6, 1 / 6), (2 / 3, 1 / 6), (1 / 6, 2 / 3))  # of a triangle, of equal weights


class Screw(NamedTuple):
    """Six springs between nodes that move as one and the mean motion of an area."""

    rigid: NDArray[np.int64]  # (n,) nodes
    under: NDArray[np.int64]  # (k, 6) triangles
    inside: Callable[[NDArray[np.float64]], NDArray[np.bool_]]  # points (m, 3) on the area
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
    """The text of a deck for natural frequencies and the compliance of the disc.

    Points (n, 3) [m]; cells (m, 10) by body; ties of a slave's triangles (k, 6) to a master's;
    held nodes; the disc's triangles (k, 6) and the direction (3,) in which its pressure pushes.
    """
    deck = Deck(per_line=None, terms=1, number="")
    deck.nodes(count(1), points)
    for body, nodes in cells.items():
        deck.elements("C3D10", body.upper(), nodes + 1)

    # (element, side) of each triangle by its corners
    corners = np.concatenate(list(cells.values()))
    side_of = {
        tuple(sorted(triangle)): (number, side)
        for side, at in enumerate(FACES, start=1)
        for number, triangle in enumerate(corners[:, at].tolist(), start=1)
    }

    def sides(triangles: NDArray[np.int64]) -> list[tuple[int, int]]:
        """(element, side) of triangles (k, 6)."""
        return [side_of[tuple(sorted(triangle))] for triangle in triangles[:, :3].tolist()]

    for i, (slave, master) in enumerate(ties):
        for name, triangles in (("SLAVE", slave), ("MASTER", master)):
            deck.lines.append(f"*SURFACE, NAME={name}{i}, TYPE=ELEMENT")
            deck.lines += [f"{number}, S{side}" for number, side in sides(triangles)]
        # tolerance [m]: the distance by which tied faces may lie apart
        deck.lines.append(f"*TIE, NAME=TIE{i}, POSITION TOLERANCE=1e-06, ADJUST=NO")
        deck.lines.append(f"SLAVE{i}, MASTER{i}")

    # screws: nodes of a rigid body, of its turn, of the mean motion of the area and of its turn,
    # with six springs between the two motions; numbers behind those of the mesh and of CONTACT
    contact = len(points) + 1
    for i, screw in enumerate(screws):
        rigid, turn, mean, mean_turn = nodes = range(contact + 1 + 4 * i, contact + 5 + 4 * i)
        deck.nodes(nodes, [screw.centre.tolist()] * 4, number="")
        deck.lines.append(f"*NSET, NSET=SCREW{i}")
        deck.lines += [f"{node + 1}," for node in np.unique(screw.rigid)]
        deck.lines.append(f"*RIGID BODY, NSET=SCREW{i}, REF NODE={rigid}, ROT NODE={turn}")

        # (G^T W G)^-1 G^T W (6, 3 n): the area's shift and turn by displacements of nodes
        GtWG, GtW = np.zeros((6, 6)), np.zeros((len(points), 3, 6))
        for N, place, area in _quadrature(points, screw.under):
            weight = area * screw.inside(place)
            away = place - screw.centre
            turned = [np.cross(axis, away) for axis in np.eye(3)]
            G = np.stack([np.broadcast_to(axis, away.shape) for axis in np.eye(3)] + turned, axis=2)
            GtWG += np.einsum("k,kai,kaj->ij", weight, G, G)
            np.add.at(GtW, screw.under, np.einsum("k,n,kai->knai", weight, N, G))
        for j, row in enumerate(np.linalg.solve(GtWG, GtW.reshape(-1, 6).T)):
            ends, axis = ((rigid, mean), j) if j < 3 else ((turn, mean_turn), j - 3)
            read = [(dof // 3 + 1, dof % 3 + 1, row[dof]) for dof in np.flatnonzero(row)]
            deck.equation([(ends[1], axis + 1, "-1."), *read])
            deck.spring(f"SPRING{i}_{j}", ends, axis + 1, screw.stiffness[j])

    deck.boundary((node + 1, 1, 3) for node in np.unique(held))

    # displacement 1 of the node CONTACT: that of the disc's area along its direction in the mean
    triangles, inward = disc
    share = np.zeros(len(points))
    for N, _, area in _quadrature(points, triangles):
        np.add.at(share, triangles, np.outer(area, N))
    mean_share = share / share.sum()
    deck.nodes([contact], [(0, 0, 0)], "CONTACT")
    read = [
        (node + 1, axis + 1, mean_share[node] * inward[axis])
        for node in np.flatnonzero(mean_share)
        for axis in np.flatnonzero(inward)
    ]
    deck.equation([(contact, 1, -1.0), *read])
    deck.boundary([(contact, 2, 3)])

    for body in cells:
        deck.material(body.upper(), materials[body])
    pressure = 1.0 / share.sum()  # a force of 1 N
    pressed = [f"{number}, P{side}, {pressure:.12e}" for number, side in sides(triangles)]
    deck.step("*FREQUENCY", "10")
    deck.step("*STATIC", "*DLOAD", *pressed, *PRINT_CONTACT)
    return deck.text()


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
