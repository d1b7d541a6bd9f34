"""Numbers of a hinged beam from the forces that a bead of the chain has measured."""

import numpy as np
import pytest

from beadwave import dem
from beadwave.coupling import CouplingError
from beadwave.coupling.sensors import Sensor, recorded
from beadwave.workflows.fit.aligned_signals import rise
from beadwave.workflows.fit.candidates import searched
from beadwave.workflows.fit.forward import MeasuredRecord, StructureForward, unknowns
from beadwave.workflows.fit.inversion import inverted, profiled
from beadwave.workflows.fit.least_squares import RecordFit
from beadwave.workflows.fit.marched_system import Rig
from beadwave.workflows.fit.parameter import Parameter
from beadwave.workflows.fit.uncertainty import (
    bars_over_time,
    bounds_information,
    determining_sample,
)

LENGTH, WIDTH, DENSITY, AT = 0.3, 0.04, 2700.0, 0.12
BUCKLING = 70e9 * WIDTH * 0.012**3 / 12 * np.pi**2 / LENGTH**2  # N, of the middle of the bounds
TRUTH = np.array([0.0124, 72e9, 0.5])  # m, Pa, axial force over the buckling load
SPEEDS = np.array([0.302, 0.447])
TRIGGERS = np.array([52e-6, 47e-6])
EVERYTHING = np.array([*TRUTH, SPEEDS[0], TRIGGERS[0], SPEEDS[1], TRIGGERS[1]])
SENSORS = (Sensor(4, "force", noise=0.01),)
SHARED = (
    Parameter("thickness", "shared", 0.012, 0.009, 0.015, 2e-4),
    Parameter("young", "shared", 70e9, 56e9, 84e9, 1e9),
    Parameter("axial force", "shared", 0.0, -0.2, 0.9, 0.05),
)


def hinged(h, E, share, n=30):
    k = np.arange(1, n + 1) * np.pi / LENGTH
    mass = DENSITY * WIDTH * h
    squares = (E * WIDTH * h**3 / 12 * k**4 - share * BUCKLING * k**2) / mass
    if squares.min() <= 0:
        raise CouplingError("buckled")
    phi = np.sqrt(2.0 / (mass * LENGTH)) * np.sin(k * AT)
    return dem.Wall(np.sqrt(squares), np.full(n, 0.003), phi)


def system(values, wall=hinged):
    h, E, share, speed = values
    flat = dem.Flat(E, 0.33)
    chain = dem.row_of_spheres(0.00953, 7800.0, 210e9, 0.3, count=9, flat=flat)
    return Rig(chain, wall(h, E, share), np.r_[speed, np.zeros(8)])


STEP = 4 * system([*TRUTH, SPEEDS.max()]).step


def sought(speeds=(0.3, 0.45)):
    """Unknowns of two records, each with a velocity and a trigger of its own."""
    of_record = [[Parameter(f"velocity {i}", "own", v, 0.7 * v, 1.4 * v, 0.01)]
           for i, v in enumerate(speeds)]  # fmt: skip
    triggers = [Parameter(f"trigger {i}", "trigger", 0.0, -2e-4, 2e-4, 3e-6)
                for i in range(len(speeds))]  # fmt: skip
    return unknowns(SHARED, of_record, triggers)


def measured(duration, gain=0.2, wall=hinged, seed=0, bits=8):
    """Two records at 1 MHz, by a march of finer steps: noise of 1 %, 8 bits."""
    t = np.arange(0.0, duration, 1e-6)
    blank = tuple(MeasuredRecord(t, np.zeros((len(t), 1)), np.ones(1)) for _ in SPEEDS)
    true = StructureForward(lambda values: system(values, wall), SENSORS, STEP / 4)
    theta = EVERYTHING
    for i, y in enumerate(gain * true.signals(sought(), theta, blank)):
        noisy = recorded(SENSORS, y, bits, [seed, i])
        rms = 0.01 * np.abs(y).max() * np.hypot(1.0, 0.01 / 0.0347 / 2)  # and of 8 bits
        yield MeasuredRecord(t, noisy, np.array([rms]))


def problem(duration, **how):
    shots = tuple(measured(duration, **how))
    return RecordFit(StructureForward(system, SENSORS, STEP), sought(), shots, np.array([0]))


@pytest.fixture(scope="module")
def result():
    return inverted(problem(3.5e-3), n_shared=3, gains=["gain"])


