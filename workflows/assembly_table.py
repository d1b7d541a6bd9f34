"""The scene's [assembly]: every dimension of `geometry.Assembly`, the material, the ties."""

from dataclasses import fields
from typing import Annotated, Literal

from pydantic import Field, create_model

from geometry import Assembly
from workflows.scene import Positive, Table

BODIES = ("block", "sheets", "sheets_support", "support", "plate")
Numbers = Annotated[tuple[float, ...], Field(strict=False)]
Names = Annotated[tuple[Literal[BODIES], ...], Field(strict=False)]  # type: ignore[valid-type]


Modulus = Annotated[Positive, Field(ge=1e6)]  # rubber; modes of softer bodies are countless
Compressible = Annotated[float, Field(gt=-1, lt=0.5)]  # an incompressible solid locks


class Steel(Table):
    """What a body is made of, where it differs from the assembly's material."""

    young: Modulus | None = None  # [Pa]
    poisson: Compressible | None = None
    density: Positive | None = None  # [kg/m^3]


class _Constraint(Table):
    young: Modulus = 210e9  # [Pa]
    poisson: Compressible = 0.3
    density: Positive = 7850.0  # [kg/m^3]
    block: Steel | None = None
    sheets: Steel | None = None
    sheets_support: Steel | None = None
    support: Steel | None = None
    plate: Steel | None = None
    constraint: Literal["full-tie", "screw-tie", "wires"] = "full-tie"
    fixing: Literal["flat", "corners", "bolted"] = "flat"


def _dimension(field):
    if field.name == "parts":
        return (Names, field.default)
    return (Numbers if isinstance(field.default, tuple) else float, field.default)


AssemblyTable = create_model(
    "AssemblyTable",
    __base__=_Constraint,
    __doc__="Dimensions in metres, defaults those of geometry.Assembly.",
    **{field.name: _dimension(field) for field in fields(Assembly)},
)


def assembly(table) -> Assembly:
    """The parts that the table describes; raises InvalidGeometry where they cannot be built."""
    return Assembly(**{field.name: getattr(table, field.name) for field in fields(Assembly)})
