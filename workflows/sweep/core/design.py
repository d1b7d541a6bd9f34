"""Designs of a sweep: every combination of values, or samples of ranges."""

from collections.abc import Sequence
from hashlib import sha256
from json import dumps
from math import prod
from typing import Any, NamedTuple

import numpy as np


class Design(NamedTuple):
    """Cases of a sweep: `columns` has the values of each key, one per case."""

    kind: str  # "grid", "lhs", "sobol" or "table"
    columns: dict[str, tuple[Any, ...]]
    base: int = 0  # of a Sobol design: samples of its matrices A and B

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys that vary."""
        return tuple(self.columns)

    @property
    def n_cases(self) -> int:
        """Number of cases."""
        return len(next(iter(self.columns.values())))

    @property
    def digest(self) -> str:
        """The first 12 hexadecimal digits of the SHA-256 of all values of all cases."""
        return sha256(dumps(self.columns, default=repr).encode()).hexdigest()[:12]

    def case(self, i: int) -> dict[str, Any]:
        """Values of one case by key."""
        return {key: values[i] for key, values in self.columns.items()}


class Axis(NamedTuple):
    """One `--over`: values of a grid, or a range to sample."""

    key: str
    values: tuple[Any, ...] = ()
    low: float = 0.0
    high: float = 0.0
    logarithmic: bool = False

    def at(self, unit: np.ndarray) -> np.ndarray:
        """Values (n,) in the range for numbers (n,) between 0 and 1: low + (high - low) x, or
        low (high / low)^x."""
        if self.logarithmic:
            return self.low * (self.high / self.low) ** unit
        return self.low + (self.high - self.low) * unit


def combined(axes: Sequence[Axis]) -> Design:
    """Every combination of the values of all axes, the last key varying fastest."""
    n_cases = prod(len(axis.values) for axis in axes)
    columns, cycles = {}, 1
    for axis in axes:
        # a value stands `repeats` times in a row, all values go round `cycles` times
        repeats = n_cases // (cycles * len(axis.values))
        columns[axis.key] = tuple(v for v in axis.values for _ in range(repeats)) * cycles
        cycles *= len(axis.values)
    return Design("grid", columns)


def latin_hypercube(axes: Sequence[Axis], n: int, seed: int) -> Design:
    """A Latin hypercube of n cases: each of the n equal parts of every range has one of them.

    M. D. McKay, R. J. Beckman, W. J. Conover, Technometrics 21 (1979) 239.
    """
    from scipy.stats import qmc

    unit = qmc.LatinHypercube(len(axes), rng=np.random.default_rng(seed)).random(n)
    return Design("lhs", _at(axes, unit))


def sobol(axes: Sequence[Axis], n: int, seed: int) -> Design:
    """The matrices A, B and A_B of a Sobol design: n (d + 2) cases for d keys.

    A. Saltelli et al., Comput. Phys. Commun. 181 (2010) 259: A and B have n rows each, A_B takes
    one column of B at a time.
    """
    from scipy.stats import qmc

    d = len(axes)
    both = qmc.Sobol(2 * d, rng=np.random.default_rng(seed)).random(n)
    A, B = both[:, :d], both[:, d:]
    mixed = [np.where(np.arange(d) == j, B, A) for j in range(d)]
    return Design("sobol", _at(axes, np.vstack([A, B, *mixed])), n)


def _at(axes: Sequence[Axis], unit: np.ndarray) -> dict[str, tuple[float, ...]]:
    """Columns of the axes for samples (n, d) between 0 and 1."""
    return {axis.key: tuple(axis.at(unit[:, j]).tolist()) for j, axis in enumerate(axes)}
