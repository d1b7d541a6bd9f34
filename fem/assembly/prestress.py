"""Static loads before the impact: the geometric stiffness of a structure under forces or heat.

    K u = f + f_T,   sigma = C : (eps(u) - alpha dT 1),
    K_G = int sigma_cd d_c phi_i d_d phi_j  on each of x, y, z,    (K + K_G) phi = omega^2 M phi

f is spread evenly over faces, f_T = int C : alpha dT 1 : eps(v); rods have terms of their own, see
`fem.assembly.rods`. K is that of the undeformed shape: displacements are small, forces keep their
directions. Springs of joints have no length and so no K_G of their own, as a string would have;
the forces that they carry act on the turns of the bodies alone.
With mu the largest of -K_G x = mu K x the loads are mu of those that buckle the structure.
Bathe, Finite Element Procedures (2014), sec. 6.3.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import LinearOperator, eigsh
from skfem import Basis

from beadwave.fem.assembly.constraints import congruent
from beadwave.fem.assembly.elasticity import (
    Structure,
    along_each_axis,
    elements_of,
    scattered,
    summed,
)
from beadwave.fem.assembly.materials import Material, Orthotropic
from beadwave.fem.assembly.model import Model
from beadwave.fem.assembly.rods import Rod, tightened
from beadwave.fem.assembly.trace import face_mean
from beadwave.fem.bending.bending_model import Buckled
from beadwave.fem.modes.solver.factorisation import factorised
from beadwave.fem.modes.solver.threads import one_thread


class FaceForce(NamedTuple):
    """A force spread evenly over a face; without a direction into it, along its mean normal."""

    face: str  # "body:face"
    force: float  # [N]
    direction: Sequence[float] | None = None  # of any length


class Heat(NamedTuple):
    """A body warmer than it was made."""

    temperature: float  # [K]
    expansion: float  # [1/K]


class Load(NamedTuple):
    """All static loads of a structure before the impact."""

    forces: Sequence[FaceForce] = ()
    heat: Mapping[str, Heat] = {}
    rods: Sequence[Rod] = ()


def prestressed(model: Model, materials: Mapping[str, Material | Orthotropic], load: Load) -> Model:
    """The model with the stiffness that its static load adds, and the load's share of buckling, for
    which the rods' own stiffness does not count.

    Raises Buckled for a load beyond buckling, ValueError for a structure that floats, for a face
    without one normal and for rods that `tightened` refuses.
    """
    structure, K, rods = model.structure, model.K, tightened(model.structure, load.rods)
    f = static_forces(structure, materials, load)

    # stresses of the static state, and what they add to the stiffness; displacements stay small
    factor = factorised(K)
    u = model.T @ factor.solve(model.T.T @ (f + rods.f))
    K_G = congruent(model.T, stress_stiffness(structure, materials, load, u) + rods.K_G)
    mu = buckling_share(K, K_G, factor)
    if mu >= 1:
        raise Buckled(
            f"the static load is {mu:.4g} times that which buckles the structure; take less"
        )
    K_0 = model.K0 + K_G + congruent(model.T, rods.K)
    return model._replace(K0=K_0.tocsc(), load_factor=mu)


def static_forces(
    structure: Structure, materials: Mapping[str, Material | Orthotropic], load: Load
) -> NDArray[np.float64]:
    """f + f_T (ndof,) [N] of forces on faces and of heat, without rods; raises ValueError for a
    face without one normal."""
    f = np.zeros(structure.n_dofs)
    for force in load.forces:
        mean = face_mean(structure, force.face)
        along = -mean.normal
        if force.direction is not None:
            along = np.asarray(force.direction, float)
        elif np.linalg.norm(mean.normal) < 0.5:  # of half a cylinder it is 0.64, of a bore 0
            raise ValueError(
                f"the face {force.face!r} has no one normal; say the force's direction."
            )
        spread = np.zeros((len(structure.points), 3))
        spread[mean.node] = np.outer(mean.share, force.force * along / np.linalg.norm(along))
        f += spread.ravel()
    for body, heat in load.heat.items():
        f[structure.dofs(body)] += thermal_load(structure.basis[body], materials[body], heat)
    return f


def stress_stiffness(
    structure: Structure,
    materials: Mapping[str, Material | Orthotropic],
    load: Load,
    u: NDArray[np.float64],
) -> csr_matrix:
    """K_G (ndof, ndof) [N/m] of all bodies displaced by u (ndof,) [m]."""
    bodies = [
        geometric_stiffness(structure, b, u, materials[b], load.heat.get(b))
        for b in structure.basis
    ]
    return sum(bodies[1:], bodies[0])


def buckling_share(K, K_G, factor, *, smallest: float = 1e-3) -> float:
    """The largest mu of -K_G x = mu K x, which is the load over the buckling load; 0 where it is
    below `smallest`, since then nothing presses."""
    inverse = LinearOperator(K.shape, factor.solve)
    start = np.random.default_rng(0).standard_normal(K.shape[0])
    # the largest eigenvalue of K - K_G is 1 + mu. Asked for mu itself, a structure that is only
    # pulled has thousands of values near 0, which no iteration tells apart. The error of mu is the
    # square of the residual
    with one_thread():
        largest = eigsh(
            K - K_G, 1, K, Minv=inverse, which="LA", v0=start, tol=1e-4, ncv=40,
            return_eigenvectors=False,
        )  # fmt: skip
    mu = float(largest[0]) - 1
    return mu if mu > smallest else 0.0


def thermal_load(basis: Basis, material, heat: Heat) -> NDArray[np.float64]:
    """int sigma_T : grad v of a body that may not expand, (n,) [N], sigma_T = C : alpha dT 1: the
    forces by which it would push on what holds it, x, y, z of node after node."""
    element, order, _ = elements_of(basis.mesh)
    scalar = Basis(basis.mesh, element, intorder=order)
    stress = np.einsum("acbd,bd->ac", material.elasticity, np.eye(3))
    stress *= heat.expansion * heat.temperature
    f = np.zeros((scalar.N, 3))
    for i, phi in enumerate(scalar.basis):
        gradient = np.einsum("ckq,kq->kc", phi[0].grad, scalar.dx)
        np.add.at(f, scalar.element_dofs[i], gradient @ stress)
    return f.ravel()


def geometric_stiffness(
    structure: Structure, body: str, u: NDArray[np.float64], material, heat: Heat | None
) -> csr_matrix:
    """K_G (ndof, ndof) [N/m] of a body displaced by u (ndof,) [m], on the dofs of the structure: of
    the stresses that u causes beyond free expansion."""
    basis = structure.basis[body]
    first = structure.first[body]
    element, order, _ = elements_of(basis.mesh)
    u_body = u[first : first + basis.N].reshape(-1, 3)
    C = material.elasticity
    free = np.zeros((3, 3)) if heat is None else heat.expansion * heat.temperature * np.eye(3)

    def of(cells: NDArray[np.int64]) -> tuple[csr_matrix]:
        """int sigma_cd d_c phi_i d_d phi_j of these elements (n / 3, n / 3), for one of the three
        displacements."""
        points = Basis(basis.mesh, element, intorder=order, elements=cells)
        gradient = np.stack([phi[0].grad for phi in points.basis])  # (i, c, cell, point)
        strain = np.einsum("ickq,ikb->bckq", gradient, u_body[points.element_dofs])
        strain -= free[:, :, None, None]
        stress = np.einsum("acbd,bdkq->ackq", C, strain)
        pulled = np.einsum("cdkq,jdkq->jckq", stress * points.dx, gradient)
        local = np.einsum("ickq,jckq->kij", gradient, pulled, optimize=True)
        return (scattered(local, points.element_dofs, points.N),)

    (A,) = summed(np.arange(basis.nelems), of)
    A = along_each_axis(A).tocoo()
    return csr_matrix((A.data, (A.row + first, A.col + first)), shape=(structure.n_dofs,) * 2)
