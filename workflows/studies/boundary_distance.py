"""ARR against the distance of the contact from a clamped edge, for plates of some thicknesses.

Near the edge the plate is stiff and little energy leaves. Away from it the bending waves that left
come back from the edge only after the contact. Thesis, section 2.2.2.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import coupling
import dem
from workflows.run_folder import Picture
from workflows.scene import Scene
from workflows.stages import Watch
from workflows.studies import plates
from workflows.studies.plates import Blow, Sizes
from workflows.study import Finding
from workflows.study_figures import Line, Panel, panels

RATIOS = (1.0, 2.0, 4.0, 6.0)  # D/t
DIAMETERS = (0.2, 0.4, 0.6, 0.8, 1.2, 1.6, 2.0, 2.4, 2.8, 3.2, 4.0, 5.0, 6.0)  # distances
CHECKED = 4.0  # D/t at which mesh and modes are varied
CLOSE = 0.05  # of the ARR far from the edge: where the edge no longer matters
SHOWN = (0.4, 1.2, 2.0, 6.0)  # distances whose forces are drawn and whose ARR is checked

VARIED = {"elements halved": plates.refined, "modes doubled": plates.with_more_modes}
COLUMNS = (
    "d_over_t", "distance_mm", "arr", "arr_over_far", "energy_lost_percent", "contact_time_us",
    "peak_force_N",
)  # fmt: skip


class Series(NamedTuple):
    """One plate struck at all distances."""

    ratio: float  # D/t
    plate: coupling.Plate
    distance: NDArray[np.float64]  # (k,) [m]
    blows: list[Blow]

    @property
    def arr(self) -> NDArray[np.float64]:
        """(k,)"""
        return np.array([blow.arr for blow in self.blows])

    @property
    def far(self) -> float:
        """ARR at the largest distance."""
        return self.blows[-1].arr

    @property
    def over_far(self) -> NDArray[np.float64]:
        """ARR over that far away, or over what could just be seen (k,)."""
        return self.arr / max(self.far, plates.FAINTEST_ARR)

    @property
    def critical(self) -> float:
        """Distance [m] beyond which ARR stays within CLOSE of that far away."""
        away = np.abs(self.over_far - self.over_far[-1])
        last = int(np.flatnonzero(away > CLOSE).max(initial=-1))
        if last < 0:
            return 0.0
        x, y = self.distance[last : last + 2], away[last : last + 2]
        return float(x[0] + (y[0] - CLOSE) / (y[0] - y[1]) * (x[1] - x[0]))

    @property
    def half_way(self) -> float:
        """Distance [m] at which ARR has fallen half of its way from the edge to far away."""
        middle = (self.arr[0] + self.far) / 2
        beyond = int((self.arr < middle).argmax())
        x, y = self.distance[beyond - 1 : beyond + 1], self.arr[beyond - 1 : beyond + 1]
        return float(x[0] + (y[0] - middle) / (y[0] - y[1]) * (x[1] - x[0]))


def boundary_distance(scene: Scene, watch: Watch) -> Finding:
    """Plates of several thicknesses struck on a line away from their clamped edge."""
    plates.require_chain(scene)
    with watch("half-space"):
        deep = plates.blow(scene, dem.rigid_wall())
    found = []
    for ratio in RATIOS:
        with watch(f"plate, D/t = {ratio:g}"):
            found.append(_series(scene, ratio, _size(scene, ratio, deep)))
    base, checks = _size(scene, CHECKED, deep), []
    for name, varied in VARIED.items():
        with watch(f"D/t = {CHECKED:g}, {name}"):
            checks.append((name, _series(scene, CHECKED, varied(base), SHOWN)))
    rows = tuple(row for series in found for row in _rows(series))
    drawn = Picture("study_boundary_distance", _picture(scene, deep, found))
    sentences = _sentences(scene, deep, found, checks)
    return Finding("boundary-distance", COLUMNS, rows, sentences, (drawn,))


def _size(scene: Scene, ratio: float, deep: Blow) -> Sizes:
    plate = plates.steel(scene, plates.diameter(scene) / ratio)
    until = plates.blow(scene, coupling.infinite_plate(plate)).contact.seconds
    size = plates.sizes(plate, deep.contact.seconds, until)
    # fine elements run all along the line of contacts
    nearest = DIAMETERS[0] * plates.diameter(scene)
    return size._replace(contact_seed=nearest, patch=min(size.patch, nearest / 2))


def _series(
    scene: Scene, ratio: float, size: Sizes, diameters: tuple[float, ...] | None = None
) -> Series:
    plate = plates.steel(scene, plates.diameter(scene) / ratio)
    distance = plates.diameter(scene) * np.array(diameters or DIAMETERS)
    walls = plates.edge_walls(plate, size, distance)
    return Series(ratio, plate, distance, [plates.blow(scene, wall) for wall in walls])


def _rows(series: Series):
    for distance, blow, over in zip(series.distance, series.blows, series.over_far, strict=True):
        yield (
            series.ratio, 1e3 * distance, blow.arr, over, 100 * blow.lost,
            1e6 * blow.contact.seconds, blow.peak_force,
        )  # fmt: skip


def _sentences(scene: Scene, deep: Blow, found: list[Series], checks) -> tuple[str, ...]:
    stiffer = plates.verdict(all(series.arr[0] > series.far for series in found))
    settled = plates.verdict(all(s.critical < s.distance[-2] for s in found))
    return (
        f"ARR is (2.9) at sphere {plates.watched(scene)}; plates of the spheres' steel, clamped at "
        "one edge, the others out of reach of the first collision; elastic contacts, no preload.",
        f"Thesis: ARR is high close to the boundary and falls away from it. {stiffer}: at "
        f"{1e3 * found[0].distance[0]:.0f} mm it is {_listed(found, lambda s: s.arr[0])}, "
        f"{1e3 * found[0].distance[-1]:.0f} mm away {_listed(found, lambda s: s.far)} (half-space "
        f"{deep.arr:.2f}), at D/t = {', '.join(f'{s.ratio:g}' for s in found)}.",
        f"Thesis: beyond a critical distance ARR is constant. {settled}: within "
        f"{100 * CLOSE:.0f} % from {_listed(found, lambda s: 1e3 * s.critical, '.0f')} mm on.",
        *_thickness(deep, found),
        *(_change(name, _at(found, CHECKED), series) for name, series in checks),
    )


def _listed(found: list[Series], value, form: str = ".2f") -> str:
    *first, last = (format(value(series), form) for series in found)
    return f"{', '.join(first)} and {last}"


def _at(found: list[Series], ratio: float) -> Series:
    return next(series for series in found if series.ratio == ratio)


def _echo_distance(series: Series, deep: Blow) -> float:
    """Half the way [m] that bending waves make while a contact with a half-space lasts."""
    seconds = deep.contact.seconds
    return coupling.group_speed(series.plate, np.pi / seconds) * seconds / 2


def _thickness(deep: Blow, found: list[Series]) -> tuple[str, ...]:
    return (
        "Thesis: the thicker the wall, the smaller that distance, until boundaries can be "
        f"neglected. At D/t = {found[0].ratio:g} it still is {1e3 * found[0].critical:.0f} mm. "
        "What shrinks is the size of the effect, since a thick plate reflects well anywhere: ARR "
        "at the edge is "
        f"{_listed(found, lambda s: s.over_far[0])} times that far away. The distance over "
        "which half of the change happens grows with the thickness, "
        f"{_listed(found, lambda s: 1e3 * s.half_way, '.0f')} mm, as bending waves grow faster: "
        "while a contact with a half-space lasts they come back from an edge "
        f"{_listed(found, lambda s: 1e3 * _echo_distance(s, deep), '.0f')} mm away (2 omega / k, "
        "half a period in the contact).",
    )


def _change(name: str, base: Series, other: Series) -> str:
    at = [DIAMETERS.index(value) for value in SHOWN]
    change = np.abs(other.arr - base.arr[at]).max()
    millimetres = ", ".join(f"{1e3 * distance:.0f}" for distance in other.distance)
    return f"D/t = {base.ratio:g}, {name}: ARR changes by {change:.1e} at most ({millimetres} mm)."


def _picture(scene: Scene, deep: Blow, found: list[Series]) -> bytes:
    x = "distance from the clamped edge [mm]"
    ends = np.array([0.0, 1e3 * found[0].distance[-1]])
    arr = [Line(f"D/t = {s.ratio:g}", 1e3 * s.distance, s.arr, "o-") for s in found]
    arr.append(Line("half-space", ends, np.full(2, deep.arr), "--", 5))
    lost = [
        Line(f"D/t = {s.ratio:g}", 1e3 * s.distance, [100 * b.lost for b in s.blows], "o-")
        for s in found
    ]
    scaled = [
        Line(f"D/t = {s.ratio:g}", s.distance / _echo_distance(s, deep), _fallen(s), "o-")
        for s in found
    ]
    return panels(
        [
            Panel("amplitude ratio of the reflected wave (2.9)", x, "ARR", arr),
            Panel("energy that the plate takes", x, "% of the striker's", lost),
            Panel(
                "what is left of the edge's effect", "distance / reach of the bending waves",
                "(ARR - far) / (edge - far)", scaled,
            ),
            _forces(scene, _at(found, CHECKED)),
        ],
        columns=2,
        size=(5.6, 3.4),
    )  # fmt: skip


def _fallen(series: Series) -> NDArray[np.float64]:
    return (series.arr - series.far) / (series.arr[0] - series.far)


def _forces(scene: Scene, series: Series) -> Panel:
    near = [DIAMETERS.index(value) for value in SHOWN]
    lines = [
        Line(
            f"{1e3 * series.distance[i]:.0f} mm", 1e3 * series.blows[i].trajectory.t,
            series.blows[i].trajectory.contact_force[:, -1],
        )
        for i in near
    ]  # fmt: skip
    return Panel(f"force at the plate, D/t = {series.ratio:g}", "time [ms]", "force [N]", lines)
