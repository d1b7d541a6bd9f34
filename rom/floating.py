"""Shift with which K is factorised if the structure floats freely or hangs softly.

A K that is held by springs at the level of its rounding counts as floating: its lowest eigenvalue
would be noise. One that hangs on soft springs (cords, foam) is held, but its suspension answers
K^-1 a million times as much as what is elastic, which is lost in it: it is shifted too.
"""

import numpy as np
import scipy.sparse as sp

from beadwave.rom.factorisation import Factorise, Pencil, ReductionError, frequency_scale, noise
from beadwave.rom.lanczos import LanczosOptions, past_rigid_modes

# accuracy of the first elastic mode, which only chooses the shift. Beside rigid modes of a stiff
# body, whose theta are 1e6 times as large, rounding leaves no more digits; to ask for more takes
# 40 s in place of 1 s
ROUGHLY = LanczosOptions(converged=1e-3)


GUESSED_SHIFT = 1e-9  # of K's frequency scale: a shift while no mode is known
SOFT_MODE = 1e-2  # of that: the lowest omega^2 of a K that is not shifted
# ratio of a suspension's highest frequency to the next one; a box on cords has 1000, and a test
# on cords should have 10 at least
SUSPENSION_GAP = 8.0
SHIFT_RATIO = 10.0  # the first elastic mode over the shift's frequency


def pencil(
    K: sp.csc_array,
    M: sp.csc_array,
    factorise: Factorise,
    shift: float | None = None,
) -> Pencil:
    """Factor of K, or of K - shift M where K floats freely and so has none, or hangs softly.

    K [N/m] and M [kg] (n, n). ``shift`` [rad^2/s^2] is negative, of the order of
    -(omega_1 / 10)^2; without it K gets one from its own first elastic mode. Raises ReductionError
    where it has none among the lowest modes.
    """
    if shift is not None:
        return Pencil(K, M, factorise(sp.csc_array(K - shift * M)), shift)
    guess = -GUESSED_SHIFT * frequency_scale(K, M)

    # K as it is, unless it hangs so softly that its modes drown all others
    trial = held_pencil(K, M, factorise)
    if trial is not None:
        if lowest_square(trial) > -guess:
            return trial
        omega = past_rigid_modes(trial, softer_than=-guess, options=ROUGHLY).omega
        if omega[0] ** 2 > -SOFT_MODE * guess and not n_suspended(omega):
            return trial
    else:
        # a guess of the shift finds the first elastic mode, which says whether it was near enough:
        # too small a shift drowns all modes next to the rigid ones, too large a one slows the
        # search
        trial = Pencil(K, M, factorise(sp.csc_array(K - guess * M)), guess)
        omega = past_rigid_modes(trial, softer_than=-guess, options=ROUGHLY).omega
    if not omega.any():
        raise ReductionError(
            f"K has at least {len(omega)} rigid-body modes and no elastic one could be found; "
            f"tie the parts that move on their own, or pass shift."
        )

    # a tenth of the frequency of the first mode that is neither rigid nor a suspension's: theta
    # = 1 / (omega^2 - sigma) of the elastic modes is then large enough next to that of the rigid
    # ones
    omega = omega[omega > 0]
    sigma = -((omega[n_suspended(omega)] / SHIFT_RATIO) ** 2)
    sigma = min(sigma, SOFT_MODE * guess)  # above rounding, also of a soft structure
    # a trial shifted by no less than a tenth of that frequency serves: no second factorisation
    if trial.sigma and sigma / guess < 1e2:
        return trial
    return Pencil(K, M, factorise(sp.csc_array(K - sigma * M)), sigma)


def n_suspended(omega: np.ndarray) -> int:
    """Number of the lowest modes omega (k,) [rad/s] ascending, above zero, that are rigid motions
    on soft springs: those below the widest gap between neighbours, if that is wide."""
    ratio = omega[1:] / np.maximum(omega[:-1], np.finfo(float).tiny)
    return int(ratio.argmax()) + 1 if len(ratio) and ratio.max() > SUSPENSION_GAP else 0


def held_pencil(K: sp.csc_array, M: sp.csc_array, factorise: Factorise) -> Pencil | None:
    """The factor of K as it is; None where that is singular: a factorisation fails then, or answers
    with noise."""
    try:
        unshifted = Pencil(K, M, factorise(K))
    except (RuntimeError, ArithmeticError, ValueError, np.linalg.LinAlgError):
        return None
    return unshifted if is_held(unshifted) else None


def is_held(problem: Pencil) -> bool:
    """True if the lowest eigenvalue of a K that was factorised without a shift is above
    rounding."""
    return lowest_square(problem) > noise(problem.K, problem.M)


def lowest_square(problem: Pencil) -> float:
    """The lowest omega^2 [rad^2/s^2] of a K that was factorised as it is, from above, by inverse
    iteration and the Rayleigh quotient; nan where the factor answers with zeros or no numbers.

    Each of three solutions multiplies the share of a mode by 1 / omega^2: a rigid motion at
    rounding is then all that is left; of a held structure the quotient stays somewhat above the
    lowest mode, which is safe where it is compared with rounding.
    """
    K, M, factor, _ = problem
    x = np.random.default_rng(0).standard_normal(K.shape[0])
    for _ in range(3):
        x = factor.solve(M @ x)
        if not np.isfinite(x).all() or not x.any():
            return np.nan
        x /= np.linalg.norm(x)
    return float(x @ (K @ x) / (x @ (M @ x)))
