"""The rig's unknowns: what the thesis states of its experiment, and what each number does to it.

The text gives neither preload, leaf springs, dissipation, the arm's or the wall's mass, nor the
spheres' radius. Every row changes one of them in the scene and judges the thesis' statements again,
on all walls of `rig_walls`.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from workflows.evidence.prose import rendered
from workflows.evidence.thesis.observed_run import Observed, Setup, observed
from workflows.evidence.thesis.records import record
from workflows.evidence.thesis.requirements import require_chain, require_echo, require_rig
from workflows.evidence.thesis.rig_statements import SEEN, Verdict, verdicts
from workflows.evidence.thesis.rig_walls import (
    HALF_SPACE,
    RIGID,
    SLIGHT,
    UNMOVED,
    one_dof,
    rig_walls,
)
from workflows.evidence.thesis.wave_distance import spread
from workflows.files.run_folder import Picture
from workflows.report.finding import Finding
from workflows.report.plots import panels
from workflows.report.tables import Table
from workflows.scene import HalfSpaceWall, LeafSpringsTable, Preload, Scene
from workflows.stages.chain import chain, initial_velocity
from workflows.stages.pipeline import Progress

MAIN = "ROM all four"
LEFT_OUT = (RIGID, one_dof(700))  # another surface, and a wall of a figure alone
ERROR = 1e-3  # of the velocities
N_SAVE = 1500
VISIBLE = 0.05  # of the striker's speed: what a sphere is said to see
SPHERES = tuple(SEEN)
WANTED = tuple(map(len, SEEN.values()))  # numbers of reflected waves at them
NUMBERS = (1, 2, 3, 4)
STIFFNESS = 200.0  # N/m, of leaf springs where a scene has none
WIDE = 100.0  # us, a wave of a third of the striker at sphere 14
LIGHT_ARM = [(force, press) for force in (5.0, 15.0, 40.0, 80.0) for press in (0.0, 0.3, 1.0)]


class Variation(NamedTuple):
    """A scene with one unknown changed."""

    unknown: str
    value: float
    scene: Scene
    wall_mass: float | None = None  # [kg] of the one-mass walls


class Case(NamedTuple):
    """What a variation shows."""

    variation: Variation
    runs: dict[str, Observed]
    verdicts: tuple[Verdict, ...]


def rig(scene: Scene, progress: Progress) -> Finding:
    """What the thesis says of its experiment, against each unknown of the rig (section 7.2)."""
    require_rig(scene)
    require_chain(scene)
    walls = [w for w in rig_walls(scene, progress) if w.name not in LEFT_OUT]
    with progress("variations"):
        default, *changed = _variations(scene)
        default = _case(default, walls)
        require_echo(scene, default.runs[MAIN])
        others = [_case(variation, walls) for variation in changed]
    with progress("arm without mass"):
        light = _light_arms(scene, walls)
    columns = (
        "unknown", "value", "seen", "hold",
        *(f"t{k}_us" for k in NUMBERS), *(f"v{k}_%" for k in NUMBERS),
    )  # fmt: skip
    rows = tuple(_row(case, default) for case in (default, *others))
    pictures = (Picture("study_rig", _picture(default)),)
    sentences = rendered(__file__, **_numbers(default, others, light))
    return Finding((Table("rig", columns, rows),), sentences, pictures)


def _variations(scene: Scene) -> Iterator[Variation]:
    yield Variation("default", 0.0, scene)
    arm, (stiffness, press_now) = scene.preload or Preload(), _leaf_springs(scene)
    for mass in (0.0, 0.034, 0.067, 0.1, 0.17):
        yield Variation("arm's mass [kg]", mass, scene.but(preload=arm.but(mass=mass)))
    for force in (5.0, 10.0, 25.0, 50.0):
        yield Variation("preload [N]", force, scene.but(preload=arm.but(force=force)))
    for press in (0.0, 0.1, 1.0):
        yield Variation("leaf press [N]", press, _pressed(scene, stiffness, press))
    for value in (50.0, 1000.0):
        yield Variation("leaf [N/m]", value, _pressed(scene, value, press_now))
    for value in (0.05, 0.2):
        lossy = {"dissipation": "hunt-crossley", "coefficient": value}
        yield Variation("dissipation [s/m]", value, scene.but(contact=lossy))
    stiff_end = (*(1.0,) * (scene.n_contacts - 1), 3.0)
    yield Variation("wall's factor", 3.0, scene.but(contact={"stiffness_factor": stiff_end}))
    for radius in (0.0120, 0.0135):
        yield Variation("radius [m]", radius, scene.but(chain={"radius": radius}))
    for mass in (1.0, 4.2, 10.0):
        yield Variation("1-DOF mass [kg]", mass, scene, mass)


def _pressed(scene: Scene, stiffness: float, press: float) -> Scene:
    """Leaf springs that press with `press` [N] each; none where they press with nothing."""
    if not press:
        return scene.but(leaf_springs=None)
    return scene.but(leaf_springs=LeafSpringsTable(stiffness=stiffness, offset=press / stiffness))


def _leaf_springs(scene: Scene) -> tuple[float, float]:
    """Largest stiffness [N/m] and press [N] of the scene's leaf springs, usual ones for none."""
    leaf = scene.leaf_springs or LeafSpringsTable()
    stiffness = np.asarray(leaf.stiffness)
    return float(stiffness.max()) or STIFFNESS, float(np.max(stiffness * np.asarray(leaf.offset)))


