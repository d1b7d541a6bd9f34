"""Check of the errors that single runs state for their time step, over random scenes.

You will see, for chains whose forces are smooth, whose contacts yield and whose dampers jump: how
many runs are done, how many are refused, how many of those done state less than their true error,
and points of

    ratio = stated / true,   true = max |v - v_reference| / largest initial speed,

over all spheres, and the contact evaluations of the search over those of the march that it ends
with. Then, of runs that observe the first sphere alone, the same of the arrays of every sphere and
contact that a run folder holds, each by the column whose ratio is the least. Scenes are those of
`random_scenes.py` (two to four unlike spheres, every law, damping and wall), rows of up to 23 very
unlike spheres at walls with up to 30 modes, and a few spheres of any size, stiffness and damping.
Errors asked for are 1e-5 to 1e-2.

The reference of a run is a march by an eighth of its steps, and shorter ones until two references
agree to a tenth of the stated error. Runs for which none do are counted as unknown.

Run it: python benchmarks/step_errors.py             200 scenes, a minute
        python benchmarks/step_errors.py 2000 7      more scenes, another seed
"""

import sys
import warnings
from functools import cache
from itertools import cycle
from typing import NamedTuple

import numpy as np

from beadwave import dem
from beadwave.dem.spheres import force_scale, time_scale

from random_scenes import DAMPED, LAWS, WALLS
from random_scenes import scene as few_spheres
from stated_errors import COLUMNS, stated_over_true
from stated_errors import row as of_ratios

FORCES = ("smooth", "yield", "jump", "jump and yield")
REFINEMENT = 8  # steps of the first reference in one of the run
AGREEMENT = 0.1  # of the stated error: difference of two references that may stand for the truth


class RandomRun(NamedTuple):
    """A random system, its duration and the requested error."""

    chain: dem.Chain
    wall: dem.Wall | None
    v0: np.ndarray  # (n,) [m/s]
    duration: float  # [s]
    n_save: int
    error: float

    @property
    def forces(self) -> str:
        """Onset of the forces of its contacts, one of FORCES."""
        jumps = self.chain.dissipation.startswith("linear")
        yields = self.chain.yield_overlap is not None
        return FORCES[2 * jumps + yields]


class Trial(NamedTuple):
    """Result of a run; NaN if it was refused or its true error is unknown."""

    ratio: float  # stated over true error
    cost: float  # evaluations of the search over those of its last march


class ArrayTrial(NamedTuple):
    """Least stated over true error of the columns of a run's arrays; NaN as in `Trial`."""

    x: float
    v: float
    contact_force: float


def main(n_scenes: int = 200, seed: int = 0) -> None:
    trials: dict[str, list[Trial]] = {forces: [] for forces in FORCES}
    array_trials: dict[str, list[ArrayTrial]] = {forces: [] for forces in FORCES}
    for i, population in zip(range(n_scenes), cycle((small, row, extreme)), strict=False):
        run = population(np.random.default_rng([seed, i]))
        trials[run.forces].append(trial(run))
        array_trials[run.forces].append(array_trial(run))

    print(f"{'forces':16} {COLUMNS} {'cost':>6}")
    everything = [one for results in trials.values() for one in results]
    for name, results in (trials | {"all": everything}).items():
        if results:
            print(line(name, np.array(results)))

    print(f"\n{'arrays':24} {COLUMNS}")
    for name, of_arrays in array_trials.items():
        ratios = np.array(of_arrays)
        for array, column in zip(ArrayTrial._fields, ratios.T, strict=False):
            if len(ratios):
                print(f"{name:9} {array:14} {of_ratios(column, np.isinf(column))}")


def line(name: str, trials: np.ndarray) -> str:
    """Row of the table; trials (k, 2)."""
    refused = np.isnan(trials[:, 1])
    cost = np.mean(trials[~refused, 1])
    return f"{name:16} {of_ratios(trials[:, 0], refused)} {cost:6.2f}"


def trial(run: RandomRun) -> Trial:
    """March to the error, then by much shorter steps."""
    saved = {"duration": run.duration, "n_save": run.n_save}
    try:
        result, report = dem.march_to_error(run.chain, run.wall, run.v0, error=run.error, **saved)
    except dem.UnstableStep:
        return Trial(np.nan, np.nan)
    cost = report.evaluations / (result.n_steps * dem.SCHEMES[result.scheme].evaluations)
    speed = float(np.abs(run.v0).max())

    def finer(i: int) -> np.ndarray:
        """Velocities (k, n) by steps REFINEMENT 2^i times as short."""
        dt = result.dt / REFINEMENT / 2**i
        return dem.march(run.chain, run.wall, run.v0, dt=dt, scheme=result.scheme, **saved).v

    def difference(a: np.ndarray, b: np.ndarray) -> float:
        """Largest difference of velocities (k, n) over the largest initial speed."""
        return float(np.abs(a - b).max() / speed)

    stated = result.error_estimate
    return Trial(stated_over_true(result.v, stated, finer, difference, AGREEMENT), cost)


def array_trial(run: RandomRun) -> ArrayTrial:
    """March to the error of the first sphere, then by much shorter steps; infinite if refused."""
    saved = {"duration": run.duration, "n_save": run.n_save}
    try:
        result, _ = dem.march_to_error(
            run.chain, run.wall, run.v0, error=run.error, observed=[0], **saved
        )
    except dem.UnstableStep:
        return ArrayTrial(*[np.inf] * 3)

    @cache
    def finer(i: int) -> dem.Trajectory:
        dt = result.dt / REFINEMENT / 2**i
        return dem.march(run.chain, run.wall, run.v0, dt=dt, scheme=result.scheme, **saved)

    def ratio(name: str) -> float:
        stated = getattr(result.errors, name)

        def difference(a: dem.Trajectory, b: dem.Trajectory) -> float:
            """Largest difference of a column over its stated error."""
            off = np.abs(getattr(a, name) - getattr(b, name)).max(axis=0)
            return float((off / np.maximum(stated, 1e-300)).max(initial=0.0))

        return stated_over_true(result, 1.0, finer, difference, AGREEMENT)

    return ArrayTrial(*(ratio(name) for name in ArrayTrial._fields))


