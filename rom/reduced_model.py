"""The reduced model M q'' + C q' + K q = w F, read through the same weights: u_w = w^T q.

    u = T q,   K_r = T^T K T,   M_r = T^T M T,   w_r = T^T w

A full-order model is the same type with T = I. The receptance at the contact is
H(omega) = w^T (K - omega^2 M + i omega C)^-1 w.
Craig and Kurdila, Fundamentals of Structural Dynamics (2006), ch. 17.
"""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike
from scipy.linalg import cholesky, eigh, solve
from scipy.linalg.lapack import dpocon

from beadwave.rom.factorisation import EPS, ReductionError, symmetric
from beadwave.rom.tall import gram


class Surface(NamedTuple):
    """The way back to the outer nodes of the mesh: node i moves by T[3 i : 3 i + 3] @ q."""

    points: np.ndarray  # (m, 3) [m]
    faces: np.ndarray  # (k, 3 or 4) into the points, around each face
    T: np.ndarray  # (3 m, r) in single precision: for pictures and readings, not for solving
    body: np.ndarray | None = None  # (m,) which of the bodies each node belongs to, from 0
    bodies: tuple[str, ...] = ()  # their names


class StrainShares(NamedTuple):
    """Shares (k, n) of n parts, "joints.bolts", in the strain energy of modes at hz (k,), which
    ascend. Files hold the damping itself in their place."""

    hz: np.ndarray
    parts: tuple[str, ...]
    shares: np.ndarray


class Contact(NamedTuple):
    """The contact of a reduced model, None where its maker does not say.

    The force enters through w of the model. half_space [m/N]: the compliance of the patch on a
    half-space, which the Hertz law holds once more; weights_read (r,): u_w = weights_read^T q where
    that is not w^T q, and the wall not passive; young [Pa], poisson of its surface;
    curvatures [1/m]: principal ones of the surface, < 0 where hollow, None of a plane;
    modes_hz (k,): the modes that damping ratios belong to; strain: the shares of parts in the
    strain energy of modes, where parts have loss factors; point (3,) [m] and direction (3,): where
    the force enters and along what unit vector, into the structure.
    """

    half_space: float | None = None
    weights_read: np.ndarray | None = None
    young: float | None = None
    poisson: float | None = None
    curvatures: tuple[float, float] | None = None
    modes_hz: tuple[float, ...] | None = None
    point: tuple[float, ...] | None = None
    direction: tuple[float, ...] | None = None
    strain: StrainShares | None = None


class MassProperties(NamedTuple):
    """Of the structure behind a reduced model, None where its maker does not say.

    mass [kg]; centre (3,) [m]; grounding: forces that rigid motions of its parts meet, relative;
    captured: share of the mass that the reduced model carries along the chain.
    """

    mass: float | None = None
    centre: tuple[float, ...] | None = None
    grounding: float | None = None
    captured: float | None = None


class Columns(NamedTuple):
    """Functionals of a reduced model in addition to w, each loaded and read by its column: a force
    F enters as column F, its displacement is column^T q.

    across (r, 2): the contact along t1 and t2, None where it is known along its normal only;
    half_space (3, 3) [m/N]: compliance of the patch on a half-space along n, t1 and t2, which the
    laws of Hertz and Mindlin hold once more; axes (3, 3): unit vectors n, t1, t2 in rows;
    load (r, s): shakers; sense (r, m): sensors.
    """

    across: np.ndarray | None = None
    half_space: np.ndarray | None = None
    axes: np.ndarray | None = None
    load: np.ndarray | None = None
    load_names: tuple[str, ...] = ()
    sense: np.ndarray | None = None
    sense_names: tuple[str, ...] = ()


class ReducedModel(NamedTuple):
    """A linear structure in few coordinates q (r,), with one contact functional.

    K (r, r) [J / unit(q)^2], which is N/m where q is a displacement, M (r, r), C (r, r) or None,
    w (r,): u_w = w^T q and the contact force enters as w F. T (n, r) gives the full field back and
    is None where it is not known. kind is "craig-bampton", "free-modes", "full-order" or
    "imported". The first n_boundary coordinates are physical boundary displacements [m]. notes are
    its maker's, of no effect.
    The n_residual highest modes are static shapes, residual vectors among them: they follow the
    force. error is the estimated relative rms error of the receptance at the contact, where it was
    asked for. coordinates names each q, where names are known; surface gives the outer nodes back.
    finer is a model of the same structure without a basis that stands for the full one
    where this one's error is stated; it goes into no file. columns are further functionals.
    """

    K: np.ndarray  # (r, r) [N/m] where coordinates are displacements
    M: np.ndarray  # (r, r) [kg], likewise
    C: np.ndarray | None  # (r, r) [N s/m]; None without dashpots
    w: np.ndarray  # (r,) u_w = w^T q, and the contact force enters as w F
    # (n, r) u = T q, row i of unknown i of the matrices that were reduced; None where not known. Of
    # a fem.Model, row 3 i + j of model.T @ T is node i along x, y, z for j = 0, 1, 2
    T: np.ndarray | None
    kind: str  # "craig-bampton", "free-modes", "full-order" or "imported"
    n_boundary: int  # the first coordinates are so many displacements of the boundary [m]
    notes: dict[str, str]  # of its maker, of no effect
    n_residual: int = 0  # the highest modes that are static shapes and follow the force
    error: float | None = None  # of the receptance at the contact, relative rms
    coordinates: tuple[str, ...] = ()  # names of the q, where known
    surface: Surface | None = None  # outer nodes and how they move
    contact: Contact = Contact()  # patch, material and place of the contact
    mass: MassProperties = MassProperties()  # of the whole structure
    finer: "ReducedModel | None" = None  # against which error is stated; in no file
    columns: Columns | None = None  # further functionals


