"""Spheres of 13 g, 70 g and 0.5 kg: by their size, as in a workshop, or by their density alone.

The thesis varies the mass in T_c ~ m^(2/5) and keeps the rest. A larger steel sphere has a stiffer
contact as well, A ~ sqrt(R): T_c ~ m^(1/3), and the wave passes diameters that grow alike, so that
its speed in m/s does not change at all. Thesis, section 2.2.2, figure 2.9, equation 2.10.
"""

from typing import NamedTuple

import numpy as np

from beadwave import dem
from beadwave.dem.waves.measures import exponent
from beadwave.workflows.evidence.study import concluded
from beadwave.workflows.evidence.thesis.observed_run import Setup, observed, round_trip
from beadwave.workflows.evidence.thesis.requirements import bare, last, require_chain
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.stages.chain import initial_velocity
from beadwave.workflows.stages.progress import Progress

FIGURE_2_9 = (0.013, 0.07, 0.5)  # [kg] masses of the thesis' figure
CHANGED = ("radius", "density")  # what reaches a mass


class SphereMassOptions(NamedTuple):
    """What the study varies."""

    masses: tuple[float, ...] = (0.013, 0.03, 0.07, 0.2, 0.5)  # [kg] figure 2.9's, two between


class MassMeasures(NamedTuple):
    """What a chain shows of its spheres' mass; over several masses, the exponents of these."""

    contact_us: float
    speed_m_s: float
    spheres_per_ms: float
    peak_velocity_m_s: float
    peak_force_N: float
    arr: float


def sphere_mass(
    scene: Scene, progress: Progress, options: SphereMassOptions = SphereMassOptions()
) -> Finding:
    """Waves of lighter and heavier spheres, by size and by density (thesis, figure 2.9)."""
    spheres = require_chain(scene)
    if max(spheres) == 1:
        raise InvalidScene("output.spheres = [1] sees no incident wave; add another sphere.")
    sphere, v0 = max(spheres), initial_velocity(scene)

    # chains of spheres like the scene's last one but for their mass, m ~ R^3 and m ~ rho
    rows, runs = [], []
    with progress("chains"):
        for by in CHANGED:
            for mass in options.masses:
                keys = ("radius", "density", "young", "poisson")
                material = {key: last(getattr(scene.chain, key)) for key in keys}
                factor = mass / dem.spheres.mass(material["radius"], material["density"])
                material[by] *= factor ** (1 / 3) if by == "radius" else factor
                row = bare(scene.but(chain=material))
                setup = Setup(f"{mass:g} kg", row, dem.rigid_wall())
                duration = round_trip(row, np.abs(v0).max())
                run = observed(setup, v0, duration=duration, spheres=spheres)
                measures = MassMeasures(
                    contact_us=1e6 * run.contact.contact_time.seconds,
                    speed_m_s=run.contact.speed_in,
                    spheres_per_ms=1e-3 * run.contact.speed_in / (2 * row.radius[0]),
                    peak_velocity_m_s=run.wave(sphere, "incident", 1).arrival.peak_velocity,
                    peak_force_N=float(run.trajectory.contact_force[:, -1].max()),
                    arr=run.contact.arr,
                )
                rows.append((by, mass, *measures))
                runs.append(run)

    # exponents p of measure ~ m^p
    powers, of_measures = {}, {}
    for by in CHANGED:
        of_measures[by] = MassMeasures(*np.transpose([row[2:] for row in rows if row[0] == by]))
        powers[by] = MassMeasures(*(exponent(options.masses, y) for y in of_measures[by]))
    striker_speed = runs[0].trajectory.v[0].max()

    # velocities of the observed spheres, a panel for each mass of figure 2.9
    figure = []
    for (by, mass, *_), run in zip(rows, runs, strict=True):
        if by == "radius" and mass in FIGURE_2_9:
            title = f"{mass:g} kg, R = {1e3 * run.chain.radius[0]:.1f} mm (figure 2.9)"
            lines = [Line(f"sphere {s}", run.milliseconds, run.velocity(s)) for s in spheres]
            figure.append(Panel(title, "time [ms]", "velocity [m/s]", lines))

    # power laws over the mass
    for name, unit, measure in (
        ("contact time", "µs", "contact_us"),
        ("speed", "m/s", "speed_m_s"),
        ("peak force at the wall", "N", "peak_force_N"),
    ):
        lines = []
        for by in CHANGED:
            y, power = getattr(of_measures[by], measure), getattr(powers[by], measure)
            label = f"by {by}, power {round(power, 2) + 0.0:+.2f}"
            lines.append(Line(label, np.array(options.masses), y, "o-"))
        figure.append(Panel(name, "mass of a sphere [kg]", f"{name} [{unit}]", lines, "xy"))

    return concluded(
        __file__, ("by", "mass_kg", *MassMeasures._fields), tuple(rows),
        panels(figure, columns=3, size=(4.4, 3)), power=powers, sphere=sphere,
        peaks=[run.wave(sphere, "incident", 1).arrival.peak_velocity / striker_speed
               for run in runs],
        arr=[run.contact.arr for run in runs], contact=runs[0].contact,
    )  # fmt: skip
