"""Derivatives of the static state by parameters:  K dx = -dr/dtheta."""

from typing import NamedTuple

import numpy as np

from beadwave.dem.chain import Chain
from beadwave.dem.kernels.arguments import Array
from beadwave.dem.statics import Equilibrium
from beadwave.dem.walls import Wall, static_compliance


class Directions(NamedTuple):
    """Derivatives of a run's inputs by p parameters."""

    A: Array  # (n_contacts, p)
    gamma: Array  # (n_contacts, p)
    v0: Array  # (n, p)
    preload: Array  # (p,)
    phi: Array  # (k, p)
    omega: Array  # (k, p)
    zeta: Array  # (k, p)
    # (n_parameters, n_contacts, p) in the order of the law's row of `laws.ELASTIC_LAWS`
    parameters: Array | None = None


class StaticSensitivities(NamedTuple):
    """Derivatives of the static state by p parameters."""

    x: Array  # (n, p)
    force: Array  # (p,) at the wall
    offset: Array  # (p,) displacement of the modes


def static_sensitivities(
    chain: Chain, wall: Wall | None, static: Equilibrium, directions: Directions
) -> StaticSensitivities:
    """Derivatives of the static state by p parameters: K dx = -dr/dtheta, from the residual
    r(x; theta) = 0 of the forces in it. Contacts that are open stay open; at the verge of closing
    the derivative is that of the open side. Zeros where nothing presses or holds the chain."""
    n, n_contacts, p = chain.mass.size, chain.A.size, directions.preload.size
    if p == 0 or not (chain.preload or chain.gravity or np.any(chain.leaf_stiffness)):
        return StaticSensitivities(np.zeros((n, p)), np.zeros(p), np.zeros(p))
    walled = n_contacts == n
    compliance = static_compliance(wall) if wall is not None else 0.0

    # derivatives of each contact's force: by its overlap, by its A, by the compliance behind it
    overlap = chain.elastic.overlap(static.force)
    k = chain.elastic.stiffness(overlap) * (overlap > 0.0)
    soft = np.ones_like(k)
    if walled and np.isfinite(compliance):
        soft[-1] = 1.0 / (1.0 + compliance * k[-1])
    slope, by_A = k * soft, chain.elastic.force(overlap) / chain.A * soft
    by_compliance = -k[-1] * soft[-1] * static.force[-1]

    # of the modes' static compliance sum (phi / omega)^2
    d_compliance = np.zeros(p)
    if wall is not None and wall.omega.size:
        moving = wall.phi != 0.0
        phi, omega = wall.phi[moving, None], wall.omega[moving, None]
        by_phi, by_omega = 2.0 * phi / omega**2, -2.0 * phi**2 / omega**3
        d_compliance = np.sum(
            by_phi * directions.phi[moving] + by_omega * directions.omega[moving], axis=0
        )

    # dF at fixed positions, (n_contacts, p), and what it and the preload unbalance, -dr (n, p)
    source = by_A[:, None] * directions.A
    if directions.parameters is not None:
        by_parameters = soft * chain.elastic.by_parameters(overlap)
        source += np.einsum("jc,jcp->cp", by_parameters, directions.parameters)
    if walled:
        source[-1] += by_compliance * d_compliance
    load = np.zeros((n, p))
    load[:n_contacts] -= source
    load[1:] += source[: n - 1]
    load[-1] += directions.preload

    # tangent stiffness K (n, n)
    K = np.diag(chain.springs[0])
    for i, k_contact in enumerate(slope):
        K[i, i] += k_contact
        if i < n - 1:
            K[i, i + 1] -= k_contact
            K[i + 1, i] -= k_contact
            K[i + 1, i + 1] += k_contact

    # a sphere that nothing holds, without leaf spring and between open contacts, keeps just
    # touching the next; the solver of the static state leaves 1e-9 of the largest force in those
    force = np.concatenate([[0.0], static.force, np.zeros(n - n_contacts)])
    is_open = force <= 1e-9 * force.max()
    idle = np.flatnonzero((chain.springs[0] == 0.0) & is_open[:-1] & is_open[1:])
    load[idle] = 0.0
    for i in idle:
        K[i] = 0.0
        K[i, i] = 1.0
        if i < n - 1:
            K[i, i + 1] = -1.0

    x = np.linalg.solve(K, load)
    if not walled:
        return StaticSensitivities(x, np.zeros(p), np.zeros(p))
    d_force = slope[-1] * x[-1] + source[-1]
    modal = compliance - wall.residual_compliance
    return StaticSensitivities(x, d_force, modal * d_force + static.force[-1] * d_compliance)
