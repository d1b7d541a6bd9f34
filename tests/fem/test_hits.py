"""Hits become frequency responses, spoiled ones are named; modes of several references beside the
truth of synthetic tests."""

import numpy as np
import pytest

from beadwave.fem.identification.hit_records import TimeRecord, cut_at_hits
from beadwave.fem.identification.hits import (
    FrequencyResponses,
    HitChecks,
    Hits,
    frequency_responses,
    until_noise,
)
from beadwave.fem.identification.poly_reference import (
    Stability,
    background,
    identified_modes,
    modal_fit,
    phase_collinearity,
    poles_of_orders,
)
from beadwave.fem.identification.synthetic_hits import (
    HammerDefects,
    HammerHits,
    struck,
    synthetic_hits,
)
from beadwave.fem.modes.mac import mac

CLEAN = HammerDefects(noise=0.0, double=0.0, overload=0.0, cross=0.0)
POLES = 2 * np.pi * np.array([-0.5 + 90j, -0.6 + 200j, -0.7 + 202j])


def modal_model(f, poles=POLES, points=4, references=2):
    """H (points, references, f) of random real shapes, and these (points, n)."""
    rng = np.random.default_rng(0)
    phi, L = rng.normal(size=(points, len(poles))), rng.normal(size=(references, len(poles)))
    s = 2j * np.pi * f
    terms = 1j / (s - poles[:, None]) - 1j / (s - poles.conj()[:, None])
    return np.einsum("pn,mn,nf->pmf", phi, L, terms), phi, L.T


def test_records_of_a_hit_have_the_responses_of_the_modes():
    """To 1 / 2.56 of the sampling rate; measured: 1e-6 of the largest. Of a force that is linear
    between samples, responses are up to 6 % lower."""
    hz, zeta = np.array([90.0, 300.0, 800.0]), np.array([0.02, 0.01, 0.004])
    one, dt, k = np.ones((1, 3)), 1 / (2.56 * 1.2 * 800.0), 2**14
    plan = HammerHits(1, 1, dt, k, 1 / 800.0)
    rng = np.random.default_rng(0)
    force, response, *_ = struck(rng, (hz, zeta), (one, one, one), HammerDefects(*[0.0] * 5), plan)
    f = np.fft.rfftfreq(k, dt)
    H = np.fft.rfft(response[0, 0]) / np.fft.rfft(force[0])
    w = 2 * np.pi * np.column_stack([f] * 3)
    o = 2 * np.pi * hz
    exact = np.sum(-(w**2) / (o**2 - w**2 + 2j * zeta * o * w), axis=1)
    within = (f > 10) & (f < 960)
    assert np.abs(H - exact)[within].max() < 3e-6 * np.abs(exact).max()


def test_the_spoiled_hits_are_left_out_and_no_others():
    for seed in range(3):
        defects = HammerDefects(noise=0.05, double=0.2, overload=0.2)
        test = synthetic_hits(seed, defects, points=4, duration=1.0)
        remarks = frequency_responses(test.hits).remarks
        assert {int(r.split()[1]) - 1 for r in remarks if "is left out" in r} == {
            *np.flatnonzero(test.spoiled)
        }


def test_h1_keeps_to_the_force_h2_to_the_response_and_hv_lies_between():
    """With noise in the responses alone H1 is unbiased and H2 larger by 1 / coherence."""
    test = synthetic_hits(1, CLEAN._replace(noise=0.05), points=3, repeats=5, duration=0.5)
    H1, H2, Hv = (frequency_responses(test.hits, name) for name in ("H1", "H2", "Hv"))
    assert np.all((H1.coherence > 0) & (H1.coherence < 1 + 1e-12))
    np.testing.assert_allclose(H1.H / H2.H, H1.coherence, rtol=1e-9)
    np.testing.assert_allclose(np.abs(Hv.H) ** 2, np.abs(H1.H * H2.H), rtol=1e-9)


def test_the_exponential_window_shifts_poles_by_what_is_handed_on():
    """Without noise the damping ratios with and without a window agree; uncorrected they would
    differ by shift / omega, 1 / 200 at 90 Hz."""
    test = synthetic_hits(2, CLEAN, points=3, references=2, repeats=1, modes=4)
    options = Stability(poles=24)
    plain, windowed = (
        identified_modes(
            frequency_responses(test.hits, checks=HitChecks(decay=decay)), test.band_hz, options
        )
        for decay in (None, 0.01)
    )
    assert frequency_responses(test.hits, checks=HitChecks(decay=0.01)).shift > 2
    np.testing.assert_allclose(plain.zeta, test.zeta, rtol=0.01)
    np.testing.assert_allclose(windowed.zeta, test.zeta, rtol=0.01)
    np.testing.assert_allclose(plain.frequency_hz, test.frequency_hz, rtol=1e-4)


