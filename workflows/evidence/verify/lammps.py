"""Chains in LAMMPS, whose velocity Verlet converges to our result with order 2."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

import dem
from workflows.evidence.verify.comparisons import Comparison, compared, require_module
from workflows.evidence.verify.lammps_chain import Spheres, started, velocities

SPEED, DURATION, N_SAVE = 0.31, 1.5e-3, 15
STEPS = (1e-7, 2.5e-8)  # s
DAMPED = 5e-5  # LAMMPS damps by the velocity of half a step before: order 1
SOURCE = "LAMMPS, package GRANULAR, pair hertz/material and fix wall/gran, step 25 ns"
R, RHO, E, NU = 0.0127, 7800.0, 210e9, 0.3


class Case(NamedTuple):
    """Spheres, how many, at a wall of the last one's material or free."""

    spheres: Spheres
    n: int
    wall: bool


ODD = np.arange(17) % 2
CASES = {
    "17 spheres at a wall": Case(Spheres(R, RHO, E, NU), 17, True),
    "17 free spheres": Case(Spheres(R, RHO, E, NU), 17, False),
    "dimer of steel and brass at a wall": Case(
        Spheres(R, np.where(ODD, 8500.0, RHO), np.where(ODD, 103e9, E), np.where(ODD, 0.34, NU)),
        17,
        True,
    ),
    "tapered by 5 % at a wall": Case(Spheres(R * 0.95 ** np.arange(12), RHO, E, NU), 12, True),
    "9 spheres at a wall, linear dampers": Case(Spheres(R, RHO, E, NU, 10.0), 9, True),
}


def lammps() -> Iterator[Comparison]:
    """Equal, unlike, tapered and damped chains in LAMMPS."""
    require_module("lammps", lambda: started().close())
    for name, case in CASES.items():
        rough, fine = (_theirs(case, dt) for dt in STEPS)
        ours, damped = _ours(case), case.spheres.damping
        yield compared(f"{name}: velocities [V]", ours, fine,
                       allowed=DAMPED if damped else 2e-6, of=SPEED, source=SOURCE)  # fmt: skip
        if not damped:
            off = [np.abs(theirs - ours).max() for theirs in (rough, fine)]
            order = np.log(off[0] / off[1]) / np.log(STEPS[0] / STEPS[1])
            yield compared(f"{name}: order of its convergence to us", order, 2.0,
                           allowed=0.1, of=1.0, source=SOURCE)  # fmt: skip


def _theirs(case: Case, dt: float) -> np.ndarray:
    v0 = SPEED * np.eye(1, case.n)[0]
    run = {"duration": DURATION, "n_save": N_SAVE, "dt": dt}
    return velocities(case.spheres, v0, wall=case.wall, **run)


def _ours(case: Case) -> np.ndarray:
    s, wall = case.spheres, dem.rigid_wall() if case.wall else None
    E_last, nu_last = (np.broadcast_to(x, case.n)[-1] for x in (s.young, s.poisson))
    flat = dem.Flat(E_last, nu_last) if case.wall else None
    damped = {"dissipation": "linear", "gamma": s.damping} if s.damping else {}
    chain = dem.row_of_spheres(*s[:4], count=case.n, flat=flat, **damped)
    run = {"duration": DURATION, "error": 1e-8 if not damped else 1e-6, "n_save": N_SAVE}
    return dem.march_to_error(chain, wall, SPEED * np.eye(1, case.n)[0], **run).trajectory.v[1:]
