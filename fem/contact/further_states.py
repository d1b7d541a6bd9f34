"""Modes of a pressed assembly about further states, by the factor of its reference.

A state has layers of its own, K_s = K_r + C^T D C, and with the geometric stiffness K = K_s + K_G,
of which K_G is small. Subspace iteration takes the inverse of K_s alone,

    Y = (K_s + s M)^-1 (M X (Lambda + s) - K_G X),    X, Lambda from Rayleigh and Ritz on [V, Y],

V modes about other states, s the shift of the reference. Motions R that strain nothing are those
of V, and are kept out: I - R R^T M. K. J. Bathe, Finite Element Procedures (1996), sec. 11.6.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from beadwave.fem.assembly.model import Model
from beadwave.fem.contact.pressed_model import PressedAssembly
from beadwave.fem.modes.mac import RIGID
from beadwave.fem.modes.modes import Modes, deflated

N_GUARDS = 6  # modes beyond those asked for, which slow convergence otherwise
MAX_STEPS = 12  # of the iteration, which took 1 to 3
DEPENDENT = 1e-6  # of a column's length: what is left of it less is in the span of the others


class FurtherModes(NamedTuple):
    """Modes about a state."""

    modes: Modes
    error: float  # relative, of the frequencies: by which the last step lowered them
    n_steps: int


def modes_about(
    assembly: PressedAssembly,
    model: Model,
    known: NDArray[np.float64],
    n_modes: int,
    *,
    error: float = 1e-6,
) -> FurtherModes:
    """The n_modes lowest modes of the model about a state of the assembly, from `known` (n, k) ones
    about others, k > n_modes. Raises ValueError where the iteration does not converge."""
    K, M, s = model.K, model.M, assembly.shift
    solver = assembly.contact.solver(model.contact.layers)
    V = _orthonormal(np.empty((len(known), 0)), known, M)
    KV = K @ V
    omega2, Q = eigh(V.T @ KV)
    rigid = omega2 < RIGID**2 * omega2.max()
    R = V @ Q[:, rigid]
    MR = M @ R
    n_iterated = min(n_modes + N_GUARDS, V.shape[1])
    for step in range(1, MAX_STEPS + 1):
        at = slice(R.shape[1], n_iterated)
        X, KX = V @ Q[:, at], KV @ Q[:, at]
        of_open = assembly.model.K @ X + assembly.contact.C.T @ (
            model.contact.layers[:, None] * (assembly.contact.C @ X)
        )
        Y = deflated(R, MR, solver, (M @ X) * (omega2[at] + s) - (KX - of_open))
        Y = _orthonormal(V, Y, M)
        V, KV = np.hstack([V, Y]), np.hstack([KV, K @ Y])
        before, (omega2, Q) = omega2[:n_modes], eigh(V.T @ KV)
        elastic = slice(R.shape[1], n_modes)
        change = np.max(before[elastic] / omega2[elastic] - 1, initial=0.0) / 2
        if change < error:
            omega = np.sqrt(np.maximum(omega2[:n_modes], 0.0))
            return FurtherModes(Modes(omega, V @ Q[:, :n_modes]), float(change), step)
    raise ValueError(
        f"the modes about another preload change by {change:.1g} after {MAX_STEPS} steps, allowed "
        f"is {error:g}; compute this case by itself."
    )


def _orthonormal(V: NDArray[np.float64], Y: NDArray[np.float64], M) -> NDArray[np.float64]:
    """M-orthonormal columns that span, with the M-orthonormal V, what V and Y do."""
    Y = Y / np.sqrt(np.einsum("ij,ij->j", Y, M @ Y))
    for _ in range(2):
        Y = Y - V @ (V.T @ (M @ Y))
    values, Q = np.linalg.eigh(Y.T @ (M @ Y))
    kept = values > DEPENDENT**2
    return Y @ (Q[:, kept] / np.sqrt(values[kept]))
