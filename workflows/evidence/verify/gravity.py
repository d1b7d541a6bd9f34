"""Chains under their weight beside closed forms, and Newton's equations by another integrator."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import dem
from workflows.evidence.verify.comparisons import Comparison, compared

G = 9.80665  # m/s^2
DENSITY, YOUNG, YOUNG_FLAT, POISSON = 7800.0, 193e9, 210e9, 0.3
CARRIED = "Hertz' law under the weight above, delta_i = (g sum m_j / A_i)^(2/3)"
NEWTON = "Newton's equations written out, DOP853 at steps below 1 us"


def gravity() -> Iterator[Comparison]:
    """Upright chains: overlaps at rest, and waves through a preload that grows downwards."""
    for inclination, words in ((90.0, "upright"), (20.0, "at 20 degrees")):
        chain, weights = _column(60, inclination)
        x = dem.equilibrium(chain, dem.rigid_wall()).x
        exact = (np.cumsum(weights) / _hertz(chain.radius)) ** (2 / 3)
        yield compared(f"60 spheres {words}, overlaps [m]", -np.diff(np.append(x, 0.0)), exact,
                       allowed=1e-9, source=CARRIED)  # fmt: skip
    for speed in (1e-4, 1e-2, 0.3):  # m/s: sound in the column at rest, up to waves that open gaps
        yield from _wave(speed)


def _column(n: int, inclination: float) -> tuple[dem.Chain, NDArray[np.float64]]:
    """Spheres of two sizes on a flat, and their weights along the chain [N]."""
    radius = np.where(np.arange(n) % 3, 0.0095, 0.008)
    along = G * np.sin(np.radians(inclination))
    flat = dem.Flat(YOUNG_FLAT, POISSON)
    chain = dem.row_of_spheres(radius, DENSITY, YOUNG, POISSON, gravity=along, flat=flat)
    return chain, along * DENSITY * 4 / 3 * np.pi * radius**3


def _hertz(radius: NDArray[np.float64]) -> NDArray[np.float64]:
    """A (n,) of F = A delta^1.5 between spheres and, last, at the flat [N/m^1.5]."""
    plane = (1 - POISSON**2) * (1 / YOUNG + 1 / np.append(np.full(len(radius) - 1, YOUNG),
                                                          YOUNG_FLAT))  # fmt: skip
    curvature = 1 / radius + np.append(1 / radius[1:], 0.0)
    return 4 / 3 / plane / np.sqrt(curvature)


def _wave(speed: float, n: int = 20) -> Iterator[Comparison]:
    """The first of a column at rest is given a speed; the wave to the last but one."""
    chain, weights = _column(n, 90.0)
    A, m, v0 = _hertz(chain.radius), weights / G, speed * np.eye(1, n)[0]
    duration = 1.4e-3
    found = dem.march_to_error(
        chain, dem.rigid_wall(), v0, duration=duration, error=1e-8, n_save=1400
    ).trajectory

    def rate(_, y):
        x, v = y[:n], y[n:]
        force = A * np.maximum(x - np.append(x[1:], 0.0), 0.0) ** 1.5
        return np.append(v, G + (np.append(0.0, force[:-1]) - force) / m)

    x0 = np.cumsum(((np.cumsum(weights) / A) ** (2 / 3))[::-1])[::-1]
    theirs = solve_ivp(rate, (0.0, duration), np.append(x0, v0), "DOP853", found.t,
                       rtol=1e-11, atol=1e-16, max_step=1e-6)  # fmt: skip
    v = theirs.y.T[:, n:]
    name = f"upright column struck at {speed:g} m/s"
    yield compared(f"{name}, velocities [V]", found.v / speed, v / speed,
                   allowed=1e-6, of=1.0, source=NEWTON)  # fmt: skip
    flights = [_peak(found.t, of[:, n - 2]) - _peak(found.t, of[:, 1]) for of in (found.v, v)]
    yield compared(f"{name}, time of flight from sphere 2 to {n - 1} [s]", *flights,
                   allowed=1e-6, source=NEWTON)  # fmt: skip


def _peak(t: NDArray[np.float64], v: NDArray[np.float64]) -> float:
    """The time of the first crest above half of the largest velocity, by a parabola [s]."""
    crests = (v[1:-1] >= v[:-2]) & (v[1:-1] > v[2:]) & (v[1:-1] > v.max() / 2)
    i = 1 + int(np.argmax(crests))
    a, b, c = v[i - 1 : i + 2]
    return float(t[i] + (t[1] - t[0]) * (a - c) / (2 * (a - 2 * b + c)))
