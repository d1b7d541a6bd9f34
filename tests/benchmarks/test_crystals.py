"""Benchmarks of crystals, made small."""

import pytest

import crystals as benchmark
import space_errors


@pytest.mark.slow
def test_contact_steps_are_timed_beside_the_peer():
    (row,) = benchmark.main(largest=300)
    assert row.contacts == 271 and 0.0 < row.smooth < 1e-5 and 0.0 < row.rubbing < 1e-5


@pytest.mark.slow
@pytest.mark.parametrize("rubs", [0, 1, 2])
def test_stated_errors_are_compared_with_true_ones(rubs):
    for found in space_errors.main(2, 40, rubs):
        assert 0.0 < found.true <= found.stated
