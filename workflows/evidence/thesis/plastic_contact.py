"""The last contact three times as stiff, as in the thesis, beside one that yields.

The thesis meets plastic deformation by a factor of 3 on the last contact's stiffness. A contact
that yields is softer than Hertz' while it is loaded, and loses energy; the factor makes it stiffer,
and loses none. Nor does the last contact yield first, unless its wall is far stiffer than a sphere:
it bears the largest force, but between two spheres the curvature is twice as large. Thornton's law:
Hertz up to the yield overlap, then the pressure stays, unloading is elastic along a
flattened sphere. Thesis, section 7.2; C. Thornton, J. Appl. Mech. 64 (1997) 383.
"""

from typing import Any, NamedTuple

import numpy as np

import dem
from dem.spheres import contact_modulus, yield_overlap
from workflows.evidence.prose import rendered
from workflows.evidence.thesis.observed_run import Observed, Setup, observed
from workflows.evidence.thesis.records import record, wave_cells, wave_columns
from workflows.evidence.thesis.requirements import last, require_chain, require_echo
from workflows.files.run_folder import Picture
from workflows.report.finding import Finding
from workflows.report.plots import Line, Panel, panels
from workflows.report.tables import Table
from workflows.scene import HalfSpaceWall, RigidWall, Scene
from workflows.stages.chain import chain, initial_velocity
from workflows.stages.pipeline import Progress

FACTOR = 3.0  # thesis, section 7.2
YIELD_STRESSES = (0.5e9, 0.75e9, 1.0e9)  # Pa, assumed: structural to quenched steel
CONSTRAINT = 1.6  # contact yield stress over yield stress, K. L. Johnson, sec. 6.1
NEVER = 1.0  # m, a yield overlap that no contact reaches


class Case(NamedTuple):
    """A law of the last contact, in the chain and for a lone sphere."""

    run: Observed
    restitution: float  # of the last sphere alone, thrown at the wall with the striker's speed


def plastic_contact(scene: Scene, progress: Progress) -> Finding:
    """Three times the contact stiffness against a contact that yields (thesis, section 7.2)."""
    spheres = require_chain(scene)
    hertz = scene.but(contact={"law": "hertz", "yield_pressure": None})
    elastic = chain(hertz.but(wall=HalfSpaceWall(kind="half-space")))
    with progress("contacts"):
        cases = [
            Case(_run(scene, name, law, spheres), _restitution(scene, law))
            for name, law in _laws(scene, elastic)
        ]
        rigid = chain(hertz.but(wall=RigidWall(kind="rigid")))
        stiff = _run(scene, "rigid", rigid, spheres)
    columns = (
        "last contact", "force_N", "contact_us", "restitution", "lost_%",
        *wave_columns((1, 2)),
    )  # fmt: skip
    rows = tuple(_row(case, max(spheres)) for case in cases)
    picture = Picture("study_plastic_contact", _picture(cases, stiff, spheres))
    sentences = rendered(__file__, **_numbers(cases, stiff, max(spheres)))
    return Finding((Table("plastic-contact", columns, rows),), sentences, (picture,))


def _laws(scene: Scene, elastic: dem.Chain):
    yield "Hertz", elastic
    stiffer = elastic.A.copy()
    stiffer[-1] *= FACTOR
    yield f"Hertz x {FACTOR:g}", elastic._replace(A=stiffer)
    for stress in YIELD_STRESSES:
        overlap = np.full(len(elastic.A), NEVER)
        overlap[-1] = _yields_at(scene, elastic, stress)
        yield f"yields at {1e-9 * stress:g} GPa", elastic._replace(yield_overlap=overlap)


def _yields_at(scene: Scene, elastic: dem.Chain, stress: float) -> float:
    flat = HalfSpaceWall(kind="half-space")
    own = last(scene.chain.young), last(scene.chain.poisson)
    modulus = contact_modulus(*own, flat.young, flat.poisson)
    return float(yield_overlap(elastic.radius[-1], modulus, CONSTRAINT * stress))


def _run(scene: Scene, name: str, law: dem.Chain, spheres: tuple[int, ...]) -> Observed:
    setup = Setup(name, law, dem.rigid_wall())
    run = observed(setup, initial_velocity(scene), duration=scene.time.duration, spheres=spheres)
    return require_echo(scene, run)


