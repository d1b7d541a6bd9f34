"""Oscillators of a receptance: exact where there is no noise, passive where there is."""

from importlib import import_module

import numpy as np
import pytest

from beadwave import rom

HZ = np.arange(20.0, 5000.0, 5.0)
LOSSES = np.array([0.004, 0.01, 0.006, 0.008])
TRUE = rom.ModalFit(
    2 * np.pi * np.array([150.0, 900.0, 2200.0, 3100.0]), LOSSES,
    np.sqrt([[0.8, 0.3, 0.05, 0.4]]), np.zeros((1, 0)), np.array([[2e-9]]),
)  # fmt: skip


def response(fit, hz=HZ):
    return rom.modal_receptance(fit, hz)[:, 0, 0]


def fitted(hz, H):
    """Oscillators of one driving point, which can move rigidly in one way."""
    return rom.passive_fit(hz, H, most_free=1)


def noisy(H, share, seed=3):
    rng = np.random.default_rng(seed)
    return H * (1 + share * (rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape)))


@pytest.mark.parametrize("inverse_mass", [0.0, 0.2])
def test_a_receptance_without_noise_gives_its_oscillators_back(inverse_mass):
    """To 1e-9, what the cancellation of 1e-6 of a residue leaves of 1e-16."""
    true = TRUE._replace(free=np.sqrt(np.full((1, int(inverse_mass > 0)), inverse_mass)))
    fit = fitted(HZ, response(true))
    nearest = [np.abs(fit.omega - omega).argmin() for omega in true.omega]
    for name in ("omega", "zeta"):
        assert np.abs(getattr(fit, name)[nearest] / getattr(true, name) - 1).max() < 1e-8
    assert np.abs(fit.phi[0, nearest] ** 2 / true.phi[0] ** 2 - 1).max() < 1e-8
    assert abs(np.sum(fit.free**2) - inverse_mass) < 1e-9
    assert fit.misfit < 1e-9


def test_of_noise_of_2_per_cent_frequencies_are_within_their_deviations():
    """A line of noise e moves a mode by e zeta / sqrt(lines in its half-power band) at most; there
    are 2 zeta f / 5 Hz of these, and one where the band is narrower."""
    fit = fitted(HZ, noisy(response(TRUE), 0.02))
    nearest = [np.abs(fit.omega - omega).argmin() for omega in TRUE.omega]
    lines = np.maximum(2 * TRUE.zeta * TRUE.omega / (2 * np.pi) / 5.0, 1.0)
    assert np.all(np.abs(fit.omega[nearest] / TRUE.omega - 1) < 4 * 0.02 * TRUE.zeta / lines**0.5)
    assert fit.free.size == 0


def test_poles_of_exact_responses_are_found_by_one_relocation(monkeypatch):
    """sigma = prod(s - a_true) / prod(s - a) solves the linear problem exactly from any a (B.
    Gustavsen, A. Semlyen, IEEE Trans. Power Delivery 14 (1999) 1052)."""
    module = import_module("beadwave.rom.passive_fit")  # the room has its function by this name
    monkeypatch.setattr(module, "N_RELOCATIONS", 1)
    H = response(TRUE)[:, None]
    poles = np.sort_complex(-1j * module.common_poles(2 * np.pi * HZ, H, np.abs(H), 4))
    np.testing.assert_allclose(np.abs(poles), TRUE.omega, rtol=1e-9)
    np.testing.assert_allclose(poles.imag / np.abs(poles), TRUE.zeta, rtol=1e-8)


def test_a_fit_has_at_least_four_lines_for_each_of_its_modes():
    """Eight modes at 30 lines, of which 8 x 4 would be needed: noise could be fitted as well."""
    hz, omega = np.linspace(20.0, 1000.0, 30), 2 * np.pi * np.linspace(40.0, 960.0, 8)
    shape = np.linspace(0.3, 1.0, 8)[None]
    true = rom.ModalFit(omega, np.full(8, 0.03), shape, np.zeros((1, 0)), np.array([[1e-7]]))
    fit = rom.passive_fit(hz, response(true, hz), most_free=0)
    assert 4 * len(fit.omega) <= len(hz)


@pytest.mark.parametrize("seed", range(4))
def test_a_fit_never_gives_power_whatever_the_noise(seed):
    """Re of the mobility i omega H is not negative, in the band and far outside of it."""
    fit = fitted(HZ, noisy(response(TRUE), 0.3, seed))
    f = np.geomspace(0.1, 1e6, 4000)
    assert np.all(response(fit, f).imag <= 0)
    assert fit.compliance[0, 0] >= 0


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda H: -H, "no"),
        (lambda H: H * np.nan, "NaN"),
        (lambda H: 2j * np.pi * HZ * H, "driving point"),
        (lambda H: 0 * H, "0 at all"),
    ],
)
def test_what_is_no_receptance_of_a_driving_point_is_refused(change, sentence):
    with pytest.raises(rom.ReductionError, match=sentence):
        fitted(HZ, change(response(TRUE)))


@pytest.mark.parametrize("noise", [0.0, 1e-4, 1e-2])
def test_a_constant_loss_factor_makes_no_modes_that_are_not_measured(noise):
    """A free part of two modes in the band, loss factor 1 %: without the check of what each pole
    makes of the response, poles damped by up to 0.5 imitated the loss factor."""
    hz = np.arange(5.0, 3000.0, 2.0)
    w = 2 * np.pi * hz
    o = 2 * np.pi * np.array([590.7, 1628.4, 3192.4, 5277.0])
    H = np.sum(34 / (o**2 * (1 + 0.01j) - w[:, None] ** 2), axis=1) - 8.5 / w**2
    rng = np.random.default_rng(0)
    H = H * (1 + noise * (rng.normal(size=len(w)) + 1j * rng.normal(size=len(w))) / np.sqrt(2))
    fit = fitted(hz, H)
    inside = fit.omega < w[-1]
    np.testing.assert_allclose(fit.omega[inside], o[:2], rtol=1e-3)
    assert np.sum(fit.free**2) == pytest.approx(8.5, rel=0.01)
