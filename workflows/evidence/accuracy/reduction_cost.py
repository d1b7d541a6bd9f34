"""What a reduction costs beside an eigen-solve, and a march with its modes beside a rigid wall's.

Seconds are those of the processor, the least of some repeats taken in turns: a machine that has
other work to do spoils them least so. BLAS runs on one thread.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import coupling
import dem
import fem
import rom
from coupling.wall import wall_from_reduced
from fem.assembly_modes import AssemblyModes
from fem.shared_solutions import SharedSolutions
from workflows.evidence.accuracy.runs import least_seconds
from workflows.scene import Scene
from workflows.stages.chain import chain, initial_velocity
from workflows.stages.reduction import selection, targets_kept
from workflows.stages.wall import damping

KIND = "free-modes"
ERROR = 1e-4  # of the reduction, and of the marches that are compared
REPEATS = 15


class Contact(NamedTuple):
    """The full model as the reductions need it."""

    K: object
    M: object
    w: NDArray[np.float64]
    known: rom.Contact
    shared: SharedSolutions


def reduced_to(
    contact: Contact, kind: str, n_modes: int, choice: str, to_hz: float
) -> rom.ReducedModel:
    """So many modes, those of the contact chosen up to to_hz [Hz]."""
    to_hz = to_hz if choice == "contact" else None
    asked = rom.Selection(n_modes=n_modes, choice=choice, to_hz=to_hz)
    return _reduced(contact, kind, asked, contact.shared)


def _reduced(
    contact: Contact, kind: str, asked: rom.Selection, factorise: rom.Factorise
) -> rom.ReducedModel:
    matrices = (contact.K, contact.M, contact.w)
    if kind == "free-modes":
        reduced = rom.free_modes(*matrices, asked, factorise=factorise)
    else:
        boundary = np.flatnonzero(contact.w)
        reduced = rom.craig_bampton(*matrices, boundary, asked, factorise=factorise)
    return reduced._replace(T=None, contact=contact.known)


def wall_of(scene: Scene, reduced: rom.ReducedModel, without: float | None = None) -> dem.Wall:
    """The wall, the compliance `without` [m/N] taken out: the half-space's unless said."""
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
    contact: Contact,
    modes: AssemblyModes,
    largest: dict[str, rom.ReducedModel],
    to_hz: float,
) -> Costs:
    """The scene's reduction against the eigen-solve; marches with the `largest` models, and with
    the modes that an error up to to_hz [Hz] keeps, against a rigid wall."""
    few = rom.Selection(error=ERROR, choice="contact", to_hz=to_hz)
    kept = _reduced(contact, KIND, few, contact.shared)
    models = largest | {f"the modes of reduction.error = {ERROR:g}": kept}
    return Costs(_solve_cost(scene, contact, modes), tuple(_march_costs(scene, models)))


def _solve_cost(scene: Scene, contact: Contact, modes: AssemblyModes) -> SolveCost:
    n = scene.reduction.modes or 40
    asked = selection(scene)
    if asked.by_contact:
        asked = asked._replace(modes=targets_kept(modes))
    calls = (
        lambda: fem.factorised(contact.K),
        lambda: fem.modes(contact.K, contact.M, n),
        lambda: _reduced(contact, scene.reduction.kind, asked, fem.factorised),
    )
    return SolveCost(n, *least_seconds(calls, 2))


def _march_costs(scene: Scene, models: dict[str, rom.ReducedModel]) -> Iterator[MarchCost]:
    at = scene.but(time={"error": ERROR})
    walls = [wall_of(at, model) for model in models.values()]
    runs = [lambda wall=wall: marched(at, wall, 1.0) for wall in (dem.rigid_wall(), *walls)]
    rigid, *seconds = least_seconds(tuple(runs), REPEATS)
    for name, wall, one in zip(models, walls, seconds, strict=True):
        yield MarchCost(name, len(wall.omega), one, rigid)
