"""A contact that never slips and whose area stays, as a part of the structure that it holds.

The springs of the contact's tangential stiffness k_t tie the wall's modes q to the last sphere's
displacements u and turns psi across the chain, in mass-normalised coordinates x = (q, m^1/2 u,
I^1/2 psi), those that the arm clamps left out:

    F_t = -C (s - S_tn F_n),    s = B^T x,    C = (1/k_t + S_tt)^-1
    x'' + (Omega^2 + B C B^T) x = (phi_n + B C S_tn) F_n
    u_n = (phi_n + B C S_tn)^T x + (S_nn - S_nt C S_tn) F_n

with s the slip and S the residual compliance. The chain sees a wall along its normal alone: what is
left of the contact's physics is that the structure couples its directions. K. L. Johnson, Contact
Mechanics (1985), 7.2.
"""

import numpy as np

from beadwave.coupling.spatial_wall import SpatialWall, spatial_wall_of_modes
from beadwave.dem import Chain
from beadwave.dem.lateral import LastSphere


def stuck_wall(wall: SpatialWall, stiffness: float, last: LastSphere, chain: Chain) -> SpatialWall:
    """The wall with its contact's tangential springs [N/m] and the chain's last sphere, its arm
    included, held across; stiffness 0 leaves the modes as they are along the normal alone.

    Damping ratios are those of the modes on the diagonal: what the springs couple of it is left
    out.
    """
    S, mass, radius = wall.residual_compliance, float(chain.mass[-1]), float(chain.radius[-1])
    C = np.zeros((2, 2))
    if stiffness > 0.0:
        C = np.linalg.inv(np.eye(2) / stiffness + S[1:, 1:])

    # the sphere's displacements and turns that the arm leaves free
    columns, squares = [], []
    for direction, k in zip(np.eye(2), np.broadcast_to(last.arm_stiffness, 2), strict=True):
        if np.isfinite(k):
            columns.append(direction / np.sqrt(mass))
            squares.append(float(k) / mass)
    if np.isfinite(last.arm_rotation):
        for direction in np.eye(2):
            columns.append(radius * direction / np.sqrt(last.inertia))
            squares.append(last.arm_rotation / last.inertia)
    of_sphere = np.array(columns).reshape(-1, 2)
    B = np.vstack([-wall.phi[:, 1:], of_sphere])
    along = np.append(wall.phi[:, 0], np.zeros(len(of_sphere))) + B @ C @ S[1:, 0]

    # modes of all that the springs tie together; a rigid one may come out at -rounding
    K = np.diag(np.append(wall.omega**2, squares)) + B @ C @ B.T
    squared, vectors = np.linalg.eigh(K)
    omega = np.sqrt(np.maximum(squared, 0.0))
    rates = np.append(2.0 * wall.zeta * wall.omega, np.zeros(len(of_sphere)))
    twice = np.einsum("ij,i,ij->j", vectors, rates, vectors)
    zeta = np.divide(twice, 2.0 * omega, out=np.zeros_like(twice), where=omega > 0.0)
    phi = np.zeros((len(omega), 3))
    phi[:, 0] = vectors.T @ along
    load = vectors.T @ np.vstack([wall.load, np.zeros((len(of_sphere), wall.load.shape[1]))])
    compliance = np.zeros((3, 3))
    compliance[0, 0] = S[0, 0] - S[0, 1:] @ C @ S[1:, 0]
    return spatial_wall_of_modes(omega, zeta, phi, load=load)._replace(
        residual_compliance=compliance
    )


def uncoupled_wall(wall: SpatialWall) -> SpatialWall:
    """The wall whose directions do not act on each other: every mode twice, once along the normal
    and once across."""
    k = wall.omega.size
    phi = np.zeros((2 * k, 3))
    phi[:k, 0], phi[k:, 1:] = wall.phi[:, 0], wall.phi[:, 1:]
    S = wall.residual_compliance.copy()
    S[0, 1:] = S[1:, 0] = 0.0
    load = np.tile(wall.load, (2, 1))
    uncoupled = spatial_wall_of_modes(np.tile(wall.omega, 2), np.tile(wall.zeta, 2), phi, load=load)
    return uncoupled._replace(residual_compliance=S)
