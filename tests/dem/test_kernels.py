"""The compiled laws and marches, each beside the formula that it stands for: roots, quadratures,
differential equations by scipy, and whole chains by `tests/support/formulas.py`. They run
as plain Python here, which compiles nothing: other tests see that numba makes the same of them."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

from beadwave import dem
from beadwave.dem import InvalidChain, Wall, dashpot_wall, equilibrium, march, rigid_wall
from beadwave.dem.checks import vector
from beadwave.dem.elastic import ElasticLaw
from beadwave.dem.kernels import dense, events, explicit, laws, oscillators, passages
from beadwave.dem.kernels.arguments import DASH, IN_WALL, Damping, Motion, Plastic, U, WallModes
from beadwave.dem.kernels.equilibrium import (
    Bearing,
    NewtonRoom,
    newton_step,
    rest,
    static_residual,
    static_slope,
)
from beadwave.dem.kernels.implicit import (
    Passage,
    closed_share,
    lead,
    mean_force,
    mean_series,
    newton_change,
    workspace,
)
from beadwave.dem.kernels.laws import mean_hertz
from beadwave.dem.kernels.modes import push_modes, shift_modes
from beadwave.dem.schemes import SCHEMES, hurwitz_zeta
from beadwave.dem.stability import fastest_rate

from formulas import at_rest
from formulas import motion as by_formulas
from known_models import speeds, unit_chain

pytestmark = pytest.mark.usefixtures("plain")

A = 1.7


def near(value, exact, rel=1e-12):
    """Relative, and nothing else: an absolute allowance would hide what is small."""
    return np.all(np.abs(np.asarray(value) - exact) <= rel * np.abs(exact))


# --- Hertz with a spring, and yielding -----------------------------------------------------------


@pytest.mark.parametrize("s", [1e-9, 0.3, 1e9, -0.05])
@pytest.mark.parametrize("share", [1e-12, 0.3, 0.97])
def test_hertz_and_a_spring_in_series_make_up_the_gap(s, share):
    """Up to the fold of a negative spring, where d gap / d delta = 1 + 3/2 s A sqrt(delta) = 0."""
    fold = (2 / (3 * A * s)) ** 2 / 3
    gap = share * (fold if s < 0 else 2.0)
    d = laws.hertz_indentation(gap, A, s)
    assert near(d + s * A * d**1.5, gap, 2e-15 if s > 0 else 1e-14)
    assert s > 0 or d <= (2 / (3 * A * s)) ** 2


def test_a_contact_without_gap_or_beyond_its_fold():
    assert laws.hertz_indentation(0.0, A, 0.1) == laws.hertz_indentation(-1.0, A, 0.1) == 0.0
    assert laws.hertz_indentation(5e-324, A, 1e300) == 0.0
    fold = (2 / (3 * A * 0.05)) ** 2 / 3
    assert math.isnan(laws.hertz_indentation(1.0001 * fold, A, -0.05))
    for s in (0.3, -0.01):
        d = laws.hertz_indentation(1.0, A, s)
        assert near(d + s * A * d**1.5, 1.0, 2e-15)
    assert laws.wall_indentation(0, -0.2, np.array([A]), None, None) == 0.0
    assert laws.wall_indentation(0, 0.2, np.array([A]), None, None) == 0.2
    assert near(laws.hertz_indentation(0.2, A, 0.0), 0.2, 1e-15)
    d = laws.wall_indentation(0, 0.2, np.array([A]), 0.4, None)
    assert near(d + 0.4 * A * d**1.5, 0.2)


def plastic(top, limit=0.1):
    """Contacts of A, yielding at a limit, pressed to the tops before."""
    contacts = Plastic(*np.array([(limit, t, *laws.plastic_loss(limit, t, A)[1:]) for t in top]).T)
    return contacts


def loading(d, limit=0.1):
    return A * limit**1.5 + 1.5 * A * limit**0.5 * (d - limit) if d > limit else A * d**1.5


@pytest.mark.parametrize("top", [0.1, 0.13, 0.4])
def test_a_yielding_contact_loses_the_area_between_loading_and_unloading(top):
    """Thornton's straight loading, Hertz' law of the flattened surface on the way back."""
    contact, As = plastic([top]), np.array([A])
    lost, coefficient, crater = laws.plastic_loss(0.1, top, A)
    back = [laws.plastic_force(0, d, As, contact) for d in (crater, top)]
    assert near(back[1], loading(top)) and back[0] < 1e-20
    assert laws.plastic_force(0, crater - 0.1, As, contact) == 0.0
    area = quad(loading, 0, top, points=[0.1], epsabs=1e-14)[0]
    given = quad(lambda d: laws.plastic_force(0, d, As, contact), crater, top, epsabs=1e-14)[0]
    # quad finds 2.5e-13 beside the root of the unloading
    assert abs(area - given - lost) < 1e-12
    F, F_y = loading(top), loading(0.1)  # C. Thornton, J. Appl. Mech. 64 (1997) 383, eq. 33
    assert near(coefficient, A * math.sqrt(F_y / F * ((2 * F + F_y) / (3 * F_y)) ** 1.5))
    assert near(laws.plastic_force(0, top + 0.2, As, contact), loading(top + 0.2))


@pytest.mark.parametrize("s", [0.6, -0.08])
@pytest.mark.parametrize("gap", [0.03, 0.12, 0.5])
def test_a_yielding_contact_and_a_spring_in_series_make_up_the_gap(s, gap):
    contact, As = plastic([0.3, 0.11]), np.array([9.0, A])
    d = laws.plastic_indentation(len(As) - 1, gap, As, s, contact)
    assert abs(d + s * laws.plastic_force(1, d, As, contact) - gap) < 4e-16
    assert laws.plastic_indentation(len(As) - 1, gap, As, None, contact) == gap
    assert laws.plastic_indentation(len(As) - 1, -gap, As, s, contact) == 0.0


@pytest.mark.parametrize("softness", [0.3, 0.6, 0.95])
@pytest.mark.parametrize("d", [0.02, 0.09, 0.1, 0.15, 0.3, 1.0])
def test_a_negative_spring_finds_overlaps_of_many_times_the_gap(softness, d):
    """softness is -s times the stiffness at first yield: the overlap is up to 12 times the gap."""
    contact, As = plastic([0.1]), np.array([A])
    s = -softness / (1.5 * A * math.sqrt(0.1))
    gap = d + s * loading(d)
    # rounding of the gap, over the slope 1 - softness of the gap in the overlap
    slack = 8e-16 * d / (1.0 - softness)
    assert abs(laws.plastic_indentation(len(As) - 1, gap, As, s, contact) - d) <= slack


@pytest.mark.parametrize(("s", "top", "gap"), [(-1.2, 0.1, 0.04), (-0.9, 0.3, 0.05)])
def test_no_force_answers_a_yielding_contact_beyond_a_fold(s, top, gap):
    """The first surface before it yields, or the flattened one on its way back from the top."""
    contact, As = plastic([top]), np.array([A])
    s /= 1.5 * A * math.sqrt(0.1)
    assert math.isnan(laws.plastic_indentation(len(As) - 1, gap, As, s, contact))


@pytest.mark.parametrize("law", ["hertz", "flattened", "yielding"])
def test_the_stiffness_of_a_contact_is_the_slope_of_its_force(law):
    contact, As = (None if law == "hertz" else plastic([0.1, 0.25])), np.array([5.0, A])
    d, h = (0.25 if law == "yielding" else 0.2), 1e-6

    def force(d):
        return A * d**1.5 if contact is None else laws.plastic_force(1, d, As, contact)

    start = d + 2 * h if law == "yielding" else d
    slope = (force(start + h) - force(start - h)) / (2 * h)
    assert near(laws.contact_stiffness(1, force(start), As, None, contact), slope, 1e-8)


def test_a_flattened_contact_yields_on_from_the_force_that_it_was_pressed_with():
    contact, As = plastic([0.1, 0.25]), np.array([5.0, A])
    coefficient, force = contact.coefficient[1], loading(0.25)
    yielding = 1.5 * A * math.sqrt(0.1)
    assert near(laws.contact_stiffness(1, force * (1 + 1e-9), As, None, contact), yielding)
    for share in (0.8, 0.99, 1 - 1e-9):
        flat = 1.5 * (coefficient**2 * share * force) ** (1 / 3)
        assert near(laws.contact_stiffness(1, share * force, As, None, contact), flat)
    assert abs(flat / yielding - 1) > 0.01


def test_a_spring_behind_a_contact_shares_its_gap_with_it():
    """1 / (1 + s k)^2, and -d ln of it / d ln F where k grows as F^(1/3)."""
    k, s, h = 3.0, 0.7, 1e-6
    share, falling = laws.spring_share(k, s)
    assert near(share, 1 / (1 + s * k) ** 2)
    up, down = (laws.spring_share(k * (1 + e) ** (1 / 3), s)[0] for e in (h, -h))
    assert near(falling, -(up - down) / (2 * h) / share, 1e-8)


@pytest.mark.parametrize("law", [laws.LINEAR, laws.LINEAR_CLIPPED, laws.HUNT_CROSSLEY])
def test_the_damper_of_a_contact(law):
    As, damping = np.array([5.0, A]), Damping(np.array([0.3, 0.4]), law, np.ones(2))
    F = 0.9
    damper = 0.4 * F if law == laws.HUNT_CROSSLEY else 0.4
    assert laws.damper(1, True, 0.0, As, None, None, damping, None) == 0.0
    assert laws.damper(1, True, -F, As, None, None, damping, None) == 0.0
    assert near(laws.damper(1, True, F, As, None, None, damping, None), damper)
    assert near(laws.damper(1, False, F, As, None, 0.5, damping, None), damper)
    shared = damper * laws.spring_share(laws.contact_stiffness(1, F, As, None, None), 0.5)[0]
    assert near(laws.damper(1, True, F, As, None, 0.5, damping, None), shared)


# --- a wall that creeps --------------------------------------------------------------------------


def creeping(d, dt, s, mobility):
    """d' (1 + 3/2 s A sqrt(d)) = -mobility A d^(3/2); with it the work on the dashpot."""

    def rate(_, y):
        F = A * max(y[0], 0.0) ** 1.5
        return [-mobility * F / (1 + 1.5 * s * A * math.sqrt(y[0])), mobility * F, mobility * F**2]

    solution = solve_ivp(rate, (0, dt), [d, 0, 0], "DOP853", rtol=1e-13, atol=1e-16)
    return solution.y[:, -1]


