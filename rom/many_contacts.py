"""One basis for many contacts of a structure, and oscillators of each contact for what it leaves.

    phi_ij = w_i^T phi_j,   r_i = K^-1 w_i - sum_j phi_j phi_ij / omega_j^2

The modes are common to all contacts. Beyond them each contact has a Krylov space of its own, that
of `rom.contact_modes` with as many vectors as are asked for:

    v_1 = r_i / |r_i|_K,   beta_j v_{j+1} = K^-1 M v_j - alpha_j v_j - beta_{j-1} v_{j-1}

Of a space of n vectors the Ritz pairs are oscillators with the first 2 n moments
sum phi^2 / omega^(2 m) of all modes that are not common; its first vectors are those of the smaller
spaces. One vector is the static response with one moment of inertia. Of a floating structure K^-1
stands for inertia relief. MacNeal, Computers & Structures 1 (1971) 581; Rubin, AIAA Journal 13
(1975) 995; Wilson, Yuan and Dickens, Earthquake Eng. Struct. Dyn. 10 (1982) 813.
"""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from beadwave.rom.contact_space import KrylovOptions
from beadwave.rom.factorisation import Pencil
from beadwave.rom.lanczos import EigenPairs
from beadwave.rom.residual_vector import attachment_modes
from beadwave.rom.tall import shares

NOTHING = 1e-12  # of the static response: rounding


class Oscillators(NamedTuple):
    """Oscillators of p contacts, n each."""

    omega: np.ndarray  # (p, n) [rad/s]
    phi: np.ndarray  # (p, n) [kg^-1/2]; 0 where a contact moves nothing more

    def lumped(self, above_hz: float) -> "Oscillators":
        """Oscillators with one in place of all above above_hz [Hz], which would cost steps.

        It has their static response m_1 = sum phi^2 / omega^2 and m_2 = sum phi^2 / omega^4, so
        that omega^2 = m_1 / m_2 and phi^2 = omega^2 m_1, and takes the place of the first of them;
        the others have phi = 0 and omega at above_hz. Arrays keep their shape (p, n).
        """
        omega, phi = self.omega.copy(), self.phi.copy()
        high = omega > 2 * np.pi * above_hz
        first, second = (np.where(high, phi**2 / omega**i, 0.0).sum(axis=1) for i in (2, 4))
        rows = np.flatnonzero(first > 0)
        column = high.argmax(axis=1)[rows]
        phi[high] = 0.0
        lumped = np.sqrt(first[rows] / second[rows])
        omega = np.where(high, 2 * np.pi * above_hz, omega)
        omega[rows, column], phi[rows, column] = lumped, lumped * np.sqrt(first[rows])
        return Oscillators(omega, phi)


class ManyContacts(NamedTuple):
    """Modes of a structure at p contacts, and the space of each beyond them."""

    omega: np.ndarray  # (k,) [rad/s] ascending, rigid-body modes as exact zeros
    phi: np.ndarray  # (p, k) [kg^-1/2]
    static: np.ndarray  # (p,) [m/N] sum phi^2 / omega^2 of all modes that are not here
    alpha: np.ndarray  # (p, n) [s^2] diagonal of V^T M V
    beta: np.ndarray  # (p, n - 1) [s^2] off it

    def beyond(self, n: int) -> Oscillators:
        """Ritz pairs of the first n vectors, omega (p, n) ascending, with
        sum phi_j^2 / omega_j^2 = static.

        An eigenpair (theta, s) of the tridiagonal H = V^T M V is an oscillator of
        omega^2 = 1 / theta; V^T w = sqrt(static) e_1, so that its phi = omega s_1 sqrt(static).
        """
        i = np.arange(n)
        H = np.zeros((len(self.static), n, n))
        H[:, i, i] = self.alpha[:, :n]
        H[:, i[1:], i[:-1]] = H[:, i[:-1], i[1:]] = self.beta[:, : n - 1]
        inverse_squared, U = np.linalg.eigh(H)
        # a vector of rounding alone may leave one of 0 or below, which no force moves
        floor = NOTHING * inverse_squared[:, -1:]
        omega = 1 / np.sqrt(np.maximum(inverse_squared[:, ::-1], floor))
        return Oscillators(omega, omega * U[:, 0, ::-1] * np.sqrt(self.static)[:, None])


