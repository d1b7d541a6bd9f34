"""Chain and wall of a scene as functions of numbers in it; a reduced wall between computed ones."""

from collections.abc import Callable
from contextlib import nullcontext
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from joblib import Memory
from numpy.typing import NDArray

import coupling
import dem
import rom
from workflows.fit.core.inspection.forward import System
from workflows.fit.core.parametric_wall import (
    Bounds,
    Computed,
    ParametricWall,
    design,
    parametric_wall,
    with_rest,
)
from workflows.fit.inspection.numbers import moved, number, put
from workflows.scene import InvalidScene, RomWall, Scene
from workflows.stages.chain import chain as chain_of
from workflows.stages.chain import initial_velocity, on_surface, simple_wall
from workflows.stages.chain import wall as wall_of
from workflows.stages.pipeline import Pipeline, Progress, needs_structure, pipeline_of
from workflows.sweep.cases import Base

QUICK, SLOW = 3, 2  # degree of the polynomials between walls, of a beam and of bodies
CHAINS = 16  # that are kept: many runs differ in the wall alone
FAILURES = (InvalidScene, ValueError, ArithmeticError, np.linalg.LinAlgError)


class KeyedChains(NamedTuple):
    """Chains of a scene by the values of the keys `of` that change them."""

    of: tuple[int, ...]
    chain: Callable[..., dem.Chain]


class VariedScene(NamedTuple):
    """A scene whose keys take values (q,), `of_wall` those that its reduced wall follows."""

    scene: Scene
    base: Base
    keys: tuple[str, ...]
    surface: Any  # rom.Contact, of bodies
    rows: KeyedChains | None  # where nothing else of the scene follows from the keys
    of_wall: tuple[int, ...] = ()
    between: ParametricWall | None = None
    fixed: dem.Wall | None = None

    def __call__(self, values: NDArray[np.float64]) -> System:
        """What is marched; raises CouplingError for values that no scene may have."""
        try:
            if self.rows is None:
                scene = moved(self.base, self.keys, values)
                chain = chain_of(on_surface(scene, self.surface))
            else:
                scene = put(self.scene, self.keys, values)
                chain = self.rows.chain(*(values[i] for i in self.rows.of))
            return System(chain, self._wall(scene, values), initial_velocity(scene))
        except InvalidScene as reason:
            raise coupling.CouplingError(str(reason)) from None

    def of(self, scene: Scene, base: Base) -> "VariedScene":
        """The same walls behind the chain of another scene."""
        rows = _rows(base, scene, self.keys, self.surface)
        return self._replace(scene=scene, base=base, rows=rows)

    def _wall(self, scene: Scene, values) -> dem.Wall | None:
        if self.between is not None:
            return self.between(values[list(self.of_wall)])
        return self.fixed if isinstance(scene.wall, RomWall) else simple_wall(scene)

    def within(self, low: NDArray[np.float64], high: NDArray[np.float64]) -> "VariedScene":
        """The same with walls computed between narrower bounds (n,) of the first keys, where
        enough of them can be."""
        chosen = list(self.of_wall)
        keys = tuple(self.keys[i] for i in chosen)
        try:
            between = _between(self.base, keys, Bounds(low[chosen], high[chosen]), SLOW)
        except FAILURES:
            return self
        return self._replace(between=between)

    def through(self, values: NDArray[np.float64]) -> "VariedScene":
        """The same with the wall that is computed at these values; raises CouplingError where none
        can be."""
        there = values[list(self.of_wall)]
        try:
            true = computed(moved(self.base, self.keys, values))
        except FAILURES as reason:
            raise coupling.CouplingError(str(reason)) from None
        return self._replace(between=self.between.through(there, true))


