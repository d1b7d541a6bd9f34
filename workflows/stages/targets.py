"""How the measured modes of a scene are recognised among the computed ones: by number, by a body's
motion, or by a measured shape."""

from pathlib import Path

import numpy as np
from scipy.sparse import csr_matrix

import fem
from fem.measured_shapes import MeasuredShape
from workflows.files.shapes import measured_shape
from workflows.scene import InvalidScene, Scene

# distance of a measured point from the assembly's surface, over the assembly's size, beyond which
# axes or units are taken to be wrong; chosen, not varied
FARTHEST = 0.05


def targets(scene: Scene, model: fem.Model) -> tuple[fem.Target, ...]:
    """What each measured mode of the scene is recognised by; raises InvalidScene for measured
    shapes with points off the assembly."""
    recognised: list[fem.Target] = []
    for target in scene.written_out.targets or ():
        if target.number:
            recognised.append(fem.Number(target.number))
        elif target.shape:
            recognised.append(shape(scene, model, target.shape, target.hz))
        else:
            recognised.append(fem.BodyMotion(target.body, target.motion))
    return tuple(recognised)


def shape(scene: Scene, model: fem.Model, file: str | Path, hz: float) -> fem.Shape:
    """The measured shape at a frequency; raises InvalidScene for points off the assembly."""
    return placed(scene, model, file, measured_shape(Path(file), hz), hz)


def placed(
    scene: Scene, model: fem.Model, file: str | Path, measured: MeasuredShape, hz: float
) -> fem.Shape:
    """A shape of a file, at a frequency, on the model; raises InvalidScene for points off the
    assembly."""
    structure = model.structure
    surface = fem.on_surface(structure, measured.points)
    size = float(np.linalg.norm(np.ptp(structure.points, axis=0)))
    worst = int(surface.distance.argmax())
    if surface.distance[worst] > FARTHEST * size:
        at = np.round(measured.points[worst], 6).tolist()
        raise InvalidScene(
            f"{scene.name}: shape = {str(file)!r} has a point at {at} m, "
            f"{surface.distance[worst]:.3g} m from the assembly, allowed are "
            f"{FARTHEST * size:.3g} m; give points in the assembly's axes, in metres or with their "
            "unit in data set 164."
        )
    n = len(measured.points)
    along = csr_matrix((measured.directions.ravel(), np.arange(3 * n), np.arange(0, 3 * n + 1, 3)))
    return fem.Shape(along @ surface.P @ model.T, measured.values, hz)
