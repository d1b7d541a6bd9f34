"""Reductions and couplings beside closed solutions and published matrices."""

from collections.abc import Iterator
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from beadwave import dem, rom
from beadwave.coupling.radiation import lamb_integral
from beadwave.dem.spheres import hertz_coefficient
from beadwave.workflows.evidence.harness import Comparison, compared

JULIA = "JuliaFEM, ModelReduction.jl, README"
MILLER = "G. F. Miller, H. Pursey, Proc. R. Soc. A 233 (1955) 55"
TIMOSHENKO = "S. Timoshenko, Z. Math. Phys. 62 (1913) 198, his integral equation"
JOHNSON = "K. L. Johnson, Contact Mechanics (1985), ch. 4"
LINEAR = "the linear oscillator of two masses"


def reductions() -> Iterator[Comparison]:
    """Craig-Bampton's published example, a chain of springs, two masses in touch."""
    K = np.array([[2, -1, 0, 0], [-1, 2, -1, 0], [0, -1, 2, -1], [0, 0, -1, 1.0]])
    M, w = np.diag([2.0, 2, 2, 1]), [0, 0, 0, 1.0]
    four = rom.craig_bampton(K, M, w, [3], rom.Selection(n_modes=1))
    published = partial(compared, source=JULIA, of=1.0)
    yield published("four masses, K_r", four.K, [[0.25, 0], [0, 0.292893]], allowed=5e-7)
    M_r = [[2.75, 1.20711], [1.20711, 1]]
    yield published("four masses, |M_r|", np.abs(four.M), M_r, allowed=5e-6)

    # n masses in a row, held at one end, loaded evenly on the last five at the other
    n, k, m = 600, 3e8, 0.02
    K = k * (np.diag(np.append(np.full(n - 1, 2.0), 1.0)) - np.eye(n, k=1) - np.eye(n, k=-1))
    w = np.append(np.zeros(n - 5), np.full(5, 0.2))
    reduced = rom.free_modes(K, m * np.eye(n), w, rom.Selection(n_modes=12))
    j = np.arange(1, 13)
    exact = 2 * np.sqrt(k / m) * np.sin((2 * j - 1) * np.pi / (4 * n + 2))
    yield compared("600 springs, twelve frequencies [rad/s]", rom.modal(reduced).omega[:12], exact,
                   allowed=1e-9, source="2 sqrt(k/m) sin((2 j - 1) pi / (4 n + 2))")  # fmt: skip
    # springs in series: the first n - 4 carry the whole force, the others 4/5 ... 1/5 of it
    exact = (n - 4 + np.sum((np.arange(5, 0, -1) / 5) ** 2) - 1) / k
    yield compared("600 springs, static compliance [m/N]", rom.static_compliance(reduced), exact,
                   allowed=1e-9, source="springs in series")  # fmt: skip

    # A sphere pressed on a mass and barely struck: the contact is a spring of 3/2 A^(2/3) F^(1/3).
    # Its curvature leaves an error of the order of v / sqrt(k / m) over the overlap.
    A, F, m, m_wall, hz, v0 = 1.7e10, 100.0, 0.0669, 1.3, 400.0, 1e-7
    k, k_wall = 1.5 * A ** (2 / 3) * F ** (1 / 3), m_wall * (2 * np.pi * hz) ** 2
    chain = dem.Chain(np.array([m]), np.array([0.0127]), np.array([A]), preload=F)
    run = dem.march(chain, dem.one_dof_wall(hz, m_wall), np.array([v0]),
                    duration=2e-3, dt=1e-7, n_save=200)  # fmt: skip
    K, M = np.array([[k, -k], [-k, k + k_wall]]), np.diag([m, m_wall])
    squared, shape = eigh(K, M)
    exact = np.cos(np.sqrt(squared) * run.t[:, None]) @ (shape[0] ** 2 * m) * v0
    yield compared("sphere pressed on a mass, small motion [V]", run.v[:, 0], exact,
                   allowed=1e-5, of=v0, source=LINEAR)  # fmt: skip


def sphere_on_modes(name: str, omega: NDArray[np.float64], phi: NDArray[np.float64]) -> Comparison:
    """Timoshenko's integral equation of a sphere on modes omega, phi (n,) [rad/s, kg^-1/2],
    F = A (v t - int ((t - s) / m + G(t - s)) F(s) ds)^(3/2), by the trapezoidal rule: the kernel
    vanishes at s = t, so that each F follows from those before it."""
    m, A, v, t = 0.0327, 1.7e10, 0.01, np.linspace(0.0, 1.5e-3, 6001)
    moved = phi**2 > 1e-9  # modes with a node at the contact do not take part
    omega, phi = omega[moved], phi[moved]
    kernel = t / m + np.sin(np.outer(t, omega)) @ (phi**2 / omega)
    F = np.zeros(t.size)
    for i in range(1, t.size):
        F[i] = A * max(v * t[i] - t[1] * kernel[i:0:-1] @ F[:i], 0.0) ** 1.5
    theirs = v - np.cumsum(F + np.append(0.0, F[:-1])) / 2 * t[1] / m
    chain = dem.Chain(np.array([m]), np.array([0.01]), np.array([A]))
    wall = dem.Wall(omega, np.zeros(omega.size), phi)
    run = dem.march_to_error(chain, wall, np.array([v]), duration=t[-1], error=1e-6, n_save=100)
    return compared(name, run.trajectory.v[:, 0], theirs[:: t.size // 100],
                    allowed=1e-4, of=v, source=TIMOSHENKO)  # fmt: skip


def half_spaces() -> Iterator[Comparison]:
    """Energy of the surface wave, and Hertz' coefficients of spheres and walls."""
    shares = lamb_integral(0.25)
    share = shares.surface / sum(shares)
    yield compared("half-space, share of the surface wave", share, 0.674,
                   allowed=5e-4, of=1.0, source=MILLER)  # fmt: skip
    A = hertz_coefficient(1.0, 1.0, 0.3, 1.0, 1.0, 0.3)
    walls = [hertz_coefficient(1.0, 1.0, 0.3, np.inf, E, 0.3) for E in (0.25, 1.0, np.inf)]
    exact = 2**1.5 / (1 + np.array([4.0, 1.0, 0.0]))
    yield compared("A_w / A of a softer wall, of the same material, rigid", walls / A, exact,
                   allowed=1e-14, source=JOHNSON)  # fmt: skip
