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
from scipy.linalg import lapack

MAX_STEPS = 40  # of Newton's method in a load step, which took 2 to 8
CONVERGED = 1e-9  # of the forces, over the largest
BROUGHT_BACK = 1 / 300  # b of `_equilibrium`: layers are 300 times stiffer than elements
# load over what slips of a facet, from which on it joins those that changed: each time that these
# grow their compliance is gathered anew
NEARLY = 0.7
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
    converged: float = CONVERGED  # of the forces, over the largest

    def displacement(self, alpha: float, s: NDArray[np.float64]) -> float:
        """q of a load and of the forces s (m + 2 s,) beyond the linear model."""
        return alpha * self.compliance + float(self.openings @ s)


class Part(NamedTuple):
    """Facets of an interface by themselves, as if the others neither opened nor slipped."""

    facets: NDArray[np.bool_]  # (m,)
    rows: NDArray[np.int64]  # (r,)
    interface: FrictionInterface


class SlipState(NamedTuple):
    """State of the facets after a load step."""

    alpha: float
    s: NDArray[np.float64]  # (m + 2 s,) [N] beyond the linear model
    slips: NDArray[np.bool_]  # (s,) in this step
    by_s: NDArray[np.float64] | float = 0.0  # (m + 2 s,) [m] W s, the openings by s
    part: Part | None = None  # the facets that have opened, closed or slipped so far
    step: float = 0.0  # by which alpha has changed
    change: NDArray[np.float64] | float = 0.0  # (m + 2 s,) of s in it


def loaded_to(
    loaded: Loaded,
    state: SlipState,
    alpha: float,
    n_steps: int = 1,
    guess: NDArray[np.float64] | None = None,
) -> SlipState:
    """The state under another load, in equal steps, each halved where it does not converge; raises
    NoEquilibrium. A guess of the forces s (m + 2 s,) after one step saves some of Newton's."""
    for target in np.linspace(state.alpha, alpha, n_steps + 1)[1:]:
        steps = [(target, 0)]
        while steps:
            goal, halvings = steps[-1]
            is_whole = n_steps == 1 and halvings == 0
            after = _equilibrium(loaded, state, goal, guess if is_whole else None)
            if after is not None:
                state = after
                steps.pop()
            elif halvings == HALVINGS:
                raise NoEquilibrium("the faces slip as a whole, and nothing else carries the load.")
            else:
                steps[-1] = (goal, halvings + 1)
                steps.append(((state.alpha + goal) / 2, halvings + 1))
    return state


def moved_on(loaded: Loaded, start: SlipState, end: SlipState, share: float) -> SlipState:
    """The end of a loop at the load of its start, with the forces that friction left in the facets
    moved on by a share of what the loop moved them and brought back to their limits."""
    change = share * (end.s - start.s)
    by_s = end.by_s + _openings(loaded.interface.W, change)
    after = _equilibrium(loaded, end._replace(s=end.s + change, by_s=by_s), end.alpha, None)
    return end if after is None else after


class Unmet(NamedTuple):
    """Residual of an iterate, and which facets change."""

    F: NDArray[np.float64]  # (m + 2 s,) [N] 0 at the solution
    opens: NDArray[np.bool_]  # (m,) closed facets of the linear model
    closes: NDArray[np.bool_]  # (m,) open ones
    slips: NDArray[np.bool_]  # (s,)
    n: NDArray[np.float64]  # (2, s) direction of friction where a facet slips
    share: NDArray[np.float64]  # (s,) mu P over the length that is brought back to it
    load: NDArray[np.float64]  # (s,) that length over mu P


def part_of(interface: FrictionInterface, facets: NDArray[np.bool_]) -> Part:
    """Facets (m,) of an interface."""
    at, m, n_stuck = np.flatnonzero(facets), interface.m, len(interface.stuck)
    of_stuck = np.flatnonzero(facets[interface.stuck])
    rows = np.concatenate([at, m + of_stuck, m + n_stuck + of_stuck])
    number = np.cumsum(facets) - 1
    own = interface._replace(
        W=interface.W[rows].take(rows, axis=1),
        stuck=number[interface.stuck[of_stuck]],
        closed=interface.closed[at],
        normal=interface.normal[at],
        force=interface.force[at],
        gap=interface.gap[at],
        across=interface.across[of_stuck],
        shear=interface.shear[:, of_stuck],
        friction=interface.friction[of_stuck],
    )
    return Part(facets, rows, own)


def _equilibrium(
    loaded: Loaded, before: SlipState, alpha: float, guess: NDArray[np.float64] | None
) -> SlipState | None:
    """The state after a load step; None where Newton's method does not converge. Solved on the
    facets that have opened, closed or slipped so far, to which come those that then would."""
    interface, linear = loaded.interface, alpha * loaded.openings
    largest = np.abs(interface.force).max(initial=0.0)
    scale = max(np.abs(interface.layers * linear).max(initial=0.0), largest)
    part = before.part or part_of(interface, np.zeros(interface.m, bool))
    # without a guess as the step before was, unless the load turns
    step, s = alpha - before.alpha, before.s if guess is None else guess
    if guess is None and step * before.step > 0:
        s = s + step / before.step * before.change
    before_d = linear + before.by_s
    while True:
        rows = part.rows
        forces = _newton(
            part.interface, before.s[rows], s[rows], before_d[rows], loaded.converged * scale
        )
        if forces is None:
            return None
        s = np.zeros(len(linear))
        s[rows] = forces
        change = s - before.s
        by_s = before.by_s + _openings(interface.W, change)
        unmet = _unmet(interface, before.s, s, linear + by_s)
        moved = unmet.opens | unmet.closes
        moved[interface.stuck[unmet.slips]] = True
        if not np.any(moved & ~part.facets):
            return SlipState(alpha, s, unmet.slips, by_s, part, step, change)
        moved[interface.stuck[unmet.load > NEARLY]] = True
        part = part_of(interface, part.facets | moved)