def _restitution(scene: Scene, law: dem.Chain) -> float:
    """Of a lone sphere, without the arm's mass and pull."""
    speed = float(np.abs(initial_velocity(scene)).max())
    alone = dem.Chain(
        law.mass[:1], law.radius[-1:], law.A[-1:],
        yield_overlap=None if law.yield_overlap is None else law.yield_overlap[-1:],
    )  # fmt: skip
    natural = dem.spheres.time_scale(alone.mass[0], alone.A[0], speed)
    run = dem.march(
        alone, dem.rigid_wall(), np.array([speed]), duration=12 * natural, dt=natural / 200
    )
    return float(-run.v[-1, 0] / speed)


def _row(case: Case, sphere: int) -> tuple:
    run = case.run.trajectory
    lost = 100 * float(run.dissipated_contact[-1] / run.energy_kinetic[0])
    force = float(run.contact_force[:, -1].max())
    time = 1e6 * case.run.contact.contact_time.seconds
    return case.run.name, force, time, case.restitution, lost, *wave_cells(case.run, sphere, (1, 2))


def _numbers(cases: list[Case], rigid: Observed, sphere: int) -> dict[str, Any]:
    hertz, stiff, *yielding = cases
    force = hertz.run.trajectory.contact_force.max(axis=0)
    peak = [case.run.trajectory.contact_force[:, -1].max() for case in cases]
    return {
        "force": force.tolist(),
        "pressure": hertz.run.pressures.tolist(),
        "rigid_pressure": rigid.pressures.tolist(),
        "factor": FACTOR,
        "change": [one / peak[0] - 1 for one in peak[1:]],
        "stiff": stiff,
        "yielding": yielding,
        "later": _later(cases, sphere),
        "sphere": sphere,
        "stresses": YIELD_STRESSES,
        "constraint": CONSTRAINT,
    }


class Later(NamedTuple):
    """The last reflected wave that all laws send, by its delays against Hertz' law."""

    number: int
    stiff: float  # [s]
    yielding: list[float]  # [s]


def _later(cases: list[Case], sphere: int) -> Later | None:
    for number in (2, 1):
        waves = [case.run.wave(sphere, "reflected", number) for case in cases]
        if None not in waves:
            hertz, *others = (wave.arrival.time for wave in waves)
            stiff, *yielding = (time - hertz for time in others)
            return Later(number, stiff, yielding)
    return None


def _picture(cases: list[Case], rigid: Observed, spheres: tuple[int, ...]) -> bytes:
    depth = [_loop(case) for case in cases]
    runs = [case.run for case in cases]
    records = [record(f"sphere {sphere}", runs, sphere) for sphere in spheres]
    loop = Panel(
        "last contact: force over approach", "approach to the wall [µm]", "force [N]", depth
    )
    rows = [loop, _forces(cases[0].run), _pressures(cases[0].run, rigid), *records]
    return panels(rows, columns=3, size=(4.8, 3.2))


def _pressures(steel: Observed, rigid: Observed) -> Panel:
    number = np.arange(1.0, len(steel.chain.A) + 1)
    lines = [
        Line("wall of steel", number, 1e-9 * steel.pressures, "o-"),
        Line("rigid surface", number, 1e-9 * rigid.pressures, "o-"),
    ]
    title = f"largest pressure, {steel.name}"
    return Panel(title, f"contact, {len(number)} at the wall", "pressure [GPa]", lines)


def _forces(run: Observed) -> Panel:
    n = run.trajectory.contact_force.shape[1]
    lines = [
        Line("at the wall" if k == n else f"spheres {k} and {k + 1}", run.milliseconds,
             run.trajectory.contact_force[:, k - 1])
        for k in (1, n // 2, n - 1, n)
    ]  # fmt: skip
    return Panel(f"contact forces, {run.name} (figure 7.12)", "time [ms]", "force [N]", lines)


def _loop(case: Case) -> Line:
    """Force over approach while the last contact is not far open."""
    run = case.run.trajectory
    approach = 1e6 * run.x[:, -1]
    near = approach > -0.1 * approach.max()
    return Line(case.run.name, approach[near], run.contact_force[near, -1])
