"""Keys of the thesis' rig, as they are written, that are each allowed but not together, a sentence
each."""

from collections.abc import Iterator
from math import log, pi, prod

from beadwave.workflows.scene.rig import RigScene, boxes
from beadwave.workflows.scene.rules import size
from beadwave.workflows.scene.rules.bodies import without_assembly
from beadwave.workflows.scene.scene import Scene
from beadwave.workflows.scene.tables.joints import Joints
from beadwave.workflows.thesis import HAMMER_TEST

MIN_YOUNG = 1e6  # [Pa] of a body of finite elements, at least: rubber
SEED_OF = {"block": "block_seed", "sheet": "seed"}  # of all other bodies "support_seed"


def of_the_rig(scene: Scene) -> Iterator[str]:
    """Sentences on contradictions in a rig as it is written, before it is expanded into bodies."""
    yield from without_assembly(scene)
    modes = range(1, len(HAMMER_TEST["hz"]) + 1)
    numbers = [target.number for target in scene.targets or ()]
    if any(number not in modes or numbers.count(number) > 1 for number in numbers):
        yield (
            f"[[targets]] of the rig are its modes {modes[0]} to {modes[-1]}, each once, as "
            "number = 1 with hz; number the others so, or drop them."
        )

    # moduli: of the assembly, and of bodies with a material of their own
    bodies = {f"assembly.{name}": getattr(table, "young", None) for name, table in scene.assembly}
    for name, young in {"assembly": scene.assembly.young, **bodies}.items():
        if young is not None and young < MIN_YOUNG:
            yield (
                f"{name}.young = {young:g} Pa must be at least {MIN_YOUNG:g} Pa, that of rubber: "
                "softer bodies have too many modes; raise it."
            )

    # the patch lies on the block's +x face
    patch, sides = scene.patch, (scene.assembly.block_y, scene.assembly.block_z)
    if 2 * patch.radius >= min(sides):
        yield (
            f"patch.radius = {patch.radius} m must be below {min(sides) / 2:.6g} m to lie "
            "on the block's face; lower it."
        )
    else:
        for axis, at, side in zip("yz", patch.point, sides, strict=True):
            reach = side / 2 - patch.radius
            if abs(at) > reach:
                yield (
                    f"patch.point has {axis} = {at} m, allowed is up to {reach:.6g} m from the "
                    f"middle of the block's face for patch.radius = {patch.radius} m; move it."
                )
    half = (sides[0] / 2, sides[1] / 2)
    for point in patch.nodes or ():
        if any(abs(at) > reach for at, reach in zip(point, half, strict=True)):
            yield (
                f"patch.nodes has {list(point)}, allowed are y, z up to {half[0]:.6g} and "
                f"{half[1]:.6g} m from the middle of the block's face; move it."
            )

    # a dashpot acts on the elongation of a spring
    for joint, table in scene.joints or Joints():
        for key, coefficient in table.dashpots.items():
            if scene.assembly.constraint != "wires":
                yield (
                    f"joints.{joint}.c{key[1:]} = {coefficient} needs the joints of "
                    'assembly.constraint = "wires"; change one of them.'
                )
    yield from _too_fine(scene)


def _too_fine(scene: Scene) -> Iterator[str]:
    """Elements, modes and memory of the thesis' rig, from its dimensions."""
    a, mesh, reduction = scene.assembly, scene.mesh, scene.reduction
    block, *below = (prod(box.upper - box.lower) for box in boxes(a).values())  # [m^3]

    # hexahedra of each seed alone; at the contact they grow by this factor from one to the next
    length = a.head_overlap + a.sheet_free_length + a.foot_overlap
    elements = {
        "block_seed": block / mesh.block_seed**3,
        "seed": 2 * length * a.sheet_width / mesh.seed**2,
        "contact_seed": 4
        * (1 + log(max(1, mesh.block_seed / mesh.contact_seed), size.ELEMENT_GROWTH)) ** 3,
        "support_seed": sum(below) / mesh.support_seed**3,
    }
    for key, number in elements.items():
        if number > size.LIMITS.elements:
            yield (
                f"mesh.{key} = {getattr(mesh, key)} m makes {number:.1e} elements, allowed are "
                f"{size.LIMITS.elements:.0e}; take a larger one."
            )

    # modes of a solid below f: 4/3 pi V f^3 (1/c_L^3 + 2/c_T^3), the first term a tenth (Weyl)
    c_T = (a.young / (2 * (1 + a.poisson)) / a.density) ** 0.5
    highest = (size.LIMITS.modes * c_T**3 / (4 / 3 * pi * 2.2 * sum((block, *below)))) ** (1 / 3)
    for key in ("cutoff", "to_hz"):
        hz = getattr(reduction, key)
        if hz is not None and hz > highest:
            yield (
                f"reduction.{key} = {hz:g} Hz must be up to {highest:.3g} Hz, below which the "
                f"assembly has some {size.LIMITS.modes} modes; lower it."
            )

    # before the memory, which grows with the modes
    yield from size.too_many_modes(scene)
    whole = RigScene.of(scene)
    nodes = size.foreseen_nodes(whole)
    if not nodes:
        return
    needed, free = size.peak_memory(whole, nodes), size.free_memory()
    if needed > free:
        body = max(nodes, key=nodes.get).removesuffix("-y").removesuffix("+y")
        seed = SEED_OF.get(body, "support_seed")
        sides = [getattr(a, f"{body}_{axis}", None) for axis in "xyz"]
        lengths = "" if None in sides else f" ({' x '.join(map(str, sides))} m)"
        yield (
            f"the mesh of [assembly] would have {3 * sum(nodes.values()):.2g} unknowns, most of "
            f"them in the {body}{lengths} at mesh.{seed} = {getattr(mesh, seed)} m, and a run "
            f"would take {size.gigabytes(needed)} of memory, {size.gigabytes(free)} are free; take "
            "larger elements, or dimensions that fit."
        )
