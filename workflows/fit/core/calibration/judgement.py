"""How far to believe a calibration: what is identified, and what its misfit says, in sentences."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from workflows.fit.core.calibration.calibration import CalibrationResult
from workflows.fit.core.calibration.parameters import Parameter
from workflows.fit.core.calibration.search import decisive
from workflows.fit.core.calibration.signals import Signals

if TYPE_CHECKING:
    from workflows.fit.core.calibration.posterior import Posterior  # loads the sampler

SHARES = (0.02275, 0.5, 0.97725)  # of the quantiles: two sigma of a Gaussian to either side
DIFFERENT = 0.1  # of two sigma, by a quantile from the end of its bar
IDENTIFIED = 0.1  # two-sigma bar relative to the value, or to ten scales of one that may be 0
WEAK = 0.5
SUSPICIOUS = 1.05  # what noise alone reaches once in a thousand records
GUESSED = 1.1  # the same for noise that is known from one record alone
EXPLAINED = 1.5  # misfit over the noise of the mean
TOLD = 3  # combinations that the data cannot tell apart
MISSED = 3.0  # times what the fitted spheres leave: a sphere held out that is not predicted
BLURRED = 0.2  # step error over the misfit that is worth a sentence


def identifiable(p: Parameter, value: float, bar: float) -> str:
    """ "yes", "weakly" or "no" by a two-sigma bar beside the value."""
    size = p.scale if p.kind == "trigger" else max(abs(value), 10 * p.scale)
    share = bar / size
    return "yes" if share <= IDENTIFIED else "weakly" if share <= WEAK else "no"


def combinations(fit: CalibrationResult) -> list[str]:
    """The three worst determined combinations, each with its bar in scales of the parameters."""
    return [
        f"{c.text(fit.parameters)}: two sigma {c.two_sigma:.2g} scales"
        for c in fit.uncertainty.combinations[:3]
    ]


def remarks(fit: CalibrationResult, noise: float | None, signals: Signals) -> Iterator[str]:
    """Sentences on the misfit beside the noise [m/s], and on what the data does not determine."""
    if signals.channels:
        each = zip(signals.names, signals.channels.units, signals.channels.scale, strict=True)
        told = ", ".join(f"{scale:.3g} {unit} of {name}" for name, unit, scale in each)
        yield f"Signals are fitted as the velocities of their spheres: 1 m/s stands for {told}."
    yield from _on_misfit(fit, noise, signals.repeats)
    yield from _on_combinations(fit)
    for stage in fit.stages:
        if not stage.converged:
            yield f"Stage '{stage.name}' stopped after {stage.evaluations} runs, not converged."
    if fit.starts > 1 and fit.same_starts < fit.starts:
        yield f"{fit.same_starts} of {fit.starts} starts found the misfit that is reported."


def _on_combinations(fit: CalibrationResult):
    """What the data does not determine, or determines least."""
    found = fit.uncertainty.combinations
    unseen = [c for c in found if not c.two_sigma < 2.0]
    for combination in unseen[:TOLD]:
        yield (
            f"The data cannot separate: {combination.text(fit.parameters)} (two sigma "
            f"{combination.two_sigma:.2g} of their scales)."
        )
    if len(unseen) > TOLD:
        yield (
            f"Nor can it separate {len(unseen) - TOLD} more of {len(found)} combinations; free "
            "fewer parameters or measure further spheres."
        )
    if found and not unseen:
        yield (
            f"Least determined: {found[0].text(fit.parameters)} (two sigma {found[0].two_sigma:.2g}"
            " of their scales); near the solution no parameter is left undetermined."
        )


def _on_misfit(fit: CalibrationResult, noise: float | None, repeats: int):
    """What the misfit says beside the noise and beside the model's own error."""
    total = float(np.sqrt(np.mean(fit.misfit**2)))
    if noise is None:
        yield (
            f"The noise cannot be estimated from one record of so many waves: whether "
            f"{1e3 * total:.3g} mm/s is noise or a wrong chain remains open; measure repeats."
        )
    else:
        yield _beside_noise(total, noise, repeats)
        if not decisive(noise, np.abs(fit.data).max(), fit.parameters, fit.data):
            yield (
                "At this noise, or with so few spheres measured, a chain with swapped contacts "
                "may leave hardly more, which the "
                f"bars do not hold ({fit.same_starts} of {fit.starts} starts found this one): "
                "measure more repeats or spheres, or hold a sphere out."
            )
    if fit.step_error > BLURRED * total:
        yield (
            f"The model's own step error reaches {1e3 * fit.step_error:.2g} mm/s beside a misfit "
            f"of {1e3 * total:.2g} mm/s: the bars do not hold it."
        )


