"""Natural frequencies and mode shapes, K phi = omega^2 M phi, by shift-inverted Lanczos."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator, eigsh

from fem.factorisation import factorised


class Modes(NamedTuple):
    """Mass-normalised modes, lowest first."""

    omega: NDArray[np.float64]  # (k,) [rad/s]
    phi: NDArray[np.float64]  # (n, k)

    @property
    def frequency_hz(self) -> NDArray[np.float64]:
        """(k,)"""
        return self.omega / (2 * np.pi)


def modes(K, M, n_modes: int, *, shift_hz: float = 5.0) -> Modes:
    """The lowest modes of K phi = omega^2 M phi.

    The shift lies at -(2 pi shift_hz)^2, a tenth of the lowest elastic frequency or so: K itself
    may be singular (a free part has omega = 0), and a shift near zero would return wrong modes.
    Raises ValueError when the modes are not M-orthonormal or leave a residual.
    """
    sigma = -((2 * np.pi * shift_hz) ** 2)
    factor = factorised((K - sigma * M).tocsc())
    n = K.shape[0]
    inverse = LinearOperator((n, n), matvec=factor.solve)
    start = np.random.default_rng(0).standard_normal(n)
    eigenvalues, phi = eigsh(K, n_modes, M, sigma=sigma, OPinv=inverse, v0=start)
    order = np.argsort(eigenvalues)
    found = Modes(np.sqrt(np.maximum(eigenvalues[order], 0.0)), phi[:, order])
    _check(found, K, M, sigma)
    return found


def _check(found: Modes, K, M, sigma: float) -> None:
    Mphi = M @ found.phi
    skew = np.abs(found.phi.T @ Mphi - np.eye(len(found.omega))).max()
    if not skew < 1e-7:
        raise ValueError(
            f"the modes are not M-orthonormal (largest error {skew:.1e}); refine K, M."
        )
    residual = K @ found.phi - Mphi * found.omega**2
    scale = np.linalg.norm(Mphi, axis=0) * (found.omega**2 - sigma)
    left = np.linalg.norm(residual, axis=0) / scale
    at, worst = int(left.argmax()), left.max()
    if not worst < 1e-2:
        raise ValueError(
            f"a mode near {found.frequency_hz[at]:.2g} Hz is lost in the rounding of K (relative "
            f"residual {worst:.1e}, allowed 1e-2): a part hangs on joints too soft beside its own "
            "stiffness; stiffen the softest joints."
        )
