"""One basis for several contacts, against dense algebra."""

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.linalg import eigh

from beadwave import rom
from beadwave.rom.truncation import LOSS, frequencies, rms, size

N = 80
TO_HZ = 1.2  # of modes from 0.03 to 13 Hz


def structure(held=True):
    link = np.diff(np.eye(N), axis=0)
    K = link.T @ np.diag(np.linspace(1e3, 3e3, N)[1:]) @ link
    K[0, 0] += 1e3 if held else 0.0
    return sp.csc_array(K), sp.csc_array(np.diag(np.linspace(1.0, 2.0, N)))


def contacts(*places):
    return np.eye(N)[:, list(places)]


def receptances(omega, phi, s):
    """(k, p, p) at s [rad/s] of participations phi (n, p)."""
    resonance = 1 / (omega**2 * (1 + 1j * LOSS) - s[:, None] ** 2)
    return np.einsum("kn,ni,nj->kij", resonance, phi, phi)


def full(K, M, W):
    square, shapes = eigh(K.toarray(), M.toarray())
    omega = np.sqrt(np.where(square < 1e-9 * square[-1], 0.0, square))
    return omega, shapes.T @ W


def functionals(reduced):
    return np.column_stack([reduced.w, reduced.columns.load])


@pytest.mark.parametrize("held", [True, False])
@pytest.mark.parametrize("error", [1e-2, 1e-4])
def test_every_receptance_is_within_the_error_that_holds_for_all_contacts_together(held, error):
    K, M = structure(held)
    W = contacts(79, 40, 12)
    reduced = rom.several_contacts(K, M, W, error=error, to_hz=TO_HZ)
    assert len(reduced.w) < N - 10 and reduced.error <= error
    s = 2 * np.pi * frequencies(TO_HZ)
    exact = receptances(*full(K, M, W), s)
    modes = rom.modal(reduced)
    mine = receptances(modes.omega, modes.vectors.T @ functionals(reduced), s)
    for i in range(3):
        for j in range(3):
            scale = np.sqrt(size(exact[:, i, i]) * size(exact[:, j, j]))
            assert rms(mine[:, i, j] - exact[:, i, j]) / scale < error
    finer = rom.modal(reduced.finer)
    best = receptances(finer.omega, finer.vectors.T @ functionals(reduced.finer), s)
    assert rms((best - exact).ravel()) < 1e-6 * rms(exact.ravel())


def test_static_response_between_contacts_is_exact():
    """That of one contact under a force at the other, however large the error may be."""
    K, M = structure()
    W = contacts(79, 30)
    reduced = rom.several_contacts(K, M, W, error=0.5, to_hz=0.05)
    exact = W.T @ np.linalg.solve(K.toarray(), W)
    W_r = functionals(reduced)
    np.testing.assert_allclose(W_r.T @ np.linalg.solve(reduced.K, W_r), exact, rtol=1e-9)


def test_modes_handed_in_are_kept():
    K, M = structure()
    square, shapes = eigh(K.toarray(), M.toarray())
    modes = np.sqrt(square[[1, 4]]), shapes[:, [1, 4]]
    reduced = rom.several_contacts(K, M, contacts(79, 40), error=1e-2, to_hz=TO_HZ, modes=modes)
    for omega in modes[0]:
        assert np.abs(rom.modal(reduced).omega / omega - 1).min() < 1e-9
