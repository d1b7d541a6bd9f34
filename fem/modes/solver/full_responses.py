"""Frequency responses of the whole model at many lines, without a solution at each of them.

With modes phi (n, k), omega up to beyond the band, D = K + sigma M, P = I - phi phi^T M and
tau = -s^2 + sigma, s = i 2 pi f + a,

    (K + s^2 M)^-1 = sum_k phi_k phi_k^T / (omega_k^2 + s^2) + sum_j tau^j (P D^-1 M)^j P D^-1

where the series falls by |tau| / (omega_top^2 + sigma) a term: what lies beyond the modes is there
as well, not at rest but with its inertia. Modes are damped, s c_k added to omega_k^2 + s^2;
dashpots follow from the same solutions (Woodbury). What lies beyond the modes is taken without
damping.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, vstack

from beadwave.fem.assembly.model import Model
from beadwave.fem.modes.modes import SHIFT_HZ, Modes, deflated
from beadwave.fem.modes.solver.factorisation import Factor, factorised


class FullResponses(NamedTuple):
    """Responses at f lines."""

    H: NDArray[np.complex128]  # (p, r, f)
    remainder: float  # of the series, relative to what it gives: its next term


# of the series, which falls by the square of the ratio of frequencies each: at modes to 1.5 times
# the lines to 1e-4
TERMS = 12


def full_responses(
    model: Model,
    modes: Modes,
    c: NDArray[np.float64],
    points: csr_matrix,
    references: csr_matrix,
    s: NDArray[np.complex128],
    *,
    power: int,
    dashpots: csr_matrix | None = None,
) -> FullResponses:
    """H (p, r, f) = s^power points Z^-1 references^T of a model at s (f,) [1/s], with c (k,) [1/s]
    of its lowest modes and `dashpots` (d, n), C = dashpots^T dashpots [N s/m].

    points (p, n) and references (r, n) read and load the free dofs; power 0 gives displacements
    [m/N], 1 velocities, 2 accelerations. c is 2 zeta omega of each mode.
    Raises ValueError where the highest mode does not lie above the lines.
    """
    top, highest = float(modes.omega[-1]), float(np.abs(s).max())
    if highest >= top:
        raise ValueError(
            f"modes reach to {top / (2 * np.pi):.5g} Hz, lines to {highest / (2 * np.pi):.5g} Hz; "
            "give modes beyond the lines."
        )
    sigma, factor = _shifted_factor(model, modes)
    none = csr_matrix((0, model.K.shape[0]))
    C = none if dashpots is None else dashpots
    left, right = csr_matrix(vstack([points, C])), csr_matrix(vstack([references, C]))

    # what the modes do, damped, then the series
    at_left, at_right = left @ modes.phi, right @ modes.phi
    h = 1 / (modes.omega[:, None] ** 2 + s**2 + s * c[:, None])  # (k, f)
    G = np.einsum("ak,kf,bk->fab", at_left, h, at_right, optimize=True)

    # x = (P D^-1 M)^j P D^-1 R^T for j = 0, 1, ..: one solution a term for all lines together; the
    # last term is not added, it is the error of those before it
    tau = -(s**2) + sigma
    x, M_phi = right.toarray().T, model.M @ modes.phi
    for j in range(TERMS + 1):
        x = deflated(modes.phi, M_phi, factor, x if j == 0 else model.M @ x)
        term = tau[:, None, None] ** j * (left @ x)
        if j == TERMS:
            remainder = float(np.abs(term).max() / np.abs(G).max())
        else:
            G = G + term

    # dashpots: u = G F with the forces F = -s (rows of C) u that they answer with (Woodbury)
    p, r, d = points.shape[0], references.shape[0], C.shape[0]
    H = G[:, :p, :r]
    if d:
        inner = np.eye(d) + s[:, None, None] * G[:, p:, r:]
        H = H - s[:, None, None] * G[:, :p, r:] @ np.linalg.solve(inner, G[:, p:, :r])
    return FullResponses(np.moveaxis(H, 0, 2) * s**power, remainder)


def residual_flexibility(model: Model, modes: Modes, points: csr_matrix) -> NDArray[np.float64]:
    """R (p, p) [m/N] by which points (p, n) yield in all modes above the given lowest ones: what
    K^-1 has beyond the sum of phi phi^T / omega^2, the inertia of those modes left out."""
    factor = _shifted_factor(model, modes)[1]
    R = points @ deflated(modes.phi, model.M @ modes.phi, factor, points.toarray().T)
    return (R + R.T) / 2


def _shifted_factor(model: Model, modes: Modes) -> tuple[float, Factor]:
    """sigma [1/s^2] and the factor of K + sigma M; sigma is zero unless the structure floats."""
    floats = modes.omega[0] < 2 * np.pi * SHIFT_HZ
    sigma = (2 * np.pi * SHIFT_HZ) ** 2 if floats else 0.0
    return sigma, factorised((model.K + sigma * model.M).tocsc())
