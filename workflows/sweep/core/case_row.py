"""A case's row of the table: its waves at the watched spheres, the wall's force, errors."""

from collections.abc import Mapping
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
WALL = "wall_peak_force_N", "wall_peak_s"
Array = np.ndarray
# spheres that are watched, by what their columns begin with: "" of one chain, "NAME_" of each of
# several; without a chain there is none
Watched = Mapping[str, tuple[int, ...]]


class Rows(NamedTuple):
    """Rows of cases, with their signals where these are wanted."""

    cases: tuple[int, ...]
    columns: dict[str, list[Any]]
    signals: dict[str, Array] | None = None  # v (cases, k, spheres), wall_force (cases, k), t (k,)


def names(watched: Watched, across: bool) -> tuple[str, ...]:
    """Names of the table's columns after those of the keys; `across` with those of friction. Cases
    without a chain have those of their modes besides."""
    if not watched:
        return ("seconds", *TEXT)
    of_chains: list[str] = []
    for chain, spheres in watched.items():
        of_chains += (f"{chain}sphere_{s}_{name}" for s in spheres for name in OF_SPHERE)
        of_chains += (chain + name for name in WALL if chain)
    return (*of_chains, *(ACROSS if across else ()), *RUN)


def other_wave(sphere: int) -> str:
    """The message of a row whose reflected wave at a sphere is not that of the points around."""
    return f"the reflected wave at sphere {sphere} is blank: not that of the points around"


def measured(
    watched: Watched, t: Array, v: Array, wall_force: Array, **run: Any
) -> dict[str, list[Any]]:
    """Columns of cases with velocities v (m, k, n) [m/s] of all n spheres that are watched and
    wall_force (m, k, number of chains) [N] at times t (k,) [s]; `run` has a number for all, or one
    each, of the other columns."""
    m, columns, first = len(v), {}, 0
    for i, (chain, spheres) in enumerate(watched.items()):
        for j, sphere in enumerate(spheres, start=first):
            waves = passages(t, v[:, :, j])
            # of the reflected wave after and over the incident one
            delay, ratio = waves[:, 2] - waves[:, 0], np.abs(waves[:, 3] / waves[:, 1])
            for name, values in zip(OF_SPHERE, (*waves.T, delay, ratio), strict=True):
                columns[f"{chain}sphere_{sphere}_{name}"] = values.tolist()
        first += len(spheres)
        columns |= peak(chain, t, wall_force[:, :, i])
    columns |= peak("", t, wall_force.max(axis=2))
    run = {"status": DONE, "message": "", "error_reduction": np.nan, "error_mesh": np.nan} | run
    for name, value in run.items():
        value = value.tolist() if isinstance(value, np.ndarray) else value
        columns[name] = list(value) if isinstance(value, list | tuple) else [value] * m
    return {name: columns[name] for name in names(watched, ACROSS[0] in run)}


def peak(chain: str, t: Array, force: Array) -> dict[str, list[float]]:
    """Columns of the largest force (m, k) [N] of a chain at the wall, and of its time [s]."""
    values = force.max(axis=1), t[force.argmax(axis=1)]
    return {chain + name: x.tolist() for name, x in zip(WALL, values, strict=True)}


def without_result(
    watched: Watched,
    cases: tuple[int, ...],
    status: str,
    messages: list[str],
    *,
    across: bool = False,
) -> Rows:
    """Rows of cases that were refused or failed, each with its sentence; `across` as of `names`."""
    columns: dict[str, list[Any]] = {name: [np.nan] * len(cases) for name in names(watched, across)}
    columns |= {"status": [status] * len(cases), "message": messages}
    columns["seconds"] = [0.0] * len(cases)
    return Rows(cases, columns)
