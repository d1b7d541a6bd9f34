"""A structure held at its boundary: the interior's factor, constraint modes, fixed-interface modes.

    K_ii Psi = -K_ib,   S = K_bb + K_bi Psi,   K x = y:  S x_b = y_b + Psi^T y_i,
    x_i = K_ii^-1 y_i + Psi x_b

so that the factor of K_ii serves K as well; and that of K serves K_ii, with Z = K^-1 [1; 0]

    Psi = Z_i Z_b^-1,   x_i = z_i - Psi z_b with z = K^-1 [0; y_i].

What a field does inside is what it has beyond the
constraint modes, x_i - Psi x_b.
"""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike
from scipy.linalg import LinAlgError, cho_factor, cho_solve, eigh

from rom.contact_modes import contact_modes
from rom.factorisation import Factor, Factorise, Pencil, ReductionError, solutions
from rom.floating import is_held, pencil
from rom.lanczos import EigenPairs, known_modes
from rom.selection import Selection


class Partition(NamedTuple):
    """Boundary and interior dof indices, and the blocks of a matrix between them."""

    boundary: np.ndarray
    interior: np.ndarray

    def blocks(self, A: sp.csc_array) -> tuple[sp.csc_array, sp.csc_array, sp.csc_array]:
        """A_bb, A_ib, A_ii."""
        b, i = self.boundary, self.interior
        columns = A[:, b]
        return columns[b], columns[i], A[:, i][i]


class FixedInterface(NamedTuple):
    """K and M (n, n), w (n,) at the contact, and the structure with its boundary held; psi (i, b)
    are the constraint modes. `whole` is the factor of K, where there is one."""

    K: sp.csc_array
    M: sp.csc_array
    w: np.ndarray
    part: Partition
    interior: Pencil
    psi: np.ndarray
    whole: Factor | None

    @property
    def condensed(self) -> np.ndarray:
        """S (b, b) = K_bb + K_bi Psi [N/m]."""
        K_bb, K_ib, _ = self.part.blocks(self.K)
        S = np.asarray(K_bb + K_ib.T @ self.psi)
        return (S + S.T) / 2


def fixed_interface(
    K: sp.csc_array,
    M: sp.csc_array,
    w: np.ndarray,
    boundary: ArrayLike,
    factorise: Factorise,
    whole: Factor | None = None,
) -> FixedInterface:
    """The structure held at the dofs in boundary (b,), by the factor of K where it is handed in;
    raises ReductionError."""
    part = partition(boundary, w)
    _, K_ib, K_ii = part.blocks(K)
    M_ii = part.blocks(M)[2]
    if whole is None:
        interior = _factorised(K_ii, M_ii, factorise)
        psi = -solutions(interior.factor, K_ib)
    else:
        clamped = _Clamped(whole, part)
        interior = Pencil(K_ii, M_ii, clamped, 0.0)
        # Z_b of a soft structure is nearly singular, which would cost psi half its digits
        clamped.psi -= solutions(clamped, K_ii @ clamped.psi + K_ib)
        psi = clamped.psi
    _require_constraint_modes(interior, K_ib, psi, w[part.boundary])
    return FixedInterface(K, M, w, part, interior, psi, whole)


def _factorised(K_ii: sp.csc_array, M_ii: sp.csc_array, factorise: Factorise) -> Pencil:
    interior = pencil(K_ii, M_ii, factorise)
    if interior.sigma:
        raise ReductionError(
            "the interior still floats with the boundary fixed, or cannot be told from one that "
            "does beside its largest stiffness; add boundary degrees of freedom, tie the loose "
            "part, replace joints of extreme stiffness by rigid ones, or take free modes."
        )
    return interior


def partition(boundary: ArrayLike, w: np.ndarray) -> Partition:
    """Boundary (b,) as given and the interior, ascending; w (n,) must vanish on the latter."""
    boundary = np.asarray(boundary)
    n = len(w)
    if boundary.dtype == bool:
        boundary = np.flatnonzero(boundary)
    if not len(boundary) or boundary.min() < 0 or boundary.max() >= n:
        raise ReductionError(f"boundary must hold dof indices from 0 to {n - 1}, at least one.")
    interior = np.setdiff1d(np.arange(n), boundary)
    if len(interior) + len(boundary) != n:
        raise ReductionError("boundary names a degree of freedom twice.")
    loaded = np.count_nonzero(w[interior])
    if loaded:
        raise ReductionError(
            f"w loads {loaded} interior degrees of freedom; add them to the boundary, "
            f"or the static response at the contact is not exact."
        )
    return Partition(boundary, interior)


