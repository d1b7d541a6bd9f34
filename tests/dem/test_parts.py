"""Wall modes, leaf springs, preload and dissipation: each alone against an exact result, all of
them together through the ledger, the order of the schemes and reversal in time."""

import numpy as np
import pytest

from beadwave.dem import (
    SCHEMES,
    InvalidChain,
    NoEquilibrium,
    StepSearch,
    UnstableStep,
    Wall,
    dashpot_wall,
    equilibrium,
    march,
    march_to_error,
    one_dof_wall,
    rigid_wall,
    stability_limit,
)
from beadwave.dem.kernels.laws import damping_impulse
from beadwave.dem.kernels.oscillators import oscillator_propagator

from known_models import speeds, unit_chain


def modal_wall(damped=True, **fields):
    omega = np.array([0.0, 0.7, 3.0, 11.0])
    zeta = np.array([0.0, 0.02, 0.3, 1.4]) if damped else np.zeros(4)
    return Wall(omega, zeta, np.array([0.2, -0.5, 0.4, 0.7]), **fields)


def squeezed(n, **fields):
    """All contacts closed with force P, held by the wall alone."""
    push = np.zeros(n)
    push[0] = 1.0
    anchor = np.zeros(n)
    anchor[0] = fields.pop("P", 1.0) * 1e3
    return unit_chain(n, 1.5, leaf_stiffness=1e-3 * push, leaf_anchor=anchor, **fields)


@pytest.mark.parametrize(
    ("omega", "zeta"),
    [(2.0, 0.0), (2.0, 0.3), (2.0, 1.0), (2.0, 1.0 + 1e-9), (2.0, 7.0), (0.0, 0.0)],
)
def test_modal_drift_is_the_analytic_oscillator(omega, zeta):
    t, q, p = 0.37, 0.8, -1.3
    qq, qp, pq, pp = oscillator_propagator(np.array([omega]), np.array([zeta]), t)[:, 0]
    companion = np.array([[0.0, 1.0], [-(omega**2), -2 * zeta * omega]])
    exact = np.eye(2)
    for k in range(60, 0, -1):
        exact = np.eye(2) + companion @ exact * (t / k)
    # terms of the series are up to exp(2 zeta omega t) = 3e4 and cancel: eps of them is 7e-12
    assert [qq * q + qp * p, pq * q + pp * p] == pytest.approx(exact @ [q, p], rel=1e-13, abs=1e-11)


def test_strong_damping_of_fast_modes_does_not_overflow():
    E = oscillator_propagator(np.array([1e8, 1e8]), np.array([1.0, 1e3]), 1e-3)
    assert np.isfinite(E).all()
    assert E[0, 1] == pytest.approx(np.exp(-1e8 / (1e3 + np.sqrt(1e6 - 1)) * 1e-3), rel=1e-6)


@pytest.mark.usefixtures("kernels")
@pytest.mark.parametrize("damped", [False, True])
def test_energy_ledger_closes_with_every_part(damped):
    chain = unit_chain(
        6,
        1.5,
        dissipation="hunt-crossley" if damped else "none",
        gamma=np.linspace(0.05, 0.2, 6),
        leaf_stiffness=np.linspace(0.0, 0.4, 6),
        leaf_anchor=np.array([0.1, 0.1, 0.0, 0.05, 0.0, 0.0]),
        preload=0.2,
    )
    wall = modal_wall(damped, residual_compliance=0.1)._replace(phi=np.array([0.0, -0.5, 0.4, 0.7]))
    run = march(chain, wall, speeds(6), duration=30.0, dt=0.01, n_save=300)
    # of the step, 2.2e-8 with damping: no rounding
    assert run.energy_error < (1e-7 if damped else 1e-8)
    for feature in (
        run.energy_contact, run.energy_leaf, run.energy_wall, run.energy_residual,
        run.work_preload,
    ):  # fmt: skip
        assert np.ptp(feature) > 1e-3
    assert (run.dissipated_contact[-1] > 1e-3) == damped
    assert (run.dissipated_wall[-1] > 1e-3) == damped
    assert np.diff(run.dissipated_contact).min() >= -1e-12
    if damped:
        assert np.diff(run.dissipated_wall).min() >= -1e-7


