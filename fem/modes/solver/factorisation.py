"""Sparse factorisation of symmetric matrices.

SuperLU factorises small matrices and those of thin bodies, where minimum degree makes little fill;
solids, where it makes much, are dissected: by PARDISO where it is installed (the `fast` extra),
else by our own Cholesky. The work that minimum degree would make decides. A matrix without a
Cholesky factor, being indefinite or complex, is left to SuperLU.

CHOLMOD by METIS' order (kvxopt, pymetis) is not taken: at 92 000 to 154 000 unknowns it needed 0.58
to 0.70 of the processor seconds of our own factor, but 1.2 times the memory and 1.7 to 2.7 times as
long for eight forces at once; by our order, where there is no METIS, 0.9 to 1.04 of the seconds and
1.4 to 1.5 times the memory (`benchmarks/factor.py`).
"""

import sys
from contextlib import suppress
from ctypes import POINTER, byref, c_double, c_int32
from functools import cache
from importlib.util import find_spec
from os import environ
from pathlib import Path
from typing import Any, Protocol
from weakref import finalize

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix, csr_matrix, hstack, triu

from beadwave.fem.modes.solver.grouping import grouped, minimum_degree, minimum_degree_work
from beadwave.fem.modes.solver.multifrontal import NEITHER, Cholesky, NotPositiveDefinite, Singular

# unknowns from which on PARDISO is taken where it is installed
WORTH_PARDISO = 20_000
# unknowns: below SuperLU is fastest, above dissection, in between the work is counted
WORTH_COUNTING = 5_000, 80_000
# work of minimum degree per unknown from which on dissection is faster: SuperLU does 3 to 5e9
# operations a second, our own takes 60 us an unknown at such sizes, and answers eight forces at
# once in 0.8 of SuperLU's time. At 174e3 (a rig of 40 389 unknowns) both factors took as long; all
# that is solved with them took 5 % less, and 120 MB less of memory, by our own
WORTH_DISSECTION = 150e3


# Settings of MKL's PARDISO in place of its defaults, which refine every solution twice; the
# manual's name of each in brackets
MTYPE = -2  # real symmetric; 2, for a Cholesky factor, saved 3 % of factor and solution
ORDERING = 3  # nested dissection on all cores, as by default [iparm(2)]
# steps of iterative refinement; 0: none but where pivots were perturbed. Two made each solution
# three times as long: at 232 000 unknowns of steel they took the residual of a random one from
# 5.1e-16 to 4.2e-16, its error from 8e-12 to 4e-12 [iparm(8)]
N_REFINEMENTS = 0
PIVOT_PERTURBATION = 8  # pivots below 10^-8 of the largest entry are, as by default [iparm(10)]
PIVOTING = 1  # of one row or two, after Bunch and Kaufman, as by default [iparm(21)]
SCHUR = 2  # a Schur complement beside the factor [iparm(36)]
AT_ONCE = 64  # right-hand sides of a compliance in one solution


class Factor(Protocol):
    """A factorised matrix A (n, n)."""

    def solve(self, b: NDArray) -> NDArray:
        """x of A x = b, (n,) or (n, k); k may be 0."""
        ...


