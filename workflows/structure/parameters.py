"""Parameters of an assembly of bodies for `tune`: joint stiffnesses, factors on materials."""

from collections.abc import Mapping, Sequence

import fem
from fem.tuning import TuningParameter
from workflows.scene import InvalidScene, Scene, nearest

SHIFT = (1e7, 1e4, 1e12)  # start, lower, upper [N/m]
TURN = (1e2, 1e-1, 1e8)  # [N m/rad]
FACTOR = (1.0, 0.5, 2.0)  # of a modulus or a density
MATERIAL = ("young", "density")


def known(scene: Scene) -> list[str]:
    """Names of all stiffnesses of joints and of all moduli and densities."""
    of_joints = [f"joints.{name}.{key}" for name in scene.springs for key in fem.DIRECTIONS]
    return of_joints + [f"materials.{name}.{key}" for name in scene.materials for key in MATERIAL]


def freed(scene: Scene, names: Sequence[str]) -> list[TuningParameter]:
    """Parameters by name, started from the values that the scene has; raises InvalidScene."""
    if not names:
        raise InvalidScene(f"--free is missing; name what to vary of {', '.join(known(scene))}.")
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
    """The parameters, those of a material with the bodies that are made of it."""
    with_bodies = []
    for p in parameters:
        material = None if p.springs else p.name.split(".")[1]
        of_it = tuple(b for b in bodies if material and scene.material_name(b) == material)
        with_bodies.append(p._replace(bodies=of_it))
    return with_bodies


def scene_value(scene: Scene, name: str) -> float:
    """The scene's value of a parameter by its name: a stiffness [N/m, N m/rad], or a material's."""
    table, entry, key = name.split(".")
    return getattr((scene.springs if table == "joints" else scene.materials)[entry], key)


def with_values(scene: Scene, value: Mapping[str, float]) -> Scene:
    """The scene with stiffnesses, and with factors on what its materials have."""
    joints = {joint.name: joint for joint in scene.joints or ()}
    materials = dict(scene.materials)
    for name, x in value.items():
        table, entry, key = name.split(".")
        if table == "joints":
            joints[entry] = joints[entry].model_copy(update={key: float(x)})
        else:
            update = {key: float(x) * scene_value(scene, name)}
            materials[entry] = materials[entry].model_copy(update=update)
    update = {"joints": tuple(joints.values()) or None, "materials": materials}
    return scene.model_copy(update=update)
