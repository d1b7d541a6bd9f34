"""Keys of an assembly of bodies, and of what sits on it, that are each allowed but not together, a
sentence each."""

from collections import Counter
from collections.abc import Iterator
from math import inf
from re import split

from beadwave.workflows.scene.named_materials import NAMED, family
from beadwave.workflows.scene.rig import RigScene
from beadwave.workflows.scene.scene import Scene
from beadwave.workflows.scene.scene_table import nearest
from beadwave.workflows.scene.tables.bodies import GROUND, SHARE, THREAD, Bolts, General, Meshing
from beadwave.workflows.scene.tables.bolts import (
    ADVISED_UTILISATION,
    BREAKING_UTILISATION,
    CONTACT,
    TORQUE_FACTOR,
)

OF_BODIES = ("bodies", "materials", "ties", "strike", "loads")


def of_bodies(scene: Scene) -> Iterator[str]:
    """Sentences on contradictions in an assembly of bodies."""
    assembly, bodies = scene.assembly, scene.bodies or {}

    # where bodies come from: drawn here, a STEP file, a mesh with named volumes
    drawn_bodies = [name for name, body in bodies.items() if body.drawn]
    if assembly.file is None:
        if not drawn_bodies:
            yield (
                "the assembly has no bodies; give assembly.step or assembly.mesh, or "
                "[bodies.NAME] with a box."
            )
        for name in bodies.keys() - set(drawn_bodies):
            yield (
                f"bodies.{name} has no shape and there is no assembly.step or mesh to take it "
                "from; give it box, plate or cylinder."
            )
    if assembly.mesh is not None:
        if assembly.step:
            yield "assembly.step and assembly.mesh exclude each other; keep one of them."
        for name, body in bodies.items():
            if body.drawn or body.seed:
                key = body.drawn or "seed"
                yield (
                    f"bodies.{name}.{key} contradicts assembly.mesh, which has all elements; drop "
                    "it."
                )
        if scene.mesh.scale != 1.0 or scene.mesh.element != "hex":
            yield "[mesh] contradicts assembly.mesh, which has all elements; drop it."
    # a search for sizes; mesh.modes also says which errors are told of sizes from a file
    usual = Meshing()
    for key in ("modes", "unknowns"):
        value = getattr(scene.mesh, key)
        searched = scene.mesh.error or (key == "modes" and scene.mesh.sizes)
        if value != getattr(usual, key) and not searched:
            yield (
                f"mesh.{key} = {value} is of the search for a mesh with an error asked for, and "
                "none is; give mesh.error, or drop it."
            )
    if scene.mesh.simplify and not scene.mesh.error:
        yield (
            f"mesh.simplify = {scene.mesh.simplify:g} m leaves out features as a part of an error "
            "that is asked for, and none is; give mesh.error, or drop it."
        )
    if scene.mesh.simplify and scene.grids:
        yield (
            f"mesh.simplify = {scene.mesh.simplify:g} m leaves out features of bodies in the CAD "
            "kernel, and elements here have prescribed lines; drop it."
        )
    if scene.mesh.error or scene.mesh.sizes:
        chooses = "mesh.sizes" if scene.mesh.sizes else "mesh.error"
        if assembly.mesh is not None:
            of_mesh = "mesh.file" if isinstance(scene, RigScene) else "assembly.mesh"
            yield f"{chooses} contradicts {of_mesh}, which has all elements; drop one."
        if scene.mesh.scale != 1.0:
            yield (
                f"{chooses} and mesh.scale = {scene.mesh.scale:g} exclude each other: sizes of "
                f"elements follow from {chooses[5:]}; drop one."
            )
        if scene.strike and (scene.strike.nodes or scene.strike.weights == "thesis"):
            key = "nodes" if scene.strike.nodes else 'weights = "thesis"'
            yield (
                f"strike.{key} belongs to one mesh and {chooses} chooses others; drop one of them."
            )
    for key in ("volumes", "merge"):
        if assembly.mesh is None and getattr(assembly, key) is not None:
            yield f"assembly.{key} says how assembly.mesh is read, and there is none; drop it."

    # targets
    by_number = Counter(target.number for target in scene.targets or () if target.number)
    for number, times in by_number.items():
        if times > 1:
            yield f"targets has {times} tables of number = {number}; give each mode once."

    # materials
    materials = scene.materials or {}
    named = {"assembly": assembly.material}
    named |= {f"bodies.{name}": body.material for name, body in bodies.items()}
    for key, name in named.items():
        if name is not None and name not in materials:
            members = family(name)
            why = (
                f"names a family, known of it: {', '.join(members)}" if members
                else f"is not known, {nearest(name, {**materials, **NAMED})}"
            )  # fmt: skip
            yield (
                f"{key}.material = {name!r} {why}; take a known one, or describe it in "
                f"[materials.{name}]."
            )
    for name in bodies:
        if scene.material_name(name) is None:
            yield (
                f"nothing says what {name} is made of; give bodies.{name}.material, or "
                "assembly.material for all."
            )
    if assembly.file and assembly.material is None and not bodies:
        yield "assembly.material is missing; name the material of the bodies in the file."

    # supports, and the place struck
    if assembly.held is None and scene.floats:
        yield (
            'assembly.held is missing; name the faces on the ground, as ["foot:-z"], or write '
            "held = [] for an assembly that floats."
        )
    if scene.strike is None:
        if scene.chain is not None and getattr(scene.wall, "kind", None) == "rom":
            yield '[strike] is missing; say where the chain touches, on = "body:+x".'
    elif assembly.file is None and scene.struck_body not in bodies:
        yield f"strike.on = {scene.strike.on!r} names no body; there are {', '.join(bodies)}."

    yield from _joints(scene)
    yield from same_names(scene, "loads")
    if scene.loads and scene.floats:
        yield "loads act on an assembly that floats; hold a face of it, or drop them."
    if scene.patch is not None:
        yield "[patch] belongs to the thesis' rig; write [strike] with on, at and radius."


