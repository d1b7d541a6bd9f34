"""Sizes of elements from energies missed: the optimum beside a search over all sizes."""

import numpy as np
import pytest
from scipy.optimize import minimize

from beadwave.fem.errors.optimal_sizes import (
    COARSEST,
    SMOOTH_ORDER,
    Regions,
    balanced_weights,
    kappa_for,
)

rng = np.random.default_rng(5)


def drawn_regions(k):
    """Elements, columns and layers with orders of their own, and k quantities that are bounded."""
    return [
        Regions(10 ** rng.uniform(-1, 1, (n, k)), rng.uniform(10, 50, n), d, np.full(n, q))
        for n, d, q in ((4, 3, SMOOTH_ORDER), (3, 2, SMOOTH_ORDER), (2, 1, 2.0))
    ]


def fewest(regions, allowed):
    """Sizes that a general optimiser finds, and their unknowns."""
    splits = np.cumsum([len(r.energy) for r in regions])[:-1]

    def each(x):
        return zip(regions, np.split(np.exp(x), splits), strict=True)

    def unknowns(x):
        return sum(float(r.cost @ f**-r.dimension) for r, f in each(x))

    # convex in log f: logarithms of both, whose steps do not overflow
    def left(x):
        return np.log(allowed / sum(r.errors(f) for r, f in each(x)))

    start = np.full(sum(len(r.energy) for r in regions), np.log(0.3))
    best = minimize(
        lambda x: np.log(unknowns(x)), start, method="SLSQP",
        constraints={"type": "ineq", "fun": left},
        options={"maxiter": 500, "ftol": 1e-9},  # below 1e-10 its line search ends in rounding
    )  # fmt: skip
    assert best.success
    assert np.exp(best.x).max() < COARSEST
    return unknowns, np.exp(best.fun)


@pytest.mark.parametrize("k", [1, 3])
def test_no_other_sizes_have_fewer_unknowns_at_the_errors_allowed(k):
    """Of elements, columns and layers with orders of their own, beside a general optimiser."""
    regions, allowed = drawn_regions(k), 0.3
    weights = balanced_weights(regions, allowed)
    kappa = kappa_for(regions, allowed, weights)
    found = [r.factors(kappa, weights) for r in regions]
    errors = sum(r.errors(f) for r, f in zip(regions, found, strict=True))
    assert errors.max() == pytest.approx(allowed)
    unknowns, best = fewest(regions, allowed)
    assert unknowns(np.log(np.concatenate(found))) == pytest.approx(best, rel=1e-3)


def test_an_error_that_is_small_anyhow_has_no_weight():
    """Where one quantity misses a thousandth of what another one does, sizes are those of the
    larger one alone; where two miss in elements of their own, both are met."""
    cost, order = np.full(2, 30.0), np.full(2, SMOOTH_ORDER)
    one = np.array([[0.5, 0.0], [0.5, 1e-3]])
    weights = balanced_weights([Regions(one, cost, 3, order)], 0.1)
    assert weights == pytest.approx([1.0, 0.0], abs=1e-9)
    each = Regions(np.array([[2.0, 0.0], [0.0, 0.5]]), cost, 3, order)
    weights = balanced_weights([each], 0.1)
    errors = each.errors(each.factors(kappa_for([each], 0.1, weights), weights))
    assert errors == pytest.approx([0.1, 0.1], rel=1e-3)


def test_an_even_error_keeps_even_sizes():
    regions = [Regions(np.full((5, 1), 0.5), np.full(5, 30.0), 3, np.full(5, SMOOTH_ORDER))]
    f = regions[0].factors(kappa_for(regions, 1.0, np.ones(1)), np.ones(1))
    assert f == pytest.approx((1 / 2.5) ** (1 / SMOOTH_ORDER))
