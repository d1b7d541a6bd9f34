"""Output of a run: observed spheres, sensors on them, the instrument that records those."""

from re import fullmatch
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from beadwave.workflows.scene.quantities import of
from beadwave.workflows.scene.scene_table import (
    Count,
    Frequency,
    Number,
    Point,
    Positive,
    Ratio,
    SceneTable,
    si_of,
)
from beadwave.workflows.scene.tables.reduction import TO_HZ, Reduction
from beadwave.workflows.scene.tables.shakers import Direction
from beadwave.workflows.scene.units import (
    ACCELERATION,
    DISPLACEMENT,
    FORCE,
    FORCE_RATE,
    FREQUENCY,
    GAINS,
    LENGTH,
    VELOCITY,
    VOLTAGE,
)

OF_SPHERES = {
    "force": FORCE,
    "force-rate": FORCE_RATE,
    "velocity": VELOCITY,
    "displacement": DISPLACEMENT,
}
KINDS = OF_SPHERES | {"acceleration": ACCELERATION}
OF_FACES = ("acceleration", "velocity", "displacement")
NAME = r"[A-Za-z][\w -]*"


class SensorTable(SceneTable):
    """Signal of one channel. Of a sphere: the mean of its two contact forces, its rate, a velocity
    or a displacement; or of a structure: acceleration, velocity or displacement of a place on a
    face, in a direction. Forces and displacements count from the state at the start.

    `gain` makes a voltage of it: a number in V per unit of the quantity, or a name for one that is
    not known, which sensors of the same name share. `noise` is of records that are computed.
    """

    sphere: Count | None = None  # number of the sphere that carries the sensor
    chain: str | None = None  # name of the one of [[chains]] whose sphere it is
    on: str | None = None  # or a face of the structure, "block:+y"
    at: Point | None = None  # [m] on that plane face, from its middle along the axes that span it
    radius: of(Positive, LENGTH) | None = None  # [m] of the disc whose mean it shows; 5 mm
    direction: Direction | None = None  # "x", "y", "z", "normal" (out of the face), or a vector
    # what is measured; of a face acceleration, velocity or displacement
    quantity: Literal[*KINDS] = "force"
    # [V/N], [V s/N], [V s/m], [V/m] or [V s^2/m]; or a name of one to be found
    gain: Number | str | None = None
    # [Hz] of a Butterworth filter; of a face by default half of reduction.to_hz, else 10 kHz
    low_pass: Frequency | None = None
    high_pass: Frequency | None = None  # [Hz] of a Butterworth filter
    order: Annotated[int, Field(ge=1, le=8)] = 4  # order of the filters
    # [V] or the quantity's unit; without it, the signal's largest value
    range: Positive | None = None
    noise: Ratio = 0.0  # root mean square over the signal's largest value

    @model_validator(mode="before")
    @classmethod
    def _units(cls, table: Any) -> Any:
        """The units of gain and range follow from the quantity."""
        if not isinstance(table, dict) or str(table.get("quantity", "force")) not in KINDS:
            return table
        quantity, gain = str(table.get("quantity", "force")), table.get("gain")
        in_si = dict(table)
        if isinstance(gain, str) and not fullmatch(NAME, gain):
            in_si["gain"] = si_of("gain", gain, GAINS[quantity])
        if "range" in table:
            kind = KINDS[quantity] if gain is None else VOLTAGE
            in_si["range"] = si_of("range", table["range"], kind)
        return in_si

    @property
    def label(self) -> str:
        """The quantity and its sphere, or its place on a face and its direction."""
        if self.on is None:
            return " ".join(map(str, filter(None, (self.quantity, self.chain, self.sphere))))
        axis = self.direction
        if not isinstance(axis, str):
            axis = "along " + " ".join(f"{x:g}" for x in axis or ())
        place = "" if self.at is None else " at " + " ".join(f"{x:g}" for x in self.at)
        return f"{self.quantity} {self.on}{place} {axis}"

    @property
    def unit(self) -> str:
        """Unit of the signal."""
        return (KINDS[self.quantity] if self.gain is None else VOLTAGE).unit


class Instrument(SceneTable):
    """The instrument that records all sensors at once; `seed` is that of the noise of computed
    records."""

    sampling: of(Positive, FREQUENCY, 1e3, 1e9) = 1e6  # [Hz] of all channels
    bits: Annotated[int, Field(ge=2, le=24)] | None = None  # of the converter, over -range to range
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0  # of the noise of computed records


class Output(SceneTable):
    """Spheres observed (1 = striker), how many instants are written, and what sensors show."""

    # numbers of the spheres whose waves are reported
    spheres: Annotated[tuple[Count, ...], Field(strict=False)] = ()
    # number of instants that are kept, over the duration
    samples: Annotated[int, Field(ge=2, le=1_000_000)] = 3001
    sensors: Annotated[tuple[SensorTable, ...], Field(strict=False, min_length=1)] | None = None
    instrument: Instrument | None = None


def low_pass_of(sensor: SensorTable, reduction: Reduction | None) -> float | None:
    """[Hz] of a sensor's filter: one on the structure shows no more than the reduced model's
    band."""
    if sensor.low_pass or sensor.on is None:
        return sensor.low_pass
    # low pass of a sensor on the structure, at half of the frequency up to which a reduced model
    # holds: a block of 6 cm to 25 kHz then shows accelerations to 1e-3, under a band to 25 kHz to
    # 1e-2
    return 0.5 * ((reduction and reduction.to_hz) or TO_HZ)
