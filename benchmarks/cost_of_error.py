"""Cost of a run to an error, over that of the longest steps that would have done.

You will see, for chains of `beadwave accuracy` and errors asked for, at 101 and at 3001 samples:
the true error, the energy error, the contact evaluations of the run with the search for its step,
over those of one march by the longest equal steps that keep both as asked, and milliseconds.

    cost = evaluations of all marches / evaluations of the ideal one

Nobody knows the ideal step before. "Kept" is the velocity error asked for, and a hundredth of it in
the energy.

Contacts that yield and linear dampers come last: their stiffness or force jumps, the search for a
step is more cautious there, and their costs are summed up separately.

Run it: python benchmarks/cost_of_error.py        a minute
"""

from collections.abc import Iterator
from contextlib import nullcontext
from time import process_time

import numpy as np

from beadwave import dem
from beadwave.workflows.evidence.accuracy.problems import Problem
from beadwave.workflows.evidence.accuracy.problems import problem as problem_of
from beadwave.workflows.files.scene import scene

from parts import with_parts

SCENES = ("free-chain", "rig-rigid", "rig-half-space", "rig-1dof")
SMOOTH_PARTS = ("hunt-crossley", "residual spring", "40 wall modes", "dashpot wall")
JUMPING_PARTS = ("plastic contacts", "linear-clipped")
INSTANTS = 20  # at which velocities are compared
REFINEMENT = 16  # steps of the reference in one of the run
STEADY = 4  # counts of steps in a row that must keep the error: a single one may by chance
GROWTH = 1.04  # next count of steps over the present one, where that is more than one more


def main(errors: tuple[float, ...] = (1e-3, 1e-4, 1e-5)) -> None:
    print(
        f"{'chain':16} {'samples':>7} {'asked':>7} {'true':>8} {'energy':>8} {'cost':>6} {'ms':>7}"
    )
    costs: dict[str, list[tuple[float, int]]] = {"smooth forces": [], "forces that jump": []}
    for name, problem in problems():
        forces = "forces that jump" if name in JUMPING_PARTS else "smooth forces"
        for error in errors:
            ideal = ideal_evaluations(problem, error)
            for samples in (101, 3001):
                row = cost(problem, error, samples, ideal)
                costs[forces].append((row[2], ideal))
                print(
                    f"{name:16} {samples:7d} {error:7.0e} "
                    + "{:8.1e} {:8.1e} {:6.2f} {:7.2f}".format(*row)
                )
    for forces, pairs in costs.items():
        ratios, ideals = np.array(pairs).T
        print(
            f"{forces}: cost median {np.median(ratios):.2f}, mean {ratios.mean():.2f}, "
            f"most {ratios.max():.2f}, of all {ratios @ ideals / ideals.sum():.2f}, "
            f"{ratios.size} runs"
        )


def problems() -> Iterator[tuple[str, Problem]]:
    """Chains of the accuracy study, and its rigid wall with one part more at a time."""
    bare = {name: problem_of(scene(name, ()), lambda stage: nullcontext()) for name in SCENES}
    yield from bare.items()
    extended = with_parts(bare["rig-rigid"])
    yield from ((name, extended[name]) for name in SMOOTH_PARTS)
    omega, zeta, phi = 2.0 * np.pi * np.linspace(50.0, 5e3, 20), np.zeros(20), np.full(20, 5.0)
    yield "light modes", bare["rig-rigid"]._replace(wall=dem.Wall(omega, zeta, phi))
    yield from ((name, extended[name]) for name in JUMPING_PARTS)


def cost(problem: Problem, error: float, samples: int, ideal: int) -> tuple[float, ...]:
    """True error, energy error, evaluations over the ideal ones, milliseconds."""
    observation = {
        "duration": problem.duration, "observed": problem.observed, "n_save": samples - 1,
    }  # fmt: skip
    seconds = []
    for _ in range(4):
        start = process_time()
        run, report = dem.march_to_error(
            problem.chain, problem.wall, problem.v0, error=error, **observation
        )
        seconds.append(process_time() - start)
    reference = marched(problem, run.dt / REFINEMENT, samples - 1)
    true_error = velocity_error(problem, run.v, reference.v)
    return true_error, run.energy_error, report.evaluations / ideal, 1e3 * min(seconds)


def ideal_evaluations(problem: Problem, error: float) -> int:
    """Evaluations of the longest equal steps that keep the error, as the next finer ones do."""
    observation = {
        "duration": problem.duration, "observed": problem.observed, "n_save": INSTANTS,
    }  # fmt: skip
    run = dem.march_to_error(
        problem.chain, problem.wall, problem.v0, error=0.1 * error, **observation
    ).trajectory
    reference = marched(problem, run.dt / REFINEMENT, INSTANTS)

    longest_search = max(run.n_steps // INSTANTS, STEADY)
    n, in_a_row = 1, []  # steps between two instants; the last counts that kept the error
    while len(in_a_row) < STEADY and n <= longest_search:
        in_a_row = [*in_a_row, n] if keeps_error(problem, INSTANTS * n, reference, error) else []
        n = max(n + 1, int(GROWTH * n))
    n_steps = INSTANTS * (in_a_row[0] if len(in_a_row) == STEADY else longest_search)
    return n_steps * dem.SCHEMES[run.scheme].evaluations


def keeps_error(problem: Problem, n_steps: int, reference: dem.Trajectory, error: float) -> bool:
    """True if so many equal steps keep the velocities to the error and, at the end of every one,
    the energy to a hundredth of it."""
    try:
        run = marched(problem, problem.duration / n_steps, n_steps)
    except dem.UnstableStep:
        return False
    v = run.v[:: n_steps // INSTANTS]
    return run.energy_error <= 0.01 * error and velocity_error(problem, v, reference.v) <= error


def marched(problem: Problem, dt: float, n_save: int) -> dem.Trajectory:
    return dem.march(
        problem.chain, problem.wall, problem.v0, duration=problem.duration, dt=dt, n_save=n_save
    )


def velocity_error(problem: Problem, v: np.ndarray, reference: np.ndarray) -> float:
    """Largest velocity error of the observed spheres over the largest initial speed."""
    return float(np.abs(v - reference)[:, problem.observed].max() / np.abs(problem.v0).max())


if __name__ == "__main__":
    main()
