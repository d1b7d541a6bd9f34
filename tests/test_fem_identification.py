import numpy as np
import pytest

from fem.identification import half_power_bandwidth, measured_modes

F = np.arange(1.0, 2000.0, 0.25)


def responses(modes, noise=0.0, n=2):
    """Receptances of modes (frequency, damping ratio) at n points, all participations positive."""
    rng = np.random.default_rng(0)
    omega = 2 * np.pi * F
    H = np.zeros((n, len(F)), dtype=complex)
    for f, zeta in modes:
        w = 2 * np.pi * f
        H += rng.uniform(0.5, 1, (n, 1)) * f / (w**2 - omega**2 + 2j * zeta * w * omega)
    size = noise * np.abs(H).mean()
    return H + size * (rng.normal(size=H.shape) + 1j * rng.normal(size=H.shape))


def test_half_power_of_a_light_mode_is_its_damping():
    # receptance: (f2 - f1) / 2 fn = zeta (1 + O(zeta^2)); a line every sixteenth of the bandwidth
    amplitude = np.abs(responses([(200.0, 0.01)], n=1)[0])
    f, bandwidth = half_power_bandwidth(F, amplitude, int(amplitude.argmax()))
    assert f == pytest.approx(200.0 * np.sqrt(1 - 2 * 0.01**2), rel=1e-5)
    assert bandwidth / (2 * f) == pytest.approx(0.01, rel=5e-3)


def test_both_methods_find_separate_modes_through_noise():
    truth = [(51.0, 0.02), (269.0, 0.01), (907.0, 0.005)]
    computed = measured_modes(F, responses(truth, noise=1e-3))
    strong = [m for m in computed if not m.remarks]
    np.testing.assert_allclose([m.frequency_hz for m in strong], [51, 269, 907], rtol=2e-3)
    np.testing.assert_allclose([m.zeta for m in strong], [0.02, 0.01, 0.005], rtol=0.1)
    np.testing.assert_allclose([m.zeta_half_power for m in strong], [0.02, 0.01, 0.005], rtol=0.1)


def test_two_close_modes_are_remarked_upon():
    computed = measured_modes(F, responses([(300.0, 0.005), (306.0, 0.005), (900.0, 0.005)]))
    assert any("another peak" in remark for remark in computed[0].remarks + computed[1].remarks)
    assert computed[-1].remarks == ()


def test_a_weak_peak_is_remarked_upon():
    H = responses([(300.0, 0.005), (900.0, 0.005)])
    H += 1.5e-3 * responses([(600.0, 0.01)])
    weak = [m for m in measured_modes(F, H, prominence=1.02) if abs(m.frequency_hz - 600) < 10]
    assert len(weak) == 1 and "weak" in weak[0].remarks[0]


@pytest.mark.parametrize(
    ("f", "H", "sentence"),
    [
        (F[:10], np.ones(10), "at least 40"),
        (F, np.full(len(F), np.nan), "NaN"),
        (F[::-1], np.ones(len(F)), "evenly spaced"),
        (np.geomspace(1, 100, 200), np.ones(200), "evenly spaced"),
    ],
)
def test_unusable_responses_are_refused(f, H, sentence):
    with pytest.raises(ValueError, match=sentence):
        measured_modes(f, H)
