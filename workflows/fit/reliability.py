"""Reliability of a calibration or an inspection: numbers that are determined, and the misfit, in
sentences."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from beadwave.workflows.fit.aligned_signals import Signals
from beadwave.workflows.fit.chain_fit import CalibrationResult
from beadwave.workflows.fit.model_errors import NOISE
from beadwave.workflows.fit.parameter import Parameter, scales
from beadwave.workflows.fit.posterior import ENOUGH, Posterior
from beadwave.workflows.fit.uncertainty import (
    bars_over_time,
    bounds_information,
    determining_sample,
)
from beadwave.workflows.fit.windows import decisive

if TYPE_CHECKING:
    from beadwave.workflows.fit.inversion import Inversion
    from beadwave.workflows.fit.least_squares import RecordFit
    from beadwave.workflows.fit.parametric_wall import ParametricWall


SHARES = (0.02275, 0.5, 0.97725)  # of the quantiles: two sigma of a Gaussian to either side


# Limits beyond which a sentence is said of a calibration; not varied systematically
IDENTIFIED_BAR = 0.1  # two-sigma bar over the value, or over ten scales of one that may be 0
WEAK_BAR = 0.5  # the same, up to which a parameter is weakly identified
SEPARATED_BAR = 2.0  # two-sigma bar of a combination that the data determines, in scales
MAX_NAMED = 3  # combinations that the data cannot separate, at most
SUSPICIOUS_MISFIT = 1.05  # misfit over the noise that noise leaves once in a thousand records
SUSPICIOUS_GUESSED_MISFIT = 1.1  # the same for noise that is estimated from one record
EXPLAINED_MISFIT = 1.5  # misfit over the noise above which the model does not explain the data
MISSED_SPHERE = 3.0  # misfit of a sphere held out, over that of the fitted: no prediction
BLURRED_STEP = 0.2  # step error over the misfit
ASYMMETRIC_BAR = 0.1  # between a quantile and the end of its bar, in two sigma


def identifiable(p: Parameter, value: float, bar: float, confirmed: bool = True) -> str:
    """ "yes", "weakly" or "no" by a two-sigma bar over the value; "unconfirmed" for the first two
    where the search is not sure of its answer."""
    size = p.scale if p.kind == "trigger" else max(abs(value), 10 * p.scale)
    share = bar / size
    if not share <= WEAK_BAR:
        return "no"
    if not confirmed:
        return "unconfirmed"
    return "yes" if share <= IDENTIFIED_BAR else "weakly"


def combinations(fit: CalibrationResult) -> list[str]:
    """The three worst determined combinations, each with its bar in scales of the parameters."""
    return [
        f"{c.text(fit.parameters)}: two sigma {c.two_sigma:.2g} scales"
        for c in fit.uncertainty.combinations[:3]
    ]


def remarks(fit: CalibrationResult, noise: float | None, signals: Signals) -> Iterator[str]:
    """Sentences on the misfit against the noise [m/s], and on what the data does not determine."""
    if signals.channels:
        rows = zip(signals.names, signals.channels.units, signals.channels.scale, strict=True)
        scales = ", ".join(f"{scale:.3g} {unit} of {name}" for name, unit, scale in rows)
        yield f"Signals are fitted as the velocities of their spheres: 1 m/s stands for {scales}."
    yield from _on_misfit(fit, noise, signals.repeats)

    # what the data does not determine, or determines least
    directions = fit.uncertainty.combinations
    undetermined = [c for c in directions if not c.two_sigma < SEPARATED_BAR]
    for combination in undetermined[:MAX_NAMED]:
        yield (
            f"The data cannot separate: {combination.text(fit.parameters)} (two sigma "
            f"{combination.two_sigma:.2g} of their scales)."
        )
    if len(undetermined) > MAX_NAMED:
        yield (
            f"Nor can it separate {len(undetermined) - MAX_NAMED} more of {len(directions)} "
            "combinations; free fewer parameters or measure further spheres."
        )
    if directions and not undetermined:
        worst = directions[0]
        yield (
            f"Least determined: {worst.text(fit.parameters)} (two sigma {worst.two_sigma:.2g} of "
            "their scales); near the solution no parameter is left undetermined."
        )

    for stage in fit.stages:
        if not stage.converged:
            yield f"Stage '{stage.name}' stopped after {stage.evaluations} runs, not converged."
    if fit.starts > 1 and fit.same_starts < fit.starts:
        yield f"{fit.same_starts} of {fit.starts} starts found the misfit that is reported."
    if not fit.confirmed:
        yield (
            "The answer is not confirmed, which takes a misfit as small as the noise, a fit that "
            "converged and, where a wrong chain may hide, three starts that end alike: try more "
            "--starts, or measure further spheres."
        )


def _on_misfit(fit: CalibrationResult, noise: float | None, repeats: int) -> Iterator[str]:
    """Sentences on the misfit, compared with the noise [m/s] and with the model's own error."""
    misfit = float(np.sqrt(np.mean(fit.misfit**2)))
    source = "the repeats tell" if repeats > 1 else "the record tells between its waves"
    of_mean = "noise of the mean" if repeats > 1 else "noise"
    if noise is None:
        yield (
            f"The noise cannot be estimated from one record of so many waves: whether "
            f"{1e3 * misfit:.3g} mm/s is noise or a wrong chain remains open; measure repeats."
        )
    elif misfit > EXPLAINED_MISFIT * noise:
        yield (
            f"The misfit of {1e3 * misfit:.3g} mm/s is {misfit / noise:.2g} times the {of_mean}, "
            f"{1e3 * noise:.3g} mm/s: the model does not explain all of the data, and the bars "
            "hold only for what it leaves as if it were noise."
        )
    elif misfit > (SUSPICIOUS_MISFIT if repeats > 1 else SUSPICIOUS_GUESSED_MISFIT) * noise:
        yield (
            f"The misfit is {misfit / noise:.3g} times the {of_mean}: contacts that no laser "
            "stands between may be swapped, try more --starts or measure further spheres."
        )
    else:
        yield (
            f"The misfit is {misfit / noise:.3g} times the {of_mean} of which {source}: noise "
            "alone leaves as much."
        )
    largest = np.abs(fit.data).max()
    if noise is not None and not decisive(noise, largest, fit.parameters, fit.data):
        yield (
            "At this noise, or with so few spheres measured, a chain with swapped contacts may "
            f"leave hardly more ({fit.same_starts} of {fit.starts} starts found this one, the bars "
            f"hold {fit.others.shape[1]} others that were found, not those that were not): measure "
            "more repeats or spheres, or hold a sphere out."
        )
    if fit.step_error > BLURRED_STEP * misfit:
        yield (
            f"The model's own step error reaches {1e3 * fit.step_error:.2g} mm/s at a misfit "
            f"of {1e3 * misfit:.2g} mm/s; the bars hold what it does to the parameters."
        )


