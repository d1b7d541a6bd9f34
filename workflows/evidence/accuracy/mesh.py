"""Frequencies against the element size; of the rig that in the sheets, the thesis' figure 5.4.

    f(h) = f_0 + c h^p

f_0 and the order p come from the finest mesh and those twice and four times as coarse, for numbers
of elements jump between neighbours; the error of every mesh is taken against f_0. The elements of
the block keep their size: one thing varies. What they leave is stated beside, from a mesh with the
block's elements twice as large and the order that singular stresses leave.
"""

from contextlib import nullcontext
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave import fem
from beadwave.fem import assembly_modes
from beadwave.fem.convergence import extrapolated, off
from beadwave.fem.factorisation import has_pardiso
from beadwave.geometry import smallest_quality
from beadwave.workflows.evidence.accuracy.mesh_of_bending import of_bending
from beadwave.workflows.evidence.accuracy.row import AccuracyRow, table_of
from beadwave.workflows.evidence.study import rendered
from beadwave.workflows.files.run_folder import Picture
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.report.tables import Table
from beadwave.workflows.scene import Scene
from beadwave.workflows.scene.parts import with_assembly
from beadwave.workflows.scene.rig import PARTS
from beadwave.workflows.stages import assembly as stages
from beadwave.workflows.stages.errors import COARSER
from beadwave.workflows.stages.pipeline import pipeline_of
from beadwave.workflows.stages.progress import Progress
from beadwave.workflows.stages.targets import targets

SCENE = "rig-rom"
SEEDS = (11.3e-3, 5.66e-3, 2.83e-3)  # [m] ratio 2: the fewest that have a limit and an order
MORE = (8e-3, 5.66e-3, 4e-3, 2.83e-3, 2e-3)  # [m] ratio sqrt 2
FINER = (1.41e-3, 1e-3)  # [m] 190 000 and 350 000 unknowns, where a faster solver is installed
BLOCK = 8e-3  # [m] elements of the block
BLOCK_ORDER = 1.0  # that singular edges leave at least
STAGE_1 = {"parts": PARTS[:2], "fixing": "flat"}
N_MODES = {"full-tie": 18, "screw-tie": 30}  # that reach mode 4
SCALES = (4.0, 2.83, 2.0, 1.41, 1.0)  # of the scene's mesh.scale, of any other assembly
FIRST = tuple(fem.Number(i) for i in range(1, 5))  # of a scene without targets
THOROUGH = {"seeds": MORE + FINER, "constraints": tuple(N_MODES)}
LEFT_OUT = "the rig's screw tie, and sheets of more and finer elements than three meshes have"
TEMPLATE = str(Path(__file__).with_name("_mesh_of_bodies.md"))


class MeshSolution(NamedTuple):
    """One mesh: its frequencies and what they cost."""

    name: str  # of the constraint, or of the scene
    size: float  # of the elements: [m], or mesh.scale
    dofs: int
    hz: NDArray[np.float64]  # (k,) of the targets
    seconds: tuple[float, float, float]  # mesh, assembly, solution
    quality: float  # smallest scaled Jacobian


def mesh(
    scene: Scene,
    progress: Progress,
    *,
    seeds: tuple[float, ...] = SEEDS,
    constraints: tuple[str, ...] = ("full-tie",),
) -> Finding:
    """Frequencies against the element size; of a beam or a plate with the waves beside.

    `seeds` [m] are those of the rig's sheets, the largest first; each of the `constraints` takes
    a mesh of every seed. Those of FINER are left out where PARDISO is not installed.
    """
    if scene.bending is not None:
        return Finding(*of_bending(scene, progress))
    with_assembly(scene)
    if not scene.of_dimensions:
        return _of_bodies(scene, progress)
    seeds = seeds if has_pardiso() else tuple(seed for seed in seeds if seed not in FINER)
    rows, lines, limits, errors = [], [], {}, {}
    for constraint in constraints:
        solutions = [rig_solution(scene, constraint, seed, BLOCK, progress) for seed in seeds]
        larger = rig_solution(scene, constraint, seeds[0], COARSER * BLOCK, progress)
        hz = np.array([s.hz for s in solutions])
        limit, order = extrapolated(np.array(seeds), hz)
        rows += [row_of(s, limit) for s in solutions]
        lines += [_line(s._replace(size=1e3 * s.size), limit) for s in solutions]
        left_by_block = error_of_the_block(solutions[0].hz, larger.hz)
        limits[constraint] = limit.tolist(), order.tolist(), left_by_block.tolist()
        errors[constraint] = np.abs(hz / limit - 1)
    picture = _picture("element size in the sheets [mm]", 1e3 * np.array(seeds), errors)
    table = Table("mesh", _columns("constraint", "seed_mm", 4), tuple(lines))
    sentences = rendered(
        __file__, limits=limits, block=BLOCK, larger=COARSER * BLOCK, block_order=BLOCK_ORDER
    )
    return Finding((table_of(tuple(rows), printed=False), table), sentences, (picture,))


