"""A model fitted to the frequency responses of a test: from a scene and a file to a tuned scene.

Poles of the responses are identified and paired with computed modes, values are brought to their
frequencies, and from there to the responses at all lines; the full model is the judge.
"""

from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel
from scipy.optimize import nnls
from scipy.sparse import csr_matrix, vstack

import fem
from fem.correlation import FROM_AFAR, Shape, mac, measured_pairs, paired
from fem.hit_records import node_and_axis
from fem.hits import FrequencyResponses
from fem.measured_shapes import FEWEST, MeasuredShape
from fem.response_fit import (
    DB,
    MeasuredResponses,
    Misfit,
    Resonances,
    ResponseFit,
    fit_responses,
    misfit,
    noise_of_coherence,
    noise_of_neighbours,
    undetermined,
)
from fem.response_model import (
    DampingParameter,
    Parameter,
    ResponseModel,
    computed_responses,
    response_model,
    solid_ones,
    with_dampings,
)
from fem.response_scale import POWERS, remark_on_scale, response_scale
from fem.tuning import TuningBasis, TuningParameter, at_before, spectrum, tune, tuning_basis
from workflows.files.hammer import Reading
from workflows.files.run_folder import Picture
from workflows.report import plots
from workflows.report.numbers import supported
from workflows.report.tables import aligned_text
from workflows.scene import InvalidScene, Scene, nearest
from workflows.stages.pipeline import pipeline_of
from workflows.stages.progress import Progress
from workflows.stages.targets import placed, remarks_on_axes
from workflows.structure import dampings as of_damping
from workflows.structure import parameters as of_bodies
from workflows.structure.hammer import (
    PHASES,
    IdentifiedTest,
    hammer_test,
    points_without_place,
)
from workflows.structure.tuning import (
    RIG_NAMES,
    at_values,
    candidates_of,
    loosened,
    scene_values,
    unit,
)

# relative, of identified frequencies beside the responses, as `tune` takes it, and of their damping
# ratios; 3 deviations at least, so that what the responses say already hardly counts twice
FREQUENCY_ERROR, ZETA_ERROR = 1e-3, 0.02


ABOVE = 1.1  # of the highest resonance: the band without one of the user's; not varied


class ResponseOptions(NamedTuple):
    """What of a test a fit reads; values not varied but where said."""

    lines: int = 600  # of the band, at most; those near resonances first
    near: float = 6.0  # half bandwidths around a resonance in which every line is kept
    loads: int = 40  # points and references whose static shapes are added, at most; else references
    beyond: float = 1.5  # the projection's modes reach this factor beyond the band
    most_modes: int = 96  # computed for it
    lasting: float = 0.02  # of a mode's amplitude at the record's end, from which its height is off
    opposite: float = -0.7  # correlation of measured with computed residues of a reversed sensor
    worse: float = 4.0  # rise of -2 ln(likelihood) that a value explains: two deviations


class FittedValue(BaseModel):
    """A fitted value; `low` and `high` are two standard deviations away, 95 %."""

    name: str
    before: float
    value: float
    unit: str
    low: float
    high: float
    deviation: float  # of ln(value), one standard deviation
    of_noise: float  # the part of it that the noise alone makes


class ResonanceRow(BaseModel):
    """A resonance of the test beside the model before and after the fit."""

    number: int  # in the order of frequencies, for --match
    hz: float
    zeta: float
    before_hz: float | None
    after_hz: float | None
    full_hz: float | None  # of the full model with the fitted values
    after_zeta: float | None
    mac: float | None  # of the fitted model's shape with the measured one
    fitted: bool  # whether lines around it, and its frequency, were fitted


class MisfitRow(BaseModel):
    """Root mean square difference of measured and computed responses."""

    decibel: float
    degrees: float


