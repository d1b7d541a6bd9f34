"""A plane face struck at many points: its outline, its contact patches, and the walls at them.

Mesh, model and the modes that all points share are computed once; every point adds static
solutions of its own (`rom.many_contacts`).
"""

from contextlib import nullcontext
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from beadwave import fem, rom
from beadwave.coupling.damping import Damping, damping_ratios
from beadwave.coupling.many_contacts import Walls
from beadwave.dem import Wall
from beadwave.fem.assembly.trace import OffFace
from beadwave.rom import floating
from beadwave.rom.factorisation import Pencil, symmetric
from beadwave.rom.lanczos import EigenPairs, modes_below
from beadwave.workflows.scene import InvalidScene, LossFactorsTable, ModalDampingTable, Scene
from beadwave.workflows.scene.tables.reduction import TO_HZ
from beadwave.workflows.stages.chain.chain import Start, start
from beadwave.workflows.stages.chain.damping import damping_law
from beadwave.workflows.stages.engine.pipeline import Pipeline, pipeline_of
from beadwave.workflows.stages.engine.stage_table import Stage, tables_of
from beadwave.workflows.stages.errors.mesh_error import energy_in, without_missed
from beadwave.workflows.stages.errors.second_mesh import of_few_elements, other_mesh
from beadwave.workflows.stages.structure import assembly as stages
from beadwave.workflows.stages.structure.assembly import solid, struck
from beadwave.workflows.stages.structure.loss_factors import structure_damping
from beadwave.workflows.stages.structure.meshed_parts import Parts
from beadwave.workflows.thesis import HAMMER_TEST_HZ

# Patches and modes of a face that is struck at many points
# points of a patch's quadrature along its radius and around; the half-space compliance is that
# of the same weights on the same mesh, so that their error cancels
N_RADIAL = 8
N_AROUND = 24
# highest frequency of the modes that all points share, over the one that errors hold up to. On
# a 4 mm plate a factor of 2 costs as much as 300 static solutions and saves 7 at every point
HIGHER_FREQUENCY = 2.0

AXES = "xyz"


class Outline(NamedTuple):
    """A plane face in the two axes that span it, measured from its middle [m]."""

    axes: tuple[str, str]  # "x", "y" or "z", the global axes nearest to the two
    lower: NDArray[np.float64]  # (2,)
    upper: NDArray[np.float64]  # (2,)
    edges: NDArray[np.float64]  # (m, 2, 2) ends of the mesh's edges along its rim and its holes


