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
from scipy.sparse import csc_matrix, triu

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


class Factor(Protocol):
    """A factorised matrix A (n, n)."""

    def solve(self, b: NDArray) -> NDArray:
        """x of A x = b, (n,) or (n, k); k may be 0."""
        ...


class Pardiso:
    """A factor of a symmetric A (n, n) held in MKL's memory until this object goes.

    Raises PyPardisoError where MKL gives up.
    """

    def __init__(self, A: csc_matrix) -> None:
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
        upper = triu(A, format="csr")
        self._values = upper.data
        self._rows, self._columns = (
            (index + 1).astype(np.int32) for index in (upper.indptr, upper.indices)
        )
        self._call(12, np.zeros((A.shape[0], 1)))
        finalize(self, self._solver.free_memory, everything=True)

    def solve(self, b: NDArray[np.float64]) -> NDArray[np.float64]:
        """x of A x = b, (n,) or (n, k): eight columns together take three times as long as one."""
        if not b.size:  # an error -1 of PARDISO
            return np.zeros(b.shape)
        columns = np.asfortranarray(b.reshape(len(b), -1), dtype=np.float64)
        return np.ascontiguousarray(self._call(33, columns)).reshape(b.shape)

    def _call(self, phase: int, b: NDArray[np.float64]) -> NDArray[np.float64]:
        """x (n, k) of PARDISO's phase 12, analysis and factorisation, or 33, solution; b (n, k) by
        columns."""
        from pypardiso.pardiso_wrapper import PyPardisoError

        x, solver, error = np.empty_like(b), self._solver, c_int32(0)
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


def factorised(A: csc_matrix, *, recovered: float = 1e-3) -> Factor:
    """Factor of a symmetric A (n, n), reusable for any number of right-hand sides.

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
        if n >= many or minimum_degree_work(groups) >= WORTH_DISSECTION * n:
            with suppress(NotPositiveDefinite):  # it has no Cholesky factor
                factor = Cholesky(A, groups)
    factor = factor or _superlu(A)

    # a random x recovered from A x: of a singular A it loses the part in the null space
    x = np.random.default_rng(0).standard_normal(n)
    solution = factor.solve((A @ x).astype(A.dtype))
    if not np.linalg.norm(solution - x) < recovered * np.linalg.norm(x):
        raise Singular(NEITHER)
    return factor


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
