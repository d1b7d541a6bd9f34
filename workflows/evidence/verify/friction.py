"""Friction of a sphere at a flat beside closed forms, published impacts, a plain row of springs."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from beadwave import dem
from beadwave.coupling.lateral_march import WallMotion, march_lateral
from beadwave.dem.friction import tangential_law
from beadwave.dem.lateral import LastSphere
from beadwave.workflows.evidence.harness import Comparison, compared

R, RHO, E, NU, MU = 0.0127, 7800.0, 210e9, 0.3, 0.2  # m, kg/m^3, Pa
LOAD, SPEED = 100.0, 0.1  # N pressed, m/s struck
MINDLIN = "R. D. Mindlin's loops in closed form, Johnson (1985), 7.57"
MAW = "N. Maw, J. R. Barber, J. N. Fawcett, Wear 38 (1976) 101"
COULOMB = "Coulomb's impulse, 1 - 7 mu v_n / v_t where all slips"
PLAIN = "20000 steps of 3000 springs cut back one by one, velocity Verlet"


def friction() -> Iterator[Comparison]:
    """Loops under constant load, oblique impacts, and histories by independent springs."""
    # loops of a plane that moves below a clamped sphere: k is the stiffness of full stick, q the
    # largest force over mu P; at gross slip, q = 1, (7.57) is 6/5 (mu P)^2 / k
    E_star, G_star = E / (2.0 * (1.0 - NU**2)), E / (1.0 + NU) / (2.0 - NU)
    a = (0.75 * LOAD * R / E_star) ** (1.0 / 3.0)
    k = 2.0 * a * G_star
    gross = 1.5 * MU * LOAD / k  # displacement at gross slip
    loop_of_gross = 7.2 * (MU * LOAD) ** 2 / k / 6.0
    for q in (0.1, 0.25, 0.5, 0.9):
        amplitude = gross * (1.0 - (1.0 - q) ** (2.0 / 3.0))
        bracket = 1.0 - (1.0 - q) ** (5 / 3) - 5 / 6 * q * (1.0 + (1.0 - q) ** (2 / 3))
        yield compared(f"loop at {q:g} of mu P [J]", _loop(amplitude),
                       7.2 * (MU * LOAD) ** 2 / k * bracket,
                       allowed=1e-6, of=loop_of_gross, source=MINDLIN)  # fmt: skip
    for amplitude in (1.5 * gross, 4.0 * gross):
        yield compared(f"loop at {amplitude / gross:g} of gross slip [J]", _loop(amplitude),
                       loop_of_gross + 4.0 * MU * LOAD * (amplitude - gross),
                       allowed=1e-6, of=loop_of_gross, source=MINDLIN)  # fmt: skip

    # oblique impacts of a free sphere; psi = 2 (1 - nu) v_t / (mu (2 - nu) v_n)
    for psi, ratio in ((1.0, -0.0597), (3.0, -0.4599)):
        ours, v = oblique_impact(psi)
        yield compared(f"impact at psi = {psi:g}, surface velocity [v_t]", ours / v, ratio,
                       allowed=1e-4, of=1.0, source=MAW)  # fmt: skip
    for psi in (4.8, 6.0, 8.0):
        ours, v = oblique_impact(psi)
        left = 1.0 - 7.0 * MU * SPEED / v
        yield compared(f"impact at psi = {psi:g}, surface velocity [v_t]", ours / v, left,
                       allowed=1e-6, of=1.0, source=COULOMB)  # fmt: skip
    for psi in (0.2, 0.5, 2.0, 4.0):
        ours, v = oblique_impact(psi)
        yield compared(f"impact at psi = {psi:g}, surface velocity [v_t]", ours / v,
                       _plain_impact(v, E_star, G_star) / v,
                       allowed=1e-4, of=1.0, source=PLAIN)  # fmt: skip


def sphere_with_friction(preload: float = 0.0, **fields) -> tuple[dem.Chain, LastSphere]:
    """One sphere on a flat of its material, preloaded [N], with more fields of `LastSphere`."""
    chain = dem.row_of_spheres(R, RHO, E, NU, count=1, flat=dem.Flat(E, NU), preload=preload)
    law = tangential_law(MU, R, E, NU, np.inf, E, NU)
    inertia = 0.4 * float(chain.mass[0]) * R**2
    return chain, LastSphere(law, inertia, **({"velocity": np.zeros(2)} | fields))


def _loop(amplitude: float) -> float:
    """Energy [J] of a period of a plane that moves by an amplitude [m]."""
    chain, last = sphere_with_friction(LOAD)
    wall, still = dem.rigid_wall(), np.zeros(1)
    along = dem.march(chain, wall, still, duration=0.1, dt=2.5e-5, n_save=4)
    clamped = last._replace(arm_stiffness=np.full(2, np.inf), arm_rotation=np.inf)
    motion = WallMotion(np.array([[amplitude, 0.0]]), np.array([10.0]), np.zeros(1))
    return march_lateral(chain, wall, still, along, clamped, motion=motion, error=1e-5).cycle.energy


def tangential_speed(psi: float) -> float:
    """[m/s] of psi = 2 (1 - nu) v_t / (mu (2 - nu) v_n)."""
    return psi * MU * (2.0 - NU) * SPEED / (2.0 * (1.0 - NU))


def oblique_impact(psi: float) -> tuple[float, float]:
    """Velocity [m/s] of the surface at the contact after an oblique impact, and before it."""
    v = tangential_speed(psi)
    chain, last = sphere_with_friction()
    wall, v0 = dem.rigid_wall(), np.array([SPEED])
    along = dem.march_to_error(
        chain, wall, v0, duration=2e-4, error=1e-5, n_save=100
    ).trajectory  # fmt: skip
    run = march_lateral(
        chain, wall, v0, along, last._replace(velocity=np.array([v, 0.0])), error=1e-5
    )
    return float(run.sphere_t_v[-1, 0] + R * run.sphere_spin[-1, 1]), v


def _plain_impact(v: float, E_star: float, G_star: float) -> float:
    """The velocity after the impact by springs at fixed places, each cut back to its bound."""
    m = 4.0 / 3.0 * np.pi * R**3 * RHO
    A = 4.0 / 3.0 * E_star * np.sqrt(R)
    deepest = (1.25 * m * SPEED**2 / A) ** 0.4
    x: NDArray[np.float64] = (np.arange(3000) + 0.5) / 3000 * np.sqrt(R * deepest) * 1.001
    dx, u = x[1] - x[0], np.zeros(x.size)
    t = np.linspace(0.0, 3.0 * deepest / SPEED, 20_001)
    h, d, rate, surface, force, T = t[1], 0.0, SPEED, v, 0.0, 0.0
    for _ in pairwise(t):
        rate -= 0.5 * h * force / m
        surface -= 0.5 * h * 3.5 * T / m
        d += h * rate
        if d < 0.0:
            break
        bound = np.maximum(MU * E_star / G_star * (d - x**2 / R), 0.0)
        u = np.clip(u + h * surface, -bound, bound)
        force, T = A * d**1.5, 2.0 * G_star * dx * float(u.sum())
        rate -= 0.5 * h * force / m
        surface -= 0.5 * h * 3.5 * T / m
    return surface
