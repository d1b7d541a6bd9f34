"""Many chains at once are the same chains one by one."""

import numpy as np
import pytest

from beadwave.dem import (
    Chain,
    Chains,
    InvalidChain,
    StepSearch,
    UnstableStep,
    Wall,
    march,
    march_batch,
    march_to_error,
    one_dof_wall,
    rigid_wall,
    row_of_spheres,
)


def scattered(count, n, A_wall=1.5):
    rng = np.random.default_rng(1)
    A = rng.lognormal(0.0, 0.05, (count, n if A_wall else n - 1))
    if A_wall:
        A[:, -1] *= A_wall
    mass = rng.lognormal(0.0, 0.05, (count, n))
    v0 = np.zeros((count, n))
    v0[:, 0] = rng.uniform(0.5, 2.0, count)
    return Chain(mass, np.full(n, 0.5), A), v0


def moving_walls(count):
    rng = np.random.default_rng(2)
    omega = rng.uniform(0.0, 3.0, (count, 3))
    return Wall(omega, rng.uniform(0.0, 0.3, (count, 3)), rng.normal(size=(count, 3)))


def alone(chain, wall, v0, i, **options):
    single = Chain(chain.mass[i], chain.radius, chain.A[i])
    if wall is not None and wall.omega.ndim == 2:
        wall = Wall(wall.omega[i], wall.zeta[i], wall.phi[i])
    return march(single, wall, v0[i], **options)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["free", "rigid", "shared", "own"])
def test_batch_is_the_chains_one_by_one(kind):
    count, n = 37, 7
    chain, v0 = scattered(count, n, A_wall=None if kind == "free" else 1.5)
    wall = {
        "free": None,
        "rigid": rigid_wall(),
        "shared": one_dof_wall(0.3, 2.0, 0.05),
        "own": moving_walls(count),
    }[kind]
    options = dict(duration=25.0, dt=0.2, n_save=25)
    batch = march_batch(Chains(chain, wall, v0), observed=[0, 4], threads=2, **options)
    assert batch.v.shape == (count, 26, 2)
    for i in (0, 15, 16, 36):
        single = alone(chain, wall, v0, i, scheme="rkn6", **options)
        assert batch.v[i] == pytest.approx(single.v[:, [0, 4]], abs=1e-12)
        wall_force = single.contact_force[:, -1] if wall else np.zeros(26)
        assert batch.wall_force[i] == pytest.approx(wall_force, abs=1e-12)
        assert batch.energy_error[i] == pytest.approx(single.energy_error, abs=1e-12)


@pytest.mark.slow
def test_batch_reaches_the_error_it_reports():
    chain, v0 = scattered(40, 17, 2.8)
    batch = march_batch(Chains(chain, rigid_wall(), v0), duration=60.0, error=1e-4, n_save=60)
    assert (batch.error_estimate <= 1e-4).all()
    off = []
    for i in range(0, 40, 3):
        fine = alone(chain, rigid_wall(), v0, i, duration=60.0, dt=0.02, n_save=60)
        off.append(np.abs(fine.v - batch.v[i]).max() / v0[i, 0])
    assert np.median(off) < 1e-4


PARTS = {
    "dissipation": {"dissipation": "hunt-crossley", "gamma": np.linspace(0.05, 0.3, 7)},
    "strong dissipation": {"dissipation": "hunt-crossley", "gamma": np.linspace(0.2, 6.0, 7)},
    "a jumping law": {"dissipation": "linear-clipped", "gamma": np.full(7, 0.1)},
    "preload": {"preload": np.linspace(0.1, 0.5, 9)},
    "leaf springs": {"leaf_stiffness": np.full(7, 0.3), "leaf_anchor": np.linspace(0.1, 0.0, 7)},
    "yield": {"yield_overlap": np.full(7, 0.2)},
}


ALONE = ("yield", "dashpot")  # what the lanes do not take


