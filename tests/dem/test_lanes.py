"""Chains in lanes, as plain Python: each march beside that of its chain alone, by other kernels,
and the vector forms of laws beside those of one number."""

import math

import numpy as np
import pytest

from beadwave.dem import Chain, Chains, Wall, march, march_batch, rigid_wall
from beadwave.dem.dense import velocities_between
from beadwave.dem.kernels import lanes as kernels
from beadwave.dem.kernels import laws
from beadwave.dem.kernels.dense import StepEnd, cubic, cubic_slope, quintic, quintic_slope
from beadwave.dem.kernels.lanes import LANES, LaneDamping, Lanes, WallPush, WallSprings
from beadwave.dem.lanes import blocks_of

pytestmark = pytest.mark.usefixtures("plain")

N, COUNT = 3, 3
RNG = np.random.default_rng(4)
MODES = Wall(
    RNG.uniform(0.5, 3.0, (COUNT, 2)), RNG.uniform(0.05, 0.3, (COUNT, 2)),
    np.array([[0.6, 0.3], [0.5, -0.7], [0.4, 0.8]]),
)  # fmt: skip
SPRUNG = MODES._replace(residual_compliance=np.array([0.05, -0.05, 0.1]))
LEAVES = {"leaf_stiffness": np.array([0.4, 0.1, 0.2]), "leaf_anchor": np.array([0.5, 0.1, 0.05])}
PRESSED = LEAVES | {"preload": np.array([0.1, 0.2, 0.4])}


def damped(law, *gamma):
    return {"dissipation": law, "gamma": np.array(gamma)}


CASES = {
    "bare": (rigid_wall(), {}),
    "free": (None, {}),
    "modes": (MODES, {}),
    "pressed": (MODES, PRESSED),
    "sprung": (SPRUNG, PRESSED),
    "falling": (SPRUNG, {"gravity": np.array([0.3, 0.0, 0.1]), "n_falling": 1}),
    "hunt-crossley": (MODES, PRESSED | damped("hunt-crossley", 0.3, 0.1, 0.2)),
    "strong": (rigid_wall(), damped("hunt-crossley", 9.0, 3.0, 6.0)),
    "damped spring": (SPRUNG, damped("hunt-crossley", 0.2, 0.0, 0.4)),
    "linear": (SPRUNG, damped("linear", 0.2, 0.1, 0.3)),
    "linear-clipped": (MODES, damped("linear-clipped", 0.3, 0.1, 4.0)),
    "free linear": (None, damped("linear", 0.2, 0.5)),
}  # fmt: skip


def chains(case):
    """The second one starts at rest."""
    wall, fields = CASES[case]
    rng = np.random.default_rng(1)
    A = rng.uniform(0.9, 1.6, (COUNT, N if wall else N - 1))
    v0 = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [1.4, 0.2, -0.1]])
    return Chains(Chain(rng.uniform(0.8, 1.3, (COUNT, N)), np.full(N, 0.5), A, **fields), wall, v0)


def scheme_of(case):
    return "suzuki4" if CASES[case][1].get("dissipation") else "rkn6"


@pytest.mark.parametrize("case", CASES)
def test_a_chain_in_a_lane_is_the_chain_alone(case):
    """At the ends of steps: velocities, the force at the wall, what is lost and not accounted for.
    Rounding alone parts the two, and roots that both find to 1e-12."""
    many, options = chains(case), dict(duration=5.0, dt=0.1, n_save=10, scheme=scheme_of(case))
    batch = march_batch(many, **options)
    opened = 0
    for i in range(COUNT):
        alone = march(*many[i], **options)
        np.testing.assert_allclose(batch.v[i], alone.v, rtol=0, atol=1e-12)
        at_wall = np.zeros(11) if many.free else alone.contact_force[:, -1]
        np.testing.assert_allclose(batch.wall_force[i], at_wall, rtol=0, atol=1e-12)
        assert abs(batch.energy_error[i] - alone.energy_error) < 1e-12
        assert i == 1 or alone.energy_error > 1e-11  # so that there is something to compare
        opened += np.count_nonzero(alone.contact_force == 0.0)
    assert opened > 0


