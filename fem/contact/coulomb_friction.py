"""Coulomb friction on preloaded faces: forces on their openings that differ from a linear model's.

What the faces do differently from the linear model K are forces s on their openings d,

    d = alpha d_1 + W s(d),    W = C K^-1 C^T,  d_1 = C K^-1 F,

with s = 0 where a facet neither opens nor slips: a small system on the facets that do. A closed
facet has P = max(0, P_0 - k_n d_n) along the normal; across it sticks with the stiffness k_f up to
|T| = mu P, in parallel with the bolts that resist what slides (Coulomb, returned radially).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

MAX_STEPS = 40  # of Newton's method in a load step, which took 2 to 8
CONVERGED = 1e-9  # of the forces, over the largest
BROUGHT_BACK = 1 / 300  # b of `_equilibrium`: layers are 300 times stiffer than elements
HALVINGS = 6  # of a load step that does not converge


class NoEquilibrium(ValueError):
    """The faces cannot carry the load: nothing else holds what they let go."""


class FrictionInterface(NamedTuple):
    """m facets of preloaded faces, s of which have friction; rows are the normals of all, then the
    first and the second tangent of these."""

    W: NDArray[np.float64]  # (m + 2 s, m + 2 s) [m/N] compliance of the linear model
    stuck: NDArray[np.int64]  # (s,) facets
    closed: NDArray[np.bool_]  # (m,) in the linear model
    normal: NDArray[np.float64]  # (m,) [N/m] k_n
    force: NDArray[np.float64]  # (m,) [N] P_0 of the preload
    gap: NDArray[np.float64]  # (m,) [m] of open facets
    across: NDArray[np.float64]  # (s,) [N/m] k_f of friction
    shear: NDArray[np.float64]  # (2, s) [N] T_0 under the preload
    friction: NDArray[np.float64]  # (s,) mu

    @property
    def m(self) -> int:
        """Number of facets."""
        return len(self.closed)

    @property
    def layers(self) -> NDArray[np.float64]:
        """Stiffness (m + 2 s,) [N/m] of each row's layer."""
        return np.concatenate([self.normal, self.across, self.across])


class Loaded(NamedTuple):
    """An interface under a load of fixed shape, alpha [N] times a vector."""

    interface: FrictionInterface
    openings: NDArray[np.float64]  # (m + 2 s,) [m/N] d_1
    compliance: float  # [m/N] of the load in its own direction, 1 / omega^2 of a mode

    def displacement(self, alpha: float, s: NDArray[np.float64]) -> float:
        """q of a load and of the forces s (m + 2 s,) beyond the linear model."""
        return alpha * self.compliance + float(self.openings @ s)


class SlipState(NamedTuple):
    """State of the facets after a load step."""

    alpha: float
    s: NDArray[np.float64]  # (m + 2 s,) [N] beyond the linear model
    slips: NDArray[np.bool_]  # (s,) in this step


def loaded_to(loaded: Loaded, state: SlipState, alpha: float, n_steps: int = 1) -> SlipState:
    """The state under another load, in equal steps, each halved where it does not converge; raises
    NoEquilibrium."""
    for target in np.linspace(state.alpha, alpha, n_steps + 1)[1:]:
        steps = [(target, 0)]
        while steps:
            goal, halvings = steps[-1]
            after = _equilibrium(loaded, state, goal)
            if after is not None:
                state = after
                steps.pop()
            elif halvings == HALVINGS:
                raise NoEquilibrium("the faces slip as a whole, and nothing else carries the load.")
            else:
                steps[-1] = (goal, halvings + 1)
                steps.append(((state.alpha + goal) / 2, halvings + 1))
    return state


class Unmet(NamedTuple):
    """Residual of an iterate, and which facets change."""

    F: NDArray[np.float64]  # (m + 2 s,) [N] 0 at the solution
    opens: NDArray[np.bool_]  # (m,) closed facets of the linear model
    closes: NDArray[np.bool_]  # (m,) open ones
    slips: NDArray[np.bool_]  # (s,)
    n: NDArray[np.float64]  # (2, s) direction of friction where a facet slips
    share: NDArray[np.float64]  # (s,) mu P over the length that is brought back to it


