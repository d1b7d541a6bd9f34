"""[[shakers]]: what moves the wall, before and while the striker comes.

A wall of a few numbers moves as a whole, along itself. A structure is shaken at a patch of a face:
by a force, or by a motion at the far end of a stinger, an elastic rod of a stated stiffness.
"""

from collections.abc import Iterator
from fractions import Fraction
from re import fullmatch
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import AfterValidator, Field

from workflows.scene.quantities import of
from workflows.scene.scene_table import Frequency, Number, Point, Positive, SceneTable
from workflows.scene.units import ACCELERATION, DISPLACEMENT, FORCE, LENGTH, STIFFNESS, VELOCITY
from workflows.scene.walls import RomWall

if TYPE_CHECKING:
    from workflows.scene.scene import Scene

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
FACE = r"^[^:@*#]+[:@].+$"  # a face of a body: "block:-x", "block@x,y,z"


def _face(selector: str) -> str:
    if not fullmatch(FACE, selector):
        raise ValueError(f'{selector!r} is no face of a body: write "body:+x"')
    return selector


Face = Annotated[str, AfterValidator(_face)]
AMPLITUDES = {"displacement": 0, "velocity": 1, "acceleration": 2}  # powers of omega over it
MOST_CYCLES = 100  # of the slowest shaker in a common period


Direction = str | Annotated[tuple[Number, Number, Number], Field(strict=False)]


class Shaker(SceneTable):
    """Shakes by amplitude cos(2 pi frequency t + phase), t = 0 when the striker arrives."""

    name: Annotated[str, Field(pattern=r"^\w[\w-]*$", max_length=50)]  # by which keys call it
    # a face, "body:-x"; or "wall", all of a wall of a few numbers, or a shaker of wall.file
    on: str
    at: Point | None = None  # [m] on a plane face, from its middle along the axes that span it
    radius: of(Positive, LENGTH) | None = None  # [m] of the patch of a face that it takes; 5 mm
    # "x", "y", "z", "normal" (out of the face), or a vector; of a wall in its plane
    direction: Direction | None = None
    frequency: Frequency  # [Hz] of its motion; several shakers have a common period
    displacement: of(Positive, DISPLACEMENT, 0, 0.1) | None = None  # [m] amplitude
    velocity: of(Positive, VELOCITY, 0, 10) | None = None  # [m/s] amplitude
    acceleration: of(Positive, ACCELERATION, 0, 1e5) | None = None  # [m/s^2] amplitude
    force: of(Positive, FORCE, 0, 1e5) | None = None  # [N] amplitude; of a structure
    # [N/m] between a motion and the face of a structure
    stinger: of(Positive, STIFFNESS) | None = None
    phase: Annotated[float, Field(ge=-360, le=360)] = 0.0  # [degrees] when the striker arrives

    @property
    def on_face(self) -> bool:
        """Whether it shakes a face of a structure."""
        return self.on != "wall"

    @property
    def vector(self) -> np.ndarray:
        """(3,) unit vector of its direction, nan where it has none."""
        given = AXES.get(self.direction) if isinstance(self.direction, str) else self.direction
        vector = np.full(3, np.nan) if given is None else np.array(given, float)
        size = float(np.linalg.norm(vector))
        return vector / size if size > 0.0 else np.full(3, np.nan)

    @property
    def force_amplitude(self) -> float:
        """[N] on the structure: its force, or that of its motion on a stinger held at the face."""
        return self.force if self.stinger is None else self.stinger * self.amplitude

    @property
    def amplitude(self) -> float:
        """[m] of the displacement."""
        omega = 2.0 * np.pi * self.frequency
        for name, power in AMPLITUDES.items():
            if (value := getattr(self, name)) is not None:
                return value / omega**power
        return 0.0


def _of_wall(shaker: Shaker, key: str) -> Iterator[str]:
    """Sentences on a shaker of a wall of a few numbers, which moves as a whole along itself."""
    if shaker.on_face:
        yield (
            f'{key}.on = "{shaker.on}", allowed is "wall": a wall of a few numbers moves as a '
            'whole; change it, or take wall.kind = "rom" with an assembly.'
        )
        return
    for name in ("at", "radius"):
        if getattr(shaker, name) is not None:
            yield (
                f'{key}.{name} is of a place on a face, with on = "wall" all of it moves; drop it.'
            )
    if shaker.force is not None:
        yield (
            f'{key}.force = {shaker.force:g} N on = "wall", whose mass along itself is not '
            "known; give displacement, velocity or acceleration."
        )
    elif not shaker.amplitude:
        yield (
            f"{key} has no amplitude; add displacement in m, velocity in m/s or acceleration "
            "in m/s^2."
        )
    if shaker.stinger is not None:
        yield (
            f'{key}.stinger = {shaker.stinger:g} N/m, with on = "wall" the motion is that of '
            "the wall itself; drop it."
        )

    # its direction: along the wall, whose normal is x
    words = isinstance(shaker.direction, str)
    if shaker.direction is None:
        yield f'{key}.direction is missing; add "y", "z" or a vector in their plane.'
    elif words and shaker.direction not in (*AXES, "normal"):
        yield (
            f'{key}.direction = "{shaker.direction}", allowed are "y", "z" and vectors in '
            "their plane; change it."
        )
    elif shaker.direction == "normal" or abs(shaker.vector[0]) > 1e-12:
        shown = shaker.direction if words else list(shaker.direction)
        yield (
            f"{key}.direction = {shown!r} moves the wall along the chain, allowed are "
            'directions in its plane: "y", "z" or [0, a, b]; change it.'
        )


