"""Check of the errors that runs with friction at the wall state, over random scenes.

You will see, for spheres that strike obliquely, spheres pressed on a wall that moves, and chains
that strike such a wall: how many runs are done, how many are refused, how many of those done state
less than their true error, points of

    ratio = stated / true,   true = max |v - v_reference| / largest speed,

over the velocity of the last sphere across the chain and that of its surface by its turn, the
largest share of the error asked for that the energy ledger leaves open, and the largest fall of
friction's heat, which should be 0. Loads, amplitudes, coefficients of friction, directions,
dampers, walls and arms are drawn at random; errors asked for are 1e-5 to 1e-3, in two directions
1e-4 to 1e-3.

The reference of a run is a run to a thirtieth of its error (a quarter in two directions), and to
halves of that until two references agree to a fifth of the stated error. Runs for which none do, or
whose references take too many steps, are counted as unknown.

Run it: python benchmarks/friction_errors.py             100 scenes, some minutes
        python benchmarks/friction_errors.py 500 7       more scenes, another seed
"""

import math
import sys
import warnings
from itertools import cycle
from typing import NamedTuple

import numpy as np

from beadwave import dem
from beadwave.coupling.lateral_march import WallMotion, march_lateral
from beadwave.dem.friction import contact_of_load, gross_slip, tangential_law
from beadwave.dem.lateral import LastSphere, LateralTrajectory
from beadwave.dem.spheres import force_scale, time_scale

from stated_errors import COLUMNS, row, stated_over_true

# error of a run over that of its first reference, in one direction and two; with 8 half of the
# references by order 2 disagree
REFINEMENT = (30.0, 4.0)
AGREEMENT = 0.2  # of the stated error: difference of two references that may stand for the truth
REFERENCES = 5  # tried, each to half the error of the last


class RandomRun(NamedTuple):
    """A random system, its duration and the requested error."""

    chain: dem.Chain
    wall: dem.Wall
    v0: np.ndarray  # (n,) [m/s]
    last: LastSphere
    motion: WallMotion | None
    duration: float  # [s]
    n_save: int
    error: float


class Trial(NamedTuple):
    """Result of a run; NaN if it was refused or its true error is unknown."""

    ratio: float  # stated over true error
    ledger: float  # what the energy ledger leaves open, over the error asked for
    fall: float  # [J] largest fall of friction's heat


def main(n_scenes: int = 100, seed: int = 0) -> None:
    trials: dict[str, list[Trial]] = {kind.__name__: [] for kind in (oblique, pressed, struck)}
    for i, kind in zip(range(n_scenes), cycle((oblique, pressed, struck)), strict=False):
        trials[kind.__name__].append(trial(kind(np.random.default_rng([seed, i]))))

    print(f"{'scenes':10} {COLUMNS} {'ledger':>7} {'fall':>6}")
    everything = [one for results in trials.values() for one in results]
    for name, results in (trials | {"all": everything}).items():
        if results:
            print(line(name, np.array(results)))


def line(name: str, trials: np.ndarray) -> str:
    """Row of the table; trials (k, 3)."""
    refused = np.isnan(trials[:, 1])
    ledger, fall = trials[~refused, 1:].max(axis=0) if not refused.all() else (np.nan, np.nan)
    return f"{name:10} {row(trials[:, 0], refused)} {ledger:7.2f} {fall:6.1g}"


def trial(run: RandomRun) -> Trial:
    """March to the error, then by much shorter steps."""
    try:
        along, _ = dem.march_to_error(
            run.chain, run.wall, run.v0, duration=run.duration, n_save=run.n_save, error=run.error
        )
        across = march_lateral(
            run.chain, run.wall, run.v0, along, run.last, motion=run.motion, error=run.error
        )
    except dem.UnstableStep:
        return Trial(np.nan, np.nan, np.nan)
    ledger = (along.energy_error + across.energy_error) / run.error
    fall = float(-np.diff(across.dissipated_friction).min())

    speed, R = top_speed(run), float(run.chain.radius[-1])
    try:
        ratio = stated_over_true(
            across, across.error_estimate,
            finer=lambda i: march_lateral(
                run.chain, run.wall, run.v0, along, run.last, motion=run.motion,
                error=run.error / (REFINEMENT[across.n_cells > 0] * 2.0**i),
            ),
            difference=lambda a, b: difference(a, b, R) / speed,
            agreement=AGREEMENT, references=REFERENCES,
        )  # fmt: skip
    except dem.UnstableStep:  # of a reference that takes too many steps
        ratio = np.nan
    return Trial(ratio, ledger, fall)


