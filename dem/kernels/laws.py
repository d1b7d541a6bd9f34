"""Contact laws: force F of an overlap d, and what it takes with dampers, springs and yield.

    shape of the force   F = A phi(d),  Hertz' phi = d^(3/2), A = 4/3 E* sqrt(R*)    `elastic_force`
    its stiffness        k = A phi'(d)                                           `elastic_stiffness`
    its energy           U = A (integral of phi from 0 to d)                         `stored_energy`
    its mean in a move   (U(d1) - U(d0)) / (d1 - d0)                                  `mean_elastic`
    spring s in series   d + s F(d) = gap                                     `elastic_indentation`
    elastic-plastic      Hertz, beyond the yield overlap a straight line         `plastic_force`
    wall with a dashpot  d(gap)/dt = -mobility F, of Hertz' law            `dashpot_indentation`
    dampers              F + c d',  c = gamma or gamma F                       `damping_impulse`

Every kernel takes the law from here. An argument `shape` that is None is Hertz' law, and the others
are compiled out. A further elastic law is a row of `ELASTIC_LAWS` and a branch in each function of
the section "shapes" below; a further damping law is a row of `DAMPING_LAWS` and, where c is neither
gamma nor gamma F, a branch in `damper_coefficient`. A of two bodies is
`dem.spheres.hertz_coefficient`. K. L. Johnson, Contact Mechanics, Cambridge 1985, chap. 4; C.
Thornton, J. Appl. Mech. 64 (1997) 383; K. H. Hunt, F. R. E. Crossley, J. Appl. Mech. 42 (1975) 440.
"""

import math
from typing import NamedTuple

import numpy as np

from beadwave.dem.kernels.arguments import (
    DASH,
    IN_WALL,
    Array,
    Damping,
    ForceShape,
    ForceTable,
    Motion,
    Plastic,
    U,
)
from beadwave.dem.kernels.compiled import (
    fastmath,
    fastmath_entry,
    fastmath_inline,
    ieee_entry,
    ieee_inline,
)
from beadwave.dem.kernels.numbers import larger, smaller

NONE, LINEAR, LINEAR_CLIPPED, HUNT_CROSSLEY = range(4)


class DampingLaw(NamedTuple):
    """Properties of a damping law that estimates and the choice of a scheme use."""

    number: int
    grows: bool  # c = gamma F: the force does not jump when the contact closes
    clipped: bool  # the contact never pulls


DAMPING_LAWS = {
    "none": DampingLaw(NONE, grows=True, clipped=False),
    "linear": DampingLaw(LINEAR, grows=False, clipped=False),
    "linear-clipped": DampingLaw(LINEAR_CLIPPED, grows=False, clipped=True),
    "hunt-crossley": DampingLaw(HUNT_CROSSLEY, grows=True, clipped=True),
}
# bits by number, as kernels ask; a contact without damping never pulls either
GROWS = sum(law.grows << law.number for law in DAMPING_LAWS.values())
NEVER_PULLS = sum((law.clipped or not law.number) << law.number for law in DAMPING_LAWS.values())


class ShapeParameter(NamedTuple):
    """A number of every contact, in addition to A, that the shape of its force depends on."""

    name: str  # a field of `dem.Chain` and, in a scene, a key of [contact]
    low: float  # what it may be
    high: float
    scale: float  # a change that counts as large in a fit; not varied systematically


class ElasticShape(NamedTuple):
    """Properties of a law whose force is not Hertz', for all but the formulas."""

    number: int
    parameters: tuple[ShapeParameter, ...]
    on_arrays: bool  # the formulas, uncompiled, take arrays as well as numbers


POWER, TABLE = range(2)
ELASTIC_LAWS = {
    # below n = 1 a contact is infinitely stiff at first touch
    "power": ElasticShape(POWER, (ShapeParameter("exponent", 1.0, 4.0, 0.02),), on_arrays=True),
    "table": ElasticShape(TABLE, (), on_arrays=False),
}
SHAPE_PARAMETERS = {p.name: p for law in ELASTIC_LAWS.values() for p in law.parameters}
CLOSE = 1e-4  # relative change of overlap below which a difference is a derivative to 1e-9
STOPPED = 1e4  # damping rate times step beyond which nothing of the motion is left to stop