def rig_solution(
    scene: Scene, constraint: str, seed: float, block: float, progress: Progress
) -> MeshSolution:
    """The rig's block and sheets alone, with elements of these sizes [m] in sheets and block."""
    plain = STAGE_1 | {"constraint": constraint} | dict.fromkeys(PARTS)
    sizes = {"seed": seed, "block_seed": block, "contact_seed": None}
    varied = scene.but(assembly=plain, mesh=sizes)
    with progress(f"{constraint} {1e3 * seed:g} mm"):
        return solution(varied, constraint, seed, N_MODES[constraint])


def error_of_the_block(hz, hz_larger) -> NDArray[np.float64]:
    """Relative error (3,) that the block's elements leave in modes 2 to 4 of hz (4,) [Hz], from
    that with elements COARSER times as large; mode 1 bends the sheets alone."""
    return (hz_larger / hz - 1)[1:] / (COARSER**BLOCK_ORDER - 1)


def _of_bodies(scene: Scene, progress: Progress) -> Finding:
    """Of an assembly of bodies: its targets, or its first modes, over mesh.scale."""
    scales, solutions = scene.mesh.scale * np.array(SCALES), []
    for scale in scales:
        scaled = scene.but(mesh={"scale": float(scale)})
        with progress(f"mesh.scale {scale:.3g}"):
            solutions.append(solution(scaled, scene.name, scale, assembly_modes.N_MODES[0]))
    hz = np.array([s.hz for s in solutions])
    limit, order = extrapolated(scales, hz)
    rows = tuple(row_of(s, limit) for s in solutions)
    lines = tuple(_line(s, limit) for s in solutions)
    table = Table("mesh", _columns("scene", "mesh.scale", len(limit)), lines)
    picture = _picture("mesh.scale", scales, {scene.name: np.abs(hz / limit - 1)})

    # beside the limit the error that a run states, from one mesh
    with progress("energy that the mesh misses"):
        finest = pipeline_of(scene, lambda name: nullcontext())
        omega = finest("modes").omega
        of_modes = finest("missed-energy").of_frequencies(omega)
        nearest = np.abs(omega - 2 * np.pi * np.nan_to_num(hz[-1])[:, None]).argmin(axis=1)
        missed = np.where(np.isnan(hz[-1]), np.nan, of_modes[nearest])
    sentences = rendered(
        TEMPLATE, name=scene.name, limit=limit.tolist(), order=order.tolist(),
        error=off(hz[-1], limit).tolist(), change=np.abs(hz[-3] / hz[-1] - 1).tolist(),
        known=not np.isnan(order).all(), missed=missed.tolist(),
    )  # fmt: skip
    return Finding((table_of(rows, printed=False), table), sentences, (picture,))


def solution(scene: Scene, name: str, size: float, n_modes: int) -> MeshSolution:
    """Mesh, model and modes of a scene, paired with its targets, or else its first four modes."""
    started = perf_counter()
    mesh = stages.mesh(scene)
    meshed = perf_counter()
    model = stages.model(scene, mesh)
    assembled = perf_counter()
    modes = fem.modes(model.K, model.M, n_modes)
    ended = perf_counter()
    index = fem.pair(model, modes, targets(scene, model) or FIRST).index
    hz = np.where(index >= 0, modes.frequency_hz[index], np.nan)
    seconds = (meshed - started, assembled - meshed, ended - assembled)
    quality = min(map(smallest_quality, mesh.meshes.values()))
    return MeshSolution(name, size, model.M.shape[0], hz, seconds, quality)


def row_of(solution: MeshSolution, limit: NDArray[np.float64]) -> AccuracyRow:
    """The error of the first mode against the limits (k,) [Hz] of all; None where this mesh itself
    stands for the limit."""
    error = abs(float(off(solution.hz, limit)[0]))
    return AccuracyRow(
        "mesh", solution.name, float(solution.size), None if np.isnan(error) else error,
        sum(solution.seconds),
    )  # fmt: skip


def _columns(name: str, size: str, n: int) -> tuple[str, ...]:
    f, errors = ([head.format(i) for i in range(1, n + 1)] for head in ("f{}_Hz", "error{}_%"))
    return (name, size, "dofs", *f, *errors, "mesh_s", "assembly_s", "solution_s", "quality")


def _line(solution: MeshSolution, limit: NDArray[np.float64]) -> tuple:
    """The numbers of `_columns`."""
    percent = 100 * off(solution.hz, limit)
    numbers = (*solution.hz, *percent, *solution.seconds, solution.quality)
    return (solution.name, float(solution.size), solution.dofs, *map(float, numbers))


def _picture(size: str, sizes: NDArray[np.float64], errors: dict[str, NDArray]) -> Picture:
    """Relative errors (k, m) of the modes against the element sizes (k,), a panel by name."""
    sets = []
    for name, values in errors.items():
        first = not sets
        lines = [
            Line(f"mode {i}" if first else None, sizes, 100 * np.where(e > 0, e, np.nan), "o-")
            for i, e in enumerate(values.T, 1)
        ]
        sets.append(Panel(name, size, "frequency error [%]" if first else "", lines, "xy"))
    return Picture("mesh", panels(sets, columns=len(sets), size=(8 / len(sets), 3.8), sharey=True))
