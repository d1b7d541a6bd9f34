"""What a reduction costs beside an eigen-solve, and a march with its modes beside a rigid wall's.

Seconds are those of the processor, the least of some repeats taken in turns: a machine that has
other work to do spoils them least so. BLAS runs on one thread.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import coupling
import dem
import fem
import rom
from coupling.reduced_wall import wall_from_reduced
from fem.assembly_modes import AssemblyModes
from fem.shared_solutions import SharedSolutions
from workflows.evidence.accuracy.runs import least_seconds
from workflows.scene import Scene
from workflows.stages.chain import chain, initial_velocity
from workflows.stages.damping import damping
from workflows.stages.reduction import selection, targets_kept

ERROR = 1e-4  # of the reduction, and of the marches that are compared


class FullModel(NamedTuple):
    """The full model as the reductions need it."""

    K: object
    M: object
    w: NDArray[np.float64]
    contact: rom.Contact
    shared: SharedSolutions


def reduced_by(
    full: FullModel, kind: str, selection: rom.Selection, factorise: rom.Factorise
) -> rom.ReducedModel:
    """The full model reduced by "free-modes" or "craig-bampton", without its T."""
    if kind == "free-modes":
        reduced = rom.free_modes(full.K, full.M, full.w, selection, factorise=factorise)
    else:
        boundary = np.flatnonzero(full.w)
        reduced = rom.craig_bampton(
            full.K, full.M, full.w, boundary, selection, factorise=factorise
        )  # fmt: skip
    return reduced._replace(T=None, contact=full.contact)


def wall_of(scene: Scene, reduced: rom.ReducedModel, without: float | None = None) -> dem.Wall:
    """The wall less the compliance `without` [m/N], that of the half-space if None: Hertz' law
    holds it already."""
    local = reduced.contact.half_space if without is None else without
    return wall_from_reduced(reduced, half_space=local, damping=damping(scene.damping, reduced))


def marched(scene: Scene, wall: dem.Wall, finer: float) -> dem.Trajectory:
    """The scene's chain against the wall, to its error times `finer`."""
    observed = [sphere - 1 for sphere in scene.output.spheres] or None
    return coupling.impact(
        chain(scene),
        wall,
        initial_velocity(scene),
        duration=scene.time.duration,
        error=finer * (scene.time.error or ERROR),
        observed=observed,
        n_save=scene.output.samples - 1,
    ).trajectory


class SolveCost(NamedTuple):
    """Seconds of a factorisation, of the eigen-solve of n_modes and of the scene's reduction."""

    n_modes: int
    factor: float
    solve: float
    reduce: float


class MarchCost(NamedTuple):
    """A march to ERROR before a wall of so many oscillators, and that before a rigid one."""

    wall: str
    n_oscillators: int
    seconds: float
    rigid: float


class Costs(NamedTuple):
    """What the scene's reduction costs, and marches with reduced walls."""

    solve: SolveCost
    marches: tuple[MarchCost, ...]


def costs_of(
    scene: Scene,
    full: FullModel,
    modes: AssemblyModes,
    largest: dict[str, rom.ReducedModel],
    to_hz: float,
) -> Costs:
    """The scene's reduction against the eigen-solve; marches with the `largest` models, and with
    the modes that an error up to to_hz [Hz] keeps, against a rigid wall."""
    to_error = rom.Selection(error=ERROR, choice="contact", to_hz=to_hz)
    models = largest | {
        f"the modes of reduction.error = {ERROR:g}": reduced_by(
            full, "free-modes", to_error, full.shared
        )
    }

    # each solution with a factorisation of its own
    n_modes = scene.reduction.modes or 40
    of_scene = selection(scene)
    if of_scene.by_contact:
        of_scene = of_scene._replace(modes=targets_kept(modes))
    solutions = (
        lambda: fem.factorised(full.K),
        lambda: fem.modes(full.K, full.M, n_modes),
        lambda: reduced_by(full, scene.reduction.kind, of_scene, fem.factorised),
    )
    solve = SolveCost(n_modes, *least_seconds(solutions, repeats=2))

    march_scene = scene.but(time={"error": ERROR})
    walls = {name: wall_of(march_scene, model) for name, model in models.items()}
    rigid, *seconds = least_seconds(
        tuple(
            lambda wall=wall: marched(march_scene, wall, 1.0)
            for wall in (dem.rigid_wall(), *walls.values())
        ),
        repeats=15,
    )
    marches = tuple(
        MarchCost(name, len(wall.omega), march, rigid)
        for (name, wall), march in zip(walls.items(), seconds, strict=True)
    )
    return Costs(solve, marches)
