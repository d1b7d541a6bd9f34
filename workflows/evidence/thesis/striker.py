"""Strikers of other speed and mass: scaling laws of the wave, and the train that a heavy one makes.

    F ~ V^(6/5),  V_s ~ V^(1/5),  T_c ~ V^(-1/5)

are exact for a Hertz chain without preload. A light striker bounces back, a heavy one sends a train
of waves of which the first holds only a part of the energy. Thesis, section 2.2.1; S. Sen et al.,
Phys. Rep. 462 (2008) 21.
"""

from typing import NamedTuple

import numpy as np

from beadwave import dem
from beadwave.dem.spheres import time_scale
from beadwave.dem.waves.measures import exponent, leading_share
from beadwave.workflows.evidence.study import concluded
from beadwave.workflows.evidence.thesis.observed_run import Setup, observed, record, round_trip
from beadwave.workflows.evidence.thesis.requirements import bare, require_chain
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.chain import initial_velocity
from beadwave.workflows.stages.progress import Progress

# share of the energy in the leading wave by the striker's mass over a sphere's, published
REFERENCE = {0.5: 0.86492, 1.0: 0.99366, 2.0: 0.96120, 5.0: 0.71353, 10.0: 0.48407}


class StrikerOptions(NamedTuple):
    """What the study varies."""

    speeds: tuple[float, ...] = (0.05, 0.1, 0.31, 1.0, 2.0)  # [m/s] the thesis' in the middle
    mass_ratios: tuple[float, ...] = (0.5, 1.0, 2.0, 5.0, 10.0)  # keys of REFERENCE, 1 among them
    n_spheres: int = 60  # of the free chain that lets a train spread out; not varied


class SpeedMeasures(NamedTuple):
    """What a chain shows of its striker's speed; over several speeds, the exponents of these."""

    contact_us: float
    speed_m_s: float
    peak_force_N: float  # in the middle of the chain


def striker(
    scene: Scene, progress: Progress, options: StrikerOptions = StrikerOptions()
) -> Finding:
    """Scaling laws of the striker's speed, wave trains of its mass (thesis, section 2.2.1)."""
    spheres = require_chain(scene)
    speeds, ratios = np.array(options.speeds), np.array(options.mass_ratios)

    # the scene's chain, without preload, struck at each speed
    runs, measures = [], []
    with progress("speeds"):
        row = bare(scene)
        for speed in options.speeds:
            v0 = np.eye(len(row.mass))[0] * speed
            setup = Setup(f"{speed:g} m/s", row, dem.rigid_wall())
            run = observed(setup, v0, duration=round_trip(row, speed), spheres=spheres)
            force = run.trajectory.contact_force[:, : len(row.mass) - 1]
            middle = float(force[:, force.shape[1] // 2].max())
            contact_us = 1e6 * run.contact.contact_time.seconds
            runs.append(run)
            measures.append(SpeedMeasures(contact_us, run.contact.speed_in, middle))
    columns = SpeedMeasures(*zip(*measures, strict=True))
    powers = SpeedMeasures(*(exponent(speeds, values) for values in columns))

    # a long free chain of equal spheres behind strikers of each mass, for 55 natural times
    shares, final = [], []  # of the energy in the leading wave; velocities over the striker's
    with progress("masses"):
        material = (scene.chain.radius, scene.chain.density, scene.chain.young, scene.chain.poisson)
        of_first = (float(np.atleast_1d(value)[0]) for value in material)
        chain = dem.row_of_spheres(*of_first, count=options.n_spheres, flat=None)
        speed = float(np.abs(initial_velocity(scene)).max())
        unit = time_scale(chain.mass[1], chain.A[0], speed)
        for ratio in options.mass_ratios:
            mass = chain.mass.copy()
            mass[0] *= ratio
            struck = chain._replace(mass=mass)
            v0 = np.eye(len(mass))[0] * speed
            run = dem.march(struck, None, v0, duration=55 * unit, dt=0.05 * unit, n_save=1100)
            shares.append(leading_share(run, struck))
            final.append(run.v[-1] / speed)
    published = [REFERENCE[ratio] for ratio in options.mass_ratios]

    rows = (
        *((f"{v:g} m/s", *m, None, None) for v, m in zip(options.speeds, measures, strict=True)),
        *(
            (f"mass x {ratio:g}", None, None, None, share, reference)
            for ratio, share, reference in zip(ratios, shares, published, strict=True)
        ),
    )

    # records at the outermost sphere, and the power laws
    sphere = max(spheres)
    names = ("contact time [µs]", "speed [m/s]", "force [N]")
    laws = [
        Line(f"{name}, power {power:+.2f}", speeds, values, "o-")
        for name, power, values in zip(names, powers, columns, strict=True)
    ]
    scaling = "scaling with the striker's speed"
    figure = [
        record(f"sphere {sphere}", runs[2:], sphere),
        Panel(scaling, "striker's speed [m/s]", "value", laws, "xy"),
    ]

    # trains: velocities along the chain at the end, and the leader's share beside the published
    numbers = np.arange(1, options.n_spheres + 1.0)
    profiles = [
        Line(f"mass x {ratio:g}", numbers, v) for ratio, v in zip(ratios, final, strict=True)
    ]
    leaders = [
        Line("this run", ratios, np.array(shares), "o-"),
        Line("reference", ratios, np.array(published), "x", 1),
    ]
    title = f"{options.n_spheres} free spheres, at the end"
    mass, share = "striker's mass over a sphere's", "share of the energy"
    figure += [
        Panel(title, "sphere", "velocity over the striker's", profiles),
        Panel("leading wave", mass, share, leaders, "x"),
    ]

    return concluded(
        __file__, ("striker", *SpeedMeasures._fields, "leader_share", "reference"), rows,
        panels(figure, columns=2, size=(5.4, 3.2)),
        power=powers, slowest=options.speeds[0], fastest=options.speeds[-1],
        contact=columns.contact_us, off=float(np.abs(np.subtract(shares, published)).max()),
        ratios=ratios, shares=shares, equal=shares[options.mass_ratios.index(1.0)],
        recoil=final[0][0],
    )  # fmt: skip
