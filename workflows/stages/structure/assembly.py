"""The assembly's stages: mesh, joined model, modes, contact patch."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from beadwave import fem, rom
from beadwave.fem.assembly.model import ConstrainedModel, constrained
from beadwave.fem.contact.bolted_joint import rough_layer
from beadwave.fem.contact.preloaded_contact import OPEN
from beadwave.fem.contact.pressed_model import (
    PairInContact,
    PressedAssembly,
    pressed_assembly,
    pressed_model,
)
from beadwave.fem.modes.assembly_modes import AssemblyModes, assembly_modes
from beadwave.fem.updating import tuning
from beadwave.geometry.cad.contacts import joined_groups
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.scene.places import mass_face, spring_face
from beadwave.workflows.stages.structure import bodies, strike
from beadwave.workflows.stages.structure.meshed_parts import STRIKE, AdaptedSizes, Parts
from beadwave.workflows.stages.structure.targets import targets

OUTGROWN = 0.7  # of the reach of round faces, up to which gaps may close


def mesh(scene: Scene, adapted: AdaptedSizes | None = None) -> Parts:
    """The bodies meshed, and what joins and holds them, with the sizes for mesh.error where the
    scene asks for one."""
    return bodies.parts(scene) if adapted is None else bodies.parts(scene, adapted.sizes)


def model(scene: Scene, mesh: Parts, fits: dict[str, rom.ModalFit] | None = None) -> fem.Model:
    """The parts assembled, joined and held, with measured parts of these fits where they are
    another's; raises InvalidScene for bodies that nothing keeps."""
    if mesh.contacts:
        return pressed(scene, mesh, condensed_faces(scene, mesh, fits))
    structure, connections, constraints = _connected(scene, mesh, fits)
    joined = fem.joined(structure, connections, constraints)
    if mesh.load is None:
        return joined
    try:
        return fem.prestressed(joined, mesh.materials, mesh.load)
    except ValueError as why:
        raise InvalidScene(f"{scene.name}: loads: {str(why).rstrip('.')}.") from None


def _connected(
    scene: Scene, mesh: Parts, fits: dict[str, rom.ModalFit] | None
) -> tuple[fem.Structure, fem.Connections, ConstrainedModel]:
    """The structure with what it carries, its connections and their constraints; raises
    InvalidScene for bodies that nothing keeps."""
    structure = _with_masses(scene, mesh, fem.assemble(mesh.meshes, mesh.materials))
    structure = _with_springs(scene, mesh, _with_bolts(mesh, structure))
    if scene.measured:
        # only these scenes pay for the reader of tests
        from beadwave.workflows.stages.structure.measured_parts import with_parts

        structure = with_parts(scene, mesh, structure, fits)
    below = scene.table and fem.SwayingTable(scene.table.frequency, scene.table.mass)
    connections = mesh.connections._replace(table=below)
    constraints = constrained(structure, connections)
    _require_kept(scene, structure, connections, constraints, mesh.touching_alone)
    return structure, connections, constraints


def condensed_faces(
    scene: Scene, mesh: Parts, fits: dict[str, rom.ModalFit] | None = None
) -> PressedAssembly:
    """The assembly with the faces under bolts condensed, for any preload, friction and roughness;
    raises InvalidScene for faces that are refused, and for bodies that nothing keeps."""
    structure, connections, _ = _connected(scene, mesh, fits)
    open_model = fem.joined(structure, mesh.assembled._replace(table=connections.table))
    try:
        return pressed_assembly(open_model, mesh.materials, *_pressing(mesh))
    except ValueError as why:
        raise InvalidScene(f"{scene.name}: contact: {str(why).rstrip('.')}.") from None


def pressed(scene: Scene, mesh: Parts, assembly: PressedAssembly) -> fem.Model:
    """The model about its state under preload; raises InvalidScene where there is none."""
    try:
        model = pressed_model(assembly, *_pressing(mesh))
    except ValueError as why:
        raise InvalidScene(f"{scene.name}: contact: {str(why).rstrip('.')}.") from None

    # facets farther apart than this are next to those that were not looked at
    facets, on = model.contact.facets, model.contact.state != OPEN
    for i, (tie, faces) in enumerate(zip(mesh.contacts, mesh.in_contact, strict=True)):
        gaps = facets.gap[on & (facets.pair == i)]
        if faces.is_round and gaps.max(initial=0.0) > OUTGROWN * tie.gap:
            raise InvalidScene(
                f'{scene.name}: contact: "{faces.pair}" close where they were '
                f"{1e6 * gaps.max():.3g} um apart, and the faces were looked at up to "
                f"{1e6 * tie.gap:.3g} um; compute this load by itself, or fit the faces to each "
                "other."
            )
    return model