class StruckFace:
    """The face that a scene strikes, of an assembly that is meshed and joined once.

    On the scene's mesh unless `mesh` is given. Outline and modes are cached like stages of a run.
    Raises InvalidScene where points cannot share modes: for a patch of nodes of the mesh, and for
    joints with dashpots.
    """

    def __init__(self, scene: Scene, mesh: Parts | None = None) -> None:
        strike, table = scene.strike, scene.strike_table
        if strike is not None and (strike.weights == "thesis" or strike.nodes):
            key = f"{table}.nodes" if strike.nodes else f'{table}.weights = "thesis"'
            raise InvalidScene(
                f'{key} is bound to nodes of the mesh; a scan takes {table}.weights "hertz" or '
                '"area".'
            )
        loose = [f"joints.{name}" for name, table in scene.bushings.items() if table.dashpots]
        loose += [
            f"springs.{spring.name}"
            for spring in scene.springs or ()
            if any(spring.dashpots.values())
        ]
        if scene.measured:
            raise InvalidScene(
                f"measured.{scene.measured[0].name} has damping, which couples the wall's modes; a "
                "scan takes assemblies without [[measured]]."
            )
        if loose:
            raise InvalidScene(
                f"{loose[0]} has dashpots, which couple the wall's modes; set them to 0 for a scan."
            )
        self.scene, self.name, self._mesh = scene, struck(scene), mesh
        self.pipeline: Pipeline = pipeline_of(scene, lambda name: nullcontext(), FURTHER)

    @cached_property
    def model(self) -> fem.Model:
        """The assembly on its mesh."""
        return stages.model(self.scene, self._mesh) if self._mesh else self.pipeline("model")

    @cached_property
    def _basis(self) -> tuple[Pencil, EigenPairs]:
        """K and M with a factor, and the modes that all points share; kept for the scene's mesh."""
        if self._mesh is None:
            return self.pipeline("pencil"), self.pipeline("face-modes")
        problem = pencil(self.scene, self.model)
        return problem, modes(self.scene, problem)

    @property
    def begun(self) -> Start:
        """The chain before the impact, which is the same at all points."""
        return start(self.scene, self.pipeline("surface"))

    def outline(self) -> Outline:
        """Outline of the face; raises InvalidScene for one that is not plane."""
        return self.pipeline("outline")

    def placed(
        self, points: NDArray[np.float64]
    ) -> tuple[dict[int, fem.ContactPatch], dict[int, str]]:
        """Patches at points (p, 2) [m], measured along the face's axes from its middle, and why
        there is none at the others; both by the point's index."""
        table, patches, refused = self.scene.strike, {}, {}
        for i, at in enumerate(points.tolist()):
            try:
                patches[i] = fem.contact_patch(
                    self.model, self.name, tuple(at), table.radius, weights=table.weights,
                    n_radial=N_RADIAL, n_around=N_AROUND,
                )  # fmt: skip
            except OffFace:
                refused[i] = f"the patch of radius {table.radius:g} m leaves the face at {at} m."
            except ValueError as reason:
                refused[i] = str(reason)
        return patches, refused

    def walls(self, patches: list[fem.ContactPatch], n_beyond: int) -> Walls:
        """The wall at each patch: the shared modes and up to `n_beyond` oscillators of its own for
        what they leave out; raises ValueError for what cannot be reduced."""
        scene, model = self.scene, self.model
        W = csc_array(np.column_stack([patch.w for patch in patches]))
        steel = solid(scene, scene.struck_body)
        local = fem.half_spaces_on_mesh(model, self.name, patches, steel)
        basis = self._basis
        with fem.one_thread():
            contacts = rom.many_contacts(*basis, W, n_beyond)
        return Walls(contacts, np.array(local), self._damping())

    def without_missed_energy(self, wall: Wall, patches: list[fem.ContactPatch]) -> Wall:
        """The wall of each patch with the strain energy taken off its stiffness that the mesh
        misses in the shared modes and in the static response beyond them."""
        problem, shared = self._basis
        k, material = len(shared.omega), solid(self.scene, self.scene.struck_body)
        omega, phi = wall.omega.copy(), wall.phi.copy()
        n_done = 0
        for field in fem.half_space_fields(self.model, self.name, patches, material):
            group = slice(n_done, n_done + field.u.shape[1])
            W = csc_array(np.column_stack([patch.w for patch in patches[group]]))
            with fem.one_thread():
                r = rom.static_responses(problem, W, shared)

            # K r = w - sum M phi_j phi_j^T w
            D = np.diag(np.append(shared.omega**2, np.zeros(W.shape[1])))
            D[:k, k:] = -(W.T @ shared.phi).T
            force = np.concatenate([np.zeros((k, W.shape[1])), np.eye(W.shape[1])])
            u, pushed = np.column_stack([shared.phi, r]), fem.Pushed(force, field)
            G = energy_in(self.scene, self.pipeline("mesh"), self.model, u, D, pushed).G

            # the oscillators beyond the modes follow a unit force by phi / omega^2, which makes up
            # r: each takes part in it by phi over what r has at the contact
            for i, at_contact in enumerate((W * r).sum(axis=0).tolist()):
                of_r = (
                    phi[n_done + i, k:] / at_contact if at_contact > 0 else 0 * phi[n_done + i, k:]
                )
                B = np.zeros((k + 1, omega.shape[1]))
                B[:k, :k], B[k, k:] = np.eye(k), of_r
                with_r = np.append(np.arange(k), k + i)
                missed = B.T @ G[np.ix_(with_r, with_r)] @ B
                squares, R = np.linalg.eigh(without_missed(omega[n_done + i], missed))
                # rigid motions are exact zeros, not rounding
                squares[: np.count_nonzero(wall.omega[n_done + i] == 0)] = 0.0
                omega[n_done + i] = squares**0.5
                phi[n_done + i] = phi[n_done + i] @ R
            n_done = group.stop
        zeta = damping_ratios(self._damping(), omega.ravel()).reshape(omega.shape)
        return wall._replace(omega=omega, zeta=zeta, phi=phi)

    @property
    def few_elements(self) -> bool:
        """True if the mesh is so small that its error is found by splitting its elements."""
        return of_few_elements(self.pipeline("mesh"))

    def split(self) -> tuple["StruckFace", float]:
        """The face on a mesh of few elements, of which each is split, and the share of the
        difference to it that is the error of the mesh as it is."""
        mesh, error_share = other_mesh(self.scene, self.pipeline("mesh"))
        return StruckFace(self.scene, mesh), error_share

    def _damping(self) -> Damping | None:
        """The damping law of the walls, ratios of measured modes at the computed frequencies."""
        table, hz = self.scene.damping, None
        if isinstance(table, LossFactorsTable):
            # of the mesh of the scene, on a split one too: their shares are alike
            whole = self.pipeline
            return structure_damping(self.scene, whole("model"), whole("modes"))
        if isinstance(table, ModalDampingTable) and isinstance(table.ratio, tuple):
            hz = tuple(self.pipeline("modes").paired_hz.values())
        return damping_law(table, hz or HAMMER_TEST_HZ)


def outline(scene: Scene, mesh: Parts, model: fem.Model) -> Outline:
    """Outline of the face that the scene strikes; raises InvalidScene if it is not plane."""
    name, structure = struck(scene), model.structure
    if mesh.struck and mesh.struck.radius is not None:
        raise InvalidScene(f"the face {name!r} is round; scan a plane one.")
    spot = fem.planar_spot(structure, name, (0.0, 0.0))
    edges = (fem.face_edges(structure, name) - spot.point) @ spot.axes.T
    names = tuple(AXES[i] for i in np.abs(spot.axes).argmax(axis=1))
    flat = edges.reshape(-1, 2)
    return Outline(names, flat.min(axis=0), flat.max(axis=0), edges)


def pencil(scene: Scene, model: fem.Model) -> Pencil:
    """K and M of the assembly, symmetric to the last bit, with a factorisation of K, shifted where
    the assembly floats."""
    K, M = symmetric(model.K, "K"), symmetric(model.M, "M")
    return floating.pencil(K, M, fem.factorised)


def modes(scene: Scene, problem: Pencil) -> EigenPairs:
    """The modes that all points of a face share, up to HIGHER_FREQUENCY times the frequency
    `to_hz`."""
    return modes_below(problem, HIGHER_FREQUENCY * to_hz(scene))


def to_hz(scene: Scene) -> float:
    """Frequency [Hz] up to which the error of the reduction holds."""
    return scene.wall.cutoff or scene.reduction.cutoff or scene.reduction.to_hz or TO_HZ


FURTHER = (
    Stage("outline", ".structure.face:outline", tables_of("strike"), ("mesh", "model")),
    Stage("pencil", ".structure.face:pencil", tables_of(), ("model",), kept=False, listed=False),
    Stage("face-modes", ".structure.face:modes", to_hz, ("pencil",)),
)
