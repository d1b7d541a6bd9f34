"""Dashpots in the joints: they couple the modes and are kept, in the response and in the run."""

from contextlib import nullcontext

import numpy as np
import pytest
from scipy.sparse import csc_matrix

import coupling
import fem
import rom
from workflows.assembly_stages import dashpots
from workflows.scene import InvalidScene
from workflows.scene_file import scene
from workflows.stages import Pipeline, memory

COARSE = (
    "mesh.seed=0.012", "mesh.block_seed=0.05", "mesh.contact_seed=0.012", "patch.radius=0.006",
    "output.samples=301", "damping={kind='none'}",
)  # fmt: skip
DAMPED = ("joints.head.cz=2000.0", "joints.head.cry=0.05")


@pytest.fixture(scope="module")
def damped(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("BEADWAVE_CACHE_DIR", str(tmp_path_factory.mktemp("cache")))
        yield Pipeline(scene("rig-rom", (*COARSE, *DAMPED)), memory(), lambda name: nullcontext())


def test_the_reduced_response_holds_the_dashpots(damped):
    """Against direct solutions of K + i omega C - omega^2 M; without C they differ by 10 times."""
    model, w, reduced = damped("model"), damped("contact").w, damped("reduction")
    C = dashpots(damped.scene, model)
    f = np.array([60.0, 270.0, 700.0, 872.0, 907.0, 3000.0])
    full = []
    for omega in 2 * np.pi * f:
        D = csc_matrix(model.K + 1j * omega * C - omega**2 * model.M)
        full.append(w @ fem.factorised(D).solve(w.astype(complex)))
    off = np.abs(rom.receptance(reduced, None, f) / full - 1)
    bare = np.abs(rom.receptance(reduced._replace(C=None), None, f) / full - 1)
    assert off.max() < 1e-3
    assert bare.max() > 0.05


def test_a_run_with_dashpots_loses_what_its_ledger_says(damped):
    wall, run = damped("wall"), damped("impact")
    assert isinstance(wall, coupling.CoupledWall) and wall.reciprocal
    trajectory = run.trajectory
    assert trajectory.dissipated_wall[-1] > 1e-4 * trajectory.energy_kinetic[0]
    assert (np.diff(trajectory.dissipated_wall) >= 0).all()
    assert trajectory.energy_error < 1e-6


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (("joints.head.cx=10.0",), "kx = inf, which never moves"),
        (("joints.foot.cry=1.0",), "kry = inf"),
        ((*DAMPED, "time.dt=1e-6"), "give time.error"),
        ((*DAMPED, "wall.prune=true"), "drop wall.prune"),
        ((*DAMPED, "assembly.constraint=full-tie"), 'assembly.constraint = "wires"'),
        ((*DAMPED, "reduction.kind=free-modes"), "whose boundary holds them"),
        (("joints.head.cz=-1.0",), "joints.head.cz = -1.0"),
    ],
)
def test_dashpots_that_cannot_be_are_refused(changes, words):
    with pytest.raises(InvalidScene, match=words):
        scene("rig-rom", (*COARSE, *changes))
