"""Place where the chain touches an assembly of bodies: a point of a plane, a cylinder or a
sphere."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from beadwave import fem, rom
from beadwave.fem.assembly.trace import OffFace
from beadwave.fem.contact.impact_point import require_flat, spanning
from beadwave.geometry.cad.struck_face import Struck, nearest, struck_at
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.stages.structure.meshed_parts import STRIKE, Parts

if TYPE_CHECKING:  # these load gmsh
    from beadwave.geometry.cad.selectors import FaceSelection
    from beadwave.geometry.cad.solids import Body, Face

MIDDLE = (0.0, 0.0)  # of a plane face


N_RIM = 16  # points of the rim whose distance from the face is measured
# distance from the face, over the patch's radius, beyond which a point is off it; the patch on
# the mesh decides where it is nearer (fem.assembly.trace.OffFace)
OFF_FACE = 0.02
# distance of a point from its face, over the body's diagonal, that is no meant one: of a length in
# mm that is written in m it is hundreds
FAR_AWAY = 10.0


@contextmanager
def in_words_of(key: str) -> Iterator[None]:
    """Refusals of a strike in the words of the table that says where it is: "strike", "crystal", or
    "chains.NAME"."""
    try:
        yield
    except InvalidScene as error:
        radius = "radius" if key == "strike" else "patch_radius"
        words = str(error).replace("strike.radius", f"{key}.{radius}")
        words = words.replace("strike: ", f"{key}: ")
        raise InvalidScene(words.replace("strike.", f"{key}.")) from None


def struck(scene: Scene, bodies: Mapping[str, Body], selected: FaceSelection) -> Struck:
    """Face and point of the CAD model that the scene strikes, among the faces `selected` by
    strike.on.

    Raises InvalidScene for a face that is no plane, cylinder or sphere, for one that is not plane
    and has no point, and for a patch that leaves its face.
    """
    strike, body = scene.strike, bodies[selected.body]
    faces = [body.face(tag) for tag in selected.tags]

    # the point: from the middle of a plane face along the two global axes that span it, or on the
    # face that is nearest to a point in space
    if strike.point is None and all(face.normal is not None for face in faces):
        lower = np.min([face.lower for face in faces], axis=0)
        upper = np.max([face.upper for face in faces], axis=0)
        point = (lower + upper) / 2 + np.array(strike.at) @ spanning(faces[0].normal)
        hit = Struck(selected, point, normal=faces[0].normal)
    else:
        point = strike.point or strike.selected_at
        if point is None:
            raise InvalidScene(
                f"{scene.name}: strike.on = {strike.on!r} is no plane face, which has a middle; "
                "say where it is struck, at = [x, y, z] in m."
            )
        if strike.point is None and tuple(strike.at) != MIDDLE:
            raise InvalidScene(
                f"{scene.name}: strike.at = {list(strike.at)} m is along a plane face, and "
                f"strike.on = {strike.on!r} is none; give [x, y, z], or drop it."
            )
        first = nearest(faces, body, point)
        if first.normal is None and first.kind not in ("cylinder", "sphere"):
            raise InvalidScene(
                f"{scene.name}: strike.on = {strike.on!r} is a face of the kind {first.kind}; "
                "strike a plane, a cylinder or a sphere."
            )
        hit = struck_at(body, faces, first, point)

    _require_near(scene, body, hit, point)

    # round face: the point is moved onto it, and the patch must be small relative to its radius
    if hit.normal is None:
        if np.linalg.norm(hit.away) < 1e-9:
            raise InvalidScene(
                f"{scene.name}: strike: {hit.point.tolist()} m lies in the middle of "
                f"{strike.on!r}: the struck side is not defined; move the point."
            )
        try:
            require_flat(hit.radii, strike.radius)
        except ValueError as error:
            raise InvalidScene(f"{scene.name}: strike.radius: {error}") from None
        hit = hit._replace(point=hit.foot)
        if min(body.distance(hit.point, tag) for tag in hit.face.tags) > strike.radius:
            raise _off_face(scene, hit.point, faces)
        return hit

    # plane face: the patch must lie on it. Not checked at the middle, the default, where a face
    # with a hole has nothing: a scan of such a face names no point. The mesh decides there.
    rim = around(hit.point, hit.normal, strike.radius, N_RIM)
    off = max(min(body.distance(p, tag) for tag in hit.face.tags) for p in rim)
    if off > OFF_FACE * strike.radius and (strike.point or tuple(strike.at) != MIDDLE):
        raise _off_face(scene, hit.point, faces)
    return hit


def _require_near(scene: Scene, body: Body, hit: Struck, point: Sequence[float]) -> None:
    """Raise InvalidScene for a point (3,) [m] that is many times as far from its face as the body
    is long."""
    off = min(body.distance(point, tag) for tag in hit.face.tags)
    if off > FAR_AWAY * np.linalg.norm(np.subtract(body.upper, body.lower)):
        raise InvalidScene(
            f"{scene.name}: strike.at = {np.round(point, 6).tolist()} m is {off:.3g} m away from "
            f"{scene.strike.on!r}; give a point on it, in m."
        )


def around(
    point: NDArray[np.float64], normal: NDArray[np.float64], radius: float, n: int = 4
) -> NDArray[np.float64]:
    """A point (3,) of a plane of this normal (3,) and n points of the circle of a radius [m] around
    it, (n + 1, 3) [m]."""
    angles = 2 * np.pi * np.arange(n) / n
    rim = np.column_stack([np.cos(angles), np.sin(angles)]) @ spanning(normal)
    return point + radius * np.vstack([np.zeros(3), rim])


def _off_face(scene: Scene, point: NDArray[np.float64], faces: Sequence[Face] = ()) -> InvalidScene:
    """The refusal of a patch at a point (3,) [m] that leaves its face, with where the faces end."""
    strike, extent = scene.strike, ""
    if faces:
        lower = np.min([face.lower for face in faces], axis=0)
        upper = np.max([face.upper for face in faces], axis=0)
        corners = [(np.round(corner, 6) + 0.0).tolist() for corner in (lower, upper)]
        extent = f"; it lies between {corners[0]} and {corners[1]} m"
    return InvalidScene(
        f"{scene.name}: strike.on = {strike.on!r}: the patch of radius {strike.radius:g} m at "
        f"{np.round(point, 6).tolist()} m leaves that face; move it by strike.at, or take a "
        f"smaller strike.radius{extent}."
    )


def surface(scene: Scene, mesh: Parts) -> rom.Contact | None:
    """Curvatures of the face struck, and modulus and Poisson's ratio if it is orthotropic: what
    Hertz' law needs besides the scene; None without a strike.

    Raises InvalidScene for a curved face of an orthotropic material.
    """
    if mesh.struck is None:
        return None
    made_of = mesh.materials[mesh.struck.face.body]
    require_known_law(scene, made_of, mesh.struck)
    contact = surface_of(made_of, mesh.struck.normal, mesh.struck.radii)
    if isinstance(made_of, fem.Orthotropic):
        return contact
    return rom.Contact(curvatures=contact.curvatures)


def require_known_law(
    scene: Scene, made_of: fem.Material | fem.Orthotropic, struck: Struck
) -> None:
    """Raise InvalidScene for a curved face of an orthotropic material."""
    if isinstance(made_of, fem.Orthotropic) and struck.normal is None:
        raise InvalidScene(
            f"{scene.name}: strike.on = {scene.strike.on!r} is a curved face of an orthotropic "
            "material, for which the contact's law is not known here; strike a plane face."
        )


def surface_of(
    made_of: fem.Material | fem.Orthotropic, normal: NDArray | None, radii: tuple[float, float]
) -> rom.Contact:
    """Curvatures (2,) [1/m], modulus [Pa] and Poisson's ratio of a face with a normal (3,) if it is
    plane and two radii [m].

    An orthotropic face counts as isotropic, with its indentation modulus along the normal and a
    Poisson's ratio of 0: contact depends on E / (1 - nu^2) alone.
    """
    if isinstance(made_of, fem.Orthotropic):
        return rom.Contact(young=fem.indentation_modulus(made_of, normal), poisson=0.0)
    curvatures = tuple(1 / radius for radius in radii)
    return rom.Contact(
        young=made_of.young,
        poisson=made_of.poisson,
        curvatures=curvatures if any(curvatures) else None,
    )


def patch(scene: Scene, mesh: Parts, model: fem.Model) -> fem.ContactPatch:
    """The patch on the mesh through which the contact force loads the body and its displacement is
    read; raises InvalidScene where it leaves the face."""
    return patch_on(scene, mesh.struck, STRIKE, model)


def patch_on(scene: Scene, face: Struck, name: str, model: fem.Model) -> fem.ContactPatch:
    """The patch of scene.strike on a face of this name in the mesh, as `patch`."""
    strike, at = scene.strike, scene.strike.at
    name = f"{face.face.body}:{name}"
    if face.radius is not None:
        surface = face.centre, abs(face.radius), face.axis
        at = fem.round_spot(model.structure, name, face.point, *surface)
    elif strike.point is not None:
        middle = fem.planar_spot(model.structure, name, MIDDLE)
        at = tuple(middle.axes @ (face.point - middle.point))
    if strike.nodes or strike.weights == "thesis":
        loaded = [at] if strike.weights == "thesis" else strike.nodes
        return fem.node_patch(model, name, loaded)
    try:
        return fem.contact_patch(model, name, at, strike.radius, weights=strike.weights)
    except OffFace:
        raise _off_face(scene, face.point) from None
    except ValueError as error:
        raise InvalidScene(f"{scene.name}: strike: {str(error).rstrip('.')}.") from None
