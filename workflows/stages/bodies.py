"""An assembly by the words of its scene: bodies drawn or read, where they touch, joined, meshed."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import combinations, permutations, product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import fem
from geometry import InvalidGeometry, rig
from geometry.own_mesh import OwnMesh, own_mesh
from geometry.shapes import Box, Cylinder, Hole, Plate, Shape
from geometry.solids import require_size
from workflows.files.mesh import volumes_of
from workflows.files.step import require_step
from workflows.scene import InvalidScene, Scene
from workflows.scene.assembly import assembly
from workflows.scene.bodies import GROUND, SHARE, THREAD, BodyTable, Bolts, General, Solid
from workflows.scene.size import too_large_mesh
from workflows.stages.parts import GMSH_NEEDS, STRIKE, Parts, Struck
from workflows.stages.strike import around, struck


class Drawing(NamedTuple):
    """The bodies in the CAD kernel or in a mesh, and which of them touch; see `geometry`."""

    bodies: dict
    unit: str | None  # of the file
    near: tuple  # geometry.touching.Neighbours
    own: OwnMesh | None = None  # of the user


class Marks(NamedTuple):
    """What a mesh must show: faces picked, what bolts hold of them, joints that stand on that."""

    named: dict
    patches: dict
    joints: list[fem.Joint]


@contextmanager
def drawing(scene: Scene) -> Iterator[Drawing]:
    """The scene's bodies; raises InvalidScene for what cannot be drawn, read, picked or joined."""
    try:
        from geometry.cad import model  # loads gmsh, and that its shared libraries
        from geometry.touching import neighbours, require_apart
    except OSError as missing:
        raise ValueError(
            f"gmsh cannot start ({missing}); install its shared libraries (Debian: {GMSH_NEEDS})."
        ) from None
    table = scene.assembly if scene.is_general else General()
    try:
        if table.mesh:
            own = own_mesh(volumes_of(Path(table.mesh)), table.gap)
            require_size(own.bodies)
            require_apart(own.meeting.near)
            yield Drawing(own.bodies, None, own.meeting.near, own)
            return
        if table.step:
            require_step(Path(table.step))
        with model(shapes(scene), Path(table.step) if table.step else None) as drawn:
            require_size(drawn.bodies)
            near = neighbours(drawn.bodies, table.gap)
            require_apart(near)
            yield Drawing(drawn.bodies, drawn.unit, near)
    except InvalidGeometry as error:
        raise InvalidScene(f"{scene.name}: {error}") from None


def shapes(scene: Scene) -> dict[str, Shape]:
    """The bodies that the scene draws, those of the rig too."""
    if not scene.is_general:
        return rig.shapes(assembly(scene.assembly))
    return {name: _shape(b) for name, b in (scene.bodies or {}).items() if b.drawn}


def _shape(body: BodyTable) -> Shape:
    place = {key: getattr(body, key) for key in ("at", "turn") if getattr(body, key)}
    if body.box:
        return Box(body.box, **place)
    if body.cylinder:
        return Cylinder(**body.cylinder.model_dump(), **place)
    at = body.holes.at if body.holes else ()
    holes = tuple(Hole(body.holes.diameter, point) for point in at)
    return Plate(body.plate.outline, body.plate.thickness, holes, **place)


def parts(scene: Scene, coarser: float = 1.0) -> Parts:
    """Bodies meshed each on its own, and what joins and holds them; elements of ours `coarser`
    times as large as the scene has them."""
    with drawing(scene) as drawn:
        _require_known(scene, drawn)
        tied, marks = tied_pairs(scene, drawn), marked(scene, drawn)
        face = _bare(scene, drawn, struck(scene, drawn.bodies)) if scene.strike else None
        if drawn.own:
            size = {name: 1 / body.volume for name, body in drawn.bodies.items()}
            meshes = _named(scene, drawn.own, [(t, _roles(t, size)[1]) for t in tied], marks, face)
        else:
            meshes = _meshes(scene, drawn, tied, marks, face, coarser)
            size = {n: mesh.nelements / drawn.bodies[n].volume for n, mesh in meshes.items()}
    nodes = {name: float(m.nvertices + m.nedges) for name, m in meshes.items()}
    for sentence in too_large_mesh(scene, "the mesh of [assembly]", nodes):
        raise InvalidScene(f"{scene.name}: {sentence}")
    connections = fem.Connections(
        [_tie(touch, size) for touch in tied],
        marks.joints,
        [fem.Held(_face(marks, f"held-{i}"), hold.directions) for i, hold in _holds(scene)],
    )
    made_of = {name: material(scene.made_of(name)) for name in meshes}
    return Parts(meshes, made_of, connections, face, _load(scene, marks, made_of))


