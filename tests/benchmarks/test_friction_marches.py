"""Both marches of a last sphere with friction meet within what they state."""

import pytest

import friction_marches


@pytest.mark.slow
def test_both_marches_meet_within_their_errors():
    *seconds, difference, first, second = friction_marches.compared(
        *friction_marches.SCENES["one direction, oblique"]
    )
    assert min(seconds) > 0.0 and difference < first + second < 2 * friction_marches.ERROR