@pytest.mark.parametrize("s", [None, 0.4, -0.1])
@pytest.mark.parametrize("mobility", [0.2, 30.0])
def test_a_dashpot_creeps_as_its_equation_says(s, mobility):
    d, dt = 0.35, 0.6
    indentation, moved, work = creeping(d, dt, s or 0.0, mobility)
    assert near(laws.dashpot_indentation(d, dt, A, s, mobility), indentation, 1e-10)
    assert laws.dashpot_indentation(0.0, dt, A, s, mobility) == 0.0
    assert laws.dashpot_indentation(-d, dt, A, s, mobility) == 0.0
    motion = a_motion(1)
    motion.wall[DASH], motion.ledger[IN_WALL] = 2.0, 3.0
    mean = laws.creep(d, dt, A, motion, s, mobility)
    assert near(mean, moved / (mobility * dt), 1e-10)
    assert near([motion.wall[DASH] - 2.0, motion.ledger[IN_WALL] - 3.0], [moved, work], 1e-9)


def a_motion(n):
    return Motion(np.zeros(n), np.zeros(n), np.zeros(n + 1), np.zeros(4), np.zeros(3))


@pytest.mark.parametrize("s", [None, 0.4])
def test_the_force_at_a_wall_is_that_of_the_gap_to_where_it_is(s):
    motion, As = a_motion(2), np.array([5.0, A])
    motion.x[:], motion.wall[U], motion.wall[DASH] = [0.9, 0.8], 0.2, 0.1
    contact = plastic([0.1, 0.15])
    gap = 0.8 - 0.2 - 0.1 - 0.05
    hertz = laws.hertz_force(laws.wall_indentation(0, gap, np.array([A]), s, None), A)
    assert near(laws.wall_force(0.3, motion, As, 0.05, None, s, None, None), hertz)
    d = laws.plastic_indentation(len(As) - 1, gap, As, s, contact)
    yielded = laws.plastic_force(1, d, As, contact)
    assert near(laws.wall_force(0.3, motion, As, 0.05, None, s, None, contact), yielded)
    start = laws.wall_indentation(0, gap, np.array([A]), s, None)
    mean = laws.wall_force(0.3, motion, As, 0.05, None, s, 0.7, None)
    assert near(mean, creeping(start, 0.3, s or 0.0, 0.7)[1] / (0.7 * 0.3), 1e-10)


# --- damping -------------------------------------------------------------------------------------


@pytest.mark.parametrize("w", [0.8, -0.3, -40.0])
@pytest.mark.parametrize("c", [1e-9, 0.04, 2.0, 300.0])
@pytest.mark.parametrize("clipped", [True, False])
def test_a_damper_gives_the_impulse_of_its_equation(w, c, clipped):
    """w' = -max(c w, -F) / m at a frozen force; unclipped it may pull."""
    force, dt, pair = 1.3, 0.25, 1.6
    low = -force if clipped else -np.inf

    def rate(_, y):
        return [-pair * max(c * y[0], low), max(c * y[0], low)]

    exact = solve_ivp(rate, (0, dt), [w, 0.0], "LSODA", rtol=1e-12, atol=1e-15, max_step=dt / 50)
    result = laws.damping_impulse(w, dt, force, c, pair, clipped)
    assert near(result, exact.y[1, -1], 1e-6 if clipped and w < 0 else 1e-9)


def test_formulas_of_weak_and_strong_dampers_agree_where_both_hold():
    """Either side of the change from the series to expm1."""
    for z in (0.0199, 0.0201, -0.0199):
        exact = -0.7 * math.expm1(-z) / 1.6
        impulse = laws.damping_impulse(0.7, 0.25, 1.3, z / (1.6 * 0.25), 1.6, False)
        assert near(impulse, exact, 1.5e-15)


