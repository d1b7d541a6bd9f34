"""What sliding of the shaken contact does to the waves that come back, and through what.

Every row changes one thing of the scene and marches it twice from its periodic state: as it is, and
with a coefficient of friction so large that the contact sticks. The waves of both at the observed
spheres are compared. A second table switches on what makes them differ, one by one, without a
shaker: a contact that sticks for ever beside one without any tangential force.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from beadwave.coupling.continuation import (
    SteadyState,
    before_striker,
    cold_state,
    later,
    neighbouring_state,
    struck,
)
from beadwave.coupling.spatial_march import (
    USUAL_SPATIAL_SEARCH,
    PreparedImpact,
    ShakerForces,
    SpatialRun,
    body_of,
    march_space,
    march_to_error,
)
from beadwave.coupling.spatial_wall import SpatialWall
from beadwave.coupling.stuck_wall import stuck_wall, uncoupled_wall
from beadwave.dem import UnstableStep, rigid_wall
from beadwave.dem.friction import stick_stiffness
from beadwave.dem.lateral import LastSphere
from beadwave.dem.prepared import prepare
from beadwave.dem.spheres import hertz_overlap
from beadwave.dem.waves.solitary import WIDTH, speed
from beadwave.workflows.evidence.study import concluded, counted
from beadwave.workflows.evidence.thesis.observed_run import Observed, RecordOptions, Setup, seen
from beadwave.workflows.evidence.thesis.requirements import require_chain
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.report.tables import Table
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.scene.places import has_friction
from beadwave.workflows.stages.chain import Start
from beadwave.workflows.stages.friction import ALL_STICKS, ARRIVED, last_sphere
from beadwave.workflows.stages.pipeline import pipeline_of
from beadwave.workflows.stages.progress import Progress
from beadwave.workflows.stages.structure_friction import shaker_forces, wall_along

SCENE = "rig-shaker"
COLUMNS = (
    "varied", "value", "cycle", "sticks", "at_wall_deg", "loop_uJ", "arrival_us",
    "amplitude_mm_s", "first_mm_s", "later_mm_s", "error_mm_s",
)  # fmt: skip
MECHANISMS = ("switched_on", "first_mm_s", "later_mm_s", "error_mm_s")


class FrictionOptions(NamedTuple):
    """What the study varies, one thing at a time, and how it marches and judges."""

    # values; the smallest is a greased contact, which slips as a whole at once
    coefficients: tuple[float, ...] = (0.001, 0.05, 0.1, 0.4)
    forces: tuple[float, ...] = (0.5, 2.0)  # factors on the shaker's
    phases: tuple[float, ...] = (45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 315.0)  # [degrees] later
    arms: tuple[float, ...] = (0.5, 2.0)  # factors on the arm's stiffness
    patches: tuple[float, ...] = (0.5, 0.0)  # factors on the distance from the face's middle
    sticking: float = 2.0  # coefficient at which nothing slips in a cycle, and no one measures
    state_error: float = 3e-3  # of the periodic states
    coarser: float = 3.0  # times as large an error where none is found; the row states it
    error: float = 1e-4  # of the marches: a third of what the differences are judged by
    n_cells: int = 64  # of the contact: 64, 128 and 256 left loops 4e-4 apart
    n_save: int = 3000
    noise: float = 1e-3  # [m/s] rms of a laser vibrometer
    timing: float = 1e-7  # [s] of its trigger


class Case(NamedTuple):
    """One row: what is varied, a scene, and how much later in the cycle the striker comes."""

    varied: str
    value: float
    scene: Scene
    turn: float = 0.0  # of a period


class MarchedRig(NamedTuple):
    """What marches of a scene take."""

    start: Start
    wall: SpatialWall
    last: LastSphere
    shakers: ShakerForces

    @property
    def modulus(self) -> float:
        """E* [Pa] of the contact of the last sphere, from Hertz' coefficient."""
        return 0.75 * float(self.start.chain.A[-1]) / np.sqrt(self.last.law.radius)

    def body(self, coefficient: float, n_cells: int) -> PreparedImpact:
        """Chain, contact and structure, with another coefficient of friction."""
        search = USUAL_SPATIAL_SEARCH._replace(n_cells=n_cells)
        last = with_coefficient(self, coefficient)
        return body_of(self.start.chain, self.wall, self.start.velocity, last, self.shakers, search)


class ContactRun(NamedTuple):
    """A run observed, the error of its velocities [m/s], and of one from a periodic state the
    contact: its state in the cycle before the striker, the share of the area that sticks and the
    shaker's phase [degrees] as the wave arrives, the loop of a period [uJ]."""

    observed: Observed
    error: float
    contact: tuple[str, float, float, float] | None = None


