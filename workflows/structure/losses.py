"""Loss factors of materials and joints from the measured damping ratios of a scene's targets."""

from typing import Literal

import numpy as np
from pydantic import BaseModel

from beadwave.fem.updating.loss_factors import (
    ASSUMED_RATIO_DEVIATION,
    MIN_ENERGY_SHARE,
    PRIOR_DEVIATION,
    loss_factors,
)
from beadwave.workflows.report.number_format import supported
from beadwave.workflows.report.tables import aligned_text
from beadwave.workflows.scene import InvalidScene, LossFactorsTable, Scene
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.engine.progress import Progress
from beadwave.workflows.stages.structure.loss_factors import strain_of


class LossRow(BaseModel):
    """A part and its loss factor; where the modes do not show that it has any, a bound alone."""

    name: str  # "joints.bolts"
    value: float
    deviation: float
    at_most: float  # value and two deviations
    says: Literal["value", "upper bound", "nothing"]


class DampedMode(BaseModel):
    """A measured mode: its damping, that of the loss factors, and whose strain it is."""

    hz: float  # measured
    computed_hz: float
    zeta: float
    zeta_deviation: float
    fitted: float
    shares: dict[str, float]  # of its strain energy


class LossReport(BaseModel):
    """Loss factors that the damping of measured modes gives."""

    scene: str
    factors: list[LossRow]
    modes: dict[str, DampedMode]  # by their numbers
    scatter: float  # rms of (fitted - measured) over the deviations, by which bars are widened
    remarks: list[str]

    def text(self) -> str:
        """A table of parts, one of modes, then sentences."""
        rows = [
            (
                row.name, None if row.says == "nothing" else f"{row.value:.3g}",
                f"{row.deviation:.2g}", row.says if row.says != "upper bound"
                else f"at most {row.at_most:.2g}",
            )
            for row in self.factors
        ]  # fmt: skip
        lines = [aligned_text(("loss factor", "", "+-", "says"), rows), ""]
        parts = [row.name for row in self.factors]
        modes = [
            (
                n, f"{mode.computed_hz:.2f}", f"{100 * mode.zeta:.4g} %",
                f"{100 * mode.zeta_deviation:.2g} %", f"{100 * mode.fitted:.4g} %",
                *(f"{100 * mode.shares[part]:.3g} %" for part in parts),
            )
            for n, mode in self.modes.items()
        ]  # fmt: skip
        head = ("mode", "computed [Hz]", "damping", "+-", "fitted", *parts)
        return "\n".join([*lines, aligned_text(head, modes), "", *self.remarks])

    def __repr__(self) -> str:
        return self.text()


