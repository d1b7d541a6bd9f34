"""The report of an inspection: a row per number, what the records leave, and sentences."""

from textwrap import fill

import numpy as np
from pydantic import BaseModel

from coupling.inspection.information import bars_over_time, bounds_information, felt_from
from coupling.inspection.inversion import Inversion, scales
from coupling.records.record import SYNTHETIC
from workflows.files.records import Recorded
from workflows.inspection.inspect import SETTLED, Inspected
from workflows.results.tables import LINE, Table, text

TOLD = 0.1  # two-sigma bar over the bounds' distance: a number that the records tell
BARELY = 0.5  # the same: one that they tell weakly
COLOURED = 1.3  # memory of a residual that is not white
MISSED = 0.3  # of a bar, by the step of the model
STRETCHED = 1.05  # of a bar, worth a sentence
ALIKE = 0.9  # correlation worth a sentence
AT_BOUND = "at its bound"
INSTANTS = 60  # record lengths for which bars are told


class NumberRow(BaseModel):
    """One number; `told` says what its bar is beside its bounds."""

    name: str
    unit: str
    low: float | None
    high: float | None
    found: float
    two_sigma: float
    told: str  # "yes", "weakly", "no", "at its bound"


class InspectionReport(BaseModel):
    """What was found, how far to believe it, and what the records do not tell."""

    scene: str
    records: list[str]
    sensors: list[str]
    synthetic: bool
    numbers: list[NumberRow]
    others: list[NumberRow]  # of the records: velocities, triggers, gains
    correlation: list[list[float]]  # of the numbers
    misfit: list[list[float]]  # rms over the noise, by record and sensor
    noise: list[list[float]]  # rms, in the sensors' units
    explained: bool
    record_length_s: list[float]
    two_sigma_by_length: dict[str, list[float]]
    walls: int
    wall_missed: float | None
    rivals: list[dict[str, float]]  # other numbers that explain the records as well
    starts: int
    seconds: float
    remarks: list[str]

    def text(self) -> str:
        """Two tables, and sentences on lines that a terminal holds."""
        face = [SYNTHETIC] if self.synthetic else []
        whole = float(np.sqrt(np.mean(np.square(self.misfit))))
        verdict = (
            f"The model leaves {whole:.3g} times the noise of {_counted(len(self.records))}; "
            f"{self.seconds:.1f} s."
        )
        told = (fill(remark, LINE, subsequent_indent="  ") for remark in self.remarks)
        return "\n".join(
            [*face, _table(self.numbers, 5), "", _table(self.others, 3), "", verdict, *told]
        )


def _counted(n: int) -> str:
    return f"{n} record{'s' * (n != 1)}"


def _table(rows: list[NumberRow], n_columns: int) -> str:
    columns = ("number", "found", "two sigma", "bounds", "told")[:n_columns]
    cells = [_cells(row)[:n_columns] for row in rows]
    return text(Table("", columns, tuple(cells)))


def _cells(row: NumberRow) -> tuple[str, ...]:
    name = f"{row.name} [{row.unit}]" if row.unit else row.name
    ends = "" if row.low is None else f"{row.low:.4g} to {row.high:.4g}"
    return name, f"{row.found:.6g}", f"{row.two_sigma:.2g}", ends, row.told


def report_of(found: Inspected, records: tuple[Recorded, ...]) -> InspectionReport:
    """Rows, bars over the records' length, and what there is to be said."""
    inversion, n = found.inversion, found.n_shared
    t, bars = _bars_by_length(found)
    rows = _rows(inversion)
    between = found.structure.between
    report = InspectionReport(
        scene=found.scene.name,
        records=[one.name for one in records],
        sensors=[channel.name for channel in records[0].channels],
        synthetic=any(one.synthetic for one in records),
        numbers=rows[:n],
        others=rows[n:],
        correlation=inversion.uncertainty.correlation[:n, :n].tolist(),
        misfit=inversion.misfit.tolist(),
        noise=[shot.noise.tolist() for shot in found.fit.shots],
        explained=not found.noise_known or inversion.explained,
        record_length_s=t.tolist(),
        two_sigma_by_length={row.name: bars[:, i].tolist() for i, row in enumerate(rows[:n])},
        walls=between.n_walls if between else 0,
        wall_missed=between.missed.frequency if between else None,
        rivals=[_rival(one, n) for one in found.rivals],
        starts=inversion.search.starts,
        seconds=found.seconds,
        remarks=[],
    )  # fmt: skip
    report.remarks += [*_on_misfit(found, report), *_on_rivals(report)]
    report.remarks += [*_on_numbers(found, report), *_on_wall(found)]
    return report


def _rows(inversion) -> list[NumberRow]:
    bars = inversion.uncertainty.two_sigma
    return [
        NumberRow(
            name=p.name, unit=p.unit, found=float(x), two_sigma=float(bar),
            low=p.low if np.isfinite(p.high) else None,
            high=p.high if np.isfinite(p.high) else None,
            told=AT_BOUND if held and bar < BARELY * (p.high - p.low)
            else _told(bar / (p.high - p.low)),
        )
        for p, x, bar, held in zip(
            inversion.parameters, inversion.value, bars, inversion.at_bound, strict=True
        )
    ]  # fmt: skip


def _told(share: float) -> str:
    return "yes" if share <= TOLD else "weakly" if share <= BARELY else "no"


