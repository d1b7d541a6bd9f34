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

from fem.correlation import BodyForms, Shape, Target, body_forms, paired
from fem.factorisation import factorised
from fem.model import Model
from fem.modes import Modes, modes

STIFF, SOFT = 1e10, 1e6  # [N/m] settings whose modes span the projection
LEVER = 1e-4  # [m^2] turns per shifts: a rotational stiffness is one at about 10 mm
UNFITTED = 3.0  # log-frequency distance charged for a mode that lost its shape
N_STARTS = 12
UNSEEN = 0.7  # of the uncertainty within the bounds: more is left where the data say nothing
VAGUE = np.log(2.0)  # standard deviation of ln(value): not even known within a factor of two
WORSE = 4.0  # rise of the sum of squares that one parameter explains: two standard deviations


class TuningParameter(NamedTuple):
    """Springs that share one stiffness, or a factor on the moduli or the density of bodies."""

    name: str
    springs: tuple[str, ...]  # "joint.ky", names of the springs that take this value
    start: float
    lower: float
    upper: float
    bodies: tuple[str, ...] = ()  # that the factor is on
    of: Literal["young", "density"] = "young"
    before: tuple[float, ...] = ()  # stiffness of each spring, inf where rigid; or the one factor


class TuningBasis(NamedTuple):
    """The assembly projected on m shapes, springs and bodies apart."""

    K0: NDArray[np.float64]  # (m, m) joints open
    M: NDArray[np.float64]  # (m, m)
    elongation: NDArray[np.float64]  # (n_springs, m)
    spring: tuple[str, ...]  # (n_springs,) their names
    stiffness: NDArray[np.float64]  # (n_springs,) where no parameter sets it
    forms: dict[str, BodyForms]  # of every body, in the same coordinates
    targets: tuple[Target, ...]  # how the modes to tune are told, 1, 2, ...


class Tuning(NamedTuple):
    """The best fit found; nan stands for targets that no mode fits."""

    parameters: tuple[TuningParameter, ...]
    value: NDArray[np.float64]  # (p,) stiffnesses [N/m, N m/rad] and factors
    modes_hz: NDArray[np.float64]  # (n_targets,) of the projection
    deviation: NDArray[np.float64]  # (p,) of ln(value) for the assumed frequency error
    uncertainty: NDArray[np.float64]  # (p,) the same over the largest that counts as determined
    is_determined: bool  # whether the targets narrow every combination of the parameters
    misfit: float  # sum of (ln(f / target) / frequency error)^2
    all_hz: NDArray[np.float64]  # every frequency up to that of the highest target
    evaluations: int


def tuning_basis(model: Model, targets: Sequence[Target], *, n_modes: int = 24) -> TuningBasis:
    """Project a model of finite springs; takes two solves for modes and one for attachments."""
    stiffness = np.where(_is_turn(model), LEVER, 1.0)
    stiff, soft = (modes(_with(model, k * stiffness), model.M, n_modes) for k in (STIFF, SOFT))
    K = _with(model, SOFT * stiffness)
    pulls = np.zeros((K.shape[0], len(model.elongation)))
    pulls[model.elongation, range(len(model.elongation))] = 1.0
    shapes = [stiff.phi, soft.phi, factorised(K).solve(pulls)]
    V = _orthonormal(np.hstack(shapes), model.M)
    return TuningBasis(
        V.T @ (model.K0 @ V),
        np.eye(V.shape[1]),
        V[model.elongation],
        model.spring,
        model.stiffness,
        {body: body_forms(model, body, V) for body in model.structure.basis},
        tuple(t.within(V) if isinstance(t, Shape) else t for t in targets),
    )


def _with(model: Model, stiffness):
    return model._replace(stiffness=stiffness).K


def _is_turn(model: Model) -> NDArray[np.bool_]:
    return np.array([".kr" in name[-4:] for name in model.spring], dtype=bool)


def _orthonormal(V: NDArray[np.float64], M) -> NDArray[np.float64]:
    """Columns that span V, M-orthonormal, nearly dependent ones dropped."""
    V = V / np.sqrt(np.sum(V * (M @ V), axis=0))
    values, rotation = np.linalg.eigh(V.T @ (M @ V))
    kept = values > 1e-10 * values[-1]
    return V @ (rotation[:, kept] / np.sqrt(values[kept]))


