"""[test_axes]: how the axes of a hammer test lie on the assembly."""

from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from beadwave.workflows.scene.scene_table import SceneTable
from beadwave.workflows.scene.tables.bodies import Place3

Places = Annotated[tuple[Place3, ...], Field(strict=False, min_length=3)]


class AxesOfTest(SceneTable):
    """Points of a hammer test whose places on the assembly are known, three or more that are not on
    a line: a turn and a shift bring all points and directions of the test onto the assembly."""

    points: Places  # [m] in the axes of the test
    at: Places  # [m] the same points on the assembly, in its axes

    @model_validator(mode="after")
    def _of_a_turn(self) -> "AxesOfTest":
        """As many points as places, neither on a line: a fit would leave a turn about it open."""
        if len(self.points) != len(self.at):
            raise ValueError(
                f"points has {len(self.points)} and at has {len(self.at)} places: give one each"
            )
        for name in ("points", "at"):
            places = np.array(getattr(self, name))
            spread = np.linalg.svd(places - places.mean(axis=0), compute_uv=False)
            # points in a strip narrower than 1e-3 of its length tell no turn about their line
            if not spread[1] > 1e-3 * spread[0]:
                raise ValueError(
                    f"the places of {name} lie on a line, which leaves a turn about it open: give "
                    "one beside it"
                )
        return self
