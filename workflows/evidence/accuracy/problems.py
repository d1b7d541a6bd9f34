"""A scene's chain as a problem that our schemes and general-purpose integrators both take."""

from typing import NamedTuple

import numpy as np

from beadwave import dem
from beadwave.dem.spheres import force_scale
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.stages.chain.chain import initial_velocity
from beadwave.workflows.stages.chain.impact import require_start
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.engine.progress import Progress

SPACING, MASS = 400.0, 4.2  # [Hz], [kg] of the block in the synthetic wall


class Problem(NamedTuple):
    """A chain, its wall, the velocities it starts with, what is observed."""

    chain: dem.Chain
    wall: dem.Wall | None
    v0: np.ndarray  # (n,) [m/s]
    duration: float  # [s]
    observed: np.ndarray  # (n_observed,) indices
    n_save: int


def problem(scene: Scene, progress: Progress) -> Problem:
    """The scene's chain, with 100 saves; raises InvalidScene for what the integrators cannot be
    given."""
    if scene.chain is None:
        raise InvalidScene(f"the scene {scene.name} has no [chain]; add one, or take rig-rigid.")
    if scene.contact.law != "hertz":
        raise InvalidScene(
            f'contact.law = "{scene.contact.law}" depends on the history, which general-purpose '
            'integrators do not support; set contact.law = "hertz" and drop contact.yield_pressure.'
        )
    require_start(scene)
    run = pipeline_of(scene, progress)
    chain, wall = run("start").chain, run("wall")
    if not isinstance(wall, dem.Wall | None):
        raise InvalidScene(
            f"the scene {scene.name} has a wall whose modes its dampers couple, which no scheme of "
            "this study marches; leave out the dashpots of the joints."
        )
    spheres = scene.output.spheres or range(1, scene.chain.count + 1)
    v0, duration = initial_velocity(scene), scene.time.duration
    return Problem(chain, wall, v0, duration, observed=np.array(spheres) - 1, n_save=100)


def pressed(case: Problem) -> Problem:
    """The case between a spring on the first sphere and a rigid wall, hit too softly to open: the
    spring presses as hard as the first collision would, and the velocities are a hundredth."""
    n = case.v0.size
    speed = float(np.abs(case.v0).max())
    peak = force_scale(case.chain.mass[0], case.chain.A[0], speed)
    first = np.eye(n)[0]
    stiffness = 0.01 * peak ** (1 / 3) * case.chain.A[0] ** (2 / 3)
    chain = case.chain._replace(leaf_stiffness=stiffness * first, leaf_anchor=None, preload=0.0)
    A = chain.A if chain.A.size == n else np.append(chain.A, chain.A[-1])
    squeezed = n * (peak / A.min()) ** (2 / 3) + peak / stiffness
    chain = chain._replace(A=A, leaf_anchor=squeezed * first)
    return case._replace(chain=chain, wall=dem.rigid_wall(), v0=0.01 * case.v0, n_save=10)


def lengthened(case: Problem, n: int) -> Problem:
    """The case with n spheres, the middle one repeated."""
    chain, n_old = case.chain, case.v0.size
    if n <= n_old:
        return case
    spheres = np.r_[: n_old // 2, np.full(n - n_old, n_old // 2), n_old // 2 : n_old]
    contacts = spheres[: chain.A.size - n_old] if chain.A.size < n_old else spheres  # a free end
    per_sphere = {
        name: values[spheres]
        for name in ("mass", "radius", "leaf_stiffness", "leaf_anchor")
        if (values := getattr(chain, name)) is not None
    }
    v0 = np.where(np.arange(n) < n_old, np.resize(case.v0, n), 0.0)
    return case._replace(chain=chain._replace(A=chain.A[contacts], **per_sphere), v0=v0)


def modal_wall(wall: dem.Wall | None, count: int) -> dem.Wall:
    """The wall's own modes, continued at equal spacing by those of a free block."""
    wall = dem.rigid_wall() if wall is None else wall
    n_own = min(count, wall.omega.size)
    lowest = wall.omega[n_own - 1] + 2 * np.pi * SPACING if n_own else 2 * np.pi * 50.0
    further = lowest + 2 * np.pi * SPACING * np.arange(count - n_own)
    return wall._replace(
        omega=np.append(wall.omega[:n_own], further),
        zeta=np.append(wall.zeta[:n_own], np.zeros(count - n_own)),
        phi=np.append(wall.phi[:n_own], np.full(count - n_own, np.sqrt(2.0 / MASS))),
    )
