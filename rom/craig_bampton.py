"""Craig-Bampton reduction: constraint modes of a boundary and fixed-interface modes of the rest.

    T = [ I        0   ]   K_ii Psi = -K_ib,   K_ii phi = M_ii phi omega^2
        [ Psi     phi  ]
    K_r = diag(K_bb + K_bi Psi, omega^2),   M_r = T^T M T

The static response to forces on the boundary is exact without any mode: what a residual vector does
for free modes, the constraint modes do here.
Craig and Bampton, AIAA Journal 6 (1968) 1313.
"""

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike
from scipy.linalg import block_diag

from beadwave.rom.contact_modes import FinerModes, contact_modes, finer_space, static_shapes
from beadwave.rom.factorisation import Factorise, Solver, superlu, symmetric
from beadwave.rom.fixed_interface import (
    FixedInterface,
    fixed_interface,
    interior_pencil,
    ritz_pairs,
    whole_pencil,
)
from beadwave.rom.health import require_faithful
from beadwave.rom.lanczos import known_modes, lowest_modes, modes_below, no_modes
from beadwave.rom.reduced_model import ReducedModel, contact_functional, modal, of_modes
from beadwave.rom.selection import Selection, require_selection
from beadwave.rom.tall import gram, shares
from beadwave.rom.truncation import LOSS, first_cutoff_hz, frequencies, rms, size


def craig_bampton(
    K: ArrayLike | sp.sparray,
    M: ArrayLike | sp.sparray,
    w: ArrayLike,
    boundary: ArrayLike,
    selection: Selection,
    *,
    C: ArrayLike | sp.sparray | None = None,
    factorise: Factorise = superlu,
    factor: Solver | None = None,
) -> ReducedModel:
    """Reduce K, M (n, n) to the dofs in boundary (b,) and the fixed-interface modes selected.

    K [N/m], M [kg] and C [N s/m] (n, n) are symmetric; w (n,) may only load the boundary. The
    coordinates are the displacements of the boundary, in its order, then the modes by rising
    frequency. One factorisation of K_ii, which a held boundary makes positive definite even where K
    floats, serves constraint modes and fixed-interface modes; factorise(A) returns an object with
    .solve. `factor`, that of a K that is held, replaces it. A cutoff and the choice "lowest" are of
    the fixed-interface modes; "contact" chooses free modes by the contact and keeps what they do
    inside as fixed-interface modes.
    Raises ReductionError with one sentence where the result would not be right: for matrices that
    are not symmetric, a w that loads the inside, a boundary that does not hold it, a selection that
    contradicts itself, modes that are not M-orthonormal, and a result that is not T^T K T.
    """
    K, M = symmetric(K, "K"), symmetric(M, "M")
    w = contact_functional(w, K.shape[0])
    require_selection(selection)
    n_modes, error, to_hz = selection.n_modes, selection.error, selection.to_hz

    # constraint modes: unit motion of the boundary, carried statically inside, K_ii Psi = -K_ib
    fixed = fixed_interface(K, M, w, boundary, factorise, factor)
    b, i, Psi = fixed.boundary, fixed.interior, fixed.psi
    C = None if C is None else symmetric(C, "C")

    if selection.by_contact:
        # free modes that the contact moves, those handed in among them: phi_i - Psi phi_b is what
        # they do inside, and Ritz pairs of K_ii and M_ii make fixed-interface modes of that
        problem, modes = whole_pencil(fixed), selection.modes
        retained = no_modes(len(w)) if modes is None else known_modes(problem, *modes)
        free, _, stated, finer_modes = contact_modes(problem, w, retained, selection)
        # within T: a second matrix of their size was 0.3 GB at a million unknowns
        T = np.empty((len(w), len(b) + len(free.omega)), order="F")
        phi = T[:, len(b) :]
        phi[:] = free.phi
        del free
        for c in shares(phi.shape[1]):
            phi[:, c] -= Psi @ phi[b, c]
        omega, phi = ritz_pairs(K, M, phi)
        T[:, : len(b)] = Psi
        reduced = projected(fixed, C, omega, T[:, : len(b) + len(omega)])

        # constraint modes and these span the free modes and their residual vector, whose error
        # bounds this one
        n_static = static_shapes(modal(reduced).omega, omega.max(initial=0.0), to_hz)
        reduced = reduced._replace(error=stated, n_residual=n_static)
    else:
        # fixed-interface modes, K_ii phi = M_ii phi omega^2: the lowest; with an error, those up
        # to a cutoff that rises until the error is met
        inside = interior_pencil(fixed)
        cutoff_hz = selection.cutoff_hz if error is None else first_cutoff_hz(error, to_hz)
        while True:
            if n_modes is None:
                pairs = modes_below(inside, cutoff_hz)
            else:
                pairs = lowest_modes(inside, n_modes)
            phi = np.zeros((len(w), len(pairs.omega)))
            phi[i] = pairs.phi
            reduced = projected(fixed, C, pairs.omega, np.column_stack([Psi, phi]))
            if to_hz is not None:
                reduced = reduced._replace(error=truncation_error(fixed, reduced, phi, to_hz))
            if error is None or reduced.error <= error:
                break
            cutoff_hz *= 1.4
        del inside, pairs, phi  # (n, k) and matrices, not to be held next to the finer model
        if selection.finer_hz is not None:
            problem, finer_hz = whole_pencil(fixed), selection.finer_hz
            space = finer_space(problem, w, no_modes(len(w)), finer_hz, len(reduced.w))
            finer_modes = FinerModes(*space.pairs)

    # T^T K T = K_r and T^T M T = M_r on a random vector, both definite, or the sentence says why
    finer = None if selection.finer_hz is None else of_modes(*finer_modes, w, C)
    reduced = reduced._replace(finer=finer)
    require_faithful(reduced, K, M)
    return reduced


