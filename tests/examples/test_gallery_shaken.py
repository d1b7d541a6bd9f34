"""The gallery's scripts on the shaken rig: resonance curves against closed forms, what sticks as a
part of the structure, and what slip changes in the waves."""

import numpy as np
import pytest

import friction
import resonance
from beadwave import dem, scene
from beadwave.coupling.continuation import before_striker
from beadwave.coupling.periodic_state import periodic_state
from beadwave.coupling.spatial_march import body_of, march_space
from beadwave.coupling.spatial_wall import spatial_wall_of_modes
from beadwave.dem.friction import stick_stiffness
from beadwave.dem.shakers import ShakerForces
from beadwave.dem.spheres import hertz_overlap
from resonance import curve, point
from shaken_rig import stuck_wall, uncoupled_wall

from command_line import COARSE_RIG
from spatial_contact import last, random_wall, row

pytestmark = pytest.mark.usefixtures("shared_cache")
COARSE = (*COARSE_RIG, "reduction.modes=20")
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


def contact_stiffness(body):
    """[N/m] of the block's contact across where it sticks."""
    overlap = hertz_overlap(PRESS, body.prepared.chain.A[-1])
    return float(stick_stiffness(body.last.law, np.sqrt(body.last.law.radius * overlap)))


def den_hartog(r, force, friction, k):
    """Amplitude [m] of a mass on a spring k with Coulomb friction, in motion without stops:
    J. P. Den Hartog, Trans. ASME 53 (1931) APM-107. r is frequency over natural frequency."""
    V = 1.0 / (1.0 - r**2)
    U = np.sin(np.pi / r) / (r * (1.0 + np.cos(np.pi / r)))
    return force / k * np.sqrt(V**2 - (friction / force * U) ** 2)


@pytest.mark.parametrize("r", [0.8, 1.3])
def test_coulombs_friction_alone_gives_den_hartogs_amplitude(r, monkeypatch):
    """Springs a thousand times as stiff turn the force round within an angle sqrt(4 s / X) = 0.02,
    s their gross slip: 4 / pi mu P / F of that is 0.6 % of the amplitude."""
    monkeypatch.setattr(resonance, "N_INSTANTS", 512)
    monkeypatch.setattr(resonance, "N_CELLS", 16)
    k, slips, force = 10.0 * (2 * np.pi * 100.0) ** 2, MU * PRESS, 16.0
    body = block(stiffer=1000.0)
    reached = curve(body, [100.0 * r] * 4, [4 * force, 2 * force, 1.4 * force, force])[-1]
    assert reached.motion == pytest.approx(den_hartog(r, force, slips, k), rel=1e-2)
    assert reached.stick == 0.0


@pytest.mark.parametrize("frequency", [60.0, 130.0, 300.0])
def test_small_forces_and_slippery_contacts_leave_the_linear_systems(frequency):
    """A contact that sticks is a spring, one without friction is none: receptances of one mass.
    The peak lies between instants, 3e-4 above; 128 cells leave the spring 0.18 % soft."""
    k, m, zeta = 10.0 * (2 * np.pi * 100.0) ** 2, 10.0, 0.02
    omega = 2 * np.pi * frequency
    free = k - m * omega**2 + 2j * zeta * omega * np.sqrt(k * m)
    slippery = point(block(zeta, coefficient=1e-6), frequency, 1.0)
    assert slippery.motion == pytest.approx(1.0 / abs(free), rel=5e-4)
    body = block(zeta, coefficient=50.0)
    k_t, stuck = contact_stiffness(body), point(body, frequency, 0.01)
    assert stuck.motion == pytest.approx(0.01 / abs(free + k_t), rel=3e-3)
    assert stuck.stiffness == pytest.approx(k_t, rel=2.5e-3)


