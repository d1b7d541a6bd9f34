"""Frequency responses of a tuning basis, with exact slopes to stiffness, mass and damping.

In the modes phi (m, m), omega of the undamped projection, s = i 2 pi f + a,

    Z(s) = diag(omega^2 + s^2 + s c) + s B^T B,      H = s^power phi_p Z^-1 phi_r^T

with phi_p, phi_r the modes at the points and the references. c holds all damping that is one value
for each mode, B the dashpots, which couple modes:

    c_k = 2 zeta_k omega_k + alpha + beta omega_k^2 + sum_j eta_j phi_k^T K_j phi_k / omega_k

(ratios, Rayleigh, loss factors eta_j of parts with the stiffness K_j). Z^-1 follows from the
diagonal and the few dashpots (Woodbury). Derivatives, of H to any value x, by one product:

    dH/dx = -s^power u_p^T (dK + s^2 dM + s dC) u_r,      Z u = phi^T

where dC of c follows its modes: off the diagonal, with G_kl = (c_k - c_l) / (lambda_k - lambda_l),

    dC_kl = G_kl dK_kl + (c_l - lambda_l G_kl) dM_kl,      dC_kk = dc_k + c_k dM_kk

(first order of modes and their damping: R. L. Fox, M. P. Kapoor, AIAA J. 6 (1968) 2426; divided
differences of a function of a matrix: Yu. L. Daletskii, S. G. Krein 1956). An exponential window
exp(-a t) on force and response makes s = i omega + a.
"""

from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.fem.modes.mac import RIGID, SPRINGS
from beadwave.fem.modes.modes import Modes
from beadwave.fem.updating.tuning import TuningBasis, TuningParameter, spectrum

CLOSE = 1e-9  # of the largest eigenvalue: two nearer ones take the slope of equal ones


class StructureDamping(NamedTuple):
    """Damping of a structure; all parts act together."""

    ratio: tuple[float, ...] = ()  # of modes: one for all, or of those nearest to ratio_hz
    ratio_hz: tuple[float, ...] = ()
    alpha: float = 0.0  # [1/s] of the mass
    beta: float = 0.0  # [s] of the stiffness
    loss: Mapping[str, float] = {}  # loss factors of parts, "materials.steel", "joints.bolts"
    dashpot: Mapping[str, float] = {}  # [N s/m] by the name of the spring, "bolts.kz"
    material: Mapping[str, str] = {}  # that of each body, by which materials are parts


class DampingParameter(NamedTuple):
    """A value of the damping that is fitted."""

    name: str
    kind: Literal["ratio", "alpha", "beta", "loss", "dashpot"]
    key: str | int  # which ratio, part or spring; "" of alpha and beta
    start: float
    lower: float
    upper: float
    before: tuple[float, ...] = ()  # the value that the scene has
    known: None = None  # nothing of it is known without the responses, as a drawing says of springs


Parameter = TuningParameter | DampingParameter


class ResponseModel(NamedTuple):
    """A basis with the places of a test and the damping."""

    basis: TuningBasis
    points: NDArray[np.float64]  # (p, m) displacements at the points, along their directions
    references: NDArray[np.float64]  # (r, m)
    damping: StructureDamping
    # (d, m) elongations of the springs parallel to each dashpot, d equal ones of one name
    rows: Mapping[str, NDArray[np.float64]]
    power: int  # of s: 0 receptance, 1 mobility, 2 accelerance
    shift: float = 0.0  # [1/s] of an exponential window


class ComputedResponses(NamedTuple):
    """Responses at f lines, and their slopes."""

    H: NDArray[np.complex128]  # (p, r, f)
    slopes: NDArray[np.complex128] | None  # (n, p, r, f) dH / d ln(value)
    modes: Modes  # of the undamped projection
    zeta: NDArray[np.float64]  # (m,) damping ratios, dashpots to first order
    zeta_slopes: NDArray[np.float64] | None  # (n, m) d zeta / d ln(value)
    c: NDArray[np.float64]  # (m,) [1/s] of each mode, dashpots left out


