"""What can be tuned of an assembly of bodies: stiffness of its joints, factors on materials."""

from collections.abc import Mapping, Sequence

import fem
from fem.tuning import TuningParameter
from workflows.scene import InvalidScene, Scene, nearest

SHIFT = (1e7, 1e4, 1e12)  # start, lower, upper [N/m]
TURN = (1e2, 1e-1, 1e8)  # [N m/rad]
FACTOR = (1.0, 0.5, 2.0)  # of a modulus or a density
MATERIAL = ("young", "density")


def known(scene: Scene) -> list[str]:
    """All names."""
    of_joints = [f"joints.{name}.{key}" for name in scene.springs for key in fem.DIRECTIONS]
    return of_joints + [f"materials.{name}.{key}" for name in scene.materials for key in MATERIAL]


def freed(scene: Scene, names: Sequence[str]) -> list[TuningParameter]:
    """What the names stand for, from the values that the scene has; raises InvalidScene."""
    if not names:
        raise InvalidScene(f"--free is missing; name what to vary of {', '.join(known(scene))}.")
    for name in names:
        if name not in known(scene):
            raise InvalidScene(f"--free {name} is not known, {nearest(name, known(scene))}.")
        if names.count(name) > 1:
            raise InvalidScene(f"--free {name} is named twice; drop one.")
    return [_parameter(scene, name) for name in names]


def _parameter(scene: Scene, name: str) -> TuningParameter:
    table, _, spring = name.partition(".")
    if table == "materials":
        _require_one_modulus(scene, name)
        return TuningParameter(name, (), *FACTOR, (), name.rpartition(".")[2], (1.0,))
    start, lower, upper = TURN if ".kr" in name else SHIFT
    value = now(scene, name)
    start = value if lower <= value <= upper else start
    return TuningParameter(name, (spring,), start, lower, upper, before=(value,))


def _require_one_modulus(scene: Scene, name: str) -> None:
    if not scene.materials[name.split(".")[1]].is_isotropic:
        raise InvalidScene(f"--free {name} is of an orthotropic material, which is not tuned yet.")


def on_bodies(scene: Scene, parameters: Sequence[TuningParameter], bodies: Sequence[str]):
    """The same with the bodies that each material's factor is on."""
    of = {p.name: p.name.split(".")[1] for p in parameters if not p.springs}
    made = {name: tuple(b for b in bodies if scene.material_name(b) == m) for name, m in of.items()}
    return [p._replace(bodies=made.get(p.name, ())) for p in parameters]


def now(scene: Scene, name: str) -> float:
    """The value that the scene has."""
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
            update = {key: float(x) * now(scene, name)}
            materials[entry] = materials[entry].model_copy(update=update)
    update = {"joints": tuple(joints.values()) or None, "materials": materials}
    return scene.model_copy(update=update)
