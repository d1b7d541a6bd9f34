"""The scene's [assembly]: every dimension of `geometry.Assembly`, the material, the ties."""

from dataclasses import fields
from typing import Annotated, Literal

from pydantic import Field, create_model

from geometry import Assembly
from workflows.scene.bodies import Compressible, Modulus
from workflows.scene.quantities import of
from workflows.scene.scene_table import Density, SceneTable
from workflows.scene.units import LENGTH

BODIES = ("block", "sheets", "sheets_support", "support", "plate")
Names = Annotated[tuple[Literal[BODIES], ...], Field(strict=False)]  # type: ignore[valid-type]
# largest usual ratio of a dimension to the rig's, either way; a mistaken unit makes it 1000
USUAL = 100.0


class Steel(SceneTable):
    """The material of a body, where it differs from the assembly's."""

    young: Modulus | None = None  # [Pa]
    poisson: Compressible | None = None
    density: Density | None = None  # [kg/m^3]


class _Constraint(SceneTable):
    young: Modulus = 210e9  # [Pa]
    poisson: Compressible = 0.3
    density: Density = 7850.0  # [kg/m^3]
    block: Steel | None = None
    sheets: Steel | None = None
    sheets_support: Steel | None = None
    support: Steel | None = None
    plate: Steel | None = None
    constraint: Literal["full-tie", "screw-tie", "wires"] = "full-tie"
    fixing: Literal["flat", "corners", "bolted"] = "flat"

    def made_of(self, part: str) -> Steel:
        """The material of a part: the assembly's where its own table has no value."""
        steel = getattr(self, part) or Steel()
        return Steel(
            young=steel.young or self.young,
            poisson=self.poisson if steel.poisson is None else steel.poisson,
            density=steel.density or self.density,
        )


def _dimension(field):
    """Type and default of a dimension of the rig [m], usual within USUAL of the thesis' one."""
    if field.name == "parts":
        return (Names, field.default)
    is_list = isinstance(field.default, tuple)
    size = max(map(abs, field.default)) if is_list else field.default
    number = of(float, LENGTH, size / USUAL, size * USUAL)
    numbers = Annotated[tuple[number, ...], Field(strict=False)]
    return (numbers if is_list else number, field.default)


AssemblyTable = create_model(
    "AssemblyTable",
    __base__=_Constraint,
    __doc__="Dimensions in metres, defaults those of geometry.Assembly.",
    **{field.name: _dimension(field) for field in fields(Assembly)},
)


def assembly(table) -> Assembly:
    """The parts that the table describes; raises InvalidGeometry where they cannot be built."""
    return Assembly(**{field.name: getattr(table, field.name) for field in fields(Assembly)})
