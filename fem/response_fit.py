"""Values of a model fitted to measured frequency responses: their magnitude in dB and their phase.

    r = ln(H(x) / H_measured) = ln(magnitudes' ratio) + i (phases' difference)

at every point, reference and line, real and imaginary part with the variance

    sigma^2 = (noise / |H|)^2 + level^2

The noise is that of the measurement; the level is the error of the model, one number for all lines,
found with the values: it makes the sum of r^2 / sigma^2 what is left of the number of residuals.
Far from the answer the level is large and every line weighs alike; near it each line weighs by its
noise. Values x move on a logarithmic scale within bounds; slopes are exact (`fem.response_model`).

A resonance that is far from the measured one makes a minimum of its own, so that a fit has to begin
where frequencies agree: `fem.tuning.tune` finds such values.

Noise: with coherence g of n averages var(H) / |H|^2 = (1 - g) / (2 (n - 1) g) in each of real and
imaginary part (J. S. Bendat, A. G. Piersol, Random Data, 4th ed., section 9.2); without, from how
lines scatter about a cubic through their neighbours.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.special import stdtrit

from fem.response_model import Parameter, ResponseModel, computed_responses
from fem.tuning import largest_determined

DB = 20 / np.log(10)  # dB in a unit of ln


class FitOptions(NamedTuple):
    """How responses are weighed and what a fit counts as done; values not varied but where said."""

    rounds: int = 12  # of weights, at most; 3 to 6 are usual
    evaluations: int = 30  # of a round
    still: float = 0.05  # deviations by which a value moves in the last round
    faint: float = 0.3  # noise over |H| above which a line says nothing: the logarithm is biased
    # chi^2 of the noise alone over the residuals' number, beyond which the model has an error
    significant: float = 1.3


class MeasuredResponses(NamedTuple):
    """Responses of a test with their noise."""

    frequency_hz: NDArray[np.float64]  # (f,)
    H: NDArray[np.complex128]  # (p, r, f)
    noise: NDArray[np.float64]  # (p, r, f) standard deviation of real and of imaginary part
    group: NDArray[np.int64]  # (f,) which resonance a line is of, for errors that lines share


class FrequencyTargets(NamedTuple):
    """Frequencies that are fitted beside the responses, of modes known by their place."""

    mode: NDArray[np.int64]
    hz: NDArray[np.float64]
    error: float  # relative


class ResponseFit(NamedTuple):
    """Values that fit best."""

    parameters: tuple[Parameter, ...]
    value: NDArray[np.float64]  # (n,)
    deviation: NDArray[np.float64]  # (n,) of ln(value), one standard deviation
    of_noise: NDArray[np.float64]  # (n,) the same of the noise alone
    covariance: NDArray[np.float64]  # (n, n) of ln(value)
    level: float  # of the model's error, in ln; 0 where the noise explains the residual
    objective: float  # -2 ln(likelihood)
    evaluations: int


class Misfit(NamedTuple):
    """How far computed responses are from measured ones."""

    decibel: float  # rms of the magnitudes' difference
    degrees: float  # rms of the phases' difference
    noise_decibel: float  # what the noise makes of the first


def noise_of_neighbours(H: NDArray[np.complex128], width: int = 25) -> NDArray[np.float64]:
    """Standard deviation of real and imaginary part of H (..., f), from fourth differences of
    neighbouring lines: of white noise their variance is 70 times its own. The median over `width`
    lines on each side leaves out the peaks, where H is no cubic."""
    fourth = np.abs(np.diff(H, 4, axis=-1)) ** 2
    ends = [(0, 0)] * (H.ndim - 1)
    fourth = np.pad(fourth, [*ends, (2, 2)], mode="edge")
    width = min(width, H.shape[-1] - 1)
    padded = np.pad(fourth, [*ends, (width, width)], mode="reflect")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * width + 1, axis=-1)
    # |.|^2 of complex noise has the median ln 2 times its mean, which is 2 * 70 sigma^2
    return np.sqrt(np.median(windows, axis=-1) / (140 * np.log(2)))


def noise_of_coherence(
    H: NDArray[np.complex128],
    coherence: NDArray[np.float64],
    averages: NDArray[np.float64],
    width: int = 10,
) -> NDArray[np.float64]:
    """Standard deviation of real and imaginary part of H (p, r, f) of so many `averages` (p,), two
    or more; of few averages the coherence itself is uncertain, so that variances are means over
    `width` lines on each side."""
    g = np.clip(coherence, 1e-6, 1.0)
    variance = np.abs(H) ** 2 * (1 - g) / (2 * g * (averages[:, None, None] - 1))
    kernel = np.ones(2 * width + 1)
    count = np.convolve(np.ones(H.shape[-1]), kernel, "same")
    smooth = np.apply_along_axis(lambda v: np.convolve(v, kernel, "same"), -1, variance)
    return np.sqrt(smooth / count)


def log_ratio(H: NDArray[np.complex128], measured: NDArray[np.complex128]) -> NDArray:
    """ln(H / measured), phases between -pi and pi."""
    tiny = np.finfo(float).tiny
    return np.log(np.maximum(np.abs(H), tiny) / np.maximum(np.abs(measured), tiny)) + 1j * np.angle(
        H * measured.conj()
    )


def misfit(measured: MeasuredResponses, H: NDArray[np.complex128]) -> Misfit:
    """Of responses H (p, r, f), over the lines that say something."""
    relative = measured.noise / np.maximum(np.abs(measured.H), np.finfo(float).tiny)
    heard = relative < FitOptions().faint
    r = log_ratio(H, measured.H)[heard]
    if not r.size:
        return Misfit(np.nan, np.nan, np.nan)
    return Misfit(
        float(DB * np.sqrt(np.mean(r.real**2))), float(np.degrees(np.sqrt(np.mean(r.imag**2)))),
        float(DB * np.sqrt(np.mean(relative[heard] ** 2))),
    )  # fmt: skip


def level_of(
    r: NDArray[np.float64], noise: NDArray[np.float64], left: float, significant: float
) -> float:
    """The level at which sum r^2 / (noise^2 + level^2) is `left`; 0 where the sum of noise alone is
    not `significant` times as much."""
    if np.sum((r / noise) ** 2) <= significant * left:
        return 0.0
    low, high = 0.0, float(np.sqrt(np.sum(r**2) / left))
    for _ in range(60):
        middle = 0.5 * (low + high)
        if np.sum(r**2 / (noise**2 + middle**2)) > left:
            low = middle
        else:
            high = middle
    return high


def fit_responses(
    model: ResponseModel,
    parameters: Sequence[Parameter],
    start: NDArray[np.float64],
    measured: MeasuredResponses,
    options: FitOptions = FitOptions(),
) -> ResponseFit:
    """Least squares from the values `start` (n,), with weights renewed until values rest.

    Deviations: of noise alone where it explains the residual. Otherwise the model has an error,
    which lines around one resonance share. Then they are those of the weights with noise and level,
    and not less than what leaving out one resonance after the other tells (delete-a-group
    jackknife, linearised, times Student's t of so many groups).
    """
    lower, upper = (np.log([getattr(p, key) for p in parameters]) for key in ("lower", "upper"))
    x = np.clip(np.log(start), lower, upper)
    size = np.abs(measured.H)
    floor = np.finfo(float).eps * size.max()
    n, evaluations, last = len(parameters), 0, {}

    def at(x: NDArray[np.float64]):
        """Responses and their slopes; the last ones are kept, residual and slopes take both."""
        key = x.tobytes()
        if key not in last:
            last.clear()
            last[key] = computed_responses(
                model, parameters, np.exp(x), measured.frequency_hz, slopes=True
            )
        return last[key]

    def stacked(r: NDArray) -> NDArray[np.float64]:
        return np.concatenate([r.real, r.imag], axis=0)

    level, objective, deviation = np.inf, np.inf, np.full(n, np.inf)
    for _ in range(options.rounds):
        # weights of this round: noise over the computed magnitude, which no measured line biases
        H = at(x).H
        relative = np.maximum(measured.noise, floor) / np.maximum(np.abs(H), floor)
        heard = (relative < options.faint) & (measured.noise < options.faint * size)
        noise = np.tile(relative[heard], 2)
        left = max(noise.size - n, 1)
        r = stacked(log_ratio(H, measured.H)[heard])
        level = level_of(r, noise, left, options.significant)
        sigma = np.sqrt(noise**2 + level**2)

        def residual(x, heard=heard, sigma=sigma):
            return stacked(log_ratio(at(x).H, measured.H)[heard]) / sigma

        def jacobian(x, heard=heard, sigma=sigma):
            computed = at(x)
            slopes = (computed.slopes / computed.H)[:, heard]
            return (np.concatenate([slopes.real, slopes.imag], axis=1) / sigma).T

        if not n:
            break
        fit = least_squares(
            residual, x, jacobian, bounds=(lower, upper), max_nfev=options.evaluations,
            xtol=1e-9, ftol=1e-9, gtol=1e-12,
        )  # fmt: skip
        evaluations += fit.nfev
        moved, x = np.abs(fit.x - x), fit.x
        information = fit.jac.T @ fit.jac
        deviation = np.sqrt(np.diag(np.linalg.inv(information + prior_information(parameters))))
        if np.all(moved < options.still * deviation):
            break

    # the level at the values found, and how likely they are
    H = at(x).H
    relative = np.maximum(measured.noise, floor) / np.maximum(np.abs(H), floor)
    heard = (relative < options.faint) & (measured.noise < options.faint * size)
    noise, r = np.tile(relative[heard], 2), stacked(log_ratio(H, measured.H)[heard])
    left = max(noise.size - n, 1)
    level = level_of(r, noise, left, options.significant)
    if level == 0:  # then the residual says how large the noise is, better than lines do
        noise = noise * np.sqrt(np.sum((r / noise) ** 2) / left)
    sigma = np.sqrt(noise**2 + level**2)
    objective = float(np.sum((r / sigma) ** 2 + 2 * np.log(sigma)))
    if not n:
        return ResponseFit(
            (), np.zeros(0), *[np.zeros(0)] * 2, np.zeros((0, 0)), level, objective, 0
        )

    slopes = (at(x).slopes / H)[:, heard]
    J = np.concatenate([slopes.real, slopes.imag], axis=1).T
    prior = prior_information(parameters)
    of_noise = np.linalg.inv((J / noise[:, None]).T @ (J / noise[:, None]) + prior)
    covariance = of_noise
    if level > 0:
        weighted, e = J / sigma[:, None], r / sigma
        covariance = covariance_of_groups(weighted, e, line_groups(measured, heard), prior)
    return ResponseFit(
        tuple(parameters), np.exp(x), np.sqrt(np.diag(covariance)), np.sqrt(np.diag(of_noise)),
        covariance, level, objective, evaluations,
    )  # fmt: skip


def prior_information(parameters: Sequence[Parameter]) -> NDArray[np.float64]:
    """What bounds say of ln(value): the information (n, n) of an even distribution within them."""
    span = np.array([np.log(p.upper / p.lower) for p in parameters])
    return np.diag(12.0 / span**2)


def line_groups(measured: MeasuredResponses, heard: NDArray[np.bool_]) -> NDArray[np.int64]:
    """The group of each residual, real parts and then imaginary ones."""
    return np.tile(np.broadcast_to(measured.group, heard.shape)[heard], 2)


def covariance_of_groups(
    J: NDArray[np.float64],
    e: NDArray[np.float64],
    group: NDArray[np.int64],
    prior: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Covariance (n, n) of values with residuals e (k,) that are alike within groups, slopes J."""
    A = J.T @ J + prior
    simple = np.linalg.inv(A)
    groups = np.unique(group)
    G = len(groups)
    if G < 2:
        return simple
    shifts = []
    for g in groups:
        members = group == g
        shifts.append(np.linalg.solve(A - J[members].T @ J[members], J[members].T @ e[members]))
    shifts = np.array(shifts) - np.mean(shifts, axis=0)
    widened = stdtrit(G - 1, 0.975) / 1.96
    jackknife = (G - 1) / G * shifts.T @ shifts * widened**2
    # the larger deviation of each value, with the correlations of the second
    larger = np.maximum(np.sqrt(np.diag(jackknife) / np.diag(simple)), 1.0)
    return simple * np.outer(larger, larger)


def undetermined(fit: ResponseFit) -> list[Parameter]:
    """Values that the responses do not tell within what counts as known, the least known first."""
    if not len(fit.parameters):
        return []
    over = fit.deviation / largest_determined(fit.parameters)
    order = np.argsort(-over)
    return [fit.parameters[j] for j in order if over[j] > 1.0]
