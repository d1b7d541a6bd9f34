"""A structure that several chains strike: their places on it, and one basis for all of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave import fem, rom
from beadwave.fem.modes.assembly_modes import AssemblyModes
from beadwave.workflows.scene import InvalidScene, LossFactorsTable, Scene
from beadwave.workflows.scene.places import chain_face, sensor_places, shaker_places
from beadwave.workflows.scene.tables.reduction import TO_HZ
from beadwave.workflows.stages.structure.assembly import solid
from beadwave.workflows.stages.structure.functionals import functionals
from beadwave.workflows.stages.structure.loss_factors import strain_of
from beadwave.workflows.stages.structure.meshed_parts import Parts
from beadwave.workflows.stages.structure.reduction import names, targets_kept, with_outer_nodes
from beadwave.workflows.stages.structure.strike import (
    in_words_of,
    patch_on,
    require_known_law,
    surface_of,
)


class ChainContacts(NamedTuple):
    """The contacts of p chains with a structure of n unknowns."""

    w: NDArray[np.float64]  # (n, p) displacement along each chain, into the structure
    point: NDArray[np.float64]  # (p, 3) [m]
    direction: NDArray[np.float64]  # (p, 3) unit vectors into the structure
    # (p, 2) [m/N] that Hertz' law holds already, and Mindlin's across; 0 without friction
    half_space: NDArray[np.float64]
    radii: NDArray[np.float64]  # (p, 2) [m] principal radii of the faces struck
    surface: tuple[rom.Contact, ...]  # their material and curvatures
    rubbing: NDArray[np.int64]  # (m,) the chains with friction
    across: NDArray[np.float64]  # (n, 2 m) displacements across these, along t1 and t2 of each
    frame: NDArray[np.float64]  # (m, 2, 3) t1 and t2
    half_space_besides: NDArray[np.float64]  # (p, 3, 3) [m/N] what it has besides on the mesh

    @property
    def columns(self) -> NDArray[np.float64]:
        """(n, p + 2 m) displacements along all chains, then across those with friction."""
        return np.hstack([self.w, self.across])


class ChainPatch(NamedTuple):
    """The contact of one of several chains, on the mesh of the body that it strikes."""

    face: str  # in the mesh, "body:name"
    patch: fem.ContactPatch
    material: fem.Material | fem.Orthotropic


def chain_patches(scene: Scene, mesh: Parts, model: fem.Model) -> list[ChainPatch]:
    """The patches of all chains. Raises InvalidScene where one leaves its face, and for a curved
    face of an orthotropic material."""
    patches = []
    for name, one in scene.of_each_chain.items():
        struck = mesh.struck_by_chains[name]
        material = solid(scene, one.struck_body)
        with in_words_of(f"chains.{name}"):
            require_known_law(one, material, struck)
            patch = patch_on(one, struck, chain_face(name), model)
        patches.append(ChainPatch(f"{struck.face.body}:{chain_face(name)}", patch, material))
    return patches


def contacts(scene: Scene, mesh: Parts, model: fem.Model) -> ChainContacts:
    """The patches of all chains and the half-spaces under them. Raises InvalidScene as
    `chain_patches`."""
    columns, points, directions, local, radii, surfaces = [], [], [], [], [], []
    rubbing, across, frames, besides = [], [], [], np.zeros((len(scene.chains), 3, 3))
    patches, each = chain_patches(scene, mesh, model), scene.of_each_chain.items()
    for i, ((name, one), (face, patch, material)) in enumerate(zip(each, patches, strict=True)):
        columns.append(patch.w)
        points.append(patch.spot.point)
        directions.append(patch.spot.inward)
        radii.append(patch.spot.radii)
        surfaces.append(surface_of(material, patch.spot.inward, patch.spot.radii))
        if one.friction is None:
            local.append([*fem.half_spaces_on_mesh(model, face, [patch], material), 0.0])
            continue
        try:
            matrix = fem.half_space_matrix(model, face, patch, material)
        except ValueError as error:
            why = str(error).rstrip(".")
            raise InvalidScene(f"{scene.name}: chains.{name}: [friction]: {why}.") from None
        tangential = 0.5 * (matrix[1, 1] + matrix[2, 2])
        local.append([matrix[0, 0], tangential])
        besides[i] = matrix - np.diag([matrix[0, 0], tangential, tangential])
        rubbing.append(i)
        across += [sideways.w for sideways in patch.across(model)]
        frames.append(patch.axes[1:])
    return ChainContacts(
        np.column_stack(columns), np.array(points), np.array(directions), np.array(local),
        np.array(radii), tuple(surfaces), np.array(rubbing, np.int64),
        np.reshape(across, (-1, len(columns[0]))).T, np.reshape(frames, (-1, 2, 3)),
        besides,
    )  # fmt: skip


def reduction(
    scene: Scene,
    model: fem.Model,
    modes: AssemblyModes,
    contacts: ChainContacts,
    factor: fem.Factor | None = None,
) -> rom.ReducedModel:
    """The structure in as many modes as keep the response at every contact and sensor to the
    scene's error, and between them; the first chain's contact is the model's own, the others are
    loads by the chains' names, and those across by name and direction. Raises InvalidScene for a
    sensor whose disc leaves its face, rom.ReductionError."""
    struck = contacts.surface[0]._replace(
        half_space=float(contacts.half_space[0, 0]),
        point=tuple(contacts.point[0].tolist()),
        direction=tuple(contacts.direction[0].tolist()),
    )
    chains, places = [row.name for row in scene.chains], sensor_places(scene)
    shakers = [place.name for place in shaker_places(scene)]
    tangents = [f"{chains[i]}, t{k}" for i in contacts.rubbing for k in (1, 2)]
    others = (*chains[1:], *tangents, *shakers)
    w = np.hstack([with_shakers(scene, model, contacts), functionals(scene, model, places)])
    reduced = reduced_to(scene, model, modes, w, others, struck, factor)
    if not places:
        return reduced
    load, sense = np.split(reduced.columns.load, [len(others)], axis=1)
    names = tuple(place.name for place in places)
    columns = reduced.columns._replace(load=load, sense=sense, sense_names=names)
    load, sense = np.split(reduced.finer.columns.load, [len(others)], axis=1)
    finer = reduced.finer._replace(columns=rom.Columns(load=load, sense=sense))
    return reduced._replace(columns=columns, finer=finer)


def with_shakers(scene: Scene, model: fem.Model, contacts: ChainContacts) -> NDArray[np.float64]:
    """(n, p + 2 m + s) the contacts' columns, and those of s shakers behind them. Raises
    InvalidScene for a shaker whose disc leaves its face."""
    return np.hstack([contacts.columns, functionals(scene, model, shaker_places(scene))])


def reduced_to(
    scene: Scene,
    model: fem.Model,
    modes: AssemblyModes,
    w: NDArray[np.float64],
    names_of_loads: tuple[str, ...],
    struck: rom.Contact,
    factor: fem.Factor | None,
) -> rom.ReducedModel:
    """The model in as many modes as keep the response at every contact of w (n, p) to the scene's
    error, with the way back to the outer nodes, names and masses; `struck` is the first one, which
    is the model's own. Raises rom.ReductionError."""
    table = scene.reduction
    with fem.one_thread():
        reduced = rom.several_contacts(
            model.K, model.M, w, error=table.error, to_hz=table.to_hz or TO_HZ,
            modes=targets_kept(modes), factor=factor, factorise=fem.factorised,
        )  # fmt: skip
    named = reduced.columns._replace(load_names=names_of_loads)
    struck = struck._replace(modes_hz=tuple(modes.paired_hz.values()) or None)
    if isinstance(scene.damping, LossFactorsTable):
        struck = struck._replace(strain=strain_of(scene, model, modes))

    reduced = with_outer_nodes(reduced, model, struck.direction)
    return reduced._replace(
        coordinates=names(model, np.zeros(0, np.int64), reduced),
        columns=named,
        contact=struck,
        finer=reduced.finer._replace(contact=struck),
    )
