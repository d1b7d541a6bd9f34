"""Factors of one stiffness by several solvers."""

import pytest

import factor


@pytest.mark.slow
def test_every_solver_finds_the_known_solution():
    rows = factor.main(5.0, ("cantilever",))
    assert {row[2] for row in rows} >= {factor.OWN, factor.SUPERLU}
    for _, n, _, order, in_all, one, eight, _, error in rows:
        assert n > 1000 and in_all > (order or 0.0) and one > 0 and eight > 0
        assert error < 1e-6
