"""The joined and held assembly: K and M on the dofs that stay free.

full tie:  every touching face follows its neighbour
screw tie: bolted faces follow their neighbour only under the washers
wires:     bolted faces are screws of six stiffnesses each, the rest is tied
"""

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_diag, csc_matrix, csr_matrix, diags_array

from fem.constraints import Constraint, congruent, eliminated
from fem.elasticity import Structure
from fem.joints import DIRECTIONS, Joint, Screw, screws, tie, widened
from fem.trace import face_nodes


class Touching(Protocol):
    """Two faces in contact: what the builders below need to know of an interface."""

    slave: str
    master: str
    screws: Sequence[str]
    halves: Sequence[str]
    centres: NDArray[np.float64]


class Model(NamedTuple):
    """K(k) = K0 + sum_j k_j e_j e_j^T over the joints' elongations, and M."""

    K0: csc_matrix  # (n, n) joints open [N/m]
    M: csc_matrix  # (n, n) [kg]
    T: csr_matrix  # (ndof, n) displacements of the mesh: u_mesh = T @ u
    free: NDArray[np.int64]  # (n,) where u stands among all dofs: mesh, elongations, mean motions
    structure: Structure
    elongation: NDArray[np.int64]  # (n_springs,) dofs of K0 on which a spring of finite k stands
    stiffness: NDArray[np.float64]  # (n_springs,) [N/m] or [N m/rad]
    spring: tuple[str, ...]  # (n_springs,) "body.direction", equal for all screws of a body

    @property
    def K(self) -> csc_matrix:  # noqa: N802  the name of the field
        """(n, n) with the springs."""
        k = np.zeros(self.K0.shape[0])
        k[self.elongation] = self.stiffness
        return (self.K0 + diags_array(k)).tocsc()


def full_tie(structure: Structure, touching: Sequence[Touching], held: Sequence[str]) -> Model:
    """Every touching face follows its neighbour over the whole face."""
    ties = [tie(structure.basis, t.slave, t.master) for t in touching]
    return _joined(structure, ties, held)


def screw_tie(structure: Structure, touching: Sequence[Touching], held: Sequence[str]) -> Model:
    """Bolted faces follow their neighbour under the washers, the other faces wholly."""
    pairs = [(face, t.master) for t in touching for face in (t.screws or (t.slave,))]
    return _joined(structure, [tie(structure.basis, *pair) for pair in pairs], held)


def wires(
    structure: Structure,
    touching: Sequence[Touching],
    held: Sequence[str],
    joint: dict[str, Joint],
) -> Model:
    """Bolted faces are held by screws; `joint` gives the stiffnesses for each master body."""
    basis = structure.basis
    bolted = [t for t in touching if len(t.screws)]
    layout = [
        Screw(share, t.master, centre)
        for t in bolted
        for share, centre in zip(t.halves, t.centres, strict=True)
    ]
    bodies = [s.master.split(":")[0] for s in layout]
    k = np.array([joint[body] for body in bodies]).reshape(-1)
    names = [f"{body}.{direction}" for body in bodies for direction in DIRECTIONS]
    ties = [tie(basis, t.slave, t.master) for t in touching if not len(t.screws)]
    taken = np.concatenate([np.empty(0, np.int64), *(c.slaves for c in ties)])
    return _joined(structure, [*ties, *screws(basis, layout, taken)], held, k, names)


def _joined(
    structure: Structure,
    constraints: list[Constraint],
    held: Sequence[str],
    stiffness: NDArray[np.float64] = np.empty(0),  # noqa: B008  an empty array has nothing to change
    names: Sequence[str] = (),
) -> Model:
    basis = structure.basis
    n_total = basis.N + 2 * len(stiffness)  # u, elongations r, mean motions p
    rigid = basis.N + np.flatnonzero(np.isinf(stiffness))
    fixed = np.concatenate([rigid, *(face_nodes(basis, face).ravel() for face in held)])
    wide = [widened(c, n_total) if c.A.shape[1] < n_total else c for c in constraints]
    slaves = np.concatenate([np.empty(0, np.int64), *(c.slaves for c in wide)])
    reduction = eliminated(n_total, wide, np.setdiff1d(fixed, slaves))
    padding = csr_matrix((n_total - basis.N, n_total - basis.N))
    K0, M = (
        congruent(reduction.T, block_diag([A, padding], format="csr"))
        for A in (structure.K, structure.M)
    )
    is_spring = (reduction.free >= basis.N) & (reduction.free < basis.N + len(stiffness))
    springs = np.flatnonzero(is_spring)
    finite = reduction.free[springs] - basis.N
    spring = tuple(names[i] for i in finite)
    T = reduction.T[: basis.N].tocsr()
    return Model(K0, M, T, reduction.free, structure, springs, stiffness[finite], spring)