class Pardiso:
    """A factor of a symmetric A (n, n) held in MKL's memory until this object goes; with rows C
    (r, n) also their `compliance` C A^-1 C^T (r, r), the Schur complement of [[A, C^T], [C, 0]]
    with its sign turned.

    Raises PyPardisoError where MKL gives up.
    """

    def __init__(self, A: csc_matrix, C: csr_matrix | None = None) -> None:
        from pypardiso import PyPardisoSolver

        # else every solver searches the disk for MKL anew, longer than some factorisations take
        environ.setdefault("PYPARDISO_MKL_RT", _mkl())
        self._solver: Any = PyPardisoSolver(mtype=MTYPE)
        self._solver.set_iparm(1, 1)  # not the defaults
        self._solver.set_iparm(2, ORDERING)
        self._solver.set_iparm(8, N_REFINEMENTS)
        self._solver.set_iparm(10, PIVOT_PERTURBATION)
        self._solver.set_iparm(21, PIVOTING)

        # rows from the diagonal on, counted from 1. pypardiso's own calls count them anew each
        # time, an eighth of a solution, and keep a copy of A
        upper, r = triu(A, format="csr"), 0 if C is None else C.shape[0]
        if C is not None:
            # the corner of zeros has its diagonal, as PARDISO asks
            upper = hstack([upper, C.T], format="csr")
            upper = csr_matrix(
                (
                    np.append(upper.data, np.zeros(r)),
                    np.append(upper.indices, A.shape[0] + np.arange(r)),
                    np.append(upper.indptr[:-1], upper.nnz + np.arange(r + 1)),
                ),
                (A.shape[0] + r,) * 2,
            )
            upper.sort_indices()
            self._solver.perm = (np.arange(A.shape[0] + r) >= A.shape[0]).astype(np.int32)
            self._solver.set_iparm(36, SCHUR)
        self._n_border = r
        self._values = upper.data
        self._rows, self._columns = (
            (index + 1).astype(np.int32) for index in (upper.indptr, upper.indices)
        )
        schur = np.zeros((r, r)) if r else None
        self._call(12, np.zeros((upper.shape[0], 1)), schur)
        if schur is not None:
            self.compliance = -schur
        finalize(self, self._solver.free_memory, everything=True)

    def solve(self, b: NDArray[np.float64]) -> NDArray[np.float64]:
        """x of A x = b, (n,) or (n, k): eight columns together take three times as long as one."""
        if not b.size:  # an error -1 of PARDISO
            return np.zeros(b.shape)
        columns = np.asfortranarray(b.reshape(len(b), -1), dtype=np.float64)
        if not self._n_border:
            return np.ascontiguousarray(self._call(33, columns)).reshape(b.shape)
        # forward, nothing on the border, and backward
        n = len(b)
        bordered = np.asfortranarray(np.pad(columns, [(0, self._n_border), (0, 0)]))
        forward = self._call(331, bordered)
        forward[n:] = 0.0
        return np.ascontiguousarray(self._call(333, forward)[:n]).reshape(b.shape)

    def _call(
        self, phase: int, b: NDArray[np.float64], out: NDArray[np.float64] | None = None
    ) -> NDArray[np.float64]:
        """x (n, k) of PARDISO's phase 12, analysis and factorisation, or 33, solution, of which 331
        is the forward and 333 the backward one; b (n, k) by columns. A Schur complement takes
        `out`."""
        from pypardiso.pardiso_wrapper import PyPardisoError

        x = np.empty_like(b) if out is None else out
        solver, error = self._solver, c_int32(0)
        n, n_columns = b.shape
        scalars = [byref(c_int32(value)) for value in (1, 1, solver.mtype, phase, n)]
        double, integer = POINTER(c_double), POINTER(c_int32)
        solver._mkl_pardiso(
            solver.pt.ctypes.data_as(POINTER(solver._pt_type[0])),
            *scalars,
            self._values.ctypes.data_as(double),
            self._rows.ctypes.data_as(integer),
            self._columns.ctypes.data_as(integer),
            solver.perm.ctypes.data_as(integer),
            byref(c_int32(n_columns)),
            solver.iparm.ctypes.data_as(integer),
            byref(c_int32(0)),  # prints nothing
            b.ctypes.data_as(double),
            x.ctypes.data_as(double),
            byref(error),
        )
        if error.value:
            raise PyPardisoError(error.value)
        return x


