"""Choice of sphere, chain and velocity for a measurement: bars before anything is measured, by a
run of the model and its derivatives."""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import nullcontext
from typing import Any, NamedTuple

import numpy as np
from joblib import Memory
from numpy.typing import NDArray

from beadwave.coupling.band import Band
from beadwave.coupling.sensors import Sensor
from beadwave.workflows.files.run_folder import Picture
from beadwave.workflows.fit import scene_parameters
from beadwave.workflows.fit.better_walls import better_walls
from beadwave.workflows.fit.forward import MeasuredRecord, StructureForward, Unknowns, unknowns
from beadwave.workflows.fit.inspect import STEPS
from beadwave.workflows.fit.inversion import GAIN_SCALE
from beadwave.workflows.fit.measured_record import marched
from beadwave.workflows.fit.model_errors import NOISE, BetterModel, biases, changes, with_systems
from beadwave.workflows.fit.parameter import Parameter, ends, scales, trigger
from beadwave.workflows.fit.parametric_wall import Bounds
from beadwave.workflows.fit.plausibility import USUAL_NOISE
from beadwave.workflows.fit.reliability import BARELY_DETERMINED_BAR, DETERMINED_BAR
from beadwave.workflows.fit.uncertainty import bars_over_time, bounds_information
from beadwave.workflows.fit.varied_scene import VariedScene, structure
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.report.number_format import si
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.report.tables import Table
from beadwave.workflows.scene import Instrument, InvalidScene
from beadwave.workflows.scene.places import has_friction
from beadwave.workflows.stages.chain.sensor_signals import sensors as sensors_of
from beadwave.workflows.stages.engine.pipeline import Pipeline
from beadwave.workflows.stages.engine.progress import Progress
from beadwave.workflows.sweep.cases import Base
from beadwave.workflows.sweep.design_words import grid, require_free

MOST_CASES = 200


class CandidateWalls(NamedTuple):
    """The scene with its walls, and those that are better in one respect."""

    model: VariedScene
    better: Mapping[str, Sequence[BetterModel]]


class CandidateChain(NamedTuple):
    """One chain: the spheres that may be watched, and what each would tell."""

    values: dict[str, Any]  # of the keys that are varied
    places: tuple[str | int, ...]  # spheres from 2 on, then sensors on the structure
    bars: NDArray[np.float64]  # (m, n) two-sigma, at m places, of the numbers, in SI units
    by_noise: NDArray[np.float64]  # (m, n) share of the noise in their squares
    records: NDArray[np.float64]  # (m, n) [s] after the first touch that are long enough

    rubs: bool = False  # on a structure, with friction

    @property
    def spheres(self) -> tuple[int, ...]:
        """Those among the places."""
        return tuple(place for place in self.places if isinstance(place, int))


def designed(
    base: Base, find: str, bounds: str | None, over: Iterable[str], progress: Progress
) -> Finding:
    """Bars of each number by each sphere, case by case; raises InvalidScene."""
    sought = scene_parameters.shared(base, find, bounds)
    scene_parameters.require_possible(base, sought)
    over = tuple(over)
    cases = [{}]
    if over:
        grid_of_cases = grid(over, base.number)
        require_free(grid_of_cases, base.given)
        cases = [grid_of_cases.case(i) for i in range(grid_of_cases.n_cases)]
    if len(cases) > MOST_CASES:
        raise InvalidScene(f"--over makes {len(cases)} cases, up to {MOST_CASES} are looked at.")
    with progress("design"):
        walls: dict[str, CandidateWalls] = {}  # several cases share one: it is computed once
        chains = [_candidate(base, case, sought, walls) for case in cases]
    return _finding(sought, chains)


