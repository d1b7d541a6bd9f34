"""Joint stiffnesses fitted to chosen hammer-test modes: from a scene to a tuned scene.

One reduction to some fifty shapes, then a fit in tenths of a second, then the full model with the
fitted stiffnesses as a judge.
"""

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from re import sub
from time import perf_counter
from typing import Any, Literal, NamedTuple

import numpy as np
from pydantic import BaseModel

from beadwave.fem.modes.mac import paired
from beadwave.fem.updating.tuning import (
    Tuning,
    TuningBasis,
    TuningParameter,
    determined,
    deviation_of_others,
    spectrum,
    tune,
)
from beadwave.workflows.files.output_file import OutputFile
from beadwave.workflows.files.scene import Source, Written, completed, scene_text
from beadwave.workflows.files.scene import scene as load_scene
from beadwave.workflows.report.number_format import supported
from beadwave.workflows.report.summary import MeshNumbers
from beadwave.workflows.report.tables import aligned_text
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.scene.named_files import every_file_key
from beadwave.workflows.scene.rig import RigScene
from beadwave.workflows.scene.scene import LONGEST_NAME
from beadwave.workflows.scene.tables.bodies import MeasuredMode
from beadwave.workflows.scene.toml import parsed, toml
from beadwave.workflows.stages.engine.pipeline import Pipeline, pipeline_of
from beadwave.workflows.stages.engine.progress import Progress
from beadwave.workflows.stages.engine.stage_table import has_sizes_chosen
from beadwave.workflows.stages.errors.mesh_causes import FINEST_SCALE, Cause, refinement, size_for
from beadwave.workflows.stages.structure.targets import remarks_on_axes
from beadwave.workflows.stages.warnings import mesh_above_asked as above_asked
from beadwave.workflows.stages.warnings import overloaded_bolts
from beadwave.workflows.structure.parameters import (
    FACTORS,
    at_values,
    freed,
    from_drawing,
    on_bodies,
    scene_values,
    usual,
)

# Relative errors of frequencies by which a fit is judged
DISAGREEMENT = 1e-3  # of the full model and the projection
MESH_ERROR = 0.01  # of a mesh that is fine enough to tune on; finer ones halve the error
BEYOND = 2.0  # deviations of a drawing, beyond which a fitted value is said to contradict it
AT_BOUND = 1e-3  # of a value from its bound
LARGEST_MISS = 0.05  # of a fit: three times what the thesis' own matches miss, table 5.3


class FrequencyErrors(NamedTuple):
    """Relative standard deviations of the frequencies that a fit is to meet."""

    relative: dict[int, float]  # by the modes' numbers
    measured: tuple[int, ...]  # modes whose deviation is that of their test
    least: float  # below which none is taken

    def text(self) -> str:
        """In words: "0.1 % in frequency", or the test's own deviations and where they are not
        taken."""
        assumed = [n for n in self.relative if n not in self.measured]
        if not self.measured:
            return f"{100 * self.relative[assumed[0]]:g} % in frequency"
        ends = [min, max]
        low, high = (f"{100 * end(self.relative[n] for n in self.measured):.2g}" for end in ends)
        parts = [f"{low} %" if low == high else f"{low} to {high} %"]
        if any(self.relative[n] == self.least for n in self.measured):
            parts.append(f"none below {100 * self.least:g} % is taken")
        if assumed:
            listed = ", ".join(map(str, assumed))
            parts.append(f"{100 * self.relative[assumed[0]]:g} % for mode {listed} without one")
        return f"the test's own deviations in frequency ({'; '.join(parts)})"