def structure(
    base: Base, keys: tuple[str, ...], box: Bounds, n_shared: int, progress: Progress
) -> VariedScene:
    """The scene as a function of its keys, the first n_shared of them within the box.

    Computes the walls between which others lie where keys change a reduced wall. Raises
    InvalidScene for walls that cannot follow.
    """
    scene = base.with_values({})
    pipeline = pipeline_of(scene, progress)
    of_bodies = needs_structure(scene) and scene.is_general
    surface = pipeline("surface") if of_bodies else None
    plain = VariedScene(scene, base, keys, surface, _rows(base, scene, keys, surface))
    if not isinstance(scene.wall, RomWall):
        return plain
    of_wall = tuple(i for i, key in enumerate(keys) if _changes_wall(base, pipeline, key))
    if any(i >= n_shared for i in of_wall):
        raise InvalidScene(
            f"--each {keys[of_wall[-1]]} changes the structure, which all records share; find it."
        )
    if not of_wall:
        return plain._replace(fixed=_required(scene, pipeline("wall")))
    chosen = list(of_wall)
    narrow = Bounds(box.low[chosen], box.high[chosen])
    with progress("walls"):
        degree = SLOW if scene.bending is None else QUICK
        between = _between(base, tuple(keys[i] for i in chosen), narrow, degree)
    return plain._replace(of_wall=of_wall, between=between)


def _rows(base: Base, scene: Scene, keys: tuple[str, ...], surface: Any) -> KeyedChains | None:
    """None where other values of the scene follow from a key."""
    if not all(_stands_alone(base, scene, key) for key in keys):
        return None

    def chain(*values: float) -> dem.Chain:
        return chain_of(on_surface(put(scene, names, np.array(values)), surface))

    names = keys
    own = [number(scene, key) for key in keys]
    usual, of = chain(*own), []
    for i, value in enumerate(own):
        other = chain(*own[:i], _other(value), *own[i + 1 :])
        if not all(map(np.array_equal, usual, other)):
            of.append(i)
    names = tuple(keys[i] for i in of)
    return KeyedChains(tuple(of), lru_cache(CHAINS)(chain))


def _other(value: float) -> float:
    return value * (1 + 1e-6) + 1e-12


def _stands_alone(base: Base, scene: Scene, key: str) -> bool:
    """Whether no other value of the scene follows from a key, as a velocity from a drop."""
    other = np.array([_other(number(scene, key))])
    anew = moved(base, (key,), other)
    return put(scene, (key,), other).but(unusual=anew.unusual) == anew


def _changes_wall(base: Base, pipeline: Pipeline, key: str) -> bool:
    other = base.with_values({key: _other(number(pipeline.scene, key))})
    return Pipeline(other, Memory(None, verbose=0)).key("wall") != pipeline.key("wall")


def _required(scene: Scene, wall: dem.Wall | coupling.CoupledWall) -> dem.Wall:
    if isinstance(wall, coupling.CoupledWall):
        raise InvalidScene(
            f"{scene.name}: dashpots and thesis weights couple the wall's modes, which inspect "
            "cannot follow; drop them."
        )
    return wall


def _between(base: Base, keys: tuple[str, ...], box: Bounds, degree: int) -> ParametricWall:
    middle, *others = design(box, degree)
    numbers, walls = [middle], [computed(moved(base, keys, middle))]
    for there in others:
        try:
            walls.append(computed(moved(base, keys, there)))
            numbers.append(there)
        except FAILURES:  # buckled, or beyond what a table takes: others are enough
            continue
    try:
        return parametric_wall(box, np.array(numbers), walls, degree)
    except coupling.CouplingError as reason:
        raise InvalidScene(str(reason)) from None


def computed(scene: Scene) -> Computed:
    """The scene's wall and the shapes of its modes; a structure of bodies is kept, beams are
    quicker computed anew."""
    if not needs_structure(scene):
        return with_rest(_required(scene, wall_of(scene, None)), None)
    reduced = _bent(scene) if scene.bending else _kept(scene)
    return with_rest(_required(scene, wall_of(scene, reduced)), reduced)


def _bent(scene: Scene) -> rom.ReducedModel:
    from workflows.stages import bending

    return bending.reduction(scene, bending.model(scene))


def _kept(scene: Scene) -> rom.ReducedModel:
    return pipeline_of(scene, lambda name: nullcontext())("reduction")