def on_held_out(left_out: dict[str, float], fit: CalibrationResult) -> Iterator[str]:
    """A sentence on each sphere that was not fitted and is missed by far more than those that were;
    left_out: misfits [m/s] by the sphere's number."""
    fitted = float(np.sqrt(np.mean(fit.misfit**2)))
    for sphere, misfit in left_out.items():
        if misfit > MISSED_SPHERE * fitted:
            yield (
                f"Sphere {sphere}, held out, is missed by {1e3 * misfit:.3g} mm/s, "
                f"{misfit / fitted:.2g} times what the fitted ones leave: what was found does not "
                "predict it, contacts may be swapped whatever the bars say; fit to more spheres."
            )


def on_posterior(posterior: Posterior, fit: CalibrationResult, *, seed: int, seconds: float) -> str:
    """Sentence on the sampling of a posterior, and on what it says beyond the bars."""
    cost = f"{posterior.model_runs} model runs in {seconds:.1f} s, seed {seed}"
    if not posterior.believable:
        return (
            f"The posterior is not shown: its samples are worth {posterior.effective:.0f} "
            f"independent ones, {ENOUGH:.0f} are needed of a sampler that came to its end; {cost}. "
            "Free fewer parameters, or those that the data determines."
        )

    # parameters without a bar, or whose bar by noise ends elsewhere than the samples do
    low, _, high = posterior.quantiles(SHARES)
    # samples hold the noise alone: bars that hold the errors of the model as well are longer
    of_noise = fit.causes.get(NOISE, fit.uncertainty.two_sigma)
    bars = np.where(fit.at_bound, np.inf, of_noise)
    off = np.maximum(np.abs(fit.value - bars - low), np.abs(fit.value + bars - high))
    unlike = [
        p.name
        for p, bar, difference in zip(fit.parameters, bars, off, strict=True)
        if not np.isfinite(bar) or difference > ASYMMETRIC_BAR * bar
    ]
    verdict = (
        f"differ from their bars by more than a tenth of two sigma: {', '.join(unlike)}"
        if unlike
        else "agree with the bars to a tenth of two sigma"
    )
    peaks = ""
    if len(posterior.masses) > 1:
        masses = ", ".join(f"{100 * mass:.0f} %" for mass in posterior.masses)
        peaks = f", in {len(posterior.masses)} separate peaks of {masses}"
    return (
        f"Posterior, flat between the bounds: {posterior.effective:.0f} effective samples{peaks} "
        f"({cost}); its quantiles {verdict}."
    )


