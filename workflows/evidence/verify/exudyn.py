"""The coupled scene in Exudyn: its own spheres, reduced body, contacts and time integration."""

from collections.abc import Iterator

import numpy as np

import dem
import rom
from coupling.reduced_wall import wall_from_reduced
from workflows.evidence.verify.comparisons import Comparison, compared, require_module
from workflows.evidence.verify.exudyn_scene import velocities
from workflows.files.scene import scene
from workflows.stages.pipeline import pipeline_of
from workflows.stages.progress import quiet

SOURCE = "Exudyn, ObjectGenericODE2 and ObjectContactSphereSphere, step 0.1 us"


def exudyn() -> Iterator[Comparison]:
    """The cantilever reduced to thirteen coordinates and its chain, marched by Exudyn."""
    require_module("exudyn")
    pipeline = pipeline_of(scene("cantilever", ("mesh.scale=2",)), quiet)
    model, start = pipeline("model"), pipeline("start")
    body = rom.free_modes(model.K, model.M, pipeline("contact").w, rom.Selection(n_modes=12))
    wall = wall_from_reduced(body, half_space=0.0, cutoff_hz=np.inf)
    run = {"duration": 1e-3, "n_save": 10}
    ours = dem.march_to_error(start.chain, wall, start.velocity, error=1e-7, **run).trajectory.v[1:]

    rough, fine = 4e-7, 1e-7  # steps [s]
    v_rough = velocities(start.chain, body, start.velocity, dt=rough, **run)
    v_fine = velocities(start.chain, body, start.velocity, dt=fine, **run)
    yield compared("cantilever and its chain: velocities [V]", ours, v_fine,
                   allowed=1e-4, of=float(np.abs(start.velocity).max()), source=SOURCE)  # fmt: skip

    # its implicit trapezoidal rule converges to our result with order 2
    errors = [float(np.abs(v - ours).max()) for v in (v_rough, v_fine)]
    order = np.log(errors[0] / errors[1]) / np.log(rough / fine)
    yield compared("cantilever and its chain: order of convergence to us", order, 2.0,
                   allowed=0.3, of=1.0, source=SOURCE)  # fmt: skip
