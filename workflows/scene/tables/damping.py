"""[damping]: that of the modes of a reduced wall."""

from typing import Annotated, Literal

from pydantic import Discriminator, Field, model_validator

from beadwave.workflows.scene.quantities import of
from beadwave.workflows.scene.scene_table import (
    Frequency,
    NonNegative,
    Ratio,
    SceneTable,
    one_or_each,
)
from beadwave.workflows.scene.units import (
    RATE,
    TIME,
)


class ModalDampingTable(SceneTable):
    """A ratio for all modes, or one for each of the hammer test: others take the nearest one's."""

    kind: Literal["modal"]
    # modal damping ratio, of all modes or of each of the hammer test
    ratio: one_or_each(Ratio) = 0.0


class RayleighDampingTable(SceneTable):
    """C = alpha M + beta K, by its coefficients or by the ratios of two frequencies."""

    kind: Literal["rayleigh"]
    alpha: of(NonNegative, RATE) = 0.0  # [1/s] factor of M
    beta: of(NonNegative, TIME) = 0.0  # [s] factor of K
    # [Hz] two frequencies, in place of alpha and beta
    frequency: Annotated[tuple[Frequency, Frequency], Field(strict=False)] | None = None
    # damping ratios at these two frequencies
    ratio: Annotated[tuple[Ratio, Ratio], Field(strict=False)] | None = None

    @model_validator(mode="after")
    def _one_way(self) -> "RayleighDampingTable":
        if (self.frequency is None) != (self.ratio is None):
            raise ValueError("frequency and ratio belong together, two values each: add the other")
        if self.frequency and (self.alpha or self.beta):
            raise ValueError("alpha and beta follow from frequency and ratio: keep one of the two")
        return self


LossTable = dict[str, Ratio]


class LossFactorsTable(SceneTable):
    """Loss factors of parts: each mode is damped by half the mean of them over its strain energy
    (Ungar and Kerwin 1962). What is not named has none."""

    kind: Literal["loss"]
    materials: LossTable = Field({}, strict=False)  # loss factors of materials by their names
    joints: LossTable = Field({}, strict=False)  # loss factors of joints by their names
    springs: LossTable = Field(
        {}, strict=False
    )  # loss factors of springs between points by their names

    @property
    def factors(self) -> dict[str, float]:
        """All of them, as "joints.bolts"."""
        tables = {"materials": self.materials, "joints": self.joints, "springs": self.springs}
        return {f"{key}.{name}": x for key, table in tables.items() for name, x in table.items()}


class NoDamping(SceneTable):
    """An undamped wall."""

    kind: Literal["none"] = "none"


Damping = Annotated[
    ModalDampingTable | RayleighDampingTable | LossFactorsTable | NoDamping, Discriminator("kind")
]