def test_poles_and_participation_of_an_exact_model_come_out_of_one_order():
    """Six poles are those of order 3 with two references; B of that order holds the rest to 1e-3
    of the frequency, as z is no polynomial of omega."""
    f = np.arange(20.0, 400.0, 0.25)
    H, _, L = modal_model(f)
    ((_, poles, factors),) = poles_of_orders(f, H, np.ones((4, len(f))), range(6, 7))
    for pole, factor in zip(POLES, L, strict=True):
        i = int(np.abs(poles - pole).argmin())
        assert abs(poles[i] - pole) < 1e-3 * abs(pole)
        assert mac(factors[i][:, None], factor[:, None])[0, 0] > 0.99


def test_the_modal_fit_returns_the_model_that_it_is_given():
    """From poles 0.1 % off to the exact ones; 1e-6, as the fit stops at a small gain."""
    f = np.arange(20.0, 400.0, 0.5)
    H, phi, L = modal_model(f)
    fit = modal_fit(f, H, np.ones((4, 2)), POLES * 1.001, L.astype(complex), 10, (6, 3))
    np.testing.assert_allclose(fit.pole, POLES, rtol=1e-6)
    assert np.all(np.diag(mac(fit.phi, phi)) > 1 - 1e-9)


def test_deviations_are_the_scatter_of_the_estimates():
    """Of 20 draws of noise the scatter is known to 16 %; a wrong derivative is off by far more."""
    rng, f = np.random.default_rng(5), np.arange(20.0, 400.0, 0.5)
    H, _, _ = modal_model(f)
    estimates, deviations = [], []
    for _ in range(20):
        noise = 0.02 * np.abs(H).mean() * (rng.normal(size=(2, *H.shape)))
        test = FrequencyResponses(f, H + noise[0] + 1j * noise[1], tuple("abcd"), tuple("rs"))
        modes = identified_modes(test, (20.0, 400.0), Stability(poles=20))
        estimates.append([modes.frequency_hz, modes.zeta])
        deviations.append([modes.frequency_deviation, modes.zeta_deviation])
    scatter = np.std(estimates, axis=0) / np.mean(deviations, axis=0)
    assert np.all((scatter > 0.5) & (scatter < 1.5)), scatter


def test_responses_without_noise_have_finite_deviations():
    """Of rounding, 1e-6 and less; the misfit itself may be rounded below zero."""
    f = np.arange(20.0, 400.0, 0.5)
    H, *_ = modal_model(f)
    test = FrequencyResponses(f, H, tuple("abcd"), tuple("rs"))
    modes = identified_modes(test, (20.0, 400.0), Stability(poles=20))
    for deviation in (modes.frequency_deviation, modes.zeta_deviation, modes.phi_deviation):
        assert np.isfinite(deviation).all() and deviation.max() < 1e-5


def test_a_mode_beyond_the_band_is_background():
    """A mode at 1.2 times the band's end is met to 3.5^-5, of the size that it has in the band."""
    f = np.arange(20.0, 400.0, 1.0)
    outside = 1 / (1 - (f / 480.0) ** 2)
    rows = background(f, 6, 3).T
    misfit = outside - rows @ np.linalg.lstsq(rows, outside.astype(complex), rcond=None)[0]
    assert np.abs(misfit).max() < 3.5**-5 * np.abs(outside).max()


@pytest.mark.slow
@pytest.mark.parametrize("held", [True, False])
def test_modes_beside_a_band_s_end_are_within_their_deviations(held):
    """The end lies 0.7 % below a mode, of which the test has lines or has none; of 375 modes of 20
    tests 97 and 96 % of frequencies and damping ratios lie within two deviations."""
    ratios = []
    for seed in (100, 101, 102):
        test = synthetic_hits(seed, HammerDefects(noise=0.02))
        responses, hz = frequency_responses(test.hits), test.frequency_hz
        for k in (4, 5, 6):
            end, whole = 0.993 * hz[k], responses
            if hz[k - 1] > 0.985 * end:
                continue
            if not held:
                at = responses.frequency_hz <= end
                whole = responses._replace(
                    frequency_hz=responses.frequency_hz[at], H=responses.H[:, :, at],
                    excited=responses.usable[at],
                    halves=tuple(half[:, :, at] for half in responses.halves),
                    deletions=tuple(
                        d._replace(change=d.change[..., at]) for d in responses.deletions
                    ),
                )  # fmt: skip
            modes = identified_modes(whole, (0.0, end))
            for i in range(k):
                j = np.abs(modes.frequency_hz - hz[i]).argmin()
                if abs(modes.frequency_hz[j] / hz[i] - 1) < 2e-3:
                    ratios.append((modes.frequency_hz[j] - hz[i]) / modes.frequency_deviation[j])
                    ratios.append((modes.zeta[j] - test.zeta[i]) / modes.zeta_deviation[j])
    within = np.mean(np.abs(ratios) < 2.0)
    assert len(ratios) > 60 and within > 0.9, (len(ratios), within)


