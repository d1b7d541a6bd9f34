"""[reduction] and [patch]: which modes a reduced model has, and where the chain touches it."""

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from beadwave.workflows.scene.scene_table import (
    Count,
    Limit,
    PatchRadius,
    Point,
    RelativeError,
    SceneTable,
    exactly_one,
)

TO_HZ = 20e3  # up to which an error of the reduction holds, unless the scene says


class Reduction(SceneTable):
    """Modes kept: a number, all below `cutoff`, or as many as an `error` asks for.

    `error` is that of the receptance at the contact, relative rms up to `to_hz`, else 20 kHz.
    `choice` says which: "contact" those that a force at the contact moves most up to `to_hz`,
    beside the four of the hammer test; "lowest" in the order of their frequencies.
    """

    # modes of the structure with its contact held, or free
    kind: Literal["craig-bampton", "free-modes"] = "craig-bampton"
    # contact: modes that a force there moves most; lowest: by frequency
    choice: Literal["contact", "lowest"] = "contact"
    modes: Count | None = None  # number of modes kept
    cutoff: Limit | None = None  # [Hz] modes below it are kept
    # of the receptance at the contact, which decides how many modes are kept
    error: Annotated[RelativeError, Field(gt=0, lt=1)] | None = None
    to_hz: Limit | None = None  # [Hz] up to which the error and the choice count; 20 kHz

    @model_validator(mode="before")
    @classmethod
    def _one_measure(cls, table: Any) -> Any:
        return exactly_one(table, "modes", "cutoff", "error", default=40)


class Patch(SceneTable):
    """Place that the last sphere touches on the block's +x face, and the average of the face there.

    `nodes` takes the mean of the nodes nearest to these points in place of a pressure. "thesis"
    pushes at the node nearest to the point and reads the mean of two others, one radius to either
    side along y, or of `nodes`. It makes energy out of nothing and serves comparisons alone.
    """

    point: Point = (0.03, 0.0)  # [m] y, z from the middle of the face
    radius: PatchRadius = 2e-3  # [m] of the loaded patch
    weights: Literal["hertz", "area", "thesis"] = "hertz"  # how the face is averaged over the patch
    # [m] y, z of points whose nearest nodes are averaged, without a pressure
    nodes: Annotated[tuple[Point, ...], Field(strict=False, min_length=1)] | None = None
