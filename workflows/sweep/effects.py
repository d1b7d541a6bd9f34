"""What an output depends on: Sobol's indices of a Saltelli design, rank correlations of a sample.

I. M. Sobol, Math. Comput. Simul. 55 (2001) 271; A. Saltelli et al., Comput. Phys. Commun. 181
(2010) 259.
"""

from typing import NamedTuple

import numpy as np

from workflows.results.tables import Table
from workflows.scene import InvalidScene
from workflows.sweep.design import Design

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

    Raises InvalidScene for other designs, and where too few cases have a value or all the same.
    """
    from scipy.stats import sobol_indices

    n, d = design.base, len(design.keys)
    if design.kind != "sobol":
        raise InvalidScene("Sobol indices need a sweep with --sample sobol:n; make one.")
    parts = np.asarray(y, float).reshape(d + 2, n)
    whole = np.isfinite(parts).all(axis=0)
    used = int(whole.sum())
    if used < FEWEST or np.ptp(parts[:, whole]) == 0.0:
        raise InvalidScene(
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


def effects_table(design: Design, outputs: dict[str, Array]) -> Table | None:
    """Indices, or rank correlations of a Latin hypercube, for outputs that have any."""
    if design.kind == "sobol":
        columns = ("output", "key", "first order", "+-", "total", "+-  ")
        return _table(columns, design, outputs, _sobol_rows)
    if design.kind == "lhs":
        return _table(("output", "key", "rank correlation"), design, outputs, _rank_rows)
    return None


def _table(columns, design, outputs, rows_of) -> Table | None:
    rows = tuple(row for name, y in outputs.items() for row in rows_of(design, name, y))
    return Table("effects", columns, rows) if rows else None


def _sobol_rows(design, name, y):
    try:
        found = sobol_effects(design, y)
    except InvalidScene:
        return
    for i, key in enumerate(design.keys):
        yield (
            name, key, float(found.first[i]), float(found.first_error[i]), float(found.total[i]),
            float(found.total_error[i]),
        )  # fmt: skip


def _rank_rows(design, name, y):
    from scipy.stats import spearmanr

    there = np.isfinite(y)
    if there.sum() < FEWEST or np.ptp(y[there]) == 0.0:
        return
    for key in design.keys:
        yield name, key, float(spearmanr(np.array(design.columns[key])[there], y[there]).statistic)
