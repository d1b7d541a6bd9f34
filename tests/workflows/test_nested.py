"""Nested sampling against posteriors that are known."""

import numpy as np
import pytest

pytest.importorskip("dynesty")

from beadwave.workflows.fit.nested import (
    NestedOptions,
    frequencies_log_likelihood,
    log_normal,
    log_uniform,
    model_probabilities,
    nested_posterior,
    normal,
    uniform,
)

FEWER = NestedOptions(live=300)


@pytest.mark.slow
def test_a_linear_problem_has_its_known_posterior_and_evidence():
    """y = A theta + e: mean S A^T y, S = (1 + A^T A)^-1, y normal of covariance 1 + A A^T.

    Of 16384 random draws means would be off by 0.8 % of a deviation, of Halton's points by 0.1 %;
    the evidence is 4e-4 off.
    """
    rng = np.random.default_rng(2)
    A, y = rng.standard_normal((6, 3)) * [3.0, 1.0, 0.3], rng.standard_normal(6)
    found = nested_posterior(
        lambda theta: -0.5 * np.sum((A @ theta - y) ** 2) - 3 * np.log(2 * np.pi),
        [normal(name, 0.0, 1.0) for name in "abc"],
        seed=1,
        options=FEWER,
    )
    S = np.linalg.inv(np.eye(3) + A.T @ A)
    mean, deviation = S @ A.T @ y, np.sqrt(np.diag(S))
    R = np.eye(6) + A @ A.T
    evidence = -0.5 * (y @ np.linalg.solve(R, y) + np.linalg.slogdet(2 * np.pi * R)[1])
    assert np.all(np.abs(found.mean - mean) < 0.01 * deviation)
    assert np.abs(found.deviation / deviation - 1).max() < 0.01
    assert abs(found.log_evidence - evidence) < 0.01
    assert len(found.lobes) == 1


def two_storeys(t):
    """Frequencies [Hz] of a shear frame of two storeys."""
    k1, k2 = 29.7e6 * t[0], 29.7e6 * t[1]
    root = np.array([16.5e3, 16.1e3]) ** -0.5
    K = root[:, None] * np.array([[k1 + k2, -k2], [-k2, k2]]) * root
    return np.sqrt(np.linalg.eigvalsh(K)) / (2 * np.pi)


@pytest.mark.slow
def test_a_frame_of_two_storeys_has_two_lobes_with_their_masses():
    """J. L. Beck, S.-K. Au, J. Eng. Mech. 128 (2002) 380: two stiffnesses change places."""
    measured = np.array([3.13, 9.83])
    found = nested_posterior(
        lambda t: -0.5 * 16**2 * np.sum((two_storeys(t) ** 2 / measured**2 - 1) ** 2),
        [log_normal("t1", 1.3, 1.0, 0.005, 4.0), log_normal("t2", 0.8, 1.0, 0.005, 4.0)],
        seed=3,
        options=FEWER,
    )
    assert len(found.lobes) == 2
    expected = (0.572, (0.493, 0.906)), (0.428, (1.831, 0.244))
    for lobe, (mass, best) in zip(found.lobes, expected, strict=True):
        assert abs(lobe.mass - mass) < 0.03
        assert np.all(np.abs(lobe.mean / best - 1) < 0.05)


@pytest.mark.slow
def test_a_parameter_that_does_nothing_is_named_and_leaves_the_evidence():
    def likelihood(theta):
        return -0.5 * ((theta[0] - 0.3) / 0.05) ** 2

    options = NestedOptions(live=100, drawn=2048)
    one = nested_posterior(likelihood, [uniform("k", 0, 1)], seed=1, options=options)
    two = nested_posterior(
        likelihood, [uniform("k", 0, 1), log_uniform("idle", 1, 1e3)], seed=1, options=options
    )
    assert one.undetermined == () and two.undetermined == ("idle",)
    exact = np.log(0.05 * np.sqrt(2 * np.pi))
    assert abs(one.log_evidence - exact) < 0.05 and abs(two.log_evidence - exact) < 0.1
    assert model_probabilities({"one": exact, "two": exact - np.log(3)})["one"] == pytest.approx(
        0.75
    )


@pytest.mark.slow
def test_a_model_error_that_is_fitted_widens_the_bars_to_what_the_model_misses():
    """One stiffness, five frequencies that scatter by 3 % and were measured to 0.1 %."""
    scatter = 1 + 0.03 * np.array([1.2, -0.9, 0.3, -1.3, 0.7])
    measured = 100 * scatter * np.arange(1, 6)

    def bars(priors, error):
        found = nested_posterior(
            lambda theta: frequencies_log_likelihood(
                100 * np.sqrt(theta[0]) * np.arange(1, 6), measured, 1e-3, error(theta)
            ),
            priors,
            seed=1,
            options=NestedOptions(live=200, drawn=4096),
        )
        return found.deviation[0], found.log_evidence

    stiffness = uniform("k", 0.5, 2.0)
    narrow, worse = bars([stiffness], lambda theta: 0.0)
    wide, better = bars([stiffness, log_uniform("error", 1e-4, 0.3)], lambda theta: theta[1])
    assert narrow == pytest.approx(2 * 1e-3 / 5**0.5, rel=0.1)
    assert 0.02 < wide < 0.06  # 2 * 0.03 / sqrt(5), and what five numbers leave open
    assert better > worse + 100
