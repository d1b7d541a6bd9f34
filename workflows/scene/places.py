"""Places of shakers and sensors on a structure, and what its reduced model has to hold for them."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

from beadwave.workflows.scene.tables.walls import RomWall

if TYPE_CHECKING:
    from beadwave.workflows.scene.scene import Scene

RADIUS = 5e-3  # m, of a shaker's and a sensor's patch where the scene gives none: assumed
MIDDLE = (0.0, 0.0)
CRYSTAL_FACE = "crystal"  # name in the mesh of the face that a crystal leans on


class Place(NamedTuple):
    """Place of a shaker or a sensor on the structure, as the scene has it."""

    key: str  # that messages call it by
    name: str
    face: str  # name of the face in the mesh, without its body
    on: str  # selector
    at: tuple[float, float]  # m, from the middle of the face
    radius: float  # m
    direction: str | tuple[float, float, float]


def shaker_places(scene: "Scene") -> list[Place]:
    """The shakers on faces of the structure, in the order of the scene."""
    return [
        Place(
            f"shakers.{shaker.name}", shaker.name, f"shaker-{shaker.name}", shaker.on,
            shaker.at or MIDDLE, shaker.radius or RADIUS, shaker.direction,
        )
        for shaker in scene.shakers or () if shaker.on_face
    ]  # fmt: skip


def sensor_places(scene: "Scene") -> list[Place]:
    """The sensors on faces of the structure, in the order of the scene."""
    output = scene.output
    return [
        Place(
            f"output.sensors.{i}", sensor.label, f"sensor-{i}", sensor.on,
            sensor.at or MIDDLE, sensor.radius or RADIUS, sensor.direction,
        )
        for i, sensor in enumerate((output and output.sensors) or (), start=1)
        if sensor.on is not None
    ]  # fmt: skip


def has_friction(scene: "Scene") -> bool:
    """True if the chain meets the structure with friction."""
    return scene.friction is not None and isinstance(scene.wall, RomWall)


def named_faces(scene: "Scene") -> dict[str, str]:
    """Selectors of the faces of shakers, sensors, masses, springs, measured parts, of several
    chains and of a crystal, by their names in the mesh."""
    functionals = {place.face: place.on for place in shaker_places(scene) + sensor_places(scene)}
    masses = {mass_face(mass.name): mass.on for mass in scene.masses or ()}
    ends = {
        spring_face(spring.name, end): getattr(spring, end)
        for spring in scene.springs or ()
        for end in spring.ends
    }
    parts = {part_face(part.name): part.on for part in scene.measured or ()}
    spheres = {chain_face(row.name): row.on for row in scene.chains or ()}
    if scene.crystal is not None and scene.crystal.on is not None:
        spheres[CRYSTAL_FACE] = scene.crystal.on
    return functionals | masses | ends | parts | spheres


def paths_of(text: str, tables: Any) -> Iterator[tuple[str, ...]]:
    """Keys that lead to each place of a text in tables, those with a name in a list by it."""
    if tables == text:
        yield ()
    rows = tables.items() if isinstance(tables, dict) else ()
    if isinstance(tables, list | tuple):
        rows = [(row.get("name", "") if isinstance(row, dict) else "", row) for row in tables]
    for name, value in rows:
        for path in paths_of(text, value):
            yield (str(name), *path) if name != "" else path


def chain_face(name: str) -> str:
    """Name in the mesh of the face that one of several chains leans on."""
    return f"chain-{name}"


def mass_face(name: str) -> str:
    """Name in the mesh of the face that carries a mass."""
    return f"mass-{name}"


def spring_face(name: str, end: str) -> str:
    """Name in the mesh of the face at one end of a spring, "on" or "to"."""
    return f"spring-{name}-{end}"


def part_face(name: str) -> str:
    """Name in the mesh of the face that is joined to a measured part."""
    return f"measured-{name}"


def words_of(scene: "Scene") -> list[Any]:
    """Words of the functionals, without the contact's patch: changes with each word."""
    return [has_friction(scene), shaker_places(scene), sensor_places(scene)]
