"""A sphere on curved surfaces: the ellipse of Hertz against the potentials of its pressure."""

import numpy as np
import pytest
from scipy.integrate import quad

from beadwave.coupling import PLANE, elliptical_contact


def pressed(a, b):
    """Relative curvatures 2A, 2B, delta and P of pressure sqrt(1 - x^2/a^2 - y^2/b^2), E* = 1:
    potentials of an elliptical distribution, Johnson eqs. 3.63 and 3.64."""

    def integral(power_a, power_b):
        # w = tan^2 t maps the half line to a quarter turn
        def part(t):
            w, dw = np.tan(t) ** 2, 2 * np.tan(t) / np.cos(t) ** 2
            return dw / ((a**2 + w) ** power_a * (b**2 + w) ** power_b * np.sqrt(w))

        return a * b / 2 * quad(part, 0, np.pi / 2)[0]

    A, B, delta = integral(1.5, 0.5), integral(0.5, 1.5), integral(0.5, 0.5)
    return 2 * A, 2 * B, delta, 2 * np.pi * a * b / 3


@pytest.mark.parametrize("axes", [1.0, 1.3, 2.5, 8.0])
def test_elliptical_contacts_are_those_of_the_potentials(axes):
    """A sphere that makes an ellipse of these axes on a cylinder."""
    flat, curved, delta, P = pressed(axes, 1.0)
    sphere = 1 / flat
    curvature = curved - flat
    result = elliptical_contact(sphere, (0.0, curvature))
    assert result.axes == pytest.approx(axes, rel=1e-6)
    plane = 4 / 3 * np.sqrt(sphere) * delta**1.5
    assert result.stiffness == pytest.approx(P / plane, rel=1e-6)
    assert result.size == pytest.approx(np.sqrt(axes) / np.cbrt(0.75 * P * sphere), rel=1e-6)
    assert result.longest(1.0) == pytest.approx(axes / np.cbrt(0.75 * P * sphere), rel=1e-6)


def test_on_a_sphere_the_radius_is_that_of_both_and_in_a_hollow_it_must_fit():
    result = elliptical_contact(0.01, (1 / 0.03, 1 / 0.03))
    assert result == (pytest.approx(np.sqrt(0.75)), 1.0, pytest.approx(np.cbrt(0.75)))
    assert elliptical_contact(0.01, (0.0, -50.0)).stiffness > 1.0
    with pytest.raises(ValueError, match=r"does not fit into a hollow of radius 0\.01 m"):
        elliptical_contact(0.01, (0.0, -100.0))
    with pytest.raises(ValueError, match=r"0\.01 m does not fit into a hollow of radius 0\.009 m"):
        elliptical_contact(0.01, (0.0, -1 / 0.009))


def test_a_flat_and_a_wide_cylinder_are_planes_and_a_seat_as_wide_as_the_sphere_is_none():
    """The stiffness grows as (1 - R/R_seat)^(-1/2) towards the seat that the sphere fills."""
    assert elliptical_contact(0.01, (0.0, 0.0)) == PLANE
    for radius in (1e3, -1e3):
        wide = elliptical_contact(0.01, (0.0, 1 / radius))
        assert wide.stiffness == pytest.approx(1 - 0.01 / radius / 4, abs=1e-9)
    for seat in (0.02, 0.011, 0.0101):
        result = elliptical_contact(0.01, (-1 / seat, -1 / seat))
        assert result.stiffness == pytest.approx((1 - 0.01 / seat) ** -0.5, rel=1e-9)
