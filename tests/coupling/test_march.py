"""Chain and wall marched together: full order against reduced, energy, the scheme of the thesis."""

from functools import partial

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.integrate import solve_ivp

from beadwave import dem
from beadwave.coupling import (
    CoupledWall,
    CouplingError,
    ModalDamping,
    energy_gain,
    impact,
    march_coupled,
    verdict,
)
from beadwave.coupling.reduced_wall import coupled_wall, wall_from_reduced, wall_of
from beadwave.rom import Contact, Selection, craig_bampton, free_modes, full_order

from known_models import steel_bar

E, NU, RHO = 210e9, 0.3, 7850.0
N = 120


bar = partial(steel_bar, 4e-4)  # m^2: half as heavy as a chain of spheres


def chain_of(count, **parts):
    return dem.row_of_spheres(0.0127, 7800.0, E, NU, count=count, flat=dem.Flat(E, NU), **parts)


def speeds(count, speed=0.31):
    return np.r_[speed, np.zeros(count - 1)]


def velocity_difference(run, reference):
    return np.abs(run.trajectory.v - reference.trajectory.v).max() / 0.31


def reduced_bar(kind, n_modes):
    K, M, w = bar()
    if kind == "free-modes":
        return free_modes(K, M, w, Selection(n_modes=n_modes))
    return craig_bampton(K, M, w, [N - 1], Selection(n_modes=n_modes))


@pytest.mark.parametrize("kind", ["free-modes", "craig-bampton"])
def test_reduced_and_full_order_walls_send_back_the_same_waves(kind):
    chain, v0 = chain_of(5), speeds(5)
    full = wall_from_reduced(full_order(*bar()), half_space=0)
    reference = impact(chain, full, v0, duration=1.5e-3, error=1e-6)
    difference = [
        velocity_difference(
            impact(
                chain,
                wall_from_reduced(reduced_bar(kind, n_modes), half_space=0),
                v0,
                duration=1.5e-3,
                error=1e-6,
            ),
            reference,
        )
        for n_modes in (6, 12, 24)
    ]
    assert difference[0] > difference[1] > difference[2]
    assert difference[2] < 1e-4


def test_a_wall_without_participation_conserves_energy_but_sends_back_other_waves():
    chain, v0 = chain_of(5), speeds(5)
    wall = wall_from_reduced(full_order(*bar()), half_space=0)
    right = impact(chain, wall, v0, duration=1.5e-3, error=1e-5)
    wrong = impact(chain, wall._replace(phi=0 * wall.phi), v0, duration=1.5e-3, error=1e-5)
    # the search asks for a hundredth of the error, 1e-7; the step that it takes leaves 7e-10
    assert wrong.trajectory.energy_error < 1e-8
    assert velocity_difference(wrong, right) > 0.05
    assert wrong.verdict.findings


def test_the_wall_takes_the_momentum_that_the_chain_loses():
    K, M, w = bar(held=False)
    chain, v0 = chain_of(4), speeds(4)
    wall = wall_from_reduced(free_modes(K, M, w, Selection(n_modes=20)), half_space=0)
    run = impact(chain, wall, v0, duration=1e-3, error=1e-6).trajectory
    rigid = abs(wall.phi[0])
    bar_momentum = run.final.p[0] * np.sign(wall.phi[0]) / rigid  # phi = 1 / sqrt(mass)
    assert bar_momentum > 0.1 * chain.mass[0] * 0.31
    assert run.v[-1] @ chain.mass + bar_momentum == pytest.approx(chain.mass[0] * 0.31, rel=1e-8)


def test_energy_stays_over_fifty_milliseconds_of_undamped_impacts():
    # leaf springs bring the spheres back again and again
    chain = chain_of(3, leaf_stiffness=2e4, preload=5.0)
    wall = wall_from_reduced(reduced_bar("free-modes", 12), half_space=0, cutoff_hz=30e3)
    run = impact(
        chain, wall, speeds(3), duration=50e-3, horizon=3e-3, error=1e-4, n_save=5000
    ).trajectory
    pushed = run.contact_force[:, -1] > 20
    assert np.count_nonzero(np.diff(pushed.astype(int)) == 1) > 20
    gain = run.energy_total - run.energy_total[0]
    assert np.abs(gain).max() < 1e-6 * run.energy_kinetic[0]


