"""What the reduction and the mesh leave of error in the waves, by a run with a coarser one of each.

The difference between the two runs is mostly the coarser one's error, so it bounds the finer's.
"""

import numpy as np

import coupling
import dem
import fem
import rom
from workflows import assembly_stages as stages
from workflows.chain_stages import chain, initial_velocity
from workflows.reduced_wall import wall_of
from workflows.reduction_stage import TO_HZ, provenance
from workflows.scene import Mesh, Scene

COARSER = 1.5  # times the element size


def reduction_error(
    scene: Scene, reduction: rom.ReducedModel, wall: dem.Wall, impact: coupling.Impact
) -> float:
    """Against half of the wall's modes: relative velocity difference of the observed spheres."""
    middle = wall.omega[len(wall.omega) // 2] / (2 * np.pi)
    halved = scene.wall.model_copy(update={"cutoff": float(middle)})
    return _difference(scene, wall_of(scene.model_copy(update={"wall": halved}), reduction), impact)


def coarse_reduction(scene: Scene) -> rom.ReducedModel:
    """The assembly on elements half as large again, reduced the quickest way."""
    coarse = scene.model_copy(update={"mesh": _coarser(scene.mesh)})
    model = stages.model(coarse, stages.mesh(coarse))
    contact = stages.contact(coarse, model)
    return rom.free_modes(
        model.K,
        model.M,
        contact.w,
        n_modes=stages.N_MODES[0],
        choice="contact",
        to_hz=TO_HZ,
        factorise=fem.factorised,
        provenance=provenance(coarse, model, contact),
    )._replace(T=None)


def mesh_error(scene: Scene, coarse: rom.ReducedModel, impact: coupling.Impact) -> float:
    """Against the coarser mesh: the same difference."""
    return _difference(scene, wall_of(scene, coarse), impact)


def _coarser(mesh: Mesh) -> Mesh:
    sizes = {name: COARSER * value for name, value in mesh if isinstance(value, float)}
    return mesh.model_copy(update=sizes)


def _difference(scene: Scene, wall: dem.Wall, impact: coupling.Impact) -> float:
    """Largest velocity difference of the observed spheres over the largest initial speed."""
    finer, v0 = impact.trajectory, initial_velocity(scene)
    coarse = dem.march(
        chain(scene),
        wall,
        v0,
        duration=scene.time.duration,
        dt=finer.dt,
        n_save=scene.output.samples - 1,
    )
    observed = [sphere - 1 for sphere in scene.output.spheres] or slice(None)
    return float(np.abs(coarse.v - finer.v)[:, observed].max() / np.abs(v0).max())
