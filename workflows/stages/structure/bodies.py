"""From a scene's tables to meshed bodies: drawn or read, where they touch, joined, held, loaded.

drawing     the bodies in the CAD kernel or in the user's mesh, and which of them touch
words       the faces and bodies that the scene names, as text for `geometry.cad.joints.picked`
placed      what these words pick, and sizing_of the sizes of elements
parts       the bodies meshed, and what joins, holds and loads them
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave import fem
from beadwave.geometry import InvalidGeometry
from beadwave.geometry.cad.contacts import TouchingPair
from beadwave.geometry.cad.joints import JointWords, NamedParts, TieWords, Under, Words, picked
from beadwave.geometry.cad.patches import Spots
from beadwave.geometry.cad.removals import Removal, Zone
from beadwave.geometry.cad.selectors import FaceSelection
from beadwave.geometry.cad.solids import SAME, Body
from beadwave.geometry.cad.struck_face import Struck
from beadwave.geometry.drawing import Drawing, FinePoint, Sizing, drawn, meshed
from beadwave.geometry.meshing.lined_blocks import lined_meshes
from beadwave.geometry.quality import volume_of
from beadwave.workflows.files.mesh_reader import volumes_of
from beadwave.workflows.files.step import require_step
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.scene.body_shapes import grid_lines, shapes
from beadwave.workflows.scene.places import (
    chain_face,
    named_faces,
    part_face,
    paths_of,
    spring_face,
)
from beadwave.workflows.scene.rules.size import too_large_mesh
from beadwave.workflows.scene.tables.bodies import GROUND, SHARE, Solid, UnderTable
from beadwave.workflows.stages.structure.bolted_joints import (
    BoltedPlace,
    FacesInContact,
    bolted_places,
    faces_in_contact,
)
from beadwave.workflows.stages.structure.meshed_parts import STRIKE, ElementSizes, Parts
from beadwave.workflows.stages.structure.round_faces import (
    hertzian_contacts,
    with_round_contacts,
)
from beadwave.workflows.stages.structure.strike import around, in_words_of, struck


@contextmanager
def drawing(scene: Scene, coarser: float = 1.0, *, lines: bool = True) -> Iterator[Drawing]:
    """The scene's bodies, without `lines` in the CAD kernel even where grid lines are prescribed;
    raises InvalidScene for what cannot be drawn, read, picked or joined."""
    table = scene.assembly
    try:
        # a mesh: the user's, or between the grid lines that the scene prescribes
        solids, volumes, scale = {}, {}, coarser * scene.mesh.scale
        remarks: tuple[str, ...] = ()
        if table.mesh:
            volumes, remarks = volumes_of(Path(table.mesh), table.volumes or (), table.merge)
        else:
            solids = shapes(scene)
            prescribed = grid_lines(scene, scale) if lines else {}
            seeds = {name: scale * scene.seed_of(name) for name in prescribed}
            volumes = lined_meshes(solids, prescribed, seeds)
        step = Path(table.step) if table.step and not volumes else None
        if step:
            require_step(step)
        with drawn({} if volumes else solids, step, volumes, table.gap) as bodies:
            bodies = bodies._replace(remarks=bodies.remarks + remarks)
            yield with_round_contacts(scene, bodies)
    except InvalidGeometry as error:
        raise InvalidScene(f"{scene.name}: {error}") from None


def words(scene: Scene) -> Words:
    """All faces and bodies that the scene names, as it names them; names of faces say what they are
    of: "held-1", "load-NAME", "rod-NAME" and those of `places.named_faces`."""
    faces = {f"held-{i}": hold.on for i, hold in enumerate(scene.assembly.holds, start=1)}
    for load in scene.loads or ():
        ends = {"load": load.on, "rod": load.to}
        faces |= {f"{end}-{load.name}": selector for end, selector in ends.items() if selector}
    faces |= named_faces(scene)

    # joints: their partners, the bolts' places, and on which sides a washer is imprinted
    joints = []
    for joint in scene.joints or ():
        rigid = tuple(i for i, coupling in enumerate(joint.sides) if coupling == "rigid")
        for i, (first, second) in enumerate(joint.pairs, start=1):
            joints.append(
                JointWords(
                    joint.name,
                    f"joints.{joint.name}",
                    first,
                    # the ground stands on the second side
                    None if second == GROUND else second,
                    joint.at,
                    joint.washer if isinstance(joint.washer, float) else None,
                    # a bolt's share is imprinted on the sides that are rigid, else on the first
                    (rigid or (0,)) if joint.washer == SHARE else (),
                    f"{joint.name}-{i}" if joint.stack else None,
                    joint.only_touches,
                )
            )
    struck = scene.strike.on if scene.strike else None
    tables = scene.model_dump(exclude_none=True)
    unders = {f"held-{i}": h.under for i, h in enumerate(scene.assembly.holds, start=1) if h.under}
    return Words(
        bodies=tuple(scene.bodies or ()),
        under={name: _under(table) for name, table in unders.items()},
        groups={f"loads.{load.name}": load.body for load in scene.loads or () if load.body},
        faces=faces,
        keys={
            selector: ".".join(path)
            for selector in (*faces.values(), *([struck] if struck else ()))
            if (path := next(paths_of(selector, tables), None))
        },
        struck=struck,
        ties=[TieWords(tie.between, tie.under and _under(tie.under)) for tie in scene.ties or ()],
        joints=joints,
    )


def _under(table: UnderTable) -> Under:
    return Under(table.at, table.radius, table.sides)


class Placed(NamedTuple):
    """Faces, bodies and joints that a scene's words pick, and element sizes, before any mesh."""

    selection: NamedParts
    ties: list[TouchingPair]
    pressed: list[TouchingPair]  # that bolts or loads keep in contact
    reach: dict[str, float]  # [m] apart, up to which faces of these are in contact, by their names
    bolted: dict[int, BoltedPlace]
    in_contact: tuple[FacesInContact, ...]
    struck: Struck | None
    struck_by_chains: dict[str, Struck]
    named: dict[str, FaceSelection]
    sizing: Sizing


