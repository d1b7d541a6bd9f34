"""The joined and held assembly: K and M on the dofs that stay free."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix, csr_matrix, diags_array

from beadwave.fem.assembly.constraints import (
    Constraint,
    Overconstrained,
    claimed,
    congruent,
    eliminated,
    fixed,
)
from beadwave.fem.assembly.elasticity import JoinedPart, Structure
from beadwave.fem.assembly.grounding import require_free_joints
from beadwave.fem.assembly.joints import DIRECTIONS, Joint, Tie, mean_sides, rigid_sides, tie
from beadwave.fem.assembly.trace import face_nodes
from beadwave.fem.contact.preloaded_contact import PreloadedContact


class HeldFace(NamedTuple):
    """A face held by the ground, or by the table."""

    face: str  # "body:face"
    directions: str = "xyz"  # of displacements that are held


class SwayingTable(NamedTuple):
    """The table below the assembly: a mass that sways along x and y."""

    frequency_hz: float  # at which table and assembly sway as one
    mass: float  # [kg] of the table


class Sway(NamedTuple):
    """Mass and stiffness of a table along x and along y."""

    stiffness: float  # [N/m]
    mass: float  # [kg]


class Connections(NamedTuple):
    """Connections of bodies to each other and to the ground."""

    ties: Sequence[Tie] = ()
    joints: Sequence[Joint] = ()
    held: Sequence[HeldFace] = ()
    table: SwayingTable | None = None

    @property
    def stiffness(self) -> NDArray[np.float64]:
        """Stiffnesses (6 n_joints,) [N/m, N m/rad] of all springs, inf of rigid ones."""
        return np.array([joint.springs for joint in self.joints]).reshape(-1)

    @property
    def centres(self) -> NDArray[np.float64]:
        """Places of the joints (n_joints, 3) [m]."""
        return np.array([joint.centre for joint in self.joints]).reshape(-1, 3)

    @property
    def spring(self) -> list[str]:
        """Names "joint.direction" (6 n_joints,) of all springs."""
        return [f"{joint.name}.{direction}" for joint in self.joints for direction in DIRECTIONS]


class Model(NamedTuple):
    """K(k) = K0 + sum_j k_j e_j e_j^T over the joints' elongations, and M."""

    K0: csc_matrix  # (n, n) joints open, with the springs between points [N/m]
    M: csc_matrix  # (n, n) [kg]
    T: csr_matrix  # (ndof, n) displacements of the mesh: u_mesh = T @ u
    free: NDArray[np.int64]  # (n,) where u stands among all dofs: mesh, elongations, mean motions
    structure: Structure
    elongation: NDArray[np.int64]  # (n_springs,) dofs of K0 on which a spring of finite k stands
    stiffness: NDArray[np.float64]  # (n_springs,) [N/m] or [N m/rad]
    spring: tuple[str, ...]  # (n_springs,) "joint.direction", equal for joints of one name
    sway: Sway | None = None  # of a table below, on the last two dofs
    overconstrained: tuple[Overconstrained, ...] = ()  # dofs that two constraints would hold
    load_factor: float | None = None  # static load over that which buckles it; None: unloaded
    contact: PreloadedContact | None = None  # faces that bolts press, about which it is linear
    # parts known by receptances, each with the positions of its oscillators among the unknowns
    measured: tuple[tuple[JoinedPart, NDArray[np.int64]], ...] = ()

    @property
    def K(self) -> csc_matrix:  # noqa: N802  the name of the field
        """Stiffness (n, n) [N/m] with the springs."""
        if not len(self.elongation):
            return self.K0
        k = np.zeros(self.K0.shape[0])
        k[self.elongation] = self.stiffness
        return (self.K0 + diags_array(k)).tocsc()


class ConstrainedModel(NamedTuple):
    """All dofs U = [u, elongations r, motions q of second sides, oscillators of measured parts,
    sway of the table (2)]."""

    n_total: int
    constraints: list[Constraint]
    overconstrained: list[Overconstrained]


