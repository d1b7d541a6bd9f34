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

from beadwave.dem import Chain, Wall

RTOL = 1e-11
Array = NDArray[np.float64]


class ReferenceMotion(NamedTuple):
    """A chain's motion at the instants of the call."""

    v: Array  # (k, n) [m/s]
    force: Array  # (k, n_contacts) [N]


class Equations(NamedTuple):
    """Chain and wall; y = (x, v, q, q', u_d). A free chain has no wall."""

    chain: Chain
    wall: Wall | None

    def unpacked(self, y: Array) -> tuple[Array, ...]:
        """x, v (n,), q, q' (n_modes,) and u_d (1,), or (0,) without a wall, of a state y."""
        n, k = self.chain.mass.size, 0 if self.wall is None else self.wall.omega.size
        return tuple(np.split(y, np.cumsum([n, n, k, k])))

    def gaps(self, y: Array) -> tuple[Array, Array]:
        """Approach of each contact (n_contacts,) [m] and its rate [m/s], without regard to the
        residual compliance s, which takes a part of the last one."""
        x, v, q, p, u_d = self.unpacked(y)
        if self.wall is None:
            return x[:-1] - x[1:], v[:-1] - v[1:]
        u = np.append(x[1:], self.wall.phi @ q + u_d[0])
        return x - u, v - np.append(v[1:], self.wall.phi @ p)

    def overlaps(self, y: Array, deepest: Array) -> Array:
        """delta (n_contacts,) [m] of every contact at a state y; the last one's solves
        delta + s F(delta) = gap. `deepest` (n_contacts,) are the largest overlaps so far."""
        d = np.maximum(self.gaps(y)[0], 0.0)
        s = 0.0 if self.wall is None else self.wall.residual_compliance
        if s and d[-1] > 0.0:
            gap, A, limit = d[-1], self.chain.A[-1], self.limits[-1]

            def excess(delta: float) -> float:
                return delta + s * float(elastic(delta, A, limit, deepest[-1])) - gap

            high = gap if s > 0.0 else 2.0 * gap  # a negative s makes delta larger than the gap
            d[-1] = brentq(excess, 0.0, high, xtol=1e-300, rtol=1e-15)
        return d

    def forces(self, y: Array, deepest: Array) -> Array:
        """F (n_contacts,) [N] of every contact, with its damping.

        Before a residual compliance s the last one's gap is delta + s (F + gamma delta'); to the
        first order in gamma its force is F(delta_0) + gamma gap' / (1 + s dF/d delta)^2.
        """
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
        """Overlap (n_contacts,) [m] of each contact at which it yields; inf for Hertz' law."""
        limits = self.chain.yield_overlap
        return np.full(self.chain.A.size, np.inf) if limits is None else np.asarray(limits, float)

    def rate(self, y: Array, deepest: Array) -> Array:
        """y' at a state y (size,), the equations of the module's docstring."""
        chain, wall = self.chain, self.wall
        x, v, q, p, u_d = self.unpacked(y)
        F = self.forces(y, deepest)
        F_behind = F if wall is not None else np.append(F, 0.0)  # of each sphere; none at the end
        k, anchor = chain.springs
        total = np.append(0.0, F_behind[:-1]) - F_behind - k * (x - anchor)
        total[-1] += chain.preload
        if wall is None:
            return np.concatenate([v, total / chain.mass, u_d])
        modal = wall.phi * F[-1] - 2.0 * wall.zeta * wall.omega * p - wall.omega**2 * q
        return np.concatenate([v, total / chain.mass, p, modal, [wall.mobility * F[-1]]])


def elastic(d: Array, A: Array, limit: Array, deepest: Array) -> Array:
    """Hertz' force up to the overlap `limit`, a straight line beyond it, and on the way back from
    the deepest overlap Hertz' law of the flattened surface; of contacts (n,), or one of them.

    Without a limit, inf, numpy's branches for yielding give no number: the last line replaces them.
    """
    d, top = np.maximum(d, 0.0), np.maximum(deepest, limit)
    with np.errstate(invalid="ignore"):
        A_flat, crater = flattened(A, limit, top)
        loading = A * limit**1.5 * (1.0 + 1.5 * (d - limit) / limit)
        F = np.where(d >= top, loading, A_flat * np.maximum(d - crater, 0.0) ** 1.5)
    return np.where((d < top) & (top <= limit) | np.isinf(limit), A * d**1.5, F)


