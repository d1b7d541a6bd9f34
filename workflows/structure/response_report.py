"""Report of a fit to responses: values with bars, resonances, misfit, pictures."""

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel
from scipy.sparse import csr_matrix

from beadwave import fem
from beadwave.fem.assembly.dashpots import dashpot_rows
from beadwave.fem.identification.measured_shapes import FEWEST
from beadwave.fem.modes.mac import FROM_AFAR, mac_near_double, measured_pairs
from beadwave.fem.modes.solver.full_responses import full_responses
from beadwave.fem.updating.response_fit import (
    DB,
    MeasuredResponses,
    Misfit,
    Resonances,
    ResponseFit,
    fit_responses,
    misfit,
)
from beadwave.fem.updating.response_model import (
    DampingParameter,
    Parameter,
    ResponseModel,
    computed_responses,
    with_dampings,
)
from beadwave.fem.updating.tuning import TuningParameter, spectrum
from beadwave.workflows.files.run_folder import Picture
from beadwave.workflows.report import plots
from beadwave.workflows.report.tables import aligned_text
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.engine.progress import Progress
from beadwave.workflows.stages.structure.targets import remarks_on_axes
from beadwave.workflows.structure.hammer import UNITS, IdentifiedTest
from beadwave.workflows.structure.measured_responses import (
    CLEAR_OF_NOISE,
    FULL_MODEL_REACH,
    LASTING_AMPLITUDE,
    MAX_MODES,
    Places,
    measured_lines,
    test_places,
)
from beadwave.workflows.structure.parameters import scene_values
from beadwave.workflows.structure.tuning import unit


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
    of_calibration: float  # d ln(value) of responses that are all 1 % higher


class ResonanceRow(BaseModel):
    """A resonance of the test and of the model before and after the fit."""

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
    full: MisfitRow  # of the full model with the fitted values
    held_out: MisfitRow | None  # at the lines around resonances that were not fitted
    projection_decibel: float  # largest difference of the fit's projection from the full model
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
                f"{100 * v.of_calibration:+.2g} %",
            )
            for v in self.values
        ]  # fmt: skip
        heads = (
            "value",
            "before",
            "fitted",
            "",
            "from",
            "to (95 %)",
            "of noise alone",
            "of 1 % in height",
        )
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
            ("full model", f"{self.full.decibel:.2f} dB", f"{self.full.degrees:.1f} degrees"),
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


class Fitted(NamedTuple):
    """Content of a report on a fit."""

    scene: Scene
    result: Scene
    test: IdentifiedTest
    places: Places
    fit: ResponseFit
    model_of: ResponseModel
    before: ResponseModel
    parameters: list[Parameter]
    chosen: NDArray[np.bool_]  # (n,) of the test's resonances, those fitted
    data: MeasuredResponses
    of_poles: Resonances | None  # that were fitted together with the responses


def values_of(scene: Scene, p: Parameter) -> list[tuple[str, float]]:
    """Keys of the scene that a parameter sets, with their values."""
    if isinstance(p, DampingParameter):
        return [(p.name, p.before[0])]
    return scene_values(scene, p)


