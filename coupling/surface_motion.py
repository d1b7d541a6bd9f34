"""How the outer nodes of a reduced structure move in each of its wall's modes.

u(X, t) = sum_k q_k(t) phi_k(X),   phi_k = T_surface v_k
"""

from typing import NamedTuple

import numpy as np

from coupling.wall import kept_modes, moving_modes, with_oscillator
from rom import ModalWall, ReducedModel, modal

SAME = 1e-3  # relative difference of two frequencies of one mode


class SurfaceModes(NamedTuple):
    """Shapes (k, m, 3) [kg^-1/2] of modes at the m outer nodes, and their omega (k,) [rad/s]."""

    omega: np.ndarray
    shape: np.ndarray


def wall_modes(
    reduced: ReducedModel, omega: np.ndarray, phi: np.ndarray, *, cutoff_hz: float | None = None
) -> SurfaceModes:
    """Shapes of the modes with omega and phi (k,) of the wall that the model was made into."""
    weights = reduced.contact.weights_read
    if weights is not None and cutoff_hz is None:
        cutoff_hz = np.inf
    modes = modal(reduced)
    kept = kept_modes(modes, reduced, cutoff_hz)
    moving = with_oscillator(modes, kept) if weights is None else moving_modes(modes, kept)
    at_contact = moving.phi if weights is None else weights @ moving.vectors
    apart = np.abs(moving.omega[:, None] - omega) / (omega + 1e-9 * omega.max(initial=1.0))
    apart += 1e-3 * np.abs(at_contact[:, None] - phi) / np.abs(phi).max(initial=1e-300)
    return _shapes(reduced, moving, apart.argmin(axis=0))


def structure_modes(reduced: ReducedModel, frequency_hz: np.ndarray) -> SurfaceModes:
    """Shapes of the reduced structure's modes at these frequencies (k,); omega is nan where it has
    none."""
    modes, omega = modal(reduced), 2 * np.pi * np.asarray(frequency_hz)
    apart = np.abs(modes.omega[:, None] - omega) / np.maximum(omega, 1e-300)
    nearest = apart.argmin(axis=0) if len(omega) else np.zeros(0, int)
    found = _shapes(reduced, modes, nearest)
    missed = apart.min(axis=0, initial=np.inf) > SAME
    return found._replace(omega=np.where(missed, np.nan, found.omega))


def _shapes(reduced: ReducedModel, modes: ModalWall, index: np.ndarray) -> SurfaceModes:
    flat = reduced.surface.T @ modes.vectors[:, index].astype(np.float32)
    return SurfaceModes(modes.omega[index], flat.T.reshape(len(index), -1, 3))
