"""Chain and wall of a scene as functions of numbers in it; a reduced wall between computed ones."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
from joblib import Memory
from numpy.typing import NDArray

from beadwave import coupling, dem
from beadwave.workflows.fit.better_walls import FAILURES, better_walls
from beadwave.workflows.fit.marched_system import Rig, RubbingSurface
from beadwave.workflows.fit.model_errors import BetterModel, with_systems
from beadwave.workflows.fit.parametric_wall import (
    Bounds,
    ComputedWall,
    ParametricWall,
    design,
    parametric_wall,
    with_rest,
)
from beadwave.workflows.fit.scene_parameters import number, put, scene_at
from beadwave.workflows.scene import InvalidScene, RomWall, Scene
from beadwave.workflows.scene.places import has_friction
from beadwave.workflows.stages.chain.chain import Start, flat, initial_velocity, on_surface
from beadwave.workflows.stages.chain.chain import chain as chain_of
from beadwave.workflows.stages.chain.walls import simple_wall, wall_of
from beadwave.workflows.stages.engine.pipeline import Pipeline, pipeline_of
from beadwave.workflows.stages.engine.progress import Progress, quiet
from beadwave.workflows.stages.engine.stage_table import needs_structure
from beadwave.workflows.sweep.cases import Base

if TYPE_CHECKING:
    from beadwave.coupling.spatial_wall import SpatialWall

DEGREE_BEAM, DEGREE_BODIES = 3, 2  # of the polynomials between walls: beams are computed quickly
# keys of a shaker that leave the structure as it is; its stinger and its place do not
OF_SHAKING = ("force", "displacement", "velocity", "acceleration", "frequency", "phase")


# VariedScene, or VariedChains of several chains: functions of a scene's keys
Varied = TypeVar("Varied")


class KeyedChains(NamedTuple):
    """Chains of a scene by the values of those of its keys that change them."""

    of: tuple[int, ...]  # places of these keys
    chain: Callable[..., dem.Chain]


class VariedScene(NamedTuple):
    """A scene as a function of the values (q,) of its keys."""

    scene: Scene
    base: Base
    keys: tuple[str, ...]
    surface: Any  # rom.Contact, of bodies
    rows: KeyedChains | None  # where nothing else of the scene follows from the keys
    of_wall: tuple[int, ...] = ()  # places of the keys that change the reduced wall
    between: ParametricWall | None = None  # the reduced wall, where keys change it
    fixed: dem.Wall | None = None  # the reduced wall, where none does
    rubbing: RubbingSurface | None = None  # friction on a structure, of the scene's own values

    def __call__(self, values: NDArray[np.float64]) -> Rig:
        """The marched system at the values (q,); raises CouplingError for those that no scene may
        have."""
        try:
            if self.rows is None:
                scene = scene_at(self.base, self.keys, values)
                chain = chain_of(on_surface(scene, self.surface))
            else:
                scene = put(self.scene, self.keys, values)
                chain = self.rows.chain(*(values[i] for i in self.rows.of))
            if self.between is not None:
                wall = self.between(values[list(self.of_wall)])
            else:
                wall = self.fixed if isinstance(scene.wall, RomWall) else simple_wall(scene)
            rig = Rig(chain, wall, initial_velocity(scene))
            return rig if self.rubbing is None else self.rubbed(rig, scene)
        except InvalidScene as reason:
            raise coupling.CouplingError(str(reason)) from None

    def rubbed(self, rig: Rig, scene: Scene) -> Rig:
        """The rig with the friction, the arm and the shakers of a scene."""
        from beadwave.workflows.stages.chain.friction import last_sphere, shaker_forces

        begin = Start(rig.chain, rig.v0, flat=flat(on_surface(scene, self.surface)))
        across = self.rubbing._replace(last=last_sphere(scene, begin))
        if across.shakers is not None:
            across = across._replace(shakers=shaker_forces(scene))
        return rig._replace(across=across)

    def stepped(self, values: NDArray[np.float64], dt: float) -> VariedScene:
        """The scene with friction prepared for marches by steps of dt [s] near these values (q,).
        Raises CouplingError where shakers lead to no periodic state."""
        if self.rubbing is None:
            return self
        from beadwave.workflows.fit.friction_fit import prepared

        try:
            return self._replace(rubbing=prepared(self(values), dt))
        except dem.UnstableStep as reason:
            raise coupling.CouplingError(str(reason)) from None

    def of(self, scene: Scene, base: Base) -> VariedScene:
        """The walls behind the chain of another scene."""
        rows = _keyed_chains(base, scene, self.keys, self.surface)
        return self._replace(scene=scene, base=base, rows=rows)

    def behind(self, wall: dem.Wall | coupling.CoupledWall) -> VariedScene:
        """The chain before this wall, whatever the values of its keys."""
        return self._replace(between=None, fixed=wall)

    def within(self, low: NDArray[np.float64], high: NDArray[np.float64]) -> VariedScene:
        """The scene with walls computed between narrower bounds (n,) of the first keys, where
        enough of them can be."""
        return with_walls_within(self, low, high, computed)

    def through(self, values: NDArray[np.float64]) -> VariedScene:
        """The scene with the wall that is computed at these values (q,); raises CouplingError where
        none can be."""
        return through_wall(self, values, computed)

    def better_models(self, values: NDArray[np.float64]) -> dict[str, list[BetterModel]]:
        """Models of the same structure at the values (q,) of the keys that are better in one
        respect, by the cause of the error: see `better_walls`; none of a structure in three
        directions."""
        if self.rubbing is not None:
            return {}
        try:
            walls = better_walls(scene_at(self.base, self.keys, values))
        except FAILURES:  # values that no scene may have: the bars name the causes that they hold
            return {}
        return with_systems(walls, self.behind)


def structure(
    base: Base, keys: tuple[str, ...], box: Bounds, n_shared: int, progress: Progress
) -> VariedScene:
    """The scene as a function of its keys, the first n_shared of them within the bounds.

    Computes the walls between which others lie where keys change a reduced wall. Raises
    InvalidScene for walls that cannot follow.
    """
    scene = base.with_values({})
    across = [key for key in keys if key.split(".")[0] in ("friction", "arm", "shakers")]
    if across and not has_friction(scene):
        raise InvalidScene(
            f"{across[0]} moves no sphere along the chain: {scene.name} has no structure that "
            'turns friction into motion along its normal; take wall.kind = "rom" with an assembly, '
            "bodies or a file of three columns."
        )
    pipeline = pipeline_of(scene, progress)

    # what no key changes: the curvature of the struck face, and how the chain follows its keys
    meshed = needs_structure(scene) and scene.bending is None
    surface = pipeline("surface") if meshed else None
    rows = _keyed_chains(base, scene, keys, surface)
    plain = VariedScene(scene, base, keys, surface, rows)
    if not isinstance(scene.wall, RomWall):
        return plain

    of_wall = keys_of_structure(base, keys, n_shared, pipeline, "wall")
    if has_friction(scene):
        if of_wall:
            raise InvalidScene(
                f"{keys[of_wall[0]]} changes the structure, and {scene.name} has friction on it: "
                "find numbers of the structure without [friction], and of friction, arm, shakers "
                "and chain with the structure as it is."
            )
        return plain._replace(
            fixed=pipeline("wall"), rubbing=_rubbing(scene, pipeline("spatial-wall"))
        )
    if not of_wall:
        return plain._replace(fixed=_with_modes(scene, pipeline("wall")))
    with progress("walls"):
        degree = DEGREE_BODIES if scene.bending is None else DEGREE_BEAM
        wall_box = Bounds(box.low[of_wall], box.high[of_wall])
        names = tuple(keys[i] for i in of_wall)
        between = wall_between(base, names, wall_box, degree, computed)
    return plain._replace(of_wall=tuple(of_wall), between=between)


def keys_of_structure(
    base: Base, keys: tuple[str, ...], n_shared: int, pipeline: Pipeline, stage: str
) -> list[int]:
    """Places of the keys that change the structure: what the stage makes is cached under another
    name then. Raises InvalidScene for one beyond the first n_shared, which are of all records."""
    scene, of_structure = base.with_values({}), []
    for i, key in enumerate(keys):
        if key.startswith("shakers.") and key.split(".")[-1] in OF_SHAKING:
            continue
        changed = base.with_values({key: a_little_more(number(scene, key))})
        if Pipeline(changed, Memory(None, verbose=0)).key(stage) != pipeline.key(stage):
            of_structure.append(i)
    if any(i >= n_shared for i in of_structure):
        raise InvalidScene(
            f"--each {keys[of_structure[-1]]} changes the structure, which all records share; "
            "find it."
        )
    return of_structure


def _rubbing(scene: Scene, wall: SpatialWall) -> RubbingSurface:
    """Friction on a structure as the scene has it; the last sphere is that of a rig's chain."""
    from beadwave.workflows.stages.chain.friction import shaker_forces

    shakers = shaker_forces(scene) if scene.shakers else None
    return RubbingSurface(wall, None, shakers, scene.friction.upstream == "held")


