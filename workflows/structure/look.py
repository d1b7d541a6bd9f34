"""What an assembly is made of: bodies, masses, where they touch, holes, and what its mesh holds."""

from json import dumps
from os.path import relpath
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pydantic import BaseModel
from skfem import Mesh

from workflows.files.output_file import OutputFile
from workflows.files.run_folder import Picture
from workflows.report.tables import aligned_text
from workflows.scene import InvalidScene, Scene
from workflows.scene.size import foreseen_seconds, peak_memory
from workflows.scene.toml import resolved
from workflows.stages import assembly
from workflows.stages.bodies import Drawing, drawing
from workflows.stages.pictures import picture_of
from workflows.stages.strike import around

STEEL = {"young": 210e9, "poisson": 0.3, "density": 7850.0}
PATCH = 2e-3  # [m] radius of the starter scene's patch
ENDINGS = (".step", ".stp")


class SeenBody(BaseModel):
    """A body; its sides are those of the box around it, its dofs those of a mesh that was made."""

    name: str
    sides_m: tuple[float, float, float]
    mass_kg: float | None
    material: str | None
    dofs: int


class SeenPair(BaseModel):
    """Two bodies that touch, and what the scene makes of it."""

    between: str
    area_m2: float
    gap_m: float


class SeenHole(BaseModel):
    """Equal round holes of a body."""

    body: str
    diameter_m: float
    axis: tuple[float, float, float]
    number: int


class Look(BaseModel):
    """All that is there; `remarks` in sentences."""

    name: str
    unit: str | None
    bodies: list[SeenBody]
    touching: list[SeenPair]
    holes: list[SeenHole]
    dofs: int
    memory_bytes: float
    seconds: float
    remarks: list[str]

    def text(self) -> str:
        """Aligned lines."""
        unit = f", lengths in {self.unit}" if self.unit else ""
        n = len(self.bodies)
        lines = [f"{self.name}: {n} bod{'y' if n == 1 else 'ies'}{unit}", ""]
        head = ("body", "sides [mm]", "mass [kg]", "dofs", "material")
        lines += [aligned_text(head, map(_body_cells, self.bodies))]
        if self.touching:
            head = ("touching", "area [mm^2]", "gap [mm]")
            lines += ["", aligned_text(head, map(_pair_cells, self.touching))]
        if self.holes:
            head = ("holes", "diameter [mm]", "number", "axis")
            lines += ["", aligned_text(head, map(_hole_cells, self.holes))]
        seconds = float(f"{self.seconds:.2g}")
        cost = (
            f"{self.dofs:,} dofs in all; modes and reduction take some {seconds:g} s of one core "
            f"and {self.memory_bytes / 1e9:.2g} GB, within a factor of 2"
        )
        return "\n".join([*lines, "", cost, *self.remarks])


def _body_cells(b: SeenBody) -> tuple:
    sides = " x ".join(f"{1e3 * side:.5g}" for side in b.sides_m)
    return b.name, sides, None if b.mass_kg is None else f"{b.mass_kg:.4g}", b.dofs, b.material


def _pair_cells(pair: SeenPair) -> tuple:
    return f'"{pair.between}"', f"{1e6 * pair.area_m2:.5g}", round(1e3 * pair.gap_m, 6)


def _hole_cells(hole: SeenHole) -> tuple:
    axis = ", ".join(f"{x:.3g}" for x in hole.axis)
    return f"{hole.body}:hole", f"{1e3 * hole.diameter_m:.5g}", hole.number, axis


class Seen(NamedTuple):
    """What was found, its picture's maker, and a scene to start from."""

    look: Look
    meshes: dict
    starter: str | None


def of_file(path: Path) -> Scene:
    """A scene of all bodies of a STEP file, of steel and floating."""
    assembly = {"step": str(path), "material": "steel", "touching": "free", "held": []}
    tables = {"name": "look", "assembly": assembly, "materials": {"steel": STEEL}}
    return resolved(tables, str(path))


def look(scene: Scene, source: str) -> Seen:
    """Bodies, pairs and holes of a scene."""
    with drawing(scene) as drawn:
        holes, starter = _holes(drawn), _starter(drawn, Path(source))
        meshes = _meshes(scene, drawn)
    nodes = {name: float(m.nvertices + m.nedges) for name, m in meshes.items()}
    seen = Look(
        name=source,
        unit=drawn.unit,
        bodies=[_body(scene, b, nodes[name]) for name, b in drawn.bodies.items()],
        touching=[
            SeenPair(between=t.name, area_m2=t.area, gap_m=t.gap) for t in drawn.near.touching
        ],
        holes=holes,
        dofs=int(3 * sum(nodes.values())),
        memory_bytes=peak_memory(scene, nodes),
        seconds=foreseen_seconds(nodes),
        remarks=_remarks(drawn),
    )
    return Seen(seen, meshes, starter)


def _meshes(scene: Scene, drawn: Drawing) -> dict[str, Mesh]:
    """Of the bodies, as a run has them but for what is struck, held and bolted."""
    if drawn.own:
        return {name: skin.mesh for name, skin in drawn.own.skins.items()}
    if not scene.is_general:
        return assembly.mesh(scene).meshes
    from geometry.body_mesh import body_meshes
    from geometry.sizes import Sizes, default_seeds

    usual = default_seeds(drawn.bodies)
    seeds = {name: scene.mesh.scale * (scene.seed_of(name) or usual[name]) for name in usual}
    # with the outlines of partners on each other, where elements are as small as in a run
    return body_meshes(
        drawn.bodies, drawn.near.touching, gap=scene.assembly.gap, sizes=Sizes(seeds),
        element=scene.mesh.element,
    )  # fmt: skip


