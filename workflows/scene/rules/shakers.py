"""Keys of shakers that are each allowed but not together, a sentence each."""

from collections.abc import Iterator
from fractions import Fraction
from re import fullmatch

import numpy as np

from beadwave.workflows.scene.scene import Scene
from beadwave.workflows.scene.tables.shakers import AMPLITUDES, AXES, FACE, MOST_CYCLES, Shaker
from beadwave.workflows.scene.tables.walls import RomWall


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


def of_shakers(scene: Scene) -> Iterator[str]:
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
        amplitudes = [name for name in (*AMPLITUDES, "force") if getattr(shaker, name) is not None]
        if len(amplitudes) > 1:
            excluding = " and ".join(amplitudes)
            yield f"{key} has {excluding}, which exclude each other; keep one of them."
        of_file = isinstance(scene.wall, RomWall) and scene.wall.file is not None
        if isinstance(scene.wall, RomWall) or scene.chains:
            yield from _of_structure(shaker, key, of_file)
        else:
            yield from _of_wall(shaker, key)
        if not (isinstance(shaker.direction, str | None) or any(shaker.direction)):
            yield f"{key}.direction = {list(shaker.direction)} has no length; give another vector."
    if scene.friction is None and not scene.chains:
        yield "[[shakers]] move the wall below the last sphere; add [friction], or drop them."
    if not scene.chains and not _pressed(scene):
        yield (
            "[[shakers]] move a wall that nothing presses the last sphere on; add preload.force, "
            "or drop them."
        )
    for name, one in scene.of_each_chain.items():
        if not (_pressed(one) or scene.gravity):
            yield (
                f"nothing presses the last sphere of chains.{name} on the structure that "
                f"[[shakers]] move; add chains.{name}.preload.force, or drop [[shakers]]."
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


def _pressed(scene: Scene) -> bool:
    """True if a force, the weight or leaf springs press the chain on the wall."""
    leaf = scene.leaf_springs
    return bool(
        (scene.preload and scene.preload.force > 0.0)
        or (scene.gravity and scene.gravity.along > 0.0)
        or (leaf is not None and np.any(np.multiply(leaf.stiffness, leaf.offset)))
    )