def _pressing(mesh: Parts) -> tuple[fem.Load, list[PairInContact]]:
    """The load with the bolts, and the faces that they press."""
    load = mesh.load or fem.Load()
    faces = []
    for tie, pair in zip(mesh.contacts, mesh.in_contact, strict=True):
        bolts = [(p.centre, p.stiffness.slipped.kx) for p in mesh.bolts_of(pair)]
        rough = rough_layer(pair.rms)[0]
        faces.append(PairInContact(tie, pair.friction, rough, bolts, pair.flatness, pair.least_gap))
    return load._replace(rods=[*load.rods, *mesh.rods]), faces


def _with_masses(scene: Scene, mesh: Parts, structure: fem.Structure) -> fem.Structure:
    """The structure with what its faces carry; raises InvalidScene for a disc that leaves its face,
    for a face that is not plane and for one that is held."""
    for table in scene.masses or ():
        face = mesh.face(mass_face(table.name))
        if _is_held(mesh, face):
            raise InvalidScene(
                f"{scene.name}: masses.{table.name}: on = {table.on!r} is held, a mass there does "
                "not move; choose a face that is free."
            )
        place = table.at, table.radius, table.mass, table.height, table.inertia or (0.0,) * 3
        try:
            structure = fem.with_carried(structure, [fem.CarriedMass(table.name, face, *place)])
        except ValueError as error:
            why = str(error).replace(face, table.on).rstrip(".")
            raise InvalidScene(f"{scene.name}: masses.{table.name}: {why}.") from None
    return structure


def _with_bolts(mesh: Parts, structure: fem.Structure) -> fem.Structure:
    """The structure with the masses of bolts, nuts and washers that are known from a drawing."""
    axes = {joint.first.face: joint.frame for joint in mesh.connections.joints}
    for place in mesh.bolted:
        for face, end, centre in place.fasteners:
            structure = fem.with_mass_on_face(
                structure, face, end.mass, end.inertia, centre, axes[place.faces[0]]
            )
    return structure


def _is_held(mesh: Parts, face: str) -> bool:
    """True if a face "body:face" is part of one that is held in all directions."""
    facets = set(mesh.facets(face).tolist())
    return any(
        facets <= set(mesh.facets(held.face).tolist())
        for held in mesh.connections.held
        if held.face.partition(":")[0] == face.partition(":")[0] and held.directions == "xyz"
    )


def _with_springs(scene: Scene, mesh: Parts, structure: fem.Structure) -> fem.Structure:
    """The structure with the springs between points of its faces and to the ground, "name.kx";
    raises InvalidScene for a disc that leaves its face and for a face that is not plane."""
    for table in scene.springs or ():
        faces = {mesh.face(spring_face(table.name, end)): getattr(table, end) for end in table.ends}
        on, *to = faces  # one to the ground has no second face
        if all(_is_held(mesh, face) for face in faces):
            raise InvalidScene(
                f"{scene.name}: springs.{table.name}: on = {table.on!r} is held, a spring from it "
                f"to {table.to!r} holds nothing; choose a face that is free."
            )

        # a spring of each stiffness at each place; without a far place that opposite is taken
        springs = []
        for i, at in enumerate(table.at):
            far = table.to_at[i] if table.to_at else None
            first = fem.SpringEnd(on, at, table.radius)
            second = fem.SpringEnd(to[0], far, table.radius) if to else None
            springs += [
                fem.PointSpring(
                    f"{table.name}.{key}", first, second, k, table.along(key), table.dashpots[key]
                )
                for key, k in table.stiffnesses.items()
            ]
        try:
            structure = fem.with_springs(structure, springs)
        except ValueError as error:
            why = str(error)
            for face, selector in faces.items():
                why = why.replace(face, selector)
            raise InvalidScene(f"{scene.name}: springs.{table.name}: {why.rstrip('.')}.") from None
    return structure


