"""Frequencies against the element size; of the rig that in the sheets, the thesis' figure 5.4.

    f(h) = f_0 + c h^p

f_0 and the order p come from the finest mesh and those twice and four times as coarse, for numbers
of elements jump between neighbours; the error of every mesh is taken against f_0. The elements of
the block keep their size: one thing varies. What they leave is told beside, from a mesh with the
block's elements twice as large and the order that singular stresses leave.
"""

from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from skfem import Mesh

import fem
import geometry
from fem import assembly_modes
from fem.convergence import extrapolated, off
from fem.factorisation import has_pardiso
from workflows.evidence.accuracy.mesh_of_bending import of_bending
from workflows.evidence.accuracy.row import Row
from workflows.evidence.accuracy.rows import table_of
from workflows.evidence.prose import rendered
from workflows.files.run_folder import Picture
from workflows.report.finding import Finding
from workflows.report.plots import Line, Panel, panels
from workflows.report.tables import Table
from workflows.scene import Scene
from workflows.scene.parts import with_assembly
from workflows.stages import assembly as stages
from workflows.stages.errors import COARSER
from workflows.stages.pipeline import Progress
from workflows.stages.targets import targets

SCENE = "rig-rom"
SEEDS = (8e-3, 5.66e-3, 4e-3, 2.83e-3, 2e-3)  # [m] ratio sqrt 2
FINER = (1.41e-3, 1e-3)  # [m] 190 000 and 350 000 unknowns, where a faster solver is installed
SHEETS = "element size in the sheets [mm]"
BLOCK = 8e-3  # [m] elements of the block
BLOCK_ORDER = 1.0  # that singular edges leave at least
STAGE_1 = {"parts": geometry.PARTS[:2], "fixing": "flat"}
N_MODES = {"full-tie": 18, "screw-tie": 30}  # that reach mode 4
SCALES = (4.0, 2.83, 2.0, 1.41, 1.0)  # of the scene's mesh.scale, of any other assembly
FIRST = tuple(fem.Number(i) for i in range(1, 5))  # of a scene without targets
TEMPLATE = str(Path(__file__).with_name("_mesh_of_bodies.md"))


class Solved(NamedTuple):
    """One mesh: what it found and what it cost."""

    name: str  # of the constraint, or of the scene
    size: float  # of the elements: [m], or mesh.scale
    dofs: int
    hz: NDArray[np.float64]  # (k,) of the targets
    seconds: tuple[float, float, float]  # mesh, assembly, solution
    quality: float  # smallest scaled Jacobian


def mesh(scene: Scene, progress: Progress, *, seeds: tuple[float, ...] | None = None) -> Finding:
    """Frequencies against the element size; of a beam or a plate with the waves beside."""
    if scene.bending is not None:
        return Finding(*of_bending(scene, progress))
    with_assembly(scene)
    if scene.is_general:
        return _of_bodies(scene, progress)
    seeds = seeds or SEEDS + (FINER if has_pardiso() else ())
    rows, lines, limits, error = [], [], {}, {}
    for constraint in N_MODES:
        solved = [_watched(scene, constraint, seed, BLOCK, progress) for seed in seeds]
        larger = _watched(scene, constraint, seeds[0], COARSER * BLOCK, progress)
        f = np.array([s.hz for s in solved])
        limit, order = extrapolated(np.array(seeds), f)
        rows += [_row(s, limit) for s in solved]
        lines += [_line(s._replace(size=1e3 * s.size), limit) for s in solved]
        left = left_by_the_block(solved[0].hz, larger.hz)
        limits[constraint] = limit.tolist(), order.tolist(), left.tolist()
        error[constraint] = np.abs(f / limit - 1)
    picture = Picture("mesh", _picture(SHEETS, 1e3 * np.array(seeds), error))
    head = _columns("constraint", "seed_mm", 4)
    tables = table_of(tuple(rows), printed=False), Table("mesh", head, tuple(lines))
    sentences = rendered(
        __file__, limits=limits, block=BLOCK, larger=COARSER * BLOCK, block_order=BLOCK_ORDER
    )
    return Finding(tables, sentences, (picture,))


