"""Errors of the waves by the reduction and by the mesh, each from a second run.

The reduction's is the difference to a run with the finer model that the reduction carries along.
The mesh's is extrapolated from the difference to a mesh with elements twice as large, those that
thickness and bores bound too: of an error e = c h^p,

    e(2 h) - e(h) = (2^p - 1) e(h),    e(h) - e(h / 2^k) = (1 - 2^-kp) e(h).

Some meshes have no coarser one to compare with: a user's own mesh, bodies whose elements are
bounded by their shape, and small meshes, of which a coarser one would be too poor. There every
element is split in eight instead, if that is affordable; in the smallest meshes in 64 or 512, since
a few elements miss more than half of the motion. Elements that are split evenly converge with the
order 1 at singular edges.

Stresses are singular where a face ends on another; meshes refined there converge faster than the
order 1 that singular edges leave on even ones, and slower than the 4 of smooth modes. With the
order taken, the errors stated of rig-rom and rig-full-tie are 1.2 and 2.7 times those against
meshes of 127 000 and 107 000 unknowns. Beams and plates have another, see `bending`. Both estimates
stop at the scene's horizon, beyond which spheres move chaotically and any two runs part.
"""

from math import log

import numpy as np

from beadwave import coupling, dem, fem, geometry, rom
from beadwave.fem.modes.assembly_modes import N_MODES
from beadwave.workflows.scene import Scene
from beadwave.workflows.scene.tables.reduction import TO_HZ
from beadwave.workflows.stages.chain.chain import Start
from beadwave.workflows.stages.chain.walls import wall_of
from beadwave.workflows.stages.structure import assembly as stages
from beadwave.workflows.stages.structure.parts import Parts
from beadwave.workflows.stages.structure.reduction import SecondModel, contact_of

COARSER = 2.0  # times the element size
ORDER = 1.5  # of the mesh's error; see above for what the errors stated are with it
MARGIN = 1.25  # of a difference, for what the finer model itself misses
SHORTER = 8  # times the step for the finer model, whose highest modes move faster than any kept


# Choice of a coarser or a finer mesh that a run is compared with
EVEN_ORDER = 1.0  # of the error of a mesh whose elements are parted evenly
FEWER_ELEMENTS = 1.5  # times the elements of a body in a mesh that is markedly coarser
# share of all elements in bodies whose second mesh is hardly coarser, up to which the second
# mesh still shows the error
UNSEEN_SHARE = 0.3
SMALL_UNKNOWNS = 1.6e4  # unknowns of a finer mesh that is solved in a second
MAX_UNKNOWNS = 6e4  # unknowns of one that takes as long as the run


def reduction_error(
    scene: Scene, start: Start, reduction: rom.ReducedModel, impact: coupling.Impact
) -> float:
    """Against the finer model: relative velocity difference of the observed spheres."""
    finer = wall_of(scene.but(wall={"cutoff": None}), reduction.finer)
    dt = impact.trajectory.dt / SHORTER
    return MARGIN * _difference(scene, start, finer, impact, dt=dt)


def other_mesh(scene: Scene, mesh: Parts) -> tuple[Parts, float]:
    """A mesh coarser than the run's own, or finer where none is, and how much of the difference
    to it is the error of the run's own.

    Raises ValueError for one that cannot be made coarser and is too large to be made finer.
    """
    n = 3 * sum(mesh.nodes.values())
    if not of_few_elements(mesh) and scene.own_mesh is None:
        coarse = stages.mesh(scene, COARSER)
        # markedly coarser: nearly all elements are in bodies that have fewer there
        n_cells = {name: body.nelements for name, body in mesh.meshes.items()}
        hardly_coarser = [
            n_cells[name]
            for name, body in coarse.meshes.items()
            if n_cells[name] < FEWER_ELEMENTS * body.nelements
        ]
        if sum(hardly_coarser) <= UNSEEN_SHARE * sum(n_cells.values()):
            return coarse, 1 / (COARSER**ORDER - 1)
    if 8 * n > MAX_UNKNOWNS:
        finer = "one of your own" if scene.own_mesh else "--set mesh.scale=0.5"
        raise ValueError(
            f"its elements cannot be made larger, and halved they would have {8 * n:.1e} "
            f"unknowns, allowed are {MAX_UNKNOWNS:.0e}; compare with a run on a finer mesh, "
            f"{finer}."
        )
    times = max(1, int(log(SMALL_UNKNOWNS / n, 8)))
    meshes = {name: geometry.refined(body, times) for name, body in mesh.meshes.items()}
    return mesh._replace(meshes=meshes), 1 / (1 - 2 ** (-times * EVEN_ORDER))


def of_few_elements(mesh: Parts) -> bool:
    """True if every element can be split in eight and the assembly solved again in a second."""
    return 8 * 3 * sum(mesh.nodes.values()) <= SMALL_UNKNOWNS


def second_mesh(scene: Scene, mesh: Parts) -> SecondModel:
    """The assembly on another mesh, reduced the quickest way; raises ValueError where none is."""
    parts, error_share = other_mesh(scene, mesh)
    model = stages.model(scene, parts)
    return SecondModel(wall_model(scene, model, stages.contact(scene, parts, model)), error_share)


def wall_model(scene: Scene, model: fem.Model, contact: fem.ContactPatch) -> rom.ReducedModel:
    """A model at its contact, reduced the quickest way, for a march alone."""
    reduced = rom.free_modes(
        model.K,
        model.M,
        contact.w,
        rom.Selection(n_modes=N_MODES[0], choice="contact", to_hz=TO_HZ),
        factorise=fem.factorised,
    )
    return reduced._replace(T=None, contact=contact_of(scene, model, contact))


def mesh_error(scene: Scene, start: Start, second: SecondModel, impact: coupling.Impact) -> float:
    """Against a second mesh: the same difference, extrapolated to elements of no size."""
    return second.left * _difference(scene, start, wall_of(scene, second.reduced), impact)


def _difference(
    scene: Scene, start: Start, wall: dem.Wall, impact: coupling.Impact, *, dt: float | None = None
) -> float:
    """Largest velocity difference of the observed spheres up to the horizon over the largest
    initial speed."""
    v = velocities(scene, start, wall, impact, dt=dt)
    difference = np.abs(v - impact.trajectory.v[: len(v), observed(scene)])
    return float(difference.max() / np.abs(start.velocity).max())


def velocities(
    scene: Scene, start: Start, wall: dem.Wall, impact: coupling.Impact, *, dt: float | None = None
) -> np.ndarray:
    """Of the observed spheres at the impact's instants up to the horizon (k, m) [m/s], before
    another wall, by its steps or by dt [s]."""
    t = impact.trajectory.t
    n = max(1, int(np.searchsorted(t, scene.time.horizon, "right")) - 1)
    march = {"duration": float(t[n]), "dt": dt or impact.trajectory.dt, "n_save": n}
    return dem.march(start.chain, wall, start.velocity, **march).v[:, observed(scene)]


def observed(scene: Scene) -> slice | list[int]:
    """Columns of the spheres that the scene observes, all without any."""
    return [sphere - 1 for sphere in scene.output.spheres] or slice(None)
