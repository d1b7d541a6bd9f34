"""What the thesis' text says about the experiment, each statement judged on a set of runs.

Sections 6.1, 7.1 and 7.2: the contact's radius, what each sphere sees within 3 ms, that waves are
apart there, and which of them depend on the wall.
"""

from typing import NamedTuple

import numpy as np

from workflows.evidence.thesis.observed_run import Observed
from workflows.evidence.thesis.rig_walls import RIGID, SLIGHT, STRONG, UNMOVED
from workflows.evidence.thesis.wave_distance import separation, spread
from workflows.scene import Scene
from workflows.stages.chain import contact_radius, start

SEEN = {1: (1,), 4: (1, 2, 3), 14: (1, 2, 3, 4)}  # reflected waves by sphere
NEAR = (0.25e-3, 0.4e-3)  # m, near 0.3 mm
APART = (4, 14)  # spheres at which they are
SEPARATE = 1.0  # widths between neighbouring crests


class Verdict(NamedTuple):
    """A statement, whether it holds, and the number that says so."""

    statement: str
    holds: bool
    number: str


def verdicts(scene: Scene, runs: dict[str, Observed], main: str) -> tuple[Verdict, ...]:
    """The statements on the wall named `main`, and those on all walls with the same surface."""
    run = runs[main]
    return (
        _radius(scene, run),
        *(_seen(run, sphere) for sphere in SEEN),
        _separate(run),
        *_dependence([other for name, other in runs.items() if name != RIGID]),
    )


def _radius(scene: Scene, run: Observed) -> Verdict:
    found = contact_radius(scene, start(scene), float(run.trajectory.contact_force[:, -1].max()))
    holds = NEAR[0] <= found <= NEAR[1]
    return Verdict("the contact's radius is near 0.3 mm", holds, f"{1e3 * found:.3f} mm")


def _seen(run: Observed, sphere: int) -> Verdict:
    found = tuple(label.number for label in run.reflected(sphere))
    wanted = SEEN[sphere]
    named = ", ".join(map(str, wanted))
    return Verdict(
        f"sphere {sphere} sees the reflected wave{'s' * (len(wanted) > 1)} {named}",
        found == wanted,
        f"sees {', '.join(map(str, found)) or 'none'}",
    )


def _separate(run: Observed) -> Verdict:
    found = separation(run, APART)
    return Verdict("waves are apart at spheres 4 and 14", found >= SEPARATE, f"{found:.2f} widths")


def _dependence(runs: list[Observed]) -> tuple[Verdict, ...]:
    first, second, third, fourth = (spread(runs, k, APART) for k in (1, 2, 3, 4))
    wave, wall = "reflected wave", "on the wall at spheres 4 and 14"
    judged = (
        (f"the first {wave} does not depend {wall}", first < UNMOVED, first),
        (f"the second {wave} depends slightly {wall}", UNMOVED <= second < SLIGHT, second),
        (f"the third {wave} depends strongly {wall}", third > STRONG, third),
        (f"the fourth {wave} depends strongly {wall}", fourth > STRONG, fourth),
    )
    return tuple(Verdict(said, holds, _distance(apart)) for said, holds, apart in judged)


def _distance(apart: float) -> str:
    return "no wall sends it" if np.isnan(apart) else f"distance {apart:.3f}"
