"""Time records of hammer tests: hits that were recorded together are cut apart, those with the same
sensors put together.

A point is named by its node and direction, "12+z", as data sets 58 of universal files have them;
"-" is against the axis. A record without a force is a ring-down or of ambient vibration.
"""

from collections.abc import Sequence
from hashlib import blake2b
from re import fullmatch
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.fem.identification.hits import Hits

AXES = ("", "x", "y", "z", "rx", "ry", "rz")  # of UFF58's directions 0 to 6
MOST = 1e60  # size of a sample, a frequency or a response, so that products are finite


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
