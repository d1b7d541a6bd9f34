"""Dashpots in the joints: they couple the modes and are kept, in the response and in the run."""

from contextlib import nullcontext

import numpy as np
import pytest
from scipy.sparse import csc_matrix

import beadwave
from beadwave import coupling, fem, rom
from beadwave.workflows.files.scene import scene
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.stages.chain.chain import chain, initial_velocity
from beadwave.workflows.stages.engine.cache import memory
from beadwave.workflows.stages.engine.pipeline import Pipeline
from beadwave.workflows.stages.structure.assembly import dashpots

from command_line import COARSE_RIG

COARSE = (
    *COARSE_RIG,
    "output.samples=151", "time.duration=1.5e-3", "damping={kind='none'}",
)  # fmt: skip
DAMPED = ("joints.head.cz=2000.0", "joints.head.cry=0.05")


@pytest.fixture(scope="module")
def damped(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("BEADWAVE_CACHE_DIR", str(tmp_path_factory.mktemp("cache")))
        yield Pipeline(scene("rig-rom", (*COARSE, *DAMPED)), memory(), lambda name: nullcontext())


@pytest.mark.slow
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


@pytest.mark.slow
def test_a_run_with_dashpots_loses_what_its_ledger_says(damped):
    wall, run = damped("wall"), damped("impact")
    assert isinstance(wall, coupling.CoupledWall) and wall.reciprocal
    trajectory = run.trajectory
    assert trajectory.dissipated_wall[-1] > 1e-4 * trajectory.energy_kinetic[0]
    assert (np.diff(trajectory.dissipated_wall) >= 0).all()
    assert trajectory.energy_error < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("dashpots", [(), DAMPED])
def test_a_run_whose_modes_are_coupled_says_which_errors_it_leaves_out(dashpots, tmp_path):
    summary = beadwave.impact("rig-rom", (*COARSE, *dashpots), out=tmp_path / "out").summary
    said = [text for text in summary.warnings if "reduction and mesh are not estimated" in text]
    assert len(said) == bool(dashpots)
    assert (summary.error_estimate.reduction is None) == bool(dashpots)


@pytest.mark.slow
def test_the_error_stated_of_a_run_with_dashpots_is_that_of_a_finer_one(damped):
    """Stated from a march of half the steps: at least the difference to one of twice as many,
    at most a thousand times it (an order of 8 leaves 2^8 between the two)."""
    wall, run = damped("wall"), damped("impact").trajectory
    row, v0 = chain(damped.scene), initial_velocity(damped.scene)
    finer = coupling.march_coupled(
        row, wall, v0, duration=float(run.t[-1]), error=1e-9, n_save=len(run.t) - 1,
        largest_step=coupling.longest_step(wall) / 2,
    )  # fmt: skip
    off = np.abs(finer.v - run.v).max() / np.abs(v0).max()
    assert off < run.error_estimate < 1e3 * off


@pytest.mark.slow
def test_a_dashpot_as_good_as_rigid_is_refused(damped):
    stiff = damped("wall")._replace(D=1e6 * damped("wall").D)
    row, v0 = chain(damped.scene), initial_velocity(damped.scene)
    with pytest.raises(coupling.CouplingError, match="hold their direction rigid"):
        coupling.impact(row, stiff, v0, duration=1e-4, error=1e-4)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (("joints.head.cx=10.0",), "kx = inf, which never moves"),
        (("joints.foot.cry=1.0",), "kry = inf"),
        ((*DAMPED, "time.dt=1e-6"), "give time.error"),
        ((*DAMPED, "assembly.constraint=full-tie"), 'assembly.constraint = "wires"'),
        ((*DAMPED, "reduction.kind=free-modes"), "whose boundary holds them"),
        (("joints.head.cz=-1.0",), "joints.head.cz = -1.0"),
    ],
)
def test_dashpots_that_cannot_be_are_refused(changes, words):
    with pytest.raises(InvalidScene, match=words):
        scene("rig-rom", (*COARSE, *changes))
