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


def with_posterior(result: Calibrated, seed: int) -> Calibrated:
    """A calibration with samples of its posterior, and their quantiles in its report's rows."""
    from workflows.fit.core.calibration.posterior import posterior

    began = perf_counter()
    samples = posterior(result.forward, result.fit, seed=seed)
    report, slowest = result.report, float(samples.autocorrelation.max())
    report.posterior = PosteriorSummary(
        walkers=samples.walkers,
        steps=samples.kept,
        discarded=samples.discarded,
        autocorrelation_steps=slowest if np.isfinite(slowest) else None,
        effective_samples=samples.effective,
        acceptance=samples.acceptance,
        model_runs=samples.model_runs,
        seed=seed,
        long_enough=samples.long_enough,
        seconds=perf_counter() - began,
    )
    if samples.long_enough:
        low, median, high = samples.quantiles(SHARES)
        for i, row in enumerate(report.parameters):
            row.low, row.median, row.high = float(low[i]), float(median[i]), float(high[i])
    seconds = report.posterior.seconds
    report.remarks.append(on_posterior(samples, result.fit, seed=seed, seconds=seconds))
    return result._replace(posterior=samples)
