"""Ten walls before the rig's chain, and whether the thesis' statements about them hold.

You will see the waves that a half-space, a rigid surface, five one-mass walls and three reduced
models of the structure send back, and how far every two walls differ. The measured waveforms are
not in the thesis' text, so the comparison does not show which wall is right: walls are compared
with each other, by the rms difference of velocities at the observed spheres over their rms, within
half the width of a wave (`observed.distance`).

Thesis, section 7.2, figures 7.13 to 7.16.

Run it: python examples/gallery/walls.py       meshes the rig's structure: minutes, once
"""

from itertools import combinations
from pathlib import Path

import numpy as np

from beadwave import dem, scene
from beadwave.workflows.report.plots import panels
from beadwave.workflows.report.tables import aligned_text
from beadwave.workflows.scene import HalfSpaceWall, RigidWall
from beadwave.workflows.stages.chain.chain import chain, initial_velocity
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.engine.progress import quiet
from observed import (
    SPHERES,
    distance,
    impact,
    observed,
    overall,
    record,
    say,
    spread,
    wave_cells,
)

ONE_MASS = {f"1-DOF {hz:g}": hz for hz in (269, 907, 8425, 700, 240)}  # thesis, 7.2 and 7.3
ROMS = {"ROM 269": "rig-rom-269", "ROM 907": "rig-rom-907", "ROM all four": "rig-rom"}
NUMBERS = (1, 2, 3, 4)  # of the reflected waves that the thesis speaks of
# of distances, by which the thesis' words are judged: below UNMOVED a wave does not depend on its
# wall, below SLIGHT it depends slightly, above it strongly
UNMOVED, SLIGHT = 0.1, 0.5
ALIKE = (("ROM 907", "1-DOF 907"), ("ROM 269", "1-DOF 700"), ("half-space", "1-DOF 8425"))
UNLIKE = ("ROM 269", "1-DOF 269")
MOVING = ("1-DOF 269", "1-DOF 907", "1-DOF 700", "1-DOF 240", *ROMS)  # within the contact
FIGURES = {
    "half-space (figure 7.13)": ("half-space", "rigid", "1-DOF 8425"),
    "one mass (figure 7.14)": ("1-DOF 269", "1-DOF 907", "1-DOF 240"),
    "ROM 269 (figure 7.15)": ("ROM 269", "1-DOF 269", "1-DOF 700"),
    "ROM 907 (figure 7.16)": ("ROM 907", "1-DOF 907", "ROM all four"),
}


def rig_walls(changes=(), roms=ROMS):
    """Walls with the surface of a half-space, by name; reduced models of scenes with changes."""
    mass = scene("rig-1dof").wall
    walls = {"half-space": dem.rigid_wall()}
    for name, hz in ONE_MASS.items():
        walls[name] = dem.one_dof_wall(hz, mass.mass, mass.damping_ratio)
    for name, source in roms.items():
        walls[name] = pipeline_of(scene(source, changes), quiet)("wall")
    return walls


