"""[[shakers]]: what moves the wall along itself, before and while the striker comes."""

from collections.abc import Iterator
from fractions import Fraction
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field

from workflows.scene.quantities import of
from workflows.scene.scene_table import Frequency, Number, Point, Positive, SceneTable
from workflows.scene.units import ACCELERATION, DISPLACEMENT, FORCE, STIFFNESS, VELOCITY

if TYPE_CHECKING:
    from workflows.scene.scene import Scene

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
AMPLITUDES = {"displacement": 0, "velocity": 1, "acceleration": 2}  # powers of omega over it
MOST_CYCLES = 100  # of the slowest shaker in a common period


class Shaker(SceneTable):
    """Moves the wall by amplitude cos(2 pi frequency t + phase), t = 0 when the striker arrives."""

    name: Annotated[str, Field(pattern=r"^\w[\w-]*$", max_length=50)]  # by which keys call it
    on: str  # what it moves: "wall", all of a wall of a few numbers
    at: Point | None = None  # [m] on a face; with on = "wall" there is none
    # "y", "z", or a vector in their plane, which is that of the wall
    direction: str | Annotated[tuple[Number, Number, Number], Field(strict=False)]
    frequency: Frequency  # [Hz] of its motion; several shakers have a common period
    displacement: of(Positive, DISPLACEMENT, 0, 0.1) | None = None  # [m] amplitude of the wall's
    velocity: of(Positive, VELOCITY, 0, 10) | None = None  # [m/s] amplitude of the wall's
    acceleration: of(Positive, ACCELERATION, 0, 1e5) | None = None  # [m/s^2] amplitude
    force: of(Positive, FORCE, 0, 1e5) | None = None  # [N] amplitude; not of a wall
    stinger: of(Positive, STIFFNESS) | None = None  # [N/m] to a structure; not of a wall
    phase: Annotated[float, Field(ge=-360, le=360)] = 0.0  # [degrees] when the striker arrives

    @property
    def vector(self) -> np.ndarray:
        """(3,) unit vector of its direction, nan where it has none."""
        given = AXES.get(self.direction) if isinstance(self.direction, str) else self.direction
        vector = np.full(3, np.nan) if given is None else np.array(given, float)
        size = float(np.linalg.norm(vector))
        return vector / size if size > 0.0 else np.full(3, np.nan)

    @property
    def amplitude(self) -> float:
        """[m] of the displacement."""
        omega = 2.0 * np.pi * self.frequency
        for name, power in AMPLITUDES.items():
            if (value := getattr(self, name)) is not None:
                return value / omega**power
        return 0.0


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
        if shaker.on != "wall":
            yield (
                f'{key}.on = "{shaker.on}", allowed is "wall": a wall of a few numbers moves as a '
                "whole, structures are not shaken; change it."
            )
        if shaker.at is not None:
            yield f'{key}.at is a place on a face, with on = "wall" all of it moves; drop it.'

        # what it does: one amplitude, of a motion
        given = [name for name in (*AMPLITUDES, "force") if getattr(shaker, name) is not None]
        if len(given) > 1:
            yield f"{key} has {' and '.join(given)}, which exclude each other; keep one of them."
        if not given:
            yield (
                f"{key} has no amplitude; add displacement in m, velocity in m/s or acceleration "
                "in m/s^2."
            )
        if shaker.force is not None:
            yield (
                f'{key}.force = {shaker.force:g} N on = "wall", whose mass along itself is not '
                "known; give displacement, velocity or acceleration."
            )
        if shaker.stinger is not None:
            yield (
                f'{key}.stinger = {shaker.stinger:g} N/m, with on = "wall" the motion is that of '
                "the wall itself; drop it."
            )

        # its direction: along the wall, whose normal is x
        words = isinstance(shaker.direction, str)
        if words and shaker.direction not in (*AXES, "normal"):
            yield (
                f'{key}.direction = "{shaker.direction}", allowed are "y", "z" and vectors in '
                "their plane; change it."
            )
        elif not words and not any(shaker.direction):
            yield f"{key}.direction = {list(shaker.direction)} has no length; give another vector."
        elif shaker.direction == "normal" or abs(shaker.vector[0]) > 1e-12:
            shown = shaker.direction if words else list(shaker.direction)
            yield (
                f"{key}.direction = {shown!r} moves the wall along the chain, allowed are "
                'directions in its plane: "y", "z" or [0, a, b]; change it.'
            )
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