def _of_bodies(scene: Scene, progress: Progress) -> Finding:
    """Of an assembly of bodies: its targets, or its first modes, over mesh.scale."""
    scales, solved = scene.mesh.scale * np.array(SCALES), []
    for scale in scales:
        at_scale = scene.but(mesh={"scale": float(scale)})
        with progress(f"mesh.scale {scale:.3g}"):
            solved.append(_solved(at_scale, scene.name, scale, assembly_modes.N_MODES[0]))
    f = np.array([s.hz for s in solved])
    limit, order = extrapolated(scales, f)
    rows = tuple(_row(s, limit) for s in solved)
    table = Table(
        "mesh", _columns("scene", "mesh.scale", len(limit)), tuple(_line(s, limit) for s in solved)
    )
    picture = _picture("mesh.scale", scales, {scene.name: np.abs(f / limit - 1)})
    found = {
        "limit": limit.tolist(),
        "order": order.tolist(),
        "error": off(f[-1], limit).tolist(),
        "change": np.abs(f[-3] / f[-1] - 1).tolist(),
    }
    sentences = rendered(TEMPLATE, name=scene.name, **found)
    return Finding((table_of(rows, printed=False), table), sentences, (Picture("mesh", picture),))


def left_by_the_block(hz, larger_hz) -> NDArray[np.float64]:
    """Relative error (3,) that the block's elements leave in modes 2 to 4 of hz (4,), from that
    with larger ones; mode 1 bends the sheets alone."""
    return (larger_hz / hz - 1)[1:] / (COARSER**BLOCK_ORDER - 1)


def _watched(
    scene: Scene, constraint: str, seed: float, block: float, progress: Progress
) -> Solved:
    plain = STAGE_1 | {"constraint": constraint} | dict.fromkeys(geometry.PARTS)
    sizes = {"seed": seed, "block_seed": block, "contact_seed": None}
    varied = scene.but(assembly=plain, mesh=sizes)
    with progress(f"{constraint} {1e3 * seed:g} mm"):
        return _solved(varied, constraint, seed, N_MODES[constraint])


def _columns(name: str, size: str, n: int) -> tuple[str, ...]:
    f, errors = ([head.format(i) for i in range(1, n + 1)] for head in ("f{}_Hz", "error{}_%"))
    return (name, size, "dofs", *f, *errors, "mesh_s", "assembly_s", "solution_s", "quality")


def _row(solved: Solved, limit: NDArray[np.float64]) -> Row:
    error = abs(float(off(solved.hz, limit)[0]))
    known = None if np.isnan(error) else error
    return Row("mesh", solved.name, float(solved.size), known, sum(solved.seconds))


def _line(solved: Solved, limit: NDArray[np.float64]) -> tuple:
    percent = 100 * off(solved.hz, limit)
    size = solved.name, float(solved.size), solved.dofs
    return (*size, *map(float, (*solved.hz, *percent, *solved.seconds, solved.quality)))


def _picture(size: str, sizes: NDArray[np.float64], error: dict[str, NDArray]) -> bytes:
    """Relative errors (k, m) of the modes against the element sizes (k,)."""
    sets = [
        Panel(
            name, size, "" if beside else "frequency error [%]",
            [Line(None if beside else f"mode {i}", sizes, 100 * np.where(e > 0, e, np.nan), "o-")
             for i, e in enumerate(values.T, 1)], "xy",
        )
        for beside, (name, values) in enumerate(error.items())
    ]  # fmt: skip
    return panels(sets, columns=len(sets), size=(8 / len(sets), 3.8), sharey=True)


def _solved(scene: Scene, name: str, size: float, n_modes: int) -> Solved:
    started = perf_counter()
    mesh = stages.mesh(scene)
    meshed = perf_counter()
    model = stages.model(scene, mesh)
    assembled = perf_counter()
    found = fem.modes(model.K, model.M, n_modes)
    ended = perf_counter()
    index = fem.pair(model, found, targets(scene, model) or FIRST).index
    hz = np.where(index >= 0, found.frequency_hz[index], np.nan)
    seconds = (meshed - started, assembled - meshed, ended - assembled)
    return Solved(name, size, model.M.shape[0], hz, seconds, _quality(mesh.meshes))


def _quality(meshes: dict[str, Mesh]) -> float:
    return min(map(geometry.smallest_quality, meshes.values()))
