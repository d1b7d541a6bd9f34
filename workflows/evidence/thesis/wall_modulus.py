"""A chain against half-spaces from rubber to diamond: contact time, and a second reflected wave.

A soft wall holds the last sphere so long that it parts from the chain, and is then caught up by it
or catches up with it: a secondary wave. The thesis says that secondary waves appear above a
critical modulus; they appear below it. Thesis, section 2.2.2, figure 2.8; J. Yang et al., Phys.
Rev. E 83 (2011) 046606.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave import dem
from beadwave.dem.spheres import time_scale
from beadwave.dem.waves.measures import exponent
from beadwave.workflows.evidence.study import concluded
from beadwave.workflows.evidence.thesis.observed_run import RecordOptions, Setup, observed, record
from beadwave.workflows.evidence.thesis.requirements import bare, last, require_chain
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.report.tables import short
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.chain import initial_velocity
from beadwave.workflows.stages.progress import Progress

PUBLISHED = (0.39, 0.47)  # J. Yang et al. (2011): ratios between which the second wave fades out
RATIOS = np.unique(
    np.concatenate([np.geomspace(3e-3, 30, 17), np.arange(0.25, 0.6, 0.02)]).round(4)
)
COLUMNS = (
    "E*_w/E*_s", "young_GPa", "contact_us", "tau_c", "arr", "second_over_striker", "apart_us",
)  # fmt: skip


class WallModulusOptions(NamedTuple):
    """What the study varies, and what it tells apart."""

    ratios: NDArray[np.float64] = RATIOS  # E/(1 - nu^2) of walls over that of a sphere, ascending
    followed: float = 0.004  # of the largest wave: what is still followed; less than `faded`
    faded: float = 0.005  # of the striker's speed: below it a second wave has faded out
    soft: float = 0.5  # ratio below which a second wave is a soft wall's, just above PUBLISHED
    very_soft: float = 0.1  # ratio below which the contact time is a power of the stiffness
    drawn: tuple[float, ...] = (0.01, 0.1, 1.0, 10.0)  # ratios whose records are, or the nearest


def wall_modulus(
    scene: Scene, progress: Progress, options: WallModulusOptions = WallModulusOptions()
) -> Finding:
    """Contact time and secondary waves against the wall's modulus (thesis, figure 2.8)."""
    spheres = require_chain(scene)
    v0 = initial_velocity(scene)
    speed = np.abs(v0).max()
    followed = RecordOptions(faint=options.followed)

    # walls from the softest to the stiffest, each until the wave is back at the striker:
    # 2.6 natural times of a sphere in the chain, 12 of the last one at the wall
    ratios, young, runs = options.ratios, options.ratios * last(scene.chain.young), []
    with progress("walls"):
        for ratio, E in zip(ratios, young, strict=True):
            row = bare(scene, dem.Flat(E, last(scene.chain.poisson)))
            in_chain = time_scale(row.mass[0], row.A[0], speed)
            at_wall = time_scale(row.mass[-1], row.A[-1], speed)
            duration = 2.6 * len(row.mass) * in_chain + 12 * at_wall
            setup = Setup(f"{ratio:g}", row, dem.rigid_wall())
            runs.append(observed(setup, v0, duration=duration, spheres=spheres, options=followed))

    # largest velocity of the second reflected wave over the striker's, and the time for which the
    # last two spheres are apart while the wall is touched
    second, apart_us = [run.largest(2) for run in runs], [1e6 * run.parted for run in runs]
    gpa = 1e-9 * young
    seconds = np.array([run.contact.contact_time.seconds for run in runs])
    tau, arr = [run.contact.tau_c for run in runs], [run.contact.arr for run in runs]
    contact_us = (1e6 * seconds).tolist()
    rows = tuple(zip(ratios, gpa.tolist(), contact_us, tau, arr, second, apart_us, strict=True))

    # T_c ~ A^p where the wall alone decides; with one constant tau_c p would be -0.4
    very_soft = ratios < options.very_soft
    slope = exponent(np.array([run.chain.A[-1] for run in runs])[very_soft], seconds[very_soft])
    second = np.array(second)
    gone = critical(second, options.faded)
    # 1 / (2**1.5 - 1): ratio at which the wall's contact is as stiff as the spheres'

    # over the modulus: contact time, tau_c, and the second wave with where it fades out
    modulus = "Young's modulus of the wall [GPa]"
    fading = [Line(None, gpa, second, "o-")]
    if gone:
        middle = np.mean(gpa[gone])
        ends = np.array([0, 1.1 * second.max()])
        fading.append(Line("fades out", np.full(2, middle), ends, ":", 1))
    microseconds = Line(None, gpa, 1e6 * seconds, "o-")
    figure = [
        Panel("contact time (figure 2.8)", modulus, "contact time [µs]", [microseconds], "xy"),
        Panel(
            "dimensionless contact time", modulus, "tau_c [-]",
            [Line(None, gpa, np.array(tau), "o-")], "x",
        ),
        Panel(
            "second reflected wave (figure 2.8)", modulus, "velocity over the striker's",
            fading, "x",
        ),
    ]  # fmt: skip

    # records of a few walls at the outermost sphere
    sphere = max(spheres)
    nearest = [int(np.abs(np.log(ratios / ratio)).argmin()) for ratio in options.drawn]
    walls = [runs[i]._replace(name=f"E = {short(float(gpa[i]))} GPa") for i in nearest]
    figure.append(record(f"sphere {sphere}: a soft wall reflects later, and twice", walls, sphere))

    return concluded(
        __file__,
        COLUMNS,
        rows,
        panels(figure, columns=2, size=(5.4, 3.2)),
        options=options,
        published=PUBLISHED,
        critical=ratios[gone],
        critical_young=gpa[gone],
        least=min(zip(second[ratios < 1.0], ratios, strict=False)),
        below=second[0] > second[-1],
        stiff=second[ratios > options.soft].max(),
        parted=max(ratios[np.array(apart_us) > 0.0], default=None),
        equal=1 / (2**1.5 - 1),
        slope=slope,
        tau=tau,
    )


def critical(second: NDArray[np.float64], faded: float) -> list[int]:
    """Places of two neighbouring walls, from the softest on, between which the second wave (k,) of
    a soft one falls to `faded` of the striker's speed; none if it does not.

    Of a stiff wall there is another one, which the first may pass into.
    """
    falls = (second[:-1] > faded) & (second[1:] <= faded)
    return [int(falls.argmax()), int(falls.argmax()) + 1] if falls.any() else []
