"""The rig's unknowns: which statements of the thesis hold as each of them is varied.

You will see, for the default and 22 changes, how many reflected waves spheres 1, 4 and 14 see and
how many of the thesis' statements on its experiment hold. The text gives neither preload, leaf
springs, dissipation, the arm's or the wall's mass, nor the spheres' radius: each row changes one of
them and runs the chain before all walls of `walls.rig_walls` again.

Thesis, sections 6.1, 7.1 and 7.2.

Run it: python examples/gallery/rig.py       some 250 runs: minutes
"""

from itertools import pairwise
from pathlib import Path

import numpy as np

from beadwave import scene
from beadwave.dem.waves.fit import Guess, apart
from beadwave.workflows.report.plots import panels
from beadwave.workflows.report.tables import aligned_text
from beadwave.workflows.scene import HalfSpaceWall, LeafSpringsTable, Preload
from beadwave.workflows.stages.chain.chain import chain, contact_radius, initial_velocity, start
from observed import SPHERES, impact, observed, record, say, spread
from walls import NUMBERS, ROMS, SLIGHT, UNMOVED, rig_walls

WAVES_SEEN = {1: (1,), 4: (1, 2, 3), 14: (1, 2, 3, 4)}  # reflected waves by sphere within 3 ms
NEAR_0_3_MM = (0.25e-3, 0.4e-3)  # [m] radius of the contact "near 0.3 mm"
MAIN, ONE_MASS = "ROM all four", "1-DOF 907"
FIGURE_ONLY = "1-DOF 700"  # a wall of a figure alone
# hundreds of runs, whose differences are larger than this error; a sphere sees waves of a twentieth
# of the striker's speed
ERROR, N_SAVE, VISIBLE = 1e-3, 1500, 0.05
LEAF_STIFFNESS = 200.0  # [N/m] of leaf springs where the scene has none
# of an arm without mass: pull [N], press [N] of each leaf spring
LIGHT_ARMS = tuple((force, press) for force in (5.0, 15.0, 40.0, 80.0) for press in (0.0, 0.3, 1.0))