class ResponseReport(BaseModel):
    """A fit to responses."""

    scene: str
    file: str
    title: str
    values: list[FittedValue]
    undetermined: dict[str, float | Literal["rigid"]]
    resonances: list[ResonanceRow]
    before: MisfitRow
    after: MisfitRow
    held_out: MisfitRow | None  # at the lines around resonances that were not fitted
    noise_decibel: float
    model_error_decibel: float  # level of the residual that noise does not explain
    lines: int
    responses: int
    evaluations: int
    seconds: float
    steps: list[str]
    remarks: list[str]

    def text(self) -> str:
        """Steps, values, resonances, misfit, then sentences."""
        steps = [f"{i}. {step}" for i, step in enumerate(self.steps, 1)]
        values = [
            (
                v.name, f"{v.before:.5g}", f"{v.value:.5g}", v.unit,
                f"{v.low:.5g}", f"{v.high:.5g}", f"{200 * v.of_noise:.2g} %",
            )
            for v in self.values
        ]  # fmt: skip
        heads = ("value", "before", "fitted", "", "from", "to (95 %)", "of noise alone")
        rows = []
        for r in self.resonances:
            off = None if r.after_hz is None else f"{100 * (r.after_hz / r.hz - 1):+.2f} %"
            hz = (None if x is None else f"{x:.2f}" for x in (r.before_hz, r.after_hz, r.full_hz))
            rows.append(
                (
                    r.number, f"{r.hz:.2f}", *hz, off, f"{100 * r.zeta:.3g} %",
                    None if r.after_zeta is None else f"{100 * r.after_zeta:.3g} %",
                    None if r.mac is None else f"{r.mac:.2f}", "" if r.fitted else "not fitted",
                )
            )  # fmt: skip
        head = (
            "#", "measured [Hz]", "before", "fitted", "full model", "off", "damping", "fitted",
            "MAC", "",
        )  # fmt: skip
        off = [
            ("before", f"{self.before.decibel:.2f} dB", f"{self.before.degrees:.1f} degrees"),
            ("after", f"{self.after.decibel:.2f} dB", f"{self.after.degrees:.1f} degrees"),
        ]
        if self.held_out:
            of_them = self.held_out
            off.append(
                ("not fitted", f"{of_them.decibel:.2f} dB", f"{of_them.degrees:.1f} degrees")
            )
        off.append(("noise", f"{self.noise_decibel:.2f} dB", None))
        cost = (
            f"{self.responses} responses at {self.lines} lines, {self.evaluations} evaluations in "
            f"{self.seconds:.2f} s"
        )
        return "\n".join(
            [
                self.title, *steps, "", aligned_text(heads, values), "", aligned_text(head, rows),
                "", aligned_text(("misfit (rms)", "magnitude", "phase"), off), "", cost,
                *self.remarks,
            ]
        )  # fmt: skip

    def __repr__(self) -> str:
        return self.text()


class TunedResponses(NamedTuple):
    """The scene with fitted values, its report and the pictures of responses."""

    scene: Scene
    report: ResponseReport
    pictures: tuple[Picture, ...]


class Places(NamedTuple):
    """A test on a model."""

    points: Shape  # its points, in the order of `used`
    references: Shape
    used: NDArray[np.int64]  # points of the test that have a place


