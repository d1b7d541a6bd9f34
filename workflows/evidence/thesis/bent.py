"""A chain at a beam or plate of bending theory: functions that the studies of these share.

The first reflected wave leaves when the contact ends. What lies so far away that bending waves
come back later does not change it.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave import coupling, dem
from beadwave.dem.waves.measures import WallContact
from beadwave.workflows.evidence.study import concluded, counted
from beadwave.workflows.evidence.thesis.observed_run import Observed, RecordOptions, Setup, seen
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.scene.parts import with_chain
from beadwave.workflows.stages import bending
from beadwave.workflows.stages.chain import chain, initial_velocity
from beadwave.workflows.stages.progress import Progress
from beadwave.workflows.stages.walls import wall_of

COLUMNS = ("mm", "first_mode_hz", "contact_us", "tof_us", "arr", "peak_N")


def require(scene: Scene, table: str) -> None:
    """Raise InvalidScene unless a chain strikes a beam or a plate, as the study wants it."""
    if getattr(scene, table) is None:
        raise InvalidScene(f"the scene {scene.name} has no [{table}]; add one, or take {table}.")
    with_chain(scene)


def wall(scene: Scene) -> dem.Wall:
    """The wall that the scene's beam or plate makes, its receptance reduced to an error of 1e-3:
    studies compare theories, not reductions."""
    exact = scene.but(reduction={"modes": None, "error": 1e-3})
    return wall_of(exact, bending.reduction(exact, bending.model(exact)))


def first_mode(scene: Scene) -> float:
    """The lowest frequency [Hz] of the beam or plate that is no rigid motion."""
    omega = bending.modes(scene, bending.model(scene)).omega
    return float(omega[omega > 1.0][0] / (2 * np.pi))


def run(scene: Scene, before_wall: dem.Wall) -> Observed:
    """The scene's chain before a wall, its waves named."""
    setup = Setup(scene.name, chain(scene), before_wall)
    spheres = scene.output.spheres or (1, scene.chain.count - 3)
    duration = scene.time.duration
    # in the last 0.3 of a run spheres move chaotically, and only the energy is controlled
    impact = coupling.impact(
        setup.chain, before_wall, initial_velocity(scene), duration=duration, n_save=8000,
        error=RecordOptions().error, horizon=0.7 * duration,
    )  # fmt: skip
    return seen(setup, impact.trajectory, spheres=spheres)


def tof_and_arr(contact: WallContact) -> tuple[float, float]:
    """Time of flight [s] and amplitude ratio of the first reflected wave, nan without one."""
    nan = float("nan")
    return (
        nan if contact.tof is None else contact.tof,
        nan if contact.arr is None else contact.arr,
    )


class StructuresOptions(NamedTuple):
    """What the studies of one size vary, and what they tell apart."""

    # of the scene's own value, ascending, 1 among them
    factors: NDArray[np.float64] = 2.0 ** np.arange(-2, 2.5, 0.5)
    arr_known: float = 0.01  # relative, to which an instrument tells ARR
    tof_known: float = 0.5e-6  # [s] to which it tells TOF: a sample at 2 MHz
    unchanged: float = 0.01  # relative change of ARR that is none


def compared(
    module: str,
    quantity: str,
    scenes: Sequence[Scene],
    values: Sequence[float],
    progress: Progress,
    options: StructuresOptions,
) -> Finding:
    """The finding of the study of a module: its scenes by the values [m] of a quantity."""
    rows = []
    for scene, value in counted(
        zip(scenes, values, strict=True),
        progress,
        lambda pair: f"{quantity} {1e3 * pair[1]:.3g} mm",
    ):
        impact = run(scene, wall(scene))
        contact_us = 1e6 * impact.contact.contact_time.seconds
        tof, arr = tof_and_arr(impact.contact)
        peak = float(impact.trajectory.contact_force[:, -1].max())
        rows.append((1e3 * value, first_mode(scene), contact_us, 1e6 * tof, arr, peak))
    mm, _, contact_us, tof_us, arr, _ = np.transpose(rows)

    # slopes d ln y / d ln x at the scene's own value, between its neighbours: what an instrument
    # tells of it
    usual = int(np.argmin(np.abs(np.log(mm / mm[-1] * options.factors[-1]))))
    x = np.log(mm)
    slopes = [
        float((y[usual + 1] - y[usual - 1]) / (x[usual + 1] - x[usual - 1]))
        for y in (np.log(arr), np.log(tof_us))
    ]

    # the value from which on ARR no longer changes
    same = np.abs(arr / arr[-1] - 1) < options.unchanged
    first_same = len(same) - int(np.argmin(same[::-1])) if not same.all() else 0
    # what hardly changes stays level: its axis reaches a tenth of the mean to either side
    figure = []
    for title, unit, y in (
        ("amplitude ratio", "ARR [-]", arr),
        ("time of flight", "TOF [µs]", tof_us),
        ("contact time", "T_c [µs]", contact_us),
    ):
        mean = float(np.nanmean(y))
        limits = (0.9 * mean, 1.1 * mean) if np.ptp(y) < 0.1 * mean / 4 else None
        line = Line(None, mm, y, "o-")
        figure.append(Panel(title, f"{quantity} [mm]", unit, [line], "x", y_limits=limits))
    return concluded(
        module,
        COLUMNS,
        tuple(rows),
        panels(figure, columns=3, size=(4.2, 3.0)),
        quantity=quantity,
        own=mm[usual],
        arr=arr,
        tof=tof_us,
        options=options,
        by_arr=options.arr_known / abs(slopes[0]) if slopes[0] else float("inf"),
        by_tof=1e6 * options.tof_known / tof_us[usual] / abs(slopes[1])
        if slopes[1]
        else float("inf"),
        slopes=slopes,
        unfelt=mm[first_same] if first_same < len(mm) - 1 else None,
    )