def projected(
    fixed: FixedInterface, C: sp.csc_array | None, omega: np.ndarray, T: np.ndarray
) -> ReducedModel:
    """K, M, C (b + k, b + k) and w (b + k,) on T = [[1, 0], [Psi, phi]] (n, b + k), phi (n, k) the
    fixed-interface modes, zero on the boundary, and omega (k,) [rad/s] their frequencies.

    Block by block where a block is known: the product T^T K T would lose log10(cond K) digits.
    K_bi phi + Psi^T K_ii phi = 0, so that K couples boundary and modes nowhere; M does.
    """
    b = fixed.boundary
    M = _symmetrised(gram(T, fixed.M))
    M[len(b) :, len(b) :] = np.eye(len(omega))
    return ReducedModel(
        K=block_diag(_symmetrised(fixed.condensed), np.diag(omega**2)),
        M=M,
        C=None if C is None else _symmetrised(T.T @ (C @ T)),
        w=np.append(fixed.w[b], np.zeros(len(omega))),
        T=T,
        kind="craig-bampton",
        n_boundary=len(b),
        notes={},
    )


def truncation_error(
    fixed: FixedInterface, reduced: ReducedModel, phi: np.ndarray, to_hz: float
) -> float:
    """Relative rms error of the receptance up to to_hz that the modes left out, j > k, make.

    With L_j = phi_j^T (M_ii Psi + M_ib) and the boundary moving by q_b (b,) it is
    s^4 sum (L_j q_b)^2 / (omega_j^2 - s^2) <= s^4 q_b^T G q_b / (1 - s^2 / omega_{k+1}^2) with
    G = sum L_j^T L_j / omega_j^2, what K_ii^-1 has beyond the modes phi (n, k) of the model.
    Infinite while these end below to_hz.
    """
    b = reduced.n_boundary
    squared = np.diag(reduced.K)[b:]
    if len(squared) == len(fixed.interior):
        return 0.0
    highest = np.sqrt(squared.max(initial=0.0))
    if highest <= 2 * np.pi * to_hz:
        return np.inf

    # G, projected on both sides: the difference of the two sums alone would lose digits
    inertia, L = fixed.M @ fixed.psi, reduced.M[b:, :b]
    beyond = fixed.clamped.solve(inertia) - phi @ (L / squared[:, None])
    G = (inertia - fixed.M @ (phi @ L)).T @ beyond

    # q_b under a unit force at the contact; omega_k, which is known, for omega_{k+1} above it
    wall, s = modal(reduced), 2 * np.pi * frequencies(to_hz)
    moved = wall.phi / (wall.omega**2 * (1 + 1j * LOSS) - s[:, None] ** 2)
    q = moved @ wall.vectors[:b].T
    missed = s**4 * np.einsum("ij,jk,ik->i", q, G, q) / (1 - (s / highest) ** 2)
    return rms(missed) / size(moved @ wall.phi)


def _symmetrised(A: np.ndarray) -> np.ndarray:
    A = np.asarray(A)
    return (A + A.T) / 2
