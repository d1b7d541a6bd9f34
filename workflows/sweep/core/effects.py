"""Dependence of an output on the varied values: Sobol's indices of a Saltelli design, rank
correlations of a sample.

I. M. Sobol, Math. Comput. Simul. 55 (2001) 271; A. Saltelli et al., Comput. Phys. Commun. 181
(2010) 259.
"""

from typing import NamedTuple

import numpy as np

from beadwave.workflows.sweep.core.design import Design

# Effects and their bootstrap
N_RESAMPLES = 400  # standard errors are known to 1 / sqrt(2 * 400), 3.5 %
MIN_SAMPLES = 16  # samples with a value that indices and rank correlations need
# range of an output over its largest value, below which it is the errors of the runs
ALIKE_RANGE = 1e-5

Array = np.ndarray


class Effects(NamedTuple):
    """Indices of one output, (d,) each, and their standard errors by bootstrap."""

    first: Array
    total: Array
    first_error: Array
    total_error: Array
    used: int  # base samples without a case that is missing


def sobol_effects(design: Design, y: Array) -> Effects:
    """First-order and total indices of y (n_cases,), nan where a case has none.

    Raises ValueError for other designs, where too few cases have a value, and where the values
    differ by no more than the errors of a run.
    """
    n, d = design.base, len(design.keys)
    if design.kind != "sobol":
        raise ValueError("Sobol indices need a sweep with --sample sobol:n; make one.")
    outputs = np.asarray(y, float).reshape(d + 2, n)
    complete = np.isfinite(outputs).all(axis=0)
    used = int(complete.sum())
    values = outputs[:, complete]
    if used < MIN_SAMPLES or np.ptp(values) <= ALIKE_RANGE * np.abs(values).max():
        raise ValueError(
            f"{used} of {n} samples have a value in all of their {d + 2} cases, and indices need "
            f"{MIN_SAMPLES} whose values differ by more than {ALIKE_RANGE:g} of the largest; "
            "take more "
            "samples or another output."
        )

    # standard errors by bootstrap: base samples drawn with replacement
    draws = np.random.default_rng(0).integers(used, size=(N_RESAMPLES, used))
    resampled = np.stack([_indices(values[:, draw]) for draw in draws])
    return Effects(*_indices(values), *resampled.std(axis=0, ddof=1), used)


def _indices(outputs: Array) -> Array:
    """First-order and total (2, d) of the outputs (d + 2, n) of A, B and each A_B: table 2 of
    Saltelli, rows (b) and (f). scipy's sobol_indices wants a power of two of samples, which cases
    that are missing leave none, and its standard errors change from call to call."""
    A, B, *mixed = outputs - outputs[:2].mean()
    AB, variance = np.array(mixed), np.var([A, B])
    return np.stack([np.mean(B * (AB - A), axis=1), np.mean((A - AB) ** 2, axis=1) / 2]) / variance


def rank_correlations(design: Design, y: Array) -> dict[str, float]:
    """Spearman's rank correlation of y (n_cases,) with each key; empty where too few cases have a
    value, or all the same."""
    from scipy.stats import spearmanr

    finite = np.isfinite(y)
    if finite.sum() < MIN_SAMPLES or np.ptp(y[finite]) == 0.0:
        return {}
    return {
        key: float(spearmanr(np.array(values)[finite], y[finite]).statistic)
        for key, values in design.columns.items()
    }
