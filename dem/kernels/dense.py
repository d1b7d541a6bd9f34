"""A step between its ends: the polynomials that agree there with what is known.

Quintic in position, velocity and acceleration, and its derivative; cubic in value and slope
(E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, 2nd ed., sec.
II.6). In a smooth step of length h the derivative is off by h^5 x^(6)/13400
at the most, to leading order.
"""

from typing import NamedTuple

from beadwave.dem.kernels.arguments import Array
from beadwave.dem.kernels.compiled import fastmath_entry, fastmath_inline


class StepEnd(NamedTuple):
    """Position, velocity and acceleration at an end of a step."""

    x: float  # [m]
    v: float  # [m/s]
    a: float  # [m/s^2]


@fastmath_inline
def quintic(s: float, h: float, start: StepEnd, end: StepEnd) -> float:
    """Position [m] at the share s, 0 to 1, of a step of length h [s]. Written in s and 1 - s, so
    that nothing cancels near either end."""
    r = 1.0 - s
    cube, mirrored = s * s * s, r * r * r
    late = cube * (10.0 - s * (15.0 - 6.0 * s))
    moved = h * (
        start.v * s * mirrored * (1.0 + 3.0 * s) - end.v * r * cube * (1.0 + 3.0 * r)
    ) + 0.5 * h * h * (start.a * s * s * mirrored + end.a * r * r * cube)
    return start.x + late * (end.x - start.x) + moved


@fastmath_inline
def quintic_slope(s: float, h: float, start: StepEnd, end: StepEnd) -> float:
    """Velocity [m/s] at the share s of a step of length h [s], the derivative of `quintic`."""
    r = 1.0 - s
    late = 30.0 * s * s * r * r / h
    w0, w1 = r * r * (1.0 + s * (2.0 - 15.0 * s)), s * s * (1.0 + r * (2.0 - 15.0 * r))
    pushed = h * s * r * (start.a * r * (1.0 - 2.5 * s) - end.a * s * (1.0 - 2.5 * r))
    return late * (end.x - start.x) + w0 * start.v + w1 * end.v + pushed


@fastmath_inline
def cubic(s: float, h: float, u0: float, w0: float, u1: float, w1: float) -> float:
    """Value at the share s of a step of length h between values u with slopes w."""
    r = 1.0 - s
    return r * r * ((1.0 + 2.0 * s) * u0 + s * h * w0) + s * s * ((1.0 + 2.0 * r) * u1 - r * h * w1)


@fastmath_inline
def cubic_slope(s: float, h: float, u0: float, w0: float, u1: float, w1: float) -> float:
    """Slope of `cubic` there."""
    r = 1.0 - s
    return 6.0 * s * r * (u1 - u0) / h + r * (1.0 - 3.0 * s) * w0 + s * (1.0 - 3.0 * r) * w1


@fastmath_entry
def fill_slopes(x: Array, v: Array, a: Array, h: float, out: Array) -> None:
    """Velocities at n equal instants, into out (n, m), of k - 1 steps of h [s] that end at x, v, a
    (k, m)."""
    steps, samples = x.shape[0] - 1, out.shape[0] - 1
    for k in range(samples + 1):
        i = min(k * steps // samples, steps - 1)
        s = k * steps / samples - i
        for j in range(x.shape[1]):
            start = StepEnd(x[i, j], v[i, j], a[i, j])
            end = StepEnd(x[i + 1, j], v[i + 1, j], a[i + 1, j])
            out[k, j] = quintic_slope(s, h, start, end)


@fastmath_entry
def fill_values(values: Array, slopes: Array, out: Array) -> None:
    """Values at n equal instants, into out (n,), of k - 1 steps that end at values (k,) with slopes
    (k,) by the step."""
    steps, samples = values.size - 1, out.size - 1
    for k in range(samples + 1):
        i = min(k * steps // samples, steps - 1)
        s = k * steps / samples - i
        out[k] = cubic(s, 1.0, values[i], slopes[i], values[i + 1], slopes[i + 1])
