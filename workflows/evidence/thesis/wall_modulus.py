"""A chain against half-spaces from rubber to diamond: contact time, and a second reflected wave.

A soft wall holds the last sphere so long that it parts from the chain, and is then caught up by it
or catches up with it: a secondary wave. The thesis says that secondary waves appear above a
critical modulus; they appear below it. Thesis, section 2.2.2, figure 2.8; J. Yang et al., Phys.
Rev. E 83 (2011) 046606.
"""

from itertools import pairwise
from typing import Any, NamedTuple

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
from workflows.report.tables import Table, short
from workflows.scene import Scene
from workflows.stages.chain import initial_velocity
from workflows.stages.pipeline import Progress

RATIOS = np.unique(
    np.concatenate([np.geomspace(3e-3, 30, 17), np.arange(0.25, 0.6, 0.02)]).round(4)
)  # of E/(1 - nu^2), wall over sphere
FAINT = 0.004  # of the largest wave: what is still followed
FADED = 0.005  # of the striker's speed: below it a second wave has faded out
PUBLISHED = (0.39, 0.47)  # J. Yang et al. (2011): ratios between which it fades out
SOFT = 0.5  # ratio below which a second wave is that of a soft wall
EQUAL = 1 / (2**1.5 - 1)  # ratio at which the wall's contact is as stiff as the spheres'
SHOWN = (0.01, 0.1, 1.0, 10.0)
COLUMNS = (
    "E*_w/E*_s", "young_GPa", "contact_us", "tau_c", "arr", "second_over_striker", "apart_us",
)  # fmt: skip


class Case(NamedTuple):
    """A wall by its ratio of moduli, and the run."""

    ratio: float
    young: float  # [Pa]
    run: Observed
    second: float  # largest velocity of the second reflected wave over the striker's
    apart: float  # [s] the last two spheres are apart while the wall is touched


def wall_modulus(scene: Scene, progress: Progress) -> Finding:
    """Contact time and secondary waves against the wall's modulus (thesis, figure 2.8)."""
    spheres = require_chain(scene)
    with progress("walls"):
        cases = [_case(scene, ratio, spheres) for ratio in RATIOS]
    table = Table("wall-modulus", COLUMNS, tuple(map(_row, cases)))
    picture = Picture("study_wall_modulus", _picture(cases, spheres))
    return Finding((table,), rendered(__file__, **_numbers(cases)), (picture,))


def _row(case: Case) -> tuple[float, ...]:
    contact = case.run.contact
    seconds = contact.contact_time.seconds
    return (
        case.ratio, 1e-9 * case.young, 1e6 * seconds, contact.tau_c, contact.arr, case.second,
        1e6 * case.apart,
    )  # fmt: skip


def _numbers(cases: list[Case]) -> dict[str, Any]:
    """What the sentences need; cases from the softest wall to the stiffest."""
    soft = [case for case in cases if case.ratio < 0.1]
    gone = critical(cases)
    return {
        "faded": FADED,
        "published": PUBLISHED,
        "critical": gone,
        "critical_young": gone and [_young(cases, ratio) for ratio in gone],
        "least": min((case for case in cases if case.ratio < 1.0), key=lambda case: case.second),
        "below": cases[0].second > cases[-1].second,
        "soft": SOFT,
        "stiff": max(case.second for case in cases if case.ratio > SOFT),
        "parted": max((case.ratio for case in cases if case.apart > 0.0), default=None),
        "equal": EQUAL,
        "slope": exponent(
            [case.run.chain.A[-1] for case in soft],
            [case.run.contact.contact_time.seconds for case in soft],
        ),
        "tau": [case.run.contact.tau_c for case in cases],
    }


def _case(scene: Scene, ratio: float, spheres: tuple[int, ...]) -> Case:
    young, nu = ratio * last(scene.chain.young), last(scene.chain.poisson)
    row, v0 = bare(scene, dem.Flat(young, nu)), initial_velocity(scene)
    unit = time_scale(row.mass[-1], row.A[-1], np.abs(v0).max())
    free = time_scale(row.mass[0], row.A[0], np.abs(v0).max())
    duration = 2.6 * len(row.mass) * free + 12 * unit
    setup = Setup(f"{ratio:g}", row, dem.rigid_wall())
    run = observed(setup, v0, duration=duration, spheres=spheres, faint=FAINT)
    return Case(ratio, young, run, run.largest(2), run.parted)


def critical(cases: list[Case]) -> tuple[float, float] | None:
    """The neighbouring ratios between which the second wave of a soft wall fades out, if it does.

    Of a stiff wall there is another one, which the first may pass into.
    """
    for softer, stiffer in pairwise(sorted(cases, key=lambda case: case.ratio)):
        if softer.second > FADED >= stiffer.second:
            return softer.ratio, stiffer.ratio
    return None


def _young(cases: list[Case], ratio: float) -> float:
    """[GPa]"""
    return next(1e-9 * case.young for case in cases if case.ratio == ratio)


def _picture(cases: list[Case], spheres: tuple[int, ...]) -> bytes:
    young = np.array([1e-9 * case.young for case in cases])
    time = np.array([1e6 * case.run.contact.contact_time.seconds for case in cases])
    tau = np.array([case.run.contact.tau_c for case in cases])
    second = np.array([case.second for case in cases])
    fades = [Line("fades out", np.full(2, np.mean([_young(cases, r) for r in gone])),
                  np.array([0, 1.1 * second.max()]), ":", 1)
             for gone in (critical(cases),) if gone]  # fmt: skip
    modulus = "Young's modulus of the wall [GPa]"
    return panels(
        [
            Panel("contact time (figure 2.8)", modulus, "contact time [µs]",
                  [Line(None, young, time, "o-")], "xy"),
            Panel("dimensionless contact time", modulus, "tau_c [-]",
                  [Line(None, young, tau, "o-")], "x"),
            Panel("second reflected wave (figure 2.8)", modulus, "velocity over the striker's",
                  [Line(None, young, second, "o-"), *fades], "x"),
            _records(cases, max(spheres)),
        ],
        columns=2, size=(5.4, 3.2),
    )  # fmt: skip


def _records(cases: list[Case], sphere: int) -> Panel:
    chosen = [min(cases, key=lambda case: abs(np.log(case.ratio / at))) for at in SHOWN]
    lines = [
        Line(
            f"E = {short(1e-9 * case.young)} GPa", case.run.milliseconds, case.run.velocity(sphere)
        )
        for case in chosen
    ]
    title = f"sphere {sphere}: a soft wall reflects later, and twice"
    return Panel(title, "time [ms]", "velocity [m/s]", lines)