def of_modes(
    omega: np.ndarray,
    phi: np.ndarray,
    amplitudes: np.ndarray | None,
    w: ArrayLike,
    C: ArrayLike | sp.sparray | None,
) -> ReducedModel:
    """Mass-normalised modes omega (j,) [rad/s] as a model without a basis, ordered by frequency,
    the highest of them static: their shapes are phi (n, j), or phi (n, k) @ amplitudes (k, j); w
    (n,) and C (n, n) are those of the full structure."""
    order = np.argsort(omega)
    A = np.eye(len(omega))[:, order] if amplitudes is None else amplitudes[:, order]
    damping = None if C is None else A.T @ gram(phi, C) @ A
    K, M = np.diag(omega[order] ** 2), np.eye(len(omega))
    return ReducedModel(K, M, damping, A.T @ (phi.T @ w), None, "free-modes", 0, {}, n_residual=1)


class ModalWall(NamedTuple):
    """The reduced model as oscillators: eta_j'' + omega_j^2 eta_j = phi_j F, u_w = sum phi_j eta_j.

    omega (k,) [rad/s] ascending, rigid-body modes as exact zeros; phi (k,) [kg^-1/2] = w^T mode;
    vectors (r, k) mass-normalised modes in q; damping (k, k) [1/s] = vectors^T C vectors, or None.
    """

    omega: np.ndarray
    phi: np.ndarray
    vectors: np.ndarray
    damping: np.ndarray | None


def full_order(
    K: ArrayLike | sp.sparray,
    M: ArrayLike | sp.sparray,
    w: ArrayLike,
    *,
    C: ArrayLike | sp.sparray | None = None,
) -> ReducedModel:
    """The unreduced structure as a ReducedModel with T = I; for references on small meshes.

    K, M, C (n, n), w (n,). Raises ReductionError above 5000 degrees of freedom.
    """
    K, M = symmetric(K, "K"), symmetric(M, "M")
    n = K.shape[0]
    if n > 5000:
        raise ReductionError(
            f"{n} degrees of freedom are too many to keep dense; reduce above 5000."
        )
    damping = None if C is None else symmetric(C, "C").toarray()
    w = contact_functional(w, n)
    return ReducedModel(K.toarray(), M.toarray(), damping, w, np.eye(n), "full-order", 0, {})


def contact_functional(w: ArrayLike, n: int) -> np.ndarray:
    """w (n,) as an array; raises ReductionError if its length is wrong, it is zero everywhere or
    holds a value that is not finite."""
    w = np.asarray(w, dtype=float)
    if w.shape != (n,):
        raise ReductionError(f"w has shape {w.shape}; the matrices want ({n},).")
    if not np.isfinite(w).all():
        raise ReductionError("w holds a value that is not finite.")
    if not w.any():
        raise ReductionError(
            "w is zero everywhere; the contact would neither load nor read the wall."
        )
    return w


def modal(reduced: ReducedModel) -> ModalWall:
    """All modes of the reduced pair (K, M) with their participation at the contact.

    Raises ReductionError if M is not positive definite or K is indefinite.
    """
    K, M = reduced.K, reduced.M
    mass = np.diag(M)
    if not (mass > 0).all():
        raise ReductionError(
            f"the reduced mass matrix has a diagonal value of {mass.min():.3g}; all must be > 0."
        )
    omega, V = _held_modes(K, M) or _floating_modes(K, M)
    damping = None if reduced.C is None else V.T @ reduced.C @ V
    return ModalWall(omega, reduced.w @ V, V, damping)


def modes_alone(reduced: ReducedModel, n: int) -> ReducedModel:
    """The n lowest modes of a reduced model, with neither static response nor dashpots for the
    rest: what a modal model without a residual vector answers.

    Coordinates are modal amplitudes [kg^1/2 m], and T (n_full, n) gives their field. Names of
    coordinates, the outer nodes and further functionals of the model are left out.
    """
    wall = modal(reduced)
    return reduced._replace(
        K=np.diag(wall.omega[:n] ** 2), M=np.eye(n), C=None, w=wall.phi[:n],
        T=None if reduced.T is None else reduced.T @ wall.vectors[:, :n], n_boundary=0,
        n_residual=0, kind="free-modes", coordinates=(), surface=None, columns=None,
    )  # fmt: skip