@pytest.mark.parametrize("law", ["linear", "linear-clipped", "hunt-crossley"])
@pytest.mark.parametrize("gamma", [0.01, 1.0, 1e3])
def test_dissipation_never_makes_energy_and_the_ledger_closes(law, gamma):
    chain = unit_chain(6, 1.5, dissipation=law, gamma=np.full(6, gamma))
    run = march(chain, modal_wall(), speeds(6), duration=30.0, dt=0.02, scheme="verlet", n_save=300)
    assert np.isfinite(run.v).all()
    assert np.diff(run.dissipated_contact).min() >= 0.0
    assert run.energy_error < 2e-3
    pulls = run.contact_force.min()
    assert pulls < 0.0 if law == "linear" and gamma <= 1.0 else True
    if law != "linear":
        assert pulls >= 0.0


@pytest.mark.usefixtures("kernels")
def test_linear_damping_of_two_closed_beads_is_the_damped_oscillator():
    # two equal beads squeezed between springs so hard that the contact is linear
    stiffness, gamma = 400.0, 0.3
    chain = unit_chain(
        2,
        dissipation="linear",
        gamma=np.array([gamma]),
        leaf_stiffness=np.full(2, 1.0),
        leaf_anchor=np.array([stiffness, -stiffness]),
    )
    static = equilibrium(chain, None)
    k = 1.5 * np.sqrt(static.x[0] - static.x[1])
    v0 = 1e-6 * np.array([1.0, -1.0])
    run = march(chain, None, v0, duration=5.0, dt=0.01, n_save=100)
    omega, decay = np.sqrt(2 * k + 1.0), gamma
    swing = np.sqrt(omega**2 - decay**2)
    t = run.t
    exact = 1e-6 * np.exp(-decay * t) * (np.cos(swing * t) - decay / swing * np.sin(swing * t))
    assert run.v[:, 0] == pytest.approx(exact, abs=3e-6 * 1e-6)


def test_hunt_crossley_restitution_of_light_damping():
    # to first order the loss is gamma * integral F v dx = 2/3 gamma m v^3
    lost = []
    for gamma in (1e-3, 2e-3):
        chain = unit_chain(1, 1.0, dissipation="hunt-crossley", gamma=np.array([gamma]))
        run = march(chain, rigid_wall(), np.ones(1), duration=4.0, dt=0.01, n_save=4)
        assert run.dissipated_contact[-1] + 0.5 * run.v[-1, 0] ** 2 == pytest.approx(0.5, abs=1e-7)
        lost.append(run.dissipated_contact[-1] / gamma)
    assert 2 * lost[0] - lost[1] == pytest.approx(2 / 3, rel=1e-4)


@pytest.mark.usefixtures("kernels")
def test_leaf_spring_swings_exactly():
    chain = unit_chain(1, leaf_stiffness=np.array([9.0]), leaf_anchor=np.array([0.5]))
    run = march(chain, None, np.ones(1), duration=10.0, dt=1.0, n_save=10)
    assert run.x[:, 0] == pytest.approx(0.5 + np.sin(3.0 * run.t) / 3.0, abs=1e-13)


@pytest.mark.usefixtures("kernels")
def test_wall_mode_rings_exactly_after_the_impact():
    wall = one_dof_wall(0.5, 2.0, 0.1)
    run = march(unit_chain(1, 1.0), wall, np.ones(1), duration=20.0, dt=0.05, n_save=400)
    free = np.flatnonzero(run.contact_force[:, 0] == 0.0)
    k = free[free > 5][0]
    E = oscillator_propagator(wall.omega, wall.zeta, run.t[-1] - run.t[k])[:, 0]
    exact = E[:2] @ [run.wall_x[k], run.wall_v[k]]
    assert run.contact_force[k:].max() == 0.0
    assert run.wall_x[-1] == pytest.approx(exact, abs=1e-13)