def spectrum(
    basis: TuningBasis, parameters: Sequence[TuningParameter], value: NDArray[np.float64]
) -> Modes:
    """All modes of the projection at the given values (p,)."""
    k, K, M = basis.stiffness.copy(), basis.K0, basis.M
    for p, x in zip(parameters, value, strict=True):
        k[np.isin(basis.spring, p.springs)] = x
        for form in (basis.forms[body] for body in p.bodies):
            if p.of == "young":
                K = K + (x - 1) * form.K
            else:
                M = M + (x - 1) * form.M
    K = K + (basis.elongation.T * k) @ basis.elongation
    standard = M is basis.M  # the identity
    omega2, phi = eigh(
        K, None if standard else M, check_finite=False, driver="evd" if standard else "gvd"
    )
    return Modes(np.sqrt(np.maximum(omega2, 0.0)), phi)


def sensitivity(
    basis: TuningBasis,
    parameters: Sequence[TuningParameter],
    value: NDArray[np.float64],
    found: Modes,
) -> NDArray[np.float64]:
    """d ln(omega) / d ln(value), (k, p), for the modes given."""
    gradients = [_gradient(basis, p, found) for p in parameters]
    return np.array(gradients).T * value / (2 * found.omega[:, None] ** 2)


def _gradient(basis: TuningBasis, p: TuningParameter, found: Modes) -> NDArray[np.float64]:
    """d omega^2 / d value, (k,)."""
    stretch = basis.elongation[np.isin(basis.spring, p.springs)] @ found.phi
    total = (stretch**2).sum(axis=0)
    for form in (basis.forms[body] for body in p.bodies):
        A, factor = (form.K, 1.0) if p.of == "young" else (form.M, -(found.omega**2))
        total = total + factor * np.sum(found.phi * (A @ found.phi), axis=0)
    return total


def tune(
    basis: TuningBasis,
    parameters: Sequence[TuningParameter],
    target_hz: Mapping[int, float],
    *,
    frequency_error: float = 1e-3,
    regularisation: float = 1e-4,
    n_starts: int = N_STARTS,
    seed: int = 0,
) -> Tuning:
    """Parameters that bring targets {1, 2, ...: Hz} of the basis to their frequencies.

    Least squares in the logarithms, from the start values and from `n_starts - 1` random ones
    within the bounds; a small pull towards the start values decides what the targets leave open.
    `deviation` is the standard deviation of ln(value) for the relative `frequency_error`.
    """
    problem = _Problem(basis, tuple(parameters), target_hz, regularisation)
    starts = problem.starts(n_starts, seed) if parameters else []
    fits = [_fit(problem, start) for start in starts]
    x = min(fits, key=lambda fit: fit.cost).x if fits else np.zeros(0)
    modes_there = spectrum(basis, parameters, np.exp(x))
    index = paired(basis.forms, modes_there, basis.targets).index
    lost = np.where(index < 0, np.nan, 1.0)
    n = len(target_hz)
    residual, J = (
        problem.residual(x)[:n] / frequency_error,
        problem.jacobian(x)[:n] / frequency_error,
    )

    # covariance of ln(value) over the largest deviations that count as determined; where the data
    # say nothing, the bounds do
    prior = problem.prior
    limit = np.minimum(UNSEEN * prior, VAGUE)
    covariance = np.linalg.inv(J.T @ J + np.diag(prior**-2.0)) / np.outer(limit, limit)
    uncertainty = np.sqrt(np.diag(covariance))
    return Tuning(
        problem.parameters,
        np.exp(x),
        lost * modes_there.frequency_hz[index],
        np.where(uncertainty > 1.0, np.inf, uncertainty * limit),
        uncertainty,
        bool(np.linalg.norm(covariance, 2) <= 1.0) if len(x) else True,
        float(residual @ residual),
        modes_there.frequency_hz[: index.max() + 1],
        sum(fit.nfev for fit in fits),
    )