def _load(scene: Scene, marks: Marks, names) -> fem.Load | None:
    """All loads of the scene; raises InvalidScene for heat on what has no expansion."""
    if not scene.loads:
        return None
    forces = [
        fem.FaceForce(_face(marks, f"load-{load.name}"), load.force, load.direction)
        for load in scene.loads
        if load.force is not None
    ]
    rods = [
        fem.Rod(*(_face(marks, f"{end}-{load.name}") for end in ("load", "rod")), load.tension,
                load.stiffness or 0.0)
        for load in scene.loads
        if load.tension is not None
    ]  # fmt: skip
    return fem.Load(forces, _heat(scene, names), rods)


def _heat(scene: Scene, names) -> dict[str, fem.Heat]:
    """Bodies that are warmer, by their materials; raises InvalidScene where nothing fits."""
    from geometry.selectors import bodies_named

    found = {}
    for load in (load for load in scene.loads if load.body):
        try:
            named = bodies_named(load.body, dict.fromkeys(names))
        except InvalidGeometry as error:
            raise InvalidScene(f"{scene.name}: loads.{load.name}: {error}") from None
        for body in named:
            expansion = scene.made_of(body).expansion
            if expansion is None:
                raise InvalidScene(
                    f"{scene.name}: loads.{load.name} warms {body!r}, whose material "
                    f"{scene.material_name(body)!r} has no expansion; add it, in 1/K."
                )
            found[body] = fem.Heat(load.temperature, expansion)
    return found


def _bare(scene: Scene, drawn: Drawing, face: Struck) -> Struck:
    """The face struck; raises InvalidScene where another body lies on it there."""
    body, radius = face.face.body, scene.strike.radius
    points = around(face.point, face.outward, radius)
    if over := drawn.near.over(body, points, drawn.bodies, scene.assembly.gap):
        raise InvalidScene(
            f'{scene.name}: strike.on = {scene.strike.on!r}: "{over}" lies on {body} at the point '
            f"struck, {np.round(face.point, 6).tolist()} m, or less than {radius:g} m beside it; "
            "move it by strike.at."
        )
    return face


def material(solid: Solid) -> fem.Material | fem.Orthotropic:
    """Of the scene's table."""
    if solid.is_isotropic:
        return fem.Material(solid.young, solid.poisson, solid.density)
    axes = {} if solid.axes is None else {"axes": solid.axes}
    return fem.Orthotropic(solid.young, solid.poisson, solid.shear, solid.density, **axes)


def _require_known(scene: Scene, drawn: Drawing) -> None:
    """Raise InvalidGeometry for names that no body bears, InvalidScene for one of no material."""
    from geometry.selectors import bodies_named

    for name in scene.bodies or {}:
        bodies_named(name, drawn.bodies)
    for name in drawn.bodies:
        if scene.material_name(name) is None:
            raise InvalidScene(
                f'{scene.name}: nothing says what "{name}" is made of; give '
                f"bodies.{name}.material, or assembly.material for all."
            )


def tied_pairs(scene: Scene, drawn: Drawing) -> list:
    """The touching pairs that stay together; raises InvalidScene for one left unsaid."""
    from geometry.selectors import touches

    found, bodies = drawn.near.touching, drawn.bodies
    tied = {t.name: t for tie in scene.ties or () for t in touches(tie.between, bodies, found)}
    bolted = {t.name: joint.name for joint, pair in _bolted(scene, drawn) for t in pair}
    for joint, thread in _threads(scene, drawn):
        bolted |= {"|".join(pair): joint.name for pair in permutations(thread.bodies)}
    for name in tied.keys() & bolted.keys():
        raise InvalidScene(
            f'{scene.name}: "{name}" is tied and has the joint {bolted[name]!r}, which a tie would '
            "bridge; drop one of them."
        )
    unsaid = [t for t in found if t.name not in tied.keys() | bolted.keys()]
    if scene.assembly.touching == "ask" and unsaid:
        raise InvalidScene(f"{scene.name}: {_asked(unsaid)}")
    _require_joined(scene, drawn)
    return [*tied.values(), *(unsaid if scene.assembly.touching == "tied" else ())]