@pytest.mark.slow
@pytest.mark.parametrize("feature", [*PARTS, "residual", "damped residual", "dashpot"])
def test_a_batch_takes_every_part(feature):
    """Differing in stiffness, speed, wall and, where it is a number, the part itself."""
    chain, v0 = scattered(9, 7)
    chain, wall = chain._replace(**PARTS.get(feature, {})), moving_walls(9)
    wall = wall._replace(omega=wall.omega + 0.2)
    if feature == "damped residual":
        chain = chain._replace(**PARTS["dissipation"])
    if "residual" in feature:
        wall = wall._replace(residual_compliance=np.linspace(-0.05, 0.1, 9))
    if feature == "dashpot":
        wall = wall._replace(mobility=np.linspace(0.1, 2.0, 9))
    options = dict(duration=12.0, dt=0.05, n_save=12)
    chains = Chains(chain, wall, v0)
    assert chains.fit_lanes == (feature not in ALONE)
    batch = march_batch(chains, observed=[0, 4], threads=2, **options)
    for i in (0, 5, 8):
        preload = chain.preload[i] if feature == "preload" else 0.0
        single = chain._replace(mass=chain.mass[i], A=chain.A[i], preload=preload)
        its_wall = Wall(*(np.asarray(p)[i] if np.ndim(p) else p for p in wall))
        run = march(single, its_wall, v0[i], scheme=batch.scheme, **options)
        assert batch.v[i] == pytest.approx(run.v[:, [0, 4]], abs=1e-12)
        assert batch.wall_force[i] == pytest.approx(run.contact_force[:, -1], abs=1e-12)
        assert batch.energy_error[i] == pytest.approx(run.energy_error, abs=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("law", ["linear", "linear-clipped", "hunt-crossley"])
def test_a_damped_free_chain_is_the_same_in_a_batch(law):
    chain, v0 = scattered(3, 5, A_wall=None)
    chain = chain._replace(dissipation=law, gamma=np.array([0.1, 0.0, 3.0, 0.2]))
    options = dict(duration=8.0, dt=0.02, n_save=8, scheme="suzuki4")
    batch = march_batch(Chains(chain, None, v0), **options)
    for i in range(3):
        run = march(chain._replace(mass=chain.mass[i], A=chain.A[i]), None, v0[i], **options)
        assert batch.v[i] == pytest.approx(run.v, abs=1e-12)
        assert batch.energy_error[i] == pytest.approx(run.energy_error, abs=1e-12)


def test_a_batch_takes_the_scheme_of_its_most_damped_chain():
    chain, v0 = scattered(4, 5)
    gamma = np.outer([0.1, 0.1, 1e4, 0.1], np.ones(5))
    chain = chain._replace(dissipation="hunt-crossley", gamma=gamma)
    options = dict(duration=8.0, error=1e-3, n_save=8)
    batch = march_batch(Chains(chain, rigid_wall(), v0), **options)
    single = chain._replace(mass=chain.mass[2], A=chain.A[2], gamma=gamma[2])
    alone = march_to_error(single, rigid_wall(), v0[2], **options)
    assert batch.scheme == alone.trajectory.scheme == "energy2"
    assert np.abs(batch.v[2] - alone.trajectory.v).max() < 2e-3 * v0[2, 0]


@pytest.mark.usefixtures("kernels")
def test_a_negative_spring_beyond_its_fold_is_no_batch():
    chain, v0 = scattered(3, 4)
    wall = rigid_wall()._replace(residual_compliance=-2.0)
    with pytest.raises(UnstableStep, match="chain 0 of the batch is not finite"):
        march_batch(Chains(chain, wall, v0), duration=10.0, dt=0.05)


@pytest.mark.usefixtures("kernels")
def test_a_batch_with_losses_reaches_the_error_it_reports():
    chain, v0 = scattered(5, 6)
    chain = chain._replace(dissipation="hunt-crossley", gamma=np.full(6, 0.1))
    batch = march_batch(Chains(chain, rigid_wall(), v0), duration=8.0, error=1e-4, n_save=8)
    fine = march_batch(Chains(chain, rigid_wall(), v0), duration=8.0, dt=0.01, n_save=8)
    off = np.abs(batch.v - fine.v).max(axis=(1, 2)) / v0[:, 0]
    assert (off < batch.error_estimate).all() and (batch.error_estimate <= 1e-4).all()


def test_a_batch_before_a_fast_light_mode_takes_the_step_that_the_error_asks_for():
    row = row_of_spheres(0.0127, 7800.0, np.linspace(150e9, 250e9, 8)[:, None], 0.3, count=6)
    wall = Wall(np.array([1.6e5, 1e6]), np.full(2, 0.005), np.array([0.6, 31.0]), -1e-9)
    v0 = np.linspace(0.1, 1.0, 8)[:, None] * np.eye(6)[0]
    chains, options = Chains(row, wall, v0), dict(duration=5e-4, n_save=20)
    batch = march_batch(chains, error=1e-4, **options)
    fine = march_batch(chains, dt=batch.dt.min() / 8, **options)
    off = np.abs(batch.v - fine.v).max(axis=(1, 2)) / v0.max(axis=1)
    assert (off < batch.error_estimate).all() and (batch.error_estimate <= 1e-4).all()
    assert batch.energy_error.max() < 1e-4
    search = StepSearch("rkn6", energy_error=np.inf)
    alone = march_to_error(*chains[7], error=1e-4, search=search, **options)
    # a batch's pilot knows its rows less well than a search of one: 2.6 times the steps; steps by
    # the light mode would be ten times as many
    assert batch.n_steps[7] < 3.0 * alone.trajectory.n_steps


def test_batch_refuses_what_it_does_not_take():
    chain, v0 = scattered(4, 5)
    options = dict(duration=1.0, dt=0.1)
    with pytest.raises(InvalidChain, match="preload is given for 3 chains, others for 4"):
        march_batch(Chains(chain._replace(preload=np.ones(3)), rigid_wall(), v0), **options)
    with pytest.raises(InvalidChain, match="either dt or error"):
        march_batch(Chains(chain, rigid_wall(), v0), duration=1.0)
    with pytest.raises(InvalidChain, match="scheme 'euler' is unknown"):
        march_batch(Chains(chain, rigid_wall(), v0), scheme="euler", **options)
    chain.A[2, 1] = np.nan
    with pytest.raises(InvalidChain, match="not finite"):
        march_batch(Chains(chain, rigid_wall(), v0), **options)


@pytest.mark.parametrize("feature", ["nothing", "preload", "leaf springs", "dissipation"])
def test_samples_closer_than_steps_keep_the_error(feature):
    """On a modal wall, against steps fifty times shorter; the force at the wall too."""
    chain, v0 = scattered(5, 7)
    chain, wall = chain._replace(**PARTS.get(feature, {})), moving_walls(5)
    wall = wall._replace(omega=wall.omega + 0.2)
    if feature == "preload":
        chain = chain._replace(preload=chain.preload[:5])
    run = dict(duration=24.0, n_save=1200)
    coarse = march_batch(Chains(chain, wall, v0), dt=0.25, **run)
    fine = march_batch(Chains(chain, wall, v0), dt=0.005, **run)
    assert coarse.n_steps == 96
    speed, force = v0[:, :1, None], fine.wall_force.max(axis=1, keepdims=True)
    assert np.abs((coarse.v - fine.v) / speed).max() < 2e-3
    assert np.abs((coarse.wall_force - fine.wall_force) / force).max() < 2e-2
    at_steps = march_batch(Chains(chain, wall, v0), dt=0.25, duration=24.0, n_save=96)
    at_samples = np.linspace(0, 1200, 97)[::2].astype(int)
    assert coarse.v[:, at_samples] == pytest.approx(at_steps.v[:, ::2], abs=1e-12)


def test_samples_between_steps_converge_with_the_scheme():
    """Of a pressed chain, whose contacts stay closed."""
    chain, v0 = scattered(3, 7)
    chain = chain._replace(leaf_stiffness=np.full(7, 1.0), leaf_anchor=np.linspace(1.4, 0.2, 7))
    v0 *= 0.02
    run = dict(duration=12.0, n_save=900)
    exact = march_batch(Chains(chain, rigid_wall(), v0), dt=0.01, **run)
    errors = [
        np.abs(march_batch(Chains(chain, rigid_wall(), v0), dt=dt, **run).v - exact.v).max()
        for dt in (0.4, 0.2)
    ]
    assert 4.5 < np.log2(errors[0] / errors[1]) < 6.5


def steel(radius, speed, count=17):
    """Chains of equal spheres before a rigid wall, one of each radius and speed."""
    radius = np.asarray(radius, float)[:, None]
    v0 = np.asarray(speed, float)[:, None] * np.eye(count)[0]
    return Chains(row_of_spheres(radius, 7800.0, 210e9, 0.3, count=count), rigid_wall(), v0)


def true_errors(chains, batch, **options):
    """Beside marches one by one by steps of an eighth, which end at the samples."""
    off = []
    for i in range(chains.count):
        fine = march(*chains[i], dt=batch.dt[i] / 8, **options)
        off.append(np.abs(batch.v[i] - fine.v).max() / np.abs(chains.v0[i]).max())
    return np.array(off)


def test_a_small_sphere_among_large_ones_has_the_error_that_its_row_states():
    """The largest A is not the fastest contact: the lightest spheres have it."""
    radius = 0.011 + 1e-6 * np.arange(40)
    radius[24] = 0.0022  # not one of 16 spread over 40
    chains, options = steel(radius, np.full(40, 0.4)), dict(duration=2e-3, n_save=400)
    batch = march_batch(chains, error=1e-4, **options)
    assert not batch.refused and (batch.error_estimate <= 1e-4).all()
    assert (true_errors(chains, batch, **options) <= batch.error_estimate).all()
    assert batch.n_steps[24] > 3 * np.delete(batch.n_steps, 24).max()


def test_stated_errors_of_rows_are_at_least_half_of_true_ones():
    rng = np.random.default_rng(11)
    for seed in range(3):
        radius, speed = np.exp(
            rng.uniform(np.log([[3e-3], [0.1]]), np.log([[2e-2], [2.0]]), (2, 24))
        )
        chains, options = steel(radius, speed, 9 + seed), dict(duration=1e-3, n_save=300)
        batch = march_batch(chains, error=10.0 ** -(3 + seed), **options)
        true = true_errors(chains, batch, **options)
        assert not batch.refused and (batch.error_estimate <= 10.0 ** -(3 + seed)).all()
        assert (batch.error_estimate >= true / 2).all()
        assert np.mean(batch.error_estimate < true) < 0.02


def test_a_chain_of_a_batch_agrees_with_its_single_run_within_both_errors():
    """Alone, and beside fast ones, it is the run of that chain within both errors."""
    options = dict(duration=2e-3, n_save=300)
    chains = steel([0.012, 0.002, 0.02], [0.3, 1.0, 0.1])
    batch = march_batch(chains, error=1e-4, **options)
    for i in range(3):
        single = march_to_error(*chains[i], error=1e-4, **options).trajectory
        off = np.abs(batch.v[i] - single.v).max() / chains.v0[i].max()
        assert off <= batch.error_estimate[i] + single.error_estimate


def test_a_chain_that_amplifies_rounding_beyond_the_error_is_refused():
    """Small fast spheres between two walls of many impacts, beside one that is not."""
    options = dict(duration=3e-3, n_save=300)
    chains = steel([0.012, 0.0012], [0.3, 12.0])
    wall = one_dof_wall(907.0, 2.87, 0.005)
    leaf = {"leaf_stiffness": np.full(17, 200.0), "leaf_anchor": np.full(17, 1.5e-3)}
    chains = Chains(chains.chain._replace(**leaf, preload=15.0), wall, chains.v0)
    batch = march_batch(chains, error=1e-4, **options)
    assert set(batch.refused) == {1} and batch.refused[1].startswith("error 0.0001 is not reached")
    assert np.isnan(batch.v[1]).all() and np.isnan(batch.error_estimate[1])
    assert batch.error_estimate[0] <= 1e-4 and np.isfinite(batch.v[0]).all()
