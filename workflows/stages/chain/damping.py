"""The damping law of a scene's wall, from its [damping]."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from beadwave import coupling
from beadwave.workflows.scene import (
    Damping,
    InvalidScene,
    LossFactorsTable,
    ModalDampingTable,
    RayleighDampingTable,
)
from beadwave.workflows.thesis import HAMMER_TEST_HZ

if TYPE_CHECKING:
    from beadwave import rom


def damping(table: Damping, reduced: "rom.ReducedModel") -> coupling.Damping | None:
    """Damping law of a scene's table; ratios measured in the hammer test apply to the computed
    modes that are paired with it, else to those nearest to the thesis' frequencies. Loss factors
    have given the ratios of the assembly's modes in its reduction; higher ones take the last one's.
    Raises InvalidScene for a model that was reduced without them."""
    if isinstance(table, LossFactorsTable):
        if reduced.contact.strain is None:
            raise InvalidScene(
                'damping.kind = "loss" needs the bodies whose strain it shares out, which this '
                'reduced model does not have; take damping.kind = "modal".'
            )
        return law_of_loss(table, reduced.contact.strain)
    return damping_law(table, reduced.contact.modes_hz or HAMMER_TEST_HZ)


def law_of_loss(table: LossFactorsTable, strain: "rom.StrainShares") -> coupling.Damping:
    """Damping law of loss factors; raises InvalidScene for names that are not of the assembly."""
    from beadwave.fem.updating.loss_factors import (
        damping_ratios_of,  # a simple wall loads no elements
    )

    for name in table.factors:
        if name not in strain.parts:
            kind, _, part = name.partition(".")
            known = [one.partition(".")[2] for one in strain.parts if one.startswith(f"{kind}.")]
            raise InvalidScene(
                f"damping.{kind}.{part} is not of this assembly; it has "
                f"{', '.join(known) or 'none of these'}."
            )
    zeta = damping_ratios_of(strain.shares, [table.factors.get(one, 0.0) for one in strain.parts])
    return coupling.ModalDamping(zeta, strain.hz, "nearest")


def damping_law(table: Damping, hammer_modes_hz: Sequence[float]) -> coupling.Damping | None:
    """Damping law of a scene's table for hammer-test modes at these frequencies [Hz]; None for no
    damping."""
    match table:
        case RayleighDampingTable(frequency=(f1, f2), ratio=(zeta1, zeta2)):
            return coupling.rayleigh(f1, zeta1, f2, zeta2)
        case RayleighDampingTable(alpha=alpha, beta=beta):
            return coupling.RayleighDamping(alpha, beta)
        case ModalDampingTable(ratio=float(ratio)):
            return coupling.ModalDamping(ratio)
        case ModalDampingTable(ratio=ratio):
            return coupling.ModalDamping(ratio, hammer_modes_hz, "nearest")
    return None
