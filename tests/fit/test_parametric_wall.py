"""A wall between computed ones: a hinged beam whose modes are known."""

import numpy as np
import pytest

from beadwave.coupling import CouplingError
from beadwave.coupling.reduced_wall import wall_from_reduced
from beadwave.dem import Wall
from beadwave.dem.space import Structure
from beadwave.rom import Surface, full_order, modal
from beadwave.workflows.fit.parametric_wall import (
    Bounds,
    ComputedWall,
    Layout,
    design,
    left_out_errors,
    mac,
    matched_modes,
    modes_and_rest,
    nearest_modes,
    parametric_wall,
    with_rest,
)

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
    return ComputedWall(wall, np.sin(np.outer(X, k)))


BOX = Bounds(np.array([0.008, 60e9, -500.0]), np.array([0.012, 84e9, 0.0]))
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


def test_walls_that_leave_out_no_mode_do_not_spoil_those_between():
    """Walls of 12 or 13 modes, the last of which joins the rest: its frequency is interpolated
    between those that have one. Twelve modes stay those of the closed form."""
    rng = np.random.default_rng(0)

    def varied(theta):
        computed = hinged(theta, int(rng.choice([12, 13])))
        wall, omega = computed.wall, computed.wall.omega
        rest = wall._replace(
            omega=np.append(omega, 10 * omega.max()),
            zeta=np.append(wall.zeta, 0.0),
            phi=np.append(wall.phi, 0.0),
        )
        return ComputedWall(rest, computed.shapes)

    between = made(of=varied)
    for theta in design(BOX, 3, seed=1):
        wall, true = between(theta), hinged(theta, 13).wall
        np.testing.assert_allclose(wall.omega[:8], true.omega[:8], rtol=2e-3)
        assert wall.omega[-1] > 0.5 * true.omega[-1]


def test_each_degree_is_missed_by_less_and_the_left_out_walls_say_so():
    missed = [made(degree).missed.frequency for degree in (1, 2, 3)]
    true = hinged(SOMEWHERE).wall.omega[:8]
    errors = [np.abs(made(d)(SOMEWHERE).omega[:8] / true - 1).max() for d in (1, 2, 3)]
    assert missed[0] > 3 * missed[1] > 9 * missed[2] > 0
    assert all(e < expected < 100 * e for e, expected in zip(errors, missed, strict=True))


