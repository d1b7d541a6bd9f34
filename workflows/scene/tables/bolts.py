"""Keys of [[joints]] by which a bolt is known from its drawing."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from beadwave.workflows.scene.named_bolts import BEARING, NamedBolt, named_bolt, stress_area
from beadwave.workflows.scene.quantities import of
from beadwave.workflows.scene.scene_table import (
    Density,
    Number,
    Positive,
    SceneTable,
    Spring,
    TurnSpring,
    text_or_table,
)
from beadwave.workflows.scene.tables.joints import JointStiffnesses
from beadwave.workflows.scene.units import FORCE, LENGTH, PRESSURE, TORQUE

TORQUE_FACTOR = 0.2  # K of T = K F d: dry, unplated threads; Shigley (2015), table 8-15
ADVISED_UTILISATION = 0.9  # preload over proof load, of permanent joints; Shigley (2015), eq. 8-31
# proof loads that no bolt bears: of A2-50, the softest that can be named, 500 MPa over 210 MPa
BREAKING_UTILISATION = 2.4
RMS = 1.25  # rms over Ra of heights with Gauss' distribution: sqrt(pi / 2)
CONTACT = "contact"
SPRINGS = ("kx", "ky", "kz", "krx", "kry", "krz")
OF_FACES = ("friction", "roughness", "flatness", "model")
OF_BOLT = ("preload", "torque", "torque_deviation", *OF_FACES)
Size = of(Positive, LENGTH, 1e-3, 0.2)
Height = of(Positive, LENGTH, 1e-9, 1e-3)


class BoltTable(SceneTable):
    """A bolt by its numbers, with a nut; lengths not given are those usual of its diameter."""

    diameter: Size  # [m] of the shank
    pitch: of(Positive, LENGTH, 1e-4, 1e-2)  # [m] of the thread
    proof_stress: of(Positive, PRESSURE, 1e7, 3e9)  # [Pa] up to which it keeps its length
    # [m] diameter of the face under the head; 1.5 times the diameter
    bearing: Size | None = None
    across_flats: Size | None = None  # [m] of head and nut; 1.6 times the diameter
    head_height: Size | None = None  # [m]; 0.65 times the diameter
    nut_height: Size | None = None  # [m]; 0.85 times the diameter
    young: of(Positive, PRESSURE, 1e9, 1e12) = 210e9  # [Pa] of the bolt
    density: Density = 7850.0  # [kg/m^3] of the bolt

    @property
    def numbers(self) -> NamedBolt:
        """With the lengths that it does not give."""
        d = self.diameter
        return NamedBolt(
            d, self.pitch, stress_area(d, self.pitch), self.bearing or BEARING * d,
            self.head_height or 0.65 * d, self.across_flats or 1.6 * d,
            self.nut_height or 0.85 * d, (0.0, 0.0), self.proof_stress, self.young,
            self.density, 5e-3,
            (2 * d + 6e-3, 0.125, 2 * d + 12e-3),
        )  # fmt: skip

    @model_validator(mode="after")
    def _of_one_size(self) -> "BoltTable":
        """A thread finer than its bolt, and a head wider than it."""
        if not self.pitch < self.diameter / 2:
            raise ValueError(
                f"pitch = {self.pitch:g} m must be below half the diameter, {self.diameter / 2:g} "
                "m: change it"
            )
        if self.bearing is not None and not self.bearing > self.diameter:
            raise ValueError(
                f"bearing = {self.bearing:g} m must be above the diameter, {self.diameter:g} m: "
                "give the diameter of the face under the head"
            )
        return self


class Roughness(SceneTable):
    """Roughness of each of the two faces, as drawings give it (Ra) or as rms of the heights."""

    Ra: Height | None = None  # [m] mean roughness of each face
    rms: Height | None = None  # [m] root of the mean square of its heights, in place of Ra

    @model_validator(mode="after")
    def _one_measure(self) -> "Roughness":
        if (self.Ra is None) == (self.rms is None):
            raise ValueError('needs Ra or rms: give one of them, as Ra = "1.6 um"')
        return self

    @property
    def of_both(self) -> float:
        """[m] rms of the heights of both faces together."""
        return 2**0.5 * (RMS * self.Ra if self.rms is None else self.rms)


EitherBolt = Annotated[
    Annotated[str, Tag("text")] | Annotated[BoltTable, Tag("table")], Discriminator(text_or_table)
]


class FromDrawing(JointStiffnesses):
    """Springs of a joint, from its bolt where one is named: then those that are not listed follow
    from the drawing."""

    kx: Spring | None = float("inf")  # [N/m] along x of its axes
    ky: Spring | None = float("inf")  # [N/m] along y of its axes
    # [N/m] along z of its axes: in [[joints]] along the bolt, see frame; of the rig vertical
    kz: Spring | None = float("inf")
    krx: TurnSpring | None = float("inf")  # [N m/rad] about x of its axes
    kry: TurnSpring | None = float("inf")  # [N m/rad] about y of its axes
    krz: TurnSpring | None = float("inf")  # [N m/rad] about z of its axes
    # "M8-8.8", "M8x1-10.9", "1/2-13 grade 5", or its numbers; springs that are not listed follow
    bolt: EitherBolt | None = None
    preload: of(Positive, FORCE, 1, 1e7) | None = None  # [N] in the bolt
    # [N m] in place of the preload F: T = 0.2 F d of dry, unplated threads
    torque: of(Positive, TORQUE, 0.01, 1e5) | None = None
    # relative standard deviation of the preload that a torque leaves; 0.15
    torque_deviation: Annotated[float, Field(ge=0, le=1)] | None = None
    friction: Annotated[float, Field(ge=0, le=2)] | None = None  # of the faces; 0.15
    roughness: Roughness | None = None  # of each face; without it they are hard and smooth
    # [m] height of the crown that both faces in contact have together: > 0 they touch in their
    # middle first, < 0 at their rim; without it they are plane
    flatness: of(Annotated[Number, Field(ge=-0.01, le=0.01)], LENGTH, -1e-3, 1e-3) | None = None
    # of the joint: "springs" by formula, or "contact" of the faces under the preload, or without a
    # bolt under other bolts and [[loads]]; springs
    model: Literal["springs", "contact"] | None = None

    @model_validator(mode="before")
    @classmethod
    def _springs_of_the_bolt(cls, table: Any) -> Any:
        """With a bolt, and of faces in contact, there is no spring that is rigid because nothing is
        said of it."""
        if isinstance(table, Mapping) and (
            table.get("bolt") is not None or table.get("model") == CONTACT
        ):
            return {**dict.fromkeys(SPRINGS), **table}
        return table

    @model_validator(mode="after")
    def _bolt_and_preload(self) -> "FromDrawing":
        """A bolt that is known, and one measure of its preload."""
        given = [key for key in OF_BOLT if getattr(self, key) is not None]
        springs = [key for key in SPRINGS if getattr(self, key) is not None]
        springs += [f"c{key[1:]}" for key in self.dashpots]
        if self.model == CONTACT and springs:
            raise ValueError(
                f'{" and ".join(springs)} belong to springs, model = "contact" has none: drop one '
                "of them"
            )
        if self.bolt is None:
            # faces in contact may be pressed by other bolts and by loads
            of_bolt = [key for key in given if self.model != CONTACT or key not in OF_FACES]
            if of_bolt:
                raise ValueError(
                    f'{" and ".join(of_bolt)} belong to a bolt: add bolt = "M8-8.8", or drop them'
                )
            return self
        if isinstance(self.bolt, str):
            named_bolt(self.bolt)
        if self.preload is not None and self.torque is not None:
            raise ValueError("preload and torque exclude each other: keep one of them")
        if self.preload is None and self.torque is None:
            raise ValueError("bolt needs its preload in N, or its torque in N m: add one of them")
        if self.flatness is not None and self.model != CONTACT:
            raise ValueError(
                'flatness is that of faces in contact: add model = "contact", or drop it'
            )
        if self.torque_deviation is not None and self.torque is None:
            raise ValueError("torque_deviation is that of a torque: give torque, or drop it")
        return self

    @property
    def fastener(self) -> NamedBolt | None:
        """Numbers of the bolt; None without one."""
        if isinstance(self.bolt, str):
            return named_bolt(self.bolt)
        return self.bolt and self.bolt.numbers

    @property
    def tension(self) -> float:
        """[N] of its bolt: the preload, or F = T / (K d) of a torque."""
        if self.preload is not None:
            return self.preload
        return self.torque / (TORQUE_FACTOR * self.fastener.diameter)

    @property
    def utilisation(self) -> float:
        """Tension of its bolt over the proof load."""
        return self.tension / self.fastener.proof_load

    @property
    def bolt_name(self) -> str | None:
        """The bolt in a word."""
        if isinstance(self.bolt, BoltTable):
            return f"{1e3 * self.bolt.diameter:g} mm"
        return self.bolt
