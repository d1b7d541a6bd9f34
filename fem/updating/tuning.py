"""Joint stiffnesses fitted to measured frequencies on a small projection of the assembly.

    K(k, e) = K0 + sum_b (e_b - 1) K_b + sum_j k_j e_j e_j^T,    M(d) = M + sum_b (d_b - 1) M_b

with e_b and d_b the factors on the moduli and the density of body b. The projection V holds the
modes at a stiff and at a soft setting and the static shapes of every spring pulled alone, so that
no trial goes back to the mesh. Sensitivities are exact (Fox and Kapoor, AIAA J. 6 (1968) 2426):

    d omega^2 / d k_j = phi_j^2,    d omega^2 / d e_b = phi^T K_b phi,
    d omega^2 / d d_b = -omega^2 phi^T M_b phi.

Modes are followed by shape; parameters move on a logarithmic scale within bounds. Of parameters
that the targets do not determine together, `determined` takes a subset that they do.
"""

from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh, null_space
from scipy.optimize import least_squares
from scipy.sparse import csr_matrix

from beadwave.fem.assembly.model import Model
from beadwave.fem.modes.mac import (
    RIGID,
    BodyForms,
    Shape,
    Target,
    body_forms,
    paired,
    spring_forms,
)
from beadwave.fem.modes.modes import SHIFT_HZ, Modes, deflated, modes
from beadwave.fem.modes.solver.factorisation import Factor, factorised

CARRIED = "masses:"  # before the name of a carried mass among the bodies; no body has a colon


class TuningParameter(NamedTuple):
    """Springs that share one stiffness, or a factor on the moduli or the density of bodies."""

    name: str
    springs: tuple[str, ...]  # "joint.ky", names of the springs that take this value
    start: float
    lower: float
    upper: float
    bodies: tuple[str, ...] = ()  # whose material, or stiffness, the factor multiplies
    of: Literal["young", "density"] = "young"
    before: tuple[float, ...] = ()  # stiffness of each spring, inf where rigid; or the one factor
    # standard deviation of ln(value) about the start that is known without the targets; None: none
    known: float | None = None


class TuningBasis(NamedTuple):
    """The assembly projected on m shapes; springs and bodies kept separate, for trial values."""

    K0: NDArray[np.float64]  # (m, m) joints open
    M: NDArray[np.float64]  # (m, m)
    elongation: NDArray[np.float64]  # (n_springs, m)
    spring: tuple[str, ...]  # (n_springs,) their names
    stiffness: NDArray[np.float64]  # (n_springs,) where no parameter sets it
    # of every body, carried mass and spring between points, in the same coordinates
    forms: dict[str, BodyForms]
    targets: tuple[Target, ...]  # what identifies the modes to tune, 1, 2, ...


class Tuning(NamedTuple):
    """The best fit; nan stands for targets that no mode fits."""

    parameters: tuple[TuningParameter, ...]
    value: NDArray[np.float64]  # (p,) stiffnesses [N/m, N m/rad] and factors
    modes_hz: NDArray[np.float64]  # (n_targets,) of the projection
    deviation: NDArray[np.float64]  # (p,) of ln(value) for the assumed frequency error
    uncertainty: NDArray[np.float64]  # (p,) the same over the largest that counts as determined
    is_determined: bool  # whether the targets determine every combination of the parameters
    misfit: float  # sum of (ln(f / target) / frequency error)^2
    all_hz: NDArray[np.float64]  # every frequency up to that of the highest target
    evaluations: int


# Stiffnesses of all joints whose modes span the projection
STIFF = 1e10  # [N/m]
SOFT = 1e6  # [N/m] that of the attachment shapes as well
LEVER2 = 1e-4  # [m^2] a rotational stiffness is one of shifts at a distance of 10 mm
DEPENDENT_SHARE = 1e-10  # of the largest eigenvalue of V^T M V: below, a shape is dropped
# of the length of an attachment: below, what it has beyond the modes is dropped; a point on
# the block of the rig has 6e-6
ATTACHMENT_ROUNDING = 1e-10


UNFITTED = 3.0  # ln(f / target) charged for a mode that lost its shape: a factor of 20
UNDETERMINED_SHARE = 0.7  # deviation over that within the bounds: above, the data say nothing
VAGUE_DEVIATION = np.log(2.0)  # deviation of ln(value): not even known within a factor of two
SIGNIFICANT_RISE = 4.0  # rise of the sum of squares that one parameter explains: two deviations


