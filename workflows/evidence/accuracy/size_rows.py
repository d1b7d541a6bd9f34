"""Rows of chains of many spheres and of walls of many modes, at one step or tolerance for all."""

from collections.abc import Iterable

from workflows.evidence.accuracy import peers
from workflows.evidence.accuracy.peers import Problem
from workflows.evidence.accuracy.row import Row
from workflows.evidence.accuracy.runs import limit, peer_rows, reference, scheme_row, scheme_rows

FIXED = "rkn6"  # what sizes are compared with, at one step for all
PEER_TOLERANCE = 1e-8


def length_rows(case: Problem) -> tuple[Row, ...]:
    """Of a chain, by two of our schemes and two of scipy's integrators."""
    n = case.v0.size
    finer = 512.0 if n <= 100 else 128.0 if n <= 1000 else 32.0
    truth = reference(case, finer=finer, independent=n <= 1000)
    solvers = {name: peers.SCIPY[name] for name in ("RK45", "DOP853")}
    return (
        scheme_row("chain-length", case, truth, FIXED, limit(case, FIXED) / 8.0, n),
        scheme_row("chain-length", case, truth, "verlet", limit(case, "verlet") / 64.0, n),
        *peer_rows("chain-length", case, truth, solvers, parameter=n, tolerances=(PEER_TOLERANCE,)),
    )


def mode_rows(case: Problem, rigid_step: float, k: int, schemes: Iterable[str]) -> tuple[Row, ...]:
    """Of a wall of k modes: FIXED at a share of the rigid wall's step [s] beside DOP853, or beside
    `schemes` over their steps and all peers."""
    truth = reference(case)
    fixed = scheme_row("wall-modes", case, truth, FIXED, rigid_step, k)
    schemes = tuple(schemes)
    if not schemes:
        dop = {"DOP853": peers.SCIPY["DOP853"]}
        return fixed, *peer_rows(
            "wall-modes", case, truth, dop, parameter=k, tolerances=(PEER_TOLERANCE,)
        )
    return (
        fixed,
        *scheme_rows("wall-modes", case, truth, schemes, parameter=k),
        *peer_rows("wall-modes", case, truth, peers.peers(), parameter=k),
    )
