"""The last contact three times as stiff, as in the thesis, beside one that yields.

The thesis meets plastic deformation by a factor of 3 on the last contact's stiffness. A contact
that yields is softer than Hertz' while it is loaded, and loses energy; the factor makes it stiffer,
and loses none. Nor does the last contact yield first, unless its wall is far stiffer than a sphere:
it bears the largest force, but between two spheres the curvature is twice as large. Thornton's law:
Hertz up to the yield overlap, then the pressure stays, unloading is elastic along a
flattened sphere. Thesis, section 7.2; C. Thornton, J. Appl. Mech. 64 (1997) 383.
"""

from typing import NamedTuple

import numpy as np

import dem
from dem.spheres import (
    contact_modulus,
    max_pressure,
    modulus_of_contact,
    radii_of_contacts,
    yield_overlap,
)
from workflows.chain_stages import chain, initial_velocity
from workflows.run_folder import Picture
from workflows.scene import HalfSpaceWall, RigidWall, Scene
from workflows.stages import Watch
from workflows.studies.observed import Observed, observed, require_chain, require_echo
from workflows.study import Finding
from workflows.study_figures import Line, Panel, panels

FACTOR = 3.0  # thesis, section 7.2
YIELD_STRESSES = (0.5e9, 0.75e9, 1.0e9)  # Pa, assumed: structural to quenched steel
CONSTRAINT = 1.6  # contact yield stress over yield stress, K. L. Johnson, sec. 6.1
NEVER = 1.0  # m, a yield overlap that no contact reaches


class Case(NamedTuple):
    """A law of the last contact, in the chain and for a lone sphere."""

    run: Observed
    restitution: float  # of the last sphere alone, thrown at the wall with the striker's speed


def plastic_contact(scene: Scene, watch: Watch) -> Finding:
    """Hertz, the factor 3, and Thornton's law for three yield stresses."""
    spheres = require_chain(scene)
    hertz = scene.contact.model_copy(update={"law": "hertz", "yield_pressure": None})
    half_space = {"wall": HalfSpaceWall(kind="half-space"), "contact": hertz}
    elastic = chain(scene.model_copy(update=half_space))
    with watch("contacts"):
        cases = [
            Case(_run(scene, name, law, spheres), _restitution(scene, law))
            for name, law in _laws(scene, elastic)
        ]
        rigid = chain(scene.model_copy(update=half_space | {"wall": RigidWall(kind="rigid")}))
        stiff = _run(scene, "rigid", rigid, spheres)
    columns = (
        "last contact", "force_N", "contact_us", "restitution", "lost_%",
        *(f"{what}{k}" for k in (1, 2) for what in ("t_ms_", "v_m_s_")),
    )  # fmt: skip
    rows = tuple(_row(case, max(spheres)) for case in cases)
    picture = Picture("study_plastic_contact", _picture(cases, stiff, spheres))
    sentences = (_first_to_yield(cases[0].run, stiff), *_sentences(cases, max(spheres)))
    return Finding("plastic-contact", columns, rows, sentences, (picture,))


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
    E, nu = (float(np.atleast_1d(v)[-1]) for v in (scene.chain.young, scene.chain.poisson))
    surface = HalfSpaceWall(kind="half-space")
    modulus = contact_modulus(E, nu, surface.young, surface.poisson)
    return float(yield_overlap(elastic.radius[-1], modulus, CONSTRAINT * stress))


def _run(scene: Scene, name: str, law: dem.Chain, spheres: tuple[int, ...]) -> Observed:
    run = observed(
        name, law, dem.rigid_wall(), initial_velocity(scene), duration=scene.time.duration,
        spheres=spheres,
    )  # fmt: skip
    return require_echo(scene, run)


def _restitution(scene: Scene, law: dem.Chain) -> float:
    """Of a lone sphere, without the arm's mass and pull."""
    speed = float(np.abs(initial_velocity(scene)).max())
    last = dem.Chain(
        law.mass[:1], law.radius[-1:], law.A[-1:],
        yield_overlap=None if law.yield_overlap is None else law.yield_overlap[-1:],
    )  # fmt: skip
    natural = dem.spheres.time_scale(last.mass[0], last.A[0], speed)
    run = dem.march(
        last, dem.rigid_wall(), np.array([speed]), duration=12 * natural, dt=natural / 200
    )
    return float(-run.v[-1, 0] / speed)


def _row(case: Case, sphere: int) -> tuple:
    run = case.run.trajectory
    waves = [case.run.wave(sphere, "reflected", k) for k in (1, 2)]
    seen = [
        value
        for wave in waves
        for value in (
            (None, None) if wave is None else (1e3 * wave.arrival.time, wave.arrival.peak_velocity)
        )
    ]
    lost = 100 * float(run.dissipated_contact[-1] / run.energy_kinetic[0])
    force = float(run.contact_force[:, -1].max())
    time = 1e6 * case.run.contact.contact_time.seconds
    return case.run.name, force, time, case.restitution, lost, *seen


