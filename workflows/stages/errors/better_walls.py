"""Errors of a run by cause: the chain is marched again before better walls, the difference counts.

    e = sum_i share_i max |v(better_i) - v(poorer_i)| / v_0

cause        better                                         than
reduction    the finer model that the reduction carries     the run
mesh         bodies without the energy that the mesh misses bodies on the mesh
             beams and plates on shorter elements           the run
theory       other theories of bending                      the run
receptance   a measured wall, or measured parts, by other   the run, or the structure with the fits
             fits of the responses                          of the run

Velocities count up to the scene's horizon, beyond which spheres move chaotically and any two runs
part.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave import coupling, dem, rom
from beadwave.coupling.measured_wall import measured_wall
from beadwave.coupling.modes_at_amplitude import SettledRun
from beadwave.dem.waves.chain_waves import ChainWaves
from beadwave.workflows.files.receptance_file import fitted
from beadwave.workflows.report.summary import NumberError
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.chain.chain import Start
from beadwave.workflows.stages.chain.walls import wall_of
from beadwave.workflows.stages.errors.mesh_error import MeshErrorEstimate
from beadwave.workflows.stages.errors.number_errors import (
    Comparison,
    MarchedPair,
    instants,
    number_errors,
)
from beadwave.workflows.stages.errors.part_fit_errors import other_fits
from beadwave.workflows.stages.errors.second_mesh import wall_model
from beadwave.workflows.stages.structure import assembly
from beadwave.workflows.stages.structure.meshed_parts import Parts
from beadwave.workflows.stages.structure.reduction import SecondModel

MARGIN = 1.25  # of a difference, for what the finer model itself misses
SHORTER = 8  # times the step for the finer model, whose highest modes move faster than any kept


class BetterWall(NamedTuple):
    """A wall that is better in one respect, and how much of a difference to it is an error."""

    wall: dem.Wall
    share: float
    poorer: dem.Wall | None = None  # that it is compared with; None is the wall of the run
    shorter: int = 1  # the step of the run over that before this wall


class BetterWalls(NamedTuple):
    """The walls that show the error of one cause."""

    cause: str
    walls: tuple[BetterWall, ...]


def of_reduction(
    scene: Scene,
    reduction: rom.ReducedModel,
    amplitudes: SettledRun | None = None,
) -> BetterWalls:
    """The finer model, up to any frequency, with the modes of the run's amplitudes."""
    finer = wall_of(scene.but(wall={"cutoff": None}), reduction.finer, amplitudes)
    return BetterWalls("reduction", (BetterWall(finer, MARGIN, shorter=SHORTER),))


def of_missed_energy(
    scene: Scene, missed: MeshErrorEstimate, reduction: rom.ReducedModel
) -> BetterWalls:
    """Bodies without what their mesh misses; raises ValueError where that is not known."""
    whole = scene.but(wall={"cutoff": None})
    on_mesh, without = (wall_of(whole, wall) for wall in missed.walls(reduction.contact))
    return BetterWalls("mesh", (BetterWall(without, missed.share, on_mesh),))


def of_second_mesh(scene: Scene, second: SecondModel) -> BetterWalls:
    """A beam or a plate on shorter elements."""
    return BetterWalls("mesh", (BetterWall(wall_of(scene, second.reduced), second.left),))


def of_other_theories(scene: Scene, others: tuple[SecondModel, ...]) -> BetterWalls:
    """A beam or a plate by other theories."""
    walls = tuple(BetterWall(wall_of(scene, other.reduced), other.left) for other in others)
    return BetterWalls("theory", walls)


def of_receptance(scene: Scene) -> BetterWalls:
    """Walls fitted to a measured response with its residuals at random phases, of which twice the
    mean change is an error, and one fitted to the lower part of the band."""
    fits = fitted(scene.wall)
    others = [(fit, 2 / len(fits.by_noise)) for fit in fits.by_noise] + [(fits.by_band, 1.0)]
    walls = tuple(
        BetterWall(measured_wall(fit, half_space=fits.half_space), share) for fit, share in others
    )
    return BetterWalls("receptance", walls)


def of_measured_parts(scene: Scene, mesh: Parts) -> BetterWalls:
    """The structure with other fits of its measured parts, all without the damping of the parts."""

    def wall(fits: dict[str, rom.ModalFit] | None) -> dem.Wall:
        """The assembly with these fits, None for those of the run."""
        joined = assembly.model(scene, mesh, fits)
        contact = assembly.contact(scene, mesh, joined)
        return wall_of(scene, wall_model(scene, joined, contact))

    as_fitted = wall(None)
    walls = tuple(BetterWall(wall(one.fits), one.share, as_fitted) for one in other_fits(scene))
    return BetterWalls("receptance", walls)


def marched(scene: Scene, start: Start, impact: coupling.Impact, better: BetterWalls) -> Comparison:
    """The impact before the better walls and before those that they are compared with."""
    run = impact.trajectory
    marches = {id(None): run}
    for one in better.walls:
        for wall, shorter in ((one.poorer, 1), (one.wall, one.shorter)):
            if id(wall) not in marches:
                marches[id(wall)] = march_before(wall, start, run, shorter=shorter)
    pairs = tuple(
        MarchedPair(marches[id(one.poorer)], marches[id(one.wall)], one.share)
        for one in better.walls
    )
    return Comparison(better.cause, pairs)


def march_before(
    wall: dem.Wall, start: Start, run: dem.Trajectory, *, shorter: int = 1
) -> dem.Trajectory:
    """The chain before another wall, at the instants of a run, by steps so many times as short."""
    return dem.march(
        start.chain, wall, start.velocity,
        dt=run.dt / shorter, duration=float(run.t[-1]), n_save=len(run.t) - 1,
    )  # fmt: skip


def observed_velocities(scene: Scene, run: dem.Trajectory) -> NDArray[np.float64]:
    """(k, m) [m/s] of the spheres that the scene observes, all without any, up to the horizon."""
    columns = [sphere - 1 for sphere in scene.output.spheres] or slice(None)
    return run.v[: instants(scene, run), columns]


def velocity_error(scene: Scene, start: Start, comparison: Comparison) -> float:
    """Error of the observed velocities up to the horizon over the largest initial speed."""
    error = 0.0
    for pair in comparison.pairs:
        first, second = (observed_velocities(scene, run) for run in (pair.first, pair.second))
        error += pair.share * float(np.abs(second - first).max())
    return error / float(np.abs(start.velocity).max())


def explained_number_errors(
    scene: Scene,
    start: Start,
    impact: coupling.Impact,
    waves: ChainWaves,
    missed: MeshErrorEstimate,
    *comparisons: Comparison,
) -> tuple[NumberError, ...]:
    """`number_errors`, with what makes those of the mesh of bodies large."""
    return tuple(
        number.model_copy(update={"why": missed.at_contact(scene, number.mesh / abs(number.value))})
        if number.mesh and number.value
        else number
        for number in number_errors(scene, start, impact, waves, *comparisons)
    )
