"""A sphere with friction on a wall whose modes couple its directions, beside a plain integrator
written from the formulas, and beside the same wall mirrored and turned."""

import numpy as np
import pytest

from beadwave.coupling.periodic_state import periodic_state
from beadwave.coupling.spatial_march import (
    Before,
    SpatialSearch,
    body_of,
    march_space,
)
from beadwave.coupling.spatial_wall import SpatialWall, spatial_wall_of_modes
from beadwave.dem.shakers import ShakerForces
from beadwave.workflows.evidence.verify.friction import R, sphere_with_friction

from bristles import Bristles, ShakenStart, plain_march

SPEED, ACROSS = 0.1, (0.06, 0.05)  # m/s struck, along n and along t1, t2
LOAD, FORCE, FREQUENCY, PHASE = 40.0, 60.0, 1000.0, 0.4  # N pressed, N and Hz shaken, rad
ARM, TURN = np.array([2e6, 3e6]), 300.0  # N/m, N m/rad
PLAIN = "Runge and Kutta's order 4 over sphere and modes, 800 bristles cut back one by one"

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("name", "seed", "arm"), [("free", 1, {}), ("on an arm", 2, {"arm_stiffness": ARM})]
)
def test_oblique_impacts_end_as_by_bristles(name, seed, arm, compare):
    wall, (chain, last) = random_wall(seed), sphere_with_friction(velocity=np.array(ACROSS), **arm)
    run = march_space(chain, wall, [SPEED], last, duration=1.5e-4, error=1e-5, n_save=20)
    end, _ = plain_march(
        chain, wall, [SPEED], last, duration=1.5e-4, dt=1e-7, bristles=Bristles(6e-6)
    )
    ours = [run.trajectory.v[-1, 0], *run.lateral.sphere_t_v[-1]]
    compare(f"oblique impact, sphere {name}, velocity along n, t1, t2 [m/s]",
            ours, [*end[1], *end[3]], allowed=1e-4, of=SPEED, source=PLAIN)  # fmt: skip
    spin = R * run.lateral.sphere_spin[-1]
    compare(f"oblique impact, sphere {name}, its turn at the surface [m/s]",
            spin, [-R * end[5][1], R * end[5][0]],
            allowed=1e-4, of=SPEED, source=PLAIN)  # fmt: skip


def test_the_cycle_that_a_shaker_keeps_up_is_that_of_bristles(compare):
    """A period of the plain integrator from the start of the cycle."""
    wall = random_wall(1)
    chain, last = sphere_with_friction(LOAD, arm_stiffness=ARM, arm_rotation=TURN)
    shakers = ShakerForces(np.array([FORCE]), np.array([FREQUENCY]), np.array([PHASE]))
    body = body_of(chain, wall, [0.0], last, shakers)
    state = periodic_state(body, Before(np.zeros(1, bool), 0), error=1e-4)
    end, history = plain_march(
        chain, wall, [0.0], last, duration=1.0 / FREQUENCY, dt=1e-6, bristles=Bristles(6e-6),
        shaken=ShakenStart(state.moving, FORCE, 2 * np.pi * FREQUENCY, PHASE),
    )  # fmt: skip
    T, slip = history[:, 1:3], history[:, 3:]
    heat = float(np.sum(0.5 * (T[1:] + T[:-1]) * np.diff(slip, axis=0)))
    compare("shaken cycle, amplitudes of friction along t1, t2 [N]",
            0.5 * np.ptp(state.cycle.friction_force, axis=0), 0.5 * np.ptp(T, axis=0),
            allowed=5e-4, source=PLAIN)  # fmt: skip
    compare("shaken cycle, heat of friction [J]", state.heat, heat, allowed=5e-4, source=PLAIN)
    compare("shaken cycle, velocities of the modes after a period [kg^1/2 m/s]",
            state.moving.motion.p, end[7], allowed=2e-4, source=PLAIN)  # fmt: skip
    compare("shaken cycle, friction and damping, beside the shaker's work [J]",
            state.heat + state.lost_in_wall, state.work,
            allowed=1e-4, source="energy")  # fmt: skip


MIRROR = np.diag([1.0, 1.0, -1.0])
TURNED = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


@pytest.mark.parametrize(
    ("Q", "source"),
    [
        (MIRROR, "the wall mirrored, t2 to -t2"),
        (TURNED, "the wall turned by 90 degrees about n"),
    ],
    ids=["mirrored", "turned"],
)
def test_a_wall_mirrored_or_turned_gives_the_forces_mirrored_or_turned(Q, source, compare):
    """Marched by the same steps."""
    S = 3e-9 * np.array([[1.0, 0.3, -0.2], [0.3, 1.2, 0.4], [-0.2, 0.4, 0.8]])
    wall = random_wall(3)._replace(residual_compliance=S)
    changed = wall._replace(phi=wall.phi @ Q.T, residual_compliance=Q @ S @ Q.T)
    runs = []
    for w, P in ((wall, np.eye(3)), (changed, Q)):
        chain, last = sphere_with_friction(velocity=P[1:, 1:] @ ACROSS)
        search = SpatialSearch(dt=2e-7)
        runs.append(march_space(chain, w, [SPEED], last, duration=1.5e-4, n_save=50, search=search))
    a, b = runs
    compare("impact on a wall with residual compliance, forces along n, t1, t2 [N]",
            a.contact_force @ Q.T, b.contact_force, allowed=1e-9, source=source)  # fmt: skip


def random_wall(seed: int) -> SpatialWall:
    """Four modes of 200 Hz to 6 kHz whose shapes point anywhere, and a shaker on them."""
    rng = np.random.default_rng(seed)
    omega = 2 * np.pi * np.exp(rng.uniform(np.log(200), np.log(6000), 4))
    phi = rng.normal(size=(4, 3)) / np.sqrt(rng.uniform(1, 10, 4))[:, None]
    return spatial_wall_of_modes(omega, np.full(4, 0.05), phi, load=rng.normal(size=(4, 1)))
