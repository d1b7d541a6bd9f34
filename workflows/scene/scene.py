"""A whole run: the tables of a scene together."""

from typing import Annotated, Any

from pydantic import Discriminator, Field, Tag, model_validator

from workflows.scene.bending import Beam, BendingPlateTable
from workflows.scene.bodies import (
    GROUND,
    BodyName,
    BodyTable,
    Bolts,
    General,
    MaterialName,
    MeasuredMode,
    Solid,
    StaticLoad,
    Strike,
    Tied,
    fitting,
)
from workflows.scene.chain import ChainTable, LeafSpringsTable, Preload, Striker
from workflows.scene.contact import ContactTable
from workflows.scene.damping import Damping
from workflows.scene.friction import Arm, Friction
from workflows.scene.gravity import Gravity, Guides
from workflows.scene.joints import Joints, JointStiffnesses
from workflows.scene.mesh import Standing
from workflows.scene.named_materials import NAMED, NUMBERS
from workflows.scene.reduction import Patch, Reduction
from workflows.scene.scene_table import SceneTable
from workflows.scene.sensors import Output
from workflows.scene.shakers import Shaker
from workflows.scene.time import Time
from workflows.scene.walls import Wall
from workflows.thesis import HAMMER_TEST_HZ

LONGEST_NAME = 50  # four bytes a letter and an ending fit in the 255 of a file's name
Several = Field(strict=False)
EitherJoints = Annotated[
    Annotated[Joints, Tag("table")] | Annotated[tuple[Bolts, ...], Several, Tag("list")],
    Discriminator(lambda value: "list" if isinstance(value, list | tuple) else "table"),
]


class Scene(SceneTable):
    """A whole run. [assembly] and [mesh] are of two kinds, the thesis' rig or bodies, and checked
    accordingly in `toml`.

    `unusual` names the keys whose values are intended though they lie outside of their usual range.
    """

    # of the scene; by default that of its file
    name: Annotated[str, Field(pattern=r"^\w[\w.-]*$", max_length=LONGEST_NAME)]
    # keys whose values are intended, outside of their usual range
    unusual: Annotated[tuple[str, ...], Field(strict=False)] | None = None
    chain: ChainTable | None = None
    striker: Striker | None = None
    contact: ContactTable | None = None
    leaf_springs: LeafSpringsTable | None = None
    gravity: Gravity | None = None
    guides: Guides | None = None
    preload: Preload | None = None
    friction: Friction | None = None
    arm: Arm | None = None
    shakers: Annotated[tuple[Shaker, ...], Several] | None = None
    wall: Wall | None = None
    beam: Beam | None = None
    plate: BendingPlateTable | None = None
    assembly: Any = None
    materials: dict[MaterialName, Solid] | None = None
    bodies: dict[BodyName, BodyTable] | None = None
    ties: Annotated[tuple[Tied, ...], Several] | None = None
    joints: EitherJoints | None = None
    strike: Strike | None = None
    loads: Annotated[tuple[StaticLoad, ...], Several] | None = None
    targets: Annotated[tuple[MeasuredMode, ...], Several] | None = None
    table: Standing | None = None
    mesh: Any = None
    patch: Patch | None = None
    reduction: Reduction | None = None
    damping: Damping | None = None
    time: Time | None = None
    output: Output | None = None

    @model_validator(mode="before")
    @classmethod
    def _named_materials(cls, tables: Any) -> Any:
        """The tables with a [materials.NAME] for each name of `named_materials` that a body, or the
        assembly, is made of and that the scene does not describe itself."""
        if not isinstance(tables, dict):
            return tables
        bodies, materials = tables.get("bodies"), tables.get("materials")
        of_bodies = bodies.values() if isinstance(bodies, dict) else ()
        names = [
            table.get("material")
            for table in (tables.get("assembly"), *of_bodies)
            if isinstance(table, dict)
        ]
        named = {
            name: {key: getattr(NAMED[name], key) for key in NUMBERS}
            for name in names
            if isinstance(name, str) and name in NAMED
        }
        if not named or not isinstance(materials, dict | None):
            return tables
        return {**tables, "materials": named | (materials or {})}

    @property
    def n_contacts(self) -> int:
        """Contacts of the chain, the wall's included."""
        return self.chain.count - (self.wall is None)

    @property
    def is_general(self) -> bool:
        """Whether the assembly is made of bodies, not of the dimensions of the thesis' rig."""
        return isinstance(self.assembly, General)

    @property
    def bending(self) -> Beam | BendingPlateTable | None:
        """The table of the structure of bending theory, [beam] or [plate]."""
        return self.beam or self.plate

    @property
    def has_structure(self) -> bool:
        """Whether there are finite elements to reduce."""
        return self.assembly is not None or self.bending is not None

    @property
    def own_mesh(self) -> str | None:
        """The file of the user's own mesh."""
        if self.bending is not None:
            return None
        return self.assembly.mesh if self.is_general else self.mesh.file

    @property
    def springs(self) -> dict[str, JointStiffnesses]:
        """Stiffnesses and dashpots of the joints by name."""
        if isinstance(self.joints, Joints):
            return dict(self.joints)
        return {joint.name: joint for joint in self.joints or ()}

    def stiffness(self, spring: str) -> float:
        """Stiffness [N/m] or [N m/rad] of a spring "joint.direction"."""
        joint, _, direction = spring.rpartition(".")
        return getattr(self.springs[joint], direction)

    @property
    def measured_hz(self) -> tuple[float, ...]:
        """Frequencies of the measured modes of the assembly."""
        if self.bending is not None:
            return ()
        if self.is_general:
            return tuple(target.hz for target in self.targets or ())
        listed = {target.number: target.hz for target in self.targets or ()}
        return tuple(listed.get(i, hz) for i, hz in enumerate(HAMMER_TEST_HZ, start=1))

    @property
    def floats(self) -> bool:
        """Whether nothing joins the structure to the ground."""
        if self.bending is not None:
            return self.bending.floats
        if not self.is_general:
            return self.assembly is not None and tuple(self.assembly.parts) == ("block",)
        return not self.assembly.held and not any(GROUND in j.partners for j in self.joints or ())

    @property
    def struck_body(self) -> str:
        """The body that the chain leans on."""
        if self.bending is not None:
            return "plate" if self.beam is None else "beam"
        return self.strike.body if self.is_general else "block"

    @property
    def struck_material(self) -> Any:
        """The material of the struck body."""
        if self.bending is not None:
            return self.bending
        return self.made_of(self.struck_body)

    def made_of(self, body: str) -> Any:
        """The material of a body: the assembly's where its own table names none."""
        if not self.is_general:
            return self.assembly.made_of(body)
        return self.materials[self.material_name(body)]

    def seed_of(self, body: str) -> float | None:
        """Element size of a body of the scene [m]; None where no table gives it."""
        return next((table.seed for table in fitting(body, self.bodies or {}) if table.seed), None)

    def material_name(self, body: str) -> str | None:
        """The name of a body's material; None where no table gives it."""
        names = (table.material for table in fitting(body, self.bodies or {}))
        return next((name for name in names if name), self.assembly.material)
