"""The tables of a scene: one pydantic model each, every key with its type, unit and default.

An absent table is an absent part. To add a key, add a field to its table, here or in the file of
bodies, beams and plates, sensors, or gravity: `of(number, KIND, low, high)` reads a text with a
unit and gives the usual range, a default makes the key optional. `--set`, units, sweeps and the
TOML of a scene follow from the field. Keys that replace each other stand in `toml.INSTEAD`, rules
between tables in `contradictions`. Nothing here loads a solver.
"""

from collections.abc import Iterable
from difflib import get_close_matches
from math import isfinite
from typing import Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    model_validator,
)

from workflows.scene.quantities import of
from workflows.scene.units import (
    COMPLIANCE,
    DASHPOT,
    DENSITY,
    FORCE,
    FREQUENCY,
    LENGTH,
    MASS,
    PRESSURE,
    RATE,
    SLOWNESS,
    STIFFNESS,
    TIME,
    TURN_DASHPOT,
    TURN_STIFFNESS,
    VELOCITY,
    Kind,
    NoSuchQuantity,
    in_si,
)


class InvalidScene(ValueError):
    """One sentence: the key, the value found, the value allowed, what to do."""


def nearest(word: str, words: Iterable[str]) -> str:
    """A hint at the word of these that is most like this one, or at all of them."""
    names = list(words)
    close = get_close_matches(word, names, n=1, cutoff=0.6)
    return f"the nearest known is {close[0]!r}" if close else f"known are {', '.join(names)}"


class SceneTable(BaseModel):
    """A table that takes its own keys and nothing else."""

    model_config = ConfigDict(
        strict=True, frozen=True, extra="forbid", allow_inf_nan=False, validate_default=True
    )

    @model_validator(mode="before")
    @classmethod
    def _known_keys(cls, table: Any) -> Any:
        for key in table if isinstance(table, dict) else ():
            if key not in cls.model_fields:
                raise ValueError(f"unknown key {key!r}, {nearest(key, cls.model_fields)}")
        return table

    def but(self, **values: Any) -> Self:
        """The same with other values, unchecked; a dict changes keys of the present table."""
        update = {}
        for name, value in values.items():
            present = getattr(self, name)
            nested = isinstance(value, dict) and isinstance(present, SceneTable)
            update[name] = present.but(**value) if nested else value
        return self.model_copy(update=update)


def _exactly_one(table: Any, *keys: str, default: float) -> Any:
    """The table with the first key at its default where none is given; two are refused."""
    if not isinstance(table, dict):
        return table
    given = [key for key in keys if table.get(key) is not None]
    if len(given) > 1:
        raise ValueError(f"{' and '.join(given)} exclude each other: keep one of them")
    return table if given else {**table, keys[0]: default}


def text_or_table(value: Any) -> str:
    """Tag of a value that is a name, or a table that says more."""
    return "text" if isinstance(value, str) else "table"


def one_or_each(number) -> Any:
    """A number for all, or a list with one number for each."""
    numbers = Annotated[tuple[number, ...], Field(strict=False, min_length=1), Tag("list")]
    kind = Discriminator(lambda value: "list" if isinstance(value, list | tuple) else "number")
    return Annotated[Annotated[number, Tag("number")] | numbers, kind]


def _representable(value: float) -> float:
    """Products and powers of numbers of this size stay finite."""
    if value and isfinite(value) and not SMALLEST <= abs(value) <= LARGEST:
        raise ValueError(
            f"{value:g} must be 0 or between {SMALLEST:g} and {LARGEST:g} in size: change it"
        )
    return value


