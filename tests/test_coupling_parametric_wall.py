"""A wall between computed ones: a hinged beam whose modes are known."""

import numpy as np
import pytest

from coupling import CouplingError
from coupling.parametric_wall import Box, Computed, design, mac, parametric_wall
from dem import Wall

LENGTH, AT = 0.5, 0.21  # m
X = np.linspace(0.0, LENGTH, 41)


def hinged(theta, n=12):
    """Thickness, modulus and axial force of Euler and Bernoulli's beam, 40 mm wide; no stiffness
    beyond buckling."""
    h, E, N = theta
    k = np.arange(1, n + 1) * np.pi / LENGTH
    mass = 2700.0 * 0.04 * h
    squares = (E * 0.04 * h**3 / 12 * k**4 + N * k**2) / mass
    phi = np.sqrt(2.0 / (mass * LENGTH)) * np.sin(k * AT)
    wall = Wall(np.sqrt(squares), np.full(n, 0.01), phi, 1e-9 / h)
    return Computed(wall, np.sin(np.outer(X, k)))


BOX = Box(np.array([0.008, 60e9, -500.0]), np.array([0.012, 84e9, 0.0]))
SOMEWHERE = np.array([0.0093, 81e9, -420.0])


def made(degree=3, of=hinged):
    numbers = design(BOX, degree)
    return parametric_wall(BOX, numbers, [of(theta) for theta in numbers], degree)


def test_a_wall_between_computed_ones_is_the_computed_one_there():
    between, true = made()(SOMEWHERE), hinged(SOMEWHERE).wall
    np.testing.assert_allclose(between.omega[:8], true.omega[:8], rtol=1e-4)
    assert between.residual_compliance / true.residual_compliance == pytest.approx(1.0, rel=1e-4)
    compliance = [np.sum(w.phi**2 / w.omega**2) for w in (between, true)]
    assert compliance[0] / compliance[1] == pytest.approx(1.0, rel=2e-4)


def test_each_degree_is_missed_by_less_and_the_left_out_walls_say_so():
    missed = [made(degree).missed.frequency for degree in (1, 2, 3)]
    true = hinged(SOMEWHERE).wall.omega[:8]
    errors = [np.abs(made(d)(SOMEWHERE).omega[:8] / true - 1).max() for d in (1, 2, 3)]
    assert missed[0] > 3 * missed[1] > 9 * missed[2] > 0
    assert all(error < told < 100 * error for error, told in zip(errors, missed, strict=True))


def test_through_a_wall_the_error_is_of_second_order_there():
    coarse = made(1)
    moved = coarse.through(SOMEWHERE, hinged(SOMEWHERE))
    np.testing.assert_allclose(moved(SOMEWHERE).omega, hinged(SOMEWHERE).wall.omega, rtol=1e-12)
    near = SOMEWHERE * [1.002, 1.0, 1.0]
    errors = [np.abs(w(near).omega[:8] / hinged(near).wall.omega[:8] - 1).max()
              for w in (coarse, moved)]  # fmt: skip
    assert errors[1] < 0.05 * errors[0]


def test_modes_that_change_places_are_followed_by_their_shapes():
    """A mode of a body beside the beam, whose frequency crosses that of the third."""

    def crossing(theta):
        wall, shapes = hinged(theta)
        omega, phi = 2 * np.pi * 900.0 * (theta[0] / 0.01) ** -2, 0.3
        order = np.argsort([*wall.omega[:-1], omega])
        put = lambda old, new: np.append(np.append(old[:-1], new)[order], old[-1])  # noqa: E731
        beside = np.where(X < 0.1, 0.1, 0.0)
        shapes = np.column_stack([shapes[:, :-1], beside])[:, order]
        given = wall._replace(
            omega=put(wall.omega, omega), phi=put(wall.phi, phi), zeta=put(wall.zeta, 0.01)
        )
        return Computed(given, np.column_stack([shapes, hinged(theta).shapes[:, -1]]))

    places = {int(np.argmin(np.abs(crossing(x).wall.phi - 0.3))) for x in design(BOX, 3)}
    assert len(places) > 1  # it does cross
    assert made(of=crossing).missed.frequency < 3 * made().missed.frequency
    by_order = made(of=lambda theta: crossing(theta)._replace(shapes=None))
    assert by_order.missed.frequency > 0.05


@pytest.mark.parametrize(("factor", "counts"), [(1 / 1.3, False), (1.3, True)])
def test_modes_of_a_hundredth_of_the_mean_compliance_count_for_the_missed_frequency(factor, counts):
    """A mode of no polynomial's frequency in the thickness, whose compliance is that share."""

    def with_jump(theta):
        wall, shapes = hinged(theta)
        omega = 1e5 * (1.0 + 0.2 * np.sin(7e4 * theta[0]))
        mean = np.sum(wall.phi**2 / wall.omega**2) / len(wall.omega)
        phi = omega * np.sqrt(factor * 0.01 * mean)
        put = lambda old, new: np.append(new, old)  # noqa: E731
        given = wall._replace(
            omega=put(wall.omega, omega), phi=put(wall.phi, phi), zeta=put(wall.zeta, 0.01)
        )
        return Computed(given, np.column_stack([(X == X[3]).astype(float), shapes]))

    plain = made().missed.frequency
    assert (made(of=with_jump).missed.frequency > 100 * plain) == counts


def test_a_mode_that_some_walls_lack_moves_with_the_rest():
    def lacking(theta):
        wall, shapes = hinged(theta, 12 if theta[0] > 0.01 else 10)
        return Computed(wall, shapes)

    found = made(of=lacking)
    assert found.n_modes == 10
    static = [np.sum(w.phi**2 / w.omega**2) for w in (found(SOMEWHERE), hinged(SOMEWHERE).wall)]
    assert static[0] / static[1] == pytest.approx(1.0, rel=1e-3)


def test_buckling_within_the_bounds_is_refused():
    box = Box(BOX.low, np.array([0.012, 84e9, 500.0]))
    numbers = design(box, 2)
    found = parametric_wall(box, numbers, [hinged(theta) for theta in numbers], 2)
    with pytest.raises(CouplingError, match="buckling"):
        found(np.array([0.008, 60e9, -5000.0]))
    with pytest.raises(CouplingError, match="narrow the bounds"):
        parametric_wall(box, numbers[:8], [hinged(theta) for theta in numbers[:8]], 2)


def test_mac_is_one_for_the_same_shape_and_zero_for_another():
    shapes = hinged(SOMEWHERE).shapes[:, :4]
    np.testing.assert_allclose(mac(shapes, -3.0 * shapes), np.eye(4), atol=1e-12)
