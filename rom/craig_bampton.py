"""Craig-Bampton reduction: constraint modes of a boundary and fixed-interface modes of the rest.

    T = [ I        0   ]   K_ii Psi = -K_ib,   K_ii phi = M_ii phi omega^2
        [ Psi     phi  ]
    K_r = diag(K_bb + K_bi Psi, omega^2),   M_r = T^T M T

The static response to forces on the boundary is exact without any mode.
Craig and Bampton, AIAA Journal 6 (1968) 1313.
"""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from rom.factorisation import (
    EigenPairs,
    Factorise,
    Pencil,
    ReductionError,
    lowest_modes,
    modes_below,
    pencil,
    solutions,
    superlu,
    symmetric,
)
from rom.free_modes import require_one_choice
from rom.health import require_faithful
from rom.reduced_model import ReducedModel, contact_functional, receptance
from rom.truncation import DAMPING, frequencies, likely_cutoff_hz, rms


class Partition(NamedTuple):
    """Boundary and interior dof indices, and the blocks of a matrix between them."""

    boundary: np.ndarray
    interior: np.ndarray

    def blocks(self, A: sp.csc_array) -> tuple[sp.csc_array, sp.csc_array, sp.csc_array]:
        """A_bb, A_ib, A_ii."""
        b, i = self.boundary, self.interior
        columns = A[:, b]
        return columns[b], columns[i], A[:, i][i]


def craig_bampton(
    K: ArrayLike | sp.sparray,
    M: ArrayLike | sp.sparray,
    w: ArrayLike,
    boundary: ArrayLike,
    *,
    n_modes: int | None = None,
    cutoff_hz: float | None = None,
    error: float | None = None,
    to_hz: float | None = None,
    shift: float | None = None,
    C: ArrayLike | sp.sparray | None = None,
    factorise: Factorise = superlu,
    provenance: dict[str, str] | None = None,
) -> ReducedModel:
    """Reduce K, M (n, n) to the dofs in boundary (b,) and k fixed-interface modes.

    Give n_modes, or cutoff_hz [Hz] for all fixed-interface modes below it, or error and to_hz [Hz]
    for as many as keep the receptance at the contact to a relative rms error up to that frequency;
    with to_hz the result states its error. w (n,) may only load the boundary. One factorisation
    of K_ii serves constraint modes and fixed-interface modes; factorise(A) returns an object with
    .solve. shift is refused: constraint modes need K_ii itself, which a held boundary makes
    positive definite even where K floats.
    Raises ReductionError with one sentence where the result would not be right.
    """
    K, M = symmetric(K, "K"), symmetric(M, "M")
    w = contact_functional(w, K.shape[0])
    part = partition(boundary, w)
    require_one_choice(n_modes, cutoff_hz, error, to_hz)
    interior = _held_interior(part, K, M, factorise, shift)
    psi = -solutions(interior.factor, part.blocks(K)[1])
    _require_constraint_modes(interior, part.blocks(K)[1], psi, w[part.boundary])
    C = None if C is None else symmetric(C, "C")
    cutoff = likely_cutoff_hz(error, to_hz) if error is not None else cutoff_hz
    while True:
        pairs = _fixed_interface_modes(interior, n_modes, cutoff)
        reduced = _projected(part, K, M, C, w, psi, pairs, dict(provenance or {}))
        if to_hz is not None:
            reduced = reduced._replace(error=_error(interior, part, K, M, w, reduced, to_hz))
        if error is None or reduced.error <= error:
            break
        cutoff *= 1.4
    require_faithful(reduced, K, M)
    return reduced


def _fixed_interface_modes(
    interior: Pencil, n_modes: int | None, cutoff_hz: float | None
) -> EigenPairs:
    if n_modes is not None:
        return lowest_modes(interior, n_modes)
    return modes_below(interior, cutoff_hz)


def _projected(
    part: Partition,
    K: sp.csc_array,
    M: sp.csc_array,
    C: sp.csc_array | None,
    w: np.ndarray,
    psi: np.ndarray,
    pairs: EigenPairs,
    provenance: dict[str, str],
) -> ReducedModel:
    K_bb, K_ib, _ = part.blocks(K)
    omega, phi = pairs
    T = basis(part, psi, phi)
    return ReducedModel(
        K=_block_diagonal(K_bb + K_ib.T @ psi, omega**2),
        M=_projected_mass(part, M, psi, phi),
        C=None if C is None else _symmetrised(T.T @ (C @ T)),
        w=np.append(w[part.boundary], np.zeros(len(omega))),
        T=T,
        kind="craig-bampton",
        n_boundary=len(part.boundary),
        provenance=provenance,
    )


