"""The reflected wave against the distance of the contact from a clamped edge of a plate.

You will see the amplitude ratio (ARR) fall from that of a half-space at the edge to that of the
infinite plate, for plates of four thicknesses. Near the edge the plate is stiff and little energy
leaves. Away from it the bending waves that left come back from the edge only after the contact. D is
the diameter of a sphere, t the thickness.

Thesis, section 2.2.2.

Run it: python examples/gallery/boundary_distance.py       60 contacts on solid plates: minutes
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from beadwave import coupling, dem, scene
from beadwave.coupling.plate import Plate, group_speed
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.report.tables import aligned_text

from observed import say
from plates import (
    FAINT,
    Collision,
    collision,
    diameter,
    edge_walls,
    observed_sphere,
    sizes,
    steel_plate,
)

RATIOS = (1.0, 2.0, 4.0, 6.0)  # D/t
# distances from the edge over the last sphere's diameter, ascending
DIAMETERS = (0.2, 0.4, 0.6, 0.8, 1.2, 1.6, 2.0, 2.4, 2.8, 3.2, 4.0, 5.0, 6.0)
CHECKED = 4.0  # D/t at which mesh and modes are varied, each alone, and forces are drawn
DRAWN = (0.4, 1.2, 2.0, 6.0)  # distances of these checks and forces, in diameters
FACTORS = {
    "elements halved": {"seed": 0.5, "contact_seed": 0.5},
    "modes doubled": {"cutoff_hz": 2.0},
}
CLOSE = 0.05  # of the ARR far from the edge: within it the edge no longer matters


class Series(NamedTuple):
    """Collisions with one plate at growing distances from its clamped edge."""

    plate: Plate
    distance: np.ndarray  # (k,) [m]
    collisions: list[Collision]
    arr: np.ndarray  # (k,)
    over_far: np.ndarray  # (k,) ARR over that at the largest distance, or the faintest that counts


def main(ratios=RATIOS, diameters=DIAMETERS, drawn=DRAWN, factors=FACTORS):
    """ARR (ratios, distances), and its largest change by each of the factors."""
    rig = scene("rig-half-space")
    D, deep = diameter(rig), collision(rig, dem.rigid_wall())

    def size_of(plate):
        # no wave is back before the end of the contact with the infinite plate; fine elements run
        # all along the line of contacts, and the patch does not reach the edge
        until = collision(rig, coupling.infinite_plate(plate)).contact.seconds
        size, nearest = sizes(plate, deep.contact.seconds, until), diameters[0] * D
        return size._replace(contact_seed=nearest, patch=min(size.patch, nearest / 2))

    def struck(plate, size, diameters):
        distance = D * np.array(diameters)
        collisions = [collision(rig, wall) for wall in edge_walls(plate, size, distance)]
        arr = np.array([hit.arr for hit in collisions])
        return Series(plate, distance, collisions, arr, arr / max(arr[-1], FAINT**1.2))

    plates = {ratio: steel_plate(rig, D / ratio) for ratio in ratios}
    series = {ratio: struck(plate, size_of(plate), diameters) for ratio, plate in plates.items()}

    # one of them again with mesh and modes varied, at a few distances
    base, changes = series[CHECKED], {}
    at, size = [diameters.index(value) for value in drawn], size_of(base.plate)
    for name, varied in factors.items():
        arr = struck(base.plate, size.scaled(**varied), drawn).arr
        changes[name] = float(np.abs(arr - base.arr[at]).max())

    columns = (
        "d_over_t", "distance_mm", "arr", "arr_over_far", "energy_lost_percent", "contact_time_us",
        "peak_force_N",
    )  # fmt: skip
    rows = [
        (ratio, 1e3 * float(distance), hit.arr, float(over_far), 100 * hit.lost,
         1e6 * hit.contact.seconds, hit.peak_force)
        for ratio, s in series.items()
        for distance, hit, over_far in zip(s.distance, s.collisions, s.over_far, strict=True)
    ]  # fmt: skip
    print(aligned_text(columns, rows))

    critical, half_way, echo = [], [], []
    for s in series.values():
        # distance beyond which ARR stays within CLOSE of that far away
        off = np.abs(s.over_far - s.over_far[-1])
        last = int(np.flatnonzero(off > CLOSE).max(initial=-1))
        critical.append(0.0)
        if last >= 0:
            x, y = s.distance[last : last + 2], off[last : last + 2]
            critical[-1] = float(x[0] + (y[0] - CLOSE) / (y[0] - y[1]) * (x[1] - x[0]))

        # distance at which ARR has fallen half of its way from the edge to far away
        middle = (s.arr[0] + s.arr[-1]) / 2
        beyond = int((s.arr < middle).argmax())
        x, y = s.distance[beyond - 1 : beyond + 1], s.arr[beyond - 1 : beyond + 1]
        half_way.append(float(x[0] + (y[0] - middle) / (y[0] - y[1]) * (x[1] - x[0])))

        # half the way that bending waves make while a contact with a half-space lasts
        seconds = deep.contact.seconds
        echo.append(group_speed(s.plate, np.pi / seconds) * seconds / 2)

    def millimetres(values):
        return ", ".join(f"{1e3 * value:.0f}" for value in values)

    def shares(values):
        return ", ".join(f"{value:.2f}" for value in values)

    of_ratios, near, far = ", ".join(f"{r:g}" for r in ratios), base.distance[0], base.distance[-1]
    say(f"""
        ARR is the amplitude ratio of the reflected wave (equation 2.9) at sphere
        {observed_sphere(rig)}. The plates are of the spheres' steel, clamped at one edge, with the
        other edges beyond the reach of the first collision; the contacts are elastic, without
        preload.

        Thesis: the ARR is high close to the boundary and falls away from it. At {1e3 * near:.0f} mm
        it is {shares(s.arr[0] for s in series.values())}, {1e3 * far:.0f} mm away
        {shares(s.arr[-1] for s in series.values())} (half-space {deep.arr:.2f}), at D/t =
        {of_ratios}.

        Thesis: beyond a critical distance the ARR is constant. It stays within {CLOSE:.0%} from
        {millimetres(critical)} mm on.

        Thesis: the thicker the wall, the smaller that distance, until boundaries can be neglected.
        What decreases is the size of the effect, because a thick plate reflects well anywhere: the
        ARR at the edge is {shares(s.over_far[0] for s in series.values())} times that far away. The
        distance over which half of the change happens grows with the thickness,
        {millimetres(half_way)} mm, because bending waves become faster: during a contact with a
        half-space they return from an edge {millimetres(echo)} mm away (group velocity 2 omega / k,
        half a period in the contact).
        """)
    for name, change in changes.items():
        say(f"""
            D/t = {CHECKED:g}, {name}: the ARR changes by at most {change:.1e} (at
            {millimetres(base.distance[at])} mm).
            """)

    # over the distance: ARR beside that of a half-space, the energy that leaves, what is left of
    # the edge's effect; forces at the checked plate
    arr, lost, remaining = [], [], []
    for (ratio, s), reach in zip(series.items(), echo, strict=True):
        name, mm = f"D/t = {ratio:g}", 1e3 * s.distance
        arr.append(Line(name, mm, s.arr, "o-"))
        lost.append(Line(name, mm, np.array([100 * hit.lost for hit in s.collisions]), "o-"))
        left = (s.arr - s.arr[-1]) / (s.arr[0] - s.arr[-1])
        remaining.append(Line(name, s.distance / reach, left, "o-"))
    arr.append(Line("half-space", np.array([0.0, 1e3 * far]), np.full(2, deep.arr), "--", 5))
    forces = []
    for i in at:
        run = base.collisions[i].trajectory
        name = f"{1e3 * base.distance[i]:.0f} mm"
        forces.append(Line(name, 1e3 * run.t, run.contact_force[:, -1]))
    x = "distance from the clamped edge [mm]"
    figure = [
        Panel("amplitude ratio (v_back / v_in)^(6/5)", x, "ARR", arr),
        Panel("energy absorbed by the plate", x, "% of the striker's", lost),
        Panel("remaining effect of the edge", "distance / reach of the bending waves",
              "(ARR - far) / (edge - far)", remaining),
        Panel(f"force at the plate, D/t = {CHECKED:g}", "time [ms]", "force [N]", forces),
    ]  # fmt: skip
    Path("boundary_distance.png").write_bytes(panels(figure, columns=2, size=(5.6, 3.4)))
    return np.array([s.arr for s in series.values()]), changes


if __name__ == "__main__":
    main()
