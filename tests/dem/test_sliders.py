"""Jenkins and Iwan elements against closed forms, and in oscillators with known amplitudes."""

import math

import numpy as np
import pytest

from beadwave.dem import InvalidChain
from beadwave.dem.friction import iwan_law, sliders_at_rest
from beadwave.dem.kernels.sliders import iwan_force, slide_iwan, slide_jenkins

F, K, CHI, BETA = 100.0, 2e7, -0.4, 0.3
LAW = iwan_law(F, K, CHI, BETA)


def jenkins_march(rates, t, x, v, impulse, stiffness, force):
    """Velocity Verlet of two masses with a Jenkins element between them: displacements (k, 2), and
    the element's heat up to each instant. `rates(t, x, v)` is the acceleration without the element,
    `impulse` (2,) is +-1/m of both."""
    z, heat = 0.0, 0.0
    h = t[1] - t[0]
    X, Q = np.empty((t.size, 2)), np.empty(t.size)
    a = rates(t[0], *x, *v)
    x1, x2, v1, v2 = *x, *v
    for i, now in enumerate(t):
        X[i], Q[i] = (x1, x2), heat
        a1, a2 = a[0] - impulse[0] * stiffness * z, a[1] + impulse[1] * stiffness * z
        v1, v2 = v1 + 0.5 * h * a1, v2 + 0.5 * h * a2
        x1, x2 = x1 + h * v1, x2 + h * v2
        z, lost = slide_jenkins(z, h * (v1 - v2), stiffness, force)
        heat += lost
        # velocities at the end of the step: the damper is small, a first guess is enough
        guess1, guess2 = v1 + 0.5 * h * a1, v2 + 0.5 * h * a2
        a = rates(now + h, x1, x2, guess1, guess2)
        v1 += 0.5 * h * (a[0] - impulse[0] * stiffness * z)
        v2 += 0.5 * h * (a[1] + impulse[1] * stiffness * z)
    return X, Q


def test_two_masses_joined_by_a_jenkins_element_move_by_the_known_amplitudes():
    """Harmonic balance to high order gave 208.471 and 188.782 um and 2.510848 mJ a cycle. 1000
    steps a cycle leave 3e-5."""
    m1, m2, f = 0.5, 0.0669, 90.0
    k1, k2 = m1 * (2 * math.pi * 100.0) ** 2, m2 * (2 * math.pi * 60.0) ** 2
    c, omega = 0.02 * math.sqrt(k1 * m1), 2 * math.pi * f

    def rates(t, x1, x2, v1, v2):
        spring = k2 * (x1 - x2)
        return (10.0 * math.cos(omega * t) - k1 * x1 - c * v1 - spring) / m1, spring / m2

    cycles, steps = 120, 1000
    t = np.arange(cycles * steps + 1) / (steps * f)
    X, Q = jenkins_march(rates, t, (0.0, 0.0), (0.0, 0.0), (1 / m1, 1 / m2), 1e6, 2.0)
    last = X[-steps - 1 :]
    assert 0.5 * np.ptp(last, axis=0) * 1e6 == pytest.approx([208.471, 188.782], rel=1e-4)
    assert Q[-1] - Q[-steps - 1] == pytest.approx(2.510848e-3, rel=1e-4)


@pytest.mark.slow
def test_coulomb_friction_gives_the_amplitude_of_den_hartog():
    """J. P. Den Hartog, Trans. ASME 53 (1931) 107: frequency ratio 0.8, friction over force 0.3.
    A spring in the element takes a time ~ stiffness^(-1/2) at each return: three stiffnesses are
    extrapolated in that power. 8000 steps a cycle leave 2e-5, half as many 3e-5."""
    amplitudes, stiffnesses = [], np.array([200.0, 400.0, 800.0])
    for stiffness in stiffnesses:

        def rates(t, x1, x2, v1, v2):
            return math.cos(0.8 * t) - x1, 0.0

        cycles, steps = 25, 8000
        t = np.arange(cycles * steps + 1) * (2 * math.pi / 0.8 / steps)
        X, _ = jenkins_march(rates, t, (2.6, 0.0), (0.0, 0.0), (1.0, 0.0), stiffness, 0.3)
        amplitudes.append(0.5 * np.ptp(X[-steps - 1 :, 0]))
    rigid = np.polyfit(stiffnesses**-0.5, amplitudes, 2)[-1]
    assert rigid == pytest.approx(2.626105, rel=5e-5)


