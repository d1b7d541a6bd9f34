"""The rig's unknowns: which statements of the thesis hold, as each unknown is varied.

The text gives neither preload, leaf springs, dissipation, the arm's or the wall's mass, nor the
spheres' radius. Every row changes one of them in the scene and judges the thesis' statements again,
on all walls of `rig_walls`.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from beadwave.workflows.evidence.study import concluded
from beadwave.workflows.evidence.thesis.observed_run import Observed, RecordOptions, Setup, record
from beadwave.workflows.evidence.thesis.requirements import require_chain, require_echo, require_rig
from beadwave.workflows.evidence.thesis.walls import (
    HALF_SPACE,
    RIGID,
    impact_run,
    one_dof,
    rig_walls,
)
from beadwave.workflows.evidence.thesis.wave_distance import DependenceLimits, separation, spread
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.report.plots import panels
from beadwave.workflows.scene import HalfSpaceWall, LeafSpringsTable, Preload, Scene
from beadwave.workflows.stages.chain import chain, contact_radius, start
from beadwave.workflows.stages.progress import Progress

# what the thesis states, sections 6.1, 7.1 and 7.2: reflected waves by sphere within 3 ms, at
# which spheres waves are separate, the radius of the contact "near 0.3 mm"
WAVES_SEEN = {1: (1,), 4: (1, 2, 3), 14: (1, 2, 3, 4)}
SEPARATE_AT = (4, 14)
NEAR_0_3_MM = (0.25e-3, 0.4e-3)  # m

SPHERES = tuple(WAVES_SEEN)
COUNTS = tuple(map(len, WAVES_SEEN.values()))  # of reflected waves at these spheres
NUMBERS = (1, 2, 3, 4)  # of reflected waves
MAIN = "ROM all four"
LEFT_OUT = (RIGID, one_dof(700))  # another surface, and a wall of a figure alone


class RigOptions(NamedTuple):
    """What the study varies beside `_variations`, how it marches, and what it counts."""

    # [N] pull of an arm without mass, press of each leaf spring
    light_arms: tuple[tuple[float, float], ...] = tuple(
        (force, press) for force in (5.0, 15.0, 40.0, 80.0) for press in (0.0, 0.3, 1.0)
    )
    # hundreds of runs, whose differences are larger than this error; a sphere sees waves of a
    # twentieth of the striker's speed
    record: RecordOptions = RecordOptions(error=1e-3, n_save=1500, visible=0.05)
    leaf_stiffness: float = 200.0  # [N/m] of leaf springs where a scene has none
    late: float = 100.0  # [us] the width of a wave of a third of the striker at sphere 14
    separate: float = 1.0  # widths between neighbouring crests
    limits: DependenceLimits = DependenceLimits()


class StatementVerdict(NamedTuple):
    """A statement, whether it holds, and the number that says so."""

    statement: str
    holds: bool
    number: str


class Variation(NamedTuple):
    """A scene with one unknown changed."""

    unknown: str
    value: float
    scene: Scene
    wall_mass: float | None = None  # [kg] of the one-mass walls


class RigVariation(NamedTuple):
    """The runs of a variation by wall, and the verdicts on the statements."""

    variation: Variation
    runs: dict[str, Observed]
    verdicts: tuple[StatementVerdict, ...]

    @property
    def holding(self) -> list[bool]:
        """Which of the statements hold."""
        return [verdict.holds for verdict in self.verdicts]


def rig(scene: Scene, progress: Progress, options: RigOptions = RigOptions()) -> Finding:
    """What the thesis says of its experiment, against each unknown of the rig (section 7.2)."""
    require_rig(scene)
    require_chain(scene)
    walls = [wall for wall in rig_walls(scene, progress) if wall.name not in LEFT_OUT]

    # the default, then one unknown after the other, each on all walls
    cases = []
    with progress("variations"):
        for variation in _variations(scene, options):
            runs = {wall.name: _impact_run(variation, wall, options) for wall in walls}
            if not cases:
                require_echo(scene, runs[MAIN])
            cases.append(RigVariation(variation, runs, verdicts(variation.scene, runs, options)))
    default, *changed = cases  # what changes are judged against is not counted among them

    # an arm without mass: the waves that come back to each chain and wall, and the distance of the
    # second ones before different walls
    tried = [wall for wall in walls if wall.name in (MAIN, HALF_SPACE, one_dof(240))]
    counts, second = [], []
    with progress("arm without mass"):
        for force, press in options.light_arms:
            pressed = _pressed(scene, options.leaf_stiffness, press)
            light = pressed.but(preload=Preload(force=force, mass=0.0))
            runs = [_impact_run(Variation("", 0.0, light), wall, options) for wall in tried]
            counts += [tuple(len(run.reflected(sphere)) for sphere in SPHERES) for run in runs]
            second.append(spread(runs, 2, SPHERES[1:]))
    second = [value for value in second if not np.isnan(value)]
    unmoved, slight, _ = options.limits

    # a row per variation: waves and statements counted, and by how much each reflected wave at
    # the outermost sphere is later [us] and higher [%], on a wall that the variation changes
    rows = []
    for case in cases:
        wall = one_dof(907) if case.variation.wall_mass else MAIN
        times, peaks = [], []
        for k in NUMBERS:
            wave, changed_wave = (
                of.runs[wall].wave(SPHERES[-1], "reflected", k) for of in (default, case)
            )
            if wave is None or changed_wave is None:
                times.append(None)
                peaks.append(None)
                continue
            a, b = wave.arrival, changed_wave.arrival
            # to tenths, runs hold no more; + 0.0 leaves no minus zero
            times.append(round(1e6 * (b.time - a.time), 1) + 0.0)
            peaks.append(round(100 * (b.peak_velocity / a.peak_velocity - 1), 1) + 0.0)
        waves = "/".join(str(len(case.runs[MAIN].reflected(sphere))) for sphere in SPHERES)
        score = f"{sum(case.holding)}/{len(case.verdicts)}"
        value = None if case is default else case.variation.value
        rows.append((case.variation.unknown, value, waves, score, *times, *peaks))
    columns = (
        "unknown", "value", "seen", "hold",
        *(f"t{k}_us" for k in NUMBERS), *(f"v{k}_%" for k in NUMBERS),
    )  # fmt: skip

    stiffness, press = _leaf_springs(scene, options.leaf_stiffness)

    drawn_runs = [default.runs[name] for name in (MAIN, HALF_SPACE, one_dof(907), one_dof(240))]
    figure = [record(f"sphere {s}", drawn_runs, s) for s in SPHERES]
    return concluded(
        __file__,
        columns,
        tuple(rows),
        panels(figure, size=(8, 2.6)),
        arm=scene.preload or Preload(),
        stiffness=stiffness,
        press=press,
        dissipation=float(np.max(scene.contact.coefficient)),
        radius=float(np.max(scene.chain.radius)),
        verdicts=default.verdicts,
        holding=[sum(holds) for holds in zip(*(case.holding for case in changed), strict=True)],
        n_changes=len(changed),
        n_default=sum(default.holding),
        best=max(changed, key=lambda case: sum(case.holding)),
        options=options,
        spheres=SPHERES,
        n_waves=NUMBERS[-1],
        main=MAIN,
        one_mass=one_dof(907),
        n_walls=len(tried),
        counts=counts,
        most_waves=max(counts, key=lambda seen: (seen == COUNTS, seen[1], seen[2])),
        second=second,
        n_slight=sum(unmoved <= value < slight for value in second),
        wanted=COUNTS,
        n_arms=len(options.light_arms),
    )


def _variations(scene: Scene, options: RigOptions) -> Iterator[Variation]:
    """The scene itself, then with one unknown changed at a time."""
    yield Variation("default", 0.0, scene)
    arm = scene.preload or Preload()
    stiffness, press_now = _leaf_springs(scene, options.leaf_stiffness)
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


def _leaf_springs(scene: Scene, usual: float) -> tuple[float, float]:
    """Largest stiffness [N/m], `usual` for none, and press [N] of the scene's leaf springs."""
    leaf = scene.leaf_springs or LeafSpringsTable()
    stiffness = np.asarray(leaf.stiffness)
    return float(stiffness.max()) or usual, float(np.max(stiffness * np.asarray(leaf.offset)))