def with_dampings(
    damping: StructureDamping, parameters: Sequence[Parameter], value: NDArray[np.float64]
) -> StructureDamping:
    """The damping with the parameters that are its own at their values (n,)."""
    ratio, loss, dashpot = list(damping.ratio), dict(damping.loss), dict(damping.dashpot)
    scalars = {"alpha": damping.alpha, "beta": damping.beta}
    for p, x in zip(parameters, value, strict=True):
        if not isinstance(p, DampingParameter):
            continue
        if p.kind == "ratio":
            ratio[int(p.key)] = float(x)
        elif p.kind in scalars:
            scalars[p.kind] = float(x)
        else:
            (loss if p.kind == "loss" else dashpot)[str(p.key)] = float(x)
    return damping._replace(ratio=tuple(ratio), loss=loss, dashpot=dashpot, **scalars)


def solid_ones(
    parameters: Sequence[Parameter], value: NDArray[np.float64]
) -> tuple[list[TuningParameter], NDArray[np.float64]]:
    """The parameters of stiffness and mass, m of n, and their values (m,) of value (n,)."""
    solid = [isinstance(p, TuningParameter) for p in parameters]
    chosen = [p for p in parameters if isinstance(p, TuningParameter)]
    return chosen, np.asarray(value)[np.array(solid, bool)]


def members(model: ResponseModel, part: str) -> tuple[NDArray[np.bool_], list[str]]:
    """Springs of joints (s,) and bodies that belong to a part: "materials.steel", "joints.bolts" or
    "springs.cord"."""
    kind, _, name = part.partition(".")
    springs = np.array([spring.rpartition(".")[0] == name for spring in model.basis.spring], bool)
    between = [body for body in model.basis.forms if body.startswith(SPRINGS)]
    bodies = {
        "joints": [],
        "materials": [body for body, made_of in model.damping.material.items() if made_of == name],
        "springs": [
            spring for spring in between if spring[len(SPRINGS) :].rpartition(".")[0] == name
        ],
    }[kind]
    return springs & (kind == "joints"), bodies


def part_stiffness(
    model: ResponseModel, part: str, parameters: Sequence[TuningParameter], value: NDArray
) -> NDArray[np.float64]:
    """K_j (m, m) of a part at the values of the parameters."""
    basis, (springs, bodies) = model.basis, members(model, part)
    k, factor = basis.stiffness.copy(), dict.fromkeys(bodies, 1.0)
    for p, x in zip(parameters, value, strict=True):
        k[np.isin(basis.spring, p.springs)] = x
        if p.of == "young":
            factor |= {body: float(x) for body in p.bodies if body in factor}
    K = (basis.elongation[springs].T * k[springs]) @ basis.elongation[springs]
    for body, x in factor.items():
        K = K + x * basis.forms[body].K
    return K


def part_slope(model: ResponseModel, part: str, p: TuningParameter) -> NDArray[np.float64]:
    """dK_j / d value (m, m) of a part by a parameter, of which it may have none."""
    basis, (springs, bodies) = model.basis, members(model, part)
    elongations = basis.elongation[springs & np.isin(basis.spring, p.springs)]
    slope = elongations.T @ elongations
    for body in p.bodies if p.of == "young" else ():
        if body in bodies:
            slope = slope + basis.forms[body].K
    return slope