def _candidate(
    base: Base,
    values: dict[str, Any],
    sought: tuple[Parameter, ...],
    walls: dict[str, CandidateWalls],
) -> CandidateChain:
    """Bars of the numbers by each sphere of a chain; adds its wall to the walls. Raises
    InvalidScene."""
    base = scene_parameters.changed_base(base, values)
    scene = base.with_values({})
    n = len(sought)

    # walls within a little of the scene's values
    nearby = []
    for p in sought:
        # 0.01 of the bounds' distance: walls are computed as far to either side of the scene's
        value, reach = scene_parameters.number(scene, p.name), 0.01 * (p.high - p.low)
        nearby.append(p._replace(start=value, low=value - reach, high=value + reach))
    each = scene_parameters.usual_each(scene, ",".join(p.name for p in sought))
    per_record = scene_parameters.per_record(base, each, 1)
    keys = tuple(p.name for p in (*sought, *per_record[0]))
    theta = np.array([p.start for p in (*nearby, *per_record[0])])
    wall = Pipeline(scene, Memory(None, verbose=0)).key("wall")

    # the scene's first sensor on every sphere but the striker, its noise over the largest signal
    spheres = tuple(range(2, scene.chain.count + 1))
    instrument = scene.output.instrument or Instrument()
    if of_spheres := [each for each in scene.output.sensors or () if each.on is None]:
        like = of_spheres[0]
        band = Band(like.low_pass, like.high_pass, like.order)
        sensors = tuple(Sensor(i - 1, like.quantity, band=band) for i in spheres)
        bits = instrument.bits
        rounding = 2.0 ** (1 - bits) / np.sqrt(12.0) if bits else 0.0
        noise = float(np.hypot(like.noise or USUAL_NOISE, rounding))
        unknown_gain = isinstance(like.gain, str)
    else:
        sensors = tuple(Sensor(i - 1, "force") for i in spheres)
        noise, unknown_gain = USUAL_NOISE, True
    places: tuple[str | int, ...] = spheres
    if has_friction(scene):
        on_structure = [each for each in sensors_of(scene) if each.column is not None]
        sensors = (*sensors, *(sensor._replace(gain=1.0) for sensor in on_structure))
        named = [each.label for each in scene.output.sensors or () if each.on is not None]
        places = (*spheres, *named)

    with marched(scene.name):
        if wall not in walls:
            box = Bounds(*ends(nearby))
            model = structure(base, keys, box, n, lambda name: nullcontext())
            model = model.through(theta) if model.between else model
            rubs = model.rubbing is not None  # no better wall of three directions is known
            walls[wall] = CandidateWalls(model, {} if rubs else better_walls(scene))
        model = walls[wall].model.of(scene, base)
        t = np.arange(int(scene.time.duration * instrument.sampling)) / instrument.sampling
        step = STEPS * model(theta).step
        model = model.stepped(theta, step)
        forward = StructureForward(model, sensors, step)
        if model.rubbing is not None and model.rubbing.near is not None:
            # 0.25: step of difference quotients, in scales: half a percent of the bounds, where
            # periodic states of shakers are found to a thousandth of what such a step changes
            forward = forward._replace(difference=0.25)
        causes, records = foreseen(
            forward, unknowns(sought, per_record, [trigger("trigger", 0.0)]), theta, t,
            noise=noise, unknown_gain=unknown_gain,
            models=with_systems(walls[wall].better, model.behind),
        )  # fmt: skip
    squares = {cause: part[:, :n] ** 2 for cause, part in causes.items()}
    whole = sum(squares.values())
    return CandidateChain(
        values, places, np.sqrt(whole), squares[NOISE] / whole, records[:, :n],
        model.rubbing is not None,
    )  # fmt: skip


def _finding(sought: tuple[Parameter, ...], chains: list[CandidateChain]) -> Finding:
    """Table of all bars, the best and worst sphere of each chain, a panel and a sentence for each
    number."""
    units = [f"{p.name} two sigma [{p.unit}]" if p.unit else f"{p.name} two sigma" for p in sought]
    by_noise = [f"{p.name} noise in its square" for p in sought]
    lengths = [f"{p.name} record [s]" for p in sought]
    columns = (*chains[0].values, "sphere", *units, *by_noise, *lengths)
    rows = tuple(
        (*chain.values.values(), sphere, *map(float, np.concatenate(numbers_of_sphere)))
        for chain in chains
        for sphere, *numbers_of_sphere in zip(
            chain.places, chain.bars, chain.by_noise, chain.records, strict=True
        )
    )

    printed: list[tuple] = [
        (*chains[0].values, "number", "best sphere", "two sigma", "of bounds", "by noise",
         "worst sphere", "two sigma", "record [ms]")
    ]  # fmt: skip
    for chain in chains:
        for i, p in enumerate(sought):
            best, worst = int(chain.bars[:, i].argmin()), int(chain.bars[:, i].argmax())
            printed.append((
                *chain.values.values(), f"{p.name} [{p.unit}]" if p.unit else p.name,
                chain.places[best], float(chain.bars[best, i]),
                float(chain.bars[best, i] / (p.high - p.low)),
                f"{100 * chain.by_noise[best, i]:.0f} %", chain.places[worst],
                float(chain.bars[worst, i]), 1e3 * float(chain.records[best, i]),
            ))  # fmt: skip

    panels_of_numbers, sentences = [], []
    for i, p in enumerate(sought):
        # at most 8 curves in a picture
        curves = [
            Line(_with_values(chain.values).removeprefix(" with ") or None,
                 np.array(chain.spheres, float),
                 chain.bars[: len(chain.spheres), i] / (p.high - p.low), "o-")
            for chain in chains[:8]
        ]  # fmt: skip
        words = f"{p.name}\ntwo sigma over bounds"
        panels_of_numbers.append(Panel("", "sphere that is watched", words, curves, "y"))
        sentences.append(_on_best(p, i, chains))
    if any(chain.rubs for chain in chains):
        sentences.append(
            "With friction on the structure bars hold noise and the error of the steps: no better "
            "mesh or reduction is computed in three directions."
        )
    sentences.append(
        "Bars are of one impact whose velocity and trigger are found with the rest; n impacts make "
        "their parts by noise shorter by the root of n. They hold noise and the known errors of "
        "the model, by its steps, mesh, reduction and theory, to first order: where numbers move "
        "along a valley of the misfit, bars of inspect have been twice as long."
    )
    table = Table("design", columns, rows, tuple(printed))
    picture = Picture("design", panels(panels_of_numbers))
    return Finding((table,), tuple(sentences), (picture,))


