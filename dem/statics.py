"""The static state under preload and leaf springs: where spheres and wall start from.

Compiled functions of this file call none of another one, see `dem.kernels`; the law of a contact
and a spring in series is a copy of the one there.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from dem.chain import static_compliance, validate

FAST = {"contract", "reassoc", "nsz", "arcp"}
REGULAR = 1e-8  # of a closed contact's stiffness, in the tangent
BEYOND = 0.25  # of the first slope of the energy that may be met beyond its least

exact = njit(cache=True, error_model="numpy", _nrt=False)
quick = njit(cache=True, error_model="numpy", _nrt=False, fastmath=FAST)


class NoEquilibrium(ValueError):
    """No static state carries the preload or the leaf springs."""


class Equilibrium(NamedTuple):
    """Static state: sphere positions, contact forces, displacement of each wall mode."""

    x: np.ndarray  # (n,)
    force: np.ndarray  # (n_contacts,)
    q: np.ndarray  # (n_modes,)


@quick
def hertz_indentation(gap, A, s):
    """delta of  delta + s A delta^(3/2) = gap: a Hertz contact and a spring s in series.

    NaN beyond the fold of a negative s, where no force answers the gap.
    """
    if gap <= 0.0:
        return 0.0
    e = s * A
    y = math.sqrt(gap)
    if e > 0.0:
        y = min(y, (gap / e) ** (1.0 / 3.0))
    elif e < 0.0:
        top = -2.0 / (3.0 * e)
        if 3.0 * gap >= top * top:
            return math.nan
    if y == 0.0:
        return 0.0
    for _ in range(60):
        change = (gap - y * y * (1.0 + e * y)) / (y * (2.0 + 3.0 * e * y))
        y += change
        if e < 0.0:
            y = min(y, 0.999999 * top)
        if abs(change) <= 1e-15 * y:
            break
    return y * y


@exact
def static_residual(x, A, stiffness, anchor, preload, compliance, f, r):
    """Net force on every sphere at rest into r, contact forces into f."""
    n = x.size
    f[n] = 0.0
    for i in range(A.size):
        if i < n - 1:
            d = max(x[i] - x[i + 1], 0.0)
        else:
            d = hertz_indentation(x[i], A[i], compliance)
        f[i + 1] = A[i] * d * math.sqrt(d)
    for i in range(n):
        r[i] = f[i] - f[i + 1] - stiffness[i] * (x[i] - anchor[i])
    r[n - 1] += preload


@exact
def static_slope(x, A, compliance, k):
    """Tangent stiffness of every contact into k."""
    n = x.size
    for i in range(A.size):
        if i < n - 1:
            k[i] = 1.5 * A[i] * math.sqrt(max(x[i] - x[i + 1], 0.0))
        else:
            hertz = 1.5 * A[i] * math.sqrt(hertz_indentation(x[i], A[i], compliance))
            k[i] = hertz / (1.0 + compliance * hertz)


@njit(cache=True, error_model="numpy")
def thomas(lower, diagonal, rhs):
    """Solution of a symmetric tridiagonal system; overwrites its arguments."""
    n = diagonal.size
    for i in range(1, n):
        factor = lower[i - 1] / diagonal[i - 1]
        diagonal[i] -= factor * lower[i - 1]
        rhs[i] -= factor * rhs[i - 1]
    rhs[n - 1] /= diagonal[n - 1]
    for i in range(n - 2, -1, -1):
        rhs[i] = (rhs[i] - lower[i] * rhs[i + 1]) / diagonal[i]
    return rhs


@njit(cache=True, error_model="numpy")
def newton_step(stiffness, k, r, floor):
    """Solution of the tangent system with contacts of the stiffness k under the net force r."""
    n = r.size
    diagonal = np.empty(n)
    for i in range(n):
        diagonal[i] = stiffness[i] + k[i] + (k[i - 1] if i > 0 else 0.0) + floor
    return thomas(-k[: n - 1], diagonal, r.copy())


@njit(cache=True, error_model="numpy")
def rest(x, A, stiffness, anchor, preload, compliance, floor, n_iterations):
    """Damped Newton for the static state, from x and in place; the net force that is left, out.

    `floor` [N/m] keeps the tangent regular while contacts are open; it fades with the net force.
    A step is halved until the potential energy, which is convex, no longer climbs at its end: the
    net force itself may have to grow on the way.
    """
    n = x.size
    f, r, k = np.zeros(n + 1), np.zeros(n), np.zeros(n)
    static_residual(x, A, stiffness, anchor, preload, compliance, f, r)
    norm = math.sqrt((r * r).sum())
    start = norm
    stalled = False
    for _ in range(n_iterations):
        if norm == 0.0 or stalled:
            break
        static_slope(x, A, compliance, k)
        change = newton_step(stiffness, k, r, floor * (norm / start))
        downhill = (r * change).sum()
        scale = 1.0
        better = False
        for _halving in range(40):
            trial = x + scale * change
            static_residual(trial, A, stiffness, anchor, preload, compliance, f, r)
            better = (r * change).sum() >= -BEYOND * downhill
            if better:
                break
            scale *= 0.5
        if not better:
            break
        trial_norm = math.sqrt((r * r).sum())
        stalled = norm < 1e-12 * start and trial_norm > 0.5 * norm
        x[:] = trial
        norm = trial_norm
    return norm


def equilibrium(chain, wall):
    """Static state under preload and leaf springs; spheres that nothing holds just touch the next.

    Raises InvalidChain, NoEquilibrium.
    """
    validate(chain, wall, np.zeros(np.size(chain.mass)))
    return static_state(chain, wall)


def static_state(chain, wall):
    """`equilibrium` of what is validated."""
    n = chain.mass.size
    n_modes = 0 if wall is None else wall.omega.size
    stiffness = np.zeros(n) if chain.leaf_stiffness is None else chain.leaf_stiffness
    anchor = np.zeros(n) if chain.leaf_anchor is None else chain.leaf_anchor
    if chain.preload == 0.0 and not (stiffness * anchor).any():
        return Equilibrium(np.zeros(n), np.zeros(chain.A.size), np.zeros(n_modes))
    compliance = static_compliance(wall)
    x, force = _rest(chain, wall, stiffness, anchor, compliance)
    q = np.zeros(n_modes)
    if n_modes and force[-1] > 0.0:
        moving = wall.phi != 0.0
        q[moving] = wall.phi[moving] * force[-1] / wall.omega[moving] ** 2
    return Equilibrium(x, force, q)


def _rest(chain, wall, stiffness, anchor, compliance):
    """Positions and contact forces."""
    n, held = chain.mass.size, stiffness > 0.0
    walled = wall is not None and bool(np.isfinite(compliance))
    if not held.any() and (not walled or chain.preload < 0.0):
        raise NoEquilibrium(
            f"a preload of {chain.preload:g} N finds no support; add leaf springs or a wall that "
            "holds it"
        )
    x, force = _balance(chain, n if walled else n - 1, stiffness, anchor, compliance)
    if not walled and wall is not None and x[-1] > 0.0:
        raise NoEquilibrium(
            "the preload presses on a wall that nothing holds; fix the wall or remove the preload"
        )
    for i in range(n - 2, -1, -1):
        if not held[i] and force[i] == 0.0 and force[i + 1] == 0.0:
            x[i] = x[i + 1]
    return x, force[1 : chain.A.size + 1]


def _balance(chain, n_contacts, stiffness, anchor, compliance):
    """Positions (n,) at which all forces (n + 1,) balance, the first contacts only."""
    A, P, held = chain.A, float(chain.preload), stiffness > 0.0
    n = held.size
    first = int(held.argmax()) if held.any() else n - 1  # spheres before it just touch
    carried = abs(P) + float(np.abs(stiffness * anchor).sum())
    overlap = (carried / A.min(initial=np.inf)) ** (2.0 / 3.0)
    x, force = np.where(held, anchor, overlap), np.zeros(n + 1)
    if n_contacts == n and compliance < 0:  # half of the largest approach that a force answers
        x = np.minimum(x, 2 / (27 * (compliance * A[-1]) ** 2))
    bearing = (
        x[first:], np.ascontiguousarray(A[:n_contacts])[first:], stiffness[first:], anchor[first:],
        P, compliance if n_contacts == n else 0.0,
    )  # fmt: skip
    floor = REGULAR * 1.5 * A.max(initial=0.0) * np.sqrt(overlap)
    left = rest(*bearing, floor, 500)
    pushed = np.cumsum(stiffness * anchor) + np.r_[np.zeros(n - 1), P]
    if not left <= 1e-9 * carried and n_contacts == n and (pushed[first:] > 0).all():
        # of a long chain: from where the springs' forces at x = 0 would press it
        gap = (np.maximum(pushed, 0) / A) ** (2.0 / 3.0)
        gap[-1] += max(compliance, 0.0) * pushed[-1]
        x[:] = np.cumsum(gap[::-1])[::-1]
        left = rest(*bearing, floor, 500)
    if not left <= 1e-9 * carried:
        raise NoEquilibrium(
            f"no static state found: {left:.3g} N of {carried:.3g} N stay unbalanced; "
            "check preload, leaf springs and the wall's residual compliance"
        )
    static_residual(*bearing, force[first:], np.zeros(n - first))
    return x, force
