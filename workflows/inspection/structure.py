"""Chain and wall of a scene as functions of numbers in it; a reduced wall between computed ones."""

from contextlib import nullcontext
from typing import Any, NamedTuple

import numpy as np
from joblib import Memory
from numpy.typing import NDArray

import coupling
import dem
import rom
from coupling.inspection.forward import System
from coupling.parametric_wall import (
    Box,
    Computed,
    ParametricWall,
    design,
    parametric_wall,
)
from workflows.inspection.numbers import moved, number, put
from workflows.pipeline.chain import simple_wall, start
from workflows.pipeline.chain import wall as wall_of
from workflows.pipeline.pipeline import Pipeline, Progress, needs_structure, pipeline_of
from workflows.scene import InvalidScene, RomWall, Scene
from workflows.sweep.cases import Base

QUICK, SLOW = 3, 2  # degree of the polynomials between walls, of a beam and of bodies
ROWS = 600  # of a surface, that tell modes apart
FAILURES = (InvalidScene, ValueError, ArithmeticError, np.linalg.LinAlgError)


class Structure(NamedTuple):
    """A scene whose keys take values (q,), `of_wall` those that its reduced wall follows."""

    scene: Scene
    base: Base
    keys: tuple[str, ...]
    surface: Any  # rom.Contact, of bodies
    plain: bool = True  # whether nothing else of the scene follows from the keys
    of_wall: tuple[int, ...] = ()
    between: ParametricWall | None = None
    fixed: dem.Wall | None = None

    def __call__(self, values: NDArray[np.float64]) -> System:
        """What is marched; raises CouplingError for values that no scene may have."""
        try:
            scene = (put(self.scene, self.keys, values) if self.plain
                     else moved(self.base, self.keys, values))  # fmt: skip
            begun = start(scene, self.surface)
            return System(begun.chain, self._wall(scene, values), begun.velocity)
        except InvalidScene as reason:
            raise coupling.CouplingError(str(reason)) from None

    def _wall(self, scene: Scene, values) -> dem.Wall | None:
        if self.between is not None:
            return self.between(values[list(self.of_wall)])
        return self.fixed if isinstance(scene.wall, RomWall) else simple_wall(scene)

    def within(self, low: NDArray[np.float64], high: NDArray[np.float64]) -> "Structure":
        """The same with walls computed between narrower bounds (n,) of the first keys, where
        enough of them can be."""
        chosen = list(self.of_wall)
        keys = tuple(self.keys[i] for i in chosen)
        try:
            between = _between(self.base, keys, Box(low[chosen], high[chosen]), SLOW)
        except FAILURES:
            return self
        return self._replace(between=between)

    def through(self, values: NDArray[np.float64]) -> "Structure":
        """The same with the wall that is computed at these values."""
        there = values[list(self.of_wall)]
        true = computed(moved(self.base, self.keys, values))
        return self._replace(between=self.between.through(there, true))


def structure(
    base: Base, keys: tuple[str, ...], box: Box, n_shared: int, progress: Progress
) -> Structure:
    """The scene as a function of its keys, the first n_shared of them within the box.

    Computes the walls between which others lie where keys change a reduced wall. Raises
    InvalidScene for walls that cannot follow.
    """
    scene = base.with_values({})
    pipeline = pipeline_of(scene, progress)
    of_bodies = needs_structure(scene) and scene.is_general
    plain = Structure(
        scene, base, keys, pipeline("surface") if of_bodies else None,
        all(_stands_alone(base, scene, key) for key in keys),
    )  # fmt: skip
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
    narrow = Box(box.low[chosen], box.high[chosen])
    with progress("walls"):
        degree = SLOW if scene.bending is None else QUICK
        between = _between(base, tuple(keys[i] for i in chosen), narrow, degree)
    return plain._replace(of_wall=of_wall, between=between)


def _stands_alone(base: Base, scene: Scene, key: str) -> bool:
    """Whether no other value of the scene follows from a key, as a velocity from a drop."""
    other = np.array([number(scene, key) * (1 + 1e-6)])
    anew = moved(base, (key,), other)
    return put(scene, (key,), other).but(unusual=anew.unusual) == anew


def _changes_wall(base: Base, pipeline: Pipeline, key: str) -> bool:
    value = number(pipeline.scene, key)
    other = base.with_values({key: value * (1 + 1e-9) + 1e-12})
    return Pipeline(other, Memory(None, verbose=0)).key("wall") != pipeline.key("wall")


def _required(scene: Scene, wall: dem.Wall | coupling.CoupledWall) -> dem.Wall:
    if isinstance(wall, coupling.CoupledWall):
        raise InvalidScene(
            f"{scene.name}: dashpots and thesis weights couple the wall's modes, which inspect "
            "cannot follow; drop them."
        )
    return wall


def _between(base: Base, keys: tuple[str, ...], box: Box, degree: int) -> ParametricWall:
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
        return _with_rest(_required(scene, wall_of(scene, None)), None)
    quick = scene.bending is not None
    none = Memory(None, verbose=0)
    pipeline = Pipeline(scene, none) if quick else pipeline_of(scene, lambda name: nullcontext())
    reduced = pipeline("reduction")
    return _with_rest(_required(scene, wall_of(scene, reduced)), reduced)


def _with_rest(wall: dem.Wall, reduced: Any) -> Computed:
    """The wall with an oscillator for the rest behind its own modes, and their shapes."""
    modes = None if reduced is None else rom.modal(reduced)
    own = None if modes is None else int(np.isin(wall.omega, modes.omega).sum())
    if own in (None, len(wall.omega)):  # nothing is left out
        wall = wall._replace(
            omega=np.append(wall.omega, 10.0 * wall.omega.max()),
            zeta=np.append(wall.zeta, 0.0),
            phi=np.append(wall.phi, 0.0),
        )
    if modes is None or reduced.surface is None:
        return Computed(wall)
    T = reduced.surface.T.reshape(-1, reduced.surface.T.shape[-1])
    return Computed(wall, T[:: max(1, len(T) // ROWS)] @ modes.vectors[:, :own])