def test_through_a_wall_the_error_is_of_second_order_there():
    coarse = made(1)
    moved = coarse.through(SOMEWHERE, hinged(SOMEWHERE))
    np.testing.assert_allclose(moved(SOMEWHERE).omega, hinged(SOMEWHERE).wall.omega, rtol=1e-12)
    nearby = SOMEWHERE * [1.002, 1.0, 1.0]
    errors = [np.abs(w(nearby).omega[:8] / hinged(nearby).wall.omega[:8] - 1).max()
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
        return ComputedWall(given, np.column_stack([shapes, hinged(theta).shapes[:, -1]]))

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
        return ComputedWall(given, np.column_stack([(X == X[3]).astype(float), shapes]))

    plain = made().missed.frequency
    assert (made(of=with_jump).missed.frequency > 100 * plain) == counts


def test_a_mode_that_some_walls_lack_moves_with_the_rest():
    def lacking(theta):
        wall, shapes = hinged(theta, 12 if theta[0] > 0.01 else 10)
        return ComputedWall(wall, shapes)

    result = made(of=lacking)
    assert result.layout.k == 9  # and the rest
    static = [np.sum(w.phi**2 / w.omega**2) for w in (result(SOMEWHERE), hinged(SOMEWHERE).wall)]
    assert static[0] / static[1] == pytest.approx(1.0, rel=1e-3)


def test_buckling_within_the_bounds_is_refused():
    box = Bounds(BOX.low, np.array([0.012, 84e9, 500.0]))
    numbers = design(box, 2)
    result = parametric_wall(box, numbers, [hinged(theta) for theta in numbers], 2)
    with pytest.raises(CouplingError, match="buckling"):
        result(np.array([0.008, 60e9, -5000.0]))
    with pytest.raises(CouplingError, match="narrow the bounds"):
        parametric_wall(box, numbers[:8], [hinged(theta) for theta in numbers[:8]], 2)


def test_mac_is_one_for_the_same_shape_and_zero_for_another():
    shapes = hinged(SOMEWHERE).shapes[:, :4]
    np.testing.assert_allclose(mac(shapes, -3.0 * shapes), np.eye(4), atol=1e-12)


# --- each step on its own ------------------------------------------------------------------------


def test_a_box_is_bent_where_a_number_varies_by_factors_above_a_twentieth():
    """Halfway is the geometric mean there, else the arithmetic one; both ends are -1 and 1."""
    low, high = np.array([1.0, 1.0, 0.0, -4.0, 0.25]), np.array([1.06, 1.04, 8.0, -1.0, 16.0])
    box = Bounds(low, high)
    middle = [np.sqrt(1.06), 1.02, 4.0, -2.5, 2.0]
    np.testing.assert_allclose(box.at(np.zeros(5)), middle, rtol=1e-14)
    fifth = [1.06**0.6, 1.024, 4.8, -2.2, 0.25 * 64**0.6]
    np.testing.assert_allclose(box.at(np.full(5, 0.2)), fifth, rtol=1e-14)
    np.testing.assert_allclose(box.unit(np.array([low, high, middle, fifth])),
                               np.outer([-1.0, 1.0, 0.0, 0.2], np.ones(5)), atol=1e-13)  # fmt: skip
    assert np.ptp(box.at(np.array([[-1.0] * 5, [1.0] * 5])), axis=0) == pytest.approx(high - low)


def test_numbers_of_large_size_are_no_factors():
    """2.1e11 and 2.15e11 lie within a twentieth: the middle is the arithmetic one."""
    box = Bounds(np.array([2.1e11]), np.array([2.15e11]))
    assert box.at(np.zeros(1))[0] == pytest.approx(2.125e11, rel=1e-12)


@pytest.mark.parametrize(("d", "degree", "n"), [(3, 3, 32), (2, 3, 16), (1, 9, 16)])
def test_walls_are_computed_evenly_in_the_angle_to_the_bounds(d, degree, n):
    """1.6 a coefficient beside the middle; by each number, one in each n-th of a half turn."""
    box = Bounds(np.full(d, -3.0), np.full(d, 5.0))
    numbers = design(box, degree)
    np.testing.assert_array_equal(numbers[0], np.ones(d))
    assert numbers.shape == (n + 1, d)
    angle = np.arccos(box.unit(numbers[1:])) / np.pi
    np.testing.assert_array_equal(np.sort(np.floor(angle * n), axis=0), np.outer(range(n), [1] * d))
    assert len(design(Bounds(np.zeros(2), np.ones(2)), 2)) == 11  # 6 coefficients


def dropped(numbers, walls, degree, i):
    """The wall at the i-th numbers from all other walls."""
    rest = [j for j in range(len(walls)) if j != i]
    return parametric_wall(BOX, numbers[rest], [walls[j] for j in rest], degree)(numbers[i])


def test_what_polynomials_miss_is_what_walls_left_out_are_missed_by():
    numbers = design(BOX, 1)[::-1]  # the first wall says which modes there are
    walls = [hinged(theta, 3) for theta in numbers]
    walls = [ComputedWall(with_rest(w.wall, None).wall, w.shapes) for w in walls]
    result = parametric_wall(BOX, numbers, walls, 1)
    frequency, compliance, largest = [], [], []
    for i, item in enumerate(walls):
        said, true = dropped(numbers, walls, 1, i), item.wall
        share = (true.phi[:3] / true.omega[:3]) ** 2
        frequency.append(0.5 * np.abs((said.omega[:3] / true.omega[:3]) ** 2 - 1.0))
        compliance.append(np.sum((said.phi[:3] / said.omega[:3]) ** 2) / share.sum() - 1.0)
        largest.append(share)
    heavy = np.mean(largest, axis=0) > 0.01 * np.mean(largest, axis=0).sum() / 4
    assert heavy.any() and result.n_walls == len(walls) and result.layout.k == 3
    worst = np.max(frequency, axis=0)[heavy].max()
    assert result.missed.frequency == pytest.approx(worst, rel=1e-8)
    assert result.missed.compliance == pytest.approx(np.abs(compliance).max(), rel=1e-8)


def test_a_wall_more_than_coefficients_is_enough():
    numbers = design(BOX, 2)
    walls = [hinged(theta) for theta in numbers]
    assert parametric_wall(BOX, numbers[:11], walls[:11], 2).n_walls == 11
    with pytest.raises(CouplingError, match="10 walls could be computed within the bounds, 11 are"):
        parametric_wall(BOX, numbers[:10], walls[:10], 2)


def constant(squares, phi2, zeta, residual=0.3):
    """A parametric wall of these quantities of its modes everywhere, and no rest."""
    numbers = np.linspace(-1.0, 1.0, 4)[:, None]
    wall = with_rest(Wall(*np.ones((3, len(squares))), 1.0), None).wall
    data = parametric_wall(
        Bounds(np.array([-1.0]), np.array([1.0])), numbers, [ComputedWall(wall)] * 4, 1
    )
    values = np.concatenate([squares, phi2, zeta, [0.0, 0.0, 0.0, residual]])
    return data._replace(coefficients=np.outer([1.0, 0.0], values))


def test_numbers_below_zero_are_none_and_stiffness_below_zero_is_refused():
    """Down to -1e-9 of the largest square of a frequency, whatever the unit of time."""
    for unit in (1e-12, 1.0, 1e12):
        squares = unit * np.array([-0.9e-9, 0.01, 1.0])
        result = constant(squares, [0.04, -1e-3, 0.25], [-0.1, 0.3, 0])
        wall = result(np.zeros(1))
        expected = np.sqrt(unit) * np.array([0, 0.1, 1])
        np.testing.assert_allclose(wall.omega[:3], expected, rtol=1e-12)
        np.testing.assert_allclose(wall.phi, [0.2, 0.0, 0.5, 0.0], rtol=1e-12)
        np.testing.assert_allclose(wall.zeta, [0.0, 0.3, 0.0, 0.0], rtol=1e-12)
        assert wall.residual_compliance == pytest.approx(0.3)
        with pytest.raises(CouplingError, match="buckling"):
            constant(unit * np.array([-1.1e-9, 0.01, 1.0]), *np.ones((2, 3)))(np.zeros(1))


def test_a_wall_is_moved_by_the_same_everywhere():
    """Through a wall with a mode more, in another order: what is not ours is in the last."""
    coarse, true = made(1), hinged(SOMEWHERE, 13)
    moved = coarse.through(SOMEWHERE, true)
    exact = modes_and_rest(true.wall, np.arange(11)).as_wall(true.wall)
    for piece in ("omega", "phi", "zeta"):
        np.testing.assert_allclose(
            np.abs(getattr(moved(SOMEWHERE), piece)), np.abs(getattr(exact, piece)), rtol=1e-9
        )
    assert moved(SOMEWHERE).residual_compliance / exact.residual_compliance == pytest.approx(1.0)
    earlier = coarse(SOMEWHERE).omega[:11] ** 2
    second = np.array([0.011, 70e9, -90.0])
    shift = moved(second).omega[:11] ** 2 - coarse(second).omega[:11] ** 2
    np.testing.assert_allclose(shift, exact.omega[:11] ** 2 - earlier, rtol=1e-6)
    assert (moved.degrees == coarse.degrees).all() and moved.missed == coarse.missed


def test_through_a_wall_with_fewer_modes_the_others_take_no_part():
    """Two modes fewer than around it: the moved wall answers a force as the true one does."""
    coarse, true = made(1), hinged(SOMEWHERE, 9)
    wall = coarse.through(SOMEWHERE, true)(SOMEWHERE)
    assert wall.omega.size == coarse.layout.k + 1 > true.wall.omega.size
    f = 2 * np.pi * np.geomspace(10.0, 2e4, 50)[:, None]
    result, exact = (
        (w.phi**2 / (w.omega**2 - f**2 + 2j * w.zeta * w.omega * f)).sum(axis=1)
        for w in (wall, true.wall)
    )  # fmt: skip
    np.testing.assert_allclose(result, exact, rtol=1e-9)
    assert wall.residual_compliance == pytest.approx(true.wall.residual_compliance)


def shaped(shapes, n=None):
    """A wall of as many modes as shapes, and the oscillator for the rest."""
    n = shapes.shape[1] if n is None else n
    return ComputedWall(Wall(*np.ones((3, n + 1))), shapes)


def test_modes_are_the_same_from_a_mac_of_a_fifth():
    e = np.eye(4)
    for much, same in ((2.0, 0), (2.01, -1)):  # 1 / (1 + 2^2)
        second = shaped(e[:, [0]] + much * e[:, [1]])
        np.testing.assert_array_equal(matched_modes(shaped(e[:, [0]]), second), [same])
    first, turned = shaped(e[:, :3]), shaped(e[:, [2, 0, 3, 1]])
    np.testing.assert_array_equal(matched_modes(first, turned), [1, 3, 0])
    np.testing.assert_array_equal(matched_modes(turned, first), [2, 0, -1, 1])


def test_the_order_counts_for_a_twentieth_of_a_mac():
    """Two modes turned by an angle: exchanged where sin^2 is above cos^2 by more than that."""
    for share, places in ((0.52, [0, 1]), (0.53, [1, 0])):  # 2 share - 1 beside 0.05
        c, s = np.sqrt(1 - share), np.sqrt(share)
        turned = shaped(np.array([[c, -s], [s, c]]))
        np.testing.assert_array_equal(matched_modes(shaped(np.eye(2)), turned), places)


def test_modes_without_shapes_to_compare_are_followed_by_their_order():
    e = np.eye(4)
    first, second = shaped(e[:, :3]), shaped(e[:, [1, 0]])
    for a, b in ((first._replace(shapes=None), second), (first, second._replace(shapes=None)),
                 (first, second._replace(shapes=e[:3, [1, 0]]))):  # fmt: skip
        np.testing.assert_array_equal(matched_modes(a, b), [0, 1, -1])


def test_the_mac_of_a_shape_that_does_not_move_is_none():
    shapes = np.array([[1.0, 0.0, 2.0], [2.0, 0.0, 0.0]])
    np.testing.assert_allclose(mac(shapes, shapes[:, :2]), [[1, 0], [0, 0], [0.2, 0]], rtol=1e-14)


def test_modes_nearest_in_octaves_are_the_same():
    mine = np.array([2.0, 9.0, 40.0])
    given = Wall(np.array([50.0, 0.0, 8.0, 4.4, 1.0, 9.0]), *np.zeros((2, 6)))
    np.testing.assert_array_equal(nearest_modes(mine, given), [[0, 1, 2], [4, 2, 0]])
    few = Wall(np.array([9.0, 2.1, 30.0]), *np.zeros((2, 3)))
    np.testing.assert_array_equal(nearest_modes(mine, few), [[0, 1], [1, 0]])


@pytest.mark.parametrize(("share", "counts"), [(0.9e-9, False), (1.1e-9, True)])
@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_modes_of_a_billionth_of_the_largest_square_are_rigid(share, counts, unit):
    """Squares of omega and phi of two modes; the first is missed by 2 % where it counts."""
    given = np.array([share * unit, unit, 2.0, 1.0, 0, 0, 0, 0, 0, 0])
    values = np.tile(given, (3, 1))
    said = values.copy()
    said[0, 0] *= 1.04
    result = left_out_errors(values, said, Layout(2, 1))
    assert result.frequency == pytest.approx(0.02 if counts else 0.0, abs=1e-12)
    assert result.compliance == pytest.approx(1 - 1 / 1.04 if counts else 0.0, abs=1e-8)


def many_masses(n=6, rows=1300):
    K = 4e6 * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    reduced = full_order(K, np.diag(np.linspace(1.0, 2.0, n)), np.eye(n)[-1])
    T = np.random.default_rng(3).standard_normal((rows, n))
    return reduced._replace(surface=Surface(np.zeros((rows // 3, 3)), np.zeros((0, 3), int), T))


def test_a_wall_of_all_modes_gets_a_silent_oscillator_for_the_rest():
    reduced = many_masses()
    wall = wall_from_reduced(reduced, half_space=0.0)._replace(zeta=np.full(6, 0.1))
    for result in (with_rest(wall, None), with_rest(wall, reduced)):
        np.testing.assert_array_equal(result.wall.phi, [*wall.phi, 0.0])
        np.testing.assert_array_equal(result.wall.zeta, [*wall.zeta, 0.0])
        np.testing.assert_array_equal(result.wall.omega[:6], wall.omega)
        assert result.wall.omega[6] > wall.omega[5]
    assert with_rest(wall, None).shapes is None
    assert with_rest(wall, reduced._replace(surface=None)).shapes is None


def test_a_wall_with_an_oscillator_for_the_rest_is_taken_as_it_is():
    """Shapes of its own modes, on every other row of 1300."""
    reduced = many_masses()
    modes = modal(reduced)
    hz = (modes.omega[3] + modes.omega[4]) / (4 * np.pi)
    wall = wall_from_reduced(reduced, half_space=0.0, cutoff_hz=hz)
    result = with_rest(wall, reduced)
    assert result.wall is wall and len(wall.omega) == 5
    np.testing.assert_allclose(result.shapes, reduced.surface.T[::2] @ modes.vectors[:, :4])
    few = many_masses(rows=900)
    np.testing.assert_allclose(with_rest(wall, few).shapes, few.surface.T @ modes.vectors[:, :4])


# --- several contacts ----------------------------------------------------------------------------


def at_two_points(theta, n=12):
    """The beam read at two points, with the half-spaces there."""
    wall, shapes = hinged(theta, n)
    k = np.arange(1, n + 1) * np.pi / LENGTH
    mass = 2700.0 * 0.04 * theta[0]
    phi = np.sqrt(2.0 / (mass * LENGTH)) * np.sin(np.outer([AT, 0.34], k))
    residual = np.array([[1e-9, 0.0], [2e-9, 0.0]]) / theta[0]
    normal = np.tile([0.0, 0.0, 1.0], (2, 1))
    return ComputedWall(
        Structure(wall.omega, wall.zeta, phi, np.arange(2), normal, residual), shapes
    )


def receptances(structure, f):
    """(k, 2, 2) [m/N] of the points at the angular frequencies f (k,)."""
    w, z, phi = structure.omega, structure.zeta, structure.phi
    D = w**2 - f[:, None] ** 2 + 2j * z * w * f[:, None]
    return np.einsum("ij,kj,lj->kil", phi, 1 / D, phi)


def test_receptances_between_two_contacts_keep_their_signs_between_computed_structures():
    between, true = made(of=at_two_points)(SOMEWHERE), at_two_points(SOMEWHERE).wall
    f = 2 * np.pi * np.geomspace(20.0, 2e3, 60)
    expected, result = receptances(true, f), receptances(between, f)
    assert (expected[:, 0, 1].real < 0).any() and (expected[:, 0, 1].real > 0).any()
    np.testing.assert_allclose(result, expected, rtol=0, atol=6e-3 * np.abs(expected).max())
    np.testing.assert_allclose(between.residual, true.residual, rtol=1e-4)


def test_two_oscillators_stand_for_the_rest_of_a_structure_with_both_moments():
    wall = at_two_points(SOMEWHERE).wall
    result = modes_and_rest(wall, np.arange(5)).as_wall(wall)
    assert len(result.omega) == 7
    for power in (2, 4):
        moments = [(w.phi / w.omega**power) @ w.phi.T for w in (wall, result)]
        np.testing.assert_allclose(moments[1], moments[0], rtol=1e-12)


def test_through_a_structure_its_receptances_are_exact():
    coarse, true = made(1, at_two_points), at_two_points(SOMEWHERE)
    result = coarse.through(SOMEWHERE, true)(SOMEWHERE)
    exact = modes_and_rest(true.wall, np.arange(10)).as_wall(true.wall)
    f = 2 * np.pi * np.geomspace(20.0, 2e3, 60)
    expected = receptances(exact, f)
    np.testing.assert_allclose(
        receptances(result, f), expected, rtol=0, atol=1e-9 * np.abs(expected).max()
    )


def test_a_structure_of_all_modes_gets_silent_oscillators_for_each_contact():
    wall = at_two_points(SOMEWHERE).wall
    result = with_rest(wall, None).wall
    assert len(result.omega) == len(wall.omega) + 2
    np.testing.assert_array_equal(result.phi[:, -2:], 0.0)
