"""The real assembly on a coarse mesh: joints from air to rigid, damping beyond critical."""

from collections.abc import Iterator
from functools import partial

import numpy as np
from joblib import Memory

import coupling
import fem
from workflows.evidence.stability.outcomes import Outcome, settled
from workflows.evidence.stability.trials import Trial
from workflows.files.scene import scene as load
from workflows.scene import Scene
from workflows.stages.chain import chain, initial_velocity
from workflows.stages.pipeline import Pipeline
from workflows.thesis import THESIS

COARSE = (
    "mesh.seed=12e-3", "mesh.block_seed=40e-3", "mesh.support_seed=60e-3",
    "mesh.contact_seed=8e-3", "reduction.modes=20", 'assembly.parts=["block","sheets"]',
)  # fmt: skip
LEVER = 1e-4  # [m^2], of the rotational stiffnesses [N m/rad] over the others [N/m]
LOWEST = 2 * np.pi * 50.0  # [rad/s], what errors of slower modes are measured by


def joint_stiffness() -> Iterator[Trial]:
    """1 to 1e16 N/m in every direction, rigid joints, and none at all: the block floats."""
    for k in (*10.0 ** np.arange(0, 17, 2), np.inf):
        yield Trial("joint-stiffness", k, partial(_jointed, k, "preload.force=0.0"))
    free = partial(_jointed, 1.0, "preload.force=0.0", 'reduction.kind="free-modes"')
    yield Trial("joint-stiffness", "1, free-modes", free)
    for kind in ("craig-bampton", "free-modes"):
        for press in (0.0, 10.0):
            changes = f"preload.force={press}", f'reduction.kind="{kind}"'
            name = f"0, free-floating, {kind}, {press:g} N"
            yield Trial("joint-stiffness", name, partial(_jointed, 0.0, *changes))


def _jointed(k: float, *changes: str) -> Outcome:
    """Error of the run, or of the lowest modes where that is larger."""
    tables = (f"joints.{side}={_stiffness(k)}" for side in ("head", "foot"))
    pipeline = _pipeline(*tables, "leaf_springs.offset=0.0", *changes)
    residual = _residual(pipeline("model"), pipeline("modes"))
    run = _run(pipeline.scene, pipeline("wall"))
    return run._replace(value=max(run.value, residual))


def _stiffness(k: float) -> str:
    along = (f"{name} = {float(k)!r}" for name in ("kx", "ky", "kz"))
    about = (f"{name} = {float(LEVER * k)!r}" for name in ("krx", "kry", "krz"))
    return "{" + ", ".join((*along, *about)) + "}"


def _pipeline(*changes: str) -> Pipeline:
    return Pipeline(load("rig-rom", (*COARSE, *changes)), Memory(None, verbose=0))


def _residual(model: fem.Model, modes) -> float:
    """How far squared frequencies are off the quotients of their shapes, the first ten modes."""
    omega, phi = modes.omega[:10], modes.phi[:, :10]
    quotient = np.sum(phi * (model.K @ phi), axis=0) / np.sum(phi * (model.M @ phi), axis=0)
    return float((np.abs(quotient - omega**2) / np.maximum(omega, LOWEST) ** 2).max())


def _run(scene: Scene, wall) -> Outcome:
    duration = 6e-5 * scene.chain.count
    return settled(chain(scene), wall, initial_velocity(scene), duration)


def rayleigh_damping() -> Iterator[Trial]:
    """The thesis' coefficients and multiples of them, to far above critical."""
    pipeline = _pipeline("chain.count=4", "output.spheres=[1]")
    for factor in (1.0, 10.0, 1e3, 1e5):
        run = partial(_rayleigh, pipeline, factor)
        yield Trial("rayleigh-damping", f"thesis x {factor:g}", run)


def _rayleigh(pipeline: Pipeline, factor: float) -> Outcome:
    wall, rayleigh = pipeline("wall"), THESIS["rayleigh"]
    scaled = {name: factor * value for name, value in rayleigh.items()}
    ratios = coupling.damping_ratios(coupling.RayleighDamping(**scaled), wall.omega)
    return _run(pipeline.scene, wall._replace(zeta=ratios))
