"""Sensitivities of a run are the derivatives of its discrete solution, static state included.

The reference is the same scheme written a second time in numpy on complex numbers: a parameter
gets an imaginary part of 1e-30, and the imaginary part of the velocities is the derivative to
rounding (W. Squire, G. Trapp, SIAM Rev. 40 (1998) 110).
"""

import numpy as np
import pytest

from beadwave import dem
from beadwave.dem.kernels import sensitivities
from beadwave.dem.kernels.sensitivities import (
    BY_LOSS,
    BY_OVERLAP,
    BY_RATE,
    BY_STIFFNESS,
    FORCE,
    Modal,
    Slopes,
    SphereDerivatives,
)
from beadwave.dem.sensitivities import (
    Directions,
    march_with_sensitivities,
    propagator_with_sensitivities,
)
from beadwave.dem.static_sensitivities import static_sensitivities

TINY = 1e-30
N, PRELOAD, DT, STEPS = 5, 8.0, 2e-6, 250


def rig(*, preload=PRELOAD, gamma=0.05, residual=-2e-10, **fields):
    chain = dem.row_of_spheres(
        0.0127, 7800.0, 210e9, 0.3, count=N, dissipation="hunt-crossley", gamma=gamma,
        preload=preload, **fields,
    )  # fmt: skip
    two_pi = 2.0 * np.pi
    wall = dem.Wall(
        two_pi * np.array([240.0, 9000.0]), np.array([0.02, 0.1]), np.array([0.3, 0.8]), residual
    )
    return chain, wall, np.array([0.31] + [0.0] * (N - 1))


def every_parameter(chain, wall):
    """Directions along each contact, the loss, the preload, the striker and the first mode."""
    p, k = N + 6, wall.omega.size
    d = Directions(*(np.zeros((size, p)) for size in (N, N, N)), np.zeros(p), *np.zeros((3, k, p)))
    np.fill_diagonal(d.A, chain.A)
    d.gamma[:, N], d.preload[N + 1], d.v0[0, N + 2] = 1.0, 1.0, 1.0
    d.phi[0, N + 3], d.omega[0, N + 4], d.zeta[0, N + 5] = 1.0, wall.omega[0], 1.0
    return d


def complex_run(chain, A, gamma, preload, v0, omega, zeta, phi, s):
    """Velocities (steps + 1, n) by the scheme of the kernels, analytic in all arguments.

    Without leaf springs the static state has a closed form: the preload presses the last contact.
    """

    def indentation(gap):
        y = np.sqrt(gap)
        for _ in range(30):
            y = y - (y * y * (1 + s * A[-1] * y) - gap) / (y * (2 + 3 * s * A[-1] * y))
        return y * y

    def force(x, v, q, p):
        gap = np.append(x[:-1] - x[1:], x[-1] - phi @ (q + rest_q))
        d = np.where(gap.real > 0, gap, 0)
        if gap[-1].real > 0:
            d[-1] = indentation(gap[-1])
        approach = np.append(v[:-1] - v[1:], v[-1] - phi @ p)
        soft = np.append(np.ones(N - 1), 1 / (1 + 1.5 * s * A[-1] * np.sqrt(d[-1] + 0j)))
        share = 1 + gamma * approach * soft**2
        return np.where(share.real > 0, share, 0) * A * d**1.5

    def slope(x, v, q, p):
        F = force(x, v, q, p)
        net = np.append(0, F[:-1]) - F
        net[-1] += preload
        return v, net / chain.mass, phi * (F[-1] - preload)

    def turn(q, p):
        b = omega * np.sqrt(1 - zeta**2)
        c, sine = np.cos(b * DT / 2), np.sin(b * DT / 2) / b
        fade, decay = np.exp(-zeta * omega * DT / 2), zeta * omega
        return (
            fade * ((c + decay * sine) * q + sine * p),
            fade * (-(omega**2) * sine * q + (c - decay * sine) * p),
        )

    rest_q = phi * preload / omega**2
    x = np.full(N, (preload / A[-1]) ** (2 / 3) + preload * s + phi @ rest_q, complex)
    v, q, p = np.array(v0, complex), np.zeros(2, complex), np.zeros(2, complex)
    saved = [v]
    for _ in range(STEPS):
        x1, v1, p1 = slope(x, v, q, p)
        x2, v2, p2 = slope(x + DT / 2 * x1, v + DT / 2 * v1, *turn(q, p + DT / 2 * p1))
        half_q, half_p = turn(q, p)
        x3, v3, p3 = slope(x + DT / 2 * x2, v + DT / 2 * v2, half_q, half_p + DT / 2 * p2)
        x4, v4, p4 = slope(x + DT * x3, v + DT * v3, *turn(half_q, half_p + DT * p3))
        x = x + DT / 6 * (x1 + 2 * x2 + 2 * x3 + x4)
        v = v + DT / 6 * (v1 + 2 * v2 + 2 * v3 + v4)
        q, p = turn(q, p + DT / 6 * p1)
        q, p = turn(q, p + DT / 3 * (p2 + p3))
        p = p + DT / 6 * p4
        saved.append(v)
    return np.array(saved)