def _of_structure(shaker: Shaker, key: str, of_file: bool) -> Iterator[str]:
    """Sentences on a shaker of a structure: of a face, or of a file by its name."""
    places = ("at", "radius", "direction")
    placed = [name for name in places if getattr(shaker, name) is not None]
    if of_file and shaker.on_face:
        yield (
            f'{key}.on = "{shaker.on}", allowed with wall.file is "wall": a shaker of the file, by '
            "its name there; change it."
        )
    elif of_file and placed:
        yield f"{key}.{placed[0]} is stated by wall.file, with {key}; drop it."
    elif not of_file and not fullmatch(FACE, shaker.on):
        yield (f'{key}.on = "{shaker.on}" is no face of a structure; name one, as on = "body:-x".')
    elif not of_file and not (
        shaker.direction in (*AXES, "normal") or isinstance(shaker.direction, tuple)
    ):
        shown = "missing" if shaker.direction is None else f'"{shaker.direction}"'
        yield (
            f'{key}.direction is {shown}, allowed are "x", "y", "z", "normal" and vectors; '
            "change it."
        )

    if shaker.force is None and not shaker.amplitude:
        yield f"{key} has no amplitude; add force in N, or a motion and its stinger in N/m."
    elif shaker.force is None and shaker.stinger is None:
        yield (
            f"{key} moves a structure without a stinger; add stinger, the stiffness in N/m between "
            "that motion and the face, or give a force."
        )
    elif shaker.force is not None and shaker.stinger is not None:
        yield (
            f"{key}.stinger = {shaker.stinger:g} N/m stands between a motion and the face, {key} "
            "is a force; drop one of them."
        )


def of_shakers(scene: "Scene") -> Iterator[str]:
    """Sentences on contradictions between shakers and the rest of a scene."""
    shakers = scene.shakers or ()
    if not shakers:
        return
    names = set()
    for shaker in shakers:
        key = f"shakers.{shaker.name}"
        if shaker.name in names:
            yield f"{key} stands twice; give each shaker a name of its own."
        names.add(shaker.name)
        given = [name for name in (*AMPLITUDES, "force") if getattr(shaker, name) is not None]
        if len(given) > 1:
            yield f"{key} has {' and '.join(given)}, which exclude each other; keep one of them."
        of_file = isinstance(scene.wall, RomWall) and scene.wall.file is not None
        if isinstance(scene.wall, RomWall):
            yield from _of_structure(shaker, key, of_file)
        else:
            yield from _of_wall(shaker, key)
        if not (isinstance(shaker.direction, str | None) or any(shaker.direction)):
            yield f"{key}.direction = {list(shaker.direction)} has no length; give another vector."
    if scene.friction is None:
        yield "[[shakers]] move the wall below the last sphere; add [friction], or drop them."
    pressed = bool(scene.preload and scene.preload.force > 0.0)
    pressed = pressed or bool(scene.gravity and scene.gravity.along > 0.0)
    leaf = scene.leaf_springs
    sprung = leaf is not None and bool(np.any(np.multiply(leaf.stiffness, leaf.offset)))
    if not (pressed or sprung):
        yield (
            "[[shakers]] move a wall that nothing presses the last sphere on; add preload.force, "
            "or drop them."
        )

    # a common period
    slowest = min(shaker.frequency for shaker in shakers)
    ratios = [Fraction(s.frequency / slowest).limit_denominator(MOST_CYCLES) for s in shakers]
    cycles = int(np.lcm.reduce([ratio.denominator for ratio in ratios]))
    if cycles > MOST_CYCLES or any(
        abs(s.frequency / slowest - ratio) > 1e-9 for s, ratio in zip(shakers, ratios, strict=True)
    ):
        hertz = ", ".join(f"{shaker.frequency:g}" for shaker in shakers)
        yield (
            f"shakers of {hertz} Hz have no common period within {MOST_CYCLES} cycles of the "
            "slowest; change a frequency."
        )
