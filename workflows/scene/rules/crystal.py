"""Keys of a crystal that are each allowed but not together, a sentence each."""

from collections.abc import Iterator
from pathlib import Path

from beadwave.system import free_memory
from beadwave.workflows.scene.named_files import unfit
from beadwave.workflows.scene.rules.size import LIMITS, gigabytes
from beadwave.workflows.scene.scene import Scene
from beadwave.workflows.scene.tables.bodies import General
from beadwave.workflows.scene.tables.contact import CIRCULAR
from beadwave.workflows.scene.tables.walls import HalfSpaceWall, OneDofWall, RigidWall

# tables of a chain, or of what it strikes, that a crystal does not take
OTHERS = (
    "chain", "striker", "leaf_springs", "guides", "preload", "arm", "shakers",
)  # fmt: skip
STANDING = ("square", "sc")  # lattices whose rows stand on each other without sides
MOST_CONTACTS = 300  # of a last row on a structure, each of one or three columns
MOST_SPHERES = 200_000  # of a crystal: a million contacts, some hours
SPHERE_BYTES = 48 + 24 + 24  # of a saved instant of a sphere: its state, its contacts' forces
MARCHES = 2  # in memory at once: the coarser one and the finer one


def of_crystal(scene: Scene) -> Iterator[str]:
    """Sentences on contradictions between [crystal] and the rest of a scene."""
    crystal, contact = scene.crystal, scene.contact
    for name in OTHERS:
        if getattr(scene, name) is not None:
            yield f"[{name}] is of a chain, [crystal] has none; drop one of them."
    yield from _of_structure(scene)
    if not isinstance(scene.wall, None | RigidWall | HalfSpaceWall | OneDofWall):
        yield (
            f'wall.kind = "{scene.wall.kind}" is not behind a [crystal]; take "rigid", '
            '"half-space" or "1dof", or leave it free without [wall].'
        )
    if contact.law not in CIRCULAR:
        yield f'contact.law = "{contact.law}" is not of a [crystal]; take {" or ".join(CIRCULAR)}.'
    for key in ("coefficient", "stiffness_factor", "yield_pressure"):
        if isinstance(getattr(contact, key), tuple):
            yield f"contact.{key} is a list, a [crystal] takes one value for all; give one."
    if scene.output.sensors:
        yield "output.sensors are of a [chain]; drop them, trajectory.npz has every sphere."

    for key in ("nodes", "links"):
        file = getattr(crystal, key)
        if file and (why := unfit(Path(file))):
            yield f"crystal.{key} = {file!r} {why}; give a CSV."
    if crystal.nodes is None:
        yield from _of_lattice(scene)
    elif crystal.sides != "free" or crystal.scatter:
        key = "scatter" if crystal.scatter else "sides"
        yield f"crystal.{key} is of a lattice, crystal.nodes is a network; drop it."
    if crystal.nodes and scene.wall is not None:
        yield "[wall] is behind the last row of a lattice, which a network has not; drop it."
    weight = bool(scene.gravity and scene.gravity.along)
    if weight and scene.gravity.along < 0.0:
        yield (
            f"gravity.inclination = {scene.gravity.inclination:g} lets a crystal fall off its "
            "wall; take an angle above 0."
        )
    if weight and (crystal.nodes or crystal.lattice == "y"):
        yield "[gravity] is of a lattice before a [wall], which this crystal is not; drop it."
    elif weight and scene.wall is None:
        yield "[gravity] needs a [wall] that carries the crystal; add one."
    elif weight and crystal.sides == "free" and crystal.lattice not in STANDING:
        yield (
            f'[gravity] presses a {crystal.lattice} packing apart with sides = "free"; take sides '
            '= "periodic" or "rigid".'
        )
    if scene.friction and scene.friction.upstream != "free":
        yield "friction.upstream is of a [chain]; drop it."
    pressed = [key for key in ("precompression", "force") if getattr(crystal, key) is not None]
    if len(pressed) > 1:
        yield "crystal.precompression and crystal.force exclude each other: keep one of them."
    if pressed and (crystal.nodes or crystal.lattice == "y"):
        yield f"crystal.{pressed[0]} is of a lattice, which this crystal is not; drop it."
    elif pressed and scene.wall is None:
        yield f"crystal.{pressed[0]} needs a [wall] that it presses against; add one."
    elif pressed and crystal.sides == "free" and crystal.lattice not in STANDING:
        yield (
            f'crystal.{pressed[0]} presses a {crystal.lattice} packing apart with sides = "free"; '
            'take sides = "periodic" or "rigid".'
        )
    if crystal.drive and (why := unfit(Path(crystal.drive.file))):
        yield f"crystal.drive.file = {crystal.drive.file!r} {why}; give a CSV."
    if crystal.drive and crystal.nodes is None and crystal.lattice == "y" and not crystal.drive.at:
        yield "crystal.drive of a y is of one sphere; give at."
    if crystal.striker is None and crystal.drive is None:
        yield "nothing moves; add crystal.striker with a velocity, or crystal.drive."


