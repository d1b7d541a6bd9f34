"""The longest step with which a march is stable.

Wall modes and leaf springs are advanced exactly and set no limit. Contacts do: for a linear contact
x'' = -omega^2 x a step is a matrix S(dt omega) with determinant 1, whose powers stay bounded while
|trace S| < 2 (Hairer, Lubich and Wanner, Geometric Numerical Integration (2006), ch. I). The
largest dt omega up to which this holds is the scheme's `stability_interval`, 2 for Verlet's. omega
is that of the stiffest contact at the largest force it can reach (`fastest_rate`).
"""

from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from beadwave.dem.chain import Chain, validate
from beadwave.dem.checks import InvalidChain
from beadwave.dem.prepared import PreparedChain, prepare
from beadwave.dem.schemes import SCHEMES, Scheme, named_scheme
from beadwave.dem.walls import Wall

SLIDING = ("verlet", "leapfrog")  # explicit, and never back in time
# exponent of the growth of rounding in a scheme's step back in time, where damping is amplified
BACKWARD = 10.0


class UnstableStep(ValueError):
    """A step so long that the march is unstable."""


def marching_scheme(
    prepared: PreparedChain, v0: ArrayLike, dt: float, name: str | None = None
) -> Scheme:
    """The scheme of a name, or the one that measures best at steps of dt [s] from velocities v0
    (n,) [m/s].

    Raises InvalidChain for an unknown name, and for one that takes no friction or no yield where
    the chain has it.
    """
    stiff = dt * fastest_decay(prepared, v0) > BACKWARD
    method = named_scheme(name, prepared.chain, prepared.wall, stiffly_damped=stiff)
    if prepared.chain.slides and method.name not in SLIDING:
        raise InvalidChain(f"scheme {method.name!r} takes no friction; take {' or '.join(SLIDING)}")
    if method.kind == "implicit" and prepared.chain.yield_overlap is not None:
        raise InvalidChain(
            f"scheme {method.name!r} takes no plastic contacts; take one that is explicit"
        )
    return method


def refuse_step(prepared: PreparedChain, v0: ArrayLike, dt: float, scheme: Scheme) -> None:
    """Raise UnstableStep if contacts or damping make the scheme unstable at steps of dt [s] from
    velocities v0 (n,) [m/s]; the sentence has the longest step that is not refused.

    A scheme that goes back in time by a share b of its step amplifies damping at the rate c by
    exp(b c dt), and with it rounding: refused beyond exp(2 BACKWARD) = 5e8.
    """
    rate, limit = fastest_rate(prepared, v0), stability_interval(scheme)
    if dt * rate > limit:
        raise UnstableStep(
            f"dt = {dt:.3g} s is unstable for contacts of {rate:.3g} rad/s; "
            f"take dt < {limit / rate:.3g} s"
        )
    decay, back = fastest_decay(prepared, v0), backward_reach(scheme.name)
    if dt * decay * back > 2.0 * BACKWARD:
        raise UnstableStep(
            f"dt = {dt:.3g} s is unstable for damping of {decay:.3g} 1/s with scheme "
            f"{scheme.name!r}; take dt < {2.0 * BACKWARD / (decay * back):.3g} s or a scheme of "
            "order 2"
        )


def fastest_rate(prepared: PreparedChain, v0: ArrayLike) -> float:
    """Upper estimate of the largest contact frequency [rad/s], sqrt(k (1/m_1 + 1/m_2)), with all
    kinetic energy of the velocities v0 (n,) [m/s] in one contact, on top of the static force.

    Wall modes faster than the contact act on it as springs, slower ones as bodies of 1/m = phi^2.
    Contacts count one by one; two that share a sphere are up to sqrt(2) faster together.
    """
    chain, wall = prepared.chain, prepared.wall
    mass, n_contacts = np.asarray(chain.mass, float), np.size(chain.A)
    if not n_contacts:
        return 0.0
    stiffness = chain.elastic.stiffness(_deepest(prepared, v0))
    inverse = 1.0 / mass
    pair = inverse[:n_contacts].copy()
    pair[: mass.size - 1] += inverse[1:]
    if wall is not None and wall.omega.size:
        bodies = wall.omega**2 <= stiffness[-1] * inverse[-1]
        pair[-1] += np.square(wall.phi[bodies]).sum()
    return float(np.sqrt((stiffness * pair).max()))


def fastest_decay(prepared: PreparedChain, v0: ArrayLike) -> float:
    """Upper estimate of the largest rate [1/s] at which damping reduces a velocity, from
    velocities v0 (n,) [m/s]: of wall modes, of a dashpot behind the last contact, and of
    the contacts' dampers, both at the largest force."""
    chain, wall, damping = prepared.chain, prepared.wall, prepared.damping
    rates = [0.0]
    if wall is not None and wall.omega.size:
        over = np.sqrt(np.maximum(wall.zeta**2 - 1.0, 0.0))
        rates.append((wall.omega * (wall.zeta + over)).max())
    if wall is not None and wall.mobility > 0.0:
        rates.append(wall.mobility * chain.elastic.stiffness(_deepest(prepared, v0))[-1])
    if damping is not None and chain.A.size:
        deepest = _deepest(prepared, v0)
        damper = damping.gamma * (1.0 if chain.jumps else chain.elastic.force(deepest))
        if wall is not None and wall.residual_compliance < 0.0:
            stiffness = chain.elastic.stiffness(deepest)[-1]
            # a negative spring in series leaves the damper 1 / (1 + s k)^2 of its strength, without
            # bound at the fold: at most that of a tenth of the contact's stiffness
            damper[-1] /= max(1.0 + wall.residual_compliance * stiffness, 0.1) ** 2
        rates.append((damper * damping.inverse_mass).max())
    return float(max(rates))


def _deepest(prepared, v0):
    """Overlap [m] of every contact with all kinetic energy in it on top of the static force."""
    chain = prepared.chain
    energy = 0.5 * float(chain.mass @ np.square(v0))
    law = chain.elastic
    return law.overlap_of_energy(np.full(chain.A.shape, energy)) + law.overlap(prepared.pressed)


@cache
def backward_reach(name: str) -> float:
    """Largest part of the step that the scheme goes back in time; damping grows there."""
    scheme = SCHEMES[name]
    moves = scheme.b if scheme.kind == "implicit" else np.concatenate([scheme.a, scheme.b])
    return float(max(0.0, -moves.min()))


def stability_interval(scheme: Scheme) -> float:
    """Largest dt * omega for which a linear contact of frequency omega stays bounded: the trace of
    the matrix of a step is within +-2."""
    return np.inf if scheme.kind == "implicit" else _interval(scheme.name)


@cache
def _interval(name):
    """`stability_interval` of an explicit scheme: the matrix of a step on x'' = -x at steps z, from
    its columns (1, 0) and (0, 1), and the first z of a grid of 0.01 at which |trace| exceeds 2."""
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
    """Longest stable step [s] from velocities v0 (n,) [m/s]; contacts that share a sphere can lower
    it by up to sqrt(2). inf of implicit schemes, and where nothing can press a contact. Raises
    InvalidChain, NoEquilibrium."""
    validate(chain, wall, v0)
    method, rate = named_scheme(scheme, chain, wall), fastest_rate(prepare(chain, wall), v0)
    return stability_interval(method) / rate if rate > 0.0 else np.inf
