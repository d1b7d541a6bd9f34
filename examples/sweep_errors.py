"""Whether the errors that a sweep states hold, row by row.

You will see, for random grids, samples and tables of cases with outliers: how many rows are done
and how many are refused, how many of those done state less than their true error, and points of

    ratio = stated / true,   true = max |v - v_reference| / striker's speed,

over the sampled velocities of the watched spheres. Then the processor time of the marches over that
of a single march of all rows by one step, the shortest of theirs, without any judgement: what a
step that all rows share would take at the least.

The reference of a row is a march of its own, by steps that end at the samples, eight times as short
as those of the row and shorter until two references agree to a twentieth of the stated error. Where
none do, the run of that row alone decides: refused there, the row is counted as stated in vain.

Run it: python examples/sweep_errors.py             1000 rows, a minute
        python examples/sweep_errors.py 3000 7      more rows, another seed
"""

import sys
from collections.abc import Callable
from time import process_time
from typing import NamedTuple

import numpy as np

import dem
from workflows.stages.chain import simple_wall, start, together
from workflows.stages.impact import impact
from workflows.sweep.cases import Base, base_of, checked, groups
from workflows.sweep.core.design import Design
from workflows.sweep.march import observed, rows
from workflows.sweep.models import SharedWall

# Smallest and largest value of each key [SI]; of a population a part of that range.
RANGES = {
    "striker.velocity": (0.05, 5.0),
    "chain.radius": (3e-3, 25e-3),
    "chain.density": (2e3, 12e3),
    "chain.young": (3e9, 400e9),
    "preload.force": (0.1, 200.0),
    "wall.frequency": (1e2, 1e4),
    "wall.mass": (0.1, 30.0),
    "contact.coefficient": (1e-3, 0.3),
}
CHAIN = ("striker.velocity", "chain.radius", "chain.density", "chain.young")
POPULATIONS = (
    ("grid, rigid wall", "rig-rigid", CHAIN, "grid"),
    ("sample, rigid wall", "rig-rigid", CHAIN, "sample"),
    ("outlier, rigid wall", "rig-rigid", CHAIN, "outlier"),
    ("grid, mass on a spring", "rig-1dof", (*CHAIN, "preload.force"), "grid"),
    ("sample, mass on a spring", "rig-1dof", (*CHAIN, "preload.force"), "sample"),
    ("outlier, mass on a spring", "rig-1dof", (*CHAIN, "preload.force"), "outlier"),
    ("grid of walls", "rig-1dof", ("wall.frequency", "wall.mass"), "grid"),
    ("sample of walls", "rig-1dof", ("wall.frequency", "wall.mass", *CHAIN), "sample"),
    ("outlier of walls", "rig-1dof", ("wall.frequency", "wall.mass", *CHAIN), "outlier"),
    ("free chain", "free-chain", CHAIN, "sample"),
    ("dissipation", "rig-1dof", (*CHAIN, "contact.coefficient"), "sample"),
    ("like chains", "rig-1dof", ("chain.young", "preload.force", "striker.velocity"), "like"),
)
LIKE = {"chain.young": (150e9, 250e9), "preload.force": (1.0, 50.0), "striker.velocity": (0.1, 1.0)}
BATCH = 50  # rows of a sweep
FINER, AGREED, REFERENCES = 8, 0.05, 4
FLOOR = 1e-12  # true errors below are rounding


class Judged(NamedTuple):
    """The rows of a population."""

    n_rows: int
    refused: int
    ratios: np.ndarray  # stated over true, of rows that are done and have a reference
    in_vain: int  # done, where the row alone is refused
    cost: float

    def line(self, name: str) -> str:
        """Of the table."""
        below = np.mean(np.append(self.ratios < 1.0, np.ones(self.in_vain)))
        least, median = np.min(self.ratios, initial=np.inf), np.median(self.ratios)
        return (
            f"{name:26} {self.n_rows:5d} {len(self.ratios) + self.in_vain:5d} {self.refused:7d} "
            f"{100 * below:7.2f} % {least:6.2f} {median:6.2f} {self.in_vain:7d} {self.cost:6.2f}"
        )


