"""Which mode is which: the modal assurance criterion, and the four hammer-test modes by shape.

Modes of the test are told by the block: 1 it sways across the sheets (y), 2 it moves along the
chain and pitches, 3 it yaws, 4 it is itself deformed. The order of frequencies does not tell them,
modes of the sheets lie in between.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fem.joints import rigid_motion
from fem.model import Model
from fem.modes import Modes

LEAST_SHARE = 0.3  # a mode has a character from this share on
RIGID = 1e-5  # below this share of the highest frequency a mode strains nothing but by rounding


class Pairing(NamedTuple):
    """The four hammer-test modes among computed ones."""

    index: NDArray[np.int64]  # (4,) position in the modes, -1 where none fits
    score: NDArray[np.float64]  # (4,) its share of the energy
    character: NDArray[np.float64]  # (4, k) the share for every mode


class BodyForms(NamedTuple):
    """Energies and rigid motions of one body as functions of a model's coordinates."""

    K: NDArray[np.float64]  # (n, n) its strain energy is u^T K u / 2
    M: NDArray[np.float64]  # (n, n) its kinetic energy v^T M v / 2
    rigid: NDArray[np.float64]  # (6, n) its momenta in shifts x y z and turns, mass-normalised

    def within(self, V: NDArray[np.float64]) -> "BodyForms":
        """The same forms in coordinates q of u = V @ q."""
        return BodyForms(V.T @ (self.K @ V), V.T @ (self.M @ V), self.rigid @ V)


def mac(phi: NDArray[np.float64], psi: NDArray[np.float64]) -> NDArray[np.float64]:
    """Modal assurance criterion |phi^T psi|^2 / (phi^T phi psi^T psi), (k, l).

    Allemang and Brown, Proc. 1st Int. Modal Analysis Conf. (1982).
    """
    cross = np.abs(phi.T @ psi) ** 2
    return cross / np.outer(np.sum(phi**2, axis=0), np.sum(psi**2, axis=0))


def pair(model: Model, modes: Modes, *, body: str = "block") -> Pairing:
    """The hammer-test modes by the motion of `body`: the first mode of each character."""
    return paired(body_forms(model, body), modes)


def paired(forms: BodyForms, modes: Modes) -> Pairing:
    """The first mode whose share reaches `LEAST_SHARE` and half of the largest share found."""
    character = _characters(forms, modes)
    largest = character.max(axis=1, keepdims=True)
    eligible = character >= np.maximum(0.5 * largest, LEAST_SHARE)
    index = np.where(eligible.any(axis=1), eligible.argmax(axis=1), -1)
    score = np.where(index >= 0, character[range(4), index], 0.0)
    return Pairing(index, score, character)


def _characters(forms: BodyForms, modes: Modes) -> NDArray[np.float64]:
    """Shares of a mode's kinetic energy in the body's y-shift, x-shift with pitch, and yaw, and of
    its strain energy in the body, (4, k).
    """
    shifts = (forms.rigid @ modes.phi) ** 2
    elastic = modes.omega > RIGID * modes.omega.max()
    strain = np.sum(modes.phi * (forms.K @ modes.phi), axis=0)
    strain = np.where(elastic, strain / np.where(elastic, modes.omega, 1.0) ** 2, 0.0)
    return np.array([shifts[1], shifts[0] + shifts[4], shifts[5], strain])


def body_forms(model: Model, body: str) -> BodyForms:
    """Energies and rigid motions of a body in the free dofs of a model."""
    basis, K, M = model.structure
    dofs = _dofs_of(model, body)
    T, M = model.T[dofs], M[dofs][:, dofs]
    nodes = basis.doflocs[:, dofs[0::3]].T
    R = rigid_motion(nodes, _centre_of_mass(nodes, M))
    R = R @ np.linalg.inv(np.linalg.cholesky(R.T @ (M @ R))).T
    return BodyForms(T.T @ K[dofs][:, dofs] @ T, T.T @ M @ T, ((M @ R).T @ T))


def body_shapes(
    model: Model, phi: NDArray[np.float64], *, body: str = "block"
) -> NDArray[np.float64]:
    """Displacements of every node of a body (3 n_nodes, k) in the shapes phi (n, k) of a model."""
    return model.T[_dofs_of(model, body)] @ phi


def _dofs_of(model: Model, body: str) -> NDArray[np.int64]:
    """x, y, z of the body's nodes, node after node, (3 n_nodes,)."""
    basis = model.structure.basis
    cells = basis.mesh.subdomains[body]
    local = basis.element_dofs[:, cells].reshape(-1, 3, len(cells))
    return np.unique(local.transpose(0, 2, 1).reshape(-1, 3), axis=0).ravel()


def _centre_of_mass(nodes, M) -> NDArray[np.float64]:
    lumped = np.asarray(M.sum(axis=1)).ravel()[0::3]
    return lumped @ nodes / lumped.sum()
