"""Errors of the elements of a beam or a plate in its frequencies and in the waves.

Elements are 2.8 to 0.5 times as long as those of a run; the finest ones stand for the limit. The
velocities are those of the observed spheres until the horizon, over the striker's speed; all meshes
are reduced as the scene says, and marched with the same steps. Elements of high order that are
about as long as the shortest wave converge the faster the finer they are; under the disc that
strikes a plate only order 4 is sure, since Hertz' pressure ends like a square root there, and a run
takes the difference to elements bending.FINER times as long and this order.
"""

from time import perf_counter

import numpy as np

from beadwave import fem
from beadwave.workflows.evidence.accuracy.runs import AccuracyRow, table_of
from beadwave.workflows.files.run_folder import Picture
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.report.tables import Table
from beadwave.workflows.scene import Scene
from beadwave.workflows.scene.required_parts import with_chain
from beadwave.workflows.stages.chain.walls import wall_of
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.engine.progress import Progress
from beadwave.workflows.stages.errors.better_walls import march_before, observed_velocities
from beadwave.workflows.stages.structure import bending

FACTORS = (2.83, 2.0, 1.41, 1.0, bending.FINER, 0.5)  # of the elements' length
N_MODES = 4  # elastic ones, above 1 Hz
COLUMNS = (
    "scene", "elements", "dofs", *(f"f{i}_Hz" for i in range(1, N_MODES + 1)),
    *(f"error{i}_%" for i in range(1, N_MODES + 1)), "velocities_%", "seconds",
)  # fmt: skip


def of_bending(scene: Scene, progress: Progress) -> Finding:
    """Frequencies and velocities of a beam or a plate on elements of growing fineness, against the
    finest."""
    run = pipeline_of(with_chain(scene), progress)
    dofs, hz, v, seconds = [], [], [], []
    for factor in FACTORS:
        with progress(f"elements {factor:.3g} times as long"):
            started = perf_counter()
            model = bending.model(scene, factor)
            reduced = bending.reduction(scene, model)
            seconds.append(perf_counter() - started)
            before = march_before(wall_of(scene, reduced), run("start"), run("impact").trajectory)
            v.append(observed_velocities(scene, before))
            f = fem.modes(model.K, model.M, N_MODES + 3).frequency_hz  # 3: rigid-body motions
        hz.append(f[f > 1.0][:N_MODES])
        dofs.append(len(model.inertia))

    # errors beside the finest mesh: of the waves (k,), of the frequencies (k, N_MODES)
    speed = float(np.abs(run("start").velocity).max())
    waves = [float(np.abs(of_mesh - v[-1]).max() / speed) for of_mesh in v[:-1]]
    off = [np.abs(f / hz[-1] - 1) for f in hz[:-1]]
    rows, lines = [], []
    for i, (factor, error) in enumerate(zip(FACTORS[:-1], waves, strict=True)):
        rows.append(AccuracyRow("mesh", scene.name, factor, error, seconds[i]))
        numbers = map(float, (*hz[i], *(100 * off[i]), 100 * error, seconds[i]))
        lines.append((scene.name, factor, dofs[i], *numbers))
    tables = table_of(tuple(rows), printed=False), Table("mesh", COLUMNS, tuple(lines))
    usual = FACTORS.index(1.0)
    stated, true = run("mesh-error"), waves[usual]
    times = f", {stated / true:.3g} times as much" if true > 1e-12 else ""
    sentence = (
        f"{scene.name}: with the elements of a run the first frequencies are off by "
        f"{', '.join(f'{error:.1e}' for error in off[usual])}, the velocities of the observed "
        f"spheres by {true:.1e} of the striker's. A run states {stated:.1e}{times}. All are "
        f"compared with elements {FACTORS[-1]:g} times as long."
    )

    size, x = "length of the elements over that of a run", FACTORS[:-1]
    modes = [
        Line(f"mode {i}", x, 100 * errors, "o-") for i, errors in enumerate(np.transpose(off), 1)
    ]  # fmt: skip
    spheres = [Line(None, x, 100 * np.array(waves), "o-")]
    sets = [
        Panel("frequencies", size, "error [%]", modes, "xy"),
        Panel("velocities of the observed spheres", size, "", spheres, "xy"),
    ]
    picture = panels(sets, columns=2, size=(4, 3.8))
    return Finding(tables, (sentence,), (Picture("mesh", picture),))
