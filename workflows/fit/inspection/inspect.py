"""Records of the waves in a chain in, numbers of its structure with their bars out."""

from time import perf_counter
from typing import NamedTuple

import numpy as np

import coupling
import dem
from workflows.files.record import Recorded
from workflows.fit.core.calibration.plausibility import require_samples
from workflows.fit.core.columns import beyond, require_columns
from workflows.fit.core.inspection.answer import Answer, answered
from workflows.fit.core.inspection.fitting import RecordFit
from workflows.fit.core.inspection.forward import Shot, StructureForward, unknowns
from workflows.fit.core.inspection.inversion import Inversion
from workflows.fit.core.inspection.reading import (
    alike,
    noise_of,
    require_size,
    rounding,
    trigger_of,
)
from workflows.fit.core.parametric_wall import Bounds
from workflows.fit.inspection import numbers
from workflows.fit.inspection.structure import VariedScene, structure
from workflows.fit.records import sensor_of, usable
from workflows.scene import InvalidScene, Scene
from workflows.stages.pipeline import Progress
from workflows.sweep.cases import Base

STEPS = 4.0  # of the model, in usual ones: 1e-5 of the largest signal


class InspectionRequest(NamedTuple):
    """What is asked for beside scene and records."""

    find: str
    bounds: str | None = None
    each: str | None = None
    starts: int = 12
    seed: int = 0


class Inspected(NamedTuple):
    """What came out, and the problem that was solved."""

    scene: Scene
    inversion: Inversion
    rivals: tuple[Inversion, ...]  # that the records do not tell from it
    fit: RecordFit
    structure: VariedScene
    n_shared: int
    moved: float | None
    no_wall: str  # why none could be computed at the answer
    noise_known: bool
    seconds: float


@usable()
def inspected(
    base: Base, records: tuple[Recorded, ...], request: InspectionRequest, progress: Progress
) -> Inspected:
    """The numbers asked for; raises InvalidScene for records or requests that cannot be."""
    began = perf_counter()
    records = alike(records)
    found = numbers.shared(base, request.find, request.bounds)
    each = request.each or numbers.usual_each(base.with_values({}), request.find)
    own = numbers.own(base, each, len(records))
    numbers.require_possible(base, found)
    keys = tuple(p.name for p in (*found, *own[0]))
    if twice := next((key for key in keys if keys.count(key) > 1), None):
        raise InvalidScene(f"{twice} is found for all records and for --each; name it once.")
    box = Bounds(*(np.array([getattr(p, end) for p in found]) for end in ("low", "high")))
    model = structure(base, keys, box, len(found), progress)
    with progress("inversion"):
        fit, gains, known = problem(model, records, found, own)
        (inversion, fit, moved, no_wall), rivals = _answered(fit, len(found), gains, request)
    at = keys[: len(found)], inversion.value[: len(found)]
    # where no wall can be computed, the numbers may contradict each other: they are shown unchecked
    scene = numbers.put(base.with_values({}), *at) if no_wall else numbers.moved(base, *at)
    seconds = perf_counter() - began
    settled = fit.forward.system
    return Inspected(
        scene, inversion, rivals, fit, settled, len(found), moved, no_wall, known, seconds
    )


@usable()
def problem(model: VariedScene, records, found, own) -> tuple[RecordFit, tuple[str, ...], bool]:
    """The least-squares problem, the names of its gains, whether the records tell their noise."""
    pairs = [sensor_of(model.scene, channel) for channel in records[0].channels]
    gains = tuple(dict.fromkeys(name for _, name in pairs if name))
    group = np.array([gains.index(name) if name else -1 for _, name in pairs])
    starts = [np.array([p.start for p in (*found, *record)]) for record in own]
    dt, time_scale = _steps(model, starts)
    within = model.within if model.between else None
    forward = StructureForward(model, tuple(sensor for sensor, _ in pairs), dt, within)
    triggers, shots, known = [], [], True
    for i, (one, start) in enumerate(zip(records, starts, strict=True), 1):
        require_samples(one.t, time_scale)
        noise, told = noise_of(one, time_scale)
        known = known and told
        shots.append(Shot(one.t, one.y, noise, rounding(one.y)))
        longer = forward.signals_of_run(start, beyond(one.t) - one.t[0])
        shown = longer[: len(one.t)]
        require_size(one, shown, group < 0)
        names = [f"{channel.name} of {one.name}" for channel in one.channels]
        forces = np.array([channel.quantity == "force" for channel in one.channels])
        require_columns(names, one.t, one.y, longer, time_scale, signed=group < 0, forces=forces)
        triggers.append(trigger_of(one, shown, f"trigger, record {i}"))
    named = [
        [p._replace(name=f"{p.name}, record {i}") for p in record]
        for i, record in enumerate(own, 1)
    ]
    fit = RecordFit(forward, unknowns(found, named, triggers), tuple(shots), group)
    return fit, tuple(f"gain {name}" for name in gains), known


def _steps(model: VariedScene, starts) -> tuple[float, float]:
    """Step [s] of the model, and the time [s] within which its stiffest contact moves."""
    try:
        usual = min(dem.sensitivities.usual_step(*model(values)) for values in starts)
    except (coupling.CouplingError, dem.InvalidChain, dem.NoEquilibrium) as reason:
        raise InvalidScene(f"{model.scene.name}: {str(reason).rstrip('.')}.") from None
    return STEPS * usual, dem.sensitivities.STEPS_PER_TIME_SCALE * usual


def _answered(
    fit: RecordFit, n_shared: int, gains: tuple[str, ...], request: InspectionRequest
) -> tuple[Answer, tuple[Inversion, ...]]:
    """The answer, and others that the records do not tell from it; raises InvalidScene."""
    try:
        return answered(fit, n_shared, gains, starts=request.starts, seed=request.seed)
    except (coupling.CouplingError, dem.InvalidChain, dem.NoEquilibrium) as reason:
        name = fit.forward.system.scene.name
        raise InvalidScene(f"{name}: {str(reason).rstrip('.')}.") from None
