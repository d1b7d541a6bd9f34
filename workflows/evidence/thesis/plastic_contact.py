"""The last contact three times as stiff, as in the thesis, beside one that yields.

The thesis meets plastic deformation by a factor of 3 on the last contact's stiffness. A contact
that yields is softer than Hertz' while it is loaded, and loses energy; the factor makes it stiffer,
and loses none. Nor does the last contact yield first, unless its wall is far stiffer than a sphere:
it bears the largest force, but between two spheres the curvature is twice as large. Thornton's law:
Hertz up to the yield overlap, then the pressure stays, unloading is elastic along a
flattened sphere. Thesis, section 7.2; C. Thornton, J. Appl. Mech. 64 (1997) 383.
"""

import numpy as np

from beadwave import dem
from beadwave.dem.spheres import contact_modulus, yield_overlap
from beadwave.workflows.evidence.study import concluded
from beadwave.workflows.evidence.thesis.observed_run import (
    Observed,
    Setup,
    observed,
    record,
    wave_cells,
    wave_columns,
)
from beadwave.workflows.evidence.thesis.requirements import last, require_chain, require_echo
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.scene import HalfSpaceWall, RigidWall, Scene
from beadwave.workflows.stages.chain import chain, initial_velocity
from beadwave.workflows.stages.progress import Progress

FACTOR = 3.0  # thesis, section 7.2
CONSTRAINT = 1.6  # contact yield stress over yield stress, K. L. Johnson, sec. 6.1
# [Pa] of the softer material; assumed, from structural to quenched steel
YIELD_STRESSES = (0.5e9, 0.75e9, 1.0e9)


def plastic_contact(scene: Scene, progress: Progress) -> Finding:
    """Three times the contact stiffness against a contact that yields (thesis, section 7.2)."""
    spheres = require_chain(scene)
    sphere, v0 = max(spheres), initial_velocity(scene)
    speed = float(np.abs(v0).max())

    # Hertz' law at a wall of steel; the thesis' factor; a yield overlap of the last contact alone
    hertz = scene.but(contact={"law": "hertz", "yield_pressure": None})
    flat = HalfSpaceWall(kind="half-space")
    elastic = chain(hertz.but(wall=flat))
    stiffness = elastic.A.copy()
    stiffness[-1] *= FACTOR
    laws = {"Hertz": elastic, f"Hertz x {FACTOR:g}": elastic._replace(A=stiffness)}
    modulus = contact_modulus(
        last(scene.chain.young), last(scene.chain.poisson), flat.young, flat.poisson
    )
    for stress in YIELD_STRESSES:
        # no contact reaches a yield overlap of 1 m
        overlap = np.full(len(elastic.A), 1.0)
        overlap[-1] = float(yield_overlap(elastic.radius[-1], modulus, CONSTRAINT * stress))
        laws[f"yields at {1e-9 * stress:g} GPa"] = elastic._replace(yield_overlap=overlap)

    def impact(name: str, row: dem.Chain) -> Observed:
        """The scene's impact of a chain at a wall that does not move."""
        setup = Setup(name, row, dem.rigid_wall())
        run = observed(setup, v0, duration=scene.time.duration, spheres=spheres)
        return require_echo(scene, run)

    # the whole chain, and the restitution of one sphere, by which contacts are usually measured
    runs, restitution = [], []
    with progress("contacts"):
        for name, law in laws.items():
            runs.append(impact(name, law))

            # the last sphere alone, without the arm's mass and pull, thrown at the wall
            overlap = None if law.yield_overlap is None else law.yield_overlap[-1:]
            alone = dem.Chain(law.mass[:1], law.radius[-1:], law.A[-1:], yield_overlap=overlap)
            natural = dem.spheres.time_scale(alone.mass[0], alone.A[0], speed)
            thrown = dem.march(
                alone, dem.rigid_wall(), np.array([speed]), duration=12 * natural, dt=natural / 200
            )
            restitution.append(float(-thrown.v[-1, 0] / speed))
        rigid = impact("rigid", chain(hertz.but(wall=RigidWall(kind="rigid"))))

    # a row for each law: force, contact time, rebound, energy lost, reflected waves
    rows = []
    for run, rebound in zip(runs, restitution, strict=True):
        march = run.trajectory
        force = float(march.contact_force[:, -1].max())
        contact_us = 1e6 * run.contact.contact_time.seconds
        lost_percent = 100 * float(march.dissipated_contact[-1] / march.energy_kinetic[0])
        waves = wave_cells(run, sphere, (1, 2))
        rows.append((run.name, force, contact_us, rebound, lost_percent, *waves))
    columns = (
        "last contact", "force_N", "contact_us", "restitution", "lost_%",
        *wave_columns((1, 2)),
    )  # fmt: skip

    # delays of the second reflected wave, of the first where not all laws send a second
    delays = []
    for later in (2, 1):
        waves = [run.wave(sphere, "reflected", later) for run in runs]
        if None not in waves:
            of_hertz, *others = (wave.arrival.time for wave in waves)
            delays = [time - of_hertz for time in others]
            break

    steel = runs[0]
    peaks = [row[1] for row in rows]

    # force over approach while the last contact is not far open
    loops = []
    for run in runs:
        approach, force = 1e6 * run.trajectory.x[:, -1], run.trajectory.contact_force[:, -1]
        closed = approach > -0.1 * approach.max()
        loops.append(Line(run.name, approach[closed], force[closed]))

    # forces of some contacts, and the largest pressure in each, at both walls
    force, n = steel.trajectory.contact_force, len(elastic.A)
    forces = [
        Line("at the wall" if k == n else f"spheres {k} and {k + 1}", steel.milliseconds,
             force[:, k - 1])
        for k in (1, n // 2, n - 1, n)
    ]  # fmt: skip
    number = np.arange(1.0, n + 1)
    pressures = [
        Line("wall of steel", number, 1e-9 * steel.pressures, "o-"),
        Line("rigid surface", number, 1e-9 * rigid.pressures, "o-"),
    ]

    name = steel.name
    figure = [
        Panel("last contact: force over approach", "approach to the wall [µm]", "force [N]", loops),
        Panel(f"contact forces, {name} (figure 7.12)", "time [ms]", "force [N]", forces),
        Panel(
            f"largest pressure, {name}", f"contact, {n} at the wall", "pressure [GPa]", pressures
        ),
        *(record(f"sphere {s}", runs, s) for s in spheres),
    ]
    return concluded(
        __file__,
        columns,
        tuple(rows),
        panels(figure, columns=3, size=(4.8, 3.2)),
        force=steel.trajectory.contact_force.max(axis=0).tolist(),
        pressure=steel.pressures.tolist(),
        rigid_pressure=rigid.pressures.tolist(),
        factor=FACTOR,
        change=[peak / peaks[0] - 1 for peak in peaks[1:]],
        restitution=restitution,
        number=later,
        delays=delays,
        sphere=sphere,
        stresses=YIELD_STRESSES,
        constraint=CONSTRAINT,
    )