@fastmath_inline
def hertz_force(d: float, A: float) -> float:
    """F = A d^(3/2) [N] of Hertz' law at the overlap d >= 0 [m]."""
    return A * d * math.sqrt(d)


@fastmath_entry
def hertz_indentation(gap: float, A: float, s: float) -> float:
    """delta of  delta + s A delta^(3/2) = gap: a Hertz contact and a spring s in series.

    Newton's method in y = sqrt(delta):  y^2 (1 + e y) = gap,  e = s A; gap in m, A in N/m^1.5, s in
    m/N. NaN beyond the fold  y = -2 / (3 e)  of a negative s, where no force answers the gap.
    """
    if gap <= 0.0:
        return 0.0
    e = s * A

    # e > 0: both bounds lie above the root of a convex function, from where Newton's steps descend
    # to it; e < 0: sqrt(gap) lies below the root, and the fold bounds it
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


# --- shapes: F = A phi(d), of Hertz' law where `shape` is None -----------------------------------


@fastmath_inline
def elastic_force(i: int, d: float, A: Array, shape: ForceShape | None) -> float:
    """F = A_i phi(d) [N] of contact i at the overlap d >= 0 [m]; A (n_contacts,), in N/m^1.5 of
    Hertz' law, else in what makes A phi a force."""
    if shape is None:
        return hertz_force(d, A[i])
    return A[i] * shape_force(i, d, shape)


@fastmath_inline
def elastic_stiffness(i: int, d: float, A: Array, shape: ForceShape | None) -> float:
    """k = A_i phi'(d) [N/m] of contact i at the overlap d >= 0 [m]; A (n_contacts,)."""
    if shape is None:
        return 1.5 * A[i] * math.sqrt(d)
    return A[i] * shape_slope(i, d, shape)


@fastmath_inline
def stored_energy(i: int, d: float, force: float, A: Array, shape: ForceShape | None) -> float:
    """U [J] of contact i at the overlap d >= 0 [m], where its force [N] is known: 2/5 F d of Hertz'
    law, else A_i (integral of phi from 0 to d); A (n_contacts,)."""
    if shape is None:
        return 0.4 * force * d
    return A[i] * shape_energy(i, d, shape)


@fastmath_inline
def pressed_overlap(i: int, force: float, A: Array, shape: ForceShape | None) -> float:
    """Overlap [m] of contact i under a force >= 0 [N], the inverse of `elastic_force`;
    A (n_contacts,)."""
    if shape is None:
        return (force / A[i]) ** (2.0 / 3.0)
    return shape_overlap(i, force / A[i], shape)


@fastmath
def shape_force(i: int, d: float, shape: ForceShape) -> float:
    """phi(d): d^n, or the table's."""
    if shape.law == POWER:
        return d ** shape.parameters[0, i]
    table = shape.table
    j = segment(d, table.overlap)
    return table.force[j] + risen(d - table.overlap[j], j, table)


@fastmath
def shape_slope(i: int, d: float, shape: ForceShape) -> float:
    """phi'(d)."""
    if shape.law == POWER:
        n = shape.parameters[0, i]
        return n * d ** (n - 1.0)
    table = shape.table
    j = segment(d, table.overlap)
    t = d - table.overlap[j]
    return table.slope[j] + t * (2.0 * table.square[j] + 3.0 * table.cube[j] * t)


@fastmath
def shape_bend(i: int, d: float, shape: ForceShape) -> float:
    """phi''(d); 0 at d = 0, where that of an exponent below 2 is infinite."""
    if shape.law == POWER:
        n = shape.parameters[0, i]
        return n * (n - 1.0) * d ** (n - 2.0) if d > 0.0 else 0.0
    table = shape.table
    j = segment(d, table.overlap)
    return 2.0 * table.square[j] + 6.0 * table.cube[j] * (d - table.overlap[j])


