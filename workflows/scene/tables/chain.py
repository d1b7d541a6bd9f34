"""[chain], [striker], [leaf_springs] and [preload]: the spheres, what moves and what holds them.

[gravity] and [guides] are in `gravity`.
"""

from typing import Annotated, Any

from pydantic import Field, model_validator

from beadwave.workflows.scene.named_materials import of_named_material
from beadwave.workflows.scene.quantities import of
from beadwave.workflows.scene.scene_table import (
    Count,
    Density,
    NonNegative,
    Number,
    Poisson,
    Positive,
    Radius,
    SceneTable,
    Velocity,
    YieldStress,
    Young,
    one_or_each,
)
from beadwave.workflows.scene.units import (
    FORCE,
    LENGTH,
    MASS,
    STIFFNESS,
    VELOCITY,
)


class ChainTable(SceneTable):
    """Spheres in a row, the striker first: scalars, or one value per sphere.

    A key that ends in a type alone, as `radius`, has no default: the scene states it, or the
    `material` that it names.
    """

    count: Count  # number of spheres, the striker included
    radius: one_or_each(Radius)  # [m] radius of the spheres
    material: one_or_each(str) | None = None  # a named material, or one for each sphere
    density: one_or_each(Density)  # [kg/m^3] mass over volume
    young: one_or_each(Young)  # [Pa] Young's modulus
    poisson: one_or_each(Poisson)  # Poisson's ratio
    yield_stress: one_or_each(YieldStress) | None = None  # [Pa] beyond which a run warns
    # [m/s] of every sphere, in place of [striker]
    initial_velocity: Annotated[tuple[Velocity, ...], Field(strict=False)] | None = None

    _of_named_material = of_named_material()


class Striker(SceneTable):
    """The first sphere arrives with a `velocity`, or falls on the others from a height `drop` along
    the chain; they rest. A chain of one sphere under [friction] may have a velocity across it."""

    velocity: of(Positive, VELOCITY, 0, 100) | None = None  # [m/s] towards the wall
    # [m] height along the chain from which it falls, under [gravity]
    drop: of(Positive, LENGTH, 0, 2) | None = None
    # [m/s] along t1 and t2 of the wall, of a chain of one sphere under [friction]
    tangential_velocity: Annotated[tuple[Velocity, Velocity], Field(strict=False)] | None = None

    @model_validator(mode="before")
    @classmethod
    def _one_measure(cls, table: Any) -> Any:
        if isinstance(table, dict) and table.get("velocity") is table.get("drop") is None:
            raise ValueError("needs velocity in m/s, or drop in m under [gravity]: add one of them")
        return table


class LeafSpringsTable(SceneTable):
    """A spring from each sphere to the ground; `offset` moves its anchor towards the wall."""

    # [N/m] of the spring from each sphere to the ground
    stiffness: one_or_each(of(NonNegative, STIFFNESS)) = 0.0
    # [m] by which the anchor is moved towards the wall
    offset: one_or_each(of(Number, LENGTH, 0, 0.1)) = 0.0


class Preload(SceneTable):
    """A steady force on the last sphere, towards the wall, by an arm that moves with the sphere."""

    force: of(NonNegative, FORCE, 0, 1e6) = 0.0  # [N] on the last sphere, towards the wall
    mass: of(NonNegative, MASS, 0, 50) = 0.0  # [kg] of the arm
