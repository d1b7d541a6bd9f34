"""The Hertz chain against the literature: units m, A, V of the chain, time in t_s.

Each number is one of references.md: published (the source stands at the test), or exact and
reproduced there by an independent run. Section 2 is the free chain, 3 a contact, 4 the wall.
"""

import numpy as np
import pytest

from dem import Chain, dashpot_wall, march, one_dof_wall, rigid_wall, row_of_spheres
from dem.spheres import force_scale, hertz_coefficient, mass, time_scale
from dem.waves.arrivals import arrivals, passage, velocity_sum_ratio
from known_models import speeds, unit_chain


@pytest.fixture(scope="module")
def long_chain():
    return march(unit_chain(60), None, speeds(60), duration=70.0, dt=0.05, n_save=7000)


def test_solitary_wave_has_published_velocity_speed_and_force(long_chain):
    # V. F. Nesterenko, Dynamics of Heterogeneous Materials (2001); C. Daraio et al. (2006)
    t, v, F = long_chain.t, long_chain.v, long_chain.contact_force
    waves = [arrivals(t, v[:, i], threshold=0.5)[0] for i in (35, 50)]
    assert waves[0].peak_velocity == pytest.approx(0.68163, abs=5e-5)
    speed = 15 / (waves[1].time - waves[0].time)
    assert speed == pytest.approx(0.84051, abs=5e-5)
    assert speed / waves[0].peak_velocity ** 0.2 == pytest.approx(0.90747, abs=5e-5)
    assert F[:, 40].max() == pytest.approx(0.63955, abs=5e-5)
    assert F[:, 40].max() / 0.68163**1.2 == pytest.approx(1.01302, abs=2e-4)
    assert waves[0].width * speed == pytest.approx(1.579, abs=2e-3)
    assert arrivals(t, F[:, 40])[0].width * speed == pytest.approx(1.412, abs=2e-3)


def test_discrete_wave_is_slower_than_nesterenkos_long_wave(long_chain):
    # V. F. Nesterenko, J. Appl. Mech. Tech. Phys. 24 (1983) 733: 0.91461, references.md 2
    A_over_m, diameter = 1.0, 1.0
    long_wave = (16 / 25) ** 0.2 * A_over_m**0.4 * diameter
    assert long_wave == pytest.approx(0.91461, abs=6e-5)
    waves = [arrivals(long_chain.t, long_chain.v[:, i], threshold=0.5)[0] for i in (35, 50)]
    found = 15 / (waves[1].time - waves[0].time) / waves[0].peak_velocity ** 0.2
    assert found / long_wave == pytest.approx(0.90747 / 0.91461, abs=1e-4)


def test_displacement_profile_is_that_of_sen_and_manciu(long_chain):
    # S. Sen, M. Manciu, Phys. Rev. E 64 (2001) 056605
    t, x = long_chain.t, long_chain.x[:, 40]
    wave = arrivals(t, long_chain.v[:, 40])[0]
    a = 0.84051 * (t - wave.time)
    near = np.abs(a) < 3.0
    f = 2.39536 * a + 0.268529 * a**3 + 0.0061347 * a**5
    profile = 0.5 * (1.0 + np.tanh(f[near] / 2.0))
    # their fit is good to 2.6e-4, the wave's time to 1e-5
    assert np.abs(x[near] / 1.35430 - profile).max() < 2.65e-4
    assert x[-1] == pytest.approx(1.35430, abs=5e-5)


def test_wave_carries_the_published_share_of_energy_and_momentum(long_chain):
    k = np.searchsorted(long_chain.t, 55.0)
    v, F = long_chain.v[k], long_chain.contact_force[k]
    stored = 0.4 * F ** (5.0 / 3.0)
    ahead = slice(30, 60)
    kinetic, potential = 0.5 * (v[ahead] ** 2).sum(), stored[29:].sum()
    assert (kinetic + potential) / 0.5 == pytest.approx(0.99366, abs=5e-5)
    assert v[ahead].sum() == pytest.approx(1.13831, abs=5e-5)