@fastmath
def shape_by_parameter(j: int, i: int, d: float, shape: ForceShape) -> tuple[float, float]:
    """Derivatives of phi(d) and of phi'(d) by parameter j of the law, at d > 0; of d^n by n,
    d^n ln d  and  d^(n-1) (1 + n ln d). A second law with parameters needs a branch here."""
    n, log = shape.parameters[0, i], math.log(d)
    return d**n * log, d ** (n - 1.0) * (1.0 + n * log)


@fastmath
def shape_energy(i: int, d: float, shape: ForceShape) -> float:
    """Integral of phi from 0 to d, exact."""
    if shape.law == POWER:
        n = shape.parameters[0, i]
        return d ** (n + 1.0) / (n + 1.0)
    table = shape.table
    j = segment(d, table.overlap)
    t = d - table.overlap[j]
    rise = t * (table.slope[j] / 2.0 + t * (table.square[j] / 3.0 + table.cube[j] / 4.0 * t))
    return table.energy[j] + t * (table.force[j] + rise)


@fastmath
def shape_overlap(i: int, value: float, shape: ForceShape) -> float:
    """d of phi(d) = value >= 0."""
    if shape.law == POWER:
        return value ** (1.0 / shape.parameters[0, i])
    table = shape.table
    j = segment(value, table.force)
    above = value - table.force[j]
    if j == table.overlap.size - 1:
        return table.overlap[j] + above / table.slope[j]

    # Newton's method within a bracket that is halved where a step would leave it
    low, high = 0.0, table.overlap[j + 1] - table.overlap[j]
    t = high * above / (table.force[j + 1] - table.force[j])
    for _ in range(100):
        missing = risen(t, j, table) - above
        if missing > 0.0:
            high = t
        else:
            low = t
        slope = table.slope[j] + t * (2.0 * table.square[j] + 3.0 * table.cube[j] * t)
        step = -missing / slope if slope > 0.0 else 2.0 * high
        old = t
        t += step
        if not low <= t <= high:
            t = 0.5 * (low + high)
        if abs(t - old) <= 1e-15 * high:
            break
    return table.overlap[j] + t


def shape_overlap_of_energy(i: int, energy: float, shape: ForceShape) -> float:
    """d at which the integral of phi reaches an energy >= 0, and not below it; not compiled."""
    if shape.law == POWER:
        power = shape.parameters[0, i] + 1.0
        return (power * energy) ** (1.0 / power)

    # the energy grows with the overlap: a bracket, then halved
    low, high = 0.0, shape.table.overlap[-1]
    while shape_energy.py_func(i, high, shape) < energy:
        high *= 2.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        if shape_energy.py_func(i, middle, shape) < energy:
            low = middle
        else:
            high = middle
    return high


def shape_fold(i: int, steepest: float, shape: ForceShape) -> float:
    """Least d at which phi' reaches a slope > 0, inf where none does; not compiled."""
    if shape.law == POWER:
        n = shape.parameters[0, i]
        with np.errstate(divide="ignore", over="ignore"):
            return (steepest / n) ** (1.0 / (n - 1.0))

    # the slope b + 2 c x + 3 d x^2 behind a knot reaches the steepest at the lesser root x > 0,
    # written without the difference of its two terms; behind the last knot it is constant
    knots, b, c, d = (shape.table.overlap, *shape.table[2:5])
    missing = steepest - b
    with np.errstate(divide="ignore", invalid="ignore"):
        x = missing / (c + np.sqrt(c**2 + 3.0 * d * missing))
    x = np.where(missing <= 0.0, 0.0, x)
    reached = (x >= 0.0) & (x <= np.append(np.diff(knots), 0.0))
    return np.where(reached, knots + x, np.inf).min()


def opening(shape: ForceShape | None) -> float:
    """Power a with which the force of a contact sets in, F ~ d^a: the smallest of all contacts."""
    if shape is None:
        return 1.5
    return float(np.min(shape.parameters[0], initial=np.inf)) if shape.law == POWER else 1.0


@fastmath
def segment(value: float, knots: Array) -> int:
    """Index of the last of the knots (m,), which ascend, that is not above the value; 0 below all
    of them. By bisection."""
    low, high = 0, knots.size
    while high - low > 1:
        middle = (low + high) // 2
        if knots[middle] <= value:
            low = middle
        else:
            high = middle
    return low


