"""A chain against plates of one thickness after the other."""

from beadwave.workflows.evidence.thesis import bent
from beadwave.workflows.evidence.thesis.bent import StructuresOptions, compared
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.progress import Progress

SCENE = "plate"


def plate_thickness(
    scene: Scene, progress: Progress, options: StructuresOptions = StructuresOptions()
) -> Finding:
    """Time of flight and amplitude ratio over the thickness of a plate."""
    bent.require(scene, "plate")
    values = options.factors * scene.plate.thickness
    scenes = [scene.but(plate={"thickness": value}) for value in values]
    return compared(__file__, "thickness", scenes, values, progress, options)
