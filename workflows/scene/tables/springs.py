"""[[springs]]: cords, foam and soft mounts, on which a structure hung or stood in its test."""

from re import fullmatch
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, field_validator, model_validator

from beadwave.workflows.scene.quantities import of
from beadwave.workflows.scene.scene_table import Dashpot, Point, Positive, SceneTable
from beadwave.workflows.scene.tables.bodies import GROUND
from beadwave.workflows.scene.tables.shakers import AXES, FACE, Direction, Face
from beadwave.workflows.scene.units import LENGTH, STIFFNESS

ALONG = "k"  # the key of a stiffness along one direction
KEYS = ("kx", "ky", "kz", ALONG)
Stiffness = of(Positive, STIFFNESS, 1.0, 1e9)
Points = Annotated[tuple[Point, ...], Field(strict=False, min_length=1)]


def _other_end(selector: str) -> str:
    if selector != GROUND and not fullmatch(FACE, selector):
        raise ValueError(f'{selector!r} is neither "ground" nor a face of a body: write "body:+x"')
    return selector


class SpringTable(SceneTable):
    """Equal springs from points of a plane face to the ground or to points of another body's plane
    face: along global axes (kx, ky, kz), or along one direction (k).

    An end moves with the mean motion of its disc. Between two bodies a spring acts at the middle
    between its ends; without a `direction`, k acts from one end to the other.
    """

    name: Annotated[str, Field(pattern=r"^\w[\w-]*$", max_length=50)]  # by which keys call it
    on: Face  # a plane face, "lid:+z"
    # [m] one point or several, from its middle along the two axes that span it: a spring at each
    at: Points = ((0.0, 0.0),)
    radius: of(Positive, LENGTH) = 5e-3  # [m] of the discs
    # "ground", or a plane face of another body, "frame:-z"
    to: Annotated[str, AfterValidator(_other_end)] = GROUND
    to_at: Points | None = None  # [m] points of that face, one each; those opposite without it
    kx: Stiffness | None = None  # [N/m] of each along the global x
    ky: Stiffness | None = None  # [N/m] of each along the global y
    kz: Stiffness | None = None  # [N/m] of each along the global z
    k: Stiffness | None = None  # [N/m] of each along its direction, in place of kx, ky, kz
    # of k: "x", "y", "z", "normal" (out of the face), or a vector; without it, from end to end
    direction: Direction | None = None
    cx: Dashpot = 0.0  # [N s/m] dashpot parallel to kx
    cy: Dashpot = 0.0  # [N s/m] dashpot parallel to ky
    cz: Dashpot = 0.0  # [N s/m] dashpot parallel to kz
    c: Dashpot = 0.0  # [N s/m] dashpot parallel to k

    @field_validator("at", "to_at", mode="before")
    @classmethod
    def _one_point(cls, value: Any) -> Any:
        """A single point as a list of one."""
        alone = isinstance(value, list | tuple) and len(value) == 2
        return (value,) if alone and not any(isinstance(x, list | tuple) for x in value) else value

    @property
    def ends(self) -> tuple[Literal["on", "to"], ...]:
        """Its ends on faces."""
        return ("on",) if self.to == GROUND else ("on", "to")

    @property
    def stiffnesses(self) -> dict[str, float]:
        """[N/m] by key."""
        return {key: k for key in KEYS if (k := getattr(self, key)) is not None}

    @property
    def dashpots(self) -> dict[str, float]:
        """[N s/m] by the key of the parallel stiffness."""
        return {key: getattr(self, f"c{key[1:]}") for key in KEYS}

    def along(self, key: str) -> tuple[float, float, float] | str | None:
        """Direction of a stiffness: a vector, "normal", or None from one end to the other."""
        direction = key[1:] if key != ALONG else self.direction
        return AXES.get(direction, direction) if isinstance(direction, str) else direction

    @model_validator(mode="after")
    def _in_a_direction(self) -> "SpringTable":
        stiffnesses = self.stiffnesses
        if not stiffnesses:
            raise ValueError(
                "has no stiffness: give kx, ky or kz in N/m along global axes, or k along a "
                "direction"
            )
        if ALONG in stiffnesses and len(stiffnesses) > 1:
            raise ValueError(
                f"{' and '.join(stiffnesses)} exclude each other: k is along one direction, the "
                "others are along global axes; keep one kind"
            )
        if self.direction is not None and ALONG not in stiffnesses:
            raise ValueError("direction is that of k: give k in N/m, or drop direction")
        words = isinstance(self.direction, str)
        if words and self.direction not in (*AXES, "normal"):
            raise ValueError(
                f'direction = "{self.direction}" must be "x", "y", "z", "normal" or a vector: '
                "change it"
            )
        if self.direction is not None and not words and not any(self.direction):
            raise ValueError(f"direction = {list(self.direction)} must not be zero: change it")
        if ALONG in stiffnesses and self.direction is None and self.to == GROUND:
            raise ValueError(
                f"k = {self.k:g} N/m to the ground has no direction: add direction, "
                '"x", "y", "z", "normal" or a vector'
            )
        for key, c in self.dashpots.items():
            if c and key not in stiffnesses:
                raise ValueError(f"c{key[1:]} = {c:g} has no spring: give {key} in N/m, or drop it")
        if self.to_at is not None and self.to == GROUND:
            raise ValueError('to_at needs a face: give to = "body:-z", or drop it')
        if self.to_at is not None and len(self.to_at) != len(self.at):
            raise ValueError(
                f"to_at has {len(self.to_at)} and at has {len(self.at)} points: give one each"
            )
        return self
