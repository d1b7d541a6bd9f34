"""Frequencies of bolted joints between two limits, and their spread by that of the springs.

Faces that are tied bound a frequency from above, a contact without friction bounds it from below:
there the bolts alone carry the shear. Both are those of the mode of the same number, of which the
bound holds (Courant and Fischer): the shapes may change places. The spread is that of the
frequencies as one group of springs after the other takes k exp(+-s), in the space of the modes
themselves and of those of the lower limit, which spans what soft springs let move:

    K(k) = V^T K0 V + sum_j k_j (V^T e_j) (V^T e_j)^T,    V = [phi, phi_slipped].
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from beadwave.fem.assembly.model import Model
from beadwave.fem.modes.modes import Modes

DEPENDENT = 1e-8  # of the largest eigenvalue of V^T M V: below, a shape is dropped


class JointBounds(NamedTuple):
    """Limits and standard deviations of frequencies (k,) [Hz]."""

    tied_hz: NDArray[np.float64]
    frictionless_hz: NDArray[np.float64]
    deviation_hz: NDArray[np.float64]


def spread_hz(
    model: Model, modes: Modes, slipped: Modes, deviations: Sequence[NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Standard deviations (k,) [Hz] of the frequencies by those of ln(k), (n_springs,) each, of
    groups of springs that vary together and independently of other groups; of each group the larger
    change of both directions counts."""
    V = np.hstack([modes.phi, slipped.phi])
    values, Q = np.linalg.eigh(V.T @ (model.M @ V))
    kept = values > DEPENDENT * values[-1]
    V = V @ (Q[:, kept] / np.sqrt(values[kept]))
    K0, e = V.T @ (model.K0 @ V), V[model.elongation]

    def omega(k: NDArray[np.float64]) -> NDArray[np.float64]:
        """Frequencies [rad/s] of as many modes, with springs k (n_springs,)."""
        omega2 = eigh(K0 + (e.T * k) @ e, eigvals_only=True)[: len(modes.omega)]
        return np.sqrt(np.maximum(omega2, 0.0))

    usual, variance = omega(model.stiffness), np.zeros(len(modes.omega))
    for s in deviations:
        changes = [np.abs(omega(model.stiffness * np.exp(sign * s)) - usual) for sign in (-1, 1)]
        variance += np.max(changes, axis=0) ** 2
    return np.sqrt(variance) / (2 * np.pi)