def response_model(
    basis: TuningBasis,
    damping: StructureDamping,
    power: int,
    shift: float = 0.0,
    stiffness: Mapping[str, float] | None = None,
) -> ResponseModel:
    """The model of a basis whose last two targets are the shapes at the points and at the
    references of a test; power is that of s in the responses, shift [1/s] of an exponential window.

    `stiffness` [N/m], by name, is that of springs between points with a parallel dashpot, which
    turns the spring's energy back into elongations; raises KeyError where one is missing.
    """
    points, references = (np.asarray(one.reading) for one in basis.targets[-2:])
    rows = {}
    for name in damping.dashpot:
        parallel = np.array([spring == name for spring in basis.spring], bool)
        rows[name] = basis.elongation[parallel]
        if (between := f"{SPRINGS}{name}") in basis.forms:
            # their form is k times the sum of squares of elongations, which are its roots
            square, directions = np.linalg.eigh(basis.forms[between].K / (stiffness or {})[name])
            some = square > 1e-12 * square[-1]
            rows[name] = (directions[:, some] * np.sqrt(square[some])).T
    return ResponseModel(basis, points, references, damping, rows, power, shift)


def computed_responses(
    model: ResponseModel,
    parameters: Sequence[Parameter],
    value: NDArray[np.float64],
    frequency_hz: NDArray[np.float64],
    *,
    slopes: bool = False,
) -> ComputedResponses:
    """Responses at the lines (f,) [Hz] at the values (n,) of the parameters; with `slopes` their
    derivatives to the logarithms of the values.

    One eigenproblem of the basis, then products: Z is diagonal but for the d dashpots, whose forces
    are a system (d, d) at each line.
    """
    # modes of the undamped projection at these values
    basis = model.basis
    solid, solid_value = solid_ones(parameters, value)
    damping = with_dampings(model.damping, parameters, value)
    modes = spectrum(basis, solid, solid_value)
    omega, phi = modes.omega, modes.phi
    lam = omega**2
    elastic = omega > RIGID * omega.max()
    root = np.where(elastic, omega, np.inf)  # a rigid motion strains nothing

    # c of each mode: ratios, Rayleigh, loss factors
    zeta = np.zeros(len(omega))
    nearest = np.zeros(len(omega), int)
    if damping.ratio:
        if len(damping.ratio) > 1:
            log = np.log(np.maximum(omega, 1e-300) / (2 * np.pi))
            nearest = np.abs(log[:, None] - np.log(damping.ratio_hz)).argmin(axis=1)
        zeta = np.array(damping.ratio)[nearest]
    zeta = np.where(elastic, zeta, 0.0)
    strain = {
        part: phi.T @ part_stiffness(model, part, solid, solid_value) @ phi for part in damping.loss
    }
    c = 2 * zeta * omega + damping.alpha + damping.beta * lam
    for part, eta in damping.loss.items():
        c = c + eta * np.diag(strain[part]) / root

    # u = Z^-1 phi^T at points and references, (m, f, p + r)
    s = 2j * np.pi * frequency_hz + model.shift
    ends = np.vstack([model.points, model.references]) @ phi
    h = 1.0 / (lam[:, None] + s**2 + s * c[:, None])
    u = h[:, :, None] * ends.T[:, None, :]
    rows = {spring: model.rows[spring] @ phi for spring in damping.dashpot}
    active = [np.sqrt(damping.dashpot[one]) * row for one, row in rows.items()]
    if any(map(np.any, active)):
        B = np.vstack(active)
        inner = np.einsum("dm,mf,em->fde", B, h, B, optimize=True) * s[:, None, None]
        moved = np.einsum("dm,mfn->fdn", B, u, optimize=True) * s[:, None, None]
        force = np.linalg.solve(np.eye(len(B)) + inner, moved)
        u = u - h[:, :, None] * np.einsum("dm,fdn->mfn", B, force, optimize=True)
    n_points = len(model.points)
    scale = s**model.power
    H = np.einsum("pm,mfr->prf", ends[:n_points], u[:, :, n_points:], optimize=True) * scale

    # ratios of the modes, with those of dashpots taken to leave shapes as they are
    of_dashpots = sum((np.sum(row**2, axis=0) for row in active), np.zeros(len(omega)))
    ratios = (c + of_dashpots) / (2 * root)
    if not slopes:
        return ComputedResponses(H, None, modes, ratios, None, c)

    # G_kl = (c_k - c_l) / (lambda_k - lambda_l); of equal eigenvalues its limit dc / d lambda, with
    # ratios and beta (2 zeta omega + beta lambda): zeta / omega + beta
    apart = np.subtract.outer(lam, lam)
    close = np.abs(apart) < CLOSE * lam[-1]
    np.fill_diagonal(apart, 1.0)
    equal = zeta / root + damping.beta
    G = np.where(close, equal[:, None], np.subtract.outer(c, c) / np.where(close, 1.0, apart))
    slope_of = np.where(close, 0.0, 1.0 / np.where(close, 1.0, apart))  # 1 / (lam_k - lam_l)

    u_p = np.ascontiguousarray(u[:, :, :n_points].transpose(1, 2, 0))  # (f, p, m)
    u_r = np.ascontiguousarray(u[:, :, n_points:])
    flat = u_r.reshape(len(omega), -1)

    def product(A: NDArray[np.float64]) -> NDArray[np.complex128]:
        """A (m, m) u_r, (m, f, r), by real products."""
        return (A @ flat.view(float)).view(complex).reshape(u_r.shape)

    C_dashpots = sum((row.T @ row for row in active), np.zeros_like(G))
    result = np.empty((len(parameters), *H.shape), complex)
    zeta_slopes = np.empty((len(parameters), len(omega)))
    for j, (p, x) in enumerate(zip(parameters, value, strict=True)):
        # dZ / d ln(value) = dK + s^2 dM + s dC in the modes
        dK, dM = np.zeros_like(G), np.zeros_like(G)
        if isinstance(p, TuningParameter):
            if p.springs:
                row = basis.elongation[np.isin(basis.spring, p.springs)] @ phi
                dK = x * (row.T @ row)
            for form in (basis.forms[body] for body in p.bodies):
                if p.of == "young":
                    dK = dK + x * (phi.T @ form.K @ phi)
                else:
                    dM = dM + x * (phi.T @ form.M @ phi)
            d_lam = np.diag(dK) - lam * np.diag(dM)
            d_root = d_lam / (2 * root)
            dc = 2 * zeta * d_root + damping.beta * d_lam
            # d phi_k = sum_l phi_l (dK_lk - lam_k dM_lk) / (lam_k - lam_l) - phi_k dM_kk / 2
            mixed = (dK - dM * lam).T * slope_of  # [k, l]
            for part, eta in damping.loss.items():
                S = strain[part]
                dE = x * np.sum(phi * (part_slope(model, part, p) @ phi), axis=0)
                dE = dE + 2 * np.sum(S * mixed, axis=1) - np.diag(S) * np.diag(dM)
                dc = dc + eta * (dE / root - np.diag(S) * d_root / root**2)
            dC = G * dK + (c - lam * G) * dM
            np.fill_diagonal(dC, dc + c * np.diag(dM))
            of_shapes = 2 * np.sum(C_dashpots * mixed, axis=1) - np.diag(C_dashpots) * np.diag(dM)
            zeta_slopes[j] = (dc + of_shapes) / (2 * root) - ratios * d_root / root
        elif p.kind == "dashpot":
            dC = x * (rows[str(p.key)].T @ rows[str(p.key)])
            zeta_slopes[j] = np.diag(dC) / (2 * root)
        else:
            by_mode = lam if p.kind == "beta" else np.ones(len(omega))  # of alpha
            if p.kind == "ratio":
                by_mode = np.where(elastic & (nearest == p.key), 2 * omega, 0.0)
            elif p.kind == "loss":
                by_mode = np.diag(strain[str(p.key)]) / root
            dC = np.diag(x * by_mode)
            zeta_slopes[j] = x * by_mode / (2 * root)
        image = s[:, None] * product(dC)
        if dK.any():
            image = image + product(dK)
        if dM.any():
            image = image + (s**2)[:, None] * product(dM)
        result[j] = -np.matmul(u_p, image.transpose(1, 0, 2)).transpose(1, 2, 0) * scale
    return ComputedResponses(H, result, modes, ratios, zeta_slopes, c)
