"""[gravity] and [guides]: the weight of the spheres, and what they slide in."""

from math import asin, cos, degrees, radians, sin
from typing import Annotated, Any

import numpy as np
from pydantic import Field, model_validator

from beadwave.workflows.scene.quantities import of
from beadwave.workflows.scene.scene_table import (
    NonNegative,
    Positive,
    SceneTable,
    Vector,
    one_or_each,
)
from beadwave.workflows.scene.units import ACCELERATION, FORCE

DOWN = (0.0, 0.0, -1.0)  # direction of the weight in global axes
UPRIGHT = 90.0  # [degrees] inclination of a chain that stands on its wall


class Gravity(SceneTable):
    """Weight of the spheres. `inclination` is the angle of the chain from the horizontal: at 90 it
    stands on the wall, at 0 it lies and no weight acts along it, at -90 it hangs below the wall. Of
    [[chains]], whose faces say how each lies, the `direction` of the weight is given."""

    # [degrees] of the chain from the horizontal, wall at the lower end
    inclination: Annotated[float, Field(ge=-90, le=90)] = UPRIGHT
    acceleration: of(Positive, ACCELERATION, 1, 30) = 9.80665  # [m/s^2] of gravity
    # of the weight in global axes, of [[chains]]; without it along -z
    direction: Vector | None = None

    @model_validator(mode="after")
    def _points_somewhere(self) -> "Gravity":
        if self.direction is not None and not any(self.direction):
            raise ValueError("direction = [0, 0, 0] is none: give x, y, z of the weight")
        return self

    @property
    def along(self) -> float:
        """Its part along the chain [m/s^2], towards the wall."""
        return self.acceleration * sin(radians(self.inclination))

    def on(self, chain: np.ndarray) -> "Gravity":
        """The weight of a chain along this unit vector (3,), from its first sphere to its last."""
        down = np.array(self.direction or DOWN)
        down /= np.abs(down).max()  # squares of tiny numbers are 0
        down /= np.linalg.norm(down)
        return self.but(inclination=degrees(asin(np.clip(down @ chain, -1.0, 1.0))))

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


def friction(guides: Guides | None, gravity: Gravity | None, mass: Any) -> Any:
    """Friction [N] of the guides on spheres of this mass [kg], 0 without guides."""
    if guides is None:
        return 0.0 * mass
    if guides.force is not None:
        return np.asarray(guides.force, float) + 0.0 * mass
    across = gravity.across if gravity else 0.0
    return guides.coefficient * across * mass
