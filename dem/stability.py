"""The largest step with which a march means anything.

Wall modes and leaf springs are advanced exactly and set no limit; contacts do, through the linear
stability interval of the scheme: dt * omega below `stability_interval`.
"""

from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from dem.chain import Chain, Wall, validate
from dem.kernels.checks import fastest_contact
from dem.schemes import SCHEMES, Scheme, default_scheme
from dem.statics import Equilibrium, static_state

_NONE = np.zeros(0)
NEAR_FOLD = 0.1  # of the contact's stiffness that a negative spring in series leaves
BACKWARD = 10.0  # rounding may grow by exp(BACKWARD) in a step back in time


class UnstableStep(ValueError):
    """A step for which the march has no meaning."""


def refuse_step(
    chain: Chain, wall: Wall | None, v0: ArrayLike, static: Equilibrium, dt: float, scheme: Scheme
) -> None:
    """Raise UnstableStep if the contacts or the damping make dt meaningless for the scheme."""
    rate, limit = fastest_rate(chain, wall, v0, static), stability_interval(scheme)
    if dt * rate > limit:
        raise UnstableStep(
            f"dt = {dt:.3g} s is unstable for contacts of {rate:.3g} rad/s; "
            f"take dt < {limit / rate:.3g} s"
        )
    decay, back = fastest_decay(chain, wall, v0, static), backward_reach(scheme)
    if dt * decay * back > 2.0 * BACKWARD:
        raise UnstableStep(
            f"dt = {dt:.3g} s is unstable for damping of {decay:.3g} 1/s with scheme "
            f"{scheme.name!r}; take dt < {2.0 * BACKWARD / (decay * back):.3g} s or a scheme of "
            "order 2"
        )


def fastest_rate(chain: Chain, wall: Wall | None, v0: ArrayLike, static: Equilibrium) -> float:
    """Upper estimate of the largest contact frequency [rad/s]: all kinetic energy in one contact,
    on top of the static force. Wall modes faster than the contact itself are springs to it."""
    omega = phi = _NONE
    if wall is not None and wall.omega.size:
        order = np.argsort(wall.omega)
        omega, phi = wall.omega[order], wall.phi[order]
    energy = 0.5 * float(np.dot(chain.mass, np.square(v0)))
    arrays = (np.asarray(values, float) for values in (chain.mass, chain.A, static.force))
    return fastest_contact(*arrays, energy, omega, phi)


def fastest_decay(chain: Chain, wall: Wall | None, v0: ArrayLike, static: Equilibrium) -> float:
    """Upper estimate of the largest rate [1/s] at which damping wears motion down."""
    rates = [0.0]
    if wall is not None and wall.omega.size:
        over = np.sqrt(np.maximum(wall.zeta**2 - 1.0, 0.0))
        rates.append((wall.omega * (wall.zeta + over)).max())
    if wall is not None and wall.mobility > 0.0:
        stiffness = 1.5 * chain.A[-1] * np.sqrt(_deepest(chain, v0, static)[-1])
        rates.append(wall.mobility * stiffness)
    if chain.dissipation != "none" and chain.A.size:
        inverse = 1.0 / chain.mass
        pair = inverse[:-1] + inverse[1:]
        if wall is not None:
            pair = np.append(pair, inverse[-1] + wall.phi @ wall.phi)
        deepest = _deepest(chain, v0, static)
        force = chain.A * deepest**1.5
        damper = chain.gamma * (force if chain.dissipation == "hunt-crossley" else 1.0)
        if wall is not None and wall.residual_compliance < 0.0:
            stiffness = 1.5 * chain.A[-1] * np.sqrt(deepest[-1])
            damper[-1] /= max(1.0 + wall.residual_compliance * stiffness, NEAR_FOLD) ** 2
        rates.append((damper * pair).max())
    return float(max(rates))


def _deepest(chain, v0, static):
    """Overlap [m] of every contact with all kinetic energy in it on top of the static force."""
    energy = 0.5 * float(chain.mass @ np.square(v0))
    return (2.5 * energy / chain.A) ** 0.4 + (static.force / chain.A) ** (2 / 3)


def backward_reach(scheme: Scheme) -> float:
    """Largest part of the step that the scheme goes back in time; damping grows there."""
    return _longest_back(scheme.name)


@cache
def _longest_back(name):
    scheme = SCHEMES[name]
    moves = scheme.b if scheme.kind == "implicit" else np.concatenate([scheme.a, scheme.b])
    return float(max(0.0, -moves.min()))


def stability_interval(scheme: Scheme) -> float:
    """Largest dt * omega for which a linear contact of frequency omega stays bounded."""
    return np.inf if scheme.kind == "implicit" else _interval(scheme.name)


@cache
def _interval(name):
    scheme = SCHEMES[name]
    z = np.arange(0.01, 12.0, 0.01)
    x, v = np.tile(np.eye(2)[:, :, None], z.size)
    for b, a in zip(scheme.b, (*scheme.a, 0.0), strict=True):
        v = v - b * z * x
        x = x + a * z * v
    unstable = np.abs(x[0] + v[1]) > 2.0 + 1e-9
    return float(z[unstable.argmax()]) if unstable.any() else float(z[-1])


def stability_limit(
    chain: Chain, wall: Wall | None, v0: ArrayLike, *, scheme: str | None = None
) -> float:
    """Largest meaningful step [s]; contacts that share a sphere can lower it by up to sqrt(2)."""
    validate(chain, wall, v0)
    method = SCHEMES[scheme or default_scheme(chain, wall)]
    rate = fastest_rate(chain, wall, v0, static_state(chain, wall))
    return stability_interval(method) / rate if rate > 0.0 else np.inf
