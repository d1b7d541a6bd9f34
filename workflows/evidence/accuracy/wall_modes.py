"""The scene's chain before walls of more and more modes."""

from beadwave.workflows.evidence.accuracy import peers
from beadwave.workflows.evidence.accuracy.curves import DRAWN, over_size, picture, ratios
from beadwave.workflows.evidence.accuracy.growth import at_one_setting, growth
from beadwave.workflows.evidence.accuracy.problems import MASS, SPACING, modal_wall, problem
from beadwave.workflows.evidence.accuracy.row import table_of
from beadwave.workflows.evidence.accuracy.runs import (
    CONTROLLED,
    FIXED,
    limit,
    peer_rows,
    reference,
    scheme_row,
    scheme_rows,
)
from beadwave.workflows.evidence.study import rendered
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.scene import Scene
from beadwave.workflows.scene.parts import with_wall
from beadwave.workflows.stages.progress import Progress

SCENE = "rig-rigid"
MODES = (0, 1, 10, 50, 150, 500)
COMPARED = 150  # wall modes with which all others are run


def wall_modes(scene: Scene, progress: Progress) -> Finding:
    """Run time against the number of modes of the wall."""
    with_wall(scene)
    case = problem(scene, progress)
    dt = limit(case._replace(wall=modal_wall(case.wall, 0)), FIXED) / 64.0  # of the rigid wall

    # one scheme and one step at all numbers of modes; every scheme and peer at one of them
    rows = []
    for k in MODES:
        modal_case = case._replace(wall=modal_wall(case.wall, k))
        truth = reference(modal_case)
        rows.append(scheme_row("wall-modes", modal_case, truth, FIXED, dt, k))
        if k == COMPARED:
            schemes = [name for name in DRAWN if name != CONTROLLED]
            rows += scheme_rows("wall-modes", modal_case, truth, schemes, parameter=k)
            rows += peer_rows("wall-modes", modal_case, truth, peers.peers(), parameter=k)
            continue
        dop853 = {"DOP853": peers.SCIPY["DOP853"]}
        rows += peer_rows("wall-modes", modal_case, truth, dop853, parameter=k, tolerances=(1e-8,))
    rows = tuple(rows)
    compared = tuple(row for row in rows if row.parameter == COMPARED)
    title = f"{scene.name} with {COMPARED} wall modes"
    rigid, *with_modes = at_one_setting(rows, FIXED)
    sentences = rendered(
        __file__, own=0 if case.wall is None else case.wall.omega.size, most=MODES[-1],
        spacing=SPACING, mass=MASS, scene=title, ratios=ratios(compared), scheme=FIXED,
        rigid=rigid.seconds, growth=growth(with_modes),
    )  # fmt: skip
    pictures = (
        picture("accuracy_wall_modes", compared, title),
        over_size("accuracy_mode_growth", rows, "wall modes"),
    )
    return Finding((table_of(rows),), sentences, pictures)
