"""What the elements of a beam or a plate leave of error in its frequencies and in the waves.

Elements are 2.8 to 0.5 times as long as those of a run; the finest ones stand for the limit. The
velocities are those of the observed spheres until the horizon, over the striker's speed; all meshes
are reduced as the scene says, and marched with the same steps.
"""

from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import fem
from workflows.evidence.accuracy.row import AccuracyRow, table_of
from workflows.evidence.study import rendered
from workflows.files.run_folder import Picture
from workflows.report.plots import Line, Panel, panels
from workflows.report.tables import Table
from workflows.scene import Scene
from workflows.scene.parts import with_chain
from workflows.stages import bending
from workflows.stages.errors import velocities
from workflows.stages.pipeline import pipeline_of
from workflows.stages.progress import Progress
from workflows.stages.walls import wall_of

TEMPLATE = str(Path(__file__).with_name("_mesh_of_bending.md"))
FACTORS = (2.83, 2.0, 1.41, 1.0, bending.FINER, 0.5)  # of the elements' length
N_MODES = 4  # elastic ones, above 1 Hz
COLUMNS = (
    "scene", "elements", "dofs", *(f"f{i}_Hz" for i in range(1, N_MODES + 1)),
    *(f"error{i}_%" for i in range(1, N_MODES + 1)), "velocities_%", "seconds",
)  # fmt: skip


class BendingMeshSolution(NamedTuple):
    """One mesh of a beam or a plate: its frequencies, its waves and what they cost."""

    factor: float  # of the elements' length
    dofs: int
    hz: NDArray[np.float64]  # (N_MODES,)
    v: NDArray[np.float64]  # (k, m) [m/s] of the observed spheres
    seconds: float  # of model and reduction


def of_bending(scene: Scene, progress: Progress) -> tuple[tuple, tuple[str, ...], tuple]:
    """Tables, sentences and pictures."""
    run = pipeline_of(with_chain(scene), progress)
    solutions = []
    for factor in FACTORS:
        with progress(f"elements {factor:.3g} times as long"):
            started = perf_counter()
            model = bending.model(scene, factor)
            reduced = bending.reduction(scene, model)
            seconds = perf_counter() - started
            v = velocities(scene, run("start"), wall_of(scene, reduced), run("impact"))
            hz = fem.modes(model.K, model.M, N_MODES + 3).frequency_hz  # 3: rigid-body motions
        hz = hz[hz > 1.0][:N_MODES]
        solutions.append(BendingMeshSolution(factor, len(model.inertia), hz, v, seconds))

    # errors beside the finest mesh: of the waves (k,), of the frequencies (k, N_MODES)
    *coarser, finest = solutions
    speed = float(np.abs(run("start").velocity).max())
    waves = [float(np.abs(s.v - finest.v).max() / speed) for s in coarser]
    hz = [np.abs(s.hz / finest.hz - 1) for s in coarser]
    rows = tuple(
        AccuracyRow("mesh", scene.name, s.factor, error, s.seconds)
        for s, error in zip(coarser, waves, strict=True)
    )
    lines = tuple(
        (scene.name, s.factor, s.dofs, *map(float, (*s.hz, *(100 * f), 100 * error, s.seconds)))
        for s, f, error in zip(coarser, hz, waves, strict=True)
    )
    tables = table_of(rows, printed=False), Table("mesh", COLUMNS, lines)
    usual = FACTORS.index(1.0)
    sentences = rendered(
        TEMPLATE, name=scene.name, finest=FACTORS[-1], second=bending.FINER,
        stated=run("mesh-error"), off=waves[usual], hz=hz[usual].tolist(),
    )  # fmt: skip

    size, x = "length of the elements over that of a run", FACTORS[:-1]
    modes = [
        Line(f"mode {i}", x, 100 * errors, "o-") for i, errors in enumerate(np.transpose(hz), 1)
    ]  # fmt: skip
    spheres = [Line(None, x, 100 * np.array(waves), "o-")]
    sets = [
        Panel("frequencies", size, "error [%]", modes, "xy"),
        Panel("velocities of the observed spheres", size, "", spheres, "xy"),
    ]
    picture = panels(sets, columns=2, size=(4, 3.8))
    return tables, sentences, (Picture("mesh", picture),)
