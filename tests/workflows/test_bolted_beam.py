"""The fit of the example of a bolted beam, on tests with known frequency and damping."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

EXAMPLE = Path(__file__).parents[2] / "examples" / "bolted_beam.py"


def test_sine_tests_have_the_frequency_and_damping_of_their_oscillator(tmp_path):
    """m (w0^2 - w^2 + 2 i zeta w0 w) u = f of 2 kg at 80 Hz, at held amplitudes w^2 u."""
    spec = importlib.util.spec_from_file_location("bolted_beam", EXAMPLE)
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    f = np.arange(79.0, 81.0, 0.05)
    tests = np.empty(2, [(name, object) for name in ("frequency", "force", "amplitude", "phase")])
    for i, (amplitude, zeta) in enumerate(((20.0, 0.002), (5.0, 0.0015))):
        omega, w0 = 2 * np.pi * f, 2 * np.pi * 80.0
        force = 2.0 * (w0**2 - omega**2 + 2j * zeta * w0 * omega) / omega**2 * amplitude
        tests[i] = f, np.abs(force), np.full_like(f, amplitude), -np.angle(force)
    path = tmp_path / "tests.mat"
    savemat(path, {"FRdata": {"ResponseControl": tests}})
    low, high = example.sine_tests(path)
    assert low == pytest.approx((5.0, 80.0, 0.0015), rel=1e-3)
    assert high == pytest.approx((20.0, 80.0, 0.002), rel=1e-3)
