"""The health of a reduced model, of an assembly or from a file, as the summary tells it."""

import numpy as np

import rom
from workflows.report.summary import ModeFound, ReductionHealth
from workflows.scene import Scene
from workflows.stages.pipeline import Pipeline
from workflows.thesis import HAMMER_TEST

LISTED = 4  # fixed-interface frequencies


def reduction_health(reduced: rom.ReducedModel, found: rom.Health | None = None) -> ReductionHealth:
    """The health of a reduced model as the summary tells it, measured unless it is known."""
    found, mass = found or rom.health(reduced), reduced.mass
    return ReductionHealth(
        kind=reduced.kind,
        coordinates=len(reduced.w),
        static_compliance_m_per_N=found.static_compliance,
        half_space_compliance_m_per_N=reduced.contact.half_space or 0.0,
        effective_mass_captured=mass.captured,
        mass_kg=mass.mass,
        centre_m=mass.centre or (),
        grounding=mass.grounding,
        fixed_interface_hz=found.fixed_interface_hz[:LISTED],
        asymmetry=found.asymmetry,
        lowest_mass=found.lowest_mass,
        lowest_stiffness=found.lowest_stiffness,
        rigid_modes=found.n_rigid,
        moved_by_the_contact=found.participation,
        receptance_error=reduced.error,
        receptance_loss_factor=None if reduced.error is None else rom.LOSS,
        findings=found.findings,
    )


def modes_found(pipeline: Pipeline) -> tuple[ModeFound, ...]:
    """The computed modes that are written, with the targets among them."""
    scene, modes = pipeline.scene, pipeline("modes")
    struck = not scene.is_general or scene.strike is not None
    at_contact = pipeline("participation") if struck else [None] * len(modes.omega)
    mac = pipeline("mac") if len(modes.index) and pipeline.kept("mac") else None
    found = []
    for number, target in zip(modes.field.number, modes.field.target, strict=True):
        j = number - 1
        mode = ModeFound(
            number=number,
            frequency_hz=modes.omega[j] / (2 * np.pi),
            participation=at_contact[j],
            effective_mass=tuple(modes.effective_mass[j]),
        )
        paired = _paired(scene, target, modes.score, None if mac is None else mac[j])
        found.append(mode.model_copy(update=paired))
    return tuple(found)


def _paired(scene: Scene, target: int, score, mac) -> dict:
    """What is known of a mode that is a target, counted from 1; nothing of one that is none."""
    if not target:
        return {}
    known = mac is not None and np.isfinite(mac[target - 1])
    return {
        "target": int(target),
        "target_hz": scene.measured_hz[target - 1],
        "shape": shape_names(scene)[target - 1],
        "score": float(score[target - 1]),
        "mac": float(mac[target - 1]) if known else None,
    }


def shape_names(scene: Scene) -> tuple[str | None, ...]:
    """What the targets look like, in words where there are any."""
    if not scene.is_general:
        return tuple(HAMMER_TEST["shape"])
    return tuple(
        f"{t.body}: {t.motion}" if getattr(t, "motion", None) else None for t in scene.targets or ()
    )
