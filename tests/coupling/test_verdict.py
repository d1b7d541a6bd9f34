"""Verdicts, marches of coupled walls and costs of modes: each number beside its formula."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from beadwave import dem
from beadwave.coupling import CoupledWall, CouplingError, energy_gain, march_coupled, verdict
from beadwave.coupling.coupled_march import longest_step, with_coupled_error
from beadwave.coupling.verdict import (
    _contact_frequency,
    large_step_error,
    largest_monotone_force,
    predicted_peak_force,
)
from beadwave.dem import Wall
from beadwave.workflows.fit.parametric_wall import Layout, left_out_errors, modes_and_rest

from formulas import motion as by_formulas
from known_models import speeds, unit_chain

OMEGA, ZETA, PHI = np.array([0.7, 3.0]), np.array([0.1, 0.3]), np.array([-0.5, 0.4])


def coupled(residual=0.0, damped=True):
    D = np.diag(2 * ZETA * OMEGA) * damped
    return CoupledWall(OMEGA, D, PHI, PHI, residual)


def row(**parts):
    chain = unit_chain(3, 1.5, **parts)
    return chain._replace(mass=np.array([1.0, 0.8, 1.3]))


# --- the march of a coupled wall -----------------------------------------------------------------

HELD = {
    "leaf_stiffness": np.array([0.4, 0.1, 0.2]), "leaf_anchor": np.array([0.9, 0.1, 0.1]),
    "preload": 0.2,
}  # fmt: skip
GAMMA = np.array([0.2, 0.14, 0.26])
CASES = {
    "hertz": (0.0, {}),
    "held": (0.1, HELD),
    "hunt-crossley": (0.2, HELD | {"dissipation": "hunt-crossley", "gamma": GAMMA}),
    "linear": (0.0, HELD | {"dissipation": "linear", "gamma": GAMMA}),
    "linear-clipped": (0.2, {"dissipation": "linear-clipped", "gamma": GAMMA}),
}


@pytest.mark.parametrize("case", CASES)
def test_a_coupled_march_is_the_solution_of_its_equations(case):
    """Modes that the damping leaves uncoupled are those of a wall of oscillators."""
    residual, parts = CASES[case]
    chain, t = row(**parts), np.linspace(0, 3.0, 7)
    run = march_coupled(chain, coupled(residual), speeds(3), duration=3.0, error=1e-10, n_save=6)
    exact = by_formulas(chain, Wall(OMEGA, ZETA, PHI, residual), speeds(3), t)
    assert np.abs(run.v - exact.v).max() < 1e-7
    assert np.abs(run.contact_force - exact.force).max() < 1e-7
    # what the steps leave at 1e-10 each, 1.5e-9 where nothing jumps: no rounding
    assert run.energy_error < (1e-8 if case in ("hertz", "held", "hunt-crossley") else 1e-6)
    off = np.abs(run.energy_total - run.energy_total[0]).max()
    assert run.energy_error == pytest.approx(off / run.energy_kinetic[0], rel=1e-12)
    assert (run.final.x == run.x[-1]).all() and (run.final.v == run.v[-1]).all()
    assert run.final.q @ PHI == pytest.approx(run.wall_x[-1], rel=1e-12)
    assert run.final.p @ PHI == pytest.approx(run.wall_v[-1], rel=1e-12)
    np.testing.assert_allclose(run.wall_q @ PHI, run.wall_x, rtol=1e-6, atol=1e-9)
    wall_energy = 0.5 * np.sum(run.final.p**2 + (OMEGA * run.final.q) ** 2)
    assert run.energy_wall[-1] == pytest.approx(wall_energy, rel=1e-12)
    assert run.dt * run.n_steps == pytest.approx(3.0) and run.n_steps >= 9
    k, anchor = chain.springs
    F = run.contact_force
    assert run.energy_kinetic == pytest.approx(0.5 * run.v**2 @ chain.mass)
    assert run.energy_leaf == pytest.approx(0.5 * (run.x - anchor) ** 2 @ k, rel=1e-12)
    assert run.work_preload[1:] == pytest.approx(chain.preload * (run.x[1:, -1] - run.x[0, -1]))
    if not parts.get("dissipation"):
        d = (F / chain.A) ** (2 / 3)
        assert run.energy_contact == pytest.approx(0.4 * (F * d).sum(axis=1))
        assert run.energy_residual == pytest.approx(0.5 * residual * F[:, -1] ** 2)
        assert not run.dissipated_contact.any()
    assert run.dissipated_wall[-1] > 1e-5


def test_a_free_mode_and_a_weight_are_marched():
    """Without contact: q'' = 0 and x'' = g; the ledger has the work of the weight."""
    wall = CoupledWall(np.array([0.0, 2.0]), np.zeros((2, 2)), *[np.array([0.5, 0.3])] * 2, 0.0)
    chain = row(gravity=0.3, n_falling=3)
    run = march_coupled(chain, wall, -np.array([2.0, 1.5, 1.0]), duration=1.0, n_save=4)
    t = run.t[:, None]
    np.testing.assert_allclose(run.x, -t * [2.0, 1.5, 1.0] + 0.15 * t**2, atol=1e-6)
    np.testing.assert_allclose(run.work_gravity, 0.3 * (run.x - run.x[0]) @ chain.mass)
    assert run.energy_error < 1e-6 and not run.contact_force.any()


def test_the_start_of_a_coupled_march_is_at_rest():
    chain = row(**HELD)
    run = march_coupled(chain, coupled(0.1), np.zeros(3), duration=2.0, error=1e-9, n_save=4)
    assert np.abs(run.x - run.x[0]).max() < 1e-9 and run.contact_force.min() > 0.04
    off = np.abs(run.energy_total - run.energy_total[0]).max()
    assert run.energy_error == pytest.approx(off / np.abs(run.energy_total).max(), rel=1e-12)
    static = dem.equilibrium(chain, Wall(OMEGA, ZETA, PHI, 0.1))
    np.testing.assert_allclose(run.x[0], static.x, rtol=1e-9)
    assert run.wall_x[0] == pytest.approx(PHI @ static.q)


def test_a_force_and_a_reading_of_their_own_rest_in_their_cross_compliance():
    reading = np.array([0.2, -0.6])
    wall = coupled()._replace(reading=reading)
    chain = row(**HELD)
    run = march_coupled(chain, wall, np.zeros(3), duration=1.0, error=1e-9, n_save=2)
    F = run.contact_force[0, -1]
    assert run.wall_x[0] == pytest.approx(reading @ (PHI / OMEGA**2) * F)
    assert np.abs(run.x - run.x[0]).max() < 1e-8


def test_an_error_estimate_is_not_below_the_difference_to_a_better_march():
    chain = row()
    run = march_coupled(chain, coupled(), speeds(3, 2.0), duration=3.0, error=1e-6, n_save=30)
    estimate = with_coupled_error(chain, coupled(), speeds(3, 2.0), run, error=1e-6).error_estimate
    best = march_coupled(chain, coupled(), speeds(3, 2.0), duration=3.0, error=1e-12, n_save=30)
    true = np.abs(best.v - run.v).max() / 2.0
    assert true < estimate < 60 * true  # 18 measured
    half = march_coupled(
        chain, coupled(), speeds(3, 2.0), duration=3.0, error=32e-6, n_save=30, largest_step=2 / 3.0
    )
    assert estimate == pytest.approx(np.abs(half.v - run.v).max() / 2.0, rel=1e-9)


def test_the_longest_step_is_that_of_the_fastest_mode_or_damper():
    assert longest_step(coupled(damped=False)) == pytest.approx(1 / 3.0)
    strong = coupled()._replace(D=np.diag([1.0, 60.0]))
    assert longest_step(strong) == pytest.approx(3 / 60.0)
    assert longest_step(coupled()._replace(omega=np.zeros(2), D=np.zeros((2, 2)))) == np.inf
    assert longest_step(coupled()._replace(D=np.diag([1.0, 299.0]))) == pytest.approx(3 / 299)
    with pytest.raises(CouplingError, match="settle within"):
        longest_step(coupled()._replace(D=np.diag([1.0, 301.0])))


@pytest.mark.parametrize(("v0", "speed"), [([0.1, -2.0, 0.5], 2.0), ([0.0, 0.0, 0.0], 1e-3)])
def test_errors_of_a_coupled_march_are_allowed_in_units_of_the_impact(monkeypatch, v0, speed):
    """Its speed, time and largest mass; before it all hangs in its static state."""
    calls = []

    def noted(rate, interval, y0, **options):
        calls.append((y0, options["atol"] / options["rtol"]))
        return solve_ivp(rate, interval, y0, **options)

    monkeypatch.setattr("scipy.integrate.solve_ivp", noted)
    wall = CoupledWall(np.array([0.0, 3.0]), np.zeros((2, 2)), PHI, PHI, 0.1)
    chain = row(**HELD)._replace(A=np.array([4.0, 0.7, 1.5]))
    march_coupled(chain, wall, v0, duration=1e-3, n_save=1)
    ((y, scale),) = calls
    period, root = dem.spheres.time_scale(1.3, 0.7, speed), np.sqrt(1.3)
    units = [speed * period, speed, speed * period * root, speed * root, 1.3 * speed**2]
    np.testing.assert_allclose(scale, np.repeat(units, [3, 3, 2, 2, 2]), rtol=1e-12)
    soft = (PHI[1] / 3.0) ** 2 + 0.1
    static = dem.equilibrium(chain, Wall(*np.zeros((3, 0)), soft))
    exact = [*static.x, *v0, 0.0, PHI[1] * static.force[-1] / 9.0, 0, 0, 0, 0]
    np.testing.assert_allclose(y, exact, rtol=1e-12)


def test_a_step_of_a_coupled_march_evaluates_its_rate_twelve_times(monkeypatch):
    times = []

    def counted(rate, *arguments, **options):
        return solve_ivp(lambda t, y: times.append(t) or rate(t, y), *arguments, **options)

    monkeypatch.setattr("scipy.integrate.solve_ivp", counted)
    run = march_coupled(row(), coupled(), speeds(3), duration=6.0, n_save=2)
    assert run.n_steps == len(times) // 12 and len(times) > 13 * 12


def test_the_gain_of_a_run_is_its_largest_energy_over_the_strikers():
    run = march_coupled(row(), coupled(), speeds(3), duration=1.0, n_save=4)
    gained = run._replace(energy_total=run.energy_kinetic[0] * np.array([1.0, 1.2, 1.5, 0.9, 1.1]))
    result = energy_gain(gained)
    assert result.largest == pytest.approx(0.5) and result.final == pytest.approx(0.1)
    assert result.time == run.t[2]


# --- verdicts ------------------------------------------------------------------------------------


def test_the_series_law_turns_over_where_its_slope_is_zero():
    F, A, s = largest_monotone_force(-0.03, 1.7), 1.7, -0.03
    assert 2 / 3 * A ** (-2 / 3) * F ** (-1 / 3) + s == pytest.approx(0, abs=1e-15)
    assert largest_monotone_force(0.0, A) == np.inf


@pytest.mark.parametrize(
    "v0", [[1.0, 0, 0], [-1.0, 0, 0], [0.5, 0.5, 0.5], [0, -2.0, 1.0], [-0.3, -0.3, -0.3]]
)
def test_a_predicted_force_is_one_sphere_with_all_of_the_swing_or_all_of_the_energy(v0):
    chain, A, v = row(preload=0.2), np.array([1.0, 2.0]), np.array(v0)
    swing = max(v.max() - min(v.min(), 0), 0) if v.max() > 0 else max(0 - v.min(), 0)
    one = 1.03 * A**0.4 * (1.25 * 1.3 * swing**2) ** 0.6
    of_energy = A**0.4 * (1.25 * (chain.mass @ v**2)) ** 0.6
    result = predicted_peak_force(chain, v, A)
    np.testing.assert_allclose(result, np.minimum(one, of_energy) + 0.2, rtol=1e-12)


@pytest.mark.parametrize("last", [1.3, 0.1])
@pytest.mark.parametrize("kind", ["wall", "coupled", "free"])
def test_a_verdict_tells_force_stiffness_and_frequencies(kind, last):
    residual = 0.2
    wall = {"wall": Wall(OMEGA, ZETA, PHI, residual), "coupled": coupled(residual), "free": None}[
        kind
    ]
    chain = row()
    chain = chain._replace(A=chain.A[: None if wall else 2], mass=np.array([1.0, 0.8, last]) * 1e-3)
    result = verdict(chain, wall, speeds(3, 9.0))
    A = chain.A[-1]
    F = float(predicted_peak_force(chain, speeds(3, 9.0), A))
    k = 1.5 * A ** (2 / 3) * F ** (1 / 3)
    k = k / (1 + residual * k) if wall else k
    assert result.predicted_peak_force == pytest.approx(F)
    assert result.n_wall_modes == (2 if wall else 0) and result.possible and result.passive
    assert f"{F:.3g} N, contact stiffness {1e-6 * k:.3g} MN/m" in result.sentences[0]
    assert ("at the wall" in result.sentences[0]) is bool(wall)
    between = chain.A[:2]
    G = predicted_peak_force(chain, speeds(3, 9.0), between)
    ks = 1.5 * between ** (2 / 3) * G ** (1 / 3)
    m = chain.mass
    if wall:
        ks = np.append(ks, k)
    pairs = np.append(1 / m[:-1] + 1 / m[1:], [1 / m[-1] + PHI @ PHI] if wall else [])
    rows = ks * pairs  # of the contact matrix, with what shares a sphere
    for i in range(len(ks) - 1):
        shared = np.sqrt(ks[i] * ks[i + 1]) / m[i + 1]
        rows[i] += shared
        rows[i + 1] += shared
    assert f"{np.sqrt(rows.max()) / 2 / np.pi:.3g} Hz" in result.sentences[1]
    if wall:
        words = f"2 modes up to {3.0 / 2 / np.pi:.3g} Hz and a residual compliance of 2e+08 nm/N"
        assert words in result.sentences[2]


def test_a_verdict_forbids_what_makes_energy_or_gives_way():
    wall, chain = Wall(OMEGA, ZETA, PHI), row()
    for broken, sentence in (
        (wall._replace(zeta=-ZETA), "generates energy"),
        (wall._replace(mobility=-1.0), "generates energy"),
        (wall._replace(residual_compliance=-1.0), "unstable"),
    ):
        result = verdict(chain, broken, speeds(3))
        assert not result.possible and sentence in " ".join(result.findings)
    driven = verdict(chain, coupled()._replace(D=-np.eye(2)), speeds(3))
    assert not driven.passive and "damping is negative" in driven.findings[0]
    elsewhere = verdict(chain, coupled()._replace(reading=2 * PHI), speeds(3))
    assert not elsewhere.passive and elsewhere.possible
    assert verdict(chain, Wall(*np.zeros((3, 0))), speeds(3)).findings == ()
    deaf = verdict(chain, coupled()._replace(force=0 * PHI, reading=0 * PHI), speeds(3))
    assert "acts as rigid" in deaf.findings[0]


def test_a_sphere_alone_has_neither_contact_nor_frequency():
    chain = row()._replace(mass=np.array([2.0]), radius=np.array([0.5]), A=np.zeros(0))
    result = verdict(chain, None, np.array([3.0]))
    assert result.possible and result.passive and result.predicted_peak_force == 0.0
    assert result.sentences == (
        "Predicted peak force between spheres 0 N, contact stiffness 0 MN/m.",
        "Highest frequency of the contacts 0 Hz.",
    )


def test_soft_contacts_of_a_free_chain_are_judged_by_the_stiffest():
    """Below 1 N/m^1.5, where spheres of a tonne swing once in minutes."""
    chain = row()._replace(mass=np.array([900.0, 400.0, 700.0]), A=np.array([0.02, 0.03]))
    v0 = np.array([1e-3, 0.0, 0.0])
    result = verdict(chain, None, v0)
    assert result.predicted_peak_force == pytest.approx(predicted_peak_force(chain, v0, 0.03))
    G = predicted_peak_force(chain, v0, chain.A)
    k = 1.5 * chain.A ** (2 / 3) * G ** (1 / 3)
    shared = np.sqrt(k[0] * k[1]) / 400
    exact = np.sqrt(max(k[0] * (1 / 900 + 1 / 400), k[1] * (1 / 400 + 1 / 700)) + shared)
    assert _contact_frequency(chain, None, v0, np.nan) == pytest.approx(exact, rel=1e-12)


def test_one_sphere_at_a_wall_moves_against_its_modes():
    """sqrt(k (1/m + phi^T phi)) of k that is given; phi is what is read."""
    chain = row()._replace(mass=np.array([3.0]), radius=np.array([0.5]), A=np.array([0.7]))
    reading = np.array([0.2, -0.6])
    wall = coupled()._replace(reading=reading)
    for given, phi in ((wall, reading), (Wall(OMEGA, ZETA, PHI), PHI)):
        exact = np.sqrt(0.05 * (1 / 3 + phi @ phi))
        result = _contact_frequency(chain, given, np.array([0.1]), 0.05)
        assert result == pytest.approx(exact, rel=1e-12)


def test_what_makes_a_wall_impossible_is_said_with_its_numbers():
    chain, wall = row(), Wall(OMEGA, ZETA, PHI)
    F = verdict(chain, wall, speeds(3)).predicted_peak_force
    for factor, possible in ((1.01, True), (0.99, False)):  # of the force that it gives way at
        s = -2 / (3 * (factor * F * 1.5**2) ** (1 / 3))
        for given in (wall._replace(residual_compliance=s), coupled(s)):
            result = verdict(chain, given, speeds(3))
            assert result.possible is possible and result.passive
            if not possible:
                sentence = (
                    f"The contact becomes unstable at {factor * F:.3g} N, below the predicted peak "
                    f"of {F:.3g} N, since the residual compliance is {s:.3g} m/N;"
                )
                assert result.findings[0].startswith(sentence) and "inf MN/m" in result.sentences[0]
                assert result.sentences[-1] == result.findings[0]
    worst = wall._replace(zeta=np.array([0.2, -0.3]))
    sentence = verdict(chain, worst, speeds(3)).findings[0]
    assert sentence.startswith("The wall has a damping ratio of -0.3 and a mobility of 0;")


def test_walls_without_damping_and_with_one_mode_are_said_to_work():
    chain = row()
    one = Wall(OMEGA[1:], np.zeros(1), PHI[1:])
    result = verdict(chain, one, speeds(3))
    assert result.passive and result.findings == () and result.n_wall_modes == 1
    assert result.sentences[2].startswith(f"The wall has 1 mode up to {3.0 / 2 / np.pi:.3g} Hz")
    assert verdict(chain, one._replace(mobility=0.5), speeds(3)).passive
    still = coupled(damped=False)
    assert verdict(chain, still, speeds(3)).passive
    rigid = verdict(chain, Wall(*np.zeros((3, 0))), speeds(3))
    assert len(rigid.sentences) == 2 and rigid.n_wall_modes == 0
    assert "acts as rigid" in verdict(chain, one._replace(phi=np.zeros(1)), speeds(3)).findings[0]


def test_a_given_step_is_too_long_above_a_hundredth():
    assert [*large_step_error(None)] == [*large_step_error(0.01)] == []
    sentence = "The step leaves an error of 0.011 in the velocities;"
    assert [line[: len(sentence)] for line in large_step_error(0.011)] == [sentence]


# --- modes left out ------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [1.0, 1e-3])
def test_modes_that_are_not_followed_are_one_oscillator_of_their_moments(size):
    """m_1 = sum phi^2 / omega^2 and m_2 = sum phi^2 / omega^4; rigid motion is none of them."""
    wall = Wall(np.array([0.0, 0.2, 0.5, 3.0]), np.array([0.0, 0.1, 0.4, 0.2]),
                size * np.array([0.7, 0.3, -0.2, 0.5]), 0.3)  # fmt: skip
    one = modes_and_rest(wall, np.array([3])).as_wall(wall)
    share = (wall.phi[1:3] / wall.omega[1:3]) ** 2
    static = (one.phi[1] / one.omega[1]) ** 2
    assert static == pytest.approx(share.sum(), rel=1e-12)
    second = (share / wall.omega[1:3] ** 2).sum()
    assert static / one.omega[1] ** 2 == pytest.approx(second, rel=1e-12)
    assert one.zeta[1] == pytest.approx(share @ wall.zeta[1:3] / share.sum(), rel=1e-12)
    assert (one.omega[0], one.phi[0], one.zeta[0]) == (3.0, size * 0.5, 0.2)
    none = modes_and_rest(wall, np.arange(1, 4)).as_wall(wall)
    assert none.phi[-1] == none.zeta[-1] == 0.0 and len(none.omega) == 4 and none.omega[-1] > 0


def test_modes_of_no_compliance_have_no_say_in_what_polynomials_miss():
    """Squares of omega, of phi, ratios, compliance of walls, and what the others say of each."""
    values = np.tile([1.0, 1e4, 2.0, 1.0, 0.1, 0.1, 0, 0, 0, 0.3], (3, 1))
    said = values.copy()
    said[0, 0] *= 1.02
    said[:, 1] *= 1.5
    result = left_out_errors(values, said, Layout(2, 1))
    assert result.frequency == pytest.approx(0.01)
    exact = (2 / 1.02 + 1 / 1.5e4) / (2 + 1e-4)
    assert result.compliance == pytest.approx(1 - exact)