@pytest.fixture(params=["compiled", "plain"])
def engine(request):
    """The kernels compiled, and as they are written."""
    if request.param == "plain":
        request.getfixturevalue("plain")


@pytest.mark.usefixtures("engine")
def test_sensitivities_are_complex_step_derivatives():
    """Rounding alone parts the two: 250 steps of 1e-16 grown by the chain leave 1e-11."""
    chain, wall, v0 = rig()
    d = every_parameter(chain, wall)
    run = march_with_sensitivities(
        chain, wall, v0, d, duration=STEPS * DT, dt=DT, observed=range(N)
    )  # fmt: skip
    for j in range(d.preload.size):
        perturbed = (
            (chain.A, d.A[:, j]), (chain.gamma, d.gamma[:, j]), (PRELOAD, d.preload[j]),
            (v0, d.v0[:, j]), (wall.omega, d.omega[:, j]), (wall.zeta, d.zeta[:, j]),
            (wall.phi, d.phi[:, j]),
        )  # fmt: skip
        moved = [value + 1j * TINY * direction for value, direction in perturbed]
        reference = complex_run(chain, *moved, wall.residual_compliance)
        np.testing.assert_allclose(run.v, reference.real, rtol=0, atol=1e-11)
        exact = reference.imag / TINY
        np.testing.assert_allclose(run.dv[:, :, j], exact, rtol=0, atol=1e-9 * np.abs(exact).max())


@pytest.mark.usefixtures("plain")
@pytest.mark.parametrize("s", [0.0, 0.3, -0.05])
@pytest.mark.parametrize("rate", [0.4, -0.3, -9.0])
def test_the_force_of_a_contact_has_its_derivatives(s, rate):
    """By complex steps of (1 + gamma rate soft^2) A d^(3/2), soft = dd/dgap; of a damper that takes
    all of it nothing is left, and nothing by the rate."""
    gap, A, gamma = 0.35, 1.7, 0.8

    def force(gap, rate, A, gamma):
        y = np.sqrt(gap + 0j)
        for _ in range(30):
            y -= (y**2 + s * A * y**3 - gap) / (2 * y + 3 * s * A * y**2)
        return (1 + gamma * rate / (1 + 1.5 * s * A * y) ** 2) * A * y**3

    f, at = np.full((5, 3), 7.0), (gap, rate, A, gamma)
    columns = np.full(3, A), np.full(3, gamma)
    sensitivities.contact(gap, rate, *columns, None, s, 1, f)
    if rate == -9.0:
        assert f[FORCE, 1] == f[BY_RATE, 1] == f[BY_LOSS, 1] == 0.0
        return
    assert f[FORCE, 1] == pytest.approx(force(*at).real, rel=1e-13)
    for row, i in ((BY_OVERLAP, 0), (BY_RATE, 1), (BY_STIFFNESS, 2), (BY_LOSS, 3)):
        bent = [value + 1j * TINY * (k == i) for k, value in enumerate(at)]
        assert f[row, 1] == pytest.approx(force(*bent).imag / TINY, rel=1e-12)
    assert (f[:, [0, 2]] == 7.0).all()
    sensitivities.contact(-gap, rate, *columns, None, s, 1, f)
    assert not f[[FORCE, BY_OVERLAP, BY_STIFFNESS, BY_LOSS], 1].any()


