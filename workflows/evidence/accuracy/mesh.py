"""Frequencies against the element size; of the rig that in the sheets, the thesis' figure 5.4.

    f(h) = f_0 + c h^p

f_0 and the order p come from the finest mesh and those twice and four times as coarse, for numbers
of elements jump between neighbours (Richardson): r^p = (f_1 - f_2) / (f_2 - f_3), h_i / h_(i+1) =
r, f_0 = f_3 - (f_2 - f_3) / (r^p - 1). The error of every mesh is taken against f_0. A mesh is
stiffer than the body, so that frequencies fall towards f_0; quadratic elements give order 4 for
smooth modes, the singular stress at a clamped edge or a washer leaves less. Where the meshes do not
determine a limit, the finest one stands for it: elements around holes and circles have a size of
their own, which mesh.scale does not change.

Of the rig the elements of the block keep their size: one thing varies. The error that they leave is
stated too, from a mesh with the block's elements twice as large and the order that singular
stresses leave. In the thesis the frequencies of the screw tie rise instead, because a finer mesh
puts more nodes under each washer and so ties more of the face; here washers are part of the
geometry, and every mesh ties the same area.
"""

from collections.abc import Callable
from functools import partial
from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave import fem
from beadwave.fem.modes import assembly_modes
from beadwave.fem.modes.solver.factorisation import has_pardiso
from beadwave.geometry import smallest_quality
from beadwave.workflows.evidence.accuracy.mesh_of_bending import of_bending
from beadwave.workflows.evidence.accuracy.runs import AccuracyRow, table_of
from beadwave.workflows.files.run_folder import Picture
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.report.tables import Table
from beadwave.workflows.scene import Scene
from beadwave.workflows.scene.required_parts import with_assembly
from beadwave.workflows.scene.rig import PARTS, RigScene
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.engine.progress import Progress, quiet
from beadwave.workflows.stages.engine.stage_table import has_sizes_chosen
from beadwave.workflows.stages.errors.second_mesh import COARSER
from beadwave.workflows.stages.structure import assembly as stages
from beadwave.workflows.stages.structure import bodies
from beadwave.workflows.stages.structure.meshed_parts import Parts
from beadwave.workflows.stages.structure.targets import targets

SEEDS = (11.3e-3, 5.66e-3, 2.83e-3)  # [m] ratio 2: the fewest that have a limit and an order
MORE = (8e-3, 5.66e-3, 4e-3, 2.83e-3, 2e-3)  # [m] ratio sqrt 2
FINER = (1.41e-3, 1e-3)  # [m] 190 000 and 350 000 unknowns, where a faster solver is installed
BLOCK = 8e-3  # [m] elements of the block
BLOCK_ORDER = 1.0  # that singular edges leave at least
STAGE_1 = {"parts": PARTS[:2], "fixing": "flat"}
N_MODES = {"full-tie": 18, "screw-tie": 30}  # that reach mode 4
SCALES = (4.0, 2.83, 2.0, 1.41, 1.0)  # of the scene's mesh.scale, of any other assembly
FIRST = tuple(fem.Number(i) for i in range(1, 5))  # of a scene without targets


class MeshSolution(NamedTuple):
    """One mesh: its frequencies and what they cost."""

    name: str  # of the constraint, or of the scene
    size: float  # of the elements: [m], or mesh.scale
    dofs: int
    hz: NDArray[np.float64]  # (k,) of the targets
    seconds: tuple[float, float, float]  # mesh, assembly, solution
    quality: float  # smallest scaled Jacobian


def mesh(scene: Scene, progress: Progress, *, thorough: bool = False) -> Finding:
    """Frequencies against the element size; of a beam or a plate with the waves beside.

    `thorough`: the rig's screw tie too, and its sheets by more and finer elements than three meshes
    have, the finest only where PARDISO is installed.
    """
    if scene.bending is not None:
        return of_bending(scene, progress)
    with_assembly(scene)
    if not isinstance(scene, RigScene):
        return _of_bodies(scene, progress)
    if not thorough:
        finding = of_rig(scene, progress, SEEDS, ("full-tie",))
        sentence = "Left out of mesh: the rig's screw tie and finer sheets; --thorough brings them."
        return finding._replace(sentences=(*finding.sentences, sentence))
    return of_rig(scene, progress, (*MORE, *FINER) if has_pardiso() else MORE, tuple(N_MODES))


