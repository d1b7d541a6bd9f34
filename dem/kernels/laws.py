"""Contact laws: force F of an overlap d, and what it takes with dampers, springs and yield.

    Hertz                F = A d^(3/2),  A = 4/3 E* sqrt(R*)                       `hertz_force`
    spring s in series   d + s A d^(3/2) = gap                               `hertz_indentation`
    elastic-plastic      Hertz, beyond the yield overlap a straight line         `plastic_force`
    wall with a dashpot  d(gap)/dt = -mobility F                           `dashpot_indentation`
    dampers              F + c d',  c = gamma or gamma F                       `damping_impulse`

A further damping law starts here: its number beside HUNT_CROSSLEY, its impulse in
`damping_impulse`. An elastic law has a force, an energy (0.4 A d^(5/2) of Hertz') and a stiffness
(1.5 A d^(1/2)), each of which stands in several kernels. CONTRIBUTING names the other places of
both. A of two bodies is `dem.spheres.hertz_coefficient`. K. L. Johnson, Contact Mechanics,
Cambridge 1985, chap. 4; C. Thornton, J. Appl. Mech. 64 (1997) 383; K. H. Hunt, F. R. E. Crossley,
J. Appl. Mech. 42 (1975) 440.
"""

import math

from dem.kernels.arguments import DASH, IN_WALL, Array, Damping, Motion, Plastic, U
from dem.kernels.compiled import fastmath, fastmath_entry, fastmath_inline, ieee_entry, ieee_inline
from dem.kernels.numbers import larger, smaller

NONE, LINEAR, LINEAR_CLIPPED, HUNT_CROSSLEY = range(4)
STOPPED = 1e4  # damping rate times step beyond which nothing of the motion is left to stop


@fastmath_inline
def hertz_force(d: float, A: float) -> float:
    """F = A d^(3/2) [N] of Hertz' law at the overlap d >= 0 [m]."""
    return A * d * math.sqrt(d)


@fastmath_entry
def hertz_indentation(gap: float, A: float, s: float) -> float:
    """delta of  delta + s A delta^(3/2) = gap: a Hertz contact and a spring s in series.

    Newton's method in y = sqrt(delta):  y^2 (1 + e y) = gap,  e = s A. NaN beyond the fold
    y = -2 / (3 e) of a negative s, where no force answers the gap.
    """
    if gap <= 0.0:
        return 0.0
    e = s * A
    y = math.sqrt(gap)
    if e > 0.0:
        y = smaller(y, (gap / e) ** (1.0 / 3.0))
    elif e < 0.0:
        top = -2.0 / (3.0 * e)
        if 3.0 * gap >= top * top:
            return math.nan
    if y == 0.0:  # the root of a gap below the smallest number
        return 0.0
    for _ in range(60):
        change = (gap - y * y * (1.0 + e * y)) / (y * (2.0 + 3.0 * e * y))
        y += change
        if e < 0.0:
            y = smaller(y, 0.999999 * top)  # Newton's step may leap over the fold
        if abs(change) <= 1e-15 * y:
            break
    return y * y


@fastmath
def wall_indentation(gap: float, A: float, residual: float | None) -> float:
    """Overlap at the wall, whose residual compliance may take some of the gap."""
    if residual is None:
        return larger(gap, 0.0)
    return hertz_indentation(gap, A, residual)


@fastmath
def plastic_force(i: int, d: float, A: Array, plastic: Plastic) -> float:
    """Thornton's elastic-plastic contact: Hertz up to its yield overlap, straight on beyond, back
    on the Hertz law of the flattened surface."""
    limit = plastic.limit[i]
    if d > plastic.top[i]:
        return hertz_force(limit, A[i]) * (1.0 + 1.5 * (d - limit) / limit)
    return hertz_force(larger(d - plastic.crater[i], 0.0), plastic.coefficient[i])


@fastmath
def plastic_indentation(gap: float, A: Array, residual: float | None, plastic: Plastic) -> float:
    """delta of  delta + s F(delta) = gap  at the last contact, by bisection."""
    if residual is None or gap <= 0.0:
        return larger(gap, 0.0)
    last = A.size - 1
    low, high = 0.0, gap
    if residual < 0.0:
        high = gap - residual * plastic_force(last, 2.0 * gap, A, plastic)
    for _ in range(100):
        d = 0.5 * (low + high)
        if d + residual * plastic_force(last, d, A, plastic) > gap:
            high = d
        else:
            low = d
        if high - low <= 4e-16 * gap:
            break
    return 0.5 * (low + high)


@ieee_entry
def plastic_loss(limit: float, top: float, A: float) -> tuple[float, float, float]:
    """Work lost for good once a contact has been pressed to the overlap `top`; also the coefficient
    of the flattened surface and its crater."""
    yielded = A * limit * math.sqrt(limit)
    beyond = (top - limit) / limit
    force = yielded * (1.0 + 1.5 * beyond)
    flat = yielded / force * ((2.0 * force + yielded) / (3.0 * yielded)) ** 1.5
    coefficient = A * math.sqrt(flat)
    elastic = (force / coefficient) ** (2.0 / 3.0)
    work = yielded * limit * (0.4 + beyond + 0.75 * beyond * beyond)
    return work - 0.4 * force * elastic, coefficient, top - elastic


@fastmath
def sphere_forces(x: Array, A: Array, f: Array, plastic: Plastic | None) -> None:
    """Elastic forces between neighbours into f[1:n]."""
    for i in range(x.size - 1):
        d = x[i] - x[i + 1]
        if plastic is None:
            f[i + 1] = hertz_force(d if d > 0.0 else 0.0, A[i])
        else:
            f[i + 1] = plastic_force(i, d, A, plastic)


