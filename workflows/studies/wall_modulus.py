"""A chain against half-spaces from rubber to diamond: contact time, and a second reflected wave.

A soft wall holds the last sphere so long that it parts from the chain, and is then caught up by it
or catches up with it: a secondary wave. The thesis says that secondary waves appear above a
critical modulus; they appear below it. Thesis, section 2.2.2, figure 2.8; J. Yang et al., Phys.
Rev. E 83 (2011) 046606.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

import dem
from dem.spheres import time_scale
from workflows.accuracy.accuracy import short
from workflows.chain_stages import initial_velocity
from workflows.run_folder import Picture
from workflows.scene import Scene
from workflows.stages import Watch
from workflows.studies.observed import Observed, bare, exponent, observed, require_chain
from workflows.study import Finding
from workflows.study_figures import Line, Panel, panels

RATIOS = np.unique(
    np.concatenate([np.geomspace(3e-3, 30, 17), np.arange(0.25, 0.6, 0.02)]).round(4)
)  # of E/(1 - nu^2), wall over sphere
FAINT = 0.004  # of the largest wave: what is still followed
FADED = 0.005  # of the striker's speed: below it a second wave has faded out
SOFT = 0.5  # ratio below which a second wave is that of a soft wall
EQUAL = 1 / (2**1.5 - 1)  # ratio at which the wall's contact is as stiff as the spheres'
SHOWN = (0.01, 0.1, 1.0, 10.0)


class Case(NamedTuple):
    """A wall by its ratio of moduli, and the run."""

    ratio: float
    young: float  # [Pa]
    run: Observed
    second: float  # largest velocity of the second reflected wave over the striker's
    apart: float  # [s] the last two spheres are apart while the wall is touched


def wall_modulus(scene: Scene, watch: Watch) -> Finding:
    """Contact time, tau_c and the second reflected wave over the wall's modulus."""
    spheres = require_chain(scene)
    with watch("walls"):
        cases = [_case(scene, ratio, spheres) for ratio in RATIOS]
    rows = tuple(
        (
            case.ratio,
            1e-9 * case.young,
            1e6 * case.run.contact.contact_time.seconds,
            case.run.contact.tau_c,
            case.run.contact.arr,
            case.second,
            1e6 * case.apart,
        )
        for case in cases
    )
    columns = (
        "E*_w/E*_s", "young_GPa", "contact_us", "tau_c", "arr", "second_over_striker", "apart_us",
    )  # fmt: skip
    picture = Picture("study_wall_modulus", _picture(scene, cases, spheres))
    return Finding("wall-modulus", columns, rows, _sentences(cases), (picture,))


def _case(scene: Scene, ratio: float, spheres: tuple[int, ...]) -> Case:
    nu = float(np.atleast_1d(scene.chain.poisson)[-1])
    young = ratio * float(np.atleast_1d(scene.chain.young)[-1])
    row, v0 = bare(scene, wall_young=young, wall_poisson=nu), initial_velocity(scene)
    unit = time_scale(row.mass[-1], row.A[-1], np.abs(v0).max())
    free = time_scale(row.mass[0], row.A[0], np.abs(v0).max())
    duration = 2.6 * len(row.mass) * free + 12 * unit
    run = observed(
        f"{ratio:g}", row, dem.rigid_wall(), v0, duration=duration, spheres=spheres, faint=FAINT
    )
    return Case(ratio, young, run, _second(run), _apart(run))


def _second(run: Observed) -> float:
    back = [train for train in run.trains if (train.kind, train.number) == ("reflected", 2)]
    sizes = [abs(pulse.velocity) for train in back for pulse in train.pulses]
    return max(sizes, default=0.0) / np.abs(run.trajectory.v[0]).max()


def _apart(run: Observed) -> float:
    """Time [s] for which the last spheres do not touch between the wall's first touch and its
    release."""
    contact, t = run.contact.contact_time, run.trajectory.t
    inside = (t > contact.start) & (t < contact.end)
    return float((run.trajectory.contact_force[inside, -2] == 0.0).sum() * (t[1] - t[0]))


def critical(cases: list[Case]) -> tuple[float, float] | None:
    """The neighbouring ratios between which the second wave of a soft wall fades out, if it does.

    Of a stiff wall there is another one, which the first may pass into.
    """
    for softer, stiffer in pairwise(sorted(cases, key=lambda case: case.ratio)):
        if softer.second > FADED >= stiffer.second:
            return softer.ratio, stiffer.ratio
    return None


def _sentences(cases: list[Case]) -> tuple[str, ...]:
    soft = [case for case in cases if case.ratio < 0.1]
    slope = exponent(
        [case.run.chain.A[-1] for case in soft],
        [case.run.contact.contact_time.seconds for case in soft],
    )
    stiff = max(case.second for case in cases if case.ratio > SOFT)
    tau = [case.run.contact.tau_c for case in cases]
    return (
        _fading(cases),
        f"{_side(cases)} Walls stiffer than {SOFT:g} leave another, faint one, at most "
        f"{100 * stiff:.1f} %, born in the chain.",
        _parting(cases),
        f"Contact time goes with A_w to the power {slope:.3f} at soft walls, where (2.5) says -0.4 "
        f"with one tau_c; tau_c is {tau[0]:.2f} at the softest and {tau[-1]:.2f} at the stiffest "
        f"wall, {min(tau):.2f} to {max(tau):.2f} in all: no constant. Contact counts from 1 % of "
        "the peak force, ARR is the mean of (2.9) along the chain.",
    )


def _side(cases: list[Case]) -> str:
    """On which side of the critical modulus a second wave is, in the thesis and here."""
    soft, stiff = (min(cases, key=lambda case: case.ratio), max(cases, key=lambda case: case.ratio))
    here = "below: soft walls make them" if soft.second > stiff.second else "above, here as well"
    return f"The thesis says that secondary waves appear above a critical modulus; it is {here}."


def _parting(cases: list[Case]) -> str:
    parted = [case.ratio for case in cases if case.apart > 0.0]
    held = f"below E*_w/E*_s = {max(parted):.3g}" if parted else "from the chain at no wall"
    return (
        f"The last sphere parts {held}, while it is still at the wall, which the thesis takes for "
        "the cause; its condition, equal approach at the last two contacts, means A_w = A, a ratio "
        f"of {EQUAL:.3f}."
    )


def _fading(cases: list[Case]) -> str:
    bound, found = f"{100 * FADED:g} % of the striker's speed", critical(cases)
    if found is None:
        least = min((case for case in cases if case.ratio < 1.0), key=lambda case: case.second)
        return (
            f"The second reflected wave falls to {100 * least.second:.1f} % of the striker's speed "
            f"at E*_w/E*_s = {least.ratio:.3g}, not from above to below {bound}."
        )
    return (
        f"A second reflected wave of more than {bound} appears below E*_w/E*_s = {found[0]:.3g} "
        f"and is gone at {found[1]:.3g}: the critical modulus of the wall is "
        f"{_young(cases, found[0]):.0f} to {_young(cases, found[1]):.0f} GPa (reference, 17 "
        "spheres: fades out at 0.39 to 0.47)."
    )


def _young(cases: list[Case], ratio: float) -> float:
    """[GPa]"""
    return next(1e-9 * case.young for case in cases if case.ratio == ratio)


def _picture(scene: Scene, cases: list[Case], spheres: tuple[int, ...]) -> bytes:
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
            Panel("dimensionless, equation (2.5)", modulus, "tau_c [-]",
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
    title = f"sphere {sphere}: a soft wall answers later, and twice"
    return Panel(title, "time [ms]", "velocity [m/s]", lines)
