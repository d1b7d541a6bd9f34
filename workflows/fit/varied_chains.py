"""Several chains on a structure as functions of numbers of their scene; the structure between
computed ones where numbers change it."""

from __future__ import annotations

from contextlib import suppress
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave import coupling
from beadwave.dem import space
from beadwave.workflows.fit.better_walls import FAILURES
from beadwave.workflows.fit.marched_system import ChainsRig
from beadwave.workflows.fit.model_errors import BetterModel
from beadwave.workflows.fit.parametric_wall import (
    Bounds,
    ComputedWall,
    ParametricWall,
    with_rest,
)
from beadwave.workflows.fit.scene_parameters import put, scene_at
from beadwave.workflows.fit.varied_scene import (
    DEGREE_BODIES,
    keys_of_structure,
    stands_alone,
    through_wall,
    wall_between,
    with_walls_within,
)
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.stages.chain import several
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.engine.progress import Progress, quiet
from beadwave.workflows.stages.errors.chains_mesh_error import structure_on_other_mesh
from beadwave.workflows.stages.structure.assembly import solid
from beadwave.workflows.stages.structure.several import ChainContacts
from beadwave.workflows.stages.structure.strike import surface_of
from beadwave.workflows.sweep.cases import Base


class VariedChains(NamedTuple):
    """A scene of several chains as a function of the values (q,) of its keys."""

    scene: Scene
    base: Base
    keys: tuple[str, ...]
    checked: bool  # other values of the scene follow from a key
    contacts: ChainContacts
    fixed: space.Structure | None = None  # the structure, where no key changes it
    of_wall: tuple[int, ...] = ()  # places of the keys that change the structure
    between: ParametricWall | None = None  # the structure, where keys change it

    def __call__(self, values: NDArray[np.float64]) -> ChainsRig:
        """The marched system at the values (q,); raises CouplingError for those that no scene may
        have."""
        structure = self.fixed
        if self.between is not None:
            structure = self.between(values[list(self.of_wall)])
        try:
            if self.checked:
                scene = scene_at(self.base, self.keys, values)
            else:
                scene = put(self.scene, self.keys, values)
            start = several.start(scene, self._contacts_of(scene), structure)
        except InvalidScene as reason:
            raise coupling.CouplingError(str(reason)) from None
        chains = tuple((first.chain, first.velocity) for first in start.starts)
        return ChainsRig(chains, start.rows, structure)

    def _contacts_of(self, scene: Scene) -> ChainContacts:
        """The contacts with the materials of a scene."""
        places = zip(
            scene.of_each_chain.values(), self.contacts.direction, self.contacts.radii, strict=True
        )
        surfaces = tuple(
            surface_of(solid(one, one.struck_body), direction, radii)
            for one, direction, radii in places
        )
        return self.contacts._replace(surface=surfaces)

    def stepped(self, values: NDArray[np.float64], dt: float) -> VariedChains:
        """The scene as it is: nothing of it follows from steps of time."""
        return self

    def behind(self, structure: space.Structure) -> VariedChains:
        """The chains on this structure, whatever the values of their keys."""
        return self._replace(between=None, fixed=structure)

    def within(self, low: NDArray[np.float64], high: NDArray[np.float64]) -> VariedChains:
        """The scene with structures computed between narrower bounds (n,) of the first keys, where
        enough of them can be."""
        return with_walls_within(self, low, high, computed)

    def through(self, values: NDArray[np.float64]) -> VariedChains:
        """The scene with the structure that is computed at these values (q,); raises CouplingError
        where none can be."""
        return through_wall(self, values, computed)

    def better_models(self, values: NDArray[np.float64]) -> dict[str, list[BetterModel]]:
        """The chains on structures at the values (q,) that are better in one respect, by the cause
        of the error: the finer reduction, another mesh; up to the first that cannot be computed."""
        models: dict[str, list[BetterModel]] = {}
        with suppress(*FAILURES):  # bars name the causes that they hold
            scene = scene_at(self.base, self.keys, values)
            of = pipeline_of(scene, quiet)
            contacts, reduction = of("chain-contacts"), of("reduction")
            finer = several.structure(scene, reduction.finer, contacts)
            models["reduction"] = [BetterModel(self.behind(finer), several.MARGIN)]
            other, _, share = structure_on_other_mesh(scene, of("mesh"), of("modes"))
            models["mesh"] = [BetterModel(self.behind(other), share)]
        return models


def varied_chains(
    base: Base, keys: tuple[str, ...], box: Bounds, n_shared: int, progress: Progress
) -> VariedChains:
    """The scene as a function of its keys, the first n_shared of them within the bounds.

    Computes the structures between which others lie where keys change the structure. Raises
    InvalidScene for structures that cannot follow, for chains with friction, and with shakers.
    """
    scene = base.with_values({})
    if scene.shakers:
        raise InvalidScene(
            f"{scene.name}: [[shakers]] move the structure, with which several chains are not "
            "compared with records; drop [[shakers]], or take one [chain]."
        )
    rubbing = [name for name, one in scene.of_each_chain.items() if one.friction]
    if rubbing:
        raise InvalidScene(
            f"{scene.name}: chains.{rubbing[0]} has friction, with which several chains are not "
            "compared with records; drop [friction], or take one [chain]."
        )
    pipeline = pipeline_of(scene, progress)
    checked = not all(stands_alone(base, scene, key) for key in keys)
    contacts = pipeline("chain-contacts")
    plain = VariedChains(scene, base, keys, checked, contacts, pipeline("structure"))
    of_wall = keys_of_structure(base, keys, n_shared, pipeline, "structure")
    if not of_wall:
        return plain
    with progress("walls"):
        box_of_wall = Bounds(box.low[of_wall], box.high[of_wall])
        names = tuple(keys[i] for i in of_wall)
        between = wall_between(base, names, box_of_wall, DEGREE_BODIES, computed)
    return plain._replace(fixed=None, of_wall=tuple(of_wall), between=between)


def computed(scene: Scene) -> ComputedWall:
    """The scene's structure and the shapes of its modes, cached."""
    of = pipeline_of(scene, quiet)
    return with_rest(of("structure"), of("reduction"))
