"""A hammer test: responses -> frequencies and damping by two methods -> the model's modes."""

from collections.abc import Collection
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pydantic import BaseModel

import coupling
import fem
from fem.correlation import measured_pairs
from fem.hammer_files import SYNTHETIC, Responses
from fem.hammer_test import accelerances, corner_readings, nearest_modes, with_noise
from fem.identification import measured_modes
from workflows.files.hammer import responses
from workflows.files.run_folder import Picture
from workflows.report import plots
from workflows.report.plots import Line, Panel
from workflows.report.tables import aligned_text
from workflows.scene import InvalidScene, ModalDampingTable, Scene
from workflows.stages.damping import damping_law
from workflows.stages.pipeline import Pipeline
from workflows.stages.targets import shape
from workflows.structure.mode_table import NO_TARGETS
from workflows.structure.tuning import targets

VIRTUAL_LINES = np.arange(10.0, 10_000.0, 0.2)  # [Hz]
VIRTUAL_NOISE = 2e-3  # of the rms response


class HammerRow(BaseModel):
    """One measured resonance, and the mode of the scene that it is paired with."""

    frequency_hz: float
    zeta_half_power: float | None
    zeta_fit: float | None
    mode: int | None = None
    computed_hz: float | None = None  # of the computed mode that it is paired with
    mac: float | None = None
    runner_up_hz: float | None = None  # of the next most like computed mode
    runner_up_mac: float | None = None
    remarks: list[str]


class HammerReport(BaseModel):
    """The resonances of a hammer test, each beside the mode that it is paired with."""

    file: str
    title: str
    n_targets: int  # of the scene that the resonances are paired with
    rows: list[HammerRow]

    @property
    def targets(self) -> dict[int, float]:
        """Measured frequencies of the scene's modes by number [Hz], for `tune`."""
        return {row.mode: row.frequency_hz for row in self.rows if row.mode}

    @property
    def damping(self) -> dict[int, float]:
        """Their damping ratios, the fit's where there is one."""
        ratios = {r.mode: r.zeta_fit or r.zeta_half_power for r in self.rows if r.mode}
        return {mode: zeta for mode, zeta in ratios.items() if zeta}

    def text(self) -> str:
        """A table of the resonances, and remarks on them."""
        head = ("Hz", "half-power", "fit", "mode", "computed Hz", "MAC", "next Hz", "MAC", "")
        table = []
        for row in self.rows:
            zetas = (f"{100 * z:.3f} %" if z else None for z in (row.zeta_half_power, row.zeta_fit))
            by_shape: list[str | None] = []
            for hz, mac in ((row.computed_hz, row.mac), (row.runner_up_hz, row.runner_up_mac)):
                by_shape += [None, None] if mac is None else [f"{hz:.2f}", f"{mac:.2f}"]
            remarks = "; ".join(row.remarks)
            table.append((f"{row.frequency_hz:.2f}", *zetas, row.mode, *by_shape, remarks))

        # responses without points have no shapes
        if not any(row.mac or row.runner_up_mac for row in self.rows):
            head, table = (*head[:4], ""), [(*cells[:4], cells[-1]) for cells in table]
        lines = [self.title, aligned_text(head, table)]
        return "\n".join(lines if self.n_targets else [*lines, "", NO_TARGETS])


class IdentifiedTest(NamedTuple):
    """Responses of a file, and the resonances that were identified."""

    report: HammerReport
    responses: Responses


def hammer_test(path: Path, expected_hz: dict[int, float]) -> IdentifiedTest:
    """Read, identify and pair with modes expected near `expected_hz` {mode: Hz}; raises
    InvalidScene where no resonance is identified."""
    test = responses(path)
    try:
        resonances = measured_modes(test.frequency_hz, test.H)
    except ImportError as missing:
        raise InvalidScene(
            f"the fit needs {missing.name}; ./install.sh identify adds it."
        ) from None
    except ValueError as error:
        raise InvalidScene(f"{path}: {error}") from None
    if not resonances:
        raise InvalidScene(f"{path} has no peaks; give responses that reach a resonance.")

    paired = nearest_modes([resonance.frequency_hz for resonance in resonances], expected_hz)
    rows = []
    for i, resonance in enumerate(resonances):
        half_power, fit = (None if np.isnan(z) else float(z) for z in resonance[1:3])
        rows.append(
            HammerRow(
                frequency_hz=resonance.frequency_hz,
                zeta_half_power=half_power,
                zeta_fit=fit,
                mode=paired.get(i),
                remarks=list(resonance.remarks),
            )
        )
    report = HammerReport(file=str(path), title=test.title, n_targets=len(expected_hz), rows=rows)
    return IdentifiedTest(report, test)


