"""[[measured]]: a table, a fixture or a neighbour that is known by its receptances at the points
where the assembly is joined to it."""

from collections import Counter
from typing import Annotated, Literal

from pydantic import Field, model_validator

from beadwave.workflows.scene.named_files import FileName
from beadwave.workflows.scene.quantities import of
from beadwave.workflows.scene.scene_table import Count, Frequency, Point, Positive, SceneTable
from beadwave.workflows.scene.tables.shakers import Face
from beadwave.workflows.scene.tables.springs import Stiffness
from beadwave.workflows.scene.units import LENGTH

SEVERAL = Field(strict=False, min_length=1)


class MeasuredTable(SceneTable):
    """A part known by measured receptances between all of its points, to which a plane face of a
    body is joined there: rigidly, or by springs kx, ky, kz at each point.

    The responses are fitted by modes that cannot create energy (`rom.passive_fit`). Points
    are found on the face by the file's coordinates, which [test_axes] may turn, or lie where `at`
    says. A point of the face moves with the mean of its disc.
    """

    name: Annotated[str, Field(pattern=r"^\w[\w-]*$", max_length=50)]  # by which keys call it
    # responses between all points: .uff, .unv, or .mat of hits that name points and sensors
    receptance: FileName
    # of the responses; without it that of the file's quantity, in m and N
    unit: Literal["m/N", "mm/N", "um/N", "m/s/N", "mm/s/N", "m/s^2/N", "g/N"] | None = None
    on: Face  # the plane face that is joined to it, "foot:-z"
    # nodes of the file that are joined; all of them without it
    points: Annotated[tuple[Count, ...], SEVERAL] | None = None
    # [m] where these are on the face, from its middle along the two axes that span it
    at: Annotated[tuple[Point, ...], SEVERAL] | None = None
    radius: of(Positive, LENGTH) = 5e-3  # [m] of the discs
    # directions that are joined, of those measured: "xyz", "z"; all of them without it
    directions: Annotated[str, Field(pattern="^(x?y?z?)$", min_length=1)] | None = None
    kx: Stiffness | None = None  # [N/m] between part and face at each point; rigid without it
    ky: Stiffness | None = None  # [N/m] along the global y
    kz: Stiffness | None = None  # [N/m] along the global z
    # a part that stands fixed has no free masses, which noise near 0 Hz may show; without it as the
    # responses have it
    held: bool = False
    lowest: Frequency | None = None  # [Hz] from which responses are fitted; all above 0 without it
    highest: Frequency | None = None  # [Hz] up to which responses are fitted; all without it

    @model_validator(mode="after")
    def _one_place_each(self) -> "MeasuredTable":
        """A place for each point, each point once, and a band that has a width."""
        if self.at is not None and self.points is None:
            raise ValueError("at needs points, the nodes of the file that lie there: give both")
        if self.at is not None and len(self.at) != len(self.points):
            raise ValueError(
                f"at has {len(self.at)} and points has {len(self.points)} entries: give one each"
            )
        for number, times in Counter(self.points or ()).items():
            if times > 1:
                raise ValueError(f"points has node {number} twice: name it once")
        if self.lowest and self.highest and self.lowest >= self.highest:
            raise ValueError(
                f"lowest = {self.lowest:g} Hz must be below highest = {self.highest:g} Hz"
            )
        return self

    @property
    def stiffness(self) -> tuple[float, float, float]:
        """[N/m] between part and face along x, y and z; inf where rigid."""
        return tuple(float("inf") if k is None else k for k in (self.kx, self.ky, self.kz))
