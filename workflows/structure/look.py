"""An assembly at a glance: bodies, masses, springs, touching pairs, holes, the size of its mesh."""

from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pydantic import BaseModel
from skfem import Mesh

from beadwave.geometry import InvalidGeometry
from beadwave.geometry.cad.face_triangles import surface
from beadwave.geometry.cad.joints import picked
from beadwave.geometry.drawing import Drawing, face_triangles, nodes_foreseen, nodes_of
from beadwave.geometry.drawing import meshed as drawn_meshes
from beadwave.workflows.report.tables import aligned_text
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.scene.body_shapes import grid_lines
from beadwave.workflows.scene.rules.size import (
    foreseen_loop_seconds,
    foreseen_seconds,
    peak_memory,
    too_large_mesh,
)
from beadwave.workflows.scene.toml import resolved
from beadwave.workflows.stages.engine.stage_table import has_bolts, in_contact
from beadwave.workflows.stages.pages.pictures import fixtures_of_faces
from beadwave.workflows.stages.structure.assembly import mesh
from beadwave.workflows.stages.structure.bodies import (
    drawing,
    placed,
    sizing_of,
    without_small_features,
    words,
)
from beadwave.workflows.stages.structure.meshed_parts import Parts
from beadwave.workflows.stages.warnings import overloaded_bolts
from beadwave.workflows.structure.face_page import face_page
from beadwave.workflows.structure.joint_table import JointRow, joint_rows, joints_text
from beadwave.workflows.structure.template import starter

STEEL = {"young": 210e9, "poisson": 0.3, "density": 7850.0}
ENDINGS = (".step", ".stp")


class SeenBody(BaseModel):
    """A body; its sides are those of the box around it, its dofs those of the mesh, without one
    about so many."""

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


class SeenMass(BaseModel):
    """A mass that a face carries."""

    name: str
    on: str
    mass_kg: float


class SeenSpring(BaseModel):
    """Equal springs from points of a face to the ground or to another face."""

    name: str
    on: str
    to: str
    number: int
    stiffness: dict[str, float]  # [N/m] of each by key


class SeenPart(BaseModel):
    """A part known by measured receptances, and where it is joined."""

    name: str
    on: str
    receptance: str
    motions: tuple[str, ...]  # of its points, "12z"
    synthetic: bool


class SeenRemoval(BaseModel):
    """A feature that mesh.simplify leaves out of the mesh."""

    body: str
    faces: tuple[str, ...]  # "body@x,y,z" [m]
    size_m: float  # diameter of a hole, radius of a rounding, diagonal of other faces
    volume_m3: float  # filled and taken away