@pytest.mark.usefixtures("plain")
def test_a_contact_without_force_has_no_sensitivity():
    """Whatever its column says of derivatives: the damper takes all of it."""
    wall = Modal(np.ones((2, 1)), np.ones((2, 1, 2)))
    spheres, f = SphereDerivatives(*np.ones((2, 3)), *np.ones((2, 3, 2))), np.ones((5, 3))
    f[FORCE] = [0.0, 2.0, 0.0]
    slopes = Slopes(*np.full((2, 3, 2), 0.5), *np.zeros((3, 1, 2)), *np.zeros((3, 2)))
    dF = np.full((3, 2), 7.0)
    sensitivities.contact_sensitivities(spheres, wall, f, np.ones(1), slopes, None, dF)
    np.testing.assert_array_equal(dF, [[0.0] * 2, [1.0] * 2, [0.0] * 2])


@pytest.mark.usefixtures("plain")
def test_a_derivative_does_not_depend_on_the_other_parameters():
    chain, wall, v0 = rig()
    all_directions = every_parameter(chain, wall)
    setting = dict(duration=20 * DT, dt=DT, observed=[0, 4])
    together = march_with_sensitivities(chain, wall, v0, all_directions, **setting)
    for j in (0, N + 3):
        single = Directions(*(values[..., j : j + 1] for values in all_directions[:-1]))
        alone = march_with_sensitivities(chain, wall, v0, single, **setting)
        np.testing.assert_allclose(alone.dv[..., 0], together.dv[..., j], rtol=1e-13)
        assert np.abs(alone.dv).max() > 0.0


LEAVES = {"leaf_stiffness": [30.0, 0.0, 90.0], "leaf_anchor": [2e-4, 0.0, -1e-5]}
PAIRS = {"wall": True, "free": False}


@pytest.mark.usefixtures("plain")
@pytest.mark.parametrize("walled", PAIRS.values(), ids=PAIRS)
@pytest.mark.parametrize("gamma", [0.3, 40.0])
def test_sensitivities_on_leaf_springs_are_those_of_differences(walled, gamma):
    """Of central ones over 1e-5 of a value; contacts that open or whose damper takes all bend the
    force, so that a few samples differ more."""
    chain = dem.row_of_spheres(
        0.01, 7800.0, 2e11, 0.3, count=3, dissipation="hunt-crossley", gamma=gamma,
        preload=1.5 if walled else 0.0, **{k: np.array(v) for k, v in LEAVES.items()},
    )  # fmt: skip
    if not walled:
        chain = chain._replace(A=chain.A[:-1], gamma=np.broadcast_to(chain.gamma, 3)[:-1])
    wall = dem.Wall(np.array([3e3, 2e4]), np.array([0.05, 1.3]), np.array([0.5, -0.8]), 2e-9)
    wall, v0 = wall if walled else None, np.array([0.3, -0.02, 0.01])
    n_contacts, k = chain.A.size, 2 * walled
    kinds = ["A", "gamma", "v0", "preload", "omega", "phi", "zeta"] if walled else [
        "A", "gamma", "v0"]  # fmt: skip
    p = len(kinds)
    sizes = (n_contacts, n_contacts, 3)
    d = Directions(*(np.zeros((s, p)) for s in sizes), np.zeros(p), *np.zeros((3, k, p)))
    size = {"A": chain.A[1], "gamma": gamma, "v0": 0.3, "preload": 1.5, "omega": 3e3, "phi": 0.5,
            "zeta": 0.05}  # fmt: skip
    for j, kind in enumerate(kinds):
        values = getattr(d, kind)
        values[(j,) if kind == "preload" else (min(1, len(values) - 1) * (kind == "A"), j)] = 1.0

    def run(j=None, step=0.0):
        def moved(kind, values):
            return values + step * getattr(d, kind)[..., j]

        if j is None:
            return march_with_sensitivities(chain, wall, v0, d, **setting)
        bent = chain._replace(A=moved("A", chain.A), gamma=moved("gamma", chain.gamma))
        bent = bent._replace(preload=float(moved("preload", chain.preload)))
        changed = wall and wall._replace(
            omega=moved("omega", wall.omega), phi=moved("phi", wall.phi),
            zeta=moved("zeta", wall.zeta),
        )  # fmt: skip
        return march_with_sensitivities(bent, changed, moved("v0", v0), **setting)

    setting = dict(duration=1.2e-4, dt=2e-6, observed=[2, 0])
    sensitivities = run()
    for j, kind in enumerate(kinds):
        h = 1e-5 * size[kind]
        up, down = run(j, h), run(j, -h)
        for ours, exact in (
            (sensitivities.dv[..., j], (up.v - down.v) / (2 * h)),
            (sensitivities.da[..., j], (up.a - down.a) / (2 * h)),
        ):
            off = np.abs(ours - exact) / np.abs(exact).max()
            assert np.quantile(off, 0.9) < 1e-5, kind
            assert off.max() < 5e-2, kind


