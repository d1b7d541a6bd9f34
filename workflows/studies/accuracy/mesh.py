"""Frequencies against the element size in the sheets: the thesis' figure 5.4, with the error.

    f(h) = f_0 + c h^p

f_0 and the order p come from the finest mesh and those twice and four times as coarse, for numbers
of elements jump between neighbours; the error of every mesh is taken against f_0. The elements of
the block keep their size: one thing varies. What they leave is told beside, from a mesh with the
block's elements twice as large and the order that singular stresses leave.
"""

from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from skfem import Mesh

import fem
import geometry
from coupling.work_precision.rows import Row
from fem.convergence import extrapolated
from fem.factorisation import has_pardiso
from workflows.files.run_folder import Picture
from workflows.pipeline import assembly as stages
from workflows.pipeline.errors import COARSER
from workflows.pipeline.pipeline import Progress
from workflows.pipeline.rig import TARGETS
from workflows.results.plots import Line, Panel, panels
from workflows.results.tables import Table
from workflows.scene import Scene
from workflows.scene.parts import with_assembly
from workflows.studies.accuracy.rows import table_of
from workflows.studies.finding import Finding
from workflows.studies.prose import rendered

SCENE = "rig-rom"
SEEDS = (8e-3, 5.66e-3, 4e-3, 2.83e-3, 2e-3)  # [m] ratio sqrt 2
FINER = (1.41e-3, 1e-3)  # [m] 190 000 and 350 000 unknowns, where a faster solver is installed
BLOCK = 8e-3  # [m] elements of the block
BLOCK_ORDER = 1.0  # that singular edges leave at least
STAGE_1 = {"parts": geometry.PARTS[:2], "fixing": "flat"}
COLUMNS = (
    "constraint", "seed_mm", "dofs", *(f"f{i}_Hz" for i in range(1, 5)),
    *(f"error{i}_%" for i in range(1, 5)), "mesh_s", "assembly_s", "solution_s", "quality",
)  # fmt: skip
N_MODES = {"full-tie": 18, "screw-tie": 30}  # that reach mode 4


class Solved(NamedTuple):
    """One mesh: what it found and what it cost."""

    constraint: str
    seed: float  # [m]
    dofs: int
    hz: NDArray[np.float64]  # (4,)
    seconds: tuple[float, float, float]  # mesh, assembly, solution
    quality: float  # smallest scaled Jacobian


def mesh(scene: Scene, progress: Progress, *, seeds: tuple[float, ...] | None = None) -> Finding:
    """Frequencies of block and sheets against the element size in the sheets."""
    with_assembly(scene)
    seeds = seeds or SEEDS + (FINER if has_pardiso() else ())
    rows, lines, limits, error = [], [], {}, {}
    for constraint in N_MODES:
        solved = [_watched(scene, constraint, seed, BLOCK, progress) for seed in seeds]
        larger = _watched(scene, constraint, seeds[0], COARSER * BLOCK, progress)
        f = np.array([s.hz for s in solved])
        limit, order = extrapolated(np.array(seeds), f)
        rows += [_row(s, abs(s.hz[0] / limit[0] - 1)) for s in solved]
        lines += [_line(s, limit) for s in solved]
        left = left_by_the_block(solved[0].hz, larger.hz)
        limits[constraint] = limit.tolist(), order.tolist(), left.tolist()
        error[constraint] = np.abs(f / limit - 1)
    picture = Picture("mesh", _picture(np.array(seeds), error))
    tables = table_of(tuple(rows), printed=False), Table("mesh", COLUMNS, tuple(lines))
    sentences = rendered(
        __file__, limits=limits, block=BLOCK, larger=COARSER * BLOCK, block_order=BLOCK_ORDER
    )
    return Finding(tables, sentences, (picture,))


def left_by_the_block(hz, larger_hz) -> NDArray[np.float64]:
    """Relative error (3,) that the block's elements leave in modes 2 to 4 of hz (4,), from that
    with larger ones; mode 1 bends the sheets alone."""
    return (larger_hz / hz - 1)[1:] / (COARSER**BLOCK_ORDER - 1)


def _watched(
    scene: Scene, constraint: str, seed: float, block: float, progress: Progress
) -> Solved:
    plain = STAGE_1 | {"constraint": constraint} | dict.fromkeys(geometry.PARTS)
    varied = scene.but(assembly=plain)
    with progress(f"{constraint} {1e3 * seed:g} mm"):
        return _solved(varied, constraint, seed, block)


def _row(solved: Solved, error: float) -> Row:
    return Row("mesh", solved.constraint, solved.seed, float(error), sum(solved.seconds))


def _line(solved: Solved, limit: NDArray[np.float64]) -> tuple:
    off = 100 * (solved.hz / limit - 1)
    size = solved.constraint, 1e3 * solved.seed, solved.dofs
    return (*size, *map(float, (*solved.hz, *off, *solved.seconds, solved.quality)))


def _picture(seeds: NDArray[np.float64], error: dict[str, NDArray[np.float64]]) -> bytes:
    """Relative errors (k, 4) of the four modes against the element size (k,) [m]."""
    sets = [
        Panel(
            constraint, "element size in the sheets [mm]", "" if beside else "frequency error [%]",
            [Line(None if beside else f"mode {i}", 1e3 * seeds, 100 * np.where(e > 0, e, np.nan),
                  "o-") for i, e in enumerate(values.T, 1)], "xy",
        )
        for beside, (constraint, values) in enumerate(error.items())
    ]  # fmt: skip
    return panels(sets, columns=len(sets), size=(8 / len(sets), 3.8), sharey=True)


def _solved(scene: Scene, constraint: str, seed: float, block: float) -> Solved:
    at_seed = scene.but(mesh={"seed": seed, "block_seed": block, "contact_seed": None})
    started = perf_counter()
    mesh = stages.mesh(at_seed)
    meshed = perf_counter()
    model = stages.model(at_seed, mesh)
    assembled = perf_counter()
    found = fem.modes(model.K, model.M, N_MODES[constraint])
    ended = perf_counter()
    hz = found.frequency_hz[fem.pair(model, found, TARGETS).index]
    seconds = (meshed - started, assembled - meshed, ended - assembled)
    return Solved(constraint, seed, model.M.shape[0], hz, seconds, _quality(mesh.meshes))


def _quality(meshes: dict[str, Mesh]) -> float:
    return min(map(geometry.smallest_quality, meshes.values()))