def frequency_errors(
    scene: Scene,
    match: Mapping[int, float],
    *,
    assumed: float = 1e-3,
    least: float = 1e-4,
) -> FrequencyErrors:
    """Errors of the modes {number: Hz}: hz_deviation of their targets, where the frequency is the
    target's and this is known, else `assumed`. None is below `least`, since no model is closer than
    that to what it stands for, however long a test was averaged."""
    tables = dict(zip(scene.measured_numbers, scene.targets or (), strict=True))
    of_test = {
        n: table.hz_deviation / table.hz
        for n, hz in match.items()
        if (table := tables[n]).hz_deviation is not None and table.hz == hz
    }
    relative = {n: max(of_test[n], least) if n in of_test else assumed for n in match}
    return FrequencyErrors(relative, tuple(of_test), least)


def unit(name: str) -> str:
    """Unit of a fitted value: of a stiffness by its direction, the last word of its name; of a
    material's value or a spring's between points, which is a factor, what it multiplies."""
    if name.endswith(FACTORS) or name.startswith("springs."):
        return "of the rest's" if name.startswith("block.") else "of the scene's"
    return "N m/rad" if name.rpartition(".")[2].startswith("kr") else "N/m"


class TuningReport(BaseModel):
    """A fit: frequencies wanted and met, fitted values with their deviations, remarks."""

    scene: str
    match: dict[str, float]  # [Hz] wanted; this and the next three by the modes' numbers
    modes_hz: dict[str, float]
    full_order_hz: dict[str, float]
    computed_mode: dict[str, int]  # number of the full model's mode that each is paired with
    stiffness: dict[str, float]
    deviation: dict[str, float | None]
    frequency_error: dict[str, float]  # relative, of the modes wanted, on which deviations rest
    undetermined: dict[str, float | Literal["rigid"]]  # keys of the scene, the values they keep
    held_out_hz: dict[str, float] = {}  # measured, of targets that had no part in the fit
    mac: dict[str, float]  # with the shape of stiff joints
    measured_mac: dict[str, float] = {}  # with the measured shape, of targets that have one
    mesh_error_percent: dict[str, float] = {}  # the full model's frequencies are too high by
    mesh: MeshNumbers | None = None  # of mesh.error, at the fitted values
    between_hz: list[float]
    evaluations: int
    seconds: float
    remarks: list[str]

    def text(self) -> str:
        """Aligned lines, then sentences."""
        modes = []
        for i, fitted in self.modes_hz.items():
            measured = self.match.get(i, self.held_out_hz.get(i))
            frequencies = measured, fitted, self.full_order_hz.get(i)
            hz = (None if x is None else f"{x:.2f}" for x in frequencies)
            error = self.mesh_error_percent.get(i)
            of_mesh = None if error is None else f"{error:.2g} %"
            computed = self.computed_mode.get(i)
            of_shape = self.measured_mac.get(i)
            macs = (f"{self.mac[i]:.2f}",)
            if self.measured_mac:
                macs = (None if of_shape is None else f"{of_shape:.2f}", *macs)
            row = (i, computed, *hz, of_mesh, *macs)
            if self.held_out_hz:
                off = None if measured is None else f"{100 * (fitted / measured - 1):+.2f} %"
                row += (off, "not fitted" if i in self.held_out_hz else "")
            modes.append(row)
        values = []
        for name, value in self.stiffness.items():
            spread = self.deviation[name]
            text = "not determined by these modes" if spread is None else f"+- {100 * spread:.2g} %"
            values.append((name, f"{value:.5g}", unit(name), text))
        cost = f"{self.evaluations} evaluations in {self.seconds:.2f} s"
        head = (
            "mode", "computed", "wanted [Hz]", "fitted [Hz]", "full model [Hz]", "mesh error",
            *(("measured MAC", "stiff MAC") if self.measured_mac else ("MAC",)),
            *(("off", "") if self.held_out_hz else ()),
        )  # fmt: skip
        return "\n".join(
            [
                aligned_text(head, modes), "", aligned_text(("value", "fitted", "", ""), values),
                "", cost, *self.remarks,
            ]
        )  # fmt: skip

    @property
    def failures(self) -> list[str]:
        """A sentence on each mode that is missed by more than a fit of it may be."""
        return [
            f"mode {n} of {self.match[n]:g} Hz is missed by {100 * error:+.3g} %, where a fit "
            f"may miss {100 * LARGEST_MISS:g} %; free what moves this mode, or match "
            "others."
            for n, error in _misses(self.modes_hz, self.match).items()
        ]


