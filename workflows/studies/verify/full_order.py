"""The coupled scene with the full finite-element model, and on another mesh, in its waves."""

from collections.abc import Iterator
from contextlib import nullcontext

import numpy as np

import coupling
import rom
from coupling.verification.comparisons import Comparison
from workflows.files.scene import scene
from workflows.pipeline.impact import impact
from workflows.pipeline.pipeline import Pipeline, pipeline_of
from workflows.pipeline.wall import damping

COARSE = ("mesh.scale=2",)
OTHER = ("mesh.element=tet", "mesh.scale=0.5", "reduction.kind=free-modes", "reduction.modes=120")


def full_order() -> Iterator[Comparison]:
    """The cantilever's waves: all modes beside the reduced model, hexahedra beside tetrahedra."""
    reduced, other = (_pipeline(changes) for changes in (COARSE, OTHER))
    stated = reduced("reduction-error") + reduced("impact").trajectory.error_estimate
    theirs = _every_mode(reduced)
    name = f"cantilever, waves of all {reduced('model').K.shape[0]} modes [V]"
    yield _waves(name, reduced, theirs, stated, "the full model, no reduction")
    ours = _pipeline(("mesh.scale=1",))
    errors = sum(one("mesh-error") for one in (ours, other))
    name = "cantilever, waves of another mesh [V]"
    theirs = other("impact").trajectory.v
    yield _waves(name, ours, theirs, errors, "finer tetrahedra and free modes")


def _pipeline(changes: tuple[str, ...]) -> Pipeline:
    return pipeline_of(scene("cantilever", changes), lambda stage: nullcontext())


def _every_mode(pipeline: Pipeline) -> np.ndarray:
    """Velocities with each mode of K and M as an oscillator of the wall."""
    model, reduced = pipeline("model"), pipeline("reduction")
    full = rom.full_order(model.K.toarray(), model.M.toarray(), pipeline("contact").w)
    full = full._replace(contact=reduced.contact)
    law = damping(pipeline.scene.damping, full)
    wall = coupling.wall.wall_of(full, damping=law, cutoff_hz=np.inf)
    return impact(pipeline.scene, pipeline("start"), wall).trajectory.v


def _waves(
    name: str, pipeline: Pipeline, theirs: np.ndarray, allowed: float, source: str
) -> Comparison:
    """Velocities of the observed spheres; a stated error is allowed to be reached."""
    ours, observed = pipeline("impact").trajectory.v, np.array(pipeline.scene.output.spheres) - 1
    off = np.abs(ours - theirs)[:, observed]
    worst = np.unravel_index(off.argmax(), off.shape)
    a, b = (v[:, observed][worst] for v in (ours, theirs))
    scale = float(np.abs(pipeline("start").velocity).max())
    return Comparison(name, float(a), float(b), float(off.max()) / scale, float(allowed), source)
