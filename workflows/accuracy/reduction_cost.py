"""What a reduction costs beside an eigen-solve, and a march with its modes beside a rigid wall's.

Seconds are those of the processor, the least of some repeats taken in turns: a machine that has
other work to do spoils them least so. BLAS runs on one thread.
"""

from collections.abc import Callable, Iterator
from time import process_time
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import coupling
import dem
import fem
import rom
from coupling.wall import wall_from_reduced
from workflows.accuracy.shared_solutions import SharedSolutions
from workflows.assembly_stages import AssemblyModes
from workflows.chain_stages import chain, initial_velocity
from workflows.reduced_wall import damping, half_space
from workflows.reduction_stage import hammer_modes, size
from workflows.scene import Scene

KIND = "free-modes"
ERROR = 1e-4  # of the reduction, and of the marches that are compared
REPEATS = 15


class Contact(NamedTuple):
    """The full model as the reductions need it."""

    K: object
    M: object
    w: NDArray[np.float64]
    notes: dict[str, str]
    shared: SharedSolutions


def reduced_to(
    contact: Contact, kind: str, n_modes: int, choice: str, to_hz: float
) -> rom.ReducedModel:
    """So many modes, those of the contact chosen up to to_hz [Hz]."""
    asked = {"n_modes": n_modes, "choice": choice, "to_hz": to_hz if choice == "contact" else None}
    return _reduced(contact, kind, asked, contact.shared)


def _reduced(
    contact: Contact, kind: str, asked: dict, factorise: rom.Factorise
) -> rom.ReducedModel:
    asked = {**asked, "factorise": factorise, "provenance": contact.notes}
    if kind == "free-modes":
        return rom.free_modes(contact.K, contact.M, contact.w, **asked)._replace(T=None)
    boundary = np.flatnonzero(contact.w)
    return rom.craig_bampton(contact.K, contact.M, contact.w, boundary, **asked)._replace(T=None)


def wall_of(scene: Scene, reduced: rom.ReducedModel, without: float | None = None) -> dem.Wall:
    """The wall, the compliance `without` [m/N] taken out: the half-space's unless said."""
    local = half_space(reduced) if without is None else without
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


def least_seconds(calls: tuple[Callable[[], object], ...], repeats: int) -> list[float]:
    """Processor seconds of the quickest of some runs of every call, the calls in turns."""
    best = [np.inf] * len(calls)
    for _ in range(repeats):
        for i, call in enumerate(calls):
            started = process_time()
            call()
            best[i] = min(best[i], process_time() - started)
    return best


def cost_sentences(
    scene: Scene,
    contact: Contact,
    modes: AssemblyModes,
    largest: dict[str, rom.ReducedModel],
    to_hz: float,
) -> Iterator[str]:
    """The scene's reduction against the eigen-solve; marches with the `largest` models, and with
    the modes that an error up to to_hz [Hz] keeps, against a rigid wall."""
    yield _reduction_cost(scene, contact, modes)
    few = {"error": ERROR, "choice": "contact", "to_hz": to_hz}
    kept = _reduced(contact, KIND, few, contact.shared)
    yield from _march_costs(scene, largest | {f"those of reduction.error = {ERROR:g}": kept})


def _reduction_cost(scene: Scene, contact: Contact, modes: AssemblyModes) -> str:
    n = scene.reduction.modes or 40
    asked = size(scene)
    if asked["choice"] == "contact":
        asked["modes"] = hammer_modes(modes)
    factor, solve, reduce = least_seconds(
        (
            lambda: fem.factorised(contact.K),
            lambda: fem.modes(contact.K, contact.M, n),
            lambda: _reduced(contact, scene.reduction.kind, asked, fem.factorised),
        ),
        2,
    )
    return (
        f"The scene's reduction takes {reduce:.2f} s, the eigen-solve of {n} modes {solve:.2f} s "
        f"(ratio {reduce / solve:.2f}); each with a factorisation of its own of about "
        f"{factor:.2f} s, without it {max(reduce - factor, 0):.2f} and "
        f"{max(solve - factor, 0):.2f} s."
    )


def _march_costs(scene: Scene, models: dict[str, rom.ReducedModel]) -> Iterator[str]:
    at = scene.model_copy(update={"time": scene.time.model_copy(update={"error": ERROR})})
    walls = [wall_of(at, model) for model in models.values()]
    runs = [lambda wall=wall: marched(at, wall, 1.0) for wall in (dem.rigid_wall(), *walls)]
    rigid, *seconds = least_seconds(tuple(runs), REPEATS)
    for name, wall, one in zip(models, walls, seconds, strict=True):
        yield (
            f"March to {ERROR:g} with {name}, {len(wall.omega)} oscillators: {1e3 * one:.1f} ms, "
            f"{one / rigid:.2f} times that against a rigid wall."
        )
