"""Natural frequencies and mode shapes, K phi = omega^2 M phi, by shift-inverted Lanczos.

    (K - sigma M)^-1 M phi = theta phi,    omega^2 = sigma + 1 / theta

The eigenvalues omega^2 nearest to the shift sigma have the largest theta, which Lanczos' method
finds first; each step costs one solution with the factor of K - sigma M. Without a floating part
sigma = 0. A floating K is singular, so sigma lies below zero, and the rigid motions R have by far
the largest theta: they are found by inverse iteration, and P = I - R R^T M keeps them out of the
Krylov space. T. Ericsson, A. Ruhe, Math. Comput. 35 (1980) 1251.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.sparse.linalg import LinearOperator, eigsh

from beadwave.fem.modes.solver.factorisation import Factor, factorised
from beadwave.fem.modes.solver.multifrontal import Singular
from beadwave.fem.modes.solver.threads import one_thread

SHIFT_HZ = 5.0  # of the shift: below the lowest elastic mode


# over K's largest eigenvalue: how large rounding makes an eigenvalue that is zero
EIGENVALUE_ROUNDING = 200 * np.finfo(float).eps
# relative residual of an eigenvalue; to ask for rounding itself takes a sixth more solutions
CONVERGED_RESIDUAL = 1e-11
# residual of a mode over its eigenvalue less the shift, from which on modes are refused
LOST_RESIDUAL = 1e-2
N_INVERSE_ITERATIONS = 3  # for each rigid motion
N_CHECKED_TOGETHER = 16  # modes that are checked together


class Unstable(ValueError):
    """Static loads under which a structure at rest moves on."""


class Modes(NamedTuple):
    """Mass-normalised modes, lowest first."""

    omega: NDArray[np.float64]  # (k,) [rad/s]
    phi: NDArray[np.float64]  # (n, k)

    @property
    def frequency_hz(self) -> NDArray[np.float64]:
        """omega / 2 pi, (k,) [Hz]."""
        return self.omega / (2 * np.pi)


def held(K, M) -> Factor | None:
    """The factor of K (n, n) itself; None where K floats, or where its lowest mode lies below
    SHIFT_HZ.

    Beside such a soft mode, the elastic modes of a stiff part would be lost in the rounding of
    K^-1; `modes` then takes a shift instead.
    """
    try:
        factor = factorised(K)
    except Singular:
        return None
    n_iterations = N_INVERSE_ITERATIONS
    no_motions = np.empty((K.shape[0], 0))
    x = _lowest(no_motions, M, factor, np.random.default_rng(1), n_iterations)
    return factor if x @ (K @ x) > (2 * np.pi * SHIFT_HZ) ** 2 else None


def modes(
    K,
    M,
    n_modes: int,
    *,
    shift_hz: float = SHIFT_HZ,
    factor: Factor | None = None,
) -> Modes:
    """The n_modes lowest modes of K phi = omega^2 M phi, K [N/m] and M [kg] (n, n) sparse.

    With the factor of a K that is held (see `held`) nothing is factorised. Without one the shift
    lies at -(2 pi shift_hz)^2, below the lowest elastic frequency: K itself may be singular. Rigid
    motions, which would drown the elastic modes of a stiff part, are then found first and kept out
    of the rest. Raises ValueError when the modes are not M-orthonormal or leave a residual, where
    K - sigma M is singular, and where K is indefinite, as under a load that buckles.
    """
    n, sigma, R = K.shape[0], 0.0, np.empty((K.shape[0], 0))
    if factor is None:
        sigma = -((2 * np.pi * shift_hz) ** 2)
        factor = factorised((K - sigma * M).tocsc())

        # rigid motions R (n, r), M-orthonormal: of no strain energy but by rounding
        rng, rounding = np.random.default_rng(1), _rounded_zero(K, M, EIGENVALUE_ROUNDING)
        while R.shape[1] < n_modes:
            x = _lowest(R, M, factor, rng, N_INVERSE_ITERATIONS)
            if abs(x @ (K @ x)) > rounding:
                break
            R = np.column_stack([R, x])

    # elastic modes by shift-inverted Lanczos, orthogonal to R
    n_elastic = n_modes - R.shape[1]
    eigenvalues, phi = np.zeros(0), np.empty((n, 0))
    if n_elastic:
        MR = M @ R
        inverse = LinearOperator((n, n), matvec=lambda b: deflated(R, MR, factor, b))
        start = np.random.default_rng(0).standard_normal(n)
        with one_thread():
            eigenvalues, phi = eigsh(
                K, n_elastic, M, sigma=sigma, OPinv=inverse, v0=start, tol=CONVERGED_RESIDUAL
            )

    # both together: Rayleigh-Ritz
    if R.shape[1]:
        V = np.hstack([R, phi])
        eigenvalues, Q = eigh(V.T @ (K @ V), V.T @ (M @ V))
        phi = V @ Q
    order = np.argsort(eigenvalues)
    lowest = eigenvalues[order[0]]
    if lowest < -((2 * np.pi * shift_hz) ** 2):
        raise Unstable(
            f"the static loads buckle the structure: a motion grows at {np.sqrt(-lowest):.3g} 1/s; "
            "reduce forces and preloads, or take thicker bodies."
        )
    solution = Modes(np.sqrt(np.maximum(eigenvalues[order], 0.0)), phi[:, order])
    require_accurate(solution, K, M, sigma)
    return solution


def require_accurate(modes: Modes, K, M, sigma: float) -> None:
    """Raise ValueError for modes that are not M-orthonormal, or lost in the rounding of K."""
    # the elongation of a joint moves a whole face: its row counts as that of a node
    m = M.diagonal()
    row = np.sqrt(np.minimum(1.0, np.quantile(m, 0.99) / np.maximum(m, np.finfo(float).tiny)))
    # a free bolt of 30 g in elements of 1 mm: rounding leaves 1.3e-2 of a shift of 5 Hz
    floor = _rounded_zero(K, M, EIGENVALUE_ROUNDING) / LOST_RESIDUAL
    eigenvalues = np.maximum(modes.omega**2 - sigma, floor)

    # a few columns at a time: of a million unknowns the modes alone take a gigabyte
    n_modes = len(modes.omega)
    product, relative = np.empty((n_modes, n_modes)), np.empty(n_modes)
    for start in range(0, n_modes, N_CHECKED_TOGETHER):
        c = slice(start, start + N_CHECKED_TOGETHER)
        phi = modes.phi[:, c]
        Mphi = M @ phi
        product[:, c] = modes.phi.T @ Mphi
        residual = K @ phi - Mphi * modes.omega[c] ** 2
        scale = np.linalg.norm(row[:, None] * Mphi, axis=0) * eigenvalues[c]
        relative[c] = np.linalg.norm(row[:, None] * residual, axis=0) / scale

    # phi^T M phi = 1, and K phi = omega^2 M phi relative to the size of M phi
    skew = np.abs(product - np.eye(n_modes)).max()
    if not skew < 1e-7:
        raise ValueError(
            f"the modes are not M-orthonormal (largest error {skew:.1e}); refine K, M."
        )
    i, worst = int(relative.argmax()), relative.max()
    if not worst < LOST_RESIDUAL:
        raise ValueError(
            f"a mode near {modes.frequency_hz[i]:.2g} Hz is lost in the rounding of K (relative "
            f"residual {worst:.1e}, allowed {LOST_RESIDUAL:g}): a part hangs on joints too soft "
            "next to its own stiffness; stiffen the softest joints."
        )


def _rounded_zero(K, M, rounding: float) -> float:
    """Size that rounding gives to an eigenvalue that is zero [rad^2/s^2]: EIGENVALUE_ROUNDING times
    an estimate of the largest one by K_ii / M_ii."""
    k, m = K.diagonal(), M.diagonal()
    return float(rounding * np.quantile(k[m > 0] / m[m > 0], 0.99))


def _lowest(
    R, M, factor: Factor, rng: np.random.Generator, n_iterations: int
) -> NDArray[np.float64]:
    """Approximately the lowest mode (n,) M-orthogonal to R, by inverse iteration from a random
    start; mass-normalised."""
    x, MR = rng.standard_normal(M.shape[0]), M @ R
    for _ in range(n_iterations):
        x = deflated(R, MR, factor, M @ x)
        x /= np.sqrt(x @ (M @ x))
    return x


def deflated(R, MR, factor: Factor, b: NDArray[np.float64]) -> NDArray[np.float64]:
    """P (K - sigma M)^-1 P^T b with P = I - R R^T M, of b (n,) or (n, k).

    R (n, r) are mass-normalised modes that are kept out, MR (n, r) their products with M, factor
    that of K - sigma M: the load gives up what would accelerate them, the answer what rounding
    brings back of them.
    """
    if not R.shape[1]:
        return factor.solve(b)
    u = factor.solve(b - MR @ (R.T @ b))
    return u - R @ (MR.T @ u)
