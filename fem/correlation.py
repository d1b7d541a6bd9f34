"""Which mode is which: told by a body's motion, by number, or by measured shapes.

The order of frequencies does not tell modes: those of soft parts lie between those of stiff ones,
and move with the joints. A mode is told by the share of its kinetic energy in a body's rigid
motion ("x", "x+ry"), by the share of its strain energy in a body ("strain"), or by the modal
assurance criterion with a measured shape.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from fem.joints import rigid_motion
from fem.model import Model
from fem.modes import Modes

LEAST_SHARE = 0.3  # a mode has a character from this share on
RIGID = 1e-4  # below this share of the highest frequency a mode strains nothing but by rounding
MOTIONS = ("x", "y", "z", "rx", "ry", "rz")
STRAIN = "strain"


class BodyMotion(NamedTuple):
    """A mode told by what a body does in it."""

    body: str
    motion: str  # of MOTIONS, or several as "x+ry"; or STRAIN

    @property
    def directions(self) -> list[int]:
        """Positions in MOTIONS, none for STRAIN; raises ValueError for what is neither."""
        if self.motion == STRAIN:
            return []
        try:
            return [MOTIONS.index(one) for one in self.motion.split("+")]
        except ValueError:
            raise ValueError(
                f"motion = {self.motion!r} of {self.body} must be a sum of {', '.join(MOTIONS)}, "
                f'as in "x+ry", or "{STRAIN}".'
            ) from None


class Number(NamedTuple):
    """A mode told by its place among those that strain something, from 1."""

    number: int


class Shape(NamedTuple):
    """A mode told by a measured shape."""

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


def paired(forms: Mapping[str, BodyForms], modes: Modes, targets: Sequence[Target]) -> Pairing:
    """The same by the forms of bodies, in the coordinates of the modes.

    Of a motion it is the first mode whose share reaches `LEAST_SHARE` and half of the largest share
    found; of a shape the mode of the largest MAC.
    """
    rows = [_character(forms, modes, target) for target in targets]
    character = np.array(rows).reshape(len(targets), len(modes.omega))
    enough = [1.0 if isinstance(target, Shape) else 0.5 for target in targets]
    least = np.array(enough)[:, None] * character.max(axis=1, keepdims=True, initial=0.0)
    eligible = character >= np.maximum(least, LEAST_SHARE)
    index = np.where(eligible.any(axis=1), eligible.argmax(axis=1), -1)
    score = np.where(index >= 0, character[range(len(targets)), index], 0.0)
    return Pairing(index, score, character)


def _character(forms: Mapping[str, BodyForms], modes: Modes, target: Target) -> NDArray[np.float64]:
    """How much of a target every mode is, (k,)."""
    elastic = modes.omega > RIGID * modes.omega.max()
    if isinstance(target, Number):
        return 1.0 * (elastic & (np.cumsum(elastic) == target.number))
    if isinstance(target, Shape):
        return mac(target.reading @ modes.phi, target.shape[:, None])[:, 0]
    form, directions = forms[target.body], target.directions
    if directions:
        return ((form.rigid[directions] @ modes.phi) ** 2).sum(axis=0)
    strain = np.sum(modes.phi * (form.K @ modes.phi), axis=0)
    return np.where(elastic, strain / np.where(elastic, modes.omega, 1.0) ** 2, 0.0)


def body_forms(model: Model, body: str, V: NDArray[np.float64]) -> BodyForms:
    """Energies and rigid motions of a body for displacements V (n, m) of a model's free dofs."""
    structure, dofs = model.structure, model.structure.dofs(body)
    u, K, M = model.T[dofs] @ V, structure.K[dofs][:, dofs], structure.M[dofs][:, dofs]
    nodes = structure.points[dofs[0::3] // 3]
    R = rigid_motion(nodes, _centre_of_mass(nodes, M))
    R = R @ np.linalg.inv(np.linalg.cholesky(R.T @ (M @ R))).T
    return BodyForms(u.T @ (K @ u), u.T @ (M @ u), (M @ R).T @ u)


def target_mac(
    models: tuple[Model, Model], shapes: tuple[NDArray, NDArray], targets: Sequence[Target]
) -> NDArray[np.float64]:
    """MAC (k, n_targets) of shapes phi (n, k) of one model with psi (m, n_targets) of another on
    the same mesh, one for each target: on the body that tells it, or on all bodies."""
    phi, psi = (model.T @ shape for model, shape in zip(models, shapes, strict=True))
    structure = models[0].structure
    columns = []
    for j, target in enumerate(targets):
        told = isinstance(target, BodyMotion)
        dofs = structure.dofs(target.body) if told else slice(None)
        columns.append(mac(phi[dofs], psi[dofs, j : j + 1])[:, 0])
    return np.array(columns).reshape(len(targets), phi.shape[1]).T


def _centre_of_mass(nodes, M) -> NDArray[np.float64]:
    lumped = np.asarray(M.sum(axis=1)).ravel()[0::3]
    return lumped @ nodes / lumped.sum()


def effective_mass(model: Model, phi: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share (k, 3) of the whole mass that each mode (n, k) carries along x, y and z."""
    structure = model.structure
    R = rigid_motion(structure.points, np.zeros(3))[:, :3]
    inertia = structure.M @ R
    return (phi.T @ (model.T[: len(R)].T @ inertia)) ** 2 / np.sum(R * inertia, axis=0)
