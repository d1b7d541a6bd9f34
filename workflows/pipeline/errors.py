"""What the reduction and the mesh leave of error in the waves, by a second run for each.

The reduction's is the difference to a run with the finer model that the reduction carries along.
The mesh's is extrapolated from the difference to a mesh with elements twice as large: of an error
e = c h^p,

    e(2 h) - e(h) = (2^p - 1) e(h).

Stresses are singular where a face ends on another; meshes refined there converge faster than the
order 1 that singular edges leave on even ones, and slower than the 4 of smooth modes. With the
order taken, the errors stated of rig-rom and rig-full-tie are 1.2 and 2.7 times those against
meshes of 127 000 and 107 000 unknowns. Beams and plates have another, see `bending`. Both estimates
stop at the scene's horizon, beyond which spheres move chaotically and any two runs part.
"""

import numpy as np

import coupling
import dem
import fem
import rom
from workflows.pipeline import assembly as stages
from workflows.pipeline import bending
from workflows.pipeline.chain import Start
from workflows.pipeline.reduction import TO_HZ, contact_of
from workflows.pipeline.wall import wall_of
from workflows.scene import Scene

COARSER = 2.0  # times the element size
ORDER = 1.5  # of the mesh's error
MARGIN = 1.25  # of a difference, for what the finer model itself misses
ONE_MESH = 1e-9  # two meshes of solids never agree so well
SHORTER = 8  # times the step for the finer model, whose highest modes move faster than any kept


def reduction_error(
    scene: Scene, start: Start, reduction: rom.ReducedModel, impact: coupling.Impact
) -> float:
    """Against the finer model: relative velocity difference of the observed spheres."""
    finer = wall_of(scene.but(wall={"cutoff": None}), reduction.finer)
    dt = impact.trajectory.dt / SHORTER
    return MARGIN * _difference(scene, start, finer, impact, dt=dt)


def coarser(scene: Scene) -> Scene:
    """The scene with elements twice as large."""
    sizes = {name: COARSER * value for name, value in scene.mesh if isinstance(value, float)}
    return scene.but(mesh=sizes)


def second_mesh(scene: Scene) -> rom.ReducedModel:
    """The assembly on elements twice as large, reduced the quickest way."""
    coarse = coarser(scene)
    mesh = stages.mesh(coarse)
    model = stages.model(coarse, mesh)
    contact = stages.contact(coarse, mesh, model)
    return rom.free_modes(
        model.K,
        model.M,
        contact.w,
        rom.Selection(n_modes=stages.N_MODES[0], choice="contact", to_hz=TO_HZ),
        factorise=fem.factorised,
    )._replace(T=None, contact=contact_of(coarse, model, contact))


def mesh_error(
    scene: Scene, start: Start, second: rom.ReducedModel, impact: coupling.Impact
) -> float:
    """Against a second mesh: the same difference, extrapolated to elements of no size.

    Raises ValueError where thin bodies and bores make one mesh of both sizes.
    """
    difference = _difference(scene, start, wall_of(scene, second), impact)
    if scene.bending is not None:
        return bending.left(scene) * difference
    if difference < ONE_MESH:
        raise ValueError(
            "elements twice as large make the same mesh, since thin bodies and holes bound them; "
            "run with --set mesh.scale=0.5 and compare."
        )
    return difference / (COARSER**ORDER - 1)


def _difference(
    scene: Scene, start: Start, wall: dem.Wall, impact: coupling.Impact, *, dt: float | None = None
) -> float:
    """Largest velocity difference of the observed spheres up to the horizon over the largest
    initial speed."""
    other = velocities(scene, start, wall, impact, dt=dt)
    spheres = observed(scene)
    difference = np.abs(other - impact.trajectory.v[: len(other), spheres])
    return float(difference.max() / np.abs(start.velocity).max())


def velocities(
    scene: Scene, start: Start, wall: dem.Wall, impact: coupling.Impact, *, dt: float | None = None
) -> np.ndarray:
    """Of the observed spheres at the impact's instants up to the horizon (k, m) [m/s], before
    another wall, by its steps or by dt [s]."""
    t = impact.trajectory.t
    held = max(1, int(np.searchsorted(t, scene.time.horizon, "right")) - 1)
    march = {"duration": float(t[held]), "dt": dt or impact.trajectory.dt, "n_save": held}
    return dem.march(start.chain, wall, start.velocity, **march).v[:, observed(scene)]


def observed(scene: Scene) -> slice | list[int]:
    """Columns of the spheres that the scene observes, all without any."""
    return [sphere - 1 for sphere in scene.output.spheres] or slice(None)
