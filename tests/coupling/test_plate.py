"""Walls that carry energy away: Zener's plate and the waves in a half-space."""

import numpy as np
import pytest

from beadwave.coupling import Plate, group_speed, infinite_plate, radiated_energy, slenderness
from beadwave.coupling.radiation import lamb_integral
from beadwave.dem import Flat, march_to_error, rigid_wall, row_of_spheres

STEEL = (210e9, 0.3, 7800.0)


def test_a_point_on_an_infinite_plate_has_the_impedance_of_zener():
    """8 sqrt(D rho h) of 10 mm of steel by hand: D = 19230.8 N m, rho h = 78 kg/m^2."""
    assert 1 / infinite_plate(Plate(*STEEL, 0.01)).mobility == pytest.approx(9798.0, rel=1e-4)


@pytest.mark.parametrize(("young", "speed"), [(210e9, 0.31), (70e9, 2.0)])
@pytest.mark.parametrize(
    ("wanted", "restitution"), [(0.1, 0.84334), (0.3, 0.60595), (0.5, 0.43690), (1.0, 0.18412)]
)
def test_a_sphere_on_any_plate_rebounds_by_its_inelasticity_alone(
    young, speed, wanted, restitution
):
    """Zener's table, reached by the thickness of plates of two materials; lambda ~ 1 / h^2."""
    ball = row_of_spheres(0.0127, 7800.0, 210e9, 0.3, count=1, flat=Flat(young, 0.0))
    plate = Plate(young, 0.3, 7800.0, 0.01)
    mobility = infinite_plate(plate).mobility
    of_plate = mobility * ball.mass[0] ** 0.6 * ball.A[0] ** 0.4 * speed**0.2
    wall = infinite_plate(plate._replace(thickness=0.01 * np.sqrt(of_plate / wanted)))
    run, _ = march_to_error(ball, wall, np.array([speed]), duration=5e-4, error=1e-6)
    assert -run.v[-1, 0] / speed == pytest.approx(restitution, abs=1e-5)


def test_bending_waves_are_dispersive_until_shear_waves_stop_them():
    plate = Plate(*STEEL, 1e-3)
    slow, fast = (group_speed(plate, omega) for omega in (1e3, 4e3))
    assert fast == pytest.approx(2 * slow)
    assert group_speed(plate._replace(thickness=1.0), 1e6) == pytest.approx(3218, rel=1e-3)
    # k h ~ sqrt(h / T)
    assert slenderness(plate, 1e-4) == pytest.approx(2 * slenderness(plate, 4e-4))


def test_the_surface_wave_takes_two_thirds_of_what_a_half_space_radiates():
    """G. F. Miller, H. Pursey, Proc. R. Soc. A 233 (1955) 55: 67.4 % for nu = 1/4."""
    shares = lamb_integral(0.25)
    assert shares.surface / sum(shares) == pytest.approx(0.674, abs=5e-4)


def test_a_sphere_on_a_half_space_loses_what_hunter_found():
    """1.04 (V/c_0)^(3/5) of its energy (S. C. Hunter, J. Mech. Phys. Solids 5 (1957) 162), who took
    a sine for the force: with Hertz' force 7 % more."""
    lost = []
    for speed in (0.31, 3.1):
        ball = row_of_spheres(0.0127, 7800.0, 210e9, 0.25, count=1, flat=Flat(210e9, 0.25))
        run, _ = march_to_error(ball, rigid_wall(), np.array([speed]), duration=1.3e-4, error=1e-6)
        lost.append(
            radiated_energy(run.t, run.contact_force[:, 0], 210e9, 0.25, 7800.0)
            / run.energy_kinetic[0]
        )
    assert lost[1] / lost[0] == pytest.approx(10**0.6, rel=1e-3)
    hunter = 1.04 * (0.31 / np.sqrt(210e9 / 7800.0)) ** 0.6
    assert lost[0] == pytest.approx(hunter, rel=0.08)