@pytest.mark.usefixtures("kernels")
@pytest.mark.parametrize("damped", [False, True])
def test_static_state_stays(damped):
    law = dict(dissipation="hunt-crossley", gamma=np.full(5, 0.1)) if damped else {}
    chain = unit_chain(
        5,
        1.5,
        leaf_stiffness=np.array([1e-2, 0.0, 300.0, 0.0, 0.3]),
        leaf_anchor=np.array([30.0, 0.0, 0.7, 0.0, 0.1]),
        preload=0.3,
        **law,
    )
    wall = Wall(np.array([2.0, 50.0]), np.array([0.1, 0.0]), np.array([0.4, -0.3]), 0.05)
    static = equilibrium(chain, wall)
    assert static.force.min() > 0.05
    run = march(chain, wall, np.zeros(5), duration=100.0, dt=0.1, n_save=10)
    assert np.abs(run.x - static.x).max() == 0.0
    assert np.abs(run.v).max() == 0.0
    assert run.contact_force[0] == pytest.approx(static.force, rel=1e-12)
    assert run.wall_x[0] == pytest.approx(wall.phi @ static.q)


def test_static_state_of_known_problems():
    alone = equilibrium(unit_chain(3, 8.0, preload=2.0), rigid_wall())
    assert alone.x == pytest.approx(np.full(3, 0.25 ** (2 / 3)))
    assert alone.force == pytest.approx([0.0, 0.0, 2.0])
    elastic = Wall(np.array([2.0]), np.zeros(1), np.array([3.0]), 0.5)
    assert equilibrium(unit_chain(1, 8.0, preload=2.0), elastic).x[0] == pytest.approx(
        0.25 ** (2 / 3) + 2.0 * (9.0 / 4.0 + 0.5)
    )
    hung = unit_chain(2, 1.0, leaf_stiffness=np.full(2, 4.0), preload=-2.0)
    x = equilibrium(hung, rigid_wall()).x
    assert x.sum() == pytest.approx(-2.0 / 4.0)
    assert (x[0] - x[1]) ** 1.5 == pytest.approx(-4.0 * x[0])


def test_spheres_before_the_first_that_is_held_just_touch():
    """Not even by a rounding error, whose square root would be a contact's stiffness."""
    stiffness = np.array([0.0, 0.0, 0.0, 2.0, 0.0, 0.1])
    for chain in (
        unit_chain(6, 1.5, preload=0.3),
        unit_chain(6, 1.5, leaf_stiffness=stiffness, leaf_anchor=0.2 * stiffness),
    ):
        static = equilibrium(chain, Wall(np.array([2.0]), np.zeros(1), np.ones(1), 0.05))
        first = 3 if chain.leaf_stiffness is not None else 5
        assert not np.diff(static.x[: first + 1]).any()
        assert not static.force[:first].any()
        assert static.force[-1] > 0.01


@pytest.mark.parametrize("seed", range(8))
def test_static_state_balances_random_chains(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 40))
    stiffness = 10.0 ** rng.uniform(-3, 3, n) * (rng.random(n) < 0.6)
    stiffness[-1] = 1.0
    chain = unit_chain(
        n,
        1.5,
        leaf_stiffness=stiffness,
        leaf_anchor=rng.normal(size=n),
        preload=float(rng.normal()),
    )
    wall = Wall(np.array([1.0]), np.zeros(1), np.array([0.5]), -0.01)
    static = equilibrium(chain, wall)
    force = np.concatenate([[0.0], static.force])
    net = -np.diff(force) - stiffness * (static.x - chain.leaf_anchor)
    net[-1] += chain.preload
    assert np.abs(net).max() < 1e-9 * np.abs(stiffness * chain.leaf_anchor).sum()


