"""A case's row of the table: its waves at the watched spheres, the wall's force, errors."""

from typing import Any, NamedTuple

import numpy as np

from beadwave.dem.waves.arrivals import passages

DONE, REFUSED, FAILED = "done", "refused", "failed"
RUN = (
    "wall_peak_force_N", "wall_peak_s", "energy_error", "error_time", "error_reduction",
    "error_mesh", "dt_s", "steps", "seconds", "status", "message",
)  # fmt: skip
# of scenes with friction: its largest force, the velocity of the last sphere's surface after the
# run over that before, heat, that of a period of a shaken wall, the share of the contact that
# sticks when the wave comes
ACROSS = (
    "friction_peak_N", "surface_velocity_ratio", "friction_heat_J", "loop_energy_J",
    "stick_share_at_impact",
)  # fmt: skip
TEXT = ("status", "message")
OF_SPHERE = (
    "incident_s", "incident_m_s", "reflected_s", "reflected_m_s", "echo_delay_s", "echo_ratio"
)  # fmt: skip
LARGE_ERROR = 0.05  # of velocities, in parts of the striker's; a row and the terminal warn of it
Array = np.ndarray


class Rows(NamedTuple):
    """Rows of cases, with their signals where these are wanted."""

    cases: tuple[int, ...]
    columns: dict[str, list[Any]]
    signals: dict[str, Array] | None = None  # v (cases, k, spheres), wall_force (cases, k), t (k,)


def names(spheres: tuple[int, ...], across: bool) -> tuple[str, ...]:
    """Names of the table's columns after those of the keys; `across` with those of friction."""
    of_spheres = (f"sphere_{s}_{name}" for s in spheres for name in OF_SPHERE)
    return (*of_spheres, *(ACROSS if across else ()), *RUN)


def other_wave(sphere: int) -> str:
    """The message of a row whose reflected wave at a sphere is not that of the points around."""
    return f"the reflected wave at sphere {sphere} is blank: not that of the points around"


def measured(
    spheres: tuple[int, ...], t: Array, v: Array, wall_force: Array, **run: Any
) -> dict[str, list[Any]]:
    """Columns of cases with velocities v (m, k, len(spheres)) [m/s] and wall_force (m, k) [N] at
    times t (k,) [s]; `run` has a number for all, or one each, of the other columns."""
    m, columns = len(v), {}
    for j, sphere in enumerate(spheres):
        waves = passages(t, v[:, :, j])
        # of the reflected wave after and over the incident one
        delay, ratio = waves[:, 2] - waves[:, 0], np.abs(waves[:, 3] / waves[:, 1])
        for name, values in zip(OF_SPHERE, (*waves.T, delay, ratio), strict=True):
            columns[f"sphere_{sphere}_{name}"] = values.tolist()
    columns["wall_peak_force_N"] = wall_force.max(axis=1).tolist()
    columns["wall_peak_s"] = t[wall_force.argmax(axis=1)].tolist()
    run = {"status": DONE, "message": "", "error_reduction": np.nan, "error_mesh": np.nan} | run
    for name, value in run.items():
        value = value.tolist() if isinstance(value, np.ndarray) else value
        columns[name] = list(value) if isinstance(value, list | tuple) else [value] * m
    return {name: columns[name] for name in names(spheres, ACROSS[0] in run)}


def without_result(
    spheres: tuple[int, ...],
    cases: tuple[int, ...],
    status: str,
    messages: list[str],
    *,
    across: bool = False,
) -> Rows:
    """Rows of cases that were refused or failed, each with its sentence; `across` as of `names`."""
    columns: dict[str, list[Any]] = {name: [np.nan] * len(cases) for name in names(spheres, across)}
    columns |= {"status": [status] * len(cases), "message": messages}
    columns["seconds"] = [0.0] * len(cases)
    return Rows(cases, columns)
