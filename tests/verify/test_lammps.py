"""Equal, unlike, tapered and damped chains, and oblique impacts, beside LAMMPS."""

import numpy as np
import pytest

from beadwave import dem
from beadwave.workflows.evidence.verify.friction import MU, SPEED, oblique_impact, tangential_speed

from peer_programs import require_module
from programs import lammps

SOURCE = "LAMMPS, package GRANULAR, pair hertz/material and fix wall/gran, step 25 ns"
INCREMENTS = "LAMMPS, package GRANULAR, tangential mindlin/force, step 10 ns"
ROUGH, FINE = 1e-7, 2.5e-8  # steps [s]

RIG = lammps.LammpsSpheres(0.0127, 7800.0, 210e9, 0.3)  # the rig's
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

pytestmark = pytest.mark.peer


@pytest.fixture(autouse=True, scope="module")
def needed():
    require_module("lammps", lambda: lammps.started().close())


@pytest.mark.parametrize("name", CASES)
def test_lammps_converges_to_our_velocities_with_order_2(name, compare):
    """LAMMPS damps by the velocity of half a step before, order 1: there the order is not asked."""
    (spheres, n, at_wall), speed = CASES[name], 0.31  # m/s
    saves, v0 = {"duration": 1.5e-3, "n_save": 15}, speed * np.eye(1, n)[0]
    v_rough, v_fine = (
        lammps.velocities(spheres, v0, wall=at_wall, dt=dt, **saves) for dt in (ROUGH, FINE)
    )

    young, poisson = (np.broadcast_to(x, n)[-1] for x in (spheres.young, spheres.poisson))
    flat, wall = (dem.Flat(young, poisson), dem.rigid_wall()) if at_wall else (None, None)
    dampers = {"dissipation": "linear", "gamma": spheres.damping} if spheres.damping else {}
    chain = dem.row_of_spheres(*spheres[:4], count=n, flat=flat, **dampers)
    error = 1e-6 if dampers else 1e-8
    ours = dem.march_to_error(chain, wall, v0, error=error, **saves).trajectory.v[1:]
    compare(f"{name}: velocities [V]", ours, v_fine,
            allowed=5e-5 if dampers else 2e-6, of=speed, source=SOURCE)  # fmt: skip
    if not dampers:
        errors = [np.abs(v - ours).max() for v in (v_rough, v_fine)]
        order = np.log(errors[0] / errors[1]) / np.log(ROUGH / FINE)
        compare(f"{name}: order of its convergence to us", order, 2.0,
                allowed=0.1, of=1.0, source=SOURCE)  # fmt: skip


# where all slips both bounds are Coulomb's; where a part does, LAMMPS' law is another one
@pytest.mark.parametrize(
    ("psi", "allowed"), [(8.0, 1e-5), (6.0, 1e-5), (3.0, 0.1), (1.0, 0.5), (0.5, 0.6)]
)
def test_oblique_impacts_in_lammps_leave_our_surface_velocity(psi, allowed, compare):
    ours, v = oblique_impact(psi)
    across = tangential_speed(psi)
    theirs = lammps.surface_velocity(RIG, speed=SPEED, across=across, coefficient=MU)
    compare(f"oblique impact at psi = {psi:g}, surface velocity [v_t]", ours / v, theirs / v,
            allowed=allowed, of=1.0, source=INCREMENTS)  # fmt: skip
