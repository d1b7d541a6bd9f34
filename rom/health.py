"""Checks of a reduced model: symmetry, definiteness, statics, mass.

The require_ functions raise ReductionError with one sentence; health() measures a finished model,
made here or elsewhere, and only reports. After the checks of Craig and Kurdila (2006) and the
Craig-Bampton model checks of NASA-STD-5002 (effective mass).
"""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike
from scipy.linalg import cho_factor, cho_solve, eigh
from scipy.sparse.linalg import LinearOperator, eigsh

from beadwave.rom.factorisation import EPS, ReductionError, frequency_scale
from beadwave.rom.reduced_model import ModalWall, ReducedModel, modal, modal_compliance


class Health(NamedTuple):
    """Relative measures of a reduced model; findings says in sentences what is wrong.

    asymmetry of K, M and C; lowest_mass and lowest_stiffness: smallest eigenvalue over the largest;
    n_rigid: modes at zero frequency; static_compliance [m/N] at w; participation: share of the
    modes that the contact moves at all; fixed_interface_hz (k,): frequencies with the boundary
    held, none without a boundary; modes: those of `modal(reduced)`, None where it has none.
    """

    asymmetry: float
    lowest_mass: float
    findings: tuple[str, ...]
    lowest_stiffness: float = np.nan
    n_rigid: int = 0
    static_compliance: float = np.nan
    participation: float = np.nan
    fixed_interface_hz: tuple[float, ...] = ()
    modes: ModalWall | None = None


class EffectiveMass(NamedTuple):
    """omega (k,) [rad/s]; mass (k,) [kg] each mode carries in a direction; total [kg]."""

    omega: np.ndarray
    mass: np.ndarray
    total: float

    @property
    def captured(self) -> float:
        """Share of the total mass that the modes carry."""
        return float(self.mass.sum() / self.total)


def health(reduced: ReducedModel) -> Health:
    """Measure a reduced model without the matrices it came from; see Health.

    Never raises for a model that is unsound: what could not be measured is nan, empty or None.
    """
    findings = []
    # largest |a_ij - a_ji| over the largest |a_ij|
    matrices, tiny = (reduced.K, reduced.M, reduced.C), np.finfo(float).tiny
    asymmetry = max(
        float(np.abs(A - A.T).max() / max(np.abs(A).max(), tiny)) for A in matrices if A is not None
    )
    if asymmetry > 1e-9:
        findings.append(f"the matrices are not symmetric (relative difference {asymmetry:.1e}).")

    # M positive definite, on a unit diagonal; without that there are no modes
    lightest, heaviest = _extremes(_unit_diagonal(reduced.M))
    lowest = lightest / max(heaviest, np.finfo(float).tiny)
    if lowest < len(reduced.w) * EPS:
        findings.append(f"M is not positive definite (lowest eigenvalue {lightest:.1e} of 1).")
        return Health(asymmetry, lowest, tuple(findings))
    softest, stiffest = _extremes(_unit_diagonal(reduced.K))
    stiffness = softest / stiffest if stiffest > 0 else 0.0

    try:
        wall = modal(reduced)
        held_hz = fixed_interface_hz(reduced)
    except ReductionError as indefinite:
        return Health(asymmetry, lowest, (*findings, str(indefinite)), stiffness)
    if wall.damping is not None and is_indefinite(wall.damping):
        findings.append("C is indefinite; the damping would feed energy into the wall.")

    # a mode with a node at the contact has a participation of rounding
    moved = np.abs(wall.phi) > 1e-9 * np.abs(wall.phi).max()
    return Health(
        asymmetry,
        lowest,
        tuple(findings),
        stiffness,
        n_rigid=int(np.count_nonzero(wall.omega == 0)),
        static_compliance=modal_compliance(wall),
        participation=float(moved.mean()),
        fixed_interface_hz=held_hz,
        modes=wall,
    )


def is_indefinite(D: np.ndarray) -> bool:
    """True if a damping matrix (k, k) has an eigenvalue below zero by more than 1e-9 of its largest
    entry, by a Cholesky factorisation of what that is added to."""
    if not D.any():
        return False
    try:
        np.linalg.cholesky(D + 1e-9 * np.abs(D).max() * np.eye(len(D)))
    except np.linalg.LinAlgError:
        return True
    return False


def fixed_interface_hz(reduced: ReducedModel) -> tuple[float, ...]:
    """Frequencies (k,) [Hz] of a reduced model whose boundary is held, ascending: those of the
    coordinates after the first n_boundary. Empty without a boundary or without others."""
    inside = slice(reduced.n_boundary, None)
    if not 0 < reduced.n_boundary < len(reduced.w):
        return ()
    squared = eigh(reduced.K[inside, inside], reduced.M[inside, inside], eigvals_only=True)
    return tuple((np.sqrt(np.maximum(squared, 0)) / (2 * np.pi)).tolist())