@fastmath_inline
def risen(t: float, j: int, table: ForceTable) -> float:
    """Rise of phi at t behind the table's knot j."""
    return t * (table.slope[j] + t * (table.square[j] + table.cube[j] * t))


@ieee_inline
def mean_elastic(
    i: int, d0: float, d1: float, A: Array, shape: ForceShape | None
) -> tuple[float, float]:
    """Mean force [N] of contact i between the overlaps d0 and d1 [m], which are open below 0:
    (U(d1) - U(d0)) / (d1 - d0) without the cancellation of that difference; and its slope in d1
    [N/m]. A (n_contacts,)."""
    if shape is None:
        return mean_hertz(d0, d1, A[i])
    c0, c1 = max(d0, 0.0), max(d1, 0.0)
    if c0 == 0.0 and c1 == 0.0:
        return 0.0, 0.0
    mean = A[i] * mean_shape(i, c0, c1, shape)

    # the slope of a mean over a short move is k/2; the quotient below would be rounding there
    if abs(c1 - c0) < CLOSE * max(c0, c1):
        return mean, 0.5 * elastic_stiffness(i, 0.5 * (c0 + c1), A, shape)

    # over the part of the move in which the contact is open the force is 0
    mean *= (c1 - c0) / (d1 - d0)
    return mean, (elastic_force(i, c1, A, shape) - mean) / (d1 - d0)


@ieee_inline
def mean_shape(i: int, d0: float, d1: float, shape: ForceShape) -> float:
    """Mean of phi between two overlaps that are not both 0.

    Of d^n, with r = d1/d0 <= 1 or its inverse,  d^n (1 - r^(n+1)) / ((n+1) (1 - r)).
    """
    low, high = min(d0, d1), max(d0, d1)
    if shape.law == POWER:
        n = shape.parameters[0, i]
        gap = (high - low) / high
        if gap == 0.0:
            return high**n
        lost = -math.expm1((n + 1.0) * math.log1p(-gap)) if low > 0.0 else 1.0
        return high**n * lost / ((n + 1.0) * gap)
    if high == low:
        return shape_force(i, high, shape)

    # Gauss' rule of two points is exact on each cubic
    table, total = shape.table, 0.0
    j, last = segment(low, table.overlap), segment(high, table.overlap)
    start = low
    while j < last:
        total += gauss(start - table.overlap[j], table.overlap[j + 1] - table.overlap[j], j, table)
        j += 1
        start = table.overlap[j]
    total += gauss(start - table.overlap[j], high - table.overlap[j], j, table)
    return total / (high - low)


@ieee_inline
def gauss(t0: float, t1: float, j: int, table: ForceTable) -> float:
    """Integral of phi between t0 and t1 behind the table's knot j, by Gauss' rule of two points,
    which lie 1/sqrt(12) of the length from the middle."""
    middle, reach = 0.5 * (t0 + t1), (t1 - t0) / math.sqrt(12.0)
    rise = risen(middle - reach, j, table) + risen(middle + reach, j, table)
    return (t1 - t0) * (table.force[j] + 0.5 * rise)


@ieee_inline
def mean_stiffness(i: int, d0: float, d1: float, A: Array, shape: ForceShape | None) -> float:
    """(F(d1) - F(d0)) / (d1 - d0) [N/m] of contact i between two overlaps >= 0 [m] that are not
    both 0, without the cancellation of the difference for close ones; A (n_contacts,)."""
    if shape is None:
        # with the roots y, z of the overlaps, (z^3 - y^3) / (z^2 - y^2); over the larger root, so
        # that powers of tiny overlaps do not underflow
        y, z = math.sqrt(d0), math.sqrt(d1)
        top = max(y, z)
        y, z = y / top, z / top
        return A[i] * top * (z * z + z * y + y * y) / (y + z)
    if abs(d1 - d0) < CLOSE * max(d0, d1):
        return elastic_stiffness(i, 0.5 * (d0 + d1), A, shape)
    return (elastic_force(i, d1, A, shape) - elastic_force(i, d0, A, shape)) / (d1 - d0)


