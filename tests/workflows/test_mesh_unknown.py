"""A mesh of whose errors nothing is known has no shapes, and no mode is one of them."""

import numpy as np

from beadwave.workflows.stages.errors.mesh_error import MeshErrorEstimate


def test_no_mode_is_a_shape_where_the_errors_of_the_mesh_are_unknown():
    nothing = MeshErrorEstimate(np.empty(0), np.empty((0, 0)), None, unknown="no factor of K")
    np.testing.assert_array_equal(nothing.shapes_of(np.array([1.0, 2.0])), [-1, -1])
    assert np.isnan(nothing.of_frequencies(np.array([1.0, 2.0]))).all()
