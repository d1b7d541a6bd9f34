"""Frequency and damping of a mode over its amplitude, from a free decay.

One mode of a ring-down is y = Re[a(t) exp(i omega t)]; demodulated, z = 2 y exp(-i omega t) passes
a low pass that neighbours do not, and

    zeta(a) = -(d ln|z| / dt) / omega,    f(a) = f + (d arg z / dt) / (2 pi).

Joints slip more at larger amplitudes: one number would be a mean over the decay. The slopes are
those of straight lines through the samples of a step of the amplitude.

Feldman, Mech. Syst. Signal Process. 8 (1994) 119.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.fft import fft, fftfreq, ifft

# Steps of the amplitude that a decay is cut into
AMPLITUDE_RATIO = 1.6  # of amplitudes at a step's ends: 20 steps for the noise of four decades
CLEAR_OF_NOISE = 5.0  # times the noise that the low pass leaves near the mode; 3 to 10 alike
NOISE_OFFSET = 6.0  # low passes away from the mode, where the noise is taken
LOW_PASS_WIDTH = 0.25  # low pass over the distance of the nearest mode, in standard deviations
MAX_LOW_PASS_WIDTH = 0.05  # low pass over the frequency of the mode
UNCERTAIN_STEP = 0.5  # deviation of a step over its damping from which on all is noise
MIN_STEPS = 3  # steps: with less there is nothing to compare
NOTABLE_CHANGE = 0.2  # relative change of the damping over the decay that is worth a sentence
CERTAIN_DEVIATIONS = 4.0  # standard deviations by which it must exceed chance


class AmplitudeStep(NamedTuple):
    """Frequency and damping of a mode at an amplitude, and the deviation of the damping."""

    amplitude: float  # in the unit of the record
    frequency_hz: float
    zeta: float
    zeta_deviation: float


def over_amplitude(
    y: NDArray[np.float64],
    dt: float,
    frequency_hz: NDArray[np.float64],
    phi: NDArray[np.complex128],
    mode: int,
) -> list[AmplitudeStep]:
    """Steps of the decay of one mode, largest amplitude first, of a record y (m, k) from its onset
    on, sampled every dt [s] at m sensors, and modes frequency_hz (n,) [Hz], phi (m, n); none where
    the mode does not stand clear of the noise for `fewest` steps."""
    hz = float(frequency_hz[mode])
    others = np.delete(frequency_hz, mode)
    gap = float(np.abs(others - hz).min()) if len(others) else np.inf
    sigma_hz = min(LOW_PASS_WIDTH * gap, MAX_LOW_PASS_WIDTH * hz)

    # sensors together as the shape has them; what the low pass smears over the ends is left out
    k = y.shape[1]
    sigma = 1 / (2 * np.pi * sigma_hz * dt)  # of the low pass [samples]
    ends = int(3 * sigma)
    if k < 20 * ends:
        return []
    weight = phi[:, mode].conj() / np.sum(np.abs(phi[:, mode]) ** 2)
    spectrum, lines = fft(weight @ y), fftfreq(k, dt)

    def demodulated(at_hz: float) -> NDArray[np.complex128]:
        """z (k,): the record turned back by at_hz, of which a Gaussian low pass leaves what lies
        within sigma_hz of it; negative frequencies are cut off, so that |z| is the amplitude."""
        low_pass = np.exp(-0.5 * ((lines - at_hz) / sigma_hz) ** 2)
        return 2 * ifft(spectrum * low_pass) * np.exp(-2j * np.pi * at_hz * dt * np.arange(k))

    # the noise is what the same low pass leaves near the mode, late in the record, on the quieter
    # side: a neighbour may stand on the other
    z = demodulated(hz)
    size = np.abs(z)
    noise = [
        np.median(np.abs(demodulated(hz + side * NOISE_OFFSET * sigma_hz))[len(size) // 2 : -ends])
        for side in (-1, 1)
    ]
    floor = CLEAR_OF_NOISE * min(noise)

    # from the largest amplitude, early in the record, down to the noise
    start = ends + int(size[ends : len(size) // 4 + ends].argmax())
    below = np.flatnonzero(size[start:] < floor)
    end = start + (int(below[0]) if len(below) else len(size) - ends - start)
    steps = []
    while True:
        # a step ends where the amplitude has fallen by the ratio; slopes of ln|z| and arg z by
        # least squares with times x about their mean
        stop = np.flatnonzero(size[start:end] < size[start] / AMPLITUDE_RATIO)
        if not len(stop) or stop[0] < 2 * sigma:
            break
        window = slice(start, start + int(stop[0]))
        x = dt * (np.arange(window.stop - window.start) - (window.stop - window.start - 1) / 2)
        level, phase = np.log(size[window]), np.unwrap(np.angle(z[window]))
        slope = float(x @ level / (x @ x))
        residual = level - level.mean() - slope * x
        # the low pass leaves one independent sample in 2 sqrt(pi) of its deviations, the integral
        # of its autocorrelation exp(-t^2 / (4 sigma^2)); two are spent on the line
        independent = max(len(x) / (2 * np.sqrt(np.pi) * sigma), 3.0)
        spread = np.sqrt(np.sum(residual**2) / (x @ x) / (independent - 2))
        if spread > UNCERTAIN_STEP * -slope:
            break
        omega = 2 * np.pi * hz
        steps.append(
            AmplitudeStep(
                float(np.exp(level.mean())), hz + float(x @ phase / (x @ x)) / (2 * np.pi),
                -slope / omega, float(spread / omega),
            )
        )  # fmt: skip
        start += int(stop[0])
    return steps if len(steps) >= MIN_STEPS else []


def varies(steps: list[AmplitudeStep]) -> bool:
    """True if the damping changes over the decay by more than chance: the slope of a straight line
    zeta(ln a) through the steps, weighted by their deviations."""
    if not steps:
        return False
    x, zeta = np.log([step.amplitude for step in steps]), np.array([step.zeta for step in steps])
    weight = 1 / np.maximum([step.zeta_deviation for step in steps], 1e-3 * np.abs(zeta))
    columns = np.column_stack([np.ones_like(x), x]) * weight[:, None]
    fit = np.linalg.lstsq(columns, zeta * weight, rcond=None)[0]
    residual = zeta * weight - columns @ fit
    scatter = max(1.0, float(np.sqrt(residual @ residual / max(len(x) - 2, 1))))
    deviation = scatter * np.sqrt(np.linalg.inv(columns.T @ columns)[1, 1])
    change = abs(fit[1]) * np.ptp(x)
    return bool(
        abs(fit[1]) > CERTAIN_DEVIATIONS * deviation
        and change > NOTABLE_CHANGE * np.abs(zeta).min()
    )