def main(changes=(), roms=ROMS):
    """The runs by wall, and the one-mass wall nearest to each wall of ALIKE and UNLIKE, None where
    one of the two sends no fourth wave."""
    rig = scene("rig-rom", changes)
    v0, duration = initial_velocity(rig), rig.time.duration
    plain = chain(rig.but(wall=HalfSpaceWall(kind="half-space")))
    setups = [(name, plain, wall) for name, wall in rig_walls(changes, roms).items()]
    stiff = chain(rig.but(wall=RigidWall(kind="rigid")))  # another surface, so another contact
    setups.insert(1, ("rigid", stiff, dem.rigid_wall()))
    runs = {
        name: observed(name, row, impact(row, wall, v0, duration), SPHERES)
        for name, row, wall in setups
    }

    # when each reflected wave is at a sphere and how fast; how far every two walls differ
    arrivals = [
        (sphere, name, *wave_cells(run, sphere, NUMBERS))
        for sphere in SPHERES
        for name, run in runs.items()
    ]
    distances = [
        (a.name, b.name, *(distance(a, b, k, SPHERES) for k in NUMBERS), overall(a, b, SPHERES))
        for a, b in combinations(runs.values(), 2)
    ]
    columns = [f"{value}_{k}" for k in NUMBERS for value in ("t_ms", "v_m_s")]
    print(aligned_text(("sphere", "wall", *columns), arrivals))
    print("\n" + aligned_text(("one", "other", *(f"D{k}" for k in NUMBERS), "all"), distances))

    # walls are alike where the fourth waves arrive nearest to each other: in the first three, and
    # so over all that comes back, the walls that move hardly differ
    moving = [runs[name] for name in MOVING if name in runs]
    early = max(spread(moving, k, SPHERES) for k in NUMBERS[:-1])
    say(f"""
        Two walls count as alike where no other one-mass wall has a fourth reflected wave that
        arrives nearer to that of the first, at sphere {SPHERES[-1]}. In the first three waves the
        walls that move hardly differ (by at most {early:.3f}).
        """)
    fourth = {name: run.wave(SPHERES[-1], "reflected", 4) for name, run in runs.items()}
    ms = {name: 1e3 * wave.arrival.time for name, wave in fourth.items() if wave}
    nearest = {}
    for wall, mass in (*ALIKE, UNLIKE):
        statement = (
            f'"{wall} {"differs from" if (wall, mass) == UNLIKE else "behaves like"} {mass}"'
        )
        if wall not in ms or mass not in ms:
            nearest[wall, mass] = None
            say(f"{statement}: cannot be judged without fourth waves of both.")
            continue
        masses = [name for name in ONE_MASS if name in ms]
        near = min(masses, key=lambda name: abs(ms[name] - ms[wall]))
        ranked = sorted((overall(runs[wall], runs[name], SPHERES), name) for name in masses)
        nearest[wall, mass] = near
        say(f"""
            {statement} {holds((near == mass) != ((wall, mass) == UNLIKE))}: the fourth waves
            arrive at {ms[wall]:.2f} and {ms[mass]:.2f} ms, the nearest is that of {near} at
            {ms[near]:.2f} ms. Over all that comes back the nearest walls are {ranked[0][1]}
            ({ranked[0][0]:.3f}) and {ranked[1][1]} ({ranked[1][0]:.3f}).
            """)

    # the rigid wall has another contact: judged by itself
    same_surface = [run for name, run in runs.items() if name != "rigid"]
    at_each = {k: {s: spread(same_surface, k, (s,)) for s in SPHERES} for k in NUMBERS}
    second, third, last = (spread(same_surface, k, SPHERES) for k in NUMBERS[1:])
    independent = holds(all(value < UNMOVED for value in at_each[1].values()))
    by_sphere = ", ".join(f"{value:.3f} at sphere {s}" for s, value in at_each[1].items())
    rigid = distance(runs["rigid"], runs["half-space"], 1, SPHERES)
    second_at = {s: value for s, value in at_each[2].items() if not np.isnan(value)}
    mainly_at_4 = bool(second_at) and second_at.get(4) == max(second_at.values())
    say(f"""
        "The first reflected wave is independent of the wall" {independent}: the largest
        distance of two walls is {by_sphere}; where it is large the second wave has caught up with
        the first. Between a half-space and a rigid surface, which
        makes a stiffer contact, it is {rigid:.3f}.

        "The second depends slightly on it" {holds(UNMOVED <= second < SLIGHT)}, {second:.3f}.
        "... and mainly at sphere 4" {holds(mainly_at_4)},
        {", ".join(f"{value:.3f} at sphere {s}" for s, value in second_at.items())}.

        "The third depends strongly on it" {holds(third > SLIGHT)}, {third:.3f}.
        "The fourth depends strongly on it" {holds(last > SLIGHT)}, {last:.3f}.

        A distance of 0 means equal waves, 1.41 waves that do not meet; a wave is called independent
        of its wall below {UNMOVED}, slightly dependent below {SLIGHT} and strongly dependent above.
        """)

    figure = [
        record(f"{title}, sphere {s}", [runs[name] for name in names if name in runs], s)
        for title, names in FIGURES.items()
        for s in SPHERES
    ]
    Path("walls.png").write_bytes(panels(figure, columns=len(SPHERES), size=(4.6, 2.7)))
    return runs, nearest


def holds(statement):
    """Words for whether a statement holds."""
    return "holds" if statement else "does not hold"


if __name__ == "__main__":
    main()
