"""Contact of faces under preload: zone, pressure, and the linear model about that state.

Facets f of the pressed faces (`fem.contact.facing_facets`) carry a pressure p_f >= 0 and stay apart
by g_f >= 0. Each has a thin layer of stiffness k_f per area, P_f = A_f p_f:

    K u = F + C^T P,    P_f = max(0, -k_f A_f g_f),    g = g_0 + C u.

The interface is condensed once on a reference in which all facets are closed and stick,
K_r = K + C^T k A C, which is regular even where contact alone holds a body:

    d = C u = C K_r^-1 F + W (what the forces of the faces are beyond - k A d),   W = C K_r^-1 C^T,

C the openings along the normal and across, and the elongations of the bolts. Layers of other
stiffness, K_r + C^T D C, change W and d by as many unknowns as layers (Woodbury):

    W' = W - W_:R G^-1 W_R:,    d' = d - W_:R G^-1 d_R,    G = 1 / D_R + W_RR,

where G of layers that all stiffen and -G of those that all soften are positive definite, as the
changed matrix is.

So the zone is a system of as many unknowns as facets, of which the closed ones are found by the
semi-smooth Newton method, which for this law is an active set (Hintermueller, Ito and Kunisch, SIAM
J. Optim. 13 (2003) 865). Other preloads, gaps, friction and roughness factorise nothing.
With gaps of 0 the zone does not depend on the preload.
"""

from contextlib import suppress
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lu_factor, lu_solve, solve_triangular
from scipy.sparse import csr_matrix, diags_array, vstack
from scipy.spatial import cKDTree

from beadwave.fem.contact.coulomb_friction import (
    CONVERGED,
    FrictionInterface,
    Loaded,
    SlipState,
    loaded_to,
)
from beadwave.fem.contact.facing_facets import FacingFacets
from beadwave.fem.modes.solver.factorisation import Factor, condensed_on
from beadwave.fem.modes.solver.multifrontal import NEITHER, Singular

MAX_STEPS = 60  # of Newton's method, which took 4 to 12
OPEN, SLIDING, STUCK = 0, 1, 2
NEIGHBOURS = 5  # of a facet by the distance of their middles, itself included
MINDLIN = 14 / 17  # stiffness along over that across, 2 (1 - nu) / (2 - nu) of nu = 0.3
# of a layer's stiffness across that is left while the zone is found without friction, so that a
# body which contact alone holds has one: of 300 E / h it is 3e-6 of the elements' stiffness; the
# second one where that is lost to rounding
LEFT_ACROSS = 1e-8, 1e-6


