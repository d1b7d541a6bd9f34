"""A hammer test: hits or responses -> modes with deviations, their report and pictures."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from beadwave import fem
from beadwave.fem.identification.decay import AmplitudeStep, over_amplitude, varies
from beadwave.fem.identification.distortion import combination_tone
from beadwave.fem.identification.half_power import half_power_bandwidth
from beadwave.fem.identification.hammer_test import (
    accelerances,
    corner_readings,
    nearest_modes,
    with_noise,
)
from beadwave.fem.identification.hit_records import node_and_axis
from beadwave.fem.identification.hits import FrequencyResponses, lines_left_out
from beadwave.fem.identification.poly_reference import IdentifiedModes, identified_modes
from beadwave.fem.identification.subspace import subspace_modes
from beadwave.workflows.files.hammer import MeasuredTest, Reading, measured_test
from beadwave.workflows.files.record import SYNTHETIC
from beadwave.workflows.files.response_files import Responses
from beadwave.workflows.files.run_folder import Picture
from beadwave.workflows.report import plots
from beadwave.workflows.report.number_format import digits
from beadwave.workflows.report.plots import Line, Panel
from beadwave.workflows.report.tables import aligned_text
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.stages.engine.pipeline import Pipeline
from beadwave.workflows.stages.structure.loss_factors import ratios_of_modes
from beadwave.workflows.structure.mode_table import NO_TARGETS

VIRTUAL_LINES = np.arange(10.0, 10_000.0, 0.2)  # [Hz]


UNITS = {"accelerations": "m/s^2 / N", "velocities": "m/s / N", "displacements": "m / N"}

# of a residue at a driving point
PHASES = {"accelerations": 1j, "velocities": 1.0, "displacements": -1j}


# Thresholds above which a mode property is reported
LOW_COLLINEARITY = 0.8  # phase collinearity below which a shape is complex
LOW_COHERENCE = 0.8  # at a mode, in the median over responses
COARSE_LINES = 4  # lines in a bandwidth that the half-power value needs
DAMPING_DIFFERENCE = 0.15  # relative difference of the damping ratio by the half-power bandwidth
LARGE_ZETA_DEVIATION = 0.2  # relative deviation of a damping ratio


class Choice(NamedTuple):
    """Decisions of a user on the poles of a test."""

    band_hz: tuple[float, float] | None = None
    reject: tuple[int, ...] = ()  # numbers of poles
    accept: tuple[int, ...] = ()


class AmplitudeRow(BaseModel):
    """Frequency and damping at an amplitude of a ring-down, in the unit of the record."""

    amplitude: float
    frequency_hz: float
    zeta: float
    zeta_deviation: float


class HammerRow(BaseModel):
    """One identified mode, and the mode of the scene that it is paired with."""

    number: int  # of the pole, for --reject
    frequency_hz: float
    # one standard deviation, as the next; None where the blocks of an ambient record do not say
    frequency_deviation_hz: float | None
    zeta: float
    zeta_deviation: float | None
    zeta_half_power: float | None
    collinearity: float
    coherence: float | None = None
    mode: int | None = None
    computed_hz: float | None = None  # of the computed mode that it is paired with
    mac: float | None = None
    runner_up_hz: float | None = None  # of the next most like computed mode
    runner_up_mac: float | None = None
    over_amplitude: list[AmplitudeRow] = []  # of ring-downs, where the mode stands clear
    remarks: list[str]


class LeftOutRow(BaseModel):
    """A pole that is no mode of the list."""

    number: int
    frequency_hz: float
    zeta: float
    reason: str


class StepRow(BaseModel):
    """A step from the files to the modes."""

    file: str
    step: str
    options: dict[str, float | int | str | None]
    left_out: list[str]

    def text(self) -> str:
        """Text on the options that were used and on what was left out."""
        options = [
            f"{name} {value:.6g}" if isinstance(value, float) else f"{name} {value}"
            for name, value in self.options.items()
            if value not in (None, "")
        ]
        left_out = f"; left out: {'; '.join(self.left_out)}" if self.left_out else ""
        return f"{self.file}: {', '.join([self.step, *options])}{left_out}."


class HammerReport(BaseModel):
    """The modes of a hammer test, each with the mode that it is paired with."""

    file: str
    title: str
    n_targets: int  # of the scene that the modes are paired with
    rows: list[HammerRow]
    left_out: list[LeftOutRow]
    steps: list[StepRow]  # from the files to the modes
    remarks: list[str]  # on the test as a whole

    @property
    def file_names(self) -> list[str]:
        """Names of the files that were read, without their folders."""
        return [Path(step.file).name for step in self.steps if step.step.startswith("read ")]

    @property
    def targets(self) -> dict[int, float]:
        """Measured frequencies of the scene's modes by number [Hz], for `tune`."""
        return {row.mode: row.frequency_hz for row in self.rows if row.mode}

    @property
    def damping(self) -> dict[int, float]:
        """Their damping ratios."""
        return {row.mode: row.zeta for row in self.rows if row.mode}

    def text(self) -> str:
        """A table of the modes, remarks on them, and what was left out."""
        head = ("#", "Hz", "+-", "damping", "+-", "phase", "mode")
        paired = ("computed Hz", "MAC", "next Hz", "MAC")
        by_shape = any(row.mac or row.runner_up_mac for row in self.rows)
        table = []
        for row in self.rows:
            df, dzeta = row.frequency_deviation_hz, row.zeta_deviation
            cells = (
                row.number, f"{row.frequency_hz:.2f}", None if df is None else f"{df:.2g}",
                f"{100 * row.zeta:.3f} %", None if dzeta is None else f"{100 * dzeta:.2g} %",
                f"{row.collinearity:.2f}", row.mode,
            )  # fmt: skip
            if by_shape:
                for hz, mac in (
                    (row.computed_hz, row.mac), (row.runner_up_hz, row.runner_up_mac)
                ):  # fmt: skip
                    known = mac is not None and hz is not None
                    cells += (f"{hz:.2f}", f"{mac:.2f}") if known else (None, None)
            table.append((*cells, "; ".join(row.remarks)))
        head += (*paired, "") if by_shape else ("",)
        lines = [self.title, aligned_text(head, table)]
        if self.left_out:
            lines += ["", "left out:"]
            lines += [f"{r.number}: {r.frequency_hz:.2f} Hz, {r.reason}" for r in self.left_out]
        hits = [sentence for step in self.steps for sentence in step.left_out]
        lines += ["", *hits, *self.remarks] if hits or self.remarks else []
        return "\n".join(lines if self.n_targets else [*lines, "", NO_TARGETS])


