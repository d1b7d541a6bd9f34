"""The rig's unknowns: what the thesis states of its experiment, and what each number does to it.

The text gives neither preload, leaf springs, dissipation, the arm's or the wall's mass, nor the
spheres' radius. Every row changes one of them in the scene and judges the thesis' statements again,
on all walls of `rig_walls`.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from workflows.chain_stages import chain, initial_velocity
from workflows.run_folder import Picture
from workflows.scene import HalfSpaceWall, LeafSprings, Preload, Scene
from workflows.stages import Watch
from workflows.studies.observed import Observed, observed, require_chain, require_echo
from workflows.studies.rig_statements import SEEN, Verdict, verdicts
from workflows.studies.rig_walls import (
    HALF_SPACE,
    RIGID,
    SLIGHT,
    UNMOVED,
    Standing,
    one_dof,
    rig_walls,
    spread,
)
from workflows.studies.schemes import require_rig
from workflows.study import Finding
from workflows.study_figures import Line, Panel, panels

MAIN = "ROM all four"
LEFT_OUT = (RIGID, one_dof(700))  # another surface, and a wall of a figure alone
ERROR = 1e-3  # of the velocities
N_SAVE = 1500
VISIBLE = 0.05  # of the striker's speed: what a sphere is said to see
SPHERES = tuple(SEEN)
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


def rig(scene: Scene, watch: Watch) -> Finding:
    """The statements at the default, and how far each unknown moves waves and statements."""
    require_rig(scene)
    require_chain(scene)
    walls = [w for w in rig_walls(scene, watch) if w.name not in LEFT_OUT]
    with watch("variations"):
        default, *changed = _variations(scene)
        default = _case(default, walls)
        require_echo(scene, default.runs[MAIN])
        others = [_case(variation, walls) for variation in changed]
    with watch("arm without mass"):
        light = _light_arms(scene, walls)
    columns = (
        "unknown", "value", "seen", "hold",
        *(f"t{k}_us" for k in NUMBERS), *(f"v{k}_%" for k in NUMBERS),
    )  # fmt: skip
    rows = tuple(_row(case, default) for case in (default, *others))
    pictures = (Picture("study_rig", _picture(default)),)
    return Finding("rig", columns, rows, (*_sentences(default, others), light), pictures)


def _variations(scene: Scene) -> Iterator[Variation]:
    yield Variation("default", 0.0, scene)
    arm, (stiffness, press_now) = scene.preload or Preload(), _leaf_springs(scene)
    for mass in (0.0, 0.034, 0.067, 0.1, 0.17):
        changed = arm.model_copy(update={"mass": mass})
        yield Variation("arm's mass [kg]", mass, _with(scene, preload=changed))
    for force in (5.0, 10.0, 25.0, 50.0):
        changed = arm.model_copy(update={"force": force})
        yield Variation("preload [N]", force, _with(scene, preload=changed))
    for press in (0.0, 0.1, 1.0):
        yield Variation("leaf press [N]", press, _pressed(scene, stiffness, press))
    for value in (50.0, 1000.0):
        yield Variation("leaf [N/m]", value, _pressed(scene, value, press_now))
    for value in (0.05, 0.2):
        changed = scene.contact.model_copy(
            update={"dissipation": "hunt-crossley", "coefficient": value}
        )
        yield Variation("dissipation [s/m]", value, _with(scene, contact=changed))
    yield Variation("wall's factor", 3.0, _with(scene, contact=_stiff_end(scene, 3.0)))
    for radius in (0.0120, 0.0135):
        changed = scene.chain.model_copy(update={"radius": radius})
        yield Variation("radius [m]", radius, _with(scene, chain=changed))
    for mass in (1.0, 4.2, 10.0):
        yield Variation("1-DOF mass [kg]", mass, scene, mass)


def _with(scene: Scene, **tables) -> Scene:
    return scene.model_copy(update=tables)


def _pressed(scene: Scene, stiffness: float, press: float) -> Scene:
    """Leaf springs that press with `press` [N] each; none where they press with nothing."""
    if not press:
        return _with(scene, leaf_springs=None)
    return _with(scene, leaf_springs=LeafSprings(stiffness=stiffness, offset=press / stiffness))


def _leaf_springs(scene: Scene) -> tuple[float, float]:
    """Largest stiffness [N/m] and press [N] of the scene's leaf springs, usual ones for none."""
    leaf = scene.leaf_springs or LeafSprings()
    stiffness = np.asarray(leaf.stiffness)
    return float(stiffness.max()) or STIFFNESS, float(np.max(stiffness * np.asarray(leaf.offset)))


def _stiff_end(scene: Scene, factor: float):
    factors = (*(1.0,) * (scene.n_contacts - 1), factor)
    return scene.contact.model_copy(update={"stiffness_factor": factors})


def _case(variation: Variation, walls: list[Standing]) -> Case:
    runs = {wall.name: _struck(variation, wall) for wall in walls}
    return Case(variation, runs, verdicts(variation.scene, runs, MAIN))


