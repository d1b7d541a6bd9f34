"""A computed hammer test, and which mode each measured resonance is.

    H(omega) = -omega^2 sum_j read_j hit_j / (omega_j^2 - omega^2 + 2 i zeta_j omega_j omega)

Ewins, Modal Testing (2000), sec. 2.4.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from beadwave.fem.assembly.model import Model
from beadwave.fem.assembly.trace import at_node


def corner_readings(model: Model, body: str) -> NDArray[np.float64]:
    """Rows (3, n) that read x, y and z at the body's corner of the largest coordinates."""
    structure = model.structure
    corner = structure.basis[body].mesh.p.max(axis=1)
    return np.array([at_node(structure, corner, e) for e in np.eye(3)]) @ model.T


def accelerances(
    read: NDArray[np.float64],
    hit: NDArray[np.float64],
    omega: NDArray[np.float64],
    zeta: NDArray[np.float64],
    frequency_hz: NDArray[np.float64],
) -> NDArray[np.complex128]:
    """H (r, len(frequency_hz)) [m/s^2/N] of modes omega (k,) [rad/s] with ratios zeta (k,); read
    (r, k) and hit (k,) [kg^-1/2] are what their mass-normalised shapes are there."""
    s = 2 * np.pi * frequency_hz
    pole = omega[:, None] ** 2 - s**2 + 2j * (zeta * omega)[:, None] * s
    return -(s**2) * ((read * hit) @ (1 / pole))


def with_noise(
    H: NDArray[np.complex128], relative: float, rng: np.random.Generator
) -> NDArray[np.complex128]:
    """H (r, k) with complex Gaussian noise of the rms `relative` times that of all of H: the same
    at every line, so that antiresonances drown in it first."""
    size = relative * np.sqrt(np.mean(np.abs(H) ** 2)) / np.sqrt(2)
    noise = rng.normal(size=(2, *H.shape))
    return H + size * (noise[0] + 1j * noise[1])


def nearest_modes(
    measured_hz: list[float], expected_hz: dict[int, float], *, farthest: float = 1.5
) -> dict[int, int]:
    """Pairs {position of a measured resonance: number of its mode}, each used once, with
    frequencies within the factor `farthest`; the sum of the distances |ln f / f'| is the least."""
    modes = list(expected_hz)
    distance = np.abs(np.log(np.divide.outer(measured_hz, [expected_hz[m] for m in modes])))
    limit = np.log(farthest)
    rows, columns = linear_sum_assignment(np.where(distance < limit, distance, 10 * limit))
    return {int(i): modes[j] for i, j in zip(rows, columns, strict=True) if distance[i, j] < limit}