def test_virial_theorem_shares_energy_five_to_four(long_chain):
    window = (long_chain.t > 40.0) & (long_chain.t < 40.0 + 15 / 0.84051)
    ratio = long_chain.energy_contact[window].mean() / long_chain.energy_kinetic[window].mean()
    # the recoiling spheres hold 0.0063 of kinetic energy and no potential energy
    assert ratio == pytest.approx(4 / 5 * (1 - 0.0063 / (5 / 9)), abs=2e-3)


def test_first_spheres_recoil(long_chain):
    recoil = [-0.07109, -0.03027, -0.01583, -0.00889, -0.00513]
    assert long_chain.v[-1, :5] == pytest.approx(recoil, abs=2e-5)


@pytest.mark.parametrize(
    ("ratio", "share"), [(0.5, 0.86492), (2.0, 0.96120), (5.0, 0.71353), (10.0, 0.48407)]
)
def test_leading_wave_of_unequal_striker(ratio, share):
    chain = unit_chain(60)
    chain.mass[0] = ratio
    run = march(chain, None, speeds(60), duration=55.0, dt=0.05, n_save=550)
    v, F = run.v[-1], run.contact_force[-1]
    gap = int(v.argmax()) - 1
    while F[gap] > 1e-3 * F.max() and F[gap] >= F[gap - 1]:
        gap -= 1
    stored = 0.4 * F ** (5.0 / 3.0)
    energy = 0.5 * (v[gap + 1 :] ** 2).sum() + stored[gap:].sum()
    assert energy / (0.5 * ratio) == pytest.approx(share, abs=2e-3)


def test_ten_steel_beads_end_like_the_published_run():
    # Siconos tutorials, ChainOfBalls/MonodisperseChainOfBalls-LZBModel.ref
    published = [
        -0.071059, -0.030186, -0.015750, -0.008808, -0.005062,
        -0.002937, -0.001702, 0.002625, 0.146923, 0.985956,
    ]  # fmt: skip
    chain = row_of_spheres(0.010, 7780.0, 203e9, 0.3, count=10, flat=None)
    run = march(chain, None, speeds(10), duration=5e-4, dt=2e-7, n_save=10)
    assert run.v[-1] == pytest.approx(published, abs=1e-3)


def test_a_bead_as_wall_is_a_bead():
    chain = row_of_spheres(0.010, 7780.0, 203e9, 0.3, count=10, flat=None)
    ten = march(chain, None, speeds(10), duration=5e-4, dt=2e-7, n_save=50)
    nine = Chain(chain.mass[:9], chain.radius[:9], chain.A)
    wall = one_dof_wall(0.0, chain.mass[0])
    run = march(nine, wall, speeds(9), duration=5e-4, dt=2e-7, n_save=50)
    assert run.v == pytest.approx(ten.v[:, :9], abs=1e-12)
    assert run.wall_v == pytest.approx(ten.v[:, 9], abs=1e-12)


def test_single_hertz_impact_on_a_flat():
    # duration and force of H. Hertz (1882): T = 3.21807 m^0.4 A^-0.4 v^-0.2
    chain = Chain(np.array([2.0]), np.array([1.0]), np.array([5.0]))
    run = march(chain, rigid_wall(), speeds(1, 0.3), duration=4.0, dt=2e-3, n_save=4000)
    closed = np.flatnonzero(run.contact_force[:, 0] > 0.0)
    t_s, F_s = time_scale(2.0, 5.0, 0.3), force_scale(2.0, 5.0, 0.3)
    assert run.t[closed[-1]] - 0.0 == pytest.approx(3.21807 * t_s, abs=2e-3)
    assert run.contact_force.max() == pytest.approx(1.14326 * F_s, rel=1e-5)
    assert run.v[-1, 0] == pytest.approx(-0.3, abs=1e-8)


def test_chung_and_ooi_elastic_glass_spheres():
    # Y. C. Chung, J. Y. Ooi, Granular Matter 13 (2011) 643, test 1
    chain = row_of_spheres(0.010, 2800.0, 48e9, 0.2, count=2, flat=None)
    v0 = np.array([10.0, -10.0])
    run = march(chain, None, v0, duration=5e-5, dt=2e-8, n_save=2500)
    closed = np.flatnonzero(run.contact_force[:, 0] > 0.0)
    assert run.contact_force.max() == pytest.approx(10.697e3, rel=1e-4)
    assert (run.x[:, 0] - run.x[:, 1]).max() == pytest.approx(274.11e-6, rel=1e-4)
    assert run.t[closed[-1]] == pytest.approx(40.34e-6, abs=3e-8)


