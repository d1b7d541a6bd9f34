"""A chain against beams of one length after the other."""

from workflows.evidence.prose import rendered
from workflows.evidence.thesis import bent
from workflows.evidence.thesis.structures import FACTORS, compared
from workflows.report.finding import Finding
from workflows.scene import Scene
from workflows.stages.pipeline import Progress

SCENE = "beam"


def beam_length(scene: Scene, progress: Progress) -> Finding:
    """Time of flight and amplitude ratio over the length of a beam, struck at the same share."""
    bent.require(scene, "beam")
    share = scene.beam.position / scene.beam.length
    lengths = FACTORS[FACTORS * scene.beam.length > 2 * (scene.beam.thickness or 0.0)]
    lengths = lengths * scene.beam.length
    scenes = [scene.but(beam={"length": x, "position": share * x}) for x in lengths]
    found = compared("beam-length", "length", scenes, lengths, progress)
    return Finding((found.table,), rendered(__file__, **found.numbers), (found.picture,))
