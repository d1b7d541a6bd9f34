"""Tones of a sensor that is not linear are told from modes."""

import numpy as np
import pytest

from beadwave.fem.identification.distortion import combination_tone
from beadwave.fem.identification.hits import Hits, frequency_responses
from beadwave.fem.identification.poly_reference import identified_modes

DT = 1 / 2048
T = DT * np.arange(3 * 2048)
HZ, ZETA = np.array([83.0, 301.0]), np.array([0.002, 0.003])


def ring_down(square):
    """Two modes at three sensors, whose readings are y + square y^2, and noise."""
    rng = np.random.default_rng(3)
    phi = np.array([[1.0, 0.8], [0.5, -1.0], [-0.7, 0.6]])
    decay = np.exp(-2 * np.pi * np.outer(HZ * ZETA, T)) * np.cos(2 * np.pi * np.outer(HZ, T))
    y = phi @ decay
    y = y + square * y**2 + 2e-4 * rng.normal(size=y.shape)
    hits = Hits(DT, None, y[None], np.array([0]), ("1+z",), ("1+z", "2+z", "3+z"), "")
    return frequency_responses(hits)


def tones(responses, varies=True):
    """Each identified frequency with its tone."""
    f, H = responses.frequency_hz, np.abs(responses.H).max(axis=(0, 1))
    modes = identified_modes(responses, (30.0, 500.0))
    height = np.array([H[np.abs(f - hz) < 1.0].max() for hz in modes.frequency_hz])
    each = np.full(len(height), varies)
    return {
        round(hz): combination_tone(i, modes.frequency_hz, modes.zeta, height, each)
        for i, hz in enumerate(modes.frequency_hz)
    }


def test_squares_of_a_motion_are_named_by_the_modes_that_they_come_from():
    """(y_1 + y_2)^2 rings at 2 x 83, at 301 - 83 and at 301 + 83 Hz."""
    result = tones(ring_down(square=0.05))
    assert result[83] is None and result[301] is None
    names = {hz: tone for hz, tone in result.items() if tone}
    assert set(names) == {166, 218, 384}
    assert names[166].startswith("2 x 83.0") and names[218].startswith("30")
    assert " - 8" in names[218] and " + 8" in names[384]


def test_no_tone_is_named_where_damping_depends_on_no_amplitude():
    """Also not the even spacing of a rod's modes, of which one is weak."""
    assert not any(tones(ring_down(square=0.05), varies=False).values())
    hz, zeta = 100.0 * np.arange(1, 8), np.full(7, 2e-3)
    for weak in range(1, 7):
        height = np.where(np.arange(7) == weak, 0.01, 1.0)
        assert combination_tone(weak, hz, zeta, height, np.zeros(7, bool)) is None
        assert combination_tone(weak, hz, zeta, height, np.arange(7) == 0) is not None


@pytest.mark.parametrize(
    ("hz", "zeta", "height"),
    [
        (166.5, 0.002, 0.01),  # 0.3 % beside the harmonic
        (166.0, 0.010, 0.01),  # decays five times as fast
        (166.0, 0.002, 0.20),  # as strong as a mode
    ],
)
def test_a_mode_near_a_harmonic_is_none_where_place_decay_or_height_differ(hz, zeta, height):
    frequency, damping = np.array([83.0, hz, 301.0]), np.array([0.002, zeta, 0.003])
    every = np.ones(3, bool)
    assert combination_tone(1, frequency, damping, np.array([1.0, height, 0.5]), every) is None
    frequency, damping = np.array([83.0, 166.0]), np.array([2e-3, 2e-3])
    assert combination_tone(1, frequency, damping, np.array([1.0, 0.01]), every[:2])
