"""One basis for many contacts says of each what a reduction of its own says."""

import numpy as np
import pytest
import scipy.sparse as sp

from coupling import ModalDamping
from coupling.many_contacts import walls_of
from coupling.wall import wall_from_reduced
from known_models import steel_bar
from rom import Face, full_order, receptance, superlu
from rom.factorisation import symmetric
from rom.floating import pencil
from rom.lanczos import modes_below

CUTOFF = 30e3  # Hz, below six modes of the bar
DAMPING = ModalDamping(0.01)


def structure(held, n=450):
    """A steel bar, and functionals at three places of it."""
    K, M, _ = steel_bar(1.6e-3, n=n, held=held)
    W = np.zeros((n, 3))
    W[n // 7, 0] = W[n // 2, 1] = 1.0
    W[-4:, 2] = 0.25
    return K, M, sp.csc_array(W)


def face(K, M, W, cutoff_hz):
    problem = pencil(symmetric(K, "K"), symmetric(M, "M"), superlu)
    return Face(problem, modes_below(problem, cutoff_hz), W)


@pytest.mark.parametrize("held", [True, False], ids=["held", "floating"])
def test_each_wall_is_that_of_the_full_model_with_the_same_modes(held):
    K, M, W = structure(held)
    half_space = np.array([1e-10, 2e-10, 0.0])
    found = walls_of(
        face(K, M, W, cutoff_hz=CUTOFF).contacts, half_space=half_space, damping=DAMPING
    )
    for i in range(3):
        own = wall_from_reduced(
            full_order(K, M, W[:, [i]].toarray().ravel()), half_space=half_space[i],
            damping=DAMPING, cutoff_hz=CUTOFF,
        )  # fmt: skip
        assert len(own.omega) == found.omega.shape[1] > 4
        scale = own.omega.max()
        assert np.abs(found.omega[i] - own.omega).max() < 1e-7 * scale
        assert np.abs(found.phi[i] ** 2 - own.phi**2).max() < 1e-7 * (own.phi**2).max()
        assert np.array_equal(found.zeta[i] > 0, own.omega > 1e-6 * scale)
        assert found.residual_compliance[i] == -half_space[i]
        # the full model says the same but for rounding of what the modes leave
        assert abs(own.residual_compliance + half_space[i]) < 1e-7 * (own.phi[-1] / scale) ** 2


def test_fewer_modes_are_those_of_a_lower_cutoff():
    K, M, W = structure(True)
    lower = face(K, M, W, cutoff_hz=CUTOFF / 2).contacts
    cut = face(K, M, W, cutoff_hz=CUTOFF).contacts.below(CUTOFF / 2)
    assert len(lower.omega) == len(cut.omega) > 1
    for one, other in zip(lower, cut, strict=True):
        assert np.abs(np.abs(one) / np.abs(other) - 1.0).max() < 1e-6


def test_the_finer_model_stands_for_the_full_one():
    K, M, W = structure(True)
    hz = np.linspace(100.0, 20e3, 50)
    full = receptance(full_order(K, M, W[:, [1]].toarray().ravel()), None, hz, loss=0.02)
    finer = receptance(face(K, M, W, cutoff_hz=5e3).finer(1, 20e3), None, hz, loss=0.02)
    assert np.abs(finer - full).max() < 1e-6 * np.abs(full).max()
