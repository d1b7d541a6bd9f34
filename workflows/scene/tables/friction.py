"""[friction] and [arm]: Coulomb friction of the last sphere at the wall, and what holds it across.

Axes across the chain: t1, t2 lie in the wall, t2 = n x t1 with n into the wall; before a wall of a
few numbers the chain lies along x, t1 is y and t2 is z.
"""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from beadwave.workflows.scene.quantities import of
from beadwave.workflows.scene.scene_table import (
    NonNegative,
    SceneTable,
    Spring,
    TurnSpring,
    one_or_each,
)
from beadwave.workflows.scene.units import INERTIA


class Friction(SceneTable):
    """Friction of the last sphere at the wall, exact under any history (Cattaneo and Mindlin); of a
    crystal of every contact, by Mindlin's increments."""

    coefficient: Annotated[NonNegative, Field(le=10)]  # tangential over normal force where it slips
    # the other spheres while shakers move a structure, before the striker comes: they move with it,
    # or are held at rest
    upstream: Literal["free", "held"] = "free"
    # the same between spheres: of the last one on the one before, which stays on the chain's line;
    # of a crystal between all spheres, `coefficient` without it
    between_spheres: Annotated[NonNegative, Field(le=10)] | None = None


class Arm(SceneTable):
    """Holds the last sphere across the chain: springs at rest in the static state; inf clamps."""

    stiffness: one_or_each(Spring) = 0.0  # [N/m] across the chain, or along [t1, t2]
    rotation: TurnSpring = 0.0  # [N m/rad] against turns about t1 and t2
    inertia: of(NonNegative, INERTIA, 0, 10) = 0.0  # [kg m^2] besides the sphere's own


def arm_stiffness(arm: Arm | None) -> np.ndarray:
    """(2,) [N/m] along t1 and t2; 0 without an arm."""
    return np.array(np.broadcast_to(0.0 if arm is None else arm.stiffness, 2), float)