def _misses(modes_hz: Mapping[Any, float], match: Mapping[Any, float]) -> dict[Any, float]:
    """Relative errors, by number, of modes missed by more than `largest_miss`; nan counts
    as missed."""
    errors = {n: modes_hz[n] / hz - 1 for n, hz in match.items()}
    return {n: error for n, error in errors.items() if not abs(error) <= LARGEST_MISS}


def fit_to_these(
    basis: TuningBasis,
    parameters: list[TuningParameter],
    places: Sequence[int],
    hz: Sequence[float],
    errors: Sequence[float],
) -> tuple[Tuning, Sequence[TuningParameter]]:
    """The fit to the targets at these places, in which the others have no part, shapes included;
    and the parameters that these determine, all where one is missed. `modes_hz` and `all_hz` are of
    all targets.

    hz [Hz] and the relative errors are those of the places. Derivatives at values that miss a mode
    by far say nothing of the values that would meet it.
    """
    of_match = basis._replace(targets=tuple(basis.targets[i] for i in places))
    wanted, by_error = dict(enumerate(hz, start=1)), dict(enumerate(errors, start=1))
    fit = tune(of_match, parameters, wanted, frequency_error=by_error)
    subset: Sequence[TuningParameter] = parameters
    if not _misses(dict(enumerate(fit.modes_hz.tolist(), start=1)), wanted):
        subset = determined(of_match, parameters, wanted, fit, frequency_error=by_error)

    # all targets at the fitted values; those matched keep the partners that the fit gave them
    modes = spectrum(basis, parameters, fit.value)
    index = paired(basis.forms, modes, basis.targets).index
    index[list(places)] = paired(of_match.forms, modes, of_match.targets).index
    modes_hz = np.where(index < 0, np.nan, modes.frequency_hz[index])
    return fit._replace(modes_hz=modes_hz, all_hz=modes.frequency_hz[: index.max() + 1]), subset


def tuned(
    scene: Scene, match: dict[int, float], free: tuple[str, ...], progress: Progress
) -> tuple[Scene, TuningReport]:
    """The scene with fitted joints, and the report.

    match  {mode: Hz} wanted, modes by `Scene.measured_numbers`
    free   names of what may vary, `usual` ones of the rig without any

    Sizes of elements that mesh.error chooses are those of the scene's own values; where they leave
    a larger error at the fitted ones, they are chosen there and the fit is repeated once. Raises
    InvalidScene for what has no joints, and where the modes determine no parameter though they are
    met.
    """
    result, report = _tuned_on(scene, match, free, progress)
    chosen = has_sizes_chosen(scene) and not scene.mesh.sizes
    if chosen and pipeline_of(result, progress)("mesh-numbers").bounded_by == "sizes":
        anew = scene.with_sizes_of(result.with_sizes_of(None))
        result, report = _tuned_on(anew, match, free, progress)
        again = "Sizes of elements were chosen again at fitted values, and the fit was repeated."
        report = report.model_copy(update={"remarks": [again, *report.remarks]})
    return result.with_sizes_of(None), report


