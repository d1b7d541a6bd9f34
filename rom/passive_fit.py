"""Receptances at points of a part, one or several, as oscillators that cannot create energy.

    H(omega) = sum_j phi_j phi_j^T / (omega_j^2 - omega^2 + 2 i zeta_j omega_j omega)
               - B_0 B_0^T / omega^2 + S,        S positive semidefinite

With omega_j > 0 and zeta_j >= 0 this is what modes of mass-normalised shapes phi_j (m,) at the m
points, free masses with shapes B_0 and a massless elastic body of compliance S do together, and
passive by construction: residues are products of a factor with itself, whatever noise is in the
measurement. A part so known is joined in the time domain to matrices of another (`coupled`); a
single driving point, m = 1, is the wall of a chain.

Poles are relocated by relaxed vector fitting (B. Gustavsen, IEEE Trans. Power Delivery 21 (2006)
1587; of several responses D. Deschrijver et al., IEEE Microw. Wirel. Compon. Lett. 18 (2008) 383)
and common to all elements. Residues by least squares are cut to their positive eigenvalues, and
factors, poles and compliance refined together by Gauss and Newton's method. The number of modes is
that of the lowest Bayesian information criterion k ln(misfit^2) + p ln k of p parameters and k real
numbers fitted (G. Schwarz, Ann. Statist. 6 (1978) 461).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import block_diag
from threadpoolctl import threadpool_limits

from beadwave.rom.factorisation import ReductionError

N_MODES = (1, 2, 3, 4, 6, 8, 11, 15, 20, 27, 36, 48)  # numbers tried
LINES_TO_SPARE = 4  # frequencies for each pole of a fit at least; not varied
N_RELOCATIONS = 8  # of the poles; 5 to 12 gave the same modes
# share of the median response added to each response as its deviation: 0 fits antiresonances,
# where noise may exceed the response, as closely as resonances
DEVIATION_FLOOR = 0.05
# of the ends of the band, beyond which poles are left to the free mass and to the compliance;
# with 1.2 modes at 1.4 of the band's end left a misfit of 6e-3, with 3 of 1e-4
OUTSIDE = (1.2, 3.0)
ZETA = (1e-6, 0.5)  # of modes; a wider one is no resonance
BETTER = 10.0  # of the criterion, by which more modes must win
# free masses are fitted where they lower the misfit to this share, or less, of that without them:
# a smaller gain is noise or rounding, and would let a wall drift away that is held
FREE_GAIN = 0.9
PATIENCE = 2  # numbers of modes tried beyond the lowest criterion
FINE_MISFIT = 1e-7  # at which no more modes are tried
N_REFINED = 3  # of the best numbers of modes, whose poles and factors are refined together
# share of the responses at its own frequency, rms, that a mode makes at least, and SHOWN_SHARE more
# where it is damped by WIDE. Wider poles without a peak stand for another law of damping: of a free
# beam with a loss factor of 1 % nine lay from 68 to 2925 Hz, damped by 0.3 to 0.5 and of shares
# below 0.05, and what was joined to the fit had modes there
PEAK_SHARE = 0.01
SHOWN_SHARE = 0.3
WIDE = 0.1
# of the largest eigenvalue of a mode's residue, below which others are noise: two modes of one
# frequency have two that are alike
SECOND = 0.1
SMALLER_SECONDS = (0.01, 0.001)  # tried where the criterion says so
# |H - H^T| over |H|, rms, above which a matrix is no reciprocal structure's
RECIPROCAL = 0.5
# the same of the lines from a frequency on, from which they are called sound. Of hits whose
# receptances differ by 0.66 it is 0.096 from 89 Hz on, 0.017 from 300 Hz; others not tried
SOUND = 0.1
BEYOND = (1.15, 1.6, 2.4)  # of the end of the band, where further poles are tried in the end
SOFTEST = 1e-6  # of the largest eigenvalue of the compliance and of free masses
# share of a free mass in the responses at the lowest line, rms, below which it is not shown: of a
# free beam in two rigid motions a third had up to 2e-3, of twelve points in six the smallest 6e-3
MASS_SHARE = 0.003
# combinations of points by which poles are found, the largest of the responses, where there are
# more points; all modes show in them
N_COMBINED = 6
N_LINES = 500  # at which many points are fitted, at most, those near resonances first
N_SEARCHED = 800  # lines at which the number of modes is searched, at most
MAX_STEPS = 60  # of the refinement
FIRST_DAMPING = 1e-3  # of its first step, relative to the diagonal of the normal matrix
STILL_GAIN = 1e-7  # of two steps, relative, at which it ends


class ModalFit(NamedTuple):
    """Modes of a part at m points, and how far they are from its receptances."""

    omega: NDArray[np.float64]  # (n,) [rad/s]
    zeta: NDArray[np.float64]  # (n,)
    phi: NDArray[np.float64]  # (m, n) [kg^-1/2, rad kg^-1/2 ...] mass-normalised shapes
    free: NDArray[np.float64]  # (m, k) B_0, shapes of free masses; k = 0 of a part that is held
    compliance: NDArray[np.float64]  # (m, m) S of the modes above the band
    misfit: float = 0.0  # root mean square of (H_fit - H) over its deviation
    error: float = 0.0  # rms of |H_fit - H| over that of |H|, points scaled to be alike
    asymmetry: float = 0.0  # the same of (H - H^T) / 2, which no reciprocal part has
    criterion: float = 0.0  # Bayesian information criterion, lower is better
    # whether omega, zeta and phi are those of loss factors 2 zeta, with which the responses agree
    # better; the fit itself is viscous, alike at resonances
    hysteretic: bool = False


class Elements(NamedTuple):
    """The upper triangle of a symmetric matrix of responses, element by element, row by row."""

    omega: NDArray[np.float64]  # (k,) [rad/s]
    H: NDArray[np.complex128]  # (k, e), e = m (m + 1) / 2 of m points
    deviation: NDArray[np.float64]  # (k, e) by which misfits are divided
    hysteretic: bool = False  # damping by loss factors, omega_j^2 (1 + 2 i zeta_j)

    def denominators(
        self, omega_j: NDArray[np.float64], zeta: NDArray[np.float64]
    ) -> NDArray[np.complex128]:
        """omega_j^2 - omega^2 + 2 i zeta_j omega_j omega of n poles, (k, n); of loss factors with
        omega_j in place of the last omega."""
        w = self.omega[:, None]
        loss = omega_j if self.hysteretic else w
        return omega_j**2 - w**2 + 2j * zeta * omega_j * loss

    def static_loss(self, zeta: NDArray[np.float64]) -> complex:
        """1 + 2 i zeta by which the modes above the band divide their compliance, damped as those
        within it are in the median; 1 of viscous damping, which is nothing there."""
        return 1 + 2j * float(np.median(zeta)) if self.hysteretic and len(zeta) else 1.0


def modal_receptance(fit: ModalFit, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
    """H (k, m, m) [m/N, rad/N, rad/(N m)] of a fit at frequencies (k,) [Hz] above 0."""
    w = 2 * np.pi * np.asarray(frequency_hz, float)[:, None]
    resonance = 1 / (fit.omega**2 - w**2 + 2j * fit.zeta * fit.omega * w)
    H = np.einsum("kn,an,bn->kab", resonance, fit.phi, fit.phi)
    return H - (fit.free @ fit.free.T) / w[:, :, None] ** 2 + fit.compliance


# products of some hundred rows: two threads on busy cores took ten times as long as one
@threadpool_limits.wrap(limits=1, user_api="blas")
def passive_fit(
    frequency_hz: ArrayLike,
    H: ArrayLike,
    *,
    most_free: int = 6,
) -> ModalFit:
    """The oscillators of receptances H (k, m, m) [m/N, rad/N, rad/(N m)] at frequencies (k,) [Hz],
    or of the H (k,) of a single driving point.

    The misfit weighs each response by its size and a share of its median, so that resonances and
    antiresonances count alike. `most_free` is the largest number of free masses: in how many ways
    the points can move rigidly, 0 of a part that is held; one more, which noise makes, would be a
    mode of what the part is joined to.

    Residues of least squares may be indefinite where noise outweighs a mode; a factor phi phi^T
    cannot be. Raises ReductionError for what is no receptance of a passive part: another shape, a
    diagonal that is no driving point's (`require_driving_point`), or a matrix that is not
    symmetric.
    """
    f, H = np.asarray(frequency_hz, float), np.asarray(H, complex)
    H = H[:, None, None] if H.ndim == 1 else H
    m = H.shape[1] if H.ndim == 3 else 0
    if H.shape != (len(f), m, m) or not m:
        raise ReductionError(
            f"receptances of shape {H.shape} at {len(f)} frequencies are no (k, m, m): give a row "
            "and a column for each point"
        )
    for a in range(m):
        try:
            require_driving_point(f, H[:, a, a])
        except ReductionError as why:
            raise ReductionError(f"of point {a + 1}: {why}" if m > 1 else str(why)) from None

    # points scaled to be alike, or a turn [rad] next to a displacement [m] would count for nothing;
    # then the mean of H and its transpose, which a reciprocal part has equal
    size, scaled, elements = _alike(H)
    require_reciprocal(f, scaled)
    deviation = _deviation(elements)
    omega = 2 * np.pi * f
    measured = Elements(omega, elements, deviation)

    # of many points poles from a few combinations, then all factors at fewer lines
    if m > N_COMBINED:
        lines = scaled / np.linalg.norm(scaled, axis=(1, 2), keepdims=True)
        stacked = np.concatenate([lines.real, lines.imag]).reshape(-1, m)
        # turned at random: along the singular vectors themselves responses of one to a force on
        # another are small, and their relative errors lead the search for poles astray
        W = np.linalg.svd(stacked, full_matrices=False)[2][:N_COMBINED].T
        W = W @ np.linalg.qr(np.random.default_rng(0).standard_normal((W.shape[1],) * 2))[0]
        few = passive_fit(f, W.T @ scaled @ W, most_free=most_free)
        at = _lines_kept(omega, few, N_LINES)
        thinned = Elements(omega[at], elements[at], deviation[at], few.hysteretic)
        of_fit = most_free if few.free.size else 0
        fit = _with_factors(thinned, *_poles(few), of_fit, refine=True)
        return _in_units(fit, f, scaled, size)

    # the number of modes is searched at some lines, those where the responses bend first
    at = _lines_that_bend(elements, deviation, N_SEARCHED)
    searched = Elements(omega[at], elements[at], deviation[at])

    # each number of modes: common poles, then factors, with and without free masses. A free mass
    # that only follows the noise would let a part drift away that is held: it has to win clearly
    fits: list[ModalFit] = []
    for n in N_MODES:
        if LINES_TO_SPARE * n + 6 > len(at):
            break
        start = resonances(*searched[:3], n)
        fixed = _with_shown_factors(searched, *start, most_free=0)
        is_fixed = most_free == 0
        if not is_fixed:
            free = _with_shown_factors(searched, *start, most_free)
            is_fixed = fixed.misfit < max(FINE_MISFIT, free.misfit / FREE_GAIN)
        fits.append(fixed if is_fixed else free)
        criteria = [fit.criterion for fit in fits]
        is_past_lowest = len(criteria) > criteria.index(min(criteria)) + 1 + PATIENCE
        if fits[-1].misfit < FINE_MISFIT or is_past_lowest:
            break

    lowest = min(fits, key=lambda fit: fit.criterion)

    def refined(
        lines: Elements, omega_j: NDArray, zeta: NDArray, fit: ModalFit, second: float = SECOND
    ) -> ModalFit:
        """The fit from these poles (n,), all of its values together, with free masses if `fit` has
        some."""
        free = most_free if fit.free.size else 0
        return _with_shown_factors(lines, omega_j, zeta, free, second, refine=True)

    # viscous damping or loss factors, by which zeta of a resonance differs where lines next to it
    # outnumber its own
    laws = (searched, searched._replace(hysteretic=True))
    viscous, by_loss = (refined(law, *_poles(lowest), lowest).criterion for law in laws)
    hysteretic = by_loss < viscous - BETTER
    searched, measured = (one._replace(hysteretic=hysteretic) for one in (searched, measured))

    # the best of these refined; of these the one of fewest modes that is as good
    fits.sort(key=lambda fit: fit.criterion)
    best = [refined(searched, *_poles(fit), fit) for fit in fits[:N_REFINED]]
    limit = min(fit.criterion for fit in best) + BETTER
    fit = min((fit for fit in best if fit.criterion < limit), key=lambda fit: len(fit.omega))

    # modes above the band that the compliance does not stand for; it keeps its rank, since points
    # without a compliance of their own cannot be joined rigidly
    for beyond in BEYOND:
        omega_j, zeta = _poles(fit)
        if len(zeta):
            omega_j = np.append(omega_j, beyond * omega[-1])
            more = refined(searched, omega_j, np.append(zeta, np.median(zeta)), fit)
            soft = [np.linalg.eigvalsh(one.compliance) for one in (fit, more)]
            before, after = (np.sum(s > SOFTEST * s[-1]) for s in soft)
            if more.criterion < fit.criterion - BETTER and after >= before:
                fit = more

    # modes that the noise made, the smallest first by its peak, |phi|^2 / (2 zeta omega^2): without
    # them the criterion is as good
    while len(fit.omega) > 1:
        omega_j, zeta = _poles(fit)
        height = [
            np.sum(fit.phi[:, fit.omega == o] ** 2) / (2 * z * o**2)
            for o, z in zip(omega_j, zeta, strict=True)
        ]
        others = np.arange(len(omega_j)) != int(np.argmin(height))
        fewer = refined(searched, omega_j[others], zeta[others], fit)
        if fewer.criterion > fit.criterion + BETTER:
            break
        fit = fewer

    # two modes of one frequency where the second moves these points little
    second = SECOND
    for smaller in SMALLER_SECONDS:
        free = most_free if fit.free.size else 0
        of_two_shapes = _with_factors(searched, *_poles(fit), free, smaller, refine=True)
        if of_two_shapes.criterion < fit.criterion - BETTER:
            fit, second = of_two_shapes, smaller

    # at all lines, from where the search has ended
    if len(at) < len(f):
        fit = refined(measured, *_poles(fit), fit, second)
    return _in_units(fit, f, scaled, size)


@threadpool_limits.wrap(limits=1, user_api="blas")
def refitted(frequency_hz: ArrayLike, H: ArrayLike, fit: ModalFit) -> ModalFit:
    """The oscillators of other receptances (k, m, m) or (k,) of the same part at frequencies (k,)
    [Hz], from the poles of a fit: what noise, or another band, makes of it.

    It has no more free masses than the fit, and each pole stays within a tenth of its frequency.
    """
    f, H = np.asarray(frequency_hz, float), np.asarray(H, complex)
    size, scaled, elements = _alike(H[:, None, None] if H.ndim == 1 else H)
    omega = 2 * np.pi * f
    at = _lines_kept(omega, fit, N_LINES)
    measured = Elements(omega[at], elements[at], _deviation(elements[at]), fit.hysteretic)
    again = _with_factors(measured, *_poles(fit), fit.free.shape[1], refine=True)
    return _in_units(again, f, scaled, size)


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
        absorbed, returned = (np.sum(weight * np.maximum(sign * H.imag, 0)) for sign in (-1, 1))
        back.append(returned / max(absorbed + returned, 1e-300))
    if min(back) > 1 / 6:
        raise ReductionError(
            f"at its frequencies the structure gives back {min(back):.0%} "
            "of the power, so it is not the response of a driving point: take the sensor at the "
            "hit and along it, and check its sign and unit"
        )


def require_reciprocal(f: NDArray[np.float64], scaled: NDArray[np.complex128]) -> None:
    """Raise ReductionError where receptances (k, m, m) at f (k,) [Hz] differ from their transposes
    by more than `reciprocal`, naming the line from which they do not, where there is one in the
    lower half of the band.

    A linear structure without gyroscopic forces is reciprocal, H = H^T (Maxwell and Betti); noise,
    or points in another order, are not.
    """
    asymmetry = _asymmetry(scaled)
    if asymmetry > RECIPROCAL:
        # noise near 0 Hz divided by omega^2 outweighs all else: the same of the lines from each on
        differing = np.sum(np.abs(scaled - scaled.swapaxes(1, 2)) ** 2, axis=(1, 2))
        square = np.sum(np.abs(scaled) ** 2, axis=(1, 2))
        from_here = np.sqrt(np.cumsum(differing[::-1]) / np.cumsum(square[::-1]))[::-1]
        alike = np.flatnonzero(from_here[: len(f) // 2] < SOUND)
        if alike.size:
            first = alike[0]
            raise ReductionError(
                f"H and its transpose differ by {asymmetry:.0%} of H, which a structure has alike, "
                f"but by {from_here[first]:.1%} from {f[first]:.4g} Hz on: lines near 0 Hz "
                f"are noise; leave them out, by lowest = {f[first]:.4g} Hz"
            )
        raise ReductionError(
            f"H and its transpose differ by {asymmetry:.0%} of H, which a structure has alike: "
            "check that rows and columns name the same points in one order, with one sign each"
        )


def _alike(
    H: NDArray[np.complex128],
) -> tuple[NDArray[np.float64], NDArray[np.complex128], NDArray[np.complex128]]:
    """Sizes (m,) of the points, the square root of the median of |H_aa|, since displacements and
    turns have different units; H (k, m, m) divided by those of both points; and the upper triangle
    (k, e) of the mean of that and its transpose."""
    size = np.sqrt(np.median(np.abs(np.einsum("kaa->ka", H)), axis=0))
    scaled = H / np.outer(size, size)
    rows, columns = np.triu_indices(H.shape[1])
    return size, scaled, (scaled + scaled.swapaxes(1, 2))[:, rows, columns] / 2


def _asymmetry(scaled: NDArray[np.complex128]) -> float:
    """|H - H^T| over |H|, rms, of receptances (k, m, m)."""
    total = np.sqrt(np.mean(np.abs(scaled) ** 2))
    return float(np.sqrt(np.mean(np.abs(scaled - scaled.swapaxes(1, 2)) ** 2)) / total)


def _deviation(elements: NDArray[np.complex128]) -> NDArray[np.float64]:
    """By which elements (k, e) are weighed: their size, and a share of its median; at least a
    thousandth of that share of a scaled diagonal, for an element that is 0 at all frequencies."""
    size = np.abs(elements)
    return size + DEVIATION_FLOOR * np.median(size, axis=0) + DEVIATION_FLOOR * 1e-3


def _lines_kept(omega: NDArray[np.float64], fit: ModalFit, most: int) -> NDArray[np.int64]:
    """Indices of `most` lines omega (k,) [rad/s] at most: half of them near resonances, the others
    evenly."""
    if len(omega) <= most:
        return np.arange(len(omega))
    # distance from each resonance in half-power half-widths, zeta omega_j
    away = np.abs(omega[:, None] - fit.omega) / np.maximum(fit.zeta * fit.omega, 1e-9 * fit.omega)
    near = np.sort(np.argsort(away.min(axis=1))[: most // 2])
    even = np.linspace(0, len(omega) - 1, most - len(near)).round().astype(int)
    return np.union1d(near, even)


def _lines_that_bend(
    elements: NDArray[np.complex128], deviation: NDArray[np.float64], most: int, width: int = 7
) -> NDArray[np.int64]:
    """Indices of `most` lines of elements (k, e) at most: half of them where the responses change
    most from line to line, by a mean over `width` lines, the others evenly."""
    n = len(elements)
    if n <= most:
        return np.arange(n)
    change = np.max(np.abs(np.gradient(elements, axis=0)) / deviation, axis=1)
    smooth = np.convolve(change, np.ones(width) / width, mode="same")
    steepest = np.argsort(smooth)[-(most // 2) :]
    even = np.linspace(0, n - 1, most - len(steepest)).round().astype(int)
    return np.union1d(steepest, even)


def _in_units(
    fit: ModalFit,
    f: NDArray[np.float64],
    scaled: NDArray[np.complex128],
    size: NDArray[np.float64],
) -> ModalFit:
    """A fit of receptances (k, m, m) over sizes (m,) of both points in the units of the points,
    with its error against the mean of H and its transpose, and how far H is from that."""
    total = np.sqrt(np.mean(np.abs(scaled) ** 2))
    missed = modal_receptance(fit, f) - (scaled + scaled.swapaxes(1, 2)) / 2
    return fit._replace(
        phi=fit.phi * size[:, None],
        free=fit.free * size[:, None],
        compliance=fit.compliance * np.outer(size, size),
        error=float(np.sqrt(np.mean(np.abs(missed) ** 2)) / total),
        asymmetry=_asymmetry(scaled) / 2,
    )


def resonances(
    omega: NDArray[np.float64],
    H: NDArray[np.complex128],
    deviation: NDArray[np.float64],
    n: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """omega_j (j,) [rad/s] and zeta_j (j,) of the `common_poles` in the band and near it, without
    those that are too wide for a resonance: j <= n.

    omega (k,) [rad/s] ascending; H (k, e) are e responses and deviation (k, e) what they are
    weighed by.
    """
    poles = common_poles(omega, H, deviation, n)
    omega_j, zeta = np.abs(poles), -poles.real / np.abs(poles)
    low, high = omega[0] / OUTSIDE[0], omega[-1] * OUTSIDE[1]
    resonant = (omega_j > low) & (omega_j < high) & (zeta < ZETA[1])
    return omega_j[resonant], np.maximum(zeta[resonant], ZETA[0])


def common_poles(
    omega: NDArray[np.float64],
    H: NDArray[np.complex128],
    deviation: NDArray[np.float64],
    n_modes: int,
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
    for _ in range(N_RELOCATIONS):
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


def shows(
    peak: NDArray[np.complex128],
    deviation: NDArray[np.float64],
    zeta: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """True for those of n poles that are modes which the measurement shows: at its own frequency
    each makes enough of the responses, the more the wider its peak is. peak (n, e) is what each
    makes of e responses there, over which deviation (n, e) divides; zeta (n,)."""
    share = np.sqrt(np.mean(np.abs(peak / deviation) ** 2, axis=1))
    return share >= PEAK_SHARE + SHOWN_SHARE * np.minimum(zeta / WIDE, 1.0)


def _with_shown_factors(
    measured: Elements,
    omega_j: NDArray[np.float64],
    zeta: NDArray[np.float64],
    most_free: int,
    second: float = SECOND,
    *,
    refine: bool = False,
) -> ModalFit:
    """The fit `_with_factors` of those poles and free masses that the measurement shows (`shows`):
    others go, and the rest is fitted anew."""
    rows, columns = np.triu_indices(int((np.sqrt(8 * measured.H.shape[1] + 1) - 1) / 2))
    while True:
        fit = _with_factors(measured, omega_j, zeta, most_free, second, refine=refine)
        omega_j, zeta = _poles(fit)
        line = np.abs(measured.omega[:, None] - omega_j).argmin(axis=0)
        residues = [fit.phi[:, fit.omega == o] for o in omega_j]
        peak = np.array([np.sum(F[rows] * F[columns], axis=1) for F in residues])
        D = np.diag(measured.denominators(omega_j, zeta)[line])
        peak = peak.reshape(len(omega_j), len(rows)) / D[:, None]
        present = shows(peak, measured.deviation[line], zeta)

        # a free mass at the lowest line: one that is not shown would be a mode at 0 Hz of what is
        # joined
        U, sizes, _ = np.linalg.svd(fit.free, full_matrices=False)
        inertia = (U * sizes)[rows] * (U * sizes)[columns] / measured.omega[0] ** 2
        share = np.sqrt(np.mean(np.abs(inertia.T / measured.deviation[0]) ** 2, axis=1))
        n_free = np.count_nonzero(share >= MASS_SHARE)
        if present.all() and n_free == len(share):
            return fit
        most_free = n_free
        omega_j, zeta = omega_j[present], zeta[present]


def _factor(residue: NDArray[np.float64], least: float) -> NDArray[np.float64]:
    """L (m, r) with L L^T nearest to a symmetric residue (m, m), of eigenvalues above `least` times
    the largest; r = 0 where none is positive."""
    values, vectors = np.linalg.eigh(residue)
    positive = values > max(least * values[-1], 0.0)
    return vectors[:, positive] * np.sqrt(values[positive])


def _poles(fit: ModalFit) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """omega, zeta (n,) of a fit, each once: a pole of two shapes stands twice."""
    omega, first = np.unique(fit.omega, return_index=True)
    return omega, fit.zeta[first]


def unconstrained_residues(
    measured: Elements, omega_j: NDArray[np.float64], zeta: NDArray[np.float64], drifts: bool
) -> NDArray[np.float64]:
    """Residues (n + 1 or 2, m, m) of the poles omega_j (n,) [rad/s] and zeta (n,), of the
    compliance and, where the part `drifts`, of its free masses: linear least squares, element by
    element, with no bound on what is positive.

    Symmetric by construction: an element and its mirror have one residue.
    """
    omega, H, deviation, _ = measured
    e = H.shape[1]
    m = int((np.sqrt(8 * e + 1) - 1) / 2)
    rows, columns = np.triu_indices(m)
    w = omega[:, None]
    D = 1 / measured.denominators(omega_j, zeta)
    static = np.ones_like(w) / measured.static_loss(zeta)
    lines = np.hstack([D, static, *([-1 / w**2] if drifts else [])])
    residues = np.zeros((lines.shape[1], e))
    for i in range(e):
        A = lines / deviation[:, [i]]
        A = np.vstack([A.real, A.imag])
        norm = np.linalg.norm(A, axis=0)
        right = np.concatenate([H[:, i].real, H[:, i].imag]) / np.tile(deviation[:, i], 2)
        residues[:, i] = np.linalg.lstsq(A / norm, right, rcond=None)[0] / norm
    square = np.zeros((len(residues), m, m))
    square[:, rows, columns] = square[:, columns, rows] = residues
    return square


def _with_factors(
    measured: Elements,
    omega_j: NDArray[np.float64],
    zeta: NDArray[np.float64],
    most_free: int,
    second: float = SECOND,
    *,
    refine: bool = False,
) -> ModalFit:
    """Factors by least squares and their positive part, then to `refine` ln omega, ln zeta and all
    factors together.

    omega_j (n,) [rad/s] and zeta (n,) are the poles to begin with, `most_free` the largest number
    of free masses. Of the fit returned error and asymmetry are nan, and points are in the units of
    `measured`.
    """
    omega, H, deviation, hysteretic = measured
    e = H.shape[1]
    m = int((np.sqrt(8 * e + 1) - 1) / 2)
    rows, columns = np.triu_indices(m)
    w = omega[:, None]

    # residues that least squares gives, then factors L (m, r) of their positive part, L L^T being
    # the nearest matrix of a passive part; one oscillator for each column of a mode's
    square = unconstrained_residues(measured, omega_j, zeta, most_free > 0)
    n = len(omega_j)
    of_modes = [_factor(R, second) for R in square[:n]]
    of_rest = [_factor(R, SOFTEST) for R in square[n:]]  # compliance, then free masses
    of_rest[1:] = [L[:, -most_free:] for L in of_rest[1:]]  # ascending: the largest

    # pole_of: the pole of each oscillator; poles without a positive residue are dropped, and a pole
    # of two columns is a pair of modes of one frequency
    pole_of = np.repeat(np.arange(n), [L.shape[1] for L in of_modes])
    present = np.unique(pole_of)
    omega_j, zeta = omega_j[present], zeta[present]
    pole_of = np.searchsorted(present, pole_of)
    L = np.hstack([*of_modes, *of_rest])
    n, n_osc, n_s = len(omega_j), len(pole_of), of_rest[0].shape[1]
    right = np.concatenate([H.real, H.imag])
    both = np.vstack([deviation, deviation])

    static_loss = measured.static_loss(zeta)

    # unknowns x = [ln omega (n), ln zeta (n), factors (m, n_l)], each factor in units of what it
    # makes of the response, so that one damping of the normal equations fits all
    def terms(ln_omega: NDArray[np.float64], ln_zeta: NDArray[np.float64]):
        """Frequency functions (k, n_l) of the factors' columns."""
        resonance = 1 / measured.denominators(np.exp(ln_omega)[pole_of], np.exp(ln_zeta)[pole_of])
        n_free = L.shape[1] - n_osc - n_s
        static = np.ones_like(w) / static_loss
        return np.hstack([resonance, np.tile(static, n_s), np.tile(-1 / w**2, n_free)])

    start_terms = terms(np.log(omega_j), np.log(zeta))
    unit = np.sqrt(np.median(np.abs(H)) / np.abs(start_terms).max(axis=0))  # (n_l,)

    def parts(x: NDArray[np.float64]):
        """Frequency functions (k, n_l) and factors (m, n_l): H_ac = sum_l g_l F_al F_cl."""
        g = terms(x[:n], x[n : 2 * n])
        return g, x[2 * n :].reshape(m, -1) * unit

    def residual(x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Misfits over their deviations (2 k e,), real above imaginary parts."""
        g, F = parts(x)
        fitted = g @ (F[rows] * F[columns]).T  # (k, e)
        return ((np.concatenate([fitted.real, fitted.imag]) - right) / both).ravel()

    def normal(x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """J^T J and J^T r, element by element: each depends on two rows of the factors alone, and J
        itself (2 k e, x) would be too large for memory with many points."""
        # d/d ln omega_j of 1 / D is -(2 omega_j^2 + 2 i zeta omega_j w) / D^2, and
        # d/d ln zeta_j is -2 i zeta omega_j w / D^2, D = omega_j^2 - w^2 + 2 i zeta omega_j w; of
        # loss factors omega_j^2 stands for omega_j w
        g, F = parts(x)
        o, z, n_l = np.exp(x[:n]), np.exp(x[n : 2 * n]), F.shape[1]
        by_pole = np.zeros((2, len(omega), n_osc), complex)  # slopes to ln omega and ln zeta
        for i, (j, resonance) in enumerate(zip(pole_of, g[:, :n_osc].T, strict=True)):
            loss = 2j * z[j] * o[j] * (o[j] if hysteretic else omega)
            by_pole[0, :, i] = -(resonance**2) * (2 * o[j] ** 2 + (1 + hysteretic) * loss)
            by_pole[1, :, i] = -(resonance**2) * loss
        to_pole = np.zeros((n_osc, n))
        to_pole[np.arange(n_osc), pole_of] = 1.0
        A, b = np.zeros((len(x), len(x))), np.zeros(len(x))
        for i, (a, c) in enumerate(zip(rows, columns, strict=True)):
            # H_ac = sum_l g_l F_al F_cl: slopes to the poles, then to F_al and to F_cl
            product = F[a] * F[c]
            of_poles = [(d * product[:n_osc]) @ to_pole for d in by_pole]
            of_factors = [g * (F[c] * unit), g * (F[a] * unit)]
            J = np.hstack([*of_poles, *of_factors]) / deviation[:, [i]]
            J = np.vstack([J.real, J.imag])
            r = (g @ product - H[:, i]) / deviation[:, i]
            r = np.concatenate([r.real, r.imag])
            first = 2 * n + n_l * np.array([a, c])
            at = np.concatenate([np.arange(2 * n), *(f + np.arange(n_l) for f in first)])
            np.add.at(A, (at[:, None], at), J.T @ J)  # of a diagonal element both rows are one
            np.add.at(b, at, J.T @ r)
        return A, b

    # poles stay near where they were found, so that they do not change places
    x = np.concatenate([np.log(omega_j), np.log(zeta), (L / unit).ravel()])
    if refine and len(omega_j):
        ends = np.log(ZETA) + np.array([-1e-9, 1e-9])
        low, high = np.full((2, len(x)), np.inf) * np.array([[-1.0], [1.0]])
        low[:n], high[:n] = x[:n] - 0.1, x[:n] + 0.1
        low[n : 2 * n], high[n : 2 * n] = ends

        # Levenberg and Marquardt, steps cut at the bounds: damping falls by 8 with a step that
        # gains and rises by 8 with one that does not
        damping, cost, still = FIRST_DAMPING, np.sum(residual(x) ** 2), 0
        A, b = normal(x)
        for _ in range(MAX_STEPS):
            # values at a bound that would go on beyond it stay
            free = ~((x <= low) & (b > 0) | (x >= high) & (b < 0))
            of_free = A[np.ix_(free, free)]
            diagonal = np.diag(of_free)
            step = np.zeros(len(x))
            step[free] = np.linalg.solve(
                of_free + np.diag(damping * (diagonal + 1e-12 * diagonal.mean())), b[free]
            )
            trial = np.clip(x - step, low, high)
            trial_cost = np.sum(residual(trial) ** 2)
            if not trial_cost < cost:
                damping *= 8
                if damping > 1e6:
                    break
                continue
            still = still + 1 if trial_cost > (1 - STILL_GAIN) * cost else 0
            x, cost, damping = trial, trial_cost, max(damping / 8, 1e-12)
            if still == 2:
                break
            A, b = normal(x)

    # misfit and criterion of k real numbers and 2 n + F.size parameters; the compliance as S S^T
    _, F = parts(x)
    k = 2 * len(omega) * e
    misfit = float(np.sqrt(2 * np.mean(residual(x) ** 2)))
    criterion = k * np.log(max(misfit, 1e-14) ** 2) + (2 * n + F.size) * np.log(k)
    o, z = np.exp(x[:n])[pole_of], np.exp(x[n : 2 * n])[pole_of]
    order = np.argsort(o)
    S = F[:, n_osc : n_osc + n_s]
    return ModalFit(
        o[order], z[order], F[:, :n_osc][:, order], F[:, n_osc + n_s :], S @ S.T, misfit, np.nan,
        np.nan, float(criterion), hysteretic,
    )  # fmt: skip


class CoupledMatrices(NamedTuple):
    """A structure joined to a measured part: M q'' + C q' + K q = f."""

    M: NDArray[np.float64]  # (r, r)
    C: NDArray[np.float64]  # (r, r)
    K: NDArray[np.float64]  # (r, r)
    part: NDArray[np.float64]  # (m, r) reads the part's points beyond the joint, without S
    n: int  # the first coordinates are those of the structure


def coupled(
    K: ArrayLike,
    M: ArrayLike,
    C: ArrayLike | None,
    B: ArrayLike,
    fit: ModalFit,
    stiffness: ArrayLike = np.inf,
) -> CoupledMatrices:
    """Matrices of a structure K, M, C (n, n), that is joined at u = B q (m points, B (m, n)) to a
    part known by a fit, through springs `stiffness` (m,) [N/m, N m/rad], rigid without any.

        K' = diag(K, omega^2, 0) + D^T K_j D,   D = [B, -phi, -B_0],   M' = diag(M, 1, 1)

    The springs and the part's compliance S are in series, K_j = (1 / k + S)^-1: symmetric and
    positive, so that joined matrices conserve or lose energy. Raises ReductionError for a B that
    does not fit, for a stiffness that is not above 0, and where a rigid joint meets a point without
    a compliance of its own.
    """
    K, M, B = (np.asarray(A, float) for A in (K, M, B))
    C = np.zeros_like(K) if C is None else np.asarray(C, float)
    m = len(fit.compliance)
    if B.shape != (m, len(K)):
        raise ReductionError(f"B {B.shape} does not join {m} points to {len(K)} unknowns")
    k = np.broadcast_to(np.asarray(stiffness, float), m)
    if not np.all(k > 0):
        raise ReductionError(f"stiffness {k.tolist()} must be above 0; inf is rigid")

    # compliance of joint and part in series, judged on a unit diagonal: points that move and points
    # that turn have other units
    Y = fit.compliance + np.diag(1 / k)
    scale = np.sqrt(np.diag(Y))
    if not np.all(scale > 0) or np.linalg.cond(Y / np.outer(scale, scale)) > 1e12:
        raise ReductionError(
            "the part has no compliance beyond its modes in some direction, where a rigid joint "
            "would leave no displacement of its own: give the joints a stiffness"
        )

    # coordinates: those of the structure, the part's modes, its free masses, which have omega = 0
    Kj = np.linalg.inv(Y)
    part = np.hstack([fit.phi, fit.free])
    omega = np.append(fit.omega, np.zeros(fit.free.shape[1]))
    zeta = np.append(fit.zeta, np.zeros(fit.free.shape[1]))
    D = np.hstack([B, -part])
    return CoupledMatrices(
        block_diag(M, np.eye(len(omega))),
        block_diag(C, np.diag(2 * zeta * omega)),
        block_diag(K, np.diag(omega**2)) + D.T @ Kj @ D,
        np.hstack([np.zeros((m, len(K))), part]),
        len(K),
    )
