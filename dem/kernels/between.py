"""A step between its ends, where each is known to its third derivative.

The polynomial of degree 7 that agrees at both ends with positions, velocities, accelerations and
their rates (E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, 2nd
ed., sec. II.6): in a smooth step of length h its derivative is off by h^7 x^(8) / 2.7e6 at the
most, to leading order. A contact that opens or closes within the step pushes with A (r tau)^(3/2),
which no polynomial follows: what it moves is known, and `mend_events` puts it in the place of its
own polynomial.
"""

import math
from typing import NamedTuple

from beadwave.dem.kernels.arguments import (
    DASH,
    IN_CONTACTS,
    IN_GUIDES,
    IN_WALL,
    WORK,
    Array,
    ChainArrays,
    Motion,
    SavedStates,
    U,
    V,
    WallModes,
)
from beadwave.dem.kernels.compiled import fastmath_inline, fastmath_march
from beadwave.dem.kernels.ends import (
    CONTACTS,
    DASHPOT,
    GUIDES,
    WALL,
    ChainAndWall,
    Ends,
    Gaps,
    StepEnds,
    fill_ends,
)
from beadwave.dem.kernels.events import crossing
from beadwave.dem.kernels.ledger import save
from beadwave.dem.kernels.modes import modal_energy
from beadwave.dem.kernels.numbers import larger, smaller


class InterpolatedStates(NamedTuple):
    """Spheres at k samples; modes (k, n_modes) from their static state."""

    x: Array  # (k, n) [m]
    v: Array  # (k, n) [m/s]
    q: Array  # (k, n_modes) [kg^1/2 m]
    p: Array  # (k, n_modes) [kg^1/2 m/s]
    slow: Array  # (k, 4) energies lost and the way of a dashpot
    slow_rate: Array  # (k, 4) their rates


@fastmath_inline
def early(s: float) -> tuple[float, float, float, float]:
    """At the share s of a step, what the value and the first three derivatives by s at its start
    weigh; those at its end weigh `early` of 1 - s, the odd ones with the opposite sign."""
    r = 1.0 - s
    r4 = r * r * r * r
    return (
        r4 * (1.0 + s * (4.0 + s * (10.0 + 20.0 * s))),
        r4 * s * (1.0 + s * (4.0 + 10.0 * s)),
        0.5 * r4 * s * s * (1.0 + 4.0 * s),
        r4 * s * s * s / 6.0,
    )


@fastmath_inline
def early_slopes(s: float) -> tuple[float, float, float, float]:
    """The derivatives of `early`."""
    r = 1.0 - s
    r3 = r * r * r
    return (
        -140.0 * r3 * s * s * s,
        r3 * (1.0 + s * (3.0 + s * (6.0 - 70.0 * s))),
        r3 * s * (1.0 + s * (3.0 - 14.0 * s)),
        r3 * s * s * (3.0 - 7.0 * s) / 6.0,
    )


@fastmath_inline
def mixed(
    i: int, b: int, h: float, weights: tuple, mirrored: tuple, sign: float, ends: Ends
) -> float:
    """Value of body b in step i of length h [s] with the `weights` of the step's start, and
    `mirrored` ones of its end. `sign` is 1 with those of `early` and -1 with those of
    `early_slopes`, since the slope by 1 - s is minus that by s."""
    x, v, a, j = ends
    even = weights[0] * x[i, b] + sign * mirrored[0] * x[i + 1, b]
    even += h * h * (weights[2] * a[i, b] + sign * mirrored[2] * a[i + 1, b])
    odd = h * (weights[1] * v[i, b] - sign * mirrored[1] * v[i + 1, b])
    return even + odd + h * h * h * (weights[3] * j[i, b] - sign * mirrored[3] * j[i + 1, b])


