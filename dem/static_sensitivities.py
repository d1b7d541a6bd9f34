"""Derivatives of the static state by parameters:  K dx = -dr/dtheta  in what holds there."""

from typing import NamedTuple

import numpy as np

from dem.chain import Chain, Wall, static_compliance
from dem.kernels.arguments import Array
from dem.spheres import hertz_overlap, hertz_stiffness
from dem.statics import Equilibrium

IDLE = 1e-9  # of the largest force: what the solver of the static state leaves in open contacts


class Directions(NamedTuple):
    """Derivatives by p parameters of what a run is made of."""

    A: Array  # (n_contacts, p)
    gamma: Array  # (n_contacts, p)
    v0: Array  # (n, p)
    preload: Array  # (p,)
    phi: Array  # (k, p)
    omega: Array  # (k, p)
    zeta: Array  # (k, p)


class StaticSensitivities(NamedTuple):
    """Derivatives of the static state."""

    x: Array  # (n, p)
    force: Array  # (p,) at the wall
    offset: Array  # (p,) displacement of the modes


def static_sensitivities(
    chain: Chain, wall: Wall | None, static: Equilibrium, directions: Directions
) -> StaticSensitivities:
    """Derivatives of the static state: K dx = -dr/dtheta, from the equations that hold in it."""
    n, p = chain.mass.size, directions.preload.size
    if p == 0 or not (chain.preload or chain.gravity or np.any(chain.leaf_stiffness)):
        return StaticSensitivities(np.zeros((n, p)), np.zeros(p), np.zeros(p))
    compliance = static_compliance(wall) if wall is not None else 0.0
    slope, by_A, by_compliance = _static_slopes(chain, static, compliance, chain.A.size == n)
    d_compliance = _compliance_sensitivities(wall, directions)
    source = by_A[:, None] * directions.A
    if chain.A.size == n:
        source[-1] += by_compliance * d_compliance
    x = np.linalg.solve(_stiffness(chain, static, slope), _loads(chain, static, directions, source))
    if chain.A.size < n:
        return StaticSensitivities(x, np.zeros(p), np.zeros(p))
    force = slope[-1] * x[-1] + source[-1]
    soft = compliance - wall.residual_compliance
    return StaticSensitivities(x, force, soft * force + static.force[-1] * d_compliance)


def _static_slopes(chain, static, compliance, walled):
    """Derivatives of each contact's force by its overlap, its stiffness, the compliance behind."""
    d = hertz_overlap(static.force, chain.A)
    k = hertz_stiffness(d, chain.A)
    soft = np.ones_like(k)
    if walled and np.isfinite(compliance):
        soft[-1] = 1.0 / (1.0 + compliance * k[-1])
    return k * soft, d**1.5 * soft, -k[-1] * soft[-1] * static.force[-1]


def _stiffness(chain, static, slope):
    """(n, n); a sphere that nothing holds keeps just touching the next."""
    n = chain.mass.size
    K = np.diag(chain.springs[0])
    for i, k in enumerate(slope):
        K[i, i] += k
        if i < n - 1:
            K[i, i + 1] -= k
            K[i + 1, i] -= k
            K[i + 1, i + 1] += k
    for i in _idle(chain, static):
        K[i] = 0.0
        K[i, i] = 1.0
        if i < n - 1:
            K[i, i + 1] = -1.0
    return K


def _idle(chain, static):
    """Spheres without leaf spring whose contacts are both open."""
    n = chain.mass.size
    force = np.concatenate([[0.0], static.force, np.zeros(n - chain.A.size)])
    open_ = force <= IDLE * force.max()
    return np.flatnonzero((chain.springs[0] == 0.0) & open_[:-1] & open_[1:])


def _loads(chain, static, directions, source):
    """(n, p) what unbalances the spheres; source (n_contacts, p) is dF at frozen positions."""
    n = chain.mass.size
    r = np.zeros((n, directions.preload.size))
    r[: chain.A.size] -= source
    r[1:] += source[: n - 1]
    r[-1] += directions.preload
    r[_idle(chain, static)] = 0.0
    return r


def _compliance_sensitivities(wall, directions):
    """(p,) of the modes' static compliance sum (phi / omega)^2."""
    if wall is None or not wall.omega.size:
        return np.zeros(directions.preload.size)
    moving = wall.phi != 0.0
    phi, omega = wall.phi[moving, None], wall.omega[moving, None]
    by_phi, by_omega = 2.0 * phi / omega**2, -2.0 * phi**2 / omega**3
    return np.sum(by_phi * directions.phi[moving] + by_omega * directions.omega[moving], axis=0)
