"""Spheres of 13 g to 0.5 kg: heavier by their size, as in a workshop, or by their density alone.

You will see the exponents of contact time, wave speed and force over the mass. The thesis varies
the mass in T_c ~ m^(2/5) and keeps the rest. A larger steel sphere has a stiffer contact as well,
A ~ sqrt(R), so that T_c ~ m^(1/3), and the wave passes diameters that grow alike: its speed in m/s
does not change at all.

Thesis, section 2.2.2, figure 2.9, equation 2.10.

Run it: python examples/gallery/sphere_mass.py
"""

from pathlib import Path

import numpy as np

from beadwave import dem, scene
from beadwave.dem.waves.measures import exponent
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.report.tables import aligned_text
from beadwave.workflows.stages.chain.chain import initial_velocity
from observed import SPHERES, bare_chain, impact, last, observed, round_trip, say

MASSES = (0.013, 0.03, 0.07, 0.2, 0.5)  # [kg] figure 2.9's, two between
FIGURE_2_9 = (0.013, 0.07, 0.5)  # [kg]
MEASURES = (
    "contact_us", "speed_m_s", "spheres_per_ms", "peak_velocity_m_s", "peak_force_N", "arr",
)  # fmt: skip


def main(masses=MASSES):
    """Exponents p of measure ~ m^p, in order of MEASURES, by radius and by density."""
    rig, sphere = scene("rig-rigid"), SPHERES[-1]
    v0 = initial_velocity(rig)

    # chains of spheres like the scene's last one but for their mass, m ~ R^3 and m ~ rho
    rows, runs = [], []
    for by in ("radius", "density"):
        for mass in masses:
            keys = ("radius", "density", "young", "poisson")
            material = {key: last(getattr(rig.chain, key)) for key in keys}
            factor = mass / dem.spheres.mass(material["radius"], material["density"])
            material[by] *= factor ** (1 / 3) if by == "radius" else factor
            row = bare_chain(rig.but(chain=material))
            march = impact(row, dem.rigid_wall(), v0, round_trip(row, np.abs(v0).max()))
            run = observed(f"{mass:g} kg", row, march, SPHERES)
            contact = run.contact
            rows.append((
                by, mass, 1e6 * contact.contact_time.seconds, contact.speed_in,
                1e-3 * contact.speed_in / (2 * row.radius[0]),
                run.wave(sphere, "incident", 1).arrival.peak_velocity,
                float(march.contact_force[:, -1].max()), contact.arr,
            ))  # fmt: skip
            runs.append(run)
    values = {
        by: np.array([row[2:] for row in rows if row[0] == by]) for by in ("radius", "density")
    }
    size, density = (
        np.array([exponent(masses, column) for column in values[by].T]) for by in values
    )

    print(aligned_text(("by", "mass_kg", *MEASURES), rows))
    T_c, v_s, _, v, F, _ = range(6)
    peaks = [row[2 + v] / v0.max() for row in rows]
    arr = [row[-1] for row in rows]
    epsilon = contact.velocity_sum_ratio
    say(f"""
        The contact time goes with the mass to the power {density[T_c]:.3f} where only the density
        changes (2/5 in equation 2.10), but {size[T_c]:.3f} (1/3) where the sphere grows, because a
        larger sphere also has a stiffer contact. The speed in m/s goes with the power
        {size[v_s]:z.3f} by size, because the diameters that the wave passes shrink alike, and
        {density[v_s]:.3f} (-2/5) by density.

        The thesis reads lower peaks for lighter spheres from figure 2.9. The peak force falls
        (power {size[F]:.3f} by size, {density[F]:.3f} by density); the peak velocity does not: it
        is {np.mean(peaks):.3f} of the striker's at sphere {sphere}, and the amplitude ratio (ARR,
        mean of equation 2.9 along the chain) {np.mean(arr):.3f}, whatever the mass.

        Equation 2.9 equates the ARR with epsilon^(6/5), epsilon being the velocity ratio of
        equation 2.8. For these spheres, which lose no energy, that is {epsilon**1.2:.3f}: the wall
        reverses the momentum, so equation 2.8 measures neither the loss nor the ARR.
        """)

    # velocities of the observed spheres for the masses of figure 2.9; power laws over the mass
    figure = []
    for (by, mass, *_), run in zip(rows, runs, strict=True):
        if by == "radius" and mass in FIGURE_2_9:
            title = f"{mass:g} kg, R = {1e3 * run.chain.radius[0]:.1f} mm (figure 2.9)"
            lines = [Line(f"sphere {s}", run.milliseconds, run.velocity(s)) for s in SPHERES]
            figure.append(Panel(title, "time [ms]", "velocity [m/s]", lines))
    for name, unit, i in (
        ("contact time", "µs", T_c), ("speed", "m/s", v_s), ("peak force at the wall", "N", F),
    ):  # fmt: skip
        lines = [
            Line(f"by {by}, power {power[i]:+z.2f}", np.array(masses),
                 values[by][:, i], "o-")
            for by, power in (("radius", size), ("density", density))
        ]  # fmt: skip
        figure.append(Panel(name, "mass of a sphere [kg]", f"{name} [{unit}]", lines, "xy"))
    Path("sphere_mass.png").write_bytes(panels(figure, columns=3, size=(4.4, 3)))
    return size, density


if __name__ == "__main__":
    main()
