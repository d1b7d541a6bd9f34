"""The benchmark of errors of runs with friction measures what it says."""

import numpy as np
import pytest

import friction_errors


def across(run, share=1.0):
    """The last sphere across, to a share of the run's error."""
    along, _ = friction_errors.dem.march_to_error(
        run.chain, run.wall, run.v0, duration=run.duration, n_save=run.n_save, error=run.error
    )
    return friction_errors.march_lateral(
        run.chain, run.wall, run.v0, along, run.last, motion=run.motion, error=share * run.error
    )


@pytest.mark.slow
@pytest.mark.parametrize("scene", [55, 58, 70, 73])
def test_a_periodic_state_brings_back_velocities_too(scene):
    """Of spheres that nothing keeps from turning on a contact that sticks: forces of two periods
    whose starts hardly differed were alike while a turn at the surface came back 1.2 errors off
    (scene 70), and stated errors were 0.21 to 0.71 of the true ones."""
    run = friction_errors.pressed(np.random.default_rng([0, scene]))
    ended = across(run)
    limit = 0.1 * run.error * friction_errors.top_speed(run)
    turn = float(run.chain.radius[-1]) * (ended.sphere_spin[-1] - ended.sphere_spin[0])
    assert np.abs(turn).max() < limit
    assert np.abs(ended.sphere_t_v[-1] - ended.sphere_t_v[0]).max() < limit


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "scene"),
    [("oblique", 3), ("oblique", 6), ("oblique", 27), ("pressed", 4), ("pressed", 82),
     ("struck", 8)],
)  # fmt: skip
def test_random_runs_state_their_error_close_the_ledger_and_heat_never_falls(kind, scene):
    trial = friction_errors.trial(getattr(friction_errors, kind)(np.random.default_rng([0, scene])))
    assert trial.ratio >= 1.0
    assert 0.0 < trial.ledger <= 1.0
    assert trial.fall <= 0.0


@pytest.mark.slow
def test_forces_of_a_slow_wall_excite_no_swing_beyond_the_error():
    """Its 285th harmonic is next to what arm and contact resonate at: forces that were balanced to
    3e-8 left a swing of 2.8 times the error, 0.29 of which was stated."""
    assert (
        friction_errors.trial(friction_errors.pressed(np.random.default_rng([11, 109]))).ratio
        >= 1.0
    )


@pytest.mark.slow
def test_a_state_sought_to_a_smaller_error_is_the_same_one():
    """Of a contact that sticks in its middle many states come back. Sought from rest, to an error
    that harmonic balance does not reach, one had a mean force of 1 % of its amplitude, and the run
    from it was four times its error off."""
    run = friction_errors.struck(np.random.default_rng([11, 68]))
    assert friction_errors.trial(run).ratio >= 1.0


@pytest.mark.slow
def test_marches_that_are_alike_by_chance_state_a_thirtieth_of_the_error_at_least():
    run = friction_errors.struck(np.random.default_rng([11, 296]))
    assert friction_errors.trial(run).ratio >= 1.0


def test_the_ledger_of_a_clamped_sphere_closes_to_the_error():
    """No velocity of it has an error that would shorten the step: a search by those never ended."""
    run = friction_errors.pressed(np.random.default_rng([12, 106]))
    assert np.isinf(run.last.arm_stiffness).all() and np.isinf(run.last.arm_rotation)
    error = across(run, 1.0 / 30.0).energy_error
    assert 0.1 * run.error / 30.0 < error <= run.error / 30.0


@pytest.mark.slow
def test_errors_of_cells_in_two_directions_hold():
    """They are of order 1 in the cells' width: with order 2 0.9 of the true error was stated."""
    run = friction_errors.oblique(np.random.default_rng([1, 24]))
    assert run.last.arm_stiffness[0] != run.last.arm_stiffness[1]
    assert friction_errors.trial(run).ratio >= 1.0


@pytest.mark.slow
def test_an_error_stated_five_times_too_small_is_noticed(monkeypatch):
    run, march_lateral = (
        friction_errors.pressed(np.random.default_rng([0, 4])),
        friction_errors.march_lateral,
    )
    march_to_error, honest = friction_errors.dem.march_to_error, friction_errors.trial(run)

    def fifth(march):
        return march._replace(error_estimate=0.2 * march.error_estimate)

    def boasting_along(*scene, **options):
        along, report = march_to_error(*scene, **options)
        return fifth(along), report

    def boasting_across(*scene, **options):
        return fifth(march_lateral(*scene, **options))

    monkeypatch.setattr(friction_errors.dem, "march_to_error", boasting_along)
    monkeypatch.setattr(friction_errors, "march_lateral", boasting_across)
    assert friction_errors.trial(run).ratio < 0.3 * honest.ratio
