"""What the elements of a beam or a plate leave of error in its frequencies and in the waves.

Elements are 2.8 to 0.5 times as long as those of a run, the finest ones stand for the limit. The
velocities are those of the observed spheres until the horizon, over the striker's speed; all meshes
are reduced as the scene says, and marched with the same steps.
"""

from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import fem
from workflows.evidence.accuracy.row import Row
from workflows.evidence.accuracy.rows import table_of
from workflows.evidence.prose import rendered
from workflows.files.run_folder import Picture
from workflows.report.plots import Line, Panel, panels
from workflows.report.tables import Table
from workflows.scene import Scene
from workflows.scene.parts import with_chain
from workflows.stages import bending
from workflows.stages.errors import velocities
from workflows.stages.pipeline import Progress, pipeline_of
from workflows.stages.wall import wall_of

TEMPLATE = str(Path(__file__).with_name("_mesh_of_bending.md"))
FACTORS = (2.83, 2.0, 1.41, 1.0, bending.FINER, 0.5)  # of the elements' length
USUAL = FACTORS.index(1.0)
N_MODES = 4
RIGID_HZ = 1.0
COLUMNS = (
    "scene", "elements", "dofs", *(f"f{i}_Hz" for i in range(1, N_MODES + 1)),
    *(f"error{i}_%" for i in range(1, N_MODES + 1)), "velocities_%", "seconds",
)  # fmt: skip


class Solved(NamedTuple):
    """One mesh."""

    factor: float  # of the elements' length
    dofs: int
    hz: NDArray[np.float64]  # (N_MODES,)
    v: NDArray[np.float64]  # (k, m) [m/s]
    seconds: float  # of model and reduction


def of_bending(scene: Scene, progress: Progress) -> tuple[tuple, tuple[str, ...], tuple]:
    """Tables, sentences and pictures."""
    run = pipeline_of(with_chain(scene), progress)
    solved = [_solved(scene, run, factor, progress) for factor in FACTORS]
    limit, speed = solved[-1], float(np.abs(run("start").velocity).max())
    waves = [float(np.abs(s.v - limit.v).max() / speed) for s in solved[:-1]]
    hz = [np.abs(s.hz / limit.hz - 1) for s in solved[:-1]]
    rows = tuple(
        Row("mesh", scene.name, s.factor, error, s.seconds)
        for s, error in zip(solved, waves, strict=False)
    )
    lines = tuple(
        (scene.name, s.factor, s.dofs, *map(float, (*s.hz, *(100 * f), 100 * error, s.seconds)))
        for s, f, error in zip(solved, hz, waves, strict=False)
    )
    tables = table_of(rows, printed=False), Table("mesh", COLUMNS, lines)
    told = {
        "second": bending.FINER,
        "stated": run("mesh-error"),
        "off": waves[USUAL],
        "hz": hz[USUAL].tolist(),
    }
    sentences = rendered(TEMPLATE, name=scene.name, finest=FACTORS[-1], **told)
    return tables, sentences, (Picture("mesh", _picture(hz, waves)),)


def _solved(scene: Scene, run, factor: float, progress: Progress) -> Solved:
    with progress(f"elements {factor:.3g} times as long"):
        started = perf_counter()
        model = bending.model(scene, factor)
        reduced = bending.reduction(scene, model)
        seconds = perf_counter() - started
        v = velocities(scene, run("start"), wall_of(scene, reduced), run("impact"))
        hz = fem.modes(model.K, model.M, N_MODES + 3).frequency_hz
    return Solved(factor, len(model.inertia), hz[hz > RIGID_HZ][:N_MODES], v, seconds)


def _picture(hz: list[NDArray], waves: list[float]) -> bytes:
    size, x = "length of the elements over that of a run", FACTORS[:-1]
    modes = [
        Line(f"mode {i}", x, 100 * values, "o-") for i, values in enumerate(np.transpose(hz), 1)
    ]
    spheres = [Line(None, x, 100 * np.array(waves), "o-")]
    sets = [
        Panel("frequencies", size, "error [%]", modes, "xy"),
        Panel("velocities of the observed spheres", size, "", spheres, "xy"),
    ]
    return panels(sets, columns=2, size=(4, 3.8))