class Interface(NamedTuple):
    """An interface condensed on the reference: rows are the normals of m facets, their first and
    second tangents, and b bolts."""

    layers: NDArray[np.float64]  # (r,) [N/m] of the reference; 0 of bolts
    W: NDArray[np.float64]  # (r, r) [m/N]

    def changed(
        self, layers: NDArray[np.float64], rows: NDArray[np.int64], d: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The compliance (k, k) [m/N] of `rows` (k,) with other layers (r,) [N/m], and their
        openings (k,) [m] under the forces that cause d (r,) in the reference."""
        change = layers - self.layers
        stiffer, softer = np.flatnonzero(change > 0), np.flatnonzero(change < 0)
        # stiffer first: all that is between is regular if both ends are
        Z = np.zeros((0, len(d) + 1))
        if len(stiffer):
            G = np.diag(1 / change[stiffer]) + self.W[np.ix_(stiffer, stiffer)]
            own = np.column_stack([self.W[stiffer], d[stiffer]])
            Z = solve_triangular(np.linalg.cholesky(G), own, lower=True)

        def stiffened(at: NDArray[np.int64], by: NDArray[np.int64]) -> NDArray[np.float64]:
            """Openings of rows `at` by unit forces on rows `by`, and in the last column by d."""
            own = np.column_stack([self.W[np.ix_(at, by)], d[at]])
            return own - Z[:, at].T @ Z[:, np.append(by, -1)]

        both = stiffened(rows, rows)
        if len(softer):
            G = np.diag(-1 / change[softer]) - stiffened(softer, softer)[:, :-1]
            own = stiffened(softer, rows)
            both += _inverse_form(G, own)[:-1]
        return both[:, :-1], both[:, -1]


def _inverse_form(G: NDArray[np.float64], B: NDArray[np.float64]) -> NDArray[np.float64]:
    """B^T G^-1 B (k, k) of a symmetric positive definite G (n, n), B (n, k)."""
    try:
        Z = solve_triangular(np.linalg.cholesky(G), B, lower=True, check_finite=False)
    except np.linalg.LinAlgError:  # nearly singular, and by rounding not positive definite
        return B.T @ np.linalg.solve(G, B)
    return Z.T @ Z


class PreloadedContact(NamedTuple):
    """Zone and pressure of m facets."""

    facets: FacingFacets
    pressure: NDArray[np.float64]  # (m,) [Pa]
    gap: NDArray[np.float64]  # (m,) [m]
    start: NDArray[np.float64]  # (m,) [m] gaps before any load
    state: NDArray[np.int64]  # (m,) OPEN, SLIDING with its shear at its limit, or STUCK
    # (n,) [m] displacements of the free dofs and (m,) [Pa] pressure while nothing rubs: that state
    # alone has geometric stiffnesses that cancel in rigid motions
    u: NDArray[np.float64]
    smooth_pressure: NDArray[np.float64]
    hard: NDArray[np.float64]  # (m,) [Pa/m] stiffness of the layers by which faces are kept apart
    rough: NDArray[np.float64]  # (m,) [m/Pa] compliance of rough faces, lambda / p
    bolts: NDArray[np.float64]  # (m,) [Pa/m] by which bolts resist the sliding of a facet
    friction: NDArray[np.float64]  # (m,)
    shear: NDArray[np.float64]  # (2, m) [N] of friction, against their opening
    interface: Interface
    C: csr_matrix  # (3 m + b, n) openings of the free dofs, and elongations of bolts
    locked: NDArray[np.float64]  # (b,) [N/m] of bolts about the state
    n_steps: int

    @property
    def force(self) -> float:
        """[N] that the faces carry."""
        return float(self.pressure @ self.facets.area)

    def with_roughness(self, rough: NDArray[np.float64]) -> "PreloadedContact":
        """The state with layers of k = p / lambda, lambda (m,) [m], which are linear about it: they
        give way to a change of the load and leave the pressure as it is."""
        p = np.where(self.state == OPEN, np.inf, self.pressure)
        return self._replace(rough=rough / p)

    @property
    def zone_area(self) -> float:
        """[m^2] of the closed facets."""
        return float(self.facets.area[self.state != OPEN].sum())

    @property
    def layers(self) -> NDArray[np.float64]:
        """Stiffnesses (3 m + b,) [N/m] of the interface about this state: along the normal of
        closed facets, and across them that of the layers with friction and of the bolts without.

        A facet that slid while its preload grew sticks to a small vibration: what turns the shear
        or takes from it meets no limit, and what adds to it is worn off in a few cycles.
        """
        area, on = self.facets.area, self.state != OPEN
        k = np.where(on, area / (1 / self.hard + self.rough), 0.0)
        across = np.where(self.friction > 0, MINDLIN * k, np.where(on, area * self.bolts, 0.0))
        return np.concatenate([k, across, across, self.locked])


class CondensedContact(NamedTuple):
    """Facets with their interface condensed on the reference in which all of it is closed."""

    facets: FacingFacets
    stiffness: NDArray[np.float64]  # (m,) [Pa/m] k of the layers
    C: csr_matrix  # (3 m + b, n) openings of the free dofs, and elongations of bolts
    interface: Interface
    factor: Factor  # of K_r
    sliding: NDArray[np.float64]  # (m, m) [m/N] W of the normals without friction
    # as friction is taken away: L (2 m, 2 m) of L L^T = 1 / D - W_tt, D what layers across lose,
    # and L^-1 W_tn (2 m, m), of rows n along the normals and t across
    across: NDArray[np.float64]
    coupling: NDArray[np.float64]

    def solver(self, layers: NDArray[np.float64]) -> "ChangedFactor":
        """The factor with other layers (r,) [N/m], (1 + W D)^-1 of those that change."""
        change = layers - self.interface.layers
        rows = np.flatnonzero(change)
        own = np.eye(len(rows)) + self.interface.W[np.ix_(rows, rows)] * change[rows]
        return ChangedFactor(self.factor, csr_matrix(self.C[rows]), change[rows], lu_factor(own))


class ChangedFactor(NamedTuple):
    """A factor of K_r + C^T D C by that of K_r, of r rows that change."""

    factor: Factor
    C: csr_matrix  # (r, n)
    change: NDArray[np.float64]  # (r,) [N/m] D
    own: tuple[NDArray[np.float64], NDArray[np.int32]]  # LU of 1 + W D

    def solve(self, b: NDArray[np.float64]) -> NDArray[np.float64]:
        """x of (K_r + C^T D C) x = b (n, k)."""
        x = self.factor.solve(b)
        forces = self.change[:, None] * lu_solve(self.own, self.C @ x)
        return x - self.factor.solve(self.C.T @ forces)


def condensed(
    K,
    M,
    T: csr_matrix,
    facets: FacingFacets,
    stiffness: NDArray[np.float64],
    *,
    bolts: csr_matrix | None = None,
    shift: float = 0.0,
) -> CondensedContact:
    """The interface of a model with K, M (n, n) and T (ndof, n) in which it is open, condensed;
    `bolts` (b, ndof) are their elongations.

    A structure that floats takes a `shift` > 0 [rad^2/s^2], K + shift M, whose share in the
    displacements under forces in balance is shift / omega^2 of the lowest elastic mode.
    """
    rows = facets.C if bolts is None else vstack([facets.C, bolts])
    C, kA = csr_matrix(rows @ T), stiffness * facets.area
    none = np.zeros(C.shape[0] - 3 * len(kA))
    layers = np.concatenate([kA, MINDLIN * kA, MINDLIN * kA, none])
    K_r = (K + C.T @ diags_array(layers) @ C + shift * M).tocsc()
    factor, W = condensed_on(K_r, C, shifted=shift > 0)
    interface, m = Interface(layers, W), len(kA)
    normals, tangents = np.split(np.arange(3 * m), [m])
    for left in LEFT_ACROSS:
        G = np.diag(1 / ((1 - left) * layers[tangents])) - W[np.ix_(tangents, tangents)]
        with suppress(np.linalg.LinAlgError):
            L = np.linalg.cholesky(G)
            break
    else:
        raise Singular(NEITHER)
    Z = solve_triangular(L, W[np.ix_(tangents, normals)], lower=True, check_finite=False)
    sliding = W[:m, :m] + Z.T @ Z
    return CondensedContact(facets, stiffness, C, interface, factor, sliding, L, Z)


def preloaded_contact(
    contact: CondensedContact, F: NDArray[np.float64], gap: NDArray[np.float64] | None = None
) -> PreloadedContact:
    """The zone under forces F (n,) [N] without friction; `gap` (m,) [m] replaces the facets' own.

    Raises ValueError where no state was found, as for forces that open all of the contact of a body
    that nothing else holds.
    """
    facets, m = contact.facets, len(contact.facets.area)
    layers, W = contact.interface.layers, contact.sliding
    kA = layers[:m]
    g_0 = facets.gap if gap is None else gap
    by_load = contact.C @ contact.factor.solve(F)
    y = solve_triangular(contact.across, by_load[m : 3 * m], lower=True, check_finite=False)
    c = by_load[:m] + contact.coupling.T @ y

    closed, seen = np.ones(m, bool), set()
    for step in range(1, MAX_STEPS + 1):  # noqa: B007  the number of steps is a result
        # d = g - g_0 = c + W (P + k A d), with P + k A d = -k A g_0 on closed facets
        opened = ~closed
        d = c - W[:, closed] @ (kA[closed] * g_0[closed])
        if opened.any():
            A = np.eye(opened.sum()) - W[np.ix_(opened, opened)] * kA[opened]
            d[opened] = np.linalg.solve(A, d[opened])
            d[closed] += W[np.ix_(closed, opened)] @ (kA[opened] * d[opened])
        now = g_0 + d < 0
        if np.array_equal(now, closed):
            break
        if (key := now.tobytes()) in seen:  # a circle of a few facets that hardly touch
            now = now & closed
        seen.add(key)
        closed = now
    else:
        closed[:] = False
    if not closed.any():
        raise ValueError("the forces open all of the contact; preload it more, or hold the bodies.")
    P = np.where(closed, -kA * (g_0 + d), 0.0)
    beyond = P + kA * d
    s = solve_triangular(
        contact.across, y + contact.coupling @ beyond, lower=True, trans="T", check_finite=False
    )
    u = contact.factor.solve(F + contact.C[: 3 * m].T @ np.append(beyond, s))
    zero = np.zeros(m)
    return PreloadedContact(
        facets=facets,
        pressure=P / facets.area,
        gap=g_0 + d,
        start=g_0,
        state=np.where(closed, SLIDING, OPEN),
        u=u,
        smooth_pressure=P / facets.area,
        hard=contact.stiffness,
        rough=zero,
        bolts=zero,
        friction=zero,
        shear=np.zeros((2, m)),
        interface=contact.interface,
        C=contact.C,
        locked=np.zeros(len(layers) - 3 * m),
        n_steps=step,
    )


def joined_stiffness(contact: PreloadedContact) -> csr_matrix:
    """Stiffness (n, n) that closed facets and locked bolts add to K."""
    return csr_matrix(contact.C.T @ diags_array(contact.layers) @ contact.C)


def with_friction(
    contact: CondensedContact,
    state: PreloadedContact,
    F: NDArray[np.float64],
    friction: NDArray[np.float64],
    gap: NDArray[np.float64] | None = None,
) -> PreloadedContact:
    """The state with Coulomb friction (m,) while F grew in proportion: facets STUCK with a shear
    below friction times pressure, or SLIDING with just that; along the faces what slides has
    besides the stiffness of the bolts. Pressure and zone follow. Raises ValueError for faces that
    slip as a whole where nothing else carries F."""
    interface, m = contact.interface, len(contact.facets.area)
    g_0 = contact.facets.gap if gap is None else gap
    closed, r = state.state != OPEN, len(interface.layers)
    if not np.any(friction):
        return state._replace(friction=friction)

    # linear with the closed facets stuck and the others open, and with P = -k g_0 at d = 0
    on, kA = np.flatnonzero(closed), interface.layers[:m]
    layers = interface.layers * np.append(np.tile(closed, 3), np.ones(r - 3 * m))
    rows = np.concatenate([np.arange(m), m + on, 2 * m + on])
    P_0 = np.where(closed, -kA * g_0, 0.0)
    c = contact.C @ contact.factor.solve(F + contact.C[:m].T @ P_0)
    W, d_1 = interface.changed(layers, rows, c)
    stuck = interface.layers[m + on]
    bolts = np.maximum((contact.facets.area * state.bolts)[on], LEFT_ACROSS[0] * stuck)
    loaded = Loaded(
        FrictionInterface(
            W=W, stuck=on, closed=closed, normal=kA, force=P_0, gap=g_0, across=stuck - bolts,
            shear=np.zeros((2, len(on))), friction=friction[on],
        ),
        d_1, 0.0,
    )  # fmt: skip
    none = SlipState(0.0, np.zeros(len(rows)), np.zeros(len(on), bool))
    after = loaded_to(loaded, none, 1.0)

    d = d_1 + W @ after.s
    P = np.where(closed, P_0 - kA * d[:m], 0.0) + after.s[:m]
    P[P < CONVERGED * P.max()] = 0.0  # an open facet has rounding
    shear = np.zeros((2, m))
    across = d[m:].reshape(2, -1)
    shear[:, on] = after.s[m:].reshape(2, -1) - (stuck - bolts) * across
    shear *= P > 0
    slides = np.ones(m, bool)
    slides[on] = after.slips
    return state._replace(
        pressure=P / contact.facets.area,
        gap=g_0 + d[:m],
        state=np.where(P > 0, np.where(slides, SLIDING, STUCK), OPEN),
        friction=friction,
        shear=shear,
    )


def rim(contact: PreloadedContact) -> NDArray[np.bool_]:
    """True for closed facets (m,) next to an open one."""
    k = min(NEIGHBOURS, len(contact.facets.area))
    near = cKDTree(contact.facets.points).query(contact.facets.points, k=k)[1].reshape(-1, k)
    opened = contact.state == OPEN
    return ~opened & opened[near].any(axis=1)


def pressure_error(contact: PreloadedContact) -> float:
    """Relative error of the pressure in the mean square, by its jumps: each facet against the mean
    over it and its neighbours that are closed."""
    k = min(NEIGHBOURS, len(contact.facets.area))
    near = cKDTree(contact.facets.points).query(contact.facets.points, k=k)[1].reshape(-1, k)
    on = contact.state != OPEN
    share = on[near] * contact.facets.area[near]
    smooth = (share * contact.pressure[near]).sum(axis=1) / np.maximum(share.sum(axis=1), 1e-300)
    area = contact.facets.area * on
    square = area @ contact.pressure**2
    return float(np.sqrt(area @ (contact.pressure - smooth) ** 2 / square)) if square else 0.0
