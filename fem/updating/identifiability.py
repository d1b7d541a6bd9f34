"""Identifiability of an assembly's parameters from measured frequencies, before any of them is
fitted.

    S_ij = (d ln f_i / d ln p_j) limit_j / frequency error_i

counts the measurement errors by which target i moves while parameter j moves by `limit_j`, the
deviation above which a fit calls it undetermined. Rank-revealing QR of S takes one parameter after
the other, each the one that adds most to what those before it explain already (Golub and Van Loan,
Matrix Computations, algorithm 5.4.1). Where the smallest singular value of the columns taken is
above 1, the targets determine these parameters together.

Springs that are rigid or open have no slope in ln k. The stiffness k at which they bring a mode to
a frequency omega is an eigenvalue, of the receptance at their ends without them:

    E (K - omega^2 M)^-1 E^T a = -a / k,    phi = (K - omega^2 M)^-1 E^T a

A MAC with a measured shape changes with the shape, whose derivative is a sum over all other modes
of the projection (Fox and Kapoor, AIAA J. 6 (1968) 2426).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import eigh, null_space, qr

from beadwave.fem.modes.mac import Shape
from beadwave.fem.modes.modes import Modes
from beadwave.fem.updating.tuning import (
    TuningBasis,
    TuningParameter,
    covariance_over,
    largest_determined,
    of_bodies,
)


class AtScene(NamedTuple):
    """The assembly in a tuning basis with every parameter at the value that its scene has."""

    modes: Modes  # omega (k,), phi (m, k)
    K: NDArray[np.float64]  # (m, m) with the springs that are not rigid
    M: NDArray[np.float64]  # (m, m)
    stiffness: NDArray[np.float64]  # (n_springs,) inf where rigid


class Ranking(NamedTuple):
    """Parameters in the order in which they are worth freeing."""

    order: NDArray[np.int64]  # (r,) positions, of those that move a target at all
    gain: NDArray[np.float64]  # (r,) measurement errors that each explains beyond those before it
    condition: NDArray[np.float64]  # (r,) of S with this one and those before it
    deviation: NDArray[np.float64]  # (r,) of ln(value) where those before it are free as well
    n_determined: int  # that the targets determine together, the first ones
    singular: NDArray[np.float64]  # of S, all parameters free


def at_scene(basis: TuningBasis, parameters: Sequence[TuningParameter]) -> AtScene:
    """Modes with all parameters at `TuningParameter.before`, rigid springs as constraints."""
    stiffness = basis.stiffness.copy()
    for p in parameters:
        for spring, k in zip(p.springs, p.before, strict=bool(p.springs)):
            stiffness[np.array(basis.spring) == spring] = k  # of all bolts of a joint
    factor = np.array([1.0 if p.springs else p.before[0] for p in parameters])
    K, M = of_bodies(basis, parameters, factor)
    rigid = np.isinf(stiffness)
    elastic = basis.elongation[~rigid]
    K = K + (elastic.T * stiffness[~rigid]) @ elastic

    Z = _not_elongating(basis.elongation[rigid])
    omega2, q = eigh(Z.T @ K @ Z, Z.T @ M @ Z)
    return AtScene(Modes(np.sqrt(np.maximum(omega2, 0.0)), Z @ q), K, M, stiffness)


def _not_elongating(elongation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Coordinates Z (m, k) of q = Z z in which springs, elongation (n, m), keep their length."""
    if not len(elongation):
        return np.eye(elongation.shape[1])
    return null_space(elongation / np.linalg.norm(elongation, axis=1, keepdims=True))


def frequency_sensitivity(
    basis: TuningBasis, parameters: Sequence[TuningParameter], scene: AtScene
) -> NDArray[np.float64]:
    """d ln f / d ln p (k, p) of every mode, (phi^T dK phi - omega^2 phi^T dM phi) / (2 omega^2) of
    mass-normalised modes; 0 for springs that are rigid or open. Rows of rigid motions, which have
    no frequency to change, mean nothing."""
    columns = [_in_modes(basis, p, scene) for p in parameters]
    omega2 = np.maximum(scene.modes.omega**2, 1e-300)  # of rigid motions 0
    columns = [(np.diag(dK) - omega2 * np.diag(dM)) / (2 * omega2) for dK, dM in columns]
    return np.array(columns).reshape(len(parameters), len(omega2)).T