def placed(
    scene: Scene, layout: Drawing, sizes: ElementSizes = ElementSizes(), coarser: float = 1.0
) -> Placed:
    """Places struck, tied, bolted and held on a drawing of the scene, and the sizes of elements,
    `coarser` times as large.

    Raises InvalidScene for a body without material, for a patch that lies between two bodies, and
    for all that `tied_pairs` refuses; InvalidGeometry for words that pick nothing.
    """
    bodies, near, gap = layout.bodies, layout.near, scene.assembly.gap
    selection = picked(words(scene), bodies, near.touching, gap)
    for name in bodies:
        if scene.material_name(name) is None:
            raise InvalidScene(
                f'{scene.name}: nothing says what "{name}" is made of; give '
                f"bodies.{name}.material, or assembly.material for all."
            )
    ties = tied_pairs(scene, layout, selection)
    bolted = bolted_places(scene, selection, bodies, near.touching)
    in_contact = faces_in_contact(scene, layout, selection.jointed)
    joined = {frozenset(p.pair.split("|")) for p in (*bolted.values(), *in_contact)}
    pressed = [touch for touch in near.touching if frozenset(touch.bodies) in joined]
    named = {n: face for n, face in selection.faces.items() if n not in selection.patches}
    hits = _hits(scene, layout, selection, sizes.fine)
    face = hits[0][0] if hits else None
    if face:
        named[STRIKE] = face.face
    struck_by_chains = {
        row.name: hit for row, (hit, _) in zip(scene.chains or (), hits, strict=False)
    }
    named |= {chain_face(name): hit.face for name, hit in struck_by_chains.items()}

    # a crystal's last row touches at many places, none of them finer than the face
    fine = [FinePoint(hit.face.body, hit.point, size) for hit, size in hits if not scene.crystal]
    reach, graded = {}, set()
    for touch in pressed:
        at_rounds = hertzian_contacts(
            scene, bodies, touch, layout.round_contacts.get(touch.name, ()), list(bolted.values())
        )
        reach[touch.name] = max((one.reach for one in at_rounds), default=touch.gap)
        fine += [place for one in at_rounds for place in one.fine]
        graded |= {body for one in at_rounds for body in one.graded}
    sizing = sizing_of(scene, layout, fine, sizes, coarser)._replace(graded=graded)
    return Placed(
        selection, ties, pressed, reach, bolted, in_contact, face, struck_by_chains, named, sizing
    )


def sizing_of(
    scene: Scene,
    layout: Drawing,
    fine: Sequence[FinePoint] = (),
    sizes: ElementSizes = ElementSizes(),
    coarser: float = 1.0,
) -> Sizing:
    """Sizes of elements: those of the scene, with `fine` ones at points of bodies, or `sizes` that
    were chosen, all of them `coarser` times as large."""
    bodies = layout.bodies
    fields = {
        name: field.stretched(sizes.boxes[name], box_of(bodies[name]))
        for name, field in sizes.fields.items()
        if name in bodies
    }
    seeds = {name: scene.seed_of(name) for name in bodies}
    element = "tet" if scene.mesh.element == "tet" else None
    return Sizing(
        scene.assembly.gap, scene.mesh.scale, seeds, fine, coarser, element, fields, sizes.usual,
        scene.mesh.seconds, sizes.curved,
    )  # fmt: skip