@pytest.mark.slow
@pytest.mark.parametrize("force", [60.0, 150.0])
def test_the_march_in_time_comes_to_the_same_cycle(force):
    """A wall of four modes in three directions, partly and wholly slipping: what 15 harmonics leave
    out is below 1e-2 of the loop in gross slip."""
    chain, rng = row(preload=PRESS), np.random.default_rng(1)
    wall = random_wall(1, load=rng.normal(size=(4, 1)))._replace(zeta=np.full(4, 0.1))
    sphere = last(chain, arm_stiffness=np.array([2e6, 3e6]), arm_rotation=300.0)
    shakers = ShakerForces(np.array([force]), np.array([1000.0]), np.array([0.4]))
    body = body_of(chain, wall, [0.0], sphere, shakers)
    cycle = periodic_state(body, before_striker(body, [0.0]), error=1e-4).cycle
    reached = curve(body, [1000.0], [force])[0]
    amplitude = 0.5 * np.ptp(cycle.friction_force[:, cycle.axis])
    assert reached.friction == pytest.approx(amplitude, rel=1e-2)
    assert reached.slip == pytest.approx(0.5 * np.ptp(cycle.slip[:, cycle.axis]), rel=1e-2)
    assert reached.heat == pytest.approx(cycle.energy, rel=2e-2)


@pytest.mark.slow
def test_the_resonance_falls_from_the_stuck_mode_to_the_free_one_as_the_force_grows(monkeypatch):
    monkeypatch.setattr(resonance, "N_HARMONICS", 3)
    body = block(0.01)
    held = stuck_wall(body.wall, contact_stiffness(body), body.last, body.prepared.chain)
    stuck = float(held.omega[0]) / 2 / np.pi
    frequencies = np.linspace(90.0, 1.1 * stuck, 30)
    peaks = []
    for force in (0.05, 6.0, 200.0):
        points = curve(body, frequencies, [force] * len(frequencies))
        peaks.append(max(points, key=lambda point: point.motion).frequency)
    step = frequencies[1] - frequencies[0]
    assert peaks[0] == pytest.approx(stuck, abs=2 * step)
    assert peaks[0] > peaks[1] + step
    assert peaks[2] == pytest.approx(100.0, abs=step)


def beside(wall, sphere, chain, v0, reference):
    """Largest difference of the last sphere's velocity from the reference, over its largest."""
    run = march_space(chain, wall, v0, sphere, duration=2e-3, error=1e-6, n_save=400)
    return np.abs(run.trajectory.v[:, -1] - reference).max() / np.abs(reference).max()


@pytest.mark.slow
@pytest.mark.parametrize(
    "arm",
    [{"arm_stiffness": np.full(2, np.inf), "arm_rotation": np.inf},
     {"arm_stiffness": np.array([2e6, 3e6]), "arm_rotation": np.inf},
     {"arm_stiffness": np.array([2e6, 3e6]), "arm_rotation": 0.0}],
)  # fmt: skip
def test_a_contact_that_sticks_on_a_constant_area_is_a_part_of_the_structure(arm):
    """A blow that changes the force by a thousandth of the preload: the area changes by 3e-4."""
    chain, v0 = row(2, preload=1000.0), np.array([2e-5, 0.0])
    S = 1e-9 * np.array([[1.0, 0.3, -0.2], [0.3, 1.2, 0.4], [-0.2, 0.4, 0.8]])
    wall = random_wall(2)._replace(residual_compliance=S, zeta=np.zeros(4))
    sphere = last(chain, **arm)
    law = sphere.law._replace(bound=100.0 * sphere.law.bound)
    overlap = float(dem.spheres.hertz_overlap(1000.0, chain.A[-1]))
    k_t = float(stick_stiffness(law, np.sqrt(law.radius * overlap)))
    full = march_space(
        chain, wall, v0, sphere._replace(law=law), duration=2e-3, error=1e-6, n_save=400
    ).trajectory.v[:, -1]
    clamped = sphere._replace(law=law, arm_stiffness=np.full(2, np.inf), arm_rotation=np.inf)
    held = stuck_wall(wall, k_t, sphere, chain)
    none = stuck_wall(wall, 0.0, sphere, chain)
    left = beside(held, clamped, chain, v0, full)
    assert left < 1e-3  # measured 4e-5 to 3e-4
    assert beside(none, clamped, chain, v0, full) > 30 * left


