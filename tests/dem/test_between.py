"""Samples between the ends of steps."""

from itertools import product

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from beadwave.dem import (
    SCHEMES,
    Chain,
    StepSearch,
    Wall,
    dashpot_wall,
    march,
    march_to_error,
    rigid_wall,
)
from beadwave.dem.between import run_between
from beadwave.dem.prepared import prepare
from beadwave.dem.schemes import named_scheme
from beadwave.dem.trajectory import run, start

N, V0, DURATION, N_SAVE = 9, np.eye(9)[0], 20.0, 3000
ROW = Chain(np.ones(N), np.ones(N), np.linspace(1.2, 1.8, N))
MODES = Wall(np.array([0.3, 1.1, 3.0]), np.array([0.0, 0.05, 0.01]), np.array([0.4, 0.7, 0.3]))
LEAVES = {"leaf_stiffness": np.linspace(0.0, 0.4, N), "leaf_anchor": np.full(N, 0.05)}
SCENES = {
    "free": (ROW._replace(A=ROW.A[:-1]), None),
    "rigid": (ROW, rigid_wall()),
    "modes": (ROW, MODES),
    "residual": (ROW, MODES._replace(residual_compliance=0.1)),
    "dashpot": (ROW, dashpot_wall(0.5)),
    "pressed": (ROW._replace(preload=0.3, **LEAVES), MODES),
    "hunt-crossley": (ROW._replace(dissipation="hunt-crossley", gamma=np.full(N, 0.05)), MODES),
}


GIVING = ("residual", "dashpot")  # where force at the wall begins with other powers besides 3/2


def both(scene, dt):
    """By steps of dt, sampled between them, and at their ends; by steps a tenth as long."""
    chain, wall = SCENES[scene]
    prepared, scheme = prepare(chain, wall), named_scheme(None, chain, wall)
    state = start(prepared, V0)
    between = run_between(prepared, state, DURATION, dt, scheme, N_SAVE)
    ends = run(prepared, state, DURATION, dt, scheme, between.n_steps)
    exact = run(prepared, state, DURATION, dt / 10, scheme, N_SAVE)
    return between, ends, exact


def largest(first, second):
    return np.abs(first - second).max()


@pytest.mark.usefixtures("kernels")
@pytest.mark.parametrize("scene", SCENES)
def test_samples_are_as_near_the_exact_run_as_the_ends_of_the_steps(scene):
    """300 steps: every tenth sample is an end. Between them contacts open and close."""
    dt = DURATION / 300
    between, ends, exact = both(scene, dt)
    assert between.n_steps == 300
    for name in ("x", "v", "contact_force", "wall_x", "wall_v"):
        samples, truth = getattr(between, name), getattr(exact, name)
        assert samples[::10] == pytest.approx(getattr(ends, name), abs=1e-13)
        at_ends = largest(getattr(ends, name), truth[::10])
        more = 2.5e-7 if scene in GIVING else 1e-14
        assert largest(samples, truth) <= 1.5 * at_ends + more, name
    for name in ("energy_wall", "dissipated_wall", "dissipated_contact", "energy_total"):
        off = largest(getattr(between, name), getattr(exact, name))
        assert off / between.energy_scale < 5e-6, name
    # 7e-7 between the ends of the steps, of which single precision is 1.2e-7
    assert between.wall_q == pytest.approx(exact.wall_q, abs=1e-6)


@pytest.mark.usefixtures("kernels")
@pytest.mark.parametrize("scene", ["modes", "hunt-crossley"])
def test_a_sampled_run_ends_in_the_state_of_its_last_step(scene):
    between, ends, _ = both(scene, DURATION / 300)
    for first, second in zip(between.final[:5], ends.final[:5], strict=True):
        assert (first == second).all()


@pytest.mark.usefixtures("kernels")
def test_more_samples_take_no_more_steps():
    chain, wall = SCENES["modes"]
    many, few = (
        march_to_error(chain, wall, V0, duration=DURATION, error=1e-4, n_save=n)
        for n in (N_SAVE, 30)
    )
    assert many.trajectory.n_steps < 0.1 * N_SAVE
    assert many.step_report.evaluations <= 1.3 * few.step_report.evaluations


