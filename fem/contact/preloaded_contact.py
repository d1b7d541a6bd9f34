"""Contact of faces under preload: zone, pressure, and the linear model about that state.

Facets f of the pressed faces (`fem.contact.facing_facets`) carry a pressure p_f >= 0 and stay apart
by g_f >= 0. Each has a thin layer of stiffness k_f per area, P_f = A_f p_f:

    K u = F + C^T P,    P_f = max(0, -k_f A_f g_f),    g = g_0 + C u.

The interface is condensed once on a reference in which all facets are closed,
K_r = K + C^T k A C, which is regular even where contact alone holds a body:

    g - g_0 = C u = c + W (P + k A (g - g_0)),    W = C K_r^-1 C^T,  c = C K_r^-1 F,

a system of as many unknowns as facets, of which the closed ones are found by the semi-smooth Newton
method, which for this law is an active set (Hintermueller, Ito and Kunisch, SIAM J. Optim. 13
(2003) 865). Other preloads, gaps and friction cost no further solution with K_r.
With gaps of 0 the zone does not depend on the preload.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags_array
from scipy.spatial import cKDTree

from beadwave.fem.contact.facing_facets import FacingFacets
from beadwave.fem.modes.solver.factorisation import Factor, factorised

MAX_STEPS = 60  # of Newton's method, which took 4 to 12
OPEN, SLIDING, STUCK = 0, 1, 2
NEIGHBOURS = 5  # of a facet by the distance of their middles, itself included
MINDLIN = 14 / 17  # stiffness along over that across, 2 (1 - nu) / (2 - nu) of nu = 0.3


class PreloadedContact(NamedTuple):
    """Zone and pressure of m facets."""

    facets: FacingFacets
    pressure: NDArray[np.float64]  # (m,) [Pa]
    gap: NDArray[np.float64]  # (m,) [m]
    state: NDArray[np.int64]  # (m,) OPEN, SLIDING or STUCK
    u: NDArray[np.float64]  # (n,) [m] displacements of the free dofs
    hard: NDArray[np.float64]  # (m,) [Pa/m] stiffness of the layers by which faces are kept apart
    rough: NDArray[np.float64]  # (m,) [m/Pa] compliance of rough faces, lambda / p
    bolts: NDArray[np.float64]  # (m,) [Pa/m] by which bolts resist the sliding of a facet
    friction: NDArray[np.float64]  # (m,)
    shear: NDArray[np.float64]  # (2, m) [N] that STUCK facets carry, against their opening
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


class CondensedContact(NamedTuple):
    """An interface condensed on the reference in which all of it is closed."""

    facets: FacingFacets
    stiffness: NDArray[np.float64]  # (m,) [Pa/m] k of the layers
    C: csr_matrix  # (3 m, n) openings of the free dofs, as those of the facets
    W: NDArray[np.float64]  # (m, m) [m/N]
    factor: Factor  # of K_r


def condensed(
    K,
    M,
    T: csr_matrix,
    facets: FacingFacets,
    stiffness: NDArray[np.float64],
    *,
    shift: float = 0.0,
) -> CondensedContact:
    """The interface of a model with K, M (n, n) and T (ndof, n) in which it is open, condensed.

    A structure that floats takes a `shift` > 0 [rad^2/s^2], K + shift M, whose share in the
    displacements under forces in balance is shift / omega^2 of the lowest elastic mode.
    """
    C, m = csr_matrix(facets.C @ T), len(facets.area)
    C_n = C[:m]
    K_r = K + C_n.T @ diags_array(stiffness * facets.area) @ C_n + shift * M
    factor = factorised(K_r.tocsc())
    return CondensedContact(facets, stiffness, C, compliance(C_n, factor), factor)


def compliance(C: csr_matrix, factor: Factor, *, at_once: int = 64) -> NDArray[np.float64]:
    """W = C K^-1 C^T (r, r) [m/N] of openings C (r, n), with the factor of K, by `at_once`
    right-hand sides in one solution."""
    W = np.empty((C.shape[0],) * 2)
    for first in range(0, len(W), at_once):
        block = slice(first, first + at_once)
        W[:, block] = C @ factor.solve(C[block].T.toarray())
    return (W + W.T) / 2


def preloaded_contact(
    contact: CondensedContact, F: NDArray[np.float64], gap: NDArray[np.float64] | None = None
) -> PreloadedContact:
    """The zone under forces F (n,) [N] without friction; `gap` (m,) [m] replaces the facets' own.

    Raises ValueError where no state was found, as for forces that open all of the contact of a body
    that nothing else holds.
    """
    facets, W = contact.facets, contact.W
    m, kA = len(facets.area), contact.stiffness * contact.facets.area
    g_0 = facets.gap if gap is None else gap
    c = contact.C[:m] @ contact.factor.solve(F)

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
    u = contact.factor.solve(F + contact.C[:m].T @ (P + kA * d))
    state = np.where(closed, STUCK, OPEN)
    hard, zero = contact.stiffness, np.zeros(m)
    return PreloadedContact(
        facets, P / facets.area, g_0 + d, state, u, hard, zero, zero, zero, np.zeros((2, m)), step
    )


def joined_stiffness(C: csr_matrix, contact: PreloadedContact) -> csr_matrix:
    """Stiffness (n, n) that closed facets add to K: along the normal, and across it that of the
    layers where they stick and of the bolts where they slide; C (3 m, n) are openings of the free
    dofs."""
    area, on = contact.facets.area, contact.state != OPEN
    k = np.where(on, area / (1 / contact.hard + contact.rough), 0.0)
    across = np.where(contact.state == STUCK, MINDLIN * k, np.where(on, area * contact.bolts, 0.0))
    return csr_matrix(C.T @ diags_array(np.concatenate([k, across, across])) @ C)


def with_friction(
    contact: CondensedContact,
    state: PreloadedContact,
    joined: Callable[[PreloadedContact], Factor],
    F: NDArray[np.float64],
    friction: NDArray[np.float64],
) -> PreloadedContact:
    """The state with SLIDING facets: those whose shear under F, as if all stuck while it grew, is
    beyond friction (m,) times pressure; what slides has no stiffness along the faces any more.

    `joined` factorises K with the stiffness of a state.
    """
    m, k = len(contact.facets.area), MINDLIN * contact.stiffness
    slides, stress = (friction == 0) & (state.state == STUCK), np.zeros((2, m))
    for _ in range(MAX_STEPS):
        state = state._replace(state=np.where(slides, SLIDING, state.state))
        if not (state.state == STUCK).any():
            break
        stress = -k * (contact.C[m:] @ joined(state).solve(F)).reshape(2, m)
        slides = (state.state == STUCK) & (np.hypot(*stress) > friction * state.pressure)
        if not slides.any():
            break
    shear = np.where(state.state == STUCK, stress, 0.0) * contact.facets.area
    return state._replace(friction=friction, shear=shear)


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
