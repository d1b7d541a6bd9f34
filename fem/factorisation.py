"""Sparse factorisation of symmetric matrices.

SuperLU's minimum degree is as good as any for small models, and for larger ones of thin parts;
beyond, nested dissection wins: PARDISO's where it is installed (the `fast` extra) from 20 000
unknowns on, else our own Cholesky's from 60 000 on. What has no Cholesky factor, being indefinite
or complex, is left to SuperLU.
"""

from functools import cache
from importlib.util import find_spec
from os import environ
from typing import Any, Protocol
from weakref import finalize

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix, triu
from scipy.sparse.linalg import splu

from fem.multifrontal import NEITHER, Cholesky, NotPositiveDefinite, Singular

WORTH_PARDISO = 20_000  # unknowns
WORTH_DISSECTION = 60_000  # thin assemblies: 49 000 take SuperLU 8.5 s for 30 modes, ours 15 s
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
    """Cholesky's factor of a matrix that is large and positive definite, else None.

    Raises Singular.
    """
    if A.shape[0] < WORTH_DISSECTION or np.iscomplexobj(A.data):
        return None
    try:
        return Cholesky(A)
    except NotPositiveDefinite:
        return None


def _superlu(A: csc_matrix) -> Factor:
    # minimum degree on A + A^T with diagonal pivots: 3 to 12 times faster than the default here
    options = {"SymmetricMode": True}
    try:
        return splu(A, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
    except RuntimeError as error:
        raise Singular(NEITHER) from error


def _checked(factor: Factor, A: csc_matrix) -> Factor:
    known = np.random.default_rng(0).standard_normal(A.shape[0])
    found = factor.solve((A @ known).astype(A.dtype))
    if not np.linalg.norm(found - known) < RECOVERED * np.linalg.norm(known):
        raise Singular(NEITHER)
    return factor