def _case(variation: Variation, walls: list[Setup]) -> Case:
    runs = {wall.name: _impact_run(variation, wall) for wall in walls}
    return Case(variation, runs, verdicts(variation.scene, runs, MAIN))


def _impact_run(variation: Variation, standing: Setup) -> Observed:
    scene, wall = variation.scene, standing.wall
    if variation.wall_mass and standing.name.startswith("1-DOF"):
        wall = wall._replace(phi=np.full(1, variation.wall_mass**-0.5))
    row = chain(scene.but(wall=HalfSpaceWall(kind="half-space")))
    return observed(
        Setup(standing.name, row, wall), initial_velocity(scene), duration=scene.time.duration,
        spheres=SPHERES, error=ERROR, n_save=N_SAVE, visible=VISIBLE,
    )  # fmt: skip


def _row(case: Case, default: Case) -> tuple:
    seen = "/".join(str(len(case.runs[MAIN].reflected(sphere))) for sphere in SPHERES)
    held = sum(verdict.holds for verdict in case.verdicts)
    value = None if case is default else case.variation.value
    score = f"{held}/{len(case.verdicts)}"
    return case.variation.unknown, value, seen, score, *_shifts(case, default)


def _shifts(case: Case, default: Case) -> tuple[float | None, ...]:
    """Of the reflected waves at the outermost sphere: later by [us], higher by [%]."""
    one, other = ([run.wave(SPHERES[-1], "reflected", k) for k in NUMBERS]
                  for run in (default.runs[_main(case)], case.runs[_main(case)]))  # fmt: skip
    pairs = [
        None if a is None or b is None else (a.arrival, b.arrival)
        for a, b in zip(one, other, strict=True)
    ]
    times = [pair and _tenths(1e6 * (pair[1].time - pair[0].time)) for pair in pairs]
    peaks = [
        pair and _tenths(100 * (pair[1].peak_velocity / pair[0].peak_velocity - 1))
        for pair in pairs
    ]
    return (*times, *peaks)


def _tenths(value: float) -> float:
    """Runs hold no more; no minus zero."""
    return round(value, 1) + 0.0


def _main(case: Case) -> str:
    """The wall whose waves are compared: one that the variation changes."""
    return one_dof(907) if case.variation.wall_mass else MAIN


class LightArms(NamedTuple):
    """What an arm without mass shows, whatever pulls and presses: numbers of reflected waves by
    sphere, and the distance of second waves before different walls."""

    n_walls: int
    seen: list[tuple[int, ...]]  # of every chain and wall
    second: list[float]  # of the chains with a second wave

    @property
    def n_as_wanted(self) -> int:
        """Of the chains and walls, that show what the thesis sees."""
        return self.seen.count(WANTED)

    @property
    def most(self) -> tuple[int, ...]:
        """The most waves, at the second sphere first."""
        return max(self.seen, key=lambda found: (found == WANTED, found[1], found[2]))

    @property
    def n_slight(self) -> int:
        """Of the chains, with second waves that depend slightly on the wall."""
        return sum(UNMOVED <= value < SLIGHT for value in self.second)


def _light_arms(scene: Scene, walls: list[Setup]) -> LightArms:
    tried = [wall for wall in walls if wall.name in (MAIN, HALF_SPACE, one_dof(240))]
    seen, differ = [], []
    for force, press in LIGHT_ARM:
        pressed = _pressed(scene, STIFFNESS, press)
        light = pressed.but(preload=Preload(force=force, mass=0.0))
        runs = [_impact_run(Variation("", 0.0, light), wall) for wall in tried]
        seen += [tuple(len(run.reflected(sphere)) for sphere in SPHERES) for run in runs]
        differ.append(spread(runs, 2, SPHERES[1:]))
    return LightArms(len(tried), seen, [value for value in differ if not np.isnan(value)])


def _numbers(default: Case, others: list[Case], light: LightArms) -> dict[str, Any]:
    scene = default.variation.scene
    stiffness, press = _leaf_springs(scene)
    return {
        "arm": scene.preload or Preload(),
        "stiffness": stiffness,
        "press": press,
        "dissipation": float(np.max(scene.contact.coefficient)),
        "radius": float(np.max(scene.chain.radius)),
        "verdicts": default.verdicts,
        "kept": [sum(held) for held in zip(*map(_held, others), strict=True)],
        "n_changes": len(others),
        "held": sum(_held(default)),
        "best": max(others, key=lambda case: sum(_held(case))),
        "visible": VISIBLE,
        "spheres": SPHERES,
        "n_waves": NUMBERS[-1],
        "main": MAIN,
        "one_mass": one_dof(907),
        "wide": WIDE,
        "light": light,
        "wanted": WANTED,
        "n_arms": len(LIGHT_ARM),
    }


def _held(case: Case) -> list[bool]:
    return [verdict.holds for verdict in case.verdicts]


def _picture(default: Case) -> bytes:
    shown = [default.runs[name] for name in (MAIN, HALF_SPACE, one_dof(907), one_dof(240))]
    return panels([record(f"sphere {s}", shown, s) for s in SPHERES], size=(8, 2.6))
