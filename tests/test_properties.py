"""Laws that hold whatever the numbers: of reductions of random networks, of chains, of scenes."""

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from skfem import MeshHex

from beadwave import dem, fem, rom
from beadwave.workflows.files.scene import scene

LAWS = settings(derandomize=True, deadline=None, max_examples=25)
FEW = settings(LAWS, max_examples=8)
SEEDS = st.integers(0, 2**32 - 1)
FREQUENCIES = np.array([0.0, 150.0, 700.0, 2000.0])
STEEL = fem.Material(210e9, 0.3, 7850.0)
LOWER = 0.05  # m, height of the lower block


def network(seed, *, held=True, n=40):
    """K, M, w of masses that springs join at random, some to the ground."""
    rng = np.random.default_rng(seed)
    pairs = [(i, int(rng.integers(i))) for i in range(1, n)]  # a tree holds them together
    pairs += [tuple(rng.choice(n, 2, replace=False)) for _ in range(n)]
    K = np.zeros((n, n))
    for i, j in pairs:
        k = 1e7 * 10 ** rng.uniform(-1, 1)
        K[[i, j, i, j], [i, j, j, i]] += k * np.array([1, 1, -1, -1])
    if held:
        K[np.diag_indices(3)] += 1e7
    w = np.zeros(n)
    w[rng.choice(n, 4, replace=False)] = rng.dirichlet(np.ones(4))
    return sp.csc_matrix(K), sp.diags_array(0.1 * 3 ** rng.uniform(-1, 1, n)).tocsc(), w


def reduced_by(kind, K, M, w, n_modes=12):
    asked = rom.Selection(n_modes=n_modes)
    if kind == "free-modes":
        return rom.free_modes(K, M, w, asked)
    return rom.craig_bampton(K, M, w, np.flatnonzero(w), asked)


def frequencies(reduced):
    return rom.modal(reduced).omega


def relative(found, known):
    return float(np.linalg.norm(np.subtract(found, known)) / np.linalg.norm(known))


KINDS = pytest.mark.parametrize("kind", ["free-modes", "craig-bampton"])


@pytest.mark.slow
@KINDS
@LAWS
@given(seed=SEEDS)
def test_a_reduction_keeps_the_static_compliance_and_lowers_no_frequency(kind, seed):
    """Rayleigh-Ritz: each frequency of a subspace is at or above the full one (Courant-Fischer)."""
    K, M, w = network(seed)
    full, reduced = rom.full_order(K, M, w), reduced_by(kind, K, M, w)
    static = w @ np.linalg.solve(K.toarray(), w)
    assert rom.static_compliance(reduced) / static == pytest.approx(1, rel=1e-9)
    found = frequencies(reduced)
    assert np.all(found >= frequencies(full)[: len(found)] * (1 - 1e-9))


@KINDS
@LAWS
@given(seed=SEEDS)
def test_a_floating_network_keeps_its_motion_as_a_whole(kind, seed):
    """Far below the first elastic mode the receptance is that of the mass, -1 / (m omega^2)."""
    K, M, w = network(seed, held=False)
    reduced = reduced_by(kind, K, M, w)
    f = frequencies(rom.full_order(K, M, w))[1] / (2 * np.pi) * 1e-4
    heavy = -1 / (M.sum() * (2 * np.pi * f) ** 2)
    assert rom.receptance(reduced, None, [f])[0].real / heavy == pytest.approx(1, rel=1e-6)


@KINDS
@LAWS
@given(seed=SEEDS)
def test_the_order_of_the_unknowns_and_the_units_do_not_matter(kind, seed):
    """P K P^T with P w answers alike; a K and b M answer at sqrt(a/b) f with 1/a of it."""
    K, M, w = network(seed)
    rng = np.random.default_rng(seed)
    known = rom.receptance(reduced_by(kind, K, M, w), None, FREQUENCIES, loss=0.02)
    p = rng.permutation(len(w))
    turned = reduced_by(kind, K[p][:, p], M[p][:, p], w[p])
    assert relative(rom.receptance(turned, None, FREQUENCIES, loss=0.02), known) < 1e-8
    a, b = 10 ** rng.uniform(-3, 3, 2)
    scaled = reduced_by(kind, a * K, b * M, w)
    found = rom.receptance(scaled, None, FREQUENCIES * np.sqrt(a / b), loss=0.02)
    assert relative(a * found, known) < 1e-8


