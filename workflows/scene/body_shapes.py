"""Shapes of the tables of [bodies], as `geometry` has them: shapes and grid lines."""

from beadwave.geometry.cad.shapes import Box, Cylinder, Hole, RadialHole, Shape, Slab
from beadwave.geometry.errors import InvalidGeometry
from beadwave.geometry.meshing.grid_lines import Stop, refined
from beadwave.geometry.meshing.lined_blocks import HoleRing, Lines
from beadwave.workflows.scene.scene import Scene
from beadwave.workflows.scene.tables.bodies import BodyTable


def grid_lines(scene: Scene, scale: float = 1.0) -> dict[str, Lines]:
    """The grid lines of a rig's bodies, with sizes multiplied by `scale`; none of other scenes."""
    lines = {}
    for name, grid in scene.grids.items():
        stops = [
            [
                Stop(line.at) if line.size is None
                else refined(line.at, scale * line.size, line.growth)
                for line in along
            ]
            for along in (grid.x, grid.y, grid.z)
        ]  # fmt: skip
        lines[name] = Lines(*stops, [HoleRing(*ring) for ring in grid.rings])
    return lines


def shapes(scene: Scene) -> dict[str, Shape]:
    """The bodies that the scene draws, by name; raises InvalidGeometry, with the body's key, for
    shapes that cannot be."""
    solids: dict[str, Shape] = {}
    for name, body in (scene.bodies or {}).items():
        if not body.drawn:
            continue
        try:
            solids[name] = _shape(body)
        except InvalidGeometry as error:
            raise InvalidGeometry(f"bodies.{name}: {error}") from None
    return solids


def _shape(body: BodyTable) -> Shape:
    """The box, plate or cylinder of a table, drilled along its thickness and, of a cylinder, into
    its round face."""
    place = {key: getattr(body, key) for key in ("at", "turn") if getattr(body, key)}
    if body.box:
        return Box(body.box, **place)

    along = tuple(
        Hole(holes.diameter, point, holes.depth)
        for holes in body.all_holes
        for point in holes.at or ()
    )
    if body.plate:
        return Slab(body.plate.outline, body.plate.thickness, along, **place)

    radial = tuple(
        RadialHole(holes.diameter, angle, height, holes.depth)
        for holes in body.all_holes
        for angle, height in holes.around or ()
    )
    return Cylinder(**body.cylinder.model_dump(), holes=along, radial_holes=radial, **place)
