"""A structure held at its boundary: the interior's factor, constraint modes, fixed-interface modes.

    K_ii Psi = -K_ib,   S = K_bb + K_bi Psi,   K x = y:  S x_b = y_b + Psi^T y_i,
    x_i = K_ii^-1 y_i + Psi x_b

so that the factor of K_ii serves K as well; and that of K serves K_ii, with Z = K^-1 [1; 0]

    Psi = Z_i Z_b^-1,   x_i = z_i - Psi z_b with z = K^-1 [0; y_i].

What a field does inside is what it has beyond the constraint modes, x_i - Psi x_b. All vectors have
the dofs of K, [1; Psi] among them and what is zero on the boundary, so that no copy of K_ii is
needed.
"""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike
from scipy.linalg import LinAlgError, cho_factor, cho_solve, eigh

from rom.contact_modes import contact_modes
from rom.factorisation import SHARES, Factor, Factorise, Pencil, ReductionError, solutions
from rom.floating import is_held, pencil
from rom.lanczos import EigenPairs, known_modes
from rom.selection import Selection
from rom.tall import gram, shares, squares, turned

# forces inside, of sums of their terms: rounding leaves 0.2 eps in a chain, 1.1 eps in a solid
EXACT = 4.0 * np.finfo(float).eps


class Partition(NamedTuple):
    """Boundary and interior dof indices."""

    boundary: np.ndarray
    interior: np.ndarray


class FixedInterface(NamedTuple):
    """K and M (n, n), w (n,) at the contact, and the structure with its boundary held; psi (n, b)
    are the constraint modes, 1 on the boundary. `clamped` solves with K_ii: what stands on the
    boundary it does not read and returns as zero. `whole` is the factor of K, where there is
    one."""

    K: sp.csc_array
    M: sp.csc_array
    w: np.ndarray
    part: Partition
    clamped: Factor
    psi: np.ndarray
    whole: Factor | None

    @property
    def condensed(self) -> np.ndarray:
        """S (b, b) = K_bb + K_bi Psi [N/m]."""
        S = self.K[:, self.part.boundary].T @ self.psi
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
    b = part.boundary
    if whole is None:
        clamped = _Extended(_inside(K, M, part.interior, factorise), part.interior)
        psi = -solutions(clamped, K[:, b])
        psi[b] = np.eye(len(b))
    else:
        clamped = _Clamped(whole, b, len(w))
        psi = clamped.psi
        # Z_b of a soft structure is nearly singular, which costs Psi digits: an error D of it is
        # D Z_b K_bi D after a correction. Springs to the ground of a millionth of the structure's
        # stiffness take two or three corrections, others one.
        before, forces = np.inf, 1.0
        while EXACT < forces < 0.5 * before:
            for some in shares(len(b)):
                psi[:, some] -= clamped.solve(K @ psi[:, some])
            before, forces = forces, _forces_inside(K, psi, b)
    fixed = FixedInterface(K, M, w, part, clamped, psi, whole)
    _require_constraint_modes(fixed)
    return fixed