@pytest.mark.usefixtures("plain")
def test_a_march_with_sensitivities_has_order_four():
    """Of a pressed chain on leaf springs and fast modes, whose contacts stay closed."""
    chain, wall, v0 = rig(leaf_stiffness=3e4, leaf_anchor=1e-4)
    setting = dict(duration=2e-4, observed=range(N))
    runs = [march_with_sensitivities(chain, wall, 0.01 * v0, dt=dt, **setting).v[-1]
            for dt in (8e-6, 4e-6, 2e-6)]  # fmt: skip
    exact = dem.march(chain, wall, 0.01 * v0, duration=2e-4, dt=5e-7, n_save=1).v[-1]
    errors = [np.abs(v - exact).max() for v in runs]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.all(np.abs(orders - 4.0) < 0.35) and errors[-1] < 1e-4 * 0.0031


def test_velocities_beside_sensitivities_are_those_of_march():
    """The steps are halved until openings of contacts limit both to order 2.5: 2e-5 at 1 us."""
    chain, wall, v0 = rig()
    run = march_with_sensitivities(chain, wall, v0, duration=1e-3, dt=1e-6, observed=range(N))
    engine = dem.march(chain, wall, v0, duration=1e-3, dt=2e-7, n_save=1000)
    np.testing.assert_allclose(run.v, engine.v, rtol=0, atol=2e-5 * 0.31)


def test_velocities_are_the_same_without_derivatives():
    """Two kernels of one scheme: sums in another order, 1e-16 a step."""
    chain, wall, v0 = rig(leaf_stiffness=300.0, leaf_anchor=1e-4)
    setting = dict(duration=1e-3, dt=2e-6, observed=(0, 3))
    alone = march_with_sensitivities(chain, wall, v0, **setting)
    together = march_with_sensitivities(chain, wall, v0, every_parameter(chain, wall), **setting)
    np.testing.assert_allclose(alone.v, together.v, rtol=0, atol=1e-12)
    np.testing.assert_allclose(alone.a, together.a, rtol=0, atol=1e-8)


