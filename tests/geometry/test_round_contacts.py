"""Round faces that touch at a point or along a line, against their curvatures and lengths."""

import numpy as np
import pytest

from beadwave.geometry.cad.occ import model
from beadwave.geometry.cad.shapes import Box, Cylinder
from beadwave.geometry.cad.touching import round_neighbours

GAP = 1e-5
LYING = {"turn": (90, 0, 0)}
BAR = Cylinder(0.02, 0.1, **LYING)


def contacts(**shapes):
    with model(shapes) as cad:
        return list(round_neighbours(*cad.bodies.values(), GAP))


@pytest.mark.parametrize(
    ("other", "radius", "length"),
    [
        pytest.param(Box((0.1, 0.06, 0.01), at=(0, 0, -0.025)), 0.02, 0.06, id="on a plate"),
        pytest.param(
            Cylinder(0.03, 0.05, bore=0.0201, at=(0, 0, 1e-4), **LYING), 4.02, 0.05, id="in a bore"
        ),
        pytest.param(Cylinder(0.01, 0.04, at=(0, 0, 0.03), **LYING), 0.02 / 3, 0.04, id="on a bar"),
    ],
)
def test_a_bar_touches_along_a_line(other, radius, length):
    """Relative radius 1 / (1/R_1 + 1/R_2), of a bore 1 / (1/R_1 - 1/R_2)."""
    (line,) = contacts(bar=BAR, other=other)
    assert 1 / line.curvature == pytest.approx(radius, rel=1e-6)
    assert line.length == pytest.approx(length, rel=0.05)
    assert abs(line.along[1]) == pytest.approx(1.0)


def test_crossed_bars_touch_at_a_point():
    """kappa_1 kappa_2 = 1 / (R_1 R_2)."""
    across = Cylinder(0.01, 0.1, turn=(0, 90, 0), at=(0, 0, 0.03))
    (point,) = contacts(bar=BAR, across=across)
    assert point.length == 0 and point.along is None
    assert 1 / point.curvature == pytest.approx(np.sqrt(0.02 * 0.01), rel=1e-4)
    np.testing.assert_allclose(point.points, [[0, 0, 0.02]], atol=1e-6)


@pytest.mark.parametrize("at", [(0, 0, -0.0253), (0.0601, 0, -0.025)])
def test_bars_off_a_plate_or_past_its_edge_touch_nowhere(at):
    """0.3 mm above it; and with the edge of the plate 10 mm beside the bar's lowest line."""
    assert not contacts(bar=BAR, plate=Box((0.1, 0.06, 0.01), at=at))