def box_of(body: Body) -> NDArray[np.float64]:
    """(2, 3) [m], the lower and the upper corner of the box around a body."""
    return np.array([body.lower, body.upper])


def parts(scene: Scene, sizes: ElementSizes = ElementSizes(), coarser: float = 1.0) -> Parts:
    """Bodies meshed each on its own, and what joins, holds and loads them.

    Elements have the `sizes`, `coarser` times as large; a mesh of the user's stays as it is.
    Raises InvalidScene for all that `drawing` and `placed` refuse, for sizes of other bodies, and
    for a mesh that does not fit into memory.
    """
    coarser *= sizes.scale
    with drawing(scene, coarser) as layout:
        if scene.mesh.sizes and (strange := sizes.fields.keys() - layout.bodies.keys()):
            raise InvalidScene(
                f"{scene.name}: mesh.sizes = {scene.mesh.sizes!r} holds sizes of {min(strange)!r}, "
                f"the bodies are {', '.join(layout.bodies)}; drop mesh.sizes, or give the "
                "sizes.npz of a run of these bodies."
            )
        chosen = placed(scene, layout, sizes, coarser)
        left_out: tuple[Removal, ...] = ()
        if scene.mesh.simplify and not layout.own:
            layout, left_out = without_small_features(scene, layout, chosen)
            chosen = placed(scene, layout, sizes, coarser) if left_out else chosen
        selection, ties, bolted = chosen.selection, chosen.ties, chosen.bolted
        boxes = {name: box_of(body) for name, body in layout.bodies.items()}
        volumes = {name: body.volume for name, body in layout.bodies.items()}
        joined = [*ties, *chosen.pressed]
        meshes, fineness = meshed(layout, selection, joined, chosen.named, chosen.sizing)

    made_of = {name: material(scene.made_of(name)) for name in meshes}
    chords = {name: volume_of(mesh) / volumes[name] - 1 for name, mesh in meshes.items()}
    connections, rigid = _connections(scene, selection, ties, fineness, bolted)
    closed = tuple(
        _tie(touch, fineness)._replace(gap=chosen.reach[touch.name]) for touch in chosen.pressed
    )
    whole = Parts(
        meshes, made_of, connections, rigid, chosen.struck, chosen.struck_by_chains,
        _load(scene, selection), sizes, tuple(bolted.values()), closed, chosen.in_contact, boxes,
        chords, left_out,
    )  # fmt: skip

    # a mesh that does not fit into memory is refused before assembly
    for sentence in too_large_mesh(scene, "the mesh of [assembly]", whole.nodes):
        raise InvalidScene(f"{scene.name}: {sentence}")
    return whole


def without_small_features(
    scene: Scene, layout: Drawing, chosen: Placed
) -> tuple[Drawing, tuple[Removal, ...]]:
    """The drawing without features below mesh.simplify, and these. Faces that the scene names,
    those on which another body lies, and what lies under patches or around joints stay."""
    from beadwave.geometry.cad.simplified import simplified

    selection, near = chosen.selection, layout.near
    patches = selection.patches.values()
    named = [*selection.faces.values(), *chosen.named.values(), *(patch.on for patch in patches)]
    # a face that is struck by a chain, or on which a patch lies, is large: it stays by itself
    kept = {tag for face in named for tag in face.tags}
    for touch in near.touching:
        kept |= {tag for contact in touch.contacts for tag in contact.faces}

    zones = []
    for patch in patches:
        centres = patch.centres if isinstance(patch, Spots) else [patch.centre]
        own = getattr(patch, "radius", None) or 0.0
        reach = max(own, *(getattr(patch, "sides", None) or (0.0,)))
        zones += [Zone(patch.on.body, np.asarray(centre), reach) for centre in centres]
    for struck_there, size in _hits(scene, layout, selection, fine=True):
        zones.append(Zone(struck_there.face.body, struck_there.point, size))
    for place in selection.joints:
        reach = max((diameter for diameter, _ in place.holes), default=0.0)
        zones += [Zone(body, place.centre, max(reach, scene.assembly.gap)) for body in place.bodies]
    bodies, left_out = simplified(layout.bodies, scene.mesh.simplify, kept, zones)
    if not left_out:
        return layout, ()
    from beadwave.geometry.cad.touching import neighbours

    return layout._replace(bodies=bodies, near=neighbours(bodies, scene.assembly.gap)), left_out


