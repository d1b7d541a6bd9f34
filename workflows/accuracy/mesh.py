"""Frequencies against the element size in the sheets: the thesis' figure 5.4, with the error.

    f(h) = f_0 + c h^p

f_0 and the order p come from the finest mesh and those twice and four times as coarse, for numbers
of elements jump between neighbours; the error of every mesh is taken against f_0. The elements of
the block keep their size: one thing varies.
"""

from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import fem
import geometry
from fem.factorisation import has_pardiso
from workflows import assembly_stages as stages
from workflows import figures
from workflows.accuracy.accuracy import Row, Study
from workflows.run_folder import Picture
from workflows.scene import Scene
from workflows.stages import Watch

SEEDS = (8e-3, 5.66e-3, 4e-3, 2.83e-3, 2e-3)  # [m] ratio sqrt 2
FINER = (1.41e-3, 1e-3)  # [m] 190 000 and 350 000 unknowns, where a faster solver is installed
BLOCK = 8e-3  # [m] elements of the block
STAGE_1 = {"parts": geometry.PARTS[:2], "fixing": "flat"}
ORDERS = 1.0, 4.0  # of clamp lines with singular stress, of smooth modes by quadratic elements
READING = (
    "Every curve falls: a mesh is stiffer than the body. Smooth modes would converge with order 4; "
    "the singular stress along a clamp line leaves less. Where no order stands, the meshes do not "
    "tell the limit and the finest stands for it.",
    "The thesis' screw-tie curve rises instead: there a finer mesh puts more nodes under each "
    "washer and so ties more; here the washer is imprinted, and every mesh ties the same area.",
)
N_MODES = {"full-tie": 18, "screw-tie": 30}  # that reach mode 4


class Solved(NamedTuple):
    """One mesh: what it found and what it cost."""

    constraint: str
    seed: float  # [m]
    dofs: int
    hz: NDArray[np.float64]  # (4,)
    seconds: tuple[float, float, float]  # mesh, assembly, solution
    quality: float  # smallest scaled Jacobian


def mesh(scene: Scene, watch: Watch, *, seeds: tuple[float, ...] | None = None) -> Study:
    """Block and sheets under full tie and under screw tie."""
    seeds = seeds or SEEDS + (FINER if has_pardiso() else ())
    rows, findings, curves = [], [], {}
    for constraint in N_MODES:
        solved = [_watched(scene, constraint, seed, watch) for seed in seeds]
        f = np.array([s.hz for s in solved])
        limit, order = extrapolated(np.array(seeds), f)
        rows += [_row(s, abs(s.hz[0] / limit[0] - 1)) for s in solved]
        findings += [_limits(constraint, limit, order), *(_line(s, limit) for s in solved)]
        curves[constraint] = np.abs(f / limit - 1)
    picture = Picture("mesh", figures.mesh_convergence(np.array(seeds), curves))
    return Study(tuple(rows), (*findings, *READING), (picture,))


def _watched(scene: Scene, constraint: str, seed: float, watch: Watch) -> Solved:
    plain = STAGE_1 | {"constraint": constraint} | dict.fromkeys(geometry.PARTS)
    varied = scene.model_copy(update={"assembly": scene.assembly.model_copy(update=plain)})
    with watch(f"{constraint} {1e3 * seed:g} mm"):
        return _solved(varied, constraint, seed)


def _row(solved: Solved, error: float) -> Row:
    return Row("mesh", solved.constraint, solved.seed, float(error), sum(solved.seconds))


def _limits(constraint: str, limit, order) -> str:
    hz = " / ".join(f"{f:.5g}" for f in limit)
    p = " / ".join("-" if np.isnan(x) else f"{x:.1f}" for x in order)
    return f"{constraint}: converges to {hz} Hz, observed order {p}"


def _line(solved: Solved, limit) -> str:
    modes = "".join(
        f"{f:9.2f} {100 * (f / g - 1):+5.2f}%" for f, g in zip(solved.hz, limit, strict=True)
    )
    cost = " + ".join(f"{t:.2f}" for t in solved.seconds)
    return (
        f"{1e3 * solved.seed:6.2f} mm {solved.dofs:8,} dofs {modes}  {cost} s, "
        f"smallest quality {solved.quality:.2f}"
    )


def _solved(scene: Scene, constraint: str, seed: float) -> Solved:
    varied = {"seed": seed, "block_seed": BLOCK, "contact_seed": None}
    sizes = scene.mesh.model_copy(update=varied)
    at_seed = scene.model_copy(update={"mesh": sizes})
    started = perf_counter()
    mesh = stages.mesh(at_seed)
    meshed = perf_counter()
    model = stages.model(at_seed, mesh)
    assembled = perf_counter()
    found = fem.modes(model.K, model.M, N_MODES[constraint])
    ended = perf_counter()
    hz = found.frequency_hz[fem.pair(model, found).index]
    seconds = (meshed - started, assembled - meshed, ended - assembled)
    return Solved(constraint, seed, model.M.shape[0], hz, seconds, geometry.smallest_quality(mesh))


def extrapolated(
    h: NDArray[np.float64], f: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """f_0 (m,) and p (m,) of f = f_0 + c h^p by every second of sizes h (k,), values f (k, m).

    Takes the finest three of them, k >= 5. Where they give no order between those of a singular and
    of a smooth mode, f_0 is the last value and p is nan.
    """
    coarse, middle, fine = f[-5::2]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = (coarse - middle) / (middle - fine)
        order = np.log(ratio) / np.log(h[-3] / h[-1])
        limit = fine - (middle - fine) / (ratio - 1)
    told = (order >= ORDERS[0]) & (order <= ORDERS[1])
    return np.where(told, limit, fine), np.where(told, order, np.nan)
