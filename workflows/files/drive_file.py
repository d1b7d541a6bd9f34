"""The CSV of a driven row's motion: time [us], displacement [um]; units stand in the header."""

from pathlib import Path

import numpy as np

from beadwave.dem.kernels.arguments import Array
from beadwave.workflows.files.signal_table import SECONDS, signal_table
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.scene.named_files import require_file
from beadwave.workflows.scene.units import (
    ACCELERATION,
    DISPLACEMENT,
    VELOCITY,
    NoSuchQuantity,
    in_si,
)

KINDS = {"displacement": DISPLACEMENT, "velocity": VELOCITY, "acceleration": ACCELERATION}


def drive_motion(file: str, quantity: str, duration: float) -> tuple[Array, Array]:
    """Times (n,) [s] and values (n,) in SI of a CSV of a time and a quantity.

    Raises InvalidScene for another number of columns, a unit of another kind, times that do not
    ascend from 0, and a motion that ends before the run.
    """
    key = f"crystal.drive.file = {file!r}"
    path = require_file(file, "give a CSV", key="crystal.drive.file = ")
    try:
        table = signal_table(Path(path))
        table.require_columns()
    except ValueError as error:
        raise InvalidScene(f"{key}: {error}; correct it.") from None
    if len(table.header) != 2:
        raise InvalidScene(
            f"{key} has {len(table.header)} columns; give two, time [us] and {quantity}."
        )
    units = [name.partition("[")[2].partition("]")[0].strip() for name in table.header]
    if units[0] not in SECONDS:
        raise InvalidScene(f"{key}: its first column must be time [s], [ms] or [us]; name it.")
    try:
        scale = in_si(f"1 {units[1]}", KINDS[quantity])
    except NoSuchQuantity as error:
        raise InvalidScene(f"{key}: its second column: {error}; name it with its unit.") from None
    t, values = table.values.T * [[SECONDS[units[0]]], [scale]]
    if len(t) < 4 or t[0] != 0.0 or np.any(np.diff(t) <= 0.0):
        raise InvalidScene(f"{key} must have four times or more that ascend from 0; correct it.")
    if t[-1] < duration * (1.0 - 1e-9):
        raise InvalidScene(
            f"{key} ends at {t[-1]:g} s, before time.duration = {duration:g} s; shorten the run, "
            "or give a longer motion."
        )
    return t, values