class Difference(NamedTuple):
    """Largest differences of two runs over the observed spheres."""

    arrival: float  # [s] of the first reflected wave
    amplitude: float  # [m/s] of its peak
    first: float  # [m/s] of the velocities until it has passed
    later: float  # [m/s] after it
    error: float  # [m/s] of both runs together

    @property
    def largest(self) -> float:
        """[m/s] at any time."""
        return max(self.first, self.later)


def friction(
    scene: Scene, progress: Progress, options: FrictionOptions = FrictionOptions()
) -> Finding:
    """What sliding of the shaken contact does to the waves that come back, and through what.

    Every case is run twice, with its coefficient and with one at which nothing slips: what these
    differ by is slip's, whatever the case changes besides. Raises InvalidScene for scenes without a
    shaken structure, an arm of one stiffness and a patch.
    """
    spheres = require_chain(scene)
    if not has_friction(scene) or not scene.shakers or scene.assembly is None:
        raise InvalidScene(
            f"the study compares contacts that stick and slip on a shaken structure, which "
            f"{scene.name} is not; take rig-shaker."
        )
    needs = {
        "an [arm] of one stiffness": scene.arm is not None and np.ndim(scene.arm.stiffness) == 0,
        "shakers that push by a force": all(shaker.force is not None for shaker in scene.shakers),
        "a [patch] whose point can be moved": scene.patch is not None,
    }
    if missing := [need for need, is_given in needs.items() if not is_given]:
        raise InvalidScene(f"{scene.name}: the study needs {missing[0]}; take rig-shaker.")

    # cases without a periodic state are named, the others compared
    states: dict[str, SteadyState] = {}
    rows, compared, refused = [], [], []
    for case in counted(tuple(cases(scene, options)), progress, label):
        rig = rig_of(case.scene, progress)
        try:
            slips, sticks = (
                shaken_run(case, rig, coefficient, spheres, states, options)
                for coefficient in (case.scene.friction.coefficient, options.sticking)
            )
        except UnstableStep:
            refused.append(label(case))
            continue
        difference = between(sticks, slips)
        compared.append((case, slips, sticks, difference))
        rows.append(
            (case.varied, case.value, *slips.contact, 1e6 * difference.arrival,
             *(1e3 * value for value in difference[1:]))
        )  # fmt: skip

    # through what a contact that sticks acts: without shakers, one mechanism after the other
    with progress("mechanisms"):
        mechanisms = alone(rig_of(scene, progress), spheres, scene.time.duration, options)
    mechanism_rows = tuple(
        (name, 1e3 * change.first, 1e3 * change.later, 1e3 * change.error)
        for name, change in mechanisms.items()
    )

    # differences by the state of the contact in the cycle before the striker
    by_state: dict[str, list[Difference]] = {}
    for _, slips, _, difference in compared:
        by_state.setdefault(slips.contact[0], []).append(difference)
    return concluded(
        __file__,
        COLUMNS,
        tuple(rows),
        picture(compared, spheres),
        Table("mechanisms", MECHANISMS, mechanism_rows),
        by_state=by_state,
        striker=float(np.abs(rig_of(scene, progress).start.velocity).max()),
        options=options,
        mechanisms=mechanisms,
        refused=refused,
        by_arrival={
            state: sum(change.arrival > options.timing for change in differences)
            for state, differences in by_state.items()
        },
        by_later={
            state: sum(is_seen(change, options) for change in differences)
            for state, differences in by_state.items()
        },
    )


def label(case: Case) -> str:
    """A row in words."""
    return f"{case.varied} {case.value:g}"


def is_seen(difference: Difference, options: FrictionOptions) -> bool:
    """Whether a single record of the vibrometer shows it at some instant after the first reflected
    wave: above three times its noise and the numerical error."""
    return difference.later > 3.0 * options.noise + difference.error


