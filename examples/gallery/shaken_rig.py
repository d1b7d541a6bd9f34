"""The shaken rig with a frictional contact: the parts of its marches, its contact as springs.

Shared by `friction.py` and `resonance.py`. A contact that never slips and whose area stays is a
part of the structure that it holds. The springs of its tangential stiffness k_t tie the wall's
modes q to the last sphere's displacements u and turns psi across the chain, in mass-normalised
coordinates x = (q, m^1/2 u, I^1/2 psi), those that the arm clamps left out:

    F_t = -C (s - S_tn F_n),    s = B^T x,    C = (1/k_t + S_tt)^-1
    x'' + (Omega^2 + B C B^T) x = (phi_n + B C S_tn) F_n
    u_n = (phi_n + B C S_tn)^T x + (S_nn - S_nt C S_tn) F_n

with s the slip and S the residual compliance. K. L. Johnson, Contact Mechanics (1985), 7.2.
"""

from typing import NamedTuple

import numpy as np

from beadwave.coupling.spatial_march import (
    USUAL_SPATIAL_SEARCH,
    PreparedImpact,
    body_of,
)
from beadwave.coupling.spatial_wall import SpatialWall, spatial_wall_of_modes
from beadwave.dem import Chain
from beadwave.dem.friction import stick_stiffness
from beadwave.dem.lateral import LastSphere
from beadwave.dem.shakers import ShakerForces
from beadwave.dem.spheres import hertz_overlap
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.chain.chain import Start
from beadwave.workflows.stages.chain.friction import ALL_STICKS, last_sphere, shaker_forces
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.engine.progress import quiet


class ShakenRig(NamedTuple):
    """Chain, wall, last sphere and shakers of a scene, as marches take them."""

    start: Start
    wall: SpatialWall
    last: LastSphere
    shakers: ShakerForces

    def last_with(self, coefficient: float) -> LastSphere:
        """The last sphere on a contact of another coefficient: the law's bound is mu E*/G*, with E*
        from Hertz' coefficient."""
        modulus = 0.75 * float(self.start.chain.A[-1]) / np.sqrt(self.last.law.radius)
        bound = coefficient * modulus / self.last.law.modulus
        return self.last._replace(law=self.last.law._replace(bound=bound))

    def body(self, coefficient: float, n_cells: int) -> PreparedImpact:
        """Chain, contact and structure, with another coefficient of friction."""
        search = USUAL_SPATIAL_SEARCH._replace(n_cells=n_cells)
        return body_of(
            self.start.chain, self.wall, self.start.velocity, self.last_with(coefficient),
            self.shakers, search,
        )  # fmt: skip

    def contact_stiffness(self) -> float:
        """[N/m] of the contact at rest, across, all of it sticking."""
        static, A = self.body(1.0, 16).prepared.static, self.start.chain.A[-1]
        overlap = float(hertz_overlap(float(static.force[-1]), A))
        return float(stick_stiffness(self.last.law, np.sqrt(self.last.law.radius * overlap)))


def shaken_rig(scene: Scene) -> ShakenRig:
    """Chain and structure of a scene, its reduced model kept by content."""
    pipeline = pipeline_of(scene, quiet)
    start = pipeline("start")
    last = last_sphere(scene, start)
    return ShakenRig(start, pipeline("spatial-wall"), last, shaker_forces(scene))


def state_of(stick: float) -> str:
    """The state of a contact of which this share of the area sticks at least."""
    return "gross slip" if stick == 0.0 else "stick" if stick > ALL_STICKS else "partial slip"


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
    stuck = spatial_wall_of_modes(omega, zeta, phi, load=load)
    return stuck._replace(residual_compliance=compliance)


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