def test_chain_on_a_rigid_wall_is_half_of_a_head_on_collision():
    n = 9
    half = unit_chain(n, A_wall=2.0**1.5)
    both = unit_chain(2 * n)
    v0 = np.concatenate([speeds(n), -speeds(n)[::-1]])
    one = march(half, rigid_wall(), speeds(n), duration=25.0, dt=0.05, n_save=100)
    two = march(both, None, v0, duration=25.0, dt=0.05, n_save=100)
    assert one.v == pytest.approx(two.v[:, :n], abs=1e-12)
    assert two.v[:, n:] == pytest.approx(-two.v[:, :n][:, ::-1], abs=1e-12)


@pytest.mark.parametrize(
    ("factor", "t_wall", "F_wall", "reflected_14", "reflected_4", "last"),
    [
        (2**0.5, 20.6250, 1.24324, (-0.64969, 24.8966), (-0.83747, 37.1003), -0.99256),
        (2**1.5, 20.2776, 1.43158, (-0.65665, 24.1637), (-0.83492, 36.3673), -0.99247),
        (3 * 2**1.5, 19.7917, 1.46293, (-0.67927, 23.4955), (-0.83243, 35.7023), -0.99218),
    ],
)
def test_seventeen_beads_and_a_wall(factor, t_wall, F_wall, reflected_14, reflected_4, last):
    chain = unit_chain(17, A_wall=factor)
    run = march(chain, rigid_wall(), speeds(17), duration=90.0, dt=0.03, n_save=9000)
    wall = arrivals(run.t, run.contact_force[:, -1])[0]
    assert (wall.time, wall.peak_velocity) == pytest.approx((t_wall, F_wall), abs=2e-4)
    fourth, fourteenth = passage(run.t, run.v[:, 3]), passage(run.t, run.v[:, 13])
    assert fourth.incident[:2] == pytest.approx((4.3296, 0.69865), abs=2e-4)
    assert fourteenth.reflected[1::-1] == pytest.approx(reflected_14, abs=2e-4)
    assert fourth.reflected[1::-1] == pytest.approx(reflected_4, abs=2e-4)
    assert run.v[-1, 0] == pytest.approx(last, abs=2e-5)
    if factor == 2**1.5:
        assert velocity_sum_ratio(run.v[0], run.v[-1]) == pytest.approx(1.36, abs=0.01)


def test_wall_peak_over_chain_peak():
    for factor, ratio in ((2**0.5, 1.9439), (2**1.5, 2.2384)):
        chain = unit_chain(17, A_wall=factor)
        run = march(chain, rigid_wall(), speeds(17), duration=22.0, dt=0.03, n_save=4000)
        F = run.contact_force
        assert F[:, -1].max() / 0.63955 == pytest.approx(ratio, abs=2e-3)


@pytest.mark.parametrize("speed", [0.01, 7.0])
def test_force_and_time_scale_exactly_with_speed(speed):
    chain = unit_chain(8, A_wall=1.5)
    one = march(chain, rigid_wall(), speeds(8), duration=20.0, dt=0.05, n_save=100)
    stretch = speed**-0.2
    other = march(
        chain,
        rigid_wall(),
        speeds(8, speed),
        duration=20.0 * stretch,
        dt=0.05 * stretch,
        n_save=100,
    )
    assert other.v / speed == pytest.approx(one.v, abs=1e-8)
    assert other.contact_force / speed**1.2 == pytest.approx(one.contact_force, abs=1e-8)


def test_falcon_column_hits_the_wall_like_one_bead():
    # E. Falcon, C. Laroche, S. Fauve, C. Coste, Eur. Phys. J. B 5 (1998) 111
    single = march(unit_chain(1, 1.4), rigid_wall(), np.ones(1), duration=5.0, dt=0.01)
    for n in (2, 5, 12):
        column = march(
            unit_chain(n, 1.4), rigid_wall(), np.ones(n), duration=4.0 * n, dt=0.02, n_save=4000
        )
        ratio = column.contact_force[:, -1].max() / single.contact_force.max()
        assert ratio == pytest.approx(1.0240, abs=5e-4)


