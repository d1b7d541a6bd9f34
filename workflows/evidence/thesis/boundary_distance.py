"""ARR against the distance of the contact from a clamped edge, for plates of some thicknesses.

Near the edge the plate is stiff and little energy leaves. Away from it the bending waves that left
come back from the edge only after the contact. Thesis, section 2.2.2.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave import coupling, dem
from beadwave.coupling.plate import Plate, group_speed
from beadwave.workflows.evidence.study import concluded, counted
from beadwave.workflows.evidence.thesis import plates
from beadwave.workflows.evidence.thesis.collision import Collision, CollisionRun
from beadwave.workflows.evidence.thesis.plates import PlateSizes
from beadwave.workflows.evidence.thesis.requirements import FEWEST, require_chain
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.progress import Progress

FACTORS = {  # of the sizes of a plate's mesh, each varied alone
    "elements halved": {"seed": 0.5, "contact_seed": 0.5},
    "modes doubled": {"cutoff_hz": 2.0},
}
COLUMNS = (
    "d_over_t", "distance_mm", "arr", "arr_over_far", "energy_lost_percent", "contact_time_us",
    "peak_force_N",
)  # fmt: skip


class BoundaryDistanceOptions(NamedTuple):
    """What the study varies, and what it draws."""

    ratios: tuple[float, ...] = (1.0, 2.0, 4.0, 6.0)  # D/t
    # distances from the edge over the last sphere's diameter, ascending
    diameters: tuple[float, ...] = (
        0.2, 0.4, 0.6, 0.8, 1.2, 1.6, 2.0, 2.4, 2.8, 3.2, 4.0, 5.0, 6.0,
    )  # fmt: skip
    checked: float = 4.0  # D/t at which mesh and modes are varied, and forces are drawn
    drawn: tuple[float, ...] = (0.4, 1.2, 2.0, 6.0)  # distances of these checks and forces
    factors: Mapping[str, Mapping[str, float]] = FACTORS
    close: float = 0.05  # of the ARR far from the edge: within it the edge no longer matters


class EdgeSeries(NamedTuple):
    """Collisions with one plate at growing distances from its clamped edge."""

    ratio: float  # D/t
    plate: Plate
    distance: NDArray[np.float64]  # (k,) [m]
    collisions: list[Collision]
    arr: NDArray[np.float64]  # (k,)

    @property
    def over_far(self) -> NDArray[np.float64]:
        """ARR (k,) over that at the largest distance, or over the faintest ARR that counts."""
        return self.arr / max(self.arr[-1], CollisionRun().faintest_arr)

    def reach(self, half_space: Collision) -> float:
        """Half the way [m] that bending waves make while a contact with a half-space lasts."""
        seconds = half_space.contact.seconds
        return group_speed(self.plate, np.pi / seconds) * seconds / 2

    def critical(self, close: float) -> float:
        """Distance [m] beyond which ARR stays within a share `close` of that far away."""
        difference = np.abs(self.over_far - self.over_far[-1])
        last = int(np.flatnonzero(difference > close).max(initial=-1))
        if last < 0:
            return 0.0
        x, y = self.distance[last : last + 2], difference[last : last + 2]
        return float(x[0] + (y[0] - close) / (y[0] - y[1]) * (x[1] - x[0]))

    @property
    def half_way(self) -> float:
        """Distance [m] at which ARR has fallen half of its way from the edge to far away."""
        middle = (self.arr[0] + self.arr[-1]) / 2
        beyond = int((self.arr < middle).argmax())
        x, y = self.distance[beyond - 1 : beyond + 1], self.arr[beyond - 1 : beyond + 1]
        return float(x[0] + (y[0] - middle) / (y[0] - y[1]) * (x[1] - x[0]))


def boundary_distance(
    scene: Scene, progress: Progress, options: BoundaryDistanceOptions = BoundaryDistanceOptions()
) -> Finding:
    """Reflected waves from plates struck near their clamped edge (thesis, section 2.2.2)."""
    require_chain(scene, FEWEST)
    diameter, checked = plates.diameter(scene), options.checked
    with progress("half-space"):
        deep = plates.collision(scene, dem.rigid_wall())

    def size_of(plate: Plate) -> PlateSizes:
        """Sizes of the plate and of its mesh."""
        # no wave is back before the end of the contact with the infinite plate; fine elements run
        # all along the line of contacts, and the patch does not reach the edge
        until = plates.collision(scene, coupling.infinite_plate(plate)).contact.seconds
        size = plates.sizes(plate, deep.contact.seconds, until)
        nearest = options.diameters[0] * diameter
        return size._replace(contact_seed=nearest, patch=min(size.patch, nearest / 2))

    def struck(ratio: float, size: PlateSizes, diameters: tuple[float, ...]) -> EdgeSeries:
        """One plate struck at these distances from its edge, in diameters of the last sphere."""
        plate, distance = plates.steel(scene, diameter / ratio), diameter * np.array(diameters)
        walls = plates.edge_walls(plate, size, distance)
        collisions = [plates.collision(scene, wall) for wall in walls]
        arr = np.array([collision.arr for collision in collisions])
        return EdgeSeries(ratio, plate, distance, collisions, arr)

    series = []
    for ratio in counted(options.ratios, progress, "plate, D/t = {:g}".format):
        size = size_of(plates.steel(scene, diameter / ratio))
        series.append(struck(ratio, size, options.diameters))

    # one of them again with mesh and modes varied, at a few distances
    base = next(plate for plate in series if plate.ratio == checked)
    at = [options.diameters.index(value) for value in options.drawn]
    size, changes = size_of(base.plate), []
    for name, factors in options.factors.items():
        with progress(f"D/t = {checked:g}, {name}"):
            varied = struck(checked, size.scaled(**factors), options.drawn)
        largest = float(np.abs(varied.arr - base.arr[at]).max())
        changes.append((name, largest, varied.distance.tolist()))

    rows = tuple(
        (
            s.ratio, 1e3 * distance, collision.arr, over_far, 100 * collision.lost,
            1e6 * collision.contact.seconds, collision.peak_force,
        )
        for s in series
        for distance, collision, over_far in zip(s.distance, s.collisions, s.over_far, strict=True)
    )  # fmt: skip

    # over the distance: ARR beside that of a half-space, the energy that leaves
    names = [f"D/t = {s.ratio:g}" for s in series]
    arr, lost, remaining = [], [], []
    for name, s in zip(names, series, strict=True):
        arr.append(Line(name, 1e3 * s.distance, s.arr, "o-"))
        percent = [100 * collision.lost for collision in s.collisions]
        lost.append(Line(name, 1e3 * s.distance, percent, "o-"))
        left = (s.arr - s.arr[-1]) / (s.arr[0] - s.arr[-1])
        remaining.append(Line(name, s.distance / s.reach(deep), left, "o-"))
    ends = np.array([0.0, 1e3 * series[0].distance[-1]])
    arr.append(Line("half-space", ends, np.full(2, deep.arr), "--", 5))

    forces = []
    for i in at:
        run = base.collisions[i].trajectory
        name = f"{1e3 * base.distance[i]:.0f} mm"
        forces.append(Line(name, 1e3 * run.t, run.contact_force[:, -1]))

    critical = [s.critical(options.close) for s in series]
    x = "distance from the clamped edge [mm]"
    figure = [
        Panel("amplitude ratio (v_back / v_in)^(6/5)", x, "ARR", arr),
        Panel("energy absorbed by the plate", x, "% of the striker's", lost),
        Panel(
            "remaining effect of the edge", "distance / reach of the bending waves",
            "(ARR - far) / (edge - far)", remaining,
        ),
        Panel(f"force at the plate, D/t = {base.ratio:g}", "time [ms]", "force [N]", forces),
    ]  # fmt: skip
    return concluded(
        __file__,
        COLUMNS,
        rows,
        panels(figure, columns=2, size=(5.6, 3.4)),
        options=options,
        changes=changes,
        sphere=plates.observed_sphere(scene),
        deep=deep,
        series=series,
        critical=critical,
        higher=all(s.arr[0] > s.arr[-1] for s in series),
        settled=all(d < s.distance[-2] for d, s in zip(critical, series, strict=True)),
        echo=[s.reach(deep) for s in series],
    )
