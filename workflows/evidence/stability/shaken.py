"""Friction on a shaken structure at its extremes: preloads, coefficients, resonance, separation,
phases."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from beadwave import dem
from beadwave.coupling.shaken_march import march_shaken
from beadwave.coupling.spatial_march import SpatialRun, body_of, march_space
from beadwave.coupling.spatial_wall import SpatialWall, spatial_wall_of_modes
from beadwave.dem.friction import tangential_law
from beadwave.dem.lateral import LastSphere
from beadwave.dem.shakers import ShakerForces
from beadwave.workflows.evidence.harness import Outcome, Trial
from beadwave.workflows.evidence.stability.trials import STEEL

R, NU, MU, LOAD = 0.0127, 0.3, 0.2, 50.0  # m, N pressed
SPEED = 0.1  # m/s of the striker
SWAYS = 300.0  # Hz, the mode across that shakers move
ERROR = 1e-3


def shaken_preload() -> Iterator[Trial]:
    """From no preload to 1 kN, without a shaker and at resonance, where all of it slips."""
    for load in (0.0, 0.1, 1.0, 10.0, 100.0, 1000.0):
        yield Trial(f"{load:g} N, off", partial(outcome, load=load, force=0.0))
        resonant = partial(outcome, load=load, force=2.0 * MU * max(load, 1.0))
        yield Trial(f"{load:g} N, resonance", resonant)


def shaken_friction() -> Iterator[Trial]:
    """Coefficients from 0 to 2, without a shaker and at resonance."""
    for mu in (0.0, 0.01, 0.1, 0.5, 2.0):
        yield Trial(f"{mu:g}, off", partial(outcome, mu=mu, force=0.0))
        yield Trial(f"{mu:g}, resonance", partial(outcome, mu=mu, force=20.0))


def shaken_separation() -> Iterator[Trial]:
    """Shakers that move the wall along its normal too, until the contact opens within a cycle."""
    for force in (10.0, 30.0, 100.0, 300.0, 1000.0):
        run = partial(outcome, load=10.0, force=force, frequency=700.0, normal=1.0)
        yield Trial(f"{force:g} N", run)


def shaken_phase() -> Iterator[Trial]:
    """Phases all round as the striker arrives, between stick and slip all over."""
    for phase in range(0, 360, 45):
        run = partial(outcome, force=8.0, phase=float(phase))
        yield Trial(f"{phase} deg", run)


def outcome(
    *,
    mu: float = MU,
    load: float = LOAD,
    force: float = 0.0,
    frequency: float = SWAYS,
    phase: float = 0.0,
    normal: float = 0.3,
) -> Outcome:
    """A striker on the sphere that is pressed on a wall: true error of the velocities beside a run
    to a tenth of the error, or what a cycle's energies leave open, if that is more."""
    # modes that sway across, and that move along the normal and both directions across
    phi = [[0.1 * normal, 0.8, 0.05], [0.6, 0.1, 0.1], [0.3, 0.2, 0.7]]
    omega = 2 * np.pi * np.array([SWAYS, 1100.0, 2700.0])
    pushed = [[1.0], [normal], [0.2]]
    wall = spatial_wall_of_modes(omega, [0.02, 0.02, 0.02], phi, load=pushed)

    run = partial(_run, mu, load, force, frequency, phase, wall)
    usual, balance = run(ERROR)
    finer, _ = run(0.1 * ERROR)
    speed = max(SPEED, float(np.abs(usual.lateral.sphere_t_v).max()))
    along = float(np.abs(usual.trajectory.v - finer.trajectory.v).max())
    across = float(np.abs(usual.lateral.sphere_t_v - finer.lateral.sphere_t_v).max())
    turning = R * float(np.abs(usual.lateral.sphere_spin - finer.lateral.sphere_spin).max())
    heat_falls = bool((np.diff(usual.lateral.dissipated_friction) < 0.0).any())
    value = max(along, across, turning) / speed
    # the energy of a period's work may be off by 10 times the error
    value = max(value, 1e-2 * usual.lateral.energy_error, balance / 10.0)
    return Outcome(np.inf if heat_falls else value, ERROR)


def _run(
    mu: float, load: float, force: float, frequency: float, phase: float, wall: SpatialWall,
    error: float,
) -> tuple[SpatialRun, float]:  # fmt: skip
    """The march to an error, and what energies of a cycle before leave open, over its work."""
    chain = dem.row_of_spheres(
        R, 7800.0, STEEL, NU, count=2, flat=dem.Flat(STEEL, NU), preload=load,
        leaf_stiffness=[0.0, 1e3],
    )  # fmt: skip
    law = tangential_law(mu, R, STEEL, NU, np.inf, STEEL, NU)
    inertia = 0.4 * float(chain.mass[-1]) * R**2
    last = LastSphere(law, inertia, np.zeros(2), np.array([2e6, 3e6]), 300.0)
    v0, options = np.array([SPEED, 0.0]), {"duration": 6e-4, "n_save": 100, "error": error}
    if force == 0.0:
        none = wall._replace(load=wall.load[:, :0], load_residual=np.zeros((3, 0)))
        return march_space(chain, none, v0, last, **options), 0.0
    shakers = ShakerForces(np.array([force]), np.array([frequency]), np.radians([phase]))
    run = march_shaken(body_of(chain, wall, v0, last, shakers), v0, **options)
    return run.run, run.before.balance
