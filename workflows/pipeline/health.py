"""The health of a reduced model, of an assembly or from a file, as the summary tells it."""

import rom
from workflows.results.summary import ReductionHealth

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