SMALLEST, LARGEST = 1e-18, 1e18  # of any number of a scene
Number = Annotated[float, AfterValidator(_representable)]
Positive = Annotated[Number, Field(gt=0)]
NonNegative = Annotated[Number, Field(ge=0)]
Ratio = Annotated[float, Field(ge=0, lt=1)]
Poisson = Annotated[float, Field(gt=-1, le=0.5)]
JointStiffness = Annotated[float, Field(ge=0, allow_inf_nan=True), AfterValidator(_representable)]
Count = Annotated[int, Field(ge=1, le=1_000_000)]
Length = of(Number, LENGTH)
Point = Annotated[tuple[Length, Length], Field(strict=False)]
Density = of(Positive, DENSITY, 20, 25e3)  # foam to osmium
Young = of(Positive, PRESSURE, 5e5, 2e12)  # soft rubber to diamond
Radius = of(Positive, LENGTH, 1e-6, 0.25)
YieldPressure = of(Positive, PRESSURE, 1e4, 1e11)
Velocity = of(Number, VELOCITY, 0, 100)
Frequency = of(Positive, FREQUENCY, 0.1, 1e7)
Limit = of(Positive, FREQUENCY)
Spring = of(JointStiffness, STIFFNESS)
TurnSpring = of(JointStiffness, TURN_STIFFNESS)
Dashpot = of(NonNegative, DASHPOT)
TurnDashpot = of(NonNegative, TURN_DASHPOT)
Seed = of(Positive, LENGTH, 1e-6, 0.25)


class ChainTable(SceneTable):
    """Spheres in a row, the striker first: scalars, or one value per sphere."""

    count: Count
    radius: one_or_each(Radius)  # [m]
    density: one_or_each(Density)  # [kg/m^3]
    young: one_or_each(Young)  # [Pa]
    poisson: one_or_each(Poisson)
    initial_velocity: Annotated[tuple[Velocity, ...], Field(strict=False)] | None = None  # [m/s]


def si_of(key: str, value: Any, kind: Kind) -> Any:
    """A number in SI of a text with a unit of the kind; raises ValueError with the key."""
    try:
        return in_si(value, kind) if isinstance(value, str) else value
    except NoSuchQuantity as error:
        raise ValueError(f"{key}: {error}") from None


class ContactTable(SceneTable):
    """The law between neighbours, and at the wall.

    "thornton" is Hertz' law until the pressure in a contact's middle reaches `yield_pressure`,
    about 1.6 times the softer material's yield stress, which then stays; craters remain.
    """

    law: Literal["hertz", "thornton"] = "hertz"
    yield_pressure: one_or_each(YieldPressure) | None = None  # [Pa] one per contact, as those below
    dissipation: Literal["none", "linear", "linear-clipped", "hunt-crossley"] = "hunt-crossley"
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
    def _yields_or_not(self) -> "ContactTable":
        if self.law == "thornton" and self.yield_pressure is None:
            raise ValueError('law = "thornton" needs yield_pressure in Pa: add it')
        if self.law == "hertz" and self.yield_pressure is not None:
            raise ValueError('yield_pressure belongs to law = "thornton": drop it or take that law')
        return self


class LeafSpringsTable(SceneTable):
    """A spring from each sphere to the ground; `offset` moves its anchor towards the wall."""

    stiffness: one_or_each(of(NonNegative, STIFFNESS)) = 0.0  # [N/m]
    offset: one_or_each(of(Number, LENGTH, 0, 0.1)) = 0.0  # [m]


class Preload(SceneTable):
    """A steady force on the last sphere, towards the wall, by an arm that moves with the sphere."""

    force: of(NonNegative, FORCE, 0, 1e6) = 0.0  # [N]
    mass: of(NonNegative, MASS, 0, 50) = 0.0  # [kg] of the arm


class RigidWall(SceneTable):
    """A wall that does not move and is not indented."""

    kind: Literal["rigid"]


class HalfSpaceWall(SceneTable):
    """A wall that is indented as a half-space of its material, and moves in no other way."""

    kind: Literal["half-space"]
    young: Young = 210e9  # [Pa]
    poisson: Poisson = 0.3


class OneDofWall(SceneTable):
    """A mass on a spring and a dashpot; young and poisson are those of the surface struck."""

    kind: Literal["1dof"]
    frequency: Frequency  # [Hz]
    mass: of(Positive, MASS, 1e-6, 1e5)  # [kg]
    damping_ratio: Ratio = 0.0
    young: Young = 210e9  # [Pa]
    poisson: Poisson = 0.3


