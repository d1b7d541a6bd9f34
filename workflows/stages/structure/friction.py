"""A chain that meets a structure with friction, as stages: wall, march, and their parts.

The structure turns a push along its normal into motion across, so that chain, last sphere and
structure march together; what the other stages read of a run, along the chain and across it, are
parts of that march.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from beadwave import coupling, dem
from beadwave.coupling.errors import CouplingError
from beadwave.coupling.reduced_spatial_wall import spatial_wall_of, with_stingers
from beadwave.coupling.shaken_march import march_shaken
from beadwave.coupling.spatial_march import (
    USUAL_SPATIAL_SEARCH,
    SpatialRun,
    SpatialSearch,
    body_of,
    march_space,
)
from beadwave.coupling.spatial_wall import SpatialWall
from beadwave.coupling.structure_sensors import sensed_in_march
from beadwave.dem.lateral import LateralTrajectory
from beadwave.dem.prepared import prepare
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.stages.chain import sensor_signals as signals
from beadwave.workflows.stages.chain.chain import Start
from beadwave.workflows.stages.chain.damping import damping
from beadwave.workflows.stages.chain.friction import last_sphere, shaker_forces
from beadwave.workflows.stages.chain.walls import pressed_off_its_springs

if TYPE_CHECKING:
    from beadwave.coupling.sensors import SensorRecord
    from beadwave.dem.waves.chain_waves import ChainWaves
    from beadwave.rom import ReducedModel


def spatial_wall(scene: Scene, reduction: ReducedModel | None = None) -> SpatialWall:
    """The structure along n, t1 and t2, of the scene's assembly or of wall.file.

    Raises InvalidScene for a file along the normal alone or without a shaker that the scene names.
    """
    reduced = reduction
    if reduced is None:
        from beadwave.workflows.files.wall_file import loaded

        reduced = _shaken_by_name(scene, loaded(scene.wall))
    shakers = scene.shakers or ()
    if any(shaker.stinger for shaker in shakers):
        stiffness = np.array([shaker.stinger or 0.0 for shaker in shakers])
        reduced = with_stingers(reduced, stiffness)
    law = damping(scene.damping, reduced)
    try:
        return spatial_wall_of(reduced, damping=law, cutoff_hz=scene.wall.cutoff)
    except CouplingError as error:
        raise InvalidScene(f"{scene.name}: [friction]: {str(error).rstrip('.')}.") from None


def _shaken_by_name(scene: Scene, reduced: ReducedModel) -> ReducedModel:
    """The model of a file with the shakers that the scene names, in the scene's order."""
    columns, names = reduced.columns, [shaker.name for shaker in scene.shakers or ()]
    if columns is None or not names:
        return reduced
    for name in names:
        if name not in columns.load_names:
            there = ", ".join(columns.load_names) or "none"
            raise InvalidScene(
                f"{scene.name}: shakers.{name} is no shaker of wall.file, which has {there}; name "
                "one of these, or add its column to w_load."
            )
    order = [columns.load_names.index(name) for name in names]
    columns = columns._replace(load=columns.load[:, order], load_names=tuple(names))
    return reduced._replace(columns=columns)


def wall_along(scene: Scene, wall: SpatialWall) -> dem.Wall:
    """The structure along its normal, as a wall of the chain."""
    residual = float(wall.residual_compliance[0, 0])
    return dem.Wall(wall.omega, wall.zeta, np.ascontiguousarray(wall.phi[:, 0]), residual)


def march(scene: Scene, start: Start, wall: SpatialWall) -> SpatialRun:
    """The march of chain, last sphere and structure, to the scene's error or at its step; with
    shakers from their periodic state on."""
    if start.ellipse != coupling.PLANE:
        raise InvalidScene(
            f"{scene.name}: [friction] on a curved face, whose contact is an ellipse of which no "
            "tangential law is known; strike a plane face, or drop [friction]."
        )
    time = scene.time
    run = {"duration": time.duration, "n_save": scene.output.samples - 1, "error": time.error}
    if time.dt is not None:
        run |= {"error": None, "search": SpatialSearch(dt=time.dt)}
    last = last_sphere(scene, start)
    try:
        if not scene.shakers:
            return march_space(start.chain, wall, start.velocity, last, **run)
        search = run.pop("search", USUAL_SPATIAL_SEARCH)
        shakers = shaker_forces(scene)
        body = body_of(start.chain, wall, start.velocity, last, shakers, search)
        held = scene.friction.upstream == "held"
        return march_shaken(body, start.velocity, upstream_held=held, **run).run
    except (dem.InvalidChain, dem.NoEquilibrium) as error:
        of_springs = isinstance(error, dem.NoEquilibrium) and pressed_off_its_springs(scene)
        raise InvalidScene(of_springs or f"{scene.name}: {str(error).rstrip('.')}.") from None


def impact(scene: Scene, start: Start, wall: dem.Wall, march: SpatialRun) -> coupling.Impact:
    """The part along the chain, with the verdict on chain and wall."""
    verdict = coupling.verdict(start.chain, wall, start.velocity)
    return coupling.Impact(march.trajectory, verdict, None, coupling.EnergyGain(0.0, 0.0, 0.0))


def across(scene: Scene, march: SpatialRun) -> LateralTrajectory:
    """The part across the chain."""
    return march.lateral


def record(
    scene: Scene,
    start: Start,
    wall: SpatialWall,
    march: SpatialRun,
    impact: coupling.Impact,
    waves: ChainWaves,
) -> SensorRecord:
    """`signals.record` of a scene with sensors on the structure, by its modes in the march."""
    run, shakers = march.trajectory, shaker_forces(scene)
    # the modes count from the state of rest, and so do the forces
    at_rest = prepare(start.chain, wall_along(scene, wall)).static.force[-1]
    force = np.column_stack([run.contact_force[:, -1] - at_rest, march.lateral.friction_force])
    angle = 2 * np.pi * np.outer(run.t, shakers.frequency) + shakers.phase
    structure = sensed_in_march(
        wall, march.wall_q, march.wall_p, force, shakers.force * np.cos(angle)
    )
    return signals.record(scene, impact, waves, structure=structure)
