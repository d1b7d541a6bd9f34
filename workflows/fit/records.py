"""Records of any sensors, as `beadwave impact` writes them: CSV with a quantity in each column,
or .mat with y (k, m) or (k, m, repeats) and the texts quantity and unit, the rest as velocities, or
UFF58, where the label of the ordinate may name the quantity and its unit is needed.

    time [us], sphere 9 force [mN], sphere 9 force [mN], sphere 4 velocity [mm/s]

The quantity is force, force-rate, velocity or displacement; [V] or [mV] is a voltage whose gain the
scene's sensor says, or that nobody knows. Columns that come twice are repeats: they are laid over
each other and averaged. A column without a quantity is what its unit measures, in volts a velocity.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from re import fullmatch, split

import numpy as np

from coupling.band import Band
from coupling.sensors import Sensor
from workflows.files.foreign import arrays
from workflows.files.record import SYNTHETIC, Channel, Record, Recorded, UnusableRecord
from workflows.files.record_formats import Found, of_mat, text_of
from workflows.files.uff import ENDINGS
from workflows.fit.core.calibration.signals import aligned
from workflows.fit.velocities import (
    csv_columns,
    laid_out,
    record,
    told_of,
    uff_columns,
    variables,
)
from workflows.scene import InvalidScene, Scene
from workflows.scene.named_files import require_file
from workflows.scene.sensors import KINDS
from workflows.scene.units import VOLTAGE, NoSuchQuantity, in_si

HEADING = r"sphere\s+(\d+)(?:\s+([a-z-]+))?\s*\[(.+)\]"


@contextmanager
def usable() -> Iterator[None]:
    """A record that cannot be what it says raised as InvalidScene."""
    try:
        yield
    except UnusableRecord as error:
        raise InvalidScene(str(error)) from None


def recorded(path: Path) -> Recorded:
    """The signals of a file; raises InvalidScene where it holds none that can be used."""
    t, channels, v, title = _channels(path)
    laid = aligned(t, v, tuple(range(len(channels))))
    if laid.outliers:
        raise InvalidScene(
            f"{path}: repeat {laid.outliers[0] + 1} is unlike the others; leave it out."
        )
    mean = laid.signals
    synthetic = SYNTHETIC in title
    return Recorded(t, mean.v, channels, mean.spread, mean.repeats, path.name, synthetic)


def measured(path: Path) -> Record:
    """Velocities or signals of any sensors, all repeats; raises InvalidScene."""
    if path.suffix.lower() not in ENDINGS and not _holds_channels(path):
        return record(path)
    t, channels, y, title = _channels(path)
    if path.suffix.lower() in ENDINGS and not any(map(_is_no_velocity, channels)):
        return Record(t, y, tuple(c.sphere for c in channels), title)
    return Record(t, y, tuple(c.sphere for c in channels), title, channels)


def _channels(path: Path):
    """t, channels, values (r, k, m) and title of a file; raises InvalidScene for a column that
    shows nothing."""
    t, channels, y, title = _read(path)
    for i, channel in enumerate(channels):
        still = np.ptp(y[:, :, i], axis=1) == 0.0
        if still.any():
            raise InvalidScene(
                f"{path}: {channel.name} is {y[still.argmax(), 0, i]:.3g} at every sample, no wave "
                "is in it; leave the column out or record it again."
            )
    return t, channels, y, title


def _read(path: Path):
    """t, channels, values (r, k, m) and title of a file."""
    if path.suffix.lower() in ENDINGS:
        require_file(path, "give a record as .uff")
        return laid_out(path, partial(uff_columns, column=_column))
    if _is_mat(path):
        require_file(path, "give a record as .csv or .mat")
        return laid_out(path, _mat_columns)
    if path.suffix.lower() != ".csv":
        raise InvalidScene(f"{path} must end in .csv.")
    require_file(path, "give a record as .csv")
    return laid_out(path, partial(csv_columns, column=_column))


def _is_mat(path: Path) -> bool:
    return path.suffix.lower() == ".mat"


def _holds_channels(path: Path) -> bool:
    """Whether a file that there is holds anything but velocities."""
    if not path.is_file() or path.suffix.lower() not in (".csv", ".mat"):
        return False
    if _is_mat(path):
        with told_of(path):
            return "quantity" in arrays("matlab", path, "quantity")
    lines = path.read_bytes()[:100_000].decode("utf-8", "replace").splitlines()
    header = next((line for line in lines if line.strip() and not line.startswith("#")), "")
    return any(_is_channel(name.strip()) for name in split(r"[,;\t]", header))


def _is_channel(name: str) -> bool:
    found = fullmatch(HEADING, name)
    if not found or found[2]:
        return bool(found)
    try:
        channel, _ = _column(name)
    except ValueError:
        return False
    return _is_no_velocity(channel)


def _is_no_velocity(channel: Channel) -> bool:
    return channel.in_volts or channel.quantity != "velocity"


def _mat_columns(path: Path) -> Found:
    held = variables(path, ("t", "y", "spheres", "time_unit", "quantity", "unit"))
    quantity, unit = text_of(held, "quantity"), text_of(held, "unit")
    t, columns, title = of_mat(held, "y")
    named = [(*_column(f"sphere {n} {quantity} [{unit}]"), y) for n, y in columns]
    return Found(t, [(channel, scale * y) for channel, scale, y in named], title)


def _column(name: str) -> tuple[Channel, float]:
    found = fullmatch(HEADING, name)
    if not found or (found[2] or "velocity") not in KINDS:
        raise ValueError(
            f"a column is {name[:40]!r}, allowed is 'sphere 9 force [mN]', with its unit; the "
            f"quantity is one of {', '.join(KINDS)}"
        )
    unit = found[3].strip()
    for quantity in (found[2],) if found[2] else ("velocity", *KINDS):
        for in_volts, kind in enumerate((KINDS[quantity], VOLTAGE)):
            try:
                return Channel(int(found[1]), quantity, bool(in_volts)), in_si(f"1 {unit}", kind)
            except NoSuchQuantity:
                continue
    quantity = found[2] or "velocity"
    units = ", ".join((KINDS[quantity].unit, *KINDS[quantity].others, "V", "mV"))
    raise ValueError(f"the unit of {quantity} is {unit!r}, allowed are {units}")


def sensor_of(scene: Scene, channel: Channel) -> tuple[Sensor, str | None]:
    """What the model shows of a channel, and the name of its gain where nobody knows it."""
    if not 1 <= channel.sphere <= scene.chain.count:
        raise InvalidScene(
            f"the data has sphere {channel.sphere}, allowed are 1 to chain.count = "
            f"{scene.chain.count}; correct its header or the scene."
        )
    told = next(
        (one for one in scene.output.sensors or ()
         if (one.sphere, one.quantity) == (channel.sphere, channel.quantity)), None,
    )  # fmt: skip
    band = Band(told.low_pass, told.high_pass, told.order) if told else Band()
    gain = told.gain if told and channel.in_volts else None
    plain = Sensor(channel.sphere - 1, channel.quantity, band=band)
    if isinstance(gain, float):
        return plain._replace(gain=gain), None
    return plain, (gain or channel.name) if channel.in_volts else None