def _tuned_on(
    scene: Scene, match: dict[int, float], free: tuple[str, ...], progress: Progress
) -> tuple[Scene, TuningReport]:
    """As `tuned`, with elements of the sizes that the scene chooses at its own values."""
    scene, known = from_drawing(scene, free, progress)
    candidates = freed(scene, free or usual(scene, match), known)

    # a fit of all candidates, then again of those alone that the modes determine; the others stay
    # as they were in the scene
    parameters, of_all = candidates, None
    number = scene.measured_numbers
    errors = frequency_errors(scene, match)
    wanted = [number.index(n) for n in match], [*match.values()], [*errors.relative.values()]
    while True:
        loose, basis, parameters = projected(scene, parameters, progress)
        started = perf_counter()
        fit, subset = fit_to_these(basis, parameters, *wanted)
        of_all = fit if of_all is None else of_all
        modes_hz = dict(zip(number, map(float, fit.modes_hz), strict=True))
        if beyond := [n for n in match if not np.isfinite(modes_hz[n])]:
            raise InvalidScene(
                f"{scene.name}: mode {beyond[0]} is beyond the modes that are computed for a fit; "
                "match lower ones."
            )
        seconds = perf_counter() - started
        if len(subset) == len(parameters):
            break
        if not subset:
            names = ", ".join(p.name for p in of_all.parameters)
            raise InvalidScene(
                f"{scene.name}: no value of --free {names} is determined by mode "
                f"{', '.join(map(str, match))}, nothing is tuned; free what moves these modes, or "
                "match others."
            )
        parameters = subset

    # bars hold though stiffnesses that the modes leave open are wrong by a factor of two; modes
    # that are missed by more than their errors tell of the model: bars are as wide as that
    fitted_names = [p.name for p in fit.parameters]
    left_out = [p for p in candidates if p.name not in fitted_names]
    places, hz, of_each = wanted
    of_match = basis._replace(targets=tuple(basis.targets[i] for i in places))
    by_number, by_error = (dict(enumerate(values, start=1)) for values in (hz, of_each))
    beside = deviation_of_others(of_match, fit, by_number, left_out, frequency_error=by_error)
    fit = fit._replace(deviation=beside)
    spare = len(match) - len(fit.parameters)
    scatter = max(1.0, np.sqrt(fit.misfit / spare)) if spare > 0 else 1.0
    fit = fit._replace(deviation=fit.deviation * scatter)

    # the full model with the fitted values, to the digits that their deviations support, is the
    # judge of the projection
    fitted = [supported(x, x * s) for x, s in zip(fit.value, fit.deviation, strict=True)]
    fit = fit._replace(value=np.array(fitted))
    result = at_values(loose, fit.parameters, fit.value)
    result = result.remeasured({n: {"hz": hz} for n, hz in match.items()}).with_sizes_of(scene)
    full = pipeline_of(result, progress)
    computed, mac = full("modes"), shape_mac(full)
    confirmed = {str(number[int(i) - 1]): hz for i, hz in computed.paired_hz.items()}
    measured_mac = {
        str(n): float(computed.score[k])
        for k, (n, target) in enumerate(zip(number, result.targets or (), strict=True))
        if target.shape and computed.index[k] >= 0
    }

    # the measured shape is the proof of a joint where there is one, else that of stiff joints
    likeness = {i: (value, "that of stiff joints") for i, value in mac.items()}
    likeness |= {i: (value, "the measured one") for i, value in measured_mac.items()}

    # what the mesh is worth in these modes, in percent
    by_mesh = full("missed-energy")
    of_mesh, shapes = by_mesh.of_frequencies(computed.omega), by_mesh.shapes_of(computed.omega)
    mesh_percent = {
        str(i): 100 * float(of_mesh[j])
        for i, j in zip(number, computed.index, strict=True)
        if j >= 0 and np.isfinite(of_mesh[j])
    }
    causes = {
        str(i): by_mesh.causes[shapes[j]]
        for i, j in zip(number, computed.index, strict=True)
        if j >= 0 and by_mesh.causes and shapes[j] >= 0
    }

    # what the report says: modes that had no part, values that stay as they are in the scene
    held_out = {str(n): hz for n, hz in scene.measured_modes.items() if n not in match}
    names = [p.name for p in fit.parameters]
    undetermined = [p for p in candidates if p.name not in names]
    unchanged = {key: value for p in undetermined for key, value in scene_values(scene, p)}
    report_hz = {str(n): hz for n, hz in modes_hz.items()}
    computed_mode = {n: int(j) + 1 for n, j in zip(number, computed.index, strict=True) if j >= 0}
    of_numbers = []
    if (scene.floats or scene.springs) and result.targets:
        of_numbers = on_numbers(result, computed_mode)
    of_mesh = full("mesh-numbers") if has_sizes_chosen(result) else None
    report = TuningReport(
        scene=scene.name,
        match={str(n): hz for n, hz in match.items()},
        modes_hz=report_hz,
        full_order_hz=confirmed,
        computed_mode={str(n): j for n, j in computed_mode.items()},
        stiffness=dict(zip(names, map(float, fit.value), strict=True)),
        deviation={
            name: float(s) if np.isfinite(s) else None
            for name, s in zip(names, fit.deviation, strict=True)
        },
        frequency_error={str(n): s for n, s in errors.relative.items()},
        undetermined={key: "rigid" if np.isinf(x) else x for key, x in unchanged.items()},
        held_out_hz=held_out,
        mac=mac,
        measured_mac=measured_mac,
        between_hz=[float(hz) for hz in fit.all_hz if not np.any(np.isclose(hz, fit.modes_hz))],
        evaluations=fit.evaluations,
        seconds=seconds,
        mesh_error_percent=mesh_percent,
        mesh=of_mesh,
        remarks=[
            *of_numbers,
            *(remarks_on_axes(scene) if any(t.shape for t in scene.targets or ()) else ()),
            *_remarks(scene, match, fit, of_all, unchanged, candidates, confirmed, likeness),
            *beyond_the_drawing(fit),
            *worth_of_the_bars(errors, scatter, spare),
            *worth_of_the_mesh(scene, match, report_hz, mesh_percent, causes),
            *(() if of_mesh is None else above_asked(of_mesh)),
            *overloaded_bolts(scene.utilisations),
        ],
    )
    return result, report