def difference(a: LateralTrajectory, b: LateralTrajectory, R: float) -> float:
    """[m/s] of velocities, and of those of the surface by the sphere's turn."""
    turning = R * np.abs(a.sphere_spin - b.sphere_spin).max()
    return max(float(np.abs(a.sphere_t_v - b.sphere_t_v).max()), float(turning))


def top_speed(run: RandomRun) -> float:
    """[m/s] to which errors are relative."""
    speed = max(float(np.abs(run.v0).max()), float(np.hypot(*run.last.velocity)))
    return speed if run.motion is None else max(speed, run.motion.speed)


def oblique(rng: np.random.Generator) -> RandomRun:
    """One sphere that strikes a wall at any angle, on an arm or free, damped or not."""
    chain, law = spheres(rng, 1)
    vn = 10 ** rng.uniform(-2.0, 0.3)
    psi = 10 ** rng.uniform(-1.0, 1.0)  # of Maw, Barber and Fawcett: from 5 or so on all slips
    coefficient, velocity = friction(rng, law, psi * vn)
    duration = 4.0 * float(time_scale(chain.mass[0], chain.A[0], vn))
    two = bool(rng.random() < 0.2)
    arm = arm_of(rng, float(chain.mass[0]), duration, two)
    last = LastSphere(coefficient, inertia(chain), velocity, *arm)
    n_save = int(rng.integers(100, 400))
    wall = wall_of(rng, chain, duration)
    return RandomRun(
        chain, wall, np.array([vn]), last, None, duration, n_save, error_asked(rng, two)
    )


def pressed(rng: np.random.Generator) -> RandomRun:
    """One sphere pressed on a wall that moves along itself, and nothing that strikes."""
    chain, law = spheres(rng, 1)
    last, motion, chain = shaken(rng, chain, law, 10 ** rng.uniform(0.0, 2.5))
    n_save, two = int(rng.integers(100, 400)), len(motion.frequency) > 1
    return RandomRun(
        chain, dem.rigid_wall(), np.zeros(1), last, motion, motion.period, n_save,
        error_asked(rng, two),
    )  # fmt: skip


def struck(rng: np.random.Generator) -> RandomRun:
    """A chain that strikes a wall that moves below its last sphere."""
    n = int(rng.integers(2, 7))
    chain, law = spheres(rng, n)
    v = 10 ** rng.uniform(-1.5, 0.0)
    force = float(force_scale(chain.mass[0], chain.A[0], v))
    last, motion, chain = shaken(rng, chain, law, force * 10 ** rng.uniform(-2.0, 0.0))
    duration = n * 3.0 * float(time_scale(chain.mass.max(), chain.A.min(), v))
    wall = wall_of(rng, chain, duration)
    n_save = int(rng.integers(100, 400))
    error = error_asked(rng, len(motion.frequency) > 1)
    return RandomRun(chain, wall, v * np.eye(n)[0], last, motion, duration, n_save, error)


def spheres(rng: np.random.Generator, n: int) -> tuple[dem.Chain, tuple]:
    """Equal spheres at a flat of another modulus, damped by any measure, and what their contact
    with the flat is made of."""
    R, E, nu = 10 ** rng.uniform(-2.7, -1.5), 10 ** rng.uniform(9.5, 11.3), rng.uniform(0.1, 0.4)
    flat = dem.Flat(10 ** rng.uniform(9.5, 11.5), nu)
    chain = dem.row_of_spheres(R, 7800.0, E, nu, count=n, flat=flat)
    if rng.random() < 0.5:
        chain = chain._replace(
            dissipation="hunt-crossley", gamma=np.full(n, 10 ** rng.uniform(-2.0, 0.3))
        )
    return chain, (R, E, nu, np.inf, *flat)


