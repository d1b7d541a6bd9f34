"""One basis for many contacts says of each what a reduction of its own says."""

import numpy as np
import pytest
import scipy.sparse as sp

from beadwave.coupling import ModalDamping
from beadwave.coupling.many_contacts import walls_of
from beadwave.coupling.reduced_wall import wall_from_reduced
from beadwave.rom import full_order, many_contacts, modal, receptance, superlu
from beadwave.rom.factorisation import symmetric
from beadwave.rom.floating import pencil
from beadwave.rom.lanczos import modes_below

from known_models import steel_bar

CUTOFF = 30e3  # Hz, below six modes of the bar
DAMPING = ModalDamping(0.01)


def structure(held, n=450):
    """A steel bar, and functionals at three places of it."""
    K, M, _ = steel_bar(1.6e-3, n=n, held=held)
    W = np.zeros((n, 3))
    W[n // 7, 0] = W[n // 2, 1] = 1.0
    W[-4:, 2] = 0.25
    return K, M, sp.csc_array(W)


def face(K, M, W, cutoff_hz, n_vectors=1):
    problem = pencil(symmetric(K, "K"), symmetric(M, "M"), superlu)
    return many_contacts(problem, modes_below(problem, cutoff_hz), W, n_vectors)


@pytest.mark.parametrize("held", [True, False], ids=["held", "floating"])
def test_each_wall_is_that_of_the_full_model_with_the_same_modes(held):
    K, M, W = structure(held)
    half_space = np.array([1e-10, 2e-10, 0.0])
    result = walls_of(face(K, M, W, cutoff_hz=CUTOFF), 1, half_space=half_space, damping=DAMPING)
    for i in range(3):
        wall_i = wall_from_reduced(
            full_order(K, M, W[:, [i]].toarray().ravel()), half_space=half_space[i],
            damping=DAMPING, cutoff_hz=CUTOFF,
        )  # fmt: skip
        assert len(wall_i.omega) == result.omega.shape[1] > 4
        scale = wall_i.omega.max()
        assert np.abs(result.omega[i] - wall_i.omega).max() < 1e-7 * scale
        assert np.abs(result.phi[i] ** 2 - wall_i.phi**2).max() < 1e-7 * (wall_i.phi**2).max()
        assert np.array_equal(result.zeta[i] > 0, wall_i.omega > 1e-6 * scale)
        assert result.residual_compliance[i] == -half_space[i]
        # the full model says the same but for rounding of what the modes leave
        rounding = 1e-7 * (wall_i.phi[-1] / scale) ** 2
        assert abs(wall_i.residual_compliance + half_space[i]) < rounding


@pytest.mark.parametrize("held", [True, False], ids=["held", "floating"])
def test_n_oscillators_have_two_n_moments_of_all_modes_beyond(held):
    K, M, W = structure(held)
    contacts = face(K, M, W, cutoff_hz=CUTOFF, n_vectors=5)
    for i in range(3):
        exact = modal(full_order(K, M, W[:, [i]].toarray().ravel()))
        far = exact.omega > 2 * np.pi * CUTOFF
        for n in (1, 2, 5):
            beyond = contacts.beyond(n)
            assert beyond.omega.shape == (3, n) and (np.diff(beyond.omega[i]) > 0).all()
            for m in range(1, 2 * n + 1):
                full = (
                    exact.phi[far] ** 2 * (2 * np.pi * CUTOFF / exact.omega[far]) ** (2 * m)
                ).sum()
                ours = (
                    beyond.phi[i] ** 2 * (2 * np.pi * CUTOFF / beyond.omega[i]) ** (2 * m)
                ).sum()
                assert abs(ours / full - 1) < 1e-6
        assert beyond.omega[i, 0] > 0.999 * exact.omega[far].min()  # a Ritz value, from above


def test_enough_oscillators_stand_for_the_full_model():
    K, M, W = structure(True)
    hz = np.linspace(100.0, 20e3, 50)
    s = 2 * np.pi * hz[:, None]
    full = receptance(full_order(K, M, W[:, [1]].toarray().ravel()), None, hz, loss=0.02)
    contacts = face(K, M, W, cutoff_hz=5e3, n_vectors=12)
    missed = []
    for n in (1, 4, 12):
        wall = walls_of(contacts, n, half_space=np.zeros(3))
        sums = (wall.phi[1] ** 2 / (wall.omega[1] ** 2 * (1 + 0.02j) - s**2)).sum(axis=1)
        missed.append(np.abs(sums - full).max() / np.abs(full).max())
    assert missed[0] > 0.1 > missed[1] > 1e-2 > 1e3 * missed[2]


def test_a_contact_with_nothing_beyond_the_modes_has_oscillators_that_do_not_move():
    K, M, _ = steel_bar(1.6e-3, n=6)
    W = sp.csc_array(np.eye(6)[:, [2, 5]])
    contacts = face(K, M, W, cutoff_hz=1e9, n_vectors=3)
    assert len(contacts.omega) == 6
    wall = walls_of(contacts, 3, half_space=np.zeros(2))
    assert np.isfinite(wall.omega).all() and (wall.omega > 0).all()
    static = (wall.phi**2 / wall.omega**2).sum(axis=1)
    assert np.abs(static / np.linalg.inv(K.toarray())[[2, 5], [2, 5]] - 1).max() < 1e-9
    two_left = face(
        K,
        M,
        W,
        cutoff_hz=float(np.sort(contacts.omega)[3] + contacts.omega[4]) / 4 / np.pi,
        n_vectors=4,
    )
    beyond = two_left.beyond(4)
    assert ((beyond.phi**2 / beyond.omega**2 > 1e-12 * static[:, None]).sum(axis=1) <= 2).all()


def test_lumped_oscillators_keep_static_response_and_moment_of_inertia():
    K, M, W = structure(True)
    beyond = face(K, M, W, cutoff_hz=5e3, n_vectors=8).beyond(8)
    limit = 40e3
    lumped = beyond.lumped(limit)
    high = beyond.omega > 2 * np.pi * limit
    assert (0 < high.sum(axis=1)).all() and (high.sum(axis=1) < 7).all()
    for power in (2, 4):
        one, other = ((o.phi**2 / o.omega**power).sum(axis=1) for o in (beyond, lumped))
        assert np.abs(one / other - 1).max() < 1e-12
    assert np.array_equal(lumped.phi[~high], beyond.phi[~high])
    assert np.array_equal(lumped.omega[~high], beyond.omega[~high])
    assert np.array_equal((lumped.phi[0] != 0).sum(), (~high[0]).sum() + 1)
    assert all(np.array_equal(a, b) for a, b in zip(beyond, beyond.lumped(np.inf), strict=True))
