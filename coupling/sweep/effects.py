"""What an output depends on: Sobol's indices of a Saltelli design, rank correlations of a sample.

I. M. Sobol, Math. Comput. Simul. 55 (2001) 271; A. Saltelli et al., Comput. Phys. Commun. 181
(2010) 259.
"""

from typing import NamedTuple

import numpy as np

from coupling.sweep.design import Design

RESAMPLES = 400
FEWEST = 16  # base samples of which indices are made
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

    Raises ValueError for other designs, and where too few cases have a value or all the same.
    """
    from scipy.stats import sobol_indices

    n, d = design.base, len(design.keys)
    if design.kind != "sobol":
        raise ValueError("Sobol indices need a sweep with --sample sobol:n; make one.")
    parts = np.asarray(y, float).reshape(d + 2, n)
    whole = np.isfinite(parts).all(axis=0)
    used = int(whole.sum())
    if used < FEWEST or np.ptp(parts[:, whole]) == 0.0:
        raise ValueError(
            f"{used} of {n} samples have a value in all of their {d + 2} cases, and indices need "
            f"{FEWEST} whose values differ; take more samples or another output."
        )
    A, B, *mixed = parts[:, whole]
    values = {"f_A": A[None], "f_B": B[None], "f_AB": np.array(mixed)[:, None]}
    rng = np.random.default_rng(0)
    found = sobol_indices(func=values, n=used, rng=rng)
    spread = found.bootstrap(n_resamples=RESAMPLES)
    return Effects(
        np.ravel(found.first_order), np.ravel(found.total_order),
        np.ravel(spread.first_order.standard_error), np.ravel(spread.total_order.standard_error),
        used,
    )  # fmt: skip


def rank_correlations(design: Design, y: Array) -> dict[str, float]:
    """Spearman's of y (n_cases,) with each key; none where too few cases have a value, or all the
    same."""
    from scipy.stats import spearmanr

    there = np.isfinite(y)
    if there.sum() < FEWEST or np.ptp(y[there]) == 0.0:
        return {}
    return {
        key: float(spearmanr(np.array(values)[there], y[there]).statistic)
        for key, values in design.columns.items()
    }
