"""Joint stiffnesses of the assembly tuned to the hammer test, on a coarse mesh."""

import numpy as np
import pytest

from beadwave.fem import Bushing, Material, assemble, joined, modes, pair
from beadwave.fem.modes.mac import BodyForms, Number
from beadwave.fem.updating.tuning import (
    TuningBasis,
    TuningParameter,
    at_before,
    determined,
    deviation_of_others,
    sensitivity,
    spectrum,
    tune,
    tuning_basis,
)

from known_models import RIG_TARGETS as TARGETS
from known_models import rig, steel

STEEL = Material(210e9, 0.3, 7850.0)
KY = TuningParameter("head.ky", ("head.ky",), 1e6, 1e4, 1e12)
KZ = TuningParameter("head.kz", ("head.kz",), 3e7, 1e5, 1e12)
KRY = TuningParameter("head.kry", ("head.kry",), 1e2, 1e-1, 1e8)
BLOCK = [
    TuningParameter(name, (), 1.0, 0.85, 1.15, ("block",), name) for name in ("young", "density")
]
TANGENTIAL = TuningParameter("head.kt", ("head.kz", "head.kx"), 1e8, 1e5, 1e12)


def model(head, block=STEEL):
    sizes = ("mesh.seed=8e-3", "mesh.block_seed=30e-3", "mesh.support_seed=40e-3")
    springs = [(f"joints.head.{key}", k) for key, k in head._asdict().items()]
    parts = rig(*sizes, "mesh.contact_seed=30e-3", *springs)
    materials = steel(parts.meshes) | {"block": block}
    return joined(assemble(parts.meshes, materials), parts.connections)


@pytest.fixture(scope="module")
def anisotropic():
    return tuning_basis(model(Bushing(ky=1e6, kz=1e7, kry=1e2)), TARGETS)


@pytest.fixture(scope="module")
def isotropic():
    return tuning_basis(model(Bushing(kx=1e8, ky=1e6, kz=1e8)), TARGETS)


@pytest.mark.slow
def test_sensitivities_are_the_slopes(anisotropic):
    value, h = np.array([7e5, 2.5e7, 1e2, 1.05, 0.98]), 1e-4
    parameters = [KY, KZ, KRY, *BLOCK]
    computed = spectrum(anisotropic, parameters, value)
    exact = sensitivity(anisotropic, parameters, value, computed)[:10]
    for j in range(len(value)):
        step = np.exp(h * (np.arange(len(value)) == j))
        up = spectrum(anisotropic, parameters, value * step).omega[:10]
        down = spectrum(anisotropic, parameters, value / step).omega[:10]
        np.testing.assert_allclose(np.log(up / down) / (2 * h), exact[:, j], atol=1e-6)


@pytest.mark.slow
def test_all_four_modes_meet_and_the_full_model_confirms_them(anisotropic):
    computed = tune(anisotropic, [KY, KZ, KRY, *BLOCK], {1: 51, 2: 269, 3: 907, 4: 8425})
    np.testing.assert_allclose(computed.modes_hz, [51, 269, 907, 8425], rtol=1e-5)
    ky, kz, kry, young, density = computed.value
    block = Material(young * STEEL.young, STEEL.poisson, density * STEEL.density)
    full = model(Bushing(ky=ky, kz=kz, kry=kry), block)
    solved = modes(full.K, full.M, 24)
    confirmed = solved.frequency_hz[pair(full, solved, TARGETS).index]
    np.testing.assert_allclose(confirmed, computed.modes_hz, rtol=1e-3)


@pytest.mark.slow
def test_one_tangential_stiffness_cannot_meet_modes_two_and_three(isotropic):
    two = tune(isotropic, [KY, TANGENTIAL], {1: 51, 2: 269})
    three = tune(isotropic, [KY, TANGENTIAL], {1: 51, 3: 907})
    np.testing.assert_allclose(two.modes_hz[:2], [51, 269], rtol=1e-4)
    np.testing.assert_allclose(three.modes_hz[[0, 2]], [51, 907], rtol=1e-4)
    assert two.modes_hz[2] < 0.8 * 907 and three.modes_hz[1] > 1.6 * 269
    both = tune(isotropic, [KY, TANGENTIAL], {1: 51, 2: 269, 3: 907})
    assert np.abs(np.log(both.modes_hz[1:3] / [269, 907])).min() > 0.2


