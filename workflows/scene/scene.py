"""A whole run: the tables of a scene together."""

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Self

from pydantic import Discriminator, Field, PrivateAttr, Tag, model_validator

from beadwave.workflows.scene.axes_of_test import AxesOfTest
from beadwave.workflows.scene.body_grid import BodyGrid
from beadwave.workflows.scene.named_materials import NUMBERS, named_material
from beadwave.workflows.scene.scene_table import SceneTable
from beadwave.workflows.scene.tables.bending import Beam, BendingPlateTable
from beadwave.workflows.scene.tables.bodies import (
    GROUND,
    BodyName,
    BodyTable,
    Bolts,
    MaterialName,
    MeasuredMode,
    Solid,
    StaticLoad,
    Strike,
    Tied,
    fitting,
)
from beadwave.workflows.scene.tables.chain import ChainTable, LeafSpringsTable, Preload, Striker
from beadwave.workflows.scene.tables.chains import ChainOnStructure
from beadwave.workflows.scene.tables.contact import ContactTable
from beadwave.workflows.scene.tables.crystal import CrystalTable
from beadwave.workflows.scene.tables.damping import Damping
from beadwave.workflows.scene.tables.friction import Arm, Friction
from beadwave.workflows.scene.tables.gravity import Gravity, Guides
from beadwave.workflows.scene.tables.joints import Joints
from beadwave.workflows.scene.tables.masses import MassTable
from beadwave.workflows.scene.tables.measured import MeasuredTable
from beadwave.workflows.scene.tables.mesh import Standing
from beadwave.workflows.scene.tables.reduction import Patch, Reduction
from beadwave.workflows.scene.tables.sensors import Output
from beadwave.workflows.scene.tables.shakers import Shaker
from beadwave.workflows.scene.tables.springs import SpringTable
from beadwave.workflows.scene.tables.time import Time
from beadwave.workflows.scene.tables.walls import RomWall, Wall

LONGEST_NAME = 50  # four bytes a letter and an ending fit in the 255 of a file's name
Several = Field(strict=False)
EitherJoints = Annotated[
    Annotated[Joints, Tag("table")] | Annotated[tuple[Bolts, ...], Several, Tag("list")],
    Discriminator(lambda value: "list" if isinstance(value, list | tuple) else "table"),
]