def flattened(A: Array, limit: Array, top: Array) -> tuple[Array, Array]:
    """Thornton's (1997) unloading: 1/R_p = 1/R F_y/F* ((2 F* + F_y) / 3 F_y)^(3/2), as the Hertz
    coefficient of the flattened surface and the overlap at which its force ends, (n,) each or one;
    F* is the force at the deepest overlap `top`."""
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


def motion(
    chain: Chain, wall: Wall | None, v0: Array, t: Array, *, steps: int = 100
) -> ReferenceMotion:
    """Velocities and forces at t (k,), from rest in equilibrium with v0 (n,); `steps` at the least.

    Raises ValueError where the integrator gives up.
    """
    equations = Equations(chain, wall)
    x, q = at_rest(chain, wall)
    y = np.concatenate([x, np.asarray(v0, float), q, 0.0 * q, [] if wall is None else [0.0]])
    deepest, states, forces, now = equations.limits.copy(), [], [], 0.0
    loading = np.zeros(deepest.size, bool)  # contacts that yield at present
    while now < t[-1]:
        phase = _phase(equations, y, deepest, loading, (now, t[-1]), t[-1] / steps)
        saves = t[(t >= now) & ((t < phase.t[-1]) | (phase.t[-1] == t[-1]))]
        y_saved = phase.sol(saves).T if saves.size else np.empty((0, y.size))
        states += [*y_saved]
        forces += [equations.forces(s, _deepest(equations, s, deepest, loading)) for s in y_saved]

        # the next phase starts where a contact began to yield or turned back
        now, y = phase.t[-1], phase.y[:, -1]
        deepest = _deepest(equations, y, deepest, loading)
        for i, times in enumerate(phase.t_events):
            loading[i] ^= bool(times.size)
    return ReferenceMotion(np.array(states)[:, x.size : 2 * x.size], np.array(forces))


def _deepest(equations: Equations, y: Array, deepest: Array, loading: Array) -> Array:
    """The deepest overlaps so far, of loading contacts the present one."""
    if not loading.any():
        return deepest
    return np.where(loading, np.maximum(equations.overlaps(y, deepest), deepest), deepest)


def _phase(equations, y, deepest, loading, span, longest):
    """The solution up to where a contact begins to yield or turns back: the law of every contact
    is smooth in between. One event for each contact that may yield."""

    def rate(_, y):
        return equations.rate(y, np.where(loading, 0.0, deepest))

    def event(i: int):
        def passed(_, y):
            if loading[i]:
                return -equations.gaps(y)[1][i]
            # a contact loads again beyond 1 + 1e-9 of its deepest overlap: the rounding at the turn
            # itself must not count as a new load
            return equations.overlaps(y, deepest)[i] - (1.0 + 1e-9) * deepest[i]

        passed.terminal, passed.direction = True, 1.0
        return passed

    yielding = np.flatnonzero(np.isfinite(equations.limits))
    unit = np.maximum(np.abs(y), 1e-3 * np.abs(y).max())
    phase = solve_ivp(
        rate, span, y, "DOP853", dense_output=True, events=[event(i) for i in yielding] or None,
        rtol=RTOL, atol=RTOL * 1e-3 * unit, max_step=longest,
    )  # fmt: skip
    if not phase.success:
        raise ValueError(f"DOP853 gives up at {phase.t[-1]:g} s: {phase.message}")
    phase.t_events = phase.t_events or []
    return phase


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
    # at rest the modes are springs: one residual compliance holds them all
    still = Equations(chain, None if wall is None else Wall(*[np.zeros(0)] * 3, s))
    zeros = np.zeros(n if wall is None else n + 1)  # v, and u_d at a wall
    unit = (load / chain.A.min()) ** (2.0 / 3.0)

    def state(z: Array) -> Array:
        """y at rest with positions z (n,) in the unit of the overlaps."""
        return np.concatenate([z * unit, zeros])

    def unbalanced(z: Array) -> Array:
        """Net force (n,) on each sphere over the load."""
        return still.rate(state(z), still.limits)[n : 2 * n] * chain.mass / load

    solution = root(unbalanced, np.arange(n, 0, -1.0), tol=1e-14)
    residual = np.abs(solution.fun).max()
    if residual > 1e-10:
        raise ValueError(f"the state of rest is off by {residual:.1e} of its load.")
    force = still.forces(state(solution.x), still.limits)
    return solution.x * unit, modes * (force[-1] if wall is not None else 0.0)