@ieee_inline
def mean_hertz(d0: float, d1: float, A: float) -> tuple[float, float]:
    """`mean_elastic` of a Hertz contact: mean force [N] between the overlaps d0 and d1 [m], and its
    slope in d1 [N/m]."""
    if d0 > 0.0 and d1 > 0.0:
        # with the roots y, z of the overlaps, 2/5 A (z^5 - y^5) / (z^2 - y^2), in which z - y
        # cancels; over the larger root, so that powers of tiny overlaps do not underflow
        top = math.sqrt(max(d0, d1))
        y, z = math.sqrt(d0) / top, math.sqrt(d1) / top
        mean = 0.4 * A * top**3 * (z**4 + z**3 * y + z * z * y * y + z * y**3 + y**4) / (y + z)
        slope = 0.2 * A * top * (3.0 * z**3 + 6.0 * z * z * y + 4.0 * z * y * y + 2.0 * y**3)
        slope /= (y + z) ** 2
        return mean, slope
    if d1 > 0.0:
        force = hertz_force(d1, A)
        mean = 0.4 * force * d1 / (d1 - d0)
        return mean, (force - mean) / (d1 - d0)
    if d0 > 0.0:
        mean = 0.4 * hertz_force(d0, A) * d0 / (d0 - d1)
        return mean, mean / (d0 - d1)
    return 0.0, 0.0


@fastmath
def elastic_indentation(i: int, gap: float, s: float, A: Array, shape: ForceShape | None) -> float:
    """d [m] of  d + s F(d) = gap: contact i and a spring of the compliance s [m/N] in series, under
    the approach `gap` [m] of both; A (n_contacts,).

    Newton's method within a bracket that is halved where a step would leave it. NaN where no force
    answers the gap, beyond the fold  1 + s k = 0  of a negative s.
    """
    if shape is None:
        return hertz_indentation(gap, A[i], s)
    if gap <= 0.0:
        return 0.0
    # s > 0: the root lies between 0 and the gap. s < 0: beyond the gap, where Newton's steps on a
    # convex force grow towards it and none is left where the stiffness reaches -1/s
    d, low, high = gap, 0.0, gap if s >= 0.0 else math.inf
    for _ in range(200):
        missing = gap - d - s * elastic_force(i, d, A, shape)
        if missing < 0.0:
            high = smaller(high, d)
        else:
            low = larger(low, d)
        slope = 1.0 + s * elastic_stiffness(i, d, A, shape)
        if slope <= 0.0:
            return math.nan
        change = missing / slope
        if not low <= d + change <= high:
            change = 0.5 * (low + high) - d
        d += change
        if abs(change) <= 1e-15 * d:
            return d
    return d if s >= 0.0 else math.nan


@fastmath
def wall_indentation(
    i: int, gap: float, A: Array, residual: float | None, shape: ForceShape | None
) -> float:
    """Overlap [m] of contact i at the wall, whose residual compliance [m/N] takes its part of the
    gap [m]; A (n_contacts,). NaN as of `elastic_indentation`."""
    if residual is None:
        return larger(gap, 0.0)
    return elastic_indentation(i, gap, residual, A, shape)


# --- yield ---------------------------------------------------------------------------------------


@fastmath
def plastic_force(i: int, d: float, A: Array, plastic: Plastic) -> float:
    """Force [N] of Thornton's elastic-plastic contact i at the overlap d [m]; A (n_contacts,).

    Hertz up to the yield overlap, beyond it straight on with the stiffness that is reached there,
    and back on the Hertz law of the flattened surface, which leaves a crater. Before it yields a
    contact has top = limit, no crater and the coefficient A, so that the second branch is Hertz'.
    """
    limit = plastic.limit[i]
    if d > plastic.top[i]:
        return hertz_force(limit, A[i]) * (1.0 + 1.5 * (d - limit) / limit)
    return hertz_force(larger(d - plastic.crater[i], 0.0), plastic.coefficient[i])