def test_an_iwan_element_follows_segalmans_curve_and_loses_his_power_of_the_amplitude():
    for U in (0.05 * LAW.last, 0.5 * LAW.last, LAW.last):
        sliders = sliders_at_rest(LAW)
        slide_iwan(sliders, LAW, U)
        p = CHI + 2.0
        curve = U**p / p + U * (LAW.last ** (p - 1) - U ** (p - 1)) / (p - 1)
        curve = LAW.density * curve + LAW.last_stiffness * U
        assert iwan_force(sliders, LAW) == pytest.approx(curve, rel=1e-12)
        lost = slide_iwan(sliders, LAW, -2.0 * U) + slide_iwan(sliders, LAW, 2.0 * U)
        expected = 4.0 * LAW.density * U ** (CHI + 3.0) / ((CHI + 2.0) * (CHI + 3.0))
        assert lost == pytest.approx(expected, rel=1e-11)
        assert iwan_force(sliders, LAW) == pytest.approx(curve, rel=1e-11)


def test_an_iwan_element_is_stiff_without_slip_and_slips_at_its_force():
    sliders = sliders_at_rest(LAW)
    slide_iwan(sliders, LAW, 1e-9 * LAW.last)
    assert iwan_force(sliders, LAW) == pytest.approx(K * 1e-9 * LAW.last, rel=1e-4)
    lost = slide_iwan(sliders, LAW, 3.0 * LAW.last)
    assert iwan_force(sliders, LAW) == pytest.approx(F, rel=1e-12)
    assert slide_iwan(sliders, LAW, LAW.last) == pytest.approx(F * LAW.last, rel=1e-12)
    assert lost > 0.0


def test_an_iwan_element_is_a_crowd_of_jenkins_elements():
    """4000 sliders beside the continuum, under a random history; they leave 2e-4 of the force."""
    rng = np.random.default_rng(4)
    n = 4000
    edges = LAW.last * (np.arange(n + 1) / n) ** 2.0
    s = 0.5 * (edges[1:] + edges[:-1])
    weight = LAW.density * np.diff(edges ** (CHI + 1.0)) / (CHI + 1.0)
    s, weight = np.append(s, LAW.last), np.append(weight, LAW.last_stiffness)
    z, heat, lost = np.zeros(n + 1), 0.0, 0.0
    sliders = sliders_at_rest(LAW)
    for way in 0.7 * LAW.last * rng.normal(size=200) * rng.uniform(size=200) ** 2:
        trial = z + way
        z = np.clip(trial, -s, s)
        heat += np.sum(weight * s * np.abs(trial - z))
        one = slide_iwan(sliders, LAW, way)
        assert one >= 0.0
        lost += one
        assert iwan_force(sliders, LAW) == pytest.approx(np.sum(weight * z), abs=2e-4 * F)
        assert lost == pytest.approx(heat, rel=2e-3)


def test_an_iwan_element_remembers_its_return_points_and_forgets_the_smallest_for_want_of_room():
    sliders, small = sliders_at_rest(LAW), sliders_at_rest(LAW, capacity=12)
    for j in range(30):
        way = (-1.0) ** j * LAW.last * 1.2 * 0.8**j
        slide_iwan(sliders, LAW, way)
        slide_iwan(small, LAW, way)
    assert sliders.count[0] > 20
    assert small.count[0] == 12
    assert iwan_force(small, LAW) == pytest.approx(iwan_force(sliders, LAW), abs=0.02 * F)
    slide_iwan(sliders, LAW, 4.0 * LAW.last)
    assert sliders.count[0] == 2


@pytest.mark.parametrize("values", [(-1.0, K, CHI, BETA), (F, 0.0, CHI, BETA), (F, K, -1.0, BETA)])
def test_parameters_out_of_range_are_refused(values):
    with pytest.raises(InvalidChain, match="iwan"):
        iwan_law(*values)
