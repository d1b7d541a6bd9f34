"""Why one tangential stiffness cannot meet modes 2 and 3, and what each further freedom buys.

With one stiffness for both tangential directions every setting that meets mode 1 lies on one
curve of mode 3 over mode 2; the hammer test's point (269, 907) Hz lies off it. Each line below is
such a curve, each row a fit of modes 1 to 3 with more left free. Thesis, section 5.2, table 5.3.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import fem
from fem.tuning import Tuning, TuningBasis, TuningParameter, spectrum, tune
from workflows.evidence.prose import rendered
from workflows.files.run_folder import Picture
from workflows.report.finding import Finding
from workflows.report.plots import Line, Panel, panels
from workflows.report.tables import Table
from workflows.scene import Joints, JointStiffnesses, Scene
from workflows.scene.parts import with_assembly
from workflows.stages.pipeline import Progress, pipeline_of
from workflows.structure.tuning import at_values, freed, loosened, shape_mac
from workflows.thesis import HAMMER_TEST_HZ

WANTED = {i: HAMMER_TEST_HZ[i - 1] for i in (1, 2, 3)}
TANGENTIAL = np.geomspace(1e6, 1e10, 33)  # [N/m]
LOOSE = 100.0  # [N m/rad]
COLUMNS = (
    "free at the head joints", *(f"f{i} [Hz]" for i in range(1, 5)), "miss of 1-3 [%]",
    "MAC of 2",
)  # fmt: skip


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
    fits, macs, curves = [], [], {}
    for freedom in FREEDOMS:
        loose, free = _loose(scene, freedom)
        basis = pipeline_of(loose, progress)("tuning-basis")
        fits.append(tune(basis, free, WANTED))
        full = pipeline_of(at_values(loose, free, fits[-1].value), progress)
        macs.append(shape_mac(full)["2"])
        if "head.kt" in freedom.free:
            curves[freedom] = _curve(basis, free)
    rows = tuple(map(_row, FREEDOMS, fits, macs))
    sentences = rendered(
        __file__, wanted=WANTED, conflicts=[_conflict(*curve) for curve in curves.items()],
        best=macs[BEST], miss=_miss(fits[BEST]), further=_between_2_and_3(fits[BEST]),
    )  # fmt: skip
    picture = Picture("study_joints", _picture(curves, fits[-1]))
    return Finding((Table("joints", COLUMNS, rows),), sentences, (picture,))


def _row(freedom: Freedom, fit: Tuning, mac: float) -> tuple:
    return freedom.name, *fit.modes_hz.tolist(), _miss(fit), mac


def _between_2_and_3(fit: Tuning) -> list[float]:
    """Frequencies [Hz] of modes of other shapes."""
    _, second, third, _ = fit.modes_hz
    return [float(f) for f in fit.all_hz if second < f < third]


def _loose(scene: Scene, freedom: Freedom) -> tuple[Scene, list[TuningParameter]]:
    bare = Joints(head=JointStiffnesses(kry=freedom.turn))
    free, varied = freed(freedom.free), scene.but(assembly={"constraint": "wires"}, joints=bare)
    return loosened(varied, free), free


def _miss(fit: Tuning) -> float:
    wanted = np.array(list(WANTED.values()))
    return float(100 * np.abs(fit.modes_hz[:3] / wanted - 1).max())


def _curve(basis: TuningBasis, free: list[TuningParameter]) -> NDArray[np.float64]:
    """Modes 2 and 3 [Hz] while mode 1 is met, (k, 2), over the tangential stiffness."""
    normal, tangential = free
    points = []
    for k in TANGENTIAL:
        fixed = tangential._replace(start=k, lower=0.999 * k, upper=1.001 * k)
        met = tune(basis, [normal, fixed], {1: WANTED[1]}, n_starts=2)
        found = spectrum(basis, free, met.value)
        index = fem.correlation.paired(basis.forms, found, basis.targets).index
        points.append(found.frequency_hz[index[1:3]])
    return np.array(points)


class Conflict(NamedTuple):
    """Where a curve puts one of modes 2 and 3 [Hz] when the other one is met."""

    rigid: bool  # whether the joint's turn in the sheets' plane is
    third: float
    second: float


def _conflict(freedom: Freedom, hz: NDArray[np.float64]) -> Conflict:
    third = np.interp(WANTED[2], hz[:, 0], hz[:, 1])
    second = np.interp(WANTED[3], hz[:, 1], hz[:, 0])
    return Conflict(bool(np.isinf(freedom.turn)), float(third), float(second))


def _picture(curves: dict[Freedom, NDArray[np.float64]], best: Tuning) -> bytes:
    lines = [Line(freedom.name, *hz.T, colour=i) for i, (freedom, hz) in enumerate(curves.items())]
    lines += [
        Line("hammer test", np.array([WANTED[2]]), np.array([WANTED[3]]), "s", 7),
        Line("all freedoms", best.modes_hz[1:2], best.modes_hz[2:3], "x", 2),
    ]
    title = "settings that meet mode 1"
    return panels([Panel(title, "mode 2 [Hz]", "mode 3 [Hz]", lines)], size=(7, 4.5))
