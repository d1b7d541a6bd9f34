"""Parts of every table of a scene: a pydantic model, types of numbers with their units.

The tables stand in the files of their names: `chain`, `contact`, `walls`, `joints`, `bodies`,
`bending` ([beam], [plate]), `mesh`, `reduction`, `damping`, `time`, `sensors` ([output]),
`gravity`, `assembly`. An absent table is an absent part of the scene.

To add a key, add a field to its table: `of(number, KIND, low, high)` reads a text with a unit and
gives the usual range, a default makes the key optional. `--set`, units, sweeps and the TOML of a
scene follow from the field. Keys that replace each other are listed in `toml.INSTEAD`, rules
between tables in `contradictions` and the files `..._contradictions`. Nothing here loads a solver.
"""

from collections.abc import Iterable
from difflib import get_close_matches
from math import isfinite
from typing import Annotated, Any, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    model_validator,
)

from beadwave.workflows.scene.quantities import of
from beadwave.workflows.scene.shown import clipped
from beadwave.workflows.scene.units import (
    DASHPOT,
    DENSITY,
    FREQUENCY,
    LENGTH,
    PRESSURE,
    STIFFNESS,
    TURN_DASHPOT,
    TURN_STIFFNESS,
    VELOCITY,
    Kind,
    NoSuchQuantity,
    in_si,
)


class InvalidScene(ValueError):
    """One sentence: the key, the value found, the value allowed, what to do. Long values in it are
    cut."""

    def __init__(self, sentence: object = "") -> None:
        super().__init__(clipped(str(sentence)))


# what users write for a key: symbols of the literature and other words
SYNONYMS = {
    "mu": "coefficient", "friction_coefficient": "coefficient", "rho": "density", "E": "young",
    "modulus": "young", "youngs_modulus": "young", "nu": "poisson", "zeta": "ratio",
    "v": "velocity", "speed": "velocity", "n": "count", "fixed": "held",
}  # fmt: skip


def nearest(word: str, words: Iterable[str]) -> str:
    """The end of a message: which of the words is most like this one, or all of them."""
    names = list(words)
    table, dot, last = word.rpartition(".")
    if (spelled := table + dot + SYNONYMS.get(last, last)) in names:
        return f"the nearest known is {spelled!r}"
    close = get_close_matches(word, names, n=1, cutoff=0.6)
    return f"the nearest known is {close[0]!r}" if close else f"known are {', '.join(names)}"


# keys of earlier scenes: table, key, and what to use instead
REMOVED = {
    ("RomWall", "prune"): "reduction.error keeps the modes that the contact needs",
    ("BodyTable", "lines"): "seed, mesh.scale and strike.seed say how large elements are",
    ("Holes", "rings"): "seed, mesh.scale and strike.seed say how large elements are",
}


class SceneTable(BaseModel):
    """A table that takes its own keys and nothing else."""

    model_config = ConfigDict(
        strict=True, frozen=True, extra="forbid", allow_inf_nan=False, validate_default=True
    )

    @model_validator(mode="before")
    @classmethod
    def _known_keys(cls, table: Any) -> Any:
        for key in table if isinstance(table, dict) else ():
            if (cls.__name__, key) in REMOVED:
                raise ValueError(f"{key} is no key any more; drop it: {REMOVED[cls.__name__, key]}")
            if key not in cls.model_fields:
                raise ValueError(f"unknown key {key!r}, {nearest(key, cls.model_fields)}")
        return table

    def but(self, **values: Any) -> Self:
        """A copy with other values, which are not checked; a dict changes keys of the table that is
        there."""
        update = {}
        for name, value in values.items():
            present = getattr(self, name)
            nested = isinstance(value, dict) and isinstance(present, SceneTable)
            update[name] = present.but(**value) if nested else value
        return self.model_copy(update=update)


def exactly_one(table: Any, *keys: str, default: float) -> Any:
    """The table, with the first key at its default where none of the keys is given; two are
    refused."""
    if not isinstance(table, dict):
        return table
    present = [key for key in keys if table.get(key) is not None]
    if len(present) > 1:
        raise ValueError(f"{' and '.join(present)} exclude each other: keep one of them")
    return table if present else {**table, keys[0]: default}


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


def _of_percent(value: Any) -> Any:
    """The share that a text as "1 %" stands for; a number as it is."""
    if not isinstance(value, str):
        return value
    number = value.removesuffix("%")
    try:
        if number != value:
            return float(number) / 100
    except ValueError:
        pass
    raise ValueError(
        f'{value!r} is no relative error; write a share or a percentage, 0.02 or "2 %"'
    )


SMALLEST, LARGEST = 1e-18, 1e18  # of any number of a scene
Number = Annotated[float, AfterValidator(_representable)]
Positive = Annotated[Number, Field(gt=0)]
NonNegative = Annotated[Number, Field(ge=0)]
Ratio = Annotated[float, Field(ge=0, lt=1)]
# a number, or a text as "1 %"
RelativeError = Annotated[float, BeforeValidator(_of_percent)]
Poisson = Annotated[float, Field(gt=-1, le=0.5)]
JointStiffness = Annotated[float, Field(ge=0, allow_inf_nan=True), AfterValidator(_representable)]
Count = Annotated[int, Field(ge=1, le=1_000_000)]
Length = of(Number, LENGTH)
Point = Annotated[tuple[Length, Length], Field(strict=False)]
Vector = Annotated[tuple[float, float, float], Field(strict=False, description="x, y, z")]
Density = of(Positive, DENSITY, 20, 25e3)  # foam to osmium
Young = of(Positive, PRESSURE, 5e5, 2e12)  # soft rubber to diamond
Radius = of(Positive, LENGTH, 1e-6, 0.25)
# elements get as small as the patch: of 1e-12 m they filled the memory of a machine
PatchRadius = of(Annotated[Number, Field(ge=1e-6)], LENGTH, 1e-5)
YieldPressure = of(Positive, PRESSURE, 1e4, 1e11)
YieldStress = of(Positive, PRESSURE, 1e5, 2e10)
Velocity = of(Number, VELOCITY, 0, 100)
Frequency = of(Positive, FREQUENCY, 0.1, 1e7)
Limit = of(Positive, FREQUENCY)
Spring = of(JointStiffness, STIFFNESS)
TurnSpring = of(JointStiffness, TURN_STIFFNESS)
Dashpot = of(NonNegative, DASHPOT)
TurnDashpot = of(NonNegative, TURN_DASHPOT)
Seed = of(Positive, LENGTH, 1e-6, 0.25)


def si_of(key: str, value: Any, kind: Kind) -> Any:
    """A number in SI of a text with a unit of the kind; raises ValueError with the key."""
    try:
        return in_si(value, kind) if isinstance(value, str) else value
    except NoSuchQuantity as error:
        raise ValueError(f"{key}: {error}") from None
