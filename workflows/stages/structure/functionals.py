"""Further functionals of a structure: its contact across, shakers and sensors on its faces.

Each is the mean displacement over a disc in one direction, by which it is loaded or read: Hertz'
weights at the contact, a plain mean under a shaker or a sensor.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beadwave import fem, rom
from beadwave.fem.assembly.trace import OffFace
from beadwave.fem.contact.disc_room import room_on_face
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.scene.places import Place, has_friction, sensor_places, shaker_places
from beadwave.workflows.scene.tables.shakers import AXES
from beadwave.workflows.stages.structure.assembly import solid, struck


def functional(
    scene: Scene, model: fem.Model, bodies: Mapping[str, str], place: Place
) -> NDArray[np.float64]:
    """(n,) mean displacement of a disc on a face in a direction; "normal" is out of the face.

    bodies[face] is the body of a named face. Raises InvalidScene where the disc leaves the face,
    the face is not plane, or is held.
    """
    face = f"{bodies[place.face]}:{place.face}"
    try:
        patch = fem.contact_patch(model, face, place.at, place.radius, weights="area")
    except OffFace:
        room = room_on_face(model.structure, face, place.at, place.radius)
        raise InvalidScene(
            f"{scene.name}: {place.key}: a disc of radius {place.radius:g} m at "
            f"{list(place.at)} m from the middle of {place.on!r} leaves that face; {room}; move "
            f"it by {place.key}.at, or make {place.key}.radius smaller."
        ) from None
    except ValueError as error:
        why = str(error).replace(face, place.on)
        raise InvalidScene(f"{scene.name}: {place.key}: {why.rstrip('.')}.") from None
    if place.direction == "normal":
        direction = -patch.spot.inward
    else:
        axis = AXES.get(place.direction, place.direction)
        direction = np.array(axis, float) / np.linalg.norm(axis)
    column = model.T.T @ (direction @ patch.mean)
    if not column.any():
        raise InvalidScene(
            f"{scene.name}: {place.key}: {place.on!r} is held fast in that direction; choose "
            f"another face by {place.key}.on, or another direction."
        )
    return column


def bodies_of_faces(model: fem.Model) -> dict[str, str]:
    """The body of each named face of the mesh."""
    return {
        face: body
        for body, basis in model.structure.basis.items()
        for face in basis.mesh.boundaries or {}
    }


def functionals(scene: Scene, model: fem.Model, places: Sequence[Place]) -> NDArray[np.float64]:
    """(n, p) `functional` of each place. Raises InvalidScene as it."""
    bodies = bodies_of_faces(model)
    columns = [functional(scene, model, bodies, place) for place in places]
    return np.reshape(columns, (len(places), -1)).T if columns else np.zeros((model.T.shape[1], 0))


def with_functionals(
    scene: Scene,
    model: fem.Model,
    contact: fem.ContactPatch,
    reduced: rom.ReducedModel,
    options: rom.ColumnOptions,
    **solver: Any,
) -> rom.ReducedModel:
    """The reduced model with what `places.words_of` names; as it is where that is nothing.

    Columns w of the full model (n, c) become columns of the reduced one with residual vectors of
    their own: without these a shaker would load, and a sensor read, the retained modes alone.
    Raises InvalidScene for a disc that leaves its face, rom.ReductionError.
    """
    across = contact.across(model) if has_friction(scene) else ()
    shakers, sensors = shaker_places(scene), sensor_places(scene)
    if not across and not shakers and not sensors:
        return reduced

    # w of each: directions across the contact, then discs of shakers, then discs of sensors
    B = np.column_stack(
        [*(patch.w for patch in across), functionals(scene, model, shakers + sensors)]
    )
    reduced, columns = rom.with_columns(reduced, model.K, model.M, B, options=options, **solver)
    split = np.split(columns, [len(across), len(across) + len(shakers)], axis=1)

    # the half-space that the tangential law holds already, (3, 3) along the contact's axes
    fields = {}
    if across:
        material = solid(scene, scene.struck_body)
        try:
            half_space = fem.half_space_matrix(model, struck(scene), contact, material)
        except ValueError as error:
            raise InvalidScene(f"{scene.name}: [friction]: {str(error).rstrip('.')}.") from None
        fields = {"across": split[0], "half_space": half_space, "axes": contact.axes}
    for group, W, places in (("load", split[1], shakers), ("sense", split[2], sensors)):
        if places:
            fields |= {group: W, f"{group}_names": tuple(place.name for place in places)}
    return reduced._replace(columns=rom.Columns(**fields))
