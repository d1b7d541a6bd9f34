"""Records of the waves in a chain in, numbers of its structure with their bars out."""

from time import perf_counter
from typing import NamedTuple

import numpy as np

from beadwave.workflows.files.record import MeanRecord
from beadwave.workflows.fit import scene_parameters
from beadwave.workflows.fit.candidates import searched
from beadwave.workflows.fit.columns import model_times, require_columns
from beadwave.workflows.fit.forward import MeasuredRecord, StructureForward, unknowns
from beadwave.workflows.fit.inversion import Inversion, inverted, profiled, widened
from beadwave.workflows.fit.least_squares import IMPOSSIBLE, RecordFit
from beadwave.workflows.fit.measured_record import marched, sensor_of, usable
from beadwave.workflows.fit.parameter import Parameter, ends
from beadwave.workflows.fit.parametric_wall import Bounds
from beadwave.workflows.fit.plausibility import (
    noise_of,
    of_same_channels,
    require_samples,
    rounding,
    size_comparison,
    trigger_of,
)
from beadwave.workflows.fit.reliability import SETTLED_SHIFT, InspectionAnswer
from beadwave.workflows.fit.varied_chains import VariedChains, varied_chains
from beadwave.workflows.fit.varied_scene import VariedScene, structure
from beadwave.workflows.report.number_format import supported
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.stages.engine.progress import Progress
from beadwave.workflows.sweep.cases import Base

STEPS = 4.0  # of the model, in usual ones: leaves 1e-5 of the largest signal


class InspectionRequest(NamedTuple):
    """Options of an inspection besides scene and records."""

    find: str  # keys of the scene, as in "beam.thickness,beam.young"
    bounds: str | None = None  # as in "beam.thickness=8mm:12mm"
    each: str | None = None  # numbers that every record has for itself
    starts: int = 12
    seed: int = 0


class InspectionResult(NamedTuple):
    """The scene that came out and the answer behind it."""

    scene: Scene
    answer: InspectionAnswer
    seconds: float


@usable()
def inspected(
    base: Base, records: tuple[MeanRecord, ...], request: InspectionRequest, progress: Progress
) -> InspectionResult:
    """The numbers to find; raises InvalidScene for records or requests that cannot be."""
    began = perf_counter()
    records = of_same_channels(records)
    scene = base.with_values({})
    if scene.shakers:
        raise InvalidScene(
            f"shakers.{scene.shakers[0].name}: inspect takes records of a structure at rest, since "
            "each of its many runs would look for a periodic state; strike with the shaker off and "
            "drop [[shakers]] (`beadwave design` takes them)."
        )

    # numbers of the structure first, then those of each record
    shared = scene_parameters.shared(base, request.find, request.bounds)
    each = request.each or scene_parameters.usual_each(scene, request.find)
    per_record = scene_parameters.per_record(base, each, len(records))
    scene_parameters.require_possible(base, shared)
    n = len(shared)
    keys = tuple(p.name for p in (*shared, *per_record[0]))
    if twice := next((key for key in keys if keys.count(key) > 1), None):
        raise InvalidScene(f"{twice} is found for all records and for --each; name it once.")

    box = Bounds(*ends(shared))
    varied = varied_chains if scene.chains else structure
    model = varied(base, keys, box, n, progress)
    with progress("inversion"):
        fit, gains, noise_known = problem(model, records, shared, per_record)
        with marched(model.scene.name):
            answer, rivals = answered(fit, n, gains, starts=request.starts, seed=request.seed)

        # bars hold what is known of the model's errors as well as the noise
        inversion = answer.inversion
        if not answer.no_wall:
            better = answer.fit.forward.system.better_models(inversion.value[: len(keys)])
            inversion = widened(answer.fit, inversion, better)

    # where no wall can be computed, the numbers may contradict each other: they are shown unchecked
    values = inversion.value[:n]
    if answer.no_wall:
        result = scene_parameters.put(scene, keys[:n], values)
    else:
        bars = inversion.uncertainty.two_sigma[:n]
        written = np.array([supported(x, bar) for x, bar in zip(values, bars, strict=True)])
        result = scene_parameters.scene_at(base, keys[:n], written)
    of_records = InspectionAnswer(
        inversion,
        rivals,
        answer.fit,
        n,
        noise_known,
        answer.fit.forward.system.between,
        answer.moved,
        tuple(record.name for record in records),
        answer.no_wall,
    )
    return InspectionResult(result, of_records, perf_counter() - began)