@pytest.mark.parametrize("scenes", [["rigid"], pytest.param([*SCENES], marks=pytest.mark.slow)])
def test_the_search_for_a_step_costs_less_than_the_march(scenes):
    """As a rule one march of longer steps beside the one given, whose error is as stated."""
    shares = []
    for scene, error in product(scenes, (1e-3, 1e-4, 1e-5)):
        chain, wall = SCENES[scene]
        saved = {"duration": DURATION, "n_save": 300}
        run, report = march_to_error(chain, wall, V0, error=error, **saved)
        exact = march(chain, wall, V0, dt=run.dt / 8, **saved)
        assert largest(run.v, exact.v) < run.error_estimate <= error
        assert run.energy_error <= 1e-2 * error
        shares.append(report.evaluations / run.n_steps / SCHEMES[run.scheme].evaluations - 1.0)
    assert np.mean(shares) < 0.5
    assert max(shares) < 1.5


@pytest.mark.usefixtures("kernels")
def test_forces_that_jump_and_modes_too_fast_for_a_polynomial_are_sampled_at_ends_of_steps():
    fast = MODES._replace(omega=np.array([0.3, 1.1, 300.0]))
    jumps = ROW._replace(dissipation="linear-clipped", gamma=np.full(N, 0.05))
    for chain, wall in ((ROW, fast), (jumps, rigid_wall())):
        prepared, scheme = prepare(chain, wall), named_scheme(None, chain, wall)
        run = run_between(prepared, start(prepared, V0), 1.0, 0.05, scheme, 100)
        exact = march(chain, wall, V0, duration=1.0, dt=0.01, scheme=scheme.name, n_save=100)
        assert run.n_steps == 100 and (run.v == exact.v).all()


@pytest.mark.usefixtures("kernels")
def test_samples_agree_with_an_integrator_of_another_kind():
    """Two spheres and a wall of one mode: velocities, and the largest force at the wall."""
    A, omega, phi = np.array([1.3, 1.7]), 0.8, 0.5
    chain = Chain(np.ones(2), np.ones(2), A)
    wall = Wall(np.array([omega]), np.zeros(1), np.array([phi]))

    def rates(t, y):
        x1, x2, q, v1, v2, p = y
        f = A * np.maximum([x1 - x2, x2 - phi * q], 0.0) ** 1.5
        return [v1, v2, p, -f[0], f[0] - f[1], phi * f[1] - omega**2 * q]

    found = march_to_error(chain, wall, [1.0, 0.0], duration=8.0, error=1e-6, n_save=N_SAVE)
    run = found.trajectory
    assert run.n_steps < N_SAVE / 4
    exact = solve_ivp(
        rates, (0.0, 8.0), [0, 0, 0, 1.0, 0, 0], "DOP853", run.t, rtol=1e-12, atol=1e-13,
        max_step=0.01,
    ).y  # fmt: skip
    assert largest(run.v.T, exact[3:5]) < run.error_estimate <= 1e-6
    force = A[1] * np.maximum(exact[1] - phi * exact[2], 0.0) ** 1.5
    assert abs(run.contact_force[:, 1].max() - force.max()) < 2e-6 * force.max()
    assert largest(run.wall_v, phi * exact[5]) < 1e-6


@pytest.mark.usefixtures("kernels")
@pytest.mark.parametrize(("scene", "error"), [("dashpot", 1e-3), ("residual", 1e-5)])
def test_no_less_than_a_thirtieth_of_the_error_asked_is_stated(scene, error):
    """By the short steps that the ledger asks for, two marches differ by less than that."""
    chain, wall = SCENES[scene]
    options = {"duration": DURATION, "error": error, "n_save": 100}
    bare = march_to_error(chain, wall, V0, search=StepSearch(least=0.0), **options)
    assert bare.step_report.error_estimate < 0.5 * error / 30
    run, report = march_to_error(chain, wall, V0, **options)
    assert run.error_estimate == report.error_estimate == error / 30


@pytest.mark.usefixtures("kernels")
def test_a_wall_of_too_many_modes_to_save_is_run_by_steps_that_end_at_the_samples():
    """Its modes are not kept, so that nothing lies between the ends of steps."""
    many = Wall(np.linspace(0.3, 3.0, 600), np.zeros(600), np.full(600, 0.02))
    run = march_to_error(ROW, many, V0, duration=DURATION, error=1e-4, n_save=100).trajectory
    assert run.n_steps % 100 == 0 and run.error_estimate < 1e-4