class IdentifiedTest(NamedTuple):
    """A measured test, its modes, and the report on them."""

    report: HammerReport
    test: MeasuredTest
    modes: IdentifiedModes

    @property
    def banner(self) -> str:
        """Banner over pictures of a computed test; none over a measured one."""
        return SYNTHETIC if SYNTHETIC in self.report.title else ""

    @property
    def kind_of_data(self) -> str:
        """Name of the responses of the test in a legend."""
        return "computed, with noise" if self.banner else "measured"

    @property
    def band_hz(self) -> tuple[float, float]:
        """The band in which modes were identified."""
        options = self.report.steps[-1].options
        return float(options["from_hz"]), float(options["to_hz"])


def hammer_test(
    paths: Path | list[Path],
    expected_hz: Mapping[int, float],
    reading: Reading = Reading(),
    choice: Choice = Choice(),
) -> IdentifiedTest:
    """Read, identify and pair with modes expected near `expected_hz` {mode: Hz}; raises
    InvalidScene where no mode is identified."""
    paths = [paths] if isinstance(paths, Path) else paths
    test, named = measured_test(paths, reading), ", ".join(map(str, paths))
    require_identifiable(test, named, choice.band_hz)

    # of ambient records, whose force nobody knows, by the correlation of the responses alone
    try:
        if test.kind == "ambient":
            (records,) = test.records
            highest = 0.4 / records.dt  # four fifths of what the sampling holds
            choice = choice._replace(band_hz=choice.band_hz or (highest / 100, highest))
            modes = subspace_modes(
                list(records.response), records.dt, choice.band_hz,
                reject=choice.reject, accept=choice.accept,
            )  # fmt: skip
        else:
            modes = identified_modes(
                test.responses, choice.band_hz, reject=choice.reject, accept=choice.accept
            )
    except ValueError as error:
        raise InvalidScene(f"{named}: {str(error).rstrip('.')}.") from None

    # the report: modes, poles left out, and every step from the files to the modes
    rows = hammer_rows(test, modes, expected_hz)
    left_out = [LeftOutRow(**row._asdict()) for row in modes.left_out]
    f = test.responses.frequency_hz
    band = choice.band_hz or (float(f[f > 0][0]), float(f[-1]))
    steps = [StepRow(**{**step._asdict(), "left_out": list(step.left_out)}) for step in test.steps]
    steps.append(
        StepRow(
            file=named, step="subspace identification" if test.kind == "ambient"
            else "poly-reference identification",
            options={
                "from_hz": band[0], "to_hz": band[1],
                "reject": ",".join(map(str, choice.reject)),
                "accept": ",".join(map(str, choice.accept)),
            },
            left_out=[],
        )
    )  # fmt: skip
    remarks, missing = opposite_directions(test, modes), points_without_place(test)
    if test.kind != "ambient":
        within = (f >= band[0]) & (f <= band[1])
        remarks += lines_left_out(f[within], test.responses.usable[within])
    if test.nodes and missing:
        points = test.responses.points
        listed = ", ".join(points[i] for i in missing[:8]) + (", ..." if len(missing) > 8 else "")
        remarks.append(
            f"{len(missing)} of {len(points)} points have no coordinates ({listed}); shapes are "
            "compared at the others: give the nodes of all in --points"
        )
    report = HammerReport(
        file=named, title=test.title, n_targets=len(expected_hz), rows=rows, left_out=left_out,
        steps=steps, remarks=remarks,
    )  # fmt: skip
    return IdentifiedTest(report, test, modes)