def _impact_run(variation: Variation, standing: Setup, options: RigOptions) -> Observed:
    """The variation's chain before one of the walls, whose mass it may change."""
    scene, wall = variation.scene, standing.wall
    if variation.wall_mass and standing.name.startswith("1-DOF"):
        wall = wall._replace(phi=np.full(1, variation.wall_mass**-0.5))
    row = chain(scene.but(wall=HalfSpaceWall(kind="half-space")))
    return impact_run(scene, Setup(standing.name, row, wall), SPHERES, options.record)


def verdicts(
    scene: Scene, runs: dict[str, Observed], options: RigOptions = RigOptions()
) -> tuple[StatementVerdict, ...]:
    """The statements on the wall MAIN, and those on all walls with the same surface."""
    run, judged = runs[MAIN], []

    peak_force = float(run.trajectory.contact_force[:, -1].max())
    radius = contact_radius(scene, start(scene), peak_force)
    holds = NEAR_0_3_MM[0] <= radius <= NEAR_0_3_MM[1]
    statement = "the contact's radius is near 0.3 mm"
    judged.append(StatementVerdict(statement, holds, f"{1e3 * radius:.3f} mm"))

    # reflected waves at each observed sphere
    for sphere, stated in WAVES_SEEN.items():
        numbers = tuple(label.number for label in run.reflected(sphere))
        named, plural = ", ".join(map(str, stated)), "s" * (len(stated) > 1)
        statement = f"sphere {sphere} sees the reflected wave{plural} {named}"
        sees = f"sees {', '.join(map(str, numbers)) or 'none'}"
        judged.append(StatementVerdict(statement, numbers == stated, sees))

    widths = separation(run, SEPARATE_AT)
    statement = "waves are apart at spheres 4 and 14"
    judged.append(StatementVerdict(statement, widths >= options.separate, f"{widths:.2f} widths"))

    # distances of the k-th reflected waves of any two walls; nan, where no wall sends one, is
    # neither below nor above a limit
    same_surface = [run for name, run in runs.items() if name != RIGID]
    first, second, third, fourth = (spread(same_surface, k, SEPARATE_AT) for k in NUMBERS)
    unmoved, slight, strong = options.limits
    for words, holds, value in (
        ("first reflected wave does not depend", first < unmoved, first),
        ("second reflected wave depends slightly", unmoved <= second < slight, second),
        ("third reflected wave depends strongly", third > strong, third),
        ("fourth reflected wave depends strongly", fourth > strong, fourth),
    ):
        number = "no wall sends it" if np.isnan(value) else f"distance {value:.3f}"
        statement = f"the {words} on the wall at spheres 4 and 14"
        judged.append(StatementVerdict(statement, holds, number))
    return tuple(judged)
