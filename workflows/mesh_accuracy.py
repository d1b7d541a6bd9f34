"""Frequencies against the element size in the sheets: the thesis' figure 5.4, with the error.

    f(h) = f_0 + c h^p

f_0 and the order p come from the three finest meshes of a constant ratio of sizes; the error of
every mesh is taken against f_0.
"""

from collections.abc import Iterator
from time import perf_counter

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

import fem
import geometry
from workflows import assembly_stages as stages
from workflows.scene import Scene
from workflows.stages import Watch

SEEDS = (8e-3, 5.66e-3, 4e-3, 2.83e-3, 2e-3, 1.41e-3, 1e-3)  # [m] ratio sqrt 2
BLOCK_PER_SHEET, FINEST_BLOCK = 3.0, 8e-3  # block's element size per the sheets', and least [m]
STAGE_1 = {"parts": geometry.PARTS[:2], "fixing": "flat"}
N_MODES = {"full-tie": 18, "screw-tie": 30}  # that reach mode 4


class MeshRow(BaseModel):
    """One mesh: what it cost and what it got wrong."""

    study: str = "mesh"
    method: str
    parameter: float  # seed [m]
    error: float  # of mode 1, against the extrapolated frequency
    seconds: float
    dofs: int
    modes_hz: list[float]
    errors: list[float]  # of the four modes
    seconds_mesh: float
    seconds_assembly: float
    seconds_solve: float


class MeshAccuracy(BaseModel):
    """All meshes of one constraint, and what they converge to."""

    constraint: str
    extrapolated_hz: list[float]
    order: list[float]
    rows: list[MeshRow]

    def text(self) -> str:
        """Aligned lines."""
        limits = " / ".join(f"{hz:.5g}" for hz in self.extrapolated_hz)
        order = " / ".join(f"{p:.1f}" for p in self.order)
        head = f"{'seed mm':>8} {'dofs':>8} " + "".join(f"{f'mode {i}':>16}" for i in range(1, 5))
        lines = [f"{self.constraint}: {limits} Hz extrapolated, observed order {order}", head]
        return "\n".join([*lines, *(_line(row) for row in self.rows)])


def _line(row: MeshRow) -> str:
    modes = "".join(
        f"{hz:9.2f} {100 * e:+5.2f}%" for hz, e in zip(row.modes_hz, row.errors, strict=True)
    )
    cost = f"{row.seconds_mesh:.2f} + {row.seconds_assembly:.2f} + {row.seconds_solve:.2f} s"
    return f"{1e3 * row.parameter:8.2f} {row.dofs:8,} {modes}  {cost}"


def mesh_accuracy(
    scene: Scene, watch: Watch, *, seeds: tuple[float, ...] = SEEDS
) -> Iterator[MeshAccuracy]:
    """Block and sheets under full tie and under screw tie."""
    for constraint in N_MODES:
        plain = STAGE_1 | {"constraint": constraint} | dict.fromkeys(geometry.PARTS)
        varied = scene.model_copy(update={"assembly": scene.assembly.model_copy(update=plain)})
        solved = []
        for seed in seeds:
            with watch(f"{constraint} {1e3 * seed:g} mm"):
                solved.append(_solved(varied, constraint, seed))
        yield _judged(constraint, solved)


def _solved(scene: Scene, constraint: str, seed: float) -> MeshRow:
    bulk = max(BLOCK_PER_SHEET * seed, FINEST_BLOCK)
    sizes = scene.mesh.model_copy(update={"seed": seed, "block_seed": bulk, "contact_seed": None})
    at_seed = scene.model_copy(update={"mesh": sizes})
    started = perf_counter()
    mesh = stages.mesh(at_seed)
    meshed = perf_counter()
    model = stages.model(at_seed, mesh)
    assembled = perf_counter()
    found = fem.modes(model.K, model.M, N_MODES[constraint])
    ended = perf_counter()
    hz = found.frequency_hz[fem.pair(model, found).index]
    return MeshRow(
        method=constraint,
        parameter=seed,
        error=np.nan,
        seconds=ended - started,
        dofs=model.M.shape[0],
        modes_hz=list(hz),
        errors=[],
        seconds_mesh=meshed - started,
        seconds_assembly=assembled - meshed,
        seconds_solve=ended - assembled,
    )


def _judged(constraint: str, solved: list[MeshRow]) -> MeshAccuracy:
    f = np.array([row.modes_hz for row in solved])
    limit, order = extrapolated(np.array([row.parameter for row in solved]), f)
    errors = f / limit - 1
    rows = [
        row.model_copy(update={"error": abs(e[0]), "errors": list(e)})
        for row, e in zip(solved, errors, strict=True)
    ]
    return MeshAccuracy(
        constraint=constraint, extrapolated_hz=list(limit), order=list(order), rows=rows
    )


def extrapolated(
    h: NDArray[np.float64], f: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """f_0 (m,) and p (m,) of f = f_0 + c h^p by the last three of sizes h (k,), values f (k, m).

    Where the three do not converge, f_0 is the last value and p is nan.
    """
    coarse, middle, fine = f[-3:]
    ratio = (coarse - middle) / np.where(middle == fine, np.nan, middle - fine)
    converging = ratio > 1
    order = np.log(np.where(converging, ratio, np.nan)) / np.log(h[-3] / h[-2])
    limit = fine - (middle - fine) / (np.where(converging, ratio, np.inf) - 1)
    return np.where(converging, limit, fine), order