def require_identifiable(
    test: MeasuredTest, named: str, band_hz: tuple[float, float] | None
) -> None:
    """Raise InvalidScene for responses in which no modes can be identified: too few or uneven
    frequencies, or values that are no numbers or all alike."""
    responses = test.responses
    f, H = responses.frequency_hz, responses.H
    spacing = np.diff(f)
    if not np.isfinite(f).all():
        line = int(np.isfinite(f).argmin()) + 1
        raise InvalidScene(f"{named}: frequency {line} is no number; remove its line.")
    if not np.isfinite(H).all():
        i, j, k = np.argwhere(~np.isfinite(H))[0]
        raise InvalidScene(
            f"{named}: the response of {responses.points[i]} to {responses.references[j]} is no "
            f"number at {f[k]:g} Hz; remove such lines or measure again."
        )
    if len(f) < 40:
        raise InvalidScene(f"{named}: {len(f)} frequencies; give at least 40.")
    if np.any(spacing <= 0) or np.ptp(spacing) > 1e-3 * spacing.mean():
        raise InvalidScene(
            f"{named}: the frequencies are not evenly spaced in ascending order; resample them."
        )
    dead = [
        f"{responses.points[i]} to {responses.references[j]}"
        for i, j in np.argwhere(~(np.ptp(np.abs(H), axis=2) > 0))
    ]
    if dead:
        raise InvalidScene(
            f"{named}: the response of {dead[0]} has no peaks; leave it out, or give responses "
            "that reach a resonance."
        )
    if band_hz is not None and test.kind != "ambient":
        low, high = band_hz
        n_within = np.count_nonzero((f >= low) & (f <= high))
        if n_within < 40:
            raise InvalidScene(
                f"{named}: --band {low:g}:{high:g} holds {n_within} of its frequencies, "
                f"which reach from {f[0]:g} to {f[-1]:g} Hz; take a band of at least 40 of them."
            )


