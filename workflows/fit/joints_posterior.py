"""Posterior and evidence of joint stiffnesses and materials, on the projection of `tune`.

    ln L = -1/2 sum_i [(ln f_i / f_m,i)^2 / s_i^2 + ln(2 pi s_i^2)],   s_i^2 = d^2 + e^2

with d the error of a measured frequency and e a relative error of the model, which is sampled with
the parameters: log-uniform priors, of each parameter within its bounds, lognormal ones of springs
that follow from the drawing of a bolt.
"""

from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from beadwave.fem.modes.mac import paired
from beadwave.fem.updating.tuning import UNFITTED, TuningBasis, TuningParameter, spectrum
from beadwave.workflows.fit.nested import (
    NestedOptions,
    NestedPosterior,
    Prior,
    frequencies_log_likelihood,
    log_normal,
    log_uniform,
    nested_posterior,
    quantiles,
    require_nested_sampler,
)
from beadwave.workflows.report.tables import aligned_text
from beadwave.workflows.scene import InvalidScene, Scene, nearest
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.engine.progress import Progress
from beadwave.workflows.structure.parameters import at_values, freed, from_drawing, usual
from beadwave.workflows.structure.tuning import (
    DISAGREEMENT,
    frequency_errors,
    projected,
    unit,
)

MODEL_ERROR = "model error"


class PosteriorOptions(NamedTuple):
    """Errors of the likelihood, and what a posterior says sentences about."""

    # relative, of a measured frequency, where its test states none; that of `tune`
    frequency_error: float = 1e-3
    least_error: float = 1e-4  # ends of the prior of the model's relative error: nothing next to a
    largest_error: float = 0.3  # measurement, and a model of which frequencies say nothing
    at_end: float = 0.05  # share of the prior, nearer to whose end a bar says a bound alone
    # what few modes leave open is a thin, bent surface: uniform draws had not filled one in 600 s,
    # walks filled a milder one in 90 s; 200 live points leave ln Z to 0.2, the mixture's samples to
    # less
    sampler: NestedOptions = NestedOptions(live=200, walk="rwalk", drawn=8192)


class PosteriorRow(BaseModel):
    """A parameter: its prior, and the posterior's median and 95 % between `low` and `high`."""

    name: str
    unit: str
    prior: tuple[float, float]  # ends of a log-uniform prior, 95 % of a lognormal one
    median: float
    low: float  # 2.5 % of the posterior are below
    high: float  # and 2.5 % above
    says: Literal["value", "lower bound", "upper bound", "nothing"]


class LobeRow(BaseModel):
    """A peak of the posterior: its share, and its most likely sample."""

    mass: float
    best: dict[str, float]
    low: dict[str, float]  # 95 % of the lobe, as above
    high: dict[str, float]
    modes_hz: dict[str, float | None]  # at the most likely sample, by the modes' numbers


class PosteriorReport(BaseModel):
    """Posterior of joints and materials given measured frequencies."""

    scene: str
    match: dict[str, float]  # [Hz] measured, by the modes' numbers
    frequency_error: dict[str, float]  # relative, of these
    parameters: list[PosteriorRow]
    lobes: list[LobeRow]  # the heaviest first
    log_evidence: float
    log_evidence_error: float  # one standard deviation
    effective: float  # independent samples
    evaluations: int
    seed: int
    remarks: list[str]

    def text(self) -> str:
        """A table of parameters, one of lobes, then sentences."""
        rows = [
            (
                p.name, f"{p.prior[0]:.3g} to {p.prior[1]:.3g}", f"{p.median:.4g}", f"{p.low:.4g}",
                f"{p.high:.4g}", p.unit, p.says,
            )
            for p in self.parameters
        ]  # fmt: skip
        head = ("value", "prior", "median", "2.5 %", "97.5 %", "", "says")
        lines = [aligned_text(head, rows), ""]
        lobes = []
        for i, lobe in enumerate(self.lobes, start=1):
            for name, best in lobe.best.items():
                first = name == next(iter(lobe.best))
                number, mass = (str(i), f"{lobe.mass:.2f}") if first else (None, None)
                ends = f"{lobe.low[name]:.4g}", f"{lobe.high[name]:.4g}"
                lobes.append((number, mass, name, f"{best:.4g}", *ends))
        lines += [aligned_text(("lobe", "mass", "value", "best", "2.5 %", "97.5 %"), lobes), ""]
        modes = [
            (n, f"{hz:.2f}", *(
                None if lobe.modes_hz[n] is None else f"{lobe.modes_hz[n]:.2f}"
                for lobe in self.lobes
            ))
            for n, hz in self.match.items()
        ]  # fmt: skip
        of_lobes = [f"lobe {i} [Hz]" for i in range(1, len(self.lobes) + 1)]
        lines += [aligned_text(("mode", "measured [Hz]", *of_lobes), modes), ""]
        evidence = f"ln evidence {self.log_evidence:.2f} +- {self.log_evidence_error:.2g}"
        cost = f"{self.evaluations} evaluations, {self.effective:.0f} independent samples"
        return "\n".join([*lines, f"{evidence}; {cost}", *self.remarks])