@pytest.mark.parametrize("case", ["bare", "pressed", "sprung", "hunt-crossley", "damped spring"])
def test_samples_lie_on_the_polynomials_of_the_steps(case):
    """Velocities on that of degree five of every sphere, the force at the wall by that of the last
    one and the cubic of the wall: five samples to two steps."""
    many, n_steps, n_save, duration = chains(case), 20, 50, 2.0
    h, n_ends = duration / n_steps, n_steps + 1
    batch = march_batch(many, duration=duration, dt=h, n_save=n_save, scheme=scheme_of(case))
    assert batch.n_steps == n_steps
    for i in range(COUNT):
        chain, wall, v0 = many[i]
        run = march(chain, wall, v0, duration=duration, dt=h, n_save=n_steps, scheme=batch.scheme)
        k, anchor = chain.springs
        force = np.pad(run.contact_force, ((0, 0), (1, 0)))
        load = chain.steady - k * (run.x - anchor)
        a = (load - np.diff(force, axis=1)) / chain.mass
        np.testing.assert_allclose(
            batch.v[i], velocities_between(run.x, run.v, a, h, n_save), rtol=0, atol=1e-11
        )
        for sample in range(n_save + 1):
            step = min(sample * n_steps // n_save, n_ends - 2)
            s = sample * n_steps / n_save - step
            start, end = (StepEnd(run.x[e, -1], run.v[e, -1], a[e, -1]) for e in (step, step + 1))
            ends = run.wall_x[step], run.wall_v[step], run.wall_x[step + 1], run.wall_v[step + 1]
            gap = quintic(s, h, start, end) - cubic(s, h, *ends)
            w = quintic_slope(s, h, start, end) - cubic_slope(s, h, *ends)
            residual = 0.0 if wall.residual_compliance == 0.0 else float(wall.residual_compliance)
            F = laws.hertz_force(
                laws.wall_indentation(N - 1, gap, chain.A, residual or None, None), chain.A[-1]
            )
            if chain.dissipation == "hunt-crossley" and F > 0.0:
                stiffness = laws.contact_stiffness(N - 1, F, chain.A, None, None)
                F += max(chain.gamma[-1] * F * w / (1 + residual * stiffness) ** 2, -F)
            if s not in (0.0, 1.0):  # there as the march has it
                assert abs(batch.wall_force[i, sample] - F) < 1e-10


def lanes_of(x, v, A, springs=(), **parts):
    """One contact at a wall in every lane: x, v (2, LANES) of the sphere and the wall."""
    none = np.zeros(0)
    fields = dict.fromkeys(Lanes._fields, none) | {
        "x": np.ravel(x), "v": np.ravel(v), "f": np.zeros(2 * LANES), "A": A,
        "springs": WallSprings(*springs) if springs else WallSprings(none, none),
    } | parts  # fmt: skip
    return Lanes(**fields)


@pytest.mark.parametrize("s", [0.3, 1e-9, 1e6, -0.05])
def test_springs_of_all_lanes_are_those_of_one_contact(s):
    """Up to the fold, and beyond it, where no force answers; touching contacts beside open ones."""
    A = np.linspace(1.0, 2.0, LANES)
    fold = -2 / (3 * A * s) if s < 0 else np.full(LANES, np.inf)
    reach = fold**2 / 3 if s < 0 else np.full(LANES, 3.0)
    gap = reach * np.r_[-0.5, 0.0, 1e-12, 1e-3, np.linspace(0.1, 0.98, LANES - 5), 0.999]
    f = np.zeros(2 * LANES)
    springs = WallSprings(np.full(LANES, s), fold)
    kernels.forces_of_lanes(np.r_[gap + 0.2, np.full(LANES, 0.2)], A, None, springs, f)
    exact = [
        laws.hertz_force(laws.hertz_indentation(g, k, s), k)
        for g, k in zip((gap + 0.2) - 0.2, A, strict=True)
    ]
    np.testing.assert_allclose(f[LANES:], exact, rtol=1e-7 if s < 0 else 1e-12, atol=1e-300)
    assert not f[:LANES].any() and (f[LANES:] > 0).sum() >= LANES - 3
    if s < 0:
        kernels.forces_of_lanes(np.r_[1.001 * reach, 0 * reach], A, None, springs, f)
        assert np.isnan(f[LANES:]).all()


def test_open_contacts_before_springs_have_no_force():
    f = np.zeros(2 * LANES)
    springs = WallSprings(np.full(LANES, -0.3), np.full(LANES, 0.1))
    kernels.forces_of_lanes(
        np.r_[np.zeros(LANES), np.full(LANES, 0.2)], np.ones(LANES), None, springs, f
    )
    assert not f.any()


def test_one_contact_before_a_soft_spring_is_solved_among_open_ones():
    f, x = np.zeros(2 * LANES), np.zeros(2 * LANES)
    x[9] = 0.8
    springs = WallSprings(np.full(LANES, 2.0), np.full(LANES, np.inf))
    kernels.forces_of_lanes(x, np.full(LANES, 1.7), None, springs, f)
    exact = laws.hertz_force(laws.hertz_indentation(0.8, 1.7, 2.0), 1.7)
    np.testing.assert_allclose(f[LANES:], np.where(np.arange(LANES) == 9, exact, 0.0), rtol=1e-14)


@pytest.mark.parametrize("dt", [0.5, 1.0, 2.0])
def test_lanes_of_verlet_are_chains_alone(dt):
    """Drifts and kicks as long as the unit of time among them."""
    A = 0.02 * RNG.uniform(0.9, 1.6, (COUNT, N))
    v0 = np.array([[1.0, 0.0, 0.0], [1.4, 0.2, -0.1], [0.3, 0.9, 0.5]])
    many = Chains(Chain(np.array([1.0, 0.8, 1.3]), np.full(N, 0.5), A), rigid_wall(), v0)
    options = dict(duration=8.0, dt=dt, n_save=4, scheme="verlet")
    batch = march_batch(many, **options)
    for i in range(COUNT):
        alone = march(*many[i], **options)
        np.testing.assert_allclose(batch.v[i], alone.v, rtol=0, atol=1e-13)
        assert alone.contact_force.max() > 1e-3


@pytest.mark.parametrize("law", [laws.LINEAR, laws.LINEAR_CLIPPED, laws.HUNT_CROSSLEY])
@pytest.mark.parametrize("weak", [True, False])
@pytest.mark.parametrize("pulls", [True, False])
def test_dampers_of_all_lanes_are_those_of_one_contact(law, weak, pulls):
    """By the series where all are weak and none would pull, else each by its own formula."""
    inverse, dt = np.linspace(0.7, 1.9, LANES), 0.25
    strongest = 0.0999 if weak else 3.0
    rate = np.linspace(0.0, strongest, LANES) / (inverse * dt)
    v = np.zeros((2, LANES))
    v[0] = np.linspace(-4.0 if pulls else -0.05, 0.8, LANES)
    damping = LaneDamping(rate, inverse, law, np.zeros(LANES), rate)
    force = np.full(2 * LANES, 0.3)
    lanes = lanes_of(np.zeros((2, LANES)), v, np.ones(LANES), damping=damping, f=force)
    impulses = np.zeros(LANES)
    kernels.damping_impulses(0, dt, lanes, impulses)
    clipped = law != laws.LINEAR
    exact = [
        laws.damping_impulse(w, dt, 0.3, c, m, clipped)
        for w, c, m in zip(v[0], rate, inverse, strict=True)
    ]
    np.testing.assert_allclose(impulses, exact, rtol=2e-14, atol=1e-300)


@pytest.mark.parametrize(("rate", "approach"), [(12.0, 0.4), (0.5, -4.0)])
def test_one_strong_or_clipped_damper_in_a_row_takes_the_exact_formula(rate, approach):
    """Among weak ones, which the series is for."""
    c, v = np.full(LANES, 0.01), np.zeros((2, LANES))
    v[0], c[5], v[0, 5] = np.linspace(0.1, 0.8, LANES), rate, approach
    damping = LaneDamping(c, np.ones(LANES), laws.LINEAR_CLIPPED, np.zeros(LANES), c)
    lanes = lanes_of(np.zeros((2, LANES)), v, np.ones(LANES), damping=damping,
                     f=np.full(2 * LANES, 0.3))  # fmt: skip
    impulses = np.zeros(LANES)
    kernels.damping_impulses(0, 0.25, lanes, impulses)
    exact = [laws.damping_impulse(w, 0.25, 0.3, k, 1.0, True) for w, k in zip(v[0], c, strict=True)]
    np.testing.assert_allclose(impulses, exact, rtol=2e-14)


@pytest.mark.parametrize("closes", [True, False])
def test_one_contact_that_opens_or_closes_is_noticed_in_a_row_of_lanes(closes):
    gaps, touching = np.r_[np.zeros(LANES), np.full(LANES, 0.2)], np.zeros(2 * LANES)
    touching[LANES:] = 0.2
    touching[7] = 0.3
    pair = (gaps, touching) if closes else (touching, gaps)
    assert kernels.crossed_row(*pair, 0) and not kernels.crossed_row(gaps, gaps, 0)
    assert not kernels.crossed_row(touching, touching + 0.01, 0)
    edge, earlier = np.zeros(2 * LANES), gaps - 0.1 * (np.arange(2 * LANES) == 7)
    for x, crosses in ((touching, True), (gaps, False), (earlier, False), (edge, False)):
        edge[:], edge[7] = gaps, 0.2  # the 8th one touches without overlap
        assert kernels.crossed_row(edge, x, 0) == kernels.crossed_row(x, edge, 0) == crosses


def test_a_series_of_ten_terms_is_exact_up_to_where_it_is_used():
    """1 - exp(-z) over z; the eleventh term is z^10 / 11!."""
    for z in (0.1, -0.1):
        inverse, rate = np.ones(LANES), np.full(LANES, z)
        damping = LaneDamping(rate, inverse, laws.LINEAR, np.zeros(LANES), rate)
        lanes = lanes_of(np.zeros((2, LANES)), np.ones((2, LANES)) * [[1.0], [0.0]], np.ones(LANES),
                         damping=damping, f=np.ones(2 * LANES))  # fmt: skip
        impulses = np.zeros(LANES)
        kernels.damping_impulses(0, 1.0, lanes, impulses)
        np.testing.assert_allclose(impulses, -math.expm1(-z), rtol=6e-16)


@pytest.mark.parametrize("law", [laws.LINEAR, laws.LINEAR_CLIPPED, laws.HUNT_CROSSLEY])
def test_forces_in_lanes_cap_the_damper_at_what_a_step_resolves(law):
    """c m dt is 1e4 at the most; no contact pulls but a linear one."""
    damping = LaneDamping(np.ones(3), np.array([0.5, 2.0, 0.7]), law, np.zeros(3), np.ones(3))
    for w, c in ((0.3, 1e9), (-0.3, 1e9), (0.3, 40.0), (-0.3, 0.2)):
        exact = w * min(c, 1e4 / (0.05 * 2.0))
        exact = exact if law == laws.LINEAR else max(exact, -0.9)
        assert kernels.damping_force(w, 0.05, 0.9, c, 1, damping) == pytest.approx(exact, rel=1e-14)


def test_the_energy_error_is_the_largest_so_far_and_keeps_nan():
    worst, start, scale = np.zeros(LANES), np.full(LANES, 2.0), np.full(LANES, 4.0)
    energy = 2.0 + np.linspace(-1.0, 1.0, LANES)
    kernels.note_energy(energy, start, scale, worst)
    np.testing.assert_allclose(worst, np.abs(energy - 2) / 4, rtol=1e-15)
    kernels.note_energy(np.where(np.arange(LANES) == 3, np.nan, 2.0), start, scale, worst)
    assert np.isnan(worst[3]) and worst[0] == 0.25


def test_errors_of_chains_at_rest_are_relative_to_one():
    lanes = lanes_of(np.zeros((2, LANES)), np.zeros((2, LANES)), np.ones(LANES),
                     mass=np.full(LANES, 2.0))  # fmt: skip
    lanes.v[3] = 0.7
    energy = np.empty(LANES)
    kernels.kinetic_energy(lanes, energy)
    # two roundings at most
    np.testing.assert_allclose(energy, np.where(np.arange(LANES) == 3, 0.49, 1.0), rtol=1e-15)


def test_an_impulse_at_the_walls_of_lanes_does_the_work_of_the_mean_velocity():
    square, impulse, start = (RNG.uniform(0.2, 1.0, LANES) for _ in range(3))
    v = np.r_[np.zeros(LANES), start]
    wall = WallPush(impulse, np.zeros(LANES), square, np.full(LANES, 0.3), np.full(LANES, 0.1))
    kernels.push_walls(v, wall)
    np.testing.assert_allclose(v[LANES:], start + square * impulse, rtol=1e-15)
    np.testing.assert_allclose(wall.work - 0.3, impulse * (start + v[LANES:]) / 2, rtol=1e-13)
    np.testing.assert_allclose(wall.pending, 0.1 + impulse, rtol=1e-15)


def test_blocks_hold_every_chain_of_a_batch():
    """Seventeen chains: the last one begins a block, and fills it."""
    A = np.linspace(1.0, 2.0, LANES + 1)[:, None] * np.ones(2)
    chain = Chain(np.ones(2), np.full(2, 0.5), A)
    many = Chains(chain, rigid_wall(), np.array([1.0, 0.0]))
    assert blocks_of(many, np.zeros(3)).A.shape == (2, 2, LANES)
    options = dict(duration=2.5, dt=0.25, n_save=2)
    batch = march_batch(many, **options)
    for i in (0, LANES - 1, LANES):
        alone = march(*many[i], **options, scheme=batch.scheme)
        np.testing.assert_allclose(batch.v[i], alone.v, rtol=0, atol=1e-13)
    assert len(batch.v) == LANES + 1
