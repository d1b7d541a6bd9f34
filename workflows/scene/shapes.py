"""What the tables of [bodies] draw, as `geometry` has it: shapes and grid lines."""

from geometry.grid_lines import Stop, refined
from geometry.lined import Lines, Ring
from geometry.shapes import Box, Cylinder, Hole, Shape, Slab
from workflows.scene.scene import Scene


def grid_lines(scene: Scene, scale: float = 1.0) -> dict[str, Lines]:
    """The grid lines that the scene prescribes, by body, with sizes multiplied by `scale`."""
    lines = {}
    for name, body in (scene.bodies or {}).items():
        if body.lines is None:
            continue
        stops = [
            [
                Stop(line.at) if line.size is None
                else refined(line.at, scale * line.size, line.growth)
                for line in along
            ]
            for along in (body.lines.x, body.lines.y, body.lines.z)
        ]  # fmt: skip
        rings = (body.holes.rings or ()) if body.holes else ()
        lines[name] = Lines(*stops, [Ring(r.washer, r.lower, r.upper) for r in rings])
    return lines


def shapes(scene: Scene) -> dict[str, Shape]:
    """The bodies that the scene draws."""
    solids: dict[str, Shape] = {}
    for name, body in (scene.bodies or {}).items():
        if not body.drawn:
            continue
        place = {key: getattr(body, key) for key in ("at", "turn") if getattr(body, key)}
        if body.box:
            solids[name] = Box(body.box, **place)
        elif body.cylinder:
            solids[name] = Cylinder(**body.cylinder.model_dump(), **place)
        else:
            points = body.holes.at if body.holes else ()
            holes = tuple(Hole(body.holes.diameter, point) for point in points)
            plate = body.plate
            solids[name] = Slab(plate.outline, plate.thickness, holes, **place)
    return solids
