"""One basis for several contacts that load a structure at once.

    W (n, p):  forces F enter as W F, the contacts move by U = W^T u
    T = [rigid and retained modes, Ritz pairs of the block Krylov space of K^-1 W]

The space of all contacts together (`contact_modes`) holds the static response between any two of
them, and grows until the receptance at each contact is within the error. By the inequality of
Cauchy and Schwarz that between two contacts is then within the mean of theirs.
"""

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from beadwave.rom.contact_modes import krylov_space, static_shapes
from beadwave.rom.contact_space import KrylovOptions
from beadwave.rom.factorisation import Factorise, Pencil, Solver, superlu, symmetric
from beadwave.rom.floating import pencil
from beadwave.rom.free_modes import retained_modes, rigid_modes
from beadwave.rom.health import require_faithful, require_static_response
from beadwave.rom.lanczos import EigenPairs, known_modes
from beadwave.rom.reduced_model import Columns, ReducedModel


def several_contacts(
    K: ArrayLike | sp.sparray,
    M: ArrayLike | sp.sparray,
    W: ArrayLike,
    *,
    error: float,
    to_hz: float,
    modes: tuple[np.ndarray, np.ndarray] | None = None,
    factorise: Factorise = superlu,
    factor: Solver | None = None,
) -> ReducedModel:
    """The structure K [N/m], M [kg] (n, n) in as many free modes as keep the receptance at each
    contact of W (n, p) to the relative rms error up to to_hz [Hz], and between them.

    The first contact is the model's w, the others are its columns `load`. modes = (omega (k,)
    [rad/s], phi (n, k)) are kept in any case. `finer` stands for the full structure, all its pairs
    as modes. Raises ReductionError.
    """
    K, M = symmetric(K, "K"), symmetric(M, "M")
    W = np.asarray(W, float)
    problem = Pencil(K, M, factor) if factor else pencil(K, M, factorise)
    supplied = None if modes is None else known_modes(problem, *modes)
    retained, options = retained_modes(problem, supplied), KrylovOptions()
    space = krylov_space(problem, W, retained, error, to_hz)
    reduced = _of_pairs(space.pairs, W, to_hz)._replace(error=space.bound)
    n_vectors = len(space.pairs.omega) + options.extra
    full = krylov_space(problem, W, retained, options.exact, to_hz, n_vectors)

    require_faithful(reduced, K, M)
    rigid = rigid_modes(problem, retained)
    for w in W.T:
        require_static_response(reduced._replace(w=reduced.T.T @ w), K, M, w, rigid)
    finer = _of_pairs(full.pairs, W, to_hz)._replace(T=None, n_residual=0)
    return reduced._replace(finer=finer)


def _of_pairs(pairs: EigenPairs, W: np.ndarray, to_hz: float) -> ReducedModel:
    """The model of mass-normalised pairs, ordered by frequency."""
    order = np.argsort(pairs.omega)
    omega, T = pairs.omega[order], np.ascontiguousarray(pairs.phi[:, order])
    columns = T.T @ W
    return ReducedModel(
        np.diag(omega**2), np.eye(len(omega)), None, columns[:, 0], T, "free-modes", 0, {},
        n_residual=static_shapes(omega, np.inf, to_hz),
        columns=Columns(load=columns[:, 1:]),
    )  # fmt: skip
