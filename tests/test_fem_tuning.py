"""Joint stiffnesses of the assembly tuned to the hammer test, on a coarse mesh."""

import numpy as np
import pytest

from fem import Bushing, Material, assemble, joined, modes, pair
from fem.correlation import Number
from fem.tuning import (
    Parameter,
    at_before,
    determined,
    sensitivity,
    spectrum,
    tune,
    tuning_basis,
)
from geometry import Assembly, by_body, held_faces, hex_mesh, interfaces
from workflows.pipeline.rig import TARGETS, wires

STEEL = Material(210e9, 0.3, 7850.0)
KY = Parameter("head.ky", ("head.ky",), 1e6, 1e4, 1e12)
KZ = Parameter("head.kz", ("head.kz",), 3e7, 1e5, 1e12)
KRY = Parameter("head.kry", ("head.kry",), 1e2, 1e-1, 1e8)
BLOCK = [Parameter(name, (), 1.0, 0.85, 1.15, ("block",), name) for name in ("young", "density")]
TANGENTIAL = Parameter("head.kt", ("head.kz", "head.kx"), 1e8, 1e5, 1e12)


def model(head, block=STEEL):
    mesh = hex_mesh(Assembly(), seed=8e-3, block_seed=30e-3, support_seed=40e-3)
    steel = {body: STEEL for body in mesh.subdomains} | {"block": block}
    a, bushings = Assembly(), {"head": head, "foot": Bushing()}
    how = wires(interfaces(a), held_faces(a), bushings)
    return joined(assemble(by_body(mesh), steel), how)


@pytest.fixture(scope="module")
def anisotropic():
    return tuning_basis(model(Bushing(ky=1e6, kz=1e7, kry=1e2)), TARGETS)


@pytest.fixture(scope="module")
def isotropic():
    return tuning_basis(model(Bushing(kx=1e8, ky=1e6, kz=1e8)), TARGETS)


def test_sensitivities_are_the_slopes(anisotropic):
    value, h = np.array([7e5, 2.5e7, 1e2, 1.05, 0.98]), 1e-4
    parameters = [KY, KZ, KRY, *BLOCK]
    found = spectrum(anisotropic, parameters, value)
    exact = sensitivity(anisotropic, parameters, value, found)[:10]
    for j in range(len(value)):
        step = np.exp(h * (np.arange(len(value)) == j))
        up = spectrum(anisotropic, parameters, value * step).omega[:10]
        down = spectrum(anisotropic, parameters, value / step).omega[:10]
        np.testing.assert_allclose(np.log(up / down) / (2 * h), exact[:, j], atol=1e-6)


def test_all_four_modes_meet_and_the_full_model_confirms_them(anisotropic):
    found = tune(anisotropic, [KY, KZ, KRY, *BLOCK], {1: 51, 2: 269, 3: 907, 4: 8425})
    np.testing.assert_allclose(found.modes_hz, [51, 269, 907, 8425], rtol=1e-5)
    ky, kz, kry, young, density = found.value
    block = Material(young * STEEL.young, STEEL.poisson, density * STEEL.density)
    full = model(Bushing(ky=ky, kz=kz, kry=kry), block)
    solved = modes(full.K, full.M, 24)
    confirmed = solved.frequency_hz[pair(full, solved, TARGETS).index]
    np.testing.assert_allclose(confirmed, found.modes_hz, rtol=1e-3)


def test_one_tangential_stiffness_cannot_meet_modes_two_and_three(isotropic):
    two = tune(isotropic, [KY, TANGENTIAL], {1: 51, 2: 269})
    three = tune(isotropic, [KY, TANGENTIAL], {1: 51, 3: 907})
    np.testing.assert_allclose(two.modes_hz[:2], [51, 269], rtol=1e-4)
    np.testing.assert_allclose(three.modes_hz[[0, 2]], [51, 907], rtol=1e-4)
    assert two.modes_hz[2] < 0.8 * 907 and three.modes_hz[1] > 1.6 * 269
    both = tune(isotropic, [KY, TANGENTIAL], {1: 51, 2: 269, 3: 907})
    assert np.abs(np.log(both.modes_hz[1:3] / [269, 907])).min() > 0.2


def test_every_mode_up_to_the_highest_target_is_told(anisotropic):
    found = tune(anisotropic, [KY, KZ, KRY, *BLOCK], {1: 51, 2: 269, 3: 907, 4: 8425})
    assert np.all(np.diff(found.all_hz) >= 0) and len(found.all_hz) > 6


def test_a_parameter_left_out_has_the_value_it_had(anisotropic):
    """Of a modulus, a density and a finite spring that is the spectrum at this value; of a rigid
    spring that of springs without end (1e14 N/m)."""
    parameters, value = [KY, KZ, KRY, *BLOCK], np.array([7e5, 2.5e7, 1e2, 1.07, 0.93])
    for j, p in enumerate(parameters):
        before = p._replace(before=tuple(value[j] for _ in p.springs or ("factor",)))
        rest = [other for other in parameters if other is not p]
        there = spectrum(at_before(anisotropic, before), rest, np.delete(value, j))
        here = spectrum(anisotropic, parameters, value)
        np.testing.assert_allclose(there.omega[:12], here.omega[:12], rtol=1e-7)
    rigid = spectrum(at_before(anisotropic, KZ._replace(before=(np.inf,))), [KY], value[:1])
    stiff = spectrum(anisotropic, [KY, KZ], np.array([value[0], 1e14]))
    np.testing.assert_allclose(rigid.omega[:6], stiff.omega[:6], rtol=1e-5)


def rail(ky, kx=np.inf):
    """A block on two sheets, its head joints soft along y and, unless rigid, along x."""
    return tuning_basis(model(Bushing(kx=kx, ky=ky)), [Number(n) for n in range(1, 7)])


def test_what_the_targets_determine_is_fitted_and_a_rigid_direction_stays_rigid():
    """One target, two springs: the one that was rigid leaves; two targets that only both can meet
    leave none."""
    kx, ky = (
        Parameter(f"head.{key}", (f"head.{key}",), 1e7, 1e4, 1e12, before=(before,))
        for key, before in (("kx", np.inf), ("ky", 5e5))
    )
    basis = rail(1e6, kx=1e7)
    stiff, both = rail(1e6), [kx, ky]
    hz = spectrum(stiff, [ky], np.array([8e5])).frequency_hz
    for n in (1, 2):
        target = {i + 1: hz[i] for i in range(n)}
        assert determined(basis, both, target, tune(basis, both, target)) == (ky,)
    hz = spectrum(basis, both, np.array([3e7, 8e5])).frequency_hz
    target = dict(enumerate(hz[:4], start=1))
    assert determined(basis, both, target, tune(basis, both, target)) == (kx, ky)


def test_two_values_of_which_one_frequency_sees_a_product_are_not_both_determined(isotropic):
    """Each alone is; together their bars would be those of the bounds."""
    block = [p._replace(before=(1.0,)) for p in BLOCK]
    hz = spectrum(isotropic, block, np.array([1.05, 1.0])).frequency_hz
    target = {4: tune(isotropic, [], {}).modes_hz[3] * 1.02}
    fit = tune(isotropic, block, target)
    assert not fit.is_determined
    assert len(determined(isotropic, block, target, fit)) == 1
    assert all(tune(isotropic, [p], target).is_determined for p in block) and len(hz)