def hammer_rows(
    test: MeasuredTest,
    modes: IdentifiedModes,
    expected_hz: Mapping[int, float],
) -> list[HammerRow]:
    """A row per mode: its numbers with those of the half-power bandwidth, and what is remarkable
    about it.

    Half-power damping is (f_2 - f_1) / (2 f) of the largest response, less shift / omega: an
    exponential window damps records by exp(-shift t).
    """
    responses = test.responses
    paired = nearest_modes(modes.frequency_hz.tolist(), dict(expected_hz))
    f, H = responses.frequency_hz, responses.H

    # ring-downs alone show damping over amplitude; a combination tone is weaker than its parents
    rows = []
    lines = np.abs(f - modes.frequency_hz[:, None]).argmin(axis=1)
    decays = [
        decay_of(test, modes, i) if test.kind == "ring-downs" else [] for i in range(len(lines))
    ]
    not_linear = np.array([varies(steps) for steps in decays])
    height = np.array([np.abs(H[:, :, max(n - 2, 0) : n + 3]).max() for n in lines])
    for i, (hz, zeta) in enumerate(zip(modes.frequency_hz, modes.zeta, strict=True)):
        line = int(lines[i])
        remarks = []
        # the half-power bandwidth in the response where the mode is largest
        at = np.unravel_index(np.abs(H[:, :, line]).argmax(), H.shape[:2])
        window = slice(max(line - 2, 0), line + 3)
        peak = window.start + int(np.abs(H[at][window]).argmax())
        f_peak, width = half_power_bandwidth(f, np.abs(H[at]), peak)
        if width < COARSE_LINES * (f[1] - f[0]):
            width = np.nan  # lines too far apart to tell
        half_power = width / (2 * f_peak) - responses.shift / (2 * np.pi * hz)
        if not half_power > 0:
            half_power = np.nan
        elif abs(half_power / zeta - 1) > DAMPING_DIFFERENCE:
            remarks.append(f"half-power bandwidth: {100 * half_power:.2g} %")
        coherence = None
        if responses.coherence is not None:
            coherence = float(np.median(responses.coherence[:, :, line]))
            if coherence < LOW_COHERENCE:
                remarks.append(f"coherence {coherence:.2f}")
        if modes.collinearity[i] < LOW_COLLINEARITY:
            remarks.append("complex shape")
        if modes.zeta_deviation[i] > LARGE_ZETA_DEVIATION * zeta:
            remarks.append("damping uncertain")
        df, dzeta = modes.frequency_deviation[i], modes.zeta_deviation[i]
        if not np.isfinite([df, dzeta]).all():
            remarks.append("deviations unknown: fewer than half of the record's blocks show it")
        if tone := combination_tone(i, modes.frequency_hz, modes.zeta, height, not_linear):
            remarks.append(f"perhaps no mode: {tone}")
        steps = decays[i]
        if not_linear[i]:
            least, most = (pick(steps, key=lambda step: step.zeta) for pick in (min, max))
            remarks.append(
                f"damping depends on amplitude: {100 * most.zeta:.3g} % at {most.amplitude:.2g}, "
                f"{100 * least.zeta:.3g} % at {least.amplitude:.2g}"
            )
        rows.append(
            HammerRow(
                number=int(modes.number[i]), frequency_hz=float(hz), zeta=float(zeta),
                frequency_deviation_hz=float(df) if np.isfinite(df) else None,
                zeta_deviation=float(dzeta) if np.isfinite(dzeta) else None,
                zeta_half_power=None if np.isnan(half_power) else float(half_power),
                collinearity=float(modes.collinearity[i]), coherence=coherence,
                mode=paired.get(i), remarks=remarks,
                over_amplitude=[AmplitudeRow(**step._asdict()) for step in steps],
            )
        )  # fmt: skip
    return rows


def decay_of(test: MeasuredTest, modes: IdentifiedModes, mode: int) -> list[AmplitudeStep]:
    """Frequency and damping of a mode over its amplitude, in the record where it lasts longest."""
    decays = []
    for hits in test.records:
        for y in hits.response:
            onset = int(np.abs(y).max(axis=0).argmax())
            decays.append(
                over_amplitude(y[:, onset:], hits.dt, modes.frequency_hz, modes.phi, mode)
            )
    return max(decays, key=len)


def opposite_directions(test: MeasuredTest, modes: IdentifiedModes) -> list[str]:
    """Sentences on driving points where hammer and sensor do not move alike.

    Where a point is hit and watched along one axis, H = sum R / (i omega - lambda) + conj. with
    R = c phi^2: all modes have R of one phase (receptance -i, mobility 1, accelerance i). Its sign
    tells hammer and sensor along opposite directions where the quantity is known, and a mixed one
    a mixed-up point.
    """
    responses, sentences = test.responses, []
    if test.kind == "ambient":
        return []
    for i, point in enumerate(responses.points):
        for j, reference in enumerate(responses.references):
            ends = node_and_axis(point), node_and_axis(reference)
            if None in ends or (ends[0][0], abs(ends[0][1])) != (ends[1][0], abs(ends[1][1])):
                continue

            # modes that both ends see, and the phases of their residues
            residues = modes.phi[i] * modes.participation[:, j]
            size = np.abs(residues) / np.abs(modes.phi).max(axis=0)
            weight = size / np.abs(modes.participation).max(axis=1)
            clear = weight > 0.1  # a node of the mode has no phase; not varied
            phase = residues[clear] / np.abs(residues[clear])
            if len(phase) < 2:
                continue
            # alike to within a sign: the mean of the squares; then the signs themselves
            axis = np.exp(0.5j * np.angle(np.mean(phase**2)))
            one_way = np.sign(ends[0][1] * ends[1][1])
            axis = PHASES.get(test.quantity, axis) * one_way
            signs = np.sign((phase / axis).real)
            if test.quantity in PHASES and np.all(signs < 0):
                sentences.append(
                    f"driving point {point}: the {test.quantity} are against the force in all "
                    f"modes; hammer and sensor point against each other: name one of them with "
                    "the other sign"
                )
            if abs(signs.sum()) < len(signs):
                sentences.append(
                    f"driving point {point}: {np.count_nonzero(signs != np.sign(signs.sum()))} of "
                    f"{len(signs)} modes move against the others; hammer and sensor are not at "
                    "one place along one direction"
                )
    return sentences