def _struck(variation: Variation, standing: Standing) -> Observed:
    scene, wall = variation.scene, standing.wall
    if variation.wall_mass and standing.name.startswith("1-DOF"):
        wall = wall._replace(phi=np.full(1, variation.wall_mass**-0.5))
    row = chain(_with(scene, wall=HalfSpaceWall(kind="half-space")))
    return observed(
        standing.name, row, wall, initial_velocity(scene), duration=scene.time.duration,
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


def _light_arms(scene: Scene, walls: list[Standing]) -> str:
    """The most waves that an arm without mass makes, whatever pulls and presses."""
    tried = [wall for wall in walls if wall.name in (MAIN, HALF_SPACE, one_dof(240))]
    seen, differ = [], []
    for force, press in LIGHT_ARM:
        pressed = _pressed(scene, STIFFNESS, press)
        light = _with(pressed, preload=Preload(force=force, mass=0.0))
        runs = [_struck(Variation("", 0.0, light), wall) for wall in tried]
        seen += [tuple(len(run.reflected(sphere)) for sphere in SPHERES) for run in runs]
        differ.append(spread(runs, 2, SPHERES[1:]))
    wanted = tuple(len(numbers) for numbers in SEEN.values())
    most = max(seen, key=lambda found: (found == wanted, found[1], found[2]))
    return (
        f"An arm without mass: of {len(seen)} chains and walls ({len(LIGHT_ARM)} preloads and leaf "
        f"springs, {len(tried)} walls) {sum(found == wanted for found in seen)} show "
        f"{_counts(wanted)} reflected waves at spheres {', '.join(map(str, SPHERES))}; the most at "
        f"sphere {SPHERES[1]} are {_counts(most)}. {_second(differ)}"
    )


def _second(differ: list[float]) -> str:
    """How far light arms' second waves know the wall, against the thesis' slightly."""
    judged = [value for value in differ if not np.isnan(value)]
    if not judged:
        return "Without mass no second wave comes back."
    slight = sum(UNMOVED <= value < SLIGHT for value in judged)
    return (
        f"Their second waves depend slightly on the wall, as the thesis has it, with {slight} of "
        f"{len(differ)} preloads and leaf springs (distance {min(judged):.2f} to "
        f"{max(judged):.2f}): it is the heavy last sphere that makes one before the wall has moved."
        if slight < len(differ) / 2
        else f"Their second waves depend slightly on the wall with {slight} of {len(differ)}."
    )


def _counts(found: tuple[int, ...]) -> str:
    return "/".join(map(str, found))


def _sentences(default: Case, others: list[Case]) -> tuple[str, ...]:
    scene = default.variation.scene
    kept = [sum(held) for held in zip(*(_held(case) for case in others), strict=True)]
    judged = (
        f'"{v.statement}": {"holds" if v.holds else "does not hold"} ({v.number}), and in '
        f"{n} of {len(others)} changes."
        for v, n in zip(default.verdicts, kept, strict=True)
    )
    arm, (stiffness, press) = scene.preload or Preload(), _leaf_springs(scene)
    return (
        f"Defaults: preload {arm.force:g} N, arm {arm.mass:g} kg, leaf springs "
        f"{stiffness:g} N/m that press with {press:g} N each, dissipation "
        f"{np.max(scene.contact.coefficient):g} s/m, radius {np.max(scene.chain.radius):g} m: "
        "inferred from the statements below, nothing of it measured (beadwave scene rig-rom says "
        "how each).",
        *judged,
        _best(default, others),
        f"The table: reflected waves of at least {100 * VISIBLE:g} % of the striker's speed at "
        f"spheres {', '.join(map(str, SPHERES))}; how many of "
        f"the statements hold; how much later [µs] and higher [%] the waves 1 to {NUMBERS[-1]} are "
        f"at sphere {SPHERES[-1]} than by default, on the wall {MAIN} ({one_dof(907)} where its "
        f"mass changes). More than {WIDE:g} µs, about a wave's width, is another wave that has "
        "taken the number. Distances are the largest of two walls, as in the study walls.",
    )


def _held(case: Case) -> list[bool]:
    return [verdict.holds for verdict in case.verdicts]


def _best(default: Case, others: list[Case]) -> str:
    """Whether a change makes more of the statements true than the default does."""
    best = max(others, key=lambda case: sum(_held(case)))
    most, now = sum(_held(best)), sum(_held(default))
    if most <= now:
        return (
            f"No change makes more of them true than the default, {now} of {len(_held(default))}."
        )
    return (
        f"{best.variation.unknown} = {best.variation.value:g} makes {most} of "
        f"{len(_held(default))} true, the default {now}; the thesis gives no value to choose by."
    )


def _picture(default: Case) -> bytes:
    shown = (MAIN, HALF_SPACE, one_dof(907), one_dof(240))
    return panels(
        [
            Panel(
                f"sphere {sphere}", "time [ms]", "velocity [m/s]",
                [Line(name, default.runs[name].milliseconds, default.runs[name].velocity(sphere))
                 for name in shown],
            )
            for sphere in SPHERES
        ],
        size=(8, 2.6),
    )  # fmt: skip
