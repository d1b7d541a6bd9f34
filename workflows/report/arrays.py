"""Arrays with named dimensions and units, for whoever analyses on: xarray."""

from collections.abc import Mapping

import numpy as np
import xarray
from numpy.typing import NDArray

from workflows.report.tables import Table

DIMENSIONS = {
    "t": ("time",), "x": ("time", "sphere"), "v": ("time", "sphere"),
    "contact_force": ("time", "contact"), "wall_q": ("time", "mode"),
}  # fmt: skip
UNITS = {
    "t": "s",
    "x": "m",
    "v": "m/s",
    "contact_force": "N",
    "wall_x": "m",
    "wall_v": "m/s",
    "wall_q": "kg^0.5 m",
    "wall_omega": "rad/s",
    "wall_phi": "kg^-0.5",
}
OF_MODES = ("wall_omega", "wall_phi")
WORDS = {
    "x": "displacement towards the wall", "v": "velocity towards the wall",
    "contact_force": "force of sphere i on its neighbour or the wall, pushing",
    "wall_x": "displacement of the wall, without its static part", "wall_v": "its velocity",
    "wall_q": "coordinate of a mode of the wall, mass-normalised",
}  # fmt: skip


def of_trajectory(arrays: Mapping[str, NDArray[np.float64]]) -> xarray.Dataset:
    """A trajectory over time [s], spheres and contacts numbered from 1; energies in J."""
    k = len(arrays["t"])
    over_time = {n: a for n, a in arrays.items() if n != "t" and a.shape[:1] == (k,) and a.ndim < 3}
    found = {name: (*_dimensions(name, a), _about(name)) for name, a in over_time.items()}
    found |= {n: ("mode", arrays[n], {"units": UNITS[n]}) for n in OF_MODES if n in arrays}
    numbered = {"sphere": arrays["x"].shape[1], "contact": arrays["contact_force"].shape[1]}
    coords = {name: np.arange(1, n + 1) for name, n in numbered.items()}
    return xarray.Dataset(found, coords | {"time": ("time", arrays["t"], {"units": "s"})})


def _dimensions(name: str, values: NDArray) -> tuple[tuple[str, ...], NDArray]:
    return DIMENSIONS.get(name, ("time", f"{name}_column")[: values.ndim]), values


def _about(name: str) -> dict[str, str]:
    words = {"long_name": WORDS[name]} if name in WORDS else {}
    return {"units": UNITS.get(name, "J"), **words}


def dataset(
    variables: Mapping[str, tuple[tuple[str, ...], NDArray, str]], **coords
) -> xarray.Dataset:
    """Variables as name: (dimensions, values, unit)."""
    found = {name: (dims, a, {"units": unit}) for name, (dims, a, unit) in variables.items()}
    return xarray.Dataset(found, coords)


def of_table(table: Table) -> xarray.Dataset:
    """The columns of a table over its rows; what does not exist is nan."""
    columns = zip(*table.rows, strict=True) if table.rows else [()] * len(table.columns)
    named = zip(table.columns, columns, strict=True)
    return xarray.Dataset({name: ("row", _column(values)) for name, values in named})


def _column(values: tuple) -> NDArray:
    if any(isinstance(value, str) for value in values):
        return np.array([value if isinstance(value, str) else str(value) for value in values])
    return np.array([np.nan if value is None else value for value in values])