@fastmath
def plastic_indentation(
    i: int, gap: float, A: Array, residual: float | None, plastic: Plastic
) -> float:
    """delta [m] of  delta + s F(delta) = gap [m]  at contact i, with a spring of the compliance s
    `residual` [m/N] in series; A (n_contacts,).

    By bisection; of a negative s in closed form beyond the largest overlap so far. NaN where no
    force answers the gap, beyond the fold  1 + s k = 0  of a negative s. The flattened surface is
    stiffer than the first one: a contact that has yielded may reach the fold on its way back, and
    every gap up to there is NaN then.
    """
    if residual is None or gap <= 0.0:
        return larger(gap, 0.0)
    low, high = 0.0, gap

    # s < 0: the overlap is more than the gap, which grows with it up to the fold of the Hertz law
    # or up to the top, and along the straight line behind that
    if residual < 0.0:
        top = plastic.top[i]
        reached = top + residual * plastic_force(i, top, A, plastic)
        line = 1.0 + 1.5 * residual * A[i] * math.sqrt(plastic.limit[i])
        if gap > reached and line > 0.0:
            return top + (gap - reached) / line
        crater = plastic.crater[i]
        root = -2.0 / (3.0 * residual * plastic.coefficient[i])
        high = smaller(crater + root * root, top)
        if high + residual * plastic_force(i, high, A, plastic) < gap:
            return math.nan
        # the way back from the top would leap to before the fold, and energy would be lost in it
        if high < top and crater > 0.0:
            return math.nan

    for _ in range(100):
        d = 0.5 * (low + high)
        if d + residual * plastic_force(i, d, A, plastic) > gap:
            high = d
        else:
            low = d
        if high - low <= 4e-16 * larger(gap, high):  # s < 0: the overlap may be many times the gap
            break
    return 0.5 * (low + high)


@ieee_entry
def plastic_loss(limit: float, top: float, A: float) -> tuple[float, float, float]:
    """Work [J] lost for good once a contact has been pressed to the overlap `top` [m] beyond the
    yield overlap `limit` [m]; also the coefficient of the flattened surface [N/m^1.5] and its
    crater [m].

    The flattened surface has the radius R F_y / F ((2 F + F_y) / (3 F_y))^(3/2) with the yield
    force F_y and the largest force F (C. Thornton, J. Appl. Mech. 64 (1997) 383).
    """
    yielded = A * limit * math.sqrt(limit)
    beyond = (top - limit) / limit
    force = yielded * (1.0 + 1.5 * beyond)

    # back along the flattened surface's Hertz law from the same force: the crater is left over
    flat = yielded / force * ((2.0 * force + yielded) / (3.0 * yielded)) ** 1.5
    coefficient = A * math.sqrt(flat)
    elastic = (force / coefficient) ** (2.0 / 3.0)

    # work of the way in less that of the way out
    work = yielded * limit * (0.4 + beyond + 0.75 * beyond * beyond)
    return work - 0.4 * force * elastic, coefficient, top - elastic


@fastmath
def sphere_forces(
    x: Array, A: Array, f: Array, shape: ForceShape | None, plastic: Plastic | None
) -> None:
    """Elastic forces [N] between neighbours at x (n,) [m] into f[1:n], f (n + 1,); that at the wall
    is `wall_force`. A (n_contacts,)."""
    for i in range(x.size - 1):
        d = x[i] - x[i + 1]
        if plastic is None:
            f[i + 1] = elastic_force(i, d if d > 0.0 else 0.0, A, shape)
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

    # Newton's method in z = 1/y, in which the creep is almost a straight line in time
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
    """Move the dashpot wall for dt [s] from the overlap d [m]; its mean force [N], the way over
    mobility and time. What contact and spring lose is what the dashpot takes: the sphere rests.
    """
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
    dt: float, motion: Motion, A: Array, offset: float, shape: ForceShape | None,
    residual: float | None, mobility: float | None, plastic: Plastic | None,
) -> float:  # fmt: skip
    """Mean force [N] at the wall over a kick of length dt [s]; moves the dashpot wall.

    A (n_contacts,), offset [m] of the wall at rest, residual [m/N], mobility [m/(N s)]. NaN as of
    `elastic_indentation`. Yield and a dashpot are not combined.
    """
    last = motion.x.size - 1
    gap = motion.x[last] - motion.wall[U] - motion.wall[DASH] - offset
    if plastic is not None:
        d = plastic_indentation(last, gap, A, residual, plastic)
        return plastic_force(last, d, A, plastic)
    d = wall_indentation(last, gap, A, residual, shape)
    if mobility is not None:
        return creep(d, dt, A[last], motion, residual, mobility)
    return elastic_force(last, d, A, shape)


