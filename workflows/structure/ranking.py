"""Ranking of parameters before a fit to measured modes: sensitivities of every parameter at the
values that the scene has, and a ranking by what the modes determine together.

It takes the projection that `tune` takes, so that nothing is solved on the mesh again.
"""

from collections.abc import Iterator
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from beadwave.fem.modes.mac import Shape, mac_near_double, paired
from beadwave.fem.updating.identifiability import (
    at_scene,
    frequency_sensitivity,
    mac_sensitivity,
    onset_stiffness,
    ranking,
)
from beadwave.fem.updating.tuning import TuningParameter
from beadwave.workflows.report.tables import aligned_text
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.stages.engine.progress import Progress
from beadwave.workflows.structure.parameters import freed, from_drawing, tunable
from beadwave.workflows.structure.tuning import (
    FrequencyErrors,
    frequency_errors,
    projected,
    unit,
)

ONSET_CHANGE = 0.01  # of a frequency, that a rigid or an open spring makes at its onset
FAR_TARGET = 0.1  # of a target from its mode, beyond which slopes at the scene say little
CLOSE_FREQUENCIES = 5e-3  # of two frequencies, below which shapes exchange as parameters change


class RankedParameter(BaseModel):
    """A parameter at the scene's value, and what it does to the targets."""

    name: str
    value: float  # [N/m, N m/rad]; 1 of a material or a mass, of which a factor is freed
    frequency: dict[str, float]  # d ln f / d ln value by the modes' numbers
    mac: dict[str, float | None] = {}  # d MAC / d ln value, of targets by shape
    rank: int | None = None  # None where it moves no target, or no more than those before it
    gain: float | None = None  # measurement errors explained beyond the parameters before it
    condition: float | None = None  # of the scaled sensitivities with those before it
    deviation: float | None = None  # of ln(value), with those before it free as well


class OnsetRow(BaseModel):
    """A joint's direction that is rigid or open, and the stiffness [N/m, N m/rad] at which it
    changes each mode by 1 %; None where it never does."""

    name: str
    now: Literal["rigid", "open"]
    stiffness: dict[str, float | None]


class RankReport(BaseModel):
    """Sensitivities and ranking of what may be freed."""

    scene: str
    match: dict[str, float]  # [Hz] wanted, by the modes' numbers
    frequency_error: dict[str, float]  # relative, of these
    computed_hz: dict[str, float]  # with the scene's values
    mac: dict[str, float]  # of targets by shape, with the scene's values
    parameters: list[RankedParameter]  # the ranked ones first
    onsets: list[OnsetRow]
    determined: list[str]  # together, within the error of the frequencies
    singular_values: list[float]  # of the scaled sensitivities, all parameters free
    remarks: list[str]

    def text(self) -> str:
        """Tables of modes, parameters and onsets, then sentences."""
        modes = [
            (
                n,
                f"{self.computed_hz[n]:.2f}",
                f"{hz:.2f}",
                f"{round(100 * (self.computed_hz[n] / hz - 1), 2) + 0.0:+.2f} %",
            )
            + ((f"{self.mac[n]:.2f}" if n in self.mac else None,) if self.mac else ())
            for n, hz in self.match.items()
        ]
        head = ("mode", "computed [Hz]", "wanted [Hz]", "apart", *(("MAC",) if self.mac else ()))
        numbers = [f"mode {n}" for n in self.match]
        rows = [
            (
                p.rank, p.name, f"{p.value:.4g}", unit(p.name),
                *(_four(slope) for slope in p.frequency.values()),
                None if p.gain is None else f"{p.gain:.3g}",
                None if p.condition is None else f"{p.condition:.3g}",
                None if p.deviation is None else f"{100 * p.deviation:.2g} %",
            )
            for p in self.parameters
        ]  # fmt: skip
        columns = ("rank", "d ln f / d ln value", "value", "", *numbers, "gain", "condition", "+-")
        tables = [aligned_text(head, modes), "", aligned_text(columns, rows)]
        if self.mac:
            by_mac = [f"mode {n}" for n in self.mac]
            rows = [
                (p.name, *(None if x is None else _four(x) for x in p.mac.values()))
                for p in self.parameters
            ]
            tables += ["", aligned_text(("d MAC / d ln value", *by_mac), rows)]
        if self.onsets:
            rows = [
                (
                    row.name,
                    row.now,
                    *(None if k is None else f"{k:.2g}" for k in row.stiffness.values()),
                )
                for row in self.onsets
            ]
            head = ("moves a mode by 1 % at", "now", *numbers)
            tables += ["", aligned_text(head, rows)]
        return "\n".join([*tables, "", *self.remarks])

    def __repr__(self) -> str:
        return self.text()


def _four(slope: float) -> str:
    """Four decimals, 0 without a sign."""
    return f"{round(slope, 4) + 0.0:.4f}"