def losses(scene: Scene, progress: Progress) -> tuple[Scene, LossReport]:
    """The scene with the loss factors that its targets' damping ratios determine, and the report.

    The ratio of a mode is half the sum of loss factors by their shares of its strain energy
    (`fem.updating.loss_factors`). Raises InvalidScene without ratios, or where no part can be told
    from zero.
    """
    damped = {
        n: target
        for n, target in zip(scene.measured_numbers, scene.targets or (), strict=False)
        if target.zeta is not None
    }
    if not damped:
        raise InvalidScene(
            f"{scene.name}: no target has a damping ratio; `beadwave hammer FILE --out DIR` writes "
            "targets.toml with them, or add zeta = 0.004 to [[targets]]."
        )

    # shares (modes, parts) of the strain energy, and the row of the mode that each target is
    pipeline = pipeline_of(scene, progress)
    model, modes = pipeline("model"), pipeline("modes")
    strain = strain_of(scene, model, modes)
    places = scene.measured_numbers
    rows, used = [], []
    for n in damped:
        i = int(modes.index[places.index(n)])
        if i < 0:
            continue
        hz = modes.omega[i] / (2 * np.pi)
        rows.append(int(np.abs(strain.hz - hz).argmin()))
        used.append(n)
    if not used:
        raise InvalidScene(
            f"{scene.name}: no computed mode is like a target that has a damping ratio; "
            "`beadwave modes` shows which is which."
        )

    # measured ratios with their deviations, an assumed one where a test states none
    zeta = np.array([damped[n].zeta for n in used])
    assumed = [n for n in used if not damped[n].zeta_deviation]
    deviation = np.array(
        [
            damped[n].zeta_deviation or max(ASSUMED_RATIO_DEVIATION * damped[n].zeta, 1e-9)
            for n in used
        ]
    )

    # parts that no mode strains are left out
    shares = strain.shares[rows]
    strained = shares.max(axis=0) > MIN_ENERGY_SHARE
    parts = [name for name, has in zip(strain.parts, strained, strict=True) if has]
    shares = shares[:, strained]

    # a part whose factor cannot be told from zero has a bound, and none above the prior's
    fit = loss_factors(shares, zeta, deviation)
    at_most = fit.value + 2 * fit.deviation
    factors = []
    for j, name in enumerate(parts):
        says = "value" if fit.is_value[j] else "upper bound"
        if not fit.is_value[j] and at_most[j] > PRIOR_DEVIATION:
            says = "nothing"
        factors.append(
            LossRow(
                name=name, value=float(fit.value[j]), deviation=float(fit.deviation[j]),
                at_most=float(at_most[j]), says=says,
            )
        )  # fmt: skip
    unstrained = [name for name, has in zip(strain.parts, strained, strict=True) if not has]
    ratios = dict(zip(used, (fit.zeta / zeta).tolist(), strict=True))
    remarks = remarks_on_losses(factors, unstrained, assumed, ratios, fit.scatter)
    if not fit.is_value.any():
        raise InvalidScene(
            f"{scene.name}: the damping of mode {', '.join(map(str, used))} tells no loss factor "
            "from zero; add modes, or smaller zeta_deviation."
        )
    table: dict[str, dict[str, float]] = {"materials": {}, "joints": {}, "springs": {}}
    for row in factors:
        if row.says == "value":
            kind, _, part = row.name.partition(".")
            table[kind][part] = supported(row.value, row.deviation)
    report = LossReport(
        scene=scene.name,
        factors=factors,
        modes={
            str(n): DampedMode(
                hz=damped[n].hz, computed_hz=float(strain.hz[rows[i]]), zeta=float(zeta[i]),
                zeta_deviation=float(deviation[i]), fitted=float(fit.zeta[i]),
                shares=dict(zip(parts, shares[i].tolist(), strict=True)),
            )
            for i, n in enumerate(used)
        },
        scatter=float(fit.scatter),
        remarks=remarks,
    )  # fmt: skip
    return scene.but(damping=LossFactorsTable(kind="loss", **table)), report


def remarks_on_losses(
    factors: list[LossRow],
    unstrained: list[str],
    assumed: list[int],
    ratios: dict[int, float],
    scatter: float,
) -> list[str]:
    """Sentences on loss factors left open, on parts that no mode strains, on deviations that were
    assumed and on damping that the factors do not explain: its scatter about the fit in deviations,
    and `ratios`, fitted over measured damping ratio by mode."""
    remarks = []
    if open_ones := [row.name for row in factors if row.says == "nothing"]:
        remarks.append(f"{', '.join(open_ones)}: not determined by the damping of these modes.")
    if unstrained:
        remarks.append(f"{', '.join(unstrained)}: no mode of these strains it.")
    if assumed:
        remarks.append(
            f"mode {', '.join(map(str, assumed))} came without zeta_deviation: "
            f"{100 * ASSUMED_RATIO_DEVIATION:g} % of the ratio is assumed."
        )
    if scatter > 2:
        remarks.append(
            f"the ratios scatter about the fit by {scatter:.3g} deviations, by which the bars "
            "are widened: damping that is not of strain (friction, air, the suspension), or loss "
            "factors that depend on frequency."
        )
    if far := [n for n, x in ratios.items() if not 0.5 < x < 2.0]:
        remarks.append(
            f"mode {', '.join(map(str, far))}: the fitted ratio is off by more than a factor of "
            "two."
        )
    return remarks
