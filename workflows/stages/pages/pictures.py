"""The stage that renders meshes and modes, in a child process.

Where no graphics library is installed, pyvista ends its process with a segmentation fault, which no
`try` can catch.
"""

from collections.abc import Iterator, Mapping
from json import dumps
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray
from skfem import Mesh

from beadwave import fem
from beadwave.fem.contact.impact_point import SurfacePoint, plane_spot
from beadwave.fem.modes import mode_field as field_file
from beadwave.fem.modes.assembly_modes import AssemblyModes
from beadwave.geometry.cad.struck_face import Struck
from beadwave.workflows.files.child import child
from beadwave.workflows.files.run_folder import NoPicture, Picture
from beadwave.workflows.scene import Scene
from beadwave.workflows.scene.places import mass_face, part_face, spring_face
from beadwave.workflows.scene.tables.bodies import GROUND
from beadwave.workflows.stages.errors.mesh_error import MeshErrorEstimate
from beadwave.workflows.stages.structure.bodies import Placed
from beadwave.workflows.stages.structure.meshed_parts import Parts

TIME_LIMIT = 120  # s, of the child; not varied
REASON = 200  # characters that are shown of what the child says last


def pictures(
    scene: Scene,
    mesh: Parts,
    modes: AssemblyModes,
    contact: fem.ContactPatch,
    missed: MeshErrorEstimate,
) -> tuple[Picture, ...]:
    """Pictures of the meshed assembly with what strikes, joins and holds it, of four modes, and of
    where the error of the mesh arises; raises NoPicture."""
    shown = fixtures(scene, mesh)
    if not scene.chains:
        shown["strike"] = _struck(contact)
    if missed.of_cells:
        shown["missed"] = np.concatenate([missed.of_cells[b] for b in modes.field.meshes]).tolist()
    return _rendered(modes.field, shown)


def pictures_of_plate(
    scene: Scene, modes: AssemblyModes, contact: fem.ContactPatch
) -> tuple[Picture, ...]:
    """Pictures of a beam or a plate with the impact, and of four modes; raises NoPicture."""
    return _rendered(modes.field, {"strike": _struck(contact)})


def _struck(contact: fem.ContactPatch) -> list[float]:
    """The point struck and the direction of the force (6,)."""
    return [float(x) for x in (*contact.spot.point, *contact.spot.inward)]


def picture_of_parts(scene: Scene, mesh: Parts) -> Picture:
    """Picture of the meshed assembly with the chain, and what joins and holds it; raises
    NoPicture."""
    return picture_of(mesh.meshes, fixtures(scene, mesh, spheres=True))


def picture_of(meshes: dict[str, Mesh], shown: dict[str, Any]) -> Picture:
    """Picture of the meshes of bodies, or of their surfaces, each in a colour, with the fixtures
    shown; raises NoPicture."""
    return _rendered(_at_rest(meshes), shown)[0]


def fixtures_of_faces(
    scene: Scene, chosen: Placed, triangles: Mapping[str, Mapping[int, NDArray[np.float64]]]
) -> dict[str, Any]:
    """Chain, joints and held faces of bodies that are not meshed, from the triangles of their faces
    by body and tag."""
    places, held = chosen.selection.joints, []
    for i, _ in enumerate(scene.assembly.holds, start=1):
        face = chosen.selection.faces[f"held-{i}"]
        held += [corners for tag in face.tags for corners in triangles[face.body][tag].tolist()]
    return {
        **_impacts(scene, chosen, spheres=True),
        "joints": [(place.joint, place.centre.tolist(), place.axis.tolist()) for place in places],
        "held": held,
    }


def _impacts(scene: Scene, chosen: Placed | Parts, *, spheres: bool) -> dict[str, Any]:
    """The place that the chain strikes, or each of several, with the radii [m] of the spheres from
    the last one on if they are asked for."""
    hits = [chosen.struck_by_chains[row.name] for row in scene.chains or ()]
    hits = hits or ([] if chosen.struck is None else [chosen.struck])
    if not hits:
        return {}
    radii: list[list[float]] = [[] for _ in hits]
    if spheres and (scene.chain or scene.chains):
        alone = [scene] if scene.chain else scene.of_each_chain.values()
        radii = [np.broadcast_to(one.chain.radius, one.chain.count)[::-1].tolist() for one in alone]
    (strike, of_first), *further = zip(map(_hit, hits), radii, strict=True)
    return {"strike": strike, "spheres": of_first, "further": further}


def _hit(struck: Struck) -> list[float]:
    """The point struck and the direction of the force (6,)."""
    inward = -struck.outward / np.linalg.norm(struck.outward)
    return [*struck.point.tolist(), *inward.tolist()]


def fixtures(scene: Scene, mesh: Parts, *, spheres: bool = False) -> dict[str, Any]:
    """Things that `report.render` draws besides the meshes, for JSON."""
    joints = []
    for joint in mesh.connections.joints:
        corners = np.concatenate(_facets(mesh, joint.first.face))
        # along the normal of a plane face, along the joint's z of another, as of a bore
        _, spread, axes = np.linalg.svd(corners - corners.mean(axis=0), full_matrices=False)
        axis = axes[2] if spread[2] < 1e-6 * spread[0] else joint.frame[2]
        joints.append((joint.name, joint.centre.tolist(), axis.tolist()))
    return {
        **_impacts(scene, mesh, spheres=spheres),
        "joints": joints,
        "held": [
            facet.tolist() for side in mesh.connections.held for facet in _facets(mesh, side.face)
        ],
        "springs": [*_springs(scene, mesh)],
        "parts": [*_parts(scene, mesh)],
        "masses": [*_masses(scene, mesh)],
    }


