"""Numbers with a unit, "1.2 mm" or "7.85 g/cm3", in SI.

A unit is a product of symbols with powers; a sign / divides by the one symbol after it. Angles and
voltages are dimensions of their own here: 60 rad/s is no frequency in Hz. Products are exact, "12.7
mm" is the number 0.0127.

No library of units is used, as it would accept scenes that are wrong. pint 0.25.3 was tried: an
angle has no dimension there, so that it takes "60 rad/s" for 60 Hz, a factor of 2 pi, and "1 J" for
a torque in N m/rad; "7.85 g/cm3" is unknown to it and "7.85 g/cm^3" becomes 7849.999999999999; it
reads "4 parsec", "Nm" (not as a newton metre) and "12 mm * 3", which are mistakes in a scene. Its
import takes 0.5 s of a core and its table of units 0.4 s, this module 0.03 s, in every command that
meets one "8 mm".
"""

from fractions import Fraction
from math import inf
from re import ASCII, compile, fullmatch
from typing import NamedTuple


class NoSuchQuantity(ValueError):
    """A sentence on a text that is no number with a unit, or one of another kind."""


class Unit(NamedTuple):
    """A factor to SI and the powers of metre, kilogram, second, radian and volt."""

    factor: Fraction
    powers: tuple[int, int, int, int, int]


class Kind(NamedTuple):
    """A physical quantity, its SI unit, and other units in use."""

    name: str
    unit: str
    others: tuple[str, ...] = ()


LENGTH = Kind("length", "m", ("mm", "um"))
DISPLACEMENT = LENGTH._replace(name="displacement")
MASS = Kind("mass", "kg", ("g",))
TIME = Kind("time", "s", ("ms", "us", "ns"))
FREQUENCY = Kind("frequency", "Hz", ("kHz",))
VELOCITY = Kind("velocity", "m/s", ("mm/s",))
ACCELERATION = Kind("acceleration", "m/s^2")
FORCE = Kind("force", "N", ("mN", "kN"))
IN_PLANE = Kind("force per width", "N/m", ("kN/m", "N/mm"))
PRESSURE = Kind("pressure", "Pa", ("GPa", "MPa"))
DENSITY = Kind("density", "kg/m^3", ("g/cm^3",))
STIFFNESS = Kind("stiffness", "N/m", ("N/mm",))
TURN_STIFFNESS = Kind("stiffness of a turn", "N m/rad")
TORQUE = Kind("torque", "N m", ("N mm",))
DASHPOT = Kind("dashpot", "N s/m", ("N s/mm",))
TURN_DASHPOT = Kind("dashpot of a turn", "N m s/rad")
COMPLIANCE = Kind("compliance", "m/N", ("mm/N",))
AREA = Kind("area", "m^2", ("mm^2", "cm^2"))
INERTIA = Kind("moment of inertia", "kg m^2", ("g mm^2", "kg mm^2"))
SECOND_MOMENT = Kind("second moment of area", "m^4", ("mm^4", "cm^4"))
RATE = Kind("rate", "1/s")
SLOWNESS = Kind("loss per velocity", "s/m")
FORCE_RATE = Kind("rate of a force", "N/s", ("N/us",))
VOLTAGE = Kind("voltage", "V", ("mV",))
GAINS = {
    "force": Kind("gain of a force", "V/N", ("mV/N",)),
    "force-rate": Kind("gain of a rate of a force", "V s/N", ("V us/N",)),
    "velocity": Kind("gain of a velocity", "V s/m", ("mV s/m",)),
    "displacement": Kind("gain of a displacement", "V/m", ("V/mm",)),
    "acceleration": Kind("gain of an acceleration", "V s^2/m", ("mV s^2/m",)),
}
KINDS = (
    LENGTH, MASS, TIME, FREQUENCY, VELOCITY, FORCE, PRESSURE, DENSITY, STIFFNESS, TURN_STIFFNESS,
    TORQUE, DASHPOT, TURN_DASHPOT, COMPLIANCE, SLOWNESS, FORCE_RATE, VOLTAGE, AREA, SECOND_MOMENT,
    ACCELERATION, INERTIA, *GAINS.values(),
)  # fmt: skip

