"""Several chains on a structure that shakers move: beside one chain's own march, and DOP853."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from beadwave import dem
from beadwave.coupling.period_map import USUAL_PERIODIC_SEARCH
from beadwave.coupling.shaken_march import march_shaken
from beadwave.coupling.shaken_packing import (
    march_shaken_rows,
    period_of,
    shaken_state,
    with_cycles,
)
from beadwave.coupling.spatial_march import body_of
from beadwave.coupling.spatial_wall import spatial_wall_of_modes
from beadwave.dem import space
from beadwave.dem.friction import tangential_law
from beadwave.dem.lateral import LastSphere
from beadwave.dem.shakers import ShakerForces
from beadwave.dem.space import kernel
from beadwave.dem.space.march import prepared, state_of

R, RHO, E, NU = 6e-3, 7800.0, 210e9, 0.3
OMEGA = 2 * np.pi * np.array([900.0, 2600.0, 7100.0, 19e3])
ZETA = np.array([0.02, 0.02, 0.03, 0.3])
PHI = np.array([[1.3, -0.7, 2.0, 5.0], [0.9, 1.5, -1.1, 3.0], [0.4, -0.6, 0.8, -2.0]])
LOAD = np.array([[0.8], [0.5], [-0.6], [0.2]])
AXES = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


def chain(n, **fields):
    sprung = {"leaf_stiffness": np.full(n, 1e5)} if n > 1 else {}
    return dem.row_of_spheres(
        R, RHO, E, NU, count=n, flat=dem.Flat(E, NU), preload=20.0, **(sprung | fields)
    )


def last_of(spheres):
    law = tangential_law(0.3, R, E, NU, np.inf, E, NU)
    inertia = 0.4 * float(spheres.mass[-1]) * R**2
    return LastSphere(law, inertia, np.zeros(2), np.array([2e6, 3e6]), 300.0)


def shaker(force, frequency=1000.0):
    return ShakerForces(np.array([force]), np.array([frequency]), np.array([0.4]))


def one_row(force, frequency, n, speed, residual=0.0, **fields):
    """A row that rubs on a structure of four modes, and the chain and its wall alone."""
    spheres, v = chain(n, **fields), speed * np.eye(n)[0]
    last = last_of(spheres)
    shakers = shaker(force, frequency)
    wall = spatial_wall_of_modes(OMEGA, ZETA, PHI.T, load=LOAD)
    wall = wall._replace(residual_compliance=residual * np.eye(3))
    behind = space.Structure(
        OMEGA, ZETA, PHI, np.zeros(3, np.int64), AXES, np.full((1, 2), residual),
        load=LOAD, shakers=shakers,
    )  # fmt: skip
    row = space.Row(spheres, v, np.zeros(3), AXES[0], last=last)
    return space.rows_of([row], behind), behind, (spheres, wall, v, last, shakers)


def frictionless(force):
    """Two rows at right angles that lean on a structure of four modes, struck by none."""
    shakers = shaker(force)
    behind = space.Structure(
        OMEGA, ZETA, PHI[:2], np.arange(2), AXES[:2], np.array([[-1e-9, 0.0], [0.0, 0.0]]),
        load=LOAD, shakers=shakers,
    )  # fmt: skip
    rows = [
        space.Row(chain(n), np.zeros(n), 0.1 * AXES[i], AXES[i], name=f"row {i}")
        for i, n in enumerate((3, 2))
    ]
    return space.rows_of(rows, behind), behind


@pytest.mark.slow
@pytest.mark.parametrize(
    ("force", "frequency", "n", "speed", "residual"),
    [
        (100.0, 1000.0, 1, 0.0, 0.0),
        (300.0, 1000.0, 1, 0.1, 0.0),
        (100.0, 1000.0, 1, 0.0, 3e-9),
        (100.0, 500.0, 3, 0.0, 0.0),
    ],
)
def test_one_row_goes_as_one_chain(force, frequency, n, speed, residual):
    """Whole and partial slip in two directions: waves after the striker, loops before it. The line
    of two spheres turns here, for one chain it does not: 9e-5 with three spheres."""
    rows, behind, (spheres, wall, v, last, shakers) = one_row(force, frequency, n, speed, residual)
    run = {"duration": 2e-4, "n_save": 100, "error": 1e-4}
    one = march_shaken(body_of(spheres, wall, v, last, shakers), v, **run)
    before = shaken_state(space.before_striker(rows, [False]), behind, error=1e-4, speed=speed)
    mine = march_shaken_rows(rows, behind, before, **run)
    (row,) = space.row_runs(rows, behind, mine)
    scale = max(speed, before.fastest)
    limit = (one.run.lateral.error_estimate + mine.error_estimate) * scale
    for mine_v, other in (
        (row.v, one.run.trajectory.v), (row.across.sphere_t_v, one.run.lateral.sphere_t_v)
    ):  # fmt: skip
        np.testing.assert_allclose(mine_v, other, rtol=0, atol=limit)
    (cycled,) = with_cycles([row], rows, before)
    cycle, across = cycled.across.cycle, cycled.across
    np.testing.assert_allclose(across.slip[0], cycle.slip[-1], atol=1e-5 * np.abs(cycle.slip).max())
    middle = 0.5 * (cycle.friction_force[1:] + cycle.friction_force[:-1])
    done = float(np.sum(middle * np.diff(cycle.slip, axis=0)))
    assert done == pytest.approx(cycle.energy, rel=2e-3)
    loop, force = before.saved.heat[-1, 0] - before.saved.heat[0, 0], before.saved.friction[:, 0]
    assert loop == pytest.approx(one.before.heat, rel=2e-4)
    np.testing.assert_allclose(
        np.ptp(force, axis=0), np.ptp(one.before.cycle.friction_force, axis=0), rtol=1e-4
    )
    assert before.unbalanced < 1e-4 * one.before.work
    assert mine.energy_error < 1e-4


@pytest.mark.parametrize("force", [0.5, 3.0])
def test_dop853_goes_round_in_the_cycle_of_two_rows(force):
    """From the state at t = 0 on for a period, by its own equations of chains, structure and
    shaker: it comes back to it within the stated error, and no damper and shaker differ."""
    rows, behind = frictionless(force)
    state = shaken_state(rows.packing, behind, error=1e-6)
    assert state.error_estimate <= 1e-6 and state.n_periods == 1

    packing = rows.packing
    n, m = len(packing.mass), OMEGA.size
    leaf = np.full(n, 1e5)
    rest = np.maximum(packing.overlap, 0.0)
    pressed = kernel_forces(packing, behind, rest)
    balance = net(rows, pressed)

    def rates(t, y):
        x, v, q, p = np.split(y, [n, 2 * n, 2 * n + m])
        gap = packing.overlap[rows.contact] + approach(rows, behind, x, q)
        force = kernel_forces(packing, behind, gap[np.argsort(rows.contact)])
        last = [2, 4]
        on = (force[rows.contact] - pressed[rows.contact])[last] @ behind.phi
        shaken = LOAD[:, 0] * behind.shakers.force[0] * np.cos(2e3 * np.pi * t + 0.4)
        a = (net(rows, force) - balance - leaf * x) / packing.mass
        return np.concatenate([v, a, p, on + shaken - 2 * ZETA * OMEGA * p - OMEGA**2 * q])

    motion = state.state.motion
    x, v = (np.einsum("sx,sx->s", values, rows.direction) for values in (motion.u, motion.v))
    y0 = np.concatenate([x, v, state.state.q, state.state.p])
    found = solve_ivp(rates, (0.0, 1e-3), y0, "DOP853", rtol=1e-11, atol=1e-18, max_step=1e-6)
    v_end = found.y[n : 2 * n, -1]
    assert np.abs(v_end - v).max() < 4e-6 * state.fastest
    work = state.saved.energy[-1, kernel.OF_SHAKERS] - state.saved.energy[0, kernel.OF_SHAKERS]
    assert state.unbalanced < 1e-6 * work


def kernel_forces(packing, behind, gap):
    """[N] of Hertz contacts with a compliance in series, gap (c,) [m] of the bodies."""
    d = np.maximum(gap, 0.0)
    c = packing.n_pairs  # the first row's at the structure
    s, A = behind.residual[0, 0], packing.A[c]
    for _ in range(60):
        d[c] -= (d[c] + s * A * d[c] ** 1.5 - max(gap[c], 0.0)) / (1 + 1.5 * s * A * d[c] ** 0.5)
    return packing.A * d**1.5


def approach(rows, behind, x, q):
    """[m] of the bodies at the contact behind each sphere, from rest."""
    ahead = np.append(x[1:], 0.0)
    ahead[[2, 4]] = behind.phi @ q
    return x - ahead


def net(rows, force):
    """[N] of the contacts on each sphere."""
    behind = force[rows.contact]
    before = np.append(0.0, behind[:-1])
    before[[0, 3]] = 0.0
    return before - behind


def test_a_state_is_placed_where_its_numbers_say_and_contacts_are_sheared_on_the_way():
    """By 2 a G* of a contact that sticks all over, 256 cells off it by 5e-3; or not at all."""
    rows, behind, (spheres, *_) = one_row(5.0, 1000.0, 2, 0.0)
    period, moving = period_of(rows.packing, behind, 256, USUAL_PERIODIC_SEARCH)
    c, z = rows.contact[-1], period.z_of(moving)
    radius = np.sqrt(R) * (20.0 / spheres.A[-1]) ** (1 / 3)
    stiffness = 2 * radius * float(rows.packing.springs.law[0][0])
    step = z.copy()
    step[: len(z) // 2] += 1e-13 * np.arange(1, len(z) // 2 + 1)
    for sheared in (True, False):
        to = moving.copied()
        for away in (step, 2.0 * step):
            period.place(to, away, sheared=sheared)
            shifted = period.way[0] @ away[: len(z) // 2]
            np.testing.assert_allclose(period.z_of(to), away, rtol=1e-12, atol=1e-22)
            traction = rows.packing.springs.frame[0] @ to.motion.traction[c]
            np.testing.assert_allclose(traction, sheared * stiffness * shifted, rtol=1e-2)
            np.testing.assert_allclose(to.parts.springs.slip[0], shifted, rtol=1e-9)


BESIDES = 1e-9 * np.array([[[0.0, 1.0, -0.7], [1.0, 0.0, 0.5], [-0.7, 0.5, 0.0]]])


@pytest.mark.parametrize(
    ("residual", "besides", "left"), [(0.0, None, 2e-4), (3e-9, BESIDES, 1e-3)]
)
def test_the_linear_map_is_that_of_small_motions(residual, besides, left):
    """Of 1e-10 m, by marches: 256 cells leave 5e-3 and 8192 a hundredth of that. Lines of spheres
    that press on each other turn, and a residual compliance couples the directions. Smaller ways
    are found to the rounding of the overlap."""
    rows, behind, _ = one_row(0.0, 5000.0, 2, 0.0, residual, gravity=2000.0)
    behind = behind._replace(residual_besides=besides)
    packing = rows.packing._replace(springs=rows.packing.springs._replace(n_cells=8192))
    period, at_rest = period_of(packing, behind, 10_000, USUAL_PERIODIC_SEARCH)
    M, weights = period.linear(None)
    n = len(M) // 2
    rng = np.random.default_rng(0)
    for _ in range(2):
        z = rng.standard_normal(2 * n) / weights
        z *= 1e-10 / np.abs(z[:n]).max()
        moving = at_rest.copied()
        period.place(moving, z)
        period.march(moving)
        off = weights * (period.z_of(moving) - M @ z)
        assert np.linalg.norm(off) < left * np.linalg.norm(weights * z)


def test_strikers_come_with_their_velocities_to_where_the_next_sphere_is():
    rows, _, _ = one_row(0.0, 1000.0, 3, 0.2)
    at_rest = prepared(rows.packing, None, np.zeros((3, 3)), np.ones(1))
    state = state_of(*at_rest)
    state.motion.u[1] = [1e-6, 2e-6, -3e-6]
    state.motion.v[2] = [0.0, 0.0, -0.01]
    motion = space.struck(rows, state).motion
    np.testing.assert_allclose(motion.u[0], [0.0, 0.0, -3e-6])
    np.testing.assert_allclose(motion.v, [[0, 0, -0.2], [0, 0, 0], [0, 0, -0.01]])


def test_a_row_that_nothing_presses_is_refused():
    rows, _ = frictionless(1.0)
    apart = rows.packing.overlap.copy()
    apart[rows.contact[2]] = -1e-6
    away = rows._replace(packing=rows.packing._replace(overlap=apart))
    with pytest.raises(dem.InvalidChain, match="nothing presses the last sphere of row 0"):
        space.before_striker(away, [False, False])


def test_a_period_of_too_many_steps_is_refused_before_the_first_march():
    rows, behind = frictionless(1.0)
    slow = behind._replace(shakers=shaker(1.0, 0.1))
    packing = space.before_striker(rows, [False, False])
    with pytest.raises(dem.UnstableStep, match=r"is [0-9.]*e\+0[67] steps .* at most 5.0e\+04"):
        shaken_state(packing, slow, error=1e-4)


def test_a_sphere_that_nothing_holds_is_refused():
    rows, _ = frictionless(1.0)
    alone = rows._replace(packing=rows.packing._replace(held=rows.packing.held._replace(
        sphere=np.zeros(0, np.int64), line=np.zeros((0, 3)))))  # fmt: skip
    with pytest.raises(dem.InvalidChain, match="sphere 1 of row 0 is held by nothing"):
        space.before_striker(alone, [False, False])
    held = space.before_striker(alone, [True, True]).guides.motion
    assert [bool(free.any()) for free in held] == [False, False, True, False, True]
