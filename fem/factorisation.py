"""Sparse factorisation of symmetric matrices.

Small and thin ones are SuperLU's, whose minimum degree makes little fill there; solids, of which it
makes much, are dissected, by PARDISO where it is installed (the `fast` extra), else by our own
Cholesky. The work that minimum degree would make decides. What has no Cholesky factor, being
indefinite or complex, is left to SuperLU.
"""

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

WORTH_PARDISO = 20_000  # unknowns
WORTH_COUNTING = 5_000, 80_000  # unknowns; below SuperLU takes least, above dissection does
# work of an unknown: SuperLU does 3 to 5e9 a second, our own takes 60 us an unknown at such sizes
WORTH_DISSECTION = 250e3
SYMMETRIC, SOLVE = -2, 33  # PARDISO's matrix type and phase
RECOVERED = 1e-3  # of a known solution: a singular matrix loses it altogether


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


def factorised(A: csc_matrix) -> Factor:
    """Factor of a symmetric A, reusable for any number of right-hand sides.

    Raises ValueError when A is singular or not finite.
    """
    if not np.all(np.isfinite(A.data)):
        raise ValueError("the matrix holds NaN or inf; check material and stiffnesses.")
    if A.shape[0] >= WORTH_PARDISO and np.isrealobj(A.data) and has_pardiso():
        return _checked(Pardiso(A), A)
    return _checked(_dissected(A) or _superlu(A), A)


@cache
def has_pardiso() -> bool:
    """Whether the optional solver is installed."""
    return find_spec("pypardiso") is not None


@cache
def _mkl() -> str:
    """Where the MKL is that pypardiso finds by itself."""
    from pypardiso import PyPardisoSolver

    return PyPardisoSolver().libmkl._name


def _dissected(A: csc_matrix) -> Factor | None:
    """Cholesky's factor of a matrix that is worth it and positive definite, else None.

    Raises Singular.
    """
    n, (few, many) = A.shape[0], WORTH_COUNTING
    if n < few or np.iscomplexobj(A.data):
        return None
    groups = grouped(A)
    if n < many and minimum_degree_work(groups) < WORTH_DISSECTION * n:
        return None
    try:
        return Cholesky(A, groups)
    except NotPositiveDefinite:
        return None


def _superlu(A: csc_matrix) -> Factor:
    try:
        return minimum_degree(A)
    except RuntimeError as error:
        raise Singular(NEITHER) from error


def _checked(factor: Factor, A: csc_matrix) -> Factor:
    known = np.random.default_rng(0).standard_normal(A.shape[0])
    found = factor.solve((A @ known).astype(A.dtype))
    if not np.linalg.norm(found - known) < RECOVERED * np.linalg.norm(known):
        raise Singular(NEITHER)
    return factor