@pytest.mark.slow
def test_thickness_modulus_and_axial_force_are_found_within_their_bars(result):
    off = np.abs(result.value[:3] - TRUTH)
    assert (off <= 1.5 * result.uncertainty.two_sigma[:3]).all()
    assert off[0] < 0.01 * TRUTH[0] and off[1] < 0.02 * TRUTH[1] and off[2] < 0.05
    np.testing.assert_allclose(result.value[[3, 5]], SPEEDS, rtol=5e-3)
    np.testing.assert_allclose(result.value[[4, 6]], TRIGGERS, atol=5e-7)
    assert result.gains[0] / 0.2 == pytest.approx(1.0, abs=3e-3)
    assert result.whole_misfit == pytest.approx(1.0, abs=0.05)
    assert result.memory == pytest.approx(1.0, abs=0.1)
    assert result.explained
    assert not result.at_bound.any()


def test_bars_of_white_noise_are_those_of_fisher_s_information(result):
    B = bounds_information(result.parameters)
    ends = np.array([1200, 2500, 3500])
    bars = bars_over_time(result.slopes, B, ends)
    scale = np.array([p.scale for p in result.parameters])
    np.testing.assert_allclose(bars[-1] * scale, result.uncertainty.two_sigma, rtol=0.3)
    assert (np.diff(bars, axis=0) <= 1e-9 * bars[0]).all()  # no record tells less for being longer


def test_the_first_reflected_wave_does_not_tell_the_axial_force():
    """It lasts 1.2 ms; the bar of the force is that of its bounds, and those of thickness and
    modulus hold the truth although the force that came out is far off."""
    short = inverted(problem(1.2e-3), n_shared=3, starts=2, gains=["gain"])
    share = short.uncertainty.two_sigma[2] / (SHARED[2].high - SHARED[2].low)
    assert share > 0.5
    assert short.uncertainty.combinations[0].text(short.parameters).startswith("1.00 axial force")
    assert (np.abs(short.value[:2] - TRUTH[:2]) <= 1.5 * short.uncertainty.two_sigma[:2]).all()


def test_waves_feel_a_number_from_the_time_on_that_the_model_says(result):
    width = np.array([(p.high - p.low) / p.scale for p in result.parameters])
    thickness, _, force = determining_sample(result.slopes, width, 0.1)[:3]
    assert 400 < thickness < 900 < force < 3500  # the wave is back after 0.5 ms
    end = result.slopes.shape[1]
    assert (determining_sample(result.slopes, np.full(len(width), 1e-9), 0.1) == end).all()


def test_a_number_that_no_wave_tells_stays_in_the_middle_of_its_bounds():
    """Within the first wave; a force at the end of its bounds would bias thickness and modulus."""
    short = inverted(problem(1.0e-3), n_shared=3, starts=1, gains=["gain"])
    force = SHARED[2]
    middle, deviation = 0.5 * (force.low + force.high), (force.high - force.low) / np.sqrt(12.0)
    assert abs(short.value[2] - middle) < 0.5 * deviation
    assert short.uncertainty.two_sigma[2] / (2 * deviation) == pytest.approx(1.0, abs=0.05)


@pytest.mark.slow
def test_a_structure_that_the_model_cannot_be_is_told_by_what_it_leaves():
    def on_a_mass(h, E, share):
        return dem.one_dof_wall(400.0, 0.2, 0.01)

    wrong = inverted(problem(2e-3, wall=on_a_mass), n_shared=3, starts=2, gains=["gain"])
    assert not wrong.explained
    assert wrong.whole_misfit > 1.5
    assert wrong.memory > 1.5


WIDE = (
    Parameter("thickness", "shared", 0.012, 0.009, 0.015, 2e-4),
    Parameter("young", "shared", 70e9, 49e9, 98e9, 1e9),
    Parameter("axial force", "shared", 0.0, -0.2, 0.9, 0.05),
)


def problem_of(truth, shared, made=system, duration=3.5e-3):
    """One record of a structure with these numbers, all between wide bounds; 1 % of noise."""
    t = np.arange(0.0, duration, 2e-6)
    of_record = Parameter("velocity", "own", 0.3, 0.15, 0.6, 0.01)
    trigger = Parameter("trigger", "trigger", 0.0, -1e-4, 1e-4, 3e-6)
    sought = unknowns(shared, [[of_record]], [trigger])
    y = StructureForward(made, SENSORS, STEP / 4).signals(
        sought,
        np.array([*truth, 0.306, 4e-6]),
        (MeasuredRecord(t, np.zeros((len(t), 1)), np.ones(1)),),
    )[0]
    shot = MeasuredRecord(t, recorded(SENSORS, y, 8, 1), np.array([0.0102 * np.abs(y).max()]))
    return RecordFit(StructureForward(made, SENSORS, STEP), sought, (shot,), np.array([0]))