def chain_of(seed, count, similar=(1, 1, 1), **parts):
    """Of other size, modulus and density in the ratios `similar`."""
    size, stiff, heavy = similar
    factor = 2 ** np.random.default_rng(seed).uniform(-1, 1, (2, count))
    radius, young = factor * [[0.01 * size], [200e9 * stiff]]
    return dem.row_of_spheres(radius, 7800.0 * heavy, young, 0.3, **parts)


def thrown(count, speed):
    return np.append(speed, np.zeros(count - 1))


CHAINS = {"seed": SEEDS, "count": st.integers(2, 7), "speed": st.floats(0.01, 2.0)}


@LAWS
@given(**CHAINS, faster=st.floats(0.1, 10.0))
def test_a_chain_struck_faster_does_the_same_sooner(seed, count, speed, faster):
    """m u'' = A u^(3/2): velocities c times as large come at c^(-1/5) of the time."""
    chain, T = chain_of(seed, count), 3e-4 * speed**-0.2
    slow, fast = (
        dem.march(chain, dem.rigid_wall(), thrown(count, speed * c), n_save=40,
                  duration=T * c**-0.2, dt=T * c**-0.2 / 4000, scheme="verlet")
        for c in (1.0, faster)
    )  # fmt: skip
    assert relative(fast.v / faster, slow.v) < 1e-9


@LAWS
@given(**CHAINS, similar=st.tuples(*3 * [st.floats(0.1, 10.0)]))
def test_similar_chains_do_the_same_in_their_own_time(seed, count, speed, similar):
    """m grows with rho r^3, A with E r^(1/2): all takes (m / A)^(2/5) as long."""
    size, stiff, heavy = similar
    T, longer = 3e-4 * speed**-0.2, (heavy * size**2.5 / stiff) ** 0.4
    one, other = (
        dem.march(chain, dem.rigid_wall(), thrown(count, speed), n_save=40,
                  duration=T * t, dt=T * t / 4000, scheme="verlet")
        for chain, t in ((chain_of(seed, count), 1.0), (chain_of(seed, count, similar), longer))
    )  # fmt: skip
    assert relative(other.v, one.v) < 1e-9


@LAWS
@given(**CHAINS, n=st.integers(2, 6))
def test_oscillators_of_a_wall_act_together_in_any_order(seed, count, speed, n):
    """And one twice over, each of half its mass: phi^2 adds up."""
    rng, chain = np.random.default_rng(seed), chain_of(seed, count)
    omega, zeta, phi = rng.uniform(2e3, 2e5, n), rng.uniform(0, 0.1, n), rng.uniform(0.1, 2, n)
    twice = rng.permutation(np.append(np.arange(n), n - 1))
    half = np.where(twice == n - 1, 0.5**0.5, 1.0)
    options = {"duration": 2e-4, "dt": 5e-8, "n_save": 30}
    one, other = (
        dem.march(chain, wall, thrown(count, speed), **options)
        for wall in (
            dem.Wall(omega, zeta, phi, 1e-9),
            dem.Wall(omega[twice], zeta[twice], half * phi[twice], 1e-9),
        )
    )
    assert relative(other.v, one.v) < 1e-8


@pytest.mark.slow
@LAWS
@given(**CHAINS)
def test_a_free_chain_keeps_its_momentum_and_its_mirror_image_moves_alike(seed, count, speed):
    """Spheres numbered from the other end, and thrown from there to the other side."""
    chain = chain_of(seed, count, flat=None)
    order = slice(None, None, -1)
    mirrored = chain._replace(mass=chain.mass[order], radius=chain.radius[order], A=chain.A[order])
    v0 = np.random.default_rng(seed).uniform(-speed, speed, count)
    options = {"duration": 3e-4, "dt": 1e-7, "n_save": 30}
    one = dem.march(chain, None, v0, **options)
    other = dem.march(mirrored, None, -v0[order], **options)
    assert np.ptp(one.v @ chain.mass) < 1e-11 * np.abs(v0) @ chain.mass
    assert relative(-other.v[:, order], one.v) < 1e-9


