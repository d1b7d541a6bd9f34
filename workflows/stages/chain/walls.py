"""The wall of a scene, by its kind, as the march takes it.

A wall of a few numbers is made by its constructor in `dem.walls`, a reduced model (of the scene's
structure, or of `wall.file`) by `coupling.reduced_wall`. A kind of wall has its table in
`workflows.scene.tables.walls` and its case in `simple_wall`; CONTRIBUTING.md has every step.
"""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from beadwave import coupling, dem
from beadwave.workflows.scene import (
    Damping,
    DashpotWall,
    HalfSpaceWall,
    InvalidScene,
    MeasuredWall,
    OneDofWall,
    RigidWall,
    RomWall,
    Scene,
)
from beadwave.workflows.stages.chain.damping import damping

if TYPE_CHECKING:
    from beadwave import rom  # simple walls do without it and without what it loads
    from beadwave.coupling.modes_at_amplitude import SettledRun


def wall_of(
    scene: Scene,
    reduction: "rom.ReducedModel | None" = None,
    amplitudes: "SettledRun | None" = None,
) -> dem.Wall | coupling.CoupledWall | None:
    """The wall as the march takes it; None for a free chain.

    With wall.kind = "rom" it is that of the `reduction`, or of `wall.file` where that is None, with
    the scene's damping and its modes up to the scene's cutoff [Hz], some of them as they are at the
    amplitudes of the run. Raises InvalidScene for a file
    that is no wall, coupling.CouplingError for a badly conditioned model.
    """
    if not isinstance(scene.wall, RomWall):
        return simple_wall(scene)
    from beadwave.coupling import reduced_wall
    from beadwave.workflows.files.wall_file import measured

    reduced, modes = reduction, None
    if reduction is None:
        reduced, health = measured(scene.wall)
        modes = health.modes
    law, cutoff = damping(scene.damping, reduced), scene.wall.cutoff
    wall = reduced_wall.wall_of(reduced, damping=law, cutoff_hz=cutoff, modes=modes)
    require_support(scene, wall)
    if amplitudes is None:
        return wall
    from beadwave.coupling.modes_at_amplitude import moved

    return moved(wall, amplitudes.largest)


def require_support(scene: Scene, wall: dem.Wall | coupling.CoupledWall) -> None:
    """Raise InvalidScene where a steady force presses a structure that its springs leave free along
    the strike; wall arrays may have a row for each point struck."""
    moving = wall.force if isinstance(wall, coupling.CoupledWall) else wall.phi
    drifts = np.any((wall.omega == 0.0) & (moving != 0.0))
    if drifts and (sentence := pressed_off_its_springs(scene)):
        raise InvalidScene(sentence)


def pressed_off_its_springs(scene: Scene) -> str:
    """A sentence on the steady force that presses a structure on springs, and what would hold it;
    "" without springs, without such a force, and where leaf springs that start bent may hold it
    off."""
    if not scene.springs or (scene.leaf_springs and np.any(scene.leaf_springs.offset)):
        return ""
    pressing = {
        "preload.force": (scene.preload.force if scene.preload else 0.0, "N"),
        "gravity.inclination": (
            scene.gravity.inclination if scene.gravity and scene.gravity.along > 0 else 0.0, "deg"
        ),
    }  # fmt: skip
    for key, (value, unit) in pressing.items():
        if np.max(value) > 0:
            names = ", ".join(f"springs.{spring.name}" for spring in scene.springs)
            return (
                f"{scene.name}: {key} = {np.max(value):g} {unit} presses the structure along the "
                f"strike, where it moves freely on {names}; give a spring a stiffness in that "
                f"direction (kx, ky or kz), hold a face, or set {key} to 0."
            )
    return ""


def simple_wall(scene: Scene) -> dem.Wall | None:
    """A wall of the scene's numbers or of a measured response, without a reduced model; None for a
    free chain. Raises InvalidScene for a response that is no wall."""
    match scene.wall:
        case None:
            return None
        case OneDofWall(frequency=frequency, mass=mass, damping_ratio=ratio):
            return dem.one_dof_wall(frequency, mass, ratio)
        case DashpotWall(coefficient=None, plate_thickness=thickness, density=density):
            return dem.plate_wall(scene.wall.young, scene.wall.poisson, density, thickness)
        case DashpotWall(coefficient=coefficient):
            return dem.dashpot_wall(coefficient)
        case MeasuredWall():
            # fits are read by scenes with such a wall alone
            from beadwave.coupling.measured_wall import measured_wall
            from beadwave.workflows.files.receptance_file import fitted

            response = fitted(scene.wall)
            return measured_wall(response.fit, half_space=response.half_space)
        case RigidWall() | HalfSpaceWall():
            return dem.rigid_wall()
    raise NotImplementedError(f"no wall is made of wall.kind = {scene.wall.kind!r} here")


def save(path: Path, reduced: "rom.ReducedModel", table: Damping) -> None:
    """Write a reduced model as .npz, .mat or .h5, by the ending, with the matrix of the scene's
    damping."""
    from beadwave import rom
    from beadwave.coupling import reduced_wall

    write = {".npz": rom.save_npz, ".mat": rom.save_mat, ".h5": rom.save_h5}[path.suffix]
    write(path, reduced, C_damping=reduced_wall.damping_matrix(reduced, damping(table, reduced)))