def tuned_to_responses(
    scene: Scene,
    files: Sequence[Path],
    free: tuple[str, ...],
    progress: Progress,
    *,
    reading: Reading = Reading(),
    band_hz: tuple[float, float] | None = None,
    match: Sequence[int] | None = None,
    options: ResponseOptions = ResponseOptions(),
) -> TunedResponses:
    """The scene fitted to the responses in the files, at the lines in a band and around the
    resonances numbered in `match`, all without; raises InvalidScene."""
    named = ", ".join(map(str, files))
    with progress("identification"):
        test = hammer_test(list(files), {}, reading)
    if test.test.kind not in ("responses", "hits"):
        raise InvalidScene(
            f"{named} has {test.test.kind.replace('ambient', 'ambient records')} without a force, "
            "of which the height of responses is not known; give hits or frequency responses."
        )
    solids, of_dampings = parameters_named(scene, free)
    of_damping.require_damped(scene, of_dampings)

    # the test on the model with springs that can vary
    loose = loosened(scene, solids)
    pipeline = pipeline_of(loose, progress)
    model = pipeline("model")
    places = test_places(scene, model, test)
    steps = [step.text() for step in test.report.steps]
    remarks = list(test.report.remarks)
    quantity = test.test.quantity
    if not quantity:
        quantity = "accelerations"
        remarks.append(
            f"{named} does not say what its responses are: accelerations in m/s^2 over N are taken."
        )
    top_hz = ABOVE * float(test.modes.frequency_hz.max())
    band_hz = band_hz or (0.0, top_hz)
    chosen = resonances_chosen(test, band_hz, match)
    data, n_lines = measured_lines(test, places, band_hz, chosen, options)
    with progress("tuning-basis"):
        basis, top = response_basis(model, test, places, data.frequency_hz[-1], options)
    if top < options.beyond * data.frequency_hz[-1]:
        raise InvalidScene(
            f"--band: {options.most_modes} modes reach to {top:.5g} Hz, which is not "
            f"{options.beyond:g} times the highest line at {data.frequency_hz[-1]:.5g} Hz; give "
            f"a band up to {top / options.beyond:.0f} Hz."
        )
    if not scene.of_dimensions:
        solids = of_bodies.on_bodies(scene, solids, list(basis.forms))
    material = {body: scene.written_out.material_name(body) or "" for body in model.structure.basis}
    damping = of_damping.structure_damping_of(scene, material, of_dampings)
    beside = {
        f"{one.name}.{key}": k for one in scene.springs or () for key, k in one.stiffnesses.items()
    }
    made = (damping, POWERS[quantity], test.test.responses.shift, beside)
    parameters: list[Parameter] = [*solids, *of_dampings]

    started = perf_counter()
    before = unfitted(basis, solids, made)
    near, resonances = resonances_near(before, test, chosen)
    require_signs_and_size(named, test, before, near, quantity, options)

    # values that meet the frequencies of the poles, then the damping of these
    n_shapes = len(basis.targets) - 2
    start = np.array([p.start for p in parameters])
    steps.append(pairing_step(test, near, chosen, n_shapes))
    if len(near) and solids:
        hz = test.modes.frequency_hz[near]
        fit = tune(of_these(basis, near), solids, dict(enumerate(hz.tolist(), start=1)))
        start[: len(solids)] = fit.value
        met = np.abs(np.log(fit.modes_hz / hz))
        steps.append(
            f"values brought to the frequencies of these {len(near)}: off by "
            f"{100 * np.nanmax(met):.2g} % at most."
        )
    if len(near) and of_dampings:
        start = damping_start(response_model(basis, *made), parameters, start, test, near)
    subset = basis._replace(targets=(*of_these(basis, near).targets, *basis.targets[-2:]))
    model_of = response_model(subset, *made)

    # from there, and from the scene's own values, to the responses at all lines
    with progress("tuning"):
        starts = [start, np.array([p.start for p in parameters])]
        of_poles = resonances if len(near) else None
        fits = [fit_responses(model_of, parameters, x, data, of_poles) for x in starts]
        fit = min(fits, key=lambda one: one.objective)
        fit, model_of, evaluations = determined(
            subset, made, parameters, fit, data, of_poles, options
        )
    evaluations += sum(one.evaluations for one in fits)
    seconds = perf_counter() - started
    steps.append(
        f"{len(parameters)} values fitted to {data.H[..., 0].size} responses at "
        f"{len(data.frequency_hz)} of {n_lines} lines between {data.frequency_hz[0]:.5g} and "
        f"{data.frequency_hz[-1]:.5g} Hz, magnitude in dB and phase, with the frequencies of the "
        "paired resonances and, where damping is free, their damping ratios."
    )
    if not fit.parameters:
        raise InvalidScene(
            f"{scene.name}: no value of --free {','.join(p.name for p in parameters)} is "
            "determined by these responses, nothing is tuned; free what moves their resonances."
        )
    fitted = [supported(x, x * s) for x, s in zip(fit.value, fit.deviation, strict=True)]
    fit = fit._replace(value=np.array(fitted))
    result = with_fitted(scene, loose, solids, fit)

    of_fit = Fitted(scene, result, test, places, fit, model_of, before, parameters, chosen, data)
    resonances_of = resonance_rows(of_fit, progress)
    at_scene = computed_responses(before, [], np.zeros(0), data.frequency_hz).H
    after = computed_responses(model_of, fit.parameters, fit.value, data.frequency_hz).H
    off = [misfit(data, H) for H in (at_scene, after)]
    held_out = held_out_misfit(of_fit, band_hz, top / options.beyond, options)
    remarks += [
        *(remarks_on_axes(scene) if scene.test_axes else ()),
        *remarks_on_fit(of_fit, off[1], options),
    ]
    undetermined_ones = {
        key: "rigid" if np.isinf(x) else x
        for p in parameters if p.name not in {q.name for q in fit.parameters}
        for key, x in values_of(scene, p)
    }  # fmt: skip
    report = ResponseReport(
        scene=scene.name, file=named, title=test.report.title, values=value_rows(of_fit),
        undetermined=undetermined_ones, resonances=resonances_of,
        before=MisfitRow(decibel=off[0].decibel, degrees=off[0].degrees),
        after=MisfitRow(decibel=off[1].decibel, degrees=off[1].degrees),
        held_out=None if held_out is None
        else MisfitRow(decibel=held_out.decibel, degrees=held_out.degrees),
        noise_decibel=off[1].noise_decibel, model_error_decibel=float(DB * fit.error.level),
        lines=len(data.frequency_hz), responses=data.H[..., 0].size, evaluations=evaluations,
        seconds=seconds, steps=steps, remarks=remarks,
    )  # fmt: skip
    with progress("picture"):
        drawn = pictures(of_fit, quantity, band_hz, top)
    return TunedResponses(result, report, drawn)


class Fitted(NamedTuple):
    """What a report on a fit is made of."""

    scene: Scene
    result: Scene
    test: IdentifiedTest
    places: Places
    fit: ResponseFit
    model_of: ResponseModel
    before: ResponseModel
    parameters: list[Parameter]
    chosen: NDArray[np.bool_]
    data: MeasuredResponses


def parameters_named(
    scene: Scene, names: tuple[str, ...]
) -> tuple[list[TuningParameter], list[DampingParameter]]:
    """Parameters of stiffness and mass, and those of damping; raises InvalidScene for names that
    are neither."""
    whole = scene.written_out
    materials = [f"materials.{name}" for name in whole.materials]
    joints = [f"joints.{name}" for name in whole.bushings]
    springs = [f"springs.{one.name}" for one in whole.springs or ()]
    parts = [*materials, *joints, *springs]
    damped = of_damping.known_dampings(scene, parts)
    solid = RIG_NAMES if scene.of_dimensions else of_bodies.known(scene)
    if not names or names == ("",):
        raise InvalidScene(
            f"--free is missing; name what to vary of {', '.join([*solid, *damped])}."
        )
    for name in names:
        if names.count(name) > 1:
            raise InvalidScene(f"--free {name} is named twice; drop one.")
        kt = scene.of_dimensions and name.endswith(".kt")
        if name not in damped and name not in solid and not kt:
            why = ""
            if name.startswith("damping.") and scene.damping is not None:
                why = f' while damping.kind = "{scene.damping.kind}"'
            elif name.rpartition(".")[2][:1] == "c":
                why = " (a direction that is rigid or open has no dashpot)"
            raise InvalidScene(
                f"--free {name} is not known{why}, {nearest(name, [*solid, *damped])}."
            )
    solids = tuple(name for name in names if name not in damped)
    return (
        candidates_of(scene, solids) if solids else [],
        of_damping.freed_dampings(scene, [name for name in names if name in damped], parts),
    )