def test_real_shapes_are_collinear_and_travelling_waves_are_not():
    x = np.linspace(0, 2 * np.pi, 50, endpoint=False)
    phi = np.column_stack([np.exp(0.3j) * np.cos(x), np.exp(1j * x)])
    np.testing.assert_allclose(phase_collinearity(phi), [1, 0], atol=1e-12)


def test_long_records_end_where_noise_is_all_that_is_left():
    """An eighth of the record holds the decay: a quarter of it is kept, and deviations fall by the
    noise of the rest; a decay that lasts to the end is kept whole."""
    rng, k = np.random.default_rng(0), 2**15
    decay = np.exp(-np.arange(k) / (k / 100)) * np.cos(np.arange(k))
    noise = 1e-3 * rng.normal(size=(2, k))
    assert until_noise([decay + noise], 1.2) == k // 4
    assert until_noise([np.exp(-np.arange(k) / k) + noise], 1.2) == k
    assert until_noise([noise[:, :1500]], 1.2) == 1500
    assert until_noise([noise[:, :2048]], 1.2) == 1024


def test_a_ring_down_without_force_gives_the_poles():
    rng, t = np.random.default_rng(3), np.arange(4096) / 2048.0
    waves = np.exp(np.outer(POLES, t))
    phi, start = rng.normal(size=(5, 3)), rng.normal(size=(2, 3))
    records = np.einsum("pn,rn,nk->rpk", phi, start, waves).real
    records += 0.01 * records.std() * rng.normal(size=records.shape)
    hits = Hits(1 / 2048.0, None, records, np.arange(2), ("1", "2"), tuple("abcde"), "ring-down")
    modes = identified_modes(frequency_responses(hits), (20.0, 400.0), Stability(poles=32))
    np.testing.assert_allclose(modes.frequency_hz, np.abs(POLES) / (2 * np.pi), rtol=1e-3)
    np.testing.assert_allclose(modes.zeta, -POLES.real / np.abs(POLES), rtol=0.1)


def hits_with(force, response):
    n = len(force)
    return Hits(1e-3, force, response, np.zeros(n, int), ("p",), ("a",), "test")


def test_records_that_hold_no_hit_are_refused_in_a_sentence():
    rng = np.random.default_rng(0)
    noise = rng.normal(size=(1, 2000))
    pulse = np.zeros((1, 2000))
    pulse[0, 100:104] = 1.0, 3.0, 3.1, 1.0
    swinging = np.exp(-np.arange(2000) / 500.0)[None] * np.sin(np.arange(2000) / 3.0)
    ringing = np.abs(swinging)
    with pytest.raises(ValueError, match="no pulse in the force"):
        frequency_responses(hits_with(noise, noise[:, None]))
    with pytest.raises(ValueError, match="NaN or inf"):
        frequency_responses(hits_with(pulse, np.full((1, 1, 2000), np.nan)))
    with pytest.raises(ValueError, match="force rings on"):
        frequency_responses(hits_with(ringing, pulse[:, None]))
    with pytest.raises(ValueError, match="force changes its sign: force and response are swapped"):
        frequency_responses(hits_with(swinging, pulse[:, None]))
    with pytest.raises(ValueError, match="trigger is late"):
        frequency_responses(hits_with(np.roll(pulse, 1850), noise[:, None]))
    with pytest.raises(ValueError, match="must be one of H1, H2, Hv"):
        frequency_responses(hits_with(pulse, noise[:, None]), "H3")


@pytest.mark.parametrize(
    ("starts", "duration", "left_out", "lengths"),
    [
        ([0.1, 5.1, 5.5, 10.0], 15.0, 1, (4490, 4510)),
        ([0.1, 6.0], 7.0, 1, (5890, 5910)),
        ([0.1, 5.1, 10.1], 14.0, 0, (3890, 5010)),
    ],
)
def test_a_hit_that_is_left_out_shortens_no_other(starts, duration, left_out, lengths):
    force = np.zeros(int(duration * 1000))
    force[(np.array(starts) * 1000).astype(int)] = 1.0
    record = TimeRecord(1e-3, force, force[None], "1+z", ("1+z",), "")
    pieces, remarks = cut_at_hits([record])
    assert len(remarks) == left_out and len(pieces) == len(starts) - left_out
    assert all(lengths[0] <= len(piece.force) <= lengths[1] for piece in pieces)


def test_a_few_lines_of_one_response_have_their_mode():
    """Too few lines for another number of background terms, which else widens the bars."""
    f = np.arange(1, 100.0) * 5
    H = 1 / (1e4 - f**2 + 10j * f)
    modes = identified_modes(FrequencyResponses(f, H[None, None], ("a",), ("hammer",)))
    np.testing.assert_allclose(modes.frequency_hz, [100.0], rtol=1e-6)
    np.testing.assert_allclose(modes.zeta, [0.05], rtol=1e-6)