def tuning_basis(
    model: Model,
    targets: Sequence[Target],
    *,
    n_modes: int = 24,
    loads: csr_matrix | None = None,
) -> TuningBasis:
    """Project a model of finite springs; takes two solves for modes and one for attachments, to
    which `loads` (l, n) add the static shapes of forces that act along their rows.

    K and M are kept in parts, K0, each spring's elongations and each body's K_b and M_b (m, m), so
    that any value of the parameters is a sum of small matrices. Raises ValueError as
    `fem.modes.modes.modes`.
    """
    # "joint.krx" and the like: the direction is the last word of a spring's name
    is_turn = np.array([name.rpartition(".")[2].startswith("kr") for name in model.spring], bool)
    unit_stiffness = np.where(is_turn, LEVER2, 1.0)

    # modes at both ends of the range, and the static shape of every spring pulled alone
    stiff, soft = (
        modes(model._replace(stiffness=k * unit_stiffness).K, model.M, n_modes)
        for k in (STIFF, SOFT)
    )
    K = model._replace(stiffness=SOFT * unit_stiffness).K
    pulls = np.zeros((K.shape[0], len(model.elongation)))
    pulls[model.elongation, range(len(model.elongation))] = 1.0
    of_points = [(spring.B @ model.T).toarray().T for spring in model.structure.springs]
    pulls = np.hstack([pulls, *of_points, *([] if loads is None else [loads.toarray().T])])
    # of a structure that floats K is singular: shifted by its inertia, without the rigid motions R
    R = soft.phi[:, soft.omega < RIGID * soft.omega.max()]
    shift = (2 * np.pi * SHIFT_HZ) ** 2 if R.shape[1] else 0.0
    factor = factorised((K + shift * model.M).tocsc() if shift else K)
    attachments = deflated(R, model.M @ R, factor, pulls)
    V = _m_orthonormalised(np.hstack([stiff.phi, soft.phi]), model.M, DEPENDENT_SHARE)
    # what attachments have beyond the modes: in their lengths in M the yielding around a point is
    # small as (omega_1 / omega)^2 and passes for dependent; once leaves rounding of their size
    length = np.sqrt(np.sum(attachments * (model.M @ attachments), axis=0))
    for _ in range(2):
        attachments = attachments - V @ (V.T @ (model.M @ attachments))
    beyond = np.sqrt(np.sum(attachments * (model.M @ attachments), axis=0))
    attachments = attachments[:, beyond > ATTACHMENT_ROUNDING * length]
    if attachments.shape[1]:
        V = np.hstack([V, _m_orthonormalised(attachments, model.M, DEPENDENT_SHARE)])

    # masses that faces carry: bodies that nothing strains
    u, m = model.T @ V, V.shape[1]
    of_carried = {
        f"{CARRIED}{mass.name}": BodyForms(np.zeros((m, m)), u.T @ (mass.M @ u), np.zeros((6, m)))
        for mass in model.structure.carried
    }
    return TuningBasis(
        V.T @ (model.K0 @ V),
        np.eye(V.shape[1]),
        V[model.elongation],
        model.spring,
        model.stiffness,
        {body: body_forms(model, body, V) for body in model.structure.basis}
        | of_carried
        | spring_forms(model, V),
        tuple(t.within(V) if isinstance(t, Shape) else t for t in targets),
    )


def _m_orthonormalised(V: NDArray[np.float64], M, dependent: float) -> NDArray[np.float64]:
    """Columns that span V (n, m), M-orthonormal; nearly dependent ones dropped."""
    V = V / np.sqrt(np.sum(V * (M @ V), axis=0))
    values, rotation = np.linalg.eigh(V.T @ (M @ V))
    independent = values > dependent * values[-1]
    return V @ (rotation[:, independent] / np.sqrt(values[independent]))


