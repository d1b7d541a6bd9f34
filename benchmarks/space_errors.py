"""Stated and true errors of the march in space, on random networks beside scipy's DOP853.

    python benchmarks/space_errors.py [NETWORKS] [FIRST_SEED] [FRICTION]

prints how many state less than their true error, and the middle of stated over true. With a third
argument of 1 the networks have friction, whose true errors are those beside a march by an eighth of
the step: where contacts change from stick to slip DOP853 stops. With 2 they are chains on one
structure whose last spheres rub by exact springs, beside an eighth of the step and four times the
cells.
"""

import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

from beadwave.dem import space

sys.path.append(str(Path(__file__).parents[1] / "tests" / "support"))
from packing_reference import random_network, reference
from rows_reference import random_rubbing_rows

DURATION, INSTANTS = 3e-4, 150  # s: some ten impacts


class Errors(NamedTuple):
    """Errors of a network's velocities, over the largest speed at the start."""

    seed: int
    stated: float
    true: float
    dof: int  # spheres and contacts
    below: int  # spheres whose own stated error is less than the true one


def errors_of(seed: int, error: float, rubs: int) -> Errors:
    """Errors of one network, with the friction that the third argument names."""
    structure = None
    if rubs == 2:
        rows, structure = random_rubbing_rows(seed)
        packing, v0 = rows.packing, rows.velocity
    else:
        packing, v0 = random_network(seed)
    if rubs == 1:
        coefficients = np.random.default_rng(seed).uniform(0.05, 0.6, len(packing.A))
        packing = packing._replace(friction=coefficients)
    speed = np.linalg.norm(v0, axis=1).max()
    run = space.march_to_error(
        packing, structure, v0, duration=DURATION, error=error, n_save=INSTANTS
    )  # fmt: skip
    if rubs:
        finer = {"duration": DURATION, "dt": run.dt / 8.0, "n_save": INSTANTS}
        if rubs == 2:
            cells = packing.springs._replace(n_cells=1024)
            packing = packing._replace(springs=cells)
        v = space.march(packing, structure, v0, **finer).velocity
    else:
        _, v = reference(packing, None, v0, run.t, tolerance=1e-12, longest=4e-7)
    each = np.linalg.norm(run.velocity - v, axis=2).max(axis=0)
    rounding = 1e-10 * speed  # of the reference
    stated = np.maximum(run.errors.velocity, rounding)
    return Errors(
        seed, run.error_estimate, float(each.max() / speed), len(packing.mass),
        int(np.sum(each > stated)),
    )  # fmt: skip


def main(n: int = 300, first: int = 1000, rubs: int = 0) -> list[Errors]:
    """Print and return the errors of n networks."""
    found = []
    for seed in range(first, first + n):
        found.append(errors_of(seed, 1e-4 if rubs else 1e-5, rubs))
        e = found[-1]
        if e.true > e.stated:
            print(f"network {e.seed}: {e.stated:.2e} stated, {e.true:.2e} true", flush=True)
    below = sum(e.true > e.stated for e in found)
    columns = sum(e.below for e in found), sum(e.dof for e in found)
    middle = float(np.median([e.stated / max(e.true, 1e-15) for e in found]))
    print(
        f"{n} networks: {below} state less than their true error, "
        f"{columns[0]} of {columns[1]} spheres; stated over true {middle:.1f} in the middle"
    )
    return found


if __name__ == "__main__":
    n, first, rubs = ([*map(int, sys.argv[1:])] + [300, 1000, 0][len(sys.argv) - 1 :])[:3]
    main(n, first, rubs)