def main(changes=(), roms=ROMS, n_changes=None, light_arms=LIGHT_ARMS):
    """Statements (9,) of the thesis, which of them hold by default and in each change; reflected
    waves at SPHERES of an arm without mass, by chain and wall."""
    rig = scene("rig-rom", changes)
    walls = rig_walls(changes, roms)
    walls.pop(FIGURE_ONLY)

    # the default, then one unknown after the other, each before all walls
    cases = [("default", None, rig, None), *variations(rig)][:n_changes]
    runs, verdicts = [], []
    for _, _, varied, wall_mass in cases:
        by_wall = {name: run_of(varied, name, wall, wall_mass) for name, wall in walls.items()}
        runs.append(by_wall)
        verdicts.append(judged(varied, by_wall))
    default, hold = runs[0], np.array([[holds for _, holds, _ in each] for each in verdicts])

    # by how much each reflected wave at the outermost sphere is later and higher than by default,
    # on a wall that the change reaches
    rows = []
    for (unknown, value, _, wall_mass), by_wall, holding in zip(cases, runs, hold, strict=True):
        wall = ONE_MASS if wall_mass else MAIN
        times, peaks = [], []
        for k in NUMBERS:
            before, after = (x[wall].wave(SPHERES[-1], "reflected", k) for x in (default, by_wall))
            if before is None or after is None:
                times.append(None)
                peaks.append(None)
                continue
            # to tenths, runs hold no more; + 0.0 leaves no minus zero
            a, b = before.arrival, after.arrival
            times.append(round(1e6 * (b.time - a.time), 1) + 0.0)
            peaks.append(round(100 * (b.peak_velocity / a.peak_velocity - 1), 1) + 0.0)
        waves = "/".join(str(len(by_wall[MAIN].reflected(sphere))) for sphere in SPHERES)
        rows.append((unknown, value, waves, f"{holding.sum()}/{len(holding)}", *times, *peaks))
    late, high = [f"t{k}_us" for k in NUMBERS], [f"v{k}_%" for k in NUMBERS]
    print(aligned_text(("unknown", "value", "seen", "hold", *late, *high), rows))
    say(f"""
        The table counts reflected waves of at least {VISIBLE:.0%} of the striker's speed at spheres
        1, 4, 14 and the statements that hold, and says by how much the waves 1 to 4 are later [µs]
        and higher [%] at sphere 14 than by default, on the wall {MAIN} ({ONE_MASS} where the mass
        of that wall changes). A delay of more than 100 µs, about the width of a wave, means that
        another wave has taken the number. The defaults are inferred from the statements below, none
        is measured (`beadwave scene rig-rom` gives the reasons).
        """)
    print()
    for (statement, holds, number), count in zip(verdicts[0], hold[1:].sum(axis=0), strict=True):
        word = "holds" if holds else "does not hold"
        print(f'- "{statement}" {word} ({number}), in {count} of {len(hold) - 1} changes')
    best = int(hold[1:].sum(axis=1).argmax()) + 1
    say(f"""
        The default makes {hold[0].sum()} of {hold.shape[1]} statements true, the best change
        ({cases[best][0]} = {cases[best][1]:g}) {hold[best].sum()}.
        """)

    # an arm without mass: the waves that come back to each chain and wall, and the distance of the
    # second ones before different walls
    tried = {name: walls[name] for name in (MAIN, "half-space", "1-DOF 240")}
    counts, second = [], []
    for force, press in light_arms:
        light = pressed(rig, LEAF_STIFFNESS, press).but(preload=Preload(force=force, mass=0.0))
        light_runs = [run_of(light, name, wall, None) for name, wall in tried.items()]
        counts += [[len(run.reflected(sphere)) for sphere in SPHERES] for run in light_runs]
        second.append(spread(light_runs, 2, SPHERES[1:]))
    wanted, second = [len(numbers) for numbers in WAVES_SEEN.values()], np.array(second)
    n_slight = int(((second >= UNMOVED) & (second < SLIGHT)).sum())
    most = max(counts, key=lambda n: (n == wanted, n[1], n[2]))
    say(f"""
        An arm without mass: of {len(counts)} combinations of chain and wall {counts.count(wanted)}
        show {"/".join(map(str, wanted))} reflected waves at spheres 1, 4, 14; the most at sphere 4
        are {"/".join(map(str, most))}. The second waves depend slightly on the wall, as in the
        thesis, with {n_slight} of {len(light_arms)} preloads and leaf springs (distance
        {np.nanmin(second):.2f} to {np.nanmax(second):.2f}). The second wave of the rig arises at
        the heavy last sphere, before the wall has moved.
        """)

    drawn = [default[name] for name in (MAIN, "half-space", ONE_MASS, "1-DOF 240")]
    figure = [record(f"sphere {s}", drawn, s) for s in SPHERES]
    Path("rig.png").write_bytes(panels(figure, size=(8, 2.6)))
    return [statement for statement, _, _ in verdicts[0]], hold, np.array(counts)