def _require_kept(
    scene: Scene,
    structure: fem.Structure,
    connections: fem.Connections,
    constraints: ConstrainedModel,
    touching: Sequence[tuple[str, str]] = (),
) -> None:
    """Raise InvalidScene for a body that can move. An assembly that floats may also move in the
    directions in which its joints are free, k = 0, and a body on joints that are free in all six
    where the reduction takes free modes. Bodies `touching` each other in contact without a bolt are
    kept by those that are."""
    loose = fem.loose_bodies(structure, connections, constraints)
    groups = joined_groups(structure.basis, touching)
    kept = {*structure.basis} - {body for body, _ in loose}
    loose = [
        one for one in loose if not kept & {*next(group for group in groups if one[0] in group)}
    ]
    if not loose:
        return

    # the first body that moves, and the springs of joints that were set free on purpose
    body, motions = loose[0]
    moves = f'{scene.name}: "{body}" can still move along or about {", ".join(motions)}, which '
    k = {
        f"joints.{name}.{key}": getattr(joint, key)
        for name, joint in scene.bushings.items()
        for key in fem.DIRECTIONS
    }
    free = [key for key, value in k.items() if value == 0]
    # free directions made rigid: a body that is held then is released by k = 0 alone
    closed = [
        joint._replace(springs=fem.Bushing(*(value or np.inf for value in joint.springs)))
        for joint in connections.joints
    ]
    if not free or fem.loose_bodies(structure, connections._replace(joints=closed)):
        raise InvalidScene(
            f"{moves}nothing keeps; tie it, bolt it, "
            f"{'give a spring a stiffness there, ' if scene.springs else ''}or hold a face of it."
            + ("" if scene.floats else " An assembly that floats says assembly.held = [].")
        )
    all_free = len(motions) == 6 and scene.reduction.kind == "free-modes"
    if not (scene.unsupported or all_free):
        raise InvalidScene(
            f"{moves}{' and '.join(f'{key} = 0' for key in free)} leaves free; give it a "
            "stiffness, or let the assembly float: assembly.held = [], of the rig assembly.parts = "
            '["block"].'
        )


def solid(scene: Scene, body: str) -> fem.Material | fem.Orthotropic:
    """Material of a body of the scene."""
    return bodies.material(scene.made_of(body))


def dashpots(scene: Scene, model: fem.Model):
    """C of the dashpots in joints and parallel to springs; None where there are none."""
    tables = {joint: table.dashpots for joint, table in scene.bushings.items()}
    named = {f"{joint}.{key}": c for joint, table in tables.items() for key, c in table.items()}
    return fem.dashpots(model, named) if scene.has_dashpots else None


def factor(scene: Scene, model: fem.Model) -> fem.Factor | None:
    """K's, for modes and reduction; None for an assembly that floats or nearly does."""
    return fem.held(model.K, model.M)


def modes(scene: Scene, model: fem.Model, space: rom.Space | None = None) -> AssemblyModes:
    """The lowest modes, the targets among them; from the assembly's Krylov space, where it has
    one."""
    known = None if space is None else fem.Modes(*space.modes)
    return assembly_modes(model, targets(scene, model), known=known)


def contact(scene: Scene, mesh: Parts, model: fem.Model) -> fem.ContactPatch:
    """The patch that loads and reads the body struck; of the thesis' scheme the node it loads.
    Raises InvalidScene without a strike, and where the patch leaves its face."""
    if scene.strike is None:
        raise InvalidScene(
            f"{scene.name}: [strike] is missing, which says where the chain touches; add "
            'on = "body:+x".'
        )
    return strike.patch(scene, mesh, model)


def participation(
    scene: Scene, contact: fem.ContactPatch, modes: AssemblyModes
) -> NDArray[np.float64]:
    """|w^T phi| (k,) [kg^-1/2] of the modes at the contact."""
    return np.abs(contact.w @ modes.phi)


def struck(scene: Scene) -> str:
    """The face that the chain leans on, as the mesh names it."""
    return f"{scene.struck_body}:{STRIKE}"


def tuning_basis(scene: Scene, model: fem.Model) -> tuning.TuningBasis:
    """The assembly projected on the shapes that joints can move."""
    return tuning.tuning_basis(model, targets(scene, model))