class Scene(SceneTable):
    """A whole run. [assembly], [mesh] and [joints] are written in two kinds, the thesis' rig or
    bodies. `toml` checks them accordingly and expands a rig into bodies (`rig.RigScene`): a scene
    that was read has bodies, [[joints]] and [strike] alone.

    `unusual` names the keys whose values are intended though they lie outside of their usual range.
    """

    strike_table: ClassVar[str] = "strike"  # that a user writes for the place that is struck

    # of the scene; by default that of its file
    name: Annotated[str, Field(pattern=r"^\w[\w.-]*$", max_length=LONGEST_NAME)]
    # keys whose values are intended, outside of their usual range
    unusual: Annotated[tuple[str, ...], Field(strict=False)] | None = None
    chain: ChainTable | None = None
    crystal: CrystalTable | None = None
    striker: Striker | None = None
    contact: ContactTable | None = None
    leaf_springs: LeafSpringsTable | None = None
    gravity: Gravity | None = None
    guides: Guides | None = None
    preload: Preload | None = None
    chains: Annotated[tuple[ChainOnStructure, ...], Field(strict=False, min_length=1)] | None = None
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
    masses: Annotated[tuple[MassTable, ...], Several] | None = None
    springs: Annotated[tuple[SpringTable, ...], Several] | None = None
    measured: Annotated[tuple[MeasuredTable, ...], Several] | None = None
    strike: Strike | None = None
    loads: Annotated[tuple[StaticLoad, ...], Several] | None = None
    targets: Annotated[tuple[MeasuredMode, ...], Several] | None = None
    test_axes: AxesOfTest | None = None
    table: Standing | None = None
    mesh: Any = None
    patch: Patch | None = None
    reduction: Reduction | None = None
    damping: Damping | None = None
    time: Time | None = None
    output: Output | None = None
    _sizes_of: "Scene | None" = PrivateAttr(default=None)

    @property
    def sizes_of(self) -> "Scene":
        """The scene whose mesh.error chooses the sizes of elements, itself but where a study chose
        them once for all scenes that it varies."""
        return self._sizes_of or self

    def with_sizes_of(self, scene: "Scene | None") -> Self:
        """This scene, with elements of the sizes that the mesh.error of another one chooses, None
        for its own; without mesh.error as it is."""
        if self.mesh is None or not self.mesh.error:
            return self
        origin = None if scene is None or scene.sizes_of == self else scene.sizes_of
        if origin is self._sizes_of:
            return self
        copy = self.model_copy()
        copy._sizes_of = origin
        return copy

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
            name: {key: getattr(material, key) for key in NUMBERS}
            for name in names
            if isinstance(name, str) and (material := named_material(name))
        }
        if not named or not isinstance(materials, dict | None):
            return tables
        return {**tables, "materials": named | (materials or {})}

    @property
    def n_contacts(self) -> int:
        """Contacts of the chain, the wall's included."""
        return self.chain.count - (self.wall is None)

    @property
    def of_each_chain(self) -> dict[str, "Scene"]:
        """A scene with each of [[chains]] alone, by its name: what the chain does not hold is this
        scene's own table."""
        return {row.name: self._of_chain(row) for row in self.chains or ()}

    def _of_chain(self, row: ChainOnStructure) -> "Scene":
        spheres = {key: getattr(row, key) for key in ChainTable.model_fields}
        striker = row.striker and Striker.model_construct(velocity=row.striker.velocity)
        return self.but(
            chains=None,
            chain=ChainTable.model_construct(**spheres),
            striker=None if row.initial_velocity else striker or self.striker,
            contact=row.contact or self.contact,
            leaf_springs=row.leaf_springs or self.leaf_springs,
            preload=row.preload or self.preload,
            friction=row.friction or self.friction,
            arm=row.arm or self.arm,
            output=self.output.but(spheres=row.output.spheres) if row.output else self.output,
            strike=Strike.model_construct(on=row.on, at=row.at, radius=row.patch_radius),
            wall=RomWall.model_construct(kind="rom"),
        )

    @property
    def written(self) -> "Scene":
        """The scene as a user writes it: of a rig its dimensions."""
        return self

    @property
    def bending(self) -> Beam | BendingPlateTable | None:
        """The table of the structure of bending theory, [beam] or [plate]."""
        return self.beam or self.plate

    @property
    def has_structure(self) -> bool:
        """True if there are finite elements to reduce."""
        return self.assembly is not None or self.bending is not None

    @property
    def own_mesh(self) -> str | None:
        """The file of the user's own mesh."""
        return None if self.assembly is None else self.assembly.mesh

    @property
    def bushings(self) -> dict[str, Bolts]:
        """The joints by name."""
        return {joint.name: joint for joint in self.joints or ()}

    @property
    def utilisations(self) -> dict[str, float]:
        """Preload over proof load of the bolts of each joint that has any."""
        return {n: joint.utilisation for n, joint in self.bushings.items() if joint.bolt}

    def with_joints(self, value: Mapping[str, float]) -> Self:
        """A copy with these stiffnesses and dashpots, "NAME.kz", which are not checked."""
        joints = self.bushings
        for name, x in value.items():
            joint, _, key = name.rpartition(".")
            joints[joint] = joints[joint].but(**{key: x})
        return self.but(joints=tuple(joints.values()) or None)

    def with_materials(self, value: Mapping[str, Mapping[str, float]]) -> Self:
        """A copy with these numbers of materials, which are not checked."""
        changed = {name: self.materials[name].but(**numbers) for name, numbers in value.items()}
        return self.but(materials={**(self.materials or {}), **changed} or None)

    def remeasured(self, value: Mapping[int, Mapping[str, Any]]) -> Self:
        """A copy with these keys of measured modes, by their numbers; a standard deviation does not
        go with another frequency."""
        numbered = zip(self.measured_numbers, self.targets or (), strict=True)
        return self.but(targets=tuple(mode.remeasured(**value.get(n, {})) for n, mode in numbered))

    def stiffness(self, spring: str) -> float:
        """Stiffness [N/m] or [N m/rad] of a spring "joint.direction"."""
        joint, _, direction = spring.rpartition(".")
        return getattr(self.bushings[joint], direction)

    @property
    def measured_hz(self) -> tuple[float, ...]:
        """Frequencies of the measured modes of the assembly."""
        return tuple(target.hz for target in self.targets or ())

    @property
    def measured_numbers(self) -> tuple[int, ...]:
        """Number of each measured mode in tables and keys: that of the computed mode where all are
        known by it, else their places in the list, from 1."""
        numbers = tuple(target.number for target in self.targets or ())
        return tuple(range(1, len(numbers) + 1)) if None in numbers else numbers

    @property
    def measured_modes(self) -> dict[int, float]:
        """Frequencies of the measured modes by their numbers."""
        return dict(zip(self.measured_numbers, self.measured_hz, strict=True))

    @property
    def floats(self) -> bool:
        """True if nothing joins the structure to the ground, springs and measured parts
        included."""
        if self.bending is not None:
            return self.bending.floats
        if self.assembly is None:
            return False
        hangs = any(spring.to == GROUND for spring in self.springs or ())
        return self.unsupported and not hangs and not self.measured

    @property
    def unsupported(self) -> bool:
        """True if no face of the assembly is held and no joint holds it to the ground: on springs
        it may be free in some directions."""
        on_ground = any(GROUND in joint.partners for joint in self.joints or ())
        return not self.assembly.held and not on_ground

    @property
    def has_dashpots(self) -> bool:
        """True if dashpots couple the modes of the assembly: in joints, parallel to springs, or as
        the damping of measured parts."""
        of_joints = any(table.dashpots for table in self.bushings.values())
        of_springs = any(any(spring.dashpots.values()) for spring in self.springs or ())
        return of_joints or of_springs or bool(self.measured)

    @property
    def struck_body(self) -> str:
        """The body that the chain leans on."""
        if self.bending is not None:
            return "plate" if self.beam is None else "beam"
        return self.strike.body

    @property
    def struck_material(self) -> Any:
        """The material of the struck body."""
        if self.bending is not None:
            return self.bending
        return self.made_of(self.struck_body)

    def made_of(self, body: str) -> Any:
        """The material of a body: the assembly's where its own table names none."""
        return self.materials[self.material_name(body)]

    @property
    def grids(self) -> Mapping[str, BodyGrid]:
        """Grids of hexahedra that are prescribed, by body: those of a rig alone."""
        return {}

    def seed_of(self, body: str) -> float | None:
        """Element size of a body of the scene [m]; None where no table gives it."""
        return next((table.seed for table in fitting(body, self.bodies or {}) if table.seed), None)

    def material_name(self, body: str) -> str | None:
        """The name of a body's material; None where no table gives it."""
        names = (table.material for table in fitting(body, self.bodies or {}))
        return next((name for name in names if name), self.assembly.material)