def recognised(test: IdentifiedTest, pipeline: Pipeline, wanted: Collection[int]) -> IdentifiedTest:
    """The test with its resonances paired one-to-one with computed modes, on MAC and frequency
    together; that of a wanted target's mode gets the target's number."""
    report, scene = test.report, pipeline.scene
    model, modes = pipeline("model"), pipeline("modes")
    computed_hz = modes.omega / (2 * np.pi)
    shapes = [shape(scene, model, report.file, row.frequency_hz) for row in report.rows]
    readings = [target.reading @ modes.phi for target in shapes]
    likeness = np.array(
        [fem.mac(at, s.shape[:, None])[:, 0] for at, s in zip(readings, shapes, strict=True)]
    )
    measured_hz = np.array([row.frequency_hz for row in report.rows])
    # all shapes of one file are read at the same points
    pairs = measured_pairs(measured_hz, computed_hz, likeness, fem.mac(readings[0], readings[0]))
    number = {j: n for n, j in enumerate(modes.index.tolist(), start=1) if n in wanted}
    rows = []
    for i, row in enumerate(report.rows):
        update: dict = {"mode": None, "remarks": [*row.remarks, *pairs.doubts[i]]}
        j, second = int(pairs.index[i]), int(pairs.runner_up[i])
        if j >= 0:
            update |= {
                "mode": number.get(j), "computed_hz": float(computed_hz[j]),
                "mac": float(likeness[i, j]),
            }  # fmt: skip
        else:
            update["remarks"].append("no computed mode is like it")
        if second >= 0:
            update |= {
                "runner_up_hz": float(computed_hz[second]),
                "runner_up_mac": float(likeness[i, second]),
            }
        rows.append(row.model_copy(update=update))
    return test._replace(report=report.model_copy(update={"rows": rows}))


def picture(test: IdentifiedTest) -> Picture:
    """The responses over frequency, a line at each resonance, those of the model's modes by
    number."""
    f, H = test.responses.frequency_hz, test.responses.H
    positive = f > 0
    lines = [
        Line(f"response {i}", f[positive], np.abs(h[positive]), "-", width=0.9)
        for i, h in enumerate(H, start=1)
    ]
    size = np.abs(H[H != 0])
    span = np.array([size.min(), size.max()]) if size.size else np.array([1.0, 1.0])
    resonances = [
        Line(None, np.full(2, row.frequency_hz), span, ":", "0.5", 0.8) for row in test.report.rows
    ]
    panel = Panel(test.report.title, "frequency [Hz]", "response", [*resonances, *lines], "xy")
    figure, (axis,) = plots.drawn([panel], size=(8, 4.2))
    for row in test.report.rows:
        axis.annotate(
            f"{row.mode}" if row.mode else "", (row.frequency_hz, span[1]), (0, 2),
            textcoords="offset points", ha="center", fontsize=8,
        )  # fmt: skip
    return Picture("hammer", plots.png(figure))


def applied(
    scene: Scene, report: HammerReport, match: str | None
) -> tuple[Scene, dict[int, float]]:
    """The scene with the measured damping, where all its modes have one, and the measured
    frequencies to tune to, {mode: Hz}; raises InvalidScene for modes without a resonance."""
    if not report.targets:
        raise InvalidScene(f"{report.file} has no resonance near the modes wanted; name others.")
    wanted = targets(match, scene.measured_hz) if match else {}
    missing = sorted(set(wanted) - set(report.targets))
    if missing:
        raise InvalidScene(f"{report.file} has no resonance near modes {missing}; leave them out.")
    ratios = [report.damping.get(i) for i in range(1, len(scene.measured_hz) + 1)]
    if None not in ratios:
        scene = scene.but(damping=ModalDampingTable(kind="modal", ratio=tuple(ratios)))
    return scene, report.targets


def virtual_test(pipeline: Pipeline) -> Responses:
    """Accelerances at a corner of the body struck, hit along (1, 1, 1) there: computed, with noise.

    H_ij = sum_k phi_ik phi_jk (-omega^2) / (omega_k^2 - omega^2 + 2 i zeta_k omega_k omega)
    """
    scene, modes = pipeline.scene, pipeline("modes")
    damping = damping_law(scene.damping, scene.measured_hz)
    if damping is None:
        raise InvalidScene("a virtual test needs damping; set damping.kind=modal with a ratio.")
    zeta = coupling.damping_ratios(damping, modes.omega)
    phi_corner = corner_readings(pipeline("model"), scene.struck_body) @ modes.phi
    phi_hit = np.array([1.0, 1.0, 1.0]) / np.sqrt(3) @ phi_corner
    H = accelerances(phi_corner, phi_hit, modes.omega, zeta, VIRTUAL_LINES)
    noisy = with_noise(H, VIRTUAL_NOISE, np.random.default_rng(0))
    return Responses(VIRTUAL_LINES, noisy, SYNTHETIC)
