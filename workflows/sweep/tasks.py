"""Pieces of a sweep's work: cases computed together, and what tasks share."""

from collections.abc import Iterator
from math import isfinite
from typing import NamedTuple

from workflows.scene import InvalidScene, Scene
from workflows.sweep.cases import Base, Checked, Group, checked, groups
from workflows.sweep.core.design import Design
from workflows.sweep.models import Source, models_key

CHUNK = 500  # cases side by side: what a killed sweep loses at the most
ALONE = 20  # cases one after another, some seconds
SPRINGS = ("kx", "ky", "kz", "krx", "kry", "krz")


class Task(NamedTuple):
    """Cases computed together."""

    checked: Checked
    signals: bool


class Sharing(NamedTuple):
    """Tasks on one wall; those of the same key share their reduced models too."""

    scene: Scene | None  # of the first case; None where all are refused
    source: Source | None
    key: str | None  # None where no reduced model is computed
    tasks: list[Task]


def sharings(base: Base, design: Design, cases: list[int], signals: bool) -> Iterator[Sharing]:
    """For each group of these cases, the tasks that share its wall."""
    return (sharing(base, design, group, signals) for group in groups(base, design, cases))


def sharing(base: Base, design: Design, group: Group, signals: bool) -> Sharing:
    """The tasks of a group of cases."""
    looked = checked(base, group)
    scene = looked.scene
    source = scene and source_of(looked, design)
    size = CHUNK if scene and looked.joins else ALONE
    tasks = [Task(part, signals) for part in looked.parts(size)]
    return Sharing(scene, source, source and models_key(source), tasks)


def source_of(looked: Checked, design: Design) -> Source:
    """The scene whose reduced models serve the group: its own or, where springs of joints vary,
    that with the springs of the scene that is swept."""
    own, values = looked.scene, looked.group.values(0)
    keys = [key for key in values if _is_spring(key, own)]
    if not keys or own.reduction.kind != "craig-bampton":
        return Source(own)
    try:
        usual = looked.base.with_values({k: v for k, v in values.items() if k not in keys})
    except InvalidScene:
        return Source(own)
    springs = tuple(key.removeprefix("joints.") for key in keys)
    every = [k for key in keys for k in design.columns[key]]
    every += [usual.stiffness(spring) for spring in springs]
    if all(isinstance(k, int | float) and isfinite(k) for k in every):
        return Source(usual, springs)
    return Source(own)


def _is_spring(key: str, scene: Scene) -> bool:
    joint, _, direction = key.removeprefix("joints.").rpartition(".")
    return key.startswith("joints.") and joint in scene.springs and direction in SPRINGS
