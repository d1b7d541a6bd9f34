"""The reflected wave against the distance of the contact from a clamped edge of a plate.

You will see the amplitude ratio (ARR) fall from that of a half-space at the edge to that of the
infinite plate, for plates of four thicknesses. Near the edge the plate is stiff and little energy
leaves. Away from it the bending waves that left come back from the edge only after the contact. D
is the diameter of a sphere, t the thickness.

Thesis, section 2.2.2.

Run it: python examples/gallery/boundary_distance.py       60 contacts on solid plates: minutes
"""

from pathlib import Path

import numpy as np

from beadwave import coupling, dem, scene
from beadwave.coupling.infinite_plate import group_speed
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.report.tables import aligned_text
from observed import say
from plates import (
    FAINT,
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


def main(ratios=RATIOS, diameters=DIAMETERS, drawn=DRAWN, factors=FACTORS):
    """ARR (ratios, distances), and its largest change by each of the factors."""
    rig = scene("rig-half-space")
    D, deep = diameter(rig), collision(rig, dem.rigid_wall())
    distance, seconds = D * np.array(diameters), deep.contact.seconds

    def size_of(plate):
        # no wave is back before the end of the contact with the infinite plate; fine elements run
        # all along the line of contacts, and the patch does not reach the edge
        until = collision(rig, coupling.infinite_plate(plate)).contact.seconds
        size = sizes(plate, seconds, until)
        return size._replace(contact_seed=distance[0], patch=min(size.patch, distance[0] / 2))

    plates = {ratio: steel_plate(rig, D / ratio) for ratio in ratios}
    hits = {
        ratio: [collision(rig, wall) for wall in edge_walls(plate, size_of(plate), distance)]
        for ratio, plate in plates.items()
    }
    arr = np.array([[hit.arr for hit in row] for row in hits.values()])
    over_far = arr / np.maximum(arr[:, -1:], FAINT**1.2)  # or over the faintest ARR that counts

    # one of them again with mesh and modes varied, at a few distances
    at, size, changes = [diameters.index(d) for d in drawn], size_of(plates[CHECKED]), {}
    for name, varied in factors.items():
        walls = edge_walls(plates[CHECKED], size.scaled(**varied), distance[at])
        off = [
            abs(collision(rig, w).arr - hits[CHECKED][i].arr)
            for w, i in zip(walls, at, strict=True)
        ]
        changes[name] = max(off)

    columns = ("arr", "arr_over_far", "energy_lost_percent", "contact_time_us", "peak_force_N")
    rows = [
        (ratio, 1e3 * float(d), hit.arr, float(share), 100 * hit.lost, 1e6 * hit.contact.seconds,
         hit.peak_force)
        for ratio, shares in zip(ratios, over_far, strict=True)
        for d, hit, share in zip(distance, hits[ratio], shares, strict=True)
    ]  # fmt: skip
    print(aligned_text(("d_over_t", "distance_mm", *columns), rows))

    # distance beyond which ARR stays within CLOSE of that far away; half the way that bending waves
    # make while a contact with a half-space lasts
    critical, echo = [], []
    for plate, shares in zip(plates.values(), over_far, strict=True):
        off = np.abs(shares - shares[-1])
        k = int(np.flatnonzero(off > CLOSE).max(initial=-1))
        critical.append(np.interp(-CLOSE, -off[k : k + 2], distance[k : k + 2]) if k >= 0 else 0.0)
        echo.append(group_speed(plate, np.pi / seconds) * seconds / 2)
    shown = [
        ", ".join(f"{x:.2f}" for x in column) for column in (arr[:, 0], arr[:, -1], over_far[:, 0])
    ]
    mm = [", ".join(f"{1e3 * x:.0f}" for x in values) for values in (critical, echo)]
    say(f"""
        ARR is the amplitude ratio of the reflected wave (equation 2.9) at sphere
        {observed_sphere(rig)}. The plates are of the spheres' steel, clamped at one edge, with the
        other edges beyond the reach of the first collision; the contacts are elastic, without
        preload.

        Thesis: the ARR is high close to the boundary and falls away from it. At
        {1e3 * distance[0]:.0f} mm it is {shown[0]}, {1e3 * distance[-1]:.0f} mm away {shown[1]}
        (half-space {deep.arr:.2f}), at D/t = {", ".join(f"{r:g}" for r in ratios)}.

        Thesis: beyond a critical distance the ARR is constant. It stays within {CLOSE:.0%} from
        {mm[0]} mm on.

        Thesis: the thicker the wall, the smaller that distance, until boundaries can be neglected.
        What decreases is the size of the effect, because a thick plate reflects well anywhere: the
        ARR at the edge is {shown[2]} times that far away. Bending waves become faster with the
        thickness: during a contact with a half-space they return from an edge {mm[1]} mm away
        (group velocity 2 omega / k, half a period in the contact).
        """)
    for name, change in changes.items():
        say(f"D/t = {CHECKED:g}, {name}: the ARR changes by at most {change:.1e}.")

    mm, edge = 1e3 * distance, "distance from the clamped edge [mm]"
    figure, lines = [], ([], [], [], [])
    for ratio, row, reach in zip(ratios, arr, echo, strict=True):
        name, lost = f"D/t = {ratio:g}", np.array([100 * hit.lost for hit in hits[ratio]])
        lines[0].append(Line(name, mm, row, "o-"))
        lines[1].append(Line(name, mm, lost, "o-"))
        lines[2].append(Line(name, distance / reach, (row - row[-1]) / (row[0] - row[-1]), "o-"))
    lines[0].append(Line("half-space", np.array([0.0, mm[-1]]), np.full(2, deep.arr), "--", 5))
    for i in at:
        run = hits[CHECKED][i].trajectory
        lines[3].append(Line(f"{mm[i]:.0f} mm", 1e3 * run.t, run.contact_force[:, -1]))
    for title, x, y, curves in zip(
        ("amplitude ratio (v_back / v_in)^(6/5)", "energy absorbed by the plate",
         "remaining effect of the edge", f"force at the plate, D/t = {CHECKED:g}"),
        (edge, edge, "distance / reach of the bending waves", "time [ms]"),
        ("ARR", "% of the striker's", "(ARR - far) / (edge - far)", "force [N]"),
        lines, strict=True,
    ):  # fmt: skip
        figure.append(Panel(title, x, y, curves))
    Path("boundary_distance.png").write_bytes(panels(figure, columns=2, size=(5.6, 3.4)))
    return arr, changes


if __name__ == "__main__":
    main()
