"""Natural frequencies and damping ratios from measured frequency responses (the hammer test).

Every peak is read twice: by the half-power bandwidth (thesis, appendix A),

    zeta = (f2 - f1) / (2 f_n),    |H(f1)| = |H(f2)| = |H(f_n)| / sqrt(2),

and by a least-squares complex-frequency fit of a band around it (Peeters et al., Shock and
Vibration 11 (2004) 395, as in sdypy-EMA). Where the two disagree, where a peak is weak or where
two are close, a sentence says so.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks

BAND = 0.15  # half-width of the fitted band, of the peak's frequency
FEWEST_LINES = 40  # in a fitted band
LARGEST_ORDER = 12  # of the polynomial fitted to a band
FEWEST_ORDERS = 4  # that must find a pole for it to count
SAME = 0.005  # two peaks closer than this, of their frequency, are one
CLOSE = 3  # bandwidths: two peaks this close disturb each other
COARSE = 4  # lines in a bandwidth
CLEAR = 8.0  # standard deviations of noise that a peak has to stand out
WEAK = 2.0  # a peak less than this above its surroundings is weak
DISAGREE = 0.15  # relative difference of the two damping ratios worth a sentence


class MeasuredMode(NamedTuple):
    """One resonance as both methods see it; nan where a method found nothing."""

    frequency_hz: float  # of the fit, else of the peak
    zeta_half_power: float
    zeta_fit: float
    remarks: tuple[str, ...]

    @property
    def zeta(self) -> float:
        """The fit's damping ratio where there is one."""
        return self.zeta_half_power if np.isnan(self.zeta_fit) else self.zeta_fit


def measured_modes(
    frequency_hz: NDArray[np.float64], H: NDArray[np.complex128], *, prominence: float = 1.5
) -> list[MeasuredMode]:
    """Resonances of responses H (n_responses, k) at evenly spaced frequencies (k,), lowest first.

    A peak counts from `prominence` (a factor) above its surroundings on. Raises ValueError for
    uneven or unordered frequencies, non-finite values, and too few lines.
    """
    f, H = _checked(frequency_hz, H)
    peaks = _peaks(f, H, prominence)
    return [_read(f, H, i, peaks) for i in range(len(peaks))]


class _Peak(NamedTuple):
    line: int
    height: float  # factor above its surroundings
    response: int  # where it stands out most


def _peaks(f, H, prominence: float) -> list[_Peak]:
    """Peaks of any response, each once: a mode may hide in one and stand clear in another."""
    found = []
    noise = _noise(H)
    for response, a in enumerate(np.abs(H)):
        level = np.log(np.maximum(a, np.finfo(float).tiny))
        lines, shape = find_peaks(level, prominence=np.log(prominence))
        heights = np.exp(shape["prominences"])
        clear = a[lines] * (1 - 1 / heights) > CLEAR * noise[response]
        lines, heights = lines[clear], heights[clear]
        found += [_Peak(int(i), float(h), response) for i, h in zip(lines, heights, strict=True)]
    kept: list[_Peak] = []
    for peak in sorted(found, key=lambda peak: -peak.height):
        near = max(SAME * f[peak.line], 2 * (f[1] - f[0]))
        if all(abs(f[peak.line] - f[other.line]) > near for other in kept):
            kept.append(peak)
    return sorted(kept)


def _noise(H) -> NDArray[np.float64]:
    """Standard deviation of the noise of each response, (n,).

    Second differences cancel what is smooth: of white noise they have 6 times its variance. Their
    median is that of a Rayleigh variable, and does not see the few lines on resonances.
    """
    curvature = np.abs(H[:, 2:] - 2 * H[:, 1:-1] + H[:, :-2])
    return np.median(curvature, axis=1) / np.sqrt(6) / np.sqrt(np.log(2))


def _checked(f, H):
    f, H = np.asarray(f, dtype=float), np.atleast_2d(np.asarray(H))
    if H.shape[1] != len(f) or len(f) < FEWEST_LINES:
        raise ValueError(
            f"{H.shape[1]} values at {len(f)} frequencies; give at least {FEWEST_LINES} of both."
        )
    if not (np.all(np.isfinite(f)) and np.all(np.isfinite(H))):
        raise ValueError("the responses hold NaN or inf; remove those lines or measure again.")
    step = np.diff(f)
    if np.any(step <= 0) or np.ptp(step) > 1e-3 * step.mean():
        raise ValueError("the frequencies are not evenly spaced in ascending order; resample them.")
    return f, H


