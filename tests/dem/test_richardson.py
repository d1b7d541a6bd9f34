"""Richardson's estimate, beside errors that are known."""

import numpy as np
import pytest

from beadwave.dem.richardson import richardson


@pytest.mark.parametrize("order", [1.0, 1.5, 2.0, 2.5])
def test_an_error_that_is_a_power_of_the_step_is_found_exactly(order):
    C, h, H = 3.0, np.array([0.1, 0.02]), np.array([0.25, 0.04])
    difference = C * (H**order - h**order)
    np.testing.assert_allclose(richardson(difference, H / h, order), C * h**order, rtol=1e-13)
