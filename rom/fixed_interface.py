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

from beadwave.rom.factorisation import EPS, Factorise, Pencil, ReductionError, Solver, solutions
from beadwave.rom.floating import held_pencil, is_held
from beadwave.rom.lanczos import EigenPairs
from beadwave.rom.tall import eighths, gram, shares, squares, turned


class FixedInterface(NamedTuple):
    """K and M (n, n), w (n,) at the contact, and the structure with its boundary held; psi (n, b)
    are the constraint modes, 1 on the boundary. `clamped` solves with K_ii on vectors (n,):
    it does not read their entries on the boundary and returns zeros there. `factor` is that of K,
    where there is one."""

    K: sp.csc_array
    M: sp.csc_array
    w: np.ndarray
    boundary: np.ndarray  # (b,) dofs, in the order in which they are given
    interior: np.ndarray  # (n - b,) dofs, ascending
    clamped: Solver
    psi: np.ndarray
    factor: Solver | None

    @property
    def condensed(self) -> np.ndarray:
        """S (b, b) = K_bb + K_bi Psi [N/m]."""
        rows, n = self.K[:, self.boundary].T, len(self.boundary)
        S = np.empty((n, n))
        for c in shares(n):  # scipy's product copies what it multiplies by
            S[:, c] = rows @ self.psi[:, c]
        return (S + S.T) / 2


def fixed_interface(
    K: sp.csc_array,
    M: sp.csc_array,
    w: np.ndarray,
    boundary: ArrayLike,
    factorise: Factorise,
    factor: Solver | None = None,
) -> FixedInterface:
    """The structure held at the dofs in boundary (b,), indices or a mask, with its constraint
    modes; by the factor of K where that is handed in.

    K [N/m], M [kg] (n, n); w (n,) must vanish inside. Raises ReductionError for indices that are
    out of range or twice in the boundary, for a w that loads the inside, for an inside that floats
    with the boundary held, and for constraint modes that leave forces inside.
    """
    # boundary as given, interior ascending
    n, b = len(w), np.asarray(boundary)
    if b.dtype == bool:
        b = np.flatnonzero(b)
    if not len(b) or b.min() < 0 or b.max() >= n:
        raise ReductionError(f"boundary must hold dof indices from 0 to {n - 1}, at least one.")
    i = np.setdiff1d(np.arange(n), b)
    if len(i) + len(b) != n:
        raise ReductionError("boundary names a degree of freedom twice.")
    loaded = np.count_nonzero(w[i])
    if loaded:
        raise ReductionError(
            f"w loads {loaded} interior degrees of freedom; add them to the boundary, "
            f"or the static response at the contact is not exact."
        )

    # constraint modes by the factor of K_ii, which a held boundary makes positive definite
    if factor is None:
        inside = held_pencil(K[:, i][i], M[:, i][i], factorise)
        if inside is None:
            raise ReductionError(
                "the interior still floats with the boundary fixed, or cannot be told from one "
                "that does next to its largest stiffness; add boundary degrees of freedom, tie the "
                "loose part, replace joints of extreme stiffness by rigid ones, or take free modes."
            )
        clamped = _InteriorOfAll(inside.factor, i)
        psi = -solutions(clamped, K[:, b])
        psi[b] = np.eye(len(b))
    else:
        clamped = _InteriorByWhole(factor, b, n)
        psi = clamped.psi
        # Z_b of a soft structure is nearly singular, which costs Psi digits. A correction
        # Psi - K_ii^-1 (K Psi)_i, with K_ii^-1 by the same inaccurate Psi, makes of an error D the
        # error D Z_b K_bi D, the square of the last. Springs to the ground of a millionth of the
        # structure's stiffness take two or three corrections, others one. They end at rounding,
        # which leaves forces inside of 0.2 eps of their terms in a chain, 1.1 eps in a solid, or
        # where the forces no longer halve.
        previous, forces = np.inf, 1.0
        while 4.0 * EPS < forces < 0.5 * previous:
            for c in shares(len(b)):
                psi[:, c] -= clamped.solve(K @ psi[:, c])
            previous, forces = forces, _interior_forces(K, psi, b)
    fixed = FixedInterface(K, M, w, b, i, clamped, psi, factor)

    # the constraint modes under the contact's load leave no forces inside: their energy
    # r^T K_ii^-1 r relative to that of the field
    u = psi @ w[b]
    residual = K @ u
    u[b] = 0.0
    error, energy = residual @ clamped.solve(residual), u @ (K @ u)
    if error > 1e-16 * energy:
        raise ReductionError(
            f"the constraint modes leave forces inside (relative {np.sqrt(error / energy):.1e} in "
            f"energy norm, allowed 1e-8); the factorisation was not accurate enough."
        )
    return fixed