@pytest.mark.parametrize(
    ("inelasticity", "restitution"),
    [(0.1, 0.84334), (0.3, 0.60595), (0.5, 0.43690), (1.0, 0.18412)],
)
def test_zener_restitution_on_a_plate(inelasticity, restitution):
    # C. Zener, Phys. Rev. 59 (1941) 669; lambda = alpha m^0.6 A^0.4 v^0.2
    m, A, v = 0.0669, 1.7e10, 0.31
    alpha = inelasticity / (m**0.6 * A**0.4 * v**0.2)
    chain = Chain(np.array([m]), np.array([0.0127]), np.array([A]))
    t_s = time_scale(m, A, v)
    run = march(chain, dashpot_wall(1 / alpha), speeds(1, v), duration=12 * t_s, dt=t_s / 100)
    assert -run.v[-1, 0] / v == pytest.approx(restitution, abs=1e-5)
    assert run.energy_error < 1e-8


def test_falcon_column_stays_at_the_wall_for_longer_with_every_bead():
    # E. Falcon et al. (1998): the duration grows about linearly with N
    n_beads = np.array([4, 8, 12, 16, 20])
    seconds = []
    for n in n_beads:
        run = march(unit_chain(n, 1.4), rigid_wall(), np.ones(n), duration=4.0 * n, dt=0.02)
        pressed = np.flatnonzero(run.contact_force[:, -1] > 0.0)
        seconds.append(run.t[pressed[-1]])
    slope, start = np.polyfit(n_beads, seconds, 1)
    assert slope > 1.0
    assert seconds == pytest.approx(slope * n_beads + start, rel=0.02)


@pytest.mark.parametrize(
    ("ratio", "least", "most"), [(0.2, 0.05, 0.2), (0.39, 0.005, 0.01), (0.47, 0.0, 0.005)]
)
def test_soft_walls_make_a_second_reflected_wave_that_fades_out(ratio, least, most):
    # references.md 4: gone where E*_w/E*_s rises to 0.39..0.47; gone is half a percent of V
    chain = unit_chain(17, A_wall=2**1.5 / (1 + 1 / ratio))
    run = march(chain, rigid_wall(), speeds(17), duration=60.0, dt=0.05, n_save=3000)
    waves = arrivals(run.t, -run.v[:, 13], threshold=1e-3)
    first, *others = (wave.peak_velocity for wave in waves if wave.time > 20.0)
    assert first > 0.6
    assert least < max(others, default=0.0) + 1e-9 < most


def test_rig_numbers():
    m, A = mass(0.0127, 7800.0), hertz_coefficient(0.0127, 210e9, 0.3, 0.0127, 210e9, 0.3)
    assert m == pytest.approx(0.0669, abs=5e-5)
    assert A == pytest.approx(1.226e10, rel=2e-4)
    assert time_scale(m, A, 0.31) == pytest.approx(39.5e-6, rel=1e-3)
    assert 0.63955 * force_scale(m, A, 0.31) == pytest.approx(336, abs=1)
    assert 0.84051 * 0.0254 / time_scale(m, A, 0.31) == pytest.approx(541, abs=1)
    flat = hertz_coefficient(0.0127, 210e9, 0.3, np.inf, 210e9, 0.3)
    assert flat / A == pytest.approx(2**0.5)
    assert hertz_coefficient(0.0127, 210e9, 0.3) / A == pytest.approx(2**1.5)
    for stiffness, peak in ((2**0.5, 653.0), (2**1.5, 752.0)):
        chain = row_of_spheres(0.0127, 7800.0, 210e9, 0.3, count=17)
        chain.A[-1] = stiffness * A
        run = march(chain, rigid_wall(), speeds(17, 0.31), duration=1e-3, dt=1e-6)
        assert run.contact_force[:, -1].max() == pytest.approx(peak, abs=1.0)
