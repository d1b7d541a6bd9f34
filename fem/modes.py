"""Natural frequencies and mode shapes, K phi = omega^2 M phi, by shift-inverted Lanczos."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.sparse.linalg import LinearOperator, eigsh

from fem.factorisation import Factor, factorised
from fem.multifrontal import Singular
from fem.threads import one_thread

ROUNDING = 200 * np.finfo(float).eps  # of K's largest eigenvalue: what it makes of a zero one
CONVERGED = 1e-11  # of an eigenvalue's residual: rounding takes a sixth more solutions
LOST = 1e-2  # of an eigenvalue beside the shift, or all of its rounding: the residual of a mode
INVERSE_ITERATIONS = 3  # of each rigid motion
SHIFT_HZ = 5.0


class Modes(NamedTuple):
    """Mass-normalised modes, lowest first."""

    omega: NDArray[np.float64]  # (k,) [rad/s]
    phi: NDArray[np.float64]  # (n, k)

    @property
    def frequency_hz(self) -> NDArray[np.float64]:
        """(k,)"""
        return self.omega / (2 * np.pi)


def held(K, M) -> Factor | None:
    """The factor of K itself; None for what floats or is held so softly, its lowest mode being
    below SHIFT_HZ, that the elastic modes of a stiff part would drown in it."""
    try:
        factor = factorised(K)
    except Singular:
        return None
    x = _lowest(np.empty((K.shape[0], 0)), M, factor, np.random.default_rng(1))
    return factor if x @ (K @ x) > (2 * np.pi * SHIFT_HZ) ** 2 else None


def modes(K, M, n_modes: int, *, shift_hz: float = SHIFT_HZ, factor: Factor | None = None) -> Modes:
    """The lowest modes of K phi = omega^2 M phi.

    With the factor of a K that is held (see `held`) nothing is factorised. Without one the shift
    lies at -(2 pi shift_hz)^2, below the lowest elastic frequency: K itself may be singular. Rigid
    motions, which would drown the elastic modes of a stiff part, are then found first and kept out
    of the rest. Raises ValueError when the modes are not M-orthonormal or leave a residual.
    """
    sigma, R = 0.0, np.empty((K.shape[0], 0))
    if factor is None:
        sigma = -((2 * np.pi * shift_hz) ** 2)
        factor = factorised((K - sigma * M).tocsc())
        R = _rigid_motions(K, M, factor, n_modes)
    n, n_elastic = K.shape[0], n_modes - R.shape[1]
    eigenvalues, phi = np.zeros(0), np.empty((n, 0))
    if n_elastic:
        inverse = LinearOperator((n, n), matvec=lambda b: _deflated(R, M, factor, b))
        start = np.random.default_rng(0).standard_normal(n)
        with one_thread():
            eigenvalues, phi = eigsh(
                K, n_elastic, M, sigma=sigma, OPinv=inverse, v0=start, tol=CONVERGED
            )
    if R.shape[1]:
        V = np.hstack([R, phi])
        eigenvalues, Q = eigh(V.T @ (K @ V), V.T @ (M @ V))
        phi = V @ Q
    order = np.argsort(eigenvalues)
    found = Modes(np.sqrt(np.maximum(eigenvalues[order], 0.0)), phi[:, order])
    _check(found, K, M, sigma)
    return found


def _rigid_motions(K, M, factor: Factor, most: int) -> NDArray[np.float64]:
    """Motions (n, r) of no strain energy but by rounding, M-orthonormal; no more than `most`."""
    R, rng = np.empty((K.shape[0], 0)), np.random.default_rng(1)
    rounding = _rounding(K, M)
    while R.shape[1] < most:
        x = _lowest(R, M, factor, rng)
        if x @ (K @ x) > rounding:
            break
        R = np.column_stack([R, x])
    return R


def _rounding(K, M) -> float:
    """What rounding makes of a zero eigenvalue [rad^2/s^2]."""
    k, m = K.diagonal(), M.diagonal()
    return float(ROUNDING * np.quantile(k[m > 0] / m[m > 0], 0.99))


def _lowest(R, M, factor: Factor, rng: np.random.Generator) -> NDArray[np.float64]:
    """Nearly the lowest motion (n,) beyond R, by inverse iteration; mass-normalised."""
    x = rng.standard_normal(M.shape[0])
    for _ in range(INVERSE_ITERATIONS):
        x = _deflated(R, M, factor, M @ x)
        x /= np.sqrt(x @ (M @ x))
    return x


def _deflated(R, M, factor: Factor, b: NDArray[np.float64]) -> NDArray[np.float64]:
    """P (K - sigma M)^-1 P^T b with P = I - R R^T M."""
    if not R.shape[1]:
        return factor.solve(b)
    u = factor.solve(b - M @ (R @ (R.T @ b)))
    return u - R @ (R.T @ (M @ u))


def _check(found: Modes, K, M, sigma: float) -> None:
    Mphi = M @ found.phi
    skew = np.abs(found.phi.T @ Mphi - np.eye(len(found.omega))).max()
    if not skew < 1e-7:
        raise ValueError(
            f"the modes are not M-orthonormal (largest error {skew:.1e}); refine K, M."
        )
    residual = K @ found.phi - Mphi * found.omega**2
    # the elongation of a joint moves a whole face: its row counts as that of a node
    m = M.diagonal()
    row = np.sqrt(np.minimum(1.0, np.quantile(m, 0.99) / np.maximum(m, np.finfo(float).tiny)))
    # a free bolt of 30 g in elements of 1 mm: rounding leaves 1.3e-2 of a shift of 5 Hz
    least = _rounding(K, M) / LOST
    scale = np.linalg.norm(row[:, None] * Mphi, axis=0) * np.maximum(found.omega**2 - sigma, least)
    left = np.linalg.norm(row[:, None] * residual, axis=0) / scale
    at, worst = int(left.argmax()), left.max()
    if not worst < LOST:
        raise ValueError(
            f"a mode near {found.frequency_hz[at]:.2g} Hz is lost in the rounding of K (relative "
            f"residual {worst:.1e}, allowed {LOST:g}): a part hangs on joints too soft beside its "
            "own stiffness; stiffen the softest joints."
        )
