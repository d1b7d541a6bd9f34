"""Keys of an assembly of bodies that are each allowed but not together, a sentence each."""

from collections import Counter
from collections.abc import Iterator
from math import isinf

from workflows.scene.bodies import GROUND, THREAD
from workflows.scene.scene import Scene

OF_BODIES = ("bodies", "materials", "ties", "strike", "loads")


def of_bodies(scene: Scene) -> Iterator[str]:
    """What speaks against an assembly of bodies."""
    yield from _nothing_there(scene)
    yield from _own_mesh(scene)
    yield from _unknown_materials(scene)
    yield from _unheld(scene)
    yield from _unstruck(scene)
    yield from _joints(scene)
    yield from _loads(scene)
    if scene.patch is not None:
        yield "[patch] belongs to the thesis' rig; write [strike] with on, at and radius."


def of_bending(scene: Scene) -> Iterator[str]:
    """What speaks against a beam or a plate."""
    if scene.bending is None:
        return
    own = scene.struck_body
    others = (
        "assembly",
        *(("plate",) if scene.beam else ()),
        *OF_BODIES,
        "joints",
        "targets",
        "table",
        "mesh",
        "patch",
    )
    for name in (name for name in others if getattr(scene, name) is not None):
        yield f"[{name}] is beside [{own}], which is a structure of its own; drop one of them."
    for key, value in scene.bending.loads.items():
        if value and scene.floats:
            yield (
                f"{own}.{key} = {value:g} acts on a {own} that can move as a rigid body; set it to "
                "0, or hold more of its edges."
            )
    if scene.floats and scene.reduction.kind == "craig-bampton":
        yield (
            f'reduction.kind = "craig-bampton" needs a {own} that is held; hold it, or take '
            '"free-modes".'
        )


def of_the_rig(scene: Scene) -> Iterator[str]:
    """Tables that need an assembly of bodies, in a scene that has none."""
    for name in (name for name in OF_BODIES if getattr(scene, name) is not None):
        yield (
            f"[{name}] belongs to an assembly of bodies; give [assembly] held = [...] and bodies, "
            f"or drop it."
        )
    known, told = range(1, len(scene.measured_hz) + 1), [t.number for t in scene.targets or ()]
    if any(number not in known or told.count(number) > 1 for number in told):
        yield (
            f"[[targets]] of the rig are its modes {known[0]} to {known[-1]}, each once, as "
            "number = 1 with hz; number the others so, or drop them."
        )
    if isinstance(scene.joints, tuple):
        yield "[[joints]] belong to an assembly of bodies; the rig has [joints.head] and foot."


def _nothing_there(scene: Scene):
    drawn = [name for name, body in (scene.bodies or {}).items() if body.drawn]
    if scene.assembly.file is None:
        if not drawn:
            yield (
                "the assembly has no bodies; give assembly.step or assembly.mesh, or "
                "[bodies.NAME] with a box."
            )
        for name in (scene.bodies or {}).keys() - set(drawn):
            yield (
                f"bodies.{name} has no shape and there is no assembly.step or mesh to take it "
                "from; give it box, plate or cylinder."
            )


def _own_mesh(scene: Scene):
    """What a mesh that is there leaves no room for."""
    if scene.assembly.mesh is None:
        return
    if scene.assembly.step:
        yield "assembly.step and assembly.mesh exclude each other; keep one of them."
    for name, body in (scene.bodies or {}).items():
        if body.drawn or body.seed:
            key = body.drawn or "seed"
            yield f"bodies.{name}.{key} is beside assembly.mesh, which has all elements; drop it."
    if scene.mesh.scale != 1.0 or scene.mesh.element != "hex":
        yield "[mesh] is beside assembly.mesh, which has all elements; drop it."


def _unknown_materials(scene: Scene):
    known = scene.materials or {}
    used = {f"bodies.{name}": body.material for name, body in (scene.bodies or {}).items()}
    for key, name in {"assembly": scene.assembly.material, **used}.items():
        if name is not None and name not in known:
            there = ", ".join(known) or "none"
            yield f"{key}.material = {name!r} is not known, there is {there}; add it."
    for name in scene.bodies or {}:
        if scene.material_name(name) is None:
            yield (
                f"nothing says what {name} is made of; give bodies.{name}.material, or "
                "assembly.material for all."
            )
    if scene.assembly.file and scene.assembly.material is None and not scene.bodies:
        yield "assembly.material is missing; name the material of the bodies in the file."


def _unheld(scene: Scene):
    if scene.assembly.held is None and scene.floats:
        yield (
            'assembly.held is missing; name the faces on the ground, as ["foot:-z"], or write '
            "held = [] for an assembly that floats."
        )


def _unstruck(scene: Scene):
    if scene.strike is None:
        if scene.chain is not None and getattr(scene.wall, "kind", None) == "rom":
            yield '[strike] is missing; say where the chain touches, on = "body:+x".'
        return
    body = scene.struck_body
    if scene.assembly.file is None and body not in (scene.bodies or {}):
        known = ", ".join(scene.bodies or {})
        yield f"strike.on = {scene.strike.on!r} names no body; there are {known}."


def _joints(scene: Scene):
    if scene.joints is not None and not isinstance(scene.joints, tuple):
        yield "[joints.head] and foot belong to the thesis' rig; write [[joints]] with a name."
        return
    for name, number in Counter(joint.name for joint in scene.joints or ()).items():
        if number > 1:
            yield f"joints has {number} tables named {name!r}; give each a name of its own."
    for joint in scene.joints or ():
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
        yield from _rigid_dashpots(joint)


def _thread(joint):
    if GROUND in joint.partners:
        yield (
            f'joints.{joint.name}.at = "thread" joins a shank and a bore, the ground has neither; '
            f'write between = "bolt|nut", or drop at to hold the walls of holes.'
        )
    if joint.washer is not None:
        yield (
            f'joints.{joint.name}.washer = {joint.washer} is beside at = "thread", which holds the '
            "cylinders that bolt and nut have in common; drop washer."
        )
    if joint.sides != ("mean", "mean"):
        yield (
            f'joints.{joint.name}.sides = {list(joint.sides)} is beside at = "thread", whose sides '
            'both move by their mean; drop sides, or write ["mean", "mean"].'
        )


def _loads(scene: Scene):
    for name, number in Counter(load.name for load in scene.loads or ()).items():
        if number > 1:
            yield f"loads has {number} tables named {name!r}; give each a name of its own."
    if scene.loads and scene.floats:
        yield "loads act on an assembly that floats; hold a face of it, or drop them."


def _rigid_dashpots(joint):
    for key in joint.dashpots:
        if isinf(getattr(joint, key)):
            yield (
                f"joints.{joint.name}.c{key[1:]} = {joint.dashpots[key]} is beside {key} = inf, "
                f"which never moves; give joints.{joint.name}.{key}."
            )
