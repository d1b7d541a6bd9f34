"""Values at the ends of steps, and the polynomials between them, as plain Python: compared with
differences of a finer march, polynomials by numpy and quadratures."""

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from beadwave.dem import Chain, Wall, dashpot_wall, rigid_wall
from beadwave.dem.between import chain_and_wall, run_between
from beadwave.dem.kernels import between as kernels
from beadwave.dem.kernels.arguments import Steps
from beadwave.dem.kernels.between import InterpolatedStates
from beadwave.dem.kernels.ends import (
    CONTACTS,
    DASHPOT,
    WALL,
    Ends,
    Gaps,
    empty_step_ends,
    fill_ends,
)
from beadwave.dem.kernels.events import crossing
from beadwave.dem.prepared import prepare
from beadwave.dem.schemes import named_scheme
from beadwave.dem.trajectory import marched, run, start

from known_models import speeds

pytestmark = pytest.mark.usefixtures("plain")

ROW = Chain(np.array([1.0, 0.8, 1.3]), np.ones(3), np.array([1.2, 1.5, 1.7]))
MODES = Wall(np.array([0.4, 1.1]), np.array([0.3, 0.05]), np.array([0.4, -0.7]))
LEAVES = {"leaf_stiffness": np.array([0.4, 0.1, 0.2]), "leaf_anchor": np.array([1.5, 0.4, 0.3])}
PRESSED = ROW._replace(preload=0.3, **LEAVES)


def loss(*gamma):
    return {"dissipation": "hunt-crossley", "gamma": np.array(gamma)}


SCENES = {
    "free": (ROW._replace(A=ROW.A[:-1]), None),
    "rigid": (ROW, rigid_wall()),
    "modes": (ROW, MODES),
    "pressed": (PRESSED, MODES),
    "residual": (PRESSED, MODES._replace(residual_compliance=0.1)),
    "dashpot": (ROW, dashpot_wall(0.5)),
    "hunt-crossley": (PRESSED._replace(**loss(0.1, 0.3, 0.2)), MODES),
    "weight": (ROW._replace(gravity=0.2, **LEAVES), MODES),
}


def ends_of(scene, v0, dt, n):
    """The march of a scene and what is known at its ends."""
    chain, wall = SCENES[scene]
    prepared = prepare(chain, wall)
    state = start(prepared, v0)
    run = marched(prepared, state, Steps(dt, n, 1), named_scheme(None, chain, wall), speeds=True)
    ends = empty_step_ends(run.saved)
    fill_ends(run.saved, chain_and_wall(prepared, run.arrays), dt, ends)
    return run.saved, ends


def agree(derivative, values, dt, allowed=1e-5):
    """Assert that they are the derivatives of values by differences of order four."""
    exact = (8 * (values[3:-1] - values[1:-3]) - (values[4:] - values[:-4])) / (12 * dt)
    size = np.abs(exact).max(axis=0) + 1e-6
    np.testing.assert_allclose(derivative[2:-2] / size, exact / size, rtol=0, atol=allowed)
    return exact