def on_numbers(scene: Scene, computed_mode: dict[int, int]) -> list[str]:
    """A sentence on the numbers of targets {number: computed mode} where modes are rigid motions as
    well, which have none; nothing where no target has a number."""
    by_number = {t.number for t in scene.targets} & computed_mode.keys()
    counted = [f"{n} is mode {computed_mode[n]}" for n in sorted(by_number)]
    if counted:
        return [
            "numbers of targets count modes that strain bodies or joints, not rigid motions, "
            f"free or on springs: {', '.join(counted)}."
        ]
    return []


def _remarks(
    scene: Scene,
    match: dict[int, float],
    fit: Tuning,
    of_all: Tuning,
    unchanged: dict[str, float],
    candidates: Sequence[TuningParameter],
    confirmed: dict[str, float],
    likeness: dict[str, tuple[float, str]],
) -> list[str]:
    """Sentences on the reliability of a fit. `of_all` is the fit of all candidates; `unchanged` has
    the scene's keys, with their values, that the modes do not determine; `likeness` the MAC of each
    mode and with which shape."""
    names, remarks = [p.name for p in fit.parameters], []
    numbers = scene.measured_numbers
    fitted, met_by_all = (
        dict(zip(numbers, map(float, one.modes_hz), strict=True)) for one in (fit, of_all)
    )

    # values that are not determined, and values at the end of what they may be
    modes = "mode " + ", ".join(map(str, match))
    for key, x in unchanged.items():
        value = "rigid" if np.isinf(x) else f"{x:g}"
        remarks.append(f"{key} is not determined by {modes}: it stays {value}.")
    if unchanged:
        remarks.append(
            f"The fit was repeated with what these modes determine: --free {','.join(names)}."
        )

    for parameter, x in zip(fit.parameters, fit.value, strict=True):
        for bound in (parameter.lower, parameter.upper):
            if abs(np.log(x / bound)) < AT_BOUND:
                remarks.append(
                    f"{parameter.name} ends at its bound, {bound:.3g} {unit(parameter.name)}: "
                    "these modes ask for more than it may do; free another value, or look at the "
                    "targets."
                )

    # modes that are missed now and were met while all were free: of a joint much stiffer than its
    # scene has it, the modes give a lower bound of the stiffness and no more
    contradicted = [
        f"mode {n}"
        for n, hz in match.items()
        if abs(fitted[n] / hz - 1) > DISAGREEMENT and abs(met_by_all[n] / hz - 1) < DISAGREEMENT / 2
    ]
    if contradicted:
        values = [
            f"{p.name} = {x:.3g} ({unit(p.name)})"
            for p, x in zip(of_all.parameters, of_all.value, strict=True)
            if p.name not in names
        ]
        remarks.append(
            f"{', '.join(contradicted)} would be met with {', '.join(values)}, which the modes do "
            "not determine: set a value like this in the scene, inf for rigid, and tune again."
        )

    # modes that are missed, and why two of the rig's contradict each other
    missed = {n: fitted[n] / hz - 1 for n, hz in match.items()}
    for n, error in missed.items():
        if abs(error) > DISAGREEMENT:
            remarks.append(f"mode {n} is missed by {100 * error:+.1f} %.")
    has_free_turn = {"head.kz", "head.kry"} <= {p.name for p in candidates}
    conflict = isinstance(scene, RigScene) and {2, 3} <= match.keys() and not has_free_turn
    if conflict and max(map(abs, missed.values())) > DISAGREEMENT:
        remarks.append(
            "Modes 2 and 3 both shear the joints along x: one stiffness for x and z that is soft "
            "enough for mode 2 pulls mode 3 down with it. Free head.kz and head.kry instead."
        )

    # the full model against the projection, and shapes that are not those meant
    for i, hz in confirmed.items():
        if abs(fitted[int(i)] / hz - 1) > DISAGREEMENT:
            remarks.append(
                f"the full model has mode {i} at {hz:.2f} Hz: the projection is inaccurate."
            )
    for compared in dict.fromkeys(words for _, words in likeness.values()):
        unlike = {i: x for i, (x, words) in likeness.items() if x < 0.8 and words == compared}
        if len(unlike) == 1:
            ((i, value),) = unlike.items()
            subject = f"the shape of mode {i} has a MAC of {value:.2f} with {compared}"
        else:
            modes, values = ", ".join(unlike), ", ".join(f"{x:.2f}" for x in unlike.values())
            subject = f"the shapes of modes {modes} have a MAC of {values} with {compared}"
        if unlike:
            remarks.append(f"{subject}: a frequency that matches is no proof of the joint.")
    return remarks