def _bars_by_length(found: Inspected) -> tuple[np.ndarray, np.ndarray]:
    """Times (k,) [s] since the first touch, and the bars (k, p) of records that end there."""
    inversion, t = found.inversion, found.fit.shots[0].t
    k = len(t)
    ends = np.unique(np.linspace(k / INSTANTS, k, INSTANTS).astype(int))
    bars = bars_over_time(inversion.slopes, bounds_information(inversion.parameters), ends)
    trigger = inversion.value[found.fit.unknowns.trigger[0]]
    return t[ends - 1] - trigger, bars * scales(inversion.parameters)


def _on_misfit(found: Inspected, report: InspectionReport):
    """What the residual says of the model."""
    inversion = found.inversion
    whole = inversion.whole_misfit
    if not found.noise_known:
        yield (
            "The records do not tell their noise, 1 % of the largest signal is taken: whether "
            f"{whole:.3g} times of it is noise or a wrong model remains open; measure repeats."
        )
    elif not report.explained:
        worst = max(inversion.parts, key=lambda part: part.misfit)
        yield (
            f"THE MODEL DOES NOT EXPLAIN THE RECORDS: it leaves {whole:.3g} times their noise, and "
            f"{worst.misfit:.3g} times from {1e3 * worst.begin:.3g} to {1e3 * worst.end:.3g} ms of "
            f"{report.records[worst.record]}. The structure is another than the scene says, a "
            "number that is off was not among those to find, or the search has missed it (give "
            "more --starts or narrower --bounds); do not rely on what was found, nor on its bars."
        )
    if inversion.memory > COLOURED:
        yield (
            "What is left goes on from sample to sample (its variance is "
            f"{inversion.memory:.3g} times that of its differences): the bars count with that."
        )


def _rival(other: Inversion, n: int) -> dict[str, float]:
    names = [p.name for p in other.parameters[:n]]
    return dict(zip(names, other.value[:n].tolist(), strict=True))


def _on_rivals(report: InspectionReport):
    for rival in report.rivals:
        told = ", ".join(f"{name} = {value:.6g}" for name, value in rival.items())
        yield (
            f"THE RECORDS CANNOT TELL THIS ANSWER FROM ANOTHER: {told} leaves as little. Bars are "
            "of the one alone; narrow --bounds by what is known, or record for longer."
        )


def _on_numbers(found: Inspected, report: InspectionReport):
    """What the records do not tell, or only together."""
    inversion, n = found.inversion, found.n_shared
    silent = [row for row in report.numbers if row.told == "no"]
    for row in silent:
        yield _why_silent(found, row)
    for row in (*report.numbers, *report.others):
        if row.told == AT_BOUND:
            yield f"{row.name} lies at its bound {row.found:.4g} or beyond: {_wider(row)}."
    names = [row.name for row in report.numbers]
    for i in range(n):
        for j in range(i):
            r = report.correlation[i][j]
            if abs(r) > ALIKE and not silent:
                way = "together" if r > 0 else "one up and one down"
                yield (
                    f"{names[j]} and {names[i]} move {way} at almost no cost (correlation "
                    f"{r:.2f}): each alone is known far worse than the two of them."
                )
    if inversion.stretch > STRETCHED:
        yield (
            f"The misfit rises more slowly than a parabola: bars are up to {inversion.stretch:.2g} "
            "times as long as its curvature says."
        )
    if silent or any(row.told == "weakly" for row in report.numbers):
        worst = inversion.uncertainty.combinations[0]
        yield f"Least told by the records: {worst.text(inversion.parameters)}."


def _wider(row: NumberRow) -> str:
    return "say with --each where it starts" if ", record" in row.name else "widen --bounds"


def _why_silent(found: Inspected, row: NumberRow) -> str:
    """A number that the records do not tell: whether any wave in them has felt it."""
    inversion, t = found.inversion, found.fit.shots[0].t
    touch = inversion.value[found.fit.unknowns.trigger[0]]
    i = [p.name for p in inversion.parameters].index(row.name)
    width = np.array([p.high - p.low for p in inversion.parameters]) / scales(inversion.parameters)
    felt, length = felt_from(inversion.slopes, width, TOLD)[i], 1e3 * (t[-1] - touch)
    said = f"The records do not tell {row.name}: its bar is as long as its bounds"
    if felt < len(t):
        return (
            f"{said}. Waves feel it from {1e3 * (t[felt] - touch):.3g} ms on, but other numbers do "
            f"the same to them: find fewer, or record for longer than {length:.3g} ms."
        )
    return (
        f"{said}, and were all else known, no wave within their {length:.3g} ms would tell it: the "
        "first wave that a structure sends back hardly feels its far ends, nor a load along it. "
        "Record later waves as well."
    )


def _on_wall(found: Inspected):
    """How far the interpolation and the step of the model may be believed."""
    between, inversion = found.structure.between, found.inversion
    if between:
        yield (
            f"The wall lies between {between.n_walls} that were computed; one that is left out is "
            f"missed by up to {100 * between.missed.frequency:.2g} % in the frequency of a mode. "
            f"The one computed at the answer moved it by {found.moved:.2g} of its bars at last."
        )
        if found.moved > SETTLED:
            yield "Walls between others are not good enough there for the bars: narrow --bounds."
    if inversion.step_error > 1.0:
        yield (
            f"The step of the model is seen in the signals by up to {inversion.step_error:.2g} "
            "times the noise: the bars do not hold it."
        )
