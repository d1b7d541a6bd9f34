"""Cases of a sweep in groups that share a wall, and whether their chains march side by side."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from beadwave.workflows.files.scene import Changes, Source, Written, completed, each, written
from beadwave.workflows.scene import HalfSpaceWall, InvalidScene, OneDofWall, Scene
from beadwave.workflows.scene.required_parts import with_chains_or_structure
from beadwave.workflows.scene.tables.bolts import BREAKING_UTILISATION
from beadwave.workflows.scene.toml import changed, keys_set
from beadwave.workflows.stages.chain.chain import TOGETHER
from beadwave.workflows.sweep.core.case_row import Watched
from beadwave.workflows.sweep.core.design import Design

SIDE_BY_SIDE = {f"{table}.{name}" for table, names in TOGETHER.items() for name in names}


class Base(NamedTuple):
    """The scene that a sweep varies."""

    written: Written
    given: tuple[str, ...] = ()  # dotted keys that changes set
    sizes_of: Scene | None = None  # its mesh.error chooses the sizes of elements of all cases

    def with_values(self, values: dict[str, Any]) -> Scene:
        """The scene of one case; raises InvalidScene."""
        # the kind of a table first, since to change it drops the other keys of the table
        ordered = sorted(values.items(), key=lambda pair: not pair[0].endswith(".kind"))
        tables = changed(self.written.tables, ordered)
        scene = with_chains_or_structure(completed(self.written._replace(tables=tables)))
        meshed = any(key.startswith("mesh.") for key in values)
        return scene if meshed or self.sizes_of is None else scene.with_sizes_of(self.sizes_of)

    def number(self, key: str, text: str) -> float:
        """Value of a text for a key of the scene, with its unit; raises InvalidScene."""
        try:
            return float(text)
        except ValueError:
            value: Any = self.with_values({key: text})
        # the value in the scene, which has read the unit of the text
        for name in key.split("."):
            if isinstance(value, tuple):  # of tables, by their names
                value = {str(getattr(row, "name", None)): row for row in value}
            value = value.get(name) if isinstance(value, dict) else getattr(value, name, None)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InvalidScene(f"{key}: {text!r} is no number; give numbers for a range.")
        return float(value)


def watched(scene: Scene) -> Watched:
    """The spheres of a scene that its table has waves of."""
    if not (scene.chain or scene.chains):
        return {}
    spheres = scene.output.spheres
    if scene.chain:
        return {"": spheres}
    return {
        f"{row.name}_": tuple(s for s in spheres if s <= row.count) for row in scene.chains or ()
    }


def base_of(source: Source, changes: Changes) -> Base:
    """The scene of a name, file or tables with its changes; raises InvalidScene."""
    pairs = each(changes)
    base = Base(written(source, pairs), keys_set(pairs))
    scene = base.with_values({})
    return base._replace(sizes_of=scene)


class Group(NamedTuple):
    """Cases that differ only in keys that chains side by side may differ in."""

    shared: dict[str, Any]  # values of the other keys
    columns: dict[str, tuple[Any, ...]]  # one value per case
    cases: tuple[int, ...]

    def values(self, i: int) -> dict[str, Any]:
        """Values of all keys in the i-th case of the group."""
        return self.shared | {key: column[i] for key, column in self.columns.items()}

    def take(self, rows: list[int]) -> "Group":
        """The group of its cases at these rows alone."""
        columns = {key: tuple(column[i] for i in rows) for key, column in self.columns.items()}
        return Group(self.shared, columns, tuple(self.cases[i] for i in rows))


def groups(base: Base, design: Design, missing: Sequence[int]) -> Iterator[Group]:
    """The missing cases of a design, grouped, in order of their first case."""
    if not missing:
        return

    # keys of one number per chain may differ within a march; all others split the cases
    joint = [
        key for key, values in design.columns.items()
        if key in SIDE_BY_SIDE
        and all(isinstance(v, int | float) and not isinstance(v, bool) for v in values)
    ]  # fmt: skip
    splitting = [key for key in design.keys if key not in joint]
    by_values: dict[str, Sequence[int]] = {} if splitting else {"all": missing}
    for i in missing if splitting else ():
        by_values.setdefault(repr([design.columns[key][i] for key in splitting]), []).append(i)

    # without a joint key cases of a group would be the same chain many times: one group each
    together = by_values.values() if joint else ([i] for cases in by_values.values() for i in cases)
    for cases in together:
        shared = {key: design.columns[key][cases[0]] for key in splitting}
        columns = {key: design.columns[key] for key in joint}
        if len(cases) < design.n_cases:
            columns = {key: tuple(column[i] for i in cases) for key, column in columns.items()}
        yield Group(shared, columns, tuple(cases))


def largest_utilisations(base: Base, design: Design) -> dict[str, float]:
    """Preload over proof load of the bolts of each joint, the largest of all cases that are not
    refused for it."""
    largest = {}
    for name, joint in base.with_values({}).bushings.items():
        keys = {key: f"joints.{name}.{key}" for key in ("bolt", "preload", "torque")}
        columns = {key: design.columns[k] for key, k in keys.items() if k in design.columns}
        if not (joint.bolt or "bolt" in columns):
            continue
        # a preload of the cases replaces the torque of the scene, and the other way round
        other = {key: None for key in ("preload", "torque") if {"preload", "torque"} & {*columns}}
        shares = []
        for values in set(zip(*columns.values(), strict=True)) or [()]:
            with suppress(ValueError, ArithmeticError, TypeError):  # such a case is refused
                case = joint.but(**(other | dict(zip(columns, values, strict=True))))
                shares.append(case.utilisation)
        sound = [share for share in shares if share <= BREAKING_UTILISATION]
        largest[name] = max(sound, default=0.0)
    return largest


@dataclass(frozen=True)
class CheckedGroup:
    """A group whose scenes were read, with a sentence for each case that is refused."""

    base: Base
    group: Group
    refused: dict[int, str]  # by place in the group

    @cached_property
    def scene(self) -> Scene | None:
        """The scene of the first case that is not refused."""
        n = len(self.group.cases)
        first = next((i for i in range(n) if i not in self.refused), None)
        return None if first is None else self.base.with_values(self.group.values(first))

    @cached_property
    def sound(self) -> Group:
        """The cases that are not refused."""
        n = len(self.group.cases)
        return self.group.take([i for i in range(n) if i not in self.refused])

    def pieces(self, size: int) -> Iterator["CheckedGroup"]:
        """The group in pieces of up to `size` cases; the refused ones are in the first."""
        refused = sorted(self.refused)
        if refused:
            sentences = {i: self.refused[place] for i, place in enumerate(refused)}
            yield CheckedGroup(self.base, self.group.take(refused), sentences)
        sound = self.sound
        for first in range(0, len(sound.cases), size):
            places = list(range(first, min(first + size, len(sound.cases))))
            yield CheckedGroup(self.base, sound.take(places), {})

    @property
    def watched(self) -> Watched:
        """The spheres that its rows have waves of."""
        return watched(self.scene or self.base.with_values({}))

    @property
    def across(self) -> bool:
        """True if its rows have columns of friction."""
        keys = (*self.group.shared, *self.group.columns)
        has_table = self.base.written.tables.get("friction") is not None
        return has_table or any(key.startswith("friction.") for key in keys)

    @property
    def side_by_side(self) -> bool:
        """True if its chains may march side by side."""
        scene = self.scene
        if not scene.chain:
            return False
        differs = {key.split(".")[0] for key in self.group.columns}
        return not (
            scene.contact.yield_pressure is not None
            or scene.time.dt is not None
            or scene.friction is not None
            or scene.time.duration > scene.time.horizon
            or ("wall" in differs and not isinstance(scene.wall, HalfSpaceWall | OneDofWall))
        )


def checked(base: Base, group: Group) -> CheckedGroup:
    """The group with its refused cases.

    Ranges and usual sizes are intervals: where the smallest and the largest value of each key are
    accepted, so are those between. Where one is refused, the scene of each case is read.
    """

    def refusals(places: Iterable[int]) -> Iterator[tuple[int, str]]:
        """Places of the cases that are refused among these, and why."""
        for i in places:
            try:
                base.with_values(group.values(i))
            except InvalidScene as reason:
                yield i, str(reason)

    probes = {0, len(group.cases) - 1}
    for column in group.columns.values():
        probes |= {int(np.argmin(column)), int(np.argmax(column))}
    if any(refusals(probes)):
        return CheckedGroup(base, group, dict(refusals(range(len(group.cases)))))
    return CheckedGroup(base, group, {})