def _keyed_chains(
    base: Base, scene: Scene, keys: tuple[str, ...], surface: Any
) -> KeyedChains | None:
    """None where other values of the scene follow from a key, as a velocity from a drop: a checked
    scene differs then from one in which the value is merely replaced."""
    if not all(stands_alone(base, scene, key) for key in keys):
        return None

    # the keys that the chain depends on: it changes where their values do
    def chain(names: tuple[str, ...], *values: float) -> dem.Chain:
        return chain_of(on_surface(put(scene, names, np.array(values)), surface))

    values = [number(scene, key) for key in keys]
    usual, of_chain = chain(keys, *values), []
    for i, value in enumerate(values):
        changed = chain(keys, *values[:i], a_little_more(value), *values[i + 1 :])
        if not all(map(np.array_equal, usual, changed)):
            of_chain.append(i)
    names = tuple(keys[i] for i in of_chain)
    # 16 chains are cached: many runs differ in the wall alone
    return KeyedChains(tuple(of_chain), lru_cache(16)(partial(chain, names)))


def with_walls_within(
    model: Varied,
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    wall: Callable[[Scene], ComputedWall],
) -> Varied:
    """A scene as a function of its keys, with walls computed between narrower bounds (n,) of the
    first keys, where enough of them can be."""
    places = list(model.of_wall)
    keys = tuple(model.keys[i] for i in places)
    try:
        box = Bounds(low[places], high[places])
        between = wall_between(model.base, keys, box, DEGREE_BODIES, wall)
    except FAILURES:
        return model
    return model._replace(between=between)