def cases(scene: Scene, options: FrictionOptions) -> Iterator[Case]:
    """The scene, and one thing of it changed at a time."""
    shaker, *others = scene.shakers
    yield Case("scene", scene.friction.coefficient, scene)
    for value in options.coefficients:
        yield Case("coefficient", value, scene.but(friction={"coefficient": value}))
    for turn in options.phases:
        yield Case("phase [deg]", (shaker.phase + turn) % 360.0, scene, turn / 360.0)
    for factor in options.forces:
        stronger = (shaker.but(force=factor * shaker.force), *others)
        yield Case("force [N]", factor * shaker.force, scene.but(shakers=stronger))
    # another force in another place of the cycle, where all may slip as the wave comes
    most = max(options.forces, default=1.0)
    stronger = (shaker.but(force=most * shaker.force), *others)
    for turn in options.phases[1::2]:
        yield Case(
            f"phase [deg] at {most * shaker.force:g} N", (shaker.phase + turn) % 360.0,
            scene.but(shakers=stronger), turn / 360.0,
        )  # fmt: skip
    for factor in options.arms:
        stiffness = factor * scene.arm.stiffness
        yield Case("arm [MN/m]", 1e-6 * stiffness, scene.but(arm={"stiffness": stiffness}))
    y, z = scene.patch.point
    for factor in options.patches:
        moved = scene.but(patch={"point": (factor * y, factor * z)})
        yield Case("patch [mm]", 1e3 * factor * y, moved)


def rig_of(scene: Scene, progress: Progress) -> MarchedRig:
    """Chain and structure of a scene, its reduced model kept by content."""
    pipeline = pipeline_of(scene, progress)
    start = pipeline("start")
    return MarchedRig(
        start, pipeline("spatial-wall"), last_sphere(scene, start), shaker_forces(scene)
    )


def with_coefficient(rig: MarchedRig, coefficient: float) -> LastSphere:
    """The last sphere on a contact of another coefficient: the law's bound is mu E*/G*."""
    bound = coefficient * rig.modulus / rig.last.law.modulus
    return rig.last._replace(law=rig.last.law._replace(bound=bound))


def shaken_run(
    case: Case,
    rig: MarchedRig,
    coefficient: float,
    spheres: tuple[int, ...],
    states: dict[str, SteadyState],
    options: FrictionOptions,
) -> ContactRun:
    """The run of a case with this coefficient. Its periodic state is looked for from rest, that of
    a contact that sticks from the last one found, and kept in `states`. Raises
    UnstableStep."""
    body, v0 = rig.body(coefficient, options.n_cells), rig.start.velocity
    before = before_striker(body, v0, upstream_held=case.scene.friction.upstream == "held")
    fastest = float(np.abs(v0).max())
    wanted = {"error": options.state_error, "speed": fastest}
    shakers = [(s.frequency, s.force_amplitude, s.phase) for s in case.scene.shakers]
    key = repr((coefficient, shakers, case.scene.arm, case.scene.patch))
    modes = f"{rig.wall.omega.size} modes"
    if key not in states:
        near = states.get(f"{coefficient:g} with {modes}", states.get(modes))
        try:
            # a contact that sticks is nearly linear: another one's state is near
            if near is None or coefficient < options.sticking:
                states[key] = cold_state(body, before, **wanted)
            else:
                states[key] = neighbouring_state(body, before, near, **wanted)
        except UnstableStep:
            wanted["error"] = options.coarser * options.state_error
            states[key] = cold_state(body, before, **wanted)
        states[f"{coefficient:g} with {modes}"] = states[modes] = states[key]
    state = states[key]

    # from the state as it is when the striker comes, a part of a period later
    body, moving = later(body, before, state, case.turn)
    struck(moving, before, v0)
    run = march_to_error(
        body, moving, duration=case.scene.time.duration, error=options.error,
        n_save=options.n_save, speed=fastest,
    )  # fmt: skip

    # the contact when the wave arrives, by the first rise of its force
    force = run.trajectory.contact_force[:, -1]
    rise = np.abs(force - force[0])
    at = int((rise >= ARRIVED * rise.max()).argmax())
    stick = float(run.lateral.stick_share[at])
    shaker, phase = case.scene.shakers[0], float(np.degrees(body.shakers.phase[0]))
    phase = (360.0 * shaker.frequency * float(run.trajectory.t[at]) + phase) % 360.0
    return ContactRun(
        observed(rig, run, spheres, label(case)),
        fastest * run.trajectory.error_estimate + state.speed * state.error,
        (name_of(state.stick), stick, phase, 1e6 * state.energy),
    )


def name_of(stick: float) -> str:
    """The state of a contact of which this share sticks at least."""
    return "gross slip" if stick == 0.0 else "stick" if stick > ALL_STICKS else "partial slip"


def observed(rig: MarchedRig, run: SpatialRun, spheres: tuple[int, ...], name: str) -> Observed:
    """The waves of a run."""
    setup = Setup(name, rig.start.chain, rigid_wall())
    return seen(setup, run.trajectory, spheres=spheres, options=RecordOptions())


