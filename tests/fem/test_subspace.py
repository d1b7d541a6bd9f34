"""Modes of records without a force beside those that they were made of."""

import numpy as np
import pytest

from beadwave.fem.identification.subspace import (
    correlations,
    half_spectra,
    is_decay,
    subspace_modes,
    subspace_poles,
)
from beadwave.fem.modes.mac import mac

from ambient_records import DT, ZETA, F, ambient


def test_correlations_of_a_decay_have_its_poles_exactly():
    """R_k = C A^(k-1) G to rounding: order 4 has both poles."""
    poles = 2 * np.pi * np.array([-0.3 + 12j, -0.5 + 31j])
    t = DT * np.arange(1000)
    y = np.einsum("mn,nk->mk", np.array([[1.0, 2], [3, -1]]), np.exp(np.outer(poles, t))).real
    ((_, found, _),) = subspace_poles(correlations(y, 60), DT, (4,))
    np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(poles), rtol=1e-8)


@pytest.mark.slow
def test_modes_of_ambient_vibration_lie_within_their_deviations():
    """Four deviations: of 16 numbers one in 16000 falls outside by chance."""
    for seed in (0, 1):
        y, phi = ambient(seed, 240.0)
        modes = subspace_modes([y], DT, (6.0, 100.0))
        assert len(modes.zeta) == 4
        assert np.all(np.abs(modes.frequency_hz - F) < 4 * modes.frequency_deviation)
        assert np.all(np.abs(modes.zeta - ZETA) < 4 * modes.zeta_deviation)
        assert np.all(modes.zeta_deviation < 0.5 * ZETA)
        assert np.all(np.diag(mac(modes.phi, phi)) > 0.95)


def test_a_pole_is_rejected_by_its_number_and_a_wrong_number_is_refused():
    y, _ = ambient(2, 120.0)
    modes = subspace_modes([y], DT, (6.0, 100.0))
    rest = subspace_modes([y], DT, (6.0, 100.0), reject=(int(modes.number[0]),))
    assert modes.number[0] not in rest.number
    assert [pole.reason for pole in rest.left_out if pole.number == modes.number[0]] == ["rejected"]
    with pytest.raises(ValueError, match="pole 99 is none"):
        subspace_modes([y], DT, (6.0, 100.0), reject=(99,))


def test_short_records_are_refused_in_a_sentence():
    with pytest.raises(ValueError, match=r"samples a block .* are needed: record longer"):
        subspace_modes([np.random.default_rng(0).normal(size=(3, 600))], DT, (6.0, 100.0))


def test_ambient_vibration_is_no_decay_and_a_decay_is_one():
    y, _ = ambient(3, 60.0)
    assert not is_decay(y)
    assert is_decay(y * np.exp(-np.arange(y.shape[1]) / (0.2 * y.shape[1])))


def test_half_spectra_peak_at_the_modes():
    y, _ = ambient(4, 240.0)
    f, H, shift = half_spectra([y], DT, 1000)
    power = np.sum(np.abs(H) ** 2, axis=(0, 1))
    assert shift > 0
    for hz in F[[0, 3]]:
        near = np.abs(f - hz) < 2
        assert abs(f[near][power[near].argmax()] - hz) < 0.5
