"""The coupled scene in Exudyn: its own spheres, reduced body, contacts and time integration."""

from collections.abc import Iterator
from contextlib import nullcontext

import numpy as np

import dem
import rom
from coupling.wall import wall_from_reduced
from workflows.evidence.verify.comparisons import Comparison, compared, require_module
from workflows.evidence.verify.exudyn_scene import velocities
from workflows.files.scene import scene
from workflows.stages.pipeline import pipeline_of

STEPS, DURATION, N_SAVE = (4e-7, 1e-7), 1e-3, 10  # [s]
SOURCE = "Exudyn, ObjectGenericODE2 and ObjectContactSphereSphere, step 0.1 us"


def exudyn() -> Iterator[Comparison]:
    """The cantilever reduced to thirteen coordinates and its chain, marched by Exudyn."""
    require_module("exudyn")
    pipeline = pipeline_of(scene("cantilever", ("mesh.scale=2",)), lambda stage: nullcontext())
    model, start = pipeline("model"), pipeline("start")
    body = rom.free_modes(model.K, model.M, pipeline("contact").w, rom.Selection(n_modes=12))
    wall = wall_from_reduced(body, half_space=0.0, cutoff_hz=np.inf)
    run = {"duration": DURATION, "n_save": N_SAVE}
    ours = dem.march_to_error(start.chain, wall, start.velocity, error=1e-7, **run).trajectory
    theirs = [velocities(start.chain, body, start.velocity, dt=dt, **run) for dt in STEPS]
    speed = float(np.abs(start.velocity).max())
    off = [float(np.abs(v - ours.v[1:]).max()) for v in theirs]
    yield compared("cantilever and its chain: velocities [V]", ours.v[1:], theirs[1],
                   allowed=1e-4, of=speed, source=SOURCE)  # fmt: skip
    order = np.log(off[0] / off[1]) / np.log(STEPS[0] / STEPS[1])
    yield compared("cantilever and its chain: order of convergence to us", order, 2.0,
                   allowed=0.3, of=1.0, source=SOURCE)  # fmt: skip
