"""Records of chains that users measured: velocities, or signals of any sensors as `beadwave impact`
writes them, in .csv, .mat and universal files (`workflows.files.record_formats`).

    time [us], sphere 9 force [mN], sphere 9 force [mN], sphere 4 velocity [mm/s]

Of several chains a column names the one, as `below sphere 4 force [N]`.
The quantity is force, force-rate, velocity or displacement; [V] or [mV] is a voltage whose gain the
scene's sensor says, or that nobody knows. Columns that come twice are repeats: they are laid over
each other and averaged. A column without a quantity is what its unit measures, in volts a velocity.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from re import fullmatch

import numpy as np
from numpy.typing import NDArray

from beadwave.coupling.band import Band
from beadwave.coupling.errors import CouplingError
from beadwave.coupling.sensors import Sensor
from beadwave.dem import InvalidChain, NoEquilibrium
from beadwave.workflows.files.foreign import arrays
from beadwave.workflows.files.record import (
    LEAST_SAMPLES,
    SYNTHETIC,
    Channel,
    MeanRecord,
    Record,
    UnusableRecord,
    stacked,
)
from beadwave.workflows.files.record_formats import (
    Found,
    of_data_sets,
    of_mat,
    of_table,
    require_whole,
    text_of,
)
from beadwave.workflows.files.signal_table import even_step, signal_table
from beadwave.workflows.files.uff import ENDINGS, data_sets
from beadwave.workflows.fit.aligned_signals import aligned
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.scene.named_files import require_file
from beadwave.workflows.scene.tables.sensors import OF_SPHERES
from beadwave.workflows.scene.units import VOLTAGE, NoSuchQuantity, in_si

SAME_INSTANT = 0.1  # of a sample, to which samples of one trigger and one sampling agree
HEADING = r"(?:(\S+)\s+)?sphere\s+(\d+)(?:\s+([a-z-]+))?\s*\[(.+)\]"


@contextmanager
def usable() -> Iterator[None]:
    """A record that cannot be what it says raised as InvalidScene."""
    try:
        yield
    except UnusableRecord as error:
        raise InvalidScene(str(error)) from None


@contextmanager
def marched(name: str) -> Iterator[None]:
    """Raise InvalidScene for what cannot be marched of a scene or file of this name."""
    try:
        yield
    except (CouplingError, InvalidChain, NoEquilibrium) as reason:
        raise InvalidScene(f"{name}: {str(reason).rstrip('.')}.") from None


def files_of_strike(data: str | Path) -> tuple[Path, ...]:
    """The file of a strike, or the files whose names are joined by +. Raises InvalidScene for an
    empty name."""
    if Path(data).exists():  # a name may hold a +
        return (Path(data),)
    names = str(data).split("+")
    if not all(names):
        raise InvalidScene(
            f"{str(data)!r} joins files by +, one of them has no name; give file+file."
        )
    return tuple(Path(name) for name in names)


def recorded(*files: Path) -> MeanRecord:
    """The signals of one strike, in a file or in several of one trigger and one sampling. Raises
    InvalidScene for files that hold none that can be used, or that do not belong together."""
    t, channels, y, title = _channels(files[0])
    for path in files[1:]:
        t_of, channels_of, y_of, title_of = _channels(path)
        k = min(len(t), len(t_of))
        if np.abs(t_of[:k] - t[:k]).max() > SAME_INSTANT * (t[1] - t[0]):
            raise InvalidScene(
                f"{files[0]} starts at {t[0]:g} s with a sample every {t[1] - t[0]:g} s, {path} at "
                f"{t_of[0]:g} s with one every {t_of[1] - t_of[0]:g} s; give records of one "
                "trigger and one sampling."
            )
        if len(y_of) != len(y):
            raise InvalidScene(
                f"{files[0]} has {len(y)} repeats, {path} has {len(y_of)}; give as many of each."
            )
        if twice := set(channels) & set(channels_of):
            raise InvalidScene(
                f"{files[0]} and {path} both have {min(twice).name}; leave it out of one of them."
            )
        t, y = t[:k], np.concatenate([y[:, :k], y_of[:, :k]], axis=2)
        channels, title = channels + channels_of, f"{title} {title_of}"

    repeats = aligned(t, y, tuple(range(len(channels))))
    name = "+".join(path.name for path in files)
    if repeats.outliers:
        raise InvalidScene(
            f"{name}: repeat {repeats.outliers[0] + 1} is unlike the others; leave it out."
        )
    mean = repeats.signals
    return MeanRecord(t, mean.v, channels, mean.spread, mean.repeats, name, SYNTHETIC in title)


def measured(path: Path) -> Record:
    """Velocities or signals of any sensors on one chain, all repeats; raises InvalidScene."""
    t, channels, y, title = _channels(path)
    if of_chain := next((channel for channel in channels if channel.chain), None):
        raise InvalidScene(
            f"{path}: {of_chain.name} is of one of several chains, the scene has one; write sphere "
            f"{of_chain.sphere} {of_chain.quantity}."
        )
    spheres = tuple(channel.sphere for channel in channels)
    are_velocities = all(c.quantity == "velocity" and not c.in_volts for c in channels)
    return Record(t, y, spheres, title, None if are_velocities else channels)


def _channels(
    path: Path,
) -> tuple[NDArray[np.float64], tuple[Channel, ...], NDArray[np.float64], str]:
    """t (k,) [s], channels, values (r, k, m) and title of a file; raises InvalidScene for a column
    that never changes."""
    ending = path.suffix.lower()
    *first, last = READERS
    endings = f"{', '.join(first)} or {last}"
    if ending not in READERS:
        raise InvalidScene(f"{path} must end in {endings}.")
    require_file(path, f"give a record as {endings}")
    with refused(path):
        t, columns, title = READERS[ending](path)
        dt = even_step(t, LEAST_SAMPLES)
        t = np.linspace(t[0], t[0] + dt * (len(t) - 1), len(t))
        channels, y = stacked(t, columns)
    for i, channel in enumerate(channels):
        is_still = np.ptp(y[:, :, i], axis=1) == 0.0
        if is_still.any():
            raise InvalidScene(
                f"{path}: {channel.name} is {y[is_still.argmax(), 0, i]:.3g} at every sample, no "
                "wave is in it; leave the column out or record it again."
            )
    return t, channels, y, title or path.stem


def _csv_columns(path: Path) -> Found:
    return of_table(signal_table(path), _channel)


def _mat_columns(path: Path) -> Found:
    """Times and columns of a .mat file, all of one quantity and unit: y with `quantity` and `unit`,
    or the velocities v with `velocity_unit`."""
    needed = ("t", "y", "spheres", "time_unit", "quantity", "unit")
    fields = arrays("matlab", path, *needed, "v", "velocity_unit", "title")
    name, quantity, unit = "y", text_of(fields, "quantity"), text_of(fields, "unit")
    if "quantity" not in fields:
        needed = ("t", "v", "spheres", "time_unit", "velocity_unit")
        name, quantity, unit = "v", "velocity", text_of(fields, "velocity_unit")
    for key in needed:
        if key not in fields:
            raise ValueError(f"there is no variable {key}, which states what is in the file")
    t, columns, title = of_mat(fields, name)
    in_si_units = []
    for n, y in columns:
        channel, factor = _channel(f"sphere {n} {quantity} [{unit}]")
        in_si_units.append((channel, factor * y))
    return Found(t, in_si_units, title)


def _uff_columns(path: Path) -> Found:
    require_whole(path.read_bytes())
    return of_data_sets(data_sets(path, 58), _channel)


READERS = {".csv": _csv_columns, ".mat": _mat_columns, **dict.fromkeys(ENDINGS, _uff_columns)}


def _channel(name: str) -> tuple[Channel, float]:
    """The channel of a heading, as "sphere 9 force [mN]", and the factor of its unit to SI; raises
    ValueError. Without a quantity it is the first that has the unit, velocity before the others."""
    heading = fullmatch(HEADING, name)
    if not heading or (heading[3] or "velocity") not in OF_SPHERES:
        raise ValueError(
            f"a column is {name[:40]!r}, allowed is 'sphere 9 force [mN]', with its unit; the "
            f"quantity is one of {', '.join(OF_SPHERES)}"
        )
    chain, sphere, unit = heading[1] or "", int(heading[2]), heading[4].strip()
    for quantity in (heading[3],) if heading[3] else ("velocity", *OF_SPHERES):
        for in_volts, kind in enumerate((OF_SPHERES[quantity], VOLTAGE)):
            try:
                factor = in_si(f"1 {unit}", kind)
            except NoSuchQuantity:
                continue
            return Channel(sphere, quantity, bool(in_volts), chain), factor
    quantity = heading[3] or "velocity"
    units = ", ".join((OF_SPHERES[quantity].unit, *OF_SPHERES[quantity].others, "V", "mV"))
    raise ValueError(f"the unit of sphere {sphere}'s {quantity} is {unit!r}, allowed are {units}")


def sensor_of(scene: Scene, channel: Channel) -> tuple[Sensor, str | None]:
    """The sensor of a channel, with band and gain of the scene's sensor of that sphere and
    quantity; and the name of its gain where nobody knows it. Raises InvalidScene for a chain or a
    sphere that the scene does not have."""
    chains = [row.name for row in scene.chains or ()]
    if channel.chain not in (chains or [""]):
        named = f"the scene has {', '.join(chains)}" if chains else "the scene has one chain"
        raise InvalidScene(
            f"the data has {channel.name!r}, {named}; name a column's chain before its sphere, if "
            "there are several, and correct header or scene."
        )
    place = chains.index(channel.chain) if chains else 0
    count = scene.chains[place].count if chains else scene.chain.count
    if not 1 <= channel.sphere <= count:
        key = f"chains.{channel.chain}.count" if chains else "chain.count"
        raise InvalidScene(
            f"the data has sphere {channel.sphere}, allowed are 1 to {key} = {count}; correct its "
            "header or the scene."
        )
    wanted = channel.sphere, channel.quantity, channel.chain or None
    table = next(
        (sensor for sensor in scene.output.sensors or ()
         if (sensor.sphere, sensor.quantity, sensor.chain) == wanted), None,
    )  # fmt: skip
    band = Band(table.low_pass, table.high_pass, table.order) if table else Band()
    sensor = Sensor(channel.sphere - 1, channel.quantity, band=band, chain=place)
    if not channel.in_volts:
        return sensor, None
    gain = table.gain if table else None
    if isinstance(gain, float):
        return sensor._replace(gain=gain), None
    return sensor, gain or channel.name


@contextmanager
def refused(path: Path) -> Iterator[None]:
    """Errors of reading a file raised as InvalidScene, in one sentence with its path."""
    try:
        yield
    except InvalidScene:
        raise
    except UnicodeDecodeError:
        raise InvalidScene(f"{path} is no text in UTF-8; save it as such.") from None
    except (ValueError, KeyError, IndexError, TypeError, OSError) as error:
        raise InvalidScene(f"{path}: {str(error).rstrip('.')}; correct the file.") from None