def _equilibrium(loaded: Loaded, before: SlipState, alpha: float) -> SlipState | None:
    """The state after a load step; None where the semi-smooth Newton method does not converge.

    With d = alpha d_1 + W s the forces are T = T_0 + s_t - k d_t and P = P_0 + s_n - k d_n, so that
    s_t less that of the step before is k times the slip, s_n of a closed facet k times its opening:

        T = T - b (s_t - s_before), brought back to mu P;    P = max(0, P - b s_n)

    for any b > 0 (P. Alart, A. Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991) 353). With b = 1
    Newton's method diverged beyond some slip: layers are far stiffer than bodies. Facets that are
    open in the linear model have P = s_n, and h = k (d_n + gap) + s_n in place of s_n.
    """
    interface, linear = loaded.interface, alpha * loaded.openings
    largest = np.abs(interface.force).max(initial=0.0)
    scale = max(np.abs(interface.layers * linear).max(initial=0.0), largest)
    s = before.s
    for _ in range(MAX_STEPS):
        changed = np.flatnonzero(s)
        d = linear + s[changed] @ interface.W[changed]  # rows of W are its columns
        unmet = _unmet(interface, before.s, s, d)
        if np.abs(unmet.F).max(initial=0.0) <= CONVERGED * scale:
            return SlipState(alpha, s, unmet.slips)
        try:
            s = s + _newton_step(interface, unmet)
        except np.linalg.LinAlgError:  # nothing holds what the faces let go
            return None
        if not np.all(np.isfinite(s)):
            return None
    return None


def _unmet(interface: FrictionInterface, s_before: NDArray, s: NDArray, d: NDArray) -> Unmet:
    """Residual of forces s (m + 2 s,) at openings d (m + 2 s,), by `_equilibrium`."""
    m, k = interface.m, interface.layers
    springs = s - k * d
    apart = k[:m] * (d[:m] + interface.gap) + s[:m]
    P = np.where(interface.closed, interface.force + springs[:m], s[:m])
    T = interface.shear + springs[m:].reshape(2, -1)

    kept = np.where(interface.closed, s[:m], apart)  # 0 of closed facets, above 0 of open ones
    pressed = P - BROUGHT_BACK * kept > 0
    opens, closes = interface.closed & ~pressed, ~interface.closed & pressed

    trial = T - BROUGHT_BACK * (s - s_before)[m:].reshape(2, -1)
    limit = interface.friction * np.maximum(P[interface.stuck], 0.0)
    length = np.hypot(*trial)
    slips = length > limit
    n = trial / np.where(slips, length, 1.0)

    F = s - s_before
    F[:m] = np.where(opens, P, np.where(closes, apart, s[:m]))
    F[m:] = np.where(slips, T - limit * n, F[m:].reshape(2, -1)).ravel()
    return Unmet(F, opens, closes, slips, n, np.where(slips, limit / np.where(slips, length, 1), 0))


def _newton_step(interface: FrictionInterface, unmet: Unmet) -> NDArray[np.float64]:
    """The change (m + 2 s,) of s: -F where a facet neither opens, closes nor slips, and what solves
    the linearised equations of those that do."""
    W, m, k = interface.W, interface.m, interface.layers
    moved, at = np.flatnonzero(unmet.opens | unmet.closes), np.flatnonzero(unmet.slips)
    tangents = [m + at, m + len(interface.stuck) + at]
    active = np.concatenate([moved, *tangents])
    step = -unmet.F
    step[active] = 0.0
    if not len(active):
        return step

    # change of s - k d and of s + k d by the active s, and by the steps that are known
    known = np.flatnonzero(step)
    by_known = step[known] @ W[known]

    def changes(rows: NDArray[np.int64], sign: NDArray | float = -1.0) -> tuple[NDArray, NDArray]:
        factor = sign * k[rows]
        own = (rows[:, None] == active) + factor[:, None] * W[rows][:, active]
        return own, step[rows] + factor * by_known[rows]

    # P of those that open, h of those that close; friction less mu P n of those that slip
    J, known_changes = changes(moved, np.where(unmet.opens[moved], -1.0, 1.0))
    blocks, known_blocks = [J], [known_changes]
    of_P, known_P = changes(interface.stuck[at])
    of_T = [changes(rows) for rows in tangents]
    n, share, mu = unmet.n[:, at], unmet.share[at], interface.friction[at]
    for i in range(2):
        block, known_block = -(mu * n[i])[:, None] * of_P, -mu * n[i] * known_P
        for j, rows in enumerate(tangents):
            turns = share * (float(i == j) - n[i] * n[j])
            block = block + (float(i == j) - turns)[:, None] * of_T[j][0]
            block += (BROUGHT_BACK * turns)[:, None] * (rows[:, None] == active)
            known_block = known_block + (float(i == j) - turns) * of_T[j][1]
        blocks.append(block)
        known_blocks.append(known_block)
    step[active] = np.linalg.solve(
        np.vstack(blocks), -unmet.F[active] - np.concatenate(known_blocks)
    )
    return step