def value_rows(of_fit: Fitted) -> list[FittedValue]:
    """The fitted values with their bars; of factors on materials and masses what they make."""
    rows, fit, data = [], of_fit.fit, of_fit.data
    higher = data._replace(H=1.01 * data.H, noise=1.01 * data.noise)
    moved = fit_responses(of_fit.model_of, fit.parameters, fit.value, higher, of_fit.of_poles)
    of_calibration = np.log(moved.value / fit.value)
    for i, (p, x, deviation, of_noise) in enumerate(
        zip(fit.parameters, fit.value, fit.deviation, fit.of_noise, strict=True)
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
                of_calibration=float(of_calibration[i]),
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


class FullModel(NamedTuple):
    """The whole model with the fitted values, at a test."""

    frequency_hz: NDArray[np.float64]  # (k,) [Hz]
    reading: NDArray[np.float64]  # (p, k) of its modes at the points
    H: NDArray[np.complex128]  # (p, r, f) at the lines that were fitted


def full_model(of_fit: Fitted, progress: Progress) -> FullModel:
    """Modes and responses of the scene with the fitted values, without the fit's projection."""
    pipeline, fit, lines = pipeline_of(of_fit.result, progress), of_fit.fit, of_fit.data
    model, modes = pipeline("model"), fem.Modes(pipeline("modes").omega, pipeline("modes").phi)
    places = test_places(of_fit.result, model, of_fit.test)
    shown = modes
    highest = 2 * np.pi * lines.frequency_hz[-1]
    while modes.omega[-1] < FULL_MODEL_REACH * highest and len(modes.omega) < MAX_MODES:
        n = min(2 * len(modes.omega), MAX_MODES)
        modes = fem.modes(model.K, model.M, n)

    # damping of each mode is that of the projection's nearest; dashpots as they sit
    projected = computed_responses(of_fit.model_of, fit.parameters, fit.value, np.array([1.0]))
    log, log_of_projected = (np.log(np.maximum(x.omega, 1.0)) for x in (modes, projected.modes))
    c = projected.c[np.abs(log[:, None] - log_of_projected).argmin(axis=1)]
    damping = with_dampings(of_fit.model_of.damping, fit.parameters, fit.value)
    of_model = of_fit.model_of
    full = full_responses(
        model, modes, c, csr_matrix(places.points.reading), csr_matrix(places.references.reading),
        2j * np.pi * lines.frequency_hz + of_model.shift, power=of_model.power,
        dashpots=dashpot_rows(model, damping.dashpot),
    )  # fmt: skip
    return FullModel(
        shown.omega / (2 * np.pi), np.asarray(places.points.reading @ shown.phi), full.H
    )


def resonance_rows(of_fit: Fitted, full: FullModel) -> list[ResonanceRow]:
    """Every identified resonance with that of the model before and after the fit, and the full one;
    each model's modes are paired with the test's anew, on MAC and frequency."""
    test, used, fit = of_fit.test, of_fit.places.used, of_fit.fit
    before = spectrum(of_fit.before.basis, [], np.zeros(0))
    after = computed_responses(of_fit.model_of, fit.parameters, fit.value, np.array([1.0]))
    n = len(test.modes.frequency_hz)
    sets = (
        (before.frequency_hz, of_fit.before.points @ before.phi),
        (after.modes.frequency_hz, of_fit.model_of.points @ after.modes.phi),
        (full.frequency_hz, full.reading),
    )
    index, hz, likeness = [], [], None
    for frequencies, reading in sets:
        if len(used) < FEWEST:
            index.append(np.full(n, -1))
        else:
            of_these = np.nan_to_num(mac_near_double(test.modes.phi[used], reading, frequencies))
            apart = np.zeros((len(frequencies),) * 2)
            hz_of_test = test.modes.frequency_hz
            pairs = measured_pairs(hz_of_test, frequencies, of_these, apart, FROM_AFAR)
            index.append(pairs.index)
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


def held_out_misfit(of_fit: Fitted, highest_hz: float) -> Misfit | None:
    """Of the fitted model at lines around the resonances that were not fitted, as high as the
    projection holds; None where all were."""
    if of_fit.chosen.all():
        return None
    band = (0.0, highest_hz)
    lines, _ = measured_lines(of_fit.test, of_fit.places, band, ~of_fit.chosen)
    if not len(lines.frequency_hz):
        return None
    fit = of_fit.fit
    H = computed_responses(of_fit.model_of, fit.parameters, fit.value, lines.frequency_hz).H
    return misfit(lines, H)


def remarks_on_fit(of_fit: Fitted, after: Misfit) -> list[str]:
    """Sentences on what the fit is worth: its noise, the model's error, values left open or at
    their bounds, correlations, damping, and records that end too early."""
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
            "each other, which does not show what all of them share, as an error in the "
            "calibration of hammer and sensors: the last column says what 1 % in the height of all "
            "responses changes."
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
        if left.max() > LASTING_AMPLITUDE:
            hz = test.modes.frequency_hz[left.argmax()]
            remarks.append(
                f"the records end while {hz:.5g} Hz still has {100 * left.max():.2g} % of its "
                "amplitude: its peak is too low by about as much, its damping not."
            )
    return remarks


def response_report(
    of_fit: Fitted,
    full: FullModel,
    highest_hz: float,
    *,
    evaluations: int,
    seconds: float,
    steps: list[str],
    remarks: list[str],
) -> ResponseReport:
    """The report of a fit: misfits at the scene's values, at the fitted ones and of the full model,
    and of lines up to `highest_hz` that had no part in it."""
    scene, test, fit, data = of_fit.scene, of_fit.test, of_fit.fit, of_fit.data
    at_scene = computed_responses(of_fit.before, [], np.zeros(0), data.frequency_hz).H
    after = computed_responses(of_fit.model_of, fit.parameters, fit.value, data.frequency_hz).H
    off = [misfit(data, H) for H in (at_scene, after, full.H)]
    # where a response is no more than noise, as across a plane of symmetry, so is a ratio of two
    clear = np.abs(data.H) > CLEAR_OF_NOISE * data.noise
    apart = np.abs(20 * np.log10(np.abs(after / full.H)))
    projection_decibel = float(apart[clear].max(initial=0.0))
    projection_rms = float(np.sqrt(np.mean(apart[clear] ** 2))) if clear.any() else 0.0
    held_out = held_out_misfit(of_fit, highest_hz)
    remarks = [
        *remarks,
        *(remarks_on_axes(scene) if scene.test_axes else ()),
        *remarks_on_fit(of_fit, off[1]),
        "the full model's responses differ from those of the fit's projection by "
        f"{projection_rms:.2g} dB (rms), {projection_decibel:.2g} dB at most, where they are "
        f"{CLEAR_OF_NOISE:g} times their noise.",
    ]
    undetermined_ones = {
        key: "rigid" if np.isinf(x) else x
        for p in of_fit.parameters if p.name not in {q.name for q in fit.parameters}
        for key, x in values_of(scene, p)
    }  # fmt: skip
    return ResponseReport(
        scene=scene.name, file=test.report.file, title=test.report.title, values=value_rows(of_fit),
        undetermined=undetermined_ones, resonances=resonance_rows(of_fit, full),
        before=MisfitRow(decibel=off[0].decibel, degrees=off[0].degrees),
        after=MisfitRow(decibel=off[1].decibel, degrees=off[1].degrees),
        full=MisfitRow(decibel=off[2].decibel, degrees=off[2].degrees),
        projection_decibel=projection_decibel,
        held_out=None if held_out is None
        else MisfitRow(decibel=held_out.decibel, degrees=held_out.degrees),
        noise_decibel=off[1].noise_decibel, model_error_decibel=float(DB * fit.error.level),
        lines=len(data.frequency_hz), responses=data.H[..., 0].size, evaluations=evaluations,
        seconds=seconds, steps=steps, remarks=remarks,
    )  # fmt: skip


def pictures(
    of_fit: Fitted, quantity: str, band_hz: tuple[float, float], top: float, most: int = 4
) -> tuple[Picture, ...]:
    """Magnitude and phase of the responses with most energy, of the test and before and after the
    fit; lines that were not fitted lie in grey."""
    test, fit, used = of_fit.test, of_fit.fit, of_fit.places.used
    responses = test.test.responses
    f = responses.frequency_hz
    # to 15 % of the band beyond it and beyond the highest mode, as pictures of the test
    last = max(band_hz[1], test.modes.frequency_hz.max()) + 0.15 * (band_hz[1] - band_hz[0])
    lines = np.flatnonzero((f > 0) & (f <= min(top / 1.2, last)) & responses.usable)
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
            (test.kind_of_data, H[i, j], "0.45", "-", 2.2),
            ("before", before[i, j], plots.COLOURS[1], "--", 1.0),
            ("fitted", after[i, j], plots.COLOURS[0], "-", 1.1),
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
        upper.set_ylabel(UNITS[quantity])
        lower.set_ylabel("phase [deg]")
        lower.set_yticks([-180, 0, 180])
        lower.set_ylim(-190, 190)
    plots.legend(pairs[0][0], "above")
    pairs[-1][1].set_xlabel("frequency [Hz]" + ("" if read.all() else "; grey: not fitted"))
    return (Picture("responses", plots.png(figure, test.banner)),)