class DashpotWall(SceneTable):
    """A wall whose velocity is the force over `coefficient`, as an infinite thin plate (Zener).

    Of a plate, `plate_thickness` h makes the coefficient 8 sqrt(D density h), with the bending
    stiffness D = young h^3 / 12 (1 - poisson^2).
    """

    kind: Literal["dashpot"]
    coefficient: of(Positive, DASHPOT) | None = None  # [N s/m]
    plate_thickness: of(Positive, LENGTH, 1e-6, 0.5) | None = None  # [m]
    density: Density | None = None  # [kg/m^3] of the plate
    young: Young = 210e9  # [Pa]
    poisson: Poisson = 0.3

    @model_validator(mode="before")
    @classmethod
    def _one_measure(cls, table: Any) -> Any:
        """A plate's, with the density of steel unless it has its own, or a bare coefficient's."""
        if not isinstance(table, dict):
            return table
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

    Modes above `cutoff` answer statically; without it, those that the reduction cannot trust.
    `prune` leaves out modes while the velocities stay within time.error; it costs three runs.
    `file` is .npz, .mat, .h5 or an Abaqus substructure's .mtx, which does not say where the chain
    touches: `nodes` does, by their numbers, with the `direction` of the chain (1, 2, 3) and
    `weights`, else equal ones. `half_space` is the part of the file's static compliance that the
    Hertz law holds already, where the file does not say.
    """

    kind: Literal["rom"]
    file: str | None = None
    nodes: Annotated[tuple[Count, ...], Field(strict=False, min_length=1)] | None = None
    direction: Annotated[int, Field(ge=1, le=3)] = 1
    weights: Annotated[tuple[Number, ...], Field(strict=False, min_length=1)] | None = None
    half_space: of(NonNegative, COMPLIANCE, 1e-15, 1e-4) | None = None  # [m/N]
    cutoff: Limit | None = None  # [Hz]
    prune: bool = False
    young: Young | None = None  # [Pa] of the surface struck; of [assembly] it is the block's own
    poisson: Poisson | None = None
    # principal ones of the face struck [1/m], < 0 hollow; of [assembly] they are its own
    curvatures: Annotated[tuple[Number, Number], Field(strict=False)] | None = None


Wall = Annotated[
    RigidWall | HalfSpaceWall | OneDofWall | DashpotWall | RomWall, Discriminator("kind")
]


class JointStiffnesses(SceneTable):
    """Along x, y, z [N/m] and about them [N m/rad]; inf is a rigid direction.

    cx to crz are dashpots beside the springs [N s/m], [N m s/rad]; a rigid direction takes none.
    """

    kx: Spring = float("inf")
    ky: Spring = float("inf")
    kz: Spring = float("inf")
    krx: TurnSpring = float("inf")
    kry: TurnSpring = float("inf")
    krz: TurnSpring = float("inf")
    cx: Dashpot = 0.0
    cy: Dashpot = 0.0
    cz: Dashpot = 0.0
    crx: TurnDashpot = 0.0
    cry: TurnDashpot = 0.0
    crz: TurnDashpot = 0.0

    @property
    def dashpots(self) -> dict[str, float]:
        """Coefficients that are not zero, by the spring beside them."""
        axes = ("x", "y", "z", "rx", "ry", "rz")
        coefficients = {f"k{axis}": getattr(self, f"c{axis}") for axis in axes}
        return {key: value for key, value in coefficients.items() if value}


class Joints(SceneTable):
    """Sheets on the block (head) and on their support (foot)."""

    head: JointStiffnesses = JointStiffnesses()
    foot: JointStiffnesses = JointStiffnesses()


class Mesh(SceneTable):
    """Quadratic elements; `seed` is their size in the sheets, `contact_seed` at the patch."""

    element: Literal["hex", "tet"] = "hex"
    seed: Seed = 6e-3  # [m]
    block_seed: Seed = 20e-3  # [m]
    support_seed: Seed = 60e-3  # [m]
    contact_seed: Seed = 5e-3  # [m]
    file: str | None = None  # a mesh of one's own, with the names of ours


class Standing(SceneTable):
    """A table below, swaying along x and y; `frequency` with the assembly on it."""

    frequency: Frequency  # [Hz]
    mass: of(Positive, MASS, 1e-3, 1e6)  # [kg] of the table alone


class Patch(SceneTable):
    """Where the last sphere touches the block's +x face, and how the face is averaged there.

    `nodes` takes the mean of the nodes nearest to these points in place of a pressure. "thesis"
    pushes at the node nearest to the point and reads the mean of two others, one radius to either
    side along y, or of `nodes`: it makes energy, and is there to be compared with.
    """

    point: Point = (0.03, 0.0)  # y, z from the middle of the face [m]
    radius: of(Positive, LENGTH) = 2e-3  # [m]
    weights: Literal["hertz", "area", "thesis"] = "hertz"
    nodes: Annotated[tuple[Point, ...], Field(strict=False, min_length=1)] | None = None  # y, z [m]


class Reduction(SceneTable):
    """Modes kept: a number, all below `cutoff`, or as many as an `error` asks for.

    `error` is that of the receptance at the contact, relative rms up to `to_hz`, else 20 kHz.
    `choice` says which: "contact" those that a force at the contact moves most up to `to_hz`,
    beside the four of the hammer test; "lowest" in the order of their frequencies.
    """

    kind: Literal["craig-bampton", "free-modes"] = "craig-bampton"
    choice: Literal["contact", "lowest"] = "contact"  # a cutoff takes the lowest
    modes: Count | None = None
    cutoff: Limit | None = None  # [Hz]
    error: Annotated[float, Field(gt=0, lt=1)] | None = None
    to_hz: Limit | None = None  # [Hz]

    @model_validator(mode="before")
    @classmethod
    def _one_measure(cls, table: Any) -> Any:
        return _exactly_one(table, "modes", "cutoff", "error", default=40)


class ModalDampingTable(SceneTable):
    """A ratio for all modes, or one for each of the hammer test: others take the nearest one's."""

    kind: Literal["modal"]
    ratio: one_or_each(Ratio) = 0.0


