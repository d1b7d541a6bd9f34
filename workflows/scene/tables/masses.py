"""[[masses]]: what faces carry, as sensors, stingers and magnets do in a test."""

from math import sqrt
from typing import Annotated

from pydantic import Field, model_validator

from beadwave.workflows.scene.quantities import of
from beadwave.workflows.scene.scene_table import NonNegative, Point, Positive, SceneTable
from beadwave.workflows.scene.tables.shakers import Face
from beadwave.workflows.scene.units import INERTIA, LENGTH, MASS

LONGEST_GYRATION = 2.0  # [m] of what a face carries: a machine of 5 m has 1.5 m
Moment = of(NonNegative, INERTIA, 0, 10)


class MassTable(SceneTable):
    """A rigid body on a disc of a plane face, which it moves with and does not stiffen."""

    name: Annotated[str, Field(pattern=r"^\w[\w-]*$", max_length=50)]  # by which keys call it
    on: Face  # a plane face, "lid:+z"
    at: Point = (0.0, 0.0)  # [m] from its middle along the two axes that span it
    mass: of(Positive, MASS, 1e-5, 1e3)  # [kg] of it
    radius: of(Positive, LENGTH) = 5e-3  # [m] of the disc
    height: of(NonNegative, LENGTH, 0, 1) = 0.0  # [m] of its centre of mass over the face
    # [kg m^2] moments of inertia about the global x, y and z through its centre; 0
    inertia: Annotated[tuple[Moment, Moment, Moment], Field(strict=False)] | None = None

    @model_validator(mode="after")
    def _of_a_body(self) -> "MassTable":
        """Moments of inertia that a body can have: none above the sum of the other two, and the
        radius of gyration sqrt(J / m) at most LONGEST_GYRATION, which finds moments in g mm^2 that
        are written without their unit."""
        J = self.inertia or (0.0, 0.0, 0.0)
        if 2 * max(J) > sum(J) * (1 + 1e-9):
            raise ValueError(
                f"inertia = {list(J)} is that of no body: none of the three may exceed the sum of "
                "the other two; change it"
            )
        gyration = sqrt(max(J) / self.mass)
        if gyration > LONGEST_GYRATION:
            raise ValueError(
                f"inertia = {list(J)} kg m^2 of {self.mass:g} kg has a radius of gyration of "
                f"{gyration:.3g} m, allowed are {LONGEST_GYRATION:g} m; write it with its unit, as "
                '"400 g mm^2"'
            )
        return self
