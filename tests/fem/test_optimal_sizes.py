"""Sizes of elements from energies missed: the optimum beside a search over all sizes."""

import numpy as np
import pytest
from scipy.optimize import minimize

from beadwave.fem.errors.optimal_sizes import SMOOTH_ORDER, Regions, kappa_for

rng = np.random.default_rng(5)


def test_no_other_sizes_have_fewer_unknowns_at_the_error_allowed():
    """Of elements, columns and layers with orders of their own, beside a general optimiser."""
    regions = [
        Regions(10 ** rng.uniform(-1, 1, n), rng.uniform(10, 50, n), d, np.full(n, q))
        for n, d, q in ((4, 3, SMOOTH_ORDER), (3, 2, SMOOTH_ORDER), (2, 1, 2.0))
    ]
    allowed = 0.3
    found = [r.factors(kappa_for(regions, allowed)) for r in regions]
    assert sum(r.error(f) for r, f in zip(regions, found, strict=True)) == pytest.approx(allowed)

    splits = np.cumsum([len(r.energy) for r in regions])[:-1]

    def each(x):
        return zip(regions, np.split(np.exp(x), splits), strict=True)

    def unknowns(x):
        return sum(float(r.cost @ f**-r.dimension) for r, f in each(x))

    def left(x):
        return allowed - sum(r.error(f) for r, f in each(x))

    start = np.full(sum(len(r.energy) for r in regions), np.log(0.3))
    best = minimize(
        unknowns, start, method="SLSQP", constraints={"type": "ineq", "fun": left},
        options={"maxiter": 500, "ftol": 1e-9},  # below 1e-10 its line search ends in rounding
    )  # fmt: skip
    assert best.success
    assert unknowns(np.log(np.concatenate(found))) == pytest.approx(best.fun, rel=1e-4)


def test_an_even_error_keeps_even_sizes():
    regions = [Regions(np.full(5, 0.5), np.full(5, 30.0), 3, np.full(5, SMOOTH_ORDER))]
    f = regions[0].factors(kappa_for(regions, 1.0))
    assert f == pytest.approx((1 / 2.5) ** (1 / SMOOTH_ORDER))
