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
from fem.grounding import require_free_joints
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
    sway: "Sway | None" = None  # of a table below, on the last two dofs

    @property
    def K(self) -> csc_matrix:  # noqa: N802  the name of the field
        """(n, n) with the springs."""
        k = np.zeros(self.K0.shape[0])
        k[self.elongation] = self.stiffness
        return (self.K0 + diags_array(k)).tocsc()


class Table(NamedTuple):
    """What the assembly stands on: a mass that sways along x and y with a frequency of its own."""

    frequency_hz: float  # of table and assembly together, swaying as one
    mass: float  # [kg] of the table


class Sway(NamedTuple):
    """What a table adds along x and along y."""

    stiffness: float  # [N/m]
    mass: float  # [kg]


def full_tie(
    structure: Structure,
    touching: Sequence[Touching],
    held: Sequence[str],
    *,
    table: Table | None = None,
) -> Model:
    """Every touching face follows its neighbour over the whole face."""
    ties = [tie(structure.basis, t.slave, t.master) for t in touching]
    return _joined(structure, ties, held, table)


def screw_tie(
    structure: Structure,
    touching: Sequence[Touching],
    held: Sequence[str],
    *,
    table: Table | None = None,
) -> Model:
    """Bolted faces follow their neighbour under the washers, the other faces wholly."""
    pairs = [(face, t.master) for t in touching for face in (t.screws or (t.slave,))]
    return _joined(structure, [tie(structure.basis, *pair) for pair in pairs], held, table)


def wires(
    structure: Structure,
    touching: Sequence[Touching],
    held: Sequence[str],
    joint: dict[str, Joint],
    *,
    table: Table | None = None,
) -> Model:
    """Bolted faces are held by screws; `joint` gives the stiffnesses for each master body."""
    basis = structure.basis
    bolted = [t for t in touching if len(t.halves)]
    layout = [
        Screw(share, t.master, centre)
        for t in bolted
        for share, centre in zip(t.halves, t.centres, strict=True)
    ]
    bodies = [s.master.split(":")[0] for s in layout]
    k = np.array([joint[body] for body in bodies]).reshape(-1)
    names = [f"{body}.{direction}" for body in bodies for direction in DIRECTIONS]
    ties = [tie(basis, t.slave, t.master) for t in touching if not len(t.halves)]
    taken = np.concatenate([np.empty(0, np.int64), *(c.slaves for c in ties)])
    screwed = screws(basis, layout, taken) if layout else []
    centres = np.array([s.centre for s in layout]).reshape(-1, 3)
    return _joined(structure, [*ties, *screwed], held, table, k, names, centres)


def _joined(
    structure: Structure,
    constraints: list[Constraint],
    held: Sequence[str],
    table: Table | None,
    stiffness: NDArray[np.float64] = np.empty(0),  # noqa: B008  an empty array has nothing to change
    names: Sequence[str] = (),
    centres: NDArray[np.float64] = np.empty((0, 3)),  # noqa: B008
) -> Model:
    """All dofs are U = [u, elongations r, mean motions p, sway of the table (2)]."""
    n, n_springs = structure.basis.N, len(stiffness)
    sway = _sway(structure, table)
    n_table = 2 if sway else 0
    n_total = n + 2 * n_springs + n_table
    wide = [widened(c, n_total) if c.A.shape[1] < n_total else c for c in constraints]
    require_free_joints(structure.basis, wide, centres)
    wide, grounded = _grounded(structure.basis, wide, held, n_total, n_table)
    fixed = np.concatenate([n + np.flatnonzero(np.isinf(stiffness)), grounded])
    slaves = np.concatenate([np.empty(0, np.int64), *(c.slaves for c in wide)])
    reduction = eliminated(n_total, wide, np.setdiff1d(fixed, slaves))
    K, M = _with_table(structure, sway, 2 * n_springs)
    springs = np.flatnonzero((reduction.free >= n) & (reduction.free < n + n_springs))
    finite = reduction.free[springs] - n
    return Model(
        congruent(reduction.T, K),
        congruent(reduction.T, M),
        reduction.T[:n].tocsr(),
        reduction.free,
        structure,
        springs,
        stiffness[finite],
        tuple(names[i] for i in finite),
        sway,
    )


def _grounded(basis, constraints, held, n_total: int, n_table: int):
    """Held faces: fixed dofs, or those that follow the table along x and y."""
    nodes = np.concatenate([np.empty((0, 3), np.int64), *(face_nodes(basis, f) for f in held)])
    nodes = np.unique(nodes, axis=0)
    if not n_table:
        return constraints, nodes.ravel()
    taken = np.concatenate([np.empty(0, np.int64), *(c.slaves for c in constraints)])
    nodes = nodes[~np.isin(nodes[:, 0], taken)]
    slaves = nodes[:, :2].ravel()
    sway = n_total - n_table + np.tile(np.arange(n_table), len(nodes))
    place = (np.ones(len(slaves)), (np.arange(len(slaves)), sway))
    follow = Constraint(slaves, csr_matrix(place, shape=(len(slaves), n_total)))
    return [*constraints, follow], nodes[:, 2]


def _sway(structure: Structure, table: Table | None) -> Sway | None:
    """The table's springs carry the assembly's mass as well."""
    if table is None:
        return None
    along_x = np.zeros(structure.basis.N)
    along_x[0::3] = 1.0
    moving = table.mass + along_x @ structure.M @ along_x
    return Sway(float((2 * np.pi * table.frequency_hz) ** 2 * moving), table.mass)


def _with_table(structure: Structure, sway: Sway | None, n_between: int):
    """K and M of all dofs."""
    if sway is None:
        empty = csr_matrix((n_between, n_between))
        return [block_diag([A, empty], format="csr") for A in (structure.K, structure.M)]
    none = [0.0] * n_between
    return [
        block_diag([A, diags_array([*none, value, value])], format="csr")
        for A, value in ((structure.K, sway.stiffness), (structure.M, sway.mass))
    ]
