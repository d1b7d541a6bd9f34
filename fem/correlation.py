"""Which mode is which: identified by a body's motion, by number, or by measured shapes.

The order of frequencies does not identify modes: those of soft parts lie between those of stiff
ones, and move with the joints. What does is the share of a mode's kinetic energy in a body's rigid
motion ("x", "x+ry"), the share of its strain energy in a body ("strain"), or the modal assurance
criterion with a measured shape.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from fem.joints import rigid_motion
from fem.model import Model
from fem.modes import Modes

RIGID = 1e-4  # frequency over the highest one, below which a mode is a rigid-body motion
MOTIONS = ("x", "y", "z", "rx", "ry", "rz")
STRAIN = "strain"


class BodyMotion(NamedTuple):
    """A mode identified by what a body does in it."""

    body: str
    motion: str  # of MOTIONS, or several as "x+ry"; or STRAIN

    @property
    def directions(self) -> list[int]:
        """Positions in MOTIONS, none for STRAIN; raises ValueError for what is neither."""
        if self.motion == STRAIN:
            return []
        try:
            return [MOTIONS.index(name) for name in self.motion.split("+")]
        except ValueError:
            raise ValueError(
                f"motion = {self.motion!r} of {self.body} must be a sum of {', '.join(MOTIONS)}, "
                f'as in "x+ry", or "{STRAIN}".'
            ) from None


class Number(NamedTuple):
    """A mode identified by its number, from 1, among those that strain something."""

    number: int


class Shape(NamedTuple):
    """A mode identified by a measured shape."""

    reading: NDArray[np.float64] | csr_matrix  # (m, n) reads a model where and how the test did
    shape: NDArray[np.complex128]  # (m,) measured

    def within(self, V: NDArray[np.float64]) -> "Shape":
        """The same in coordinates q of u = V @ q."""
        return Shape(self.reading @ V, self.shape)


Target = BodyMotion | Number | Shape


class Pairing(NamedTuple):
    """The targets among computed modes."""

    index: NDArray[np.int64]  # (n_targets,) position in the modes, -1 where none fits
    score: NDArray[np.float64]  # (n_targets,) its share of the energy, or MAC
    character: NDArray[np.float64]  # (n_targets, k) the same for every mode


class BodyForms(NamedTuple):
    """Energies and rigid motions of one body in coordinates q (m,) of u = V @ q."""

    K: NDArray[np.float64]  # (m, m) its strain energy is q^T K q / 2
    M: NDArray[np.float64]  # (m, m) its kinetic energy v^T M v / 2
    rigid: NDArray[np.float64]  # (6, m) its momenta in shifts x y z and turns, mass-normalised


def mac(phi: NDArray, psi: NDArray) -> NDArray[np.float64]:
    """Modal assurance criterion |phi^H psi|^2 / (phi^H phi psi^H psi), (k, l).

    Allemang and Brown, Proc. 1st Int. Modal Analysis Conf. (1982).
    """
    cross = np.abs(phi.conj().T @ psi) ** 2
    return cross / np.outer(*(np.sum(np.abs(a) ** 2, axis=0) for a in (phi, psi)))


def pair(model: Model, modes: Modes, targets: Sequence[Target]) -> Pairing:
    """The targets among the modes of a model."""
    bodies = {target.body for target in targets if isinstance(target, BodyMotion)}
    forms = {body: body_forms(model, body, modes.phi) for body in bodies}
    by_mode = [t.within(modes.phi) if isinstance(t, Shape) else t for t in targets]
    return paired(forms, modes._replace(phi=np.eye(len(modes.omega))), by_mode)


def paired(
    forms: Mapping[str, BodyForms],
    modes: Modes,
    targets: Sequence[Target],
    *,
    smallest: float = 0.3,
) -> Pairing:
    """The targets among modes in the coordinates of the bodies' energies `forms`.

    A target by motion is the first mode whose share of the energy reaches half of the largest one;
    a target by shape is the mode of the largest MAC. No mode with a share or MAC below `smallest`
    is paired.
    """
    elastic = modes.omega > RIGID * modes.omega.max()
    character = np.zeros((len(targets), len(modes.omega)))
    for i, target in enumerate(targets):
        if isinstance(target, Number):
            character[i] = elastic & (np.cumsum(elastic) == target.number)
            continue
        if isinstance(target, Shape):
            character[i] = mac(target.reading @ modes.phi, target.shape[:, None])[:, 0]
            continue
        form, directions = forms[target.body], target.directions
        if directions:
            character[i] = ((form.rigid[directions] @ modes.phi) ** 2).sum(axis=0)
            continue
        # strain energy of the body over that of the mode, omega^2 / 2; rigid motions have neither
        strain = np.sum(modes.phi * (form.K @ modes.phi), axis=0)
        omega = np.where(elastic, modes.omega, 1.0)
        character[i] = np.where(elastic, strain / omega**2, 0.0)

    share = [1.0 if isinstance(target, Shape) else 0.5 for target in targets]
    threshold = np.array(share)[:, None] * character.max(axis=1, keepdims=True, initial=0.0)
    eligible = character >= np.maximum(threshold, smallest)
    index = np.where(eligible.any(axis=1), eligible.argmax(axis=1), -1)
    score = np.where(index >= 0, character[range(len(targets)), index], 0.0)
    return Pairing(index, score, character)


def body_forms(model: Model, body: str, V: NDArray[np.float64]) -> BodyForms:
    """Energies and rigid motions of a body for displacements V (n, m) of a model's free dofs."""
    structure, dofs = model.structure, model.structure.dofs(body)
    u, K, M = model.T[dofs] @ V, structure.K[dofs][:, dofs], structure.M[dofs][:, dofs]
    nodes = structure.points[dofs[0::3] // 3]
    lumped = np.asarray(M.sum(axis=1)).ravel()[0::3]
    centre_of_mass = lumped @ nodes / lumped.sum()
    R = rigid_motion(nodes, centre_of_mass)
    R = R @ np.linalg.inv(np.linalg.cholesky(R.T @ (M @ R))).T
    return BodyForms(u.T @ (K @ u), u.T @ (M @ u), (M @ R).T @ u)


def target_mac(
    models: tuple[Model, Model], shapes: tuple[NDArray, NDArray], targets: Sequence[Target]
) -> NDArray[np.float64]:
    """MAC (k, n_targets) of shapes phi (n, k) of one model with psi (m, n_targets) of another on
    the same mesh, one for each target: on the body that it names, or on all bodies."""
    phi, psi = (model.T @ shape for model, shape in zip(models, shapes, strict=True))
    structure = models[0].structure
    columns = []
    for j, target in enumerate(targets):
        has_body = isinstance(target, BodyMotion)
        dofs = structure.dofs(target.body) if has_body else slice(None)
        columns.append(mac(phi[dofs], psi[dofs, j : j + 1])[:, 0])
    return np.array(columns).reshape(len(targets), phi.shape[1]).T


def effective_mass(model: Model, phi: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share (k, 3) of the total mass that each mode phi_k of phi (n, k), mass-normalised, carries
    along x, y and z: (phi_k^T M e)^2 / e^T M e, with e a unit shift of the whole structure. Those
    of all modes add up to 1, less the share of mass at dofs that are held."""
    structure = model.structure
    R = rigid_motion(structure.points, np.zeros(3))[:, :3]
    inertia = structure.M @ R
    return (phi.T @ (model.T[: len(R)].T @ inertia)) ** 2 / np.sum(R * inertia, axis=0)