def _asked(unsaid: list) -> str:
    pairs = ", ".join(f'"{t.name}" ({1e6 * t.area:.4g} mm^2)' for t in unsaid)
    lines = "\n".join(f'[[ties]]\nbetween = "{t.name}"' for t in unsaid)
    return (
        f"{pairs} touch, and nothing says whether they are tied, bolted or free; write "
        f'assembly.touching = "tied" or "free", [[joints]], or of these what is meant:\n{lines}'
    )


def _require_joined(scene: Scene, drawn: Drawing) -> None:
    """Raise InvalidScene for a body that touches none, though there are others, and is not held."""
    from geometry.touching import told

    held = {hold.on.partition(":")[0].partition("@")[0] for _, hold in _holds(scene)}
    held |= {joint.partners[0].partition(":")[0] for joint in scene.joints or ()}
    held |= {body for _, thread in _threads(scene, drawn) for body in thread.bodies}
    free = [name for name in drawn.near.free(drawn.bodies) if name not in held]
    if len(drawn.bodies) == 1 or not free:
        return
    misses = [told(miss) for miss in drawn.near.misses if set(miss.bodies) & set(free)]
    raise InvalidScene(
        f'{scene.name}: "{free[0]}" touches no other body and is not held: it keeps its six rigid '
        f"motions; move it, hold it, or raise assembly.gap = {scene.assembly.gap:g} m."
        + "".join(f" {miss}" for miss in misses)
    )


def _bolted(scene: Scene, drawn: Drawing) -> Iterator[tuple[Bolts, list]]:
    """Bolts between bodies, and the touching pairs of each."""
    from geometry.selectors import touches

    for joint in scene.joints or ():
        if GROUND not in joint.partners and joint.at != THREAD:
            yield joint, touches(joint.between, drawn.bodies, drawn.near.touching)


def _threads(scene: Scene, drawn: Drawing) -> Iterator[tuple[Bolts, Any]]:
    """Joints at threads, and where a shank of one body sits in a bore of the other; raises
    InvalidScene for a joint without one, and for bodies with several."""
    from geometry.holes import THREAD as LIKE
    from geometry.holes import bores, engaged
    from geometry.selectors import bodies_named

    for joint in (joint for joint in scene.joints or () if joint.at == THREAD):
        ones, others = (bodies_named(side, drawn.bodies) for side in joint.partners)
        pairs = {frozenset(pair): pair for pair in product(ones, others) if len({*pair}) == 2}
        threads = []
        for pair in pairs.values():
            both = engaged(*(drawn.bodies[name] for name in pair))
            if len(both) > 1:
                places = " and ".join(f"{np.round(t.centre, 6).tolist()} m" for t in both)
                raise InvalidScene(
                    f'{scene.name}: joints.{joint.name}.at = "thread": "{"|".join(pair)}" have '
                    f"{len(both)} cylinders in common, at {places}, and a thread is one; make the "
                    "other one wider than its shank, or draw it as a body of its own."
                )
            threads += both
        if not threads:
            sizes = [
                f'"{name}" has a {what} of {1e3 * cylinder.diameter:.4g} mm'
                for name in dict.fromkeys([*ones, *others])
                for what, hollow in (("shank", False), ("bore", True))
                for cylinder in bores(drawn.bodies[name], hollow=hollow)
            ]
            raise InvalidScene(
                f'{scene.name}: joints.{joint.name}.at = "thread" finds no shank of one of '
                f'"{joint.between}" in a bore of the other, on one axis, up to {100 * LIKE:g} % of '
                f"the bore's radius apart: {', '.join(sizes[:6]) or 'neither has a cylinder'}; "
                "move them onto each other, or give at = [[x, y, z], ...] and washer."
            )
        yield from ((joint, thread) for thread in threads)


def _holds(scene: Scene):
    return enumerate(scene.assembly.holds, start=1)


