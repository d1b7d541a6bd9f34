"""The coupled scene with the full finite-element model, and on another mesh, in its waves."""

from collections.abc import Iterator
from contextlib import nullcontext

import numpy as np

import coupling
import dem
import fem
import rom
from workflows.evidence.verify.comparisons import Comparison
from workflows.files.scene import scene
from workflows.stages.impact import impact
from workflows.stages.pipeline import Pipeline, pipeline_of
from workflows.stages.wall import damping

COARSE = ("mesh.scale=2",)
RIG = ("mesh.seed=0.01", "mesh.block_seed=0.035", "mesh.support_seed=0.1", "mesh.contact_seed=0.01",
       "time.error=1e-6")  # fmt: skip
N_MODES = 100  # of the rig, to 36 kHz; twice as many change its waves by 3e-6
OTHER = ("mesh.element=tet", "mesh.scale=0.5", "reduction.kind=free-modes", "reduction.modes=120")


def full_order() -> Iterator[Comparison]:
    """Waves of all modes beside the reduced model's, and of hexahedra beside tetrahedra."""
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
    yield _rig()


def _rig() -> Comparison:
    """The rig on one mesh: its own modes and static compliance instead of a reduction."""
    reduced = _pipeline(RIG, "rig-rom")
    stated = reduced("reduction-error") + reduced("impact").trajectory.error_estimate
    wall = _lowest_modes(reduced, N_MODES)
    name = f"rig, waves of {N_MODES} modes of {reduced('model').K.shape[0]} [V]"
    theirs = impact(reduced.scene, reduced("start"), wall).trajectory.v
    return _waves(name, reduced, theirs, stated, "modes of K and M, the rest by K^-1 w")


def _lowest_modes(pipeline: Pipeline, n_modes: int) -> dem.Wall:
    """Modes of the full K and M, and one oscillator with what they lack of w^T K^-1 w = sum
    phi^2 / omega^2 and of w^T K^-1 M K^-1 w = sum phi^2 / omega^4."""
    model, w, reduced = pipeline("model"), pipeline("contact").w, pipeline("reduction")
    found = fem.modes(model.K, model.M, n_modes)
    phi, u = w @ found.phi, fem.factorised(model.K).solve(w)
    m_1 = w @ u - np.sum((phi / found.omega) ** 2)
    m_2 = u @ model.M @ u - np.sum((phi / found.omega**2) ** 2)
    omega = np.append(found.omega, np.sqrt(m_1 / m_2))
    zeta = coupling.damping_ratios(damping(pipeline.scene.damping, reduced), omega)
    return dem.Wall(omega, zeta, np.append(phi, m_1 / np.sqrt(m_2)), -reduced.contact.half_space)


def _pipeline(changes: tuple[str, ...], name: str = "cantilever") -> Pipeline:
    return pipeline_of(scene(name, changes), lambda stage: nullcontext())


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
