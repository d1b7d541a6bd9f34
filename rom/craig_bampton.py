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

from rom.contact_modes import static_shapes
from rom.factorisation import Factorise, ReductionError, superlu, symmetric
from rom.fixed_interface import Held, Partition, held_structure, modes_inside
from rom.free_modes import require_choice, require_one_choice
from rom.health import require_faithful
from rom.lanczos import EigenPairs, lowest_modes, modes_below
from rom.reduced_model import ReducedModel, contact_functional, modal, receptance
from rom.truncation import DAMPING, frequencies, likely_cutoff_hz, rms


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
    choice: str = "lowest",
    modes: tuple[np.ndarray, np.ndarray] | None = None,
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
    positive definite even where K floats. choice "lowest" takes the fixed-interface modes in the
    order of their frequencies; "contact" takes what the free modes of the same choice (see
    rom.contact_modes) do inside, beside those of `modes` (omega, phi (n, k)), which then all stay.
    Raises ReductionError with one sentence where the result would not be right.
    """
    K, M = symmetric(K, "K"), symmetric(M, "M")
    w = contact_functional(w, K.shape[0])
    require_one_choice(n_modes, cutoff_hz, error, to_hz)
    require_choice(choice, n_modes, error, to_hz)
    if shift:
        raise ReductionError(
            f"shift={shift:g} would make the constraint modes inexact; leave it out, K_ii is "
            f"positive definite once the boundary is held."
        )
    held = held_structure(K, M, w, boundary, factorise)
    C = None if C is None else symmetric(C, "C")
    if choice == "contact":
        pairs, stated = modes_inside(held, modes, n_modes=n_modes, error=error, to_hz=to_hz)
        reduced = _projected(held, C, pairs)
        shapes = static_shapes(modal(reduced).omega, pairs.omega.max(initial=0.0), to_hz)
        reduced = reduced._replace(error=stated, n_residual=shapes)
    else:
        reduced = _lowest(held, C, n_modes, cutoff_hz, error, to_hz)
    reduced = reduced._replace(provenance=dict(provenance or {}))
    require_faithful(reduced, K, M)
    return reduced


def _lowest(
    held: Held,
    C: sp.csc_array | None,
    n_modes: int | None,
    cutoff_hz: float | None,
    error: float | None,
    to_hz: float | None,
) -> ReducedModel:
    """The lowest fixed-interface modes, as many as the error asks for."""
    cutoff = likely_cutoff_hz(error, to_hz) if error is not None else cutoff_hz
    while True:
        pairs = (
            modes_below(held.interior, cutoff)
            if n_modes is None
            else lowest_modes(held.interior, n_modes)
        )
        reduced = _projected(held, C, pairs)
        if to_hz is not None:
            reduced = reduced._replace(error=_error(held, reduced, to_hz))
        if error is None or reduced.error <= error:
            return reduced
        cutoff *= 1.4


def _projected(held: Held, C: sp.csc_array | None, pairs: EigenPairs) -> ReducedModel:
    omega, phi = pairs
    T = basis(held.part, held.psi, phi)
    return ReducedModel(
        K=_block_diagonal(held.condensed, omega**2),
        M=_projected_mass(held, phi),
        C=None if C is None else _symmetrised(T.T @ (C @ T)),
        w=np.append(held.w[held.part.boundary], np.zeros(len(omega))),
        T=T,
        kind="craig-bampton",
        n_boundary=len(held.part.boundary),
        provenance={},
    )


def _error(held: Held, reduced: ReducedModel, to_hz: float) -> float:
    """Relative rms error of the receptance up to to_hz, from the forces it leaves inside.

    With r = w - D T q and T^T r = 0 the error is r^T D^-1 r; r lies in the interior beyond the
    kept modes, where D is close to K_ii: |r_i^T K_ii^-1 r_i| / (1 - omega^2 / omega_{k+1}^2).
    """
    inside, K, M = held.part.interior, held.K, held.M
    omega = np.sqrt(np.diag(reduced.K)[len(held.part.boundary) :])
    if len(omega) == len(inside):
        return 0.0
    highest = omega[-1] if len(omega) else np.inf
    if highest <= 2 * np.pi * to_hz:
        return np.inf
    left = []
    for s in 2 * np.pi * frequencies(to_hz, 8):
        stiffness = reduced.K * (1 + 2j * DAMPING) - s**2 * reduced.M
        u = reduced.T @ np.linalg.solve(stiffness, reduced.w)
        r = (held.w - K @ u * (1 + 2j * DAMPING) + s**2 * (M @ u))[inside]
        static = held.interior.factor.solve(np.column_stack([r.real, r.imag]))
        left.append(r @ (static @ [1, 1j]) / (1 - (s / highest) ** 2))
    return rms(np.array(left)) / rms(receptance(reduced, None, frequencies(to_hz), zeta=DAMPING))


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


def _projected_mass(held: Held, phi: np.ndarray) -> np.ndarray:
    M_bb, M_ib, M_ii = held.part.blocks(held.M)
    inertia = M_ii @ held.psi + M_ib
    M_boundary = M_bb + M_ib.T @ held.psi + held.psi.T @ inertia
    coupling = phi.T @ inertia
    return np.block([[_symmetrised(M_boundary), coupling.T], [coupling, np.eye(phi.shape[1])]])


def _symmetrised(A: np.ndarray) -> np.ndarray:
    A = np.asarray(A)
    return (A + A.T) / 2
