"""Steps beyond reason, long runs, runs backwards, and the ends of floating point."""

from collections.abc import Iterator
from functools import partial

import numpy as np

import coupling
import dem
from coupling.verdict import large_step_error
from workflows.evidence.stability.chains import SPEED, spheres_of, squeezed, striker_velocity
from workflows.evidence.stability.outcomes import Outcome, finer, settled
from workflows.evidence.stability.trials import Trial

DRIFT_STEPS = 10_000_000


def step() -> Iterator[Trial]:
    """0.01 to 100 times the stability limit; a run at a given step must know its error."""
    for scheme in ("verlet", "rkn6", "energy2"):
        for share in (0.01, 0.03, 0.1, 0.3, 0.6, 0.9, 1.1, 3.0, 10.0, 100.0):
            yield Trial("step", f"{scheme} x {share:g}", partial(_stepped, scheme, share))


def _stepped(scheme: str, share: float) -> Outcome:
    """The true error, which the run's own estimate must not fall below by more than half."""
    chain, wall, v0 = spheres_of(), dem.rigid_wall(), striker_velocity()
    dt = share * dem.stability_limit(
        chain, wall, v0, scheme="verlet" if scheme == "energy2" else scheme
    )
    run = coupling.impact(
        chain, wall, v0, duration=100 * max(dt, 5e-6), dt=dt, n_save=20, scheme=scheme
    ).trajectory
    truth = finer(chain, wall, v0, run._replace(dt=min(dt, 1e-6)))
    off = float(np.abs(truth.v - run.v).max()) / SPEED
    return Outcome(off, 2 * run.error_estimate + 1e-9, tuple(large_step_error(run.error_estimate)))


def drift() -> Iterator[Trial]:
    """Ten million steps of three spheres between spring and wall: does the energy wander?"""
    for scheme in ("verlet", "rkn6"):
        for name, press in (("closed contacts", 1e-3), ("opening contacts", 0.0)):
            run = partial(_drift, scheme, press)
            yield Trial("drift", f"{scheme}, {DRIFT_STEPS:.0e} steps, {name}", run)


def _drift(scheme: str, press: float, n_steps: int = DRIFT_STEPS) -> Outcome:
    """Difference between the mean energies of the last and the first tenth of the run.

    Contacts that stay closed keep the energy of a nearby system for ever; each that opens or closes
    knocks it by as much as the step is rough, and the knocks add up like a random walk.
    """
    first = np.eye(1, 3)[0]
    chain = spheres_of(count=3, leaf_stiffness=1e6 * first, leaf_anchor=press * first)
    wall, v0 = dem.one_dof_wall(1e3, 1.0), SPEED * first
    dt = 0.02 * dem.stability_limit(chain, wall, v0, scheme=scheme)
    run = dem.march(chain, wall, v0, duration=n_steps * dt, dt=dt, scheme=scheme, n_save=1000)
    moved = abs(run.energy_total[-100:].mean() - run.energy_total[:100].mean())
    kinetic = 0.5 * float(chain.mass @ v0**2)
    return Outcome(moved / kinetic, 1e-4 if press else 1e-2)


def time_reversal() -> Iterator[Trial]:
    """There and back again."""
    walls = {"free": None, "rigid": dem.rigid_wall(), "1dof": dem.one_dof_wall(900.0, 2.0)}
    for name, wall in walls.items():
        yield Trial("time-reversal", name, partial(_there_and_back, spheres_of, wall))
    pressed = partial(squeezed, 100.0)
    yield Trial("time-reversal", "pressed", partial(_there_and_back, pressed, walls["1dof"]))


def _there_and_back(chain_of, wall: dem.Wall | None) -> Outcome:
    """What is missing from the start."""
    chain, v0 = chain_of(flat=None) if wall is None else chain_of(), striker_velocity()
    options = {"duration": 1e-3, "dt": 5e-7, "scheme": "rkn6"}
    there = dem.march(chain, wall, v0, **options)
    back = dem.march(chain, wall, v0, state=there.final.reversed(), **options)
    return Outcome(float(np.abs(back.v[-1] + v0).max()) / SPEED, 1e-7)


def float_extremes() -> Iterator[Trial]:
    """Inputs at and beyond the ends of what a float holds."""
    for speed in (0.0, 1e-300, 1e-30, 1e30, 1e300, np.inf, np.nan):
        yield Trial("float-extremes", f"speed {speed:g}", partial(_scaled, speed=speed))
    for factor in (1e-300, 1e-30, 1e30, 1e300, np.inf, np.nan, -1.0):
        yield Trial("float-extremes", f"mass x {factor:g}", partial(_scaled, mass=factor))
        yield Trial("float-extremes", f"A x {factor:g}", partial(_scaled, A=factor))
    for duration in (1e-300, 1e300, np.nan):
        run = partial(_scaled, duration=duration)
        yield Trial("float-extremes", f"duration {duration:g}", run)


def _scaled(speed: float = SPEED, mass: float = 1.0, A: float = 1.0, duration: float = 0.0):
    """A chain in which one quantity is absurd, for thirty natural times of it."""
    chain, v0 = spheres_of(), striker_velocity(speed=speed)
    chain = chain._replace(mass=mass * chain.mass, A=A * chain.A)
    natural = float(np.max((chain.mass / chain.A) ** 0.4 * np.abs(speed or 1.0) ** -0.2))
    outcome = settled(chain, dem.rigid_wall(), v0, duration or 30 * natural)
    return outcome._replace(warnings=())