def as_coupled(wall):
    D = np.diag(2 * wall.zeta * wall.omega)
    return CoupledWall(wall.omega, D, wall.phi, wall.phi, wall.residual_compliance)


def test_two_independent_integrators_agree():
    chain = chain_of(4, dissipation="hunt-crossley", gamma=0.2, leaf_stiffness=1e4, preload=3.0)
    wall = wall_from_reduced(reduced_bar("free-modes", 8), half_space=5e-11)
    split = impact(chain, wall, speeds(4), duration=8e-4, error=1e-7)
    coupled_run = impact(chain, as_coupled(wall), speeds(4), duration=8e-4, error=1e-10)
    assert velocity_difference(coupled_run, split) < 1e-6
    for name in ("energy_wall", "energy_residual", "dissipated_contact", "wall_x"):
        ours, theirs = getattr(coupled_run.trajectory, name), getattr(split.trajectory, name)
        np.testing.assert_allclose(ours, theirs, atol=1e-6 * np.abs(theirs).max())


def test_the_march_is_chosen_by_the_weights_that_read_never_by_a_note():
    noted = reduced_bar("free-modes", 8)._replace(notes={"reading_weights": "0.5"})
    assert isinstance(wall_of(noted), dem.Wall)
    assert isinstance(wall_of(noted._replace(contact=Contact(weights_read=noted.w))), CoupledWall)


@pytest.mark.slow
def test_force_at_one_node_and_reading_beside_it_makes_energy():
    K, M, w = bar()
    reading = np.zeros(N)
    reading[[N - 14, N - 10]] = 0.5
    reduced = full_order(K, M, w)
    chain = chain_of(3, leaf_stiffness=2e4, preload=5.0)
    read_beside = reduced._replace(contact=Contact(weights_read=reading))  # T = I
    thesis = coupled_wall(read_beside, half_space=0, cutoff_hz=60e3)
    ours = coupled_wall(reduced, half_space=0, cutoff_hz=60e3)
    gained = impact(chain, thesis, speeds(3), duration=6e-3, error=1e-9)
    passive_run = impact(chain, ours, speeds(3), duration=6e-3, error=1e-9)
    assert not gained.verdict.passive and passive_run.verdict.passive
    assert "not passive" in gained.verdict.findings[0]
    assert gained.energy_gain.largest > 0.01
    assert abs(passive_run.energy_gain.largest) < 1e-6


@pytest.mark.slow
def test_a_dashpot_inside_the_wall_is_marched_and_its_loss_is_in_the_ledger():
    K, M, w = bar()
    dashpot = sp.csc_array(([2e3], ([60], [60])), shape=K.shape)
    chain, v0 = chain_of(4), speeds(4)
    reduced = free_modes(K, M, w, Selection(n_modes=24), C=dashpot)
    full = coupled_wall(full_order(K, M, w, C=dashpot), half_space=0)
    small = impact(chain, coupled_wall(reduced, half_space=0), v0, duration=1e-3, error=1e-8)
    large = impact(chain, full, v0, duration=1e-3, error=1e-8)
    assert small.trajectory.dissipated_wall[-1] > 0.02 * small.trajectory.energy_kinetic[0]
    assert small.trajectory.energy_error < 1e-6
    assert velocity_difference(small, large) < 2e-3


def test_proportional_damping_marches_alike_as_ratios_and_as_a_matrix():
    K, M, w = bar()
    reduced = free_modes(K, M, w, Selection(n_modes=8), C=30 * M + 2e-8 * K)
    chain, v0 = chain_of(3), speeds(3)
    ratios = impact(chain, wall_from_reduced(reduced, half_space=0), v0, duration=8e-4, error=1e-7)
    matrix = impact(chain, coupled_wall(reduced, half_space=0), v0, duration=8e-4, error=1e-10)
    assert ratios.trajectory.dissipated_wall[-1] > 0
    assert velocity_difference(matrix, ratios) < 1e-6
    assert energy_gain(ratios.trajectory).largest < 1e-7


