"""Damped Newton for the static state of a chain under steady forces and leaf springs.

    r_i(x) = f_{i-1} - f_i - k_i (x_i - a_i) + steady_i = 0,      K dx = r,   K tridiagonal

with contact forces f, leaf springs k to anchors a, and steady forces.
"""

import math
from typing import NamedTuple

from beadwave.dem.kernels.arguments import Array, ForceShape
from beadwave.dem.kernels.compiled import ieee, ieee_march
from beadwave.dem.kernels.laws import elastic_force, elastic_indentation, elastic_stiffness
from beadwave.dem.kernels.numbers import larger


class Bearing(NamedTuple):
    """Supports that hold n spheres at rest."""

    A: Array  # (n_contacts,) as `dem.elastic.ElasticLaw.A`
    stiffness: Array  # (n,) [N/m] of the leaf springs
    anchor: Array  # (n,) [m]
    steady: Array  # (n,) [N] forces towards the wall
    compliance: float  # [m/N] of the wall, behind the n-th contact
    shape: ForceShape | None = None  # of the contacts' force; None: Hertz


class NewtonRoom(NamedTuple):
    """Workspace of an iteration, zeros at the start; arrays made by compiled code take a quarter of
    a second to compile."""

    f: Array  # (n + 1,) [N] contact forces
    r: Array  # (n,) [N] net forces
    k: Array  # (n,) [N/m] stiffness of the contacts
    diagonal: Array  # (n,) [N/m] of the tangent
    change: Array  # (n,) [m] of the positions
    trial: Array  # (n,) [m] positions


@ieee
def static_residual(
    x: Array, bearing: Bearing, shape: ForceShape | None, f: Array, r: Array
) -> None:
    """Net force on every sphere at x (n,) [m] into r (n,), contact forces into f (n + 1,), all in
    N."""
    A, stiffness, anchor = bearing.A, bearing.stiffness, bearing.anchor
    n = x.size
    f[n] = 0.0
    for i in range(A.size):
        if i < n - 1:
            d = larger(x[i] - x[i + 1], 0.0)
        else:
            d = elastic_indentation(i, x[i], bearing.compliance, A, shape)
        f[i + 1] = elastic_force(i, d, A, shape)
    for i in range(n):
        r[i] = f[i] - f[i + 1] - stiffness[i] * (x[i] - anchor[i]) + bearing.steady[i]


@ieee
def static_slope(x: Array, A: Array, compliance: float, shape: ForceShape | None, k: Array) -> None:
    """Tangent stiffness [N/m] of every contact at x (n,) [m] into k (n,), with the compliance
    [m/N] of the wall in series with the last; A (n_contacts,)."""
    n = x.size
    for i in range(A.size):
        if i < n - 1:
            d = x[i] - x[i + 1]
            k[i] = elastic_stiffness(i, d, A, shape) if d > 0.0 else 0.0
        else:
            d = elastic_indentation(i, x[i], compliance, A, shape)
            tangent = elastic_stiffness(i, d, A, shape) if d > 0.0 else 0.0
            k[i] = tangent / (1.0 + compliance * tangent)


@ieee
def newton_step(
    stiffness: Array, k: Array, r: Array, floor: float, diagonal: Array, change: Array
) -> None:
    """Solution of the symmetric tridiagonal tangent system with leaf springs of the stiffness (n,)
    and contacts of the stiffness k (n,) [N/m] under the net force r (n,) [N], into change (n,) [m].

    `floor` [N/m] on the diagonal (n,) keeps it positive where all contacts of a sphere are open.
    """
    n = r.size
    for i in range(n):
        diagonal[i] = stiffness[i] + k[i] + (k[i - 1] if i > 0 else 0.0) + floor
        change[i] = r[i]
    for i in range(1, n):
        factor = k[i - 1] / diagonal[i - 1]
        diagonal[i] -= factor * k[i - 1]
        change[i] += factor * change[i - 1]
    change[n - 1] /= diagonal[n - 1]
    for i in range(n - 2, -1, -1):
        change[i] = (change[i] + k[i] * change[i + 1]) / diagonal[i]


@ieee
def dot(a: Array, b: Array) -> float:
    """sum_i a_i b_i of arrays (n,)."""
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total


@ieee
def add(x: Array, scale: float, change: Array, out: Array) -> None:
    """out = x + scale * change, (n,) each; an expression of arrays takes seconds to compile."""
    for i in range(x.size):
        out[i] = x[i] + scale * change[i]


@ieee_march
def rest(x: Array, bearing: Bearing, floor: float, n_iterations: int, room: NewtonRoom) -> float:
    """Damped Newton for the static state from x (n,) [m], in place, with the contact forces there
    into `room`; the norm [N] of the net forces that are left, out.

    `floor` [N/m] keeps the tangent regular while contacts are open; it fades with the net force.
    A step is halved until the potential energy, which is convex, no longer climbs at its end: the
    net force itself may have to grow on the way. Ends where the norm is 0, where no step, however
    short, leads down, where rounding keeps the norm from falling, or after n_iterations: whether
    what is left is small the caller has to judge.
    """
    f, r, k, diagonal, change, trial = room
    static_residual(x, bearing, bearing.shape, f, r)
    norm = math.sqrt(dot(r, r))
    start = norm
    stalled = False
    for _ in range(n_iterations):
        if norm == 0.0 or stalled:
            break

        # Newton's change, downhill in the potential energy, whose gradient is -r
        static_slope(x, bearing.A, bearing.compliance, bearing.shape, k)
        newton_step(bearing.stiffness, k, r, floor * (norm / start), diagonal, change)
        downhill = dot(r, change)

        # halved while the energy climbs at the step's end
        scale = 1.0
        better = False
        for _halving in range(40):
            add(x, scale, change, trial)
            static_residual(trial, bearing, bearing.shape, f, r)
            # the energy may rise at the step's end with 0.25 of its slope at the start
            better = dot(r, change) >= -0.25 * downhill
            if better:
                break
            scale *= 0.5
        if not better:
            break

        # on from there; a norm at rounding that no longer halves is as small as it gets
        trial_norm = math.sqrt(dot(r, r))
        stalled = norm < 1e-12 * start and trial_norm > 0.5 * norm
        add(trial, 0.0, change, x)
        norm = trial_norm
    static_residual(x, bearing, bearing.shape, f, r)
    return norm
