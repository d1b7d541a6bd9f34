"""Results as xarray datasets: arrays with named dimensions and units."""

from collections.abc import Mapping

import numpy as np
import xarray
from numpy.typing import NDArray

from beadwave.workflows.report.tables import Table

DIMENSIONS = {
    "t": ("time",), "x": ("time", "sphere"), "v": ("time", "sphere"),
    "contact_force": ("time", "contact"), "wall_q": ("time", "mode"),
    "sphere_t": ("time", "across"), "sphere_t_v": ("time", "across"),
    "sphere_rotation": ("time", "across"), "sphere_spin": ("time", "across"),
    "friction_force": ("time", "across"), "slip": ("time", "across"),
    "wall_t": ("time", "across"),
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
    "sphere_t": "m",
    "sphere_t_v": "m/s",
    "sphere_rotation": "rad",
    "sphere_spin": "rad/s",
    "friction_force": "N",
    "slip": "m",
    "stick_share": "1",
    "wall_t": "m",
}
WORDS = {
    "x": "displacement towards the wall", "v": "velocity towards the wall",
    "contact_force": "force of sphere i on its neighbour or the wall, pushing",
    "wall_x": "displacement of the wall, without its static part", "wall_v": "its velocity",
    "wall_q": "coordinate of a mode of the wall, mass-normalised",
    "sphere_t": "displacement of the last sphere along t1, t2", "sphere_t_v": "its velocity",
    "sphere_rotation": "turn of the last sphere about t1, t2", "sphere_spin": "its rate",
    "friction_force": "tangential force of the last sphere on the wall, along t1, t2",
    "slip": "displacement of the sphere's surface relative to the wall, along t1, t2",
    "wall_t": "displacement of the wall along t1, t2",
    "stick_share": "share of the contact's area that sticks",
}  # fmt: skip


def of_trajectory(arrays: Mapping[str, NDArray[np.float64]]) -> xarray.Dataset:
    """A trajectory over time [s], spheres and contacts numbered from 1; energies in J.

    Of the arrays by name those over the k instants of t (k,) and the wall's modes; the cycle before
    a striker, which has instants of its own, is left out.
    """
    if "displacement" in arrays:
        return of_crystal(arrays)
    if "chain" in arrays:
        return of_chains(arrays)
    k, variables = len(arrays["t"]), {}
    for name, values in arrays.items():
        if name.startswith("error_"):
            array = name.removeprefix("error_")
            about = {"units": UNITS[array], "long_name": f"error of {array} by the time step"}
            variables[name] = (DIMENSIONS[array][1:], values, about)
        elif (
            name != "t"
            and not name.startswith("cycle_")
            and values.shape[:1] == (k,)
            and values.ndim < 3
        ):
            dimensions = DIMENSIONS.get(name, ("time", f"{name}_column")[: values.ndim])
            about = {"units": UNITS.get(name, "J")}
            if name in WORDS:
                about["long_name"] = WORDS[name]
            variables[name] = (dimensions, values, about)
    for name in ("wall_omega", "wall_phi"):
        if name in arrays:
            variables[name] = ("mode", arrays[name], {"units": UNITS[name]})
    numbered = {"sphere": arrays["x"].shape[1], "contact": arrays["contact_force"].shape[1]}
    coords = {name: np.arange(1, n + 1) for name, n in numbered.items()}
    return xarray.Dataset(variables, coords | {"time": ("time", arrays["t"], {"units": "s"})})