AT_BOUND = "at its bound"
UNEXPLAINED = "not explained"


# Limits beyond which a sentence is said of an inspection; not varied systematically
DETERMINED_BAR = 0.1  # two-sigma bar over the bounds' distance of a number that is determined
BARELY_DETERMINED_BAR = 0.5  # the same, of one that is determined weakly
COLOURED_MEMORY = 1.3  # memory of a residual that is not white
LENGTHENED_BAR = 1.05  # factor on a bar by the profile of the misfit
ALIKE_CORRELATION = 0.9  # correlation of two numbers
SETTLED_SHIFT = 0.05  # of a bar, that a further wall computed at the answer may move


def verdicts_of(inversion: Inversion) -> list[str]:
    """Of each number "yes", "weakly", "no" or "at its bound", by its bar over its bounds."""
    width = np.array([p.high - p.low for p in inversion.parameters])
    verdicts = []
    for share, at_bound in zip(
        inversion.uncertainty.two_sigma / width, inversion.at_bound, strict=True
    ):
        if at_bound and share < BARELY_DETERMINED_BAR:
            verdicts.append(AT_BOUND)
        else:
            verdicts.append(
                "yes"
                if share <= DETERMINED_BAR
                else "weakly"
                if share <= BARELY_DETERMINED_BAR
                else "no"
            )
    return verdicts


