"""Parameters of an assembly of bodies for `tune`: joint stiffnesses, factors on materials, on
masses that faces carry and on springs between points."""

from collections.abc import Mapping, Sequence

from beadwave import fem
from beadwave.fem.modes.mac import SPRINGS
from beadwave.fem.updating.tuning import CARRIED, TuningParameter
from beadwave.workflows.scene import InvalidScene, Scene, nearest

SHIFT = (1e7, 1e4, 1e12)  # start, lower, upper [N/m]
TURN = (1e2, 1e-1, 1e8)  # [N m/rad]
FACTOR = (1.0, 0.5, 2.0)  # of a modulus or a density
OF_SPRING = (1.0, 0.1, 10.0)  # of a cord or foam, of which hardly more than the order is known
MATERIAL = ("young", "density")
FACTORS = (*MATERIAL, "mass")  # keys of which a factor is fitted


def known(scene: Scene) -> list[str]:
    """Names of all stiffnesses of joints, of all moduli and densities, of carried masses and of
    springs between points."""
    of_joints = [f"joints.{name}.{key}" for name in scene.bushings for key in fem.DIRECTIONS]
    of_materials = [f"materials.{name}.{key}" for name in scene.materials for key in MATERIAL]
    of_masses = [f"masses.{mass.name}.mass" for mass in scene.masses or ()]
    of_springs = [
        f"springs.{spring.name}.{key}"
        for spring in scene.springs or ()
        for key in spring.stiffnesses
    ]
    return of_joints + of_materials + of_masses + of_springs


def full_name(scene: Scene, name: str) -> str:
    """joints.m8.kz of "m8.kz" where no other table has an entry m8 with that key; any other name as
    it is."""
    longer = [key for key in known(scene) if key.partition(".")[2] == name]
    return longer[0] if len(longer) == 1 else name


def freed(scene: Scene, names: Sequence[str]) -> list[TuningParameter]:
    """Parameters by name, started from the values that the scene has; raises InvalidScene."""
    if not names:
        raise InvalidScene(f"--free is missing; name what to vary of {', '.join(known(scene))}.")
    names = [full_name(scene, name) for name in names]
    for name in names:
        if name not in known(scene):
            raise InvalidScene(f"--free {name} is not known, {nearest(name, known(scene))}.")
        if names.count(name) > 1:
            raise InvalidScene(f"--free {name} is named twice; drop one.")
    parameters = []
    for name in names:
        table, entry, key = name.split(".")
        if table == "materials":
            if not scene.materials[entry].is_isotropic:
                raise InvalidScene(
                    f"--free {name} is of an orthotropic material, which is not tuned yet."
                )
            parameters.append(TuningParameter(name, (), *FACTOR, (), key, (1.0,)))
            continue
        if table == "masses":
            of_it = (f"{CARRIED}{entry}",)
            parameters.append(TuningParameter(name, (), *FACTOR, of_it, "density", (1.0,)))
            continue
        if table == "springs":
            of_it = (f"{SPRINGS}{entry}.{key}",)
            parameters.append(TuningParameter(name, (), *OF_SPRING, of_it, "young", (1.0,)))
            continue
        start, lower, upper = TURN if key.startswith("kr") else SHIFT
        value = scene_value(scene, name)
        start = value if lower <= value <= upper else start
        parameters.append(
            TuningParameter(name, (f"{entry}.{key}",), start, lower, upper, before=(value,))
        )
    return parameters


def on_bodies(
    scene: Scene, parameters: Sequence[TuningParameter], bodies: Sequence[str]
) -> list[TuningParameter]:
    """The parameters, those of a material with those of the `bodies` that are made of it."""
    solid = [body for body in bodies if not body.startswith((CARRIED, SPRINGS))]
    with_bodies = []
    for p in parameters:
        table, material, _ = p.name.split(".")
        if table == "materials":
            p = p._replace(bodies=tuple(b for b in solid if scene.material_name(b) == material))
        with_bodies.append(p)
    return with_bodies


def scene_value(scene: Scene, name: str) -> float:
    """The scene's value of a parameter by its name: a stiffness [N/m, N m/rad], a material's, or a
    mass [kg]."""
    table, entry, key = name.split(".")
    masses, springs = ({one.name: one for one in t or ()} for t in (scene.masses, scene.springs))
    tables = {
        "joints": scene.bushings, "materials": scene.materials, "masses": masses, "springs": springs
    }  # fmt: skip
    return getattr(tables[table][entry], key)


def with_values(scene: Scene, value: Mapping[str, float]) -> Scene:
    """The scene with stiffnesses, and with factors on what its materials have, on its masses, whose
    inertia grows with them, and on its springs between points."""
    joints = {joint.name: joint for joint in scene.joints or ()}
    materials, masses = dict(scene.materials), {mass.name: mass for mass in scene.masses or ()}
    springs = {spring.name: spring for spring in scene.springs or ()}
    for name, x in value.items():
        table, entry, key = name.split(".")
        if table == "joints":
            joints[entry] = joints[entry].model_copy(update={key: float(x)})
        elif table == "masses":
            one = masses[entry]
            inertia = one.inertia and tuple(times(x, J) for J in one.inertia)
            update = {"mass": times(x, one.mass), "inertia": inertia}
            masses[entry] = one.model_copy(update=update)
        elif table == "springs":
            update = {key: float(x) * getattr(springs[entry], key)}
            springs[entry] = springs[entry].model_copy(update=update)
        else:
            update = {key: times(x, scene_value(scene, name))}
            materials[entry] = materials[entry].model_copy(update=update)
    update = {"joints": tuple(joints.values()) or None, "materials": materials}
    update["masses"] = tuple(masses.values()) or None
    update["springs"] = tuple(springs.values()) or None
    return scene.model_copy(update=update)


def times(factor: float, value: float) -> float:
    """A value times a factor, without the digits that rounding makes of short numbers."""
    return float(f"{float(factor) * value:.12g}")
