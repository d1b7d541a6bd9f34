"""Random scenes: every contact law, dissipation, wall and leaf spring."""

import numpy as np

from beadwave import dem
from beadwave.dem.spheres import force_scale

DAMPED = {"none": 0.0, "linear": 20.0, "linear-clipped": 20.0, "hunt-crossley": 0.2}
WALLS = ("free", "rigid", "one mass", "modes", "compliance", "dashpot")
LAWS = ("hertz", "thornton")


def scene(
    rng: np.random.Generator,
    law: str,
    dissipation: str,
    wall_kind: str,
    *,
    springs: bool | None = None,
) -> tuple[dem.Chain, dem.Wall | None, np.ndarray]:
    """Two to four unlike spheres, a wall, and velocities (n,) [m/s]; on leaf springs or not, by
    chance if None. The order of the draws is part of the scene: each seed gives the same one."""
    n = int(rng.integers(2, 5))
    radius = 0.0127 * 2 ** rng.uniform(-0.5, 0.5, n)
    young = 210e9 * 10 ** rng.uniform(-0.6, 0.0, n)
    flat = None if wall_kind == "free" else dem.Flat(210e9, 0.3)
    chain = dem.row_of_spheres(radius, 7800.0, young, 0.3, flat=flat)
    v0 = np.append(0.31, rng.uniform(-0.1, 0.1, n - 1))
    force = float(force_scale(chain.mass[0], chain.A[0], 0.31))  # [N] of a first collision

    # dampers and yield points of the contacts; a dashpot's contact has no damper of its own
    contacts = {"dissipation": dissipation}
    if dissipation != "none":
        contacts["gamma"] = DAMPED[dissipation] * rng.uniform(0.3, 1.0, chain.A.size)
        if wall_kind == "dashpot":
            contacts["gamma"][-1] = 0.0
    if law == "thornton":
        contacts["yield_overlap"] = (rng.uniform(0.1, 0.5) * force / chain.A) ** (2 / 3)
    chain = chain._replace(**contacts)

    # leaf springs, stretched and pressed to the wall where the chain can rest so; else slack
    pressed = law == "hertz" and wall_kind in ("rigid", "modes", "compliance")
    if springs is None:
        springs = law == "hertz" and rng.random() < 0.5 and pressed
    if springs:
        chain = chain._replace(leaf_stiffness=rng.uniform(1e3, 2e5, n))
    if springs and pressed:
        chain = chain._replace(leaf_anchor=rng.uniform(0.0, 2e-4, n), preload=0.1 * force)

    if wall_kind == "free":
        return chain, None, v0
    if wall_kind == "rigid":
        return chain, dem.rigid_wall(), v0
    if wall_kind == "one mass":
        hz, mass, zeta = rng.uniform(50.0, 2e3), rng.uniform(0.05, 2.0), rng.uniform(0, 0.1)
        return chain, dem.one_dof_wall(hz, mass, zeta), v0
    if wall_kind == "dashpot":
        return chain, dem.dashpot_wall(10 ** rng.uniform(2.5, 4.0)), v0

    # modes, alone or with a residual compliance about that of the contact, also a negative one
    omega, phi = 2 * np.pi * np.geomspace(100.0, 2e4, 5), rng.uniform(0.2, 1.0, 5)
    wall = dem.Wall(omega, rng.uniform(0.0, 0.05, 5), phi)
    contact_compliance = (force / chain.A[-1]) ** (2 / 3) / force
    residual = rng.choice([-0.1, 1.0]) * contact_compliance * (wall_kind != "modes")
    return chain, wall._replace(residual_compliance=residual), v0
