"""The health of a reduced model, of an assembly or from a file, as the summary tells it."""

import rom
from workflows.reduced_wall import half_space
from workflows.summary import ReductionHealth

LISTED = 4  # fixed-interface frequencies


def reduction_health(reduced: rom.ReducedModel) -> ReductionHealth:
    """The health of a reduced model as the summary tells it."""
    found, notes = rom.health(reduced), reduced.provenance
    return ReductionHealth(
        kind=reduced.kind,
        coordinates=len(reduced.w),
        static_compliance_m_per_N=found.static_compliance,
        half_space_compliance_m_per_N=half_space(reduced),
        effective_mass_captured=_noted(notes, "effective_mass_captured"),
        mass_kg=_noted(notes, "mass_kg"),
        centre_m=tuple(float(x) for x in notes.get("centre_m", "").split()),
        grounding=_noted(notes, "grounding"),
        fixed_interface_hz=found.fixed_interface_hz[:LISTED],
        asymmetry=found.asymmetry,
        lowest_mass=found.lowest_mass,
        lowest_stiffness=found.lowest_stiffness,
        rigid_modes=found.n_rigid,
        moved_by_the_contact=found.participation,
        receptance_error=reduced.error,
        findings=found.findings,
    )


def _noted(notes: dict[str, str], name: str) -> float | None:
    return float(notes[name]) if name in notes else None