def _on_best(p: Parameter, i: int, chains: list[CandidateChain]) -> str:
    """A sentence on the chain and sphere that tell number i best."""
    best = min(chains, key=lambda chain: chain.bars[:, i].min())
    sphere = int(best.bars[:, i].argmin())
    bar = best.bars[sphere, i]
    share = bar / (p.high - p.low)
    if share > BARELY_DETERMINED_BAR:
        return (
            f"{p.name} is told by no sphere: its bar is as long as its bounds; record longer, "
            "or find fewer numbers."
        )
    how = "determined" if share <= DETERMINED_BAR else "weakly determined"
    where, place = _with_values(best.values), best.places[sphere]
    by = f"sphere {place}" if isinstance(place, int) else place
    return (
        f"{p.name} is {how} best by {by}{where}: two sigma {si(float(bar), p.unit)}"
        f" of one impact, in records of {1e3 * best.records[sphere, i]:.3g} ms or longer."
    )


def _with_values(values: dict[str, Any]) -> str:
    """ " with chain.count = 9, ..", or nothing."""
    texts = (f"{key} = {x:g}" if isinstance(x, float) else f"{key} = {x}"
             for key, x in values.items())  # fmt: skip
    text = ", ".join(texts)
    return f" with {text}" if text else ""


def foreseen(
    forward: StructureForward,
    unknowns: Unknowns,
    theta: NDArray[np.float64],
    t: NDArray[np.float64],
    *,
    noise: float,
    unknown_gain: bool,
    models: Mapping[str, Sequence[BetterModel]],
) -> tuple[Mapping[str, NDArray[np.float64]], NDArray[np.float64]]:
    """Parts (m, p) of the two-sigma bars of the unknowns by each of m sensors alone, by noise and
    by each error of the model, and the record (m, p) [s] after which those by noise are at most
    ENOUGH times as long.

    theta are the values of all but the trigger; noise is over the largest signal; `models` are
    those that are better in what a cause names.
    """
    # one record of zeros from the touch at t = 0 on: only the model's signals and slopes count
    m, theta = len(forward.sensors), np.append(theta, 0.0)
    shot = MeasuredRecord(t, np.zeros((len(t), m)), np.ones(m))
    signals, slopes = forward.jacobian(unknowns, theta, [shot])
    rms = noise * np.maximum(np.abs(signals[0]).max(axis=0), 1e-300)
    signals, slopes = signals[0] / rms, slopes[0] / rms[:, None]

    def shown(forward):
        """(k, m) over the noise."""
        return forward.signals(unknowns, theta, [shot])[0] / rms

    by_cause = changes(forward, signals, shown, models)

    # an unknown gain is one more number, without bounds
    if unknown_gain:
        slopes = np.concatenate([slopes, GAIN_SCALE * signals[..., None]], axis=-1)
    p, n = slopes.shape[-1], len(unknowns.parameters)
    B = np.zeros((p, p))
    B[:n, :n] = bounds_information(unknowns.parameters)

    # each sensor alone: bars of records that end earlier and earlier, and biases of the whole one
    n_lengths = 80  # record lengths at which bars are computed
    ends = np.unique(np.linspace(len(t) / n_lengths, len(t), n_lengths).astype(int))
    causes = {cause: np.zeros((m, n)) for cause in (NOISE, *by_cause)}
    records = np.zeros((m, n))
    for i in range(m):
        bars = bars_over_time(slopes[None, :, i, None], B, ends)[:, :n]
        causes[NOISE][i] = bars[-1] * scales(unknowns.parameters)
        # a record that is long enough has bars of at most twice those of the whole one
        records[i] = t[ends[np.argmax(bars <= 2.0 * bars[-1], axis=0)] - 1]
        for cause, of_cause in by_cause.items():
            differences = np.array([change.share * change.signals[:, i] for change in of_cause])
            b = biases(slopes[:, i], differences.T, B)
            causes[cause][i] = np.linalg.norm(b[:n], axis=1) * scales(unknowns.parameters)
    return causes, records