@fastmath_inline
def fill_between(ends: Ends, h: float, x: Array, v: Array) -> None:
    """Positions x and velocities v (k, m) of m bodies at k equal instants of steps of h [s]."""
    steps, samples = ends.x.shape[0] - 1, x.shape[0] - 1
    for k in range(samples + 1):
        # whole numbers up to the division: a sample at the end of a step is there to rounding
        i = k * steps // samples if k < samples else steps - 1
        s = (k * steps - i * samples) / samples
        weights, mirrored = early(s), early(1.0 - s)
        slope, mirrored_slope = early_slopes(s), early_slopes(1.0 - s)
        for b in range(x.shape[1]):
            x[k, b] = mixed(i, b, h, weights, mirrored, 1.0, ends)
            v[k, b] = mixed(i, b, h, slope, mirrored_slope, -1.0, ends) / h


class ContactOnset(NamedTuple):
    """Instant in a step at which a contact begins to push, and the growth of its overlap; time in
    steps."""

    at: float  # below 0 if it began in the step before; counted from the end if the contact opens
    slope: float  # of the overlap there, away from touching; 0 where there is none
    curvature: float


@fastmath_inline
def unfollowed(z: float, at: float, bend: float) -> tuple[float, float]:
    """u less the polynomial that agrees with it at both ends of a step, at z in (0, 1), where
    u'' = tau^(3/2) + bend tau^(5/2) with tau = z - at > 0; and the derivative of that by z. All in
    steps."""
    u0, u1 = risen(larger(-at, 0.0), bend), risen(1.0 - at, bend)
    w, d = early(z), early_slopes(z)
    value = -(w[0] * u0[0] + w[1] * u0[1] + w[2] * u0[2] + w[3] * u0[3])
    slope = -(d[0] * u0[0] + d[1] * u0[1] + d[2] * u0[2] + d[3] * u0[3])
    w, d = early(1.0 - z), early_slopes(1.0 - z)
    value -= w[0] * u1[0] - w[1] * u1[1] + w[2] * u1[2] - w[3] * u1[3]
    slope += d[0] * u1[0] - d[1] * u1[1] + d[2] * u1[2] - d[3] * u1[3]
    u = risen(larger(z - at, 0.0), bend)
    return value + u[0], slope + u[1]


@fastmath_inline
def risen(t: float, bend: float) -> tuple[float, float, float, float]:
    """u of u'' = t^(3/2) + bend t^(5/2), at rest at t = 0, and its first three derivatives."""
    root = math.sqrt(t)
    return (
        t * t * t * root * (1.0 / 8.75 + bend * t / 15.75),
        t * t * root * (0.4 + bend * t / 3.5),
        t * root * (1.0 + bend * t),
        root * (1.5 + 2.5 * bend * t),
    )


@fastmath_inline
def touch(h: float, i: int, k: int, c: int, gaps: Gaps) -> ContactOnset:
    """Onset of contact c between the ends i and k of a step of h [s], seen from i: open there, or
    just closed. A slope of 0 where there is none. With k = i - 1 time runs backwards, and a contact
    that opens is one that closes."""
    h *= k - i
    g0, r0 = gaps.overlap[i, c], h * gaps.rate[i, c]
    g1, r1 = gaps.overlap[k, c], h * gaps.rate[k, c]
    curvature = h * h * gaps.bend[i, c]
    if g0 <= 0.0 and g1 > 0.0:
        at, slope, curvature = crossing(g0, r0, g1, r1)
    # 0.7 of a step: a contact that closed no longer ago still bends the next step's motion
    elif 0.0 < g0 < 0.7 * r0 and g1 > 0.0:
        at = -g0 / r0
        fall = r0 + curvature * at
        if fall > 0.0:
            at = smaller(larger(at - 0.5 * curvature * at * at / fall, -1.0), 0.0)
        slope = r0 + curvature * at
    else:
        at, slope = 0.0, 0.0
    return ContactOnset(at, larger(slope, 0.0), curvature)


