"""Contacts that open, close or yield within a step.

A contact that opens or closes inside a step costs any scheme all but order 2.5, because its force
starts like tau^(3/2). The end correction for that singularity is known: a composite quadrature
with nodes c and weights b misses the integral of (t - t_c)^p by  -h^(p+1) sum b zeta(-p, c - theta)
with Hurwitz' zeta and theta = (t_c - t_0)/h  (I. Navot, J. Math. Phys. 40 (1961) 271; J. N.
Lyness, B. W. Ninham, Math. Comput. 21 (1967) 162). `correct_events` adds it as an impulse.
"""

import math

from beadwave.dem.kernels.arguments import (
    DASH,
    IN_CONTACTS,
    Array,
    ChainArrays,
    Correction,
    Damping,
    Motion,
    Plastic,
    U,
    V,
)
from beadwave.dem.kernels.compiled import fastmath_inline, ieee
from beadwave.dem.kernels.laws import grows, plastic_indentation, plastic_loss
from beadwave.dem.kernels.modes import push_modes, shift_modes
from beadwave.dem.kernels.numbers import larger, smaller


@ieee
def zeta_sums(theta: float, correction: Correction) -> tuple[float, float, float]:
    """sum b zeta(-p, c - theta), p = 3/2, 5/2, 7/2, over the nodes of this and all later steps but
    those before theta.

    With zeta(-p, a) = a^p + zeta(-p, a + 1) the terms a^p of this step and the next are summed as
    they stand; `correction.tail` (3, m) holds what starts two steps on, polynomials in 2 theta - 1,
    smooth as its zeta functions are far from their singularity at a = 0.
    """
    b, c, tail = correction.weights, correction.nodes, correction.tail
    z = 2.0 * theta - 1.0
    s3, s5, s7 = 0.0, 0.0, 0.0
    for k in range(tail.shape[1]):
        s3 = s3 * z + tail[0, k]
        s5 = s5 * z + tail[1, k]
        s7 = s7 * z + tail[2, k]
    for i in range(b.size):
        s = larger(c[i] - theta, 0.0)
        e = larger(c[i] - theta + 1.0, 0.0)
        this_step = b[i] * s * math.sqrt(s)
        next_step = b[i] * e * math.sqrt(e)
        s3 += this_step + next_step
        s5 += this_step * s + next_step * e
        s7 += this_step * s * s + next_step * e * e
    return s3, s5, s7


@ieee
def crossing(g0: float, r0: float, g1: float, r1: float) -> tuple[float, float, float]:
    """Zero in (0, 1) of the cubic with values g and slopes r at the ends, in steps; slope and
    curvature there. g0 and g1 differ in sign, or g0 is 0.

    Newton's method within a bracket that is halved where a step would leave it.
    """
    c2 = 3.0 * (g1 - g0) - 2.0 * r0 - r1
    c3 = 2.0 * (g0 - g1) + r0 + r1
    if g0 == 0.0:
        return 0.0, r0, 2.0 * c2
    low, high = 0.0, 1.0
    t = g0 / (g0 - g1)
    for _ in range(60):
        value = g0 + t * (r0 + t * (c2 + t * c3))
        slope = r0 + t * (2.0 * c2 + t * 3.0 * c3)
        if (value > 0.0) == (g1 > 0.0):
            high = t
        else:
            low = t
        step = -value / slope if slope != 0.0 else 2.0
        t += step
        if not low <= t <= high:
            t = 0.5 * (low + high)
        if abs(step) < 1e-13:
            break
    return t, r0 + t * (2.0 * c2 + t * 3.0 * c3), 2.0 * c2 + 6.0 * t * c3


@ieee
def missed_impulse(
    A: float, dt: float, g0: float, r0: float, g1: float, r1: float, correction: Correction
) -> tuple[float, float, float]:
    """Impulse [N s] and displacement times mass [kg m] that the scheme misses in a step dt [s] at a
    contact whose overlap went from g0 to g1 [m] with rates r0, r1 [m/s]; also the rate [m/s] at the
    crossing. All 0 where the overlap grazes 0 rather than crosses it.

    The force near the crossing is A (r tau)^(3/2) (1 + bend tau) with the time tau in steps: each
    power has its zeta sum. A kick at the share c of a step moves a body by (1 - c) of its impulse
    until the end, so that the displacement needs the sums of one power more.
    """
    theta, slope, curvature = crossing(g0, dt * r0, g1, dt * r1)
    if (slope > 0.0) != (g1 > 0.0) or slope == 0.0:
        return 0.0, 0.0, 0.0

    # a contact that opens is one that closes, seen back from the end: the schemes are symmetric
    closes = slope > 0.0
    z3, z5, z7 = zeta_sums(theta if closes else 1.0 - theta, correction)
    bend = 0.75 * curvature / abs(slope)
    bend = smaller(larger(bend, -1.0), 1.0)  # a grazing contact has no slope to speak of
    size = A * dt * abs(slope) * math.sqrt(abs(slope))
    lever = 1.0 - theta
    impulse = -(z3 + bend * z5)
    moment = -(z5 + bend * z7)
    if closes:
        shift = lever * impulse - moment
    else:
        shift = lever * impulse + moment
    return size * impulse, dt * size * shift, slope / dt