class Look(BaseModel):
    """Bodies, touching pairs, holes, features that the mesh leaves out, carried masses, springs,
    measured parts, the cost of a run;
    `remarks` in sentences."""

    name: str
    unit: str | None
    bodies: list[SeenBody]
    touching: list[SeenPair]
    holes: list[SeenHole]
    left_out: list[SeenRemoval] = []  # by mesh.simplify
    masses: list[SeenMass] = []
    springs: list[SeenSpring] = []
    measured: list[SeenPart] = []
    joints: list[JointRow] = []  # those that are known from their drawing
    meshed: bool  # whether the dofs are those of meshes; else within a factor of 2
    dofs: int
    unknowns: int | None = None  # about, of a run: less what ties, joints and supports take
    memory_bytes: float
    seconds: float
    amplitude_seconds: float | None = None  # of modes --amplitude, beside these; faces in contact
    remarks: list[str]

    def text(self) -> str:
        """Tables of bodies, touching pairs and holes, and remarks."""
        unit = f", lengths in {self.unit}" if self.unit else ""
        n = len(self.bodies)
        lines = [f"{self.name}: {n} bod{'y' if n == 1 else 'ies'}{unit}", ""]

        head = ("body", "sides [mm]", "mass [kg]", "dofs", "material")
        cells = []
        for body in self.bodies:
            sides = " x ".join(f"{1e3 * side:.5g}" for side in body.sides_m)
            mass = None if body.mass_kg is None else f"{body.mass_kg:.4g}"
            dofs = body.dofs if self.meshed else float(f"{body.dofs:.1e}")
            cells.append((body.name, sides, mass, f"{dofs:.0f}", body.material))
        lines += [aligned_text(head, cells)]

        if self.touching:
            head = ("touching", "area [mm^2]", "gap [mm]")
            cells = [
                (f'"{pair.between}"', f"{1e6 * pair.area_m2:.5g}", round(1e3 * pair.gap_m, 6))
                for pair in self.touching
            ]
            lines += ["", aligned_text(head, cells)]

        if self.holes:
            head = ("holes", "diameter [mm]", "number", "axis")
            cells = []
            for hole in self.holes:
                axis = ", ".join(f"{x:.3g}" for x in hole.axis)
                diameter = f"{1e3 * hole.diameter_m:.5g}"
                cells.append((f"{hole.body}:hole", diameter, hole.number, axis))
            lines += ["", aligned_text(head, cells)]

        if self.left_out:
            head = ("left out of the mesh", "size [mm]", "volume [mm^3]")
            cells = [
                (feature.faces[0], f"{1e3 * feature.size_m:.4g}", f"{1e9 * feature.volume_m3:.4g}")
                for feature in self.left_out
            ]
            lines += ["", aligned_text(head, cells)]

        if self.masses:
            cells = [(mass.name, mass.on, f"{mass.mass_kg:.4g}") for mass in self.masses]
            lines += ["", aligned_text(("carried", "on", "mass [kg]"), cells)]

        if self.springs:
            cells = []
            for spring in self.springs:
                stiffness = ", ".join(f"{key} {k:.4g}" for key, k in spring.stiffness.items())
                cells.append((spring.name, spring.on, spring.to, spring.number, stiffness))
            lines += ["", aligned_text(("springs", "on", "to", "number", "each [N/m]"), cells)]

        if self.measured:
            cells = [
                (
                    part.name, part.on, ", ".join(part.motions), part.receptance,
                    "SYNTHETIC" if part.synthetic else "measured",
                )
                for part in self.measured
            ]  # fmt: skip
            head = ("known by receptances", "joined to", "motions", "file", "")
            lines += ["", aligned_text(head, cells)]

        if self.joints:
            lines += ["", joints_text(self.joints)]

        seconds = float(f"{self.seconds:.2g}")
        price = (
            f"modes and reduction take some {seconds:g} s of one core and "
            f"{self.memory_bytes / 1e9:.2g} GB, within a factor of 2"
        )
        if self.amplitude_seconds is not None:
            loops = float(f"{self.amplitude_seconds:.2g}")
            price += f"; modes --amplitude takes some {loops:g} s more"
        if not self.meshed:
            cost = f"Some {float(f'{self.dofs:.1e}'):,.0f} dofs, foreseen without a mesh; {price}."
            return "\n".join([*lines, "", cost, *self.remarks])
        left = f", some {self.unknowns:,} once joined and held" if self.unknowns else " in all"
        return "\n".join([*lines, "", f"{self.dofs:,} dofs{left}; {price}", *self.remarks])


class LookContents(NamedTuple):
    """The report, what a picture shows, and a scene to start from."""

    look: Look
    scene: Scene
    whole: bool  # not of bodies alone
    parts: Parts | None  # what a run has; None without a mesh
    surfaces: dict[str, Mesh]  # of the bodies, in triangles; of those that are meshed none
    fixtures: dict[str, Any]  # drawn besides the surfaces
    starter: str | None  # TOML; None where none was asked for or no face offers itself to the chain
    page: str | None  # HTML, on which a click on a face shows its selectors


def of_file(path: Path) -> Scene:
    """A scene of all bodies of a STEP file, of steel and floating."""
    assembly = {"step": str(path), "material": "steel", "touching": "free", "held": []}
    tables = {"name": "look", "assembly": assembly, "materials": {"steel": STEEL}}
    return resolved(tables, str(path))


