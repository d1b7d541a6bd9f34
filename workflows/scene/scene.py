"""A whole run: the tables of a scene together."""

from typing import Annotated, Any

from pydantic import Discriminator, Field, Tag

from workflows.scene.bending import Beam, Plate
from workflows.scene.bodies import (
    GROUND,
    Body,
    BodyName,
    Bolts,
    General,
    MaterialName,
    Solid,
    StaticLoad,
    Strike,
    Target,
    Tied,
    fitting,
)
from workflows.scene.gravity import Gravity, Guides, Striker
from workflows.scene.sensors import Output
from workflows.scene.tables import (
    Chain,
    Contact,
    Damping,
    Joints,
    JointStiffnesses,
    LeafSprings,
    Patch,
    Preload,
    Reduction,
    Standing,
    Table,
    Time,
    Wall,
)
from workflows.thesis import HAMMER_TEST_HZ

LONGEST_NAME = 50  # four bytes a letter and an ending fit in the 255 of a file's name
Several = Field(strict=False)
EitherJoints = Annotated[
    Annotated[Joints, Tag("table")] | Annotated[tuple[Bolts, ...], Several, Tag("list")],
    Discriminator(lambda value: "list" if isinstance(value, list | tuple) else "table"),
]


class Scene(Table):
    """A whole run; [assembly] and [mesh] are checked by what the assembly is, see `toml`.

    `unusual` names the keys whose values lie outside of their usual range and are meant.
    """

    name: Annotated[str, Field(pattern=r"^\w[\w.-]*$", max_length=LONGEST_NAME)]
    unusual: Annotated[tuple[str, ...], Field(strict=False)] | None = None
    chain: Chain | None = None
    striker: Striker | None = None
    contact: Contact | None = None
    leaf_springs: LeafSprings | None = None
    gravity: Gravity | None = None
    guides: Guides | None = None
    preload: Preload | None = None
    wall: Wall | None = None
    beam: Beam | None = None
    plate: Plate | None = None
    assembly: Any = None
    materials: dict[MaterialName, Solid] | None = None
    bodies: dict[BodyName, Body] | None = None
    ties: Annotated[tuple[Tied, ...], Several] | None = None
    joints: EitherJoints | None = None
    strike: Strike | None = None
    loads: Annotated[tuple[StaticLoad, ...], Several] | None = None
    targets: Annotated[tuple[Target, ...], Several] | None = None
    table: Standing | None = None
    mesh: Any = None
    patch: Patch | None = None
    reduction: Reduction | None = None
    damping: Damping | None = None
    time: Time | None = None
    output: Output | None = None

    @property
    def n_contacts(self) -> int:
        """Contacts of the chain, the wall's included."""
        return self.chain.count - (self.wall is None)

    @property
    def is_general(self) -> bool:
        """Whether the assembly is told by bodies, not by the dimensions of the thesis' rig."""
        return isinstance(self.assembly, General)

    @property
    def bending(self) -> Beam | Plate | None:
        """The structure of bending theory, told in one table."""
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
        """Of a spring, "joint.direction" [N/m] or [N m/rad]."""
        joint, _, direction = spring.rpartition(".")
        return getattr(self.springs[joint], direction)

    @property
    def measured_hz(self) -> tuple[float, ...]:
        """Frequencies of the measured modes of the assembly."""
        if self.bending is not None:
            return ()
        if self.is_general:
            return tuple(target.hz for target in self.targets or ())
        own = {target.number: target.hz for target in self.targets or ()}
        return tuple(own.get(i, hz) for i, hz in enumerate(HAMMER_TEST_HZ, start=1))

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
        """What it is made of."""
        if self.bending is not None:
            return self.bending
        return self.made_of(self.struck_body)

    def made_of(self, body: str) -> Any:
        """What a body is made of: the assembly's material where its own table says nothing."""
        if not self.is_general:
            return self.assembly.made_of(body)
        return self.materials[self.material_name(body)]

    def seed_of(self, body: str) -> float | None:
        """Element size of a body of the scene; None where nothing says it."""
        return next((table.seed for table in fitting(body, self.bodies or {}) if table.seed), None)

    def material_name(self, body: str) -> str | None:
        """The name of a body's material; None where nothing says it."""
        own = (table.material for table in fitting(body, self.bodies or {}))
        return next((name for name in own if name), self.assembly.material)