def many_contacts(
    problem: Pencil, modes: EigenPairs, W: ArrayLike, n_vectors: int = 1
) -> ManyContacts:
    """Contact functionals W (n, p) on a structure, by its pencil K, M (n, n) and its lowest modes.

    modes must hold the rigid-body modes of a floating structure, as exact zeros of omega. Each
    contact has a space of n_vectors beyond the modes, a solution apiece; 64 contacts are solved at
    once. Raises ReductionError where K is singular beyond the rigid modes.
    """
    W = sp.csc_array(W)
    phi = W.T @ modes.phi
    spaces = [_spaces(problem, W[:, c], modes, phi[c], n_vectors) for c in shares(len(phi), 64)]
    static, alpha, beta = np.concatenate(spaces, axis=1)
    return ManyContacts(modes.omega, phi, static[:, 0], alpha, beta[:, :-1])


def static_responses(problem: Pencil, W: sp.csc_array, modes: EigenPairs) -> np.ndarray:
    """Part of the static responses that the modes lack, to unit forces through W (n, m), r (n, m)
    [m/N]; of a floating structure, of those with inertia relief."""
    elastic = modes.omega > 0
    shapes, rigid = modes.phi[:, elastic], modes.phi[:, ~elastic]

    # the modes' share leaves the loads and, since solver and modes leave rounding, the result
    loads = W.toarray(order="F") - problem.M @ (shapes @ (W.T @ shapes).T)
    r = attachment_modes(problem, loads, rigid)
    return r - shapes @ (shapes.T @ (problem.M @ r))


def _spaces(
    problem: Pencil, W: sp.csc_array, modes: EigenPairs, phi: np.ndarray, n_vectors: int
) -> np.ndarray:
    """sum phi^2 / omega^2, alpha and beta (3, m, n_vectors) of contacts W (n, m) that move the
    modes by phi (m, k)."""
    elastic = modes.omega > 0
    shapes, omega, rigid = modes.phi[:, elastic], modes.omega[elastic], modes.phi[:, ~elastic]

    v = static_responses(problem, W, modes)
    static = (W * v).sum(axis=0)
    of_modes = ((phi[:, elastic] / omega) ** 2).sum(axis=1)
    static[static <= NOTHING * of_modes] = 0.0  # rounding, where the modes hold all that can move

    # Lanczos in K, three terms, all contacts of the share at once; of a contact whose space is
    # exhausted v is 0 from then on, and its oscillators do not move
    alpha = np.full((n_vectors, W.shape[1]), omega.max(initial=1.0) ** -2)
    beta = np.zeros_like(alpha)
    length, previous = np.sqrt(static), np.zeros_like(v)
    for j in range(n_vectors):
        v *= np.divide(1.0, length, out=np.zeros_like(length), where=length > 0)
        inertia = problem.M @ v
        moved = length > 0
        alpha[j, moved] = np.einsum("ij,ij->j", v, inertia)[moved]
        if j + 1 == n_vectors:
            break
        # what the common modes hold leaves every vector again: K^-1 magnifies its rounding by
        # 1 / omega^2, most of all in the lowest mode
        x = attachment_modes(problem, inertia, rigid)
        x -= shapes @ (shapes.T @ (problem.M @ x))
        unprojected = np.sqrt(np.maximum(np.einsum("ij,ij->j", x, inertia), 0.0))
        x -= alpha[j] * v + (beta[j - 1] * previous if j else 0.0)
        length = np.sqrt(np.maximum(np.einsum("ij,ij->j", x, problem.K @ x), 0.0))
        length[length <= KrylovOptions().exhausted * unprojected] = 0.0
        beta[j], previous, v = length, v, x
    return np.array([np.broadcast_to(static, alpha.shape), alpha, beta]).transpose(0, 2, 1)