def with_bolts_of(scene: Scene, mesh: Parts) -> Parts:
    """The meshed parts with the bolts of a scene that differs in these alone: in preloads, friction
    and roughness; nothing is meshed."""
    with drawing(scene) as layout:
        anew = placed(scene, layout, mesh.sizes)
    return mesh._replace(bolted=tuple(anew.bolted.values()), in_contact=anew.in_contact)


def _hits(
    scene: Scene, layout: Drawing, selection: NamedParts, fine: bool
) -> list[tuple[Struck, float]]:
    """Places that are struck, with the size of elements [m] there, infinite where it is neither
    given nor to be `fine`: that of the scene, or of each of several chains in their order. Raises
    InvalidScene where another body lies on one."""
    several = scene.of_each_chain
    if scene.crystal:
        strikes = {"crystal": (scene, selection.struck)} if scene.strike else {}
    elif not several:
        strikes = {"strike": (scene, selection.struck)} if scene.strike else {}
    else:
        strikes = {
            f"chains.{name}": (one, selection.faces[chain_face(name)])
            for name, one in several.items()
        }
    hits = []
    for key, (one, selected) in strikes.items():
        with in_words_of(key):
            hit = struck(one, layout.bodies, selected)
        # another body on the face at the point struck would be struck in its place
        body, radius = hit.face.body, one.strike.radius
        points = around(hit.point, hit.outward, radius)
        if over := layout.near.over(body, points, layout.bodies, scene.assembly.gap):
            raise InvalidScene(
                f'{scene.name}: {key}.on = {one.strike.on!r}: "{over}" lies on {body} at '
                f"the point struck, {np.round(hit.point, 6).tolist()} m, or less than "
                f"{radius:g} m next to it; move it by {key}.at."
            )
        hits.append((hit, one.strike.size if fine or one.strike.seed else np.inf))
    return hits


def tied_pairs(scene: Scene, layout: Drawing, selection: NamedParts) -> list[TouchingPair]:
    """The touching pairs that are tied.

    Raises InvalidScene for a touching pair of which the scene says nothing, for one that is tied
    and has a joint, and for a body that nothing joins or holds.
    """
    touching, tied, jointed = layout.near.touching, selection.tied, selection.jointed
    for name in tied.keys() & jointed.keys():
        raise InvalidScene(
            f'{scene.name}: "{name}" is tied and has the joint {jointed[name]!r}, which a tie '
            "would bridge; drop one of them."
        )
    unsaid = [t for t in touching if t.name not in tied.keys() | jointed.keys()]
    if scene.assembly.touching == "ask" and unsaid:
        pairs = ", ".join(f'"{t.name}" ({1e6 * t.area:.4g} mm^2)' for t in unsaid)
        lines = "\n".join(f'[[ties]]\nbetween = "{t.name}"' for t in unsaid)
        raise InvalidScene(
            f"{scene.name}: {pairs} touch, and nothing says whether they are tied, bolted or free; "
            'write assembly.touching = "tied" or "free", [[joints]], or of these what is meant:\n'
            f"{lines}"
        )

    # a body among others that touches none, is not held and on no springs would keep its rigid
    # motions; whether springs hold it in all directions is judged with the model
    n_holds = len(scene.assembly.holds)
    supported = {selection.faces[f"held-{i + 1}"].body for i in range(n_holds)}
    supported |= {body for place in selection.joints for body in place.bodies}
    supported |= {
        selection.faces[spring_face(spring.name, end)].body
        for spring in scene.springs or () for end in spring.ends
    }  # fmt: skip
    supported |= {selection.faces[part_face(part.name)].body for part in scene.measured or ()}
    free = [name for name in layout.near.free(layout.bodies) if name not in supported]
    if len(layout.bodies) > 1 and free:
        # of several the smallest is meant to be joined to the others
        loose = min(free, key=lambda name: layout.bodies[name].volume)
        misses = [miss for miss in layout.near.misses if loose in miss.bodies]
        # a wider gap lets faces touch that are apart, not edges and points that meet
        apart = min((m.distance for m in misses if m.distance > SAME), default=None)
        wider = "" if apart is None else f", or raise assembly.gap above {1e3 * apart:.4g} mm"
        raise InvalidScene(
            f'{scene.name}: "{loose}" touches no other body and is not held: it keeps its six '
            f"rigid motions; move it so that a face of it lies on another body, or hold it{wider}."
            + "".join(f" {miss.sentence}" for miss in misses)
        )
    return [*tied.values(), *(unsaid if scene.assembly.touching == "tied" else ())]


