"""The scene's chain before walls of more and more modes."""

from itertools import chain as joined

from coupling import peers
from coupling.peers import Problem
from coupling.work_precision.growth import at_one_setting, growth
from coupling.work_precision.problems import MASS, SPACING, modal_wall
from coupling.work_precision.ratios import ratios
from coupling.work_precision.rows import Row
from coupling.work_precision.runs import limit, peer_rows, reference, scheme_row, scheme_rows
from workflows.pipeline.pipeline import Progress
from workflows.scene import Scene
from workflows.scene.parts import with_wall
from workflows.studies.accuracy.curves import DRAWN, FIXED, PEER_TOLERANCE, over_size, picture
from workflows.studies.accuracy.problems import problem
from workflows.studies.accuracy.rows import table_of
from workflows.studies.finding import Finding
from workflows.studies.prose import rendered

SCENE = "rig-rigid"
MODES = (0, 1, 10, 50, 150, 500)
COMPARED = 150  # wall modes with which all others are run


def wall_modes(scene: Scene, progress: Progress) -> Finding:
    """Run time against the number of modes of the wall."""
    with_wall(scene)
    case = problem(scene, progress)
    cases = {k: case._replace(wall=modal_wall(case.wall, k)) for k in MODES}
    step = limit(cases[0], FIXED) / 64.0
    rows = tuple(joined.from_iterable(_mode_rows(one, step, k) for k, one in cases.items()))
    compared = tuple(row for row in rows if row.parameter == COMPARED)
    where = f"{scene.name} with {COMPARED} wall modes"
    rigid, *more = at_one_setting(rows, FIXED)
    sentences = rendered(
        __file__, own=0 if case.wall is None else case.wall.omega.size, most=MODES[-1],
        spacing=SPACING, mass=MASS, scene=where, ratios=ratios(compared), scheme=FIXED,
        rigid=rigid.seconds, growth=growth(more),
    )  # fmt: skip
    drawn = (
        picture("accuracy_wall_modes", compared, where),
        over_size("accuracy_mode_growth", rows, "wall modes"),
    )
    return Finding((table_of(rows),), sentences, drawn)


def _mode_rows(case: Problem, rigid_step: float, k: int) -> tuple[Row, ...]:
    truth = reference(case)
    fixed = scheme_row("wall-modes", case, truth, FIXED, rigid_step, k)
    if k != COMPARED:
        dop = {"DOP853": peers.SCIPY["DOP853"]}
        return fixed, *peer_rows(
            "wall-modes", case, truth, dop, parameter=k, tolerances=(PEER_TOLERANCE,)
        )
    return (
        fixed,
        *scheme_rows("wall-modes", case, truth, DRAWN[:-1], parameter=k),
        *peer_rows("wall-modes", case, truth, peers.peers(), parameter=k),
    )
