"""Slopes of frequencies and of MAC, onsets and ranking, beside separate solutions."""

import numpy as np
import pytest

from beadwave.fem.modes.mac import BodyForms, Number, Shape, mac
from beadwave.fem.updating.identifiability import (
    at_scene,
    frequency_sensitivity,
    mac_sensitivity,
    onset_stiffness,
    ranking,
)
from beadwave.fem.updating.tuning import (
    TuningBasis,
    TuningParameter,
    at_before,
    determined,
    spectrum,
    tune,
)

SPRINGS = ("joint.kx", "joint.ky", "joint.kx", "joint.kz")  # two bolts share kx


def basis_of(n=8):
    """A body of n coordinates and a carried mass on springs, M = I."""
    random = np.random.default_rng(5)
    Q = np.linalg.qr(random.normal(size=(n, n)))[0]
    K0 = Q @ np.diag(np.geomspace(1e5, 1e8, n)) @ Q.T
    part = random.normal(size=(n, n))
    M_part = 0.3 * part @ part.T / np.linalg.norm(part @ part.T, 2)
    forms = {
        "body": BodyForms(0.6 * K0, np.eye(n) - M_part, np.zeros((6, n))),
        "mass": BodyForms(np.zeros((n, n)), M_part, np.zeros((6, n))),
    }
    elongation = 0.3 * random.normal(size=(4, n))
    numbers = tuple(Number(i) for i in range(1, n + 1))
    return TuningBasis(K0, np.eye(n), elongation, SPRINGS, np.full(4, 1e7), forms, numbers)


def parameters_at(kx, ky, kz):
    springs = [
        TuningParameter(name, (name,), 1e7, 1e4, 1e12, before=(k,))
        for name, k in (("joint.kx", kx), ("joint.ky", ky), ("joint.kz", kz))
    ]
    factors = [
        TuningParameter(name, (), 1.0, 0.5, 2.0, (body,), of, (before,))
        for name, body, of, before in (
            ("young", "body", "young", 1.2),
            ("density", "body", "density", 1.0),
            ("mass", "mass", "density", 0.9),
        )
    ]
    return [*springs, *factors]


def solved(parameters, step=None):
    """Modes of the basis with rigid springs projected out, each parameter times exp(step)."""
    basis, factors = basis_of(), []
    for p, x in zip(parameters, np.zeros(len(parameters)) if step is None else step, strict=True):
        factors.append(p._replace(before=tuple(np.exp(x) * b for b in p.before)))
    constraint = basis.elongation[
        np.isin(SPRINGS, [p.name for p in parameters if np.inf in p.before])
    ]
    Z = np.linalg.svd(constraint)[2][len(constraint) :].T if len(constraint) else np.eye(8)
    K, M = basis.K0.copy(), basis.M.copy()
    for p in factors:
        for e in basis.elongation[np.isin(SPRINGS, p.springs)]:
            K += (p.before[0] if np.isfinite(p.before[0]) else 0.0) * np.outer(e, e)
        for body in p.bodies:
            if p.of == "young":
                K += (p.before[0] - 1) * basis.forms[body].K
            else:
                M += (p.before[0] - 1) * basis.forms[body].M
    L = np.linalg.cholesky(Z.T @ M @ Z)
    omega2, q = np.linalg.eigh(np.linalg.solve(L, np.linalg.solve(L, Z.T @ K @ Z).T))
    return np.sqrt(omega2) / (2 * np.pi), Z @ np.linalg.solve(L.T, q)


@pytest.mark.parametrize("stiffness", [(4e6, 7e7, 2e7), (np.inf, 7e7, 2e7), (3e6, 0.0, np.inf)])
def test_slopes_of_frequencies_and_of_mac_are_central_differences_of_separate_solutions(stiffness):
    parameters, h = parameters_at(*stiffness), 1e-4
    basis = basis_of()
    now = at_scene(basis, parameters)
    np.testing.assert_allclose(now.modes.frequency_hz, solved(parameters)[0], rtol=1e-10)
    slopes = frequency_sensitivity(basis, parameters, now)

    random = np.random.default_rng(1)
    reading = random.normal(size=(5, 8))
    shape = Shape(reading, random.normal(size=5) + 0.5j * random.normal(size=5), 1.0)
    for j in range(len(parameters)):
        step = h * (np.arange(len(parameters)) == j)
        (up, u), (down, d) = solved(parameters, step), solved(parameters, -step)
        np.testing.assert_allclose(np.log(up / down) / (2 * h), slopes[:, j], atol=1e-7)
        both = [mac(reading @ one, shape.shape[:, None])[:, 0] for one in (u, d)]
        expected = (both[0] - both[1]) / (2 * h)
        computed = [mac_sensitivity(basis, parameters, now, shape, i)[j] for i in range(len(up))]
        np.testing.assert_allclose(computed, expected, atol=2e-6)


