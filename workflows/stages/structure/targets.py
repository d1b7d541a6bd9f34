"""Recognition of the measured modes of a scene among the computed ones: by number, by a body's
motion, or by a measured shape."""

from pathlib import Path

import numpy as np
from scipy.sparse import csr_matrix

from beadwave import fem
from beadwave.fem.identification.measured_shapes import MeasuredShape, RigidFit, rigid_fit
from beadwave.workflows.files.measured_shape import measured_shape
from beadwave.workflows.scene import InvalidScene, Scene

# distance of a measured point from the assembly's surface, over the assembly's size, beyond which
# axes or units are taken to be wrong; chosen, not varied
FARTHEST = 0.05


def targets(scene: Scene, model: fem.Model) -> tuple[fem.Target, ...]:
    """Targets that each measured mode of the scene is recognised by; raises InvalidScene for
    measured shapes with points off the assembly."""
    recognised: list[fem.Target] = []
    for target in scene.targets or ():
        if target.number:
            recognised.append(fem.Number(target.number))
        elif target.shape:
            recognised.append(shape(scene, model, target.shape, target.hz))
        else:
            recognised.append(fem.BodyMotion(target.body, target.motion))
    return tuple(recognised)


def shape(scene: Scene, model: fem.Model, file: str | Path, hz: float) -> fem.Shape:
    """The measured shape at a frequency; raises InvalidScene for points off the assembly."""
    return placed(scene, model, f"shape = {str(file)!r}", measured_shape(Path(file), hz), hz)


def axes_of_test(scene: Scene) -> RigidFit | None:
    """The turn and shift of a test's points onto the assembly; None of a test in its axes."""
    table = scene.test_axes
    return None if table is None else rigid_fit(np.array(table.points), np.array(table.at))


def remarks_on_axes(scene: Scene) -> list[str]:
    """A sentence on how well [test_axes] bring the points of a test onto the assembly."""
    axes = axes_of_test(scene)
    if axes is None:
        return []
    cosine = np.clip((np.trace(axes.turn) - 1) / 2, -1, 1)
    return [
        f"The points of the test are turned by {np.degrees(np.arccos(cosine)):.3g} degrees and "
        f"shifted; {len(axes.misfit)} points of [test_axes] miss their places by up to "
        f"{1e3 * axes.misfit.max():.2g} mm, root mean square "
        f"{1e3 * np.sqrt(np.mean(axes.misfit**2)):.2g} mm."
    ]


def placed(
    scene: Scene, model: fem.Model, source: str, measured: MeasuredShape, hz: float
) -> fem.Shape:
    """A shape at a frequency on the model, where [test_axes] bring it; raises InvalidScene for
    points off the assembly, with the key or the file that they are from, `source`."""
    # a test in axes of its own is turned and shifted by a fit of a few points, which must be near
    # their places: a fit alone would turn even left-handed axes onto something
    structure = model.structure
    size = float(np.linalg.norm(np.ptp(structure.points, axis=0)))
    axes = axes_of_test(scene)
    if axes is not None:
        worst = int(axes.misfit.argmax())
        if axes.misfit[worst] > FARTHEST * size:
            fits = axes.mirrored <= FARTHEST * size
            remedy = "change the sign of one axis: the test's are left-handed"
            raise InvalidScene(
                f"{scene.name}: test_axes: no turn and shift bring point {worst + 1} nearer than "
                f"{axes.misfit[worst]:.3g} m to its place, allowed are {FARTHEST * size:.3g} m; "
                f"{remedy if fits else 'check the order of the points and their unit'}."
            )
        measured = axes.moved(measured)

    # every point on the surface: P (3 m, dofs) interpolates the motion of the m nearest points
    surface = fem.on_surface(structure, measured.points)
    worst = int(surface.distance.argmax())
    if surface.distance[worst] > FARTHEST * size:
        at = np.round(measured.points[worst], 6).tolist()
        remedy = (
            "give points in the assembly's axes, or [test_axes] that say how they lie on it, in "
            "metres or with their unit in data set 164"
        )
        # in mm they would lie on it, and not all in one place of it
        in_mm = 1e-3 * measured.points
        reach = float(np.linalg.norm(np.ptp(in_mm, axis=0)))
        if (
            axes is None
            and reach > FARTHEST * size
            and fem.on_surface(structure, in_mm).distance.max() <= FARTHEST * size
        ):
            remedy = (
                "they lie on it if they are in mm: write node, x [mm], y [mm], z [mm] as the "
                "header of a CSV, or their unit in data set 164"
            )
        raise InvalidScene(
            f"{scene.name}: {source} has a point at {at} m, {surface.distance[worst]:.3g} m from "
            f"the assembly, allowed are {FARTHEST * size:.3g} m; {remedy}."
        )

    # the shape's functionals: the motion of each point along its measured direction
    n = len(measured.points)
    along = csr_matrix((measured.directions.ravel(), np.arange(3 * n), np.arange(0, 3 * n + 1, 3)))
    return fem.Shape(along @ surface.P @ model.T, measured.values, hz)