def _springs(scene: Scene, mesh: Parts) -> Iterator[tuple[str, list[float], list[float], bool]]:
    """Each spring between points: its name, where it begins (3,) [m], and where it ends or, of one
    to the ground, the direction (3,) in which it leaves; whether that is the ground. A spring that
    a run refuses is left out."""
    for table in scene.springs or ():
        for i, at in enumerate(table.at):
            first = _spot(mesh, spring_face(table.name, "on"), at)
            if first is None:
                continue
            if table.to == GROUND:
                # along its direction, out of the body; of several stiffnesses along the normal
                (key, *others) = table.stiffnesses
                along = "normal" if others else table.along(key)
                outward = -first.inward
                d = outward if along == "normal" else np.array(along) / np.linalg.norm(along)
                d = d if d @ outward >= 0 else -d
                yield table.name, first.point.tolist(), d.tolist(), True
                continue
            face = spring_face(table.name, "to")
            far = _spot(mesh, face, table.to_at[i] if table.to_at else (0.0, 0.0))
            if far is not None and not table.to_at:  # the point opposite
                away = far.axes @ (first.point - far.point)
                far = far._replace(point=far.point + away @ far.axes)
            if far is not None:
                yield table.name, first.point.tolist(), far.point.tolist(), False


def _parts(scene: Scene, mesh: Parts) -> Iterator[tuple[str, list[float], list[float]]]:
    """Each point of a measured part: the part's name, and that it is SYNTHETIC where it is, where
    the point is (3,) [m], and the direction (3,) out of the body. A part that a run refuses is left
    out."""
    if not scene.measured:
        return
    # only these scenes pay for the reader of tests
    from beadwave.workflows.files.part_receptances import receptances
    from beadwave.workflows.stages.structure.measured_parts import places_on_face

    for table in scene.measured:
        spot = _spot(mesh, part_face(table.name), (0.0, 0.0))
        if spot is None:
            continue
        try:
            part = receptances(table)
            places = places_on_face(scene, table, spot, part)
        except ValueError:
            continue
        for at in places.values():
            point = _spot(mesh, part_face(table.name), tuple(at.tolist())).point
            name = f"{table.name}, SYNTHETIC" if part.synthetic else table.name
            yield name, point.tolist(), (-spot.inward).tolist()


def _masses(scene: Scene, mesh: Parts) -> Iterator[tuple[str, list[float], list[float], float]]:
    """Each mass on a face: its name, its point (3,) [m], the direction (3,) out of the body, and
    the radius [m] of its disc. One that a run refuses is left out."""
    for table in scene.masses or ():
        spot = _spot(mesh, mass_face(table.name), table.at)
        if spot is not None:
            yield table.name, spot.point.tolist(), (-spot.inward).tolist(), table.radius


def _spot(mesh: Parts, name: str, at: tuple[float, float]) -> SurfacePoint | None:
    """The spot on a named plane face; None on one that is not plane."""
    face = mesh.face(name)
    try:
        return plane_spot(mesh.meshes[face.partition(":")[0]], mesh.facets(face), face, at)
    except ValueError:
        return None


def _facets(mesh: Parts, name: str) -> NDArray[np.float64]:
    """Corners (n_facets, 3 or 4, 3) [m] of a face "body:face"."""
    skin = mesh.meshes[name.partition(":")[0]]
    return skin.p[:, skin.facets[:, mesh.facets(name)]].transpose(2, 1, 0)


def _at_rest(meshes: dict[str, Mesh]) -> field_file.ModeField:
    nothing = np.empty(0)
    return field_file.ModeField(meshes, *(nothing,) * 4)


def _rendered(modes: field_file.ModeField, shown: dict[str, Any]) -> tuple[Picture, ...]:
    """Pictures of assembly and modes with the fixtures shown, rendered by a child; raises
    NoPicture."""
    fixtures_of = {"bodies": [*modes.meshes]} | shown
    names = "assembly", "modes", *(("mesh-error",) if "missed" in shown else ())
    return rendered("beadwave.workflows.report.render", modes, fixtures_of, *names)


def rendered(
    module: str, modes: field_file.ModeField, content: Any, *names: str
) -> tuple[Picture, ...]:
    """Pictures of these names that a child draws, `python -m module modes.vtu content.json
    NAME.png ...`; raises NoPicture."""
    with TemporaryDirectory() as folder:
        field, json = Path(folder, "modes.vtu"), Path(folder, "content.json")
        field_file.write(field, modes)
        json.write_text(dumps(content), encoding="utf-8", newline="\n")
        images = [Path(folder) / f"{name}.png" for name in names]
        drawn = " and ".join(names)
        try:
            process = child(module, *map(str, (field, json, *images)), seconds=TIME_LIMIT)
        except TimeoutError:
            raise NoPicture(
                f"{drawn} were not rendered within {TIME_LIMIT} s; the rest is complete."
            ) from None
        if process.returncode != 0:
            said = process.stderr.decode(errors="replace").strip().rpartition("\n")[2]
            reason = f" It says {said[:REASON]!r}." if said else ""
            raise NoPicture(
                f"{drawn} could not be rendered, the rest is complete; install an "
                "off-screen GL library (Debian: apt-get install libgl1 libosmesa6) and run again."
                f"{reason}"
            )
        return tuple(Picture(image.stem, image.read_bytes()) for image in images)
