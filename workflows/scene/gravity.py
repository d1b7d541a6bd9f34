"""The weight of the spheres, the guides that they slide in, the fall of the striker."""

from collections.abc import Iterator
from math import cos, pi, radians, sin, sqrt
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field, model_validator

from workflows.scene.chain import Striker
from workflows.scene.quantities import of
from workflows.scene.scene_table import (
    InvalidScene,
    NonNegative,
    Positive,
    SceneTable,
    one_or_each,
)
from workflows.scene.units import ACCELERATION, FORCE
from workflows.scene.walls import DashpotWall, RomWall

if TYPE_CHECKING:
    from workflows.scene.scene import Scene

SAME = 1e-9  # relative difference of a stated velocity to that of the stated drop


class Gravity(SceneTable):
    """Weight of the spheres. `inclination` is the angle of the chain from the horizontal: at 90 it
    stands on the wall, at 0 it lies and no weight acts along it, at -90 it hangs below the wall."""

    # [degrees] of the chain from the horizontal, wall at the lower end
    inclination: Annotated[float, Field(ge=-90, le=90)] = 90.0
    acceleration: of(Positive, ACCELERATION, 1, 30) = 9.80665  # [m/s^2] of gravity

    @property
    def along(self) -> float:
        """Its part along the chain [m/s^2], towards the wall."""
        return self.acceleration * sin(radians(self.inclination))

    @property
    def across(self) -> float:
        """Its part across the chain [m/s^2]."""
        upright = abs(self.inclination) == 90.0
        return 0.0 if upright else self.acceleration * cos(radians(self.inclination))


class Guides(SceneTable):
    """Coulomb friction of the guides of the spheres: a `coefficient` of the weight across the
    chain, or a `force` on each sphere that slides. The chain starts from rest without it."""

    # coefficient of friction at the guides
    coefficient: Annotated[NonNegative, Field(le=10)] | None = None
    # [N] of friction on a sphere, in place of the coefficient
    force: one_or_each(of(NonNegative, FORCE, 0, 1e3)) | None = None

    @model_validator(mode="after")
    def _one_measure(self) -> "Guides":
        if (self.coefficient is None) == (self.force is None):
            raise ValueError("needs either coefficient or force in N: give one of them")
        return self


def friction(scene: "Scene", mass: Any) -> Any:
    """Friction [N] of the guides on spheres of this mass [kg], 0 without guides."""
    if scene.guides is None:
        return 0.0 * mass
    if scene.guides.force is not None:
        return np.asarray(scene.guides.force, float) + 0.0 * mass
    across = scene.gravity.across if scene.gravity else 0.0
    return scene.guides.coefficient * across * mass


def fallen(scene: "Scene", source: str) -> Striker | None:
    """The striker with the velocity that its drop gives it; raises InvalidScene where it gives
    none, or where both are given and differ."""
    if scene.striker is None or scene.striker.drop is None:
        return scene.striker
    drop, given = scene.striker.drop, scene.striker.velocity
    R, rho = (float(np.atleast_1d(x)[0]) for x in (scene.chain.radius, scene.chain.density))
    mass = 4 / 3 * pi * R**3 * rho

    # v = sqrt(2 a h) with the weight along the chain less the friction of the guides
    force = np.atleast_1d(friction(scene, mass))[0]
    net = (scene.gravity.along if scene.gravity else 0.0) - force / mass
    if net <= 0:
        raise InvalidScene(
            f"{source}: striker.drop = {drop:g} m makes no fall, {net:.3g} m/s^2 act on the "
            "striker towards the wall; add [gravity], incline the chain, or give striker.velocity."
        )
    speed = sqrt(2 * net * drop)
    if given is not None and abs(given / speed - 1) > SAME:
        raise InvalidScene(
            f"{source}: striker.velocity = {given:g} m/s, but striker.drop = {drop:g} m gives "
            f"{speed:.6g} m/s; drop one of them."
        )
    return scene.striker.but(velocity=speed)


def of_gravity(scene: "Scene") -> Iterator[str]:
    """Sentences on contradictions between weight, guides and the rest of a scene."""
    gravity, guides = scene.gravity, scene.guides
    along = gravity.along if gravity else 0.0
    if along and scene.wall is None and not scene.leaf_springs:
        yield "[gravity] needs a [wall] or [leaf_springs] that carries the chain; add one."
    if along and isinstance(scene.wall, DashpotWall) and not scene.leaf_springs:
        yield (
            '[gravity] with wall.kind = "dashpot", which gives way to any steady force: nothing '
            'holds an infinite plate. Take wall.kind = "half-space" for a slab thicker than its '
            'waves are long, a [plate] with wall.kind = "rom", whose edges carry the chain, or '
            "gravity.inclination = 0, without what the weight adds to the speed of the waves."
        )
    if along < 0 and not scene.leaf_springs:
        yield (
            f"gravity.inclination = {gravity.inclination:g} lets the chain fall off the wall; hold "
            "it by [leaf_springs], or take an angle above 0."
        )
    of_assembly = isinstance(scene.wall, RomWall) and not scene.wall.file
    if along > 0 and of_assembly and scene.floats:
        yield "[gravity] presses on an assembly without supports; hold it, or drop [gravity]."
    if guides and scene.leaf_springs and np.any(scene.leaf_springs.stiffness):
        yield "[guides] and [leaf_springs] exclude each other: keep one of them."
    if guides and guides.coefficient and not (gravity and gravity.across):
        yield (
            f"guides.coefficient = {guides.coefficient:g} presses nothing on the guides: give "
            "guides.force, or [gravity] with an inclination between -90 and 90."
        )
