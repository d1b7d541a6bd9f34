"""Records of any sensors, as `beadwave impact` writes them: CSV with a quantity in each column.

    time [us], sphere 9 force [mN], sphere 9 force [mN], sphere 4 velocity [mm/s]

The quantity is force, force-rate, velocity or displacement; [V] or [mV] is a voltage whose gain the
scene's sensor says, or that nobody knows. Columns that come twice are repeats: they are laid over
each other and averaged. A column without a quantity is a velocity.
"""

from pathlib import Path
from re import fullmatch
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from coupling.calibration.signals import aligned
from workflows.files.velocities import SYNTHETIC, read_csv
from workflows.scene import InvalidScene
from workflows.scene.sensors import KINDS
from workflows.scene.units import VOLTAGE, NoSuchQuantity, in_si


class Channel(NamedTuple):
    """What a column holds."""

    sphere: int  # counted from 1
    quantity: str
    in_volts: bool

    @property
    def name(self) -> str:
        """As in the header of a file."""
        return f"sphere {self.sphere} {self.quantity}"


class Recorded(NamedTuple):
    """Mean signals y (k, m) of m channels at equal times t (k,) [s], in SI units."""

    t: NDArray[np.float64]
    y: NDArray[np.float64]
    channels: tuple[Channel, ...]
    spread: NDArray[np.float64]  # (m,) standard deviation of one repeat; nan of a single one
    repeats: int
    name: str
    synthetic: bool


def recorded(path: Path) -> Recorded:
    """The signals of a file; raises InvalidScene where it holds none that can be used."""
    t, channels, v, title = read_csv(path, _column)
    laid = aligned(t, v, tuple(range(len(channels))))
    if laid.outliers:
        raise InvalidScene(
            f"{path}: repeat {laid.outliers[0] + 1} is unlike the others; leave it out."
        )
    mean = laid.signals
    synthetic = SYNTHETIC in title
    return Recorded(t, mean.v, channels, mean.spread, mean.repeats, path.name, synthetic)


def _column(name: str) -> tuple[Channel, float]:
    found = fullmatch(r"sphere\s+(\d+)(?:\s+([a-z-]+))?\s*\[(.+)\]", name)
    if not found or (found[2] or "velocity") not in KINDS:
        raise ValueError(
            f"a column is {name[:40]!r}, allowed is 'sphere 9 force [mN]', with its unit; the "
            f"quantity is one of {', '.join(KINDS)}"
        )
    quantity, unit = found[2] or "velocity", found[3].strip()
    for in_volts, kind in enumerate((KINDS[quantity], VOLTAGE)):
        try:
            return Channel(int(found[1]), quantity, bool(in_volts)), in_si(f"1 {unit}", kind)
        except NoSuchQuantity:
            continue
    units = ", ".join((KINDS[quantity].unit, *KINDS[quantity].others, "V", "mV"))
    raise ValueError(f"the unit of {quantity} is {unit!r}, allowed are {units}")