def of_rig(
    scene: Scene, progress: Progress, seeds: tuple[float, ...], constraints: tuple[str, ...]
) -> Finding:
    """Of block and sheets: each of the constraints takes a mesh of every seed [m] in the sheets,
    the largest first."""
    rows, lines, sentences, errors = [], [], [], {}
    for constraint in constraints:
        solutions = [rig_solution(scene, constraint, seed, BLOCK, progress) for seed in seeds]
        larger = rig_solution(scene, constraint, seeds[0], COARSER * BLOCK, progress)
        hz = np.array([s.hz for s in solutions])
        limit, order = extrapolated(np.array(seeds), hz)
        rows += [row_of(s, limit) for s in solutions]
        lines += [_line(s._replace(size=1e3 * s.size), limit) for s in solutions]
        errors[constraint] = np.abs(hz / limit - 1)
        of_block = error_of_the_block(solutions[0].hz, larger.hz)
        sentences += [
            f"{constraint}: the four frequencies converge to {_numbers(limit, '.5g')} Hz with the "
            f"observed orders {_numbers(order, '.1f')}.",
            f"{constraint}: the block's elements stay at {1e3 * BLOCK:g} mm and leave modes 2 to 4 "
            f"too high by {_numbers(100 * of_block, '.2f')} % in all of these, limits included; "
            f"the estimate takes elements of {1e3 * COARSER * BLOCK:g} mm and an order of "
            f"{BLOCK_ORDER:g}.",
        ]
    picture = _picture("element size in the sheets [mm]", 1e3 * np.array(seeds), errors)
    table = Table("mesh", _columns("constraint", "seed_mm", 4), tuple(lines))
    tables = table_of(tuple(rows), printed=False), table
    return Finding(tables, tuple(sentences), (picture,))


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
    # sizes that mesh.error chooses are scaled as others are
    scales, solutions = scene.mesh.scale * np.array(SCALES), []
    chosen = pipeline_of(scene, progress)("sizes").sizes if has_sizes_chosen(scene) else None
    for scale in scales:
        with progress(f"mesh.scale {scale:.3g}"):
            if chosen is None:
                mesh = partial(stages.mesh, scene.but(mesh={"scale": float(scale)}))
            else:
                sizes = chosen._replace(scale=float(scale) * chosen.scale)
                mesh = partial(bodies.parts, scene, sizes)
            solutions.append(solution(scene, scene.name, scale, assembly_modes.N_MODES[0], mesh))
    hz = np.array([s.hz for s in solutions])
    limit, order = extrapolated(scales, hz)
    rows = tuple(row_of(s, limit) for s in solutions)
    lines = tuple(_line(s, limit) for s in solutions)
    table = Table("mesh", _columns("scene", "mesh.scale", len(limit)), lines)
    picture = _picture("mesh.scale", scales, {scene.name: np.abs(hz / limit - 1)})

    # beside the limit the error that a run states, from one mesh
    with progress("energy that the mesh misses"):
        finest = pipeline_of(scene, quiet)
        omega = finest("modes").omega
        of_modes = finest("missed-energy").of_frequencies(omega)
        nearest = np.abs(omega - 2 * np.pi * np.nan_to_num(hz[-1])[:, None]).argmin(axis=1)
        missed = np.where(np.isnan(hz[-1]), np.nan, of_modes[nearest])
    sentence = (
        f"{scene.name}: these meshes do not determine the limits of the frequencies; errors in the "
        "table are those against the finest mesh, that of the scene."
    )
    if not np.isnan(order).all():
        sentence = (
            f"{scene.name}: the frequencies converge to {_numbers(limit, '.5g')} Hz with the "
            f"observed orders {_numbers(order, '.1f')}; the finest of these meshes, that of the "
            f"scene, is off by {_numbers(100 * off(hz[-1], limit), '.3f')} %."
        )
    sentences = (
        sentence,
        "By the strain energy that the finest mesh misses, as `beadwave modes` states it, its "
        f"frequencies are too high by up to {_numbers(100 * missed, '.2f')} %.",
        "From the mesh with elements twice as large it differs by "
        f"{_numbers(100 * np.abs(hz[-3] / hz[-1] - 1), '.2f')} %.",
    )
    return Finding((table_of(rows, printed=False), table), sentences, (picture,))


def extrapolated(
    h: NDArray[np.float64], f: NDArray[np.float64], *, orders: tuple[float, float] = (1.0, 4.0)
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """f_0 (m,) and p (m,) of f = f_0 + c h^p by sizes h (k,), values f (k, m).

    Sizes fall from mesh to mesh. Three of them are used, each half of the one before: all of k = 3
    sizes in the ratio 2, or every second one of the last five of k >= 5 sizes in the ratio sqrt 2.
    `orders` are the lowest and the highest order to be expected: that of singular stress at clamp
    lines, and that of smooth modes with quadratic elements. Where p lies outside, f_0 is the value
    on the finest mesh and p is nan.
    """
    h, f = (h[-5::2], f[-5::2]) if len(h) > 3 else (h, f)
    coarse, middle, fine = f
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = (coarse - middle) / (middle - fine)
        order = np.log(ratio) / np.log(h[1] / h[2])
        limit = fine - (middle - fine) / (ratio - 1)
    converges = (order >= orders[0]) & (order <= orders[1])
    return np.where(converges, limit, fine), np.where(converges, order, np.nan)


def off(hz: NDArray[np.float64], limit: NDArray[np.float64]) -> NDArray[np.float64]:
    """Relative errors (k,) of the frequencies hz (k,) of a mesh against their limits (k,).

    nan where both are equal: no order of convergence was found, so that the finest mesh stands for
    the limit.
    """
    return np.where(hz == limit, np.nan, hz / limit - 1)


def solution(
    scene: Scene,
    name: str,
    size: float,
    n_modes: int,
    meshed_parts: Callable[[], Parts] | None = None,
) -> MeshSolution:
    """Mesh, its own or another one, model and modes of a scene, paired with its targets, or else
    its first four modes."""
    started = perf_counter()
    mesh = stages.mesh(scene) if meshed_parts is None else meshed_parts()
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


def _numbers(values: NDArray[np.float64], form: str) -> str:
    """Numbers as words of a sentence; a dash for nan."""
    *first, last = ("-" if np.isnan(value) else format(value, form) for value in values)
    return f"{', '.join(first)} and {last}"
