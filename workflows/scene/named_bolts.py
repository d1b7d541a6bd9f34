"""Bolts that a scene may name, `bolt = "M8-8.8"` or `"1/2-13 grade 5"`.

Hexagon bolts with a nut and one washer under it: metric ones with the pitch of ISO 261 (coarse
without one in the name, "M8x1-8.8" is fine), heads of ISO 4014, nuts of ISO 4032, washers of ISO
7089, strengths of ISO 898-1 and ISO 3506-1; inch ones with threads of ASME B1.1, heads of
B18.2.1, nuts of B18.2.2, strengths of SAE J429, and no washer.
"""

from math import pi
from re import fullmatch
from typing import NamedTuple

MM, INCH, KSI = 1e-3, 0.0254, 6.894757e6
BEARING = 1.5  # diameter of the face under a head over that of the bolt: Shigley (2015), sec. 8-5


class NamedBolt(NamedTuple):
    """Numbers of a bolt, its nut and washer; those of `fem.Bolt`, and in this order."""

    diameter: float  # [m] of the shank
    pitch: float  # [m]
    stress_area: float  # [m^2] of the thread
    bearing: float  # [m] diameter of the face under the head
    head_height: float  # [m]
    across_flats: float  # [m]
    nut_height: float  # [m]
    washer: tuple[float, float]  # [m] outer diameter and thickness; 0 without one
    proof_stress: float  # [Pa]
    young: float  # [Pa]
    density: float  # [kg/m^3]
    length_step: float  # [m] of the lengths that are sold
    thread: tuple[float, float, float]  # [m] length of the thread; up to which length; beyond it

    @property
    def proof_load(self) -> float:
        """[N] up to which it keeps its length."""
        return self.proof_stress * self.stress_area


# mm: coarse pitch, across flats, height of head and of nut, outer diameter and thickness of washer
METRIC = {
    3: (0.5, 5.5, 2.0, 2.4, 7, 0.5), 4: (0.7, 7, 2.8, 3.2, 9, 0.8), 5: (0.8, 8, 3.5, 4.7, 10, 1),
    6: (1.0, 10, 4.0, 5.2, 12, 1.6), 8: (1.25, 13, 5.3, 6.8, 16, 1.6),
    10: (1.5, 16, 6.4, 8.4, 20, 2), 12: (1.75, 18, 7.5, 10.8, 24, 2.5),
    14: (2.0, 21, 8.8, 12.8, 28, 2.5), 16: (2.0, 24, 10.0, 14.8, 30, 3),
    18: (2.5, 27, 11.5, 15.8, 34, 3), 20: (2.5, 30, 12.5, 18.0, 37, 3),
    22: (2.5, 34, 14.0, 19.4, 39, 3), 24: (3.0, 36, 15.0, 21.5, 44, 4),
    27: (3.0, 41, 17.0, 23.8, 50, 4), 30: (3.5, 46, 18.7, 25.6, 56, 4),
    36: (4.0, 55, 22.5, 31.0, 66, 5),
}  # fmt: skip
# proof stress [MPa] up to M16 and above, Young's modulus [GPa], density
CLASSES = {
    "4.6": (225, 225, 210, 7850), "4.8": (310, 310, 210, 7850), "5.6": (280, 280, 210, 7850),
    "5.8": (380, 380, 210, 7850), "6.8": (440, 440, 210, 7850), "8.8": (580, 600, 210, 7850),
    "10.9": (830, 830, 210, 7850), "12.9": (970, 970, 210, 7850),
    "A2-50": (210, 210, 200, 7900), "A2-70": (450, 450, 200, 7900), "A2-80": (600, 600, 200, 7900),
    "A4-50": (210, 210, 200, 8000), "A4-70": (450, 450, 200, 8000), "A4-80": (600, 600, 200, 8000),
}  # fmt: skip
# inches: threads per inch, coarse and fine, across flats, height of head and of nut
INCHES = {
    "1/4": (20, 28, 7 / 16, 5 / 32, 7 / 32), "5/16": (18, 24, 1 / 2, 13 / 64, 17 / 64),
    "3/8": (16, 24, 9 / 16, 15 / 64, 21 / 64), "7/16": (14, 20, 5 / 8, 9 / 32, 3 / 8),
    "1/2": (13, 20, 3 / 4, 5 / 16, 7 / 16), "9/16": (12, 18, 13 / 16, 23 / 64, 31 / 64),
    "5/8": (11, 18, 15 / 16, 25 / 64, 35 / 64), "3/4": (10, 16, 9 / 8, 15 / 32, 41 / 64),
    "7/8": (9, 14, 21 / 16, 35 / 64, 3 / 4), "1": (8, 12, 3 / 2, 39 / 64, 55 / 64),
}  # fmt: skip
GRADES = {"2": (55, 33), "5": (85, 85), "8": (120, 120)}  # ksi: proof up to 3/4 inch and above


