"""Names beside a picture of bodies."""

import numpy as np

from workflows.report.callouts import LINES, callouts

ALONG, UP = (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)  # seen along y: x to the right, z upwards


def slab(x, y, z, side=1.0):
    """Points of an upright square that looks at the eye."""
    u, v = np.meshgrid(np.linspace(-side / 2, side / 2, 41), np.linspace(-side / 2, side / 2, 41))
    return np.column_stack([x + u.ravel(), np.full(u.size, y), z + v.ravel()])


def test_names_of_many_bodies_stand_apart_and_beside_them():
    rng = np.random.default_rng(1)
    bodies = [slab(*rng.uniform(0, 4, 3), side=0.5) for _ in range(14)]
    found = callouts(bodies, ALONG, UP)
    whole = np.concatenate(bodies)
    size = np.ptp(whole[:, [0, 2]], axis=0).max()
    for left in (True, False):
        side = [callout for callout in found if callout.left == left]
        assert len(side) == 7
        heights = np.sort([callout.text[2] for callout in side])
        assert np.diff(heights).min() > 0.999 * size / LINES
        edge = whole[:, 0].min() if left else whole[:, 0].max()
        assert all((callout.text[0] < edge) == left for callout in side)


def test_a_body_behind_another_is_told_and_one_in_part_is_pointed_at_where_it_is_seen():
    front, behind, peeping = slab(0, -1, 0, 2.0), slab(0.2, 1, 0.1), slab(1.2, 1, 0)
    found = callouts([front, behind, peeping], ALONG, UP)
    assert [callout.seen for callout in found] == [True, False, True]
    assert found[2].anchor[0] > 1.0
    assert all(callout.anchor[1] == -1 for callout in found)  # moved before all bodies
