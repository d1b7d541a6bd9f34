"""Which sphere to watch, in which chain, at which velocity: bars before anything is measured."""

from collections.abc import Iterable, Iterator
from contextlib import nullcontext
from typing import Any, NamedTuple

import numpy as np
from joblib import Memory
from numpy.typing import NDArray

import coupling
import dem
from coupling.band import Band
from coupling.sensors import Sensor
from workflows.files.run_folder import Picture
from workflows.fit.core.calibration.parameters import Parameter
from workflows.fit.core.inspection.foreseen import foreseen, trigger
from workflows.fit.core.inspection.forward import StructureForward, unknowns
from workflows.fit.core.inspection.judgement import BARELY, TOLD
from workflows.fit.core.inspection.reading import USUAL_NOISE
from workflows.fit.core.parametric_wall import Bounds
from workflows.fit.inspection import numbers
from workflows.fit.inspection.inspect import STEPS
from workflows.fit.inspection.structure import VariedScene, structure
from workflows.report.finding import Finding
from workflows.report.plots import Line, Panel, panels
from workflows.report.tables import Table, short
from workflows.scene import Instrument, InvalidScene, Scene
from workflows.stages.pipeline import Pipeline, Progress
from workflows.sweep.cases import Base
from workflows.sweep.design import grid, require_free

NEAR = 0.01  # of the bounds' distance: where walls are computed to either side of the scene's
MOST_CASES = 200


class CandidateChain(NamedTuple):
    """One chain: the spheres that may be watched, and what each would tell."""

    values: dict[str, Any]
    spheres: tuple[int, ...]  # from 2 on
    bars: NDArray[np.float64]  # (m, n) two-sigma of the numbers, in SI units
    needed: NDArray[np.float64]  # (m, n) [s] of record after the first touch


def designed(
    base: Base, find: str, bounds: str | None, over: Iterable[str], progress: Progress
) -> Finding:
    """Bars of each number by each sphere, case by case; raises InvalidScene."""
    found = numbers.shared(base, find, bounds)
    numbers.require_possible(base, found)
    over = tuple(over)
    chosen = grid(over, base.number) if over else None
    if chosen:
        require_free(chosen, base.given)
    values = [chosen.case(i) for i in range(chosen.n_cases)] if chosen else [{}]
    if len(values) > MOST_CASES:
        raise InvalidScene(f"--over makes {len(values)} cases, up to {MOST_CASES} are looked at.")
    with progress("design"):
        known: dict[str, VariedScene] = {}
        cases = [_case(base, case, found, known) for case in values]
    return _finding(found, cases)


def _case(
    base: Base, values: dict[str, Any], found: tuple[Parameter, ...], known: dict[str, VariedScene]
) -> CandidateChain:
    """One case; walls that several share are computed once."""
    base = numbers.changed_base(base, values)
    scene = base.with_values({})
    here = tuple(_near(p, numbers.number(scene, p.name)) for p in found)
    own = numbers.own(base, numbers.usual_each(scene, ",".join(p.name for p in found)), 1)
    keys = tuple(p.name for p in (*found, *own[0]))
    theta = np.array([p.start for p in (*here, *own[0])])
    wall = Pipeline(scene, Memory(None, verbose=0)).key("wall")
    try:
        if wall not in known:
            box = Bounds(*(np.array([getattr(p, end) for p in here]) for end in ("low", "high")))
            model = structure(base, keys, box, len(found), lambda name: nullcontext())
            known[wall] = model.through(theta) if model.between else model
        model = known[wall].of(scene, base)
        spheres = tuple(range(2, scene.chain.count + 1))
        blank = CandidateChain(values, spheres, *np.zeros((2, len(spheres), len(found))))
        return _told(scene, blank, model, theta, found, own)
    except (coupling.CouplingError, dem.InvalidChain, dem.NoEquilibrium) as reason:
        raise InvalidScene(f"{scene.name}: {str(reason).rstrip('.')}.") from None


def _near(p: Parameter, value: float) -> Parameter:
    """The number within a little of the scene's value."""
    reach = NEAR * (p.high - p.low)
    return p._replace(start=value, low=value - reach, high=value + reach)


