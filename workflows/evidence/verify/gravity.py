"""Chains under their weight beside closed forms, and Newton's equations by another integrator."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from beadwave import dem
from beadwave.workflows.evidence.harness import Comparison, compared

G = 9.80665  # m/s^2
DENSITY, YOUNG, YOUNG_FLAT, POISSON = 7800.0, 193e9, 210e9, 0.3  # kg/m^3, Pa, Pa
CARRIED = "Hertz' law under the weight above, delta_i = (g sum m_j / A_i)^(2/3)"
NEWTON = "Newton's equations written out, DOP853 at steps below 1 us"


def gravity() -> Iterator[Comparison]:
    """Upright chains: overlaps at rest, and waves through a preload that grows downwards."""
    for inclination, words in ((90.0, "upright"), (20.0, "at 20 degrees")):
        chain, weights, A = _column(60, inclination)
        x = dem.equilibrium(chain, dem.rigid_wall()).x
        yield compared(f"60 spheres {words}, overlaps [m]", -np.diff(np.append(x, 0.0)),
                       (np.cumsum(weights) / A) ** (2 / 3),
                       allowed=1e-9, source=CARRIED)  # fmt: skip

    # the first sphere of a column at rest is given a speed: sound, up to waves that open gaps
    n, duration = 20, 1.4e-3
    chain, weights, A = _column(n, 90.0)
    m = weights / G
    x0 = np.cumsum(((np.cumsum(weights) / A) ** (2 / 3))[::-1])[::-1]

    def rate(_, y):
        """Newton's equations of the column, positions x counted down from the undeformed column."""
        x, v = y[:n], y[n:]
        F = A * np.maximum(x - np.append(x[1:], 0.0), 0.0) ** 1.5
        return np.append(v, G + (np.append(0.0, F[:-1]) - F) / m)

    for speed in (1e-4, 1e-2, 0.3):  # m/s
        v0 = speed * np.eye(1, n)[0]
        ours = dem.march_to_error(
            chain, dem.rigid_wall(), v0, duration=duration, error=1e-8, n_save=1400
        ).trajectory
        theirs = solve_ivp(rate, (0.0, duration), np.append(x0, v0), "DOP853", ours.t,
                           rtol=1e-11, atol=1e-16, max_step=1e-6).y.T[:, n:]  # fmt: skip
        name = f"upright column struck at {speed:g} m/s"
        yield compared(f"{name}, velocities [V]", ours.v / speed, theirs / speed,
                       allowed=1e-6, of=1.0, source=NEWTON)  # fmt: skip
        flights = [
            _crest(ours.t, v[:, n - 2]) - _crest(ours.t, v[:, 1]) for v in (ours.v, theirs)
        ]  # fmt: skip
        yield compared(f"{name}, time of flight from sphere 2 to {n - 1} [s]", *flights,
                       allowed=1e-6, source=NEWTON)  # fmt: skip


def _column(
    n: int, inclination: float
) -> tuple[dem.Chain, NDArray[np.float64], NDArray[np.float64]]:
    """Spheres of two sizes on a flat, their weights along the chain (n,) [N], and A (n,)
    [N/m^1.5] of F = A delta^1.5 between spheres and, last, at the flat."""
    radius = np.where(np.arange(n) % 3, 0.0095, 0.008)
    g = G * np.sin(np.radians(inclination))
    flat = dem.Flat(YOUNG_FLAT, POISSON)
    chain = dem.row_of_spheres(radius, DENSITY, YOUNG, POISSON, gravity=g, flat=flat)
    behind = np.append(np.full(n - 1, YOUNG), YOUNG_FLAT)
    compliance = (1 - POISSON**2) * (1 / YOUNG + 1 / behind)  # 1 / E*
    curvature = 1 / radius + np.append(1 / radius[1:], 0.0)
    A = 4 / 3 / compliance / np.sqrt(curvature)
    return chain, g * DENSITY * 4 / 3 * np.pi * radius**3, A


def _crest(t: NDArray[np.float64], v: NDArray[np.float64]) -> float:
    """The time [s] of the first crest above half of the largest velocity, by a parabola."""
    crests = (v[1:-1] >= v[:-2]) & (v[1:-1] > v[2:]) & (v[1:-1] > v.max() / 2)
    i = 1 + int(np.argmax(crests))
    a, b, c = v[i - 1 : i + 2]
    return float(t[i] + (t[1] - t[0]) * (a - c) / (2 * (a - 2 * b + c)))
