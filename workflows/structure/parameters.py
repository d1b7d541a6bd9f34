"""Parameters of an assembly for `tune`: joint stiffnesses, factors on materials, on masses that
faces carry and on springs between points; of the thesis' rig its joints and its block, by names
without their table, "head.ky"."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from beadwave import fem
from beadwave.fem.modes.mac import SPRINGS
from beadwave.fem.updating.tuning import CARRIED, TuningParameter
from beadwave.workflows.scene import InvalidScene, Scene, nearest
from beadwave.workflows.scene.rig import RigScene
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.engine.progress import Progress

SHIFT = (1e7, 1e4, 1e12)  # start, lower, upper [N/m]
TURN = (1e2, 1e-1, 1e8)  # [N m/rad]
FACTOR = (1.0, 0.5, 2.0)  # of a modulus or a density
OF_SPRING = (1.0, 0.1, 10.0)  # of a cord or foam, of which hardly more than the order is known
MATERIAL = ("young", "density")
FACTORS = (*MATERIAL, "mass")  # keys of which a factor is fitted

PARTS = {"head": "sheets", "foot": "sheets_support"}  # of the rig, that its joints hold
RIG_STARTS = {"ky": (1e6, *SHIFT[1:]), "kz": (3e7, *SHIFT[1:]), "kt": (1e8, *SHIFT[1:])}
RIG_FACTOR = (1.0, 0.85, 1.15)  # of the block's modulus and density over those of other parts
TANGENTIAL = ("kx", "kz")  # what "kt" of the rig stands for


def known(scene: Scene) -> list[str]:
    """Names of all stiffnesses of joints, of all moduli and densities, of carried masses and of
    springs between points; of the rig those of its joints and its block."""
    if isinstance(scene, RigScene):
        of_joints = [f"{joint}.{key}" for joint in PARTS for key in (*fem.DIRECTIONS, "kt")]
        return of_joints + [f"block.{key}" for key in MATERIAL]
    of_joints = [f"joints.{name}.{key}" for name in scene.bushings for key in fem.DIRECTIONS]
    of_materials = [f"materials.{name}.{key}" for name in scene.materials for key in MATERIAL]
    of_masses = [f"masses.{mass.name}.mass" for mass in scene.masses or ()]
    of_springs = [
        f"springs.{spring.name}.{key}"
        for spring in scene.springs or ()
        for key in spring.stiffnesses
    ]
    return of_joints + of_materials + of_masses + of_springs


def tunable(scene: Scene) -> list[str]:
    """Known names of what is there and not of an orthotropic material, each value once."""
    if isinstance(scene, RigScene):
        there = {*scene.bushings, "block"}
        return [n for n in known(scene) if n.split(".")[0] in there and not n.endswith(".kt")]
    orthotropic = {("materials", name) for name, m in scene.materials.items() if not m.is_isotropic}
    return [name for name in known(scene) if place_of(name)[:2] not in orthotropic]


def usual(scene: Scene, match: Iterable[int]) -> tuple[str, ...]:
    """Names of the rig to free for the chosen modes; none of bodies."""
    modes = set(match)
    if not isinstance(scene, RigScene):
        return ()
    # one tangential stiffness cannot meet both 2 and 3
    joint = ("head.ky", "head.kz", "head.kry") if {2, 3} <= modes else ("head.ky", "head.kt")
    return (*joint, "block.young", "block.density") if 4 in modes else joint


def full_name(scene: Scene, name: str) -> str:
    """joints.m8.kz of "m8.kz" where no other table has an entry m8 with that key; any other name as
    it is."""
    longer = [key for key in known(scene) if key.partition(".")[2] == name]
    return longer[0] if len(longer) == 1 else name


def from_drawing(
    scene: Scene, names: Sequence[str], progress: Progress
) -> tuple[Scene, dict[str, float]]:
    """The scene with the springs named, of all without names, that follow from a drawing as
    numbers, and the standard deviations of their logarithms by name. Of bolts of a joint that
    differ the geometric mean is taken."""
    wanted = {full_name(scene, name) for name in names} if names else None
    of_bolts = {
        f"{joint}.{key}"
        for joint, table in scene.bushings.items()
        for key in fem.DIRECTIONS
        if getattr(table, key) is None and (wanted is None or f"joints.{joint}.{key}" in wanted)
    }
    if not of_bolts:
        return scene, {}
    in_contact = [n for n in sorted(of_bolts) if scene.bushings[n.split(".")[0]].model == "contact"]
    if in_contact and wanted is not None:
        raise InvalidScene(
            f'--free joints.{in_contact[0]}: its faces are in contact, model = "contact", and have '
            'no springs; take model = "springs", or free materials.'
        )
    values: dict[str, list[tuple[float, float]]] = {}
    for place in pipeline_of(scene, progress)("mesh").bolted:
        for key, k, s in zip(fem.DIRECTIONS, place.springs, place.deviation, strict=True):
            if (name := f"{place.joint}.{key}") in of_bolts:
                values.setdefault(name, []).append((float(np.log(k)), float(s)))
    stiffness, known = {}, {}
    for name, pairs in values.items():
        log_k, s = np.array(pairs).T
        # four digits: a spread of some 10 % and more supports no others
        stiffness[name] = float(f"{np.exp(log_k.mean()):.4g}")
        known[f"joints.{name}"] = float(np.hypot(s.max(), log_k.std()))
    return scene.with_joints(stiffness), known


def freed(
    scene: Scene, names: Sequence[str], known_deviation: Mapping[str, float] = {}
) -> list[TuningParameter]:
    """Parameters by name, started from the values that the scene has where these lie between their
    bounds, with the standard deviations of their logarithms that are known; raises
    InvalidScene."""
    is_rig = isinstance(scene, RigScene)
    if is_rig and scene.rig.assembly.constraint != "wires":
        raise InvalidScene(
            f"assembly.constraint = {scene.rig.assembly.constraint!r} has no springs to tune; "
            "set assembly.constraint=wires."
        )
    if not names:
        raise InvalidScene(f"--free is missing; name what to vary of {', '.join(known(scene))}.")
    names = [full_name(scene, name) for name in names]
    set_by: dict[str, str] = {}
    parameters = []
    for name in names:
        if name not in known(scene):
            raise InvalidScene(f"--free {name} is not known, {nearest(name, known(scene))}.")
        if names.count(name) > 1:
            raise InvalidScene(f"--free {name} is named twice; drop one.")
        table, entry, key = place_of(name)
        if table == "masses":
            of_it = (f"{CARRIED}{entry}",)
            parameters.append(TuningParameter(name, (), *FACTOR, of_it, "density", (1.0,)))
            continue
        if table == "springs":
            of_it = (f"{SPRINGS}{entry}.{key}",)
            parameters.append(TuningParameter(name, (), *OF_SPRING, of_it, "young", (1.0,)))
            continue
        if is_rig and table == "joints" and entry not in scene.bushings:
            raise InvalidScene(
                f"{name} cannot be tuned: assembly.parts = {list(scene.rig.assembly.parts)} "
                f"has no {PARTS[entry]}; add it, or free something else."
            )
        if table == "materials":
            if not scene.materials[entry].is_isotropic:
                raise InvalidScene(
                    f"--free {name} is of an orthotropic material, which is not tuned yet."
                )
            bounds = RIG_FACTOR if is_rig else FACTOR
            p = TuningParameter(name, (), *bounds, (), key)
            before = (scene_value(scene, name) / reference(scene, name),)
        else:
            bounds = TURN if key.startswith("kr") else SHIFT
            bounds = RIG_STARTS.get(key, bounds) if is_rig else bounds
            p = TuningParameter(name, springs_of(name), *bounds)
            before = tuple(map(scene.stiffness, p.springs))
        for value in p.springs:
            if value in set_by:
                raise InvalidScene(f"--free {set_by[value]} and {name} set the same; drop one.")
            set_by[value] = name
        start = before[0] if p.lower <= before[0] <= p.upper else p.start
        deviation = known_deviation.get(name)
        parameters.append(p._replace(start=start, before=before, known=deviation))
    return parameters


def on_bodies(
    scene: Scene, parameters: Sequence[TuningParameter], bodies: Sequence[str]
) -> list[TuningParameter]:
    """The parameters, those of a material with those of the `bodies` that are made of it."""
    solid = [body for body in bodies if not body.startswith((CARRIED, SPRINGS))]
    with_bodies = []
    for p in parameters:
        table, material, _ = place_of(p.name)
        if table == "materials":
            p = p._replace(bodies=tuple(b for b in solid if scene.material_name(b) == material))
        with_bodies.append(p)
    return with_bodies


def place_of(name: str) -> tuple[str, str, str]:
    """Table, entry and key of a parameter's name; the rig's have no table."""
    *table, entry, key = name.split(".")
    return (*(table or ["joints" if entry in PARTS else "materials"]), entry, key)


def springs_of(name: str) -> tuple[str, ...]:
    """Springs "joint.key" of a stiffness by its name."""
    _, joint, key = place_of(name)
    return tuple(f"{joint}.{k}" for k in (TANGENTIAL if key == "kt" else (key,)))


def scene_value(scene: Scene, name: str) -> float:
    """The scene's value of a parameter by its name: a stiffness [N/m, N m/rad], a material's, or a
    mass [kg]."""
    table, entry, key = place_of(name)
    masses, springs = ({one.name: one for one in t or ()} for t in (scene.masses, scene.springs))
    tables = {
        "joints": scene.bushings, "materials": scene.materials, "masses": masses, "springs": springs
    }  # fmt: skip
    return getattr(tables[table][entry], key)


def scene_values(scene: Scene, p: TuningParameter) -> list[tuple[str, float]]:
    """Keys of the scene that the parameter sets, each with its value."""
    if len(p.springs) > 1:
        return [(spring, scene.stiffness(spring)) for spring in p.springs]
    return [(p.name, scene_value(scene, p.name))]


def reference(scene: Scene, name: str) -> float:
    """The value that a factor on a material multiplies: the scene's, of the rig's block that of
    the other parts."""
    if isinstance(scene, RigScene):
        return getattr(scene.rig.assembly, place_of(name)[2])
    return scene_value(scene, name)


def at_values(scene: Scene, parameters: Sequence[TuningParameter], value: Iterable[float]) -> Scene:
    """The scene with the parameters at these values."""
    return with_values(scene, dict(zip((p.name for p in parameters), value, strict=True)))


def with_values(scene: Scene, value: Mapping[str, float]) -> Scene:
    """The scene with stiffnesses, and with factors on what its materials have, on its masses, whose
    inertia grows with them, and on its springs between points."""
    joints: dict[str, float] = {}
    materials: dict[str, dict[str, float]] = {}
    masses = {mass.name: mass for mass in scene.masses or ()}
    springs = {spring.name: spring for spring in scene.springs or ()}
    for name, x in value.items():
        table, entry, key = place_of(name)
        if table == "joints":
            joints |= dict.fromkeys(springs_of(name), float(x))
        elif table == "masses":
            one = masses[entry]
            inertia = one.inertia and tuple(times(x, J) for J in one.inertia)
            update = {"mass": times(x, one.mass), "inertia": inertia}
            masses[entry] = one.model_copy(update=update)
        elif table == "springs":
            update = {key: float(x) * getattr(springs[entry], key)}
            springs[entry] = springs[entry].model_copy(update=update)
        else:
            materials.setdefault(entry, {})[key] = times(x, reference(scene, name))
    scene = scene.with_joints(joints).with_materials(materials)
    return scene.but(masses=tuple(masses.values()) or None, springs=tuple(springs.values()) or None)


def times(factor: float, value: float) -> float:
    """A value times a factor, without the digits that rounding makes of short numbers."""
    return float(f"{float(factor) * value:.12g}")
