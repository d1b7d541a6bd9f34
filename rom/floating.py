"""Whether K can be factorised as it is, and with what shift where it floats freely.

A K that is held by springs at the level of its rounding counts as floating: its lowest eigenvalue
would be noise.
"""

import numpy as np
import scipy.sparse as sp

from rom.factorisation import Factorise, Pencil, ReductionError, frequency_scale, noise
from rom.lanczos import LanczosOptions, past_rigid_modes

# a first elastic mode that only chooses the shift. Beside rigid modes of a stiff body, whose theta
# are 1e6 times as large, rounding leaves no more digits, and asking for them takes 40 s for 1 s
ROUGHLY = LanczosOptions(converged=1e-3)


def pencil(
    K: sp.csc_array, M: sp.csc_array, factorise: Factorise, shift: float | None = None
) -> Pencil:
    """Factor of K, or of K - shift M where K floats freely and so has none.

    ``shift`` [rad^2/s^2] is negative, of the order of -(omega_1 / 10)^2; without it a floating K
    gets one from its own first elastic mode. Raises ReductionError where it has none.
    """
    if shift is not None:
        return Pencil(K, M, factorise(sp.csc_array(K - shift * M)), shift)

    # K as it is; a factorisation of a singular matrix fails, or answers with noise
    try:
        unshifted = Pencil(K, M, factorise(K))
    except (RuntimeError, ArithmeticError, ValueError, np.linalg.LinAlgError):
        unshifted = None
    if unshifted is not None and is_held(unshifted):
        return unshifted

    # a guess of the shift finds the first elastic mode, which says whether it was near enough:
    # too small a shift drowns all modes beside the rigid ones, too large a one slows the search
    guess = -1e-9 * frequency_scale(K, M)
    trial = Pencil(K, M, factorise(sp.csc_array(K - guess * M)), guess)
    omega = past_rigid_modes(trial, options=ROUGHLY).omega
    if not omega.any():
        raise ReductionError(
            f"K has at least {len(omega)} rigid-body modes and no elastic one could be found; "
            f"tie the parts that move on their own, or pass shift."
        )
    sigma = -((omega[omega > 0][0] / 10) ** 2)
    if 1e-2 < sigma / guess < 1e2:
        return trial
    return Pencil(K, M, factorise(sp.csc_array(K - sigma * M)), sigma)


def is_held(problem: Pencil) -> bool:
    """Whether the lowest eigenvalue of a K that was factorised as it is stands above rounding."""
    K, M, factor, _ = problem
    # inverse iteration: its Rayleigh quotient is the lowest omega^2 from above
    x = np.random.default_rng(0).standard_normal(K.shape[0])
    for _ in range(3):
        x = factor.solve(M @ x)
        if not np.isfinite(x).all() or not x.any():
            return False
        x /= np.linalg.norm(x)
    return bool(x @ (K @ x) / (x @ (M @ x)) > noise(K, M))
