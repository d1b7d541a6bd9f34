"""Time records of hammer tests from the content of CSV, MATLAB's .mat, UFF58 and WAV files.

CSV: lines that start with # are a title; then a header, and one line per sample:

    time [s], force 12+z [N], response 3+x [m/s^2], response 3-y [m/s^2]

A point is named by its node and direction, "12+z", as data sets 58 have them; "-" is against the
axis. A record without a force is a ring-down or of ambient vibration. A .mat file has dt or t,
force (k,) or (k, n) of n hits, response (k, m) or (k, m, n), and the texts points and sensors. In
UFF58 (function type 1) a channel measures a force if its ordinate is of type 13 or in N; channels
follow one another hit by hit. A WAV file has the force in the channel that is said.

A record may hold several hits: it is cut between them.
"""

from collections.abc import Sequence
from hashlib import blake2b
from pathlib import Path
from re import fullmatch
from typing import NamedTuple
from warnings import catch_warnings, filterwarnings, simplefilter

import numpy as np
from numpy.typing import NDArray

from beadwave.fem.identification.hits import Hits

AXES = ("", "x", "y", "z", "rx", "ry", "rz")  # of UFF58's directions 0 to 6
FORCE = 13  # UFF58's type of an excitation force
TIME_RESPONSE = 1  # UFF58's function type
QUANTITIES = {8: "displacements", 11: "velocities", 12: "accelerations"}  # UFF58's types
NEWTONS = {"N": 1.0, "kN": 1e3, "mN": 1e-3, "lbf": 4.4482216152605}
MOTIONS = {
    "": ("of no unit", 1.0), "V": ("voltages", 1.0), "m/s^2": ("accelerations", 1.0),
    "m/s2": ("accelerations", 1.0), "g": ("accelerations", 9.80665),
    "mm/s^2": ("accelerations", 1e-3), "m/s": ("velocities", 1.0), "mm/s": ("velocities", 1e-3),
    "m": ("displacements", 1.0), "mm": ("displacements", 1e-3), "um": ("displacements", 1e-6),
}  # fmt: skip
MOST = 1e60  # size of a sample, a frequency or a response, so that products are finite
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}


class TimeRecord(NamedTuple):
    """One record: a force, unless it is a ring-down or ambient, and m responses at k instants."""

    dt: float  # [s]
    force: NDArray[np.float64] | None  # (k,) [N]
    response: NDArray[np.float64]  # (m, k)
    point: str  # that was hit
    sensors: tuple[str, ...]  # (m,)
    title: str
    quantity: str = ""  # "accelerations", "velocities" or "displacements" where it is known


# Cutting of a record of several hits into records of one
PULSE_THRESHOLD = 0.2  # of the largest force, from which on a pulse is a hit
DOUBLE_HIT_TIME = 0.25  # [s] closer pulses are a double hit; rebounds follow in 5 to 50 ms
PRETRIGGER = 0.01  # [s] of a record before its pulse, at most
MIN_LENGTH = 0.5  # of the median length; what is left after a late hit is shorter


def degree_of_freedom(node: int, direction: int) -> str:
    """The name of a node's direction, "12+z" of 12 and 3, "12-z" of 12 and -3, "12" of 12 and 0."""
    sign = "" if direction == 0 else "-" if direction < 0 else "+"
    return f"{node}{sign}{AXES[abs(direction)]}"


def node_and_axis(name: str) -> tuple[int, int] | None:
    """Node and direction 1 to 3, negative against it, of a name "12+z"; None for another name."""
    match = fullmatch(r"(\d+)([+-])([xyz])", name)
    return match and (int(match[1]), AXES.index(match[3]) * (1 if match[2] == "+" else -1))


def direction_named(text: str) -> int:
    """The direction of "z", "+z" or "-z", as in UFF58; raises ValueError for another."""
    name = text.strip()
    axis = name.lstrip("+-")
    if axis not in ("x", "y", "z") or len(name) > 2:
        raise ValueError(f"the direction {text!r} is none of x, y, z, -x, -y, -z")
    return AXES.index(axis) * (-1 if name[0] == "-" else 1)