class JointsPosterior(NamedTuple):
    """The report, and the samples behind it."""

    report: PosteriorReport
    posterior: NestedPosterior

    def __repr__(self) -> str:
        return self.report.text()


def matched_hz(
    basis: TuningBasis,
    parameters: Sequence[TuningParameter],
    places: Sequence[int],
    value: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Frequencies (n,) [Hz] of the targets at `places` of the basis; nan where no mode is like."""
    computed = spectrum(basis, parameters, value)
    index = paired(basis.forms, computed, basis.targets).index[list(places)]
    return np.where(index < 0, np.nan, computed.frequency_hz[index])


def joints_posterior(
    basis: TuningBasis,
    parameters: Sequence[TuningParameter],
    target_hz: Mapping[int, float],
    *,
    seed: int,
    priors: Sequence[Prior] | None = None,
    frequency_error: Mapping[int, float] | None = None,
    options: PosteriorOptions = PosteriorOptions(),
) -> NestedPosterior:
    """Posterior of the parameters, and last of the model's error, given the targets {1, 2, ...: Hz}
    of a basis; `priors` of the parameters stand for log-uniform ones within their bounds, and
    frequency_error {1, 2, ...: relative} for that of the options. Raises InvalidScene where the
    sampler is not installed, or the likelihood is 0 wherever the priors allow."""
    places, measured = [n - 1 for n in target_hz], np.array([*target_hz.values()])
    errors = frequency_error or dict.fromkeys(target_hz, options.frequency_error)
    d = np.array([errors[n] for n in target_hz])

    # a target that no mode is like counts as far too high: finite, so that likelihoods of two such
    # points can be compared, and charged as `tune` charges it
    lost = measured * np.exp(UNFITTED)
    if priors is None:
        priors = [prior_of(p) for p in parameters]
    of_error = log_uniform(MODEL_ERROR, options.least_error, options.largest_error)

    def log_likelihood(theta: NDArray[np.float64]) -> float:
        """ln L at the values (p,) of the parameters and, last, of the model's error."""
        hz = matched_hz(basis, parameters, places, theta[:-1])
        hz = np.where(np.isnan(hz), lost, np.maximum(hz, 1e-3))
        return frequencies_log_likelihood(hz, measured, d, theta[-1])

    return nested_posterior(log_likelihood, [*priors, of_error], seed=seed, options=options.sampler)


def prior_of(p: TuningParameter) -> Prior:
    """Log-uniform within the bounds, or lognormal about the start of one that is known so well."""
    if p.known is None:
        return log_uniform(p.name, p.lower, p.upper)
    # the mode of the density of value is below its median, which is the start
    return log_normal(p.name, p.start * np.exp(-(p.known**2)), p.known, p.lower, p.upper)


def bounded(candidates: list[TuningParameter], bounds: str | None) -> list[TuningParameter]:
    """The parameters with the bounds of "joints.cover.kz=1e6:1e9,..."; raises InvalidScene."""
    by_name = {p.name: p for p in candidates}
    for item in (bounds or "").split(",") if bounds else ():
        name, _, ends = item.strip().partition("=")
        if name not in by_name:
            raise InvalidScene(f"--bounds {name} is not free, {nearest(name, [*by_name])}.")
        try:
            low, high = map(float, ends.split(":"))
        except ValueError:
            low = high = np.nan
        if not 0 < low < high < np.inf:
            raise InvalidScene(
                f"--bounds {item.strip()} must be NAME=LOW:HIGH with 0 < LOW < HIGH, in "
                f"{unit(name)}, as in {name}={by_name[name].lower:g}:{by_name[name].upper:g}."
            )
        start = float(np.clip(by_name[name].start, low, high))
        by_name[name] = by_name[name]._replace(lower=low, upper=high, start=start)
    return [*by_name.values()]


def parameter_rows(
    posterior: NestedPosterior, parameters: Sequence[TuningParameter], options: PosteriorOptions
) -> list[PosteriorRow]:
    """Posterior of each parameter and of the model's error, next to the prior."""
    rows, shares = [], (0.5, 0.025, 0.975)
    ends = [
        (p.lower, p.upper) if p.known is None
        else (p.start * np.exp(-1.96 * p.known), p.start * np.exp(1.96 * p.known))
        for p in parameters
    ]  # fmt: skip
    ends.append((options.least_error, options.largest_error))
    of_drawing = {p.name for p in parameters if p.known is not None}
    for j, (name, (lower, upper)) in enumerate(zip(posterior.names, ends, strict=True)):
        median, low, high = quantiles(posterior.samples[:, j], posterior.weights, shares)

        # ends of the bar in the probability of the log-uniform prior, 0 to 1
        at_low, at_high = (np.log(x / lower) / np.log(upper / lower) for x in (low, high))
        says, spans = "value", at_low < options.at_end and at_high > 1 - options.at_end
        if name in posterior.undetermined or (spans and name not in of_drawing):
            says = "nothing"
        elif name in of_drawing:  # its prior has no ends
            says = "value"
        elif at_high > 1 - options.at_end:
            says = "lower bound"
        elif at_low < options.at_end:
            says = "upper bound"
        rows.append(
            PosteriorRow(
                name=name, unit="relative" if name == MODEL_ERROR else unit(name),
                prior=(lower, upper), median=median, low=low, high=high, says=says,
            )
        )  # fmt: skip
    return rows


def lobe_rows(
    posterior: NestedPosterior, numbers: Sequence[int], hz_of_lobes: Sequence[NDArray[np.float64]]
) -> list[LobeRow]:
    """Best values, 95 % bars and frequencies of the modes `numbers` in each lobe, whose frequencies
    [Hz] are (modes,) of each, nan of a mode that no computed one is like."""
    lobes = []
    for k, (lobe, hz) in enumerate(zip(posterior.lobes, hz_of_lobes, strict=True)):
        of_lobe = posterior.lobe == k
        of_each = [
            quantiles(posterior.samples[of_lobe, j], posterior.weights[of_lobe], (0.025, 0.975))
            for j in range(len(posterior.names))
        ]
        lobes.append(
            LobeRow(
                mass=lobe.mass,
                best=dict(zip(posterior.names, map(float, lobe.best), strict=True)),
                low={name: low for name, (low, _) in zip(posterior.names, of_each, strict=True)},
                high={name: high for name, (_, high) in zip(posterior.names, of_each, strict=True)},
                modes_hz={
                    str(n): float(f) if np.isfinite(f) else None
                    for n, f in zip(numbers, hz, strict=True)
                },
            )
        )  # fmt: skip
    return lobes


def posterior_of(
    scene: Scene,
    match: dict[int, float],
    free: tuple[str, ...],
    progress: Progress,
    *,
    seed: int,
    bounds: str | None = None,
    options: PosteriorOptions = PosteriorOptions(),
) -> JointsPosterior:
    """Posterior of what is free given the modes {number: Hz}, with `usual` names for the rig where
    none are given. Raises InvalidScene for bad input and without the sampler."""
    require_nested_sampler()
    names = free or usual(scene, match)
    scene, known = from_drawing(scene, names, progress)
    parameters = bounded(freed(scene, names, known), bounds)
    loose, basis, parameters = projected(scene, parameters, progress)

    # a user counts measured modes by their numbers, the basis by their places, from 1
    numbers = scene.measured_numbers
    by_place = {numbers.index(n) + 1: hz for n, hz in match.items()}
    places = [n - 1 for n in by_place]
    # what a model misses is sampled: the test's deviations are taken however small they are
    errors = frequency_errors(scene, match, assumed=options.frequency_error, least=0.0)
    by_error = {numbers.index(n) + 1: s for n, s in errors.relative.items()}
    with progress("posterior"):
        posterior = joints_posterior(
            basis, parameters, by_place, seed=seed, frequency_error=by_error, options=options
        )

    rows = parameter_rows(posterior, parameters, options)
    hz_of_lobes = [
        matched_hz(basis, parameters, places, lobe.best[:-1]) for lobe in posterior.lobes
    ]
    lobes = lobe_rows(posterior, [*match], hz_of_lobes)

    remarks = [f"Errors of the measurement: {errors.text()}; that of the model is sampled."]
    remarks += [f"{p.name} is not determined by these modes." for p in rows if p.says == "nothing"]
    # of a lower bound the 5 % below it is all of the doubt: there is none above
    least = [quantiles(x, posterior.weights, (0.05,))[0] for x in posterior.samples.T]
    remarks += [
        f"{p.name} is at least {least[j]:.3g} {p.unit} (95 %): these modes know no upper end, "
        "rigid fits as well."
        for j, p in enumerate(rows)
        if p.says == "lower bound" and p.name.startswith(("joints.", "head.", "foot."))
    ]
    if len(lobes) > 1:
        remarks.append(
            f"{len(lobes)} lobes: other values fit these modes nearly as well. A further mode that "
            "differs between them, or a shape, tells which is right."
        )

    # the full model at the most likely values is the judge of the projection
    likely = at_values(loose, parameters, posterior.lobes[0].best[:-1]).with_sizes_of(loose)
    full = pipeline_of(likely, progress)
    for i, hz in full("modes").paired_hz.items():
        n = numbers[int(i) - 1]
        best = lobes[0].modes_hz.get(str(n))
        if best is not None and abs(best / hz - 1) > DISAGREEMENT:
            remarks.append(
                f"the full model has mode {n} at {hz:.2f} Hz at the best values of lobe 1: the "
                "projection is inaccurate."
            )
    report = PosteriorReport(
        scene=scene.name,
        match={str(n): hz for n, hz in match.items()},
        frequency_error={str(n): s for n, s in errors.relative.items()},
        parameters=rows,
        lobes=lobes,
        log_evidence=posterior.log_evidence,
        log_evidence_error=posterior.log_evidence_error,
        effective=posterior.effective,
        evaluations=posterior.evaluations,
        seed=seed,
        remarks=remarks,
    )
    return JointsPosterior(report, posterior)
