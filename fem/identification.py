"""Natural frequencies and damping ratios from measured frequency responses (the hammer test).

The damping of every peak is found twice: by the half-power bandwidth (thesis, appendix A),

    zeta = (f2 - f1) / (2 f_n),    |H(f1)| = |H(f2)| = |H(f_n)| / sqrt(2),

and by a least-squares complex-frequency fit of a band around it, with polynomials in
z = exp(-i omega dt),

    H(omega) = B(z) / A(z),   A(z_j) = 0:   z_j = exp(-lambda_j dt),
    lambda_j = -zeta_j omega_j +- i omega_j sqrt(1 - zeta_j^2),

whose equations A H = B are linear in the coefficients (Peeters et al., Shock and Vibration 11
(2004) 395, as in sdypy-EMA). Where the two disagree, where a peak is weak or where two are close, a
sentence says so.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks


class Identification(NamedTuple):
    """What counts as a peak, how it is fitted, and what is remarked on; values not varied."""

    same: float = 0.005  # relative difference of frequencies below which two peaks are one
    clear: float = 8.0  # height of a peak above its surroundings, in standard deviations of noise
    band: float = 0.15  # half-width of the fitted band, of the peak's frequency
    fewest_lines: int = 40  # in a fitted band
    largest_order: int = 12  # of the polynomial fitted to a band
    fewest_orders: int = 4  # that must have a pole near the peak for the fit to count
    close: int = 3  # bandwidths: two peaks this close disturb each other
    coarse: int = 4  # lines in a bandwidth that the half-power value needs
    weak: float = 2.0  # a peak less than this factor above its surroundings is weak
    disagree: float = 0.15  # relative difference of the two damping ratios worth a sentence


class Resonance(NamedTuple):
    """One resonance by both methods; nan where a method has no result."""

    frequency_hz: float  # by the fit, else of the peak
    zeta_half_power: float
    zeta_fit: float
    remarks: tuple[str, ...]

    @property
    def zeta(self) -> float:
        """The fit's damping ratio where there is one."""
        return self.zeta_half_power if np.isnan(self.zeta_fit) else self.zeta_fit


class _Peak(NamedTuple):
    line: int  # of the frequencies
    height: float  # factor above its surroundings
    response: int  # where it stands out most


def measured_modes(
    frequency_hz: NDArray[np.float64],
    H: NDArray[np.complex128],
    *,
    prominence: float = 1.5,
    options: Identification = Identification(),
) -> list[Resonance]:
    """Resonances of responses H (n_responses, k) at evenly spaced frequencies (k,), lowest first.

    A peak counts from `prominence` (a factor) above its surroundings on. Raises ValueError for
    uneven or unordered frequencies, non-finite values, and too few lines.
    """
    f, H = np.asarray(frequency_hz, dtype=float), np.atleast_2d(np.asarray(H))
    fewest = options.fewest_lines
    if H.shape[1] != len(f) or len(f) < fewest:
        raise ValueError(
            f"{H.shape[1]} values at {len(f)} frequencies; give at least {fewest} of both."
        )
    if not (np.all(np.isfinite(f)) and np.all(np.isfinite(H))):
        raise ValueError("the responses hold NaN or inf; remove those lines or measure again.")
    step = np.diff(f)
    if np.any(step <= 0) or np.ptp(step) > 1e-3 * step.mean():
        raise ValueError("the frequencies are not evenly spaced in ascending order; resample them.")
    spacing = f[1] - f[0]

    # standard deviation of the noise of each response: second differences cancel what is smooth, of
    # white noise they have 6 times its variance; their median is that of a Rayleigh variable, and
    # does not see the few lines on resonances
    curvature = np.abs(H[:, 2:] - 2 * H[:, 1:-1] + H[:, :-2])
    noise = np.median(curvature, axis=1) / np.sqrt(6) / np.sqrt(np.log(2))

    # peaks of any response: a mode may hide in one and stand clear in another
    candidates = []
    for response, a in enumerate(np.abs(H)):
        level = np.log(np.maximum(a, np.finfo(float).tiny))
        lines, shape = find_peaks(level, prominence=np.log(prominence))
        heights = np.exp(shape["prominences"])
        is_clear = a[lines] * (1 - 1 / heights) > options.clear * noise[response]
        for line, height in zip(lines[is_clear], heights[is_clear], strict=True):
            candidates.append(_Peak(int(line), float(height), response))

    # of several peaks at one frequency the highest
    peaks: list[_Peak] = []
    for peak in sorted(candidates, key=lambda peak: -peak.height):
        distance = max(options.same * f[peak.line], 2 * spacing)
        if all(abs(f[peak.line] - f[p.line]) > distance for p in peaks):
            peaks.append(peak)
    peaks.sort()

    resonances = []
    for i, peak in enumerate(peaks):
        f_peak, bandwidth = half_power_bandwidth(f, np.abs(H[peak.response]), peak.line)
        zeta = (bandwidth if bandwidth > 0 else np.nan) / (2 * f_peak)
        f_fit, zeta_fit = complex_frequency_fit(f, H, f_peak, options)

        remarks = []
        if peak.height < options.weak:
            remarks.append(f"weak: only {peak.height:.2g} times its surroundings")
        gap = np.array([abs(f[p.line] - f[peak.line]) for j, p in enumerate(peaks) if j != i])
        width = 2 * np.nanmax([zeta, zeta_fit, 0.0]) * f[peak.line]
        if gap.size and gap.min() < options.close * width:
            remarks.append(
                f"another peak {gap.min():.3g} Hz away, within {options.close} bandwidths"
            )
        if width < options.coarse * spacing:
            remarks.append("lines too far apart for this bandwidth: the half-power value is poor")
        if np.isnan(zeta) or np.isnan(zeta_fit):
            lost = "half-power bandwidth" if np.isnan(zeta) else "complex-frequency fit"
            remarks.append(f"the {lost} found no damping here")
        elif abs(zeta - zeta_fit) > options.disagree * zeta_fit:
            remarks.append(f"half-power {zeta:.3g} and fit {zeta_fit:.3g} disagree on the damping")
        frequency = f_peak if np.isnan(f_fit) else f_fit
        resonances.append(Resonance(frequency, zeta, zeta_fit, tuple(remarks)))
    return resonances


