"""Resonance curves by harmonic balance: closed forms, linear limits, and the march in time."""

import numpy as np
import pytest

from beadwave.coupling.continuation import before_striker
from beadwave.coupling.errors import CouplingError
from beadwave.coupling.harmonic_balance import answer, cut_at_contacts
from beadwave.coupling.periodic_state import periodic_state
from beadwave.coupling.resonance import HarmonicBalance, curve, point
from beadwave.coupling.spatial_march import Before, ShakerForces, body_of
from beadwave.coupling.spatial_wall import spatial_wall_of_modes
from beadwave.coupling.stuck_wall import stuck_wall
from beadwave.dem.friction import gross_slip, stick_stiffness
from beadwave.dem.spheres import hertz_overlap

from closed_loops import loop_amplitude, loop_energy
from spatial_contact import last, random_wall, row

CLAMPED = {"arm_stiffness": np.full(2, np.inf), "arm_rotation": np.inf}
PRESS, MU = 20.0, 0.2


def block(zeta=0.0, stiffer=1.0, coefficient=1.0):
    """A block of 10 kg at 100 Hz along t1 under a clamped sphere; the springs of its contact
    `stiffer` times as stiff under the same bound, the coefficient as a factor."""
    wall = spatial_wall_of_modes(
        np.array([2 * np.pi * 100.0]), np.array([zeta]), np.array([[0.0, 10**-0.5, 0.0]]),
        load=np.array([[10**-0.5]]),
    )  # fmt: skip
    chain = row(preload=PRESS)
    sphere = last(chain, **CLAMPED)
    law = sphere.law._replace(
        modulus=stiffer * sphere.law.modulus, bound=coefficient / stiffer * sphere.law.bound
    )
    return body_of(chain, wall, [0.0], sphere._replace(law=law), None)


def den_hartog(r, force, friction, k):
    """Amplitude [m] of a mass on a spring k with Coulomb friction, in motion without stops:
    J. P. Den Hartog, Trans. ASME 53 (1931) APM-107. r is frequency over natural frequency."""
    V = 1.0 / (1.0 - r**2)
    U = np.sin(np.pi / r) / (r * (1.0 + np.cos(np.pi / r)))
    return force / k * np.sqrt(V**2 - (friction / force * U) ** 2)


@pytest.mark.parametrize("r", [0.8, 1.3])
def test_coulombs_friction_alone_gives_den_hartogs_amplitude(r):
    """Springs a thousand times as stiff turn the force round within an angle sqrt(4 s / X) = 0.02,
    s their gross slip: 4 / pi mu P / F of that is 0.6 % of the amplitude."""
    k, friction, force = 10.0 * (2 * np.pi * 100.0) ** 2, MU * PRESS, 16.0
    options = HarmonicBalance(n_harmonics=15, n_instants=512, n_cells=16)
    body = block(stiffer=1000.0)
    found = curve(body, [100.0 * r] * 4, [4 * force, 2 * force, 1.4 * force, force], options)[-1]
    assert found.motion == pytest.approx(den_hartog(r, force, friction, k), rel=1e-2)
    assert found.stick == 0.0


@pytest.mark.parametrize("frequency", [60.0, 130.0, 300.0])
def test_small_forces_and_slippery_contacts_leave_the_linear_systems(frequency):
    """A contact that sticks is a spring, one without friction is none: receptances of one mass.
    The peak lies between instants, 3e-4 above; 128 cells leave the spring 0.18 % soft."""
    k, m, zeta = 10.0 * (2 * np.pi * 100.0) ** 2, 10.0, 0.02
    omega = 2 * np.pi * frequency
    free = k - m * omega**2 + 2j * zeta * omega * np.sqrt(k * m)
    body = block(zeta, coefficient=1e-6)
    assert point(body, frequency, 1.0, None).motion == pytest.approx(1.0 / abs(free), rel=5e-4)
    body = block(zeta, coefficient=50.0)
    a = np.sqrt(body.last.law.radius * hertz_overlap(PRESS, body.prepared.chain.A[-1]))
    k_t = float(stick_stiffness(body.last.law, a))
    stuck = point(body, frequency, 0.01, None)
    assert stuck.motion == pytest.approx(0.01 / abs(free + k_t), rel=3e-3)
    assert stuck.stiffness == pytest.approx(k_t, rel=2.5e-3)


def test_a_wall_that_moves_along_its_normal_alone_leaves_nothing_across():
    """No receptance across to weigh what is left of the equation by: it was 0 over 0."""
    wall = spatial_wall_of_modes(
        np.array([2 * np.pi * 100.0]), np.array([0.02]), np.array([[10**-0.5, 0.0, 0.0]]),
        load=np.array([[10**-0.5]]),
    )  # fmt: skip
    chain = row(preload=PRESS)
    body = body_of(chain, wall, [0.0], last(chain, **CLAMPED), None)
    reached = curve(body, [60.0], [0.5])[-1]
    assert reached.slip == reached.friction == reached.energy == 0.0
    assert reached.stick > 0.99