@fastmath_inline
def crossed(
    motion: Motion, start: Motion, A: Array, offset: float, plastic: Plastic | None
) -> bool:
    """Did any contact open or close in the last step, from `start` to `motion`? Plastic contacts
    are closed beyond their crater. A (n_contacts,), offset [m] of the wall at rest."""
    x, x_old = motion.x, start.x
    n = x.size
    count = 0
    for i in range(n - 1):
        crater = 0.0 if plastic is None else plastic.crater[i]
        count += (x[i] - x[i + 1] > crater) != (x_old[i] - x_old[i + 1] > crater)
    if A.size == n:
        crater = 0.0 if plastic is None else plastic.crater[n - 1]
        was = x_old[n - 1] - start.wall[U] - start.wall[DASH] - offset
        now = x[n - 1] - motion.wall[U] - motion.wall[DASH] - offset
        count += (was > crater) != (now > crater)
    return count > 0


@ieee
def overlap(i: int, motion: Motion, offset: float) -> tuple[float, float]:
    """Overlap [m] of contact i and its rate [m/s]; at the wall that of contact and residual spring
    together, without the dashpot's rate."""
    x, v, wall = motion.x, motion.v, motion.wall
    if i < x.size - 1:
        return x[i] - x[i + 1], v[i] - v[i + 1]
    return x[i] - wall[U] - wall[DASH] - offset, v[i] - wall[V]


@ieee
def correct_events(
    dt: float, motion: Motion, start: Motion, chain: ChainArrays, correction: Correction,
    damping: Damping | None, plastic: Plastic | None,
) -> None:  # fmt: skip
    """Add what the scheme missed at the contacts that opened or closed in the last step of dt [s].

    Dampers in proportion to the force scale the impulse by 1 + gamma r with the rate r at the
    crossing, and the ledger gets what they take of it. Dampers whose force jumps are not corrected:
    they leave an error of order 1.
    """
    x, v, minv = motion.x, motion.v, chain.inverse_mass
    n = x.size
    for i in range(chain.A.size):
        # a plastic contact opens and closes at its crater, by the law of its flattened surface
        g0, r0 = overlap(i, start, chain.offset)
        g1, r1 = overlap(i, motion, chain.offset)
        coefficient = chain.A[i]
        if plastic is not None:
            g0 -= plastic.crater[i]
            g1 -= plastic.crater[i]
            coefficient = plastic.coefficient[i]
        if (g0 > 0.0) == (g1 > 0.0):
            continue
        impulse, shift, rate = missed_impulse(coefficient, dt, g0, r0, g1, r1, correction)
        if damping is not None and grows(damping.law):
            factor = larger(damping.gamma[i] * rate, -1.0)
            motion.ledger[IN_CONTACTS] += factor * impulse * rate
            impulse *= 1.0 + factor
            shift *= 1.0 + factor

        # on both bodies, with opposite signs: momentum stays
        v[i] -= minv[i] * impulse
        x[i] -= minv[i] * shift
        if i < n - 1:
            v[i + 1] += minv[i + 1] * impulse
            x[i + 1] += minv[i + 1] * shift
        else:
            push_modes(impulse, motion.wall, chain.modes)
            shift_modes(shift, motion.wall, chain.modes)


@ieee
def peak(dt: float, g0: float, r0: float, g1: float, r1: float) -> float:
    """Largest overlap [m] in a step dt [s] of the cubic between the overlaps g0, g1 [m] with the
    rates r0, r1 [m/s]."""
    highest = larger(g0, g1)
    if r0 > 0.0 and r1 < 0.0:
        # the lesser root of the slope, written without the difference of its two terms
        r0 *= dt
        c2 = 3.0 * (g1 - g0) - 2.0 * r0 - r1 * dt
        c3 = 2.0 * (g0 - g1) + r0 + r1 * dt
        t = r0 / (math.sqrt(larger(c2 * c2 - 3.0 * c3 * r0, 0.0)) - c2)
        highest = larger(highest, g0 + t * (r0 + t * (c2 + t * c3)))
    return highest


@ieee
def yield_contacts(
    dt: float, motion: Motion, start: Motion, chain: ChainArrays, plastic: Plastic | None
) -> bool:
    """Deepen the craters of contacts that were pressed further than ever in the last step of dt
    [s], and book what that took as lost in the contacts. Says whether any was.

    The peak lies between the ends of a step: of the ends alone a crater would fall short by order 2
    of the step.
    """
    if plastic is None:
        return False
    deeper = False
    for i in range(chain.A.size):
        g0, r0 = overlap(i, start, chain.offset)
        g1, r1 = overlap(i, motion, chain.offset)
        top = peak(dt, g0, r0, g1, r1)
        if i == motion.x.size - 1:
            top = plastic_indentation(i, top, chain.A, chain.residual, plastic)
        if top > plastic.top[i]:
            lost = plastic_loss(plastic.limit[i], plastic.top[i], chain.A[i])[0]
            now, plastic.coefficient[i], plastic.crater[i] = plastic_loss(
                plastic.limit[i], top, chain.A[i]
            )
            plastic.top[i] = top
            motion.ledger[IN_CONTACTS] += now - lost
            deeper = True
    return deeper
