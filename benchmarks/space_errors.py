"""Stated and true errors of the march in space, on random networks beside scipy's DOP853.

    python benchmarks/space_errors.py [NETWORKS] [FIRST_SEED]

prints how many state less than their true error, and the middle of stated over true.
"""

import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

from beadwave.dem import space

sys.path.append(str(Path(__file__).parents[1] / "tests" / "support"))
from packing_reference import random_network, reference

DURATION, INSTANTS = 3e-4, 150  # s: some ten impacts


class Errors(NamedTuple):
    """Errors of a network's velocities, over the largest speed at the start."""

    seed: int
    stated: float
    true: float
    dof: int  # spheres and contacts
    below: int  # spheres whose own stated error is less than the true one


def errors_of(seed: int, error: float = 1e-5) -> Errors:
    """Errors of one network."""
    packing, v0 = random_network(seed)
    speed = np.linalg.norm(v0, axis=1).max()
    run = space.march_to_error(
        packing, None, v0, duration=DURATION, error=error, n_save=INSTANTS
    )  # fmt: skip
    _, v = reference(packing, None, v0, run.t, tolerance=1e-12, longest=4e-7)
    each = np.linalg.norm(run.velocity - v, axis=2).max(axis=0)
    rounding = 1e-10 * speed  # of the reference
    stated = np.maximum(run.errors.velocity, rounding)
    return Errors(
        seed, run.error_estimate, float(each.max() / speed), len(packing.mass),
        int(np.sum(each > stated)),
    )  # fmt: skip


def main(n: int = 300, first: int = 1000) -> list[Errors]:
    """Print and return the errors of n networks."""
    found = []
    for seed in range(first, first + n):
        found.append(errors_of(seed))
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
    main(*map(int, sys.argv[1:]))
