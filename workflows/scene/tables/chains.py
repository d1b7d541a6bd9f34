"""[[chains]]: several chains that lean on one structure, each at a place of its own.

What a row does not hold is the scene's own table: [striker], [contact], [leaf_springs], [preload],
[friction], [arm], [output].
"""

from typing import Annotated

from pydantic import Field

from beadwave.workflows.scene.quantities import of
from beadwave.workflows.scene.scene_table import (
    Count,
    NonNegative,
    PatchRadius,
    Positive,
    SceneTable,
)
from beadwave.workflows.scene.tables.bodies import PlaceOnFace
from beadwave.workflows.scene.tables.chain import ChainTable, LeafSpringsTable, Preload
from beadwave.workflows.scene.tables.contact import ContactTable
from beadwave.workflows.scene.tables.friction import Arm, Friction
from beadwave.workflows.scene.tables.shakers import Face
from beadwave.workflows.scene.units import TIME, VELOCITY


class ChainStriker(SceneTable):
    """The first sphere of a chain: it arrives at the second one at a `time` with a `velocity`."""

    velocity: of(Positive, VELOCITY, 0, 100)  # [m/s] towards the structure
    # [s] from the start of the run, at which it arrives at the second sphere
    time: of(NonNegative, TIME, 0, 1) = 0.0


class ChainOutput(SceneTable):
    """At which spheres of a chain its waves are observed, in place of [output]."""

    # numbers of the chain's spheres whose waves are reported
    spheres: Annotated[tuple[Count, ...], Field(strict=False)] = ()


class ChainOnStructure(ChainTable):
    """One of several chains on a structure: its spheres, and the face that it leans on."""

    name: Annotated[str, Field(pattern=r"^\w[\w-]*$", max_length=50)]  # in results and in --set
    on: Face  # the face, "body:+x"; or "body@x,y,z"
    # [m] from the middle of a plane face along its two global axes, or [x, y, z]
    at: PlaceOnFace = (0.0, 0.0)
    patch_radius: PatchRadius = 2e-3  # [m] of the loaded patch
    striker: ChainStriker | None = None  # in place of [striker]
    contact: ContactTable | None = None  # in place of [contact]
    leaf_springs: LeafSpringsTable | None = None  # in place of [leaf_springs]
    preload: Preload | None = None  # in place of [preload]
    friction: Friction | None = None  # in place of [friction]
    arm: Arm | None = None  # in place of [arm]
    output: ChainOutput | None = None  # in place of output.spheres
