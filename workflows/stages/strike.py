"""Where the chain touches an assembly of bodies: a point of a plane, a cylinder or a sphere."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

import fem
import rom
from fem.spot import require_flat, spanning
from fem.trace import OffFace
from geometry.struck import Struck, nearest, struck_at
from workflows.scene import InvalidScene, Scene
from workflows.stages.parts import STRIKE, Parts

FLAT = (0.0, 0.0)
RIM = 16  # points around a patch that are looked at
BESIDE = 0.02  # radii off the face that the patch on the mesh is to judge


def struck(scene: Scene, bodies: Mapping) -> Struck:
    """The face of the CAD model that the scene strikes; raises InvalidScene for one that no Hertz
    law is known of, or whose point is not told."""
    from geometry.selectors import faces

    picked = faces(scene.strike.on, bodies)
    found = [bodies[picked.body].face(tag) for tag in picked.tags]
    if scene.strike.point is None and all(face.normal is not None for face in found):
        middle = _from_the_middle(found, scene.strike.at)
        return _on_face(scene, bodies, Struck(picked, middle, normal=found[0].normal))
    near = scene.strike.point or scene.strike.selected_at
    if near is None:
        raise InvalidScene(
            f"{scene.name}: strike.on = {scene.strike.on!r} is no plane face, which has a middle; "
            "say where it is struck, at = [x, y, z] in m."
        )
    body = bodies[picked.body]
    first = nearest(found, body, near)
    if first.normal is None:
        _require_round(scene, first)
    hit = struck_at(body, found, first, near)
    if hit.normal is not None:
        return _on_face(scene, bodies, hit)
    hit = _on_round_face(scene, hit)
    if min(body.distance(hit.point, tag) for tag in hit.face.tags) > scene.strike.radius:
        raise _beside(scene, hit.point)
    return hit


def around(
    point: NDArray[np.float64], normal: NDArray[np.float64], radius: float, n: int = 4
) -> NDArray[np.float64]:
    """A point (3,) of a plane and n of the circle around it, (n + 1, 3) [m]."""
    angles = 2 * np.pi * np.arange(n) / n
    rim = np.column_stack([np.cos(angles), np.sin(angles)]) @ spanning(normal)
    return point + radius * np.vstack([np.zeros(3), rim])


def _on_face(scene: Scene, bodies: Mapping, found: Struck) -> Struck:
    """What is struck of a plane face; raises InvalidScene where the patch lies beside it. The
    middle is left to the mesh: a scan has it, of a face with a hole there too."""
    strike, away = scene.strike, bodies[found.face.body].distance
    points = around(found.point, found.normal, strike.radius, RIM)
    far = max(min(away(point, tag) for tag in found.face.tags) for point in points)
    if far > BESIDE * strike.radius and (strike.point or tuple(strike.at) != FLAT):
        raise _beside(scene, found.point)
    return found


def _beside(scene: Scene, point: NDArray[np.float64]) -> InvalidScene:
    strike = scene.strike
    return InvalidScene(
        f"{scene.name}: strike.on = {strike.on!r}: the patch of radius {strike.radius:g} m at "
        f"{np.round(point, 6).tolist()} m leaves that face; move it by strike.at, or take a "
        "smaller strike.radius."
    )


def _on_round_face(scene: Scene, found: Struck) -> Struck:
    """The point moved onto the face; raises InvalidScene where none is nearest, or the patch is
    large beside the radius."""
    if np.linalg.norm(found.away) < 1e-9:
        raise InvalidScene(
            f"{scene.name}: strike: {found.point.tolist()} m lies in the middle of "
            f"{scene.strike.on!r}: the struck side is not defined; move the point."
        )
    try:
        require_flat(found.radii, scene.strike.radius)
    except ValueError as error:
        raise InvalidScene(f"{scene.name}: strike.radius: {error}") from None
    return found._replace(point=found.foot)


def _from_the_middle(found: list, at: tuple[float, ...]) -> NDArray[np.float64]:
    lower = np.min([face.lower for face in found], axis=0)
    upper = np.max([face.upper for face in found], axis=0)
    return (lower + upper) / 2 + np.array(at) @ spanning(found[0].normal)


def _require_round(scene: Scene, face) -> None:
    """Raise InvalidScene for a face that is neither a plane nor round."""
    if face.kind not in ("cylinder", "sphere"):
        raise InvalidScene(
            f"{scene.name}: strike.on = {scene.strike.on!r} is a face of the kind {face.kind}; "
            "strike a plane, a cylinder or a sphere."
        )


def surface(scene: Scene, mesh: Parts) -> rom.Contact | None:
    """What the chain's Hertz law takes of the face struck that the scene does not say; raises
    InvalidScene for a curved face of an orthotropic material."""
    if mesh.struck is None:
        return None
    made_of = mesh.materials[mesh.struck.face.body]
    if isinstance(made_of, fem.Orthotropic) and mesh.struck.normal is None:
        raise InvalidScene(
            f"{scene.name}: strike.on = {scene.strike.on!r} is a curved face of an orthotropic "
            "material, for which the contact's law is not known here; strike a plane face."
        )
    known = surface_of(made_of, mesh.struck.normal, mesh.struck.radii)
    return (
        known if isinstance(made_of, fem.Orthotropic) else rom.Contact(curvatures=known.curvatures)
    )


def surface_of(
    made_of: fem.Material | fem.Orthotropic, normal: NDArray | None, radii: tuple[float, float]
) -> rom.Contact:
    """Curvatures, modulus and Poisson's ratio of a face; an orthotropic one is like an isotropic
    one of its indentation modulus and a Poisson's ratio of 0."""
    if isinstance(made_of, fem.Orthotropic):
        return rom.Contact(young=fem.indentation_modulus(made_of, normal), poisson=0.0)
    curvatures = tuple(1 / radius for radius in radii)
    return rom.Contact(
        young=made_of.young,
        poisson=made_of.poisson,
        curvatures=curvatures if any(curvatures) else None,
    )


def patch(scene: Scene, mesh: Parts, model: fem.Model) -> fem.ContactPatch:
    """What loads and reads the body struck; raises InvalidScene where it leaves the face."""
    strike, face, at = scene.strike, mesh.struck, scene.strike.at
    name = f"{face.face.body}:{STRIKE}"
    if face.radius is not None:
        near = face.point, face.centre, abs(face.radius), face.axis
        at = fem.round_spot(model.structure, name, *near)
    elif strike.point is not None:
        middle = fem.planar_spot(model.structure, name, FLAT)
        at = tuple(middle.axes @ (face.point - middle.point))
    try:
        return fem.contact_patch(model, name, at, strike.radius, weights=strike.weights)
    except OffFace:
        raise _beside(scene, face.point) from None
    except ValueError as error:
        raise InvalidScene(f"{scene.name}: strike: {str(error).rstrip('.')}.") from None
