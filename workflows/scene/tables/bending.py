"""Tables of a structure that is one table: a beam or a plate of bending theory."""

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from beadwave.workflows.scene.named_materials import of_named_material
from beadwave.workflows.scene.quantities import of
from beadwave.workflows.scene.scene_table import (
    Density,
    Number,
    Positive,
    SceneTable,
    Spring,
    TurnSpring,
    YieldStress,
    text_or_table,
)
from beadwave.workflows.scene.units import AREA, FORCE, IN_PLANE, LENGTH, PRESSURE, SECOND_MOMENT

Modulus = of(Positive, PRESSURE, 1e6, 2e12)  # rubber to diamond
Compressible = Annotated[float, Field(gt=-1, lt=0.5)]
Size = of(Positive, LENGTH, 1e-5, 50)
Side = of(Positive, LENGTH, 1e-5, 2)  # of a section
Force = of(Number, FORCE, 0, 1e9)
ForcePerWidth = of(Number, IN_PLANE, 0, 1e9)
SECTIONS = {"width": "thickness", "diameter": None, "area": "second_moment"}


class EndSprings(SceneTable):
    """Springs of a beam's end to the ground; inf is rigid."""

    shift: Spring  # [N/m] across the beam
    turn: TurnSpring = 0.0  # [N m/rad] against rotation


EndOfBeam = Annotated[
    Annotated[Literal["hinged", "clamped", "free"], Tag("text")]
    | Annotated[EndSprings, Tag("table")],
    Discriminator(text_or_table),
]