def test_nothing_to_lean_on_is_no_equilibrium():
    with pytest.raises(NoEquilibrium, match="nothing supports a preload of 1 N"):
        equilibrium(unit_chain(3, preload=1.0), None)
    with pytest.raises(NoEquilibrium, match="nothing supports a preload of 1 N"):
        equilibrium(unit_chain(3, 1.0, preload=1.0), dashpot_wall(2.0))
    with pytest.raises(NoEquilibrium, match="nothing supports a preload of 1 N"):
        equilibrium(unit_chain(3, 1.0, preload=1.0), one_dof_wall(0.0, 1.0))
    with pytest.raises(NoEquilibrium, match="nothing holds"):
        equilibrium(unit_chain(1, 1.0, leaf_stiffness=np.ones(1), preload=1.0), dashpot_wall(2.0))


def _order(scheme, chain, wall, steps, duration=8.0):
    v0 = 0.05 * np.sin(np.arange(chain.mass.size) + 1.0)
    runs = [
        march(chain, wall, v0, duration=duration, dt=duration / m, scheme=scheme, n_save=8)
        for m in (*steps, 4096)
    ]
    errors = [np.abs(run.v - runs[-1].v).max() for run in runs[:-1]]
    assert min(run.contact_force.min() for run in runs) > 0.1
    return np.diff(np.log(errors)) / np.diff(np.log(1.0 / np.array(steps))), errors


@pytest.mark.parametrize("name", SCHEMES)
def test_order_while_contacts_stay_closed(name):
    scheme = SCHEMES[name]
    steps = {2: (256, 512), 4: (64, 128), 6: (32, 48), 8: (24, 32)}[scheme.order]
    chain = squeezed(5)
    wall = Wall(np.array([0.6, 2.0]), np.array([0.0, 0.1]), np.array([0.5, 0.3]), 0.1)
    order, errors = _order(name, chain, wall, steps)
    assert order[-1] == pytest.approx(scheme.order, abs=0.15)
    assert errors[-1] < 1e-4


@pytest.mark.usefixtures("kernels")
@pytest.mark.parametrize(
    "name",
    ["verlet", "suzuki4", "energy2"]
    + [
        pytest.param(name, marks=pytest.mark.slow)
        for name in ("leapfrog", "kahan-li6", "kahan-li8", "energy4")
    ],
)
def test_composed_and_implicit_schemes_keep_their_order_with_damped_contacts(name):
    scheme = SCHEMES[name]
    steps = {2: (256, 512), 4: (64, 128), 6: (32, 48), 8: (24, 32)}[scheme.order]
    chain = squeezed(5, dissipation="linear", gamma=np.full(5, 0.2))
    order, _ = _order(name, chain, modal_wall()._replace(omega=np.array([1.0, 0.7, 3, 4])), steps)
    assert order[-1] == pytest.approx(scheme.order, abs=0.15)


def without_correction(monkeypatch):
    for name, scheme in SCHEMES.items():
        monkeypatch.setitem(SCHEMES, name, scheme._replace(correction=None))


@pytest.mark.usefixtures("kernels")
def test_march_reverses_in_time(monkeypatch):
    without_correction(monkeypatch)
    chain = unit_chain(
        6, 1.5, leaf_stiffness=np.full(6, 0.1), leaf_anchor=np.linspace(0.2, 0, 6), preload=0.1
    )
    wall = modal_wall(damped=False, residual_compliance=-0.05)._replace(
        phi=np.array([0.0, -0.5, 0.4, 0.7])
    )
    forward = march(chain, wall, speeds(6), duration=15.0, dt=0.05, n_save=5)
    turned = forward.final.reversed()
    back = march(chain, wall, None, duration=15.0, dt=0.05, n_save=5, state=turned)
    assert back.x[-1] == pytest.approx(forward.x[0], abs=1e-10)
    assert back.v[-1] == pytest.approx(-forward.v[0], abs=1e-10)