def test_a_clipped_damper_back_in_time_takes_all_of_the_force():
    assert laws.damping_impulse(-9.0, -0.2, 1.3, 2.0, 1.0, True) == pytest.approx(1.3 * 0.2)
    assert laws.damping_impulse(-9.0, 0.2, 0.0, 2.0, 1.0, True) == 0.0


# --- oscillators, modes --------------------------------------------------------------------------

OSCILLATORS = [
    (2.0, 0.0), (2.0, 0.3), (2.0, 1.0), (2.0, 1.0 + 1e-7), (2.0, 1.0 - 1e-7), (2.0, 7.0),
    (0.0, 0.0), (1e-3, 0.2), (1e-3, 1.4), (40.0, 0.01),
]  # fmt: skip


@pytest.mark.parametrize(("omega", "zeta"), OSCILLATORS)
def test_a_free_oscillator_moves_by_the_exponential_of_its_matrix(omega, zeta):
    companion = np.array([[0.0, 1.0], [-(omega**2), -2 * zeta * omega]])
    for t in (0.37, -0.1):
        E = np.array(oscillators.propagator(omega, zeta, t)).reshape(2, 2)
        np.testing.assert_allclose(E, expm(companion * t), rtol=2e-12, atol=1e-13)


@pytest.mark.parametrize(("omega", "zeta"), [(9.9e-4, 0.0), (1e-6, 990.0)])
def test_slow_oscillators_are_moved_by_series_to_rounding(omega, zeta):
    """Sine and cosine of z = 9.9e-4, or sinh and cosh: one term less would leave 1e-14."""
    z = omega * math.sqrt(abs(1 - zeta**2))
    c, s = (math.cosh(z), math.sinh(z)) if zeta else (math.cos(z), math.sin(z))
    fade, decay = math.exp(-zeta * omega), zeta * omega
    E = oscillators.propagator(omega, zeta, 1.0)
    exact = c + decay * s / z, s / z, -(omega**2) * s / z, c - decay * s / z
    assert near(E, fade * np.array(exact), 1e-15)


@pytest.mark.parametrize(("omega", "zeta"), OSCILLATORS)
def test_a_unit_force_moves_an_oscillator_by_the_integral_of_its_impulses(omega, zeta):
    for t in (0.37, 1.6):
        exact = quad(lambda s: oscillators.propagator(omega, zeta, s)[1], 0, t, epsrel=1e-13)[0]
        response = oscillators.step_response(np.array([omega]), np.array([zeta]), t)
        assert near(response[0], exact, 1e-10)


def test_drifts_of_a_palindrome_are_those_of_each_step():
    omega, zeta = np.array([2.0, 5.0, 0.0]), np.array([0.1, 1.2, 0.0])
    for steps in ([0.1, 0.4, 0.4, 0.1], [0.1, 0.3, 0.1], [0.1, 0.2, 0.3]):
        E = oscillators.propagators(np.array(steps), omega, zeta)
        for k, t in enumerate(steps):
            np.testing.assert_array_equal(E[k], oscillators.oscillator_propagator(omega, zeta, t))


def test_an_impulse_at_the_wall_does_the_work_of_the_mean_velocity():
    """W = J (w + w') / 2; the wall moves by phi phi J. A shift changes places in the same way."""
    phi = np.array([0.4, -0.7, 0.1])
    q, p = np.array([0.3, 0.2, -0.5]), np.array([1.0, -2.0, 0.5])
    modes = WallModes(q.copy(), p.copy(), phi, *[None] * 4, float(phi @ phi), 0.0)
    wall, J = np.array([phi @ q, phi @ p, 0.0, 0.25]), 0.6
    push_modes(J, wall, modes)
    np.testing.assert_allclose(modes.p, p + phi * J, rtol=1e-14)
    assert near(wall[1], phi @ modes.p) and wall[2] == 0.0
    assert near(wall[3] - 0.25, 0.5 * (modes.p @ modes.p - p @ p))
    shift_modes(0.3, wall, modes)
    np.testing.assert_allclose(modes.q, q + phi * 0.3, rtol=1e-14)
    assert near(wall[0], phi @ modes.q)
    start = wall.copy()
    push_modes(J, wall, None)
    shift_modes(J, wall, None)
    np.testing.assert_array_equal(wall, start)


# --- contacts that open or close within a step ---------------------------------------------------

CUBICS = [(-0.2, 0.9, 0.5, 0.6), (0.4, -0.1, -0.3, -1.2), (-0.1, 0.05, 0.02, 0.4), (0.3, 2, -1, -5),
          (1.0, -0.4, -0.3, -1.2)]  # fmt: skip


@pytest.mark.parametrize(("g0", "r0", "g1", "r1"), CUBICS)
def test_the_crossing_of_a_step_is_the_root_of_its_cubic(g0, r0, g1, r1):
    rows = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [1, 1, 1, 1], [0, 1, 2, 3]])
    cubic = np.polynomial.Polynomial(np.linalg.solve(rows, [g0, r0, g1, r1]))
    t, slope, curvature = events.crossing(g0, r0, g1, r1)
    assert 0 < t < 1 and abs(cubic(t)) < 1e-12
    assert near([slope, curvature], [cubic.deriv()(t), cubic.deriv(2)(t)], 1e-10)


def test_a_step_that_starts_on_the_edge_crosses_there():
    t, slope, curvature = events.crossing(0.0, 0.4, 0.5, 0.9)
    assert (t, slope) == (0.0, 0.4)
    assert near(curvature, 2 * (3 * 0.5 - 2 * 0.4 - 0.9))


@pytest.mark.parametrize("name", ["rkn6", "suzuki4", "split4"])
def test_zeta_sums_are_those_of_hurwitz_over_all_nodes_behind_the_crossing(name):
    """sum b zeta(-p, a), a the way of a node behind the crossing; nodes before it count from the
    next step on."""
    correction = SCHEMES[name].correction
    b, c = correction.weights, correction.nodes
    for theta in (0.07, 0.5, 0.93):
        away = np.where(c > theta, c - theta, c - theta + 1)
        exact = [b @ [hurwitz_zeta(p, a) for a in away] for p in (1.5, 2.5, 3.5)]
        # the polynomials of degree 14 miss 8.7e-12; rounding moves that by less than 1e-13
        np.testing.assert_allclose(events.zeta_sums(theta, correction), exact, rtol=0, atol=1e-11)


@pytest.mark.parametrize("closes", [True, False])
def test_the_missed_impulse_is_that_of_the_exact_integral(closes):
    """Impulse of A g^(3/2), g a parabola with a zero, by the nodes of a step and those around it,
    where the force is smooth, against its integral: of h = 1e-3 the next term is of order 1e-9."""
    scheme, h, A, zero = SCHEMES["rkn6"], 1e-3, 2.0, 0.4
    sign = 1.0 if closes else -1.0

    def gap(t):
        u = sign * (t / h - zero) * h
        return 1.5 * u + 20.0 * u * u

    def rate(t):
        u = sign * (t / h - zero) * h
        return sign * (1.5 + 40.0 * u)

    impulse, shift, speed = events.missed_impulse(
        A, h, gap(0), rate(0), gap(h), rate(h), scheme.correction
    )
    starts = h * np.arange(-40, 41)
    times = starts[:, None] + h * scheme.correction.nodes
    end = starts[-1] + h
    force = A * np.maximum(np.where(sign * (times - zero * h) > 0, gap(times), 0), 0) ** 1.5
    first, last = (zero * h, end) if closes else (starts[0], zero * h)
    tolerances = {"epsabs": 1e-18, "epsrel": 1e-12}
    exact = quad(lambda t: A * max(gap(t), 0) ** 1.5, first, last, **tolerances)[0]
    lever = quad(lambda t: A * max(gap(t), 0) ** 1.5 * (h - t), first, last, **tolerances)[0]
    given = h * (force @ scheme.correction.weights).sum()
    arms = h * ((force * (h - times)) @ scheme.correction.weights).sum()
    assert near(impulse, exact - given, 1e-3)
    assert near(shift, lever - arms, 1e-3)
    assert near(speed, rate(zero * h), 1e-9)