def test_a_sphere_that_sticks_turns_about_its_middle_on_a_curved_surface_too():
    """Of a wall at rest: k_t R^2 / I, whatever the relative radius of the contact."""
    chain = row(preload=20.0)
    sphere = last(chain, arm_stiffness=np.full(2, np.inf), arm_rotation=0.0)
    curved = sphere._replace(law=sphere.law._replace(radius=0.25 * sphere.law.radius))
    rest = random_wall(2)._replace(phi=np.zeros((4, 3)))
    omega = stuck_wall(rest, 1e6, curved, chain).omega
    expected = float(chain.radius[-1]) * np.sqrt(1e6 / sphere.inertia)
    assert np.sum(np.abs(omega / expected - 1.0) < 1e-12) == 2


@pytest.mark.slow
def test_directions_that_do_not_act_on_each_other_leave_the_chain_alone():
    chain, v0 = row(3, preload=20.0), np.array([0.1, 0.0, 0.0])
    wall = random_wall(2)
    run = march_space(
        chain, uncoupled_wall(wall), v0, last(chain), duration=1e-3, error=1e-6, n_save=200
    ).trajectory
    along = dem.Wall(wall.omega, wall.zeta, np.ascontiguousarray(wall.phi[:, 0]), 0.0)
    alone = dem.march_to_error(chain, along, v0, duration=1e-3, error=1e-6, n_save=200)
    assert np.abs(run.v - alone.trajectory.v).max() < 1e-5 * 0.1
    coupled = march_space(chain, wall, v0, last(chain), duration=1e-3, error=1e-6, n_save=200)
    assert np.abs(coupled.trajectory.v - alone.trajectory.v).max() > 5e-4 * 0.1


@pytest.mark.slow
def test_slip_lowers_the_resonance_of_the_rig_and_damps_it():
    """Between the mode on a contact that sticks and the one without friction: the harder the shaker
    pushes, the lower the peak and the less it moves for a newton."""
    peak_hz, per_force, damping, up_down = resonance.main(
        (0.05, 2.0), n_frequencies=7, checked=(), changes=COARSE
    )
    assert peak_hz[1] < peak_hz[0] and per_force[1] < per_force[0]
    assert damping[1] > 5 * damping[0]
    assert max(up_down) < 0.05


def test_each_row_of_friction_changes_one_thing():
    rig = scene("rig-shaker")
    rows = {
        f"{case.varied} {case.value:g}": case
        for case in friction.cases(rig, (0.1,), (90.0,), (2.0,), (0.5,), (0.0,))
    }
    assert list(rows) == [
        "scene 0.2", "coefficient 0.1", "phase [deg] 180", "force [N] 2", "arm [MN/m] 1",
        "patch [mm] 0",
    ]  # fmt: skip
    assert rows["coefficient 0.1"].scene.friction.coefficient == 0.1
    assert rows["phase [deg] 180"].turn == 0.25 and rows["phase [deg] 180"].scene == rig
    assert rows["force [N] 2"].scene.shakers[0].force == 2.0
    assert rows["arm [MN/m] 1"].scene.arm.stiffness == 1e6
    assert rows["patch [mm] 0"].scene.strike.at == (0.0, 0.0)


@pytest.mark.slow
def test_slip_shows_in_later_waves_and_through_the_structures_coupling_alone():
    """On a coarse mesh as on the rig's: the first reflected wave of a contact that slips in part
    hardly moves, the later ones do; without coupled directions nothing does."""
    states, changes, mechanisms = friction.main((), (90.0,), (), (), (), COARSE)
    assert set(states) == {"partial slip"}
    for change in changes:
        assert change.arrival < 1e-7 and change.amplitude < 1e-4
        assert change.later > 20 * change.error
    uncoupled = mechanisms.pop("all but the structure's coupling")
    assert max(uncoupled.first, uncoupled.later) < uncoupled.error
    assert all(max(x.first, x.later) > 50 * x.error for x in mechanisms.values())