class InspectionAnswer(NamedTuple):
    """An answer, others that the records do not tell from it, and how it came about."""

    inversion: Inversion
    rivals: tuple[Inversion, ...]
    fit: RecordFit
    n_shared: int  # numbers of the structure, the first ones
    noise_known: bool
    between: ParametricWall | None
    moved: float | None  # bars by which the last computed wall moved it
    records: tuple[str, ...]
    no_wall: str = ""  # why no wall could be computed at the answer

    @property
    def explained(self) -> bool:
        """True if the model explains the records, as far as their noise is known; without a wall at
        the answer there is no model of it."""
        return not self.no_wall and (not self.noise_known or self.inversion.explained)

    @property
    def identifiable(self) -> list[str]:
        """Verdict on each number: "not explained" for all where the model does not explain the
        records, for then a short bar means nothing."""
        if self.explained:
            return verdicts_of(self.inversion)
        return [UNEXPLAINED] * len(self.inversion.parameters)

    @property
    def rival_numbers(self) -> list[dict[str, float]]:
        """The numbers of the structure in each rival answer."""
        n = self.n_shared
        return [
            {p.name: float(x) for p, x in zip(r.parameters[:n], r.value[:n], strict=True)}
            for r in self.rivals
        ]

    def bars_by_length(self) -> tuple[np.ndarray, np.ndarray]:
        """Times (k,) [s] since the first touch, and the bars (k, p) of records that end there."""
        inversion, t = self.inversion, self.fit.shots[0].t
        k = len(t)
        n_lengths = 60  # record lengths for which bars are computed
        ends = np.unique(np.linspace(k / n_lengths, k, n_lengths).astype(int))
        bars = bars_over_time(inversion.slopes, bounds_information(inversion.parameters), ends)
        return t[ends - 1] - self._touch, bars * scales(inversion.parameters)

    @property
    def _touch(self) -> float:
        """First touch [s] on the first record's clock."""
        return self.inversion.value[self.fit.unknowns.trigger[0]]

    def remarks(self) -> Iterator[str]:
        """Sentences on the misfit, on rival answers, on the numbers and on the wall."""
        yield from self._on_misfit()
        for rival in self.rival_numbers:
            values = ", ".join(f"{name} = {value:.6g}" for name, value in rival.items())
            yield (
                f"THE RECORDS CANNOT TELL THIS ANSWER FROM ANOTHER: {values} leaves as little. "
                "Bars are of the one alone; narrow --bounds by what is known, or record for longer."
            )
        yield from self._on_numbers()
        yield from self._on_wall()

    def _on_misfit(self) -> Iterator[str]:
        """Sentences on the model by its residual."""
        inversion = self.inversion
        misfit = inversion.whole_misfit
        if not self.noise_known:
            yield (
                "The records do not tell their noise, 1 % of the largest signal is taken: whether "
                f"{misfit:.3g} times of it is noise or a wrong model remains open; measure repeats."
            )
        elif not inversion.explained:
            worst = max(inversion.parts, key=lambda part: part.misfit)
            yield (
                f"THE MODEL DOES NOT EXPLAIN THE RECORDS: it leaves {misfit:.3g} times their "
                f"noise, and {worst.misfit:.3g} times from {1e3 * worst.begin:.3g} to "
                f"{1e3 * worst.end:.3g} ms of {self.records[worst.record]}. The structure is "
                "another than the scene says, a number that is off was not among those to find, "
                "or the search has missed it (give more --starts or narrower --bounds); do not "
                "rely on what was found, nor on its bars."
            )
        elif not inversion.noisy:
            yield (
                f"What is left is {misfit:.3g} times the noise, no more than the known errors of "
                "the model (mesh, reduction, theory) leave; the bars hold these."
            )
        if inversion.memory > COLOURED_MEMORY:
            yield (
                "What is left goes on from sample to sample (its variance is "
                f"{inversion.memory:.3g} times that of its differences): the bars count with that."
            )

    def _on_numbers(self) -> Iterator[str]:
        """Numbers that the records do not determine, or only together with another one."""
        inversion, n = self.inversion, self.n_shared
        names = [p.name for p in inversion.parameters]
        verdicts = verdicts_of(inversion)
        undetermined = [i for i in range(n) if verdicts[i] == "no"]

        for i in undetermined:
            # were it determined if all others were known? then others do the same to the waves
            t = self.fit.shots[0].t
            length = 1e3 * (t[-1] - self._touch)
            width = np.array([p.high - p.low for p in inversion.parameters])
            felt = determining_sample(
                inversion.slopes, width / scales(inversion.parameters), DETERMINED_BAR
            )
            opening = f"The records do not determine {names[i]}: its bar is as long as its bounds"
            if felt[i] < len(t):
                yield (
                    f"{opening}. Waves feel it from {1e3 * (t[felt[i]] - self._touch):.3g} ms on, "
                    "but other numbers do the same to them: find fewer, or record for longer than "
                    f"{length:.3g} ms."
                )
            else:
                yield (
                    f"{opening}, and were all else known, no wave within their {length:.3g} ms "
                    "would tell it: the first wave that a structure sends back hardly feels its "
                    "far ends, nor a load along it. Record later waves as well."
                )
        for name, value, verdict in zip(names, inversion.value, verdicts, strict=True):
            if verdict == AT_BOUND:
                of_record = ", record" in name
                remedy = "say with --each where it starts" if of_record else "widen --bounds"
                yield f"{name} lies at its bound {value:.4g} or beyond: {remedy}."
        for i in range(n) if not undetermined else ():
            for j in range(i):
                r = float(inversion.uncertainty.correlation[i, j])
                if abs(r) > ALIKE_CORRELATION:
                    way = "together" if r > 0 else "one up and one down"
                    yield (
                        f"{names[j]} and {names[i]} move {way} at almost no cost (correlation "
                        f"{r:.2f}): each alone is known far worse than the two of them."
                    )
        if inversion.lengthening > LENGTHENED_BAR:
            yield (
                "The misfit rises more slowly than a parabola: bars are up to "
                f"{inversion.lengthening:.2g} times as long as its curvature says."
            )
        if undetermined or "weakly" in verdicts[:n]:
            worst = inversion.uncertainty.combinations[0]
            yield f"Least determined by the records: {worst.text(inversion.parameters)}."

    def _on_wall(self) -> Iterator[str]:
        """Errors of the interpolation and of the step of the model."""
        between = self.between
        if self.no_wall:
            yield (
                "THE MODEL DOES NOT EXPLAIN THE RECORDS: no wall can be computed at the answer "
                f"({self.no_wall.rstrip('.')}). What is shown is of walls around it; do not rely "
                "on what was found, nor on its bars. The structure is another than the scene says, "
                "or --bounds are too wide."
            )
        elif between:
            yield (
                f"The wall lies between {between.n_walls} that were computed; one that is left out "
                f"is missed by up to {100 * between.missed.frequency:.2g} % in the frequency of a "
                f"mode. The one computed at the answer moved it by {self.moved:.2g} of its bars at "
                "last."
            )
            if self.moved > SETTLED_SHIFT:
                yield (
                    "Walls between others are not good enough there for the bars: narrow --bounds."
                )
        if self.inversion.step_error > 1.0:
            yield (
                "The step of the model is seen in the signals by up to "
                f"{self.inversion.step_error:.2g} times the noise; the bars hold what it does "
                "to the numbers."
            )
