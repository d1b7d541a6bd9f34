"""What a run to an error costs beside the longest steps that would have done.

You will see, for chains of `beadwave accuracy` and errors asked for, at 101 and at 3001 samples:
the true error, the energy error, the contact evaluations of the run with the search for its step,
over those of one march by the longest equal steps that keep both as asked, and milliseconds.

    cost = evaluations of all marches / evaluations of the ideal one

Nobody knows the ideal step before. "Kept" is the velocity error asked for, and a hundredth of it in
the energy.

Contacts that yield and linear dampers come last: their stiffness or force jumps, estimates are more
cautious there, and costs are told apart.

Run it: python examples/cost_of_error.py        a minute
"""

from collections.abc import Iterator
from contextlib import nullcontext
from time import process_time

import numpy as np

import dem
from workflows.evidence.accuracy.peers import Problem
from workflows.evidence.accuracy.problem_variants import with_parts
from workflows.evidence.accuracy.problems import problem
from workflows.files.scene import scene

SCENES = ("free-chain", "rig-rigid", "rig-half-space", "rig-1dof")
PARTS = ("hunt-crossley", "residual spring", "40 wall modes", "dashpot wall")
JUMPING = ("plastic contacts", "linear-clipped")
SEEN, FINER, STEADY = 20, 16, 4  # instants compared; steps of the reference; counts that must do
APART = 1.04  # times as many steps, is the next count tried, where that is more than SEEN more


def main(errors: tuple[float, ...] = (1e-3, 1e-4, 1e-5)) -> None:
    print(
        f"{'chain':16} {'samples':>7} {'asked':>7} {'true':>8} {'energy':>8} {'cost':>6} {'ms':>7}"
    )
    found = {True: [], False: []}
    for name, case in cases():
        for error in errors:
            ideal = ideal_evaluations(case, error)
            for samples in (101, 3001):
                row = cost(case, error, samples, ideal)
                found[name not in JUMPING].append((row[2], ideal))
                print(
                    f"{name:16} {samples:7d} {error:7.0e} "
                    + "{:8.1e} {:8.1e} {:6.2f} {:7.2f}".format(*row)
                )
    for smooth, pairs in found.items():
        print(f"{'smooth forces' if smooth else 'forces that jump'}: {told(*np.array(pairs).T)}")


def told(costs: np.ndarray, ideals: np.ndarray) -> str:
    """Points of the costs, and all evaluations over all ideal ones."""
    points = f"median {np.median(costs):.2f}, mean {costs.mean():.2f}, most {costs.max():.2f}"
    return f"cost {points}, of all {costs @ ideals / ideals.sum():.2f}, {costs.size} runs"


def cases() -> Iterator[tuple[str, Problem]]:
    """Chains of the accuracy study, and of its first scene with parts."""
    found = {name: problem(scene(name, ()), lambda stage: nullcontext()) for name in SCENES}
    yield from found.items()
    parts = with_parts(found["rig-rigid"])
    yield from ((name, parts[name]) for name in PARTS)
    light = 2.0 * np.pi * np.linspace(50.0, 5e3, 20), np.zeros(20), np.full(20, 5.0)
    yield "light modes", found["rig-rigid"]._replace(wall=dem.Wall(*light))
    yield from ((name, parts[name]) for name in JUMPING)


def cost(case: Problem, error: float, samples: int, ideal: int) -> tuple[float, ...]:
    """True error, energy error, evaluations over the ideal ones, milliseconds."""
    start = {"duration": case.duration, "observed": case.observed, "n_save": samples - 1}
    times = []
    for _ in range(4):
        started = process_time()
        run, report = dem.march_to_error(case.chain, case.wall, case.v0, error=error, **start)
        times.append(process_time() - started)
    exact = marched(case, run.dt / FINER, samples - 1)
    true = off(case, run.v, exact.v)
    return true, run.energy_error, report.evaluations / ideal, 1e3 * min(times)


def ideal_evaluations(case: Problem, error: float) -> int:
    """Of the fewest equal steps that keep what is asked, as do the next finer ones: one count of
    steps may by chance."""
    start = {"duration": case.duration, "observed": case.observed, "n_save": SEEN}
    run = dem.march_to_error(case.chain, case.wall, case.v0, error=0.1 * error, **start).trajectory
    exact = marched(case, run.dt / FINER, SEEN)
    most, n, row = max(run.n_steps // SEEN, STEADY), 1, []
    while len(row) < STEADY and n <= most:
        row = [*row, n] if keeps(case, SEEN * n, exact, error) else []
        n = max(n + 1, int(APART * n))
    steps = SEEN * (row[0] if len(row) == STEADY else most)
    return steps * dem.SCHEMES[run.scheme].evaluations


def keeps(case: Problem, n_steps: int, exact: dem.Trajectory, error: float) -> bool:
    """Whether as many steps keep the error, and the ledger at the end of every one."""
    try:
        run = marched(case, case.duration / n_steps, n_steps)
    except dem.UnstableStep:
        return False
    closed = run.energy_error <= 0.01 * error
    return closed and off(case, run.v[:: n_steps // SEEN], exact.v) <= error


def marched(case: Problem, dt: float, n_save: int) -> dem.Trajectory:
    return dem.march(case.chain, case.wall, case.v0, duration=case.duration, dt=dt, n_save=n_save)


def off(case: Problem, v: np.ndarray, exact: np.ndarray) -> float:
    """Largest velocity error of the observed spheres over the largest initial speed."""
    return float(np.abs(v - exact)[:, case.observed].max() / np.abs(case.v0).max())


if __name__ == "__main__":
    main()
