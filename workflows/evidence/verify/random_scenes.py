"""Random scenes beside scipy's DOP853: every contact law, dissipation, wall and leaf spring."""

from collections.abc import Iterator
from itertools import product

import numpy as np

import dem
from dem.spheres import force_scale, time_scale
from workflows.evidence.verify.comparisons import Comparison, compared
from workflows.evidence.verify.formulas import motion

DAMPED = {"none": 0.0, "linear": 20.0, "linear-clipped": 20.0, "hunt-crossley": 0.2}
WALLS = ("free", "rigid", "one mass", "modes", "compliance", "dashpot")
LAWS = ("hertz", "thornton")
ERROR, ALLOWED = 1e-7, 1e-6  # of the largest initial speed
SOURCE = "the equations of motion in numpy by DOP853 of scipy"


def formulas() -> Iterator[Comparison]:
    """Random chains by DOP853: each law, damping, without and with leaf springs; the worst wall."""
    for law, dissipation, springs in product(LAWS, DAMPED, (False, True)):
        walls = WALLS if law == "hertz" else WALLS[:-1]  # a dashpot takes no plastic contacts
        rows = (comparison(law, dissipation, wall, springs=springs) for wall in walls)
        yield max(rows, key=lambda row: np.nan_to_num(row.difference, nan=np.inf))


def comparison(law: str, dissipation: str, wall: str, *, springs: bool) -> Comparison:
    """Velocities of the random scene of these parts."""
    seed = (LAWS.index(law) * len(DAMPED) + [*DAMPED].index(dissipation)) * len(WALLS)
    rng = np.random.default_rng(seed + WALLS.index(wall))
    chain, behind, v0 = scene(rng, law, dissipation, wall, springs=springs)
    speed = float(np.abs(v0).max())
    duration = 3.0 * v0.size * float(time_scale(chain.mass.max(), chain.A.min(), speed))
    run = dem.march_to_error(chain, behind, v0, duration=duration, error=ERROR, n_save=50)
    theirs = motion(chain, behind, v0, run.trajectory.t)
    held = ", leaf springs" if springs else ""
    name = f"{law}, {dissipation} damping{held}, {wall} wall: velocities [V]"
    return compared(name, run.trajectory.v, theirs.v, allowed=ALLOWED, of=speed, source=SOURCE)


def scene(
    rng: np.random.Generator, law: str, dissipation: str, wall: str, *, springs: bool | None = None
) -> tuple[dem.Chain, dem.Wall | None, np.ndarray]:
    """Two to four unlike spheres and their velocities; on springs or not, by chance if None."""
    n = int(rng.integers(2, 5))
    radius = 0.0127 * 2 ** rng.uniform(-0.5, 0.5, n)
    young = 210e9 * 10 ** rng.uniform(-0.6, 0.0, n)
    flat = None if wall == "free" else dem.Flat(210e9, 0.3)
    chain = dem.row_of_spheres(radius, 7800.0, young, 0.3, flat=flat)
    v0 = np.append(0.31, rng.uniform(-0.1, 0.1, n - 1))
    chain = _with_contacts(rng, chain, law, dissipation, wall)
    pressed = law == "hertz" and wall in ("rigid", "modes", "compliance")
    if springs is None:
        springs = law == "hertz" and rng.random() < 0.5 and pressed
    if springs:
        chain = _on_springs(rng, chain, pressed)
    return chain, _wall(rng, wall, chain), v0


def _with_contacts(rng, chain: dem.Chain, law: str, dissipation: str, wall: str) -> dem.Chain:
    contacts, parts = chain.A.size, {"dissipation": dissipation}
    if dissipation != "none":
        parts["gamma"] = DAMPED[dissipation] * rng.uniform(0.3, 1.0, contacts)
    if wall == "dashpot" and dissipation != "none":
        parts["gamma"][-1] = 0.0
    if law == "thornton":
        limit = rng.uniform(0.1, 0.5) * _force(chain)
        parts["yield_overlap"] = (limit / chain.A) ** (2 / 3)
    return chain._replace(**parts)


def _on_springs(rng, chain: dem.Chain, pressed: bool) -> dem.Chain:
    """Stretched and pressed to the wall where it can rest so; else slack at the start."""
    n = chain.mass.size
    chain = chain._replace(leaf_stiffness=rng.uniform(1e3, 2e5, n))
    if not pressed:
        return chain
    return chain._replace(leaf_anchor=rng.uniform(0.0, 2e-4, n), preload=0.1 * _force(chain))


def _force(chain: dem.Chain) -> float:
    return float(force_scale(chain.mass[0], chain.A[0], 0.31))


def _wall(rng: np.random.Generator, kind: str, chain: dem.Chain) -> dem.Wall | None:
    if kind == "free":
        return None
    if kind == "one mass":
        return dem.one_dof_wall(rng.uniform(50.0, 2e3), rng.uniform(0.05, 2.0), rng.uniform(0, 0.1))
    if kind == "dashpot":
        return dem.dashpot_wall(10 ** rng.uniform(2.5, 4.0))
    if kind == "rigid":
        return dem.rigid_wall()
    omega, phi = 2 * np.pi * np.geomspace(100.0, 2e4, 5), rng.uniform(0.2, 1.0, 5)
    wall = dem.Wall(omega, rng.uniform(0.0, 0.05, 5), phi)
    softer = (_force(chain) / chain.A[-1]) ** (2 / 3) / _force(chain)
    return wall._replace(residual_compliance=rng.choice([-0.1, 1.0]) * softer * (kind != "modes"))
