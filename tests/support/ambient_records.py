"""Records without a force, of four known modes."""

import numpy as np
from scipy.signal import cont2discrete, lfilter

DT = 1 / 512
F, ZETA = np.array([12.0, 31.0, 32.5, 58.0]), np.array([0.01, 0.008, 0.01, 0.006])


def ambient(seed, seconds, noise=0.05):
    """Four modes, two 5 % apart, driven by white noise at three points; y (m, k), phi (m, n)."""
    rng = np.random.default_rng(seed)
    phi, drive = rng.normal(size=(5, 4)), rng.normal(size=(4, 3))
    u = rng.normal(size=(3, round(seconds / DT)))
    y = 0.0
    for f, z, shape, b in zip(F, ZETA, phi.T, drive, strict=True):
        w = 2 * np.pi * f
        num, den, _ = cont2discrete(([1.0, 0, 0], [1.0, 2 * z * w, w**2]), DT, method="zoh")
        y = y + np.outer(shape, lfilter(num.ravel(), den, b @ u))
    return y + noise * y.std() * rng.normal(size=y.shape), phi