def _tie(touch: TouchingPair, fineness: Mapping[str, float]) -> fem.Tie:
    """All that touches, tied: nodes of the finer face follow the coarser one, the other way round
    nodes of the finer one between them would be free."""
    master, slave = sorted(touch.bodies, key=lambda body: fineness[body])
    return fem.Tie(f"{slave}:{touch.name}", f"{master}:{touch.name}", touch.gap)


def _connections(
    scene: Scene,
    selection: NamedParts,
    ties: list[TouchingPair],
    fineness: dict[str, float],
    bolted: Mapping[int, BoltedPlace],
) -> tuple[fem.Connections, fem.Connections]:
    """Ties, joints and held faces as `fem` takes them, and the same with rigid joints and with ties
    over all that touches; `fineness` orders masters and slaves."""
    tied, wholly = [], []
    for touch in ties:
        wholly.append(_tie(touch, fineness))
        partly = selection.partly.get(touch.name)
        tied.append(fem.Tie(*partly, touch.gap) if partly else wholly[-1])

    # joints: springs along the axes of a frame, of which z is along the bolt unless it is global
    joints, tables = [], {joint.name: joint for joint in scene.joints or ()}
    for i, place in enumerate(selection.joints):
        table = tables[place.joint]
        # the two faces of a bolt's share may lie apart by the gap on either side
        gap = 2 * scene.assembly.gap if table.washer == SHARE else 0.0
        sides = [
            fem.Side(face, coupling, over, gap=gap)
            for face, coupling, over in zip(place.faces, table.sides, place.over, strict=False)
        ]
        # of a bolt that is known from its drawing by formula, where the scene has none
        springs = (
            bolted[i].springs if i in bolted
            else fem.Bushing(**{key: getattr(table, key) for key in fem.DIRECTIONS})
        )  # fmt: skip
        frame = fem.normal_frame(place.axis) if table.frame == "normal" else np.eye(3)
        first, second = sides if len(sides) == 2 else (*sides, None)
        joints.append(fem.Joint(table.name, first, second, place.centre, springs, frame))

    held = [
        fem.HeldFace(_in_mesh(selection, f"held-{i}"), hold.directions)
        for i, hold in enumerate(scene.assembly.holds, start=1)
    ]
    rigid = [joint._replace(springs=fem.Bushing()) for joint in joints]
    return fem.Connections(tied, joints, held), fem.Connections(wholly, rigid, held)


def _load(scene: Scene, selection: NamedParts) -> fem.Load | None:
    """Forces, rods and heat that act before the impact; raises InvalidScene for heat on a body
    whose material has no coefficient of expansion."""
    if not scene.loads:
        return None
    forces, rods, heat = [], [], {}
    for load in scene.loads:
        if load.force is not None:
            face = _in_mesh(selection, f"load-{load.name}")
            forces.append(fem.FaceForce(face, load.force, load.direction))
        if load.tension is not None:
            ends = [_in_mesh(selection, f"{end}-{load.name}") for end in ("load", "rod")]
            rods.append(fem.Rod(*ends, load.tension, load.stiffness or 0.0))
        for body in selection.groups.get(f"loads.{load.name}", ()):
            expansion = scene.made_of(body).expansion
            if expansion is None:
                raise InvalidScene(
                    f"{scene.name}: loads.{load.name} warms {body!r}, whose material "
                    f"{scene.material_name(body)!r} has no expansion; add it, in 1/K."
                )
            heat[body] = fem.Heat(load.temperature, expansion)
    return fem.Load(forces, heat, rods)


def _in_mesh(selection: NamedParts, name: str) -> str:
    """A named face as the meshes have it, "body:name"."""
    return f"{selection.faces[name].body}:{name}"


def material(solid: Solid) -> fem.Material | fem.Orthotropic:
    """The material of a table of [materials]: isotropic, or orthotropic in its own axes."""
    if solid.is_isotropic:
        return fem.Material(solid.young, solid.poisson, solid.density)
    axes = {} if solid.axes is None else {"axes": solid.axes}
    return fem.Orthotropic(solid.young, solid.poisson, solid.shear, solid.density, **axes)