def friction(rng: np.random.Generator, law: tuple, speed: float):
    """The law of the wall's contact, and a velocity across of so much [m/s] over its coefficient's
    inverse, in any direction."""
    mu, way = rng.uniform(0.05, 1.0), rng.uniform(0.0, 2.0 * np.pi)
    return tangential_law(mu, *law), mu * speed * np.array([np.cos(way), np.sin(way)])


def inertia(chain: dem.Chain) -> float:
    return 0.4 * float(chain.mass[-1]) * float(chain.radius[-1]) ** 2


def arm_of(
    rng: np.random.Generator, mass: float, duration: float, two: bool
) -> tuple[np.ndarray, float]:
    """Stiffness along t1 and t2 and against turns: none, springs, as likely slow as fast over the
    duration, or a clamp against turns."""
    k = mass * (10 ** rng.uniform(-1.0, 1.5) / duration) ** 2 * float(rng.random() < 0.7)
    turn = float(rng.choice([0.0, 10 ** rng.uniform(0.0, 3.0), np.inf]))
    return k * np.array([1.0, rng.uniform(0.3, 3.0) if two else 1.0]), turn


def wall_of(rng: np.random.Generator, chain: dem.Chain, duration: float) -> dem.Wall:
    """Rigid, or of one mode."""
    if rng.random() < 0.6:
        return dem.rigid_wall()
    mass = 10 ** rng.uniform(-0.5, 2.0) * float(chain.mass[-1])
    return dem.one_dof_wall(10 ** rng.uniform(-1.0, 0.7) / duration, mass, 0.02)


def shaken(
    rng: np.random.Generator, chain: dem.Chain, law: tuple, load: float
) -> tuple[LastSphere, WallMotion, dem.Chain]:
    """A wall that moves by a twentieth to ten times the displacement at gross slip, in one
    direction or, in a fifth of the scenes, in two, below a sphere on an arm."""
    coefficient = rng.uniform(0.05, 1.0)
    contact = tangential_law(coefficient, *law)
    _, overlap = contact_of_load(contact, coefficient, load)
    slip = float(gross_slip(contact, overlap))
    mass = float(chain.mass[-1])
    natural = math.sqrt(2.0 * math.sqrt(contact.radius * overlap) * contact.modulus / mass)
    frequency = natural / (2.0 * np.pi) * 10 ** rng.uniform(-2.5, -0.7)
    two = bool(rng.random() < 0.2)
    count = 1 + int(two or rng.random() < 0.2)
    ways = rng.uniform(0.0, 2.0 * np.pi, count) if two else np.full(count, rng.uniform(0.0, 6.0))
    amplitude = slip * 10 ** rng.uniform(-1.3, 1.0, (count, 1)) * np.c_[np.cos(ways), np.sin(ways)]
    multiples = np.array([1.0, float(rng.choice([1.0, 1.5, 2.0, 3.0]))])[:count]
    motion = WallMotion(amplitude, frequency * multiples, rng.uniform(0.0, 6.0, count))

    # stiffer or softer than the contact; one that clamps leaves the turn alone
    stiffness = mass * natural**2 * 10 ** rng.uniform(-2.0, 0.5)
    stiffness = np.inf if rng.random() < 0.2 else stiffness
    turn = float(rng.choice([0.0, np.inf]))
    last = LastSphere(contact, inertia(chain), np.zeros(2), np.full(2, stiffness), turn)
    return last, motion, chain._replace(preload=load)


def error_asked(rng: np.random.Generator, two: bool) -> float:
    return 10 ** rng.uniform(-4.0 if two else -5.0, -3.0)


if __name__ == "__main__":
    warnings.simplefilter("error")
    main(*map(int, sys.argv[1:]))
