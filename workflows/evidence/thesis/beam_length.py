"""A chain against beams of one length after the other."""

from beadwave.workflows.evidence.thesis import bent
from beadwave.workflows.evidence.thesis.bent import StructuresOptions, compared
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.progress import Progress

SCENE = "beam"


def beam_length(
    scene: Scene, progress: Progress, options: StructuresOptions = StructuresOptions()
) -> Finding:
    """Time of flight and amplitude ratio over the length of a beam, struck at the same share."""
    bent.require(scene, "beam")
    share = scene.beam.position / scene.beam.length
    lengths = options.factors * scene.beam.length
    lengths = lengths[lengths > 2 * (scene.beam.thickness or 0.0)]  # shorter is no beam
    scenes = [scene.but(beam={"length": x, "position": share * x}) for x in lengths]
    return compared(__file__, "length", scenes, lengths, progress, options)