def between(one: ContactRun, other: ContactRun) -> Difference:
    """How far the waves of two runs at the same instants differ, at the sphere where each does so
    most; the first reflected wave ends a width after its crest, of a record without one where the
    contact with the wall begins."""
    arrival = amplitude = first = later = 0.0
    a, b = one.observed, other.observed
    t = a.trajectory.t
    for sphere in a.labels:
        waves = [run.wave(sphere, "reflected", 1) for run in (a, b)]
        end = a.contact.contact_time.start
        if all(waves):
            (t1, v1), (t2, v2) = ((wave.arrival.time, wave.arrival.peak_velocity) for wave in waves)
            arrival = max(arrival, abs(t2 - t1))
            amplitude = max(amplitude, abs(v2 - v1))
            end = float(t1 + WIDTH / abs(speed(v1, a.chain.mass[0], a.chain.A[0])))
        difference = np.abs(b.velocity(sphere) - a.velocity(sphere))
        first = max(first, float(difference[t <= end].max()))
        later = max(later, float(difference[t > end].max(initial=0.0)))
    return Difference(arrival, amplitude, first, later, one.error + other.error)


def alone(
    rig: MarchedRig, spheres: tuple[int, ...], duration: float, options: FrictionOptions
) -> dict[str, Difference]:
    """What a contact that sticks changes in the waves beside one without tangential force, without
    shakers, over a duration [s], by what is switched on."""
    # the last sphere clamped across; free to yield on its arm; free to turn
    v0, chain = rig.start.velocity, rig.start.chain
    clamped = rig.last._replace(arm_stiffness=np.full(2, np.inf), arm_rotation=np.inf)
    sprung = rig.last._replace(arm_rotation=np.inf)
    turning = clamped._replace(arm_rotation=0.0)

    # a contact that sticks and does not grow is a spring k_t: its stiffness under the load at rest
    along = wall_along(None, rig.wall)
    overlap = float(hertz_overlap(prepare(chain, along).static.force[-1], chain.A[-1]))
    k_t = float(stick_stiffness(rig.last.law, np.sqrt(rig.last.law.radius * overlap)))

    def run(wall: SpatialWall, last: LastSphere, coefficient: float) -> ContactRun:
        """The scene's impact with another wall, last sphere and coefficient."""
        last = with_coefficient(rig._replace(last=last), coefficient)
        search = USUAL_SPATIAL_SEARCH._replace(n_cells=options.n_cells)
        march = march_space(
            chain, wall, v0, last, duration=duration, error=options.error,
            n_save=options.n_save, search=search,
        )  # fmt: skip
        error = float(np.abs(v0).max()) * march.trajectory.error_estimate
        return ContactRun(observed(rig, march, spheres, ""), error)

    def fixed(last: LastSphere) -> ContactRun:
        """The same with the spring k_t between structure and sphere in place of the contact."""
        return run(stuck_wall(rig.wall, k_t, last, chain), clamped, options.sticking)

    of_scene = float(rig.last.law.bound * rig.last.law.modulus / rig.modulus)  # coefficient
    none = run(stuck_wall(rig.wall, 0.0, clamped, chain), clamped, options.sticking)
    runs = {
        "all but the structure's coupling": run(
            uncoupled_wall(rig.wall), rig.last, options.sticking
        ),
        "coupling alone": fixed(clamped),
        "coupling, area that grows": run(rig.wall, clamped, options.sticking),
        "coupling, arm that yields": fixed(sprung),
        "coupling, sphere that turns": fixed(turning),
        "all of these": run(rig.wall, rig.last, options.sticking),
        "all of these, and slip": run(rig.wall, rig.last, of_scene),
    }
    return {name: between(none, each) for name, each in runs.items()}


def picture(compared: list[tuple], spheres: tuple[int, ...]) -> bytes:
    """PNG: what slip changes at each sphere over time, for the largest difference of each state."""
    chosen = {}
    for case, slips, sticks, difference in compared:
        state = slips.contact[0]
        if state not in chosen or difference.largest > chosen[state][3].largest:
            chosen[state] = (case, slips, sticks, difference)
    sets = []
    for sphere in spheres:
        lines = [
            Line(f"{state}: {label(case)}", slips.observed.milliseconds,
                 1e3 * (slips.observed.velocity(sphere) - sticks.observed.velocity(sphere)), "-",
                 i, 1.0)
            for i, (state, (case, slips, sticks, _)) in enumerate(chosen.items())
        ]  # fmt: skip
        sets.append(
            Panel(f"sphere {sphere}", "time [ms]", "with slip less stuck [mm/s]", lines,
                  legend="above" if sphere == spheres[0] else "inside")
        )  # fmt: skip
    return panels(sets, size=(8, 2.6))