def joined(
    structure: Structure,
    connections: Connections,
    constraints_of_all: ConstrainedModel | None = None,
) -> Model:
    """The bodies joined and held; `constraints_of_all` are those of these connections, where they
    are known.

    K0 and M are T^T K T and T^T M T of the free bodies, with what springs, measured parts and the
    table add on dofs of their own.
    Raises ValueError where faces that are joined do not lie on each other, where a joint holds too
    few nodes, or where ties form a circle.
    """
    n, k = structure.n_dofs, connections.stiffness
    n_total, constraints, overconstrained = constraints_of_all or constrained(
        structure, connections
    )
    reduction = eliminated(n_total, constraints)

    # the table's springs carry the mass of the assembly as well: (2 pi f)^2 (m_table + m)
    sway, table = None, connections.table
    if table is not None:
        along_x = np.zeros(n)
        along_x[0::3] = 1.0
        moving = table.mass + along_x @ structure.M @ along_x
        sway = Sway(float((2 * np.pi * table.frequency_hz) ** 2 * moving), table.mass)

    # K and M of the dofs of the mesh; nothing stands on elongations and mean motions yet
    T = reduction.T[:n].tocsr()
    K, M = congruent(T, structure.K), congruent(T, structure.M)
    if sway is not None:
        of_sway = reduction.T[-2:]
        K = (K + sway.stiffness * (of_sway.T @ of_sway)).tocsc()
        M = (M + sway.mass * (of_sway.T @ of_sway)).tocsc()

    # springs between points, B (m, n): K + B^T k B
    for spring in structure.springs:
        B = csr_matrix(spring.B @ T)
        K = (K + spring.stiffness * (B.T @ B)).tocsc()

    # measured parts, D = [B, -phi]: K + D^T k D, and their oscillators
    measured, first = [], n + 2 * len(k)
    for part in structure.measured:
        at = np.searchsorted(reduction.free, first + np.arange(len(part.omega)))
        first += len(part.omega)
        measured.append((part, at))
        place = csr_matrix(
            (np.ones(len(at)), (range(len(at)), at)), shape=(len(at), len(reduction.free))
        )
        D = csr_matrix(part.B @ T - csr_matrix(part.phi) @ place)
        K = (K + D.T @ csr_matrix(part.stiffness) @ D).tocsc()
        K = (K + place.T @ diags_array(part.omega**2) @ place).tocsc()
        M = (M + place.T @ place).tocsc()

    # springs of finite stiffness whose elongation no constraint holds
    springs = np.flatnonzero((reduction.free >= n) & (reduction.free < n + len(k)))
    finite = reduction.free[springs] - n
    names = connections.spring
    return Model(
        K,
        M,
        T,
        reduction.free,
        structure,
        springs,
        k[finite],
        tuple(names[i] for i in finite),
        sway,
        tuple(overconstrained),
        measured=tuple(measured),
    )


def constrained(structure: Structure, connections: Connections) -> ConstrainedModel:
    """All constraints; where two hold a dof the ground comes first, then joints, then ties.

    A later one loses the dof and is listed in `overconstrained`. Raises ValueError where faces
    that are joined do not lie on each other, where a joint holds too few nodes, and where a tie or
    a joint would resist a rigid motion.
    """
    n, joints, k = structure.n_dofs, connections.joints, connections.stiffness
    n_table = 2 if connections.table else 0
    oscillators = sum(len(part.omega) for part in structure.measured)
    n_total = n + 2 * len(k) + oscillators + n_table

    # held faces, and the motions q of joints to the ground
    first = n + 6 * len(joints)
    to_ground = [i for i, joint in enumerate(joints) if joint.second is None]
    dofs = [np.empty(0, int), *(first + 6 * i + np.arange(6) for i in to_ground)]
    axes = [np.empty(0, int), *[np.arange(6)] * len(to_ground)]
    for support in connections.held:
        nodes = face_nodes(structure, support.face)
        for axis in map("xyz".index, support.directions):
            dofs.append(nodes[:, axis])
            axes.append(np.full(len(nodes), axis))
    slaves, unique = np.unique(np.concatenate(dofs), return_index=True)
    axis = np.concatenate(axes)[unique]

    # they stand still, but along x and y with the table, where there is one
    moved = np.flatnonzero(axis < n_table)
    on_table = (np.ones(len(moved)), (moved, n_total - n_table + axis[moved]))
    A = csr_matrix(on_table, shape=(len(slaves), n_total))
    ground = Constraint(slaves, A, "the supports")

    # mean sides come last: they choose their slaves among the dofs that nothing else holds
    rigid = rigid_sides(structure, joints, n_total)
    ties = [tie(structure, pair, n_total) for pair in connections.ties]
    slaves = np.concatenate([np.empty(0, np.int64), *(c.slaves for c in (ground, *rigid, *ties))])
    means = mean_sides(structure, joints, slaves, n_total)
    require_free_joints(structure, [*rigid, *means, *ties], connections.centres)
    rigid_springs = fixed(n + np.flatnonzero(np.isinf(k)), n_total, "rigid springs")
    return ConstrainedModel(
        n_total, *claimed(n_total, [rigid_springs, ground, *rigid, *means, *ties])
    )