@pytest.mark.parametrize("closes", [True, False])
@pytest.mark.parametrize("bent", [-4.0, -0.3, 0.9, 6.0])
def test_the_missed_impulse_of_a_grazing_contact_is_bounded(bent, closes):
    """-A h slope^(3/2) (z3 + bend z5), bend = 3/4 of curvature over slope, within 1; and its moment
    at the end of the step."""
    correction, h, A, zero = SCHEMES["rkn6"].correction, 0.2, 1.7, 0.3
    sign = 1.0 if closes else -1.0
    slope = 0.6 * sign
    curvature = bent * abs(slope) / 0.75
    third = sign * (3.0 + abs(curvature))
    cubic = np.polynomial.Polynomial([0.0, slope, curvature / 2, third])
    ends = [value for t in (-zero, 1 - zero) for value in (cubic(t), cubic.deriv()(t) / h)]
    missed = events.missed_impulse(A, h, *ends, correction)
    z = events.zeta_sums(zero if closes else 1 - zero, correction)
    bend, size = np.clip(bent, -1, 1), A * h * 0.6**1.5
    impulse, moment = -(z[0] + bend * z[1]), -(z[1] + bend * z[2])
    exact = size * impulse, h * size * ((1 - zero) * impulse - sign * moment), slope / h
    np.testing.assert_allclose(missed, exact, rtol=1e-9)


def test_a_contact_that_only_grazes_misses_nothing():
    correction = SCHEMES["rkn6"].correction
    assert events.missed_impulse(1.0, 0.1, 0.0, 0.0, 0.3, 9.0, correction) == (0.0, 0.0, 0.0)
    assert events.missed_impulse(1.0, 0.1, 0.0, -1.0, 0.3, 9.0, correction) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(("g0", "r0", "g1", "r1"), [(0.1, 2.0, 0.3, -4.0), (0.3, 5.0, 0.1, -1.0)])
def test_the_peak_of_a_step_is_that_of_its_cubic(g0, r0, g1, r1):
    dt = 0.25
    s = np.linspace(0, 1, 20001)
    cubic = dense.cubic(s, dt, g0, r0, g1, r1)
    assert near(events.peak(dt, g0, r0, g1, r1), cubic.max(), 1e-7)
    assert events.peak(dt, g0, -r0, g1, r1) == events.peak(dt, g0, r0, g1, -r1) == max(g0, g1)


@pytest.mark.parametrize("crater", [0.0, 0.02])
@pytest.mark.parametrize("walled", [True, False])
def test_each_contact_that_opens_or_closes_is_noticed(crater, walled):
    """Overlaps 0.1, 0.1 and 0.05 behind a wall moved by 0.03 in all."""
    As = np.ones(3 if walled else 2)
    shape = None if crater == 0 else Plastic(*np.full((3, 3), 0.3), np.full(3, crater))

    def state(*overlaps):
        motion = a_motion(3)
        motion.x[:] = np.cumsum(overlaps[::-1])[::-1]
        motion.x[:] += 0.03
        motion.wall[U], motion.wall[DASH] = 0.02, 0.004
        return motion

    def moved(*overlaps):
        start, end = state(0.1, 0.1, 0.05), state(*overlaps)
        first, second = (events.crossed(*pair, As, 0.006, shape) for pair in
                    ((end, start), (start, end)))  # fmt: skip
        assert first == second
        return first

    assert not moved(0.2, 0.03, 0.03)
    assert moved(crater - 1e-3, 0.1, 0.05) and moved(0.1, crater - 1e-3, 0.05)
    assert moved(0.1, 0.1, crater - 1e-3) == walled


# --- friction, passages, steps -------------------------------------------------------------------


@pytest.mark.parametrize("v", [1.0, -1.0, 0.0, 0.05, -0.05])
@pytest.mark.parametrize("a", [0.0, 0.2, -0.2, 0.9, -0.9])
def test_a_body_slides_stops_and_stays_as_coulomb_says(v, a):
    """By many small steps of the friction that opposes; it stays where the push is below it."""
    b, dt, n = 0.4, 0.7, 20000
    h, now, way = dt / n, v, 0.0
    for _ in range(n):
        sticks = abs(now) <= b * h and abs(a) <= b
        rate = a - math.copysign(b, now if now else a)
        new = 0.0 if sticks or (now == 0 and abs(a) <= b) else now + h * rate
        way += 0.5 * h * abs(now + new)
        now = new
    end, gone = explicit.slid(v, dt, a, b)
    assert abs(end - now) < 2e-4 and abs(gone - way) < 2e-4


def test_incident_and_reflected_waves_are_located_between_samples():
    """Two parabolas of either sign, tops at 20.3 and 60.6 samples, a smaller one between."""
    k = np.arange(100.0)
    wave = np.maximum(1 - ((k - 20.3) / 6) ** 2, 0) + 0.3 * np.maximum(1 - ((k - 40) / 4) ** 2, 0)
    two = np.maximum(0.7 - ((k - 60.6) / 6) ** 2, 0)
    out = np.empty((4, 4))
    passages.fill_passages(np.array([wave - two, wave, two - wave, 0 * wave]), 0.05, out)
    np.testing.assert_allclose(out[0], [20.3, 1.0, 60.6, -0.7], rtol=1e-12)
    np.testing.assert_allclose(out[1][:2], [20.3, 1.0], rtol=1e-12)
    assert np.isnan(out[1][2:]).all() and np.isnan(out[3]).all()
    np.testing.assert_allclose(out[2][:2], [60.6, 0.7], rtol=1e-12)
    assert np.isnan(out[2][2:]).all()


def test_waves_are_found_whatever_their_size_and_not_at_the_ends_of_a_record():
    k, out = np.arange(40.0), np.empty((4, 4))
    crest = np.maximum(1 - ((k - 1.2) / 6) ** 2, 0)
    last = np.maximum(1 - ((k - 37.9) / 6) ** 2, 0)
    begins = np.maximum(1 - (k / 6) ** 2, 0)
    rows = 0.02 * np.array([crest - 0.5 * last, begins, begins[::-1], begins - 0.5 * last])
    passages.fill_passages(rows, 0.2, out)
    np.testing.assert_allclose(out[0], [1.2, 0.02, 37.9, -0.01], rtol=1e-12)
    assert np.isnan(out[1:]).all()
    small = np.array([np.maximum(1 - ((k - 20.3) / 6) ** 2, 0) - 0.3 * last])
    for threshold, visible in ((0.29, True), (0.31, False)):
        passages.fill_passages(small, threshold, out[:1])
        assert np.isnan(out[0, 2]) == (not visible) and near(out[0, 0], 20.3)