def points_without_place(test: MeasuredTest) -> list[int]:
    """Positions of the points whose node has no coordinates, or that have no node."""
    ends = [node_and_axis(name) for name in test.responses.points]
    return [i for i, end in enumerate(ends) if end is None or end[0] not in test.nodes]


def shown_lines(test: IdentifiedTest, beyond: float = 0.15) -> NDArray[np.bool_]:
    """Lines (f,) that pictures show: above 0, excited by the force, within the band and `beyond` of
    its width past its ends."""
    (low, high), f = test.band_hz, test.test.responses.frequency_hz
    margin = beyond * (high - low)
    return (f > 0) & (f >= low - margin) & (f <= high + margin) & test.test.responses.usable


def summed_response(
    responses: FrequencyResponses, lines: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Frequencies of the chosen lines (k,) [Hz], and the root of the sum of the squares of all
    responses there."""
    size = np.sqrt(np.sum(np.abs(responses.H[:, :, lines]) ** 2, axis=(0, 1)))
    return responses.frequency_hz[lines], size


def pictures(test: IdentifiedTest) -> list[Picture]:
    """Stability diagram, responses of the test over synthesised ones, coherence and AutoMAC; grey
    beyond the band."""
    responses, modes, rows = test.test.responses, test.modes, test.report.rows
    f, H, within = responses.frequency_hz, responses.H, shown_lines(test)
    size = summed_response(responses, within)[1]
    low, high = test.band_hz
    ends = [(a, b) for a, b in ((f[within][0], low), (high, f[within][-1])) if b > a]
    across = "frequency [Hz]" + ("; grey: beyond the band" if ends else "")
    unit = UNITS.get(test.test.quantity)
    up = f"{test.test.quantity} over force [{unit}]" if unit else "response over force"

    def framed(sets: list[Panel], height: float):
        """Figure and axes of panels, grey beyond the band."""
        figure, axes = plots.drawn(sets, size=(9, height))
        for axis in axes:
            for a, b in ends:
                axis.axvspan(a, b, color="0.93", zorder=0)
        return figure, axes

    # poles of every order over the sum of all responses; lines at the modes, with their numbers
    top = max(order for order, _ in modes.diagram)
    span = np.array([size.min(), size.max()])
    orders = np.concatenate([np.full(len(poles), order) for order, poles in modes.diagram])
    hz = np.concatenate([np.abs(poles) / (2 * np.pi) for _, poles in modes.diagram])
    level = span[0] * (span[1] / span[0]) ** (orders / top)
    numbered = np.array([row.frequency_hz for row in (*rows, *test.report.left_out)])
    recurs = np.abs(np.divide.outer(hz, numbered) - 1).min(axis=1) < 0.005
    lines = [Line(None, np.full(2, row.frequency_hz), span, ":", "0.5", 0.8) for row in rows]
    lines += [
        Line("sum of all responses", f[within], size, "-", 0),
        Line(f"poles of orders up to {top}", hz[~recurs], level[~recurs], "x", "0.8"),
        Line("of them near a numbered one", hz[recurs], level[recurs], "x", 1),
    ]
    names = test.report.file_names
    named = names[0] if len(names) == 1 else f"{names[0]} and {len(names) - 1} more"
    panel = Panel(named, across, up, lines, "y", (None, 2 * span[1]), legend="above")
    figure, (axis,) = framed([panel], 4.5)
    for row in rows:
        axis.annotate(
            f"{row.number}", (row.frequency_hz, span[1]), (0, 2),
            textcoords="offset points", ha="center", fontsize=8,
        )  # fmt: skip
    drawn = [Picture("hammer", plots.png(figure, test.banner))]

    # the responses with most energy, four at most
    energy = np.sum(np.abs(H) ** 2, axis=2)
    panels = []
    for place in np.argsort(-energy.ravel())[:4]:
        i, j = np.unravel_index(int(place), energy.shape)
        lines = [Line(test.kind_of_data, f[within], np.abs(H[i, j, within]), "-", 0, 0.9)]
        for k, (hz, model) in enumerate(modes.synthesis):
            drawn_too = (hz >= f[within][0]) & (hz <= f[within][-1])
            size = np.abs(model[i, j, drawn_too])
            lines.append(Line(None if k else "modes found", hz[drawn_too], size, "--", 1))
        title = f"{responses.points[i]} to {responses.references[j]}"
        panels.append(Panel(title, across, up, lines, "y", legend="above"))
    drawn.append(Picture("synthesis", plots.png(framed(panels, 2.6)[0], test.banner)))

    # coherence, damping over amplitude of ring-downs, and how alike shapes are, where there are any
    if responses.coherence is not None:
        low, middle = np.quantile(responses.coherence, [0.1, 0.5], axis=(0, 1))
        lines = [
            Line("median of the responses", f[within], middle[within], "-", 0),
            Line("a tenth lie below", f[within], low[within], "-", 1, 0.8),
        ]
        panel = Panel("", across, "coherence", lines, "", (0.0, 1.02), "above")
        drawn.append(Picture("coherence", plots.png(framed([panel], 2.8)[0], test.banner)))
    decaying = [row for row in rows if row.over_amplitude]
    if decaying:
        lines = []
        for k, row in enumerate(decaying[:8]):
            amplitude = np.array([step.amplitude for step in row.over_amplitude])
            percent = np.array([100 * step.zeta for step in row.over_amplitude])
            lines.append(Line(f"{digits(row.frequency_hz, 5)} Hz", amplitude, percent, "o-", k))
        panel = Panel("damping over amplitude", "amplitude", "damping ratio [%]", lines, "x")
        figure = plots.drawn([panel], size=(8, 3.6))[0]
        drawn.append(Picture("decay", plots.png(figure, test.banner)))
    if len(responses.points) > 1 and len(rows) > 1:
        drawn.append(Picture("automac", auto_mac(test)))
    return drawn


def auto_mac(test: IdentifiedTest) -> bytes:
    """PNG of the MAC of the measured shapes with each other, as `mac` shows that with computed."""
    names = [f"{row.number}: {digits(row.frequency_hz, 5)} Hz" for row in test.report.rows]
    figure, (axis,) = plots.subplots(1, 1, (2.4 + 0.62 * len(names), 1.6 + 0.5 * len(names)))
    values = fem.mac(test.modes.phi, test.modes.phi)
    plots.heat_map(axis, values, (names, names), "AutoMAC", legible=0.1, limits=(0, 1))
    axis.tick_params(axis="x", rotation=60)
    return plots.png(figure, test.banner)


def virtual_test(pipeline: Pipeline) -> Responses:
    """Accelerances at a corner of the body struck, hit along (1, 1, 1) there: computed, with noise.

    H_ij = sum_k phi_ik phi_jk (-omega^2) / (omega_k^2 - omega^2 + 2 i zeta_k omega_k omega)

    Raises InvalidScene for a scene without damping, whose resonances would be infinite.
    """
    scene, modes = pipeline.scene, pipeline("modes")
    zeta = ratios_of_modes(scene, pipeline("model"), modes)
    if not zeta.any():
        raise InvalidScene("a virtual test needs damping; set damping.kind=modal with a ratio.")
    phi_corner = corner_readings(pipeline("model"), scene.struck_body) @ modes.phi
    phi_hit = np.array([1.0, 1.0, 1.0]) / np.sqrt(3) @ phi_corner
    H = accelerances(phi_corner, phi_hit, modes.omega, zeta, VIRTUAL_LINES)
    # noise of 2e-3 of the rms response
    noisy = with_noise(H, 2e-3, np.random.default_rng(0))
    return Responses(VIRTUAL_LINES, noisy, SYNTHETIC)
