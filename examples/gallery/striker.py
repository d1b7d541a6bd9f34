"""Strikers of other speed and mass: scaling laws of the wave, and the train that a heavy one makes.

You will see the power laws of a Hertz chain without preload,

    F ~ V^(6/5),  V_s ~ V^(1/5),  T_c ~ V^(-1/5)

for the force, the speed of the wave and the contact time over the striker's speed V, and the share
of the energy in the leading wave over the striker's mass: a light striker bounces back, a heavy one
sends a train of waves of which the first holds only a part of the energy.

Thesis, section 2.2.1; S. Sen et al., Phys. Rep. 462 (2008) 21.

Run it: python examples/gallery/striker.py
"""

from pathlib import Path

import numpy as np

from beadwave import dem, scene
from beadwave.dem.spheres import time_scale
from beadwave.dem.waves.measures import exponent, leading_share
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.report.tables import aligned_text
from beadwave.workflows.stages.chain.chain import initial_velocity
from observed import SPHERES, bare_chain, impact, observed, record, round_trip, say

SPEEDS = (0.05, 0.1, 0.31, 1.0, 2.0)  # [m/s] the thesis' in the middle
# share of the energy in the leading wave by the striker's mass over a sphere's, published
REFERENCE = {0.5: 0.86492, 1.0: 0.99366, 2.0: 0.96120, 5.0: 0.71353, 10.0: 0.48407}
N_FREE = 60  # spheres of the free chain, in which a train spreads out


def main(speeds=SPEEDS, mass_ratios=tuple(REFERENCE)):
    """Exponents of contact time, wave speed and force over the striker's speed; shares of the
    energy in the leading wave."""
    rig = scene("rig-rigid")

    # the chain without preload, struck at each speed
    row, runs, measures = bare_chain(rig), [], []
    for speed in speeds:
        v0 = np.eye(len(row.mass))[0] * speed
        march = impact(row, dem.rigid_wall(), v0, round_trip(row, speed))
        run = observed(f"{speed:g} m/s", row, march, SPHERES)
        force = march.contact_force[:, : len(row.mass) - 1]
        middle = float(force[:, force.shape[1] // 2].max())
        runs.append(run)
        measures.append((1e6 * run.contact.contact_time.seconds, run.contact.speed_in, middle))
    contact_us, wave_speed, peak_force = np.transpose(measures)
    powers = np.array([exponent(speeds, values) for values in (contact_us, wave_speed, peak_force)])

    # a long free chain of equal spheres behind strikers of each mass, for 55 natural times
    shares, final = [], []  # of the energy in the leading wave; velocities over the striker's
    first = (rig.chain.radius, rig.chain.density, rig.chain.young, rig.chain.poisson)
    free = dem.row_of_spheres(*first, count=N_FREE, flat=None)
    speed = float(np.abs(initial_velocity(rig)).max())
    unit = time_scale(free.mass[1], free.A[0], speed)
    for ratio in mass_ratios:
        mass = free.mass.copy()
        mass[0] *= ratio
        struck = free._replace(mass=mass)
        v0 = np.eye(N_FREE)[0] * speed
        run = dem.march(struck, None, v0, duration=55 * unit, dt=0.05 * unit, n_save=1100)
        shares.append(leading_share(run, struck))
        final.append(run.v[-1] / speed)
    published = np.array([REFERENCE[ratio] for ratio in mass_ratios])
    shares = np.array(shares)

    rows = [(f"{v:g} m/s", *m, None, None) for v, m in zip(speeds, measures, strict=True)]
    for ratio, share, reference in zip(mass_ratios, shares, published, strict=True):
        rows.append((f"mass x {ratio:g}", None, None, None, float(share), float(reference)))
    columns = ("striker", "contact_us", "speed_m_s", "peak_force_N", "leader_share", "reference")
    print(aligned_text(columns, rows))
    say(f"""
        Powers of the striker's speed: force {powers[2]:.5f} (6/5), speed of the wave
        {powers[1]:.5f} (1/5), contact time {powers[0]:.5f} (-1/5): between {speeds[0]:g} and
        {speeds[-1]:g} m/s the contact time falls by {1 - contact_us[-1] / contact_us[0]:.0%}.

        The share of the energy in the leading wave agrees with the published values within
        {np.abs(shares - published).max():.1e}. Equation 2.5 gives all of the energy to the wave; a
        striker {mass_ratios[-1]:g} times as heavy as a sphere gives it {shares[-1]:.0%}, one of
        {mass_ratios[0]:g} of the mass rebounds with {-final[0][0]:.2f} of its speed.
        """)

    # records at the outermost sphere, power laws; trains at the end, and the leader's share
    laws = [
        Line(f"{name}, power {power:+.2f}", np.array(speeds), values, "o-")
        for name, power, values in (
            ("contact time [µs]", powers[0], contact_us),
            ("speed [m/s]", powers[1], wave_speed),
            ("force [N]", powers[2], peak_force),
        )
    ]
    numbers, ratios = np.arange(1, N_FREE + 1.0), np.array(mass_ratios)
    trains = [Line(f"mass x {r:g}", numbers, v) for r, v in zip(mass_ratios, final, strict=True)]
    leaders = [Line("this run", ratios, shares, "o-"), Line("reference", ratios, published, "x", 1)]
    mass = "striker's mass over a sphere's"
    figure = [
        record(f"sphere {SPHERES[-1]}", runs[2:], SPHERES[-1]),
        Panel("scaling with the striker's speed", "striker's speed [m/s]", "value", laws, "xy"),
        Panel(
            f"{N_FREE} free spheres, at the end", "sphere", "velocity over the striker's", trains
        ),
        Panel("leading wave", mass, "share of the energy", leaders, "x"),
    ]
    Path("striker.png").write_bytes(panels(figure, columns=2, size=(5.4, 3.2)))
    return powers, shares


if __name__ == "__main__":
    main()