def pressures(run: Observed) -> np.ndarray:
    """Largest pressure [Pa] ever in each contact (n,), the last one at the wall."""
    R = radii_of_contacts(run.chain.radius)
    return max_pressure(run.trajectory.contact_force.max(axis=0), R,
                        modulus_of_contact(run.chain.A, R))  # fmt: skip


def _first_to_yield(elastic: Observed, rigid: Observed) -> str:
    force = elastic.trajectory.contact_force.max(axis=0)
    steel, stiff = pressures(elastic), pressures(rigid)
    among = int(steel[:-1].argmax())
    where = "at the wall" if steel[-1] > steel[:-1].max() else "between spheres"
    against = "at the wall" if stiff[-1] > stiff[:-1].max() else "between spheres"
    return (
        f"Figure 7.12: the largest force is at the wall, {force[-1]:.0f} N, against "
        f"{force[:-1].max():.0f} N between spheres, and the thesis expects that contact to yield "
        f"first. The pressure decides: {1e-9 * steel[-1]:.2f} GPa at a steel wall, "
        f"{1e-9 * steel[among]:.2f} between the spheres {among + 1} and {among + 2}, largest "
        f"{where}; against the rigid surface of the thesis' program {1e-9 * stiff[-1]:.2f} and "
        f"{1e-9 * stiff[:-1].max():.2f}, largest {against}."
    )


def _later(cases: list[Case], sphere: int) -> str:
    """When the last reflected wave that all laws send comes, against Hertz' law."""
    for number, name in ((2, "second"), (1, "first")):
        waves = [case.run.wave(sphere, "reflected", number) for case in cases]
        if None not in waves:
            hertz, stiff, *yielding = (1e6 * wave.arrival.time for wave in waves)
            others = ", ".join(f"{time - hertz:+.0f}" for time in yielding)
            return (
                f"at sphere {sphere} the {name} reflected wave comes {stiff - hertz:+.0f} µs with "
                f"it, and {others} µs with a contact that yields."
            )
    return f"not all of them send the same waves to sphere {sphere}."


def _sentences(cases: list[Case], sphere: int) -> tuple[str, ...]:
    _, stiff, *yielding = cases
    force = [case.run.trajectory.contact_force[:, -1].max() for case in cases]
    return (
        f"The factor {FACTOR:g} raises the peak force by {100 * (force[1] / force[0] - 1):.0f} % "
        f"and loses no energy (restitution {stiff.restitution:.4f}). A contact that yields lowers "
        f"it by {', '.join(f'{100 * (1 - F / force[0]):.0f}' for F in force[2:])} % and gives back "
        f"{', '.join(f'{case.restitution:.3f}' for case in yielding)} of a sphere's speed.",
        "So the factor is no plasticity but a knob that works the other way: "
        f"{_later(cases, sphere)}",
        f"The table: time [ms] and peak velocity [m/s] of the first two reflected waves at sphere "
        f"{sphere}; restitution is that of the last sphere alone.",
        f"Yield stresses are assumed: {', '.join(f'{1e-9 * s:g}' for s in YIELD_STRESSES)} GPa of "
        f"the softer partner, contact yield at {CONSTRAINT:g} of it. Only the first blow yields so "
        "much: a dented contact is conforming, elastic and, by then, stiffer than Hertz', which is "
        "what a factor above 1 can stand for after many tests.",
        "The wall is a half-space of steel; the arm and its pull are those of the scene. Only the "
        "last contact yields here, as in the thesis; contact.yield_pressure of a run lets all.",
    )


def _picture(cases: list[Case], rigid: Observed, spheres: tuple[int, ...]) -> bytes:
    depth = [_loop(case) for case in cases]
    records = [
        Panel(
            f"sphere {sphere}", "time [ms]", "velocity [m/s]",
            [Line(case.run.name, case.run.milliseconds, case.run.velocity(sphere))
             for case in cases],
        )
        for sphere in spheres
    ]  # fmt: skip
    loop = Panel(
        "last contact: what each law does", "approach to the wall [µm]", "force [N]", depth
    )
    rows = [loop, _forces(cases[0].run), _pressures(cases[0].run, rigid), *records]
    return panels(rows, columns=3, size=(4.8, 3.2))


def _pressures(steel: Observed, rigid: Observed) -> Panel:
    number = np.arange(1.0, len(steel.chain.A) + 1)
    lines = [
        Line("wall of steel", number, 1e-9 * pressures(steel), "o-"),
        Line("rigid surface", number, 1e-9 * pressures(rigid), "o-"),
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