def half_power_bandwidth(
    f: NDArray[np.float64], amplitude: NDArray[np.float64], peak: int
) -> tuple[float, float]:
    """Frequency of a peak [Hz] and its bandwidth f2 - f1 [Hz]; nan where a flank does not fall.

    Near the peak of one light mode 1/|H|^2 ~ (omega^2 - omega_n^2)^2 + (2 zeta omega_n omega)^2 is
    a parabola in the frequency: its lowest point is the peak, and where it has doubled are f1 and
    f2.
    """
    i = int(np.clip(peak, 1, len(f) - 2))
    inverse = 1 / amplitude[i - 1 : i + 2] ** 2
    curvature = inverse[0] - 2 * inverse[1] + inverse[2]
    shift = 0.5 * (inverse[0] - inverse[2]) / curvature
    lowest = inverse[1] - 0.25 * (inverse[0] - inverse[2]) * shift
    f_peak = f[i] + shift * (f[1] - f[0])
    if lowest <= 0:
        return f_peak, np.nan

    # where 1/|H|^2 first exceeds twice its value at the peak, down and up in frequency
    level, ends = 2 * lowest, []
    for step in (1, -1):
        crossing, line = np.nan, i
        while 0 < line < len(f) - 1:
            inner, outer = 1 / amplitude[line] ** 2, 1 / amplitude[line + step] ** 2
            if outer >= level:
                share = (level - inner) / (outer - inner) if outer > inner else 0.0
                crossing = float(f[line] + share * (f[line + step] - f[line]))
                break
            if outer < 0.4 * level:  # higher than the peak: another one begins
                break
            line += step
        ends.append(crossing)
    return f_peak, ends[0] - ends[1]


def complex_frequency_fit(
    f: NDArray[np.float64],
    H: NDArray[np.complex128],
    f_peak: float,
    options: Identification = Identification(),
) -> tuple[float, float]:
    """Frequency [Hz] and damping ratio of the pole nearest to a peak, by the fit of A(z), B(z) in a
    band around it; nan where too few orders have such a pole.

    Orders above the number of modes fit the noise with poles of their own, which move from order to
    order. So the median is taken over all orders, of the poles within a hundredth of the peak.
    """
    from sdypy.EMA import Model

    half = max(options.band * f_peak, options.fewest_lines / 2 * (f[1] - f[0]))
    used = f < f_peak + half
    model = Model(
        H[:, used], f[used], lower=max(f_peak - half, f[0]), upper=f[used][-1],
        pol_order_high=options.largest_order, frf_form="receptance",
    )  # fmt: skip
    model.get_poles(method="lscf", show_progress=False)

    # of each order the decaying pole nearest to the peak
    poles = []
    for frequency, zeta in zip(model.pole_freq, model.pole_xi, strict=True):
        decaying = np.where((zeta > 0) & (zeta < 0.5), np.abs(frequency), np.inf)
        i = int(np.argmin(np.abs(decaying - f_peak)))
        if abs(decaying[i] / f_peak - 1) < 0.01:
            poles.append((float(decaying[i]), float(zeta[i])))
    if len(poles) < options.fewest_orders:
        return np.nan, np.nan
    return tuple(np.median(np.array(poles), axis=0))