def small(rng: np.random.Generator) -> RandomRun:
    """Two to four unlike spheres, as `random_scenes.py` has them."""
    law, dissipation, wall_kind = (str(rng.choice(list(kinds))) for kinds in (LAWS, DAMPED, WALLS))
    if law == "thornton" and wall_kind == "dashpot":  # takes no plastic contacts
        wall_kind = "rigid"
    chain, wall, v0 = few_spheres(rng, law, dissipation, wall_kind)
    speed = float(np.abs(v0).max())
    duration = 5.0 * v0.size * float(time_scale(chain.mass.max(), chain.A.min(), speed))
    return RandomRun(chain, wall, v0, duration, int(rng.integers(20, 300)), error_asked(rng))


def row(rng: np.random.Generator) -> RandomRun:
    """Up to 23 very unlike spheres, struck or all in motion, at a rigid or an elastic wall."""
    n = int(rng.integers(2, 24))
    radius, young = 0.0127 * 10 ** rng.uniform(-0.2, 0.2, n), 10 ** rng.uniform(9.5, 11.5, n)
    chain = dem.row_of_spheres(radius, 7800.0, young, 0.3, flat=dem.Flat(70e9, 0.3))
    force = float(force_scale(chain.mass[0], chain.A[0], 0.31))  # [N] of a first collision
    dissipation = str(rng.choice(list(DAMPED)))
    if dissipation != "none":
        gamma = DAMPED[dissipation] * 10 ** rng.uniform(-1.0, 0.5) * rng.uniform(0.3, 1.0, n)
        chain = chain._replace(dissipation=dissipation, gamma=gamma)
    if rng.random() < 0.3:
        limit = (rng.uniform(0.05, 0.5) * force / chain.A) ** (2 / 3)
        chain = chain._replace(yield_overlap=limit)
    v0 = 0.3 * rng.normal(size=n) if rng.random() < 0.5 else 0.31 * np.eye(n)[0]

    wall = dem.rigid_wall()
    kind = rng.choice(["rigid", "modes", "compliance"])
    if kind != "rigid":
        k = int(rng.integers(1, 31))
        omega = 2 * np.pi * np.geomspace(50.0, 2e4, k)
        phi = rng.normal(size=k) * 10 ** rng.uniform(-0.5, 0.7)
        compliance = 10 ** rng.uniform(-1.0, 1.0) * (force / chain.A[-1]) ** (2 / 3) / force
        wall = dem.Wall(omega, np.full(k, 0.01), phi, compliance * (kind == "compliance"))
    duration, n_save = 10 ** rng.uniform(-3.3, -2.3), int(rng.integers(20, 300))
    return RandomRun(chain, wall, v0, duration, n_save, error_asked(rng))


def extreme(rng: np.random.Generator) -> RandomRun:
    """Up to five spheres of any size and stiffness, pressed or on leaf springs, damped by any
    measure, at a wall far lighter or heavier than they are."""
    n, dissipation = int(rng.integers(1, 6)), str(rng.choice(list(DAMPED)))
    radius, young = 10 ** rng.uniform(-3.0, -1.5, n), 10 ** rng.uniform(9.0, 11.3, n)
    flat = dem.Flat(10 ** rng.uniform(9.0, 12.0), 0.3)
    chain = dem.row_of_spheres(radius, 7800.0, young, 0.3, flat=flat)

    # dampers, leaf springs and preload in units of the slowest contact's time
    speed = 10 ** rng.uniform(-2.0, 0.5)
    period = float(time_scale(chain.mass.max(), chain.A.min(), speed))
    damper = chain.mass / period
    if dissipation == "hunt-crossley":
        damper = np.full(n, 1.0 / speed)
    chain = chain._replace(dissipation=dissipation, gamma=10 ** rng.uniform(-3.0, 1.0) * damper)
    if rng.random() < 0.5:
        stiffness = chain.mass / period**2 * 10 ** rng.uniform(-2.0, 1.0)
        chain = chain._replace(leaf_stiffness=stiffness)
    if rng.random() < 0.5:
        force = chain.mass[-1] * speed / period
        chain = chain._replace(preload=float(force * 10 ** rng.uniform(-3.0, 1.0)))

    wall = dem.rigid_wall()
    kind = rng.choice(["rigid", "one mode", "modes"])
    if kind == "one mode":
        mass = 10 ** rng.uniform(-1.0, 3.0) * chain.mass[-1]
        wall = dem.one_dof_wall(10 ** rng.uniform(-2.0, 1.0) / period, mass)
    elif kind == "modes":
        omega = 10 ** rng.uniform(-1.5, 1.5, 5) / period
        phi = rng.normal(size=5) / np.sqrt(30.0 * chain.mass[-1])
        wall = dem.Wall(omega, np.full(5, 0.01), phi)
    duration, n_save = period * 10 ** rng.uniform(0.0, 1.2), int(rng.choice([1, 30, 300]))
    return RandomRun(chain, wall, speed * np.eye(n)[0], duration, n_save, error_asked(rng))


def error_asked(rng: np.random.Generator) -> float:
    return 10 ** rng.uniform(-5.0, -2.0)


if __name__ == "__main__":
    warnings.simplefilter("error")
    main(*map(int, sys.argv[1:]))