def _of_structure(scene: Scene) -> Iterator[str]:
    """A structure behind the last row."""
    crystal = scene.crystal
    if crystal.on is None:
        if scene.has_structure:
            yield (
                "[crystal] leans on no structure; say where by crystal.on, as 'block:+x', or drop "
                "[assembly], [beam] or [plate]."
            )
        if tuple(crystal.at) != (0.0, 0.0):
            yield "crystal.at is of the face that crystal.on names; add it, or drop crystal.at."
        return
    if not isinstance(scene.assembly, General):
        yield (
            f"crystal.on = {crystal.on!r} is a face of bodies; add [assembly] with "
            "[bodies.NAME], which the thesis' rig, [beam] and [plate] are not."
        )
        return
    if scene.wall is not None:
        yield "[wall] and crystal.on are both behind the last row; drop one."
    if crystal.nodes or crystal.lattice == "y":
        yield "crystal.on is behind the last row of a lattice, which this crystal has not; drop it."
    if crystal.sides == "periodic":
        yield 'crystal.sides = "periodic" has no end on a face; take "free" or "rigid".'
    if crystal.precompression or crystal.force or (scene.gravity and scene.gravity.along):
        yield (
            "a crystal before a structure starts without a load; drop crystal.precompression, "
            "crystal.force or [gravity]."
        )
    if scene.contact.law == "thornton":
        yield 'contact.law = "thornton" is not marched before a structure; take "hertz".'
    if scene.mesh.error:
        yield "mesh.error is of one [chain]; give mesh.scale, or the sizes of elements."
    if scene.has_dashpots:
        yield "crystal.on is not marched with dashpots and [[measured]] parts; drop these."
    if crystal.radius and crystal.patch_radius > crystal.radius:
        yield (
            f"crystal.patch_radius = {crystal.patch_radius:g} m must be up to crystal.radius = "
            f"{crystal.radius:g} m, or patches overlap; lower it."
        )
    columns = 1
    for count in crystal.size[:-1] if crystal.size else ():
        columns *= count
    if columns > MOST_CONTACTS:
        yield (
            f"crystal.size = {list(crystal.size)} has a last row of {columns} spheres, allowed on "
            f"a structure are {MOST_CONTACTS}, as each feels every other; take fewer columns."
        )
    if scene.reduction.kind != "free-modes" or scene.reduction.error is None:
        yield (
            "a crystal's contacts are reduced to one error together; give reduction.kind = "
            '"free-modes" and reduction.error.'
        )


def _of_lattice(scene: Scene) -> Iterator[str]:
    """Sizes and places of a lattice, and the memory that its run takes."""
    crystal = scene.crystal
    size, n = crystal.size, crystal.n_sites
    if len(size) != crystal.dimensions:
        yield (
            f"crystal.size = {list(size)} must be {crystal.dimensions} numbers with lattice = "
            f'"{crystal.lattice}"; change it.'
        )
        return
    if crystal.lattice == "y" and crystal.sides != "free":
        yield f'crystal.sides = "{crystal.sides}" is of a lattice, not of a y; drop it.'
    if crystal.lattice == "y" and crystal.scatter:
        yield "crystal.scatter is of a lattice, not of a y; drop it."
    if crystal.lattice == "y" and scene.wall is not None:
        yield "[wall] is behind the last row of a lattice, which a y has not; drop it."
    if n > MOST_SPHERES:
        yield (
            f"crystal.size = {list(size)} makes {n} spheres, allowed are {MOST_SPHERES}; lower it."
        )
    places = [("missing", place) for place in crystal.missing]
    places += [("inclusions.at", inclusion.at) for inclusion in crystal.inclusions]
    moved = {name: getattr(crystal, name) for name in ("striker", "drive")}
    moved = {name: table for name, table in moved.items() if table is not None}
    places += [(f"{name}.at", x.at) for name, x in moved.items() if x.at is not None]
    for key, place in places:
        if not inside(place, crystal):
            yield (
                f"crystal.{key} = {list(place)} is no place of {size_words(crystal)}; places count "
                "from 0."
            )
    for name, key in ((name, key) for name in moved for key in ("row", "plane")):
        value, dimensions = getattr(moved[name], key), 2 if key == "row" else 3
        place = "plane" if crystal.dimensions == 3 else "at" if crystal.lattice == "y" else "row"
        if value is not None and (crystal.dimensions != dimensions or crystal.lattice == "y"):
            yield (f'crystal.{name}.{key} is not of lattice = "{crystal.lattice}"; give {place}.')
        elif value is not None and value >= size[-1]:
            yield (
                f"crystal.{name}.{key} = {value} must be below {size[-1]}, the number of "
                f"{'layers' if dimensions == 3 else 'rows'}; lower it."
            )

    # what is saved of every instant, in both marches that are compared
    spheres = scene.output.spheres
    if spheres and max(spheres) > n:
        yield f"output.spheres has {max(spheres)}, allowed are 1 to {n}; lower it."
    kept = len(spheres) or n
    values = 6 * kept * scene.output.samples
    if values > LIMITS.values * 5:
        yield (
            f"output.samples = {scene.output.samples} of {kept} spheres are {values:.1e} values, "
            f"allowed are {5 * LIMITS.values:.0e}; lower it, or list spheres in output.spheres."
        )
    needed = MARCHES * SPHERE_BYTES * kept * scene.output.samples
    if needed > free_memory():
        yield (
            f"output.samples = {scene.output.samples} of {kept} spheres would take "
            f"{gigabytes(needed)} of memory, {gigabytes(free_memory())} are free; lower it, or "
            "list spheres in output.spheres."
        )


def inside(place: tuple[int, ...], crystal) -> bool:
    """True if a place is one of the lattice."""
    size = crystal.size
    if len(place) != crystal.dimensions:
        return False
    if crystal.lattice == "y":
        return place[1] <= 2 and place[0] < size[min(place[1], 1)]
    return all(index < count for index, count in zip(place, size, strict=True))


def size_words(crystal) -> str:
    """The lattice in words, for a sentence on a place in it."""
    if crystal.lattice == "y":
        return f"a y of stem {crystal.size[0]} and branches {crystal.size[1]}, [number, part]"
    return f"a lattice of {' x '.join(map(str, crystal.size))}"