def through_wall(
    model: Varied, values: NDArray[np.float64], wall: Callable[[Scene], ComputedWall]
) -> Varied:
    """A scene as a function of its keys, with the wall that is computed at their values (q,);
    raises CouplingError where none can be."""
    try:
        exact = wall(scene_at(model.base, model.keys, values))
    except FAILURES as reason:
        raise coupling.CouplingError(str(reason)) from None
    return model._replace(between=model.between.through(values[list(model.of_wall)], exact))


def stands_alone(base: Base, scene: Scene, key: str) -> bool:
    """True of a key from which no other value of the scene follows."""
    value = np.array([a_little_more(number(scene, key))])
    checked = scene_at(base, (key,), value)
    return put(scene, (key,), value).but(unusual=checked.unusual) == checked


def a_little_more(value: float) -> float:
    """A value that differs by more than rounding, and by nothing that a scene refuses."""
    return value * (1 + 1e-6) + 1e-12


def _with_modes(scene: Scene, wall: dem.Wall | coupling.CoupledWall) -> dem.Wall:
    """The wall; raises InvalidScene for one that is not a set of oscillators."""
    if isinstance(wall, coupling.CoupledWall):
        raise InvalidScene(
            f"{scene.name}: dashpots and thesis weights couple the wall's modes, which inspect "
            "cannot follow; drop them."
        )
    return wall


def wall_between(
    base: Base,
    keys: tuple[str, ...],
    box: Bounds,
    degree: int,
    wall: Callable[[Scene], ComputedWall],
) -> ParametricWall:
    """The wall between those computed within the bounds of its keys; raises InvalidScene where too
    few can be."""
    middle, *others = design(box, degree)
    numbers, walls = [middle], [wall(scene_at(base, keys, middle))]
    for values in others:
        try:
            walls.append(wall(scene_at(base, keys, values)))
            numbers.append(values)
        except FAILURES:  # buckled, or beyond what a table takes: others are enough
            continue
    try:
        return parametric_wall(box, np.array(numbers), walls, degree)
    except coupling.CouplingError as reason:
        raise InvalidScene(str(reason)) from None


def computed(scene: Scene) -> ComputedWall:
    """The scene's wall and the shapes of its modes; a structure of bodies is cached, beams are
    quicker computed anew."""
    if not needs_structure(scene):
        reduced = None
    elif scene.bending:
        from beadwave.workflows.stages.structure import bending

        reduced = bending.reduction(scene, bending.model(scene))
    else:
        reduced = pipeline_of(scene, quiet)("reduction")
    return with_rest(_with_modes(scene, wall_of(scene, reduced)), reduced)
