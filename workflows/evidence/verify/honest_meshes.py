"""Stated errors of meshes beside true ones; those of steps and reductions are in
`workflows.evidence.verify.honest_steps`."""

from collections.abc import Iterator
from contextlib import nullcontext

import numpy as np

from workflows.evidence.verify.comparisons import Comparison
from workflows.evidence.verify.honest_steps import FLOOR, points
from workflows.files.scene import scene as load_scene
from workflows.stages.pipeline import pipeline_of


def honest_meshes() -> Iterator[Comparison]:
    """Stated over true errors of the mesh in waves: cantilevers of random sizes and materials."""
    yield from points("waves", [*_meshes()])


def _meshes() -> Iterator[float]:
    """Cantilevers of random sizes and materials beside elements four times finer."""
    for seed in range(6):
        rng = np.random.default_rng(seed)
        length, width, height = rng.uniform([0.15, 0.012, 0.012], [0.35, 0.03, 0.03])
        changes = (
            f"bodies.beam.box=[{length}, {width}, {height}]",
            f"materials.aluminium.young={70e9 * 3 ** rng.uniform(0, 1)}",
            f"strike.at=[{length * rng.uniform(0.0, 0.4)}, 0.0]",
        )
        coarse, fine = (
            pipeline_of(load_scene("cantilever", (*changes, f"mesh.scale={s}")), _silent)
            for s in (2.0, 0.5)
        )
        observed = np.array(coarse.scene.output.spheres) - 1
        v, exact = (one("impact").trajectory.v[:, observed] for one in (coarse, fine))
        speed = float(np.abs(coarse("start").velocity).max())
        yield coarse("mesh-error") / max(float(np.abs(v - exact).max()) / speed, FLOOR)


def _silent(stage: str):
    return nullcontext()
