"""A chain and its wall by scipy's DOP853, from the formulas alone: the plainest of all peers.

    m_i x_i'' = F_{i-1} - F_i - k_i (x_i - a_i) + P [i = N],   q'' + 2 zeta omega q' + omega^2 q =
    phi F_N,   u_d' = mobility F_N,   F = A delta^(3/2)

with the damping of Chain's docstring, delta + s F = gap at the wall, and C. Thornton's yielding
contact (J. Appl. Mech. 64 (1997) 383), whose deepest overlaps change at events. Nothing is
compiled, nothing is shared with the kernels, and nothing is fast.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, root

from dem import Chain, Wall

RTOL = 1e-11
AGAIN = 1.0 + 1e-9  # of the deepest overlap: beyond it, no rounding takes a turn for a new load
Array = NDArray[np.float64]


class Motion(NamedTuple):
    """At the instants asked for."""

    v: Array  # (k, n) [m/s]
    force: Array  # (k, n_contacts) [N]


class Equations(NamedTuple):
    """Chain and wall; y = (x, v, q, q', u_d). A free chain has no wall."""

    chain: Chain
    wall: Wall | None

    def parts(self, y: Array) -> tuple[Array, ...]:
        """x, v (n,), q, q' (n_modes,), u_d of a state."""
        n, k = self.chain.mass.size, 0 if self.wall is None else self.wall.omega.size
        return tuple(np.split(y, np.cumsum([n, n, k, k])))

    def gaps(self, y: Array) -> tuple[Array, Array]:
        """Approach of each contact and its rate, what a spring s takes of it included."""
        x, v, q, p, u_d = self.parts(y)
        if self.wall is None:
            return x[:-1] - x[1:], v[:-1] - v[1:]
        u = np.append(x[1:], self.wall.phi @ q + u_d[0])
        return x - u, v - np.append(v[1:], self.wall.phi @ p)

    def overlaps(self, y: Array, deepest: Array) -> Array:
        """delta of every contact; the last one's solves delta + s F(delta) = gap."""
        d = np.maximum(self.gaps(y)[0], 0.0)
        s = 0.0 if self.wall is None else self.wall.residual_compliance
        if s and d[-1] > 0.0:
            gap, A, limit = d[-1], self.chain.A[-1], self.limits[-1]

            def missing(delta: float) -> float:
                return delta + s * float(elastic(delta, A, limit, deepest[-1])) - gap

            high = gap if s > 0.0 else 2.0 * gap
            d[-1] = brentq(missing, 0.0, high, xtol=1e-300, rtol=1e-15)
        return d

    def forces(self, y: Array, deepest: Array) -> Array:
        """F of every contact, with its damping."""
        chain, d, rate = self.chain, self.overlaps(y, deepest), self.gaps(y)[1]
        F = elastic(d, chain.A, self.limits, deepest)
        if chain.dissipation == "none":
            return F
        touching = F > 0.0  # none in the crater that a yielding contact leaves
        share = np.ones(F.size)
        if self.wall is not None and touching[-1]:
            k = slope(d[-1], chain.A[-1], self.limits[-1], deepest[-1])
            share[-1] = (1.0 + self.wall.residual_compliance * k) ** -2
        hunt = chain.dissipation == "hunt-crossley"
        damped = F + touching * share * chain.gamma * rate * (F if hunt else 1.0)
        return damped if chain.dissipation == "linear" else np.maximum(damped, 0.0)

    @property
    def limits(self) -> Array:
        """Overlap of each contact at which it yields; inf for Hertz' law."""
        given = self.chain.yield_overlap
        return np.full(self.chain.A.size, np.inf) if given is None else np.asarray(given, float)

    def rate(self, y: Array, deepest: Array) -> Array:
        """y'"""
        chain, wall = self.chain, self.wall
        x, v, q, p, u_d = self.parts(y)
        F = self.forces(y, deepest)
        behind = F if wall is not None else np.append(F, 0.0)
        k, anchor = chain.springs
        total = np.append(0.0, behind[:-1]) - behind - k * (x - anchor)
        total[-1] += chain.preload
        if wall is None:
            return np.concatenate([v, total / chain.mass, u_d])
        turn = wall.phi * F[-1] - 2.0 * wall.zeta * wall.omega * p - wall.omega**2 * q
        return np.concatenate([v, total / chain.mass, p, turn, [wall.mobility * F[-1]]])


def elastic(d: Array, A: Array, limit: Array, deepest: Array) -> Array:
    """Hertz' force up to the overlap `limit`, a straight line beyond it, and on the way back from
    the deepest overlap Hertz' law of the flattened surface."""
    d, top = np.maximum(d, 0.0), np.maximum(deepest, limit)
    with np.errstate(invalid="ignore"):
        A_flat, crater = flattened(A, limit, top)
        loading = A * limit**1.5 * (1.0 + 1.5 * (d - limit) / limit)
        F = np.where(d >= top, loading, A_flat * np.maximum(d - crater, 0.0) ** 1.5)
    return np.where((d < top) & (top <= limit) | np.isinf(limit), A * d**1.5, F)


def flattened(A: Array, limit: Array, top: Array) -> tuple[Array, Array]:
    """Thornton's (1997) unloading: 1/R_p = 1/R F_y/F* ((2 F* + F_y) / 3 F_y)^(3/2), as the Hertz
    coefficient of the flattened surface and the overlap at which its force ends."""
    F_y = A * limit**1.5
    F = F_y * (1.0 + 1.5 * (top - limit) / limit)
    A_flat = A * np.sqrt(F_y / F * ((2.0 * F + F_y) / (3.0 * F_y)) ** 1.5)
    return A_flat, top - (F / A_flat) ** (2.0 / 3.0)


def slope(d: float, A: float, limit: float, deepest: float) -> float:
    """dF/d delta [N/m], by the formulas of `elastic`."""
    if np.isinf(limit):
        return 1.5 * A * d**0.5
    top = max(deepest, limit)
    A_flat, crater = flattened(A, limit, top)
    return 1.5 * (A * limit**0.5 if d >= top else A_flat * max(d - crater, 0.0) ** 0.5)


def motion(chain: Chain, wall: Wall | None, v0: Array, t: Array, *, steps: int = 100) -> Motion:
    """Velocities and forces at t (k,), from rest in equilibrium with v0 (n,); `steps` at the least.

    Raises ValueError where the integrator gives up.
    """
    equations = Equations(chain, wall)
    x, q = at_rest(chain, wall)
    y = np.concatenate([x, np.asarray(v0, float), q, 0.0 * q, [] if wall is None else [0.0]])
    deepest, saved, forces, now = equations.limits.copy(), [], [], 0.0
    loading = np.zeros(deepest.size, bool)
    while now < t[-1]:
        phase = _phase(equations, y, deepest, loading, (now, t[-1]), t[-1] / steps)
        inside = t[(t >= now) & ((t < phase.t[-1]) | (phase.t[-1] == t[-1]))]
        states = phase.sol(inside).T if inside.size else np.empty((0, y.size))
        saved += [*states]
        forces += [equations.forces(s, _top(equations, s, deepest, loading)) for s in states]
        now, y = phase.t[-1], phase.y[:, -1]
        deepest = _top(equations, y, deepest, loading)
        for i, times in enumerate(phase.t_events):
            loading[i] ^= bool(times.size)
    return Motion(np.array(saved)[:, x.size : 2 * x.size], np.array(forces))


def _top(equations: Equations, y: Array, deepest: Array, loading: Array) -> Array:
    """The deepest overlaps, of loading contacts the present one."""
    if not loading.any():
        return deepest
    return np.where(loading, np.maximum(equations.overlaps(y, deepest), deepest), deepest)


def _phase(equations, y, deepest, loading, span, longest):
    """Up to where a contact begins to yield or ceases to; one event for each that may."""

    def rate(_, y):
        return equations.rate(y, np.where(loading, 0.0, deepest))

    def event(i: int):
        def passed(_, y):
            if loading[i]:
                return -equations.gaps(y)[1][i]
            return equations.overlaps(y, deepest)[i] - AGAIN * deepest[i]

        passed.terminal, passed.direction = True, 1.0
        return passed

    yields = np.flatnonzero(np.isfinite(equations.limits))
    unit = np.maximum(np.abs(y), 1e-3 * np.abs(y).max())
    found = solve_ivp(
        rate, span, y, "DOP853", dense_output=True, events=[event(i) for i in yields] or None,
        rtol=RTOL, atol=RTOL * 1e-3 * unit, max_step=longest,
    )  # fmt: skip
    if not found.success:
        raise ValueError(f"DOP853 gives up at {found.t[-1]:g} s: {found.message}")
    found.t_events = found.t_events or []
    return found


def at_rest(chain: Chain, wall: Wall | None) -> tuple[Array, Array]:
    """x (n,) and q (n_modes,) under preload and leaf springs, where all forces balance.

    Raises ValueError where scipy's `root` does not find them.
    """
    n, (k, anchor) = chain.mass.size, chain.springs
    modes = np.zeros(0) if wall is None else wall.phi / wall.omega**2
    load = np.abs(k * anchor).sum() + abs(chain.preload)
    if load == 0.0:
        return np.zeros(n), 0.0 * modes
    s = 0.0 if wall is None else float(wall.residual_compliance + wall.phi @ modes)
    still = Equations(chain, None if wall is None else Wall(*[np.zeros(0)] * 3, s))
    rest = np.zeros(n if wall is None else n + 1)
    unit = (load / chain.A.min()) ** (2.0 / 3.0)

    def state(z: Array) -> Array:
        return np.concatenate([z * unit, rest])

    def unbalanced(z: Array) -> Array:
        return still.rate(state(z), still.limits)[n : 2 * n] * chain.mass / load

    found = root(unbalanced, np.arange(n, 0, -1.0), tol=1e-14)
    if np.abs(found.fun).max() > 1e-10:
        raise ValueError(f"the state of rest is off by {np.abs(found.fun).max():.1e} of its load.")
    force = still.forces(state(found.x), still.limits)
    return found.x * unit, modes * (force[-1] if wall is not None else 0.0)
