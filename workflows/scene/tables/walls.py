"""[wall]: one table for each kind of wall.

What the march makes of them is in `workflows.stages.chain.walls`.
"""

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, model_validator

from beadwave.workflows.scene.named_files import FileName
from beadwave.workflows.scene.named_materials import of_named_material, with_numbers
from beadwave.workflows.scene.quantities import of
from beadwave.workflows.scene.scene_table import (
    Count,
    Density,
    Frequency,
    Limit,
    NonNegative,
    Number,
    Poisson,
    Positive,
    Ratio,
    SceneTable,
    YieldStress,
    Young,
)
from beadwave.workflows.scene.units import (
    COMPLIANCE,
    DASHPOT,
    LENGTH,
    MASS,
)


class RigidWall(SceneTable):
    """A wall that does not move and is not indented."""

    kind: Literal["rigid"]


class HalfSpaceWall(SceneTable):
    """A wall that is indented as a half-space of its material and does not move otherwise."""

    kind: Literal["half-space"]
    material: str | None = None  # a named material, in place of its numbers
    young: Young = 210e9  # [Pa] Young's modulus
    poisson: Poisson = 0.3  # Poisson's ratio
    yield_stress: YieldStress | None = None  # [Pa] beyond which a run warns

    _of_named_material = of_named_material("young", "poisson", "yield_stress")


class OneDofWall(SceneTable):
    """A mass on a spring and a dashpot; young and poisson are those of the surface struck."""

    kind: Literal["1dof"]
    frequency: Frequency  # [Hz] natural frequency
    mass: of(Positive, MASS, 1e-6, 1e5)  # [kg] of the mass on its spring
    damping_ratio: Ratio = 0.0  # damping over the critical one
    material: str | None = None  # a named material, in place of its numbers
    young: Young = 210e9  # [Pa] Young's modulus
    poisson: Poisson = 0.3  # Poisson's ratio
    yield_stress: YieldStress | None = None  # [Pa] beyond which a run warns

    _of_named_material = of_named_material("young", "poisson", "yield_stress")


class DashpotWall(SceneTable):
    """A wall whose velocity is the force over `coefficient`, as an infinite thin plate (Zener).

    Of a plate, `plate_thickness` h makes the coefficient 8 sqrt(D density h), with the bending
    stiffness D = young h^3 / 12 (1 - poisson^2).
    """

    kind: Literal["dashpot"]
    coefficient: of(Positive, DASHPOT) | None = None  # [N s/m] force over velocity
    # [m] of an infinite plate, in place of the coefficient
    plate_thickness: of(Positive, LENGTH, 1e-6, 0.5) | None = None
    density: Density | None = None  # [kg/m^3] of the plate
    young: Young = 210e9  # [Pa] Young's modulus
    poisson: Poisson = 0.3  # Poisson's ratio
    material: str | None = None  # a named material, in place of the numbers of the plate
    yield_stress: YieldStress | None = None  # [Pa] beyond which a run warns

    @model_validator(mode="before")
    @classmethod
    def _one_measure(cls, table: Any) -> Any:
        """A plate's, with the density of steel unless it has its own, or a bare coefficient's."""
        if not isinstance(table, dict):
            return table
        bare = table.get("coefficient") is not None
        numbers = ("young", "poisson", "yield_stress", *(() if bare else ("density",)))
        table = with_numbers(table, numbers)
        plate, bare = (table.get(key) is not None for key in ("plate_thickness", "coefficient"))
        if plate and bare:
            raise ValueError("coefficient and plate_thickness exclude each other: keep one of them")
        if not plate and not bare:
            raise ValueError("needs coefficient in N s/m, or plate_thickness in m: add one of them")
        if bare and table.get("density") is not None:
            raise ValueError("density belongs to plate_thickness, not to coefficient: drop it")
        return {"density": 7850.0, **table} if plate else table