@usable()
def problem(
    model: VariedScene | VariedChains,
    records: tuple[MeanRecord, ...],
    shared: tuple[Parameter, ...],
    per_record: list[list[Parameter]],
) -> tuple[RecordFit, tuple[str, ...], bool]:
    """The least-squares problem, the names of its gains, whether the records tell their noise;
    raises InvalidScene for records that are not what the scene may show."""
    pairs = [sensor_of(model.scene, channel) for channel in records[0].channels]
    sensors = tuple(sensor for sensor, _ in pairs)
    gains = tuple(dict.fromkeys(name for _, name in pairs if name))
    gain_of_sensor = np.array([gains.index(name) if name else -1 for _, name in pairs])
    gain_known = gain_of_sensor < 0

    # the rig of the smallest step, which all records and all evaluations are marched by
    starts = [np.array([p.start for p in (*shared, *of_record)]) for of_record in per_record]
    with marched(model.scene.name):
        rigs = [model(values) for values in starts]
    stiffest = min(rigs, key=lambda rig: rig.step)
    step, time_scale = stiffest.step, stiffest.time_scale
    within = model.within if model.between else None
    with marched(model.scene.name):
        model = model.stepped(starts[0], STEPS * step)
    forward = StructureForward(model, sensors, STEPS * step, within)

    # each record against the model at the start: samples, noise, sizes, columns, first touch
    triggers, shots, noise_known = [], [], True
    for i, (record, start) in enumerate(zip(records, starts, strict=True), 1):
        require_samples(record.t, time_scale)
        noise, is_known = noise_of(record, time_scale)
        noise_known = noise_known and is_known
        shots.append(MeasuredRecord(record.t, record.y, noise, rounding(record.y)))
        longer = forward.signals_of_run(start, model_times(record.t) - record.t[0])
        signals = longer[: len(record.t)]
        names = [f"{channel.name} of {record.name}" for channel in record.channels]
        known = np.flatnonzero(gain_known)
        size_comparison(
            [names[c] for c in known], [record.channels[c].unit for c in known],
            record.y[:, known], signals[:, known],
        )  # fmt: skip
        forces = np.array([channel.quantity == "force" for channel in record.channels])
        require_columns(
            names, record.t, record.y, longer, time_scale, signed=gain_known, forces=forces
        )
        triggers.append(trigger_of(record, signals, f"trigger, record {i}"))

    # numbers of a record are told apart by its number: "striker.velocity, record 2"
    named = [
        [p._replace(name=f"{p.name}, record {i}") for p in of_record]
        for i, of_record in enumerate(per_record, 1)
    ]
    fit = RecordFit(forward, unknowns(shared, named, triggers), tuple(shots), gain_of_sensor)
    return fit, tuple(f"gain {name}" for name in gains), noise_known


class Answer(NamedTuple):
    """An end of the search, found again with walls computed where it lies."""

    inversion: Inversion
    fit: RecordFit
    moved: float | None  # bars by which the last computed wall moved it
    no_wall: str = ""  # why no wall could be computed there


def answered(
    fit: RecordFit, n_shared: int, gains: tuple[str, ...], *, starts: int, seed: int
) -> tuple[Answer, tuple[Inversion, ...]]:
    """The answer, and others that the records do not tell from it.

    Each end of the search is fitted again with a wall that is computed at it, until that moves it
    by less than a small share of its bars. Where no wall can be computed the end stays as the walls
    around it gave it. Raises what the system raises for values that cannot be marched.
    """
    search = searched(fit, n_shared=n_shared, starts=starts, seed=seed)
    answers = []
    for end in search.ends:
        end_fit = fit._replace(forward=search.forward)
        model, moved, no_wall = end_fit.forward.system, None, ""
        inversion = inverted(end_fit, begin=end.point, n_shared=n_shared, gains=gains)

        # a wall between computed ones is wrong by its interpolation: one computed at the answer
        # takes its place, and the fit goes on from there; three times at most
        for _ in range(3 if model.between else 0):
            try:
                model = model.through(inversion.value[: len(model.keys)])
                fit_there = end_fit._replace(forward=end_fit.forward._replace(system=model))
                theta = inversion.value[: len(end_fit.unknowns.parameters)]
                again = inverted(fit_there, begin=theta, n_shared=n_shared, gains=gains)
            except IMPOSSIBLE as reason:
                no_wall = str(reason)
                break
            bars = again.uncertainty.two_sigma[:n_shared]
            moved = float((np.abs(again.value - inversion.value)[:n_shared] / bars).max())
            end_fit, inversion = fit_there, again
            if moved <= SETTLED_SHIFT:
                break
        inversion = profiled(end_fit, inversion, n_shared)._replace(search=search)
        answers.append(Answer(inversion, end_fit, moved, no_wall))
    best, *others = sorted(answers, key=lambda answer: answer.inversion.whole_misfit)
    return best, best.inversion.rivals([answer.inversion for answer in others], n_shared)