def factorised(A: csc_matrix, *, recovered: float = 1e-3, dissected: bool = False) -> Factor:
    """Factor of a symmetric A (n, n), reusable for any number of right-hand sides; if `dissected`
    the work of minimum degree is not counted first, but for small matrices.

    Raises ValueError when A is singular or not finite: a random solution must be recovered to the
    relative error `recovered`, of which a singular matrix loses everything.
    """
    if not np.all(np.isfinite(A.data)):
        raise ValueError("the matrix holds NaN or inf; check material and stiffnesses.")
    n, (few, many) = A.shape[0], WORTH_COUNTING
    is_real = np.isrealobj(A.data)

    # the fastest: PARDISO, else Cholesky by nested dissection where minimum degree makes much fill;
    # SuperLU for thin bodies, and for what has no Cholesky factor
    factor: Factor | None = None
    if n >= WORTH_PARDISO and is_real and has_pardiso():
        factor = Pardiso(A)
    elif n >= few and is_real:
        groups = grouped(A)
        if dissected or n >= many or minimum_degree_work(groups) >= WORTH_DISSECTION * n:
            with suppress(NotPositiveDefinite):  # it has no Cholesky factor
                factor = Cholesky(A, groups)
    factor = factor or _superlu(A)

    _require_recovered(A, factor, recovered)
    return factor


def condensed_on(
    A: csc_matrix, C: csr_matrix, *, shifted: bool = False, recovered: float = 1e-3
) -> tuple[Factor, NDArray[np.float64]]:
    """Factor of a symmetric A (n, n), and the compliance W = C A^-1 C^T (r, r) of rows C (r, n);
    raises ValueError as `factorised`. Of an A that a shift alone keeps from being singular the rows
    are recovered: thin plates lose the rigid motions, which open nothing.

    PARDISO has W as a Schur complement: at 33 500 unknowns and 2052 rows with the factor in as long
    as 250 right-hand sides take.
    """
    rows = C if shifted else None
    if A.shape[0] >= WORTH_PARDISO and has_pardiso() and C.shape[0]:
        bordered = Pardiso(A, C)
        _require_recovered(A, bordered, recovered, rows)
        return bordered, (bordered.compliance + bordered.compliance.T) / 2
    # SuperLU substitutes for each row, which takes longer than either factor
    loosely, dissected = np.inf if shifted else recovered, C.shape[0] > AT_ONCE
    factor = factorised(A, recovered=loosely, dissected=dissected)
    _require_recovered(A, factor, recovered, rows)
    if isinstance(factor, Cholesky):
        return factor, factor.compliance(C)
    W = np.empty((C.shape[0],) * 2)
    for first in range(0, len(W), AT_ONCE):
        block = slice(first, first + AT_ONCE)
        W[:, block] = C @ factor.solve(C[block].T.toarray())
    return factor, (W + W.T) / 2


def _require_recovered(
    A: csc_matrix, factor: Factor, recovered: float, rows: csr_matrix | None = None
) -> None:
    """Raise Singular unless a random x is recovered from A x, or what rows read of it: of a
    singular A it loses the part in the null space."""
    x = np.random.default_rng(0).standard_normal(A.shape[0])
    solution = factor.solve((A @ x).astype(A.dtype))
    if rows is not None:
        solution, x = rows @ solution, rows @ x
    if not np.linalg.norm(solution - x) < recovered * np.linalg.norm(x):
        raise Singular(NEITHER)


def _superlu(A: csc_matrix) -> Factor:
    """SuperLU's factor; raises Singular, with a sentence on the structure, for its RuntimeError."""
    try:
        return minimum_degree(A)
    except RuntimeError as error:
        raise Singular(NEITHER) from error


@cache
def has_pardiso() -> bool:
    """True if the optional solver is installed and finds its MKL."""
    with suppress(ImportError):
        return find_spec("pypardiso") is not None and bool(_mkl())
    return False


@cache
def _mkl() -> str:
    """Path of the MKL that pypardiso finds; raises ImportError where it finds none."""
    # where wheels have it: pypardiso itself, already when it is imported, would walk through all
    # that is installed, which took 0.8 s of the processor
    folders = (Path(sys.prefix, *folder) for folder in (("lib",), ("Library", "bin")))
    libraries = [path for folder in folders for path in folder.glob("*mkl_rt*")]
    if libraries:
        environ.setdefault("PYPARDISO_MKL_RT", str(libraries[0]))
    from pypardiso import PyPardisoSolver

    return PyPardisoSolver().libmkl._name