def _error(
    interior: Pencil,
    part: Partition,
    K: sp.csc_array,
    M: sp.csc_array,
    w: np.ndarray,
    reduced: ReducedModel,
    to_hz: float,
) -> float:
    """Relative rms error of the receptance up to to_hz, from the forces it leaves inside.

    With r = w - D T q and T^T r = 0 the error is r^T D^-1 r; r lies in the interior beyond the
    kept modes, where D is close to K_ii: |r_i^T K_ii^-1 r_i| / (1 - omega^2 / omega_{k+1}^2).
    """
    omega = np.sqrt(np.diag(reduced.K)[len(part.boundary) :])
    if len(omega) == len(part.interior):
        return 0.0
    highest = omega[-1] if len(omega) else np.inf
    if highest <= 2 * np.pi * to_hz:
        return np.inf
    left = []
    for s in 2 * np.pi * frequencies(to_hz, 8):
        stiffness = reduced.K * (1 + 2j * DAMPING) - s**2 * reduced.M
        u = reduced.T @ np.linalg.solve(stiffness, reduced.w)
        r = (w - K @ u * (1 + 2j * DAMPING) + s**2 * (M @ u))[part.interior]
        inside = interior.factor.solve(np.column_stack([r.real, r.imag]))
        left.append(r @ (inside @ [1, 1j]) / (1 - (s / highest) ** 2))
    return rms(np.array(left)) / rms(receptance(reduced, None, frequencies(to_hz), zeta=DAMPING))


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


def _held_interior(
    part: Partition, K: sp.csc_array, M: sp.csc_array, factorise: Factorise, shift: float | None
) -> Pencil:
    if shift:
        raise ReductionError(
            f"shift={shift:g} would make the constraint modes inexact; leave it out, K_ii is "
            f"positive definite once the boundary is held."
        )
    held = pencil(part.blocks(K)[2], part.blocks(M)[2], factorise)
    if held.sigma:
        raise ReductionError(
            "the interior still floats with the boundary held, or cannot be told from one that "
            "does beside its largest stiffness; add boundary degrees of freedom, tie the loose "
            "part, replace joints of extreme stiffness by rigid ones, or take free modes."
        )
    return held


def _require_constraint_modes(
    interior: Pencil, K_ib: sp.csc_array, psi: np.ndarray, w: np.ndarray
) -> None:
    left = interior.K @ (psi @ w) + K_ib @ w
    error = left @ interior.factor.solve(left)
    energy = (psi @ w) @ (interior.K @ (psi @ w))
    if error > 1e-16 * energy:
        raise ReductionError(
            f"the constraint modes leave forces inside (relative {np.sqrt(error / energy):.1e} in "
            f"energy norm, allowed 1e-8); the factorisation was not accurate enough."
        )


def basis(part: Partition, psi: np.ndarray, phi: np.ndarray) -> np.ndarray:
    """T (n, b + k) in the order of the full dofs."""
    b = len(part.boundary)
    T = np.zeros((b + len(part.interior), b + phi.shape[1]))
    T[part.boundary, np.arange(b)] = 1
    T[part.interior, :b] = psi
    T[part.interior, b:] = phi
    return T


def _block_diagonal(K_boundary: np.ndarray, squared: np.ndarray) -> np.ndarray:
    b, k = len(K_boundary), len(squared)
    K = np.zeros((b + k, b + k))
    K[:b, :b] = _symmetrised(K_boundary)
    K[b:, b:] = np.diag(squared)
    return K


def _projected_mass(
    part: Partition, M: sp.csc_array, psi: np.ndarray, phi: np.ndarray
) -> np.ndarray:
    M_bb, M_ib, M_ii = part.blocks(M)
    inertia = M_ii @ psi + M_ib
    M_boundary = M_bb + M_ib.T @ psi + psi.T @ inertia
    coupling = phi.T @ inertia
    return np.block([[_symmetrised(M_boundary), coupling.T], [coupling, np.eye(phi.shape[1])]])


def _symmetrised(A: np.ndarray) -> np.ndarray:
    A = np.asarray(A)
    return (A + A.T) / 2