@LAWS
@given(**CHAINS, omega=st.floats(2e3, 3e5), phi=st.floats(0.1, 3.0))
def test_a_march_turned_back_arrives_where_it_began(seed, count, speed, omega, phi):
    """Without dissipation the equations know no direction of time."""
    chain = chain_of(seed, count)
    wall = dem.Wall(np.array([omega]), np.zeros(1), np.array([phi]), 0.0)
    options = {"duration": 2e-4, "dt": 2e-8, "n_save": 10}
    there = dem.march(chain, wall, thrown(count, speed), **options)
    back = dem.march(chain, wall, there.v[-1], state=there.final.reversed(), **options)
    assert np.abs(-back.v[-1] - there.v[0]).max() < 1e-5 * speed


@FEW
@given(seed=SEEDS)
def test_bodies_and_their_joint_turned_and_moved_ring_alike_and_bear_no_strain(seed):
    """The joint's frame turns with them."""
    rng = np.random.default_rng(seed)
    Q, shift = Rotation.random(random_state=rng).as_matrix(), rng.standard_normal(3)
    springs = fem.Bushing(*10 ** rng.uniform(6, 9, 3), *10 ** rng.uniform(2, 5, 3))
    centre = np.array([0.0, 0.0, LOWER])
    still, moved = blocks(np.eye(3), np.zeros(3)), blocks(Q, shift)
    models = (
        joint_of(still, springs, centre, np.eye(3)),
        joint_of(moved, springs, Q @ centre + shift, Q.T),
    )
    one, other = (fem.modes(m.K, m.M, 12, shift_hz=100.0).omega for m in models)
    assert relative(other[6:], one[6:]) < 1e-7
    assert np.all(other[:6] < 1e-3 * other[6])


@pytest.mark.slow
@FEW
@given(seed=SEEDS)
def test_a_contact_turned_and_moved_with_its_body_answers_alike(seed):
    rng = np.random.default_rng(seed)
    Q, shift = Rotation.random(random_state=rng).as_matrix(), rng.standard_normal(3)
    answers = []
    for turned, moved in ((np.eye(3), np.zeros(3)), (Q, shift)):
        model = fem.joined(blocks(turned, moved), fem.Connections())
        point = turned @ [0.02, -0.019, LOWER] + moved
        spot = fem.SurfacePoint(point, turned @ [0, 0, -1.0], np.eye(3)[:2] @ turned.T)
        patch = fem.contact_patch(model, "lower:top", spot, 0.006)
        whole = rom.full_order(model.K, model.M, patch.w)
        answers.append(rom.receptance(whole, None, FREQUENCIES[1:], loss=0.02))
    assert relative(answers[1], answers[0]) < 1e-6


def blocks(Q, shift):
    lower = MeshHex.init_tensor(*2 * [np.linspace(-0.03, 0.03, 3)], np.linspace(0, LOWER, 3))
    upper = MeshHex.init_tensor(*2 * [np.linspace(-0.01, 0.01, 3)], np.linspace(LOWER, 0.12, 3))
    faces = {"lower": "top", "upper": "foot"}
    meshes = {
        name: type(mesh)(Q @ mesh.p + shift[:, None], mesh.t).with_boundaries(
            {faces[name]: mesh.facets_satisfying(lambda x: np.isclose(x[2], LOWER))}
        )
        for name, mesh in {"lower": lower, "upper": upper}.items()
    }
    return fem.assemble(meshes, dict.fromkeys(meshes, STEEL))


def joint_of(structure, springs, centre, frame):
    sides = fem.Side("upper:foot"), fem.Side("lower:top", "mean", over="upper:foot")
    joint = fem.Joint("screw", *sides, centre, springs, frame)
    return fem.joined(structure, fem.Connections(joints=[joint]))


@LAWS
@given(mm=st.floats(1.0, 50.0), gpa=st.floats(1.0, 400.0))
def test_a_value_with_its_unit_is_the_value_in_si(mm, gpa):
    with_units = (f'chain.radius="{mm!r} mm"', f'chain.young="{gpa!r} GPa"')
    plain = (f"chain.radius={mm * 1e-3!r}", f"chain.young={gpa * 1e9!r}")
    one, other = (scene("rig-rigid", changes).chain for changes in (with_units, plain))
    assert one.radius == pytest.approx(other.radius, rel=1e-14)
    assert one.young == pytest.approx(other.young, rel=1e-14)
