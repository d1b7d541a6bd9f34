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

import fem
import rom
from coupling.damping import Damping
from coupling.many_contacts import Walls
from fem.trace import OffFace
from rom import floating
from rom.factorisation import Pencil, symmetric
from rom.lanczos import EigenPairs, modes_below
from workflows.scene import InvalidScene, LossFactorsTable, ModalDampingTable, Scene
from workflows.scene.reduction import TO_HZ
from workflows.stages import assembly as stages
from workflows.stages.assembly import solid, struck
from workflows.stages.chain import Start, start
from workflows.stages.damping import damping_law
from workflows.stages.errors import other_mesh
from workflows.stages.loss_factors import structure_damping
from workflows.stages.mesh_error import energy_in, without_missed
from workflows.stages.parts import Parts
from workflows.stages.pipeline import Pipeline, Stage, pipeline_of, tables_of
from workflows.thesis import HAMMER_TEST_HZ


class FaceOptions(NamedTuple):
    """Patches and modes of a face that is struck at many points."""

    # points of a patch's quadrature along its radius and around; the half-space compliance is that
    # of the same weights on the same mesh, so that their error cancels
    n_radial: int = 8
    n_around: int = 24
    # highest frequency of the modes that all points share, over the one that errors hold up to. On
    # a 4 mm plate a factor of 2 costs as much as 300 static solutions and saves 7 at every point
    higher: float = 2.0


SCAN = FaceOptions()
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
        table = "patch" if scene.of_dimensions else "strike"
        scene = scene.written_out
        strike = scene.strike
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
        if self._mesh is None:
            return self.pipeline("pencil"), self.pipeline("face-modes")
        problem = pencil(self.scene, self.model)
        return problem, modes(self.scene, problem)

    @property
    def begun(self) -> Start:
        """The chain before the impact, which is the same at all points."""
        return start(self.scene, self.pipeline("surface"))

    def outline(self) -> Outline:
        """Where the face ends; raises InvalidScene for one that is not plane."""
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
                    n_radial=SCAN.n_radial, n_around=SCAN.n_around,
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

    def without_missed_energy(self, walls: Walls) -> Walls:
        """The same walls with the modes as they are once the strain energy that the mesh misses in
        them is taken off their stiffness."""
        omega = walls.contacts.omega
        squares, R = np.linalg.eigh(without_missed(omega, self.pipeline("face-missed")))
        # rigid motions are exact zeros, not rounding
        softer = np.where(squares > 1e-9 * squares[-1], squares, 0.0) ** 0.5
        contacts = walls.contacts._replace(omega=softer, phi=walls.contacts.phi @ R)
        return walls._replace(contacts=contacts)

    def second(self) -> tuple["StruckFace", float]:
        """The face on a coarser or finer mesh, and the factor from the difference between the two
        to the error of this one; raises ValueError where there is no such mesh."""
        mesh, error_share = other_mesh(self.scene, self.pipeline("mesh"))
        return StruckFace(self.scene, mesh), error_share

    def _damping(self) -> Damping | None:
        table, hz = self.scene.damping, None
        if isinstance(table, LossFactorsTable):
            # of the mesh of the scene, on a second one too: their shares are alike
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
    """The modes that all points of a face share, up to `SCAN.higher` times the frequency
    `to_hz`."""
    return modes_below(problem, SCAN.higher * to_hz(scene))


def missed(scene: Scene, mesh: Parts, model: fem.Model, modes: EigenPairs) -> NDArray[np.float64]:
    """G (k, k) [rad^2/s^2] that the mesh misses in the modes that all points share."""
    return energy_in(scene, mesh, model, modes.phi, np.diag(modes.omega**2))[0]


def to_hz(scene: Scene) -> float:
    """Frequency [Hz] up to which the error of the reduction holds."""
    return scene.wall.cutoff or scene.reduction.cutoff or scene.reduction.to_hz or TO_HZ


FURTHER = {
    "outline": Stage(".face:outline", tables_of("strike"), ("mesh", "model")),
    "pencil": Stage(".face:pencil", tables_of(), ("model",), kept=False, listed=False),
    "face-modes": Stage(".face:modes", to_hz, ("pencil",)),
    "face-missed": Stage(".face:missed", to_hz, ("mesh", "model", "face-modes")),
}