def test_polynomials_of_a_step_are_their_own_interpolation():
    """Of degree five from position, velocity and acceleration, of three from value and slope."""
    five = np.polynomial.Polynomial([0.3, -1.0, 2.0, 0.7, -0.4, 0.9])
    three, h = five.cutdeg(3), 0.8
    places = [
        dense.StepEnd(*(five.deriv(k)(t) if k else five(t) for k in range(3))) for t in (0, h)
    ]
    for s in (0.0, 0.2, 0.5, 0.9, 1.0):
        assert abs(dense.quintic(s, h, *places) - five(s * h)) < 1e-13
        assert abs(dense.quintic_slope(s, h, *places) - five.deriv()(s * h)) < 1e-13
        ends = (three(0), three.deriv()(0), three(h), three.deriv()(h))
        assert abs(dense.cubic(s, h, *ends) - three(s * h)) < 1e-13
        assert abs(dense.cubic_slope(s, h, *ends) - three.deriv()(s * h)) < 1e-13
    t = h * np.arange(4)
    x, v, a = (np.column_stack([five.deriv(k)(t) if k else five(t)] * 2) for k in range(3))
    out, line = np.empty((10, 2)), np.empty(10)
    dense.fill_slopes(x, v, a, h, out)
    at = np.linspace(0, 3 * h, 10)
    np.testing.assert_allclose(out, np.column_stack([five.deriv()(at)] * 2), atol=1e-12)
    dense.fill_values(three(t), h * three.deriv()(t), line)
    np.testing.assert_allclose(line, three(at), atol=1e-12)


