"""[contact]: the law between neighbouring spheres, and between the last sphere and the wall."""

from typing import Any, Literal

from pydantic import model_validator

from workflows.scene.scene_table import (
    NonNegative,
    Positive,
    SceneTable,
    YieldPressure,
    one_or_each,
    si_of,
)
from workflows.scene.units import (
    DASHPOT,
    SLOWNESS,
)


class ContactTable(SceneTable):
    """The law between neighbours, and at the wall.

    "thornton" is Hertz' law until the pressure in a contact's middle reaches `yield_pressure`,
    about 1.6 times the softer material's yield stress, which then stays; craters remain.
    """

    law: Literal["hertz", "thornton"] = "hertz"  # force over overlap
    yield_pressure: one_or_each(YieldPressure) | None = None  # [Pa] one per contact, as those below
    # damping of the contacts
    dissipation: Literal["none", "linear", "linear-clipped", "hunt-crossley"] = "hunt-crossley"
    # of the damping, [s/m] of hunt-crossley; one per contact
    coefficient: one_or_each(NonNegative) = 0.0
    stiffness_factor: one_or_each(Positive) = 1.0  # one per contact, the last at the wall

    @model_validator(mode="before")
    @classmethod
    def _coefficient(cls, table: Any) -> Any:
        """Its unit is that of the dissipation: s/m of Hunt and Crossley's, N s/m of a dashpot."""
        if not isinstance(table, dict) or "coefficient" not in table:
            return table
        kind = DASHPOT if str(table.get("dissipation")).startswith("linear") else SLOWNESS
        value = table["coefficient"]
        if isinstance(value, list):
            return {**table, "coefficient": [si_of("coefficient", x, kind) for x in value]}
        return {**table, "coefficient": si_of("coefficient", value, kind)}

    @model_validator(mode="after")
    def _yields_or_not(self) -> "ContactTable":
        if self.law == "thornton" and self.yield_pressure is None:
            raise ValueError('law = "thornton" needs yield_pressure in Pa: add it')
        if self.law == "hertz" and self.yield_pressure is not None:
            raise ValueError('yield_pressure belongs to law = "thornton": drop it or take that law')
        return self
