"""A chain against beams of one thickness after the other."""

from beadwave.workflows.evidence.thesis import bent
from beadwave.workflows.evidence.thesis.bent import StructuresOptions, compared
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.stages.progress import Progress

SCENE = "beam"


def beam_thickness(
    scene: Scene, progress: Progress, options: StructuresOptions = StructuresOptions()
) -> Finding:
    """Time of flight and amplitude ratio over the thickness of a beam."""
    bent.require(scene, "beam")
    if scene.beam.thickness is None:
        raise InvalidScene(
            f"the scene {scene.name} has a beam without beam.thickness; give width and thickness."
        )
    values = options.factors * scene.beam.thickness
    scenes = [scene.but(beam={"thickness": value}) for value in values]
    return compared(__file__, "thickness", scenes, values, progress, options)
