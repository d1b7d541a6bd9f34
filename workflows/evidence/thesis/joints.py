"""Why one tangential stiffness cannot meet modes 2 and 3, and what further stiffnesses achieve.

With one stiffness for both tangential directions every setting that meets mode 1 lies on one
curve of mode 3 over mode 2; the hammer test's point (269, 907) Hz lies off it. Each line below is
such a curve, each row a fit of modes 1 to 3 with more left free. Thesis, section 5.2, table 5.3.
"""

from typing import NamedTuple

import numpy as np

from beadwave import fem
from beadwave.fem.tuning import spectrum, tune
from beadwave.workflows.evidence.study import concluded
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.scene import Joints, JointStiffnesses, Scene
from beadwave.workflows.scene.parts import with_assembly
from beadwave.workflows.stages.pipeline import pipeline_of
from beadwave.workflows.stages.progress import Progress
from beadwave.workflows.structure.tuning import at_values, freed, loosened, shape_mac
from beadwave.workflows.thesis import HAMMER_TEST_HZ

TARGETS = {i: HAMMER_TEST_HZ[i - 1] for i in (1, 2, 3)}  # [Hz] by mode
LOOSE = 100.0  # [N m/rad] a turn of the head joints that hardly resists
COLUMNS = (
    "free at the head joints", *(f"f{i} [Hz]" for i in range(1, 5)), "miss of 1-3 [%]",
    "MAC of 2",
)  # fmt: skip
TANGENTIAL = np.geomspace(1e6, 1e10, 33)  # [N/m] stiffnesses along a curve


class Freedom(NamedTuple):
    """What a fit may vary, and the turn of the head joints in the sheets' plane."""

    name: str
    free: tuple[str, ...]
    turn: float = np.inf  # [N m/rad]


FREEDOMS = (
    Freedom("normal, one tangential", ("head.ky", "head.kt")),
    Freedom("the same, loose turn in plane", ("head.ky", "head.kt"), LOOSE),
    Freedom("normal, along x, vertical", ("head.ky", "head.kx", "head.kz")),
    Freedom("normal, vertical, turn in plane", ("head.ky", "head.kz", "head.kry"), LOOSE),
    Freedom(
        "the same, block's modulus and density",
        ("head.ky", "head.kz", "head.kry", "block.young", "block.density"),
        LOOSE,
    ),
)
BEST = 3  # of these: the fewest freedoms with a stiffness for the vertical direction and a turn


def joints(scene: Scene, progress: Progress) -> Finding:
    """The conflict of modes 2 and 3, and joint stiffnesses that resolve it (thesis, table 5.3)."""
    with_assembly(scene)
    targets_hz = np.array(list(TARGETS.values()))

    fits, misses, macs, curves = [], [], [], {}
    for freedom in FREEDOMS:
        # modes 1 to 3 fitted on a basis of shapes; the full model at these stiffnesses judges
        turning = Joints(head=JointStiffnesses(kry=freedom.turn))
        varied = scene.but(assembly={"constraint": "wires"}, joints=turning)
        parameters = freed(freedom.free)
        loose = loosened(varied, parameters)
        basis = pipeline_of(loose, progress)("tuning-basis")
        fit = tune(basis, parameters, TARGETS)
        fits.append(fit)
        misses.append(float(100 * np.abs(fit.modes_hz[:3] / targets_hz - 1).max()))
        full = pipeline_of(at_values(loose, parameters, fit.value), progress)
        macs.append(shape_mac(full)["2"])
        if "head.kt" not in freedom.free:
            continue

        # modes 2 and 3 over the tangential stiffness, the normal one fitted to mode 1
        normal, tangential = parameters
        points = []
        for k in TANGENTIAL:
            fixed = tangential._replace(start=k, lower=0.999 * k, upper=1.001 * k)
            met = tune(basis, [normal, fixed], {1: TARGETS[1]}, n_starts=2)
            modes = spectrum(basis, parameters, met.value)
            index = fem.correlation.paired(basis.forms, modes, basis.targets).index
            points.append(modes.frequency_hz[index[1:3]])
        curves[freedom] = np.array(points)

    rows = tuple(
        (freedom.name, *fit.modes_hz.tolist(), miss, mac)
        for freedom, fit, miss, mac in zip(FREEDOMS, fits, misses, macs, strict=True)
    )

    # where each curve puts mode 3 when mode 2 is met, and mode 2 when mode 3 is
    conflicts = [
        (freedom.turn, np.interp(TARGETS[2], *hz.T), np.interp(TARGETS[3], *hz.T[::-1]))
        for freedom, hz in curves.items()
    ]

    # modes of other shapes between 2 and 3 are what the best fit pays
    best = fits[BEST]
    _, second, third, _ = best.modes_hz
    further = [float(f) for f in best.all_hz if second < f < third]

    lines = [Line(freedom.name, *hz.T, colour=i) for i, (freedom, hz) in enumerate(curves.items())]
    free_hz = fits[-1].modes_hz
    lines += [
        Line("hammer test", np.array([TARGETS[2]]), np.array([TARGETS[3]]), "s", 7),
        Line("all freedoms", free_hz[1:2], free_hz[2:3], "x", 2),
    ]
    figure = [Panel("settings that meet mode 1", "mode 2 [Hz]", "mode 3 [Hz]", lines)]
    return concluded(
        __file__, COLUMNS, rows, panels(figure, size=(7, 4.5)),
        wanted=TARGETS, conflicts=conflicts, best=macs[BEST], miss=misses[BEST], further=further,
    )  # fmt: skip