def picture(seen: Seen) -> Picture:
    """The bodies, a colour and a name each."""
    return picture_of(seen.meshes)


def _body(scene: Scene, body, nodes: float) -> SeenBody:
    if scene.is_general:
        material = scene.material_name(body.name)
        density = scene.materials[material].density if material in (scene.materials or {}) else None
    else:
        material, made_of = None, assembly.materials(scene.assembly, [body.name])
        density = made_of[body.name].density
    return SeenBody(
        name=body.name,
        # to a micrometre: the CAD kernel pads its boxes by a tenth of one
        sides_m=tuple(np.round(body.upper - body.lower, 6).tolist()),
        mass_kg=None if density is None else density * body.volume,
        material=material,
        dofs=int(3 * nodes),
    )


def _holes(drawn: Drawing) -> list[SeenHole]:
    from geometry.holes import bores

    found: dict[tuple, int] = {}
    for name, body in drawn.bodies.items():
        for bore in bores(body):
            axis = np.abs(np.round(bore.axis, 6)) + 0.0
            key = (name, round(bore.diameter, 9), tuple(axis.tolist()))
            found[key] = found.get(key, 0) + 1
    return [
        SeenHole(body=body, diameter_m=diameter, axis=axis, number=number)
        for (body, diameter, axis), number in found.items()
    ]


def _remarks(drawn: Drawing) -> list[str]:
    from geometry.holes import cut_holes

    free = drawn.near.free(drawn.bodies) if len(drawn.bodies) > 1 else ()
    remarks = [f'"{name}" touches no other body.' for name in free]
    for body in drawn.bodies.values():
        for hole in cut_holes(body):
            at = ",".join(f"{x:.4g}" for x in body.face(hole.tags[0]).centre.round(6) + 0.0)
            remarks.append(
                f'"{body.name}" has a hole of {1e3 * hole.diameter:.5g} mm that an edge cuts, or a '
                f"slot's end; {body.name}@{at} picks it, {body.name}:hole does not."
            )
    return remarks + [miss.sentence for miss in drawn.near.misses]


def _starter(drawn: Drawing, source: Path) -> str | None:
    """TOML that runs; None where no plane face offers itself to the chain."""
    faces = [(body, face) for body in drawn.bodies.values() for face in _upright(body)]
    by_height = sorted(faces, key=_height, reverse=True)
    struck = next((f for f in by_height if _is_bare(drawn, *f)), None)
    if struck is None:
        return None
    below = [f for f in faces if f[1].normal[2] < -0.5]
    held = [_word(*f) for f in sorted(below, key=lambda f: f[1].centre[2])][:1]
    return STARTER.format(
        name=source.stem.replace(" ", "-"),
        source=source.absolute(),
        held=dumps(held),
        struck=_word(*struck),
        radius=PATCH,
    )


def write_starter(file: OutputFile, seen: Seen, source: Path) -> None:
    """Write the scene to start from; raises InvalidScene where no face offers itself."""
    if seen.starter is None:
        raise InvalidScene(
            f"{source} has no plane face across an axis that a patch of {PATCH} m fits into the "
            "middle of; write the scene by hand."
        )
    with file.writing() as part:
        near = relpath(source.absolute(), file.path.absolute().parent)
        part.write_text(seen.starter.replace(str(source.absolute()), near), encoding="utf-8")


STARTER = """\
# To start from: {source}. Materials, support, chain and strike are assumed; change them.
name = "{name}"
chain = {{ count = 10, radius = 0.00635, density = 7800.0, young = 210e9, poisson = 0.3 }}
striker = {{ velocity = 0.3 }}
wall = {{ kind = "rom" }}
damping = {{ kind = "modal", ratio = 0.005 }}
time = {{ duration = 1e-3 }}
output = {{ spheres = [1, 5] }}

[assembly]
step = "{source}"
touching = "tied"              # pairs that no [[ties]] or [[joints]] names: "tied", "free", "ask"
held = {held}
material = "steel"

[materials.steel]
young = 210e9                  # Pa
poisson = 0.3
density = 7850.0               # kg/m^3

[strike]
on = "{struck}"
radius = {radius}
"""


def _upright(body) -> list:
    """Plane faces along an axis, each the outermost one there and alone."""
    flat = [f for f in body.faces if f.normal is not None and np.abs(f.normal).max() > 1 - 1e-6]
    words = [_word(body, face) for face in flat]
    return [face for face, word in zip(flat, words, strict=True) if words.count(word) == 1]


def _word(body, face) -> str:
    axis = int(np.abs(face.normal).argmax())
    return f"{body.name}:{'+' if face.normal[axis] > 0 else '-'}{'xyz'[axis]}"


def _height(found) -> tuple[bool, float]:
    """Faces that look up come last, the highest at the end."""
    return bool(found[1].normal[2] > 0.5), float(found[1].centre[2])


def _is_bare(drawn: Drawing, body, face) -> bool:
    """Whether a patch fits into its middle, where no other body lies on it."""
    points = around((face.lower + face.upper) / 2, face.normal, 2 * PATCH)
    whole = all(body.distance(point, face.tag) < 1e-9 for point in points)
    return whole and not drawn.near.over(body.name, points, drawn.bodies, PATCH)
