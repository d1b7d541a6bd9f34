"""Strikers of other speed and mass: scaling laws of the wave, and the train that a heavy one makes.

    F ~ V^(6/5),  V_s ~ V^(1/5),  T_c ~ V^(-1/5)

are exact for a Hertz chain without preload. A light striker bounces back, a heavy one sends a train
of waves of which the first holds only a part of the energy. Thesis, section 2.2.1; S. Sen et al.,
Phys. Rep. 462 (2008) 21.
"""

from typing import NamedTuple

import numpy as np

import dem
from dem.spheres import time_scale
from dem.waves.measures import exponent
from workflows.evidence.prose import rendered
from workflows.evidence.thesis.collision import HeavyStriker, heavy_striker
from workflows.evidence.thesis.observed_run import Observed, Setup, observed
from workflows.evidence.thesis.records import record
from workflows.evidence.thesis.requirements import bare, require_chain
from workflows.files.run_folder import Picture
from workflows.report.finding import Finding
from workflows.report.plots import Line, Panel, panels
from workflows.report.tables import Table
from workflows.scene import Scene
from workflows.stages.chain import initial_velocity
from workflows.stages.pipeline import Progress

SPEEDS = (0.05, 0.1, 0.31, 1.0, 2.0)  # m/s, the thesis' in the middle
RATIOS = (0.5, 1.0, 2.0, 5.0, 10.0)  # of the striker's mass to a sphere's
LENGTH = 60  # spheres that let a train spread out
REFERENCE = {0.5: 0.86492, 1.0: 0.99366, 2.0: 0.96120, 5.0: 0.71353, 10.0: 0.48407}


class Measures(NamedTuple):
    """What a chain shows of its striker's speed."""

    contact_us: float
    speed_m_s: float
    peak_force_N: float


def striker(scene: Scene, progress: Progress) -> Finding:
    """Scaling laws of the striker's speed, wave trains of its mass (thesis, section 2.2.1)."""
    spheres = require_chain(scene)
    with progress("speeds"):
        runs = [_at(scene, speed, spheres) for speed in SPEEDS]
    with progress("masses"):
        heavy = [_of_mass(scene, ratio) for ratio in RATIOS]
    measures = [_measures(run) for run in runs]
    powers = Measures(*(exponent(SPEEDS, values) for values in zip(*measures, strict=True)))
    rows = (
        *((f"{v:g} m/s", *found, None, None) for v, found in zip(SPEEDS, measures, strict=True)),
        *((f"mass x {h.ratio:g}", None, None, None, h.share, REFERENCE[h.ratio]) for h in heavy),
    )
    table = Table("striker", ("striker", *Measures._fields, "leader_share", "reference"), rows)
    sentences = rendered(
        __file__, power=powers, slowest=SPEEDS[0], fastest=SPEEDS[-1],
        contact=[found.contact_us for found in measures],
        off=max(abs(h.share - REFERENCE[h.ratio]) for h in heavy),
        light=heavy[0], equal=next(h for h in heavy if h.ratio == 1.0), heavy=heavy[-1],
    )  # fmt: skip
    picture = Picture("study_striker", _picture(runs, powers, heavy, spheres))
    return Finding((table,), sentences, (picture,))


def _at(scene: Scene, speed: float, spheres: tuple[int, ...]) -> Observed:
    row = bare(scene)
    v0 = np.eye(len(row.mass))[0] * speed
    duration = 2.8 * len(v0) * time_scale(row.mass[0], row.A[0], speed)
    setup = Setup(f"{speed:g} m/s", row, dem.rigid_wall())
    return observed(setup, v0, duration=duration, spheres=spheres)


def _measures(run: Observed) -> Measures:
    force = run.trajectory.contact_force[:, : len(run.chain.mass) - 1]
    middle = float(force[:, force.shape[1] // 2].max())
    return Measures(1e6 * run.contact.contact_time.seconds, run.contact.speed_in, middle)


def _of_mass(scene: Scene, ratio: float) -> HeavyStriker:
    row = scene.chain
    first = (float(np.atleast_1d(v)[0]) for v in (row.radius, row.density, row.young, row.poisson))
    chain = dem.row_of_spheres(*first, count=LENGTH, flat=None)
    return heavy_striker(chain, ratio, float(np.abs(initial_velocity(scene)).max()))


def _picture(
    runs: list[Observed], powers: Measures, heavy: list[HeavyStriker], spheres: tuple[int, ...]
) -> bytes:
    sphere = max(spheres)
    values = zip(*map(_measures, runs), strict=True)
    names = ("contact time [µs]", "speed [m/s]", "force [N]")
    scaled = [
        Line(f"{name}, power {power:+.2f}", np.array(SPEEDS), column, "o-")
        for name, power, column in zip(names, powers, values, strict=True)
    ]
    ratio = np.array(RATIOS)
    share = np.array([h.share for h in heavy])
    known = np.array([REFERENCE[r] for r in RATIOS])
    return panels(
        [
            record(f"sphere {sphere}", runs[2:], sphere),
            Panel("scaling with the striker's speed", "striker's speed [m/s]", "value", scaled,
                  "xy"),
            Panel(f"{LENGTH} free spheres, at the end", "sphere", "velocity over the striker's",
                  [_profile(h) for h in heavy]),
            Panel("leading wave", "striker's mass over a sphere's", "share of the energy",
                  [Line("this run", ratio, share, "o-"), Line("reference", ratio, known, "x", 1)],
                  "x"),
        ],
        columns=2, size=(5.4, 3.2),
    )  # fmt: skip


def _profile(h: HeavyStriker) -> Line:
    v = h.trajectory.v[-1] / np.abs(h.trajectory.v[0]).max()
    return Line(f"mass x {h.ratio:g}", np.arange(1, len(v) + 1.0), v)