def ranked(
    scene: Scene,
    match: dict[int, float],
    free: tuple[str, ...],
    progress: Progress,
) -> RankReport:
    """Sensitivities of the modes {number: Hz} to the parameters named, to all that the scene has
    without names, and their ranking.

    Raises InvalidScene for names that are not known, and where a mode is not among those computed.
    """
    names = free or tuple(tunable(scene))
    if not names:
        raise InvalidScene(
            f"{scene.name} has nothing to free: no joint, no isotropic material and no mass; add "
            "[[joints]]."
        )
    scene, known = from_drawing(scene, names, progress)
    _, basis, candidates = projected(scene, freed(scene, names, known), progress)

    # the modes at the scene's values, and which of them the targets are
    now = at_scene(basis, candidates)
    numbers = scene.measured_numbers
    at = paired(basis.forms, now.modes, basis.targets).index
    at = {n: int(at[numbers.index(n)]) for n in match}
    for n, i in at.items():
        if i < 0:
            raise InvalidScene(
                f"{scene.name}: no computed mode is like mode {n} of {match[n]:g} Hz; match "
                "others, or look at the modes by beadwave modes."
            )
    index = list(at.values())
    hz = now.modes.frequency_hz
    shapes = {n: t for n in match if isinstance(t := basis.targets[numbers.index(n)], Shape)}

    # springs that are rigid or open have no slope on a logarithmic scale, but an onset
    def state(p: TuningParameter) -> Literal["rigid", "open", "elastic"]:
        """That of all springs of a parameter; elastic where they differ."""
        ends = {np.inf: "rigid", 0.0: "open"}
        states = {ends.get(k, "elastic") for k in p.before} if p.springs else {"elastic"}
        return states.pop() if len(states) == 1 else "elastic"

    elastic = [p for p in candidates if state(p) == "elastic" and (p.springs or p.bodies)]

    # d ln f / d ln value (modes, parameters), over the errors of the measurement ranked by a QR
    # factorisation with pivoting
    slopes = frequency_sensitivity(basis, elastic, now)[index]
    errors = frequency_errors(scene, match)
    order = ranking(elastic, slopes, frequency_error=np.array([*errors.relative.values()]))
    of_mac = {
        str(n): mac_sensitivity(basis, elastic, now, target, at[n]) for n, target in shapes.items()
    }
    rows = []
    for j, p in enumerate(elastic):
        place = np.flatnonzero(order.order == j)
        row = RankedParameter(
            name=p.name,
            value=p.before[0] if p.springs else 1.0,
            frequency={str(n): float(x) for n, x in zip(match, slopes[:, j], strict=True)},
            mac={n: None if np.isnan(x[j]) else float(x[j]) for n, x in of_mac.items()},
        )
        if place.size:
            i = int(place[0])
            row.rank, row.gain = i + 1, float(order.gain[i])
            row.condition, row.deviation = float(order.condition[i]), float(order.deviation[i])
        rows.append(row)
    rows.sort(key=lambda row: np.inf if row.rank is None else row.rank)

    onsets = []
    for p in candidates:
        if (is_now := state(p)) != "elastic":
            k = {n: onset_stiffness(basis, p, now, i, ONSET_CHANGE) for n, i in at.items()}
            stiffness = {str(n): float(x) if np.isfinite(x) else None for n, x in k.items()}
            onsets.append(OnsetRow(name=p.name, now=is_now, stiffness=stiffness))

    determined = [row.name for row in rows[: order.n_determined]]
    remarks = [
        _on_determined(match, determined, errors),
        *_on_modes(match, at, hz),
    ]
    return RankReport(
        scene=scene.name,
        match={str(n): wanted for n, wanted in match.items()},
        frequency_error={str(n): s for n, s in errors.relative.items()},
        computed_hz={str(n): float(hz[i]) for n, i in at.items()},
        mac={
            str(n): float(
                mac_near_double(
                    t.shape[:, None], t.reading @ now.modes.phi, now.modes.frequency_hz
                )[0, at[n]]
            )
            for n, t in shapes.items()
        },
        parameters=rows,
        onsets=onsets,
        determined=determined,
        singular_values=order.singular.tolist(),
        remarks=remarks,
    )


def _on_determined(match: dict[int, float], determined: list[str], errors: FrequencyErrors) -> str:
    """Values that the modes determine, as --free takes them."""
    several, error = len(match) > 1, f"at {errors.text()}"
    mode = f"{'modes' if several else 'mode'} {', '.join(map(str, match))}"
    does = "determine together" if several else "determines"
    return (
        f"{mode} {does}, {error}: --free {','.join(determined)}."
        if determined
        else f"{mode}: no value of these is determined {error}; match others, or more."
    )


def _on_modes(
    match: dict[int, float], at: dict[int, int], hz: NDArray[np.float64]
) -> Iterator[str]:
    """Sentences on modes far from their targets or close to a neighbour, places `at` among all
    computed frequencies."""
    apart = {n: hz[i] / match[n] - 1 for n, i in at.items()}
    if far := [f"mode {n} ({100 * x:+.0f} %)" for n, x in apart.items() if abs(x) > FAR_TARGET]:
        yield (
            f"Far from the target: {', '.join(far)}. Sensitivities at the fitted values will "
            "differ, rank again after a fit."
        )
    for n, i in at.items():
        others = np.delete(hz, i)
        nearest = others[np.abs(np.log(np.maximum(others, 1e-9) / hz[i])).argmin()]
        if abs(nearest / hz[i] - 1) < CLOSE_FREQUENCIES:
            yield (
                f"mode {n} has a neighbour at {nearest:.2f} Hz: their shapes exchange as "
                "parameters change, and sensitivities with them."
            )
