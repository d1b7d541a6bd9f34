"""Checks of a reduced model and the list of modes, as the summary has them."""

import numpy as np

import rom
from workflows.report.summary import ModeFound, ReductionHealth
from workflows.scene import Scene
from workflows.stages.pipeline import Pipeline
from workflows.thesis import HAMMER_TEST


def reduction_health(
    reduced: rom.ReducedModel, health: rom.Health | None = None
) -> ReductionHealth:
    """Checks of a reduced model for the summary; computed here unless `health` is given."""
    health, mass = health or rom.health(reduced), reduced.mass
    return ReductionHealth(
        kind=reduced.kind,
        coordinates=len(reduced.w),
        static_compliance_m_per_N=health.static_compliance,
        half_space_compliance_m_per_N=reduced.contact.half_space or 0.0,
        effective_mass_captured=mass.captured,
        mass_kg=mass.mass,
        centre_m=mass.centre or (),
        grounding=mass.grounding,
        fixed_interface_hz=health.fixed_interface_hz[:4],  # the lowest
        asymmetry=health.asymmetry,
        lowest_mass=health.lowest_mass,
        lowest_stiffness=health.lowest_stiffness,
        rigid_modes=health.n_rigid,
        moved_by_the_contact=health.participation,
        receptance_error=reduced.error,
        receptance_loss_factor=None if reduced.error is None else rom.LOSS,
        findings=health.findings,
    )


def modes_found(pipeline: Pipeline) -> tuple[ModeFound, ...]:
    """The computed modes that the summary lists, with number, frequency, MAC and score of the
    target that each one is paired with, if any."""
    scene, modes = pipeline.scene, pipeline("modes")
    struck = not scene.is_general or scene.strike is not None
    at_contact = pipeline("participation") if struck else [None] * len(modes.omega)
    mac = pipeline("mac") if len(modes.index) and pipeline.kept("mac") else None
    listed = []
    for number, target in zip(modes.field.number, modes.field.target, strict=True):
        j = number - 1
        mode = ModeFound(
            number=number,
            frequency_hz=modes.omega[j] / (2 * np.pi),
            participation=at_contact[j],
            effective_mass=tuple(modes.effective_mass[j]),
        )
        if target:
            # targets count from 1; one whose shape stiff joints suppress has no MAC
            i = target - 1
            mode = mode.model_copy(
                update={
                    "target": int(target),
                    "target_hz": scene.measured_hz[i],
                    "shape": shape_names(scene)[i],
                    "score": float(modes.score[i]),
                    "mac": None if mac is None or not np.isfinite(mac[j, i]) else float(mac[j, i]),
                }
            )
        listed.append(mode)
    return tuple(listed)


def shape_names(scene: Scene) -> tuple[str | None, ...]:
    """Descriptions of the targets' shapes; None for a target by number or by measured shape."""
    if not scene.is_general:
        return tuple(HAMMER_TEST["shape"])
    return tuple(
        f"{t.body}: {t.motion}" if getattr(t, "motion", None) else None for t in scene.targets or ()
    )
