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
from workflows.chain_stages import initial_velocity
from workflows.run_folder import Picture
from workflows.scene import Scene
from workflows.stages import Watch
from workflows.studies.observed import Observed, bare, exponent, observed, require_chain
from workflows.study import Finding
from workflows.study_figures import Line, Panel, panels

SPEEDS = (0.05, 0.1, 0.31, 1.0, 2.0)  # m/s, the thesis' in the middle
RATIOS = (0.5, 1.0, 2.0, 5.0, 10.0)  # of the striker's mass to a sphere's
LENGTH = 60  # spheres that let a train spread out
REFERENCE = {0.5: 0.86492, 1.0: 0.99366, 2.0: 0.96120, 5.0: 0.71353, 10.0: 0.48407}
EMPTY = 1e-3  # of the largest force: between two waves


class Heavy(NamedTuple):
    """A striker of another mass before a long free chain."""

    ratio: float
    trajectory: dem.Trajectory
    share: float  # of the energy, in the leading wave
    recoil: float  # its velocity at the end over that at the start


def striker(scene: Scene, watch: Watch) -> Finding:
    """Exponents over the speed, energy share of the leader over the mass."""
    spheres = require_chain(scene)
    with watch("speeds"):
        runs = [_at(scene, speed, spheres) for speed in SPEEDS]
    with watch("masses"):
        heavy = [_of_mass(scene, ratio) for ratio in RATIOS]
    columns = ("striker", "contact_us", "speed_m_s", "peak_force_N", "leader_share", "reference")
    rows = (
        *(
            (f"{speed:g} m/s", *_measures(run), None, None)
            for speed, run in zip(SPEEDS, runs, strict=True)
        ),
        *((f"mass x {h.ratio:g}", None, None, None, h.share, REFERENCE[h.ratio]) for h in heavy),
    )
    picture = Picture("study_striker", _picture(runs, heavy, spheres))
    return Finding("striker", columns, rows, _sentences(runs, heavy), (picture,))


def _at(scene: Scene, speed: float, spheres: tuple[int, ...]) -> Observed:
    row = bare(scene)
    v0 = np.eye(len(row.mass))[0] * speed
    duration = 2.8 * len(v0) * time_scale(row.mass[0], row.A[0], speed)
    return observed(f"{speed:g} m/s", row, dem.rigid_wall(), v0, duration=duration, spheres=spheres)


def _measures(run: Observed) -> tuple[float, float, float]:
    force = run.trajectory.contact_force[:, : len(run.chain.mass) - 1]
    middle = float(force[:, force.shape[1] // 2].max())
    return 1e6 * run.contact.contact_time.seconds, run.contact.speed_in, middle


def _of_mass(scene: Scene, ratio: float) -> Heavy:
    row = scene.chain
    chain = dem.row_of_spheres(
        *(float(np.atleast_1d(v)[0]) for v in (row.radius, row.density, row.young, row.poisson)),
        count=LENGTH, free=True,
    )  # fmt: skip
    chain.mass[0] *= ratio
    speed = float(np.abs(initial_velocity(scene)).max())
    unit = time_scale(chain.mass[1], chain.A[0], speed)
    run = dem.march(
        chain, None, np.eye(LENGTH)[0] * speed, duration=55 * unit, dt=0.05 * unit, n_save=1100
    )
    return Heavy(ratio, run, _leading_share(chain, run), float(run.v[-1, 0] / speed))


def _leading_share(chain: dem.Chain, run: dem.Trajectory) -> float:
    """Energy from the gap behind the first wave on, over the striker's."""
    v, F = run.v[-1], run.contact_force[-1]
    gap = int(v.argmax()) - 1
    while F[gap] > EMPTY * F.max() and F[gap] >= F[gap - 1]:
        gap -= 1
    stored = 0.4 * F ** (5 / 3) / chain.A ** (2 / 3)
    moving = 0.5 * chain.mass[gap + 1 :] @ v[gap + 1 :] ** 2
    return float((moving + stored[gap:].sum()) / run.energy_kinetic[0])


def _sentences(runs: list[Observed], heavy: list[Heavy]) -> tuple[str, ...]:
    time, speed, force = np.array([_measures(run) for run in runs]).T
    powers = [exponent(SPEEDS, values) for values in (force, speed, time)]
    light, equal, large = heavy[0], next(h for h in heavy if h.ratio == 1.0), heavy[-1]
    off = max(abs(h.share - REFERENCE[h.ratio]) for h in heavy)
    return (
        f"Over the striker's speed, force goes with power {powers[0]:.5f} (6/5), the wave's speed "
        f"with {powers[1]:.5f} (1/5), the contact time with {powers[2]:.5f} (-1/5).",
        f"The thesis reads from (2.5) that a faster striker shortens the contact: from "
        f"{time[0]:.0f} to {time[-1]:.0f} µs between {SPEEDS[0]:g} and {SPEEDS[-1]:g} m/s, by "
        f"{100 * (1 - time[-1] / time[0]):.0f} %. "
        "These laws hold without preload and at speeds where the spheres stay elastic; a preload "
        "gives small waves the speed of sound instead.",
        f"The leading wave's share of the energy is within {off:.1e} of the reference for all "
        f"mass ratios. (2.5) gives the wave all of the striker's energy: of a striker of the "
        f"spheres' mass it is all but {100 * (1 - equal.share):.1f} %, of one {large.ratio:g} "
        f"times as heavy {100 * large.share:.0f} %; one of {light.ratio:g} of that mass bounces "
        f"back with {-light.recoil:.2f} of its speed.",
    )


def _picture(runs: list[Observed], heavy: list[Heavy], spheres: tuple[int, ...]) -> bytes:
    sphere = max(spheres)
    records = [Line(run.name, run.milliseconds, run.velocity(sphere)) for run in runs[2:]]
    values = np.array([_measures(run) for run in runs])
    scaled = [
        Line(f"{name}, power {exponent(SPEEDS, column):+.2f}", np.array(SPEEDS), column, "o-")
        for name, column in zip(("contact time [µs]", "speed [m/s]", "force [N]"), values.T,
                                strict=True)
    ]  # fmt: skip
    ratio = np.array(RATIOS)
    share = np.array([h.share for h in heavy])
    known = np.array([REFERENCE[r] for r in RATIOS])
    return panels(
        [
            Panel(f"sphere {sphere}", "time [ms]", "velocity [m/s]", records),
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


def _profile(h: Heavy) -> Line:
    v = h.trajectory.v[-1] / np.abs(h.trajectory.v[0]).max()
    return Line(f"mass x {h.ratio:g}", np.arange(1, len(v) + 1.0), v)