def marked(scene: Scene, drawn: Drawing) -> Marks:
    """Faces held, struck and bolted."""
    from geometry.selectors import faces

    marks = Marks({}, {}, [])
    for i, hold in _holds(scene):
        marks.named[f"held-{i}"] = faces(hold.on, drawn.bodies)
    for load in scene.loads or ():
        ends = {"load": load.on, "rod": load.to}
        for end, face in ends.items():
            if face:
                marks.named[f"{end}-{load.name}"] = faces(face, drawn.bodies)
    for joint, pairs in _bolted(scene, drawn):
        _between_bodies(scene, drawn, joint, pairs, marks)
    for i, (joint, thread) in enumerate(_threads(scene, drawn), start=1):
        marks.joints.append(_threaded(joint, f"{joint.name}-{i}", thread, marks))
    for joint in scene.joints or ():
        if GROUND in joint.partners:
            _to_the_ground(drawn, joint, marks)
    return marks


def _between_bodies(scene: Scene, drawn: Drawing, joint: Bolts, pairs: list, marks: Marks) -> None:
    """What each bolt of a joint holds on both faces."""
    from geometry.imprint import share_of
    from geometry.selectors import bodies_named

    first, second = (bodies_named(side, drawn.bodies) for side in joint.partners)
    places = [place for touch in pairs for place in _places(scene, drawn, joint, touch)]
    if not places:
        raise InvalidScene(
            f'{scene.name}: joints.{joint.name} finds no hole through both of "{joint.between}"; '
            "give at = [[x, y, z], ...] and washer."
        )
    for i, place in enumerate(places, start=1):
        under, axis = list(zip(place.bodies, place.faces, strict=True)), place.axis
        if not (place.bodies[0] in first and place.bodies[1] in second):
            under, axis = under[::-1], -axis
        key = f"{joint.name}-{i}"
        if joint.washer == SHARE:
            sides = _shares(scene, joint, key, under, share_of(place, places, pairs), marks)
        else:
            sides = _rings(joint, key, under, place, marks)
        marks.joints.append(_joint(joint, *sides, place.centre, axis))


def _threaded(joint: Bolts, key: str, thread, marks: Marks) -> fem.Joint:
    """The mean motions of shank and bore over the length that they have in common."""
    from geometry.imprint import Band
    from geometry.selectors import Selected

    sides = []
    for body, tags in zip(thread.bodies, thread.tags, strict=True):
        name = f"{key}-{body}"
        on = Selected(body, tags)
        marks.patches[name] = Band(on, thread.centre, thread.axis, thread.length)
        sides.append(fem.Side(f"{body}:{name}", "mean"))
    return _joint(joint, *sides, thread.centre, thread.axis)


def _rings(joint: Bolts, key: str, under: list, place, marks: Marks) -> list[fem.Side]:
    """Discs under the washers, on both faces."""
    from geometry.imprint import Disc
    from geometry.selectors import Selected

    radius = joint.washer or max(place.diameters)
    sides = []
    for (body, face), coupling in zip(under, joint.sides, strict=True):
        marks.patches[f"{key}-{body}"] = Disc(
            Selected(body, (face,)), place.centre, place.axis, radius
        )
        sides.append(fem.Side(f"{body}:{key}-{body}", coupling))
    return sides


def _shares(scene: Scene, joint: Bolts, key: str, under: list, share, marks: Marks) -> list:
    """The bolt's share of the common face, drawn on the sides that are rigid, else on the first;
    the mean of the other is taken over its footprint there."""
    from geometry.selectors import Selected

    drawn = [i for i, coupling in enumerate(joint.sides) if coupling == "rigid"] or [0]
    sides: list = [None, None]
    for i in sorted((0, 1), key=lambda i: i not in drawn):
        (body, face), coupling = under[i], joint.sides[i]
        on, name = Selected(body, (face,)), f"{key}-{body}"
        (marks.patches if i in drawn else marks.named)[name] = share(on) if i in drawn else on
        over = None if i in drawn else sides[drawn[0]].face
        sides[i] = fem.Side(f"{body}:{name}", coupling, over, gap=2 * scene.assembly.gap)
    return sides