def beyond_the_drawing(fit: Tuning) -> list[str]:
    """Sentences on joints that are known from their drawing, and values that a fit moved beyond
    what that says of them."""
    sentences, known = [], [p for p in fit.parameters if p.known]
    for p, x in zip(fit.parameters, fit.value, strict=True):
        if p.known and abs(moved := np.log(x / p.before[0]) / p.known) > BEYOND:
            sentences.append(
                f"{p.name} is {x / p.before[0]:.3g} times what its drawing says, {p.before[0]:.4g} "
                f"{unit(p.name)}, {abs(moved):.2g} of its deviations away: look at preload, faces "
                "and washer of this joint."
            )
    if known and not sentences:
        sentences.append(
            f"{', '.join(p.name for p in known)} moved by less than {BEYOND:g} deviations from "
            "what the drawing says."
        )
    return sentences


def worth_of_the_bars(errors: FrequencyErrors, scatter: float, spare: int) -> list[str]:
    """Sentences on what bars rest on, where that is a test's own deviations or a model that misses
    the modes; `spare` modes are more than the values fitted."""
    sentences = [f"Bars rest on {errors.text()}."] if errors.measured else []
    if scatter > 1:
        sentences.append(
            f"The modes scatter about the fit by {scatter:.2g} times these errors"
            f"{'' if errors.measured else f' ({errors.text()})'}: bars are widened by that."
        )
    elif errors.measured and spare <= 0:
        sentences.append(
            "There are no more modes than values, so nothing shows what the model misses: bars "
            "hold the errors of the measurement alone."
        )
    return sentences


