"""Extreme chains: materials, sizes, speeds, loads, losses, lengths.

Every run is held against one of another scheme with a step four times finer.
"""

from collections.abc import Iterator
from functools import partial

import numpy as np

from beadwave import dem
from beadwave.workflows.evidence.harness import Outcome, Trial
from beadwave.workflows.evidence.stability.trials import collisions, settled

RIG = {"radius": 0.0127, "density": 7800.0, "young": 210e9, "poisson": 0.3}
STEEL = dem.Flat(210e9, 0.3)
SPEED, N = 0.31, 9  # m/s of the striker, spheres


def spheres_of(**changes) -> dem.Chain:
    """The rig's spheres, nine unless a count or arrays are given, at a flat of steel."""
    options = {**RIG, "flat": STEEL, **changes}
    if not any(np.ndim(options[name]) for name in RIG):
        options.setdefault("count", N)
    return dem.row_of_spheres(**options)


def striker_velocity(n: int = N, speed: float = SPEED) -> np.ndarray:
    """Velocities (n,) with only the striker moving."""
    return speed * np.eye(1, n)[0]


def at_rigid_wall(
    *,
    speed: float = SPEED,
    duration: float | None = None,
    natural_times: float = 30.0,
    n_save: int = 100,
    **changes,
) -> Outcome:
    """Outcome of the rig's spheres with some changes at a rigid wall, for a duration [s] or as many
    of the slowest contact's natural times."""
    chain = spheres_of(**changes)
    v0 = striker_velocity(chain.mass.size, speed)
    if duration is None:
        duration = collisions(chain, speed, natural_times)
    young = changes.get("young", RIG["young"])
    return settled(chain, dem.rigid_wall(), v0, duration, young=young, n_save=n_save)


def young() -> Iterator[Trial]:
    """One Young's modulus for all spheres, from 1 MPa to 1 TPa."""
    for E in 10.0 ** np.arange(6, 13):
        yield Trial(E, partial(at_rigid_wall, young=E, flat=dem.Flat(E, 0.3)), "Pa")


def unlike_materials() -> Iterator[Trial]:
    """Steel next to ever softer spheres."""
    for soft in 10.0 ** np.arange(6, 12):
        E = np.where(np.arange(N) % 2, soft, 210e9)
        yield Trial(soft, partial(at_rigid_wall, young=E), "Pa")


def unlike_radii() -> Iterator[Trial]:
    """Every second sphere smaller, and a chain tapered a thousandfold."""
    for ratio in (0.3, 0.1, 1e-2, 1e-3):
        R = np.where(np.arange(N) % 2, ratio, 1.0) * RIG["radius"]
        yield Trial(ratio, partial(at_rigid_wall, radius=R))
    R = RIG["radius"] * np.geomspace(1.0, 1e-3, N)
    run = partial(at_rigid_wall, radius=R, natural_times=3.0)
    yield Trial("tapered to 0.001", run)


def radius() -> Iterator[Trial]:
    """One radius for all spheres, from 1 um to 1 m."""
    for R in 10.0 ** np.arange(-6, 1):
        yield Trial(R, partial(at_rigid_wall, radius=R), "m")


def striker_speed() -> Iterator[Trial]:
    """Speeds of the striker from 1 um/s to 100 m/s."""
    for speed in 10.0 ** np.arange(-6, 3):
        yield Trial(speed, partial(at_rigid_wall, speed=speed), "m/s")


def preload() -> Iterator[Trial]:
    """On the last sphere, and through all spheres by a spring on the first."""
    for force in (0.0, 1e-6, 1.0, 1e2, 1e4, 1e5):
        yield Trial(force, partial(at_rigid_wall, preload=force, duration=1e-3), "N")
        if force:
            chain, v0 = squeezed(force), striker_velocity()
            run = partial(settled, chain, dem.rigid_wall(), v0, 1e-3)
            yield Trial(f"{force:g} through all", run)


def squeezed(force: float) -> dem.Chain:
    """Spheres between a soft spring and a wall; with no force both just touch."""
    first, stiffness = np.eye(1, N)[0], 1e5
    anchor = force / stiffness + N * (force / spheres_of().A.min()) ** (2 / 3)
    return spheres_of(leaf_stiffness=stiffness * first, leaf_anchor=anchor * first)


def sonic_vacuum() -> Iterator[Trial]:
    """No preload: the limit of a vanishing one, which only tiny forces reach."""
    for force in (1e-3, 1e-6, 1e-9, 1e-12):
        yield Trial(force, partial(_vanishing, force), "N")


def _vanishing(force: float) -> Outcome:
    """Velocity difference to no force at all; a force p shifts it by about (p/F)^(2/3)."""
    wall, v0 = dem.rigid_wall(), striker_velocity()
    options = {"duration": 1e-3, "error": 1e-7, "n_save": 100}
    pressed = dem.march_to_error(squeezed(force), wall, v0, **options).trajectory
    free = dem.march_to_error(squeezed(0.0), wall, v0, **options).trajectory
    shift = (force / pressed.contact_force.max()) ** (2 / 3)
    return Outcome(float(np.abs(pressed.v - free.v).max()) / SPEED, 30 * shift + 1e-6)


def dissipation() -> Iterator[Trial]:
    """Each law of contact damping, from none to far beyond critical."""
    for law in ("linear", "linear-clipped", "hunt-crossley"):
        for gamma in (0.0, 1e-3, 1.0, 1e2, 1e4, 1e6, 1e8, 1e12, 1e18):
            run = partial(at_rigid_wall, dissipation=law, gamma=gamma, duration=5e-4)
            yield Trial(f"{law} {gamma:g}", run)


def spheres() -> Iterator[Trial]:
    """Chains of 2 to 100 000 spheres."""
    for n in (2, 17, 100, 1000, 10_000, 100_000):
        duration = 3e-4 if n > 1000 else 1e-3
        yield Trial(n, partial(at_rigid_wall, count=n, duration=duration, n_save=10))