def of_bending(scene: Scene) -> Iterator[str]:
    """Sentences on contradictions in a scene with a beam or a plate."""
    if scene.bending is None:
        return
    body = scene.struck_body  # "beam" or "plate", as its table
    others = ("assembly", *(("plate",) if scene.beam else ()), *OF_BODIES)
    others += ("joints", "targets", "table", "mesh", "patch")
    for name in (name for name in others if getattr(scene, name) is not None):
        yield f"[{name}] contradicts [{body}], which is a structure of its own; drop one of them."
    for key, value in scene.bending.loads.items():
        if value and scene.floats:
            yield (
                f"{body}.{key} = {value:g} acts on a {body} that can move as a rigid body; set it "
                "to 0, or hold more of its edges."
            )
    if scene.floats and scene.reduction.kind == "craig-bampton":
        yield (
            f'reduction.kind = "craig-bampton" needs a {body} that is held; hold it, or take '
            '"free-modes".'
        )


def without_assembly(scene: Scene) -> Iterator[str]:
    """Sentences on tables that need an assembly of bodies, in a scene without one."""
    for name in (name for name in OF_BODIES if getattr(scene, name) is not None):
        yield (
            f"[{name}] belongs to an assembly of bodies; give [assembly] held = [...] and bodies, "
            f"or drop it."
        )
    if isinstance(scene.joints, tuple):
        yield "[[joints]] belong to an assembly of bodies; the rig has [joints.head] and foot."


def _joints(scene: Scene) -> Iterator[str]:
    """Names of joints, what each of them joins, and its dashpots."""
    if scene.joints is not None and not isinstance(scene.joints, tuple):
        yield "[joints.head] and foot belong to the thesis' rig; write [[joints]] with a name."
        return
    yield from same_names(scene, "joints")
    for joint in scene.joints or ():
        if joint.bolt is not None:
            yield from _bolt(joint)
        if joint.only_touches:
            yield from _faces_in_contact(scene, joint)
            continue
        if joint.at == THREAD:
            yield from _thread(joint)
        elif GROUND not in joint.partners:
            if joint.at != "holes" and joint.washer is None:
                yield f"joints.{joint.name}.washer is missing; give its radius around the points."
        elif joint.partners[1] != GROUND:
            yield f'joints.{joint.name}.between must end with the ground; write "body:hole|ground".'
        elif joint.at != "holes" or joint.washer is not None:
            yield (
                f"joints.{joint.name} holds the walls of holes to the ground; drop at and washer."
            )
        for key, coefficient in joint.dashpots.items():
            if getattr(joint, key) == inf:
                yield (
                    f"joints.{joint.name}.c{key[1:]} = {coefficient} is parallel to {key} = inf, "
                    f"which never moves; give joints.{joint.name}.{key}."
                )