def main(n_rows: int = 1000, seed: int = 0) -> None:
    print(
        f"{'population':26} {'rows':>5} {'done':>5} {'refused':>7} {'below':>9} {'least':>6} "
        f"{'median':>6} {'in vain':>7} {'cost':>6}"
    )
    each = -(-n_rows // len(POPULATIONS))
    every = []
    for i, population in enumerate(POPULATIONS):
        every.append(judged(population, each, np.random.default_rng([seed, i])))
        print(every[-1].line(population[0]), flush=True)
    print(together_of(every).line("all"))


def together_of(parts: list[Judged]) -> Judged:
    """Populations as one; the cost is their mean."""
    n_rows, refused, ratios, in_vain, cost = zip(*parts, strict=True)
    return Judged(
        sum(n_rows), sum(refused), np.concatenate(ratios), sum(in_vain), float(np.mean(cost))
    )


def judged(population: tuple, n_rows: int, rng: np.random.Generator) -> Judged:
    """Sweeps of BATCH rows, each over other keys and ranges."""
    _, name, keys, kind = population
    parts = []
    for first in range(0, n_rows, BATCH):
        parts.append(judged_sweep(name, columns(keys, kind, min(BATCH, n_rows - first), rng)))
    return together_of(parts)


def columns(keys: tuple[str, ...], kind: str, n: int, rng: np.random.Generator) -> dict:
    """(n,) values of one to three of the keys."""
    if kind == "like":
        return {key: rng.permutation(np.geomspace(*LIKE[key], n)) for key in keys}
    some = rng.permutation(keys)[: rng.integers(1, 4)].tolist()
    ends = {key: np.sort(np.exp(rng.uniform(*np.log(RANGES[key]), 2))) for key in some}
    if kind == "sample":
        return {key: rng.permutation(np.geomspace(*ends[key], n)) for key in some}
    if kind == "outlier":
        row = rng.integers(n)
        return {
            key: np.where(np.arange(n) == row, high, low * (1 + 1e-4 * np.arange(n)))
            for key, (low, high) in ends.items()
        }
    side = int(np.ceil(n ** (1 / len(some))))
    axes = np.meshgrid(*(np.geomspace(*ends[key], side) for key in some), indexing="ij")
    return {key: axis.ravel()[:n] for key, axis in zip(some, axes, strict=True)}


def judged_sweep(name: str, values: dict, error: float | None = None) -> Judged:
    """The rows of one sweep, each beside its references; values (n,) of every key."""
    changes = {"contact.dissipation": "hunt-crossley"} if "contact.coefficient" in values else {}
    base = base_of(name, tuple((changes | ({"time.error": error} if error else {})).items()))
    design = Design("cases", {key: tuple(map(float, column)) for key, column in values.items()})
    ratios, refused, in_vain, costs = [], 0, 0, []
    for group in groups(base, design, range(design.n_cases)):
        looked = checked(base, group)
        for part in rows(looked, SharedWall(), True):
            if part.signals is None:
                refused += len(part.cases)
                continue
            stated, dt = (np.array(part.columns[key]) for key in ("error_time", "dt_s"))
            for case, v, own, h in zip(part.cases, part.signals["v"], stated, dt, strict=True):
                true = true_error(base, design.case(case), v, own, h)
                if true is None:
                    in_vain += 1
                else:
                    ratios.append(own / max(true, FLOOR))
            costs.append(cost(looked, part.cases, float(dt.min())))
    return Judged(design.n_cases, refused, np.array(ratios), in_vain, float(np.mean(costs or [0])))


def true_error(base: Base, case: dict, v: np.ndarray, stated: float, dt: float) -> float | None:
    """Of velocities v (k, watched spheres); None where no reference agrees with a finer one and
    the run alone is refused."""
    scene = base.with_values(case)
    begun, wall, speed = start(scene), simple_wall(scene), scene.striker.velocity
    run = {"duration": scene.time.duration, "n_save": len(v) - 1}
    before = None
    for i in range(REFERENCES):
        exact = dem.march(begun.chain, wall, begun.velocity, dt=dt / FINER / 2**i, **run)
        exact = exact.v[:, observed(scene)]
        if before is not None and np.abs(exact - before).max() <= AGREED * stated * speed:
            return float(np.abs(v - exact).max() / speed)
        before = exact
    try:
        impact(scene, begun, wall)
    except dem.UnstableStep:
        return None
    return float(np.abs(v - before).max() / speed)


def cost(looked, cases: tuple[int, ...], dt: float) -> float:
    """Processor time of the marches of cases that are done over that of one by a step for all."""
    scene, places = looked.scene, [looked.group.cases.index(case) for case in cases]
    group = looked.group.take(places)
    chains = together(scene, {key: np.array(c) for key, c in group.columns.items()}, None)
    run = {
        "duration": scene.time.duration, "n_save": scene.output.samples - 1,
        "observed": observed(scene), "threads": 1,
    }  # fmt: skip
    own = seconds(lambda: dem.march_batch(chains, error=scene.time.error, **run))
    return own / seconds(lambda: dem.march_batch(chains, dt=dt, **run))


def seconds(march: Callable[[], object]) -> float:
    began = process_time()
    march()
    return process_time() - began


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