class RomWall(SceneTable):
    """A reduced model: of [assembly], or from a file.

    Modes above `cutoff` answer statically; without it, those above the highest mode that the
    reduction represents. `file` is .npz, .mat, .h5 or the .mtx of an Abaqus substructure. An .mtx
    does not say where the chain touches: `nodes` are the numbers of these nodes, `direction` (1, 2,
    3) is the chain's, and `weights` are those of the mean over them, equal without it. `half_space`
    is the part of the file's static compliance that Hertz' law holds already, for files that do not
    state it.
    """

    kind: Literal["rom"]
    file: FileName | None = None  # a reduced model: .npz, .mat, .h5, .mtx
    # numbers of the nodes of an .mtx that the chain touches
    nodes: Annotated[tuple[Count, ...], Field(strict=False, min_length=1)] | None = None
    direction: Annotated[int, Field(ge=1, le=3)] = 1  # of the chain in an .mtx: 1, 2, 3 are x, y, z
    # of the mean over the nodes of an .mtx; equal without them
    weights: Annotated[tuple[Number, ...], Field(strict=False, min_length=1)] | None = None
    # [m/N] compliance of the file that Hertz' law holds already
    half_space: of(NonNegative, COMPLIANCE, 1e-15, 1e-4) | None = None
    cutoff: Limit | None = None  # [Hz] modes above it answer statically
    young: Young | None = None  # [Pa] Young's modulus of the surface struck; of [assembly] its own
    poisson: Poisson | None = None  # Poisson's ratio
    # principal ones of the face struck [1/m], < 0 hollow; of [assembly] they are its own
    curvatures: Annotated[tuple[Number, Number], Field(strict=False)] | None = None


# responses by their unit: times i omega of a displacement, and the factor to SI
RESPONSE_UNITS = {
    "m/N": (0, 1.0),
    "mm/N": (0, 1e-3),
    "um/N": (0, 1e-6),
    "m/s/N": (1, 1.0),
    "mm/s/N": (1, 1e-3),
    "m/s^2/N": (2, 1.0),
    "g/N": (2, 9.80665),
}


class MeasuredWall(SceneTable):
    """A wall that is known by its measured response at the contact alone.

    `receptance` is a hammer test of this one point (.uff, .unv, .csv, .mat), fitted by oscillators
    that cannot create energy. Displacement over force is a receptance, velocity a mobility,
    acceleration an accelerance: `unit` says which. What Hertz' law holds of the response already is
    taken out: by `sensor_distance` the motion of a half-space's surface there, by `half_space` its
    compliance itself; without either the sensor is far from the hit or behind it. `young` and
    `poisson` are those of the surface struck.
    """

    kind: Literal["measured"]
    receptance: FileName  # a measured response: .uff, .unv, .csv, .mat
    # of the response; "g/N" is accelerance in multiples of 9.80665 m/s^2
    unit: Literal["m/N", "mm/N", "um/N", "m/s/N", "mm/s/N", "m/s^2/N", "g/N"]
    # number of the response in the file; without it that of a point hit itself
    response: Count | None = None
    sensor_distance: of(Positive, LENGTH, 1e-4, 1.0) | None = None  # [m] of the sensor from the hit
    # [m/N] compliance of the response that Hertz' law holds already
    half_space: of(NonNegative, COMPLIANCE, 1e-15, 1e-4) | None = None
    material: str | None = None  # a named material, in place of its numbers
    young: Young = 210e9  # [Pa] Young's modulus
    poisson: Poisson = 0.3  # Poisson's ratio
    yield_stress: YieldStress | None = None  # [Pa] beyond which a run warns

    @model_validator(mode="before")
    @classmethod
    def _of_named_material(cls, table: Any) -> Any:
        if isinstance(table, dict) and None not in (
            table.get("sensor_distance"),
            table.get("half_space"),
        ):
            raise ValueError("sensor_distance and half_space exclude each other: keep one of them")
        return with_numbers(table, ("young", "poisson", "yield_stress"))


Wall = Annotated[
    RigidWall | HalfSpaceWall | OneDofWall | DashpotWall | RomWall | MeasuredWall,
    Discriminator("kind"),
]


def gives_way(wall: Wall | None) -> bool:
    """True if a steady force moves the wall without end, as a dashpot lets it. Such a wall takes
    Hertz' contacts without damping of its own."""
    return isinstance(wall, DashpotWall)
