"""The scene's [assembly]: every dimension of `geometry.Assembly`, the material, the ties."""

from dataclasses import fields
from typing import Annotated, Literal

from pydantic import Field, create_model

from geometry import Assembly
from workflows.scene.bodies import Compressible, Modulus
from workflows.scene.quantities import of
from workflows.scene.tables import Density, Table
from workflows.scene.units import LENGTH

BODIES = ("block", "sheets", "sheets_support", "support", "plate")
Names = Annotated[tuple[Literal[BODIES], ...], Field(strict=False)]  # type: ignore[valid-type]
USUAL = 100.0  # times the dimension of the thesis' rig, or that part of it


class Steel(Table):
    """What a body is made of, where it differs from the assembly's material."""

    young: Modulus | None = None  # [Pa]
    poisson: Compressible | None = None
    density: Density | None = None  # [kg/m^3]


class _Constraint(Table):
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
        """What a part is made of: the assembly's material where its own table says nothing."""
        own = getattr(self, part) or Steel()
        return Steel(
            young=own.young or self.young,
            poisson=self.poisson if own.poisson is None else own.poisson,
            density=own.density or self.density,
        )


def _dimension(field):
    if field.name == "parts":
        return (Names, field.default)
    several = isinstance(field.default, tuple)
    size = max(map(abs, field.default)) if several else field.default
    number = of(float, LENGTH, size / USUAL, size * USUAL)
    each = Annotated[tuple[number, ...], Field(strict=False)]
    return (each if several else number, field.default)


AssemblyTable = create_model(
    "AssemblyTable",
    __base__=_Constraint,
    __doc__="Dimensions in metres, defaults those of geometry.Assembly.",
    **{field.name: _dimension(field) for field in fields(Assembly)},
)


def assembly(table) -> Assembly:
    """The parts that the table describes; raises InvalidGeometry where they cannot be built."""
    return Assembly(**{field.name: getattr(table, field.name) for field in fields(Assembly)})
