"""Samples of a calibration's posterior beside its two-sigma bars; needs the extra `posterior`."""

from importlib.util import find_spec
from time import perf_counter

import numpy as np

from workflows.fit.calibration.calibrate import Calibrated
from workflows.fit.calibration.report import PosteriorSummary
from workflows.fit.core.calibration.judgement import SHARES, on_posterior
from workflows.scene import InvalidScene


def require_sampler() -> None:
    """Raise InvalidScene where the sampler is not installed."""
    if find_spec("emcee") is None:
        raise InvalidScene("--posterior needs emcee; ./install.sh posterior adds it.")


def with_posterior(found: Calibrated, seed: int) -> Calibrated:
    """A calibration with samples of its posterior, and their quantiles in its report's rows."""
    from workflows.fit.core.calibration.posterior import posterior

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
    seconds = report.posterior.seconds
    report.remarks.append(on_posterior(drawn, found.fit, seed=seed, seconds=seconds))
    return found._replace(posterior=drawn)


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