def worth_of_the_mesh(
    scene: Scene,
    match: dict[int, float],
    modes_hz: Mapping[str, float],
    mesh_percent: Mapping[str, float],
    causes: Mapping[str, Cause],
) -> list[str]:
    """A sentence where the mesh makes more of a mode than the fit misses, and more than a fit may
    miss, with the size of elements that brings it to what both allow."""
    worst = max((n for n in match if str(n) in mesh_percent), default=None,
                key=lambda n: mesh_percent[str(n)])  # fmt: skip
    if worst is None:
        return []
    error, missed = mesh_percent[str(worst)], 100 * abs(modes_hz[str(worst)] / match[worst] - 1)
    if error <= max(missed, 100 * DISAGREEMENT):
        return []
    sentence = (
        f"the mesh makes mode {worst} {error:.2g} % too high, more than the fit misses "
        f"({missed:.2g} %): the fitted values make up for it."
    )

    def keys(times: float, percent: float) -> str:
        return refinement(scene, times, percent / 100).rstrip(",")

    if (cause := causes.get(str(worst))) is None:  # of few elements nothing is known but that
        return [f"{sentence} Tune again with {keys(0.5, error / 2)}."]
    wanted = max(missed, min(100 * MESH_ERROR, error / 2))
    times = size_for(wanted, error, cause)
    if times < FINEST_SCALE and cause.remedy:
        return [
            f"{sentence} It arises {cause.place}, where errors fall slowly with their size: take "
            f"{cause.remedy}, or {keys(FINEST_SCALE, wanted)}, and tune again."
        ]
    return [f"{sentence} Bring it to {wanted:.2g} % with {keys(times, wanted)}, and tune again."]


def targets(match: str, measured: Mapping[int, float]) -> dict[int, float]:
    """The modes named in "1,3,4", or "1=51.2,3=905" with frequencies of one's own; `measured` has
    those of the scene [Hz] by number. Raises InvalidScene for modes that the scene does not have,
    for one that comes twice and for what is no frequency."""
    pairs = [item.partition("=") for item in match.split(",")]

    # a frequency that is none of a mode that there is has a sentence of its own
    for n, eq, text in pairs:
        try:
            hz = float(text) if eq else 1.0
        except ValueError:
            hz = np.nan
        if n.strip() in map(str, measured) and not 0 < hz < np.inf:
            raise InvalidScene(
                f"--match {n}={text}: {text.strip() or 'nothing'} is no frequency above 0 in Hz, "
                f"without a unit; write {n}={measured[int(n)]:g}, for example."
            )
    try:
        wanted = {int(n): float(hz) if eq else measured[int(n)] for n, eq, hz in pairs}
    except (ValueError, KeyError):
        wanted = {}
    if len(wanted) < len(pairs) or not all(
        n in measured and 0 < hz < np.inf for n, hz in wanted.items()
    ):
        numbers = list(measured)
        consecutive = numbers == [*range(1, len(numbers) + 1)] and len(numbers) > 1
        known = f"1 to {len(numbers)}" if consecutive else " or ".join(map(str, numbers))
        raise InvalidScene(
            f"--match {match} must name modes {known} of the targets, each once, as in "
            f"{','.join(map(str, numbers[:3]))} or {numbers[0]}={measured[numbers[0]]:g} (Hz)."
        )
    return wanted


