"""Which mode is which: the modal assurance criterion, and the four hammer-test modes by shape.

Modes of the tests are told by the block: 1 it sways across the sheets (y), 2 it moves along the
chain and pitches, 3 it yaws, 4 it is itself deformed. The order of frequencies does not tell them,
modes of the sheets lie in between.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fem.joints import rigid_motion
from fem.model import Model
from fem.modes import Modes

HAMMER_TEST_HZ = (51.0, 269.0, 907.0, 8425.0)  # thesis, table 5.1


class Pairing(NamedTuple):
    """The four hammer-test modes among computed ones."""

    index: NDArray[np.int64]  # (4,) position in the modes, -1 where none fits
    score: NDArray[np.float64]  # (4,) share of the block's kinetic or of all strain energy in it
    character: NDArray[np.float64]  # (4, k) the same share for every mode


def mac(phi: NDArray[np.float64], psi: NDArray[np.float64]) -> NDArray[np.float64]:
    """Modal assurance criterion |phi^T psi|^2 / (phi^T phi psi^T psi), (k, l).

    Allemang and Brown, Proc. 1st Int. Modal Analysis Conf. (1982).
    """
    cross = np.abs(phi.T @ psi) ** 2
    return cross / np.outer(np.sum(phi**2, axis=0), np.sum(psi**2, axis=0))


def pair(model: Model, modes: Modes, *, body: str = "block", least: float = 0.3) -> Pairing:
    """The hammer-test modes by the motion of `body`: the first mode of each character.

    A mode has a character when its share reaches half of the largest share found, and `least`.
    """
    character = _characters(model, modes, body)
    eligible = character >= np.maximum(0.5 * character.max(axis=1, keepdims=True), least)
    index = np.where(eligible.any(axis=1), eligible.argmax(axis=1), -1)
    score = np.where(index >= 0, character[range(4), index], 0.0)
    return Pairing(index, score, character)


def _characters(model: Model, modes: Modes, body: str) -> NDArray[np.float64]:
    dofs, K, M = _body_matrices(model, body)
    u = (model.T @ modes.phi)[dofs]
    kinetic = np.sum(u * (M @ u), axis=0)  # of a total of 1
    strain = np.sum(u * (K @ u), axis=0) / np.maximum(modes.omega**2, 1e-30)
    sway, along, yaw = _rigid_shares(model, u, dofs, M)
    # weighted by the block's share, so that a mode of the sheets that drags the block does not win
    return np.array([sway * kinetic, along * kinetic, yaw * kinetic, strain])


def _rigid_shares(model: Model, u, dofs, M):
    """Shares of the kinetic energy in y-shift, in x-shift with pitch, in yaw, each (k,)."""
    basis = model.structure.basis
    nodes = basis.doflocs[:, dofs[0::3]].T
    R = rigid_motion(nodes, _centre_of_mass(nodes, M))
    R = R @ np.linalg.inv(np.linalg.cholesky(R.T @ (M @ R))).T
    energy = (R.T @ (M @ u)) ** 2 / np.sum(u * (M @ u), axis=0)
    return energy[1], energy[0] + energy[4], energy[5]


def _centre_of_mass(nodes, M) -> NDArray[np.float64]:
    lumped = np.asarray(M.sum(axis=1)).ravel()[0::3]
    return lumped @ nodes / lumped.sum()


def _body_matrices(model: Model, body: str):
    basis, K, M = model.structure
    cells = basis.mesh.subdomains[body]
    local = basis.element_dofs[:, cells].reshape(-1, 3, len(cells))
    dofs = np.unique(local.transpose(0, 2, 1).reshape(-1, 3), axis=0).ravel()
    return dofs, K[dofs][:, dofs], M[dofs][:, dofs]
