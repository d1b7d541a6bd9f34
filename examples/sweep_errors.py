"""Check of the errors that a sweep states, row by row.

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

from beadwave import dem
from beadwave.workflows.stages.chain.chain import start, together
from beadwave.workflows.stages.chain.impact import impact
from beadwave.workflows.stages.chain.walls import simple_wall
from beadwave.workflows.sweep.cases import Base, base_of, checked, groups
from beadwave.workflows.sweep.core.design import Design
from beadwave.workflows.sweep.marched_group import observed, rows
from beadwave.workflows.sweep.models import SharedWall

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
REFINEMENT = 8  # steps of the first reference in one of the row
AGREEMENT = 0.05  # of the stated error: difference of two references that may stand for the truth
REFERENCES = 4  # tried, each by half the steps of the last
ROUNDING = 1e-12  # true errors below it are rounding


class Trial(NamedTuple):
    """Stated errors of the rows of a population, compared with the true ones."""

    n_rows: int
    refused: int
    ratios: np.ndarray  # stated over true error of each row that is done and has a reference
    in_vain: int  # rows that are done, while a run of that row alone is refused
    cost: float

    def line(self, name: str) -> str:
        """Row of the table."""
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
    rows_each = -(-n_rows // len(POPULATIONS))
    trials = []
    for i, population in enumerate(POPULATIONS):
        trials.append(population_trial(population, rows_each, np.random.default_rng([seed, i])))
        print(trials[-1].line(population[0]), flush=True)
    print(merged(trials).line("all"))


def merged(trials: list[Trial]) -> Trial:
    """Populations as one; the cost is their mean."""
    n_rows, refused, ratios, in_vain, cost = zip(*trials, strict=True)
    return Trial(
        sum(n_rows), sum(refused), np.concatenate(ratios), sum(in_vain), float(np.mean(cost))
    )


def population_trial(population: tuple, n_rows: int, rng: np.random.Generator) -> Trial:
    """Sweeps of BATCH rows, each over other keys and ranges."""
    _, name, keys, kind = population
    trials = []
    for first in range(0, n_rows, BATCH):
        trials.append(sweep_trial(name, columns(keys, kind, min(BATCH, n_rows - first), rng)))
    return merged(trials)


def columns(keys: tuple[str, ...], kind: str, n: int, rng: np.random.Generator) -> dict:
    """Values (n,) of one to three of the keys, drawn from the ranges above."""
    if kind == "like":
        return {key: rng.permutation(np.geomspace(*LIKE[key], n)) for key in keys}
    varied = rng.permutation(keys)[: rng.integers(1, 4)].tolist()
    ends = {key: np.sort(np.exp(rng.uniform(*np.log(RANGES[key]), 2))) for key in varied}
    if kind == "sample":
        return {key: rng.permutation(np.geomspace(*ends[key], n)) for key in varied}
    if kind == "outlier":
        row = rng.integers(n)
        return {
            key: np.where(np.arange(n) == row, high, low * (1 + 1e-4 * np.arange(n)))
            for key, (low, high) in ends.items()
        }
    side = int(np.ceil(n ** (1 / len(varied))))
    axes = np.meshgrid(*(np.geomspace(*ends[key], side) for key in varied), indexing="ij")
    return {key: axis.ravel()[:n] for key, axis in zip(varied, axes, strict=True)}


def sweep_trial(name: str, values: dict, error: float | None = None) -> Trial:
    """The rows of one sweep, each beside its references; values (n,) of every key."""
    changes = {"contact.dissipation": "hunt-crossley"} if "contact.coefficient" in values else {}
    base = base_of(name, tuple((changes | ({"time.error": error} if error else {})).items()))
    design = Design("cases", {key: tuple(map(float, column)) for key, column in values.items()})
    ratios, refused, in_vain, costs = [], 0, 0, []
    for group in groups(base, design, range(design.n_cases)):
        cases = checked(base, group)
        for done in rows(cases, SharedWall(), True):
            if done.signals is None:
                refused += len(done.cases)
                continue
            stated, dt = (np.array(done.columns[key]) for key in ("error_time", "dt_s"))
            for case, v, error_of_row, h in zip(
                done.cases, done.signals["v"], stated, dt, strict=True
            ):
                true = true_error(base, design.case(case), v, error_of_row, h)
                if true is None:
                    in_vain += 1
                else:
                    ratios.append(error_of_row / max(true, ROUNDING))
            costs.append(cost(cases, done.cases, float(dt.min())))
    return Trial(design.n_cases, refused, np.array(ratios), in_vain, float(np.mean(costs or [0])))


def true_error(base: Base, case: dict, v: np.ndarray, stated: float, dt: float) -> float | None:
    """Error of the velocities v (k, watched spheres) of a row, over its striker's speed.

    None where no reference agrees with a finer one and the run alone is refused.
    """
    scene = base.with_values(case)
    initial, wall, speed = start(scene), simple_wall(scene), scene.striker.velocity
    run = {"duration": scene.time.duration, "n_save": len(v) - 1}
    coarser = None
    for i in range(REFERENCES):
        reference = dem.march(
            initial.chain, wall, initial.velocity, dt=dt / REFINEMENT / 2**i, **run
        )
        reference = reference.v[:, observed(scene)]
        if coarser is not None and np.abs(reference - coarser).max() <= AGREEMENT * stated * speed:
            return float(np.abs(v - reference).max() / speed)
        coarser = reference
    try:
        impact(scene, initial, wall)
    except dem.UnstableStep:
        return None
    return float(np.abs(v - coarser).max() / speed)


def cost(group_of_cases, cases: tuple[int, ...], dt: float) -> float:
    """Processor time of the marches of cases that are done over that of one by a step for all."""
    scene, group = group_of_cases.scene, group_of_cases.group
    group = group.take([group.cases.index(case) for case in cases])
    chains = together(scene, {key: np.array(c) for key, c in group.columns.items()}, None)
    run = {
        "duration": scene.time.duration, "n_save": scene.output.samples - 1,
        "observed": observed(scene), "threads": 1,
    }  # fmt: skip
    judged = seconds(lambda: dem.march_batch(chains, error=scene.time.error, **run))
    return judged / seconds(lambda: dem.march_batch(chains, dt=dt, **run))


def seconds(march: Callable[[], object]) -> float:
    start = process_time()
    march()
    return process_time() - start


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