def numbered(scene: Scene, match: str) -> tuple[Scene, dict[int, float]]:
    """A scene of bodies with the modes of "1=738.6,3=2210.8" [Hz] as its targets, and these;
    raises InvalidScene."""
    pairs = [item.partition("=") for item in match.split(",")]
    try:
        hz = {int(n): float(value) for n, _, value in pairs}
    except ValueError:
        hz = {}
    if len(hz) < len(pairs) or not all(1 <= n <= 200 and 0 < f < np.inf for n, f in hz.items()):
        raise InvalidScene(
            f"--match {match}: {scene.name} has no targets, so each mode needs its number and its "
            "frequency: a number from 1 to 200 once, and Hz above 0 without a unit, as in "
            "1=738.6,3=2210.8."
        )
    tables = tuple(MeasuredMode(number=n, hz=f) for n, f in sorted(hz.items()))
    return scene.but(targets=tables), dict(sorted(hz.items()))


def projected(
    scene: Scene, candidates: list[TuningParameter], progress: Progress
) -> tuple[Scene, TuningBasis, list[TuningParameter]]:
    """The scene loosened where candidates vary, its projection, and the candidates on that."""
    loose = loosened(scene, candidates)
    basis = pipeline_of(loose, progress)("tuning-basis")
    return loose, basis, on_bodies(scene, candidates, list(basis.forms))


def loosened(scene: Scene, parameters: Sequence[TuningParameter]) -> Scene:
    """The scene with finite springs where they vary, all else that varies at a factor of 1."""
    start = [p.start if p.springs else 1.0 for p in parameters]
    loose = at_values(scene, parameters, np.array(start))
    return loose.with_sizes_of(scene)


def shape_mac(full: Pipeline) -> dict[str, float]:
    """MAC of the computed modes with those of stiff joints by number, as `beadwave modes` has
    it."""
    index, mac, numbers = full("modes").index, full("mac"), full.scene.measured_numbers
    return {
        str(n): float(mac[i, j]) if i >= 0 else np.nan
        for j, (n, i) in enumerate(zip(numbers, index, strict=True))
    }


def write_scene(
    scene: Scene, file: OutputFile | None, first: str, source: Source
) -> tuple[Scene, Path | None]:
    """Write the scene as TOML with a first line on where its values come from, named after its
    file; the scene and the file's path, the scene as it is where there is no file.

    One that was read from a file keeps this file's name of it, comments and order, as far as
    reading that back gives the scene; in another folder it names its own files by full paths.
    """
    if file is None:
        return scene, None
    name = sub(r"[^\w.-]", "-", file.path.stem).lstrip(".-")[:LONGEST_NAME] or "tuned"
    scene = scene.model_copy(update={"name": name})
    text = toml(scene)
    if source is None or isinstance(source, str | Path):
        from beadwave.workflows.scene.commented import with_values

        original = scene_text(None if source is None else str(source)).text

        # the values that differ are put into the text of the source; what is written is read back,
        # since paths of files and numbers of targets may mean something else where it is written
        tables = [tomllib.loads(toml(one)) for one in (load_scene(source), scene)]
        before, after = ({k: v for k, v in one.items() if k != "name"} for one in tables)
        # files by the paths of the source, else by their full ones
        elsewhere = {
            table: {k: v for k, v in value.items() if k not in every_file_key()} for table, value
            in before.items() if isinstance(value, dict)
        }  # fmt: skip
        without_files = {k: v for k, v in before.items() if k != "targets"} | elsewhere
        for unchanged in (before, without_files):
            commented = with_values(original, unchanged, after)
            tables = parsed(commented, scene.name)
            read = completed(Written(scene.name, tables, file.path.parent.resolve()))
            if read.model_copy(update={"name": scene.name}) == scene:
                scene, text = read, commented
                break
    with file.writing() as path:
        path.write_text(f"# {first}\n{text}", encoding="utf-8", newline="\n")
    return scene, file.path
