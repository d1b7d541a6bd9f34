"""A hammer test computed from a seed, with the defects of real ones, and the true values.

A structure of random modes is hit at every point several times (roving hammer), a few sensors
record. Records are those of an ideal analyser: the force went through a filter against aliasing,
and responses are exact between samples, of a force that has no more than the band:

    X(s) = sum_i phi_i c_i s^2 F(s) / (s^2 + 2 zeta omega s + omega^2),    s = sigma + i omega_k

Lines of the Fourier transform lie near the imaginary axis, where a record that goes on ringing
comes round e^(-sigma T) times smaller.

Defects: noise in force and response, records shorter than the decay (leakage), double hits,
overloads, hits off their direction, sensors that read across their axis, two modes 1 % apart.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len

from beadwave.fem.identification.hits import Hits

# samples by which the filter against aliasing rings before and after a pulse: enough for it to be
# flat to 1 / 2.56 of the sampling rate and 100 dB down from where the rest would fold back on that
RINGING = 16
# factor by which a response is reduced that rings on beyond the record of the transform, and so
# comes round to its beginning; rounding grows by the square root of this factor
ROUND = 1e10


class HammerDefects(NamedTuple):
    """Defects of a synthetic test."""

    noise: float = 0.02  # rms over that of the channel's record
    double: float = 0.1  # share of the hits that are double
    overload: float = 0.1  # share of the hits with a clipped response
    cross: float = 0.03  # share of the other sensors' signals in a sensor, and of a side hit
    close: float = 0.01  # relative distance of the two closest modes


class SyntheticTest(NamedTuple):
    """Records and what they were made of; shapes are at the points hit."""

    hits: Hits
    frequency_hz: NDArray[np.float64]  # (n,) of the modes within the band
    zeta: NDArray[np.float64]  # (n,)
    phi: NDArray[np.float64]  # (p, n)
    phi_at_sensors: NDArray[np.float64]  # (m, n) as they read, across their axes included
    spoiled: NDArray[np.bool_]  # (hits,) double or clipped
    band_hz: tuple[float, float]


def synthetic_hits(
    seed: int,
    defects: HammerDefects = HammerDefects(),
    *,
    points: int = 12,
    references: int = 3,
    repeats: int = 5,
    modes: int = 8,
    duration: float = 2.0,
) -> SyntheticTest:
    """Records of `duration` [s] with `modes` modes between 80 and 850 Hz, of damping ratios 0.2 to
    2 % (the larger at lower frequencies), one of them `close` to another, and two modes above."""
    rng = np.random.default_rng(seed)
    rate, band = 4096.0, (40.0, 950.0)
    dt, k = 1 / rate, round(duration * rate)

    # apart by their number of bandwidths, then one more close above one of them
    f = np.linspace(90.0, 820.0, modes - 1) * (1 + rng.uniform(-0.04, 0.04, modes - 1))
    i = int(rng.integers(modes - 1))
    f = np.sort([*f, f[i] * (1 + defects.close), 1150.0, 1400.0])
    zeta = np.exp(rng.uniform(np.log(0.002), np.log(0.02), len(f))) * np.minimum(1, 250 / f)
    zeta = np.maximum(zeta, 0.002)
    phi, side = rng.normal(size=(2, points, len(f)))
    at_sensors = phi[rng.choice(points, references, replace=False)]
    mixing = np.eye(references) + defects.cross * rng.uniform(-1, 1, (references, references))

    plan = HammerHits(points, repeats, dt, k, 1e-3)
    force, response, point, spoiled = struck(
        rng, (f, zeta), (phi, side, mixing @ at_sensors), defects, plan
    )
    inside = f < band[1]
    hits = Hits(
        dt, force, response, point,
        tuple(f"point {p + 1}" for p in range(points)),
        tuple(f"sensor {r + 1}" for r in range(references)), "SYNTHETIC: computed, not measured",
    )  # fmt: skip
    return SyntheticTest(
        hits, f[inside], zeta[inside], phi[:, inside], (mixing @ at_sensors)[:, inside], spoiled,
        band,
    )  # fmt: skip


class HammerHits(NamedTuple):
    """Hits on a structure: `repeats` times at every point, records of k samples."""

    points: int
    repeats: int
    dt: float  # [s]
    k: int
    width: float  # [s] of a pulse, 0.8 to 1.2 of it


def struck(
    rng: np.random.Generator,
    poles: tuple[NDArray[np.float64], NDArray[np.float64]],
    shapes: tuple[NDArray[np.float64], ...],
    defects: HammerDefects,
    plan: HammerHits,
) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Forces (n, k), responses (n, m, k), points (n,) and whether a hit is double or clipped, of
    modes with frequencies [Hz] and damping ratios (q,), shapes at the points (p, q), across the
    direction of the hits there (p, q), and at the sensors (m, q). Forces in N, responses in m/s^2.
    """
    dt, k = plan.dt, plan.k
    phi, side, at_sensors = shapes

    # of each mode, force to acceleration at the lines of a record twice as long
    n = next_fast_len(2 * k, real=True)
    sigma = np.log(ROUND) / (n * dt)
    t, rise = np.arange(k) * dt, np.exp(sigma * dt * np.arange(k))
    s = sigma + 2j * np.pi * np.fft.rfftfreq(n, dt)
    omega, zeta = 2 * np.pi * np.asarray(poles[0])[:, None], np.asarray(poles[1])[:, None]
    accelerance = s**2 / (s**2 + 2 * zeta * omega * s + omega**2)  # (q, lines)

    # hit by hit: pulse, a second one where it bounces, the response, noise, and what is clipped
    force, response, point, spoiled = [], [], [], []
    for p in range(plan.points):
        for _ in range(plan.repeats):
            start = rng.uniform(0.01, 0.02) + RINGING * dt
            width = plan.width * rng.uniform(0.8, 1.2)
            pulse = recorded_pulse(t, start, width) * rng.uniform(50, 150)
            is_double, is_clipped = rng.random(2) < (defects.double, defects.overload)
            if is_double:
                later = start + rng.uniform(4e-3, 30e-3)
                pulse += pulse.max() * rng.uniform(0.2, 0.6) * recorded_pulse(t, later, width)
            hit = phi[p] + defects.cross * rng.uniform(-1, 1) * side[p]
            F = np.fft.rfft(pulse / rise, n)
            x = np.fft.irfft((at_sensors * hit) @ accelerance * F, n)[:, :k] * rise
            noise = rng.normal(size=(1 + len(at_sensors), k)) * defects.noise
            pulse = pulse + noise[0] * np.sqrt(np.mean(pulse**2))
            x = x + noise[1:] * np.sqrt(np.mean(x**2, axis=1, keepdims=True))
            if is_clipped:
                x = np.clip(x, *(0.6 * np.abs(x).max() * np.array([-1, 1])))
            force.append(pulse)
            response.append(x)
            point.append(p)
            spoiled.append(is_double or is_clipped)
    return np.array(force), np.array(response), np.array(point), np.array(spoiled)


def recorded_pulse(
    t: NDArray[np.float64], start: float, width: float, finer: int = 32
) -> NDArray[np.float64]:
    """The pulse sin^2(pi (t - start) / width) of a length `width` at evenly spaced times (k,), as
    an analyser records it: filtered without a delay, flat to 1 / 2.56 of the sampling rate and 100
    dB less beyond what would fold back on that; sampled `finer` for the filter."""
    from scipy.signal import firwin, kaiser_beta

    dt = t[1] - t[0]
    window = ("kaiser", kaiser_beta(100))
    low_pass = firwin(2 * RINGING * finer + 1, 0.5, window=window, fs=finer)
    first = int(np.floor(start / dt)) - RINGING
    n = int(np.ceil(width / dt)) + 2 * RINGING + 2
    fine = (first + np.arange(n * finer) / finer) * dt - start
    pulse = np.where((fine > 0) & (fine < width), np.sin(np.pi * fine / width) ** 2, 0.0)
    recorded = np.convolve(pulse, low_pass, mode="same")[::finer]
    at = first + np.arange(n)
    within = (at >= 0) & (at < len(t))
    record = np.zeros(len(t))
    record[at[within]] = recorded[within]
    return record
