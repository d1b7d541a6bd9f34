"""Recorded signals at common, equally spaced times, with repeats along an axis of their own."""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.workflows.scene.tables.sensors import KINDS
from beadwave.workflows.scene.units import VOLTAGE

SYNTHETIC = "SYNTHETIC: computed, not measured"
LEAST_SAMPLES = 50


class UnusableRecord(ValueError):
    """A record that cannot be used; one sentence with what was found and what to do."""


class Record(NamedTuple):
    """Velocities of m spheres, positive towards the wall, in r repeats over k equal times."""

    t: NDArray[np.float64]  # (k,) [s]
    v: NDArray[np.float64]  # (r, k, m) [m/s]
    spheres: tuple[int, ...]  # (m,) counted from 1, ascending
    title: str
    channels: tuple[Any, ...] | None = None  # quantities in v, SI; None: velocities


class Channel(NamedTuple):
    """The quantity in one column of a record of sensors."""

    sphere: int  # counted from 1
    quantity: str
    in_volts: bool
    chain: str = ""  # whose sphere it is, where there are several

    @property
    def name(self) -> str:
        """As in the header of a file."""
        return f"{self.chain} sphere {self.sphere} {self.quantity}".lstrip()

    @property
    def unit(self) -> str:
        """Of its signal."""
        return VOLTAGE.unit if self.in_volts else KINDS[self.quantity].unit


class MeanRecord(NamedTuple):
    """Mean signals y (k, m) of m channels at equal times t (k,) [s], in SI units."""

    t: NDArray[np.float64]
    y: NDArray[np.float64]
    channels: tuple[Channel, ...]
    spread: NDArray[np.float64]  # (m,) standard deviation of one repeat; nan of a single one
    repeats: int
    name: str
    synthetic: bool


def stacked(t: NDArray[np.float64], columns) -> tuple[tuple, NDArray[np.float64]]:
    """Kinds of the m columns, in order, and their values (r, k, m) in r repeats at times t (k,)
    [s]; raises ValueError for missing numbers and if columns differ in repeats."""
    repeats_of: dict[Any, list] = {}
    for key, values in columns:
        if not np.isfinite(values).all():
            i = int(np.argmin(np.isfinite(values)))
            raise ValueError(f"{_name(key)} has no number at sample {i + 1}, at {t[i]:.6g} s")
        repeats_of.setdefault(key, []).append(values)
    if not repeats_of:
        raise ValueError("there is no column of a sphere")
    count = {key: len(repeats) for key, repeats in repeats_of.items()}
    if len(set(count.values())) > 1:
        listed = ", ".join(f"{_name(key)}: {k}" for key, k in count.items())
        raise ValueError(f"spheres differ in repeats ({listed}), each needs as many")
    keys = tuple(sorted(repeats_of))
    return keys, np.array([repeats_of[key] for key in keys]).transpose(1, 2, 0)


def _name(key: Any) -> str:
    return getattr(key, "name", f"sphere {key}")


def csv_text(measured: Record) -> str:
    """The record as CSV; files of velocities are read back from it."""
    r, k, m = measured.v.shape
    names = [f"sphere {n} [m/s]" for _ in range(r) for n in measured.spheres]
    v = measured.v.transpose(1, 0, 2).reshape(k, r * m)
    return csv_of_signals(measured.title, names, measured.t, v)


def csv_of_signals(
    title: str, names: Iterable[str], t: NDArray[np.float64], y: NDArray[np.float64]
) -> str:
    """CSV of times t (k,) [s] and signals y (k, m) of these names."""
    lines = [",".join(f"{x:.9g}" for x in row) for row in np.column_stack([t, y])]
    return "\n".join([f"# {title}", ", ".join(["time [s]", *names]), *lines, ""])
