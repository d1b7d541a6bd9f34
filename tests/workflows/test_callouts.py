"""Names beside a picture of bodies."""

import numpy as np
import pytest

from beadwave.workflows.report.callouts import N_LINES, callouts

ALONG, UP = (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)  # seen along y: x to the right, z upwards


def slab(x, y, z, side=1.0):
    """Points of an upright square that looks at the eye."""
    u, v = np.meshgrid(np.linspace(-side / 2, side / 2, 41), np.linspace(-side / 2, side / 2, 41))
    return np.column_stack([x + u.ravel(), np.full(u.size, y), z + v.ravel()])


@pytest.mark.parametrize(("n", "on_left"), [(14, 0), (20, 10)])
def test_names_do_not_overlap_and_stand_on_the_right_while_there_is_room(n, on_left):
    rng = np.random.default_rng(1)
    bodies = [slab(*rng.uniform(0, 4, 3), side=0.5) for _ in range(n)]
    labels = callouts(bodies, ALONG, UP)
    points = np.concatenate(bodies)
    size = np.ptp(points[:, [0, 2]], axis=0).max()
    for left in (True, False):
        side = [callout for callout in labels if callout.left == left]
        assert len(side) == (on_left if left else n - on_left)
        heights = np.sort([callout.text[2] for callout in side])
        assert np.all(np.diff(heights) > 0.999 * size / N_LINES)
        edge = points[:, 0].min() if left else points[:, 0].max()
        assert all((callout.text[0] < edge) == left for callout in side)


def test_a_hidden_body_is_named_so_and_a_half_hidden_one_is_pointed_at_where_it_is_visible():
    front, behind, half_hidden = slab(0, -1, 0, 2.0), slab(0.2, 1, 0.1), slab(1.2, 1, 0)
    labels = callouts([front, behind, half_hidden], ALONG, UP)
    assert [callout.seen for callout in labels] == [True, False, True]
    assert labels[2].anchor[0] > 1.0
    assert all(callout.anchor[1] == -1 for callout in labels)  # moved before all bodies


def test_names_stand_across_from_a_side_that_is_occupied():
    bodies = [slab(x, 0, x, 0.5) for x in range(4)]
    for x, left in ((1.0, True), (-1.0, False)):
        labels = callouts(bodies, ALONG, UP, occupied=(x, 0.0, -0.2))
        assert [callout.left for callout in labels] == [left] * 4
        heights = np.sort([callout.text[2] for callout in labels])
        assert np.diff(heights).min() > 3.0 / N_LINES
    for along in ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), None):  # no side of the picture
        assert not any(callout.left for callout in callouts(bodies, ALONG, UP, occupied=along))