def on_held_out(left_out: dict[str, float], fit: CalibrationResult):
    """A sentence on each sphere that was not fitted and is missed by far more than those that were;
    left_out [m/s] by the sphere's number."""
    fitted = float(np.sqrt(np.mean(fit.misfit**2)))
    for sphere, misfit in left_out.items():
        if misfit > MISSED * fitted:
            yield (
                f"Sphere {sphere}, held out, is missed by {1e3 * misfit:.3g} mm/s, "
                f"{misfit / fitted:.2g} times what the fitted ones leave: what was found does not "
                "predict it, contacts may be swapped whatever the bars say; fit to more spheres."
            )


def _beside_noise(total: float, noise: float, repeats: int) -> str:
    known = "the repeats tell" if repeats > 1 else "the record tells between its waves"
    of_mean = "noise of the mean" if repeats > 1 else "noise"
    if total > EXPLAINED * noise:
        return (
            f"The misfit of {1e3 * total:.3g} mm/s is {total / noise:.2g} times the {of_mean}, "
            f"{1e3 * noise:.3g} mm/s: the model does not explain all of the data, and the bars "
            "hold only for what it leaves as if it were noise."
        )
    if total > (SUSPICIOUS if repeats > 1 else GUESSED) * noise:
        return (
            f"The misfit is {total / noise:.3g} times the {of_mean}: contacts that no laser "
            "stands between may be swapped, try more --starts or measure further spheres."
        )
    return (
        f"The misfit is {total / noise:.3g} times the {of_mean} of which {known}: noise alone "
        "leaves as much."
    )


def on_posterior(drawn: Posterior, fit: CalibrationResult, *, seed: int, seconds: float) -> str:
    """How the samples of a posterior came about, and what they say beyond the bars."""
    cost = f"{drawn.model_runs} model runs in {seconds:.1f} s, seed {seed}"
    tau = float(drawn.autocorrelation.max())
    if not (np.isfinite(tau) and drawn.long_enough):
        times = f"of {tau:.3g} steps" if np.isfinite(tau) else "that cannot be told"
        return (
            f"The posterior is not shown: {drawn.kept} steps of {drawn.walkers} walkers are too "
            f"few for autocorrelation times {times} (50 of them are needed); {cost}. Free fewer "
            "parameters, or those that the data determines."
        )
    different = _unlike(drawn, fit)
    verdict = (
        f"differ from their bars by more than a tenth of two sigma: {', '.join(different)}"
        if different
        else "agree with the bars to a tenth of two sigma"
    )
    return (
        f"Posterior, flat between the bounds: {drawn.effective:.0f} effective samples "
        f"({drawn.walkers} walkers, {drawn.kept} steps, autocorrelation "
        f"{tau:.3g} steps, {100 * drawn.acceptance:.0f} % accepted; {cost}); "
        f"its quantiles {verdict}."
    )


def _unlike(drawn: Posterior, fit: CalibrationResult) -> list[str]:
    """Parameters without a bar, or whose bar ends elsewhere than the samples do."""
    low, _, high = drawn.quantiles(SHARES)
    bars = np.where(fit.at_bound, np.inf, fit.uncertainty.two_sigma)
    each = zip(fit.parameters, fit.value, bars, low, high, strict=True)
    return [
        p.name
        for p, x, bar, least, most in each
        if not np.isfinite(bar) or max(abs(x - bar - least), abs(x + bar - most)) > DIFFERENT * bar
    ]