def variations(rig):
    """The unknown, its value, the scene with it, and the mass [kg] of the one-mass walls if that is
    the unknown; one is changed at a time."""
    arm, leaf = rig.preload or Preload(), rig.leaf_springs or LeafSpringsTable()
    stiffness = float(np.max(leaf.stiffness)) or LEAF_STIFFNESS
    press = float(np.max(np.asarray(leaf.stiffness) * np.asarray(leaf.offset)))
    for mass in (0.0, 0.034, 0.067, 0.1, 0.17):
        yield "arm's mass [kg]", mass, rig.but(preload=arm.but(mass=mass)), None
    for force in (5.0, 10.0, 25.0, 50.0):
        yield "preload [N]", force, rig.but(preload=arm.but(force=force)), None
    for value in (0.0, 0.1, 1.0):
        yield "leaf press [N]", value, pressed(rig, stiffness, value), None
    for value in (50.0, 1000.0):
        yield "leaf [N/m]", value, pressed(rig, value, press), None
    for value in (0.05, 0.2):
        lossy = {"dissipation": "hunt-crossley", "coefficient": value}
        yield "dissipation [s/m]", value, rig.but(contact=lossy), None
    stiff_end = (*(1.0,) * (rig.n_contacts - 1), 3.0)
    yield "wall's factor", 3.0, rig.but(contact={"stiffness_factor": stiff_end}), None
    for radius in (0.0120, 0.0135):
        yield "radius [m]", radius, rig.but(chain={"radius": radius}), None
    for mass in (1.0, 4.2, 10.0):
        yield "1-DOF mass [kg]", mass, rig, mass


def pressed(rig, stiffness, press):
    """The rig with leaf springs that press with `press` [N] each, without any for 0."""
    if not press:
        return rig.but(leaf_springs=None)
    return rig.but(leaf_springs=LeafSpringsTable(stiffness=stiffness, offset=press / stiffness))


def run_of(rig, name, wall, wall_mass):
    """The rig's chain before one of the walls, of another mass [kg] if it is one of one mass."""
    if wall_mass and name.startswith("1-DOF"):
        wall = wall._replace(phi=np.full(1, wall_mass**-0.5))
    row = chain(rig.but(wall=HalfSpaceWall(kind="half-space")))
    run = impact(row, wall, initial_velocity(rig), rig.time.duration, ERROR, N_SAVE)
    return observed(name, row, run, SPHERES, visible=VISIBLE)


def judged(rig, runs):
    """Each statement of the thesis, whether it holds, and the number that says so: on the wall
    MAIN, then on all walls."""
    run = runs[MAIN]
    peak_force = float(run.trajectory.contact_force[:, -1].max())
    radius = contact_radius(rig, start(rig), peak_force)
    near = NEAR_0_3_MM[0] <= radius <= NEAR_0_3_MM[1]
    verdicts = [("the contact's radius is near 0.3 mm", near, f"{1e3 * radius:.3f} mm")]

    for sphere, stated in WAVES_SEEN.items():
        numbers = tuple(label.number for label in run.reflected(sphere))
        statement = f"sphere {sphere} sees reflected waves {', '.join(map(str, stated))} only"
        sees = f"sees {', '.join(map(str, numbers)) or 'none'}"
        verdicts.append((statement, numbers == stated, sees))

    # neighbouring crests at spheres 4 and 14, in widths; 0.1 ms for a wave without a width
    gaps = []
    for sphere in SPHERES[1:]:
        waves = [label.arrival for label in run.reflected(sphere)]
        guesses = [
            Guess(w.time, w.peak_velocity, (w.width if w.width == w.width else 0.0) or 1e-4)
            for w in waves
        ]
        gaps += [apart(*pair) for pair in pairwise(guesses)]
    widths = min(gaps, default=0.0)
    verdicts.append(("waves are apart at spheres 4 and 14", widths >= 1, f"{widths:.2f} widths"))

    # distances of the k-th reflected waves of any two walls; nan, where no wall sends one, is
    # neither below nor above a limit
    first, second, third, fourth = (spread(runs.values(), k, SPHERES[1:]) for k in NUMBERS)
    for words, holds, value in (
        ("first reflected wave does not depend", first < UNMOVED, first),
        ("second reflected wave depends slightly", UNMOVED <= second < SLIGHT, second),
        ("third reflected wave depends strongly", third > SLIGHT, third),
        ("fourth reflected wave depends strongly", fourth > SLIGHT, fourth),
    ):
        number = "no wall sends it" if np.isnan(value) else f"distance {value:.3f}"
        verdicts.append((f"the {words} on the wall at spheres 4 and 14", holds, number))
    return verdicts


if __name__ == "__main__":
    main()
