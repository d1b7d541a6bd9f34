"""Factors of stiffness matrices by our own Cholesky, SuperLU, PARDISO and CHOLMOD.

You will see, for a grid of hexahedra of thick bodies, one of a slender beam and tetrahedra, the
processor seconds of order and factor and of solutions for one force and for eight, the memory at
most beside the matrix, and the error of a known solution,

    error = max |x - x0| / max |x0|,   A x = A x0, x0 random,

which is that of K's condition. Every factor is made in a process of its own, on one thread.
CHOLMOD, on its supernodal path, takes the order of METIS and our own; what it is given is a copy of
the lower triangle, which counts. It needs `pip install kvxopt pymetis`, PARDISO the extra `fast`;
what is not installed is left out.

Run it: python benchmarks/factor.py              minutes; 90 000 to 150 000 unknowns
        python benchmarks/factor.py 2            elements of twice the size
"""

import json
import subprocess
import sys
from collections.abc import Callable
from importlib.util import find_spec
from os import environ
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix, diags_array, load_npz, save_npz, tril

from beadwave.fem.modes.solver.factorisation import WORTH_COUNTING, Pardiso, has_pardiso
from beadwave.fem.modes.solver.grouping import grouped, minimum_degree
from beadwave.fem.modes.solver.multifrontal import Cholesky, plan
from beadwave.system import peak_memory, reset_peak_memory
from beadwave.workflows.files.scene import scene
from beadwave.workflows.report.tables import Table, text
from beadwave.workflows.stages.structure import assembly as stages

STRUCTURES = {  # scene, its changes, factor on the sizes of its elements
    "rig-rom": ({}, 0.5),
    "cantilever": ({}, 0.2),
    "rig-full-tie": ({"mesh.element": "tet"}, 0.6),
}
COLUMNS = (
    "structure", "unknowns", "solver", "order [s]", "with factor [s]", "1 force [s]",
    "8 forces [s]", "memory [MB]", "error",
)  # fmt: skip
Solve = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def main(coarser: float = 1.0, names: tuple[str, ...] = tuple(STRUCTURES)) -> list[tuple]:
    """Print the table of structures with elements `coarser` times as large; returns its rows."""
    rows: list[tuple] = []
    for name in names:
        changes, scale = STRUCTURES[name]
        case = scene(name, {**changes, "mesh.scale": coarser * scale})
        K = stages.model(case, stages.mesh(case)).K
        with TemporaryDirectory() as folder:
            file = Path(folder, "K.npz")
            save_npz(file, K, compressed=False)
            for solver in solvers(K.shape[0]):
                ended = subprocess.run(
                    [sys.executable, __file__, "--child", solver, file],
                    capture_output=True, check=True, encoding="utf-8",
                    env=environ | dict.fromkeys(ONE_THREAD, "1"),
                )  # fmt: skip
                rows.append((name, K.shape[0], solver, *json.loads(ended.stdout.splitlines()[-1])))
    print(text(Table("factor", COLUMNS, tuple(rows))))
    return rows


ONE_THREAD = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")
OWN, SUPERLU, PARDISO = "our own", "SuperLU", "PARDISO"
METIS, OUR_ORDER = "CHOLMOD, METIS", "CHOLMOD, our order"


def solvers(n: int) -> list[str]:
    """Those that are installed; SuperLU for matrices (n, n) of which it can be a candidate."""
    names = [OWN, *([SUPERLU] if n < WORTH_COUNTING[1] else [])]
    names += [PARDISO] if has_pardiso() else []
    if find_spec("kvxopt"):
        names += [*([METIS] if find_spec("pymetis") else []), OUR_ORDER]
    return names


def measure(solver: str, file: str) -> None:
    """Print a row's seconds, memory and error for the matrix of a file, as a line of JSON."""
    A = load_npz(file).tocsc()
    x = np.random.default_rng(0).standard_normal((A.shape[0], 8))
    b = np.asfortranarray(A @ x)
    of_order = None
    if solver == OWN:  # it finds its order itself
        of_order, _ = timed(lambda: plan(grouped(A)))
    reset_peak_memory()
    before = peak_memory()

    if solver in (METIS, OUR_ORDER):
        of_order, order = timed(
            lambda: metis_order(A) if solver == METIS else plan(grouped(A)).order
        )
        of_factor, solve = timed(lambda: cholmod(A, order))
        of_factor += of_order
    else:
        factors = {OWN: lambda: Cholesky(A, grouped(A)), SUPERLU: lambda: minimum_degree(A)}
        of_factor, factor = timed(factors.get(solver, lambda: Pardiso(A)))
        solve = factor.solve

    peak = peak_memory()
    megabytes = None if peak is None or before is None else 1e-6 * (peak - before)
    of_one, _ = timed(lambda: solve(b[:, :1]))
    of_eight, solution = timed(lambda: solve(b))
    error = float(np.abs(solution - x).max() / np.abs(x).max())
    print(json.dumps((of_order, of_factor, of_one, of_eight, megabytes, error)))


def timed(call: Callable[[], Any]) -> tuple[float, Any]:
    """Processor seconds of a call, and what it returns."""
    began = process_time()
    result = call()
    return process_time() - began, result


def metis_order(A: csc_matrix) -> NDArray[np.int64]:
    """METIS' order of elimination (n,), of the graph of nodes."""
    import pymetis

    graph, group = grouped(A)
    others = (graph - diags_array(graph.diagonal())).tocsr()
    others.eliminate_zeros()
    sequence, _ = pymetis.nested_dissection(xadj=others.indptr, adjncy=others.indices)
    rank = np.empty(len(sequence), dtype=np.int64)
    rank[np.asarray(sequence)] = np.arange(len(sequence))
    return np.argsort(rank[group], kind="stable")


def cholmod(A: csc_matrix, order: NDArray[np.int64]) -> Solve:
    """The solution by CHOLMOD's supernodal factor in this order of elimination (n,)."""
    from kvxopt import cholmod, matrix, spmatrix

    cholmod.options["supernodal"] = 2  # with its other path a matrix of 140 000 took minutes
    lower = tril(A, format="coo")
    rows, columns = (matrix(index.astype(np.int64)) for index in (lower.row, lower.col))
    copy = spmatrix(matrix(lower.data), rows, columns, A.shape)
    factor = cholmod.symbolic(copy, matrix(order.astype(np.int64)))
    cholmod.numeric(copy, factor)

    def solve(b):
        x = matrix(b)
        cholmod.solve(factor, x)
        return np.array(x)

    return solve


if __name__ == "__main__":
    if sys.argv[1:2] == ["--child"]:
        measure(*sys.argv[2:])
    else:
        main(*map(float, sys.argv[1:]))
