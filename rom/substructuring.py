"""Substructures joined by their receptances, as measured or computed one by one.

    H = H_u - H_u B^T (B H_u B^T + Y)^-1 B H_u

H_u is block-diagonal with the receptances of the free-standing substructures, B u = 0 are the
interface conditions, and Y is the receptance of the joint in each: 0 where it is rigid,
1 / (k + i omega c) for a spring and a dashpot. The multipliers are the forces in the joints. D. de
Klerk, D. J. Rixen, S. N. Voormeeren, AIAA J. 46 (2008) 1169, LM-FBS; joints that give way: M. S.
Allen et al., Substructuring in Engineering Dynamics (CISM 594, 2020), section 4.3.

>>> import numpy as np
>>> spring = np.full((1, 1, 1), 1 / 2e6), np.full((1, 1, 1), 1 / 1e6)  # two springs side by side
>>> H = joined_receptance(spring, compatibility((1, 1), [((0, 0), (1, 0))]))
>>> float(round(1 / H[0, 0, 0].real))
3000000.0
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import block_diag
from scipy.ndimage import maximum_filter1d

from beadwave.rom.factorisation import ReductionError

# condition of the scaled interface receptance beyond which forces in joints are rounding:
# a condition that is stated twice has 1e16
MAX_CONDITION = 1e12


def compatibility(
    sizes: Sequence[int], pairs: Sequence[tuple[tuple[int, int], tuple[int, int]]]
) -> NDArray[np.float64]:
    """B (m, n) with a row u_a - u_b for each pair of (substructure, degree of freedom), from 0: the
    signed Boolean matrix of de Klerk, Rixen and Voormeeren.

    sizes are the numbers of degrees of freedom of the substructures, of sum n.
    """
    first = np.concatenate([[0], np.cumsum(sizes)])
    B = np.zeros((len(pairs), first[-1]))
    for row, ((a, i), (b, j)) in zip(B, pairs, strict=True):
        row[first[a] + i] += 1.0
        row[first[b] + j] -= 1.0
    return B


def joint_receptance(
    frequency_hz: ArrayLike, stiffness: ArrayLike, dashpot: ArrayLike = 0.0
) -> NDArray[np.complex128]:
    """Y (k, m) [m/N, rad/(N m)] = 1 / (k + i omega c) of springs k (m,) [N/m, N m/rad] and dashpots
    c (m,) [N s/m, N m s/rad] in parallel, at frequencies (k,) [Hz].

    An infinite stiffness is a rigid joint, Y = 0. Raises ReductionError for a negative value, for a
    joint with neither a spring nor a dashpot, and for a dashpot alone at 0 Hz.
    """
    omega = 2 * np.pi * np.asarray(frequency_hz, float)[:, None]
    k, c = np.broadcast_arrays(*np.atleast_1d(stiffness, dashpot))
    if not (np.all(k >= 0) and np.all(c >= 0) and np.all((k > 0) | (c > 0))):
        raise ReductionError(
            f"joints of stiffness {np.min(k):g} and dashpot {np.min(c):g}: neither may be negative "
            "and one must be above 0; leave a joint out that carries no force."
        )
    if np.any((k == 0) & (omega == 0)):
        raise ReductionError("a dashpot alone carries no force at 0 Hz; leave this frequency out.")
    rigid = np.isinf(k)
    return np.where(rigid, 0.0, 1 / (np.where(rigid, 1.0, k) + 1j * omega * c))


class JoinedByFits(NamedTuple):
    """A structure joined of fitted parts, and how far it is from that of the measured parts."""

    H: NDArray[np.complex128]  # (k, n, n) [m/N, rad/N, rad/(N m)]
    error: NDArray[np.float64]  # (k, n, n) of |H|, in its units


def joined_by_fits(
    fitted: Sequence[NDArray[np.complex128]],
    measured: Sequence[NDArray[np.complex128]],
    B: NDArray[np.float64],
    Y: NDArray[np.complex128] | None = None,
    *,
    lines: int = 2,
) -> JoinedByFits:
    """Receptance of fitted parts joined, with its error at the frequencies of the measurement.

    A resonance of the whole multiplies what a fit misses of a part, so that the part's own misfit
    is no bar of the whole. The error is the distance to the measured receptances joined without a
    fit, relative, the largest within so many `lines` to either side: what the fit misses, together
    with the noise of the measurement. Of a part that is not measured, `fitted` and `measured` are
    its receptance alike. B and Y as of `joined_receptance`, which says what is refused.
    """
    H = joined_receptance(fitted, B, Y)
    size = np.maximum(np.abs(H), np.finfo(float).tiny)
    relative = np.abs(H - joined_receptance(measured, B, Y)) / size
    nearby = maximum_filter1d(relative, 2 * lines + 1, axis=0, mode="nearest")
    return JoinedByFits(H, nearby * size)


def joined_receptance(
    substructures: Sequence[NDArray[np.complex128]],
    B: NDArray[np.float64],
    Y: NDArray[np.complex128] | None = None,
) -> NDArray[np.complex128]:
    """Receptance (k, n, n) [m/N, rad/N, rad/(N m)] of the joined structure at all degrees of
    freedom of its parts.

    substructures are their receptances (k, n_s, n_s) at the same k frequencies, n the sum of n_s; B
    (m, n) the interface conditions; Y (k, m) what `joint_receptance` gives, None for rigid joints.
    Raises ReductionError where conditions repeat each other, sizes do not fit or a receptance is
    not finite.
    """
    k, n = len(substructures[0]), sum(H.shape[-1] for H in substructures)
    if any(len(H) != k for H in substructures) or B.shape[1] != n:
        raise ReductionError(
            f"substructures of {[H.shape for H in substructures]} do not fit B of {B.shape}; give "
            "all at the same frequencies, and B a column for each degree of freedom."
        )
    if not all(np.isfinite(H).all() for H in substructures):
        raise ReductionError("a receptance holds NaN or inf; leave those frequencies out.")
    joined = np.empty((k, n, n), complex)
    for i in range(k):
        H = block_diag(*(part[i] for part in substructures)).astype(complex)

        # receptances of displacements and turns have other units: scaled to a diagonal of 1
        across = B @ H @ B.T + (0 if Y is None else np.diag(Y[i]))
        scale = 1 / np.sqrt(np.maximum(np.abs(np.diag(across)), np.finfo(float).tiny))
        scaled = scale[:, None] * across * scale
        if np.linalg.cond(scaled) > MAX_CONDITION:
            raise ReductionError(
                f"interface conditions repeat each other (number {i + 1} of the frequencies); "
                "leave out those that others imply."
            )

        # forces in the joints per unit load, lambda = (B H B^T + Y)^-1 B H, and what they change
        forces = scale[:, None] * np.linalg.solve(scaled, scale[:, None] * (B @ H))
        joined[i] = H - H @ B.T @ forces
    return joined
