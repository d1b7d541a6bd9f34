"""The Hertz chain against the literature: units m, A, V of the chain, time in t_s.

Each number is one of references.md: published (the source stands at the test), or exact and
reproduced there by an independent run. Section 2 is the free chain, 3 a contact, 4 the wall.
"""

import numpy as np
import pytest

from beadwave.dem import Chain, march, one_dof_wall, rigid_wall, row_of_spheres
from beadwave.dem.spheres import force_scale, hertz_coefficient, mass, time_scale
from beadwave.dem.waves.arrivals import arrivals

from known_models import speeds, unit_chain


@pytest.fixture(scope="module")
def long_chain():
    return march(unit_chain(60), None, speeds(60), duration=70.0, dt=0.05, n_save=7000)


def test_discrete_wave_is_slower_than_nesterenkos_long_wave(long_chain):
    # V. F. Nesterenko, J. Appl. Mech. Tech. Phys. 24 (1983) 733: 0.91461, references.md 2
    A_over_m, diameter = 1.0, 1.0
    long_wave = (16 / 25) ** 0.2 * A_over_m**0.4 * diameter
    assert long_wave == pytest.approx(0.91461, abs=6e-5)
    waves = [arrivals(long_chain.t, long_chain.v[:, i], threshold=0.5)[0] for i in (35, 50)]
    c = 15 / (waves[1].time - waves[0].time) / waves[0].peak_velocity ** 0.2
    assert c / long_wave == pytest.approx(0.90747 / 0.91461, abs=1e-4)


@pytest.mark.usefixtures("kernels")
def test_a_free_mass_as_wall_moves_like_one_more_bead():
    chain = row_of_spheres(0.010, 7780.0, 203e9, 0.3, count=10, flat=None)
    ten = march(chain, None, speeds(10), duration=5e-4, dt=2e-7, n_save=50)
    nine = Chain(chain.mass[:9], chain.radius[:9], chain.A)
    wall = one_dof_wall(0.0, chain.mass[0])
    run = march(nine, wall, speeds(9), duration=5e-4, dt=2e-7, n_save=50)
    assert run.v == pytest.approx(ten.v[:, :9], abs=1e-12)
    assert run.wall_v == pytest.approx(ten.v[:, 9], abs=1e-12)


def test_wall_peak_over_chain_peak():
    for factor, ratio in ((2**0.5, 1.9439), (2**1.5, 2.2384)):
        chain = unit_chain(17, A_wall=factor)
        run = march(chain, rigid_wall(), speeds(17), duration=22.0, dt=0.03, n_save=4000)
        F = run.contact_force
        assert F[:, -1].max() / 0.63955 == pytest.approx(ratio, abs=2e-3)


@pytest.mark.parametrize("speed", [0.01, 7.0])
def test_force_and_time_scale_exactly_with_speed(speed):
    chain = unit_chain(8, A_wall=1.5)
    slow = march(chain, rigid_wall(), speeds(8), duration=20.0, dt=0.05, n_save=100)
    stretch = speed**-0.2
    fast = march(
        chain,
        rigid_wall(),
        speeds(8, speed),
        duration=20.0 * stretch,
        dt=0.05 * stretch,
        n_save=100,
    )
    assert fast.v / speed == pytest.approx(slow.v, abs=1e-8)
    assert fast.contact_force / speed**1.2 == pytest.approx(slow.contact_force, abs=1e-8)


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
    ("ratio", "lowest", "highest"), [(0.2, 0.05, 0.2), (0.39, 0.005, 0.01), (0.47, 0.0, 0.005)]
)
def test_soft_walls_make_a_second_reflected_wave_that_fades_out(ratio, lowest, highest):
    # references.md 4: gone where E*_w/E*_s rises to 0.39..0.47; gone is half a percent of V
    chain = unit_chain(17, A_wall=2**1.5 / (1 + 1 / ratio))
    run = march(chain, rigid_wall(), speeds(17), duration=60.0, dt=0.05, n_save=3000)
    waves = arrivals(run.t, -run.v[:, 13], threshold=1e-3)
    first, *others = (wave.peak_velocity for wave in waves if wave.time > 20.0)
    assert first > 0.6
    assert lowest < max(others, default=0.0) + 1e-9 < highest


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
