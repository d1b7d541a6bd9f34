"""Samples of a calibration's posterior beside its two-sigma bars; needs the extra `posterior`."""

from importlib.util import find_spec
from time import perf_counter

import numpy as np

from workflows.calibration.calibrate import Calibrated
from workflows.calibration.report import SHARES, PosteriorSummary
from workflows.scene import InvalidScene

DIFFERENT = 0.1  # of two sigma, by a quantile from the end of its bar


def require_sampler() -> None:
    """Raise InvalidScene where the sampler is not installed."""
    if find_spec("emcee") is None:
        raise InvalidScene("--posterior needs emcee; ./install.sh posterior adds it.")


def with_posterior(found: Calibrated, seed: int) -> Calibrated:
    """A calibration with samples of its posterior, and their quantiles in its report's rows."""
    from coupling.calibration.posterior import posterior

    began = perf_counter()
    drawn = posterior(found.forward, found.fit, seed=seed)
    report = found.report
    report.posterior = PosteriorSummary(
        walkers=drawn.walkers,
        steps=drawn.kept,
        discarded=drawn.discarded,
        autocorrelation_steps=_number(drawn.autocorrelation.max()),
        effective_samples=drawn.effective,
        acceptance=drawn.acceptance,
        model_runs=drawn.model_runs,
        seed=seed,
        long_enough=drawn.long_enough,
        seconds=perf_counter() - began,
    )
    if drawn.long_enough:
        low, median, high = drawn.quantiles(SHARES)
        for i, row in enumerate(report.parameters):
            row.low, row.median, row.high = float(low[i]), float(median[i]), float(high[i])
    report.remarks.append(_told(report))
    return found._replace(posterior=drawn)


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _told(report) -> str:
    """How the samples came about, and what they say beyond the bars."""
    made = report.posterior
    cost = f"{made.model_runs} model runs in {made.seconds:.1f} s, seed {made.seed}"
    if made.autocorrelation_steps is None or not made.long_enough:
        tau = made.autocorrelation_steps
        times = "that cannot be told" if tau is None else f"of {tau:.3g} steps"
        return (
            f"The posterior is not shown: {made.steps} steps of {made.walkers} walkers are too few "
            f"for autocorrelation times {times} (50 of them are needed); {cost}. Free fewer "
            "parameters, or those that the data determines."
        )
    different = [row.name for row in report.parameters if _unlike(row)]
    verdict = (
        f"differ from their bars by more than a tenth of two sigma: {', '.join(different)}"
        if different
        else "agree with the bars to a tenth of two sigma"
    )
    return (
        f"Posterior, flat between the bounds: {made.effective_samples:.0f} effective samples "
        f"({made.walkers} walkers, {made.steps} steps, autocorrelation "
        f"{made.autocorrelation_steps:.3g} steps, {100 * made.acceptance:.0f} % accepted; {cost}); "
        f"its quantiles {verdict}."
    )


def _unlike(row) -> bool:
    if row.two_sigma is None:
        return True
    ends = row.found - row.two_sigma - row.low, row.found + row.two_sigma - row.high
    return max(map(abs, ends)) > DIFFERENT * row.two_sigma
