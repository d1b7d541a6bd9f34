"""ARR against the distance of the contact from a clamped edge, for plates of some thicknesses.

Near the edge the plate is stiff and little energy leaves. Away from it the bending waves that left
come back from the edge only after the contact. Thesis, section 2.2.2.
"""

from typing import Any, NamedTuple

import numpy as np

import coupling
import dem
from workflows.evidence.prose import rendered
from workflows.evidence.thesis import plate_sizes, plates
from workflows.evidence.thesis.collision import Collision
from workflows.evidence.thesis.edge_series import CLOSE, Series
from workflows.evidence.thesis.plate_sizes import Sizes
from workflows.evidence.thesis.requirements import FEWEST, require_chain
from workflows.files.run_folder import Picture
from workflows.report.finding import Finding
from workflows.report.plots import Line, Panel, panels
from workflows.report.tables import Table
from workflows.scene import Scene
from workflows.stages.pipeline import Progress

RATIOS = (1.0, 2.0, 4.0, 6.0)  # D/t
DIAMETERS = (0.2, 0.4, 0.6, 0.8, 1.2, 1.6, 2.0, 2.4, 2.8, 3.2, 4.0, 5.0, 6.0)  # distances
CHECKED = 4.0  # D/t at which mesh and modes are varied
SHOWN = (0.4, 1.2, 2.0, 6.0)  # distances whose forces are drawn and whose ARR is checked

VARIED = {"elements halved": plate_sizes.refined, "modes doubled": plate_sizes.with_more_modes}
COLUMNS = (
    "d_over_t", "distance_mm", "arr", "arr_over_far", "energy_lost_percent", "contact_time_us",
    "peak_force_N",
)  # fmt: skip


def boundary_distance(scene: Scene, progress: Progress) -> Finding:
    """Reflected waves from plates struck near their clamped edge (thesis, section 2.2.2)."""
    require_chain(scene, FEWEST)
    with progress("half-space"):
        deep = plates.collision(scene, dem.rigid_wall())
    found = []
    for ratio in RATIOS:
        with progress(f"plate, D/t = {ratio:g}"):
            found.append(_series(scene, ratio, _size(scene, ratio, deep)))
    base, checks = _size(scene, CHECKED, deep), []
    for name, varied in VARIED.items():
        with progress(f"D/t = {CHECKED:g}, {name}"):
            checks.append((name, _series(scene, CHECKED, varied(base), SHOWN)))
    rows = tuple(row for series in found for row in _rows(series))
    drawn = Picture("study_boundary_distance", _picture(scene, deep, found))
    changes = [_change(name, _at(found, CHECKED), series) for name, series in checks]
    numbers = _numbers(scene, deep, found)
    sentences = rendered(__file__, checked=CHECKED, changes=changes, **numbers)
    return Finding((Table("boundary-distance", COLUMNS, rows),), sentences, (drawn,))


def _size(scene: Scene, ratio: float, deep: Collision) -> Sizes:
    plate = plates.steel(scene, plates.diameter(scene) / ratio)
    until = plates.collision(scene, coupling.infinite_plate(plate)).contact.seconds
    size = plate_sizes.sizes(plate, deep.contact.seconds, until)
    # fine elements run all along the line of contacts
    nearest = DIAMETERS[0] * plates.diameter(scene)
    return size._replace(contact_seed=nearest, patch=min(size.patch, nearest / 2))


def _series(
    scene: Scene, ratio: float, size: Sizes, diameters: tuple[float, ...] | None = None
) -> Series:
    plate = plates.steel(scene, plates.diameter(scene) / ratio)
    distance = plates.diameter(scene) * np.array(diameters or DIAMETERS)
    walls = plates.edge_walls(plate, size, distance)
    return Series(ratio, plate, distance, [plates.collision(scene, wall) for wall in walls])


def _rows(series: Series):
    for distance, one, over in zip(
        series.distance, series.collisions, series.over_far, strict=True
    ):
        yield (
            series.ratio, 1e3 * distance, one.arr, over, 100 * one.lost,
            1e6 * one.contact.seconds, one.peak_force,
        )  # fmt: skip


def _numbers(scene: Scene, deep: Collision, found: list[Series]) -> dict[str, Any]:
    return {
        "sphere": plates.observed_sphere(scene),
        "deep": deep,
        "found": found,
        "close": CLOSE,
        "higher": all(series.arr[0] > series.far for series in found),
        "settled": all(series.critical < series.distance[-2] for series in found),
        "echo": [series.reach(deep) for series in found],
    }


def _at(found: list[Series], ratio: float) -> Series:
    return next(series for series in found if series.ratio == ratio)


class Change(NamedTuple):
    """Largest change of ARR at some distances [m] when a series is varied."""

    varied: str
    arr: float
    distance: list[float]


def _change(name: str, base: Series, other: Series) -> Change:
    at = [DIAMETERS.index(value) for value in SHOWN]
    return Change(name, float(np.abs(other.arr - base.arr[at]).max()), other.distance.tolist())


def _picture(scene: Scene, deep: Collision, found: list[Series]) -> bytes:
    x = "distance from the clamped edge [mm]"
    ends = np.array([0.0, 1e3 * found[0].distance[-1]])
    arr = [Line(f"D/t = {s.ratio:g}", 1e3 * s.distance, s.arr, "o-") for s in found]
    arr.append(Line("half-space", ends, np.full(2, deep.arr), "--", 5))
    lost = [
        Line(f"D/t = {s.ratio:g}", 1e3 * s.distance, [100 * b.lost for b in s.collisions], "o-")
        for s in found
    ]
    scaled = [
        Line(f"D/t = {s.ratio:g}", s.distance / s.reach(deep), s.remaining, "o-") for s in found
    ]
    return panels(
        [
            Panel("amplitude ratio (v_back / v_in)^(6/5)", x, "ARR", arr),
            Panel("energy absorbed by the plate", x, "% of the striker's", lost),
            Panel(
                "remaining effect of the edge", "distance / reach of the bending waves",
                "(ARR - far) / (edge - far)", scaled,
            ),
            _forces(scene, _at(found, CHECKED)),
        ],
        columns=2,
        size=(5.6, 3.4),
    )  # fmt: skip


def _forces(scene: Scene, series: Series) -> Panel:
    near = [DIAMETERS.index(value) for value in SHOWN]
    lines = [
        Line(
            f"{1e3 * series.distance[i]:.0f} mm", 1e3 * series.collisions[i].trajectory.t,
            series.collisions[i].trajectory.contact_force[:, -1],
        )
        for i in near
    ]  # fmt: skip
    return Panel(f"force at the plate, D/t = {series.ratio:g}", "time [ms]", "force [N]", lines)
