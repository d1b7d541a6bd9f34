"""Joint stiffnesses of the assembly tuned to the hammer test, on a coarse mesh."""

import numpy as np
import pytest

from fem import Bushing, Material, assemble, joined, modes, pair
from fem.tuning import Parameter, sensitivity, spectrum, tune, tuning_basis
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
