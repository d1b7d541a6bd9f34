"""Values of a model fitted to measured frequency responses: their magnitude in dB and their phase.

    r = ln(H(x) / H_measured) = ln(magnitudes' ratio) + i (phases' difference)

at every point, reference and line, real and imaginary part with the variance

    sigma^2 = (noise^2 + absent^2 |s|^(2 power)) / |H|^2 + level^2

The noise is that of the measurement. Where it does not explain the residual the model has an error,
of two parts that are found with the values (largest likelihood): `level`, relative, and `absent`, a
receptance as of modes that the model lacks, which counts most in antiresonances. Far from the
answer every line weighs alike; near it each weighs by its noise. Values x move on a
logarithmic scale within bounds; slopes are exact (`fem.updating.response_model`).

A resonance that is far from the measured one makes a minimum of its own, so that a fit has to begin
where frequencies agree: `fem.updating.tuning.tune` finds such values.

Noise: with coherence g of n averages var(H) / |H|^2 = (1 - g) / (2 (n - 1) g) in each of real and
imaginary part (J. S. Bendat, A. G. Piersol, Random Data, 4th ed., section 9.2); without, from how
lines scatter about a cubic through their neighbours.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, minimize
from scipy.special import stdtrit

from beadwave.fem.modes.mac import paired
from beadwave.fem.modes.modes import Modes
from beadwave.fem.updating.response_model import (
    ComputedResponses,
    Parameter,
    ResponseModel,
    computed_responses,
    solid_ones,
)
from beadwave.fem.updating.tuning import UNFITTED, TuningParameter, largest_determined, sensitivity

DB = 20 / np.log(10)  # dB in a unit of ln


# Weighing of responses, and when a fit is done
MAX_ROUNDS = 12  # of weights, at most; 3 to 6 are usual
MAX_EVALUATIONS = 30  # of a round
SETTLED_DEVIATIONS = 0.05  # deviations by which a value moves in the last round
FAINT_NOISE = 0.3  # noise over |H| above which a line says nothing: the logarithm is biased
# chi^2 of the noise alone over the residuals' number, beyond which the model has an error
SIGNIFICANT_CHI2 = 1.3


class MeasuredResponses(NamedTuple):
    """Responses of a test with their noise."""

    frequency_hz: NDArray[np.float64]  # (f,)
    H: NDArray[np.complex128]  # (p, r, f)
    noise: NDArray[np.float64]  # (p, r, f) standard deviation of real and of imaginary part
    group: NDArray[np.int64]  # (f,) which resonance a line is of, for errors that lines share


class Resonances(NamedTuple):
    """Frequencies that are fitted together with the responses; the first targets of the basis tell
    which computed modes they are."""

    hz: NDArray[np.float64]  # (n,)
    group: NDArray[np.int64]  # (n,) as that of the lines around each
    error: NDArray[np.float64]  # (n,) relative deviation
    zeta: NDArray[np.float64]  # (n,) damping ratios, fitted likewise where damping is free
    zeta_error: NDArray[np.float64]  # (n,) relative


class ModelError(NamedTuple):
    """Error of a model beyond the noise; both 0 where the noise explains the residual."""

    level: float = 0.0  # relative
    absent: float = 0.0  # in the unit of a receptance


class ResponseFit(NamedTuple):
    """Values that fit best."""

    parameters: tuple[Parameter, ...]
    value: NDArray[np.float64]  # (n,)
    deviation: NDArray[np.float64]  # (n,) of ln(value), one standard deviation
    of_noise: NDArray[np.float64]  # (n,) the same of the noise alone
    covariance: NDArray[np.float64]  # (n, n) of ln(value)
    # (n,) of ln(value), what leaving out one resonance after the other tells, also where the noise
    # explains the residual: hits off their direction shift all lines of a resonance alike
    of_groups: NDArray[np.float64]
    error: ModelError
    objective: float  # -2 ln(likelihood)
    evaluations: int


class Misfit(NamedTuple):
    """Distance of computed responses from measured ones."""

    decibel: float  # rms of the magnitudes' difference
    degrees: float  # rms of the phases' difference
    noise_decibel: float  # what the noise makes of the first


def noise_of_neighbours(H: NDArray[np.complex128], width: int = 100) -> NDArray[np.float64]:
    """Standard deviation (..., f) of real and imaginary part of H (..., f), from fourth differences
    of neighbouring lines, 1 -4 6 -4 1, which a cubic does not have: of white noise their variance
    is 1 + 16 + 36 + 16 + 1 = 70 times its own. The median over `width` lines on each side leaves
    out the peaks, where H is no cubic."""
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
    """ln(H / measured) of responses of one shape (..., f): the logarithm of the magnitudes' ratio,
    and i times the difference of phases between -pi and pi; finite where either is zero."""
    tiny = np.finfo(float).tiny
    return np.log(np.maximum(np.abs(H), tiny) / np.maximum(np.abs(measured), tiny)) + 1j * np.angle(
        H * measured.conj()
    )


def misfit(measured: MeasuredResponses, H: NDArray[np.complex128]) -> Misfit:
    """Distance of responses H (p, r, f) from measured ones, over the lines whose noise is below the
    share FAINT_NOISE of the response; nan where there is none."""
    relative = measured.noise / np.maximum(np.abs(measured.H), np.finfo(float).tiny)
    heard = relative < FAINT_NOISE
    r = log_ratio(H, measured.H)[heard]
    if not r.size:
        return Misfit(np.nan, np.nan, np.nan)
    return Misfit(
        float(DB * np.sqrt(np.mean(r.real**2))), float(np.degrees(np.sqrt(np.mean(r.imag**2)))),
        float(DB * np.sqrt(np.mean(relative[heard] ** 2))),
    )  # fmt: skip


class Weights(NamedTuple):
    """Weights of k residuals of h lines, real parts first."""

    heard: NDArray[np.bool_]  # (p, r, f) which lines say something
    noise: NDArray[np.float64]  # (k,) deviation by noise alone
    error: ModelError
    sigma: NDArray[np.float64]  # (k,) deviation
    magnitude: NDArray[np.float64] | None  # (h,) by which differences are divided; None: logarithms


def model_error(
    r: NDArray[np.float64],
    noise: NDArray[np.float64],
    unit: NDArray[np.float64],
    left: float,
    significant: float,
) -> ModelError:
    """The error of the model for which residuals r (k,) are most likely, with deviations
    sqrt(noise^2 + (absent unit)^2 + level^2); `unit` (k,) is what a receptance of 1 is of each."""
    chi = np.sum((r / noise) ** 2) / left
    if chi <= significant:
        return ModelError()
    size = np.sqrt(np.mean(r**2))
    typical = size / np.sqrt(np.mean(unit**2))

    def unlikely(x: NDArray[np.float64]) -> float:
        """-2 ln(likelihood) a residual, of x = ln of level and absent (2,) over their sizes if each
        were alone."""
        variance = noise**2 + size**2 * np.exp(2 * x[0]) + (typical * unit) ** 2 * np.exp(2 * x[1])
        return float(np.mean(r**2 / variance + np.log(variance)))

    # both within a factor of a million below what either would have to be alone
    best = minimize(
        unlikely, [-0.5, -1.5], method="Nelder-Mead", bounds=[(-14, 3)] * 2,
        options={"xatol": 0.02, "fatol": 1e-6, "maxiter": 120},
    )  # fmt: skip
    level, absent = np.exp(best.x)
    return ModelError(float(size * level), float(typical * absent))


def fit_responses(
    model: ResponseModel,
    parameters: Sequence[Parameter],
    start: NDArray[np.float64],
    measured: MeasuredResponses,
    resonances: Resonances | None = None,
) -> ResponseFit:
    """Least squares from the values `start` (n,), with weights renewed until values rest.

    ln(f / f_measured) of `resonances` are residuals as well, and where damping is free the same of
    their damping ratios.

    Deviations: of noise alone where it explains the residual. Otherwise the model has an error,
    which lines around one resonance share. Then they are those of the weights with noise and level,
    and not less than what leaving out one resonance after the other tells (delete-a-group
    jackknife, linearised, times Student's t of so many groups).
    """
    # x = ln(value) within its bounds; s = i omega + a of the exponential window
    lower, upper = (np.log([getattr(p, key) for p in parameters]) for key in ("lower", "upper"))
    x = np.clip(np.log(start), lower, upper)
    size = np.abs(measured.H)
    floor = np.finfo(float).eps * size.max()
    s = 2j * np.pi * measured.frequency_hz + model.shift
    n, evaluations, last = len(parameters), 0, {}

    def at(x: NDArray[np.float64]):
        """Responses and their slopes at x (n,); the last ones are kept, residual and slopes take
        both."""
        key = x.tobytes()
        if key not in last:
            last.clear()
            last[key] = computed_responses(
                model, parameters, np.exp(x), measured.frequency_hz, slopes=True
            )
        return last[key]

    def stacked(r: NDArray) -> NDArray[np.float64]:
        """Real parts of (h, ...) above imaginary ones, (2 h, ...)."""
        return np.concatenate([r.real, r.imag], axis=0)

    def weights(x: NDArray[np.float64]) -> Weights:
        """Weights of the residuals near x (n,); noise is over the computed magnitude, so that no
        measured line biases its own weight."""
        H = at(x).H
        magnitude = np.maximum(np.abs(H), floor)
        relative = np.maximum(measured.noise, floor) / magnitude
        heard = (relative < FAINT_NOISE) & (measured.noise < FAINT_NOISE * size)
        noise, r = np.tile(relative[heard], 2), stacked(log_ratio(H, measured.H)[heard])
        left = max(noise.size - n, 1)
        unit = np.tile((np.abs(s) ** model.power / magnitude)[heard], 2)
        error = model_error(r, noise, unit, left, SIGNIFICANT_CHI2)
        if any(error):
            sigma = np.sqrt(noise**2 + error.level**2 + (error.absent * unit) ** 2)
            return Weights(heard, noise, error, sigma, None)
        # noise is what is left: all lines, and ln(H / H_measured) as (H - H_measured) / |H|, of
        # which noise has no bias; the residual says how large it is better than lines do
        noise, r = np.tile(relative.ravel(), 2), stacked(((H - measured.H) / magnitude).ravel())
        noise = noise * np.sqrt(np.mean((r / noise) ** 2))
        return Weights(np.ones_like(heard), noise, error, noise, magnitude.ravel())

    def residual(x: NDArray[np.float64], weights: Weights) -> NDArray[np.float64]:
        """Residuals (k,) over their deviations, those of resonances last."""
        H, heard = at(x).H, weights.heard
        if weights.magnitude is None:
            r = log_ratio(H, measured.H)[heard]
        else:
            r = (H - measured.H)[heard] / weights.magnitude
        e = stacked(r) / weights.sigma
        if resonances is None:
            return e
        return np.append(e, of_resonances(model, parameters, np.exp(x), at(x), resonances)[0])

    def jacobian(x: NDArray[np.float64], weights: Weights) -> NDArray[np.float64]:
        """Slopes (k, n) of the residuals to x: d ln H / dx = (dH / dx) / H."""
        computed = at(x)
        over = computed.H[weights.heard] if weights.magnitude is None else weights.magnitude
        J = stacked((computed.slopes[:, weights.heard] / over).T) / weights.sigma[:, None]
        if resonances is None:
            return J
        return np.vstack([J, of_resonances(model, parameters, np.exp(x), computed, resonances)[1]])

    # weights and values in turn: each round fits with the weights of the last values, until no
    # value moves by more than a share of its deviation
    for _ in range(MAX_ROUNDS if n else 0):
        now = weights(x)
        fit = least_squares(
            residual, x, jacobian, bounds=(lower, upper), max_nfev=MAX_EVALUATIONS,
            args=(now,), xtol=1e-9, ftol=1e-9, gtol=1e-12,
        )  # fmt: skip
        evaluations += fit.nfev
        moved, x = np.abs(fit.x - x), fit.x
        information = fit.jac.T @ fit.jac + prior_information(parameters)
        if np.all(moved < SETTLED_DEVIATIONS * np.sqrt(np.diag(np.linalg.inv(information)))):
            break

    # how likely the values found are, and their deviations
    now = weights(x)
    e, error = residual(x, now), now.error
    objective = float(e @ e + 2 * np.sum(np.log(now.sigma)))
    if not n:
        none = np.zeros(0)
        return ResponseFit((), none, none, none, np.zeros((0, 0)), none, error, objective, 0)

    # covariances: of the noise alone; and with errors that all lines of a resonance share, for
    # which a line is no independent observation
    J, prior = jacobian(x, now), prior_information(parameters)
    alone = jacobian(x, now._replace(sigma=now.noise))
    of_noise = np.linalg.inv(alone.T @ alone + prior)
    group = np.tile(np.broadcast_to(measured.group, size.shape)[now.heard], 2)
    if resonances is not None:
        times = (len(e) - len(group)) // len(resonances.group)
        group = np.append(group, np.tile(resonances.group, times))
    of_groups = covariance_of_groups(J, e, group, prior)
    covariance = of_groups if any(error) else of_noise
    return ResponseFit(
        tuple(parameters), np.exp(x), np.sqrt(np.diag(covariance)), np.sqrt(np.diag(of_noise)),
        covariance, np.sqrt(np.diag(of_groups)), error, objective, evaluations,
    )  # fmt: skip


def of_resonances(
    model: ResponseModel,
    parameters: Sequence[Parameter],
    value: NDArray[np.float64],
    computed: ComputedResponses,
    resonances: Resonances,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """ln(f / f_measured) (k,) of resonances, and of damping ratios where damping is free, over
    their deviations, and slopes to ln(value) (k or 2 k, n); a constant of those that no computed
    mode is like."""
    basis, modes = model.basis, computed.modes
    index = paired(basis.forms, modes, basis.targets[: len(resonances.hz)]).index
    hz = np.maximum(modes.frequency_hz[index], 1e-3)
    solid, values = solid_ones(parameters, value)
    slopes = np.zeros((len(index), len(parameters)))
    is_solid = [isinstance(p, TuningParameter) for p in parameters]
    chosen = Modes(np.maximum(modes.omega[index], 1e-3), modes.phi[:, index])
    slopes[:, is_solid] = sensitivity(basis, solid, values, chosen).reshape(len(index), -1)
    e, error = np.log(hz / resonances.hz), resonances.error
    if not all(is_solid):
        zeta = np.maximum(computed.zeta[index], 1e-9)
        e = np.append(e, np.log(zeta / resonances.zeta))
        error = np.append(error, resonances.zeta_error)
        slopes = np.vstack([slopes, computed.zeta_slopes[:, index].T / zeta[:, None]])
        index = np.tile(index, 2)
    slopes[index < 0] = 0.0
    return np.where(index < 0, UNFITTED, e) / error, slopes / error[:, None]


def prior_information(parameters: Sequence[Parameter]) -> NDArray[np.float64]:
    """Information in the bounds of ln(value): (n, n) of an even distribution within them."""
    span = np.array([np.log(p.upper / p.lower) for p in parameters])
    return np.diag(12.0 / span**2)


def covariance_of_groups(
    J: NDArray[np.float64],
    e: NDArray[np.float64],
    group: NDArray[np.int64],
    prior: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Covariance (n, n) of values with residuals e (k,) that are alike within groups, group (k,),
    with slopes J (k, n) and the information (n, n) of the bounds, prior.

    Each group left out shifts the values by (A - J_g^T J_g)^-1 J_g^T e_g, A = J^T J + prior, to
    first order; the spread of these shifts is the jackknife's (Efron and Stein, Ann. Stat. 9 (1981)
    586). Each value has the larger of its deviations by A^-1 and by the jackknife, widened by
    Student's t for few groups, with the correlations of A^-1.
    """
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
    """Parameters whose deviation exceeds what counts as known
    (`fem.updating.tuning.largest_determined`), the least known first."""
    if not len(fit.parameters):
        return []
    over = fit.deviation / largest_determined(fit.parameters)
    order = np.argsort(-over)
    return [fit.parameters[j] for j in order if over[j] > 1.0]