@pytest.mark.slow
@pytest.mark.parametrize(
    "truth", [(0.0145, 52e9, 0.6), (0.0105, 95e9, 0.1), (0.0125, 60e9, 0.75)]
)  # fmt: skip
def test_structures_all_over_wide_bounds_are_found_by_windows_that_grow(truth):
    fit = problem_of(truth, WIDE)
    result = profiled(fit, inverted(fit, n_shared=3, starts=12, seed=1, gains=["gain"]), 3)
    off = np.abs(result.value[:3] - truth) / result.uncertainty.two_sigma[:3]
    assert result.explained
    assert (off <= 1.5).all()


def test_a_bar_holds_a_number_that_no_wave_within_the_record_tells_on_one_side():
    """Beyond a force of 0.69 the second wave returns after the record; the bounds draw the answer
    to where it just comes in, where the curvature says that the force is known to 0.02."""
    truth = (0.0125, 60e9, 0.75)
    fit = problem_of(truth, WIDE)
    plain = inverted(fit, n_shared=3, begin=np.array([*truth, 0.306, 4e-6]), gains=["gain"])
    longer = profiled(fit, plain, 3)
    off = abs(plain.value[2] - 0.75)
    assert off > 2.0 * plain.uncertainty.two_sigma[2]
    assert off < longer.uncertainty.two_sigma[2] < 0.3


def test_a_valley_beside_the_answer_is_not_called_an_explanation():
    """The whole record is fitted at once, from the middle of the bounds."""
    fit = problem_of((0.0145, 52e9, 0.6), WIDE)
    middle = np.array([p.start for p in fit.unknowns.parameters])
    result = inverted(fit, n_shared=3, begin=middle, gains=["gain"])
    off = np.abs(result.value[:3] - (0.0145, 52e9, 0.6)) / result.uncertainty.two_sigma[:3]
    assert off.max() > 1.5
    assert not result.explained


def test_what_one_part_of_a_record_leaves_is_enough_to_doubt_the_whole(result):
    parts = list(result.parts)
    assert len(parts) == 2 * 50 and parts[50].record == 1
    parts[60] = parts[60]._replace(misfit=1.6)
    assert not result._replace(parts=tuple(parts)).explained
    assert not result._replace(misfit=1.15 * result.misfit).explained


def test_two_places_on_a_symmetric_beam_are_told_as_two_answers():
    """A hinged beam struck at x answers as one struck at L - x."""

    def struck_at(values):
        at, speed = values
        k = np.arange(1, 31) * np.pi / LENGTH
        item = system(np.array([*TRUTH, speed]))
        phi = np.sqrt(2.0 / (DENSITY * WIDTH * TRUTH[0] * LENGTH)) * np.sin(k * at)
        return item._replace(wall=item.wall._replace(phi=phi))

    place = (Parameter("position", "shared", 0.1, 0.06, 0.24, 0.004),)
    fit = problem_of((0.11,), place, struck_at)
    ends = searched(fit, n_shared=1, starts=12, seed=0).ends
    answers = [inverted(fit, n_shared=1, begin=end.point, gains=["gain"]) for end in ends]
    (rival,) = answers[0].rivals(answers[1:], 1)
    both = np.sort([answers[0].value[0], rival.value[0]])
    np.testing.assert_allclose(both, [0.11, LENGTH - 0.11], rtol=2e-3)
    wrong = rival._replace(misfit=1.1 * rival.misfit)
    assert answers[0].rivals([wrong], 1) == ()
    assert answers[0].rivals([answers[0]], 1) == ()


def test_bars_are_as_long_as_the_misfit_says_where_a_number_saturates():
    """The thickness follows h = h0 + c (1 - exp(-a)); on the side where it hardly follows a any
    more, the misfit has risen by a parabola's after t bars q: q = 1 - exp(-t q)."""

    def saturated(values):
        a, speed = values
        return system(np.array([TRUTH[0] - 2e-4 * np.exp(3.0 - a), *TRUTH[1:], speed]))

    number = (Parameter("a", "shared", 4.0, 1.0, 12.0, 0.1),)
    fit = problem_of((7.0,), number, saturated)
    begin = np.array([7.0, 0.306, 4e-6])
    result = inverted(fit, n_shared=1, begin=begin, gains=["gain"])
    q = result.uncertainty.two_sigma[0]
    assert 0.4 < q < 0.9
    longer = profiled(fit, result, 1)
    assert longer.lengthening == pytest.approx(-np.log(1.0 - q) / q, rel=0.06)
    assert longer.uncertainty.two_sigma[0] / q == pytest.approx(longer.lengthening, rel=1e-6)
    deepest = longer.uncertainty.combinations[0]
    assert deepest.two_sigma / result.uncertainty.combinations[0].two_sigma > 1.1


