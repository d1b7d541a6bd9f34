"""Rates of the parts of a run beside the machine's best."""

import pytest

import limits


@pytest.mark.slow
def test_every_part_has_an_error_and_a_share_of_what_the_machine_does():
    rows = {row[0]: row[1:] for row in limits.main("cantilever", "1.5")}
    assert list(rows) == ["order", "factor", "solution", "product", "projection", "chain"]
    for part in ("factor", "solution", "chain"):
        assert 0 < rows[part][0] < 1e-6
    for part, (_, first, later, *rates, _) in rows.items():
        assert first > 0 and later > 0
        if part != "order":
            rate, best, _, share = rates
            assert share == pytest.approx(rate / best) and 0 < share < 1.5
