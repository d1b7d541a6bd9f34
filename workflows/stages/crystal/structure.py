"""The structure that a crystal's last row leans on: its contacts there, and one basis for them.

The crystal keeps its own axes. The axis of its rows points into the face, its x runs along the
first of the two global axes that span the face, and y of a lattice in space along the second.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave import coupling, fem
from beadwave.coupling.reduced_structure import require_answer, structure_of
from beadwave.dem import space
from beadwave.fem.assembly.trace import OffFace
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.scene.places import CRYSTAL_FACE
from beadwave.workflows.stages.chain.damping import damping
from beadwave.workflows.stages.crystal.packing import CrystalStart, start
from beadwave.workflows.stages.structure.assembly import solid
from beadwave.workflows.stages.structure.several import reduced_to
from beadwave.workflows.stages.structure.strike import surface_of

if TYPE_CHECKING:
    from beadwave import rom
    from beadwave.fem.modes.assembly_modes import AssemblyModes
    from beadwave.workflows.stages.structure.meshed_parts import Parts

# of the quadrature of each patch, as of a scan: the half-space is that of the same weights on the
# same mesh, so that what they miss cancels
QUADRATURE = {"n_radial": 8, "n_around": 24}
MARGIN, SHORTER = 1.25, 8  # as of several chains


class RowContacts(NamedTuple):
    """Contacts of the p spheres of a last row, each along d directions: 1, or 3 with friction."""

    w: NDArray[np.float64]  # (n, 1 + p d) in the middle of the row, then sphere by sphere
    point: NDArray[np.int64]  # (p d,) which sphere of the row each is of
    direction: NDArray[np.float64]  # (p d, 3) in the crystal's axes
    half_space: NDArray[np.float64]  # (p, 2) [m/N] that the contact's laws hold, normal, tangential
    names: tuple[str, ...]  # (p d,)


def contacts(scene: Scene, mesh: Parts, model: fem.Model, contact: fem.ContactPatch) -> RowContacts:
    """The patches under the last row; raises InvalidScene where one leaves the face."""
    crystal, first = scene.crystal, start(scene)
    face, strike = mesh.face(CRYSTAL_FACE), scene.strike
    material, centre = solid(scene, scene.struck_body), first.packing.rest[first.last]
    across = [axis for axis in range(3) if axis != first.axis]

    # directions of the crystal's axes on the face: rows into it, then along it
    spot = contact.spot
    globally = np.array([spot.inward, *spot.axes])
    frame = np.eye(3)[[first.axis, *across]]
    n_directions = 3 if scene.friction else 1

    rows, w, local = centre[:, across], [contact.w], []
    middle = 0.5 * (rows.min(axis=0) + rows.max(axis=0))
    for place in rows - middle:
        at = tuple(float(x) for x in np.add(strike.at, place))
        try:
            patch = fem.contact_patch(
                model, face, at, strike.radius, weights=strike.weights, **QUADRATURE
            )
        except OffFace:
            raise InvalidScene(
                f"{scene.name}: crystal.on = {crystal.on!r}: a sphere of the last row touches at "
                f"{np.round(at, 6).tolist()} m from the middle of the face, where its patch of "
                f"{strike.radius:g} m leaves it; take fewer columns, or move the row by crystal.at."
            ) from None
        of_sphere = []
        for k, direction in enumerate(globally[:n_directions]):
            on_mesh = direction @ patch.mean
            tangent = direction if k else None  # None: along the normal
            of_sphere.append(
                patch._replace(w=model.T.T @ on_mesh, on_mesh=on_mesh, tangent=tangent)
            )
        w += [one.w for one in of_sphere]
        local.append(of_sphere)
    together = [patch for of_sphere in local for patch in of_sphere]
    compliance = np.array(fem.half_spaces_on_mesh(model, face, together, material))
    compliance = compliance.reshape(len(rows), n_directions)
    tangential = compliance[:, 1:].mean(axis=1) if n_directions == 3 else np.zeros(len(rows))
    letters = ("n", "t1", "t2")[:n_directions]
    return RowContacts(
        np.column_stack(w),
        np.repeat(np.arange(len(rows)), n_directions),
        np.tile(frame[:n_directions], (len(rows), 1)),
        np.column_stack([compliance[:, 0], tangential]),
        tuple(f"sphere-{first.number[k]}-{letter}" for k in first.last for letter in letters),
    )


def reduction(
    scene: Scene,
    model: fem.Model,
    contact: fem.ContactPatch,
    modes: AssemblyModes,
    row: RowContacts,
    factor: fem.Factor | None = None,
) -> rom.ReducedModel:
    """The structure in modes that keep the response at every contact of the row to the scene's
    error, and between them; the model's own contact is in the middle of the row."""
    material = solid(scene, scene.struck_body)
    surface = surface_of(material, contact.spot.inward, contact.spot.radii)
    face = f"{scene.struck_body}:{CRYSTAL_FACE}"
    (local,) = fem.half_spaces_on_mesh(model, face, [contact], material)
    struck = surface._replace(
        half_space=local,
        point=tuple(contact.spot.point.tolist()),
        direction=tuple(contact.spot.inward.tolist()),
    )
    return reduced_to(scene, model, modes, row.w, row.names, struck, factor)


def structure(scene: Scene, reduction: rom.ReducedModel, row: RowContacts) -> space.Structure:
    """The structure as the last row pushes it."""
    law = damping(scene.damping, reduction)
    return structure_of(
        reduction, reduction.columns.load, row.point, row.direction, row.half_space, damping=law
    )


def require_unique(scene: Scene, start: CrystalStart, structure: space.Structure) -> None:
    """Raise InvalidScene where a contact and the structure in series leave no unique force."""
    try:
        require_answer(start.packing, structure, start.velocity)
    except coupling.CouplingError as error:
        raise InvalidScene(
            f"{scene.name}: crystal.on: {str(error).rstrip('.')}, crystal.patch_radius."
        ) from None


def reduction_error(
    scene: Scene,
    start: CrystalStart,
    march: space.SpaceTrajectory,
    reduction: rom.ReducedModel,
    row: RowContacts,
) -> float:
    """Error of the saved velocities by the reduction over the largest speed at the start: the march
    again on the model that stands for the full structure at all contacts, up to any frequency."""
    finer = structure(scene, reduction.finer, row)
    again = space.march(
        start.packing, finer, start.velocity, duration=scene.time.duration, dt=march.dt / SHORTER,
        n_save=scene.output.samples - 1, saved=march.saved,
    )  # fmt: skip
    change = np.linalg.norm(again.velocity - march.velocity, axis=2).max(initial=0.0)
    speed = max(np.linalg.norm(start.velocity, axis=1).max(), start.packing.fastest_drive)
    return MARGIN * float(change) / (float(speed) or 1.0)
