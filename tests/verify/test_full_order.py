"""Waves of the coupled scene with the full finite-element model, and on another mesh."""

import numpy as np
import pytest

from beadwave import coupling, dem, fem, rom
from beadwave.coupling.reduced_wall import wall_of
from beadwave.workflows.evidence.harness import Comparison
from beadwave.workflows.files.scene import scene
from beadwave.workflows.stages.chain.damping import damping
from beadwave.workflows.stages.chain.impact import impact
from beadwave.workflows.stages.engine.pipeline import Pipeline, pipeline_of
from beadwave.workflows.stages.engine.progress import quiet

RIG = ("mesh.seed=0.01", "mesh.block_seed=0.035", "mesh.support_seed=0.1", "mesh.contact_seed=0.01",
       "time.error=1e-6")  # fmt: skip
OTHER = ("mesh.element=tet", "mesh.scale=0.5", "reduction.kind=free-modes", "reduction.modes=120")


pytestmark = pytest.mark.slow


def test_waves_of_all_modes_are_those_of_the_reduced_model(check):
    """Each mode of K and M of the cantilever is an oscillator of the wall, without a reduction."""
    reduced = pipeline_of(scene("cantilever", ("mesh.scale=2",)), quiet)
    model, K, M = reduced("model"), reduced("model").K.toarray(), reduced("model").M.toarray()
    full = rom.full_order(K, M, reduced("contact").w)
    full = full._replace(contact=reduced("reduction").contact)
    law = damping(reduced.scene.damping, full)
    wall = wall_of(full, damping=law, cutoff_hz=np.inf)
    check(_waves(
        f"cantilever, waves of all {model.K.shape[0]} modes [V]", reduced,
        impact(reduced.scene, reduced("start"), wall).trajectory.v,
        reduced("reduction-error") + reduced("impact").trajectory.error_estimate,
        "the full model, no reduction",
    ))  # fmt: skip


def test_waves_of_hexahedra_are_those_of_tetrahedra_within_both_mesh_errors(check):
    """Other elements, reduced in another way; both state the error of their mesh."""
    hexahedra, tetrahedra = (
        pipeline_of(scene("cantilever", changes), quiet) for changes in (("mesh.scale=1",), OTHER)
    )
    check(_waves(
        "cantilever, waves of another mesh [V]", hexahedra, tetrahedra("impact").trajectory.v,
        hexahedra("mesh-error") + tetrahedra("mesh-error"), "finer tetrahedra and free modes",
    ))  # fmt: skip


def test_waves_of_the_rig_by_its_own_modes_are_those_of_the_reduced_model(check):
    """Modes to 36 kHz (twice as many change the waves by 3e-6) and one oscillator with what they
    lack of  w^T K^-1 w = sum phi^2 / omega^2  and of  w^T K^-1 M K^-1 w = sum phi^2 / omega^4."""
    n_modes = 100
    reduced = pipeline_of(scene("rig-rom", RIG), quiet)
    model, w = reduced("model"), reduced("contact").w
    modes = fem.modes(model.K, model.M, n_modes)
    phi, u = w @ modes.phi, fem.factorised(model.K).solve(w)
    m_1 = w @ u - np.sum((phi / modes.omega) ** 2)
    m_2 = u @ model.M @ u - np.sum((phi / modes.omega**2) ** 2)
    omega = np.append(modes.omega, np.sqrt(m_1 / m_2))
    law = damping(reduced.scene.damping, reduced("reduction"))
    zeta = coupling.damping_ratios(law, omega)
    half_space = reduced("reduction").contact.half_space
    wall = dem.Wall(omega, zeta, np.append(phi, m_1 / np.sqrt(m_2)), -half_space)
    check(_waves(
        f"rig, waves of {n_modes} modes of {model.K.shape[0]} [V]", reduced,
        impact(reduced.scene, reduced("start"), wall).trajectory.v,
        reduced("reduction-error") + reduced("impact").trajectory.error_estimate,
        "modes of K and M, the rest by K^-1 w",
    ))  # fmt: skip


def _waves(
    name: str, pipeline: Pipeline, theirs: np.ndarray, stated: float, source: str
) -> Comparison:
    """Velocities of the observed spheres, over the striker's; the run may be off by the error that
    it states."""
    observed = np.array(pipeline.scene.output.spheres) - 1
    v = pipeline("impact").trajectory.v
    distance = np.abs(v - theirs)[:, observed]
    worst = np.unravel_index(distance.argmax(), distance.shape)
    a, b = v[:, observed][worst], theirs[:, observed][worst]
    speed = float(np.abs(pipeline("start").velocity).max())
    return Comparison(
        name, float(a), float(b), float(distance.max()) / speed, float(stated), source
    )
