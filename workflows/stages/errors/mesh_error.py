"""Error of the mesh of an assembly in its modes and in the wall of it.

In mass-normalised shapes phi_j that hold the modes and the static response at the contact, with
K = diag(omega^2), the mesh misses the strain energy G (`fem.missed_energy`). Without the mesh

    K_0^-1 = K^-1 + K^-1 G K^-1,

which adds to the static compliance w^T K^-1 w what its displacement misses, and takes G_jj from
omega_j^2 to first order. A chain marched before both walls, of K and of K_0, shows what the mesh
does to its waves. Under the patch the mesh misses in the structure what it misses in a half-space,
which the wall takes off again: what counts there is the difference of both.

Functions of the next order do not move a body of a few elements: of one along a cantilever they
stated 0.04 where 0.49 was true. A mesh so small is split instead, which takes as long as a run.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from skfem import MeshHex

from beadwave import fem, rom
from beadwave.fem.modes.assembly_modes import N_MODES, AssemblyModes
from beadwave.fem.modes.mac import RIGID
from beadwave.rom.contact_space import KrylovOptions
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.scene.places import mass_face, part_face, spring_face
from beadwave.workflows.scene.tables.reduction import TO_HZ
from beadwave.workflows.stages.errors import second_mesh
from beadwave.workflows.stages.errors.mesh_causes import Cause, causes, explanation
from beadwave.workflows.stages.structure import assembly as stages
from beadwave.workflows.stages.structure.meshed_parts import Parts
from beadwave.workflows.stages.structure.reduction import half_space_at

# times the energy found, of which functions of the next order hold 0.6 where stresses are
# singular and all where they are smooth. Of the 716 pairs of 19 structures that
# `examples/mesh_errors.py 1906` compares the least stated over true error is 0.92 with 2.3, the
# median 1.9, and 92 % are from 1 to 4
SAFETY = 2.3
# times it in tetrahedra, whose functions hold more: with 1 the least ratio of brackets, and of
# a plate, profiles and tied boxes of tetrahedra, is 1.9
TETRAHEDRA_SHARE = 0.7
PAIR_DISTANCE = 1e-3  # relative difference of frequencies of one mode, by two eigensolvers
N_KRYLOV = 20  # shapes in addition to the modes, of an assembly that floats


class SplitMesh(NamedTuple):
    """A mesh of few elements compared with the one with every element split."""

    omega: NDArray[np.float64]  # (k,) [rad/s] of the modes of the split mesh, lowest first
    walls: tuple[rom.ReducedModel, rom.ReducedModel]  # own and split
    share: float  # of the difference that is the own mesh's error


class MeshErrorEstimate(NamedTuple):
    """Shapes of an assembly on its mesh, and the energy that the mesh misses in them."""

    omega: NDArray[np.float64]  # (k,) [rad/s] ascending, rigid motions as zeros
    # (k, k) [rad^2/s^2] G of mass-normalised shapes; of a split mesh by features left out alone
    energy: NDArray[np.float64]
    w: NDArray[np.float64] | None  # (k,) [kg^-1/2] at the contact; None of what is not struck
    n_static: int = 0  # of the highest, that follow the force
    split: SplitMesh | None = None  # of a mesh of few elements
    unknown: str = ""  # why nothing is known: then there are no shapes
    causes: tuple[Cause, ...] = ()  # (k,) of the error of each shape
    # (cells,) by body: energy missed in each element over that of the shape in which it is largest,
    # of the first elastic modes and the static response; none of a split mesh
    of_cells: Mapping[str, NDArray[np.float64]] = MappingProxyType({})
    # (features, k, k) [rad^2/s^2] of the energy, by features that the mesh leaves out
    left_out: NDArray[np.float64] = np.empty((0, 0, 0))

    @property
    def share(self) -> float:
        """Error of the mesh over the difference of its two walls."""
        return 1.0 if self.split is None else self.split.share

    def of_frequencies(self, omega: NDArray[np.float64]) -> NDArray[np.float64]:
        """Relative errors (m,) of modes (m,) [rad/s]: they are too high by as much; nan of modes
        that are none of the shapes, and of rigid motions."""
        if self.split is not None:
            n = min(len(omega), len(self.split.omega))
            error = np.full(len(omega), np.nan)
            elastic = np.flatnonzero(omega[:n] > RIGID * np.max(omega))
            lower = self.split.omega[elastic] / omega[elastic]
            of_features = np.diag(self.energy)[elastic] / omega[elastic] ** 2
            error[elastic] = np.maximum(self.split.share * (1 - lower), 0.0)
            error[elastic] += 1 - 1 / np.sqrt(1 + of_features)
            return error
        if not len(self.omega):
            return np.full(len(omega), np.nan)
        shape = self.shapes_of(omega)
        error, pairs = np.full(len(omega), np.nan), shape >= 0
        j = shape[pairs]
        # omega_0 = omega / sqrt(1 + G / omega^2)
        error[pairs] = 1 - 1 / np.sqrt(1 + self.energy[j, j] / self.omega[j] ** 2)
        return error

    def shapes_of(self, omega: NDArray[np.float64]) -> NDArray[np.int64]:
        """Indices of the shapes (m,) of modes (m,) [rad/s]; -1 of rigid motions, and of none."""
        if not len(self.omega):
            return np.full(len(omega), -1)
        nearest = np.abs(self.omega - omega[:, None]).argmin(axis=1)
        pairs = np.abs(self.omega[nearest] - omega) <= PAIR_DISTANCE * omega
        pairs &= omega > RIGID * np.max(omega, initial=0.0)
        return np.where(pairs, nearest, -1)

    def explained(self, scene: Scene, omega: NDArray[np.float64]) -> list[str]:
        """Causes and remedies of large errors of modes (m,) [rad/s]; "" of small ones."""
        if not self.causes:
            return [""] * len(omega)
        errors = zip(self.of_frequencies(omega), self.shapes_of(omega), strict=True)
        return [explanation(scene, error, self.causes[j]) if j >= 0 else "" for error, j in errors]

    def at_contact(self, scene: Scene, relative: float) -> str:
        """Cause and remedy of a large relative error of a number of the impact, or of the static
        compliance: that of the shape with the largest part in the error of the compliance; "" of a
        small one."""
        if not self.causes:
            return ""
        elastic = np.where(self.omega > 0, self.omega, np.inf)
        part = (self.w / elastic**2) ** 2 * np.diag(self.energy)
        return explanation(scene, relative, self.causes[int(np.argmax(part))])

    @property
    def of_compliance(self) -> float | None:
        """Amount by which the static compliance at the contact [m/N] is too small; None if the
        structure floats."""
        if self.w is None or not np.all(self.omega > 0):
            return None
        u = self.w / self.omega**2
        of_energy = float(u @ self.energy @ u)
        if self.split is not None:
            of_run, finer = (
                rom.static_compliance(wall) - (wall.contact.half_space or 0.0)
                for wall in self.split.walls
            )
            return self.split.share * abs(finer - of_run) + of_energy
        return of_energy

    def walls(self, contact: rom.Contact) -> tuple[rom.ReducedModel, rom.ReducedModel]:
        """The assembly at its contact, as its mesh has it and without what the mesh misses; raises
        ValueError where that is not known."""
        if self.unknown:
            raise ValueError(self.unknown)
        if self.split is not None:
            # loss factors are shared out as in the run
            return tuple(
                wall._replace(contact=wall.contact._replace(strain=contact.strain))
                for wall in self.split.walls
            )
        contact = contact._replace(weights_read=None)
        return tuple(
            rom.ReducedModel(
                K, np.eye(len(K)), None, self.w, None, "free-modes", 0, {},
                n_residual=self.n_static, contact=contact,
            )
            for K in (np.diag(self.omega**2), without_missed(self.omega, self.energy))
        )  # fmt: skip


class StaticShape(NamedTuple):
    """Part of the static response at the contact beyond some modes Phi, as a mass-normalised shape:
    K phi = M Phi d + w / length."""

    phi: NDArray[np.float64]  # (n,) [kg^-1/2]
    omega: float  # [rad/s] sqrt(phi^T K phi)
    length: float  # [kg^1/2 m/N] by the mass, of what the response to 1 N has beyond the modes


def static_shape(
    scene: Scene,
    mesh: Parts,
    model: fem.Model,
    modes: AssemblyModes,
    space: rom.Space | None = None,
) -> StaticShape | None:
    """That of a held assembly, from its Krylov space: a stage of its own, so that a second process
    has it while the space serves the reduction. None of what floats and of what is not struck."""
    contact = None if space is None else contact_of_strike(scene, mesh, model)
    if contact is None:
        return None
    order = np.argsort(space.pairs.omega)
    omega, phi = space.pairs.omega[order], space.pairs.phi[:, order]
    return _beyond(len(modes.omega), omega, phi, contact.w)


def _beyond(
    n_modes: int, omega: NDArray[np.float64], phi: NDArray[np.float64], w: NDArray[np.float64]
) -> StaticShape:
    """The static shape in the space of phi (n, k) beyond its first modes."""
    of_contact = w @ phi[:, n_modes:]
    static = of_contact / omega[n_modes:] ** 2
    length = float(np.linalg.norm(static))
    stiffness = float(static @ of_contact) / length**2
    return StaticShape(phi[:, n_modes:] @ (static / length), stiffness**0.5, length)


def missed_by_mesh(
    scene: Scene,
    mesh: Parts,
    model: fem.Model,
    modes: AssemblyModes,
    static: StaticShape | None = None,
    field: fem.HalfSpaceField | None = None,
) -> MeshErrorEstimate:
    """The assembly's modes, and what its contact moves; the static shape is that of a held assembly
    beyond its modes, the field that of the half-space at its contact. A run stands without what
    cannot be estimated: the result says why."""
    try:
        return energy_of_shapes(scene, mesh, model, modes, static, field)
    except ValueError as reason:
        return MeshErrorEstimate(np.empty(0), np.empty((0, 0)), None, unknown=str(reason))


def energy_of_shapes(
    scene: Scene,
    mesh: Parts,
    model: fem.Model,
    modes: AssemblyModes,
    static: StaticShape | None = None,
    field: fem.HalfSpaceField | None = None,
) -> MeshErrorEstimate:
    """Missed energy of shapes; raises ValueError if a second mesh, or its modes, cannot be
    computed."""
    contact = contact_of_strike(scene, mesh, model)

    # of few elements every one is split; modes are paired by their number
    if contact is not None and second_mesh.of_few_elements(mesh):
        split_mesh, share = second_mesh.other_mesh(scene, mesh)
        split = stages.model(scene, split_mesh)
        lowest = fem.modes(split.K, split.M, min(len(modes.omega), split.K.shape[0] - 2))
        walls = tuple(
            second_mesh.wall_model(scene, on_mesh, stages.contact(scene, parts, on_mesh))
            for on_mesh, parts in ((model, mesh), (split, split_mesh))
        )
        pair = SplitMesh(lowest.omega, walls, share)
        # no split element tells of features that all meshes leave out
        omega, phi = modes.omega, modes.phi
        if static is not None:
            omega, phi = np.append(omega, static.omega), np.column_stack([phi, static.phi])
        left_out = energy_left_out(mesh, model, phi, omega)
        energy = left_out.sum(axis=0)
        return MeshErrorEstimate(omega, energy, contact.w @ phi, split=pair, left_out=left_out)

    shapes = loaded_shapes(scene, model, modes, contact, static, field)
    energy = energy_in(scene, mesh, model, shapes.phi, shapes.D, shapes.pushed)
    static_from = KrylovOptions().reach * 2 * np.pi * max(TO_HZ, scene.reduction.to_hz or 0.0)
    # shapes of unit mass have the energy omega^2
    elastic = np.flatnonzero(shapes.omega > RIGID * shapes.omega.max())
    shown = elastic[: scene.mesh.modes]
    shown = shown if shapes.pushed is None else np.union1d(shown, elastic[-1:])
    of_cells = {
        body: factor(mesh, body) * (e[:, shown] / shapes.omega[shown] ** 2).max(axis=1, initial=0.0)
        for body, e in energy.missed.of_cells.items()
    }
    return MeshErrorEstimate(
        shapes.omega, energy.G, shapes.w, int(np.sum(shapes.omega > static_from)),
        causes=causes(mesh, energy.missed.of_cells), of_cells=of_cells, left_out=energy.left_out,
    )  # fmt: skip


def contact_of_strike(scene: Scene, mesh: Parts, model: fem.Model) -> fem.ContactPatch | None:
    """The contact; None where nothing is struck."""
    try:
        return stages.contact(scene, mesh, model)
    except (InvalidScene, ValueError):
        return None


class LoadedShapes(NamedTuple):
    """Modes of an assembly and, where it is struck, what its contact moves beyond them as the last
    shape: K phi = M phi D + what is pushed."""

    omega: NDArray[np.float64]  # (k,) [rad/s]
    phi: NDArray[np.float64]  # (n, k) [kg^-1/2] mass-normalised
    D: NDArray[np.float64]  # (k, k) [rad^2/s^2]
    w: NDArray[np.float64] | None = None  # (k,) [kg^-1/2] at the contact
    pushed: fem.Pushed | None = None


def loaded_shapes(
    scene: Scene,
    model: fem.Model,
    modes: AssemblyModes,
    contact: fem.ContactPatch | None,
    static: StaticShape | None = None,
    field: fem.HalfSpaceField | None = None,
) -> LoadedShapes:
    """Shapes whose missed energy tells the errors of frequencies and of the wall; what the contact
    moves of a floating assembly is found from modes with residual attachment. Raises ValueError
    where these cannot be computed."""
    omega, phi = modes.omega, modes.phi
    if contact is None:
        return LoadedShapes(omega, phi, np.diag(omega**2))
    if static is None:
        n = min(len(omega) + N_KRYLOV, model.K.shape[0] - 2)
        n_modes = min(len(omega), N_MODES[0])
        known = omega[:n_modes], phi[:, :n_modes]
        selected = rom.Selection(n_modes=n, choice="contact", to_hz=TO_HZ, modes=known)
        reduced = rom.free_modes(model.K, model.M, contact.w, selected, factorise=fem.factorised)
        order = np.argsort(np.diag(reduced.K))
        of_space, shapes = np.sqrt(np.diag(reduced.K))[order], reduced.T[:, order]
        static = _beyond(n_modes, of_space, shapes, contact.w)
        omega, phi = of_space[:n_modes], shapes[:, :n_modes]

    # K u = M u D + w holds of the modes and of the static shape, of Ritz vectors that have not
    # converged it does not
    D = np.pad(np.diag(omega**2), (0, 1))
    D[:-1, -1] = -(contact.w @ phi) / static.length
    phi, omega = np.column_stack([phi, static.phi]), np.append(omega, static.omega)
    field, pushed = field or half_space_at(scene, model, contact), None
    if field is not None:
        force = np.append(np.zeros(len(omega) - 1), 1 / static.length)
        pushed = fem.Pushed(force[:, None], field)
    return LoadedShapes(omega, phi, D, contact.w @ phi, pushed)


class ShapeEnergy(NamedTuple):
    """Energy that a mesh misses in shapes."""

    G: NDArray[np.float64]  # (k, k) [rad^2/s^2] stated, with the dents
    # (k, k) [rad^2/s^2] of it, under springs and of what meshes leave out: no mesh lowers them
    dents: NDArray[np.float64]
    missed: fem.MissedEnergy  # as found, without `factor`
    left_out: NDArray[np.float64]  # (features, k, k) [rad^2/s^2] of the dents, of `Parts.left_out`


def factor(mesh: Parts, body: str) -> float:
    """Times the energy found in the elements of a body, the one that is stated."""
    return SAFETY * (1.0 if isinstance(mesh.meshes[body], MeshHex) else TETRAHEDRA_SHARE)


def energy_in(
    scene: Scene,
    mesh: Parts,
    model: fem.Model,
    phi: NDArray[np.float64],
    D: NDArray[np.float64],
    pushed: fem.Pushed | None = None,
) -> ShapeEnergy:
    """Energy that the mesh misses in mass-normalised shapes phi (n, k) with K phi = M phi D + the
    forces pushed."""
    connections, load = mesh.assembled, mesh.load
    sides = [side for j in connections.joints for side in (j.first, j.second) if side]
    rigid = {side.face for side in sides if side.coupling == "rigid" and np.isinf(side.within)}
    faces = {side.face for side in sides} - rigid
    faces |= {mesh.face(mass_face(mass.name)) for mass in scene.masses or ()}
    springs = [(spring.name, end) for spring in scene.springs or () for end in spring.ends]
    faces |= {mesh.face(spring_face(*end)) for end in springs}
    faces |= {mesh.face(part_face(part.name)) for part in scene.measured or ()}
    faces |= {face for pair in mesh.contacts for face in (pair.slave, pair.master)}
    faces |= {face for rod in mesh.rods for face in rod[:2]}
    still = [*connections.held, *(fem.HeldFace(face) for face in sorted(rigid))]
    if load is not None:
        faces |= {force.face for force in load.forces}
        faces |= {face for rod in load.rods for face in rod[:2]}
    boundary = fem.Faces(still, faces, connections.ties)
    # products of small blocks: on two busy cores threads take 2 to 4 times as long as one
    with fem.one_thread():
        missed = fem.missed_energy(model, mesh.materials, phi, D, boundary, pushed=pushed)
    dents = fem.missed_in_dents(model, mesh.materials, phi)
    left_out = energy_left_out(mesh, model, phi, np.sqrt(np.maximum(np.diag(D), 0.0)))
    dents = dents + left_out.sum(axis=0)
    G = sum(factor(mesh, body) * of_body for body, of_body in missed.of_bodies.items())
    return ShapeEnergy(G + dents, dents, missed, left_out)


def energy_left_out(
    mesh: Parts, model: fem.Model, phi: NDArray[np.float64], omega: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(features, k, k) [rad^2/s^2] of the energy of mass-normalised shapes phi (n, k) with omega
    (k,) [rad/s], by features that the mesh leaves out."""
    features = [fem.LeftOut(r.body, r.places, r.volume, r.factor) for r in mesh.left_out]
    return fem.energy_left_out(model, mesh.materials, features, phi, omega)


def without_missed(omega: NDArray[np.float64], energy: NDArray[np.float64]) -> NDArray[np.float64]:
    """K_0 (k, k) of mass-normalised shapes with K = diag(omega^2), in which the mesh misses the
    energy G (k, k); rigid motions as zeros."""
    elastic = omega > 0
    K_0 = np.zeros((len(omega), len(omega)))
    at, omega = np.ix_(elastic, elastic), omega[elastic]
    # K_0 = Omega (1 + Omega^-1 G Omega^-1)^-1 Omega is positive, however large G is
    missed = np.eye(len(omega)) + energy[at] / np.outer(omega, omega)
    K_0[at] = np.linalg.inv(missed) * np.outer(omega, omega)
    return (K_0 + K_0.T) / 2