def test_places(scene: Scene, model: fem.Model, test: IdentifiedTest) -> Places:
    """Where points and references of a test are on the model; raises InvalidScene where hammer or
    sensors have no place."""
    responses, nodes = test.test.responses, test.test.nodes
    missing = set(points_without_place(test.test))
    used = [i for i in range(len(responses.points)) if i not in missing]
    ends = [node_and_axis(name) for name in responses.references]
    lost = [
        name
        for name, end in zip(responses.references, ends, strict=True)
        if end is None or end[0] not in nodes
    ]
    if lost or not used:
        name = lost[0] if lost else responses.points[0]
        raise InvalidScene(
            f"{test.report.file}: {name} has no place on the structure, and responses are fitted "
            "where force and sensor are; name points by node and direction, as 12+z, and give the "
            "nodes in the file or with --points."
        )

    def on_model(names: Sequence[str]) -> Shape:
        at = [node_and_axis(name) for name in names]
        directions = np.array([np.sign(a) * np.eye(3)[abs(a) - 1] for _, a in at])
        points = np.array([nodes[n] for n, _ in at])
        shape = MeasuredShape(points, directions, np.ones(len(at), complex))
        return placed(scene, model, test.report.file, shape, 1.0)

    return Places(
        on_model([responses.points[i] for i in used]), on_model(responses.references),
        np.array(used),
    )  # fmt: skip


def resonances_chosen(
    test: IdentifiedTest, band_hz: tuple[float, float], match: Sequence[int] | None
) -> NDArray[np.bool_]:
    """Which identified resonances (n,) are fitted; raises InvalidScene for numbers that are none,
    and where none is left."""
    hz = test.modes.frequency_hz
    numbers = np.arange(1, len(hz) + 1)
    if match is not None:
        unknown = sorted(set(match) - set(numbers.tolist()))
        if unknown or len(set(match)) < len(match) or not len(match):
            what = unknown[0] if unknown else ",".join(map(str, match)) or "without a number"
            raise InvalidScene(
                f"--match {what} must name resonances 1 to {len(hz)} of {test.report.file}, each "
                "once, as in 1,2,4."
            )
    chosen = (hz >= band_hz[0]) & (hz <= band_hz[1])
    if match is not None:
        chosen &= np.isin(numbers, list(match))
    if not chosen.any():
        listed = ", ".join(f"{n}: {f:.5g} Hz" for n, f in zip(numbers, hz, strict=True))
        raise InvalidScene(
            f"{test.report.file}: no resonance to fit within --band and --match; there are "
            f"{listed}."
        )
    return chosen


