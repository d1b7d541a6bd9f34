"""Limits of the parts of a run: the rate of each beside the best that one core of the machine does.

You will see, for the stiffness of a structure and a chain at a rigid wall, the seconds of the first
and of later calls, the error, and the rate at which a part works next to what limits it:

    factor       additions and multiplications, beside a product of two dense matrices
    solution     bytes of the factor, which is read twice, beside reading a long array
    product      bytes of K, beside the same
    projection   bytes of a basis that is read twice and of a block, beside the same
    chain        contacts times evaluations of the force, beside square roots of a short array

so that a share near 1 says that only another method, not another program, would be faster. Errors
are those of a known solution, of the projection's orthogonality, and of the chain beside half the
step. Seconds are of the processor, all is done by one thread.

Run it: python benchmarks/limits.py [SCENE [SCALE]]        a minute; rig-rom, elements half as large
"""

import sys
from collections.abc import Callable
from time import process_time
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from beadwave.dem import SCHEMES
from beadwave.fem.modes.solver.grouping import grouped
from beadwave.fem.modes.solver.multifrontal import Cholesky, plan
from beadwave.fem.modes.solver.threads import one_thread
from beadwave.workflows.evidence.accuracy.problems import problem
from beadwave.workflows.evidence.accuracy.runs import (
    limit,
    marched,
    observed,
    relative_error,
)
from beadwave.workflows.files.scene import scene
from beadwave.workflows.report.tables import Table, text
from beadwave.workflows.stages.engine.progress import quiet
from beadwave.workflows.stages.structure import assembly as stages

COLUMNS = ("part", "error", "first [s]", "later [s]", "rate", "best", "unit", "share", "bound by")
BLOCK = 8  # forces at once, as the Krylov space solves for
BASIS = 128  # columns of the basis that a block is projected on
SHORT = 4096  # numbers that stay in the innermost cache


class Timed(NamedTuple):
    """A result, the processor seconds of its first call, and of the quickest of some later ones."""

    result: Any
    first: float
    later: float


def timed(call: Callable[[], Any], budget: float = 0.3) -> Timed:
    """Call once, which may compile, then again while the budget [s] lasts, at least twice."""
    seconds: list[float] = []
    while len(seconds) < 3 or sum(seconds[1:]) < budget:
        began = process_time()
        result = call()
        seconds.append(process_time() - began)
    return Timed(result, seconds[0], min(seconds[1:]))


class Machine(NamedTuple):
    """Best rates of one core."""

    products: float  # [1e9/s] additions and multiplications of a product of matrices
    read: float  # [GB/s] from memory
    roots: float  # [1e9/s] square roots with a product


def main(name: str = "rig-rom", scale: str = "0.5") -> list[tuple]:
    """Print the table; returns its rows."""
    with one_thread():
        machine = measured_machine()
        rows = [*structure_rows(name, float(scale), machine), chain_row(machine)]
    print(text(Table("limits", COLUMNS, tuple(rows))))
    return rows


def measured_machine(n: int = 1500, length: int = 40_000_000) -> Machine:
    """Rates of a product of dense matrices (n, n), of the sum of `length` numbers, and of roots of
    `SHORT` numbers."""
    rng = np.random.default_rng(0)
    A, long = rng.random((n, n)), rng.random(length)
    short, out = rng.random(SHORT), np.empty(SHORT)
    repeats = 1000
    return Machine(
        1e-9 * 2 * n**3 / timed(lambda: A @ A).later,
        1e-9 * long.nbytes / timed(lambda: long @ long).later,
        1e-9 * SHORT * repeats / timed(lambda: _roots(short, out, repeats)).later,
    )


@njit
def _roots(x, out, repeats):
    for _ in range(repeats):
        for i in range(x.size):
            out[i] = x[i] * np.sqrt(x[i])


def structure_rows(name: str, scale: float, machine: Machine) -> list[tuple]:
    """Rows of the stiffness of a scene's structure with this factor on its elements."""
    case = scene(name, {"mesh.scale": scale})
    K = stages.model(case, stages.mesh(case)).K.tocsc()
    rng = np.random.default_rng(0)
    x = rng.standard_normal((K.shape[0], BLOCK))
    b = np.asfortranarray(K @ x)

    # the factor, whose order is bound by nothing but our own graph work
    groups = grouped(K)
    order = timed(lambda: plan(groups))
    factor = timed(lambda: Cholesky(K, groups))
    fronts = order.result.fronts
    work, stored = (sum(getattr(f, what) for f in fronts) for what in ("work", "stored"))
    solution = timed(lambda: factor.result.solve(b))
    error = float(np.abs(solution.result - x).max() / np.abs(x).max())

    # a product with K, and the projection of a block on a basis
    product = timed(lambda: K @ x)
    basis = np.linalg.qr(rng.standard_normal((K.shape[0], BASIS)))[0]
    basis = np.asfortranarray(basis)
    projected = timed(lambda: x - basis @ (basis.T @ x))
    oblique = float(np.abs(basis.T @ projected.result).max() / np.linalg.norm(x, axis=0).max())

    of_factor = factor.first - order.first, factor.later - order.later
    of_basis = 2 * (basis.nbytes + x.nbytes)
    return [
        ("order", None, order.first, order.later, *4 * (None,), "graph"),
        row("factor", error, of_factor, 1e-9 * work, machine.products, "GFlop/s", "arithmetic"),
        row("solution", error, solution[1:], 16e-9 * stored, machine.read, "GB/s", "memory"),
        row("product", None, product[1:], 12e-9 * K.nnz, machine.read, "GB/s", "memory"),
        row("projection", oblique, projected[1:], 1e-9 * of_basis, machine.read, "GB/s", "memory"),
    ]


def chain_row(machine: Machine, scheme: str = "suzuki4") -> tuple:
    """Row of the bare chain of rig-rigid at a hundredth of the stable step."""
    case = problem(scene("rig-rigid"), quiet)
    dt = limit(case, scheme) / 100
    marching = timed(lambda: marched(case, scheme, dt))
    finer = observed(case, marched(case, scheme, dt / 2).v)
    error = relative_error(case, marching.result.v, finer)
    forces = marching.result.n_steps * SCHEMES[scheme].evaluations * case.chain.A.size
    seconds = marching.first, marching.later
    return row("chain", error, seconds, 1e-9 * forces, machine.roots, "1e9/s", "roots")


def row(
    part: str,
    error: float | None,
    seconds: tuple[float, float],
    amount: float,
    best: float,
    unit: str,
    bound: str,
) -> tuple:
    """Row of a part that does `amount` in the seconds of a first and of a later call."""
    rate = amount / seconds[1]
    return part, error, *seconds, rate, best, unit, rate / best, bound


if __name__ == "__main__":
    main(*sys.argv[1:])