@pytest.mark.usefixtures("kernels")
def test_two_halves_are_the_whole_bit_for_bit():
    chain, wall = unit_chain(6, 1.5), modal_wall(residual_compliance=0.1)
    full = march(chain, wall, speeds(6), duration=16.0, dt=2**-4, n_save=4)
    first = march(chain, wall, speeds(6), duration=8.0, dt=2**-4, n_save=2)
    second = march(chain, wall, None, duration=8.0, dt=2**-4, n_save=2, state=first.final)
    assert (full.x[2:] == second.x).all()
    assert (full.v[2:] == second.v).all()
    assert (full.wall_x[2:] == second.wall_x).all()


@pytest.mark.usefixtures("kernels")
def test_free_chain_keeps_its_momentum():
    chain = unit_chain(12, dissipation="hunt-crossley", gamma=np.full(11, 0.3))
    chain.mass[:] = np.linspace(0.5, 2.0, 12)
    run = march(chain, None, speeds(12), duration=40.0, dt=0.05, n_save=100)
    assert run.v @ chain.mass == pytest.approx(0.5, abs=1e-13)


@pytest.mark.usefixtures("kernels")
def test_wall_that_takes_no_part_is_rigid_and_one_that_does_is_not():
    rigid = march(unit_chain(4, 1.5), rigid_wall(), speeds(4), duration=9.0, dt=0.05, n_save=20)
    still = modal_wall()._replace(phi=np.zeros(4))
    same = march(unit_chain(4, 1.5), still, speeds(4), duration=9.0, dt=0.05, n_save=20)
    assert same.v == pytest.approx(rigid.v, abs=1e-14)
    given = march(unit_chain(4, 1.5), modal_wall(), speeds(4), duration=9.0, dt=0.05, n_save=20)
    assert np.abs(given.v - rigid.v).max() > 0.05
    assert np.abs(given.wall_x).max() > 0.1


@pytest.mark.slow
def test_stiff_mode_and_residual_spring_are_the_same_compliance():
    # a mode far above the contact's frequency is a spring of compliance phi^2 / omega^2
    mode = Wall(np.array([80.0]), np.zeros(1), np.array([20.0]))
    spring = rigid_wall()._replace(residual_compliance=(20.0 / 80.0) ** 2)
    chain = unit_chain(3, 1.5)
    stiff = march(chain, mode, speeds(3), duration=10.0, dt=2e-3, n_save=50)
    two = march(chain, spring, speeds(3), duration=10.0, dt=2e-3, n_save=50)
    assert two.v == pytest.approx(stiff.v, abs=5e-4)
    rigid = march(chain, rigid_wall(), speeds(3), duration=10.0, dt=2e-3, n_save=50)
    assert np.abs(rigid.v - two.v).max() > 1e-2


@pytest.mark.parametrize("error", [1e-3, 1e-5])
@pytest.mark.parametrize("damped", [False, True])
def test_march_to_error_reaches_the_error_it_reports(error, damped):
    law = dict(dissipation="hunt-crossley", gamma=np.full(17, 0.05)) if damped else {}
    chain, wall = unit_chain(17, 1.5, **law), modal_wall(damped, residual_compliance=0.05)
    run, report = march_to_error(
        chain, wall, speeds(17), duration=60.0, error=error, observed=[0, 3, 13], n_save=200
    )
    exact = march(chain, wall, speeds(17), duration=60.0, dt=2e-3, n_save=200)
    off = np.abs(run.v - exact.v)[:, [0, 3, 13]].max()
    assert off < max(run.error_estimate, 3e-8) <= error
    assert report.error_estimate == run.error_estimate
    assert run.energy_error <= 1e-2 * error