def require_even(t: NDArray[np.float64]) -> float:
    """The step of times t (k,) [s]; raises ValueError where they are no even, ascending ones, or
    fewer than 64.

    Times that an analyser writes with few digits jump or repeat: they are even where all are within
    half of the last digit of a line through them, whose slope is the step.
    """
    steps = np.diff(t)
    if len(t) < 64 or not np.isfinite(t).all():
        raise ValueError(f"it has {len(t)} samples with a time; at least 64 are needed")
    i = np.arange(len(t)) - 0.5 * (len(t) - 1)
    dt, late = float(i @ (t - t.mean()) / (i @ i)), t[len(t) // 2 :]
    digits = (10.0**-k for k in range(10) if not np.any(np.abs(late * 10**k % 1 - 0.5) < 0.499))
    digit = next(digits, 0.0)
    # a sample that is missing is a jump of a step too, but a single one
    often = np.mean(np.abs(steps - dt) > 0.3 * dt) > 0.05
    if often and np.abs(t - t.mean() - dt * i).max() <= 0.51 * digit < 0.01 * np.ptp(t):
        return dt
    dt = float((t[-1] - t[0]) / (len(t) - 1))
    if dt <= 0 or np.abs(steps - dt).max() > 0.3 * dt:
        raise ValueError("its times are not evenly spaced in ascending order; resample them")
    return dt


def record_of_csv(path: Path, name: str) -> TimeRecord:
    """The record of a CSV file; `name` is that of a point whose heading has none.

    Raises ValueError where the file has no record.
    """
    # title lines, then the header: the mark between its cells is that of the file
    title, first, n_lines = [], "", 0
    with path.open(encoding="utf-8-sig") as file:
        for line in file:
            n_lines += 1
            if line.startswith("#"):
                title.append(line.lstrip("# ").strip())
            elif line.strip():
                first = line
                break
    between = next((mark for mark in ";\t" if mark in first), ",")
    header = [cell.strip() for cell in first.split(between)]

    # each heading "kind label [unit]": what the column is, whose, and its scale to SI
    scales, force, sensors, columns, point = [], None, [], [], name
    quantities: set[str] = set()
    for i, heading in enumerate(header):
        match = fullmatch(r"(time|force|response|sensor)?\s*(.*?)\s*(?:\[(.*)\])?", heading)
        kind, label, unit = match[1], match[2], match[3] or ""
        if i == 0:
            if kind != "time" or unit not in SECONDS:
                raise ValueError(f"its first column is {heading!r}, 'time [s]' is needed")
            scales.append(SECONDS[unit])
        elif kind == "force":
            if force is not None:
                raise ValueError("it has two columns of a force; a record has one hammer")
            force, point = i, label or name
            if unit not in NEWTONS:
                raise ValueError(
                    f"the unit of its force is {unit!r}, allowed are {', '.join(NEWTONS)}"
                )
            scales.append(NEWTONS[unit])
        else:
            sensors.append(label or f"sensor {len(sensors) + 1}")
            columns.append(i)
            if unit not in MOTIONS:
                raise ValueError(
                    f"the unit of {heading!r} is {unit!r}, allowed are {', '.join(MOTIONS)}"
                )
            quantities.add(MOTIONS[unit][0])
            scales.append(MOTIONS[unit][1])

    # one quantity: a shape of accelerations at some points and velocities at others is none
    if not columns:
        raise ValueError("it has no column with a response")
    if len(quantities) > 1:
        raise ValueError(
            f"its responses are {' and '.join(sorted(quantities))}; shapes need one quantity"
        )

    # numbers below the header, in SI
    with catch_warnings():
        simplefilter("ignore")  # of a file without lines, which is refused below
        try:
            table = np.loadtxt(
                path, delimiter=between, ndmin=2, skiprows=n_lines, encoding="utf-8-sig"
            )
        except ValueError:
            raise ValueError(
                f"a line below its header is not {len(header)} numbers with decimal points; the "
                "file may be cut off"
            ) from None
    if table.shape[1] != len(header):
        raise ValueError(f"its lines have {table.shape[1]} numbers, its header {len(header)}")
    table = table * scales
    dt = require_even(table[:, 0])
    return TimeRecord(
        dt, None if force is None else table[:, force], table[:, columns].T, point,
        tuple(sensors), " ".join(title), quantities.pop(),
    )  # fmt: skip


def records_of_mat(variables: dict[str, NDArray], name: str) -> list[TimeRecord]:
    """The records of a .mat file's variables, one for each of n hits: force (k,) or (k, n) [N],
    response (k,), (k, m) or (k, m, n), dt [s] or t (k,) [s]; either may be transposed, k being the
    longest side. `name` is that of a point that the file does not name.

    Raises ValueError where it has none, or their sizes do not fit.
    """
    if "response" not in variables or not {"dt", "t"} & variables.keys():
        raise ValueError(
            f"of what is read it has {', '.join(variables) or 'nothing'}; response and dt or t are "
            "needed, and force unless it is a ring-down"
        )
    for key in ("response", "force", "dt", "t"):
        if key in variables and variables[key].dtype.kind not in "fiub":
            raise ValueError(f"{key} is no array of real numbers")

    # response (k, m, n) and force (k, n): instants along the longest side
    y = np.asarray(variables["response"], float)
    force = variables.get("force")
    k = max(y.shape) if force is None else max(force.shape)
    if y.ndim == 2 and y.shape[0] != k:
        y = y.T
    y = y.reshape(len(y), y.shape[1] if y.ndim > 1 else 1, -1)
    f = None if force is None else np.asarray(force, float)
    if f is not None and f.shape[0] != k:
        f = f.T
    if f is not None and (f.ndim != 2 or f.shape != (y.shape[0], y.shape[2])):
        raise ValueError(
            f"force is {f.shape}, response {y.shape}: (k, hits) and (k, sensors, hits) are needed"
        )
    dt = (
        float(variables["dt"].ravel()[0]) if "dt" in variables
        else require_even(np.ravel(variables["t"]).astype(float))
    )  # fmt: skip
    if not 0 < dt < np.inf:
        raise ValueError(f"dt is {dt:g} s, a positive number is needed")

    # names of the points hit and of the sensors, an array of texts or one text with blanks between
    n, m = y.shape[2], y.shape[1]

    def names(key: str, count: int, usual: Sequence[str]) -> list[str]:
        """The texts of a variable, one name for all or `count` of them; the usual ones where the
        file has none. Raises ValueError for any other number."""
        if key not in variables:
            return list(usual)
        texts = [str(text).strip() for text in np.ravel(variables[key])]
        if len(texts) == 1:
            texts = texts[0].split()
        if len(texts) not in (1, count):
            raise ValueError(f"{key} has {len(texts)} names, {count} are needed")
        return texts * (count // len(texts))

    points = names("points", n, [name] * n)
    sensors = names("sensors", m, [f"sensor {i + 1}" for i in range(m)])
    return [
        TimeRecord(
            dt,
            None if f is None else f[:, i],
            y[:, :, i].T,
            points[i],
            tuple(sensors),
            str(np.ravel(variables["title"])[0]) if "title" in variables else "",
            quantity_named(variables),
        )
        for i in range(n)
    ]


def quantity_named(variables: dict[str, NDArray]) -> str:
    """Quantity of the responses of a .mat file by its variable `quantity`, a text or an array (1,)
    of one, "" without it; raises ValueError where it is none of accelerations, velocities and
    displacements, in SI units."""
    named = "".join(map(str, np.ravel(variables.get("quantity", "")))).strip()
    if named and named not in QUANTITIES.values():
        raise ValueError(f"quantity is {named!r}, none of {', '.join(sorted(QUANTITIES.values()))}")
    return named


def record_of_wav(path: Path, name: str, force_channel: int) -> TimeRecord:
    """The record of a WAV file, the force in a channel from 1 on, 0 for none; raises ValueError
    where it has no such channel, or for a file that is damaged."""
    from scipy.io import wavfile

    with catch_warnings():
        simplefilter("ignore")  # of chunks other than the samples
        filterwarnings("error", "Reached EOF prematurely")
        try:
            rate, samples = wavfile.read(path)
        except MemoryError:
            raise
        except Exception:  # struct.error, UnboundLocalError, ...: the reader expects a sound file
            raise ValueError("it is no WAV file, cut off or damaged; write it anew") from None
    if rate <= 0:
        raise ValueError(f"its sampling rate is {rate} Hz, a number above 0 is needed")
    with np.errstate(all="ignore"):  # numbers of 16 bytes may be too large; `require_consistent`
        y = np.atleast_2d(samples.T).astype(float)
    if samples.dtype.kind in "iu":
        unsigned = samples.dtype == np.uint8  # of 8 bits alone, its zero is 128
        y = (y - 128.0) / 128.0 if unsigned else y / np.iinfo(samples.dtype).max
    if not 0 <= force_channel <= len(y) or len(y) == force_channel == 1:
        raise ValueError(
            f"it has {len(y)} channels, the force is in channel {force_channel}; --force-channel "
            "says which, 0 for none"
        )
    others = [i for i in range(len(y)) if i != force_channel - 1]
    return TimeRecord(
        1 / rate, y[force_channel - 1] if force_channel else None, y[others], name,
        tuple(f"channel {i + 1}" for i in others), "",
    )  # fmt: skip


def motion_of(channel: dict) -> tuple[str, float]:
    """Quantity of a data set 58's response, "" where it is not known, and what its unit is in m and
    s; raises ValueError where its unit and its type contradict each other."""
    unit = str(channel.get("ordinate_axis_units_lab", "")).strip()
    by_type = QUANTITIES.get(int(channel.get("ordinate_spec_data_type", 0)), "")
    by_unit, scale = MOTIONS.get(unit, ("", 1.0))
    if by_unit not in QUANTITIES.values():  # no unit, volts, or a word that is none
        return by_type, 1.0
    if by_type and by_type != by_unit:
        raise ValueError(f"a response in {unit} is one of {by_type} by its type; correct either")
    return by_unit, scale


def records_of_data_sets(sets: Sequence[dict]) -> list[TimeRecord]:
    """The records of data sets 58; raises ValueError where they hold none."""
    sets = [s for s in sets if s["func_type"] == TIME_RESPONSE]
    if not sets:
        raise ValueError("it has no data set 58 with a time record (function type 1)")

    # a record ends where one of its channels comes again
    groups: list[dict[tuple, dict]] = []
    for s in sets:
        is_force = s.get("ordinate_spec_data_type") == FORCE or (
            str(s.get("ordinate_axis_units_lab", "")).strip() in NEWTONS
        )
        key = ("force",) if is_force else (int(s["rsp_node"]), int(s["rsp_dir"]))
        if not groups or key in groups[-1]:
            groups.append({})
        groups[-1][key] = s

    # each record by its channels, in SI
    records = []
    for group in groups:
        force = group.pop(("force",), None)
        if not group:
            raise ValueError("it has a force without a response")
        sensors = list(group.values())
        t = np.asarray(sensors[0]["x"], float)
        if any(len(s["x"]) != len(t) for s in [*sensors, *([force] if force else [])]):
            raise ValueError("the channels of one hit differ in length")
        # the force's own point is the one hit; without a force it is the reference that is named
        node, direction = (
            (force["rsp_node"], force["rsp_dir"]) if force
            else (sensors[0]["ref_node"], sensors[0]["ref_dir"])
        )  # fmt: skip
        scale = (
            NEWTONS.get(str(force.get("ordinate_axis_units_lab", "")).strip(), 1.0) if force else 1
        )
        motions = [motion_of(s) for s in sensors]
        if len({quantity for quantity, _ in motions}) > 1:
            listed = " and ".join(
                dict.fromkeys(quantity or "of no unit" for quantity, _ in motions)
            )
            raise ValueError(f"its responses are {listed}; shapes need one quantity")
        records.append(
            TimeRecord(
                require_even(t),
                scale * np.asarray(force["data"], float) if force else None,
                np.array(
                    [
                        size * np.asarray(s["data"], float)
                        for s, (_, size) in zip(sensors, motions, strict=True)
                    ]
                ),
                degree_of_freedom(int(node), int(direction)),
                tuple(degree_of_freedom(int(s["rsp_node"]), int(s["rsp_dir"])) for s in sensors),
                str(sensors[0]["id1"]).strip(),
                motions[0][0],
            )
        )
    return records


def require_consistent(records: list[TimeRecord]) -> list[TimeRecord]:
    """The records; raises ValueError where a sensor stands twice in one of them, or a sample is so
    large that products would overflow."""
    for record in records:
        twice = [s for i, s in enumerate(record.sensors) if s in record.sensors[:i]]
        if twice:
            raise ValueError(
                f"it has two responses of the sensor {twice[0]}; drop one, or correct its name"
            )
        force = [] if record.force is None else [("the force", record.force)]
        for name, samples in (*force, *zip(record.sensors, record.response, strict=True)):
            size = np.abs(samples)
            huge = (size > MOST) & np.isfinite(size)  # NaN and inf are named with their hit
            if huge.any():
                k = int(huge.argmax())
                raise ValueError(
                    f"sample {k + 1} of {name} is {samples[k]:.3g}, up to {MOST:g} in size is "
                    "allowed: correct it or measure again"
                )
    return records


def copies(records: Sequence[TimeRecord]) -> dict[int, int]:
    """Records that hold the same samples as an earlier one, each with the first of these: a record
    that was given twice would count as two hits without scatter."""
    first: dict[bytes, int] = {}
    again = {}
    for i, record in enumerate(records):
        digest = blake2b(digest_size=16)
        for samples in (record.force, record.response):
            if samples is not None:
                digest.update(np.ascontiguousarray(samples, float))
        j = first.setdefault(digest.digest(), i)
        if j != i:
            again[i] = j
    return again


def cut_at_hits(records: Sequence[TimeRecord]) -> tuple[list[TimeRecord], list[str]]:
    """Records of one hit each, and sentences on what is left out. Records without a force, and of
    one hit, stay as they are."""
    pieces, remarks = [], []
    for record in records:
        if record.force is None:
            pieces.append(record)
            continue

        # hits: the first sample above a share of the largest force after a pause
        f, dt = np.abs(record.force), record.dt
        high = np.flatnonzero(f > PULSE_THRESHOLD * f.max()) if f.size else np.zeros(0, int)
        starts = high[np.diff(high, prepend=-np.inf) > DOUBLE_HIT_TIME / dt]
        if len(starts) < 2:
            pieces.append(record)
            continue

        # from a little before each pulse to as long before the next one
        before = min(int(PRETRIGGER / dt), int(starts[0]))
        lengths = np.diff([*starts, len(f) + before])
        long_enough = lengths >= MIN_LENGTH * np.median(lengths)
        # the last hit may have less time; the others are all of one length
        usual = lengths[:-1][long_enough[:-1]]
        length = int(usual.min()) if len(usual) > 1 else int(lengths[long_enough].min())
        for i, start in enumerate(starts.tolist()):
            first = start - before
            if not long_enough[i]:
                remarks.append(
                    f"the hit at {start * dt:.3f} s at {record.point} is left out: the next hit "
                    "or the record's end follows too soon"
                )
                continue
            piece = slice(first, first + min(length, int(lengths[i])))
            pieces.append(
                record._replace(force=record.force[piece], response=record.response[:, piece])
            )
    return pieces, remarks


def sets_of_hits(records: Sequence[TimeRecord]) -> list[Hits]:
    """Records with the same sensors together, all of one length; raises ValueError where they are
    sampled unlike, or some have a force and others none."""
    if len({record.force is None for record in records}) > 1:
        raise ValueError(
            "some records have a force and others none; analyse them one after another"
        )
    first = records[0]
    for record in records:
        if abs(record.dt / first.dt - 1) > 1e-6:
            raise ValueError(
                f"records are sampled every {first.dt:.6g} s and every {record.dt:.6g} s; resample"
            )
    length = min(record.response.shape[1] for record in records)
    result = []
    for sensors in dict.fromkeys(record.sensors for record in records):
        alike = [record for record in records if record.sensors == sensors]
        points = tuple(dict.fromkeys(record.point for record in alike))
        force = None if first.force is None else np.array([r.force[:length] for r in alike])
        response = np.array([r.response[:, :length] for r in alike])
        point = np.array([points.index(r.point) for r in alike])
        result.append(
            Hits(first.dt, force, response, point, points, sensors, first.title, first.quantity)
        )
    return result