def test_a_run_that_cannot_work_is_refused_before_it_starts():
    chain, v0 = chain_of(3), speeds(3)
    wall = wall_from_reduced(reduced_bar("free-modes", 8), half_space=0)
    with pytest.raises(CouplingError, match="becomes unstable"):
        impact(chain, wall._replace(residual_compliance=-1e-7), v0, duration=1e-3, error=1e-4)
    with pytest.raises(CouplingError, match="either error or dt"):
        impact(chain, wall, v0, duration=1e-3)
    with pytest.raises(CouplingError, match="instead of dt"):
        impact(chain, as_coupled(wall), v0, duration=1e-3, dt=1e-7)


def test_a_contact_that_gives_way_stops_the_coupled_march():
    chain = chain_of(1)
    wall = as_coupled(dem.rigid_wall())._replace(residual_compliance=-2e-8)
    with pytest.raises(CouplingError, match="became unstable"):
        march_coupled(chain, wall, np.array([3.0]), duration=1e-3)


def test_damping_that_couples_the_modes_moves_the_wall_as_in_physical_coordinates():
    # one sphere on two masses, a dashpot between them
    K, M = np.array([[3e7, -1e7], [-1e7, 1e7]]), np.diag([0.3, 0.1])
    C = 400.0 * np.array([[1, -1], [-1, 1]])
    chain, v0 = chain_of(1), np.array([0.5])
    wall = coupled_wall(full_order(K, M, [0, 1.0], C=C), half_space=0)
    run = march_coupled(chain, wall, v0, duration=1e-3, error=1e-11)

    def rate(t, y):
        x, u, v = y[0], y[1:3], y[4:]
        F = chain.A[0] * max(x - u[1], 0) ** 1.5
        force = np.array([0, F]) - K @ u - C @ v
        return np.concatenate([y[3:], [-F / chain.mass[0]], force / np.diag(M)])

    start = np.array([0, 0, 0, 0.5, 0, 0])
    physical = solve_ivp(rate, (0, 1e-3), start, "DOP853", run.t, rtol=1e-11, atol=1e-14)
    np.testing.assert_allclose(run.wall_x, physical.y[2], atol=1e-7 * np.abs(run.wall_x).max())
    np.testing.assert_allclose(run.v[:, 0], physical.y[3], atol=1e-7)


def test_a_coupled_wall_is_damped_as_its_oscillators_are():
    """2 zeta omega on the diagonal, whichever way the wall was made; undamped it is another one."""
    model, damped = reduced_bar("free-modes", 8), {"damping": ModalDamping(0.2)}
    wall, chain = wall_from_reduced(model, half_space=5e-11, **damped), chain_of(3)
    split = impact(chain, wall, speeds(3), duration=6e-4, error=1e-7)
    for coupled in (as_coupled(wall), coupled_wall(model, half_space=5e-11, **damped)):
        coupled_run = impact(chain, coupled, speeds(3), duration=6e-4, error=1e-9)
        assert velocity_difference(coupled_run, split) < 1e-6
        free = impact(
            chain, coupled._replace(D=0 * coupled.D), speeds(3), duration=6e-4, error=1e-9
        )
        assert velocity_difference(free, split) > 1e-3


def test_a_horizon_before_the_first_impact_ends_makes_no_tiny_steps():
    run = {"duration": 3e-3, "error": 1e-4, "n_save": 3000}
    usual = impact(chain_of(5), dem.rigid_wall(), speeds(5), **run).trajectory
    early = impact(chain_of(5), dem.rigid_wall(), speeds(5), horizon=1e-18, **run).trajectory
    assert early.n_steps <= 4 * usual.n_steps
    assert early.energy_error < 1e-6


def test_a_verdict_on_many_spheres_costs_no_more_a_sphere():
    # with a sum over all spheres for each contact this one would take minutes
    many, few = (verdict(chain_of(n), dem.rigid_wall(), speeds(n)).sentences for n in (200_000, 20))
    assert many == few