@pytest.mark.parametrize("n_save", [3001, 997, 1, 59 * 61])
def test_march_to_error_takes_any_number_of_saves(n_save):
    """A prime number of saves leaves no longer step that meets some of them only."""
    chain, wall = unit_chain(5, 1.5), rigid_wall()
    run, report = march_to_error(chain, wall, speeds(5), duration=6.0, error=1e-3, n_save=n_save)
    exact = march(chain, wall, speeds(5), duration=6.0, dt=1e-3, n_save=n_save)
    assert run.t.size == n_save + 1
    assert np.abs(run.v - exact.v).max() < max(report.error_estimate, 3e-8) <= 1e-3


def test_march_to_error_says_when_it_cannot():
    with pytest.raises(UnstableStep, match="is not reached"):
        march_to_error(
            unit_chain(5), None, speeds(5), duration=20.0, error=1e-9,
            search=StepSearch(max_evaluations=1e4),
        )  # fmt: skip


@pytest.mark.parametrize(("duration", "error"), [(1e12, 1e-3), (20.0, 1e-60)])
def test_march_to_error_refuses_at_once_what_would_not_end(duration, error):
    with pytest.raises(UnstableStep, match=r"is not reached within .* evaluations"):
        march_to_error(unit_chain(5), None, speeds(5), duration=duration, error=error)


def test_a_step_beyond_the_limit_is_refused():
    chain = unit_chain(5, 1.5)
    limit = stability_limit(chain, rigid_wall(), speeds(5))
    with pytest.raises(UnstableStep, match=r"dt = .* take dt <"):
        march(chain, rigid_wall(), speeds(5), duration=100 * limit, dt=2 * limit)
    march(chain, rigid_wall(), speeds(5), duration=100 * limit, dt=0.5 * limit)


@pytest.mark.usefixtures("kernels")
def test_fold_of_a_negative_residual_is_reported():
    wall = rigid_wall()._replace(residual_compliance=-0.9)
    with pytest.raises(UnstableStep, match="residual compliance"):
        march(unit_chain(1, 1.0), wall, np.ones(1), duration=5.0, dt=0.05)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (dict(mass=np.array([1.0, -1.0, 1.0])), r"mass\[1\] is -1; it must be finite and above 0"),
        (dict(A=np.array([1.0, 2.0])), r"A has shape \(2,\); give 3 numbers"),
        (dict(A=np.array([1.0, np.nan, 1.0])), r"A\[1\] is nan"),
        (dict(dissipation="viscous"), "dissipation 'viscous' is unknown"),
        (dict(dissipation="linear"), "gamma"),
        (dict(preload=np.inf), "preload"),
        (dict(leaf_stiffness=-np.ones(3)), r"leaf_stiffness\[0\] is -1"),
        (dict(leaf_anchor=np.ones(3)), "leaf_anchor needs leaf_stiffness"),
    ],
)
def test_bad_chains_are_refused_in_one_sentence(change, sentence):
    with pytest.raises(InvalidChain, match=sentence):
        march(unit_chain(3, 1.0)._replace(**change), rigid_wall(), speeds(3), duration=1.0, dt=0.1)


def test_bad_walls_velocities_and_times_are_refused():
    chain, wall = unit_chain(3, 1.0), rigid_wall()
    for bad_wall, sentence in (
        (wall._replace(omega=np.array([-1.0])), "omega"),
        (wall._replace(mobility=np.nan), "mobility"),
    ):
        with pytest.raises(InvalidChain, match=sentence):
            march(chain, bad_wall, speeds(3), duration=1.0, dt=0.1)
    with pytest.raises(InvalidChain, match="initial velocity"):
        march(chain, wall, np.array([1.0, np.inf, 0.0]), duration=1.0, dt=0.1)
    for duration, dt in ((0.0, 0.1), (1.0, -0.1), (1.0, np.nan)):
        with pytest.raises(InvalidChain, match="must be finite and above 0"):
            march(chain, wall, speeds(3), duration=duration, dt=dt)
    with pytest.raises(InvalidChain, match="scheme"):
        march(chain, wall, speeds(3), duration=1.0, dt=0.1, scheme="euler")