PREFIXES = {"n": -9, "u": -6, "µ": -6, "μ": -6, "m": -3, "c": -2, "d": -1, "k": 3, "M": 6, "G": 9}
PREFIXED = {
    "m": Unit(Fraction(1), (1, 0, 0, 0, 0)),
    "g": Unit(Fraction(1, 1000), (0, 1, 0, 0, 0)),
    "s": Unit(Fraction(1), (0, 0, 1, 0, 0)),
    "rad": Unit(Fraction(1), (0, 0, 0, 1, 0)),
    "Hz": Unit(Fraction(1), (0, 0, -1, 0, 0)),
    "N": Unit(Fraction(1), (1, 1, -2, 0, 0)),
    "Pa": Unit(Fraction(1), (-1, 1, -2, 0, 0)),
    "J": Unit(Fraction(1), (2, 1, -2, 0, 0)),
    "V": Unit(Fraction(1), (0, 0, 0, 0, 1)),
    "bar": Unit(Fraction(10**5), (-1, 1, -2, 0, 0)),
}
POUND_FORCE = Fraction("4.4482216152605")
SYMBOLS = PREFIXED | {
    "t": Unit(Fraction(1000), (0, 1, 0, 0, 0)),
    "min": Unit(Fraction(60), (0, 0, 1, 0, 0)),
    "in": Unit(Fraction("0.0254"), (1, 0, 0, 0, 0)),
    "ft": Unit(Fraction("0.3048"), (1, 0, 0, 0, 0)),
    "lb": Unit(Fraction("0.45359237"), (0, 1, 0, 0, 0)),
    "lbf": Unit(POUND_FORCE, (1, 1, -2, 0, 0)),
    "psi": Unit(POUND_FORCE / Fraction("0.0254") ** 2, (-1, 1, -2, 0, 0)),
}
NUMBER = r"([+-]?(?:\d{1,40}(?:\.\d{0,40})?|\.\d{1,40})(?:[eE][+-]?\d{1,3})?)"
FACTOR = compile(r"\s*([*·/]?)\s*([A-Za-zµμ]+)(?:(?:\^|\*\*)?(-?[1-9]))?", ASCII)
SUPERSCRIPTS = str.maketrans("⁻¹²³⁴", "-1234")


def in_si(text: str, kind: Kind) -> float:
    """The number in SI; raises NoSuchQuantity with a sentence where the text is none of the kind.

    >>> in_si("12.7 mm", LENGTH), in_si("7.85 g/cm3", DENSITY)
    (0.0127, 7850.0)
    """
    shown = repr(text) if len(text) <= 40 else repr(text[:40] + "...")
    number_and_unit = fullmatch(rf"\s*{NUMBER}\s*(\S.{{0,40}})", text, ASCII)
    unit = number_and_unit and unit_of(number_and_unit[2].translate(SUPERSCRIPTS))
    if not unit:
        raise NoSuchQuantity(
            f"{shown} is no number with a unit that is known; write a number in "
            f"{kind.unit}, or one as '1 {(*kind.others, kind.unit)[0]}'"
        )

    # the dimension of the kind; N m is a stiffness of a turn as well as N m/rad is, but 1 rad/s is
    # not 1 Hz: an angle may be left out, not added
    needed = unit_of(kind.unit).powers
    without_angle = needed[3] != 0 == unit.powers[3] and needed[:3] == unit.powers[:3]
    if unit.powers != needed and not without_angle:
        names = (kind.name for kind in KINDS if unit_of(kind.unit).powers == unit.powers)
        raise NoSuchQuantity(
            f"{shown} is a {next(names, 'quantity of another kind')}, a {kind.name} is needed; "
            f"write it in {', '.join((kind.unit, *kind.others))} or the like"
        )
    value = Fraction(number_and_unit[1]) * unit.factor
    try:
        return float(value)
    except OverflowError:
        return inf if value > 0 else -inf


def number_of(text: str) -> str:
    """The number that a text begins with."""
    return compile(rf"\s*{NUMBER}", ASCII).match(text)[1]


def unit_of(text: str) -> Unit | None:
    """The unit that a text stands for, None where it holds an unknown symbol."""
    text = text.strip().removeprefix("1")
    factor, powers, position = Fraction(1), (0, 0, 0, 0, 0), 0
    while position < len(text):
        token = FACTOR.match(text, position)
        if token is None:
            return None
        sign, name, exponent = token.groups()

        # a symbol as it is, else a prefix and a symbol that takes prefixes
        symbol = SYMBOLS.get(name)
        if symbol is None:
            prefix, plain = PREFIXES.get(name[0]), PREFIXED.get(name[1:])
            if prefix is None or plain is None:
                return None
            symbol = plain._replace(factor=plain.factor * Fraction(10) ** prefix)

        power = int(exponent or 1) * (-1 if sign == "/" else 1)
        factor *= symbol.factor**power
        powers = tuple(p + power * q for p, q in zip(powers, symbol.powers, strict=True))
        position = token.end()
    return Unit(factor, powers)