def stress_area(d: float, pitch: float, factor: float = 0.9382) -> float:
    """[m^2] of a thread: pi / 4 (d - 0.9382 p)^2 of ISO 898-1, 9.1.6.1; with 0.9743 of ASME
    B1.1."""
    return pi / 4 * (d - factor * pitch) ** 2


def named_bolt(name: str) -> NamedBolt:
    """The bolt of a name; raises ValueError, with what there is, for one that is not known."""
    word = name.strip().replace(" ", "")
    metric = fullmatch(r"[Mm](\d+)(?:[xX](\d+(?:\.\d+)?))?-(\S+)", word)
    inch = fullmatch(r"(\d+/\d+|1)-(\d+)(?:UN[CF])?-?(?:[Gg]rade)?(\d)", word)
    if metric:
        size, pitch, grade = int(metric[1]), metric[2], metric[3].upper()
        if size not in METRIC:
            raise ValueError(f"{name!r}: there are M{', M'.join(map(str, METRIC))}; take one")
        if grade not in CLASSES:
            raise ValueError(f"{name!r}: strengths are {', '.join(CLASSES)}; take one of them")
        coarse, flats, head, nut, *washer = METRIC[size]
        thread = float(pitch) if pitch else coarse
        if not 0.1 * coarse <= thread <= coarse:
            raise ValueError(f"{name!r}: its pitch is at most that of M{size}, {coarse:g} mm")
        small, large, young, density = CLASSES[grade]
        return NamedBolt(
            size * MM, thread * MM, stress_area(size * MM, thread * MM),
            BEARING * size * MM, head * MM, flats * MM, nut * MM,
            (washer[0] * MM, washer[1] * MM), (small if size <= 16 else large) * 1e6,
            young * 1e9, density, 5 * MM, ((2 * size + 6) * MM, 125 * MM, (2 * size + 12) * MM),
        )  # fmt: skip
    if inch:
        size, per_inch, grade = inch[1], int(inch[2]), inch[3]
        if size not in INCHES or grade not in GRADES or per_inch not in INCHES[size][:2]:
            threads = ", ".join(f"{key}-{n}" for key, row in INCHES.items() for n in row[:2])
            raise ValueError(
                f"{name!r}: there are {threads}, of grade {', '.join(GRADES)}; take one, as "
                '"1/2-13 grade 5"'
            )
        _, _, flats, head, nut = INCHES[size]
        numerator, _, denominator = size.partition("/")
        d = int(numerator) / int(denominator or 1)
        proof = GRADES[grade][0 if d <= 0.75 else 1] * KSI
        return NamedBolt(
            d * INCH, INCH / per_inch, stress_area(d * INCH, INCH / per_inch, 0.9743),
            BEARING * d * INCH, head * INCH, flats * INCH, nut * INCH,
            (0.0, 0.0), proof, 207e9, 7850.0, INCH / 4,
            ((2 * d + 0.25) * INCH, 6 * INCH, (2 * d + 0.5) * INCH),
        )  # fmt: skip
    raise ValueError(
        f'{name!r} is not the name of a bolt: write a size and a strength, as "M8-8.8", '
        '"M8x1-10.9", "M8-A2-70" or "1/2-13 grade 5", or give its numbers'
    )