def _require_constraint_modes(
    interior: Pencil, K_ib: sp.csc_array, psi: np.ndarray, w: np.ndarray
) -> None:
    residual = interior.K @ (psi @ w) + K_ib @ w
    error = residual @ interior.factor.solve(residual)
    energy = (psi @ w) @ (interior.K @ (psi @ w))
    if error > 1e-16 * energy:
        raise ReductionError(
            f"the constraint modes leave forces inside (relative {np.sqrt(error / energy):.1e} in "
            f"energy norm, allowed 1e-8); the factorisation was not accurate enough."
        )


def _floats() -> ReductionError:
    return ReductionError(
        "the structure, or a part of it, floats freely or on springs as soft as that, and "
        "constraint modes cannot say which of its modes the contact moves; stiffen the softest "
        "joints, take choice 'lowest', or free modes."
    )


class _Clamped:
    """Solves with K_ii by the factor of K."""

    def __init__(self, whole: Factor, part: Partition) -> None:
        self._whole, (b, i) = whole, part
        self._part, n = part, len(b) + len(i)
        unit = sp.csc_array((np.ones(len(b)), (b, np.arange(len(b)))), shape=(n, len(b)))
        Z = solutions(whole, unit)
        self.psi = Z[i] @ np.linalg.inv(Z[b])

    def solve(self, y: np.ndarray) -> np.ndarray:
        b, i = self._part
        z = np.zeros((len(b) + len(i), *y.shape[1:]))
        z[i] = y
        z = self._whole.solve(z)
        return z[i] - self.psi @ z[b]


class _Condensed:
    """Solves with K by the factor of K_ii."""

    def __init__(self, fixed: FixedInterface):
        self._fixed = fixed
        try:
            self._S = cho_factor(fixed.condensed)
        except LinAlgError:
            raise _floats() from None

    def solve(self, y: np.ndarray) -> np.ndarray:
        (b, i), psi = self._fixed.part, self._fixed.psi
        x = np.empty_like(y)
        x[b] = cho_solve(self._S, y[b] + psi.T @ y[i])
        x[i] = self._fixed.interior.factor.solve(y[i]) + psi @ x[b]
        return x


def modes_inside(fixed: FixedInterface, asked: Selection) -> tuple[EigenPairs, float, EigenPairs]:
    """What the free modes that the contact moves do inside, as Ritz pairs of K_ii and M_ii; the
    error that those modes with a residual vector have: theirs is no larger, constraint modes and
    these hold every one of those vectors; and the free modes that they were chosen from."""
    whole = whole_pencil(fixed)
    known = none_of(fixed) if asked.modes is None else known_modes(whole, *asked.modes)
    chosen = contact_modes(whole, fixed.w, known, asked)
    b, i = fixed.part
    inside = chosen.pairs.phi[i] - fixed.psi @ chosen.pairs.phi[b]
    return _ritz(fixed.interior, inside), chosen.error, chosen.space


def whole_pencil(fixed: FixedInterface) -> Pencil:
    """K and M of the structure with its boundary free; raises ReductionError where it floats."""
    whole = Pencil(fixed.K, fixed.M, fixed.whole or _Condensed(fixed), 0.0)
    if fixed.whole is None and not is_held(whole):
        raise _floats()
    return whole


def none_of(fixed: FixedInterface) -> EigenPairs:
    """No modes at all."""
    return EigenPairs(np.zeros(0), np.zeros((len(fixed.w), 0)))


def _ritz(interior: Pencil, Z: np.ndarray) -> EigenPairs:
    """Ritz pairs of the columns of Z; those that add nothing to the others are left out."""
    Z = Z / np.sqrt(np.einsum("ij,ij->j", Z, interior.K @ Z))
    for _ in range(2):  # once leaves rounding over the smallest size
        size, U = eigh(Z.T @ (interior.K @ Z))
        Z = Z @ (U[:, size > 1e-12] / np.sqrt(size[size > 1e-12]))
    inverse_squared, U = eigh(Z.T @ (interior.M @ Z))
    order = np.argsort(-inverse_squared)
    scale = np.sqrt(inverse_squared[order])
    return EigenPairs(1 / scale, Z @ (U[:, order] / scale))
