"""A driving-point receptance as oscillators that cannot create energy.

    H(omega) = sum_j r_j / (omega_j^2 - omega^2 + 2 i zeta_j omega_j omega) - r_0 / omega^2 + s

With omega_j > 0, zeta_j >= 0 and r_j, r_0, s >= 0 it is what parallel oscillators of masses
1 / r_j, a free mass 1 / r_0 (modes below the band) and a spring of compliance s (modes above it)
do: passive by construction, whatever noise is in the measurement.

Poles are relocated by relaxed vector fitting (B. Gustavsen, IEEE Trans. Power Delivery 21 (2006)
1587; of several responses D. Deschrijver et al., IEEE Microw. Wirel. Compon. Lett. 18 (2008) 383),
residues found by least squares that allow no negative ones (Lawson and Hanson), and both refined
together. The number of modes is that of the lowest Bayesian information criterion
k ln(misfit^2) + p ln k of p parameters and k real numbers fitted, two for each frequency
(G. Schwarz, Ann. Statist. 6 (1978) 461).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import block_diag
from scipy.optimize import least_squares, nnls
from threadpoolctl import threadpool_limits

from beadwave.rom.factorisation import ReductionError


class FitOptions(NamedTuple):
    """How a receptance is fitted."""

    n_modes: tuple[int, ...] = (1, 2, 3, 4, 6, 8, 11, 15, 20, 27, 36, 48)  # numbers tried
    relocations: int = 8  # of the poles; 5 to 12 gave the same modes
    # share of the median response added to each response as its deviation: 0 fits antiresonances,
    # where noise may exceed the response, as closely as resonances
    floor: float = 0.05
    # of the ends of the band, beyond which poles are left to the free mass and to the compliance;
    # with 1.2 modes at 1.4 of the band's end left a misfit of 6e-3, with 3 of 1e-4
    outside: tuple[float, float] = (1.2, 3.0)
    zeta: tuple[float, float] = (1e-6, 0.5)  # of modes; a wider one is no resonance
    better: float = 10.0  # of the criterion, by which more modes must win
    # a free mass is fitted where it lowers the misfit to this share, or less, of that without one:
    # a smaller gain is noise or rounding, and would let a wall drift away that is held
    free: float = 0.9
    patience: int = 2  # numbers of modes tried beyond the lowest criterion
    fine: float = 1e-7  # misfit at which no more modes are tried
    # share of the responses at its own frequency, rms, that a mode makes at least: `peak`, and
    # `shown` more where it is damped by `wide`. Wider poles without a peak stand for another law of
    # damping: of a free beam with a loss factor of 1 % nine lay from 68 to 2925 Hz, damped by 0.3
    # to 0.5 and of shares below 0.05, and what was joined to the fit had modes there
    peak: float = 0.01
    shown: float = 0.3
    wide: float = 0.1
    refined: int = 3  # of the best numbers of modes, whose poles and residues are refined together


class ModalFit(NamedTuple):
    """Modes of a fit and how far it is from the response."""

    omega: NDArray[np.float64]  # (n,) [rad/s]
    zeta: NDArray[np.float64]  # (n,)
    residue: NDArray[np.float64]  # (n,) [1/kg] squares of mass-normalised modes at the point
    inverse_mass: float  # r_0 [1/kg] of the free mass, 0 where the structure is held
    compliance: float  # s [m/N] of the modes above the band
    misfit: float  # root mean square of (H_fit - H) over its deviation
    criterion: float  # Bayesian information criterion, lower is better


def modal_receptance(fit: ModalFit, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
    """H (k,) [m/N] of a fit at frequencies (k,) [Hz] above 0."""
    omega = 2 * np.pi * np.asarray(frequency_hz, float)
    residues = np.concatenate([fit.residue, [fit.inverse_mass, fit.compliance]])
    return _columns(omega, fit.omega, fit.zeta) @ residues


# products of some hundred rows: two threads on busy cores took ten times as long as one
@threadpool_limits.wrap(limits=1, user_api="blas")
def passive_fit(
    frequency_hz: ArrayLike, H: ArrayLike, options: FitOptions = FitOptions()
) -> ModalFit:
    """The oscillators of a driving-point receptance H (k,) [m/N] at frequencies (k,) [Hz].

    The misfit weighs each frequency by |H| and a share of its median, so that resonances and
    antiresonances count alike. Raises ReductionError for fewer than 16 frequencies, for values that
    are not finite or frequencies that do not rise from above 0 Hz, and for a response that is no
    driving point's: its power into the structure, -omega Im H |F|^2 / 2, is negative over much of
    the band.
    """
    f, H = np.asarray(frequency_hz, float), np.asarray(H, complex)
    require_driving_point(f, H)
    omega = 2 * np.pi * f
    deviation = np.abs(H) + options.floor * np.median(np.abs(H))

    # each number of modes, with and without a free mass, residues not negative
    fits: list[ModalFit] = []
    for n in options.n_modes:
        # fewer than four frequencies a mode would fit the noise
        if 4 * n + 6 > len(f):
            break
        start = resonances(omega, H[:, None], deviation[:, None], n, options)
        fixed, free = (
            _shown(
                omega, H, deviation, _with_residues(omega, H, deviation, *start, drifts), options
            )
            for drifts in (False, True)
        )
        is_fixed = fixed.misfit < max(options.fine, free.misfit / options.free)
        fits.append(fixed if is_fixed else free)
        if enough_modes(fits[-1].misfit, [fit.criterion for fit in fits], options):
            break

    # the best of these refined; more parameters only where the criterion says so
    fits.sort(key=lambda fit: fit.criterion)
    refined = [
        _shown(omega, H, deviation, _refined(omega, H, deviation, fit, options), options, True)
        for fit in fits[: options.refined]
    ]
    return simplest(refined, options)


def refitted(
    frequency_hz: ArrayLike, H: ArrayLike, fit: ModalFit, options: FitOptions = FitOptions()
) -> ModalFit:
    """The fit of another response H (k,) [m/N] at frequencies (k,) [Hz] that begins at a fit and
    has as many modes, each frequency within a tenth of what it was."""
    f, H = np.asarray(frequency_hz, float), np.asarray(H, complex)
    deviation = np.abs(H) + options.floor * np.median(np.abs(H))
    return _refined(2 * np.pi * f, H, deviation, fit, options)


def require_driving_point(frequency_hz: NDArray[np.float64], H: NDArray[np.complex128]) -> None:
    """Raises ReductionError unless H (k,) may be a driving point's receptance [m/N].

    There -Im H >= 0 at every frequency: the force's mean power is -omega Im H |F|^2 / 2. Noise may
    break this between resonances, where the power is small; so it is summed. Of a part that hangs
    free the noise of its mass line, 1 / omega^2, outweighs all resonances: sums of Im H and of
    omega^2 Im H must both be wrong.
    """
    if not (np.isfinite(frequency_hz).all() and np.isfinite(H).all()):
        raise ReductionError("it holds NaN or inf; leave those frequencies out")
    if np.any(frequency_hz <= 0) or np.any(np.diff(frequency_hz) <= 0):
        raise ReductionError("its frequencies are not above 0 Hz and increasing; sort them")
    if len(frequency_hz) < 16:
        raise ReductionError(f"it has {len(frequency_hz)} frequencies, at least 16 are needed")
    if not np.any(H):
        raise ReductionError("it is 0 at all frequencies")
    back = []
    for weight in (np.ones(len(H)), frequency_hz**2):
        taken, returned = (np.sum(weight * np.maximum(sign * H.imag, 0)) for sign in (-1, 1))
        back.append(returned / max(taken + returned, 1e-300))
    if min(back) > 1 / 6:
        raise ReductionError(
            f"at its frequencies the structure gives back {min(back):.0%} "
            "of the power, so it is not the response of a driving point: take the sensor at the "
            "hit and along it, and check its sign and unit"
        )


def resonances(
    omega: NDArray[np.float64],
    H: NDArray[np.complex128],
    deviation: NDArray[np.float64],
    n: int,
    options: FitOptions,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """omega_j (j,) [rad/s] and zeta_j (j,) of the `common_poles` in the band and near it, without
    those that are too wide for a resonance: j <= n.

    omega (k,) [rad/s] ascending; H (k, e) are e responses and deviation (k, e) what they are
    weighed by.
    """
    poles = common_poles(omega, H, deviation, n, options)
    omega_j, zeta = np.abs(poles), -poles.real / np.abs(poles)
    low, high = omega[0] / options.outside[0], omega[-1] * options.outside[1]
    resonant = (omega_j > low) & (omega_j < high) & (zeta < options.zeta[1])
    return omega_j[resonant], np.maximum(zeta[resonant], options.zeta[0])


def shows(
    peak: NDArray[np.complex128],
    deviation: NDArray[np.float64],
    zeta: NDArray[np.float64],
    options: FitOptions,
) -> NDArray[np.bool_]:
    """Whether n poles are modes that the measurement shows: at its own frequency each makes enough
    of the responses, the more the wider its peak is. peak (n, e) is what each makes of e responses
    there, over which deviation (n, e) divides; zeta (n,)."""
    share = np.sqrt(np.mean(np.abs(peak / deviation) ** 2, axis=1))
    return share >= options.peak + options.shown * np.minimum(zeta / options.wide, 1.0)


def enough_modes(misfit: float, criteria: list[float], options: FitOptions) -> bool:
    """Whether fits of more and more modes may end: the last misfit is fine, or the criterion has
    not fallen for some numbers of modes."""
    lowest = criteria.index(min(criteria))
    return misfit < options.fine or len(criteria) > lowest + 1 + options.patience


def simplest(fits: list, options: FitOptions):
    """Of fits (ModalFit or MatrixFit) the one of fewest modes whose criterion is as good as the
    lowest."""
    lowest = min(fit.criterion for fit in fits)
    as_good = [fit for fit in fits if fit.criterion < lowest + options.better]
    return min(as_good, key=lambda fit: len(fit.omega))


def common_poles(
    omega: NDArray[np.float64],
    H: NDArray[np.complex128],
    deviation: NDArray[np.float64],
    n_modes: int,
    options: FitOptions,
) -> NDArray[np.complex128]:
    """Poles (n,) of upper half-plane, stable, that all elements H (k, e) share, by relaxed vector
    fitting:

        (sum c_em phi_m + d_e + g_e / s^2) - (sum c~_m phi_m + d~) H_e = 0,   Re sum(sigma) = k

    Coefficients of the elements are eliminated by QR; the zeros of sigma = sum c~_m phi_m + d~ are
    the new poles. omega (k,) [rad/s]; deviation (k, e) weighs the responses. d_e is the compliance
    of modes above the band, g_e / s^2 a free mass.
    """
    # frequencies over the band's end, or powers of s would differ by their units; poles to begin
    # with spread evenly over the band, damped by 1 %
    unit = omega[-1]
    s = 1j * omega / unit
    b = np.linspace(omega[0], omega[-1], n_modes + 2)[1:-1] / unit
    poles = -0.01 * b + 1j * b
    weight = 1 / deviation
    for _ in range(options.relocations):
        # real partial fractions of a pair: c' (1/(s-a) + 1/(s-a*)) + c'' i (1/(s-a) - 1/(s-a*))
        up, down = 1 / (s[:, None] - poles), 1 / (s[:, None] - poles.conj())
        phi = np.stack([up + down, 1j * (up - down)], axis=2).reshape(len(s), -1)
        columns = np.column_stack([phi, np.ones_like(s), 1 / s**2])
        sigma = np.column_stack([phi, np.ones_like(s)])

        # what each element says of sigma once its own coefficients are best
        left = []
        for h, w in zip(H.T, weight.T, strict=True):
            A = np.hstack([columns, -sigma * h[:, None]]) * w[:, None]
            A = np.vstack([A.real, A.imag])
            R = np.linalg.qr(A / np.linalg.norm(A, axis=0).clip(np.finfo(float).tiny), mode="r")
            norms = np.linalg.norm(A, axis=0)[columns.shape[1] :]
            left.append(R[columns.shape[1] :, columns.shape[1] :] * norms)

        # sigma does not vanish: the sum of its real part is k, with the size of the rest
        scale = np.linalg.norm(H * weight) / len(s)
        left.append(scale * sigma.real.sum(axis=0)[None])
        A = np.vstack(left)
        right = np.zeros(len(A))
        right[-1] = scale * len(s)
        norm = np.maximum(np.linalg.norm(A, axis=0), np.finfo(float).tiny)
        x = np.linalg.lstsq(A / norm, right, rcond=None)[0] / norm
        # the zeros go to infinity with d~ -> 0
        c, d = x[:-1], x[-1] if abs(x[-1]) > 1e-8 else 1e-8

        # zeros of sigma: eigenvalues of A - b c^T / d in the real form of the pairs
        state = block_diag(*([[a.real, a.imag], [-a.imag, a.real]] for a in poles))
        state -= np.outer(np.tile([2.0, 0.0], n_modes), c) / d
        zeros = np.linalg.eigvals(state)
        zeros = -np.abs(zeros.real) + 1j * zeros.imag  # stable: mirrored at the imaginary axis

        # pairs; two real zeros become a pair of their mean, of damping ratio 0.45
        upper = zeros[zeros.imag > 0]
        real = np.sort(zeros[zeros.imag == 0].real)[: 2 * (n_modes - len(upper))]
        pairs = real.reshape(-1, 2).mean(axis=1)
        poles = np.concatenate([upper, 0.5 * pairs - 1j * pairs])
    return poles * unit


def _columns(
    omega: NDArray[np.float64], omega_j: NDArray[np.float64], zeta: NDArray[np.float64]
) -> NDArray[np.complex128]:
    """Responses (k, n + 2) of unit residues: the oscillators, the free mass, the compliance."""
    w = omega[:, None]
    modes = 1 / (omega_j**2 - w**2 + 2j * zeta * omega_j * w)
    return np.hstack([modes, -1 / w**2, np.ones_like(w)])


def _weighted(omega, deviation, omega_j, zeta) -> NDArray[np.float64]:
    """_columns over the deviation, real above imaginary parts (2 k, n + 2)."""
    A = _columns(omega, omega_j, zeta) / deviation[:, None]
    return np.vstack([A.real, A.imag])


def _fit(omega_j, zeta, r, residual, free: bool) -> ModalFit:
    """The fit with its misfit and criterion; residual (2 k,), real above imaginary parts, so that
    the mean square of a complex misfit is twice its mean."""
    misfit = np.sqrt(2 * np.mean(residual**2))
    n_parameters = 3 * len(omega_j) + 1 + free
    k = len(residual)
    criterion = k * np.log(max(misfit, 1e-14) ** 2) + n_parameters * np.log(k)
    order, n = np.argsort(omega_j), len(omega_j)
    return ModalFit(
        omega_j[order], zeta[order], r[:n][order], float(r[n]), float(r[n + 1]), float(misfit),
        float(criterion),
    )  # fmt: skip


def _with_residues(omega, H, deviation, omega_j, zeta, free: bool) -> ModalFit:
    """The fit of poles with the best residues that are not negative, by least squares with that
    constraint (Lawson and Hanson); poles of residue 0 go. free: with a free mass."""
    A = _weighted(omega, deviation, omega_j, zeta)
    if not free:
        A[:, -2] = 0.0
    right = np.concatenate([H.real, H.imag]) / np.tile(deviation, 2)
    norm = np.linalg.norm(A, axis=0)
    norm[norm == 0] = 1.0
    r = nnls(A / norm, right, maxiter=50 * len(norm))[0] / norm
    present = r[:-2] > 0
    residues = np.concatenate([r[:-2][present], r[-2:]])
    return _fit(omega_j[present], zeta[present], residues, A @ r - right, free)


def _shown(
    omega, H, deviation, fit: ModalFit, options: FitOptions, refine: bool = False
) -> ModalFit:
    """The fit without poles that the measurement does not show (`shows`), the rest fitted anew."""
    while len(fit.omega):
        line = np.abs(omega[:, None] - fit.omega).argmin(axis=0)
        w, o = omega[line], fit.omega
        peak = fit.residue / (o**2 - w**2 + 2j * fit.zeta * o * w)
        present = shows(peak[:, None], deviation[line][:, None], fit.zeta, options)
        if present.all():
            break
        drifts = fit.inverse_mass > 0
        fit = _with_residues(omega, H, deviation, o[present], fit.zeta[present], drifts)
        fit = _refined(omega, H, deviation, fit, options) if refine else fit
    return fit


def _refined(omega, H, deviation, fit: ModalFit, options: FitOptions) -> ModalFit:
    """All of ln omega, ln zeta and the residues together, by least squares from a fit.

    Logarithms keep omega and zeta positive and alike in size; residues are in units of what they
    make of the response.
    """
    n, free = len(fit.omega), fit.inverse_mass > 0
    if n == 0:
        return fit
    right = np.concatenate([H.real, H.imag]) / np.tile(deviation, 2)
    norm = np.linalg.norm(_weighted(omega, deviation, fit.omega, fit.zeta), axis=0)
    is_fitted = np.concatenate([np.ones(n, bool), [free, True]])

    def model(x):
        """omega_j and zeta (n,) of x = [ln omega, ln zeta, residues over their units], and the
        columns (2 k, n + 2) that these residues multiply; 0 for a free mass that is not fitted."""
        omega_j, zeta = np.exp(x[:n]), np.exp(x[n : 2 * n])
        return omega_j, zeta, _weighted(omega, deviation, omega_j, zeta) * is_fitted / norm

    def residual(x):
        """Misfits over their deviations (2 k,)."""
        return model(x)[2] @ x[2 * n :] - right

    def jacobian(x):
        # of r / D with D = omega_j^2 - w^2 + 2 i zeta omega_j w:
        # d/d ln omega_j = -r (2 omega_j^2 + 2 i zeta omega_j w) / D^2, d/d ln zeta likewise
        omega_j, zeta, A = model(x)
        r, w = x[2 * n : 3 * n] / norm[:n], omega[:, None]
        D2 = (omega_j**2 - w**2 + 2j * zeta * omega_j * w) ** 2 * deviation[:, None]
        of_omega = -r * (2 * omega_j**2 + 2j * zeta * omega_j * w) / D2
        J = np.hstack([of_omega, -r * 2j * zeta * omega_j * w / D2])
        return np.hstack([np.vstack([J.real, J.imag]), A])

    # poles stay near where they were found, so that they do not change places
    ln_omega, ln_zeta = np.log(fit.omega), np.log(fit.zeta)
    r = np.concatenate([fit.residue, [fit.inverse_mass, fit.compliance]]) * norm
    ends = np.log(options.zeta) + np.array([-1e-9, 1e-9])
    low = np.concatenate([ln_omega - 0.1, np.full(n, ends[0]), 0 * r])
    high = np.concatenate([ln_omega + 0.1, np.full(n, ends[1]), np.full(n + 2, np.inf)])
    start = np.concatenate([ln_omega, ln_zeta, r])
    x = least_squares(residual, start, jacobian, bounds=(low, high), max_nfev=60).x
    omega_j, zeta, _ = model(x)
    return _fit(omega_j, zeta, x[2 * n :] / norm * is_fitted, residual(x), free)
