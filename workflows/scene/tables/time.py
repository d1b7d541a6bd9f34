"""[time]: how long a run lasts, and its error or its step."""

from typing import Annotated, Any

from pydantic import Field, model_validator

from beadwave.workflows.scene.quantities import of
from beadwave.workflows.scene.scene_table import (
    Positive,
    RelativeError,
    SceneTable,
    exactly_one,
)
from beadwave.workflows.scene.units import (
    TIME,
)


class Time(SceneTable):
    """Duration and requested error; `dt` replaces the error.

    The velocities meet `error` until `horizon`. After tens of impacts spheres move chaotically, and
    no step bounds the error of their velocities; from the horizon on the energy alone is
    controlled.
    """

    duration: of(Positive, TIME, 0, 1) = 3e-3  # [s] of the run
    horizon: of(Positive, TIME, 0, 10) = 10e-3  # [s] up to which errors count
    # of the velocities over the striker's speed; the step follows from it
    error: Annotated[RelativeError, Field(ge=1e-12, lt=1)] | None = None
    dt: of(Positive, TIME) | None = None  # [s] a fixed step, in place of an error

    @model_validator(mode="before")
    @classmethod
    def _one_measure(cls, table: Any) -> Any:
        return exactly_one(table, "error", "dt", default=1e-4)
