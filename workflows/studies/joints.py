"""Why one tangential stiffness cannot meet modes 2 and 3, and what each further freedom buys.

With one stiffness for both tangential directions every setting that meets mode 1 lies on one
curve of mode 3 over mode 2; the hammer test's point (269, 907) Hz lies off it. Each line below is
such a curve, each row a fit of modes 1 to 3 with more left free. Thesis, section 5.2, table 5.3.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import fem
from fem.tuning import Parameter, TuningBasis, spectrum, tune
from workflows.run_folder import Picture
from workflows.scene import Joints, JointStiffnesses, Scene
from workflows.stages import Watch, pipeline_of
from workflows.study import Finding
from workflows.study_figures import Line, Panel, panels
from workflows.summary import HAMMER_TEST_HZ
from workflows.tuning import freed, loosened

WANTED = {i: HAMMER_TEST_HZ[i - 1] for i in (1, 2, 3)}
TANGENTIAL = np.geomspace(1e6, 1e10, 33)  # [N/m]
LOOSE = 100.0  # [N m/rad]


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


def joints(scene: Scene, watch: Watch) -> Finding:
    """Curves for a rigid and a loose turn, and the fits of modes 1 to 3."""
    rows, curves = [], []
    for freedom in FREEDOMS:
        basis, free = _basis(scene, freedom, watch)
        found = tune(basis, free, WANTED)
        rows.append(
            (freedom.name, *found.modes_hz.tolist(), _miss(found.modes_hz), float(found.mac[1]))
        )
        if "head.kt" in freedom.free:
            curves.append((freedom, _curve(basis, free)))
    columns = ("free at the head joints", *(f"f{i} [Hz]" for i in range(1, 5)))
    picture = Picture("study_joints", _picture(curves, rows))
    return Finding(
        "joints",
        (*columns, "miss of 1-3 [%]", "MAC of 2"),
        tuple(rows),
        _sentences(curves),
        (picture,),
    )


def _basis(scene: Scene, freedom: Freedom, watch: Watch) -> tuple[TuningBasis, list[Parameter]]:
    plain = scene.assembly.model_copy(update={"constraint": "wires"})
    bare = Joints(head=JointStiffnesses(kry=freedom.turn))
    free = freed(freedom.free)
    varied = scene.model_copy(update={"assembly": plain, "joints": bare})
    return pipeline_of(loosened(varied, free), watch)("tuning-basis"), free


def _miss(hz: NDArray[np.float64]) -> float:
    wanted = np.array(list(WANTED.values()))
    return float(100 * np.abs(hz[:3] / wanted - 1).max())


def _curve(basis: TuningBasis, free: list[Parameter]) -> NDArray[np.float64]:
    """Modes 2 and 3 [Hz] while mode 1 is met, (k, 2), over the tangential stiffness."""
    normal, tangential = free
    points = []
    for k in TANGENTIAL:
        fixed = tangential._replace(start=k, lower=0.999 * k, upper=1.001 * k)
        met = tune(basis, [normal, fixed], {1: WANTED[1]}, n_starts=2)
        found = spectrum(basis, free, met.value)
        points.append(found.frequency_hz[fem.correlation.paired(basis.block, found).index[1:3]])
    return np.array(points)


def _sentences(curves) -> tuple[str, ...]:
    nearest = []
    for freedom, hz in curves:
        at_2 = np.interp(WANTED[2], hz[:, 0], hz[:, 1])
        at_3 = np.interp(WANTED[3], hz[:, 1], hz[:, 0])
        turn = "a rigid turn" if np.isinf(freedom.turn) else "a loose turn"
        nearest.append(
            f"With {turn} in the sheets' plane, mode 2 at {WANTED[2]:g} Hz puts mode 3 at "
            f"{at_2:.0f} Hz, and mode 3 at {WANTED[3]:g} Hz puts mode 2 at {at_3:.0f} Hz."
        )
    return (
        *nearest,
        "Both modes shear the head joints: mode 2 along x and, by its pitch, vertically, mode 3 "
        "along x alone. One stiffness that is soft enough for mode 2 pulls mode 3 down with it.",
        "What resolves it is a stiffness of its own for the vertical direction: mode 2 becomes a "
        "pitch about the sheets, mode 3 keeps its stiff x. The price is a shape of mode 2 that "
        "stiff joints do not have, and further modes near 724 and 872 Hz.",
    )


def _picture(curves, rows) -> bytes:
    lines = [
        Line(f"{freedom.name}", hz[:, 0], hz[:, 1], colour=i)
        for i, (freedom, hz) in enumerate(curves)
    ]
    best = rows[-1]
    lines += [
        Line("hammer test", np.array([WANTED[2]]), np.array([WANTED[3]]), "s", 7),
        Line("all freedoms", np.array([best[2]]), np.array([best[3]]), "x", 2),
    ]
    title = "settings that meet mode 1"
    return panels([Panel(title, "mode 2 [Hz]", "mode 3 [Hz]", lines)], size=(7, 4.5))
