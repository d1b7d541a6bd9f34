"""The cantilever reduced to thirteen coordinates and its chain, beside Exudyn."""

import numpy as np
import pytest

from beadwave import dem, rom
from beadwave.coupling.reduced_wall import wall_from_reduced
from beadwave.workflows.files.scene import scene
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.engine.progress import quiet

from peer_programs import require_module
from programs import exudyn

SOURCE = "Exudyn, ObjectGenericODE2 and ObjectContactSphereSphere, step 0.1 us"
ROUGH, FINE = 4e-7, 1e-7  # steps [s]

pytestmark = pytest.mark.peer


@pytest.fixture(autouse=True, scope="module")
def needed():
    require_module("exudyn")


def test_exudyn_converges_to_our_velocities_with_order_2(compare):
    """Order 2 is that of its implicit trapezoidal rule."""
    pipeline = pipeline_of(scene("cantilever", ("mesh.scale=2",)), quiet)
    model, start = pipeline("model"), pipeline("start")
    body = rom.free_modes(model.K, model.M, pipeline("contact").w, rom.Selection(n_modes=12))
    wall = wall_from_reduced(body, half_space=0.0, cutoff_hz=np.inf)
    run = {"duration": 1e-3, "n_save": 10}
    ours = dem.march_to_error(start.chain, wall, start.velocity, error=1e-7, **run).trajectory.v[1:]

    v_rough, v_fine = (
        exudyn.velocities(start.chain, body, start.velocity, dt=dt, **run) for dt in (ROUGH, FINE)
    )
    compare("cantilever and its chain: velocities [V]", ours, v_fine,
            allowed=1e-4, of=float(np.abs(start.velocity).max()), source=SOURCE)  # fmt: skip
    errors = [float(np.abs(v - ours).max()) for v in (v_rough, v_fine)]
    order = np.log(errors[0] / errors[1]) / np.log(ROUGH / FINE)
    compare("cantilever and its chain: order of convergence to us", order, 2.0,
            allowed=0.3, of=1.0, source=SOURCE)  # fmt: skip
