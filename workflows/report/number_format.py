"""Numbers as a person reads them: SI prefixes, percent, three digits."""

from math import floor, isfinite, log10

PREFIXES = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
PLAIN = ("kg", "1/", "s/m", "m^", "°")  # units that bear no prefix here
NONE = "-"
GLUE = "\u00a0"  # keeps a unit on the line of its number


def digits(value: float, n: int = 3) -> str:
    r"""n significant digits, without a power of ten where that is short.

    >>> digits(0.0127), digits(49062.0), digits(2.9e-8)
    ('0.0127', '49\u202f100', '2.9e-08')
    """
    if value == 0:
        return "0"
    if 10.0**n <= abs(value) < 1e7:
        return grouped(round(value, n - 1 - floor(log10(abs(value)))))
    text = f"{value:.{n}g}"
    return text if "e" in text or "." not in text else text.rstrip("0").rstrip(".")


def figures(value: float, n: int = 4) -> str:
    r"""n significant figures, zeros too, for a column that names the unit.

    >>> figures(51.0), figures(1160.22), figures(12641.1)
    ('51.00', '1160', '12\u202f641')
    """
    return grouped(value) if abs(value) >= 10.0**n - 0.5 else f"{value:#.{n}g}".rstrip(".")


def supported(value: float, deviation: float) -> float:
    """A fitted value to two digits beyond the first one of its deviation, and to four at least;
    where the deviation is not known, to four.

    >>> supported(35133923.98926383, 4.6e5), supported(0.0499998, 1e-6), supported(31.41592, 99.0)
    (35134000.0, 0.0499998, 31.42)
    """
    if not value or not isfinite(value):
        return value
    last = floor(log10(abs(value))) - 3
    if deviation > 0 and isfinite(deviation):
        last = min(last, floor(log10(deviation)) - 2)
    return float(f"{value:.{max(floor(log10(abs(value))) - last, 0)}e}")


def grouped(value: float) -> str:
    """A whole number in groups of three digits."""
    return f"{value:,.0f}".replace(",", "\u202f")


def si(value: float | None, unit: str, n: int = 3) -> str:
    r"""A value with a prefix that leaves 1 to 1000 before its unit.

    >>> si(0.0127, "m"), si(2.1e11, "Pa"), si(2.047e-8, "m/N"), si(0.134, "kg")
    ('12.7\xa0mm', '210\xa0GPa', '20.5\xa0nm/N', '134\xa0g')
    """
    if value is None or not isfinite(value):
        return NONE if value is None or value != value else f"∞{GLUE}{unit}"
    if unit == "kg" and 0 < abs(value) < 1:
        value, unit = 1e3 * value, "g"
    if value == 0 or unit.startswith(PLAIN) or unit in ("", "g"):
        return f"{digits(value, n)}{GLUE}{unit}".rstrip()
    power = 3 * floor(floor(log10(abs(float(f"{value:.{n - 1}e}")))) / 3)
    power = min(max(power, min(PREFIXES)), max(PREFIXES))
    return f"{digits(value / 10.0**power, n)}{GLUE}{PREFIXES[power]}{unit}"


def percent(value: float | None, n: int = 3) -> str:
    r"""A share in percent, small ones in millionths.

    >>> percent(0.008809), percent(2.91e-8, 2), percent(1e-15)
    ('0.881\xa0%', '0.029\xa0ppm', '<\xa00.001\xa0ppm')
    """
    if value is None or not isfinite(value):
        return NONE
    if 0 < abs(value) < 1e-5:
        return (
            f"{digits(1e6 * value, n)}{GLUE}ppm" if abs(value) >= 1e-9 else f"<{GLUE}0.001{GLUE}ppm"
        )
    return f"{digits(100 * value, n)}{GLUE}%"


def difference(value: float) -> str:
    r"""A relative difference in percent with its sign.

    >>> difference(-2.4e-4), difference(0.0)
    ('-0.024\xa0%', '0\xa0%')
    """
    return f"{'+' * (value > 0)}{percent(value, 2)}"


def share_percent(value: float) -> str:
    """A share in whole percent, nothing below half of one."""
    return f"{100 * value:.0f}{GLUE}%" if value >= 0.005 else ""