def test_all_stiffnesses_together_raise_every_frequency_by_half_and_all_masses_lower_it_so():
    """K is homogeneous of degree 1 in moduli and stiffnesses, M in densities and masses."""
    basis = basis_of()._replace(K0=basis_of().forms["body"].K)
    parameters = [p._replace(before=p.before if p.springs else (1.0,)) for p in
                  parameters_at(np.inf, 7e7, 2e7)]  # fmt: skip
    slopes = frequency_sensitivity(basis, parameters, at_scene(basis, parameters))
    np.testing.assert_allclose(slopes[:, :4].sum(axis=1), 0.5, atol=1e-10)
    np.testing.assert_allclose(slopes[:, 4:].sum(axis=1), -0.5, atol=1e-10)


@pytest.mark.parametrize(("before", "sign"), [(np.inf, -1), (0.0, 1)])
def test_an_onset_is_the_stiffness_at_which_a_frequency_has_changed_by_so_much(before, sign):
    parameters, basis = parameters_at(before, 7e7, 2e7), basis_of()
    now, start = at_scene(basis, parameters), solved(parameters)[0]
    onsets = [onset_stiffness(basis, parameters[0], now, i, 0.01) for i in range(4)]
    assert np.isfinite(onsets).sum() >= 3
    for i in np.flatnonzero(np.isfinite(onsets)):
        hz = solved(parameters_at(onsets[i], 7e7, 2e7))[0]
        assert np.abs(hz / start[i] - 1 - sign * 0.01).min() < 1e-9


def test_a_mode_that_a_spring_does_not_touch_has_no_onset_though_others_pass_it():
    """The second coordinate alone is on the rigid spring; it falls through the first one."""
    K0, elongation = np.diag([1e6, 1e5]), np.array([[0.0, 1.0]])
    basis = TuningBasis(K0, np.eye(2), elongation, ("joint.kx",), np.array([1e7]), {}, ())
    p = TuningParameter("joint.kx", ("joint.kx",), 1e7, 1e4, 1e12, before=(np.inf,))
    now = at_scene(basis, [p])
    assert np.isnan(onset_stiffness(basis, p, now, 0, 0.01))
    basis = basis._replace(elongation=np.array([[0.1, 1.0]]))
    now = at_scene(basis, [p])
    assert np.isfinite(onset_stiffness(basis, p, now, 0, 0.01))


def test_the_ranking_takes_what_the_targets_tell_and_leaves_what_others_tell_already():
    """Orthogonal columns rank by size; a copy of one, and one that moves nothing, come last."""
    slopes = np.array([[0.3, 0.0, 0.3, 0.0], [0.0, 0.02, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0]])
    springs = [TuningParameter(name, (name,), 1e7, 1e4, 1e12) for name in "abcd"]
    rank = ranking(springs, slopes)
    assert len(rank.order) == rank.n_determined == 2
    assert rank.order[0] in (0, 2) and rank.order[1] == 1
    np.testing.assert_allclose(rank.gain, np.log(2) * np.array([300, 20]), rtol=1e-12)
    np.testing.assert_allclose(rank.condition, [1, 15], rtol=1e-12)
    # frequency error over slope, less what the bounds say already
    np.testing.assert_allclose(rank.deviation, [1e-3 / 0.3, 1e-3 / 0.02], rtol=1e-3)
    # each target by its own error: the second one is known ten times as well
    of_each = ranking(springs, slopes, frequency_error=[1e-3, 1e-4, 1e-3])
    np.testing.assert_allclose(of_each.gain, np.log(2) * np.array([300, 200]), rtol=1e-12)
    np.testing.assert_allclose(of_each.deviation, [1e-3 / 0.3, 1e-4 / 0.02], rtol=1e-3)
    # of 0.001 a frequency error is a factor of e: not known within a factor of two
    assert ranking(springs[:1], np.array([[1e-3]])).n_determined == 0


def test_what_is_ranked_as_determined_is_what_a_fit_determines():
    """With targets at the scene's own frequencies, where the slopes are those of the fit."""
    parameters = parameters_at(4e6, 7e7, 2e7)
    basis, value = basis_of(), np.array([4e6, 7e7, 2e7, 1.2, 1.0, 0.9])
    hz = spectrum(basis, parameters, value).frequency_hz
    now = at_scene(basis, parameters)
    slopes = frequency_sensitivity(basis, parameters, now)
    for n in (1, 2, 3, 5):
        rank = ranking(parameters, slopes[:n])
        chosen = [parameters[i] for i in rank.order[: rank.n_determined]]
        rest = basis
        for p in parameters:
            if p not in chosen:
                rest = at_before(rest, p)
        target = dict(enumerate(hz[:n].tolist(), start=1))
        starts = [p._replace(start=p.before[0]) for p in chosen]
        fit = tune(rest, starts, target)
        assert fit.is_determined and determined(rest, starts, target, fit) == tuple(starts)
        expected = value[rank.order[: rank.n_determined]]
        np.testing.assert_allclose(fit.value, expected, rtol=0.02)
        # the last one taken has the deviation that the ranking foretells
        np.testing.assert_allclose(fit.deviation[-1], rank.deviation[len(chosen) - 1], rtol=0.05)