class Beam(SceneTable):
    """A straight Timoshenko beam, struck across.

    The section is width and thickness (along the chain), diameter with or without a bore, or area
    and second_moment. `position` is from the left end; axial_force > 0 pulls, < 0 presses.
    """

    length: Size  # [m] between its ends
    width: Side | None = None  # [m] of a rectangular section
    thickness: Side | None = None  # [m] along the chain
    diameter: Side | None = None  # [m] of a round section
    bore: of(Annotated[Number, Field(ge=0)], LENGTH, 1e-5, 2) = 0.0  # [m] inner diameter of a tube
    area: of(Positive, AREA, 1e-9, 10) | None = None  # [m^2] of any section
    # [m^4] of the section, with area
    second_moment: of(Positive, SECOND_MOMENT, 1e-18, 10) | None = None
    shear_factor: Annotated[float, Field(gt=0, le=1.2)] | None = None  # by default of its shape
    material: str | None = None  # a named material, in place of its numbers
    young: Modulus  # [Pa] Young's modulus
    poisson: Compressible = 0.3  # Poisson's ratio
    density: Density  # [kg/m^3] mass over volume
    yield_stress: YieldStress | None = None  # [Pa] beyond which a run warns
    left: EndOfBeam  # how that end or edge is held
    right: EndOfBeam  # how that end or edge is held
    position: Size  # [m] of the strike from the left end
    axial_force: Force = 0.0  # [N] along the beam, > 0 pulls

    @property
    def loads(self) -> dict[str, float]:
        """Loads before the strike, by key."""
        return {"axial_force": self.axial_force}

    @property
    def springs(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """(shift, turn) of both ends, inf rigid."""
        return _springs(self.left), _springs(self.right)

    @property
    def floats(self) -> bool:
        """True if the beam can move as a rigid body."""
        (shift, turn), (other_shift, other_turn) = self.springs
        n_turns = (shift > 0) + (other_shift > 0)
        return n_turns == 0 or (n_turns == 1 and turn == 0 and other_turn == 0)

    _of_named_material = of_named_material()

    @model_validator(mode="after")
    def _one_section(self) -> "Beam":
        """One section, whole, lower than the beam is long, and struck within the beam."""
        sections = [key for key in SECTIONS if getattr(self, key) is not None]
        if len(sections) != 1:
            keys = " and ".join(sections) or "nothing"
            raise ValueError(
                f"the section is told by {keys}: give width and thickness, diameter, or area and "
                "second_moment"
            )
        for key, partner in SECTIONS.items():
            if partner and (getattr(self, key) is None) != (getattr(self, partner) is None):
                raise ValueError(f"{key} and {partner} belong together: add the other")
        if self.area and self.shear_factor is None:
            raise ValueError("area and second_moment say no shape: add shear_factor")
        if self.bore and not self.diameter:
            raise ValueError("bore belongs to diameter: drop it, or give diameter")
        if self.bore and self.bore >= self.diameter:
            raise ValueError(
                f"bore = {self.bore:g} m must be below diameter = {self.diameter:g} m: change it"
            )
        height = self.thickness or self.diameter or 0.0
        if height >= self.length:
            key = "thickness" if self.thickness else "diameter"
            in_mm = f'write {key} = "{height:g} mm" if these are meant, else '
            raise ValueError(
                f"a section {height:g} m high is no beam of length = {self.length:g} m: "
                f"{in_mm if 1e-3 * height < self.length else ''}draw it as a body"
            )
        if not self.position < self.length:
            raise ValueError(
                f"position = {self.position:g} m must be below length = {self.length:g} m: move it"
            )
        return self


Edge = Literal["hinged", "clamped", "free"]


class BendingPlateTable(SceneTable):
    """A rectangular Mindlin plate from x = 0 to length and y = 0 to width, struck on its face.

    Edges are left and right at the ends of its length, front and back at those of its width; a
    hinged one turns about itself. in_plane_x and in_plane_y are forces in its plane along x and y,
    per width, even all over it: > 0 pull, < 0 press. Modes may be many: see reduction.
    """

    length: Size  # [m] along x
    width: Size  # [m] along y
    thickness: Side  # [m] along the chain
    shear_factor: Annotated[float, Field(gt=0, le=1.2)] | None = None  # by default 5 / (6 - nu)
    material: str | None = None  # a named material, in place of its numbers
    young: Modulus  # [Pa] Young's modulus
    poisson: Compressible = 0.3  # Poisson's ratio
    density: Density  # [kg/m^3] mass over volume
    yield_stress: YieldStress | None = None  # [Pa] beyond which a run warns
    left: Edge  # how that end or edge is held
    right: Edge  # how that end or edge is held
    front: Edge  # how that edge is held
    back: Edge  # how that edge is held
    at: Annotated[tuple[Size, Size], Field(strict=False)]  # [m] x, y of the strike, from the corner
    in_plane_x: ForcePerWidth = 0.0  # [N/m] along x, > 0 pulls
    in_plane_y: ForcePerWidth = 0.0  # [N/m] along y, > 0 pulls

    @property
    def loads(self) -> dict[str, float]:
        """Loads before the strike, by key."""
        return {"in_plane_x": self.in_plane_x, "in_plane_y": self.in_plane_y}

    @property
    def edges(self) -> tuple[str, str, str, str]:
        """At x = 0, x = length, y = 0, y = width."""
        return self.left, self.right, self.front, self.back

    @property
    def floats(self) -> bool:
        """True if the plate can move as a rigid body: one hinged edge lets it turn."""
        supported = [edge for edge in self.edges if edge != "free"]
        return not supported or supported == ["hinged"]

    _of_named_material = of_named_material()

    @model_validator(mode="after")
    def _struck_inside(self) -> "BendingPlateTable":
        """Thin enough for a theory of plates, and struck a thickness from the edges at least."""
        h = self.thickness
        if 4 * h > min(self.length, self.width):
            raise ValueError(
                f"thickness = {h:g} m must be up to a quarter of the shorter side, "
                f"{min(self.length, self.width):g} m: draw a thicker one as a body"
            )
        for axis, x, side in zip("xy", self.at, (self.length, self.width), strict=True):
            if not h <= x <= side - h:
                raise ValueError(
                    f"at has {axis} = {x:g} m, allowed are {h:g} to {side - h:g} m, one thickness "
                    "from the edges: move it"
                )
        return self


def _springs(end: Any) -> tuple[float, float]:
    """Stiffness across [N/m] and against turning [N m/rad] of an end, of a word or springs."""
    inf = float("inf")
    words = {"hinged": (inf, 0.0), "clamped": (inf, inf), "free": (0.0, 0.0)}
    return words[end] if isinstance(end, str) else (end.shift, end.turn)
