"""[contact]: the law between neighbouring spheres, and between the last sphere and the wall."""

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from beadwave.workflows.scene.named_files import FileName
from beadwave.workflows.scene.scene_table import (
    NonNegative,
    Positive,
    SceneTable,
    YieldPressure,
    one_or_each,
    si_of,
)
from beadwave.workflows.scene.units import (
    DASHPOT,
    SLOWNESS,
)

PowerStiffness = Annotated[float, Field(gt=0, le=1e30, allow_inf_nan=False)]
# as `dem.kernels.laws.ELASTIC_LAWS` has them: scenes are read without numba, and a test compares
EXPONENTS = (1.0, 4.0)
Exponent = Annotated[float, Field(ge=EXPONENTS[0], le=EXPONENTS[1])]
KEYS = {
    "thornton": {"yield_pressure": "in Pa"},
    "power": {"stiffness": "in N/m^exponent", "exponent": "from {:g} to {:g}".format(*EXPONENTS)},
    "table": {"file": "of overlaps and forces"},
}  # that a law needs, and that laws without it do not have
CIRCULAR = ("hertz", "thornton")  # laws of circular contacts, the others state their own force


class ContactTable(SceneTable):
    """The law between neighbours, and at the wall.

    "thornton" is Hertz' law until the pressure in a contact's middle reaches `yield_pressure`,
    about 1.6 times the softer material's yield stress, which then stays; craters remain. "power"
    is F = stiffness overlap^exponent, "table" the force that the rows of a CSV file have: overlap
    [m], force [N], from 0, 0 on.
    """

    # force over overlap
    law: Literal["hertz", "thornton", "power", "table"] = "hertz"
    stiffness: one_or_each(PowerStiffness) | None = None  # k of law = "power", [N/m^exponent]
    # of the overlap, law = "power"; one per contact
    exponent: one_or_each(Exponent) | None = Field(None, examples=[2.0])
    file: FileName | None = None  # CSV of overlap [m] and force [N], law = "table"
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
    def _keys_of_its_law(self) -> "ContactTable":
        """The parameters of its law, and none of another one."""
        needed = KEYS.get(self.law, {})
        for law, keys in KEYS.items():
            for key, unit in keys.items():
                is_given = getattr(self, key) is not None
                if law == self.law and not is_given:
                    raise ValueError(f'law = "{law}" needs {key} {unit}: add it')
                if key not in needed and is_given:
                    raise ValueError(f'{key} belongs to law = "{law}": drop it or take that law')
        return self

    @property
    def shaped(self) -> bool:
        """True if the contacts have another force than Hertz'."""
        return self.law not in CIRCULAR
