"""Energy of small features that a mesh leaves out: holes that it fills, roundings that it has not.

A feature of the volume V in which displacements u_j have strains eps_j changes omega_j^2 of
mass-normalised modes, to first order, by no more than

    G_jj = V (factor eps_j : C : eps_j + rho omega_j^2 |u_j|^2),

with the strains of the body without it, at places on its faces, and a factor for what stresses rise
by around it. Stiffness and inertia change omega_j^2 in opposite directions: both are counted.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree
from skfem import Mesh, MeshTet

from beadwave.fem.assembly.materials import Material, Orthotropic
from beadwave.fem.assembly.model import Model
from beadwave.fem.errors.stress_error import at_elements, element_of

# times it, for features next to edges and to each other. Of ten parts (`test_simplified.py`) the
# least ratio of stated and true changes above their own errors is 0.89 with 1, and 0.5 of a pin,
# which moves farther than its foot
LEFT_OUT_SAFETY = 1.3
# elements whose middles are next to a point: for 40 of 4000 points in gmsh's tetrahedra the element
# around them was not among 8, for 5 not among 16, for none not among 24. Newton's steps in each
N_NEAR, N_STEPS = 24, 4


class LeftOut(NamedTuple):
    """A feature that the mesh of a body leaves out."""

    body: str
    places: NDArray[np.float64]  # (n, 3) [m] on its faces
    volume: float  # m^3
    factor: float  # of the strain energy


def energy_left_out(
    model: Model,
    materials: Mapping[str, Material | Orthotropic],
    features: Sequence[LeftOut],
    u: NDArray[np.float64],
    omega: NDArray[np.float64],
) -> NDArray[np.float64]:
    """G (features, k, k) [J] of displacements u (n, k) of a model's free dofs that vibrate with
    omega (k,) [rad/s], 0 of static ones."""
    structure, k = model.structure, u.shape[1]
    energies = np.zeros((len(features), k, k))
    for i, feature in enumerate(features):
        basis, material = structure.basis[feature.body], materials[feature.body]
        mesh, element = basis.mesh, element_of(basis.mesh)

        cells, X = nearest_in_elements(mesh, feature.places)
        of_body = model.T[structure.dofs(feature.body)] @ u
        local = at_elements(basis, of_body)[cells].astype(float)  # (n, function, x y z, k)
        inverse = mesh.mapping().invDF(X, tind=cells)[..., 0]  # (along X, along x, n)
        of_functions = [element.lbasis(X, j) for j in range(local.shape[1])]
        value = np.stack([f[0][..., 0] for f in of_functions], axis=-1)  # (n, function)
        slope = np.stack([f[1][..., 0] for f in of_functions], axis=-1)  # (3, n, function)
        gradient = np.einsum("dcn,dnf,nfak->nack", inverse, slope, local).reshape(-1, 9, k)
        velocity = omega * np.einsum("nf,nfak->nak", value, local)

        C = material.elasticity.reshape(9, 9)
        strain = np.einsum("npi,pq,nqj->ij", gradient, C, gradient)
        inertia = material.density * np.einsum("nai,naj->ij", velocity, velocity)
        mean = (feature.factor * strain + inertia) / len(cells)
        energies[i] = LEFT_OUT_SAFETY * feature.volume * mean
    return energies


def nearest_in_elements(
    mesh: Mesh, points: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Elements (n,) with the place in each nearest to points (n, 3) [m], and their coordinates
    (3, n, 1) there: those of the point itself inside of the mesh."""
    middles = mesh.p[:, mesh.t].mean(axis=1).T
    near = np.reshape(
        KDTree(middles).query(points, min(N_NEAR, len(middles)))[1], (len(points), -1)
    )
    cells, x = near.ravel(), np.repeat(points, near.shape[1], axis=0).T[:, :, None]
    mapping = mesh.mapping()
    X = np.repeat(mesh.elem().refdom.p.mean(axis=1)[:, None, None], len(cells), axis=1)
    for _ in range(N_STEPS):
        X = X + np.einsum(
            "dcnp,cnp->dnp", mapping.invDF(X, tind=cells), x - mapping.F(X, tind=cells)
        )
        X = np.clip(X, 0.0, 1.0)
        if isinstance(mesh, MeshTet):
            X = X / np.maximum(X.sum(axis=0), 1.0)
    away = np.linalg.norm(x - mapping.F(X, tind=cells), axis=0).reshape(near.shape)
    best = np.arange(len(points)) * near.shape[1] + away.argmin(axis=1)
    return cells[best], X[:, best]