# arrays of several chains: dimensions and unit; contact i is behind sphere i
CHAINS = {
    "x": (("time", "sphere"), "m"), "v": (("time", "sphere"), "m/s"),
    "contact_force": (("time", "sphere"), "N"),
    "wall_x": (("time", "point"), "m"), "wall_v": (("time", "point"), "m/s"),
    "wall_force": (("time", "point"), "N"), "wall_q": (("time", "mode"), "kg^0.5 m"),
    "wall_omega": (("mode",), "rad/s"), "wall_phi": (("point", "mode"), "kg^-0.5"),
    "rest": (("sphere", "axis"), "m"), "direction": (("sphere", "axis"), "1"),
    "radius": (("sphere",), "m"),
    "error_x": (("sphere",), "m"), "error_v": (("sphere",), "m/s"),
    "error_contact_force": (("sphere",), "N"),
    "rubbing": (("contact",), "1"), "stick_share": (("time", "contact"), "1"),
    **{name: (("time", "contact", "across"), unit)
       for name, unit in (("sphere_t", "m"), ("sphere_t_v", "m/s"), ("sphere_spin", "rad/s"),
                          ("friction_force", "N"), ("slip", "m"), ("wall_t", "m"))},
}  # fmt: skip


def _variables(arrays: Mapping[str, NDArray], known: Mapping[str, tuple]) -> dict[str, tuple]:
    """Dimensions, values and unit of the arrays that are known by dimensions and unit, and of the
    energies."""
    variables = {}
    for name, values in arrays.items():
        if name in known:
            dimensions, unit = known[name]
            variables[name] = (dimensions, values, unit)
        elif name.startswith(("energy", "dissipated", "work")):
            variables[name] = (("time",), values, "J")
    return variables


def of_chains(arrays: Mapping[str, NDArray[np.float64]]) -> xarray.Dataset:
    """The trajectory of several chains over time [s], spheres numbered from 1 through all chains,
    `chain` says which one each is of, from 0, and `rubbing` which chains the contacts with friction
    are of; energies in J."""
    return dataset(
        _variables(arrays, CHAINS),
        time=("time", arrays["t"], {"units": "s"}),
        sphere=np.arange(1, len(arrays["chain"]) + 1),
        chain=("sphere", arrays["chain"]),
        axis=["x", "y", "z"],
    )


# arrays of a crystal: dimensions and unit
CRYSTAL = {
    "displacement": (("time", "sphere", "axis"), "m"),
    "velocity": (("time", "sphere", "axis"), "m/s"),
    "angular_velocity": (("time", "sphere", "axis"), "rad/s"),
    "pair_force": (("time", "contact"), "N"),
    "pair_friction": (("time", "contact", "axis"), "N"),
    "wall_x": (("time", "direction"), "m"), "wall_v": (("time", "direction"), "m/s"),
    "wall_force": (("time", "direction"), "N"), "wall_q": (("time", "mode"), "kg^0.5 m"),
    "rest": (("sphere", "axis"), "m"), "radius": (("sphere",), "m"),
    "pairs": (("contact", "end"), "1"),
    "error_displacement": (("sphere",), "m"), "error_velocity": (("sphere",), "m/s"),
    "error_pair_force": (("contact",), "N"),
}  # fmt: skip


def of_crystal(arrays: Mapping[str, NDArray[np.float64]]) -> xarray.Dataset:
    """A crystal's trajectory over time [s], spheres by their numbers, contacts from 1 and the axes
    x, y, z; energies in J. `pairs` are rows of the spheres, from 0."""
    return dataset(
        _variables(arrays, CRYSTAL),
        time=("time", arrays["t"], {"units": "s"}),
        sphere=arrays["saved"],
        contact=np.arange(1, len(arrays["pairs"]) + 1),
        axis=["x", "y", "z"],
    )


def dataset(
    variables: Mapping[str, tuple[tuple[str, ...], NDArray, str]], **coords
) -> xarray.Dataset:
    """Variables as name: (dimensions, values, unit)."""
    with_units = {name: (dims, a, {"units": unit}) for name, (dims, a, unit) in variables.items()}
    return xarray.Dataset(with_units, coords)


def of_table(table: Table) -> xarray.Dataset:
    """The columns of a table over its rows; what does not exist is nan, in words None."""
    variables = {}
    for i, name in enumerate(table.columns):
        values = [row[i] for row in table.rows]
        if any(isinstance(value, str) for value in values):
            column = np.array([value if isinstance(value, str) else str(value) for value in values])
        else:
            column = np.array([np.nan if value is None else value for value in values])
        variables[name] = ("row", column)
    return xarray.Dataset(variables)