def _held_modes(K: np.ndarray, M: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """omega (r,) ascending and mass-normalised V (r, r) by M v = v / omega^2 K; None where K is
    singular to rounding.

    That way round the lowest modes are right to rounding, by K v = omega^2 M v the highest.
    """
    stiffness = np.diag(K)
    if not (stiffness > 0).all():
        return None
    # a unit diagonal: coordinates of other units, or of stiff springs, cost no digits
    scale = 1 / np.sqrt(stiffness)
    scaled = K * np.outer(scale, scale)
    try:
        # LAPACK's estimate of the condition, at a fraction of what the modes take
        norm = float(np.abs(scaled).sum(axis=0).max())
        reciprocal_condition, _ = dpocon(cholesky(scaled), norm)
        if reciprocal_condition < EPS:
            return None
        inverse_squared, V = eigh(M * np.outer(scale, scale), scaled)
    except np.linalg.LinAlgError:
        return None
    if inverse_squared[0] <= 10 * EPS * inverse_squared[-1]:
        return None
    V = scale[:, None] * V / np.sqrt(inverse_squared)
    return 1 / np.sqrt(inverse_squared[::-1]), V[:, ::-1]


def _floating_modes(K: np.ndarray, M: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """omega (r,) ascending and mass-normalised V (r, r) by K v = omega^2 M v, what is zero but for
    rounding set to zero; raises ReductionError where M is not positive or K is indefinite."""
    try:
        squared, V = eigh(K, M)
    except np.linalg.LinAlgError:
        raise ReductionError(
            "the reduced mass matrix is not positive definite; the reduction lost rank."
        ) from None
    noise = 20 * EPS * max(squared[-1], 0.0)
    if squared[0] < -noise:
        raise ReductionError(
            f"the reduced stiffness is indefinite: its lowest eigenvalue is {squared[0]:.3g} "
            f"rad^2/s^2, allowed is > {-noise:.1g}."
        )
    return np.sqrt(np.where(squared > noise, squared, 0.0)), V


def static_compliance(reduced: ReducedModel, *, modes: ModalWall | None = None) -> float:
    """w^T K^-1 w [m/N]; of a floating model the part that is not rigid-body motion.

    The latter is sum phi_j^2 / omega_j^2 over the elastic modes (inertia relief). A held model is
    solved directly, independently of its modes. modes are those of `modal(reduced)`, where known.
    """
    wall = modal(reduced) if modes is None else modes
    if not wall.omega.all():
        return modal_compliance(wall)
    scale = 1 / np.sqrt(np.diag(reduced.K))
    load = scale * reduced.w
    return float(load @ solve(reduced.K * np.outer(scale, scale), load, assume_a="pos"))


def modal_compliance(wall: ModalWall) -> float:
    """sum phi_j^2 / omega_j^2 [m/N] over the elastic modes of a wall."""
    elastic = wall.omega > 0
    return float(np.sum((wall.phi[elastic] / wall.omega[elastic]) ** 2))


def receptance(
    reduced: ReducedModel,
    w_out: ArrayLike | None,
    frequency_hz: ArrayLike,
    *,
    zeta: ArrayLike = 0.0,
    loss: float = 0.0,
) -> np.ndarray:
    """H (k,) complex [m/N]: response w_out^T u to a unit harmonic contact force at frequency_hz.

    w_out (n,) acts on the full field, or (r,) on q where T is None; None reads at the contact.
    frequency_hz (k,) [Hz]; zeta is a modal damping ratio, one or (r,) of them, on top of C; loss a
    structural loss factor, K (1 + i loss). Without any of them H is unbounded at a resonance:
    compare models between resonances, or with some damping in both. Raises ReductionError as
    `modal`, and for a w_out that is zero or of another length.
    """
    wall = modal(reduced)
    out = wall.phi
    if w_out is not None:
        row = np.asarray(w_out, dtype=float)
        row = row if reduced.T is None else row @ reduced.T
        out = contact_functional(row, len(reduced.w)) @ wall.vectors
    s = 2j * np.pi * np.atleast_1d(np.asarray(frequency_hz, dtype=float))
    stiffness = wall.omega**2 * (1 + 1j * loss) + 2 * np.outer(s, zeta * wall.omega)

    # modes uncouple without dashpots; with them V^T C V is full, and each frequency is a solution
    if wall.damping is None:
        return (wall.phi * out / (stiffness + s[:, None] ** 2)).sum(axis=1)
    return np.array(
        [
            out @ np.linalg.solve(np.diag(k + si**2) + si * wall.damping, wall.phi)
            for k, si in zip(stiffness, s, strict=True)
        ]
    )
