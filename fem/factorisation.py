"""Sparse factorisation of symmetric matrices.

SuperLU factorises small matrices and those of thin bodies, where minimum degree makes little fill;
solids, where it makes much, are dissected: by PARDISO where it is installed (the `fast` extra),
else by our own Cholesky. The work that minimum degree would make decides. A matrix without a
Cholesky factor, being indefinite or complex, is left to SuperLU.
"""

from contextlib import suppress
from functools import cache
from importlib.util import find_spec
from os import environ
from typing import Any, Protocol
from weakref import finalize

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix, triu

from fem.grouping import grouped, minimum_degree, minimum_degree_work
from fem.multifrontal import NEITHER, Cholesky, NotPositiveDefinite, Singular

# unknowns from which on PARDISO is taken where it is installed
WORTH_PARDISO = 20_000
# unknowns: below SuperLU is fastest, above dissection, in between the work is counted
WORTH_COUNTING = 5_000, 80_000
# work of minimum degree per unknown from which on dissection is faster: SuperLU does 3 to 5e9
# operations a second, our own takes 60 us an unknown at such sizes
WORTH_DISSECTION = 250e3
SYMMETRIC, SOLVE = -2, 33  # PARDISO's matrix type and phase


class Factor(Protocol):
    def solve(self, b: NDArray) -> NDArray: ...


class Pardiso:
    """A factor held in MKL's memory until this object goes."""

    def __init__(self, A: csc_matrix) -> None:
        from pypardiso import PyPardisoSolver

        # else every solver searches the disk for MKL anew, longer than some factorisations take
        environ.setdefault("PYPARDISO_MKL_RT", _mkl())
        self._solver: Any = PyPardisoSolver(mtype=SYMMETRIC)
        self._upper = triu(A, format="csr")
        self._solver.factorize(self._upper)
        self._solver.set_phase(SOLVE)
        finalize(self, self._solver.free_memory, everything=True)

    def solve(self, b: NDArray[np.float64]) -> NDArray[np.float64]:
        """x of A x = b, (n,) or (n, k); the solver's own `solve` would hash A at every call."""
        columns = np.asfortranarray(b.reshape(len(b), -1), dtype=np.float64)
        x = self._solver._call_pardiso(self._upper, columns)
        return np.ascontiguousarray(x).reshape(b.shape)


def factorised(A: csc_matrix, *, recovered: float = 1e-3) -> Factor:
    """Factor of a symmetric A, reusable for any number of right-hand sides.

    Raises ValueError when A is singular or not finite: a random solution must be recovered to the
    relative error `recovered`, of which a singular matrix loses everything.
    """
    if not np.all(np.isfinite(A.data)):
        raise ValueError("the matrix holds NaN or inf; check material and stiffnesses.")
    n, (few, many) = A.shape[0], WORTH_COUNTING
    is_real = np.isrealobj(A.data)

    factor: Factor | None = None
    if n >= WORTH_PARDISO and is_real and has_pardiso():
        factor = Pardiso(A)
    elif n >= few and is_real:
        groups = grouped(A)
        if n >= many or minimum_degree_work(groups) >= WORTH_DISSECTION * n:
            with suppress(NotPositiveDefinite):  # it has no Cholesky factor
                factor = Cholesky(A, groups)
    factor = factor or _superlu(A)

    x = np.random.default_rng(0).standard_normal(n)
    solution = factor.solve((A @ x).astype(A.dtype))
    if not np.linalg.norm(solution - x) < recovered * np.linalg.norm(x):
        raise Singular(NEITHER)
    return factor


def _superlu(A: csc_matrix) -> Factor:
    try:
        return minimum_degree(A)
    except RuntimeError as error:
        raise Singular(NEITHER) from error


@cache
def has_pardiso() -> bool:
    """Whether the optional solver is installed."""
    return find_spec("pypardiso") is not None


@cache
def _mkl() -> str:
    """Where the MKL is that pypardiso finds by itself."""
    from pypardiso import PyPardisoSolver

    return PyPardisoSolver().libmkl._name
