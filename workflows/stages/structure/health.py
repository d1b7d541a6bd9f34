"""Checks of a reduced model, the list of modes and their errors, as the summary has them.

They are stages of their own since they are small against the modes and the model that they are made
from: a run whose results are kept loads neither of these.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from beadwave import rom
from beadwave.workflows.report.summary import (
    ModeFound,
    NumberError,
    ReductionHealth,
    StructureNumbers,
)
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages import warnings

if TYPE_CHECKING:  # the health of a wall from a file loads no finite elements
    from beadwave.fem.modes.assembly_modes import AssemblyModes
    from beadwave.workflows.stages.errors.mesh_error import MeshErrorEstimate


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


def structure_numbers(
    scene: Scene,
    modes: AssemblyModes,
    reduction: rom.ReducedModel,
    participation: NDArray[np.float64],
) -> StructureNumbers:
    """Numbers and warnings of an assembly. Of the computed modes those that the summary lists, with
    the score of the target that each one is paired with, if any, and their participation
    |w^T phi| (k,) [kg^-1/2] at the contact; their MAC comes later."""
    listed, names = [], scene.measured_numbers
    for number, target in zip(modes.field.number, modes.field.target, strict=True):
        j = number - 1
        mode = ModeFound(
            number=number,
            frequency_hz=modes.omega[j] / (2 * np.pi),
            participation=participation[j],
            effective_mass=tuple(modes.effective_mass[j]),
        )
        if target:
            i = target - 1  # targets count from 1
            mode = mode.model_copy(
                update={
                    "target": names[i],
                    "target_hz": scene.measured_hz[i],
                    "shape": shape_names(scene)[i],
                    "score": float(modes.score[i]),
                }
            )
        listed.append(mode)
    health = reduction_health(reduction)
    numbers = {
        "modes_hz": {str(names[int(i) - 1]): hz for i, hz in modes.paired_hz.items()},
        "modes": tuple(listed),
        "dofs": modes.n_dofs,
        "load_factor": modes.load_factor,
        "reduction": health,
    }
    said = list(warnings.of_structure(modes, health))
    if scene.measured:
        from beadwave.workflows.stages.structure.measured_parts import sentences

        said += sentences(scene)
    return StructureNumbers(numbers, tuple(said))


def structure_errors(
    scene: Scene,
    modes: AssemblyModes,
    missed: MeshErrorEstimate,
    structure: StructureNumbers,
    of_parts: NDArray[np.float64] | None = None,
) -> tuple[NumberError, ...]:
    """Errors of the mesh in the frequencies and in the static compliance, as far as they are known,
    and of the fits of measured parts in the frequencies, `of_parts` (k,)."""
    errors = []
    hz = modes.omega / (2 * np.pi)
    whys = missed.explained(scene, modes.omega)
    for i, relative in enumerate(missed.of_frequencies(modes.omega)):
        if np.isfinite(relative):
            of_mesh = float(relative * hz[i])
            of_fit = None if of_parts is None else float(of_parts[i] * hz[i])
            errors.append(
                NumberError(
                    name=f"mode {i + 1}", value=hz[i], unit="Hz", why=whys[i], mesh=of_mesh,
                    receptance=of_fit, total=of_mesh + (of_fit or 0.0),
                )
            )  # fmt: skip
    if missed.of_compliance is not None:
        health = structure.numbers["reduction"]
        value = health.static_compliance_m_per_N - health.half_space_compliance_m_per_N
        errors.append(
            NumberError(
                name="static_compliance_m_per_N",
                value=value,
                unit="m/N",
                mesh=missed.of_compliance,
                total=missed.of_compliance,
                why=missed.at_contact(scene, missed.of_compliance / abs(value)) if value else "",
            )
        )
    return tuple(errors)


def shape_names(scene: Scene) -> tuple[str | None, ...]:
    """Descriptions of the targets' shapes; None for a target by number or by measured shape."""
    return tuple(
        target.title or (f"{target.body}: {target.motion}" if target.motion else None)
        for target in scene.targets or ()
    )