def _bolt(joint: Bolts) -> Iterator[str]:
    """A bolt with head and nut goes through holes, and holds discs about them."""
    if GROUND in joint.partners or joint.at != "holes":
        yield (
            f"joints.{joint.name}.bolt needs holes through both bodies, from which it has its "
            'grip; join two bodies at = "holes", or give the springs in place of the bolt.'
        )
    if joint.washer == SHARE:
        yield (
            f'joints.{joint.name}.washer = "share" contradicts its bolt, which holds the foot of '
            "its pressure cone; drop washer, or give a radius."
        )
    if joint.frame != "normal":
        yield (
            f'joints.{joint.name}.frame = "{joint.frame}" contradicts its bolt, whose springs are '
            "along and across it; drop frame."
        )
    if joint.utilisation > BREAKING_UTILISATION:
        force, d = ADVISED_UTILISATION * joint.fastener.proof_load, joint.fastener.diameter
        if joint.torque is None:
            given, most = f"preload = {joint.preload:g} N", f"{force / 1e3:.3g} kN"
        else:
            given = f"torque = {joint.torque:g} N m, a preload of {joint.tension / 1e3:.3g} kN,"
            most = f"{TORQUE_FACTOR * d * force:.3g} N m"
        yield (
            f"joints.{joint.name}.{given} is {joint.utilisation:.3g} times the proof load of its "
            f"bolt {joint.bolt_name}, which would break: none bears more than "
            f"{BREAKING_UTILISATION:g} times; take {most} at most, or a stronger bolt."
        )


def _faces_in_contact(scene: Scene, joint: Bolts) -> Iterator[str]:
    """Faces in contact without a bolt of their own are two bodies', which something presses."""
    if GROUND in joint.partners:
        yield (
            f"joints.{joint.name}.between = {joint.between!r}: the ground has no face to be in "
            "contact with; draw it as a body and hold it."
        )
    given = [key for key in ("at", "washer", "sides", "frame") if key in joint.model_fields_set]
    given = [key for key in given if getattr(joint, key) != type(joint).model_fields[key].default]
    if given:
        yield (
            f"joints.{joint.name}.{given[0]} belongs to bolts, and faces in contact without one "
            f"have none; drop {given[0]}, or name the bolt."
        )
    pressed = scene.loads or any(j.bolt and j.model == CONTACT for j in scene.joints)
    if not pressed:
        yield (
            f"joints.{joint.name}: nothing presses the faces on each other; give a bolt with its "
            'preload in a joint of model = "contact", or [[loads]].'
        )


def _thread(joint: Bolts) -> Iterator[str]:
    """A thread joins a shank and a bore, over the length that both have."""
    if GROUND in joint.partners:
        yield (
            f'joints.{joint.name}.at = "thread" joins a shank and a bore, the ground has neither; '
            f'write between = "bolt|nut", or drop at to hold the walls of holes.'
        )
    if joint.washer is not None:
        yield (
            f'joints.{joint.name}.washer = {joint.washer} contradicts at = "thread", which holds '
            "the cylinders that bolt and nut have in common; drop washer."
        )
    if joint.sides != ("mean", "mean"):
        yield (
            f'joints.{joint.name}.sides = {list(joint.sides)} contradicts at = "thread", whose '
            'sides both move by their mean; drop sides, or write ["mean", "mean"].'
        )


def of_masses(scene: Scene) -> Iterator[str]:
    """Sentences on contradictions between masses and the rest of a scene."""
    if scene.masses and scene.assembly is None:
        yield "[[masses]] sit on faces of an [assembly]; add one, or drop them."
    yield from same_names(scene, "masses")


def of_springs(scene: Scene) -> Iterator[str]:
    """Sentences on contradictions between springs and the rest of a scene."""
    if scene.springs and scene.assembly is None:
        yield "[[springs]] sit on faces of an [assembly]; add one, or drop them."
    for spring in scene.springs or ():
        for end in spring.ends:
            key = f"springs.{spring.name}.{end}"
            yield from no_such_body(scene, key, getattr(spring, end))
    yield from same_names(scene, "springs")


def of_measured(scene: Scene) -> Iterator[str]:
    """Sentences on contradictions between measured parts and the rest of a scene."""
    if scene.measured and scene.assembly is None:
        yield "[[measured]] are joined to faces of an [assembly]; add one, or drop them."
    for part in scene.measured or ():
        yield from no_such_body(scene, f"measured.{part.name}.on", part.on)
    yield from same_names(scene, "measured")


def same_names(scene: Scene, table: str) -> Iterator[str]:
    """Sentences on tables of one kind, "joints", that have the same name."""
    for name, number in Counter(row.name for row in getattr(scene, table) or ()).items():
        if number > 1:
            yield f"{table} has {number} tables named {name!r}; give each a name of its own."


def no_such_body(scene: Scene, key: str, selector: str) -> Iterator[str]:
    """A sentence on a selector whose body is not among those that the scene draws."""
    drawn = isinstance(scene.assembly, General) and not scene.assembly.file
    if drawn and split("[:@]", selector)[0] not in (scene.bodies or {}):
        bodies = ", ".join(scene.bodies or {})
        yield f"{key} = {selector!r} names no body; there are {bodies}."


def of_test_axes(scene: Scene) -> Iterator[str]:
    """Sentences on contradictions between the axes of a test and the rest of a scene."""
    if scene.test_axes and scene.assembly is None:
        yield "[test_axes] lie on an [assembly]; add one, or drop them."