@pytest.mark.slow
def test_every_mode_up_to_the_highest_target_is_listed(anisotropic):
    computed = tune(anisotropic, [KY, KZ, KRY, *BLOCK], {1: 51, 2: 269, 3: 907, 4: 8425})
    assert np.all(np.diff(computed.all_hz) >= 0) and len(computed.all_hz) > 6


def small_basis(*, stiffness=(0.0, 0.0)):
    """A body of seven coordinates on two springs "joint.kx" and "joint.ky", M = I."""
    random = np.random.default_rng(3)
    Q = np.linalg.qr(random.normal(size=(7, 7)))[0]
    K0 = Q @ np.diag(np.geomspace(1e5, 1e8, 7)) @ Q.T
    springs = 0.3 * random.normal(size=(2, 7))
    form = BodyForms(K0, np.eye(7), np.zeros((6, 7)))
    names, numbers = ("joint.kx", "joint.ky"), tuple(Number(n) for n in range(1, 8))
    return TuningBasis(K0, np.eye(7), springs, names, np.array(stiffness), {"body": form}, numbers)


def parameter(name, before=np.inf):
    if name in ("young", "density"):
        return TuningParameter(name, (), 1.0, 0.5, 2.0, ("body",), name, (before,))
    return TuningParameter(name, (f"joint.{name}",), 1e7, 1e4, 1e12, before=(before,))


def targets_at(parameters, value, n):
    hz = spectrum(small_basis(), parameters, np.array(value)).frequency_hz
    return dict(enumerate(hz[:n].tolist(), start=1))


def test_a_parameter_left_out_has_the_value_it_had():
    names, value = ("kx", "ky", "young", "density"), np.array([4e6, 7e7, 1.2, 0.8])
    parameters = [parameter(name, x) for name, x in zip(names, value, strict=True)]
    expected = spectrum(small_basis(), parameters, value).omega
    for p in parameters:
        rest = [other for other in parameters if other is not p]
        there = [x for other, x in zip(parameters, value, strict=True) if other is not p]
        computed = spectrum(at_before(small_basis(), p), rest, np.array(there)).omega
        np.testing.assert_allclose(computed, expected, rtol=1e-10)


def test_a_rigid_spring_left_out_is_a_constraint():
    """One coordinate fewer; the error of a finite stiffness k in its place falls as 1 / k."""
    kx, ky = parameter("kx"), parameter("ky")
    rigid = spectrum(at_before(small_basis(), kx), [ky], np.array([7e7])).omega
    assert len(rigid) == 6
    for k in (1e11, 1e13):
        stiff = spectrum(small_basis(), [kx, ky], np.array([k, 7e7])).omega[:6]
        np.testing.assert_allclose(rigid, stiff, rtol=1e9 / k)


@pytest.mark.parametrize("n", [1, 2, 4])
def test_a_direction_that_was_rigid_stays_so_where_the_targets_are_met_without_it(n):
    kx, ky = parameter("kx"), parameter("ky", 3e6)
    target = targets_at([kx, ky], [1e16, 8e6], n)
    basis, both = small_basis(), [kx, ky]
    assert determined(basis, both, target, tune(basis, both, target)) == (ky,)


def test_a_direction_that_was_rigid_is_fitted_where_the_targets_need_it():
    kx, ky = parameter("kx"), parameter("ky", 3e6)
    target = targets_at([kx, ky], [2e7, 8e6], 4)
    basis, both = small_basis(), [kx, ky]
    fit = tune(basis, both, target)
    assert determined(basis, both, target, fit) == (kx, ky)
    np.testing.assert_allclose(fit.value, [2e7, 8e6], rtol=1e-4)


@pytest.mark.parametrize(("scatter", "names"), [(0.003, ("kx", "ky")), (0.01, ("ky",))])
def test_a_rise_counts_by_the_scatter_where_targets_scatter_more_than_their_errors(scatter, names):
    """Errors of 0.1 % are stated: without kx the misfit rises by 3.7, and by 0.8, times four mean
    squares of what the fit leaves of the targets."""
    both = [parameter("kx"), parameter("ky", 3e6)]
    exact = targets_at(both, [1e9, 8e6], 5)
    target = {i: hz * (1 + scatter * (-1) ** i) for i, hz in exact.items()}
    fit = tune(small_basis(), both, target)
    left = determined(small_basis(), both, target, fit)
    assert tuple(p.name for p in left) == names


