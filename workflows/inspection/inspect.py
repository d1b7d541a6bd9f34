"""Records of the waves in a chain in, numbers of its structure with their bars out."""

from time import perf_counter
from typing import NamedTuple

import numpy as np

import coupling
import dem
from coupling.calibration.parameters import Parameter
from coupling.calibration.plausibility import WRONG_UNITS, require_samples
from coupling.calibration.signals import noise_between_waves
from coupling.inspection.fitting import Fit
from coupling.inspection.forward import Forward, Shot, unknowns
from coupling.inspection.inversion import Inversion, inverted, profiled
from coupling.inspection.judgement import SETTLED
from coupling.inspection.search import Searched, rise, searched
from coupling.parametric_wall import Box
from workflows.files.records import Recorded, sensor_of, usable
from workflows.inspection import numbers
from workflows.inspection.structure import Structure, structure
from workflows.pipeline.pipeline import Progress
from workflows.scene import InvalidScene, Scene
from workflows.sweep.cases import Base

STEPS = 4.0  # of the model, in usual ones: 1e-5 of the largest signal
TRIGGER = (1e-4, 3e-6)  # to either side of the estimate, scale [s]
RESOLVED = 1e-4  # of the largest signal: noise below what the model resolves
USUAL_NOISE = 0.01  # of the largest signal, where a record does not tell
LEVELS = 4096  # different values of a record, below which an instrument has rounded them
ROUNDS = 3  # of walls computed at the answer


class Request(NamedTuple):
    """What is asked for beside scene and records."""

    find: str
    bounds: str | None = None
    each: str | None = None
    starts: int = 12
    seed: int = 0


class Answer(NamedTuple):
    """An end of the search, settled."""

    inversion: Inversion
    fit: Fit
    moved: float | None  # bars by which the last computed wall moved it


class Inspected(NamedTuple):
    """What came out, and the problem that was solved."""

    scene: Scene
    inversion: Inversion
    rivals: tuple[Inversion, ...]  # that the records do not tell from it
    fit: Fit
    structure: Structure
    n_shared: int
    moved: float | None
    noise_known: bool
    seconds: float


def inspected(
    base: Base, records: tuple[Recorded, ...], request: Request, progress: Progress
) -> Inspected:
    """The numbers asked for; raises InvalidScene for records or requests that cannot be."""
    began = perf_counter()
    records = _alike(records)
    found = numbers.shared(base, request.find, request.bounds)
    each = request.each or numbers.usual_each(base.with_values({}), request.find)
    own = numbers.own(base, each, len(records))
    numbers.require_possible(base, found)
    keys = tuple(p.name for p in (*found, *own[0]))
    if twice := next((key for key in keys if keys.count(key) > 1), None):
        raise InvalidScene(f"{twice} is found for all records and for --each; name it once.")
    box = Box(*(np.array([getattr(p, end) for p in found]) for end in ("low", "high")))
    model = structure(base, keys, box, len(found), progress)
    with progress("inversion"):
        fit, gains, known = problem(model, records, found, own)
        (inversion, fit, moved), rivals = _answered(fit, len(found), gains, request)
    scene = numbers.moved(base, keys[: len(found)], inversion.value[: len(found)])
    seconds = perf_counter() - began
    settled = fit.forward.system
    return Inspected(scene, inversion, rivals, fit, settled, len(found), moved, known, seconds)


def called_apart(records: tuple[Recorded, ...]) -> tuple[Recorded, ...]:
    """Records whose files have the same name called by their numbers."""
    if len({one.name for one in records}) == len(records):
        return records
    return tuple(one._replace(name=f"record {i}") for i, one in enumerate(records, 1))


def _alike(records: tuple[Recorded, ...]) -> tuple[Recorded, ...]:
    """Records of the same channels, cut to the shortest; raises InvalidScene for others."""
    for one in records[1:]:
        if one.channels != records[0].channels:
            raise InvalidScene(
                f"{one.name} has {_named(one)}, {records[0].name} has {_named(records[0])}; give "
                "records of the same sensors."
            )
    k = min(len(one.t) for one in records)
    return tuple(one._replace(t=one.t[:k], y=one.y[:k]) for one in records)


def _named(one: Recorded) -> str:
    return ", ".join(channel.name for channel in one.channels)


def problem(model: Structure, records, found, own) -> tuple[Fit, tuple[str, ...], bool]:
    """The least-squares problem, the names of its gains, whether the records tell their noise."""
    pairs = [sensor_of(model.scene, channel) for channel in records[0].channels]
    gains = tuple(dict.fromkeys(name for _, name in pairs if name))
    group = np.array([gains.index(name) if name else -1 for _, name in pairs])
    starts = [np.array([p.start for p in (*found, *record)]) for record in own]
    dt, time_scale = _steps(model, starts)
    within = model.within if model.between else None
    forward = Forward(model, tuple(sensor for sensor, _ in pairs), dt, within)
    triggers, shots, known = [], [], True
    for i, (one, start) in enumerate(zip(records, starts, strict=True), 1):
        with usable():
            require_samples(one.t, time_scale)
        noise, told = _noise(one, time_scale)
        known = known and told
        shots.append(Shot(one.t, one.y, noise, _rounding(one.y)))
        shown = forward.shown(start, one.t - one.t[0])
        _require_size(one, shown, group < 0)
        triggers.append(_trigger(one, shown, f"trigger, record {i}"))
    named = [
        [p._replace(name=f"{p.name}, record {i}") for p in record]
        for i, record in enumerate(own, 1)
    ]
    fit = Fit(forward, unknowns(found, named, triggers), tuple(shots), group)
    return fit, tuple(f"gain {name}" for name in gains), known