@pytest.mark.parametrize("load", [0.25, 0.5])
def test_a_cycle_has_johnsons_loop(load):
    """Johnson 7.57, of the amplitude at which the force is `load` of its bound."""
    body = block()
    law, t = body.last.law, np.arange(512) / 512
    overlap = hertz_overlap(PRESS, body.prepared.chain.A[-1])
    most, a = MU * PRESS, float(np.sqrt(law.radius * overlap))
    amplitude = float(loop_amplitude(law, most, load * most, a))
    shakers = ShakerForces(np.ones(1), np.array([100.0]), np.zeros(1))
    body, before = body._replace(shakers=shakers), Before(np.zeros(1, bool), 0)
    cut = cut_at_contacts(body, before, 512)
    y = np.zeros((512, 2))
    y[:, 1] = amplitude * np.cos(2 * np.pi * t)
    cycle = answer(body, before, cut, y, None, 2)
    assert np.ptp(cycle.force[:, 1]) / 2 == pytest.approx(load * most, rel=1e-3)
    assert cycle.heat == pytest.approx(float(loop_energy(law, most, load * most, a)), rel=1e-2)
    assert amplitude < gross_slip(law, overlap)


@pytest.mark.slow
@pytest.mark.parametrize("force", [60.0, 150.0])
def test_the_march_in_time_comes_to_the_same_cycle(force):
    """A wall of four modes in three directions, partly and wholly slipping: what 11 harmonics leave
    out was measured as up to 1e-2 of the loop in gross slip."""
    chain, rng = row(preload=PRESS), np.random.default_rng(1)
    wall = random_wall(1, load=rng.normal(size=(4, 1)))._replace(zeta=np.full(4, 0.1))
    sphere = last(chain, arm_stiffness=np.array([2e6, 3e6]), arm_rotation=300.0)
    shakers = ShakerForces(np.array([force]), np.array([1000.0]), np.array([0.4]))
    body = body_of(chain, wall, [0.0], sphere, shakers)
    marched = periodic_state(body, before_striker(body, [0.0]), error=1e-4)
    options = HarmonicBalance(n_harmonics=11, n_instants=128)
    found = curve(body, [1000.0], [force], options)[0]
    cycle = marched.cycle
    amplitude = 0.5 * np.ptp(cycle.friction_force[:, cycle.axis])
    assert found.friction == pytest.approx(amplitude, rel=1e-2)
    assert found.slip == pytest.approx(0.5 * np.ptp(cycle.slip[:, cycle.axis]), rel=1e-2)
    assert found.energy == pytest.approx(cycle.energy, rel=2e-2)


@pytest.mark.slow
def test_the_resonance_falls_from_the_stuck_mode_to_the_free_one_as_the_force_grows():
    body = block(0.01)
    a = np.sqrt(body.last.law.radius * hertz_overlap(PRESS, body.prepared.chain.A[-1]))
    k_t = float(stick_stiffness(body.last.law, a))
    stuck = stuck_wall(body.wall, k_t, body.last, body.prepared.chain).omega
    stuck = float(stuck[0]) / 2 / np.pi
    frequencies = np.linspace(90.0, 1.1 * stuck, 30)
    peaks = []
    for force in (0.05, 6.0, 200.0):
        points = curve(
            body, frequencies, [force] * len(frequencies), HarmonicBalance(n_harmonics=3)
        )
        per_force = [p.motion / force for p in points]
        peaks.append(points[int(np.argmax(per_force))].frequency)
    step = frequencies[1] - frequencies[0]
    assert peaks[0] == pytest.approx(stuck, abs=2 * step)
    assert peaks[0] > peaks[1] + step
    assert peaks[2] == pytest.approx(100.0, abs=step)


def test_a_curve_that_cannot_be_followed_is_refused():
    options = HarmonicBalance(most_iterations=0)
    with pytest.raises(CouplingError, match="cannot be followed to 100 Hz at 8 N"):
        curve(block(0.01), [100.0], [8.0], options)


@pytest.mark.parametrize("frequency", [100.0, 50.0])
def test_a_mode_without_damping_is_not_shaken_at_its_own_frequency(frequency):
    """Nor at that of which it is a harmonic: the mode lies at 100 Hz."""
    with pytest.raises(CouplingError, match="without damping lies at 100 Hz"):
        curve(block(), [frequency], [1.0])


@pytest.mark.parametrize(
    ("changes", "frequency", "said"),
    [
        ({"gamma": np.array([20.0]), "dissipation": "hunt-crossley"}, 100.0, "leave the damper"),
        ({}, 0.0, "frequencies must be above 0 Hz"),
    ],
)
def test_a_curve_refuses_what_it_would_leave_out(changes, frequency, said):
    body = block()
    chain = body.prepared.chain._replace(**changes)
    body = body._replace(prepared=body.prepared._replace(chain=chain))
    with pytest.raises(CouplingError, match=said):
        curve(body, [frequency], [1.0])
