"""Errors of an L-bracket over its unknowns, of meshes that an error is asked of."""

import numpy as np
import pytest

import bracket_rate

pytestmark = pytest.mark.usefixtures("shared_cache")


def test_exponents_are_slopes_of_logarithms():
    assert bracket_rate.exponent([(n, 7 * n**-1.25) for n in (900, 4000, 20_000)]) == (
        pytest.approx(1.25)
    )


def test_the_best_sizes_reach_their_exponent_at_many_unknowns_only():
    """Of sizes r^((6 - 2 lambda) / 7) errors fall as N^-1.09; with a few thousand unknowns they
    reach from the edge to the outside within a few elements."""
    few, many, most = (
        [bracket_rate.ideal(unknowns, of_edge) for of_edge in (1.0, 5.0, 30.0)]
        for unknowns in ([3000, 40_000], [1_000_000, 4_000_000], [10**8, 10**9])
    )
    assert np.all(np.diff([few, many, most], axis=0) > 0)
    assert max(few) < 0.9 < min(many)
    assert 1.0 < min(most) < max(most) < bracket_rate.TWO_LAMBDA


@pytest.mark.slow
@pytest.mark.parametrize(
    ("element", "errors", "least"), [("hex", "0.05 0.01 0.002", 0.95), ("tet", "0.05 0.01", 0.85)]
)
def test_errors_of_sizes_asked_for_fall_twice_as_fast_as_those_of_even_ones(
    element, errors, least, monkeypatch, capsys
):
    """The truth from one grid less, within 4e-4 of that of `limit`. Exponents are 1.00 and 0.94,
    those of even elements 0.42 and 0.49; without jumps of stresses that of hexahedra is 0.8."""
    monkeypatch.setattr(bracket_rate, "INNERMOST", (4e-4, 2e-4))
    ours, even = bracket_rate.main([element, *errors.split()])[element]
    assert ours > least
    assert ours > 1.8 * even
    if element == "tet":
        assert ours > bracket_rate.ideal([4446, 24_276], bracket_rate.OF_EDGE[1])
    told = [line for line in capsys.readouterr().out.splitlines() if " asked " in line]
    rows = np.array([[float(line.split()[i].strip("%")) for i in (2, 5, 7)] for line in told])
    assert np.all(rows[:, 2] < rows[:, 1]) and np.all(rows[:, 1] <= rows[:, 0])
