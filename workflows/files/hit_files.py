"""Time records of hits from CSV, MATLAB's .mat, UFF58 and WAV files.

CSV, one line per sample:

    time [s], force 12+z [N], response 3+x [m/s^2], response 3-y [m/s^2]

A .mat file has dt or t, force (k,) or (k, n) of n hits, response (k, m) or (k, m, n), and the texts
points and sensors. In UFF58 (function type 1) a channel measures a force if its ordinate is of type
13 or in N; channels follow one another hit by hit. A WAV file has the force in the channel that is
said. All raise ValueError for content that cannot be used.
"""

from collections.abc import Sequence
from pathlib import Path
from re import fullmatch
from warnings import catch_warnings, filterwarnings, simplefilter

import numpy as np
from numpy.typing import NDArray

from beadwave.fem.identification.hit_records import TimeRecord, degree_of_freedom
from beadwave.workflows.files.signal_table import SECONDS, TIME_RESPONSE, SignalTable, even_step

FORCE = 13  # UFF58's type of an excitation force
QUANTITIES = {8: "displacements", 11: "velocities", 12: "accelerations"}  # UFF58's types
NEWTONS = {"N": 1.0, "kN": 1e3, "mN": 1e-3, "lbf": 4.4482216152605}
MOTIONS = {
    "": ("of no unit", 1.0), "V": ("voltages", 1.0), "m/s^2": ("accelerations", 1.0),
    "m/s2": ("accelerations", 1.0), "g": ("accelerations", 9.80665),
    "mm/s^2": ("accelerations", 1e-3), "m/s": ("velocities", 1.0), "mm/s": ("velocities", 1e-3),
    "m": ("displacements", 1.0), "mm": ("displacements", 1e-3), "um": ("displacements", 1e-6),
}  # fmt: skip
LEAST_SAMPLES = 64


def require_one_quantity(quantities: Sequence[str]) -> str:
    """The quantity of all responses; raises ValueError for several: a shape of accelerations at
    some points and velocities at others is none."""
    distinct = sorted({quantity or "of no unit" for quantity in quantities})
    if len(distinct) > 1:
        raise ValueError(f"its responses are {' and '.join(distinct)}; shapes need one quantity")
    return quantities[0]


def record_of_table(table: SignalTable, name: str) -> TimeRecord:
    """The record of a CSV file's table; `name` is that of a point whose heading has none."""
    table.require_columns()

    # each heading "kind label [unit]": what the column is, whose, and its scale to SI
    scales, force, sensors, columns, quantities, point = [], None, [], [], [], name
    for i, heading in enumerate(table.header):
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
            quantities.append(MOTIONS[unit][0])
            scales.append(MOTIONS[unit][1])
    if not columns:
        raise ValueError("it has no column with a response")
    quantity = require_one_quantity(quantities)

    values = table.values * scales
    return TimeRecord(
        even_step(values[:, 0], LEAST_SAMPLES),
        None if force is None else values[:, force],
        values[:, columns].T, point, tuple(sensors), table.title, quantity,
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
        else even_step(np.ravel(variables["t"]).astype(float), LEAST_SAMPLES)
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
        quantity = require_one_quantity([quantity for quantity, _ in motions])
        records.append(
            TimeRecord(
                even_step(t, LEAST_SAMPLES),
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
                quantity,
            )
        )
    return records
