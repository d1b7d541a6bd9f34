"""Stated errors of meshes beside true ones; those of steps and reductions are in
`workflows.evidence.verify.honest_steps`."""

from collections.abc import Iterator

import numpy as np

from workflows.evidence.verify.comparisons import Comparison
from workflows.evidence.verify.honest_steps import FLOOR, points
from workflows.files.scene import scene as load_scene
from workflows.stages.pipeline import pipeline_of
from workflows.stages.progress import quiet


def honest_meshes() -> Iterator[Comparison]:
    """Stated over true errors of the mesh in waves: cantilevers of random sizes and materials."""
    ratios = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        length, width, height = rng.uniform([0.15, 0.012, 0.012], [0.35, 0.03, 0.03])
        changes = (
            f"bodies.beam.box=[{length}, {width}, {height}]",
            f"materials.aluminium.young={70e9 * 3 ** rng.uniform(0, 1)}",
            f"strike.at=[{length * rng.uniform(0.0, 0.4)}, 0.0]",
        )

        # true errors are those beside elements four times finer
        coarse, fine = (
            pipeline_of(load_scene("cantilever", (*changes, f"mesh.scale={scale}")), quiet)
            for scale in (2.0, 0.5)
        )
        observed = np.array(coarse.scene.output.spheres) - 1
        v, exact = (run("impact").trajectory.v[:, observed] for run in (coarse, fine))
        speed = float(np.abs(coarse("start").velocity).max())
        true = float(np.abs(v - exact).max()) / speed
        ratios.append(coarse("mesh-error") / max(true, FLOOR))
    yield from points("waves", ratios)
