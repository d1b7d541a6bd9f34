"""Tasks of a sweep: cases computed together, and the reduced models that tasks share."""

from collections.abc import Iterator
from math import isfinite
from typing import NamedTuple

from beadwave.workflows.scene import InvalidScene, LossFactorsTable, Scene
from beadwave.workflows.sweep.cases import Base, CheckedGroup, Group, checked, groups
from beadwave.workflows.sweep.core.design import Design
from beadwave.workflows.sweep.models import Source, has_spheres, models_key

CHUNK = 500  # cases of a task that march side by side: a killed sweep loses at most so many
ALONE = 20  # cases of a task that march one after another, some seconds
SPRINGS = ("kx", "ky", "kz", "krx", "kry", "krz")


class Task(NamedTuple):
    """Cases computed together."""

    checked: CheckedGroup
    signals: bool


class Sharing(NamedTuple):
    """Tasks on one wall; those of the same key share their reduced models too."""

    scene: Scene | None  # of the first case; None where all are refused
    source: Source | None
    key: str | None  # None where no reduced model is computed
    tasks: list[Task]


def sharings(
    base: Base, design: Design, cases: list[int], signals: bool, *, here: bool = False
) -> Iterator[Sharing]:
    """For each group of these cases, the tasks that share its wall. Cases without a chain computed
    `here`, in this process, that differ in preload, friction and roughness follow each other and
    share the rest."""
    if not here or not (varied := pressed_keys(base, design)):
        yield from (sharing(base, design, group, signals) for group in groups(base, design, cases))
        return
    from beadwave.workflows.stages.structure.pressed_family import PressedFamily

    others = [key for key in design.keys if key not in varied]
    by_values: dict[str, list[int]] = {}
    for i in cases:
        by_values.setdefault(repr([design.columns[key][i] for key in others]), []).append(i)
    for alike in by_values.values():
        family = None
        for group in groups(base, design, alike):
            of_group = sharing(base, design, group, signals)
            if of_group.source is not None:
                family = family or PressedFamily(of_group.source.pipeline)
                of_group = of_group._replace(source=of_group.source._replace(family=family))
            yield of_group


def pressed_keys(base: Base, design: Design) -> list[str]:
    """Keys of the design that leave the interface of faces in contact as it is condensed."""
    try:
        scene = base.with_values(design.case(0))
    except InvalidScene:
        return []
    in_contact = any(joint.model == "contact" for joint in scene.bushings.values())
    if has_spheres(scene) or not in_contact:
        return []
    from beadwave.workflows.stages.structure.pressed_family import varied

    return varied(scene, design.columns)


def sharing(base: Base, design: Design, group: Group, signals: bool) -> Sharing:
    """The tasks of a group of cases."""
    scenes = checked(base, group)
    size = CHUNK if scenes.scene and scenes.side_by_side else ALONE
    tasks = [Task(piece, signals) for piece in scenes.pieces(size)]
    if scenes.scene is None:
        return Sharing(None, None, None, tasks)
    source = source_of(scenes, design)
    return Sharing(scenes.scene, source, models_key(source), tasks)


def source_of(checked_group: CheckedGroup, design: Design) -> Source:
    """The scene whose reduced models serve the group: its first one or, where springs of joints
    vary, that with the springs of the scene that is swept, as K(k) = K0 + sum k_j b_j b_j^T is
    reduced once for all k."""
    scene, values = checked_group.scene, checked_group.group.values(0)
    keys = []
    for key in values:
        joint, _, direction = key.removeprefix("joints.").rpartition(".")
        if key.startswith("joints.") and joint in scene.bushings and direction in SPRINGS:
            keys.append(key)
    if not keys or scene.reduction.kind != "craig-bampton":
        return Source(scene)
    # shares of parts in the strain of modes change with the stiffness of joints
    if isinstance(scene.damping, LossFactorsTable):
        return Source(scene)
    try:
        other_values = {key: value for key, value in values.items() if key not in keys}
        usual = checked_group.base.with_values(other_values)
    except InvalidScene:
        return Source(scene)

    # springs whose value is text, infinite or nan need a model each
    springs = tuple(key.removeprefix("joints.") for key in keys)
    stiffness = [k for key in keys for k in design.columns[key]]
    stiffness += [usual.stiffness(spring) for spring in springs]
    if all(isinstance(k, int | float) and isfinite(k) for k in stiffness):
        return Source(usual, springs)
    return Source(scene)