def determined(
    basis: TuningBasis,
    parameters: Sequence[TuningParameter],
    target_hz: Mapping[int, float],
    fit: Tuning,
) -> tuple[TuningParameter, ...]:
    """The parameters, of a fit of all of them, that the targets determine; none where they
    determine none. The others are at the values they had before (`TuningParameter.before`).

    Backward elimination, one parameter at a time. A direction that was rigid, or stiffer than its
    bounds, stays so if the other parameters alone meet the targets as closely (likelihood ratio,
    two standard deviations), even where the fit is definite near its solution: a bolt soft along
    its axis lets a part tilt at the frequency at which one soft across it lets the part slide.
    While a combination is undetermined, the least determined parameter without which the targets
    are still met leaves the fit; where each is needed, the least determined of all.
    """
    while parameters:
        uncertainty = dict(zip([p.name for p in parameters], fit.uncertainty, strict=True))
        least = sorted(parameters, key=lambda p: -uncertainty[p.name])
        rigid = [p for p in least if p.springs and min(p.before) > p.upper]
        elastic = [p for p in least if p not in rigid]
        allowed = fit.misfit + WORSE * max(1.0, fit.misfit / len(target_hz))
        refits = {}
        for left_out in rigid if fit.is_determined else rigid + elastic:
            rest = [p for p in parameters if p is not left_out]
            fixed = at_before(basis, left_out)
            refit = tune(fixed, rest, target_hz)
            refits[left_out.name] = rest, fixed, refit
            if refit.misfit <= allowed:
                break
        else:
            if fit.is_determined:
                break
            left_out = least[0]
        parameters, basis, fit = refits[left_out.name]
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
    rigid = np.isinf(stiffness)
    constraint = basis.elongation[rigid]
    constraint = constraint / np.linalg.norm(constraint, axis=1, keepdims=True)
    Z = _orthonormal(null_space(constraint) if rigid.any() else np.eye(len(M)), M)
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


def _fit(problem: "_Problem", start: NDArray[np.float64]):
    return least_squares(
        problem.residual,
        start,
        problem.jacobian,
        bounds=problem.bounds,
        xtol=1e-10,
        ftol=1e-12,
        gtol=1e-12,
        max_nfev=60,
    )


class _Problem(NamedTuple):
    """Residuals ln(f / target) and weak pulls ln(value / start), in x = ln(value)."""

    basis: TuningBasis
    parameters: tuple[TuningParameter, ...]
    target_hz: Mapping[int, float]
    regularisation: float

    @property
    def bounds(self):
        return np.log([p.lower for p in self.parameters]), np.log(
            [p.upper for p in self.parameters]
        )

    @property
    def prior(self) -> NDArray[np.float64]:
        """Standard deviation of ln(value) that is evenly likely within the bounds."""
        return np.subtract(self.bounds[1], self.bounds[0]) / np.sqrt(12)

    @property
    def start(self) -> NDArray[np.float64]:
        return np.log([p.start for p in self.parameters])

    def starts(self, n: int, seed: int) -> list[NDArray[np.float64]]:
        lower, upper = self.bounds
        random = np.random.default_rng(seed).uniform(lower, upper, (n - 1, len(lower)))
        return [np.clip(self.start, lower, upper), *random]

    def residual(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        f, index, _ = self._matched(x)
        targets = np.array(list(self.target_hz.values()))
        error = np.where(index < 0, UNFITTED, np.log(np.maximum(f, 1e-3) / targets))
        return np.concatenate([error, self.regularisation * (x - self.start)])

    def jacobian(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        _, index, found = self._matched(x)
        some = Modes(found.omega[index], found.phi[:, index])
        J = sensitivity(self.basis, self.parameters, np.exp(x), some)
        J[index < 0] = 0.0
        return np.vstack([J, self.regularisation * np.eye(len(x))])

    def _matched(self, x: NDArray[np.float64]):
        found = spectrum(self.basis, self.parameters, np.exp(x))
        index = paired(self.basis.forms, found, self.basis.targets).index
        index = index[[i - 1 for i in self.target_hz]]
        return found.frequency_hz[index], index, found
