"""Spheres of 13 g, 70 g and 0.5 kg: by their size, as in a workshop, or by their density alone.

The thesis varies the mass in T_c ~ m^(2/5) and keeps the rest. A larger steel sphere has a stiffer
contact as well, A ~ sqrt(R): T_c ~ m^(1/3), and the wave passes diameters that grow alike, so that
its speed in m/s does not change at all. Thesis, section 2.2.2, figure 2.9, equation 2.10.
"""

from typing import NamedTuple

import numpy as np

import dem
from dem.spheres import time_scale
from dem.waves.measures import exponent
from workflows.evidence.prose import rendered
from workflows.evidence.thesis.observed_run import Observed, Setup, observed
from workflows.evidence.thesis.requirements import bare, last, require_chain
from workflows.files.run_folder import Picture
from workflows.report.finding import Finding
from workflows.report.plots import Line, Panel, panels
from workflows.report.tables import Table
from workflows.scene import InvalidScene, Scene
from workflows.stages.chain import initial_velocity
from workflows.stages.pipeline import Progress

MASSES = (0.013, 0.07, 0.5)  # kg, thesis, figure 2.9
BETWEEN = (0.013, 0.03, 0.07, 0.2, 0.5)
BY = ("radius", "density")


class Measures(NamedTuple):
    """What a chain shows of its spheres' mass."""

    contact_us: float
    speed_m_s: float
    spheres_per_ms: float
    peak_velocity_m_s: float
    peak_force_N: float
    arr: float


class Case(NamedTuple):
    """Spheres of one mass."""

    by: str  # what was changed to get there
    mass: float  # [kg]
    run: Observed
    measures: Measures


def sphere_mass(scene: Scene, progress: Progress) -> Finding:
    """Waves of lighter and heavier spheres, by size and by density (thesis, figure 2.9)."""
    spheres = require_chain(scene)
    if max(spheres) == 1:
        raise InvalidScene("output.spheres = [1] sees no incident wave; add another sphere.")
    with progress("chains"):
        cases = [_case(scene, mass, by, spheres) for by in BY for mass in BETWEEN]
    rows = tuple((case.by, case.mass, *case.measures) for case in cases)
    striker = cases[0].run.trajectory.v[0].max()
    sentences = rendered(
        __file__, power={by: _powers(cases, by) for by in BY}, sphere=max(spheres),
        peaks=[case.measures.peak_velocity_m_s / striker for case in cases],
        arr=[case.measures.arr for case in cases], contact=cases[0].run.contact,
    )  # fmt: skip
    table = Table("sphere-mass", ("by", "mass_kg", *Measures._fields), rows)
    return Finding((table,), sentences, (Picture("study_sphere_mass", _picture(cases, spheres)),))


def _case(scene: Scene, mass: float, by: str, spheres: tuple[int, ...]) -> Case:
    """A chain of spheres like the scene's last one, but for their mass."""
    keys = ("radius", "density", "young", "poisson")
    changed = {key: last(getattr(scene.chain, key)) for key in keys}
    factor = mass / dem.spheres.mass(changed["radius"], changed["density"])
    changed[by] *= factor ** (1 / 3) if by == "radius" else factor
    row = bare(scene.but(chain=changed))
    v0 = initial_velocity(scene)
    duration = 2.8 * len(v0) * time_scale(row.mass[0], row.A[0], np.abs(v0).max())
    setup = Setup(f"{mass:g} kg", row, dem.rigid_wall())
    run = observed(setup, v0, duration=duration, spheres=spheres)
    return Case(by, mass, run, _measures(run, max(spheres)))


def _measures(run: Observed, sphere: int) -> Measures:
    return Measures(
        contact_us=1e6 * run.contact.contact_time.seconds,
        speed_m_s=run.contact.speed_in,
        spheres_per_ms=1e-3 * run.contact.speed_in / (2 * run.chain.radius[0]),
        peak_velocity_m_s=run.wave(sphere, "incident", 1).arrival.peak_velocity,
        peak_force_N=float(run.trajectory.contact_force[:, -1].max()),
        arr=run.contact.arr,
    )


def _powers(cases: list[Case], by: str) -> Measures:
    """Exponents of the measures over the mass."""
    chosen = [case for case in cases if case.by == by]
    mass = [case.mass for case in chosen]
    columns = zip(*(case.measures for case in chosen), strict=True)
    return Measures(*(exponent(mass, column) for column in columns))


def _picture(cases: list[Case], spheres: tuple[int, ...]) -> bytes:
    shown = [case for case in cases if case.by == "radius" and case.mass in MASSES]
    records = [
        Panel(
            f"{case.mass:g} kg, R = {1e3 * case.run.chain.radius[0]:.1f} mm (figure 2.9)",
            "time [ms]", "velocity [m/s]",
            [Line(f"sphere {s}", case.run.milliseconds, case.run.velocity(s)) for s in spheres],
        )
        for case in shown
    ]  # fmt: skip
    laws = [
        _law(cases, "contact time", "µs", "contact_us"),
        _law(cases, "speed", "m/s", "speed_m_s"),
        _law(cases, "peak force at the wall", "N", "peak_force_N"),
    ]
    return panels([*records, *laws], columns=3, size=(4.4, 3))


def _law(cases: list[Case], name: str, unit: str, measure: str) -> Panel:
    lines = []
    for by in BY:
        points = [(c.mass, getattr(c.measures, measure)) for c in cases if c.by == by]
        power = round(getattr(_powers(cases, by), measure), 2) + 0.0
        lines.append(Line(f"by {by}, power {power:+.2f}", *np.transpose(points), "o-"))
    return Panel(name, "mass of a sphere [kg]", f"{name} [{unit}]", lines, "xy")
