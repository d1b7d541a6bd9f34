"""How far a few modes and a static residual answer at the contact like all modes do.

The static response u = K^-1 w knows the moments of the whole spectrum,
    w^T u = sum phi_j^2 / omega_j^2,   u^T M u = sum phi_j^2 / omega_j^4,
so what is missing in the receptance after k modes is bounded without knowing any further mode:
    H - H_k = omega^2 sum_{j>k} phi_j^2 / (omega_j^2 (omega_j^2 - omega^2))
           <= omega^2 tau_k / (1 - omega^2 / omega_{k+1}^2),   tau_k = u^T M u - sum_{j<=k} ...
"""

import numpy as np

GRID = 400  # frequencies at which the error is averaged
DAMPING = 0.01  # modal damping of the receptance that the error is compared with


def frequencies(to_hz: float, n: int = GRID) -> np.ndarray:
    """(n,) [Hz], evenly up to to_hz."""
    return to_hz * np.arange(1, n + 1) / n


def tail_errors(
    omega: np.ndarray, phi: np.ndarray, compliance: float, second_moment: float, to_hz: float
) -> np.ndarray:
    """Relative rms error of the receptance up to to_hz after the first 0, 1, .. k modes, (k + 1,).

    omega (k,) [rad/s] ascending, phi (k,) [kg^-1/2], compliance = w^T u [m/N] and
    second_moment = u^T M u [m s^2/N] over all elastic modes. Infinite while the next mode lies
    below to_hz.
    """
    s = 2 * np.pi * frequencies(to_hz)
    elastic = omega > 0
    known = np.where(elastic, phi, 0) ** 2 / np.where(elastic, omega, 1) ** 4
    left = second_moment - np.append(0, np.cumsum(known))
    left[left < 1e-12 * second_moment] = 0
    following = np.append(omega, omega[-1:] if len(omega) else 2 * s[-1])
    scale = rms(_receptance(omega, phi, compliance, s))
    missing = [_missing(*pair, s) for pair in zip(left, following, strict=True)]
    return np.array(missing) / scale


def _missing(tau: float, following: float, s: np.ndarray) -> float:
    if tau == 0:
        return 0.0
    return tau * rms(s**2 / (1 - (s / following) ** 2)) if following > s[-1] else np.inf


def _receptance(omega: np.ndarray, phi: np.ndarray, compliance: float, s: np.ndarray) -> np.ndarray:
    elastic = omega > 0
    static = compliance - np.sum((phi[elastic] / omega[elastic]) ** 2)
    dynamic = omega**2 - s[:, None] ** 2 + 2j * DAMPING * omega * s[:, None]
    return static + (phi**2 / dynamic).sum(axis=1)


def rms(values: np.ndarray) -> float:
    """Root mean square of real or complex values."""
    return float(np.sqrt(np.mean(np.abs(values) ** 2)))


def likely_cutoff_hz(error: float, to_hz: float) -> float:
    """Where the modes of a solid usually suffice: 1.3 to_hz for 1e-3, 2.2 to_hz for 1e-4."""
    return to_hz * max(1.05, 1.3 * (1e-3 / error) ** 0.23)