@fastmath_inline
def move(
    k: int, c: int, dx: float, dv: float, bodies: ChainAndWall, moved: InterpolatedStates
) -> None:
    """Move the bodies of contact c at the k-th sample by dx [kg m], mass times displacement,
    and the impulse dv [N s] of its force: each sphere by that over its mass, the modes by phi."""
    x, v, q, p, _, _ = moved
    inverse_mass, phi = bodies.inverse_mass, bodies.phi
    x[k, c] -= inverse_mass[c] * dx
    v[k, c] -= inverse_mass[c] * dv
    if c < x.shape[1] - 1:
        x[k, c + 1] += inverse_mass[c + 1] * dx
        v[k, c + 1] += inverse_mass[c + 1] * dv
    else:
        for m in range(phi.size):
            q[k, m] += phi[m] * dx
            p[k, m] += phi[m] * dv


@fastmath_inline
def mend_events(gaps: Gaps, h: float, bodies: ChainAndWall, moved: InterpolatedStates) -> None:
    """Correct the spheres and modes in `moved` by what contacts do that open or close in a step of
    h [s]: their true motion u'' = (r tau)^(3/2) takes the place of its own polynomial. Nothing
    changes at the ends of the step, where both agree."""
    steps, samples = gaps.overlap.shape[0] - 1, moved.x.shape[0] - 1
    for i in range(steps):
        for c in range(bodies.A.size):
            for closes in (True, False):
                # a contact that opens is one that closes, seen back from the end of the step
                opened, closed = (i, i + 1) if closes else (i + 1, i)
                at, slope, curvature = touch(h, opened, closed, c, gaps)
                if slope == 0.0:
                    continue
                sign = 1.0 if closes else -1.0
                bend = smaller(larger(0.75 * curvature / slope, -1.0), 1.0)
                size = bodies.A[c] * h * h * slope * math.sqrt(slope)
                size *= 1.0 + larger(sign * bodies.gamma[c] * slope / h, -1.0)
                for k in range(-(-i * samples // steps), (i + 1) * samples // steps + 1):
                    s = (k * steps - i * samples) / samples
                    dx, dv = unfollowed(s if closes else 1.0 - s, at, bend)
                    move(k, c, size * dx, sign * size / h * dv, bodies, moved)


@fastmath_inline
def place_modes(k: int, rows: InterpolatedStates, wall: Array, modes: WallModes | None) -> None:
    """Modes at the k-th sample into those of the chain, and displacement and velocity of the wall
    (4,) with them."""
    wall[U], wall[V] = 0.0, 0.0
    if modes is not None:
        for j in range(modes.q.size):
            modes.q[j], modes.p[j] = rows.q[k, j], rows.p[k, j]
            wall[U] += modes.phi[j] * modes.q[j]
            wall[V] += modes.phi[j] * modes.p[j]


@fastmath_march
def save_between(
    h: float, marched: SavedStates, bodies: ChainAndWall, ends: StepEnds,
    samples: InterpolatedStates,
    snapshot: Motion, chain: ChainArrays, saved: SavedStates,
) -> None:  # fmt: skip
    """States, forces and energies between the steps of h [s] that were marched, at equally spaced
    times.

    Writes over everything from `ends` on, the chain's modes too. One entry for all of it: four
    would compile what unpacks and hands over the same arrays once each.
    """
    fill_ends(marched, bodies, h, ends)

    # samples on the polynomials of degree 7, then what contacts do that open or close in a step
    fill_between(ends.spheres, h, samples.x, samples.v)
    fill_between(ends.modes, h, samples.q, samples.p)
    fill_between(ends.slow, h, samples.slow, samples.slow_rate)
    mend_events(ends.gaps, h, bodies, samples)

    # forces and energies at the samples
    wall, ledger, modes, slow = snapshot.wall, snapshot.ledger, chain.modes, samples.slow
    for k in range(samples.x.shape[0]):
        for i in range(snapshot.x.size):
            snapshot.x[i], snapshot.v[i] = samples.x[k, i], samples.v[k, i]
        place_modes(k, samples, wall, modes)
        wall[DASH] = slow[k, DASHPOT]
        wall[WORK] = modal_energy(modes)[0]
        ledger[IN_CONTACTS], ledger[IN_WALL] = slow[k, CONTACTS], slow[k, WALL]
        ledger[IN_GUIDES] = slow[k, GUIDES]
        save(k, h, snapshot, chain, saved, chain.mobility)
