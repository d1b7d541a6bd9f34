"""The scene's chain as a problem that our schemes and general-purpose integrators both take."""

import numpy as np

import dem
from workflows.evidence.accuracy.peers import Problem
from workflows.scene import InvalidScene, Scene
from workflows.stages.chain import initial_velocity
from workflows.stages.impact import require_start
from workflows.stages.pipeline import pipeline_of
from workflows.stages.progress import Progress


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
