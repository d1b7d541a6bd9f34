"""Equal, unlike, tapered and damped chains, oblique impacts, pairs and crystals, beside LAMMPS."""

import numpy as np
import pytest

from beadwave import dem
from beadwave.dem import space
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


SMALL = lammps.LammpsSpheres(6e-3, 7800.0, 210e9, 0.3)
SMOOTH = "linear_nohistory 0 0"
# springs that leave a contact take their energy along, as ours do
ROUGH_LAW = "mindlin_rescale/force NULL 0.0 {mu}"


def in_space(x, pairs, friction):
    """The packing of spheres at x (s, 3) [m] whose pairs (c, 2) touch."""
    found = space.packing_of(x, *SMALL[:4], pairs=pairs, arm=x[pairs[:, 1]] - x[pairs[:, 0]])
    return found._replace(friction=np.full(len(pairs), friction)) if friction else found


def crystal_of(name, size):
    """Centres (s, 3) [m] of spheres that touch without force, and their pairs."""
    lattice = space.lattice(name, size)
    pairs, _ = space.touching(lattice.centre, lattice.period, 1.0 + space.CLOSE)
    return 2.0 * SMALL.radius * lattice.centre, pairs


@pytest.mark.parametrize(("name", "size"), [("hexagonal", (7, 8)), ("fcc", (3, 3, 3))])
def test_lammps_converges_to_our_velocities_in_a_crystal_with_order_2(name, size, compare):
    """A sphere of the first row or plane is struck, obliquely."""
    x, pairs = crystal_of(name, size)
    v0, run = np.zeros_like(x), {"duration": 2e-4}
    v0[len(x) // 2] = [0.1, 0.25, 0.0] if name == "hexagonal" else [0.05, 0.1, 0.2]
    still, steps = np.zeros_like(x), (1e-7, 5e-8)
    theirs = [
        lammps.packing_motion(x, v0, still, SMALL, law=SMOOTH, dt=dt, **run)[0] for dt in steps
    ]
    ours = space.march_to_error(in_space(x, pairs, 0.0), None, v0, error=1e-7, **run)
    speed, v = np.linalg.norm(v0, axis=1).max(), ours.velocity[-1]
    compare(f"{name} crystal of {len(x)} spheres: velocities [V]", v, theirs[1],
            allowed=1e-4, of=speed, source=SOURCE)  # fmt: skip
    errors = [np.abs(other - v).max() for other in theirs]
    compare(f"{name} crystal: order of its convergence to us", np.log2(errors[0] / errors[1]), 2.0,
            allowed=0.15, of=1.0, source=SOURCE)  # fmt: skip


PAIRS = [(0.1, 0.3, 0.0), (0.3, 0.1, 0.0), (0.3, 0.1, 30.0), (5.0, 0.2, -20.0)]


@pytest.mark.parametrize(("mu", "across", "spin"), PAIRS)
def test_oblique_pairs_leave_as_in_lammps(mu, across, spin, compare):
    """Two spheres meet off their line, one of them spinning; sliding, in part, sticking."""
    x = np.array([[0.0, 0.0, 0.0], [2.0 * SMALL.radius, 0.0, 0.0]])
    v0 = np.array([[0.2, across, 0.0], [0.0, 0.0, 0.0]])
    spin0 = np.array([[0.0, 0.0, spin], [0.0, 0.0, 0.0]])
    packing = in_space(x, np.array([[0, 1]]), mu)
    start = np.hstack([v0, spin0])
    ours = space.march_to_error(packing, None, start, duration=6e-5, error=1e-5)
    v, omega = lammps.packing_motion(
        x, v0, spin0, SMALL, law=ROUGH_LAW.format(mu=mu), duration=6e-5, dt=2e-9
    )
    compare(f"pair at mu = {mu:g}, across {across:g} m/s, spin {spin:g} rad/s: velocities [V]",
            ours.velocity[-1], v, allowed=2e-3, of=0.2, source=INCREMENTS)  # fmt: skip
    compare(f"pair at mu = {mu:g}, across {across:g} m/s, spins at the surface [V]",
            SMALL.radius * ours.angular_velocity[-1], SMALL.radius * omega,
            allowed=2e-3, of=0.2, source=INCREMENTS)  # fmt: skip


def test_a_crystal_with_friction_moves_as_in_lammps(compare):
    x, pairs = crystal_of("hexagonal", (7, 8))
    v0 = np.zeros_like(x)
    v0[3] = [0.1, 0.25, 0.0]
    ours = space.march_to_error(in_space(x, pairs, 0.3), None, v0, duration=1e-4, error=1e-4)
    v, omega = lammps.packing_motion(
        x, v0, np.zeros_like(x), SMALL, law=ROUGH_LAW.format(mu=0.3), duration=1e-4, dt=1e-8
    )
    compare("hexagonal crystal with friction: velocities [V]", ours.velocity[-1], v,
            allowed=5e-3, of=0.27, source=INCREMENTS)  # fmt: skip
    compare("hexagonal crystal with friction: spins at the surface [V]",
            SMALL.radius * ours.angular_velocity[-1], SMALL.radius * omega,
            allowed=5e-3, of=0.27, source=INCREMENTS)  # fmt: skip