def _newton(
    interface: FrictionInterface, s_before: NDArray, s: NDArray, d: NDArray, most: float
) -> NDArray[np.float64] | None:
    """Forces (m + 2 s,) [N] beyond the linear model, from a guess s; `d` (m + 2 s,) [m] are the
    openings with the forces s_before. None where the semi-smooth Newton method does not converge to
    forces unmet by `most` [N].

    With d = alpha d_1 + W s the forces are T = T_0 + s_t - k d_t and P = P_0 + s_n - k d_n, so that
    s_t less that of the step before is k times the slip, s_n of a closed facet k times its opening:

        T = T - b (s_t - s_before), brought back to mu P;    P = max(0, P - b s_n)

    for any b > 0 (P. Alart, A. Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991) 353). With b = 1
    Newton's method diverged beyond some slip: layers are far stiffer than bodies. Facets that are
    open in the linear model have P = s_n, and h = k (d_n + gap) + s_n in place of s_n.
    """
    W = interface.W
    d = d + _openings(W, s - s_before)
    for _ in range(MAX_STEPS):
        unmet = _unmet(interface, s_before, s, d)
        if np.abs(unmet.F).max(initial=0.0) <= most:
            return s
        try:
            step = _newton_step(interface, unmet)
        except np.linalg.LinAlgError:  # nothing holds what the faces let go
            return None
        if not np.all(np.isfinite(step)):
            return None
        s, d = s + step, d + _openings(W, step)
    return None


def _openings(W: NDArray[np.float64], s: NDArray[np.float64]) -> NDArray[np.float64]:
    """W s (n,) of few forces (n,) that are not 0; W (n, n) is symmetric."""
    at = np.flatnonzero(s)
    return s[at] @ W[at]


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
    share = np.where(slips, limit / np.where(slips, length, 1.0), 0.0)
    return Unmet(F, opens, closes, slips, n, share, length / np.maximum(limit, 1e-200))


def _newton_step(interface: FrictionInterface, unmet: Unmet) -> NDArray[np.float64]:
    """The change (m + 2 s,) of s: -F where a facet neither opens, closes nor slips, and what solves
    the linearised equations of those that do."""
    W, m, k = interface.W, interface.m, interface.layers
    moved, at = np.flatnonzero(unmet.opens | unmet.closes), np.flatnonzero(unmet.slips)
    # P, T_1 and T_2 of the facets that slip
    slipping = np.column_stack([interface.stuck[at], m + at, m + len(interface.stuck) + at])
    active = np.concatenate([moved, slipping[:, 1:].ravel()])
    step = -unmet.F
    step[active] = 0.0
    if not len(active):
        return step

    # change of P where a facet opens, s - k d, and of h where one closes, s + k d
    sign = np.where(unmet.closes[moved], k[moved], -k[moved])
    # and of friction less mu P n, by those of P and T, s - k d
    n, share, mu = unmet.n[:, at].T, unmet.share[at], interface.friction[at]
    turns = share[:, None, None] * (np.eye(2) - n[:, :, None] * n[:, None, :])
    change = np.concatenate([-(mu[:, None] * n)[:, :, None], np.eye(2) - turns], axis=2)

    # by the active s, facet by facet
    equations = np.empty((len(active), len(active)))
    equations[: len(moved)] = sign[:, None] * _block(W, moved, active)
    by_d = change * -k[slipping][:, None, :]
    openings = _block(W, slipping.ravel(), active).reshape(len(at), 3, len(active))
    equations[len(moved) :] = (by_d @ openings).reshape(-1, len(active))
    own = np.arange(len(moved))
    equations[own, own] += 1.0
    columns = len(moved) + np.arange(2 * len(at)).reshape(-1, 1, 2)
    rows = columns.reshape(-1, 2, 1)
    equations[rows, columns] += change[:, :, 1:] + BROUGHT_BACK * turns
    place = np.full(m, -1)
    place[moved] = own
    open_too = np.flatnonzero(place[slipping[:, 0]] >= 0)
    equations[rows[open_too, :, 0], place[slipping[open_too, :1]]] += change[open_too, :, 0]

    # and by the steps that are known
    right = -unmet.F[active]
    given = np.flatnonzero(step)
    if len(given):
        d = step[given] @ W[given]
        known = (step - k * d)[slipping]
        right[: len(moved)] -= sign * d[moved]
        right[len(moved) :] -= (change @ known[:, :, None]).ravel()
    # in place, of what LAPACK takes for the transpose: a sixth of `solve` less
    lu, pivots, singular = lapack.dgetrf(equations.T, overwrite_a=True)
    if singular:
        raise np.linalg.LinAlgError
    step[active] = lapack.dgetrs(lu, pivots, right, trans=True)[0]
    return step


def _block(W: NDArray[np.float64], rows: NDArray[np.int64], columns: NDArray[np.int64]) -> NDArray:
    """W (n, n) at rows (r,) and columns (c,), by `take` in a quarter of the time of an index."""
    return W.ravel().take(rows[:, None] * len(W) + columns)
