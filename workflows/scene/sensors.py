"""What a run writes: observed spheres, sensors on them, the instrument that records those."""

from re import fullmatch
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from workflows.scene.quantities import of
from workflows.scene.scene_table import Count, Frequency, Number, Positive, Ratio, SceneTable, si_of
from workflows.scene.units import (
    DISPLACEMENT,
    FORCE,
    FORCE_RATE,
    FREQUENCY,
    GAINS,
    VELOCITY,
    VOLTAGE,
)

KINDS = {
    "force": FORCE,
    "force-rate": FORCE_RATE,
    "velocity": VELOCITY,
    "displacement": DISPLACEMENT,
}
NAME = r"[A-Za-z][\w -]*"


class SensorTable(SceneTable):
    """What one channel shows of a sphere: the mean of its two contact forces, its rate, a velocity
    or a displacement; forces and displacements count from the state at the start.

    `gain` makes a voltage of it: a number in V per unit of the quantity, or a name for one that is
    not known, which sensors of the same name share. `noise` is of records that are computed.
    """

    sphere: Count  # number of the sphere that carries the sensor
    # what is measured
    quantity: Literal["force", "force-rate", "velocity", "displacement"] = "force"
    # [V/N], [V s/N], [V s/m] or [V/m]; or a name of one to be found
    gain: Number | str | None = None
    low_pass: Frequency | None = None  # [Hz] of a Butterworth filter
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
        """The quantity and its sphere."""
        return f"{self.quantity} {self.sphere}"

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