def look(
    scene: Scene, source: str, *, whole: bool = True, meshed: bool = False,
    with_starter: bool = False, pictured: bool = False,
) -> LookContents:  # fmt: skip
    """Bodies, pairs and holes of a scene from its geometry, `meshed` with the mesh that a run has;
    a scene to start from and the page of its faces where they are asked for. Not `whole` is what
    has bodies alone, as a STEP file."""
    parts, chosen, refusal = None, None, []
    # a mesh of the user's, and one between prescribed grid lines, cost nothing
    meshed = meshed or bool(scene.assembly.mesh or grid_lines(scene, scene.mesh.scale))
    if whole and meshed:
        try:
            parts = mesh(scene)
        except InvalidScene as why:
            refusal = [f"A run refuses this scene: {why}"]

    # holes and remarks need the CAD kernel, whose session ends with the context
    with drawing(scene, lines=False) as geometry:
        if whole and not meshed:
            try:
                chosen = placed(scene, geometry)
            except (InvalidScene, InvalidGeometry) as why:
                at = "" if isinstance(why, InvalidScene) else f"{scene.name}: "
                refusal = [f"A run refuses this scene: {at}{why}"]
        holes = _holes(geometry)
        remarks = _remarks(geometry) + refusal
        start = starter(geometry, Path(source), scene.assembly.gap) if with_starter else None
        page, surfaces, fixtures = None, {}, {}
        if pictured:
            triangles = face_triangles(geometry, scene.mesh.seconds)
            page = face_page(source, geometry.bodies, triangles)
            if parts is None:
                surfaces = {name: surface(of_faces) for name, of_faces in triangles.items()}
                fixtures = fixtures_of_faces(scene, chosen, triangles) if chosen else {}
                fixtures["elements"] = False

        removals = parts.left_out if parts else ()
        if chosen and scene.mesh.simplify and not geometry.own:
            geometry, removals = without_small_features(scene, geometry, chosen)

        # a mesh comes last: it parts faces that touch in part
        sizing = chosen.sizing if chosen else sizing_of(scene, geometry)
        if meshed and not whole:
            pairs = geometry.near.touching
            nothing = picked(words(scene), geometry.bodies, pairs, scene.assembly.gap)
            fixtures, (surfaces, _) = {}, drawn_meshes(geometry, nothing, pairs, {}, sizing)
            nodes = nodes_of(surfaces)
        else:
            nodes = parts.nodes if parts else nodes_foreseen(geometry, sizing)

    counted = parts is not None or geometry.own is not None or (meshed and not whole)
    bodies = []
    for name, body in geometry.bodies.items():
        material = scene.material_name(body.name)
        solid = (scene.materials or {}).get(material)
        density = solid.density if solid else None
        bodies.append(
            SeenBody(
                name=body.name,
                # to a micrometre: the CAD kernel pads its boxes by a tenth of one
                sides_m=tuple(np.round(body.upper - body.lower, 6).tolist()),
                mass_kg=None if density is None else density * body.volume,
                material=material,
                dofs=int(3 * nodes[name]),
            )
        )
    mass_of = {body.name: body.mass_kg for body in bodies}
    heavy = [
        f"{one.name} of {one.mass:g} kg is heavier than {one.on.partition(':')[0]}, "
        f"{carrying:.4g} kg, which carries it; check its unit."
        for one in scene.masses or ()
        if (carrying := mass_of.get(one.on.partition(":")[0])) and one.mass > carrying
    ]
    bolted = parts.bolted if parts else tuple(chosen.bolted.values()) if chosen else ()
    joints = joint_rows(bolted)
    overloaded = [*overloaded_bolts(scene.utilisations)]
    dofs = int(3 * sum(nodes.values()))
    chosen, large = [], []
    if not counted and whole:
        too_large = too_large_mesh(scene, "the mesh of [assembly]", nodes)
        large = [f"A run may refuse this scene: {sentence}" for sentence in too_large]
    if scene.mesh and scene.mesh.error:
        chosen.append(
            f"These elements have their usual sizes; mesh.error = {scene.mesh.error:g} chooses "
            f"others, with {scene.mesh.unknowns} unknowns at most."
        )
    report = Look(
        name=source,
        unit=geometry.unit,
        bodies=bodies,
        touching=[
            SeenPair(between=pair.name, area_m2=pair.area, gap_m=pair.gap)
            for pair in geometry.near.touching
        ],
        holes=holes,
        left_out=[
            SeenRemoval(body=r.body, faces=r.faces, size_m=r.size, volume_m3=r.volume)
            for r in removals
        ],
        masses=[SeenMass(name=one.name, on=one.on, mass_kg=one.mass) for one in scene.masses or ()],
        measured=_seen_parts(scene),
        joints=joints,
        springs=[
            SeenSpring(
                name=one.name, on=one.on, to=one.to, number=len(one.at), stiffness=one.stiffnesses
            )
            for one in scene.springs or ()
        ],
        meshed=counted,
        dofs=dofs,
        unknowns=(dofs - constrained_dofs(parts)) if parts else dofs if whole else None,
        memory_bytes=peak_memory(scene, nodes),
        seconds=foreseen_seconds(nodes, bounded=whole and has_bolts(scene)),
        amplitude_seconds=foreseen_loop_seconds(nodes) if whole and in_contact(scene) else None,
        remarks=remarks + heavy + overloaded + large + chosen,
    )
    return LookContents(report, scene, whole, parts, surfaces, fixtures, start, page)


