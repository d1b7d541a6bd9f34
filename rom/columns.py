"""Further functionals of a reduced model in addition to its contact: a block Krylov space beyond
its basis.

    B (n, p):  a force F at one of them enters as B_j F, its displacement is B_j^T u
    T' = [T, V],   V spans X, K^-1 M X, (K^-1 M)^2 X, ... beyond T with X = K^-1 B
    V^T K V = 1,   T^T K V = 0,   K' = diag(K_r, 1)

The first block makes the static response to every functional exact, as the residual vector does for
the contact of free modes and the constraint modes for that of Craig-Bampton; both are kept as they
are. Each further block adds two moments sum phi_i phi_j / omega^(2 m) of all receptances
B_i^T (K - s^2 M)^-1 B_j. What is loaded by a column is read by the same, so that
B_i^T u by a force at B_j is B_j^T u by that force at B_i to rounding. Of a floating structure K^-1
stands for inertia relief.
Wilson, Yuan and Dickens, Earthquake Eng. Struct. Dyn. 10 (1982) 813; Bai, Appl. Numer. Math. 43
(2002) 9.
"""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike
from scipy.linalg import block_diag

from beadwave.rom.contact_modes import k_orthonormalised, static_shapes
from beadwave.rom.factorisation import Factorise, Pencil, ReductionError, Solver, superlu, symmetric
from beadwave.rom.floating import pencil
from beadwave.rom.free_modes import rigid_modes
from beadwave.rom.health import require_faithful
from beadwave.rom.reduced_model import ReducedModel, modal
from beadwave.rom.residual_vector import attachment_modes
from beadwave.rom.truncation import LOSS, frequencies, rms, size


class ColumnOptions(NamedTuple):
    """Size of a block Krylov space of further functionals."""

    to_hz: float = 20e3  # [Hz] up to which receptances count: what a chain of spheres excites
    # relative rms change of any receptance of a column with itself, up to to_hz, by the last block
    error: float = 1e-3
    blocks: int = 60  # at most; a solid block of steel to 20 kHz takes some 10
    # share of a vector's length that is new, below which the space holds all that the loads move
    exhausted: float = 1e-10


def with_columns(
    reduced: ReducedModel,
    K: ArrayLike | sp.sparray,
    M: ArrayLike | sp.sparray,
    B: ArrayLike | sp.sparray,
    *,
    C: ArrayLike | sp.sparray | None = None,
    factorise: Factorise = superlu,
    factor: Solver | None = None,
    options: ColumnOptions = ColumnOptions(),
) -> tuple[ReducedModel, np.ndarray]:
    """The model on a basis that holds the functionals B (n, p) as well, and these on its
    coordinates, T'^T B (r', p).

    K [N/m], M [kg], C [N s/m] (n, n) are the matrices that `reduced` was made of, with its basis T
    (n, r), which it must have; its r coordinates are the first of the result's r' and keep their
    meaning. `factor` is that of a K that is held; without it K is factorised anew. Raises
    ReductionError for matrices that are not symmetric, where `blocks` blocks do not meet the error,
    and where the result is not T'^T K T' and T'^T M T'.
    """
    K, M = symmetric(K, "K"), symmetric(M, "M")
    C = None if C is None else symmetric(C, "C")
    B = np.asarray(B.toarray() if sp.issparse(B) else B, dtype=float)
    problem = Pencil(K, M, factor) if factor else pencil(K, M, factorise)
    rigid = rigid_modes(problem, None)

    # Q: the elastic part of T and the vectors so far, all K-orthonormal
    wall, T = modal(reduced), reduced.T
    elastic = wall.omega > 0
    Q = T @ (wall.vectors[:, elastic] / wall.omega[elastic])
    V, MV = np.zeros((len(B), 0)), np.zeros((len(B), 0))
    to_hz, loads = options.to_hz, B
    s = 2 * np.pi * frequencies(to_hz)
    previous, changes = None, []
    for _ in range(options.blocks):
        # what K^-1 of the loads has beyond Q; twice, since one projection leaves rounding. Lengths
        # are those before it: what the projection leaves is judged relative to them, not by itself
        X = attachment_modes(problem, np.asfortranarray(loads), rigid)
        lengths = np.sqrt(np.maximum(np.einsum("ij,ij->j", X, K @ X), 0.0))
        for _ in range(2):
            X -= Q @ (Q.T @ (K @ X))
        block, _ = k_orthonormalised(X, X.T @ (K @ X), K, options.exhausted * lengths)
        loads = M @ block
        V, MV, Q = (np.column_stack(pair) for pair in ((V, block), (MV, loads), (Q, block)))

        # T holds K^-1 w, so that V^T w = V^T K K^-1 w = 0: the contact does not see the new
        # coordinates but through M. C is not needed for the receptances and comes at the end
        coupled, inertia = T.T @ MV, V.T @ MV
        grown = reduced._replace(
            K=block_diag(reduced.K, np.eye(V.shape[1])),
            M=np.block([[reduced.M, coupled], [coupled.T, (inertia + inertia.T) / 2]]),
            C=None,
            w=np.append(reduced.w, np.zeros(V.shape[1])),
        )
        columns = np.concatenate([T.T @ B, V.T @ B])

        # the receptance of each column with itself, sum phi_j^2 / (omega_j^2 (1 + i eta) - s^2), by
        # the modes of the grown model
        modes = modal(grown)
        phi = modes.vectors.T @ columns
        resonances = 1 / (modes.omega[:, None] ** 2 * (1 + 1j * LOSS) - s**2)
        receptance = (phi**2).T @ resonances
        if previous is not None:
            pairs = zip(receptance, previous, strict=True)
            changes.append(max(rms(new - old) / size(new) for new, old in pairs))
        previous = receptance
        # two blocks in a row: a block may by chance move no resonance below to_hz
        if not block.shape[1] or (len(changes) > 1 and max(changes[-2:]) <= options.error):
            break
    else:
        raise ReductionError(
            f"{V.shape[1]} vectors still change the receptances of the further functionals by "
            f"{changes[-1]:.1e} up to {to_hz:g} Hz, allowed is {options.error:g}; take a lower "
            "frequency."
        )

    # modes far above to_hz are static shapes, which a run lets follow the force: as oscillators
    # they would only cost steps
    T = np.column_stack([T, V])
    grown = grown._replace(
        C=None if C is None else T.T @ (C @ T),
        T=T,
        n_residual=static_shapes(modes.omega, np.inf, to_hz),
    )
    require_faithful(grown, K, M)
    return grown, columns