def test_of_modulus_and_density_frequencies_determine_one():
    """omega^2 is proportional to the one over the other: both bars would be those of the bounds,
    which no bar alone tells; of the one that is left it is twice that of a frequency."""
    both = [parameter("young", 1.0), parameter("density", 1.0)]
    target = targets_at(both, [1.3, 1.0], 5)
    fit = tune(small_basis(), both, target)
    assert not fit.is_determined
    (left,) = determined(small_basis(), both, target, fit)
    alone = tune(small_basis(), [left], target)
    np.testing.assert_allclose(alone.value, 1.3 if left.name == "young" else 1 / 1.3, rtol=1e-6)
    np.testing.assert_allclose(alone.deviation, 2e-3 / np.sqrt(5), rtol=1e-2)


def test_a_value_not_known_within_a_factor_of_two_is_not_determined():
    """A spring of 1e12 N/m, its own upper bound, moves no frequency by the error of the data."""
    ky = parameter("ky", 3e6)
    target = targets_at([ky], [1e12], 3)
    fit = tune(small_basis(), [ky], target)
    assert np.isinf(fit.deviation).all() and determined(small_basis(), [ky], target, fit) == ()


@pytest.mark.slow
def test_bars_from_the_errors_of_each_frequency_hold_two_sigma_in_95_of_100():
    """Frequencies known to 0.01 to 0.5 %: weighted by these, the deviations are the scatter of the
    fitted values over 150 draws; weighted alike, the value scatters more."""
    parameters = [parameter("kx", 3e6), parameter("young", 1.0)]
    truth, s = np.array([4e6, 1.1]), np.array([1e-4, 5e-3, 2e-4, 5e-3, 5e-3])
    exact = np.array([*targets_at(parameters, truth, len(s)).values()])
    errors, rng = dict(enumerate(s.tolist(), start=1)), np.random.default_rng(11)
    z, alike = [], []
    for _ in range(150):
        measured = exact * np.exp(s * rng.normal(size=len(s)))
        target = dict(enumerate(measured.tolist(), start=1))
        fit = tune(small_basis(), parameters, target, frequency_error=errors, n_starts=1)
        z.append(np.log(fit.value / truth) / fit.deviation)
        other = tune(small_basis(), parameters, target, n_starts=1)
        alike.append(np.log(other.value / truth) / fit.deviation)
    z, alike = np.array(z), np.array(alike)
    np.testing.assert_allclose(np.sqrt(np.mean(z**2, axis=0)), 1.0, atol=0.15)
    assert np.all(np.mean(np.abs(z) < 2, axis=0) > 0.92)
    assert np.all(np.abs(z.mean(axis=0)) < 3 / np.sqrt(len(z)))
    assert np.all(np.sqrt(np.mean(alike**2, axis=0)) > 2)


def test_bars_beside_a_spring_left_out_are_those_of_a_fit_that_knows_it_by_a_factor_of_two():
    """A fit of all three, whose bounds of ky have that standard deviation; a spring that is rigid
    adds nothing."""
    kx, ky, young = parameter("kx", 3e6), parameter("ky", 8e6), parameter("young", 1.0)
    target, errors = targets_at([kx, young, ky], [4e6, 1.1, 8e6], 3), {1: 1e-3, 2: 4e-3, 3: 2e-3}
    basis = small_basis(stiffness=(0.0, 8e6))
    fit = tune(basis, [kx, young], target, frequency_error=errors, n_starts=1)
    beside = deviation_of_others(basis, fit, target, [ky], frequency_error=errors)
    half = np.exp(np.log(2.0) * np.sqrt(12) / 2)
    known = ky._replace(start=8e6, lower=8e6 / half, upper=8e6 * half)
    both = tune(basis, [kx, young, known], target, frequency_error=errors, n_starts=1)
    np.testing.assert_allclose(beside, both.deviation[:2], rtol=1e-6)
    assert np.all(beside > fit.deviation) and beside[1] > 1.05 * fit.deviation[1]
    rigid = [parameter("ky", np.inf)]
    np.testing.assert_array_equal(deviation_of_others(basis, fit, target, rigid), fit.deviation)
