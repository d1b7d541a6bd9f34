"""Craig-Bampton reduction: constraint modes of a boundary and fixed-interface modes of the rest.

    T = [ I        0   ]   K_ii Psi = -K_ib,   K_ii phi = M_ii phi omega^2
        [ Psi     phi  ]
    K_r = diag(K_bb + K_bi Psi, omega^2),   M_r = T^T M T

The static response to forces on the boundary is exact without any mode.
Craig and Bampton, AIAA Journal 6 (1968) 1313.
"""

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike
from scipy.linalg import block_diag

from rom.contact_modes import finer_space, static_shapes
from rom.factorisation import Factor, Factorise, superlu, symmetric
from rom.fixed_interface import (
    FixedInterface,
    fixed_interface,
    interior,
    modes_inside,
    none_of,
    whole_pencil,
)
from rom.health import require_faithful
from rom.lanczos import EigenPairs, lowest_modes, modes_below
from rom.reduced_model import ReducedModel, contact_functional, modal, of_modes
from rom.selection import Selection, require_selection
from rom.tall import gram
from rom.truncation import LOSS, first_cutoff_hz, frequencies, rms, size


def craig_bampton(
    K: ArrayLike | sp.sparray,
    M: ArrayLike | sp.sparray,
    w: ArrayLike,
    boundary: ArrayLike,
    asked: Selection,
    *,
    C: ArrayLike | sp.sparray | None = None,
    factorise: Factorise = superlu,
    factor: Factor | None = None,
) -> ReducedModel:
    """Reduce K, M (n, n) to the dofs in boundary (b,) and the fixed-interface modes asked for.

    w (n,) may only load the boundary. One factorisation of K_ii, which a held boundary makes
    positive definite even where K floats, serves constraint modes and fixed-interface modes;
    factorise(A) returns an object with .solve; with the factor of a K that is held nothing is
    factorised. A cutoff and choice "lowest" speak of the
    fixed-interface modes; "contact" takes what the free modes of that choice do inside.
    Raises ReductionError with one sentence where the result would not be right.
    """
    K, M = symmetric(K, "K"), symmetric(M, "M")
    w = contact_functional(w, K.shape[0])
    require_selection(asked)
    fixed = fixed_interface(K, M, w, boundary, factorise, factor)
    C = None if C is None else symmetric(C, "C")
    if asked.by_contact:
        pairs, stated, space = modes_inside(fixed, asked)
        reduced = _projected(fixed, C, pairs)
        shapes = static_shapes(modal(reduced).omega, pairs.omega.max(initial=0.0), asked.to_hz)
        reduced = reduced._replace(error=stated, n_residual=shapes)
    else:
        reduced = _lowest(fixed, C, asked)
        space = _finer(fixed, len(reduced.w), asked.finer_hz)
    finer = None if asked.finer_hz is None else of_modes(*space, w, C)
    reduced = reduced._replace(finer=finer)
    require_faithful(reduced, K, M)
    return reduced


def _finer(fixed: FixedInterface, n_modes: int, finer_hz: float | None) -> EigenPairs | None:
    if finer_hz is None:
        return None
    return finer_space(whole_pencil(fixed), fixed.w, none_of(fixed), finer_hz, n_modes).pairs


def _lowest(fixed: FixedInterface, C: sp.csc_array | None, asked: Selection) -> ReducedModel:
    """The lowest fixed-interface modes, as many as the error asks for."""
    error, to_hz, cutoff = asked.error, asked.to_hz, asked.cutoff_hz
    if error is not None:
        cutoff = first_cutoff_hz(error, to_hz)
    inside = interior(fixed)
    while True:
        if asked.n_modes is None:
            pairs = modes_below(inside, cutoff)
        else:
            pairs = lowest_modes(inside, asked.n_modes)
        phi = np.zeros((len(fixed.w), len(pairs.omega)))
        phi[fixed.part.interior] = pairs.phi
        reduced = _projected(fixed, C, EigenPairs(pairs.omega, phi))
        if to_hz is not None:
            reduced = reduced._replace(error=_error(fixed, reduced, phi, to_hz))
        if error is None or reduced.error <= error:
            return reduced
        cutoff *= 1.4


def _projected(fixed: FixedInterface, C: sp.csc_array | None, pairs: EigenPairs) -> ReducedModel:
    omega, b = pairs.omega, len(fixed.part.boundary)
    T = np.column_stack([fixed.psi, pairs.phi])
    M = _symmetrised(gram(T, fixed.M))
    M[b:, b:] = np.eye(len(omega))
    return ReducedModel(
        K=block_diag(_symmetrised(fixed.condensed), np.diag(omega**2)),
        M=M,
        C=None if C is None else _symmetrised(T.T @ (C @ T)),
        w=np.append(fixed.w[fixed.part.boundary], np.zeros(len(omega))),
        T=T,
        kind="craig-bampton",
        n_boundary=b,
        notes={},
    )


def _error(fixed: FixedInterface, reduced: ReducedModel, phi: np.ndarray, to_hz: float) -> float:
    """Relative rms error of the receptance up to to_hz that the modes left out, j > k, make.

    With L_j = phi_j^T (M_ii Psi + M_ib) and the boundary moving by q_b (b,) it is
    s^4 sum (L_j q_b)^2 / (omega_j^2 - s^2) <= s^4 q_b^T G q_b / (1 - s^2 / omega_{k+1}^2) with
    G = sum L_j^T L_j / omega_j^2, what K_ii^-1 has beyond the modes phi (n, k) that were kept.
    """
    b = reduced.n_boundary
    squared = np.diag(reduced.K)[b:]
    if len(squared) == len(fixed.part.interior):
        return 0.0
    highest = np.sqrt(squared.max(initial=0.0))
    if highest <= 2 * np.pi * to_hz:
        return np.inf
    inertia, L = fixed.M @ fixed.psi, reduced.M[b:, :b]
    # projected on both sides: the difference of the two sums alone would lose digits
    beyond = fixed.clamped.solve(inertia) - phi @ (L / squared[:, None])
    G = (inertia - fixed.M @ (phi @ L)).T @ beyond
    wall, s = modal(reduced), 2 * np.pi * frequencies(to_hz)
    moved = wall.phi / (wall.omega**2 * (1 + 1j * LOSS) - s[:, None] ** 2)
    q = moved @ wall.vectors[:b].T
    missed = s**4 * np.einsum("ij,jk,ik->i", q, G, q) / (1 - (s / highest) ** 2)
    return rms(missed) / size(moved @ wall.phi)


def _symmetrised(A: np.ndarray) -> np.ndarray:
    A = np.asarray(A)
    return (A + A.T) / 2