def constrained_dofs(parts: Parts) -> int:
    """Dofs that ties, rigid sides of joints and supports take from those of the meshes: of each
    node on such a face, those in its directions. Springs of joints add at most six a joint."""
    connections = parts.connections
    faces = [(tie.slave, 3) for tie in connections.ties]
    faces += [(held.face, len(held.directions)) for held in connections.held]
    for joint in connections.joints:
        sides = [side for side in (joint.first, joint.second) if side is not None]
        faces += [(side.face, 3) for side in sides if side.coupling == "rigid"]
    dofs = 0
    for name, directions in faces:
        skin = parts.meshes[name.partition(":")[0]]
        corners = np.zeros(skin.nvertices, dtype=bool)
        corners[skin.facets[:, parts.facets(name)]] = True
        dofs += directions * int(corners.sum() + corners[skin.edges].all(axis=0).sum())
    return dofs


def _seen_parts(scene: Scene) -> list[SeenPart]:
    """Parts known by receptances, as their files have them."""
    if not scene.measured:
        return []
    # only these scenes pay for the reader of tests
    from beadwave.workflows.files.part_receptances import AXES, receptances

    seen = []
    for table in scene.measured:
        part = receptances(table)
        motions = tuple(f"{n}{AXES[a]}" for n, a in zip(part.node, part.axis, strict=True))
        seen.append(
            SeenPart(
                name=table.name, on=table.on, receptance=Path(table.receptance).name,
                motions=motions, synthetic=part.synthetic,
            )
        )  # fmt: skip
    return seen


def _holes(geometry: Drawing) -> list[SeenHole]:
    """Holes of the bodies, equal ones of a body in one row with their number."""
    from beadwave.geometry.cad.holes import bores

    counts: Counter[tuple] = Counter()
    for name, body in geometry.bodies.items():
        for bore in bores(body):
            axis = np.abs(np.round(bore.axis, 6)) + 0.0
            counts[name, round(bore.diameter, 9), tuple(axis.tolist())] += 1
    return [
        SeenHole(body=body, diameter_m=diameter, axis=axis, number=number)
        for (body, diameter, axis), number in counts.items()
    ]


def _remarks(geometry: Drawing) -> list[str]:
    """Bodies that touch none, holes that no name picks, faces that miss each other, in
    sentences."""
    from beadwave.geometry.cad.holes import cut_holes

    free = geometry.near.free(geometry.bodies) if len(geometry.bodies) > 1 else ()
    remarks = [*geometry.remarks, *(f'"{name}" touches no other body.' for name in free)]
    for body in geometry.bodies.values():
        for hole in cut_holes(body):
            at = ",".join(f"{x:.4g}" for x in body.face(hole.tags[0]).centre.round(6) + 0.0)
            remarks.append(
                f'"{body.name}" has a hole of {1e3 * hole.diameter:.5g} mm that an edge cuts, or a '
                f"slot's end; {body.name}@{at} picks it, {body.name}:hole does not."
            )
    return remarks + [miss.sentence for miss in geometry.near.misses]
