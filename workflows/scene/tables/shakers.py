"""[[shakers]]: what moves the wall, before and while the striker comes.

A wall of a few numbers moves as a whole, along itself. A structure is shaken at a patch of a face:
by a force, or by a motion at the far end of a stinger, an elastic rod of a stated stiffness.
"""

from re import fullmatch
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, Field

from beadwave.workflows.scene.quantities import of
from beadwave.workflows.scene.scene_table import Frequency, Number, Point, Positive, SceneTable
from beadwave.workflows.scene.units import (
    ACCELERATION,
    DISPLACEMENT,
    FORCE,
    LENGTH,
    STIFFNESS,
    VELOCITY,
)

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
    """Shakes by amplitude cos(2 pi frequency t + phase), t = 0 when the run starts."""

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
    phase: Annotated[float, Field(ge=-360, le=360)] = 0.0  # [degrees] when the run starts

    @property
    def on_face(self) -> bool:
        """True if it shakes a face of a structure."""
        return self.on != "wall"

    @property
    def vector(self) -> np.ndarray:
        """(3,) unit vector of its direction, nan where it has none."""
        direction = AXES.get(self.direction) if isinstance(self.direction, str) else self.direction
        vector = np.full(3, np.nan) if direction is None else np.array(direction, float)
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
