"""Whether K can be factorised as it is, and with what shift where it floats freely.

A K that is held by springs at the level of its rounding counts as floating: its lowest eigenvalue
would be noise.
"""

import numpy as np
import scipy.sparse as sp

from rom.factorisation import (
    Factor,
    Factorise,
    Pencil,
    ReductionError,
    frequency_scale,
    noise,
)
from rom.lanczos import past_rigid_modes

# of a first elastic mode that only chooses the shift; beside rigid modes of a stiff body, whose
# theta are 1e6 times as large, rounding leaves no more
ROUGHLY = 1e-3


def pencil(
    K: sp.csc_array, M: sp.csc_array, factorise: Factorise, shift: float | None = None
) -> Pencil:
    """Factor of K, or of K - shift M where K floats freely and so has none.

    ``shift`` [rad^2/s^2] is negative, of the order of -(omega_1 / 10)^2; without it a floating K
    gets one from its own first elastic mode.
    """
    if shift is not None:
        return Pencil(K, M, factorise(sp.csc_array(K - shift * M)), shift)
    anchored = _anchored(K, M, factorise)
    return anchored if anchored is not None else _floating(K, M, factorise)


def _anchored(K: sp.csc_array, M: sp.csc_array, factorise: Factorise) -> Pencil | None:
    try:
        factor = factorise(K)
    except (RuntimeError, ArithmeticError, ValueError, np.linalg.LinAlgError):
        return None
    held = Pencil(K, M, factor)
    return held if is_held(held) else None


def is_held(problem: Pencil) -> bool:
    """Whether the lowest eigenvalue of a K that was factorised as it is stands above rounding."""
    return _lowest_quotient(*problem[:3]) > noise(problem.K, problem.M)


def _lowest_quotient(K: sp.csc_array, M: sp.csc_array, factor: Factor) -> float:
    x = np.random.default_rng(0).standard_normal(K.shape[0])
    for _ in range(3):
        x = factor.solve(M @ x)
        if not np.isfinite(x).all() or not x.any():
            return 0.0
        x /= np.linalg.norm(x)
    return float(x @ (K @ x) / (x @ (M @ x)))


def _floating(K: sp.csc_array, M: sp.csc_array, factorise: Factorise) -> Pencil:
    guess = -1e-9 * frequency_scale(K, M)
    trial = Pencil(K, M, factorise(sp.csc_array(K - guess * M)), guess)
    omega = past_rigid_modes(trial, tolerance=ROUGHLY).omega
    if not omega.any():
        raise ReductionError(
            f"K has at least {len(omega)} rigid-body modes and no elastic one could be found; "
            f"tie the parts that move on their own, or pass shift."
        )
    sigma = -((omega[omega > 0][0] / 10) ** 2)
    if 1e-2 < sigma / guess < 1e2:
        return trial
    return Pencil(K, M, factorise(sp.csc_array(K - sigma * M)), sigma)
