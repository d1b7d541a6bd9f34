"""The errors of a run's numbers before a structure, by cause.

Each cause is a pair of walls: the reduced and the finer model, and the structure on its mesh and
without what the mesh misses. The chain is marched before both.
"""

import numpy as np

from beadwave import coupling, dem, rom
from beadwave.dem.waves.chain_waves import ChainWaves
from beadwave.workflows.report.summary import QuantityErrors
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.chain.chain import Start
from beadwave.workflows.stages.chain.walls import wall_of
from beadwave.workflows.stages.errors.mesh import MeshErrorEstimate
from beadwave.workflows.stages.errors.numbers import MarchedPair, instants, numbers_with_errors
from beadwave.workflows.stages.errors.waves import MARGIN, SHORTER, observed, velocities


def quantity_errors(
    scene: Scene,
    start: Start,
    missed: MeshErrorEstimate,
    reduction: rom.ReducedModel,
    impact: coupling.Impact,
    waves: ChainWaves,
) -> QuantityErrors:
    """Changes of every number of the waves between two walls: of the reduced and of the finer
    model, and of the mesh and without the energy that the mesh misses."""
    on_mesh, without = (
        marched(scene, start, wall, impact) for wall in missed.walls(reduction.contact)
    )
    pairs = {
        "reduction": (of_reduction(scene, start, reduction, impact),),
        "mesh": (MarchedPair(on_mesh, without, missed.share),),
    }
    run, speed = impact.trajectory, float(np.abs(start.velocity).max())
    n, columns = instants(scene, run), observed(scene)
    of_mesh = missed.share * float(np.abs((without.v - on_mesh.v)[:n, columns]).max()) / speed
    numbers = numbers_with_errors(scene, start, impact, waves, pairs)
    explained = tuple(
        number.model_copy(update={"why": missed.at_contact(scene, number.mesh / abs(number.value))})
        if number.mesh and number.value
        else number
        for number in numbers
    )
    return QuantityErrors(explained, of_mesh)


def marched(
    scene: Scene,
    start: Start,
    reduced: rom.ReducedModel,
    impact: coupling.Impact,
    shorter: int = 1,
) -> dem.Trajectory:
    """The impact before another wall, at its instants, by steps so many times as short."""
    run = impact.trajectory
    return dem.march(
        start.chain, wall_of(scene.but(wall={"cutoff": None}), reduced), start.velocity,
        dt=run.dt / shorter, duration=float(run.t[-1]), n_save=len(run.t) - 1,
    )  # fmt: skip


def of_reduction(
    scene: Scene, start: Start, reduction: rom.ReducedModel, impact: coupling.Impact
) -> MarchedPair:
    """The run, and the same before the finer model."""
    finer = marched(scene, start, reduction.finer, impact, SHORTER)
    return MarchedPair(impact.trajectory, finer, MARGIN)


def velocity_error_of_mesh(
    scene: Scene,
    start: Start,
    missed: MeshErrorEstimate,
    contact: rom.Contact,
    impact: coupling.Impact,
) -> float:
    """Error of the mesh in the observed velocities up to the horizon, relative to the striker's
    speed; raises ValueError if nothing is known."""
    whole = scene.but(wall={"cutoff": None})
    on_mesh, without = (
        velocities(scene, start, wall_of(whole, wall), impact) for wall in missed.walls(contact)
    )
    return missed.share * float(np.abs(without - on_mesh).max() / np.abs(start.velocity).max())


def error_of_mesh(scene: Scene, errors: QuantityErrors) -> float:
    """The mesh's error of all observed velocities, relative to the striker's speed."""
    return errors.mesh