def _forces_inside(K: sp.csc_array, psi: np.ndarray, b: np.ndarray) -> float:
    """Root sum of squares of the forces (K psi)_i, which are zero but for errors, over that of
    |K| p, what their terms sum up to without signs; p (n,) are the norms of the rows of psi."""
    squared, p, terms = 0.0, np.sqrt(np.einsum("ij,ij->i", psi, psi)), 0.0
    for some in shares(len(b)):
        forces = K @ psi[:, some]
        forces[b] = 0.0
        squared += np.sum(forces**2)
    for some in shares(len(p), len(p) // SHARES + 1):
        terms = terms + abs(K[:, some]) @ p[some]
    return float(np.sqrt(squared) / np.linalg.norm(terms))


def _inside(K: sp.csc_array, M: sp.csc_array, i: np.ndarray, factorise: Factorise) -> Factor:
    """The factor of K_ii."""
    inside = pencil(K[:, i][i], M[:, i][i], factorise)
    if inside.sigma:
        raise ReductionError(
            "the interior still floats with the boundary fixed, or cannot be told from one that "
            "does beside its largest stiffness; add boundary degrees of freedom, tie the loose "
            "part, replace joints of extreme stiffness by rigid ones, or take free modes."
        )
    return inside.factor


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


def _require_constraint_modes(fixed: FixedInterface) -> None:
    K, b = fixed.K, fixed.part.boundary
    u = fixed.psi @ fixed.w[b]
    residual = K @ u
    u[b] = 0.0
    error, energy = residual @ fixed.clamped.solve(residual), u @ (K @ u)
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

    def __init__(self, whole: Factor, b: np.ndarray, n: int) -> None:
        self._whole, self._b = whole, b
        unit = sp.csc_array((np.ones(len(b)), (b, np.arange(len(b)))), shape=(n, len(b)))
        Z = solutions(whole, unit)
        self.psi = turned(Z, np.linalg.inv(Z[b]))
        self.psi[b] = np.eye(len(b))

    def solve(self, y: np.ndarray) -> np.ndarray:
        y = y.copy()
        y[self._b] = 0.0
        z = self._whole.solve(y)
        z -= self.psi @ z[self._b]
        z[self._b] = 0.0
        return z


class _Extended(NamedTuple):
    """Solves with K_ii by its own factor, in vectors of all dofs."""

    factor: Factor
    interior: np.ndarray

    def solve(self, y: np.ndarray) -> np.ndarray:
        x = np.zeros_like(y)
        x[self.interior] = self.factor.solve(y[self.interior])
        return x


class _Restricted(NamedTuple):
    """Solves with K_ii as it is, (i,), by one that takes vectors of all dofs."""

    clamped: Factor
    interior: np.ndarray
    n: int

    def solve(self, y: np.ndarray) -> np.ndarray:
        x = np.zeros((self.n, *y.shape[1:]))
        x[self.interior] = y
        return self.clamped.solve(x)[self.interior]


class _Condensed:
    """Solves with K by the factor of K_ii."""

    def __init__(self, fixed: FixedInterface):
        self._fixed = fixed
        try:
            self._S = cho_factor(fixed.condensed)
        except LinAlgError:
            raise _floats() from None

    def solve(self, y: np.ndarray) -> np.ndarray:
        psi = self._fixed.psi
        return self._fixed.clamped.solve(y) + psi @ cho_solve(self._S, psi.T @ y)


def interior(fixed: FixedInterface) -> Pencil:
    """K_ii and M_ii as matrices of their own."""
    i = fixed.part.interior
    K_ii, M_ii = (A[:, i][i] for A in (fixed.K, fixed.M))
    return Pencil(K_ii, M_ii, _Restricted(fixed.clamped, i, len(fixed.w)))


def modes_inside(fixed: FixedInterface, asked: Selection) -> tuple[EigenPairs, float, EigenPairs]:
    """What the free modes that the contact moves do inside, as Ritz pairs of K_ii and M_ii; the
    error that those modes with a residual vector have: theirs is no larger, constraint modes and
    these hold every one of those vectors; and the free modes that they were chosen from."""
    whole = whole_pencil(fixed)
    known = none_of(fixed) if asked.modes is None else known_modes(whole, *asked.modes)
    chosen = contact_modes(whole, fixed.w, known, asked)
    inside, b = chosen.pairs.phi, fixed.part.boundary
    for some in shares(inside.shape[1]):
        inside[:, some] -= fixed.psi @ inside[b, some]
    return _ritz(fixed, inside), chosen.error, chosen.space


def whole_pencil(fixed: FixedInterface) -> Pencil:
    """K and M of the structure with its boundary free; raises ReductionError where it floats."""
    whole = Pencil(fixed.K, fixed.M, fixed.whole or _Condensed(fixed))
    if fixed.whole is None and not is_held(whole):
        raise _floats()
    return whole


def none_of(fixed: FixedInterface) -> EigenPairs:
    """No modes at all."""
    return EigenPairs(np.zeros(0), np.zeros((len(fixed.w), 0)))


def _ritz(fixed: FixedInterface, Z: np.ndarray) -> EigenPairs:
    """Ritz pairs of the columns of Z, which are written over and are zero on the boundary; those
    that add nothing to the others are left out."""
    Z /= np.sqrt(squares(Z, fixed.K))
    for _ in range(2):  # once leaves rounding over the smallest size
        size, U = eigh(gram(Z, fixed.K))
        Z = turned(Z, U[:, size > 1e-12] / np.sqrt(size[size > 1e-12]))
    inverse_squared, U = eigh(gram(Z, fixed.M))
    order = np.argsort(-inverse_squared)
    scale = np.sqrt(inverse_squared[order])
    return EigenPairs(1 / scale, turned(Z, U[:, order] / scale))