def test_bars_of_a_parabola_stay(result):
    assert profiled(problem(3.5e-3), result, 3).lengthening < 1.05


def test_derivatives_are_those_of_the_signals():
    fit = problem(2e-3)
    theta = EVERYTHING
    _, slopes = fit.forward.jacobian(fit.unknowns, theta, fit.shots)
    for j, step in enumerate(1e-3 * fit.unknowns.scale):
        moved = theta + np.outer([step, -step], np.eye(len(theta))[j])
        up, down = (fit.forward.signals(fit.unknowns, x, fit.shots) for x in moved)
        central = 1e3 * (up - down) / 2
        off = np.abs(slopes[..., j] - central).max() / np.abs(central).max()
        assert off < 2e-3, fit.unknowns.parameters[j].name


def test_gains_that_are_known_are_kept():
    fit = problem(1.2e-3)
    signals = np.array([shot.y for shot in fit.shots]) / 0.2
    assert fit.gains(signals)[0] == pytest.approx(0.2, rel=1e-12)
    assert fit._replace(gain=np.array([-1])).gains(signals)[0] == 1.0


def test_a_first_wave_rises_between_samples():
    t = np.linspace(0.0, 1e-3, 101)
    y = np.clip((t - 3.04e-4) / 1e-4, 0.0, 1.0)[:, None]
    assert rise(t, -2.0 * y) == pytest.approx(3.34e-4, abs=1e-7)


def test_too_few_samples_are_refused():
    fit = problem(1.2e-3).of_shots([0], stride=300)
    with pytest.raises(CouplingError, match="do not determine"):
        inverted(fit, n_shared=3, gains=["gain"])


def stepped(duration, wall=hinged):
    """Two noiseless records of a sphere's velocity in 8 bits; it stands still between waves."""
    sensors, t = (Sensor(8, "velocity"),), np.arange(0.0, duration, 1e-6)
    blank = tuple(MeasuredRecord(t, np.zeros((len(t), 1)), np.ones(1)) for _ in SPEEDS)
    true = StructureForward(lambda values: system(values, wall), sensors, STEP / 4)
    shots = []
    for y in true.signals(sought(), EVERYTHING, blank):
        rounded = recorded(sensors, y, 8)
        rms = np.diff(np.unique(rounded)).min() / np.sqrt(12.0)
        shots.append(MeasuredRecord(t, rounded, np.array([rms]), np.array([rms])))
    return RecordFit(
        StructureForward(system, sensors, STEP), sought(), tuple(shots), np.array([-1])
    )


def test_records_without_noise_are_explained_down_to_their_steps():
    result = inverted(stepped(2e-3), n_shared=3, begin=EVERYTHING)
    assert result.explained
    assert max(piece.misfit for piece in result.parts) > np.sqrt(3.0)  # no noise in as many samples
    assert not result._replace(rounded=0.0).explained
    wrong = stepped(2e-3, lambda h, E, share: dem.one_dof_wall(400.0, 0.2, 0.01))
    assert not inverted(wrong, n_shared=3, begin=EVERYTHING).explained


@pytest.mark.parametrize("sigma", [0.0, 0.2, 0.35, 0.6, 2.0])
def test_rounding_a_signal_that_stands_still_leaves_what_the_noise_before_it_says(sigma):
    """In steps, the integral of the squared error over normal noise at the worst place."""
    noise = np.linspace(-9.0, 9.0, 20001) * max(sigma, 1e-9)
    density = np.exp(-0.5 * (noise / max(sigma, 1e-9)) ** 2)
    still = np.linspace(0.0, 1.0, 201)[:, None] + noise
    worst = np.max((still - np.round(still)) ** 2 @ density / density.sum())
    rms = np.sqrt(sigma**2 + 1.0 / 12.0)
    shot = MeasuredRecord(
        np.arange(2.0), np.zeros((2, 1)), np.array([rms]), np.array([1.0 / np.sqrt(12.0)])
    )
    fit = RecordFit(
        StructureForward(system, SENSORS, STEP), sought(SPEEDS[:1]), (shot,), np.array([0])
    )
    bound = (1.0 + fit.rounded) * rms**2 - sigma**2
    assert worst <= bound * (1 + 1e-6)
    assert worst >= 0.8 * bound