# --- damping -----------------------------------------------------------------------------------


@ieee_inline
def grows(law: int) -> bool:
    """Is the damper's coefficient gamma F, so that it grows with the force?"""
    return (GROWS >> law) & 1 == 1


@ieee_inline
def never_pulls(law: int) -> bool:
    """Is a damper that outweighs the elastic force cut, so that the contact never pulls?"""
    return (NEVER_PULLS >> law) & 1 == 1


@ieee_inline
def damper_coefficient(gamma: float, force: float, law: int) -> float:
    """c of the damping force c d' in a closed contact with the elastic force F: gamma F of Hunt and
    Crossley's law, else gamma."""
    return gamma * force if grows(law) else gamma


@fastmath_inline
def damping_impulse(
    w: float, dt: float, force: float, c: float, inverse_mass: float, clipped: bool
) -> float:
    """Impulse of a damper c on two bodies that approach at w, exact at fixed positions:
    w' = -c w / m  gives  m w (1 - exp(-c dt / m)),  1/m = 1/m_1 + 1/m_2.

    Clipped, the damper never outweighs the elastic force F, so the contact never pulls: where it
    would, it takes F until c w = -F. w in m/s, dt in s, force in N, c in N s/m; the impulse in N s.
    """
    clipped_impulse = 0.0
    if clipped and c * w < -force:
        if dt < 0.0:  # a composed scheme's step back in time, in which w only grows more negative
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
def contact_stiffness(
    i: int, force: float, A: Array, shape: ForceShape | None, plastic: Plastic | None
) -> float:
    """k = dF/d delta [N/m] of contact i under a force [N]: 3/2 (A^2 F)^(1/3) of Hertz' law, and of
    Thornton's the straight line's while the force is above that where unloading began;
    A (n_contacts,)."""
    if shape is not None:
        return elastic_stiffness(i, pressed_overlap(i, force, A, shape), A, shape)
    if plastic is None:
        return 1.5 * (A[i] * A[i] * force) ** (1.0 / 3.0)
    limit = plastic.limit[i]
    if force > A[i] * math.sqrt(limit) * (1.5 * plastic.top[i] - 0.5 * limit):
        return 1.5 * A[i] * math.sqrt(limit)
    return 1.5 * (plastic.coefficient[i] * plastic.coefficient[i] * force) ** (1.0 / 3.0)


@ieee_inline
def spring_share(stiffness: float, residual: float) -> tuple[float, float]:
    """Share 1 / (1 + s k)^2 that a spring in series leaves of a damper in the contact: the contact
    gives way by 1 / (1 + s k) of the gap, and as much of what is added to its force arrives behind
    the spring. Also by what power of the force that share falls, -d(ln share)/d(ln F), of Hertz'
    law, where k grows as F^(1/3)."""
    softness = residual * stiffness
    return 1.0 / (1.0 + softness) ** 2, (2.0 / 3.0) * softness / (1.0 + softness)


@fastmath_inline
def damper(
    i: int, last: bool, force: float, A: Array, shape: ForceShape | None, residual: float | None,
    damping: Damping, plastic: Plastic | None,
) -> float:  # fmt: skip
    """Coefficient c [N s/m] of the damping force c (approach velocity) of contact i under the
    elastic force [N]: 0 of an open contact, less of the last one where a spring is in series;
    A (n_contacts,)."""
    if force <= 0.0:
        return 0.0
    c = damper_coefficient(damping.gamma[i], force, damping.law)
    if residual is not None and last:
        c *= spring_share(contact_stiffness(i, force, A, shape, plastic), residual)[0]
    return c
