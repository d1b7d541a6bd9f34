"""One basis for many contacts of a structure, and what each of them has beyond it.

    phi_ij = w_i^T phi_j,   r_i = K^-1 w_i - sum_j phi_j phi_ij / omega_j^2
    first_i = w_i^T r_i,    second_i = r_i^T M r_i

The modes are common to all contacts; the static response beyond them and its first moment of
inertia belong to each. Of a floating structure K^-1 stands for inertia relief.
MacNeal, Computers & Structures 1 (1971) 581; Rubin, AIAA Journal 13 (1975) 995.
"""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from rom.contact_modes import finer_space
from rom.factorisation import Pencil, static_response
from rom.lanczos import EigenPairs
from rom.reduced_model import ReducedModel, of_modes
from rom.tall import shares

CONTACTS = 64  # solved at once


class ManyContacts(NamedTuple):
    """Modes of a structure at p contacts, and the static response of each beyond them."""

    omega: np.ndarray  # (k,) [rad/s] ascending, rigid-body modes as exact zeros
    phi: np.ndarray  # (p, k) [kg^-1/2]
    first: np.ndarray  # (p,) [m/N] sum phi^2 / omega^2 of all modes that are not here
    second: np.ndarray  # (p,) [m s^2/N] sum phi^2 / omega^4 of the same

    def below(self, cutoff_hz: float) -> "ManyContacts":
        """The same with fewer modes; what is left out is part of the static response."""
        kept = self.omega < 2 * np.pi * cutoff_hz
        phi, omega = self.phi[:, ~kept], self.omega[~kept]
        first = self.first + ((phi / omega) ** 2).sum(axis=1)
        second = self.second + ((phi / omega**2) ** 2).sum(axis=1)
        return ManyContacts(self.omega[kept], self.phi[:, kept], first, second)


class Face:
    """Contact functionals W (n, p) on a structure, by its pencil K, M (n, n) and its lowest modes.

    contacts has all of them, for one solution each. Raises ReductionError.
    """

    def __init__(self, problem: Pencil, modes: EigenPairs, W: ArrayLike) -> None:
        self._W, self._problem, self._modes = sp.csc_array(W), problem, modes
        phi = self._W.T @ self._modes.phi
        found = [
            _moments(self._problem, self._W[:, at], self._modes, phi[at])
            for at in shares(len(phi), CONTACTS)
        ]
        self.contacts = ManyContacts(self._modes.omega, phi, *np.concatenate(found, axis=1))

    def finer(self, i: int, to_hz: float) -> ReducedModel:
        """A model for one contact alone, that stands for the full one up to to_hz [Hz]."""
        w = self._W[:, [i]].toarray().ravel()
        return of_modes(*finer_space(self._problem, w, self._modes, to_hz).pairs, w, None)


def _moments(
    problem: Pencil, W: sp.csc_array, modes: EigenPairs, phi: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """First and second (m,) of the contacts W (n, m), which move the modes by phi (m, k)."""
    elastic = modes.omega > 0
    shapes, omega = modes.phi[:, elastic], modes.omega[elastic]
    r = _static(problem, W.toarray(order="F"), modes.phi[:, ~elastic])
    r -= shapes @ (phi[:, elastic] / omega**2).T
    r -= shapes @ (shapes.T @ (problem.M @ r))  # what solver and modes leave of rounding
    return (W * r).sum(axis=0), np.einsum("ij,ij->j", r, problem.M @ r)


def _static(problem: Pencil, W: np.ndarray, rigid: np.ndarray) -> np.ndarray:
    """Static responses (n, m) to loads W (n, m)."""
    if problem.sigma == 0:
        return problem.factor.solve(W)
    return np.column_stack([static_response(problem, w, rigid) for w in W.T])