def test_static_sensitivities_follow_the_equilibrium_on_leaf_springs():
    """Equilibrium is solved to 1e-9 of the load; differences over 1e-3 of a value leave 1e-6."""
    anchor = np.linspace(4e-6, 1e-6, N)
    chain, wall, _ = rig(leaf_stiffness=2e4, leaf_anchor=anchor)
    d = every_parameter(chain, wall)
    static = static_sensitivities(chain, wall, dem.equilibrium(chain, wall), d)

    def state(j, e):
        bent = chain._replace(A=chain.A + e * d.A[:, j], preload=PRELOAD + e * d.preload[j])
        moved = wall._replace(
            omega=wall.omega + e * d.omega[:, j], phi=wall.phi + e * d.phi[:, j]
        )  # fmt: skip
        rest = dem.equilibrium(bent, moved)
        return np.append(rest.x, [rest.force[-1], moved.phi @ rest.q])

    for j in range(d.preload.size):
        h = 1e-3
        exact = (8 * (state(j, h) - state(j, -h)) - state(j, 2 * h) + state(j, -2 * h)) / (12 * h)
        ours = np.append(static.x[:, j], [static.force[j], static.offset[j]])
        size = np.abs(exact) + 1e-5 * np.abs(np.append(np.full(N, 1e-5), [PRELOAD, 1e-6]))
        assert np.all(np.abs(ours - exact) <= 1e-5 * size)


def test_propagators_and_their_derivatives_hold_beyond_critical_damping_and_without_stiffness():
    omega, zeta, t = np.array([0.0, 50.0, 3e4, 2e3]), np.array([0.0, 1.0, 1.7, 0.3]), 1e-4
    _, by_omega, by_zeta = propagator_with_sensitivities(omega, zeta, t)
    for by, step, moved in (
        (by_zeta, 1e-4, lambda e: (omega, zeta + e)),
        (by_omega, 1e-2, lambda e: (omega + e, zeta)),
    ):
        up, down = (propagator_with_sensitivities(*moved(e), t)[0] for e in (step, -step))
        difference = (up - down) / (2 * step)
        scale = np.abs(difference).max(axis=0)
        np.testing.assert_allclose(by / scale, difference / scale, rtol=0, atol=1e-5)


def test_the_interpolated_acceleration_is_the_slope_of_the_interpolated_velocity():
    chain, wall, v0 = rig()
    run = march_with_sensitivities(chain, wall, v0, duration=5e-4, dt=1e-6, observed=[0, 3])
    t = np.linspace(1e-5, 4.8e-4, 333)
    h = 1e-9
    slope = (run.at(t + h)[0] - run.at(t - h)[0]) / (2 * h)
    kinked = np.abs((t + h) // 1e-6 - (t - h) // 1e-6) > 0
    scale = np.abs(slope).max()
    np.testing.assert_allclose(run.at(t)[1][~kinked], slope[~kinked], rtol=0, atol=1e-6 * scale)


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({"dissipation": "linear", "gamma": np.ones(N)}, "jumps at first touch"),
        ({"yield_overlap": np.full(N, 1e-6)}, "plastic contacts have no sensitivities"),
    ],
)
def test_forces_without_a_derivative_are_refused(fields, sentence):
    chain, wall, v0 = rig()
    with pytest.raises(dem.InvalidChain, match=sentence):
        march_with_sensitivities(
            chain._replace(**fields), wall, v0, duration=1e-4, dt=1e-6, observed=[0]
        )  # fmt: skip


def test_a_static_state_is_found_whatever_the_wall_and_the_leaf_springs():
    """It is the least of a convex energy, so it exists; 1e-9 of the load may stay unbalanced."""
    rng = np.random.default_rng(0)
    A = dem.row_of_spheres(0.0127, 7800.0, 210e9, 0.3, count=17).A
    for hz, leaf in [(45.0, 200.0), *np.exp(rng.uniform([1, 0], [9, 15], (100, 2)))]:
        chain = dem.row_of_spheres(
            0.0127, 7800.0, 210e9, 0.3, count=17, preload=15.0, leaf_stiffness=leaf,
            leaf_anchor=rng.choice([1.5e-3, rng.uniform(-1e-4, 1e-4)]),
        )._replace(A=A * np.exp(rng.uniform(-1, 1, 17)))  # fmt: skip
        x, force, _ = dem.equilibrium(chain, dem.one_dof_wall(hz, 2.87))
        net = (
            15.0 * (np.arange(17) == 16)
            - leaf * (x - chain.leaf_anchor)
            - np.diff(force, prepend=0.0)
        )
        assert np.abs(net).max() <= 1e-9 * (15.0 + 17 * leaf * np.abs(chain.leaf_anchor).max())
