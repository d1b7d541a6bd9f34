"""Points of a test that tell modes apart."""

import numpy as np
import pytest
from skfem import MeshHex

from beadwave.fem import Connections, Material, Tie, assemble, joined
from beadwave.fem.identification.sensor_placement import (
    effective_independence,
    one_more_point,
    outside,
)
from beadwave.fem.modes.mac import mac

STEEL = Material(210e9, 0.3, 7850.0)


def test_points_of_sines_tell_all_of_them_apart():
    """Of n sines n evenly spaced points do: their MAC is 1 with themselves and 0 with others. The
    points found are as good to 0.2, where the first n of them leave a MAC above 0.9."""
    x = np.linspace(0.0, 1.0, 201)[1:-1]
    phi = np.sin(np.pi * np.outer(x, np.arange(1, 6)))
    kept = effective_independence(phi, 5)
    assert len(kept) == 5 and np.all(np.diff(kept) > 0)
    worst = (mac(phi[kept], phi[kept]) - np.eye(5)).max()
    assert worst < 0.2
    assert (mac(phi[:5], phi[:5]) - np.eye(5)).max() > 0.9


def test_of_points_that_move_alike_one_is_taken():
    x = np.linspace(0.0, 1.0, 60)[1:-1]
    phi = np.sin(np.pi * np.outer(x, np.arange(1, 4)))
    kept = effective_independence(np.concatenate([phi, phi]), 6)
    assert len({int(i) % len(x) for i in kept}) == 6


def test_fewer_points_than_modes_and_modes_alike_are_refused():
    phi = np.random.default_rng(0).normal(size=(20, 4))
    with pytest.raises(ValueError, match="3 points; 4 modes need 4 to 20 points"):
        effective_independence(phi, 3)
    phi[:, 3] = phi[:, 0]
    with pytest.raises(ValueError, match="look alike at all candidates"):
        effective_independence(phi, 5)


def test_candidates_lie_outside_and_away_from_where_bodies_meet():
    low = MeshHex.init_tensor(*[np.linspace(0.0, 0.04, 5)] * 3)
    high = low.translated((0.0, 0.0, 0.04))
    names = {
        "low": {"top": lambda x: x[2] > 0.04 - 1e-9},
        "high": {"foot": lambda x: x[2] < 0.04 + 1e-9},
    }
    bodies = {
        name: mesh.with_boundaries(names[name]) for name, mesh in (("low", low), ("high", high))
    }
    structure = assemble(bodies, {"low": STEEL, "high": STEEL})
    model = joined(structure, Connections([Tie("low:top", "high:foot")]))
    candidates = outside(model)
    assert not np.any(np.abs(candidates.points[:, 2] - 0.04) < 1e-9)
    on_face = np.take_along_axis(candidates.points, candidates.axes[:, None], axis=1)[:, 0]
    sides = np.where(candidates.axes == 2, 0.08, 0.04)
    assert np.all(np.isclose(on_face, 0.0) | np.isclose(on_face, sides))
    assert np.all(candidates.reading % 3 == candidates.axes)


def test_one_more_point_is_the_one_that_lowers_the_mac_most():
    rng = np.random.default_rng(0)
    phi = rng.normal(size=(4, 1)) * [1.0, 1.02] + 0.02 * rng.normal(size=(4, 2))
    candidates = rng.normal(size=(30, 2))
    best, with_it = one_more_point(phi, candidates)
    each = [mac(*np.split(np.vstack([phi, row]), 2, axis=1))[0, 0] for row in candidates]
    assert best == int(np.argmin(each)) and with_it == pytest.approx(min(each), rel=1e-12)
    assert with_it < mac(phi[:, :1], phi[:, 1:])[0, 0]