def measured_lines(
    test: IdentifiedTest,
    places: Places,
    band_hz: tuple[float, float],
    chosen: NDArray[np.bool_],
    options: ResponseOptions,
) -> tuple[MeasuredResponses, int]:
    """The responses that are fitted, with their noise, and how many lines there were: those near
    resonances and evenly chosen others."""
    responses = test.test.responses
    f = responses.frequency_hz
    within = (f > 0) & (f >= band_hz[0]) & (f <= band_hz[1])
    hz, zeta = test.modes.frequency_hz, test.modes.zeta
    group = np.abs(np.log(np.maximum(f, 1e-9)[:, None] / hz)).argmin(axis=1)
    # a line belongs to the nearest resonance; those of resonances not fitted are not read
    lines = np.flatnonzero(within & chosen[group])
    n_lines = len(lines)
    if n_lines > options.lines:
        distance = np.abs(f[lines, None] - hz[chosen]) / (hz[chosen] * zeta[chosen])
        near = distance.min(axis=1) < options.near
        close, far = lines[near], lines[~near]
        half = options.lines // 2
        close = close[:: max(1, -(-len(close) // half))]
        far = far[:: max(1, -(-len(far) // max(options.lines - len(close), 1)))]
        lines = np.sort(np.concatenate([close, far]))
    H, noise = responses.H, noise_of(responses)
    used = places.used
    return MeasuredResponses(
        f[lines], H[np.ix_(used, range(H.shape[1]), lines)],
        noise[np.ix_(used, range(H.shape[1]), lines)], group[lines],
    ), n_lines  # fmt: skip


def noise_of(responses: FrequencyResponses) -> NDArray[np.float64]:
    """Standard deviation (p, m, f) of real and imaginary parts: by coherence and the number of hits
    where there is one, else by the scatter from line to line."""
    noise = noise_of_neighbours(responses.H)
    if responses.coherence is None:
        return noise
    by_coherence = noise_of_coherence(
        responses.H, responses.coherence, np.maximum(averages(responses), 2.0)
    )
    hit_once = averages(responses) < 2
    return np.where(hit_once[:, None, None], noise, by_coherence)


def averages(responses: FrequencyResponses) -> NDArray[np.float64]:
    """Number (p,) of hits behind each point's responses."""
    count = np.ones(len(responses.points))
    for one in responses.deletions:
        count[one.points] = len(one.change)
    return count


def response_basis(
    model: fem.Model,
    test: IdentifiedTest,
    places: Places,
    highest_hz: float,
    options: ResponseOptions,
) -> tuple[TuningBasis, float]:
    """The projection with static shapes of forces at the test's points; its targets are the
    identified shapes, of three points or more, and then points and references. And the highest
    frequency of the modes it holds."""
    phi = test.modes.phi[places.used]
    shapes = []
    if len(places.used) >= FEWEST:
        shapes = [
            places.points._replace(shape=phi[:, i], hz=float(hz))
            for i, hz in enumerate(test.modes.frequency_hz)
        ]
    readings = [csr_matrix(one.reading) for one in (places.points, places.references)]
    few = sum(one.shape[0] for one in readings) <= options.loads
    loads = csr_matrix(vstack(readings)) if few else readings[1]
    n_modes = 24
    while True:
        basis = tuning_basis(
            model, [*shapes, places.points, places.references], n_modes=n_modes, loads=loads
        )
        stiffest = spectrum(basis, [], np.zeros(0)).frequency_hz
        top = float(stiffest[min(n_modes, len(stiffest)) - 1])
        n_modes *= 2
        if top > options.beyond * highest_hz or n_modes > options.most_modes:
            return basis, top


def of_these(basis: TuningBasis, indices: NDArray[np.int64]) -> TuningBasis:
    """The basis with these of the identified shapes as its only targets: others have no part."""
    return basis._replace(targets=tuple(basis.targets[i] for i in indices.tolist()))


def unfitted(basis: TuningBasis, solids: Sequence[TuningParameter], made: tuple) -> ResponseModel:
    """The model as the scene has it, rigid directions included."""
    for p in solids:
        basis = at_before(basis, p)
    return response_model(basis, *made)


def resonances_near(
    before: ResponseModel, test: IdentifiedTest, chosen: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], Resonances]:
    """Positions (k,) of the chosen resonances that some computed mode is like, and their
    frequencies."""
    targets = before.basis.targets[:-2]
    if not targets:
        return np.zeros(0, int), Resonances(np.zeros(0), np.zeros(0, int), *[np.zeros(0)] * 3)
    modes = spectrum(before.basis, [], np.zeros(0))
    reading = before.points @ modes.phi
    places = np.flatnonzero(chosen)
    shapes = np.column_stack([targets[i].shape for i in places.tolist()])
    pairs = measured_pairs(
        test.modes.frequency_hz[places], modes.frequency_hz, mac(shapes, reading),
        np.zeros((reading.shape[1],) * 2), FROM_AFAR,
    )  # fmt: skip
    near = places[pairs.index >= 0]
    hz = test.modes.frequency_hz[near]
    error = np.maximum(FREQUENCY_ERROR, 3 * test.modes.frequency_deviation[near] / hz)
    zeta = test.modes.zeta[near]
    of_zeta = np.maximum(ZETA_ERROR, 3 * test.modes.zeta_deviation[near] / zeta)
    return near, Resonances(hz, near, error, zeta, of_zeta)


def pairing_step(
    test: IdentifiedTest, near: NDArray[np.int64], chosen: NDArray[np.bool_], n_shapes: int
) -> str:
    """A sentence on how the resonances begin the fit."""
    n = int(np.count_nonzero(chosen))
    if not n_shapes:
        return (
            f"{n} resonances, whose shapes are known at fewer than {FEWEST} points: none is paired "
            "with a computed mode, the fit begins at the scene's values."
        )
    lost = [i for i in np.flatnonzero(chosen) if i not in near]
    listed = ", ".join(f"{test.modes.frequency_hz[i]:.5g} Hz" for i in lost)
    return f"{len(near)} of {n} resonances paired by shape with computed modes" + (
        f"; none is like {listed}." if lost else "."
    )


def damping_start(
    model: ResponseModel,
    parameters: Sequence[Parameter],
    value: NDArray[np.float64],
    test: IdentifiedTest,
    near: NDArray[np.int64],
) -> NDArray[np.float64]:
    """The values with those of damping that bring the ratios of the modes nearest to the measured
    ones (least squares without negative values; ratios are linear in them)."""
    damped = [j for j, p in enumerate(parameters) if isinstance(p, DampingParameter)]

    def ratios(x: NDArray[np.float64]) -> NDArray[np.float64]:
        computed = computed_responses(model, parameters, x, np.array([1.0]))
        index = paired(model.basis.forms, computed.modes, of_these(model.basis, near).targets).index
        return np.where(index < 0, np.nan, computed.zeta[index])

    without = value.copy()
    without[damped] = 0.0
    fixed = ratios(without)
    columns = []
    for j in damped:
        x = without.copy()
        x[j] = value[j]
        columns.append((ratios(x) - fixed) / value[j])
    measured = test.modes.zeta[near]
    A, b = np.column_stack(columns), measured - fixed
    known = np.isfinite(A).all(axis=1) & np.isfinite(b)
    result = value.copy()
    if known.any():
        scale = value[damped]
        weight = 1 / measured[known]  # relative errors of ratios
        x, _ = nnls(A[known] * scale * weight[:, None], np.maximum(b[known], 0) * weight)
        lower = np.array([parameters[j].lower for j in damped])
        upper = np.array([parameters[j].upper for j in damped])
        # none begins at zero, from where a logarithm does not return
        result[damped] = np.clip(np.maximum(x, 0.03) * scale, 2 * lower, 0.5 * upper)
    return result


def require_signs_and_size(
    named: str,
    test: IdentifiedTest,
    before: ResponseModel,
    near: NDArray[np.int64],
    quantity: str,
    options: ResponseOptions,
) -> None:
    """Raise InvalidScene where residues of the paired resonances say that a sensor or the hammer
    looks the other way, or that a unit is another."""
    modes = spectrum(before.basis, [], np.zeros(0))
    index = paired(before.basis.forms, modes, of_these(before.basis, near).targets).index
    near, index = near[index >= 0], index[index >= 0]
    if not len(near):
        return
    at_points, at_references = before.points @ modes.phi, before.references @ modes.phi
    used = [i for i in range(len(test.modes.phi)) if i not in set(points_without_place(test.test))]
    measured = np.einsum(
        "pn,nr->npr", test.modes.phi[np.ix_(used, near)], test.modes.participation[near]
    )
    computed = np.einsum("pn,rn->npr", at_points[:, index], at_references[:, index])
    computed = (
        computed * PHASES[quantity] * (modes.omega[index] ** (before.power - 1))[:, None, None]
    )
    along = np.sum((measured * computed.conj()).real, axis=0)
    correlation = along / np.maximum(np.sum(np.abs(measured * computed), axis=0), 1e-300)
    reversed_ones = correlation < options.opposite
    responses = test.test.responses
    if len(near) > 1 and reversed_ones.any():
        i, j = np.argwhere(reversed_ones)[0]
        point, reference = responses.points[used[i]], responses.references[j]
        which = f"{point} to {reference} moves"
        if reversed_ones[:, j].all():
            which = f"{reference} looks"
        raise InvalidScene(
            f"{named}: {which} against the model in all paired resonances: the direction of its "
            "name is not that of hammer or sensor; name it with the other sign, as 3-z for 3+z."
        )
    chosen = test.modes._replace(
        frequency_hz=test.modes.frequency_hz[near], phi=test.modes.phi[np.ix_(used, near)],
        participation=test.modes.participation[near],
    )  # fmt: skip
    scale = response_scale(chosen, quantity, at_points[:, index], at_references[:, index])
    if sentence := remark_on_scale(scale):
        raise InvalidScene(
            f"{named}: {sentence}. The height of responses is fitted: correct their unit in the "
            "file, or the mass of the model."
        )


def determined(
    basis: TuningBasis,
    made: tuple,
    parameters: Sequence[Parameter],
    fit: ResponseFit,
    data: MeasuredResponses,
    resonances: Resonances | None,
    options: ResponseOptions,
) -> tuple[ResponseFit, ResponseModel, int]:
    """The fit of what the responses determine: what they do not has the value it had before, and
    directions that were rigid stay so where the others alone explain the responses as well."""
    evaluations, model = 0, response_model(basis, *made)
    while fit.parameters:
        rigid = [
            p for p in fit.parameters
            if isinstance(p, TuningParameter) and p.springs and min(p.before) > p.upper
        ]  # fmt: skip
        for dropped in [*undetermined(fit), *rigid]:
            places = [j for j, p in enumerate(fit.parameters) if p is not dropped]
            kept = [fit.parameters[j] for j in places]
            reduced, of_damping_now = basis, made[0]
            if isinstance(dropped, TuningParameter):
                reduced = at_before(basis, dropped)
            else:
                of_damping_now = with_dampings(made[0], [dropped], np.array(dropped.before))
            remade = (of_damping_now, *made[1:])
            without = response_model(reduced, *remade)
            refit = fit_responses(without, kept, fit.value[places], data, resonances)
            evaluations += refit.evaluations
            is_rigid = any(dropped is p for p in rigid)
            if not is_rigid or refit.objective <= fit.objective + options.worse:
                basis, made, model, fit = reduced, remade, without, refit
                break
        else:
            break
    return fit, model, evaluations


def with_fitted(
    scene: Scene, loose: Scene, solids: Sequence[TuningParameter], fit: ResponseFit
) -> Scene:
    """The scene with the fitted values; what was loosened for the fit is as it was."""
    chosen, value = solid_ones(fit.parameters, fit.value)
    result = at_values(scene, chosen, value) if chosen else scene
    of_dampings = {
        p.name: float(x)
        for p, x in zip(fit.parameters, fit.value, strict=True)
        if isinstance(p, DampingParameter)
    }
    return of_damping.with_dampings(result, of_dampings)


def values_of(scene: Scene, p: Parameter) -> list[tuple[str, float]]:
    """Keys of the scene that a parameter sets, with their values."""
    if isinstance(p, DampingParameter):
        return [(p.name, p.before[0])]
    return scene_values(scene, p)


def value_rows(of_fit: Fitted) -> list[FittedValue]:
    """The fitted values with their bars; of factors on materials and masses what they make."""
    rows, fit = [], of_fit.fit
    for p, x, deviation, of_noise in zip(
        fit.parameters, fit.value, fit.deviation, fit.of_noise, strict=True
    ):
        before = values_of(of_fit.scene, p)[0][1]
        factor = isinstance(p, TuningParameter) and not p.springs
        scale = before if factor else 1.0
        rows.append(
            FittedValue(
                name=p.name, before=before, value=float(scale * x), unit=unit_of(p),
                low=float(scale * x * np.exp(-2 * deviation)),
                high=float(scale * x * np.exp(2 * deviation)),
                deviation=float(deviation), of_noise=float(of_noise),
            )
        )  # fmt: skip
    return rows


def unit_of(p: Parameter) -> str:
    """Unit of a fitted value."""
    if isinstance(p, DampingParameter):
        turn = p.name.rpartition(".")[2].startswith("cr")
        units = {"alpha": "1/s", "beta": "s", "dashpot": "N m s/rad" if turn else "N s/m"}
        return units.get(p.kind, "")
    last = p.name.rpartition(".")[2]
    units = {"young": "Pa", "density": "kg/m^3", "mass": "kg"}
    return units.get(last, "N/m" if p.name.startswith("springs.") else unit(p.name))


def shapes_paired(
    test: IdentifiedTest, used: NDArray[np.int64], hz: NDArray, reading: NDArray
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """The mode (n,) at frequencies hz (k,) that each resonance is, -1 for none, and their MAC
    (n, k), with shapes `reading` (p, k) at the points."""
    likeness = np.nan_to_num(mac(test.modes.phi[used], reading))
    pairs = measured_pairs(
        test.modes.frequency_hz, hz, likeness, np.zeros((len(hz),) * 2), FROM_AFAR
    )
    return pairs.index, likeness


def resonance_rows(of_fit: Fitted, progress: Progress) -> list[ResonanceRow]:
    """Every identified resonance beside the model before and after, those not fitted as well."""
    test, used, fit = of_fit.test, of_fit.places.used, of_fit.fit
    before = spectrum(of_fit.before.basis, [], np.zeros(0))
    after = computed_responses(of_fit.model_of, fit.parameters, fit.value, np.array([1.0]))
    full = pipeline_of(of_fit.result, progress)
    places = test_places(of_fit.result, full("model"), test)
    n = len(test.modes.frequency_hz)
    sets = (
        (before.frequency_hz, of_fit.before.points @ before.phi),
        (after.modes.frequency_hz, of_fit.model_of.points @ after.modes.phi),
        (full("modes").omega / (2 * np.pi), np.asarray(places.points.reading @ full("modes").phi)),
    )
    index, hz, likeness = [], [], None
    for frequencies, reading in sets:
        if len(used) < FEWEST:
            index.append(np.full(n, -1))
        else:
            paired_with, of_these = shapes_paired(test, used, frequencies, reading)
            index.append(paired_with)
            likeness = of_these if len(index) == 2 else likeness
        hz.append([float(frequencies[j]) if j >= 0 else None for j in index[-1]])
    rows = []
    for i in range(n):
        j = index[1][i]
        rows.append(
            ResonanceRow(
                number=i + 1, hz=float(test.modes.frequency_hz[i]), zeta=float(test.modes.zeta[i]),
                before_hz=hz[0][i], after_hz=hz[1][i], full_hz=hz[2][i],
                after_zeta=float(after.zeta[j]) if j >= 0 else None,
                mac=float(likeness[i, j]) if j >= 0 else None, fitted=bool(of_fit.chosen[i]),
            )
        )  # fmt: skip
    return rows


def held_out_misfit(
    of_fit: Fitted, band_hz: tuple[float, float], highest_hz: float, options: ResponseOptions
) -> Misfit | None:
    """Of the fitted model at lines around the resonances that were not fitted, as high as the
    projection holds; None where all were."""
    if of_fit.chosen.all():
        return None
    band = (0.0, highest_hz)
    lines, _ = measured_lines(of_fit.test, of_fit.places, band, ~of_fit.chosen, options)
    if not len(lines.frequency_hz):
        return None
    fit = of_fit.fit
    H = computed_responses(of_fit.model_of, fit.parameters, fit.value, lines.frequency_hz).H
    return misfit(lines, H)


def remarks_on_fit(of_fit: Fitted, after: Misfit, options: ResponseOptions) -> list[str]:
    """Sentences on what the fit is worth."""
    fit, scene, test = of_fit.fit, of_fit.scene, of_fit.test
    remarks = []
    responses = test.test.responses
    if responses.coherence is None:
        remarks.append(
            "no coherence: the noise is how lines scatter about a smooth curve through their "
            "neighbours."
        )
    if any(fit.error):
        wider = float(np.median(fit.deviation / fit.of_noise))
        remarks.append(
            f"the responses differ from the fitted model by {after.decibel:.2g} dB, of which their "
            f"noise explains {after.noise_decibel:.2g} dB. The rest is an error of the model. It "
            f"widens the bars (in the middle {wider:.2g} times): by how far resonances contradict "
            "each other, which does not show what all of them share."
        )
    names = [p.name for p in fit.parameters]
    for p in of_fit.parameters:
        if p.name not in names:
            key, x = values_of(scene, p)[0]
            value = "rigid" if np.isinf(x) else f"{x:g}"
            remarks.append(f"{key} is not determined by these responses: it stays {value}.")
    for p, x in zip(fit.parameters, fit.value, strict=True):
        for bound in (p.lower, p.upper):
            if abs(np.log(x / bound)) < 1e-3:
                remarks.append(
                    f"{p.name} ends at its bound, {bound:.3g}: these responses ask for more than "
                    "it may do; free another value, or look at the test."
                )
    if len(fit.parameters) > 1:
        deviation = np.sqrt(np.diag(fit.covariance))
        correlation = np.tril(fit.covariance / np.outer(deviation, deviation), -1)
        i, j = np.unravel_index(np.abs(correlation).argmax(), correlation.shape)
        if abs(correlation[i, j]) > 0.95:
            remarks.append(
                f"{names[i]} and {names[j]} are correlated by {correlation[i, j]:.3f}: the "
                "responses know a combination of both better than each."
            )
    if not any(isinstance(p, DampingParameter) for p in of_fit.parameters):
        remarks.append(
            "no damping was free: peaks have the height of the scene's; free damping.ratio, loss "
            "factors or dashpots to fit it."
        )
    if test.test.kind == "hits":
        f = responses.frequency_hz
        decay = 2 * np.pi * test.modes.frequency_hz * test.modes.zeta + responses.shift
        left = np.exp(-decay / (f[1] - f[0]))
        if left.max() > options.lasting:
            hz = test.modes.frequency_hz[left.argmax()]
            remarks.append(
                f"the records end while {hz:.5g} Hz still has {100 * left.max():.2g} % of its "
                "amplitude: its peak is too low by about as much, its damping not."
            )
    return remarks


LETTERS = {"accelerations": "m/s^2 / N", "velocities": "m/s / N", "displacements": "m / N"}


def pictures(
    of_fit: Fitted, quantity: str, band_hz: tuple[float, float], top: float, most: int = 4
) -> tuple[Picture, ...]:
    """Magnitude and phase of the responses with most energy, measured and before and after the fit;
    lines that were not fitted lie in grey."""
    test, fit, used = of_fit.test, of_fit.fit, of_fit.places.used
    responses = test.test.responses
    f = responses.frequency_hz
    lines = np.flatnonzero((f > 0) & (f <= top / 1.2))
    lines = lines[:: max(1, len(lines) // 3000)]
    hz, H = f[lines], responses.H[used][:, :, lines]
    before = computed_responses(of_fit.before, [], np.zeros(0), hz).H
    after = computed_responses(of_fit.model_of, fit.parameters, fit.value, hz).H
    group = np.abs(np.log(hz[:, None] / test.modes.frequency_hz)).argmin(axis=1)
    read = of_fit.chosen[group] & (hz >= band_hz[0]) & (hz <= band_hz[1])

    energy = np.sum(np.abs(H) ** 2, axis=2)
    shown = [np.unravel_index(k, energy.shape) for k in np.argsort(-energy, axis=None)[:most]]
    figure, pairs = plots.residual_pairs(len(shown), 2.6)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], ~read, [False]]).astype(int)))
    for (i, j), (upper, lower) in zip(shown, pairs, strict=True):
        curves = (
            ("measured", H[i, j], "0.45", "-", 2.2), ("before", before[i, j], plots.COLOURS[1],
            "--", 1.0), ("fitted", after[i, j], plots.COLOURS[0], "-", 1.1),
        )  # fmt: skip
        for name, h, colour, style, width in curves:
            upper.semilogy(hz, np.abs(h), style, color=colour, linewidth=width, label=name)
            phase = np.degrees(np.angle(h))
            phase[1:][np.abs(np.diff(phase)) > 180] = np.nan  # no stroke from -180 to 180
            lower.plot(hz, phase, style, color=colour, linewidth=width)
        for axis in (upper, lower):
            for a, b in zip(edges[::2], edges[1::2], strict=True):
                axis.axvspan(hz[a], hz[min(b, len(hz)) - 1], color="0.93", zorder=0)
            plots.frame(axis)
        title = f"{responses.points[used[i]]} to {responses.references[j]}"
        low = np.quantile(np.abs(H[i, j]), 0.01)
        upper.set_ylim(0.3 * low, 3 * np.abs(H[i, j]).max())
        upper.set_title(title, fontsize=9, loc="left")
        upper.set_ylabel(LETTERS[quantity])
        lower.set_ylabel("phase [deg]")
        lower.set_yticks([-180, 0, 180])
        lower.set_ylim(-190, 190)
    plots.legend(pairs[0][0], "above")
    pairs[-1][1].set_xlabel("frequency [Hz]" + ("" if read.all() else "; grey: not fitted"))
    return (Picture("responses", plots.png(figure)),)
