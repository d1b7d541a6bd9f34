"""Chains in LAMMPS, whose velocity Verlet converges to our result with order 2."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

import dem
from workflows.evidence.verify.comparisons import Comparison, compared, require_module
from workflows.evidence.verify.lammps_chain import LammpsSpheres, started, velocities

R, RHO, E, NU = 0.0127, 7800.0, 210e9, 0.3  # m, kg/m^3, Pa: the rig's spheres
SOURCE = "LAMMPS, package GRANULAR, pair hertz/material and fix wall/gran, step 25 ns"


class LammpsCase(NamedTuple):
    """Spheres, how many, at a wall of the last one's material or free."""

    spheres: LammpsSpheres
    n: int
    wall: bool


ODD = np.arange(17) % 2
DIMER = LammpsSpheres(
    R, np.where(ODD, 8500.0, RHO), np.where(ODD, 103e9, E), np.where(ODD, 0.34, NU)
)
TAPERED = LammpsSpheres(R * 0.95 ** np.arange(12), RHO, E, NU)
CASES = {
    "17 spheres at a wall": LammpsCase(LammpsSpheres(R, RHO, E, NU), 17, True),
    "17 free spheres": LammpsCase(LammpsSpheres(R, RHO, E, NU), 17, False),
    "dimer of steel and brass at a wall": LammpsCase(DIMER, 17, True),
    "tapered by 5 % at a wall": LammpsCase(TAPERED, 12, True),
    "9 spheres at a wall, linear dampers": LammpsCase(LammpsSpheres(R, RHO, E, NU, 10.0), 9, True),
}


def lammps() -> Iterator[Comparison]:
    """Equal, unlike, tapered and damped chains in LAMMPS."""
    require_module("lammps", lambda: started().close())
    speed, rough, fine = 0.31, 1e-7, 2.5e-8  # m/s; steps [s]
    saves = {"duration": 1.5e-3, "n_save": 15}
    for name, (spheres, n, at_wall) in CASES.items():
        v0 = speed * np.eye(1, n)[0]
        v_rough, v_fine = (
            velocities(spheres, v0, wall=at_wall, dt=dt, **saves) for dt in (rough, fine)
        )

        young, poisson = (np.broadcast_to(x, n)[-1] for x in (spheres.young, spheres.poisson))
        flat, wall = (dem.Flat(young, poisson), dem.rigid_wall()) if at_wall else (None, None)
        dampers = {"dissipation": "linear", "gamma": spheres.damping} if spheres.damping else {}
        chain = dem.row_of_spheres(*spheres[:4], count=n, flat=flat, **dampers)
        error = 1e-6 if dampers else 1e-8
        ours = dem.march_to_error(chain, wall, v0, error=error, **saves).trajectory.v[1:]

        # LAMMPS damps by the velocity of half a step before, order 1; else it converges with 2
        yield compared(f"{name}: velocities [V]", ours, v_fine,
                       allowed=5e-5 if dampers else 2e-6, of=speed, source=SOURCE)  # fmt: skip
        if dampers:
            continue
        errors = [np.abs(v - ours).max() for v in (v_rough, v_fine)]
        order = np.log(errors[0] / errors[1]) / np.log(rough / fine)
        yield compared(f"{name}: order of its convergence to us", order, 2.0,
                       allowed=0.1, of=1.0, source=SOURCE)  # fmt: skip
