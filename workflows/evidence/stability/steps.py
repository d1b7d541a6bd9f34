"""Steps beyond reason, long runs, runs backwards, and the ends of floating point."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from beadwave import coupling, dem
from beadwave.coupling.verdict import large_step_error
from beadwave.workflows.evidence.harness import Outcome, Trial
from beadwave.workflows.evidence.stability.chains import (
    SPEED,
    spheres_of,
    squeezed,
    striker_velocity,
)
from beadwave.workflows.evidence.stability.trials import finer, settled


def step() -> Iterator[Trial]:
    """0.01 to 100 times the stability limit; a run at a given step must know its error."""
    for scheme in ("verlet", "rkn6", "energy2"):
        for share in (0.01, 0.03, 0.1, 0.3, 0.6, 0.9, 1.1, 3.0, 10.0, 100.0):
            yield Trial(f"{scheme} x {share:g}", partial(_at_share_of_limit, scheme, share))


def _at_share_of_limit(scheme: str, share: float) -> Outcome:
    """The true error of a run; it may be at most twice the error that the run estimates."""
    chain, wall, v0 = spheres_of(), dem.rigid_wall(), striker_velocity()
    limit_of = "verlet" if scheme == "energy2" else scheme  # an implicit scheme has no limit
    dt = share * dem.stability_limit(chain, wall, v0, scheme=limit_of)
    run = coupling.impact(
        chain, wall, v0, duration=100 * max(dt, 5e-6), dt=dt, n_save=20, scheme=scheme
    ).trajectory
    truth = finer(chain, wall, v0, run._replace(dt=min(dt, 1e-6)))
    true = float(np.abs(truth.v - run.v).max()) / SPEED
    allowed = 2 * run.error_estimate + 1e-9
    return Outcome(true, allowed, tuple(large_step_error(run.error_estimate)))


def drift() -> Iterator[Trial]:
    """Ten million steps of three spheres between spring and wall: the drift of their energy."""
    n_steps = 10_000_000
    for scheme in ("verlet", "rkn6"):
        for name, press in (("closed contacts", 1e-3), ("opening contacts", 0.0)):
            run = partial(energy_drift, scheme, press, n_steps)
            yield Trial(f"{scheme}, {n_steps:.0e} steps, {name}", run)


def energy_drift(scheme: str, press: float, n_steps: int) -> Outcome:
    """Difference between the mean energies of the last and the first tenth of the run, over the
    kinetic energy at the start; `press` [m] is how far the spring's anchor squeezes the chain.

    Contacts that stay closed keep the energy of a nearby system for ever; each that opens or closes
    changes it by an error of the step, and these changes add up like a random walk.
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
    """A march forth, velocities reversed, and back: the start is met to rounding and drift."""
    oscillator = dem.one_dof_wall(900.0, 2.0)
    cases = {
        "free": (spheres_of(flat=None), None),
        "rigid": (spheres_of(), dem.rigid_wall()),
        "1dof": (spheres_of(), oscillator),
        "pressed": (squeezed(100.0), oscillator),
    }
    for name, (chain, wall) in cases.items():
        yield Trial(name, partial(_there_and_back, chain, wall))


def _there_and_back(chain: dem.Chain, wall: dem.Wall | None) -> Outcome:
    """The velocities' error after a march and one with all velocities reversed."""
    v0, options = striker_velocity(), {"duration": 1e-3, "dt": 5e-7, "scheme": "rkn6"}
    there = dem.march(chain, wall, v0, **options)
    back = dem.march(chain, wall, v0, state=there.final.reversed(), **options)
    return Outcome(float(np.abs(back.v[-1] + v0).max()) / SPEED, 1e-7)


def float_extremes() -> Iterator[Trial]:
    """Inputs at and beyond the ends of what a float holds."""
    for speed in (0.0, 1e-300, 1e-30, 1e30, 1e300, np.inf, np.nan):
        yield Trial(f"speed {speed:g}", partial(_absurd, speed=speed))
    for factor in (1e-300, 1e-30, 1e30, 1e300, np.inf, np.nan, -1.0):
        yield Trial(f"mass x {factor:g}", partial(_absurd, mass=factor))
        yield Trial(f"A x {factor:g}", partial(_absurd, A=factor))
    for duration in (1e-300, 1e300, np.nan):
        run = partial(_absurd, duration=duration)
        yield Trial(f"duration {duration:g}", run)


def _absurd(
    speed: float = SPEED, mass: float = 1.0, A: float = 1.0, duration: float = 0.0
) -> Outcome:
    """A chain in which one quantity is absurd, for thirty natural times of it; mass and A are
    factors."""
    chain, v0 = spheres_of(), striker_velocity(speed=speed)
    chain = chain._replace(mass=mass * chain.mass, A=A * chain.A)
    natural = float(np.max((chain.mass / chain.A) ** 0.4 * np.abs(speed or 1.0) ** -0.2))
    outcome = settled(chain, dem.rigid_wall(), v0, duration or 30 * natural)
    return outcome._replace(warnings=())