def rigid_jointed(
    model: Model, modes: Modes, factor: Factor, n_modes: int, dependent: float = 1e-10
) -> Modes:
    """The n_modes lowest modes of the model with all its springs rigid, in the space of `modes`
    and of the static shapes of the springs.

    omega (k,) and phi (n, k) are diagonal in K and M, and may be Ritz pairs; the factor is that of
    K. Rigid springs hold the elongations e^T u at zero by forces that act along e alone: to the
    modes come the static response to each, K^-1 e, and the response to its inertia, K^-1 M K^-1 e.
    """
    # what those have beyond the modes: X (n, 2 s), M-orthonormal
    pulls = np.zeros((len(modes.phi), len(model.elongation)))
    pulls[model.elongation, range(len(model.elongation))] = 1.0
    static = factor.solve(pulls)
    X = np.hstack([static, factor.solve(model.M @ static)])
    for _ in range(2):  # once leaves rounding of the size of X
        X -= modes.phi @ (modes.phi.T @ (model.M @ X))
    X = _m_orthonormalised(X, model.M, dependent)

    # K and the elongations in [phi, X], M being 1; coordinates Z in which no spring elongates
    cross = modes.phi.T @ (model.K @ X)
    K = np.block([[np.diag(modes.omega**2), cross], [cross.T, X.T @ (model.K @ X)]])
    elongation = np.hstack([modes.phi[model.elongation], X[model.elongation]])
    Z = null_space(elongation / np.linalg.norm(elongation, axis=1, keepdims=True))
    omega2, q = eigh(Z.T @ K @ Z)
    q = Z @ q[:, :n_modes]
    n = len(modes.omega)
    return Modes(np.sqrt(np.maximum(omega2[:n_modes], 0)), modes.phi @ q[:n] + X @ q[n:])


def spectrum(
    basis: TuningBasis, parameters: Sequence[TuningParameter], value: NDArray[np.float64]
) -> Modes:
    """All modes of the projection at the given values (p,): omega (m,) [rad/s], phi (m, m) in its
    coordinates, mass-normalised."""
    k = basis.stiffness.copy()
    for p, x in zip(parameters, value, strict=True):
        k[np.isin(basis.spring, p.springs)] = x
    K, M = of_bodies(basis, parameters, value)
    K = K + (basis.elongation.T * k) @ basis.elongation
    standard = M is basis.M  # the identity
    omega2, phi = eigh(
        K, None if standard else M, check_finite=False, driver="evd" if standard else "gvd"
    )
    return Modes(np.sqrt(np.maximum(omega2, 0.0)), phi)