class RayleighDampingTable(SceneTable):
    """C = alpha M + beta K, by its coefficients or by the ratios of two frequencies."""

    kind: Literal["rayleigh"]
    alpha: of(NonNegative, RATE) = 0.0  # [1/s]
    beta: of(NonNegative, TIME) = 0.0  # [s]
    frequency: Annotated[tuple[Frequency, Frequency], Field(strict=False)] | None = None  # [Hz]
    ratio: Annotated[tuple[Ratio, Ratio], Field(strict=False)] | None = None

    @model_validator(mode="after")
    def _one_way(self) -> "RayleighDampingTable":
        if (self.frequency is None) != (self.ratio is None):
            raise ValueError("frequency and ratio belong together, two values each: add the other")
        if self.frequency and (self.alpha or self.beta):
            raise ValueError("alpha and beta follow from frequency and ratio: keep one of the two")
        return self


class NoDamping(SceneTable):
    """An undamped wall."""

    kind: Literal["none"] = "none"


Damping = Annotated[ModalDampingTable | RayleighDampingTable | NoDamping, Discriminator("kind")]


class Time(SceneTable):
    """How long, and the error asked for; `dt` replaces the error.

    The velocities are held to `error` until `horizon`. After tens of impacts spheres move
    chaotically and no step holds an error of theirs: from there on the energy is kept.
    """

    duration: of(Positive, TIME, 0, 1) = 3e-3  # [s]
    horizon: of(Positive, TIME, 0, 10) = 10e-3  # [s]
    error: Annotated[float, Field(ge=1e-12, lt=1)] | None = None  # above rounding
    dt: of(Positive, TIME) | None = None  # [s]

    @model_validator(mode="before")
    @classmethod
    def _one_measure(cls, table: Any) -> Any:
        return _exactly_one(table, "error", "dt", default=1e-4)