def test_samples_lie_in_the_steps_that_they_fall_into():
    """Of three steps that are no one polynomial; the last sample ends the last step."""
    rng = np.random.default_rng(2)
    (x, v, a), h, n = rng.standard_normal((3, 4, 2)), 0.8, 10
    slopes, line = np.empty((n, 2)), np.empty(n)
    dense.fill_slopes(x, v, a, h, slopes)
    dense.fill_values(x[:, 0], h * v[:, 0], line)
    for k in range(n):
        i = min(k // 3, 2)
        s = k / 3 - i
        for j in range(2):
            first, second = (dense.StepEnd(x[e, j], v[e, j], a[e, j]) for e in (i, i + 1))
            assert near(slopes[k, j], dense.quintic_slope(s, h, first, second), 1e-10)
        value = dense.cubic(s, h, x[i, 0], v[i, 0], x[i + 1, 0], v[i + 1, 0])
        assert near(line[k], value, 1e-10)


@pytest.mark.parametrize("bad", [np.inf, np.nan, -np.inf])
def test_the_first_number_that_is_not_finite_is_named(bad):
    with pytest.raises(InvalidChain, match=rf"^speeds\[1\] is {bad:g}; it must be finite$"):
        vector("speeds", [1.0, bad, bad], 3)


def test_a_number_at_its_bound_is_allowed_and_one_below_is_named():
    assert vector("gamma", [1.0, 2.0, 0.5], 3, at_least=0.5)[2] == 0.5
    with pytest.raises(InvalidChain, match=r"^gamma\[2\] is 0.5; .* at least 0.6"):
        vector("gamma", [1.0, 2.0, 0.5], 3, at_least=0.6)
    with pytest.raises(InvalidChain, match=r"^mass\[0\] is 0; it must be finite and above 0"):
        vector("mass", [0.0, 2.0], 2, positive=True)


def test_the_fastest_contact_has_all_energy_on_top_of_its_static_force():
    """E = 2/5 A delta^(5/2); a mode below the contact's frequency is a body, above it a spring."""
    mass, As, force = np.array([1.0, 2.0]), np.array([3.0, 4.0]), np.array([0.5, 0.2])
    omega, phi = np.array([0.5, 1.0, 50.0]), np.array([0.6, -0.8, 5.0])
    depth = (2.5 * 0.7 / As) ** 0.4 + (force / As) ** (2 / 3)
    k = 1.5 * As * np.sqrt(depth)
    exact = np.sqrt(max(k[0] * 1.5, k[1] * (0.5 + 0.36 + 0.64)))
    chain, wall = (
        SimpleNamespace(mass=mass, A=As, elastic=ElasticLaw(As)),
        SimpleNamespace(omega=omega, phi=phi),
    )
    prepared = SimpleNamespace(chain=chain, wall=wall, pressed=force)
    assert near(fastest_rate(prepared, [np.sqrt(1.4), 0.0]), exact)


# --- static states -------------------------------------------------------------------------------


def room(n):
    """Zeros that Newton's method for n spheres at rest works on."""
    return NewtonRoom(np.zeros(n + 1), *np.zeros((5, n)))


@pytest.mark.parametrize("compliance", [0.0, 0.3, -0.02])
def test_newtons_rest_balances_every_sphere(compliance):
    As, stiffness = np.array([1.0, 3.0, 2.0]), np.array([0.2, 0.0, 5.0])
    anchor, steady = np.array([0.4, 0.0, -0.1]), np.array([0.1, 0.0, 0.6])
    x = np.array([0.5, 0.2, 0.1])
    unbalanced = rest(x, Bearing(As, stiffness, anchor, steady, compliance), 1e-3, 60, room(x.size))
    d = brentq(lambda d: d + compliance * 2.0 * d**1.5 - x[2], 0, 2) if x[2] > 0 else 0.0
    F = As * np.r_[np.maximum(x[:2] - x[1:], 0), d] ** 1.5
    net = np.r_[0, F[:2]] - F - stiffness * (x - anchor) + steady
    assert unbalanced < 1e-13 and np.abs(net).max() < 1e-13 and F.min() > 1e-3


def test_a_free_chain_rests_between_its_springs():
    stiffness, anchor = np.array([0.5, 0.2]), np.array([1.0, -0.5])
    x = np.array([0.6, 0.1])
    unbalanced = rest(
        x, Bearing(np.ones(1), stiffness, anchor, np.zeros(2), 0.0), 1e-3, 60, room(2)
    )
    F = (x[0] - x[1]) ** 1.5
    assert (
        unbalanced < 1e-14 and np.abs(stiffness * (x - anchor) + [F, -F]).max() < 1e-14 and F > 0.01
    )


# --- mean forces of the implicit march ------------------------------------------------------------

ENDS = [(0.2, 0.5), (0.5, 0.2), (0.3, 0.3 + 1e-12), (-0.2, 0.4), (0.4, -0.2), (-0.3, -0.1)]


def energy_of_gap(gap, s):
    d = laws.hertz_indentation(gap, A, s)
    F = A * d**1.5
    return 0.4 * F * d + 0.5 * s * F * F


@pytest.mark.parametrize("s", [0.0, 0.6, -0.05])
@pytest.mark.parametrize(("g0", "g1"), ENDS)
def test_a_mean_force_is_the_change_of_energy_over_that_of_the_gap(g0, g1, s):
    def mean(g1):
        return mean_series(0, g0, g1, s, np.array([A]), None) if s else mean_hertz(g0, g1, A)

    force, slope = mean(g1)
    middle = A * laws.hertz_indentation(g0, A, s) ** 1.5
    change = energy_of_gap(g1, s) - energy_of_gap(g0, s)
    exact = middle if abs(g1 - g0) < 1e-9 else change / (g1 - g0)
    # of two places 1e-12 apart the middle is off by half of that, times the stiffness
    assert abs(force - exact) < 1e-11
    h = 1e-5
    both = g0 > 0 and g1 > 0 and s  # Newton's method is content with less there
    assert abs(slope - (mean(g1 + h)[0] - mean(g1 - h)[0]) / (2 * h)) < (0.01 if both else 1e-8)


@pytest.mark.parametrize(("g0", "g1"), ENDS)
def test_the_share_of_a_step_that_a_contact_is_closed_for(g0, g1):
    s = np.linspace(0, 1, 100001)
    share, slope = closed_share(g0, g1)
    assert abs(share - np.mean(g0 + s * (g1 - g0) > 0)) < 2e-5
    h = 1e-6
    assert abs(slope - (closed_share(g0, g1 + h)[0] - closed_share(g0, g1 - h)[0]) / (2 * h)) < 1e-8


@pytest.mark.parametrize("z", [0.1, 3.0, 40.0, -2.0])
def test_a_strong_damper_reads_the_velocity_at_the_end_of_a_step(z):
    """It leaves near exp(-4) of the speed at z = 4; a weak one stays in the middle."""
    ahead, slope = lead(z)
    h = 1e-5
    assert near(slope, (lead(z + h)[0] - lead(z - h)[0]) / (2 * h), 1e-6)
    assert ahead == -lead(-z)[0] and 0 < abs(ahead) < 0.5
    at = lead(4.0)[0]
    assert near((1 - 2 + 4 * at) / (1 + 2 + 4 * at), math.exp(-4), 0.02)
    # 0.01^3 / (2 LEAD) = 9.1e-9
    assert lead(1e4)[0] == pytest.approx(0.5, rel=1e-6) and lead(0.01)[0] < 1e-8


@pytest.mark.parametrize("s", [None, 0.6])
@pytest.mark.parametrize(("g0", "g1"), [(0.2, 0.5), (0.5, 0.2), (-0.2, 0.4), (0.4, -0.2)])
@pytest.mark.parametrize("law", [laws.LINEAR, laws.LINEAR_CLIPPED, laws.HUNT_CROSSLEY])
@pytest.mark.parametrize("compliance", [1e-3, 0.02])
def test_a_damped_mean_force_adds_the_damper_and_has_its_slope(compliance, law, g0, g1, s):
    """c (rate + 2 ahead (rate - w0)) beside the elastic part; light bodies are not led."""
    As, damping = np.array([5.0, A]), Damping(np.array([0.3, 0.4]), law, np.full(2, 2.0))
    dt, w0 = 0.1, 0.2

    def force(g1):
        over = Passage(1, True, g0, g1, w0, compliance)
        return mean_force(over, 1 / dt, As, None, s, damping)

    mean, slope, elastic = force(g1)
    exact = mean_series(0, g0, g1, s, np.array([A]), None)[0] if s else mean_hertz(g0, g1, A)[0]
    assert near(elastic, exact)
    assert force(g1)[0] == mean and mean_force(
        Passage(1, True, g0, g1, w0, compliance), 1 / dt, As, None, s, None
    )[::2] == (elastic, elastic)
    c = 0.4 * elastic if law == laws.HUNT_CROSSLEY else 0.4
    if s:
        c *= laws.spring_share(laws.contact_stiffness(1, elastic, As, None, None), s)[0]
    led = compliance / dt**2 > 0.75
    assert led is (compliance > 0.01)
    ahead = lead(2 * c * compliance / dt)[0] if led else 0.0
    closed = 1.0 if law == laws.HUNT_CROSSLEY else closed_share(g0, g1)[0]
    rate = (g1 - g0) / dt
    total = elastic + c * closed * (rate + 2 * ahead * (rate - w0))
    assert near(mean, total if law == laws.LINEAR else max(total, 0.0))
    h = 1e-5
    numeric = (force(g1 + h)[0] - force(g1 - h)[0]) / (2 * h)
    if s is None or (law == laws.HUNT_CROSSLEY and mean == 0.0):
        assert abs(slope - numeric) < 1e-7


def test_the_strength_of_a_damper_is_capped_at_ten_thousand_stops_a_step():
    As, compliance, dt = np.array([A]), 0.02, 0.1
    damping = Damping(np.array([1e12]), laws.LINEAR, np.ones(1))
    mean = mean_force(
        Passage(0, False, 0.3, 0.4, 0.0, compliance), 1 / dt, As, None, None, damping
    )[0]
    stops = 2 * compliance / dt
    strongest = laws.STOPPED / stops
    assert near(mean, strongest * (1 + 2 * lead(laws.STOPPED)[0]), 1e-3)
    elastic = mean_hertz(0.3, 0.4, A)[0]
    for share in (0.3, 0.999, 1.001, 3.0):
        for law in (laws.LINEAR, laws.HUNT_CROSSLEY):
            c = share * strongest / (elastic if law == laws.HUNT_CROSSLEY else 1.0)
            damping = Damping(np.array([c]), law, np.ones(1))
            over = Passage(0, False, 0.3, 0.4, 0.0, compliance)
            mean, slope, _ = mean_force(over, 1 / dt, As, None, None, damping)
            strength = min(share, 1.0)
            assert near(
                mean, elastic + strength * strongest * (1 + 2 * lead(strength * laws.STOPPED)[0])
            )
            h = 1e-6
            up, down = (
                mean_force(over._replace(g1=0.4 + e), 1 / dt, As, None, None, damping)[0]
                for e in (h, -h)
            )
            assert near(slope, (up - down) / (2 * h), 1e-5)


def tangent(diagonal, k):
    """A chain of contacts of the stiffness k, the last one at a wall."""
    n = len(diagonal)
    K = np.diag(diagonal)
    for i, stiffness in enumerate(k):
        K[i, i] += stiffness
        if i + 1 < n:
            K[i + 1, i + 1] += stiffness
            K[i, i + 1] = K[i + 1, i] = -stiffness
    return K


@pytest.mark.parametrize("walled", [True, False])
def test_newton_changes_solve_the_tangent_system(walled):
    rng = np.random.default_rng(1)
    n = 5
    k, r = rng.uniform(1, 3, n), rng.standard_normal(n)
    k[-1] *= walled
    stiffness, change = rng.uniform(0, 0.2, n), np.zeros(n)
    newton_step(stiffness, k, r, 0.03, np.zeros(n), change)
    np.testing.assert_allclose(tangent(stiffness + 0.03, k) @ change, r, atol=1e-13)
    contacts = n if walled else n - 1
    compliance, residual = rng.uniform(0.1, 0.5, n + 1), rng.standard_normal(n + 1)
    work = workspace(n, contacts)[1]
    work.residual[:], work.slope[:contacts] = residual, k[:contacts]
    newton_change(compliance, work)
    exact = np.eye(n + 1) + compliance[:, None] * tangent(np.zeros(n + 1), k[:contacts])
    np.testing.assert_allclose(exact @ work.residual, residual, atol=1e-13)


@pytest.mark.parametrize("compliance", [0.0, 0.4])
def test_the_slope_of_every_contact_at_rest_is_that_of_its_force(compliance):
    x, As, k = np.array([0.5, 0.2, 0.1]), np.array([1.0, 3.0, 2.0]), np.zeros(3)
    none = np.zeros(3)
    static_slope(x, As, compliance, None, k)

    def forces(x):
        f, r = np.zeros(4), np.zeros(3)
        static_residual(x, Bearing(As, none, none, none, compliance), None, f, r)
        return f[1:]

    h = 1e-6
    for i in range(3):
        step = h * np.eye(3)[i]
        numeric = (forces(x + step)[i] - forces(x - step)[i]) / (2 * h)
        assert near(k[i], numeric, 1e-8)


def test_a_chain_that_is_at_rest_stays_there():
    x, none = np.array([0.1, 0.2]), np.zeros(2)
    assert rest(x, Bearing(np.ones(1), none, none, none, 0.0), 1e-3, 60, room(2)) == 0.0
    np.testing.assert_array_equal(x, [0.1, 0.2])


def test_open_contacts_at_rest_have_no_slope_and_no_force():
    x, As, none = np.array([0.1, 0.2, -0.3]), np.array([1.0, 3.0, 2.0]), np.zeros(3)
    k, f, r = np.ones(3), np.ones(4), np.ones(3)
    static_slope(x, As, 0.4, None, k)
    np.testing.assert_array_equal(k[[0, 2]], [0.0, 0.0])
    assert near(k[1], 4.5 * math.sqrt(0.5))
    f[0] = 0.0
    static_residual(np.array([0.1, 0.2, -0.3]), Bearing(As, none, none, none, 0.4), None, f, r)
    assert f[1] == f[3] == 0.0 and near(f[2], 3.0 * 0.5**1.5)
    assert near(r, [0.0, -f[2], f[2]])


# --- whole chains --------------------------------------------------------------------------------

MODAL = Wall(np.array([0.7, 3.0, 11.0]), np.array([0.02, 0.3, 1.4]), np.array([-0.5, 0.4, 0.7]))
SPRUNG, BACKED = (wall._replace(residual_compliance=0.2) for wall in (MODAL, rigid_wall()))
HELD = {
    "leaf_stiffness": np.array([0.4, 0.1, 0.2]), "leaf_anchor": np.array([0.9, 0.1, 0.1]),
    "preload": 0.2,
}  # fmt: skip


def damped(law, gamma):
    return {"dissipation": law, "gamma": np.array([1.0, 0.7, 1.3]) * gamma}


YIELDS = {"yield_overlap": np.array([0.2, 0.25, 0.15])}
CASES = {
    "bare": (rigid_wall(), {}),
    "free": (None, {}),
    "modal": (MODAL._replace(residual_compliance=0.1), HELD),
    "modal-bare": (MODAL, {}),
    "hunt-crossley": (SPRUNG, HELD | damped("hunt-crossley", 0.3)),
    "linear": (MODAL, HELD | damped("linear", 0.2)),
    "linear-clipped": (BACKED, damped("linear-clipped", 0.3)),
    "dashpot": (dashpot_wall(0.4), {}),
    "dashpot-spring": (dashpot_wall(0.4)._replace(residual_compliance=0.3), {}),
    "yielding": (BACKED, YIELDS),
    "yielding-damped": (MODAL, YIELDS | damped("hunt-crossley", 0.2)),
}  # fmt: skip
MARCHES = [  # of velocities, ten times what is measured
    ("bare", "rkn6", 0.02, 1e-11), ("bare", "verlet", 0.005, 8e-5), ("bare", "energy4", 0.02, 2e-8),
    ("free", "rkn6", 0.02, 2e-8), ("free", "energy4", 0.02, 4e-8),
    ("modal", "rkn6", 0.02, 7e-9), ("modal", "energy4", 0.02, 2e-8),
    ("modal-bare", "rkn6a", 0.02, 1e-11), ("modal-bare", "energy4", 0.02, 2e-8),
    ("hunt-crossley", "suzuki4", 0.02, 1e-6), ("hunt-crossley", "energy4", 0.02, 2e-7),
    ("linear", "suzuki4", 0.01, 5e-4), ("linear", "energy4", 0.02, 5e-7),
    ("linear-clipped", "verlet", 0.005, 6e-3), ("linear-clipped", "energy4", 0.02, 2e-8),
    ("dashpot", "split4", 0.02, 2e-8), ("dashpot", "energy4", 0.02, 4e-8),
    ("dashpot-spring", "split4", 0.02, 6e-9), ("dashpot-spring", "energy4", 0.02, 2e-8),
    ("yielding", "suzuki4", 0.01, 1e-7), ("yielding-damped", "suzuki4", 0.01, 3e-7),
]  # fmt: skip


@pytest.fixture(scope="module")
def exact():
    """Velocities and forces of each case by DOP853, once."""
    solution, t = {}, np.linspace(0, 4.0, 9)

    def of(case):
        if case not in solution:
            wall, fields = CASES[case]
            solution[case] = by_formulas(row(wall, fields), wall, speeds(3), t)
        return solution[case]

    return of


def row(wall, fields):
    chain = unit_chain(3, None if wall is None else 1.5, **fields)
    mass = np.array([1.0, 0.8, 1.3])
    cut = {"gamma": fields["gamma"][: chain.A.size]} if "gamma" in fields else {}
    return chain._replace(mass=mass, **cut)


@pytest.mark.parametrize(("case", "scheme", "dt", "allowed"), MARCHES)
def test_a_march_is_the_solution_of_its_equations(exact, case, scheme, dt, allowed):
    wall, fields = CASES[case]
    run = march(row(wall, fields), wall, speeds(3), duration=4.0, dt=dt, scheme=scheme, n_save=8)
    right = exact(case)
    off = np.abs(run.v - right.v).max(), np.abs(run.contact_force - right.force).max()
    assert off[0] < allowed and off[1] < 3 * allowed
    conserved = scheme == "energy4"  # by construction, to rounding
    # kept: 200 steps of eps, 4e-14 if all add up
    assert run.energy_error < (1e-13 if conserved else allowed)


@pytest.mark.parametrize("dt", [1.0, 2.0, 0.5])
@pytest.mark.parametrize("sprung", [False, True])
def test_steps_of_verlet_are_kick_drift_kick(dt, sprung):
    """By hand, drifts and kicks as long as the unit of time among them."""
    fields = {"leaf_stiffness": np.array([0.04, 0.0, 0.03])} if sprung else {}
    chain = row(rigid_wall(), fields)._replace(A=0.01 * np.array([1.0, 2.0, 3.0]))
    run = march(chain, rigid_wall(), speeds(3), duration=6.0, dt=dt, scheme="verlet", n_save=3)
    x, v, k = run.x[0].copy(), speeds(3).astype(float), chain.springs[0]

    def kick(v):
        F = chain.A * np.maximum(np.append(x[:-1] - x[1:], x[-1]), 0.0) ** 1.5
        return v + 0.5 * dt * (np.append(0.0, F[:-1]) - F) / chain.mass

    omega = np.sqrt(k / chain.mass)
    sine = np.where(k > 0, np.sin(omega * dt) / np.where(k > 0, omega, 1.0), dt)
    for step in range(1, round(6.0 / dt) + 1):
        v = kick(v)
        x, v = np.cos(omega * dt) * x + sine * v, np.cos(omega * dt) * v - omega**2 * sine * x
        v = kick(v)
        if step * dt % 2.0 == 0.0:
            np.testing.assert_allclose(run.x[int(step * dt / 2.0)], x, rtol=1e-12, atol=1e-13)
            np.testing.assert_allclose(run.v[int(step * dt / 2.0)], v, rtol=1e-12, atol=1e-13)
    assert run.contact_force.max() > 1e-3


@pytest.mark.parametrize("law", ["linear", "linear-clipped"])
def test_saved_forces_cap_the_damper_at_what_a_step_resolves(law):
    """c w, with c m dt = 1e4 at the most, m of both bodies; no contact pulls but a linear one."""
    wall, dt = MODAL, 0.03
    fields = HELD | {"dissipation": law, "gamma": np.array([1e9, 0.4, 1e12])}
    chain, v = row(wall, fields), np.array([0.1, 0.3, -0.2])
    run = march(chain, wall, v, duration=dt, dt=dt, n_save=1, scheme="verlet")
    inverse = 1 / chain.mass + np.append(1 / chain.mass[1:], wall.phi @ wall.phi)
    c = np.minimum(fields["gamma"], 1e4 / (dt * inverse))
    elastic, w = equilibrium(chain, wall).force, np.append(v[:-1] - v[1:], v[-1])
    exact = elastic + c * w
    assert near(run.contact_force[0], exact if law == "linear" else np.maximum(exact, 0.0), 1e-8)
    assert exact.min() < -1.0


L, TAU, MU = 1e-6, 1e-5, 1e-2  # of length, time and mass: those of a chain of steel spheres
UNITS = {
    "A": MU / TAU**2 / L**0.5, "mass": MU, "preload": MU * L / TAU**2, "radius": L,
    "leaf_stiffness": MU / TAU**2, "leaf_anchor": L, "yield_overlap": L,
    "omega": 1 / TAU, "zeta": 1.0, "phi": MU**-0.5, "residual_compliance": TAU**2 / MU,
    "mobility": TAU / MU,
}  # fmt: skip
LOSS = {"hunt-crossley": TAU / L, "linear": MU / TAU, "linear-clipped": MU / TAU, "none": 1.0}


def in_small_units(part, loss=1.0):
    """A chain or a wall."""
    given = {name: getattr(part, name, None) for name in (*UNITS, "gamma")}
    return part._replace(**{
        name: value * (UNITS | {"gamma": loss})[name]
        for name, value in given.items() if value is not None
    })  # fmt: skip


@pytest.mark.parametrize(("case", "scheme"), [
    ("modal", "energy4"), ("hunt-crossley", "energy4"), ("linear", "energy4"),
    ("dashpot-spring", "energy4"), ("modal", "rkn6"), ("hunt-crossley", "suzuki4"),
    ("linear-clipped", "suzuki4"), ("dashpot-spring", "split4"), ("yielding-damped", "suzuki4"),
])  # fmt: skip
def test_a_march_is_the_same_in_any_units(case, scheme):
    """Lengths of micrometres, times of 10 us, masses of 10 g: the same velocities to rounding."""
    wall, fields = CASES[case]
    chain = row(wall, fields)
    run = march(chain, wall, speeds(3), duration=2.0, dt=0.04, scheme=scheme, n_save=5)
    small = march(
        in_small_units(chain, LOSS[chain.dissipation]), in_small_units(wall), speeds(3) * L / TAU,
        duration=2.0 * TAU, dt=0.04 * TAU, scheme=scheme, n_save=5,
    )  # fmt: skip
    np.testing.assert_allclose(small.v * TAU / L, run.v, rtol=0, atol=1e-12)
    force = small.contact_force * TAU**2 / (MU * L)
    np.testing.assert_allclose(force, run.contact_force, rtol=0, atol=1e-11)
    assert small.energy_error < (1e-13 if scheme == "energy4" else run.energy_error + 1e-12)


def test_states_of_rest_are_those_of_the_equations():
    wall, fields = CASES["modal"]
    chain = row(wall, fields)
    static, (x, q) = equilibrium(chain, wall), at_rest(chain, wall)
    np.testing.assert_allclose(static.x, x, rtol=1e-9)
    np.testing.assert_allclose(static.q, q, rtol=1e-9)


def test_energies_are_those_of_the_saved_states():
    wall, fields = CASES["modal"]
    chain = row(wall, fields)
    run = march(chain, wall, speeds(3), duration=4.0, dt=0.02, scheme="rkn6", n_save=8)
    k, anchor = chain.springs
    F, rest = run.contact_force, equilibrium(chain, wall)
    d = (F / chain.A) ** (2 / 3)
    assert near(run.energy_kinetic, 0.5 * run.v**2 @ chain.mass)
    assert near(run.energy_contact, 0.4 * (F * d).sum(axis=1), 1e-11)
    assert near(run.energy_leaf, 0.5 * (run.x - anchor) ** 2 @ k)
    assert near(run.energy_residual, 0.05 * F[:, -1] ** 2)
    assert near(run.work_preload[1:], 0.2 * (run.x[1:, -1] - run.x[0, -1]))
    gap = run.x[:, -1] - run.wall_x
    assert near(gap, d[:, -1] + 0.1 * F[:, -1], 1e-11)
    assert near(run.wall_x[0], wall.phi @ rest.q) and near(run.final.wall[1], run.wall_v[-1])
    assert near(run.energy_wall[0], 0.5 * np.sum((wall.omega * rest.q) ** 2))


def test_a_sphere_falls_rises_and_is_braked_by_its_guide():
    """x'' = g -+ mu / m, until it rests where weight and friction hold it; the ledger has all."""
    chain = dem.Chain(
        np.array([2.0]), np.ones(1), np.ones(1), gravity=0.3, n_falling=1, friction=np.array([0.8])
    )
    run = march(chain, rigid_wall(), -np.ones(1), duration=4.0, dt=0.01, n_save=8)
    t = np.minimum(run.t, 1 / 0.7)
    np.testing.assert_allclose(run.x[:, 0], -t + 0.35 * t**2, atol=2e-6)  # it stops in a kick
    np.testing.assert_allclose(run.dissipated_guides, 0.8 * (t - 0.35 * t**2), atol=2e-6)
    np.testing.assert_allclose(run.work_gravity, 0.6 * run.x[:, 0], atol=1e-12)
    assert run.energy_error < 1e-6
    down = march(chain, rigid_wall(), np.ones(1), duration=0.4, dt=0.01, n_save=4)
    assert down.contact_force.max() > 0.1 and down.energy_error < 1e-4
    pushed = march(
        chain._replace(gravity=0.7), rigid_wall(), -np.ones(1), duration=1.6, dt=0.01, n_save=8
    )
    u = np.minimum(pushed.t, 1 / 1.1)
    exact = 0.55 * u**2 - u + 0.15 * (pushed.t - u) ** 2
    np.testing.assert_allclose(pushed.x[:, 0], exact, atol=2e-5)
