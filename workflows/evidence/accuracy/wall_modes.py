"""The scene's chain before walls of more and more modes."""

from workflows.evidence.accuracy.curves import DRAWN, over_size, picture
from workflows.evidence.accuracy.growth import at_one_setting, growth
from workflows.evidence.accuracy.problem_variants import MASS, SPACING, modal_wall
from workflows.evidence.accuracy.problems import problem
from workflows.evidence.accuracy.ratios import ratios
from workflows.evidence.accuracy.rows import table_of
from workflows.evidence.accuracy.runs import limit
from workflows.evidence.accuracy.size_rows import FIXED, mode_rows
from workflows.evidence.prose import rendered
from workflows.report.finding import Finding
from workflows.scene import Scene
from workflows.scene.parts import with_wall
from workflows.stages.pipeline import Progress

SCENE = "rig-rigid"
MODES = (0, 1, 10, 50, 150, 500)
COMPARED = 150  # wall modes with which all others are run


def wall_modes(scene: Scene, progress: Progress) -> Finding:
    """Run time against the number of modes of the wall."""
    with_wall(scene)
    case = problem(scene, progress)
    cases = {k: case._replace(wall=modal_wall(case.wall, k)) for k in MODES}
    step = limit(cases[0], FIXED) / 64.0
    schemes = {COMPARED: DRAWN[:-1]}
    rows = tuple(
        row for k, one in cases.items() for row in mode_rows(one, step, k, schemes.get(k, ()))
    )
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