def mac_sensitivity(
    basis: TuningBasis,
    parameters: Sequence[TuningParameter],
    scene: AtScene,
    target: Shape,
    mode: int,
) -> NDArray[np.float64]:
    """d MAC / d ln p (p,) of a mode with a measured shape; nan where another mode has the same
    frequency, as the shapes of both are arbitrary then."""
    omega2 = scene.modes.omega**2
    distance = omega2[mode] - omega2
    others = np.arange(len(omega2)) != mode
    # frequencies within 1e-6 of each other have arbitrary shapes
    if np.any(np.abs(distance[others]) < 2 * 1e-6 * omega2[mode]):
        return np.full(len(parameters), np.nan)

    # MAC = |c|^2 / (u u  psi psi), with c = psi^H u of the shape u read at the sensors
    read = target.reading @ scene.modes.phi
    u, psi = read[:, mode], target.shape
    c, u_u, psi_psi = psi.conj() @ u, u @ u, np.vdot(psi, psi).real
    slopes = []
    for p in parameters:
        dK, dM = _in_modes(basis, p, scene)
        # d phi = sum_j phi_j (phi_j^T (dK - omega^2 dM) phi) / (omega^2 - omega_j^2), j others
        share = np.zeros(len(omega2))
        share[others] = (dK - omega2[mode] * dM)[others, mode] / distance[others]
        du = read @ share  # less what changes its length alone
        dc = psi.conj() @ du
        slopes.append(
            (2 * (c.conjugate() * dc).real / u_u - 2 * abs(c) ** 2 * (u @ du) / u_u**2) / psi_psi
        )
    return np.array(slopes)


def _in_modes(
    basis: TuningBasis, p: TuningParameter, scene: AtScene
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """d K / d ln p and d M / d ln p (k, k) in the modes' own coordinates."""
    phi = scene.modes.phi
    dK = np.zeros((phi.shape[1],) * 2)
    dM = np.zeros_like(dK)
    of_springs = np.isin(basis.spring, p.springs) & np.isfinite(scene.stiffness)
    elongation = basis.elongation[of_springs] @ phi
    dK += (elongation.T * scene.stiffness[of_springs]) @ elongation
    for form in (basis.forms[body] for body in p.bodies):
        if p.of == "young":
            dK += p.before[0] * (phi.T @ form.K @ phi)
        else:
            dM += p.before[0] * (phi.T @ form.M @ phi)
    return dK, dM


def onset_stiffness(
    basis: TuningBasis,
    p: TuningParameter,
    scene: AtScene,
    mode: int,
    change: float,
    likeness: float = 0.5,
) -> float:
    """Stiffness [N/m, N m/rad] at which springs that are rigid now lower a mode, or springs that
    are open now raise it, by the relative `change` of its frequency; nan where they never do.

    `likeness` is the least share of M in which the mode must stay itself, as others may pass it.
    """
    springs = np.isin(basis.spring, p.springs)
    rigid = np.isinf(scene.stiffness)
    sign = -1.0 if rigid[springs].all() else 1.0
    omega2 = (scene.modes.omega[mode] * (1 + sign * change)) ** 2
    if omega2 == 0.0:
        return np.nan

    # receptance at the ends of the springs, all others as they are
    Z = _not_elongating(basis.elongation[rigid & ~springs])
    elongation = basis.elongation[springs] @ Z
    response = np.linalg.solve(Z.T @ (scene.K - omega2 * scene.M) @ Z, elongation.T)
    minus_flexibility, a = np.linalg.eigh(elongation @ response)

    # of the modes that some stiffness brings to this frequency, the one that is this mode
    shapes = Z @ response @ a
    masses = np.sum(shapes * (scene.M @ shapes), axis=0)
    share = (scene.modes.phi[:, mode] @ scene.M @ shapes) ** 2 / np.maximum(masses, 1e-300)
    share[minus_flexibility >= 0] = 0.0
    best = int(share.argmax())
    return -1 / minus_flexibility[best] if share[best] > likeness else np.nan


def ranking(
    parameters: Sequence[TuningParameter],
    slopes: NDArray[np.float64],
    *,
    frequency_error: ArrayLike = 1e-3,
    least: float = 1e-9,
) -> Ranking:
    """Parameters ranked by d ln f / d ln p (n, p) of n targets, with a relative frequency_error of
    all or of each (n,).

    `least` is the column of S, over the largest, that counts as zero: rounding of the slopes.
    """
    # S, and its columns from the one that adds most on; |R_jj| is what the j-th adds
    limit = largest_determined(parameters)
    weighted = slopes / np.broadcast_to(frequency_error, len(slopes))[:, None]
    S = weighted * limit
    _, R, order = qr(S, mode="economic", pivoting=True)
    gain = np.abs(np.diag(R))
    order = order[: np.count_nonzero(gain > least * max(gain[0], 1.0))]

    # with each number of parameters free: how far the targets pin them down. Those counted as
    # determined have a covariance, in units of their limits, below 1 in every direction
    condition, deviation, n_determined = [], [], 0
    for n, j in enumerate(order, start=1):
        first = order[:n]
        condition.append(np.linalg.cond(S[:, first]))
        chosen = [parameters[i] for i in first]
        covariance = covariance_over(limit[first], chosen, weighted[:, first])
        deviation.append(np.sqrt(covariance[-1, -1]) * limit[j])
        if n == n_determined + 1 and np.linalg.norm(covariance, 2) <= 1.0:
            n_determined = n
    return Ranking(
        order, gain[: len(order)], np.array(condition), np.array(deviation), n_determined,
        np.linalg.svd(S, compute_uv=False),
    )  # fmt: skip