@pytest.mark.usefixtures("kernels")
@pytest.mark.parametrize("name", ["energy2", pytest.param("energy4", marks=pytest.mark.slow)])
@pytest.mark.parametrize("law", ["none", "linear", "linear-clipped", "hunt-crossley"])
def test_implicit_schemes_keep_energy_at_any_step(name, law):
    chain = unit_chain(
        7,
        1.5,
        dissipation=law,
        gamma=np.full(7, 0.1),
        leaf_stiffness=np.linspace(0.0, 0.4, 7),
        leaf_anchor=np.linspace(0.1, 0.0, 7),
        preload=0.2,
    )
    wall = modal_wall()._replace(phi=np.array([0.0, -0.5, 0.4, 0.7]))
    unconditional = name == "energy2" and not law.startswith("linear")
    for dt in (0.02, 0.2, 1.0, 10.0) if unconditional else (0.02, 0.1):
        run = march(chain, wall, speeds(7), duration=40.0, dt=dt, n_save=8, scheme=name)
        # 2000 steps of eps if all add up, 4e-13
        assert run.energy_error < 1e-12
    for residual in (0.2, -0.1):
        springy = wall._replace(residual_compliance=residual)
        run = march(chain, springy, speeds(7), duration=40.0, dt=0.1, scheme=name)
        assert run.energy_error < 1e-12


@pytest.mark.slow
def test_implicit_scheme_finds_the_same_trajectory():
    chain = unit_chain(9, 1.5, dissipation="hunt-crossley", gamma=np.full(9, 0.05))
    wall = modal_wall(residual_compliance=0.1)
    explicit = march(chain, wall, speeds(9), duration=30.0, dt=0.02, n_save=30)
    two = march(chain, wall, speeds(9), duration=30.0, dt=0.02, n_save=30, scheme="energy4")
    assert two.v == pytest.approx(explicit.v, abs=1e-6)
    assert two.dissipated_wall == pytest.approx(explicit.dissipated_wall, abs=1e-6)
    dash = dashpot_wall(2.0)
    explicit = march(unit_chain(4, 1.5), dash, speeds(4), duration=12.0, dt=0.02, n_save=30)
    two = march(
        unit_chain(4, 1.5), dash, speeds(4), duration=12.0, dt=0.02, n_save=30, scheme="energy4"
    )
    assert two.v == pytest.approx(explicit.v, abs=1e-6)
    assert two.energy_error < 1e-12


@pytest.mark.parametrize("w", [-3.0, -0.6, 0.2])
def test_clipped_damper_has_no_memory_of_how_its_time_is_cut(w):
    force, c, inverse_mass, dt = 1.0, 2.0, 0.7, 3.0
    full = damping_impulse(w, dt, force, c, inverse_mass, True)
    pieces, speed = 0.0, w
    for _ in range(16):
        piece = damping_impulse(speed, dt / 16, force, c, inverse_mass, True)
        assert piece >= -force * dt / 16 * (1.0 + 1e-12)
        speed -= inverse_mass * piece
        pieces += piece
    assert pieces == pytest.approx(full, rel=1e-12)


def test_opening_and_closing_contacts_keep_the_order(monkeypatch):
    chain, wall = unit_chain(17, 2.0**1.5), rigid_wall()
    options = dict(duration=60.0, n_save=60)
    exact = march(chain, wall, speeds(17), dt=0.004, **options)
    steps = (0.2, 0.05)

    def errors():
        runs = [march(chain, wall, speeds(17), dt=dt, **options) for dt in steps]
        return [np.abs(run.v - exact.v).max() for run in runs]

    corrected = errors()
    without_correction(monkeypatch)
    plain = errors()
    assert np.log(corrected[0] / corrected[1]) / np.log(steps[0] / steps[1]) > 3.2
    assert plain[0] > 8 * corrected[0]
    assert plain[1] > 8 * corrected[1]
