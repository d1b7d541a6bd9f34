"""The scene's chain before walls of more and more modes."""

from coupling.work_precision.growth import at_one_setting, growth
from coupling.work_precision.problems import MASS, SPACING, modal_wall
from coupling.work_precision.ratios import ratios
from coupling.work_precision.runs import limit
from coupling.work_precision.sizes import FIXED, mode_rows
from workflows.pipeline.pipeline import Progress
from workflows.scene import Scene
from workflows.scene.parts import with_wall
from workflows.studies.accuracy.curves import DRAWN, over_size, picture
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