def _read(f, H, i: int, peaks: list[_Peak]) -> MeasuredMode:
    amplitude = np.abs(H[peaks[i].response])
    f_peak, half_power = half_power_bandwidth(f, amplitude, peaks[i].line)
    half_power = half_power if half_power > 0 else np.nan
    f_fit, zeta_fit = _fitted(f, H, f_peak)
    zeta = half_power / (2 * f_peak)
    remarks = _remarks(f, i, peaks, zeta, zeta_fit)
    return MeasuredMode(f_peak if np.isnan(f_fit) else f_fit, zeta, zeta_fit, remarks)


def half_power_bandwidth(
    f: NDArray[np.float64], amplitude: NDArray[np.float64], peak: int
) -> tuple[float, float]:
    """Frequency of a peak [Hz] and its bandwidth f2 - f1 [Hz]; nan where a flank does not fall.

    The peak is the top of the parabola through 1/|H|^2, which is exact for a light single mode.
    """
    i = int(np.clip(peak, 1, len(f) - 2))
    inverse = 1 / amplitude[i - 1 : i + 2] ** 2
    curvature = inverse[0] - 2 * inverse[1] + inverse[2]
    shift = 0.5 * (inverse[0] - inverse[2]) / curvature
    least = inverse[1] - 0.25 * (inverse[0] - inverse[2]) * shift
    f_peak = f[i] + shift * (f[1] - f[0])
    if least <= 0:
        return f_peak, np.nan
    return f_peak, _crossing(f, amplitude, i, 1, 2 * least) - _crossing(
        f, amplitude, i, -1, 2 * least
    )


def _crossing(f, amplitude, start: int, step: int, inverse_square: float) -> float:
    """Where 1/|H|^2 first exceeds a level, going up or down in frequency; nan if it never does."""
    i = start
    while 0 < i < len(f) - 1:
        here, there = 1 / amplitude[i] ** 2, 1 / amplitude[i + step] ** 2
        if there >= inverse_square:
            part = (inverse_square - here) / (there - here) if there > here else 0.0
            return float(f[i] + part * (f[i + step] - f[i]))
        if there < 0.4 * inverse_square:  # higher than the peak: another one begins
            return np.nan
        i += step
    return np.nan


def _fitted(f, H, f_peak: float) -> tuple[float, float]:
    """Frequency and damping ratio of the pole nearest to a peak; nan where no order keeps one.

    The median over polynomial orders, of the poles that lie within a hundredth of the peak.
    """
    from sdypy.EMA import Model

    half = max(BAND * f_peak, FEWEST_LINES / 2 * (f[1] - f[0]))
    used = f < f_peak + half
    model = Model(
        H[:, used], f[used], lower=max(f_peak - half, f[0]), upper=f[used][-1],
        pol_order_high=LARGEST_ORDER, frf_form="receptance",
    )  # fmt: skip
    model.get_poles(method="lscf", show_progress=False)
    near = [_nearest(*poles, f_peak) for poles in zip(model.pole_freq, model.pole_xi, strict=True)]
    kept = np.array([pole for pole in near if abs(pole[0] / f_peak - 1) < 0.01])
    return tuple(np.median(kept, axis=0)) if len(kept) >= FEWEST_ORDERS else (np.nan, np.nan)


def _nearest(frequency, zeta, f_peak: float) -> tuple[float, float]:
    """The decaying pole nearest to the peak."""
    real = np.where((zeta > 0) & (zeta < 0.5), np.abs(frequency), np.inf)
    i = int(np.argmin(np.abs(real - f_peak)))
    return float(real[i]), float(zeta[i])


def _remarks(f, i: int, peaks: list[_Peak], zeta: float, zeta_fit: float) -> tuple[str, ...]:
    remarks, here = [], f[peaks[i].line]
    if peaks[i].height < WEAK:
        remarks.append(f"weak: only {peaks[i].height:.2g} times its surroundings")
    gap = np.array([abs(f[p.line] - here) for j, p in enumerate(peaks) if j != i])
    width = 2 * np.nanmax([zeta, zeta_fit, 0.0]) * here
    if gap.size and gap.min() < CLOSE * width:
        remarks.append(f"another peak {gap.min():.3g} Hz away, within {CLOSE} bandwidths")
    if width < COARSE * (f[1] - f[0]):
        remarks.append("lines too far apart for this bandwidth: the half-power value is poor")
    if np.isnan(zeta) or np.isnan(zeta_fit):
        lost = "half-power bandwidth" if np.isnan(zeta) else "complex-frequency fit"
        remarks.append(f"the {lost} found no damping here")
    elif abs(zeta - zeta_fit) > DISAGREE * zeta_fit:
        remarks.append(f"half-power {zeta:.3g} and fit {zeta_fit:.3g} disagree on the damping")
    return tuple(remarks)
