"""How far to believe a calibration: what is identified, and what its misfit says, in sentences."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from workflows.fit.core.calibration.calibration import CalibrationResult
from workflows.fit.core.calibration.parameters import Parameter
from workflows.fit.core.calibration.search import decisive
from workflows.fit.core.calibration.signals import Signals
from workflows.fit.core.model_errors import NOISE

if TYPE_CHECKING:
    from workflows.fit.core.calibration.posterior import Posterior  # loads the sampler

SHARES = (0.02275, 0.5, 0.97725)  # of the quantiles: two sigma of a Gaussian to either side


class FitLimits(NamedTuple):
    """When a sentence is said of a calibration. None of these numbers has been varied
    systematically."""

    identified: float = 0.1  # two-sigma bar over the value, or over ten scales of one that may be 0
    weak: float = 0.5  # the same, up to which a parameter is weakly identified
    separated: float = 2.0  # two-sigma bar of a combination that the data determines, in scales
    named: int = 3  # combinations that the data cannot separate, at most
    suspicious: float = 1.05  # misfit over the noise that noise leaves once in a thousand records
    guessed: float = 1.1  # the same for noise that is estimated from one record
    explained: float = 1.5  # misfit over the noise above which the model does not explain the data
    missed: float = 3.0  # misfit of a sphere held out, over that of the fitted: no prediction
    blurred: float = 0.2  # step error over the misfit
    different: float = 0.1  # between a quantile and the end of its bar, in two sigma


LIMITS = FitLimits()


def identifiable(p: Parameter, value: float, bar: float) -> str:
    """ "yes", "weakly" or "no" by a two-sigma bar beside the value."""
    size = p.scale if p.kind == "trigger" else max(abs(value), 10 * p.scale)
    share = bar / size
    return "yes" if share <= LIMITS.identified else "weakly" if share <= LIMITS.weak else "no"


def combinations(fit: CalibrationResult) -> list[str]:
    """The three worst determined combinations, each with its bar in scales of the parameters."""
    return [
        f"{c.text(fit.parameters)}: two sigma {c.two_sigma:.2g} scales"
        for c in fit.uncertainty.combinations[:3]
    ]


def remarks(fit: CalibrationResult, noise: float | None, signals: Signals) -> Iterator[str]:
    """Sentences on the misfit beside the noise [m/s], and on what the data does not determine."""
    if signals.channels:
        rows = zip(signals.names, signals.channels.units, signals.channels.scale, strict=True)
        scales = ", ".join(f"{scale:.3g} {unit} of {name}" for name, unit, scale in rows)
        yield f"Signals are fitted as the velocities of their spheres: 1 m/s stands for {scales}."
    yield from _on_misfit(fit, noise, signals.repeats)

    # what the data does not determine, or determines least
    directions = fit.uncertainty.combinations
    undetermined = [c for c in directions if not c.two_sigma < LIMITS.separated]
    for combination in undetermined[: LIMITS.named]:
        yield (
            f"The data cannot separate: {combination.text(fit.parameters)} (two sigma "
            f"{combination.two_sigma:.2g} of their scales)."
        )
    if len(undetermined) > LIMITS.named:
        yield (
            f"Nor can it separate {len(undetermined) - LIMITS.named} more of {len(directions)} "
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


def _on_misfit(fit: CalibrationResult, noise: float | None, repeats: int) -> Iterator[str]:
    """What the misfit says beside the noise [m/s] and beside the model's own error."""
    misfit = float(np.sqrt(np.mean(fit.misfit**2)))
    source = "the repeats tell" if repeats > 1 else "the record tells between its waves"
    of_mean = "noise of the mean" if repeats > 1 else "noise"
    if noise is None:
        yield (
            f"The noise cannot be estimated from one record of so many waves: whether "
            f"{1e3 * misfit:.3g} mm/s is noise or a wrong chain remains open; measure repeats."
        )
    elif misfit > LIMITS.explained * noise:
        yield (
            f"The misfit of {1e3 * misfit:.3g} mm/s is {misfit / noise:.2g} times the {of_mean}, "
            f"{1e3 * noise:.3g} mm/s: the model does not explain all of the data, and the bars "
            "hold only for what it leaves as if it were noise."
        )
    elif misfit > (LIMITS.suspicious if repeats > 1 else LIMITS.guessed) * noise:
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
            f"leave hardly more, which the bars do not hold ({fit.same_starts} of {fit.starts} "
            "starts found this one): measure more repeats or spheres, or hold a sphere out."
        )
    if fit.step_error > LIMITS.blurred * misfit:
        yield (
            f"The model's own step error reaches {1e3 * fit.step_error:.2g} mm/s beside a misfit "
            f"of {1e3 * misfit:.2g} mm/s; the bars hold what it does to the parameters."
        )


def on_held_out(left_out: dict[str, float], fit: CalibrationResult) -> Iterator[str]:
    """A sentence on each sphere that was not fitted and is missed by far more than those that were;
    left_out: misfits [m/s] by the sphere's number."""
    fitted = float(np.sqrt(np.mean(fit.misfit**2)))
    for sphere, misfit in left_out.items():
        if misfit > LIMITS.missed * fitted:
            yield (
                f"Sphere {sphere}, held out, is missed by {1e3 * misfit:.3g} mm/s, "
                f"{misfit / fitted:.2g} times what the fitted ones leave: what was found does not "
                "predict it, contacts may be swapped whatever the bars say; fit to more spheres."
            )


def on_posterior(posterior: Posterior, fit: CalibrationResult, *, seed: int, seconds: float) -> str:
    """How the samples of a posterior came about, and what they say beyond the bars."""
    cost = f"{posterior.model_runs} model runs in {seconds:.1f} s, seed {seed}"
    tau = float(posterior.autocorrelation.max())
    if not (np.isfinite(tau) and posterior.long_enough):
        times = f"of {tau:.3g} steps" if np.isfinite(tau) else "that cannot be told"
        return (
            f"The posterior is not shown: {posterior.kept} steps of {posterior.walkers} walkers "
            f"are too few for autocorrelation times {times} (50 of them are needed); {cost}. Free "
            "fewer parameters, or those that the data determines."
        )

    # parameters without a bar, or whose bar by noise ends elsewhere than the samples do
    low, _, high = posterior.quantiles(SHARES)
    of_noise = fit.causes.get(NOISE, fit.uncertainty.two_sigma)
    bars = np.where(fit.at_bound, np.inf, of_noise)
    off = np.maximum(np.abs(fit.value - bars - low), np.abs(fit.value + bars - high))
    unlike = [
        p.name
        for p, bar, difference in zip(fit.parameters, bars, off, strict=True)
        if not np.isfinite(bar) or difference > LIMITS.different * bar
    ]
    verdict = (
        f"differ from their bars by more than a tenth of two sigma: {', '.join(unlike)}"
        if unlike
        else "agree with the bars to a tenth of two sigma"
    )
    return (
        f"Posterior, flat between the bounds: {posterior.effective:.0f} effective samples "
        f"({posterior.walkers} walkers, {posterior.kept} steps, autocorrelation "
        f"{tau:.3g} steps, {100 * posterior.acceptance:.0f} % accepted; {cost}); "
        f"its quantiles {verdict}."
    )