@pytest.mark.parametrize("scene", ["pressed", "hunt-crossley", "residual", "weight"])
def test_derivatives_at_the_ends_of_steps_are_those_of_the_march(scene):
    """Of a pressed chain, whose contacts stay closed."""
    dt = 0.02
    saved, at_ends = ends_of(scene, [0.1, -0.05, 0.02], dt, 80)
    assert saved.force.min() > 0.0
    for bodies, x in ((at_ends.spheres, saved.x), (at_ends.modes, saved.modes)):
        v = saved.v if bodies is at_ends.spheres else saved.speeds
        agree(bodies.v, x, dt)
        agree(bodies.a, v, dt)
        agree(bodies.j, bodies.a, dt)
    np.testing.assert_array_equal(at_ends.spheres.x, saved.x)
    behind = np.column_stack([saved.x, saved.wall[:, 0]])
    np.testing.assert_allclose(at_ends.gaps.overlap, behind[:, :-1] - behind[:, 1:], atol=1e-14)
    agree(at_ends.gaps.rate, at_ends.gaps.overlap, dt)
    agree(at_ends.gaps.bend, at_ends.gaps.rate, dt)
    agree(at_ends.slow.a, at_ends.slow.v, dt, 1e-4)
    wall = SCENES[scene][1]
    if scene == "hunt-crossley":  # of the others the damped force is not saved apart
        lost = np.abs(agree(at_ends.slow.v, at_ends.slow.x, dt, 1e-3)).max(axis=0)
        assert lost[CONTACTS] > 1e-5 and lost[WALL] > 5e-6
    if scene != "hunt-crossley":
        agree(at_ends.force_rate, saved.force, dt)
    power = 2 * (wall.zeta * wall.omega * saved.speeds**2).sum(axis=1)
    np.testing.assert_allclose(at_ends.slow.v[:, WALL], power, rtol=1e-12)
    agree(at_ends.slow.j[1:-1], at_ends.slow.a[1:-1], dt, 1e-2)
    ends = at_ends.slow.a[[1, -1]] - at_ends.slow.a[[0, -2]]
    np.testing.assert_allclose(at_ends.slow.j[[0, -1]], ends / dt, rtol=1e-12)


def test_forces_of_damped_contacts_have_their_rates():
    """F (1 + gamma w), by differences of it; where the damper takes all, none."""
    dt = 0.005
    chain = ROW._replace(**LEAVES, **loss(0.1, 4.0, 0.2))
    SCENES["strong"] = chain, rigid_wall()
    _, at_ends = ends_of("strong", [0.0, -0.3, 0.5], dt, 200)
    overlap, w = at_ends.gaps.overlap, at_ends.gaps.rate
    share = np.maximum(1 + chain.gamma * w, 0.0)
    elastic = chain.A * np.maximum(overlap, 0.0) ** 1.5
    force = elastic * share
    exact = np.gradient(force, dt, axis=0)
    inside = (share[:-2] > 0) & (share[2:] > 0) & (overlap[:-2] > 0.01) & (overlap[2:] > 0.01)
    off = np.abs(at_ends.force_rate[1:-1] - exact[1:-1]) / np.abs(exact).max()
    assert off[inside].max() < 1e-3 and inside.sum() > 200
    overruled = (share == 0) & (elastic > 0)
    assert overruled.any() and not at_ends.force_rate[overruled].any()
    power = np.where(share > 0, elastic * chain.gamma * w**2, -elastic * w).sum(axis=1)
    np.testing.assert_allclose(at_ends.slow.v[:, CONTACTS], power, rtol=1e-9, atol=1e-12)
    smooth = np.abs(np.diff((share > 0).sum(axis=1) + 10 * (overlap > 0).sum(axis=1))) == 0
    smooth = smooth[:-1] & smooth[1:]
    rate = np.gradient(power, dt)[1:-1]
    off = np.abs(at_ends.slow.a[1:-1, CONTACTS] - rate) / np.abs(rate).max()
    assert off[smooth].max() < 1e-2 and off[smooth & overruled.any(axis=1)[1:-1]].size > 5


def test_way_and_power_of_a_dashpot_follow_from_the_force_at_the_wall():
    """m F and m F^2, with their rates."""
    dt = 0.01
    saved, at_ends = ends_of("dashpot", speeds(3), dt, 400)
    F, mobility = saved.force[:, -1], SCENES["dashpot"][1].mobility
    moved = at_ends.slow.x[:, DASHPOT]
    np.testing.assert_allclose(moved, saved.wall[:, 0], atol=1e-15)
    closed = (F[:-4] > 0.05) & (F[4:] > 0.05)
    for rates, values in (
        (at_ends.slow.v[:, DASHPOT], moved), (at_ends.slow.a[:, DASHPOT], mobility * F),
        (at_ends.slow.v[:, WALL], at_ends.slow.x[:, WALL]),
        (at_ends.slow.a[:, WALL], mobility * F**2),
    ):  # fmt: skip
        exact = (8 * (values[3:-1] - values[1:-3]) - (values[4:] - values[:-4])) / (12 * dt)
        off = np.abs(rates[2:-2] - exact)[closed] / np.abs(exact).max()
        assert off.max() < 2e-2 and np.median(off) < 1e-3
    np.testing.assert_allclose(at_ends.slow.v[:, WALL], mobility * F**2, rtol=1e-12)