def _extremes(A: np.ndarray) -> tuple[float, float]:
    """The lowest and the highest eigenvalue; of a large definite A by Lanczos, to a thousandth."""
    if len(A) >= 600:  # coordinates, above which all eigenvalues take a second
        try:
            factor = cho_factor(A)
        except np.linalg.LinAlgError:
            pass
        else:
            inverse = LinearOperator(A.shape, matvec=lambda b: cho_solve(factor, b))
            start = np.random.default_rng(0).standard_normal(len(A))
            options = {"which": "LM", "v0": start, "tol": 1e-3, "return_eigenvectors": False}
            of_inverse, highest = (float(eigsh(B, 1, **options)[0]) for B in (inverse, A))
            return 1 / of_inverse, highest
    eigenvalues = np.linalg.eigvalsh(A)
    return float(eigenvalues[0]), float(eigenvalues[-1])


def _unit_diagonal(A: np.ndarray) -> np.ndarray:
    """A scaled to 1 on its diagonal, so that eigenvalues tell rank and not units."""
    diagonal = np.abs(np.diag(A))
    scale = 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    return (A + A.T) / 2 * np.outer(scale, scale)


def require_faithful(reduced: ReducedModel, K: sp.csc_array, M: sp.csc_array) -> None:
    """Check K_r = T^T K T and M_r = T^T M T on a random vector, and that both are sound.

    K [N/m], M [kg] (n, n) are the matrices that were reduced. One vector shows a wrong entry with
    probability 1, at the cost of one product with each matrix where T^T K T itself would take r.
    Raises ReductionError with the first finding.
    """
    q = np.random.default_rng(2).standard_normal(len(reduced.w))
    q /= np.sqrt(np.abs(np.diag(reduced.M)))
    u = reduced.T @ q
    for name, full, small in (("K", K, reduced.K), ("M", M, reduced.M)):
        mismatch = _relative(reduced.T.T @ (full @ u) - small @ q, small @ q)
        if mismatch > 1e-6:
            raise ReductionError(
                f"the reduced {name} is not T^T {name} T (relative difference {mismatch:.1e}, "
                f"allowed 1e-6); the factorisation was not accurate enough."
            )
    findings = health(reduced).findings
    if findings:
        raise ReductionError(f"the reduced model is unsound: {findings[0]}")


def require_static_response(
    reduced: ReducedModel, K: sp.csc_array, M: sp.csc_array, w: np.ndarray, rigid: np.ndarray
) -> None:
    """Check that T q with K_r q = w_r solves K u = w of the full structure (inertia relief).

    K [N/m], M [kg] (n, n), w (n,); rigid (n, r) are the mass-normalised rigid-body modes, r = 0
    where it is held. Raises ReductionError with what the response misses of the load, relative.
    """
    wall = modal(reduced)
    elastic = wall.omega > 0
    u = reduced.T @ (wall.vectors[:, elastic] @ (wall.phi[elastic] / wall.omega[elastic] ** 2))
    load = w - M @ (rigid @ (rigid.T @ w))
    mismatch = _relative(K @ u - load, load)
    # rounding of K @ u, which a soft structure that moves far has more of
    noise = 1e3 * EPS * frequency_scale(K, M) * np.linalg.norm(M @ u) / np.linalg.norm(load)
    allowed = max(1e-6, noise)
    if mismatch > allowed:
        raise ReductionError(
            f"the static response at the contact misses the load by {mismatch:.1e} (allowed "
            f"{allowed:.1e}); the factorisation was not accurate enough."
        )


def _relative(difference: np.ndarray, reference: np.ndarray) -> float:
    """|difference| over |reference|."""
    return float(np.linalg.norm(difference) / np.linalg.norm(reference))


def effective_mass(
    reduced: ReducedModel, M: ArrayLike, direction: ArrayLike, onto: sp.csr_array | None = None
) -> EffectiveMass:
    """Mass that each mode of the reduced model carries along direction (n,), e.g. ones in x.

    m_j = (mode_j^T M e)^2 [kg] for mass-normalised modes; the sum over all modes of a full model is
    e^T M e. M (n, n) [kg]; M and e may be those of a finer field u = onto @ T q, onto (m, n) with
    M (m, m) and e (m,).
    Raises ReductionError if the model came without its basis.
    """
    if reduced.T is None:
        raise ReductionError("a model without its basis T has no effective mass.")
    e, wall = np.asarray(direction, dtype=float), modal(reduced)
    inertia = (M if sp.issparse(M) else np.asarray(M)) @ e  # as it is: a conversion is a copy
    on_field = inertia if onto is None else onto.T @ inertia
    participation = wall.vectors.T @ (reduced.T.T @ on_field)
    return EffectiveMass(wall.omega, participation**2, float(e @ inertia))