def _steps(model: Structure, starts) -> tuple[float, float]:
    """Step [s] of the model, and the time [s] within which its stiffest contact moves."""
    try:
        usual = min(dem.sensitivities.usual_step(*model(values)) for values in starts)
    except (coupling.CouplingError, dem.InvalidChain, dem.NoEquilibrium) as reason:
        raise InvalidScene(f"{model.scene.name}: {str(reason).rstrip('.')}.") from None
    return STEPS * usual, dem.sensitivities.STEPS_PER_TIME_SCALE * usual


def _require_size(one: Recorded, shown: np.ndarray, known: np.ndarray) -> None:
    """Raise InvalidScene where signals of known gains are far from the size of the model's."""
    sizes = zip(one.channels, np.abs(one.y).max(axis=0), np.abs(shown).max(axis=0), strict=True)
    for (channel, largest, own), told in zip(sizes, known, strict=True):
        if told and not own / WRONG_UNITS < largest < own * WRONG_UNITS:
            raise InvalidScene(
                f"{one.name}: {channel.name} reaches {largest:.3g}, the scene's model {own:.3g} in "
                "SI units; correct the unit in the record's header, the gain or the scene."
            )


def _trigger(one: Recorded, shown: np.ndarray, name: str) -> Parameter:
    """When the chain is first touched on the record's clock, from the rise of its first wave."""
    reach, scale = TRIGGER
    estimate = rise(one.t, one.y) - rise(one.t - one.t[0], shown)
    return Parameter(name, "trigger", estimate, estimate - reach, estimate + reach, scale, "s")


def _noise(one: Recorded, time_scale: float) -> tuple[np.ndarray, bool]:
    """(m,) rms of the mean signals' noise, and whether the record tells it."""
    largest = np.abs(one.y).max(axis=0)
    if not largest.all():
        raise InvalidScene(f"{one.name}: {_named(one)} holds a signal of zeros; drop its column.")
    if one.repeats > 1:
        found = list(one.spread / np.sqrt(one.repeats))
    else:
        found = [noise_between_waves(one.t, y[:, None], time_scale) for y in one.y.T]
    guessed = [share if share is not None else np.nan for share in found]
    known = bool(np.isfinite(guessed).all())
    rms = np.where(np.isfinite(guessed), guessed, USUAL_NOISE * largest)
    least = np.maximum(RESOLVED * largest, _rounding(one.y))
    return np.maximum(rms, least), known


def _rounding(y: np.ndarray) -> np.ndarray:
    """(m,) rms of what an instrument of few levels rounds off signals (k, m)."""
    levels = [np.unique(column) for column in y.T]
    steps = [np.median(np.diff(u)) if 1 < len(u) <= LEVELS else 0.0 for u in levels]
    return np.array(steps) / np.sqrt(12.0)


def _answered(
    fit: Fit, n_shared: int, gains: tuple[str, ...], request: Request
) -> tuple[Answer, tuple[Inversion, ...]]:
    """The answer, and others that the records do not tell from it."""
    try:
        search = searched(fit, n_shared=n_shared, starts=request.starts, seed=request.seed)
        fit = fit._replace(forward=search.forward)
        answers = [_settled(fit, end.theta, n_shared, gains, search) for end in search.ends]
    except (coupling.CouplingError, dem.InvalidChain, dem.NoEquilibrium) as reason:
        name = fit.forward.system.scene.name
        raise InvalidScene(f"{name}: {str(reason).rstrip('.')}.") from None
    answers.sort(key=lambda answer: answer.inversion.whole_misfit)
    best, *others = answers
    return best, best.inversion.rivals([one.inversion for one in others], n_shared)


def _settled(fit: Fit, theta, n_shared: int, gains: tuple[str, ...], search: Searched) -> Answer:
    """An end of the search, found again with walls computed where it lies."""
    model, moved = fit.forward.system, None
    found = inverted(fit, begin=theta, n_shared=n_shared, gains=gains)
    for _ in range(ROUNDS if model.between else 0):
        model = model.through(found.value[: len(model.keys)])
        fit = fit._replace(forward=fit.forward._replace(system=model))
        begin = found.value[: len(fit.unknowns.parameters)]
        before, found = found, inverted(fit, begin=begin, n_shared=n_shared, gains=gains)
        off = np.abs(found.value - before.value)[:n_shared]
        moved = float((off / found.uncertainty.two_sigma[:n_shared]).max())
        if moved <= SETTLED:
            break
    return Answer(profiled(fit, found, n_shared)._replace(search=search), fit, moved)
