"""The real assembly on a coarse mesh: joints from air to rigid, damping beyond critical."""

from collections.abc import Iterator
from functools import partial

import numpy as np
from joblib import Memory

from beadwave import coupling, dem
from beadwave.workflows.evidence.harness import Outcome, Trial
from beadwave.workflows.evidence.stability.trials import settled
from beadwave.workflows.files.scene import scene as load
from beadwave.workflows.stages.chain.chain import chain, initial_velocity
from beadwave.workflows.stages.engine.pipeline import Pipeline
from beadwave.workflows.thesis import THESIS

COARSE = (
    "mesh.seed=12e-3", "mesh.block_seed=40e-3", "mesh.support_seed=60e-3",
    "mesh.contact_seed=8e-3", "reduction.modes=20", 'assembly.parts=["block","sheets"]',
)  # fmt: skip


def joint_stiffness() -> Iterator[Trial]:
    """1 to 1e16 N/m in every direction, rigid joints, and none at all: the block floats."""
    for k in (*10.0 ** np.arange(0, 17, 2), np.inf):
        yield Trial(k, partial(on_joints, k, "preload.force=0.0"), "N/m")
    free = partial(on_joints, 1.0, "preload.force=0.0", 'reduction.kind="free-modes"')
    yield Trial("1, free-modes", free)
    for kind in ("craig-bampton", "free-modes"):
        for press in (0.0, 10.0):
            changes = f"preload.force={press}", f'reduction.kind="{kind}"'
            name = f"0, free-floating, {kind}, {press:g} N"
            yield Trial(name, partial(on_joints, 0.0, *changes))


def on_joints(k: float, *changes: str) -> Outcome:
    """Error of a run on joints of k [N/m], or of the lowest modes where that is larger."""
    lever = 1e-4  # [m^2], of the rotational stiffnesses [N m/rad] over the others [N/m]
    shifts = [f"{name} = {float(k)!r}" for name in ("kx", "ky", "kz")]
    turns = [f"{name} = {float(lever * k)!r}" for name in ("krx", "kry", "krz")]
    table = "{" + ", ".join(shifts + turns) + "}"
    joints = [f"joints.{side}={table}" for side in ("head", "foot")]
    pipeline = _pipeline(*joints, "leaf_springs.offset=0.0", *changes)

    # omega^2 of the first ten modes beside Rayleigh's quotients phi^T K phi / phi^T M phi of their
    # shapes; relative, of modes below 50 Hz to 50 Hz: those of a floating block have no frequency
    model, modes = pipeline("model"), pipeline("modes")
    omega, phi = modes.omega[:10], modes.phi[:, :10]
    quotient = np.sum(phi * (model.K @ phi), axis=0) / np.sum(phi * (model.M @ phi), axis=0)
    scale = np.maximum(omega, 2 * np.pi * 50.0) ** 2
    residual = float((np.abs(quotient - omega**2) / scale).max())

    run = _march(pipeline, pipeline("wall"))
    return run._replace(value=max(run.value, residual))


def rayleigh_damping() -> Iterator[Trial]:
    """The thesis' coefficients and multiples of them, to far above critical."""
    pipeline = _pipeline("chain.count=4", "output.spheres=[1]")
    for factor in (1.0, 10.0, 1e3, 1e5):
        run = partial(_damped, pipeline, factor)
        yield Trial(f"thesis x {factor:g}", run)


def _damped(pipeline: Pipeline, factor: float) -> Outcome:
    """The run with the thesis' Rayleigh coefficients times a factor on the wall's modes."""
    wall = pipeline("wall")
    scaled = {name: factor * value for name, value in THESIS["rayleigh"].items()}
    ratios = coupling.damping_ratios(coupling.RayleighDamping(**scaled), wall.omega)
    return _march(pipeline, wall._replace(zeta=ratios))


def _pipeline(*changes: str) -> Pipeline:
    return Pipeline(load("rig-rom", (*COARSE, *changes)), Memory(None, verbose=0))


def _march(pipeline: Pipeline, wall: dem.Wall) -> Outcome:
    """The scene's chain at a wall for 60 us a sphere, of which its wave takes 47 us."""
    scene = pipeline.scene
    return settled(chain(scene), wall, initial_velocity(scene), 6e-5 * scene.chain.count)