def _interior_forces(K: sp.csc_array, psi: np.ndarray, b: np.ndarray) -> float:
    """Root sum of squares of the forces (K psi)_i, which are zero but for errors, over that of
    |K| p, what their terms sum up to without signs; p (n,) are the norms of the rows of psi."""
    squared, p, terms = 0.0, np.sqrt(np.einsum("ij,ij->i", psi, psi)), 0.0
    for c in shares(len(b)):
        forces = K @ psi[:, c]
        forces[b] = 0.0
        squared += np.sum(forces**2)
    for c in eighths(len(p)):
        terms = terms + abs(K[:, c]) @ p[c]
    return float(np.sqrt(squared) / np.linalg.norm(terms))


def interior_pencil(fixed: FixedInterface) -> Pencil:
    """K_ii and M_ii (i, i) as matrices of their own, with the factor of K_ii: its modes are the
    fixed-interface modes."""
    i = fixed.interior
    K_ii, M_ii = (A[:, i][i] for A in (fixed.K, fixed.M))
    return Pencil(K_ii, M_ii, _InteriorAlone(fixed.clamped, i, len(fixed.w)))


def whole_pencil(fixed: FixedInterface) -> Pencil:
    """K and M of the structure with its boundary free; raises ReductionError where it floats."""
    K, M = fixed.K, fixed.M
    if fixed.factor is not None:
        return Pencil(K, M, fixed.factor)
    try:
        S = cho_factor(fixed.condensed)
        problem = Pencil(K, M, _WholeByInterior(fixed.clamped, fixed.psi, S))
        is_sound = is_held(problem)
    except LinAlgError:  # S is not positive
        is_sound = False
    if not is_sound:
        raise ReductionError(
            "the structure, or a part of it, floats freely or on springs as soft as that, and "
            "constraint modes cannot say which of its modes the contact moves; stiffen the softest "
            "joints, take choice 'lowest', or free modes."
        )
    return problem


def ritz_pairs(K: sp.csc_array, M: sp.csc_array, Z: np.ndarray) -> EigenPairs:
    """Ritz pairs of K and M in the columns of Z (n, k), which are written over: omega (j,) [rad/s]
    rising, phi (n, j) mass-normalised.

    Columns that add nothing to the others are left out, j <= k. Every column must have a strain
    energy: K holds the structure, or Z is zero on a boundary that does.
    """
    # K-orthonormal, from unit length on, so that rank shows in the eigenvalues of the Gram matrix
    Z /= np.sqrt(squares(Z, K))
    for _ in range(2):  # once leaves rounding over the smallest size
        size, U = eigh(gram(Z, K))
        Z = turned(Z, U[:, size > 1e-12] / np.sqrt(size[size > 1e-12]))

    # M u = omega^-2 u among them, which keeps the lowest frequencies to rounding
    inverse_squared, U = eigh(gram(Z, M))
    order = np.argsort(-inverse_squared)
    scale = np.sqrt(inverse_squared[order])
    return EigenPairs(1 / scale, turned(Z, U[:, order] / scale))


class _InteriorByWhole:
    """Solves with K_ii by the factor of K, in vectors of all dofs: z = K^-1 [0; y_i] moves the
    boundary by z_b, and z - Psi z_b does not, with the same forces inside."""

    def __init__(self, factor: Solver, b: np.ndarray, n: int) -> None:
        self._factor, self._b = factor, b
        unit = sp.csc_array((np.ones(len(b)), (b, np.arange(len(b)))), shape=(n, len(b)))
        Z = solutions(factor, unit)
        self.psi = turned(Z, np.linalg.inv(Z[b]))
        self.psi[b] = np.eye(len(b))

    def solve(self, y: np.ndarray) -> np.ndarray:
        y = y.copy()
        y[self._b] = 0.0
        z = self._factor.solve(y)
        z -= self.psi @ z[self._b]
        z[self._b] = 0.0
        return z


class _InteriorOfAll(NamedTuple):
    """Solves with K_ii by its own factor, in vectors of all dofs."""

    factor: Solver
    interior: np.ndarray

    def solve(self, y: np.ndarray) -> np.ndarray:
        x = np.zeros_like(y)
        x[self.interior] = self.factor.solve(y[self.interior])
        return x


class _InteriorAlone(NamedTuple):
    """Solves with K_ii in vectors of the interior (i,), by a solver in vectors of all dofs."""

    clamped: Solver
    interior: np.ndarray
    n: int

    def solve(self, y: np.ndarray) -> np.ndarray:
        x = np.zeros((self.n, *y.shape[1:]))
        x[self.interior] = y
        return self.clamped.solve(x)[self.interior]


class _WholeByInterior(NamedTuple):
    """Solves with K by the factor of K_ii and that of S, the stiffness seen at the boundary:
    x = K_ii^-1 y_i + Psi x_b, S x_b = y_b + Psi^T y_i, the rows of Psi on the boundary being 1."""

    clamped: Solver
    psi: np.ndarray
    S: tuple[np.ndarray, bool]

    def solve(self, y: np.ndarray) -> np.ndarray:
        return self.clamped.solve(y) + self.psi @ cho_solve(self.S, self.psi.T @ y)