def _places(scene: Scene, drawn: Drawing, joint: Bolts, touch) -> list:
    """Where the bolts of a joint pass from one body to the other."""
    from geometry.holes import concentric, crossed

    if joint.at == "holes":
        return list(concentric(touch, drawn.bodies, scene.assembly.gap))
    found = crossed(touch, drawn.bodies, joint.at)
    if not found:
        raise InvalidScene(
            f'{scene.name}: joints.{joint.name} has points, but "{touch.name}" touch on no plane; '
            "tie them."
        )
    _require_apart(scene, joint, np.array([place.centre for place in found]))
    return found


def _require_apart(scene: Scene, joint: Bolts, centres: np.ndarray) -> None:
    """Raises InvalidScene for washers that overlap; centres (n, 3) [m] on the common face."""
    radius = joint.washer if isinstance(joint.washer, float) else 1e-3
    for i, j in combinations(range(len(centres)), 2):
        apart = np.linalg.norm(centres[i] - centres[j])
        if apart < 2 * radius * (1 - 1e-9):
            raise InvalidScene(
                f"{scene.name}: points {i + 1} and {j + 1} of joints.{joint.name}.at are "
                f"{apart:.4g} m apart, where washers need {2 * radius:g} m; name each bolt once, "
                "or take a smaller washer."
            )


def _to_the_ground(drawn: Drawing, joint: Bolts, marks: Marks) -> None:
    """The walls of holes, each held on its own."""
    from geometry.holes import bores
    from geometry.selectors import Selected, faces

    picked = faces(joint.partners[0], drawn.bodies)
    walls = [b for b in bores(drawn.bodies[picked.body]) if set(b.tags) <= set(picked.tags)]
    for i, bore in enumerate(walls, start=1):
        key = f"{joint.name}-{i}"
        marks.named[key] = Selected(picked.body, bore.tags)
        side = fem.Side(f"{picked.body}:{key}", joint.sides[0])
        marks.joints.append(_joint(joint, side, None, bore.ends.mean(axis=0), bore.axis))


def _joint(joint: Bolts, first: fem.Side, second: fem.Side | None, centre, axis) -> fem.Joint:
    springs = fem.Bushing(**{key: getattr(joint, key) for key in fem.DIRECTIONS})
    frame = fem.normal_frame(axis) if joint.frame == "normal" else np.eye(3)
    return fem.Joint(joint.name, first, second, centre, springs, frame)


def _face(marks: Marks, name: str) -> str:
    return f"{marks.named[name].body}:{name}"


def _roles(touch, fineness: Mapping[str, float]) -> list[str]:
    """Who leads and who follows, the finer mesh or smaller body: an order of all bodies, so that no
    ties form a circle."""
    return sorted(touch.bodies, key=lambda body: fineness[body])


def _tie(touch, fineness: Mapping[str, float]) -> fem.Tie:
    master, slave = _roles(touch, fineness)
    return fem.Tie(f"{slave}:{touch.name}", f"{master}:{touch.name}", touch.gap)


def _meshes(
    scene: Scene, drawn: Drawing, tied: list, marks: Marks, struck: Struck | None, coarser: float
) -> dict:
    from geometry.body_mesh import body_meshes
    from geometry.sizes import Fine, Sizes, default_seeds

    scale, usual = scene.mesh.scale, default_seeds(drawn.bodies)
    seeds = {name: scale * (scene.seed_of(name) or usual[name]) for name in drawn.bodies}
    named, fine = marks.named, []
    if struck:
        fine = [Fine(struck.face.body, struck.point, scale * scene.strike.size)]
        named = named | {STRIKE: struck.face}
    return body_meshes(
        drawn.bodies,
        tied,
        gap=scene.assembly.gap,
        sizes=Sizes(seeds, fine, coarser),
        named=named,
        patches=marks.patches,
        element="tet" if scene.mesh.element == "tet" else None,
    )


def _named(scene: Scene, own: OwnMesh, tied: list, marks: Marks, struck: Struck | None) -> dict:
    """The user's meshes with all faces named; raises InvalidScene for what facets cannot show."""
    named = marks.named | ({STRIKE: struck.face} if struck else {})
    try:
        return own.marked(named, marks.patches, tied)
    except ValueError as error:
        raise InvalidScene(f"{scene.name}: {error}") from None