# --- polynomials ---------------------------------------------------------------------------------

SEVEN = Polynomial([0.3, -1.0, 2.0, 0.7, -0.4, 0.9, -0.6, 0.35])


def of_degree_seven(ends):
    """The polynomial with a value and three derivatives (2, 4) at 0 and 1."""
    power = np.arange(8)
    rows = [Polynomial(np.eye(8)[k]).deriv(d)(s) if d else s**k
            for s in (0, 1) for d in range(4) for k in power]  # fmt: skip
    return Polynomial(np.linalg.solve(np.reshape(rows, (8, 8)), np.ravel(ends)))


def test_between_two_ends_lies_the_polynomial_of_degree_seven():
    h, steps, samples = 0.8, 3, 10
    t = h * np.arange(steps + 1)
    derivatives = [SEVEN.deriv(d)(t) if d else SEVEN(t) for d in range(4)]
    ends = Ends(*(np.column_stack([values, -2 * values]) for values in derivatives))
    x, v = np.empty((2, samples + 1, 2))
    kernels.fill_between(ends, h, x, v)
    at = np.linspace(0, t[-1], samples + 1)
    np.testing.assert_allclose(x, np.outer(SEVEN(at), [1, -2]), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(v, np.outer(SEVEN.deriv()(at), [1, -2]), rtol=1e-12, atol=1e-12)


def test_samples_lie_on_the_polynomials_of_their_steps():
    """Of three steps that are no one polynomial; the last sample ends the last step."""
    h, n = 0.8, 10
    ends = Ends(*np.random.default_rng(2).standard_normal((4, 4, 2)))
    x, v = np.empty((2, n, 2))
    kernels.fill_between(ends, h, x, v)
    for b in range(2):
        hermite = np.array([values[:, b] * h**d for d, values in enumerate(ends)]).T
        polynomials = [of_degree_seven(hermite[i : i + 2]) for i in range(3)]
        for k in range(n):
            i = min(k // 3, 2)
            P, s = polynomials[i], k / 3 - i
            np.testing.assert_allclose((x[k, b], h * v[k, b]), (P(s), P.deriv()(s)), atol=1e-11)


@pytest.mark.parametrize("bend", [0.0, 0.6, -0.4])
def test_a_contact_moves_bodies_by_the_second_integral_of_its_force(bend):
    h, t = 1e-4, np.array([0.2, 0.9, 1.3])
    force = t**1.5 + bend * t**2.5

    def moved(t):
        return np.array([kernels.risen(time, bend) for time in t]).T

    middle, up, down = moved(t), moved(t + h), moved(t - h)
    # three roundings
    np.testing.assert_allclose(middle[2], force, rtol=1e-14)
    np.testing.assert_allclose((up - down)[:3] / (2 * h), middle[1:], rtol=1e-6)
    assert kernels.risen(0.0, bend) == (0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("bend", [0.0, -0.4])
@pytest.mark.parametrize("at", [-0.6, -0.1, 0.0, 0.35])
def test_a_contact_that_opens_or_closes_leaves_its_difference_to_the_hermite_polynomial(at, bend):
    ends = [kernels.risen(max(s - at, 0.0), bend) for s in (0.0, 1.0)]
    P = of_degree_seven(ends)
    for z in (0.1, 0.3, 0.5, 0.8, 0.97):
        u = kernels.risen(max(z - at, 0.0), bend)
        exact = u[0] - P(z), u[1] - P.deriv()(z)
        np.testing.assert_allclose(kernels.unfollowed(z, at, bend), exact, rtol=0, atol=4e-13)


def gaps_of(t, g):
    """Two contacts, the second one with overlap g at times t, the first one never near."""
    derivatives = (g(t), g.deriv()(t), g.deriv(2)(t))
    return Gaps(*(np.column_stack([-9.0 + 0 * t, values]) for values in derivatives))


@pytest.mark.parametrize("h", [1.0, 0.3])
@pytest.mark.parametrize("back", [False, True])
def test_a_contact_touches_where_its_overlap_has_its_root(h, back):
    """Within the step by the cubic, in the one before by the parabola; from the end it opens."""
    t = h * np.arange(2.0)
    ways = (1, 0) if back else (0, 1)

    def seen(g):
        """g in shares of the step from the end that it is seen from."""
        s = Polynomial([1.0, -1.0 / h] if back else [0.0, 1.0 / h])
        return kernels.touch(h, *ways, 1, gaps_of(t, g(s)))

    inside = seen(Polynomial([-0.2, 0.9, 0.3]))
    exact = crossing(-0.2, 0.9, 1.0, 1.5)
    np.testing.assert_allclose(inside, exact, rtol=1e-12)
    parabola = Polynomial([0.1, 0.8, 0.05])
    root = max(parabola.roots())
    earlier = seen(parabola)
    assert earlier.at == pytest.approx(root, abs=2e-5)
    assert earlier.slope == pytest.approx(0.8 + 0.1 * earlier.at, rel=1e-12)
    assert earlier.curvature == pytest.approx(0.1, rel=1e-12)
    assert seen(Polynomial([0.1, 0.4, 0.1])).at < -0.25  # more than the line's, whose slope falls
    for g, slope in (([0.699, 1.0], 1.0), ([0.701, 1.0], 0.0), ([0.2, -0.1], 0.0),
                     ([-0.3, 0.1], 0.0), ([0.1, 0.5, -0.7], 0.0)):  # fmt: skip
        assert seen(Polynomial([*g, *[0.0] * (3 - len(g))])).slope == pytest.approx(slope)
    steep = seen(Polynomial([0.6, 1.0, 0.7]))  # nowhere: its least is above 0
    assert -1.0 <= steep.at <= 0.0 and steep.slope == max(1.0 + 1.4 * steep.at, 0.0)


def test_the_bodies_of_a_contact_take_its_impulse():
    prepared = prepare(*SCENES["modes"])
    bodies = chain_and_wall(prepared, marched(
        prepared, start(prepared, speeds(3)), Steps(0.1, 1, 1), named_scheme("rkn6", ROW, MODES)
    ).arrays)  # fmt: skip
    for c in range(3):
        moved = InterpolatedStates(*np.zeros((2, 2, 3)), *np.zeros((2, 2, 2)), *np.zeros((2, 2, 4)))
        kernels.move(1, c, 0.3, -0.7, bodies, moved)
        for way, sphere, mode in ((0.3, moved.x, moved.q), (-0.7, moved.v, moved.p)):
            exact = np.zeros(3)
            exact[c] = -way / ROW.mass[c]
            if c < 2:
                exact[c + 1] = way / ROW.mass[c + 1]
            np.testing.assert_allclose(sphere[1], exact, rtol=1e-14)
            np.testing.assert_allclose(mode[1], MODES.phi * way * (c == 2), rtol=1e-14)
            assert not sphere[0].any() and not mode[0].any()


@pytest.mark.parametrize("gamma", [0.0, 0.3, -9.0, 9.0])
@pytest.mark.parametrize("curvature", [0.5, 2.5, -1.9])
@pytest.mark.parametrize("back", [False, True])
def test_a_sample_is_moved_by_what_its_contact_does_in_its_step(back, curvature, gamma):
    """A contact that closes in the last of three steps or opens in the first, of ten samples: force
    A slope^(3/2) (tau^(3/2) + 3/4 curvature / slope tau^(5/2)) (1 + gamma rate), in its step alone;
    the bend no more than 1, and no force of a damper that would pull."""
    h, n, A = 0.4, 11, np.array([2.0, 1.5, 1.7])
    overlap, rate = np.full((2, 4, 3), -1.0)
    overlap[:, 1] = [-0.9, -0.6, -0.2, 0.5]
    rate[:, 1] = np.array([0.1, 0.5, 0.4, 0.4 + curvature]) / h
    if back:
        overlap, rate = overlap[::-1].copy(), -rate[::-1]
    gaps = Gaps(overlap, rate, 0 * rate)
    prepared = prepare(*SCENES["modes"])
    bodies = chain_and_wall(prepared, marched(
        prepared, start(prepared, speeds(3)), Steps(0.1, 1, 1), named_scheme("rkn6", ROW, MODES)
    ).arrays)._replace(A=A, gamma=np.array([5.0, gamma, 7.0]))  # fmt: skip
    moved = InterpolatedStates(*np.zeros((2, n, 3)), *np.zeros((2, n, 2)), *np.zeros((2, n, 4)))
    kernels.mend_events(gaps, h, bodies, moved)
    sign = -1.0 if back else 1.0
    at, slope, bent = crossing(-0.2, 0.4, 0.5, 0.4 + curvature)
    size = A[1] * slope**1.5 * max(1.0 + sign * gamma * slope / h, 0.0) * h * h
    for k in range(n):
        s = 0.3 * k - (0.0 if back else 2.0)
        dx, dv = 0.0, 0.0
        if 0.0 < s < 1.0:
            z, bend = 1 - s if back else s, np.clip(0.75 * bent / slope, -1, 1)
            dx, dv = kernels.unfollowed(z, at, bend)
        shift, impulse = size * dx, sign * size / h * dv
        for value, exact in ((moved.x[k], shift), (moved.v[k], impulse)):
            by_mass = np.array([0.0, -exact / ROW.mass[1], exact / ROW.mass[2]])
            # Newton's method ends at steps of 1e-13 with the crossing, from which 1e-12 comes here
            np.testing.assert_allclose(value, by_mass, rtol=1e-11, atol=1e-16)
    assert not moved.q.any() and (np.abs(moved.x[:, 1]).max() > 1e-8) == (size > 0.0)


# --- samples -------------------------------------------------------------------------------------


@pytest.mark.parametrize("scene", [*SCENES])
def test_samples_between_steps_are_those_of_finer_ones(scene):
    """Contacts open and close; at every third sample a step ends."""
    chain, wall = SCENES[scene]
    duration, n = 6.0, 60
    prepared, scheme = prepare(chain, wall), named_scheme(None, chain, wall)
    state = start(prepared, speeds(3))
    found = run_between(prepared, state, duration, duration / n, scheme, 3 * n)
    assert found.n_steps == n
    exact = run(prepared, state, duration, duration / n / 9, scheme, 3 * n)
    ends = run(prepared, state, duration, duration / n, scheme, n)
    for name in ("x", "v", "contact_force", "wall_x", "wall_v"):
        ours, at_ends, true = (np.asarray(getattr(r, name)) for r in (found, ends, exact))
        np.testing.assert_allclose(ours[::3], at_ends, rtol=0, atol=1e-12)
        off = np.abs(at_ends - true[::3]).max()
        more = 4e-6 if scene in ("dashpot", "residual") else 2e-8
        assert np.abs(ours - true).max() <= 2 * off + more, name
    for name in ("dissipated_wall", "dissipated_contact", "energy_wall", "energy_total"):
        np.testing.assert_allclose(
            getattr(found, name), getattr(exact, name), rtol=0, atol=3e-5, err_msg=name
        )
    np.testing.assert_allclose(found.wall_q, exact.wall_q, atol=1e-5)
    assert found.energy_error == pytest.approx(ends.energy_error, rel=1e-9, abs=1e-14)