# --- a wall that creeps ------------------------------------------------------------------------


@fastmath
def dashpot_indentation(
    d: float, dt: float, A: float, residual: float | None, mobility: float
) -> float:
    """Indentation after dt of creep  d(gap)/dt = -mobility A d^(3/2)  at a fixed sphere.

    With a spring s in series the creep is  -2 y^-1 + 3 s A ln y = const - mobility A t,
    y = sqrt(d), which keeps y > 0.
    """
    if d <= 0.0:
        return 0.0
    y = math.sqrt(d)
    if residual is None:
        y = y / (1.0 + 0.5 * mobility * A * y * dt)
        return y * y
    e = residual * A
    target = 2.0 / y - 3.0 * e * math.log(y) + mobility * A * dt
    z = 1.0 / y + 0.5 * mobility * A * dt / (1.0 + 1.5 * e * y)
    for _ in range(60):
        change = (target - 2.0 * z - 3.0 * e * math.log(z)) / (2.0 + 3.0 * e / z)
        z = larger(z + change, 0.1 * z)  # the logarithm ends at 0
        if abs(change) <= 1e-15 * z:
            break
    return 1.0 / (z * z)


@fastmath
def creep(
    d: float, dt: float, A: float, motion: Motion, residual: float | None, mobility: float
) -> float:
    """Move the dashpot wall for dt; its mean force."""
    force = hertz_force(d, A)
    d_new = dashpot_indentation(d, dt, A, residual, mobility)
    force_new = hertz_force(d_new, A)
    moved = d - d_new
    motion.ledger[IN_WALL] += 0.4 * (force * d - force_new * d_new)
    if residual is not None:
        moved += residual * (force - force_new)
        motion.ledger[IN_WALL] += 0.5 * residual * (force * force - force_new * force_new)
    motion.wall[DASH] += moved
    return moved / (mobility * dt)


@fastmath
def wall_force(
    dt: float, motion: Motion, A: Array, offset: float, residual: float | None,
    mobility: float | None, plastic: Plastic | None,
) -> float:  # fmt: skip
    """Mean force at the wall over a kick of length dt; moves the dashpot wall."""
    last = motion.x.size - 1
    gap = motion.x[last] - motion.wall[U] - motion.wall[DASH] - offset
    if plastic is not None:
        d = plastic_indentation(gap, A, residual, plastic)
        return plastic_force(last, d, A, plastic)
    d = wall_indentation(gap, A[last], residual)
    if mobility is not None:
        return creep(d, dt, A[last], motion, residual, mobility)
    return hertz_force(d, A[last])


# --- damping -----------------------------------------------------------------------------------


@fastmath_inline
def damping_impulse(
    w: float, dt: float, force: float, c: float, inverse_mass: float, clipped: bool
) -> float:
    """Impulse of a damper c on two bodies that approach at w, exact at fixed positions:
    w' = -c w / m  gives  m w (1 - exp(-c dt / m)),  1/m = 1/m_1 + 1/m_2.

    Clipped, the damper never outweighs the elastic force F, so the contact never pulls: where it
    would, it takes F until c w = -F.
    """
    clipped_impulse = 0.0
    if clipped and c * w < -force:
        if dt < 0.0:
            return -force * dt
        until = (-force / c - w) / (force * inverse_mass) if force > 0.0 else math.inf
        if until >= dt:
            return -force * dt
        clipped_impulse = -force * until
        w = -force / c
        dt -= until
    z = c * inverse_mass * dt
    if abs(z) < 0.02:  # expm1(-z) / z, where c may be too small to divide by
        share = 1.0 / 24.0 - z * (1.0 / 120.0 - z * (1.0 / 720.0 - z * (1.0 / 5040.0)))
        return clipped_impulse + c * w * dt * (1.0 - z * (0.5 - z * (1.0 / 6.0 - z * share)))
    return clipped_impulse - w / inverse_mass * math.expm1(-z)


@ieee_inline
def contact_stiffness(i: int, force: float, A: Array, plastic: Plastic | None) -> float:
    """k = dF/d delta of contact i under a force: 3/2 (A^2 F)^(1/3) of Hertz' law."""
    if plastic is None:
        return 1.5 * (A[i] * A[i] * force) ** (1.0 / 3.0)
    limit = plastic.limit[i]
    if force > A[i] * math.sqrt(limit) * (1.5 * plastic.top[i] - 0.5 * limit):
        return 1.5 * A[i] * math.sqrt(limit)
    return 1.5 * (plastic.coefficient[i] * plastic.coefficient[i] * force) ** (1.0 / 3.0)


@ieee_inline
def spring_share(stiffness: float, residual: float) -> tuple[float, float]:
    """What a spring in series leaves of a damper in the contact: the contact gives way by
    1 / (1 + s k) of the gap, and as much of what is added to its force arrives behind the spring;
    also by how much that falls, relatively, with the force."""
    softness = residual * stiffness
    return 1.0 / (1.0 + softness) ** 2, (2.0 / 3.0) * softness / (1.0 + softness)


@fastmath_inline
def damper(
    i: int, last: bool, force: float, A: Array, residual: float | None, damping: Damping,
    plastic: Plastic | None,
) -> float:  # fmt: skip
    """Coefficient c of the damping force c (approach velocity) of contact i."""
    if force <= 0.0:
        return 0.0
    c = damping.gamma[i] * force if damping.law == HUNT_CROSSLEY else damping.gamma[i]
    if residual is not None and last:
        c *= spring_share(contact_stiffness(i, force, A, plastic), residual)[0]
    return c
