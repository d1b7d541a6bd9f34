"""Closure of the energy of shaken cycles: shakers' work = friction + damping, in random scenes.

You will see, of chains pressed on walls of random modes that one or two shakers move, how many have
no periodic state that was found (with the first sentence), how many were found by harmonic balance
and how many by periods marched, and of those found points of

    |work - heat of friction - losses of dampers and modes| / (work * error asked),

which are to stay below 1, of the change from period to period over the error, and the least share
of the area that sticks. Walls of 1 to 6 modes, coefficients, loads, arms, forces (from stick to
slip all over), frequencies and errors (1e-4 to 1e-2) are drawn at random.

Run it: python examples/cycle_energy.py             20 scenes, a minute
        python examples/cycle_energy.py 200 7       more scenes, another seed
"""

import sys
import time
import warnings
from typing import NamedTuple

import numpy as np

from beadwave import dem
from beadwave.coupling.errors import CouplingError
from beadwave.coupling.periodic_state import periodic_state
from beadwave.coupling.spatial_march import Before, PreparedImpact, body_of
from beadwave.coupling.spatial_wall import spatial_wall_of_modes
from beadwave.dem.friction import tangential_law
from beadwave.dem.lateral import LastSphere
from beadwave.dem.shakers import ShakerForces

R, RHO, E, NU = 0.0127, 7800.0, 210e9, 0.3  # steel spheres


class RandomCycle(NamedTuple):
    """A shaken chain before anything strikes, and the error asked for."""

    body: PreparedImpact
    error: float


class Closure(NamedTuple):
    """Result of a scene; NaN if no state was found."""

    balance: float  # what work and losses differ by, over the work and the error
    change: float  # from period to period, over the error
    stick: float  # least share of the area
    seconds: float  # of processor
    refusal: str = ""


def main(n_scenes: int = 20, seed: int = 0) -> None:
    closures = [closure(scene(np.random.default_rng([seed, i]))) for i in range(n_scenes)]
    numbers = np.array([each[:4] for each in closures])
    solved = np.isfinite(numbers[:, 0])
    partly = solved & (numbers[:, 2] > 0.0)
    print(f"{n_scenes} scenes: {solved.sum()} solved, {partly.sum()} of them stick in part")
    for i, each in enumerate(closures):
        if each.refusal:
            print(f"  scene {i}: {each.refusal}")
    print(f"{'':32} {'median':>8} {'95 %':>8} {'largest':>8}")
    for name, values in (
        ("balance over work and error", numbers[solved, 0]),
        ("change over the error", numbers[solved, 1]),
        ("seconds of processor", numbers[solved, 3]),
    ):
        print(f"{name:32}", *(f"{x:8.2g}" for x in np.quantile(values, [0.5, 0.95, 1.0])))
    print(f"{100 * np.mean(numbers[solved, 0] > 1.0):.1f} % do not close to the error")


def closure(cycle: RandomCycle) -> Closure:
    """The periodic state of a scene, and how its energy closes."""
    n, started = cycle.body.prepared.chain.mass.size, time.process_time()
    try:
        state = periodic_state(cycle.body, Before(np.zeros(n, bool), 0), error=cycle.error)
    except (dem.UnstableStep, CouplingError) as error:
        return Closure(*[np.nan] * 3, time.process_time() - started, str(error).split(";")[0])
    return Closure(
        state.balance / cycle.error,
        state.cycle.periodicity_error / cycle.error,
        float(state.cycle.stick_share.min()),
        time.process_time() - started,
    )


def scene(rng: np.random.Generator) -> RandomCycle:
    """One to four spheres pressed on a wall of random modes."""
    n, n_modes, s = int(rng.integers(1, 5)), int(rng.integers(1, 7)), int(rng.integers(1, 3))
    load = 10 ** rng.uniform(0.5, 2.0)
    chain = dem.row_of_spheres(
        R, RHO, E, NU, count=n, flat=dem.Flat(E, NU), preload=load,
        leaf_stiffness=None if n == 1 else 10 ** rng.uniform(3.0, 5.0),
    )  # fmt: skip
    if rng.random() < 0.5:
        gamma = np.full(n, 10 ** rng.uniform(-1.0, 0.3))
        chain = chain._replace(dissipation="hunt-crossley", gamma=gamma)

    omega = 2 * np.pi * 10 ** rng.uniform(1.7, 4.0, n_modes)
    phi = rng.normal(size=(n_modes, 3)) / np.sqrt(10 ** rng.uniform(0.0, 1.3, n_modes))[:, None]
    wall = spatial_wall_of_modes(
        omega, 10 ** rng.uniform(-2.5, -1.0, n_modes), phi, load=rng.normal(size=(n_modes, s))
    )
    mu = rng.uniform(0.05, 0.8)
    mass = float(chain.mass[-1])
    arm = np.full(2, 10 ** rng.uniform(5.0, 7.0)) * np.array([1.0, rng.choice([1.0, 1.7])])
    last = LastSphere(
        tangential_law(mu, R, E, NU, np.inf, E, NU), 0.4 * mass * R**2, np.zeros(2),
        arm if rng.random() < 0.8 else np.full(2, np.inf),
        float(rng.choice([100.0, np.inf])),
    )  # fmt: skip
    frequency = 10 ** rng.uniform(1.7, 3.0)
    multiples = np.array([1.0, float(rng.choice([1.0, 2.0, 3.0]))])[:s]
    force = mu * load * 10 ** rng.uniform(-1.5, 0.7, s)
    shakers = ShakerForces(force, frequency * multiples, rng.uniform(0.0, 6.0, s))
    body = body_of(chain, wall, np.zeros(n), last, shakers)
    return RandomCycle(body, 10 ** rng.uniform(-4.0, -2.0))


if __name__ == "__main__":
    warnings.simplefilter("error")
    main(*map(int, sys.argv[1:]))
