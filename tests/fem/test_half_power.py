"""Half-power bandwidths, and modes of responses beside those of an independent code."""

import numpy as np
import pytest

from beadwave.fem.identification.half_power import half_power_bandwidth
from beadwave.fem.identification.hits import FrequencyResponses
from beadwave.fem.identification.poly_reference import identified_modes

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


def test_a_peak_at_the_second_line_has_the_frequency_of_its_three_lines_and_no_bandwidth():
    amplitude = np.abs(responses([(200.0, 0.01)], n=1)[0])
    top = int(amplitude.argmax())
    whole, _ = half_power_bandwidth(F, amplitude, top)
    for ends in (slice(top - 1, None), slice(None, top + 2)):
        at = int(amplitude[ends].argmax())
        f, bandwidth = half_power_bandwidth(F[ends], amplitude[ends], at)
        assert f == whole and np.isnan(bandwidth)


def test_modes_agree_with_the_common_denominator_fit_of_sdypy():
    """Two estimates from the same noisy responses: within 0.1 %, and 5 % of the damping."""
    ema = pytest.importorskip("sdypy.EMA", reason="an independent code, for this comparison alone")
    H = responses([(51.0, 0.02), (269.0, 0.01), (907.0, 0.005)], noise=1e-3, n=3)
    lines = F < 1100
    names = tuple("abc")
    ours = identified_modes(FrequencyResponses(F[lines], H[:, None, lines], names, ("hammer",)))
    model = ema.Model(
        H[:, lines], F[lines], lower=20, upper=1000, pol_order_high=20, frf_form="receptance"
    )
    model.get_poles(method="lscf", show_progress=False)
    assert len(ours.zeta) == 3
    for hz, zeta in zip(ours.frequency_hz[1:], ours.zeta[1:], strict=True):
        near = [
            (float(f[i]), float(xi[i]))
            for f, xi in zip(model.pole_freq, model.pole_xi, strict=True)
            for i in np.flatnonzero((np.abs(f / hz - 1) < 0.01) & (xi > 0) & (xi < 0.1))
        ]
        other = np.median(np.array(near), axis=0)
        assert other[0] == pytest.approx(hz, rel=1e-3)
        assert other[1] == pytest.approx(zeta, rel=0.05)
