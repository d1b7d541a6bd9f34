"""Small motions of a pressed packing: its modes, and by Bloch's theorem the waves of its lattice.

A contact under the force N at the distance r of centres is a spring

    K = k e e^T - N / r (1 - e e^T),   k = 3/2 A sqrt(d)

and a wave u exp(i q X) of the lattice moves a sphere by  m omega^2 u = sum of K (u - u' exp(i q D))
over its contacts, with the arm D to the neighbour and its amplitude u' (L. Brillouin, Wave
Propagation in Periodic Structures, 1946). The sum of N / r turns no rigid motion into a force: it
is balanced by the loads that press.
"""

from typing import NamedTuple

import numpy as np

from beadwave.dem.kernels.arguments import Array
from beadwave.dem.space.packing import Packing
from beadwave.dem.space.statics import assembled, lines

DENSE = 1500  # unknowns up to which all modes are computed


class CrystalModes(NamedTuple):
    """Modes of a packing at rest, mass-normalised."""

    frequency: Array  # (n,) [Hz], ascending
    shape: Array  # (n, s, 3) [kg^-1/2]


class Cell(NamedTuple):
    """Contacts of the spheres of one cell of a lattice, n of them."""

    mass: Array  # (n,) [kg]
    first: Array  # (c,) which sphere of the cell
    second: Array  # (c,) which sphere of a cell its neighbour is like
    arm: Array  # (c, 3) [m]
    stiffness: Array  # (c, 3, 3) [N/m]
    free: Array  # (f,) directions that are free: 0, 1 in the plane


def springs(packing: Packing) -> Array:
    """(c, 3, 3) [N/m] of the contacts at rest."""
    e, overlap, r = lines(packing, np.zeros((len(packing.mass), 3)))
    d = np.maximum(overlap, 0.0)
    k, turning = 1.5 * packing.A * np.sqrt(d), packing.A * d**1.5 / r
    along = e[:, :, None] * e[:, None, :]
    return k[:, None, None] * along - turning[:, None, None] * (np.eye(3) - along)


def modes(packing: Packing, free: Array, most: int = 100) -> CrystalModes:
    """The modes of a packing at rest in the directions that are free: all of a small packing, else
    the `most` lowest. Rigid motions and loose spheres have 0 Hz."""
    K = assembled(packing, springs(packing)).tocsr()
    s = len(packing.mass)
    if packing.guides is None:
        kept = (3 * np.arange(s)[:, None] + free).ravel()
        basis = None
    else:  # a direction for each line guide
        _, vectors = np.linalg.eigh(packing.guides.motion)
        basis = vectors[:, :, 2]
    root = np.sqrt(np.repeat(packing.mass, 3))
    K = K / root[:, None] / root[None, :]
    if basis is not None:
        from scipy import sparse

        columns = np.repeat(np.arange(s), 3)
        B = sparse.csc_array((basis.ravel(), (np.arange(3 * s), columns)), (3 * s, s))
        K = B.T @ K @ B
    else:
        K = K.tocsr()[kept][:, kept]
        B = None
    n = K.shape[0]
    if n <= DENSE:
        square, vectors = np.linalg.eigh(K.toarray())
    else:
        from scipy.sparse.linalg import eigsh

        shift = -1e-4 * abs(K.diagonal()).max()
        square, vectors = eigsh(K.tocsc(), min(most, n - 2), sigma=shift)
        order = np.argsort(square)
        square, vectors = square[order], vectors[:, order]
    whole = np.zeros((3 * s, vectors.shape[1]))
    if B is None:
        whole[kept] = vectors
    else:
        whole = B @ vectors
    frequency = np.sqrt(np.maximum(square, 0.0)) / (2.0 * np.pi)
    return CrystalModes(frequency, (whole / root[:, None]).T.reshape(-1, s, 3))


def cell(packing: Packing, kind: Array, free: Array) -> Cell:
    """The cell of a periodic packing, each of whose spheres is like one of a few: `kind` (s,) says
    which; of each the sphere in the middle shows the contacts."""
    n, (i, j) = packing.n_pairs, packing.pairs.T
    K = springs(packing)[:n]
    i, j = i[:n], j[:n]
    centre = packing.rest.mean(axis=0)
    rows = []
    for which in range(int(kind.max()) + 1):
        alike = np.flatnonzero(kind == which)
        middle = alike[np.argmin(np.linalg.norm(packing.rest[alike] - centre, axis=1))]
        for at in np.flatnonzero(i == middle):
            rows.append((which, kind[j[at]], packing.arm[at], K[at], packing.mass[middle]))
        for at in np.flatnonzero(j == middle):
            rows.append((which, kind[i[at]], -packing.arm[at], K[at], packing.mass[middle]))
    first, second, arm, stiffness, mass = (np.array(part) for part in zip(*rows, strict=True))
    of_kind = np.array([mass[first == which][0] for which in range(int(kind.max()) + 1)])
    return Cell(of_kind, first, second, arm, stiffness, free)


def dispersion(cell: Cell, q: Array) -> Array:
    """Frequencies (k, b) [Hz] of the waves of vectors q (k, 3) [1/m], ascending in each row."""
    n, f = len(cell.mass), len(cell.free)
    K = cell.stiffness[:, cell.free][:, :, cell.free]
    phase = np.exp(1j * q @ cell.arm.T)
    D = np.zeros((len(q), n, f, n, f), complex)
    for c in range(len(K)):
        a, b = cell.first[c], cell.second[c]
        D[:, a, :, a, :] += K[c]
        D[:, a, :, b, :] -= phase[:, c, None, None] * K[c]
    D = D.reshape(len(q), n * f, n * f)
    root = np.sqrt(np.repeat(cell.mass, f))
    square = np.linalg.eigvalsh(D / root[:, None] / root[None, :])
    return np.sqrt(np.maximum(square, 0.0)) / (2.0 * np.pi)


def band_edges(cell: Cell, reciprocal: Array, points: int = 24) -> tuple[float, ...]:
    """Edges [Hz] of the bands, lower and upper in turn, of waves over an even grid of the cell of
    the `reciprocal` vectors (d, 3) [1/m]; bands that overlap are one."""
    grid = np.arange(points) / points
    steps = np.stack(np.meshgrid(*[grid] * len(reciprocal), indexing="ij"), axis=-1)
    branches = dispersion(cell, steps.reshape(-1, len(reciprocal)) @ reciprocal)
    spans = sorted(zip(branches.min(axis=0), branches.max(axis=0), strict=True))
    edges = [list(spans[0])]
    for low, high in spans[1:]:
        if low <= edges[-1][1] * (1.0 + 1e-6):
            edges[-1][1] = max(edges[-1][1], high)
        else:
            edges.append([low, high])
    top = edges[-1][1]
    return tuple(float(x) if x > 1e-6 * top else 0.0 for edge in edges for x in edge)