def of_bodies(
    basis: TuningBasis, parameters: Sequence[TuningParameter], value: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """K and M (m, m) of the projection without springs, factors on bodies at the values (p,)."""
    K, M = basis.K0, basis.M
    for p, x in zip(parameters, value, strict=True):
        for form in (basis.forms[body] for body in p.bodies):
            if p.of == "young":
                K = K + (x - 1) * form.K
            else:
                M = M + (x - 1) * form.M
    return K, M


def sensitivity(
    basis: TuningBasis,
    parameters: Sequence[TuningParameter],
    value: NDArray[np.float64],
    computed: Modes,
) -> NDArray[np.float64]:
    """d ln(omega) / d ln(value), (k, p), of k modes computed at the values (p,)."""
    phi, gradients = computed.phi, []
    for p in parameters:
        # d omega^2 / d value, (k,): of all springs that share the value, then of the bodies
        elongation = basis.elongation[np.isin(basis.spring, p.springs)] @ phi
        gradient = (elongation**2).sum(axis=0)
        for form in (basis.forms[body] for body in p.bodies):
            A, factor = (form.K, 1.0) if p.of == "young" else (form.M, -(computed.omega**2))
            gradient = gradient + factor * np.sum(phi * (A @ phi), axis=0)
        gradients.append(gradient)
    return np.array(gradients).T * value / (2 * computed.omega[:, None] ** 2)


def tune(
    basis: TuningBasis,
    parameters: Sequence[TuningParameter],
    target_hz: Mapping[int, float],
    *,
    frequency_error: float | Mapping[int, float] = 1e-3,
    regularisation: float = 0.1,
    n_starts: int = 12,
    seed: int = 0,
) -> Tuning:
    """Parameters that bring targets {1, 2, ...: Hz} of the basis to their frequencies.

    Least squares in x = ln(value), from the start values and from `n_starts - 1` random ones
    within the bounds, of the residuals

        w_i ln(f_i(x) / target_i),    r_j min(s) (x_j - x_j(start)).

    The second residuals pull towards the start: with r = 1 / p.known where a parameter is known
    that well, else weakly, with r = regularisation, so that they decide what the targets leave
    open.
    frequency_error s_i, relative, is that of all targets or {1, 2, ...: of each}, and
    w_i = min(s) / s_i. `deviation` is the standard deviation of ln(value), from the covariance
    (J^T S^-2 J)^-1 with the Jacobian J of ln f and S = diag(s).
    """
    # x = ln(value); weights relative to that of the surest target, 1 where all errors are alike
    start, lower, upper = (
        np.log([getattr(p, key) for p in parameters]) for key in ("start", "lower", "upper")
    )
    measured_hz = np.array(list(target_hz.values()))
    n_targets = len(target_hz)
    errors = frequency_error if isinstance(frequency_error, Mapping) else None
    s = np.array([errors[n] if errors else frequency_error for n in target_hz])
    weight = s.min() / s
    pull = s.min() * np.array([1 / p.known if p.known else regularisation for p in parameters])

    def matched(x: NDArray[np.float64]) -> tuple[Modes, NDArray[np.int64]]:
        """Modes at exp(x), x (p,), and which of them each target (n_targets,) is, -1 where none."""
        computed = spectrum(basis, parameters, np.exp(x))
        index = paired(basis.forms, computed, basis.targets).index
        return computed, index[[i - 1 for i in target_hz]]

    def residual(x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Residuals (n_targets + p,); one that is lost has a constant, which no slope reduces."""
        computed, index = matched(x)
        error = np.log(np.maximum(computed.frequency_hz[index], 1e-3) / measured_hz)
        error = np.where(index < 0, UNFITTED, error)
        return np.concatenate([weight * error, pull * (x - start)])

    def jacobian(x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Slopes (n_targets + p, p) of the residuals to x."""
        computed, index = matched(x)
        of_targets = Modes(computed.omega[index], computed.phi[:, index])
        J = sensitivity(basis, parameters, np.exp(x), of_targets)
        J[index < 0] = 0.0
        return np.vstack([weight[:, None] * J, np.diag(pull)])

    # modes swap places as joints stiffen, so the sum of squares has several minima: many starts
    fits, x = [], np.zeros(0)
    if parameters:
        random = np.random.default_rng(seed).uniform(lower, upper, (n_starts - 1, len(lower)))
        for x_0 in (np.clip(start, lower, upper), *random):
            fits.append(
                least_squares(
                    residual, x_0, jacobian, bounds=(lower, upper),
                    xtol=1e-10, ftol=1e-12, gtol=1e-12, max_nfev=60,
                )
            )  # fmt: skip
        x = min(fits, key=lambda fit: fit.cost).x

    # covariance of the best fit, targets and bounds together, in units of what counts as known
    error, J = residual(x)[:n_targets] / s.min(), jacobian(x)[:n_targets] / s.min()
    limit = largest_determined(parameters)
    covariance = covariance_over(limit, parameters, J)
    uncertainty = np.sqrt(np.diag(covariance))

    # every target, those too that were not fitted
    computed = spectrum(basis, parameters, np.exp(x))
    index = paired(basis.forms, computed, basis.targets).index
    return Tuning(
        tuple(parameters),
        np.exp(x),
        np.where(index < 0, np.nan, 1.0) * computed.frequency_hz[index],
        np.where(uncertainty > 1.0, np.inf, uncertainty * limit),
        uncertainty,
        bool(np.linalg.norm(covariance, 2) <= 1.0) if len(x) else True,
        float(error @ error),
        computed.frequency_hz[: index.max() + 1],
        sum(fit.nfev for fit in fits),
    )


def deviation_of_others(
    basis: TuningBasis,
    fit: Tuning,
    target_hz: Mapping[int, float],
    left_out: Sequence[TuningParameter],
    *,
    frequency_error: float | Mapping[int, float] = 1e-3,
) -> NDArray[np.float64]:
    """Standard deviations (p,) of ln(value) of a fit where springs that were left out of it, at the
    values they had before, are known to within a factor of two alone.

    From (J^T S^-2 J + P^-2)^-1 of both together, P the deviations that the bounds of those fitted
    or what is known of them say, and ln 2 of others. inf where a value is not determined even
    without these.
    """
    elastic = [p for p in left_out if p.springs and 0 < min(p.before) and max(p.before) < np.inf]
    if not elastic:
        return fit.deviation
    errors = frequency_error if isinstance(frequency_error, Mapping) else None
    s = np.array([errors[n] if errors else frequency_error for n in target_hz])
    computed = spectrum(basis, fit.parameters, fit.value)
    index = paired(basis.forms, computed, basis.targets).index[[i - 1 for i in target_hz]]
    of_targets = Modes(computed.omega[index], computed.phi[:, index])
    parameters = [*fit.parameters, *elastic]
    value = np.concatenate([fit.value, [p.before[0] for p in elastic]])
    J = sensitivity(basis, parameters, value, of_targets) / s[:, None]
    J[index < 0] = 0.0
    vague = [p.known or VAGUE_DEVIATION for p in elastic]
    prior = np.append(prior_deviation(fit.parameters), vague)
    together = np.sqrt(np.diag(np.linalg.inv(J.T @ J + np.diag(prior**-2.0))))
    return np.maximum(fit.deviation, together[: len(fit.parameters)])


def largest_determined(parameters: Sequence[TuningParameter]) -> NDArray[np.float64]:
    """The largest deviations (p,) of ln(value) that count as determined."""
    return np.minimum(UNDETERMINED_SHARE * prior_deviation(parameters), VAGUE_DEVIATION)


def covariance_over(
    limit: NDArray[np.float64], parameters: Sequence[TuningParameter], J: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Covariance (p, p) of ln(value) over `limit` (p,), from the Jacobian J (n, p) of residuals
    that have a standard deviation of 1, and from what is known without them."""
    prior = prior_deviation(parameters)
    return np.linalg.inv(J.T @ J + np.diag(prior**-2.0)) / np.outer(limit, limit)


def prior_deviation(parameters: Sequence[TuningParameter]) -> NDArray[np.float64]:
    """Standard deviations (p,) of ln(value) without the data: those known, else those of values
    evenly distributed within the bounds, their distance over sqrt(12)."""
    return np.array([p.known or np.log(p.upper / p.lower) / np.sqrt(12) for p in parameters])


def determined(
    basis: TuningBasis,
    parameters: Sequence[TuningParameter],
    target_hz: Mapping[int, float],
    fit: Tuning,
    *,
    frequency_error: float | Mapping[int, float] = 1e-3,
) -> tuple[TuningParameter, ...]:
    """The parameters, of a fit of all of them with this frequency_error, that the targets
    determine; none where they determine none. The others are at the values they had before
    (`TuningParameter.before`).

    Backward elimination, one parameter at a time. A direction that was rigid, or stiffer than its
    bounds, stays so if the other parameters alone meet the targets as closely (likelihood ratio,
    two standard deviations). This holds even where the covariance is finite, since a fit may have
    two solutions: a bolt that is soft along its axis lets a part tilt at the same frequency at
    which one that is soft across it lets the part slide. As long as some combination is
    undetermined, one parameter leaves the fit: the least determined of those without which the
    targets are still met, or of all where each is needed.
    """
    while parameters:
        uncertainty = dict(zip([p.name for p in parameters], fit.uncertainty, strict=True))
        by_uncertainty = sorted(parameters, key=lambda p: -uncertainty[p.name])
        rigid = [p for p in by_uncertainty if p.springs and min(p.before) > p.upper]
        elastic = [p for p in by_uncertainty if p not in rigid]
        allowed = fit.misfit + SIGNIFICANT_RISE * max(1.0, fit.misfit / len(target_hz))
        refits = {}
        for dropped in rigid if fit.is_determined else rigid + elastic:
            remaining = [p for p in parameters if p is not dropped]
            reduced = at_before(basis, dropped)
            refit = tune(reduced, remaining, target_hz, frequency_error=frequency_error)
            refits[dropped.name] = remaining, reduced, refit
            if refit.misfit <= allowed:
                break
        else:
            # every one of these is needed to meet the targets
            if fit.is_determined:
                break
            dropped = by_uncertainty[0]
        parameters, basis, fit = refits[dropped.name]
    return tuple(parameters)


def at_before(basis: TuningBasis, p: TuningParameter) -> TuningBasis:
    """The basis with a parameter at the value it had before, rigid springs as constraints."""
    before = dict(zip(p.springs, p.before, strict=True)) if p.springs else {}
    stiffness = np.array(
        [before.get(name, k) for name, k in zip(basis.spring, basis.stiffness, strict=True)]
    )
    K0, M = basis.K0, basis.M
    for form in (basis.forms[body] for body in p.bodies):
        if p.of == "young":
            K0 = K0 + (p.before[0] - 1) * form.K
        else:
            M = M + (p.before[0] - 1) * form.M

    # coordinates q = Z z in which the rigid springs do not elongate
    rigid = np.isinf(stiffness)
    constraint = basis.elongation[rigid]
    constraint = constraint / np.linalg.norm(constraint, axis=1, keepdims=True)
    Z = null_space(constraint) if rigid.any() else np.eye(len(M))
    Z = _m_orthonormalised(Z, M, DEPENDENT_SHARE)
    return TuningBasis(
        Z.T @ K0 @ Z,
        np.eye(Z.shape[1]),
        basis.elongation[~rigid] @ Z,
        tuple(name for name, is_rigid in zip(basis.spring, rigid, strict=True) if not is_rigid),
        stiffness[~rigid],
        {
            body: BodyForms(Z.T @ form.K @ Z, Z.T @ form.M @ Z, form.rigid @ Z)
            for body, form in basis.forms.items()
        },
        tuple(t.within(Z) if isinstance(t, Shape) else t for t in basis.targets),
    )
