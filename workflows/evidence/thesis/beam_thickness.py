"""A chain against beams of one thickness after the other."""

from workflows.evidence.prose import rendered
from workflows.evidence.thesis import bent
from workflows.evidence.thesis.structures import FACTORS, compared
from workflows.report.finding import Finding
from workflows.scene import InvalidScene, Scene
from workflows.stages.pipeline import Progress

SCENE = "beam"


def beam_thickness(scene: Scene, progress: Progress) -> Finding:
    """Time of flight and amplitude ratio over the thickness of a beam."""
    bent.require(scene, "beam")
    if scene.beam.thickness is None:
        raise InvalidScene(
            f"the scene {scene.name} has a beam without beam.thickness; give width and thickness."
        )
    values = FACTORS * scene.beam.thickness
    scenes = [scene.but(beam={"thickness": value}) for value in values]
    found = compared("beam-thickness", "thickness", scenes, values, progress)
    return Finding((found.table,), rendered(__file__, **found.numbers), (found.picture,))
