"""Damping ratios of the wall's modes: given per mode, by Rayleigh, or by the matrix C of the model.

    zeta_j from a table (f, zeta);   zeta = alpha / (2 omega) + beta omega / 2;
    zeta_j = mode_j^T C mode_j / (2 omega_j) where C leaves the modes uncoupled
Caughey and O'Kelly, J. Appl. Mech. 32 (1965) 583, for when it does.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from beadwave.coupling.errors import CouplingError

UNCOUPLED = 1e-6  # largest normalised off-diagonal modal damping that counts as proportional


class ModalDamping(NamedTuple):
    """Damping ratios of modes: one number for all, one for each, or a table over frequency.

    ratio () or (k,); frequency_hz None or (k,) ascending. pairing "interpolate" is linear between
    the entries and constant outside; "nearest" gives each mode the entry nearest on a log scale.
    """

    ratio: ArrayLike
    frequency_hz: ArrayLike | None = None
    pairing: str = "interpolate"


class RayleighDamping(NamedTuple):
    """C = alpha M + beta K: alpha [1/s], beta [s]."""

    alpha: float
    beta: float


Damping = ModalDamping | RayleighDamping


def rayleigh(
    frequency_1_hz: float, zeta_1: float, frequency_2_hz: float, zeta_2: float
) -> RayleighDamping:
    """The Rayleigh damping with two given ratios at two frequencies [Hz]: alpha [1/s] and beta [s]
    of  zeta = alpha / (2 omega) + beta omega / 2.

    Raises CouplingError if the frequencies coincide or a coefficient comes out negative, since
    modes outside the two would then be driven.
    """
    w = 2 * np.pi * np.array([frequency_1_hz, frequency_2_hz])
    if w[0] == w[1] or (w <= 0).any():
        raise CouplingError(
            f"Rayleigh damping needs two different frequencies above 0 Hz, not {frequency_1_hz:g} "
            f"and {frequency_2_hz:g}."
        )
    rows = np.column_stack([1 / (2 * w), w / 2])
    alpha, beta = np.linalg.solve(rows, [zeta_1, zeta_2])
    if alpha < 0 or beta < 0:
        raise CouplingError(
            f"damping ratios {zeta_1:g} at {frequency_1_hz:g} Hz and {zeta_2:g} at "
            f"{frequency_2_hz:g} Hz need alpha={alpha:.3g}, beta={beta:.3g}; a negative one feeds "
            f"energy into other modes; use modal ratios instead."
        )
    return RayleighDamping(float(alpha), float(beta))


def damping_ratios(damping: Damping | None, omega: np.ndarray) -> np.ndarray:
    """zeta (k,) of modes at omega (k,) [rad/s]; None is undamped.

    Raises CouplingError for a negative or missing ratio, or for alpha on a rigid-body mode.
    """
    if damping is None:
        return np.zeros_like(omega)

    # by the coefficients alpha and beta
    if isinstance(damping, RayleighDamping):
        alpha, beta = damping
        if alpha and not omega.all():
            raise CouplingError(
                f"alpha={alpha:g} 1/s would damp the rigid-body motion of a free-floating wall; "
                f"use modal ratios or alpha=0."
            )
        with np.errstate(divide="ignore", invalid="ignore"):
            zeta = np.where(omega > 0, alpha / (2 * omega) + beta * omega / 2, 0.0)

    # one ratio for all modes, or one for each
    elif damping.frequency_hz is None:
        ratio = np.atleast_1d(np.asarray(damping.ratio, dtype=float))
        if len(ratio) not in (1, len(omega)):
            raise CouplingError(
                f"{len(ratio)} damping ratios were given for {len(omega)} modes; give one, one "
                f"each, or a table with frequency_hz."
            )
        zeta = np.broadcast_to(ratio, omega.shape)

    # a table over frequency
    else:
        ratio = np.atleast_1d(np.asarray(damping.ratio, dtype=float))
        table_hz = np.asarray(damping.frequency_hz, dtype=float)
        if table_hz.shape != ratio.shape or not (np.diff(table_hz) > 0).all():
            raise CouplingError(
                f"the damping table has {table_hz.size} frequencies and {ratio.size} ratios; give "
                f"as many of both, frequencies ascending."
            )
        if table_hz[0] <= 0:
            raise CouplingError(f"the damping table starts at {table_hz[0]:g} Hz; start above 0.")
        if damping.pairing == "interpolate":
            zeta = np.interp(omega / (2 * np.pi), table_hz, ratio)
        elif damping.pairing == "nearest":
            log = np.log(np.maximum(omega, 1e-300) / (2 * np.pi))
            zeta = ratio[np.abs(log[:, None] - np.log(table_hz)).argmin(axis=1)]
        else:
            raise CouplingError(
                f"pairing is {damping.pairing!r}; it can be 'interpolate' or 'nearest'."
            )

    if not (zeta >= 0).all():
        worst = int(np.argmin(zeta))
        raise CouplingError(
            f"the damping ratio at {omega[worst] / 2 / np.pi:.4g} Hz is {zeta[worst]:.3g}; "
            f"a passive wall has ratios >= 0."
        )
    return np.where(omega > 0, zeta, 0.0)


def matrix_ratios(D: np.ndarray | None, omega: np.ndarray) -> np.ndarray:
    """zeta (k,) that a model's own modal damping matrix D (k, k) gives, zeros without one.

    Raises CouplingError if C couples the modes: then no ratios exist that stand for it.
    """
    if D is None or not len(omega):
        return np.zeros(len(omega))
    diagonal = np.diag(D)
    coupling = modal_coupling(D)
    if coupling > UNCOUPLED or (diagonal[omega == 0] > UNCOUPLED * diagonal.max()).any():
        raise CouplingError(
            f"the damping matrix C couples the wall's modes (by {coupling:.1e} of their own "
            f"damping, allowed {UNCOUPLED:g}), so damping ratios cannot stand for it; march it "
            f"with coupled_wall(), or leave C out of the reduction and give modal ratios."
        )
    return diagonal / (2 * np.where(omega > 0, omega, np.inf))


def couples_modes(D: np.ndarray | None) -> bool:
    """True if no ratios can stand for a modal damping matrix (k, k)."""
    return D is not None and modal_coupling(D) > UNCOUPLED


def modal_coupling(D: np.ndarray) -> float:
    """Largest |D_jk| / sqrt(D_jj D_kk) off the diagonal of a modal damping matrix (k, k); 0 of a
    diagonal one. Modes without damping count with 1e-12 of the largest entry: a damper that couples
    them is not divided by 0."""
    diagonal, off = np.abs(np.diag(D)), np.abs(D - np.diag(np.diag(D)))
    if not off.any():
        return 0.0
    norm = np.sqrt(np.maximum(diagonal, 1e-12 * np.abs(D).max()))
    return float((off / np.outer(norm, norm)).max())