def _told(
    scene: Scene, case: CandidateChain, model: VariedScene, theta, found, own
) -> CandidateChain:
    """A case with its bars."""
    sensors, noise, unknown = _sensors(scene, case.spheres)
    sampling = (scene.output.instrument or Instrument()).sampling
    t = np.arange(int(scene.time.duration * sampling)) / sampling
    forward = StructureForward(model, sensors, STEPS * dem.sensitivities.usual_step(*model(theta)))
    sought = unknowns(found, own, [trigger()])
    told = foreseen(forward, sought, theta, t, noise=noise, unknown_gain=unknown)
    bars, needed = (one[:, : len(found)] for one in told)
    return case._replace(bars=bars, needed=needed)


def _sensors(scene: Scene, spheres) -> tuple[tuple[Sensor, ...], float, bool]:
    """The scene's first sensor on every sphere, its noise, and whether its gain is unknown."""
    told = (scene.output.sensors or (None,))[0]
    if told is None:
        return tuple(Sensor(i - 1, "force") for i in spheres), USUAL_NOISE, True
    band = Band(told.low_pass, told.high_pass, told.order)
    sensors = tuple(Sensor(i - 1, told.quantity, band=band) for i in spheres)
    bits = (scene.output.instrument or Instrument()).bits
    rounding = 2.0 ** (1 - bits) / np.sqrt(12.0) if bits else 0.0
    noise = float(np.hypot(told.noise or USUAL_NOISE, rounding))
    return sensors, noise, isinstance(told.gain, str)


def _finding(found: tuple[Parameter, ...], cases: list[CandidateChain]) -> Finding:
    names = [p.name for p in found]
    units = [f"{p.name} two sigma [{p.unit}]" if p.unit else f"{p.name} two sigma" for p in found]
    lengths = [f"{p.name} record [s]" for p in found]
    columns = (*cases[0].values, "sphere", *units, *lengths)
    rows = tuple(
        (*case.values.values(), sphere, *map(float, bars), *map(float, needed))
        for case in cases
        for sphere, bars, needed in zip(case.spheres, case.bars, case.needed, strict=True)
    )
    printed = (
        (*cases[0].values, "number", "best sphere", "two sigma", "of bounds", "worst sphere",
         "two sigma", "record [ms]"),
        *(line for case in cases for line in _best(found, case)),
    )  # fmt: skip
    table = Table("design", columns, rows, printed)
    picture = Picture("design", panels([_panel(p, i, cases) for i, p in enumerate(found)]))
    return Finding((table,), tuple(_sentences(found, names, cases)), (picture,))


def _best(found, case: CandidateChain) -> Iterator[tuple]:
    for i, p in enumerate(found):
        best, worst = int(case.bars[:, i].argmin()), int(case.bars[:, i].argmax())
        yield (
            *case.values.values(), p.name, case.spheres[best], float(case.bars[best, i]),
            float(case.bars[best, i] / (p.high - p.low)), case.spheres[worst],
            float(case.bars[worst, i]), 1e3 * float(case.needed[best, i]),
        )  # fmt: skip


def _sentences(found, names, cases: list[CandidateChain]) -> Iterator[str]:
    for i, p in enumerate(found):
        best = min(cases, key=lambda case: case.bars[:, i].min())
        sphere = int(best.bars[:, i].argmin())
        bar, where = best.bars[sphere, i], _where(best.values)
        share = bar / (p.high - p.low)
        if share > BARELY:
            yield (
                f"{p.name} is told by no sphere: its bar is as long as its bounds; record longer, "
                "or find fewer numbers."
            )
            continue
        how = "told" if share <= TOLD else "weakly told"
        yield (
            f"{p.name} is {how} best by sphere {best.spheres[sphere]}{where}: two sigma "
            f"{short(float(bar))} {p.unit}".rstrip()
            + f" of one impact, in records of {1e3 * best.needed[sphere, i]:.3g} ms or longer."
        )
    yield (
        "Bars are of one impact whose velocity and trigger are found with the rest; n impacts make "
        "them shorter by the root of n. They hold noise, not what the model does not know."
    )


def _where(values: dict[str, Any]) -> str:
    told = ", ".join(f"{key} = {value:g}" if isinstance(value, float) else f"{key} = {value}"
                     for key, value in values.items())  # fmt: skip
    return f" with {told}" if told else ""


def _panel(p: Parameter, i: int, cases: list[CandidateChain]) -> Panel:
    lines = [
        Line(_where(case.values).removeprefix(" with ") or None, np.array(case.spheres, float),
             case.bars[:, i] / (p.high - p.low), "o-")
        for case in cases[:8]
    ]  # fmt: skip
    return Panel("", "sphere that is watched", f"{p.name}\ntwo sigma over bounds", lines, "y")
