"""Modes from frequency responses to several references, with deviations (p-LSCF, then ML).

The responses H (p points, m references) are a right matrix fraction in z = exp(-i omega dt),

    H(omega) = B(z) A(z)^-1,   A (m, m) = sum_r A_r z^r,  A_0 = 1,

whose equations B - H A = 0 are linear. B is eliminated; A of every order comes from one Gram
matrix, its poles and participation factors from the companion matrix. With A_0 = 1 the poles that
fit noise mostly grow in time and are dropped. A mode is a pole that recurs from order to order with
its participation factors, and in the two halves of the hits.

The modal model (residues: least squares frequency domain, LSFD)

    H_pj = sum_i [phi_pi l_ij / (i omega - lambda_i) + conj.] + u_pj / omega^2 + v_pj + ...

then starts at those poles and is fitted by Gauss and Newton with the noise as weight (maximum
likelihood), points eliminated one by one. Deviations follow from the scatter of the hits: each
deleted hit displaces H at its point, hence the estimate (delete-one jackknife, linearised); without
repeated hits from the residual of the fit.

Guillaume et al., Proc. 21st IMAC (2003), p-LSCF; El-Kafafy, Guillaume, Peeters, Mech. Syst. Signal
Process. 40 (2013) 463, the modal model by maximum likelihood; Efron and Stein, Ann. Stat. 9 (1981)
586, the jackknife; Pappa, Elliott, Schenk, J. Guid. Control Dyn. 16 (1993) 860, phase collinearity.
"""

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from beadwave.fem.identification.hits import Deletions, FrequencyResponses
from beadwave.fem.modes.mac import mac
from beadwave.fem.modes.solver.threads import one_thread


class Stability(NamedTuple):
    """Criteria for a pole that is one of the order before, and for a mode."""

    poles: int = 72  # of the largest order, those that grow and the conjugate ones included
    orders: int = 24  # between 2 and the largest, at most
    frequency: float = 0.005  # relative change of frequency from one order to the next
    damping: float = 0.3  # relative change of the damping ratio
    participation: float = 0.8  # MAC of participation factors
    share: float = 0.4  # of the orders above the first that a track must hold; not varied
    halves: float = 0.01  # relative difference of frequency between the halves of the hits
    largest_zeta: float = 0.15  # damping ratio above which a pole is part of the background
    iterations: int = 8  # of Gauss and Newton; 3 to 5 are usual
    # even and odd terms of the background, of which the first is taken that the next does not
    # better by the Bayesian information criterion
    terms: tuple[tuple[int, int], ...] = ((6, 3), (10, 5), (14, 7), (18, 9))
    least_share: float = 0.01  # of the response's energy at its own frequency that a mode carries
    twin: float = 0.01  # relative distance of two modes that are one, where they are also
    alike: float = 0.97  # in the MAC of shapes and in that of participation factors
    band: float = 3.0  # largest ratio of a band's ends, where it has more than 2000 lines
    lines: int = 4000  # of a band, at most: else every second, third, ... is taken
    margin: float = 1.15  # by which a band is fitted beyond its ends, where it has neighbours


class StablePole(NamedTuple):
    """A pole followed over orders."""

    pole: complex  # [1/s]
    participation: NDArray[np.complex128]  # (m,)
    orders: tuple[int, ...]


class RejectedPole(NamedTuple):
    """A pole that recurs from order to order and is no mode."""

    number: int
    frequency_hz: float
    zeta: float
    reason: str


class IdentifiedModes(NamedTuple):
    """Modes of a test, lowest first; deviations are one standard deviation."""

    number: NDArray[np.int64]  # (n,) of the recurring pole, from 1, those left out included
    frequency_hz: NDArray[np.float64]  # (n,) |lambda| / (2 pi)
    zeta: NDArray[np.float64]  # (n,)
    phi: NDArray[np.complex128]  # (p, n) the largest component is 1
    participation: NDArray[np.complex128]  # (n, m) H = sum phi participation / (s - lambda) + conj.
    frequency_deviation: NDArray[np.float64]  # (n,) [Hz]
    zeta_deviation: NDArray[np.float64]  # (n,)
    phi_deviation: NDArray[np.float64]  # (p, n) of the complex component
    collinearity: NDArray[np.float64]  # (n,) 1 for a real shape
    orders: NDArray[np.int64]  # (n,) in which the pole recurred
    left_out: tuple[RejectedPole, ...]
    # order and its decaying poles [1/s], of one band after the other
    diagram: tuple[tuple[int, NDArray[np.complex128]], ...]
    # lines (k,) [Hz] and the modal model there (p, m, k), of each band
    synthesis: tuple[tuple[NDArray[np.float64], NDArray[np.complex128]], ...]


def phase_collinearity(phi: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Modal phase collinearity (n,) of shapes (p, n): 1 where all points move in phase or against,
    0 for a travelling wave. (Pappa, Elliott, Schenk 1993)"""
    x, y = phi.real, phi.imag
    xx, yy, xy = np.sum(x * x, axis=0), np.sum(y * y, axis=0), np.sum(x * y, axis=0)
    return ((xx - yy) ** 2 + 4 * xy**2) / np.maximum((xx + yy) ** 2, np.finfo(float).tiny)


def poles_of_orders(
    frequency_hz: NDArray[np.float64],
    H: NDArray[np.complex128],
    weight: NDArray[np.float64],
    orders: Sequence[int],
) -> list[tuple[int, NDArray[np.complex128], NDArray[np.complex128]]]:
    """Order, decaying poles (k,) [1/s] with positive frequency, participation factors (k, m), for
    every order of A, of H (p, m, f) at frequency_hz (f,), even lines, with weights (p, f); orders
    ascend.

    The sampling dt = 1 / (2 f_max) of the model is its own: it puts the band's end at z = -1.
    """
    m = H.shape[1]
    top = orders[-1]
    dt = 0.5 / frequency_hz[-1]
    z = np.exp(-2j * np.pi * np.outer(frequency_hz * dt, np.arange(top + 1)))  # (f, top + 1)

    # Gram matrices of [B, A] of the largest order; those of lower orders are blocks of them
    R, S, T = [], [], np.zeros(((top + 1) * m, (top + 1) * m))
    for h, w in zip(H, weight, strict=True):
        X = w[:, None] * z
        Y = -(w[:, None, None] * z[:, :, None] * h.T[:, None, :]).reshape(len(z), -1)
        R.append((X.conj().T @ X).real)
        S.append((X.conj().T @ Y).real)
        T += (Y.conj().T @ Y).real

    # D = T - S^T R^-1 S: what the equations say of A once the best B of each point is put in
    result = []
    for order in orders:
        n = order + 1
        D = T[: n * m, : n * m].copy()
        for r, s in zip(R, S, strict=True):
            D -= s[:n, : n * m].T @ np.linalg.lstsq(r[:n, :n], s[:n, : n * m], rcond=1e-13)[0]
        # A_0 = 1, the others least squares; companion matrix of sum A_r z^r, for 1 / z
        A = -np.linalg.lstsq(D[m:, m:], D[m:, :m], rcond=1e-13)[0].reshape(order, m, m)
        companion = np.zeros((order * m, order * m))
        companion[:m] = np.concatenate([-a.T for a in A], axis=1)
        companion[m:, :-m] = np.eye((order - 1) * m)

        # eigenvalues mu = exp(lambda dt); the first m rows of their vectors are participations
        mu, V = np.linalg.eig(companion)
        usable = np.abs(mu) > 1e-12
        pole = np.log(mu[usable].astype(complex)) / dt
        L = V[:m, usable]
        keep = (pole.real < 0) & (pole.imag > 0)
        result.append((order, pole[keep], L[:, keep].T))
    return result


def stable_poles(
    diagram: list[tuple[int, NDArray[np.complex128], NDArray[np.complex128]]], options: Stability
) -> list[StablePole]:
    """Poles that recur from order to order, lowest frequency first: medians over the orders.

    diagram has, order by order, the order, its poles (k,) [1/s] and participation factors (k, m) or
    shapes, whichever tells poles of one frequency apart.
    """
    tracks: list[list[tuple[int, complex, NDArray[np.complex128]]]] = []
    for i, (_, poles, L) in enumerate(diagram):
        light = (-poles.real < options.largest_zeta * np.abs(poles)).nonzero()[0]
        zeta = -poles.real / np.abs(poles)
        # one-to-one, the nearest pairs first; a track may miss two orders
        pairs = []
        for t, track in enumerate(tracks):
            last, pole, participation = track[-1]
            if i - last > 3:
                continue

            # alike in frequency, damping and participation, each over what it may change by
            zeta_before = -pole.real / abs(pole)
            change = np.abs(np.abs(poles[light]) / abs(pole) - 1) / options.frequency
            damping = np.abs(zeta[light] - zeta_before) / options.damping
            damping = damping / np.maximum(zeta[light], zeta_before)
            for j in np.flatnonzero((change < 1) & (damping < 1)).tolist():
                similar = float(mac(L[light[j]][:, None], participation[:, None])[0, 0])
                if similar > options.participation:
                    pairs.append((change[j] + damping[j] + 1 - similar, t, int(light[j])))
        used_tracks, used_poles = set(), set()
        for _, t, j in sorted(pairs):
            if t not in used_tracks and j not in used_poles:
                tracks[t].append((i, complex(poles[j]), L[j]))
                used_tracks.add(t)
                used_poles.add(j)
        tracks += [[(i, complex(poles[j]), L[j])] for j in light if j not in used_poles]

    # a mode is a track that holds long enough; medians of real and imaginary part, which a few
    # orders far off do not move, and the factors of the order nearest to them
    stable = []
    for track in tracks:
        if len(track) < options.share * len(diagram):
            continue
        rows, poles, L = zip(*track, strict=True)
        orders, poles = tuple(diagram[i][0] for i in rows), np.array(poles)
        middle = complex(np.median(poles.real), np.median(poles.imag))
        stable.append(StablePole(middle, L[int(np.abs(poles - middle).argmin())], orders))
    return sorted(stable, key=lambda s: s.pole.imag)


def background(frequency_hz: NDArray[np.float64], even: int, odd: int) -> NDArray[np.complex128]:
    """Functions (1 + even + odd, f) for what modes outside of the band leave in it, with x = f over
    the largest: 1 / x^2 of rigid motions and Chebyshev polynomials T(2 x^2 - 1), those times i x as
    well.

    A mode at 1.2 times the band's end is met to 3.5^(1 - even), one close behind it hardly: with
    two even terms estimates of synthetic tests were up to eleven deviations off, with
    six twenty of a weak mode where the band ends next to others. Sampling, in which
    dt / (1 - exp((lambda - s) dt)) stands for 1 / (s - lambda), adds odd powers.
    """
    x = frequency_hz / frequency_hz[-1]
    smooth = np.polynomial.chebyshev.chebvander(2 * x**2 - 1, even - 1).T
    return np.concatenate([[(x[0] / x) ** 2], smooth, 1j * x * smooth[:odd]])


class ResponseModes(NamedTuple):
    """The modal model at the responses (p, m, f), and what a change of H does to it.

    Weighted rows of the equations are compressed to the b = 4 n orthonormal columns q (2 f, b) that
    all derivatives are made of: those of a response x (f,) are w q^T [Re x, Im x].
    """

    pole: NDArray[np.complex128]  # (n,)
    L: NDArray[np.complex128]  # (n, m) the largest factor is 1
    phi: NDArray[np.complex128]  # (p, n)
    misfit: float  # sum of the weighted squares, real and imaginary parts
    normal: NDArray[np.float64]  # (g, g) of poles and factors, the points eliminated
    J: NDArray[np.float64]  # (p, m b, g) derivatives with respect to poles and factors
    local: NDArray[np.float64]  # (p, m b, 2 n) those with respect to a point's shape
    q: NDArray[np.float64]  # (2 f, b)
    synthesis: NDArray[np.complex128]  # (p, m, f) the model with its background


def modal_fit(
    frequency_hz: NDArray[np.float64],
    H: NDArray[np.complex128],
    weight: NDArray[np.float64],
    poles: NDArray[np.complex128],
    L: NDArray[np.complex128],
    iterations: int,
    terms: tuple[int, int],
) -> ResponseModes:
    """Poles (n,), participation L (n, m) and shapes that fit H (p, m, f) by least squares with
    weights (p, m) [1 / standard deviation], by Gauss and Newton from the poles given, with a
    background of so many even and odd terms.

    With P = 1 / (s - lambda), Q = 1 / (s - lambda*) all columns are c P + c* Q and c P^2 + c* Q^2,
    real combinations of P + Q, i (P - Q), P^2 + Q^2 and i (P^2 - Q^2), whichever point and
    reference. One QR factorisation of these, the background projected off, serves all of them.
    """
    p, m, f = H.shape
    n = len(poles)

    # the background projected off the responses, once for all steps: its amplitudes are free, real
    # and imaginary part at every point and reference
    s = 2j * np.pi * frequency_hz
    rows = background(frequency_hz, *terms)
    outside = np.linalg.qr(stacked(np.concatenate([rows, 1j * rows])).T)[0]
    data = stacked(H.reshape(p * m, f)).T
    beyond = data - outside @ (outside.T @ data)
    energy = float(np.sum((weight.ravel() * beyond) ** 2))

    # phi L has a free factor: the largest participation of each mode is 1 and stays so
    L = L / L[np.arange(n), np.abs(L).argmax(axis=1)][:, None]
    free = np.ones((n, m), bool)
    free[np.arange(n), np.abs(L).argmax(axis=1)] = False  # the factor that is 1 stays
    free_modes, free_references = np.nonzero(free)

    best, gradient = None, np.zeros(0)
    damping_factor = 0.0
    step_poles, step_L = np.zeros(n, complex), np.zeros((n, m), complex)
    for _ in range(iterations + 1):
        # poles of this step, kept decaying, and the columns that all derivatives are made of
        at, L_at = poles + step_poles, L + step_L
        at = np.where(at.real >= 0, -1e-4 * np.abs(at) + 1j * at.imag, at)
        P, Q = 1 / (s - at[:, None]), 1 / (s - at.conj()[:, None])
        scale = np.abs(at.real)[:, None]  # columns of like size: P^2 is as large as P / sigma
        basis = [P + Q, 1j * (P - Q), scale * (P**2 + Q**2), 1j * scale * (P**2 - Q**2)]
        basis = stacked(np.concatenate(basis)).T
        q, r = np.linalg.qr(basis - outside @ (outside.T @ basis))
        re, im, re2, im2 = r.reshape(4 * n, 4, n).swapaxes(0, 1)
        d = (q.T @ data).reshape(4 * n, p, m)

        # columns c P + c* Q of the shape at a point, (m b, 2 n)
        c = L_at.T[:, None]  # (m, 1, n)
        shape_columns = np.concatenate([re * c.real + im * c.imag, im * c.real - re * c.imag], 2)
        normal, phi = 0.0, np.empty((p, n), complex)
        J_all, local_all, gradient, cost = [], [], 0.0, 0.0
        for i in range(p):
            # the best shape at this point for these poles and factors: what is left of it has no
            # part along the shape's columns (variable projection)
            w = weight[i][:, None, None]
            local = (w * shape_columns).reshape(-1, 2 * n)
            target = (weight[i] * d[:, i]).T.ravel()
            u, sizes, vt = np.linalg.svd(local, full_matrices=False)
            inverse = np.where(sizes > 1e-12 * sizes[0], 1 / np.maximum(sizes, 1e-300), 0.0)
            amplitudes = vt.T @ (inverse * (u.T @ target))
            phi[i] = amplitudes[:n] + 1j * amplitudes[n:]
            misfit = target - local @ amplitudes

            # derivatives for poles (real, imaginary) and for the free participation factors
            a = (phi[i] * L_at.T)[:, None] / scale[:, 0]
            J = np.zeros((m, 4 * n, 2 * n + 2 * len(free_modes)))
            J[:, :, :n] = re2 * a.real + im2 * a.imag
            J[:, :, n : 2 * n] = im2 * a.real - re2 * a.imag
            b = phi[i, free_modes]
            column = 2 * n + 2 * np.arange(len(free_modes))
            re_b, im_b = re[:, free_modes], im[:, free_modes]
            J[free_references, :, column] = (re_b * b.real + im_b * b.imag).T
            J[free_references, :, column + 1] = (im_b * b.real - re_b * b.imag).T
            J = (w * J).reshape(m * 4 * n, -1)
            projected = J - u @ (u.T @ J)
            normal = normal + projected.T @ projected
            gradient = gradient + projected.T @ misfit
            cost += float(misfit @ misfit - target @ target)
            J_all.append(J)
            local_all.append(local)
        cost += energy

        # a step that gains is taken, with the model as it stands and its background added again
        if best is None or cost < best.misfit:
            settled = best is not None and best.misfit - cost < 1e-4 * cost
            amplitudes = phi[:, None, :] * L_at.T  # (p, m, n)
            model = amplitudes @ P + amplitudes.conj() @ Q
            residual = data - stacked(model.reshape(p * m, f)).T
            low = (outside @ (outside.T @ residual)).T.reshape(p, m, 2, f)
            model = model + low[:, :, 0] + 1j * low[:, :, 1]
            best = ResponseModes(
                at, L_at, phi, cost, normal, np.array(J_all), np.array(local_all), q, model
            )
            best_gradient = gradient
            poles, L = at, L_at
            damping_factor /= 10
            if settled:
                break
        else:  # the step was too long
            damping_factor = max(10 * damping_factor, 1e-3)

        # the next step (Levenberg and Marquardt), unknowns scaled to a unit diagonal
        size = np.sqrt(np.maximum(np.diag(best.normal), np.finfo(float).tiny))
        matrix = best.normal / np.outer(size, size) + damping_factor * np.eye(len(size))
        step = np.linalg.lstsq(matrix, best_gradient / size, rcond=1e-12)[0] / size
        step_poles = step[:n] + 1j * step[n : 2 * n]
        step_L = np.zeros((n, m), complex)
        pairs = step[2 * n :].reshape(-1, 2)
        step_L[free] = pairs[:, 0] + 1j * pairs[:, 1]
    return best


def stacked(rows: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Real parts next to imaginary ones, (r, 2 k) of (r, k)."""
    return np.concatenate([rows.real, rows.imag], axis=1)


def bands_between_modes(
    test: FrequencyResponses, band_hz: tuple[float, float], options: Stability
) -> list[tuple[float, float]]:
    """Parts of a band [Hz], cut where the responses are small, so that each has a ratio of its ends
    up to `options.band` or 2000 lines: polynomials in z are ill-conditioned over decades."""
    f, H = test.frequency_hz[test.usable], test.H[:, :, test.usable]
    low, high = max(band_hz[0], f[f > 0][0]), min(band_hz[1], f[-1])
    size = np.sum(np.abs(H) / np.abs(H).max(axis=2, keepdims=True), axis=(0, 1))
    spacing, parts = f[1] - f[0], []
    while True:
        reach = max(options.band * low, low + 2000 * spacing)
        if reach > high / 1.2:
            return [*parts, (low, high)]
        within = np.flatnonzero((f > low + 0.6 * (reach - low)) & (f < reach))
        width = max(1, len(within) // 50)
        smooth = np.convolve(np.log(size[within] + 1e-300), np.ones(width) / width, "same")
        cut = float(f[within[width + int(smooth[width : -width or None].argmin())]])
        parts.append((low, cut))
        low = cut


class PoleCandidates(NamedTuple):
    """Poles of a band that recur from order to order, and what may speak against them."""

    own: tuple[float, float]  # [Hz] modes beyond are those of neighbouring bands
    lines: NDArray[np.int64]  # (f,) of the test that are fitted
    noise: NDArray[np.float64]  # (p, m) standard deviation of a line
    poles: list[StablePole]
    doubts: list[str | None]
    diagram: list[tuple[int, NDArray[np.complex128]]]


def candidates(
    test: FrequencyResponses,
    own: tuple[float, float],
    ends: tuple[float, float],
    options: Stability,
) -> PoleCandidates:
    """Recurring poles of the part `own` of a test's band with these `ends` [Hz].

    The part is fitted somewhat beyond its ends: a mode there has then its flanks, and which part it
    belongs to is decided afterwards. Raises ValueError where it has too few lines.
    """
    low = own[0] / (options.margin if own[0] > ends[0] else 1)
    high = own[1] * options.margin  # as far as the test has lines
    frequency = test.frequency_hz
    within = (frequency >= low) & (frequency <= high) & (frequency > 0)
    lines = np.flatnonzero(within & test.usable)
    lines = lines[:: -(-len(lines) // options.lines)]
    f, H = frequency[lines], test.H[:, :, lines]
    m, n_lines = H.shape[1:]
    # the lines must outnumber the coefficients, those of B included
    largest = min(max(-(-options.poles // m), 8), n_lines // 4)
    if largest < 8:
        raise ValueError(
            f"{n_lines} lines between {low:g} and {high:g} Hz; at least 32 are needed, so measure "
            "longer or take a wider band"
        )

    # noise of every response: the scatter of its hits, else second differences along frequency
    # (second differences cancel what is smooth; of white noise they have six times its variance)
    curvature = np.abs(H[:, :, 2:] - 2 * H[:, :, 1:-1] + H[:, :, :-2])
    noise = np.median(curvature, axis=2) / np.sqrt(6 * np.log(2))
    for points, references, change in test.deletions:
        squares = (len(change) - 1) / len(change) * np.abs(change[:, :, :, lines]) ** 2
        noise[np.ix_(points, references)] = np.sqrt(np.median(squares.sum(axis=0), axis=2))
    noise = np.maximum(noise, 1e-6 * np.abs(H).max(axis=2))
    if test.deletions:
        noise = np.maximum(noise, 0.2 * np.median(noise))

    # stability over orders, then recurrence in both halves of the hits
    orders = range(2, largest + 1, -(-(largest - 1) // options.orders))
    weight = np.repeat(1 / np.sqrt(np.mean(noise**2, axis=1))[:, None], n_lines, axis=1)
    diagram = poles_of_orders(f, H, weight, orders)
    # the band's end is z = -1, where A has real roots that are no modes
    poles = [
        c for c in stable_poles(diagram, options)
        if f[0] <= c.pole.imag / (2 * np.pi) < 0.995 * f[-1]
    ]  # fmt: skip
    doubts: list[str | None] = [None] * len(poles)
    if test.halves is not None:
        recurring = [
            stable_poles(poles_of_orders(f, half[:, :, lines], weight, orders[::3]), options)
            for half in test.halves
        ]
        for i, candidate in enumerate(poles):
            near = [
                any(abs(abs(s.pole) / abs(candidate.pole) - 1) < options.halves for s in half)
                for half in recurring
            ]
            if not all(near):
                doubts[i] = "it does not recur in both halves of the hits"
    return PoleCandidates(own, lines, noise, poles, doubts, [(o, at) for o, at, _ in diagram])


def identified_modes(
    test: FrequencyResponses,
    band_hz: tuple[float, float] | None = None,
    options: Stability = Stability(),
    *,
    reject: Collection[int] = (),
    accept: Collection[int] = (),
) -> IdentifiedModes:
    """Modes of a test within a band [Hz], all of its lines without one.

    Poles that recur are numbered from 1, lowest first, before any is left out: those of `reject`
    are left out, those of `accept` are modes whatever speaks against them. Raises ValueError where
    the band has too few lines, no pole recurs, a number is none of a pole, or a response is zero.
    """
    if not np.isfinite(test.H).all() or not test.H.any(axis=2).all():
        raise ValueError("the responses hold NaN or inf, or one is zero; leave it out")
    if not test.usable.any():
        raise ValueError("the force excites no line; measure with a shorter pulse")
    ends = band_hz or (0.0, float(test.frequency_hz[-1]))
    with one_thread():  # eigenvalues of some hundred rows: 30 s a test in place of 2 on busy cores
        parts = [
            candidates(test, band, ends, options)
            for band in bands_between_modes(test, ends, options)
        ]  # fmt: skip

    # numbers of the poles in each band's own part, all bands together
    numbered = sorted(
        (abs(pole.pole), b, i)
        for b, part in enumerate(parts)
        for i, pole in enumerate(part.poles)
        if part.own[0] <= abs(pole.pole) / (2 * np.pi) <= part.own[1]
    )
    number = {(b, i): n for n, (_, b, i) in enumerate(numbered, start=1)}
    if not number:
        raise ValueError("no pole recurs from order to order; measure with less noise or longer")
    for n in (*reject, *accept):
        if not 1 <= n <= len(number):
            raise ValueError(f"pole {n} is none: they are numbered 1 to {len(number)}")

    # band by band: what is rejected, or does not recur in the halves, is left out; the others are
    # fitted together, those of the neighbours among them that reach into the band
    modes, left_out, synthesis = [], [], []
    for b, part in enumerate(parts):
        chosen = []
        for i, pole in enumerate(part.poles):
            n = number.get((b, i))
            reason = part.doubts[i] if n not in accept else None
            if n is not None and n in reject:
                reason = "rejected"
            if reason is None:
                chosen.append((n, pole))
            elif n is not None:
                left_out.append(of_pole(n, pole.pole + test.shift, reason))
        if chosen:
            identified, dropped, model = fitted_modes(test, part, chosen, accept, options)
            modes += identified
            left_out += dropped
            synthesis.append((test.frequency_hz[part.lines], model))
    if not modes:
        raise ValueError("no pole that recurs carries energy of the responses")

    # lowest first, field by field; poles of the diagram without the window's shift
    modes.sort(key=lambda mode: mode[1])
    columns = [np.array(column) for column in zip(*modes, strict=True)]
    number_, hz, zeta, phi, L, hz_deviation, zeta_deviation, phi_deviation, orders = columns
    diagram = tuple(
        (order, poles[(np.abs(poles) >= 2 * np.pi * part.own[0])
                      & (np.abs(poles) <= 2 * np.pi * part.own[1])] + test.shift)
        for part in parts for order, poles in part.diagram
    )  # fmt: skip
    return IdentifiedModes(
        number_, hz, zeta, phi.T, L, hz_deviation, zeta_deviation, phi_deviation.T,
        phase_collinearity(phi.T), orders, tuple(sorted(left_out)), diagram, tuple(synthesis),
    )  # fmt: skip


def of_pole(number: int, pole: complex, reason: str) -> RejectedPole:
    """A pole [1/s] that is left out, as frequency and damping ratio."""
    return RejectedPole(number, abs(pole) / (2 * np.pi), -pole.real / abs(pole), reason)


def fitted_modes(
    test: FrequencyResponses,
    part: PoleCandidates,
    chosen: list[tuple[int | None, StablePole]],
    accept: Collection[int],
    options: Stability,
) -> tuple[list[tuple], list[RejectedPole], NDArray[np.complex128]]:
    """Modes of a band by maximum likelihood, those that are left out, and the model (p, m, f).

    `chosen` are poles and their numbers, None for those beyond the band's own part. A mode is a
    tuple of the fields of IdentifiedModes up to phi_deviation, and the count of its orders. Modes
    that carry nothing are dropped one at a time, the weakest first, since its part of the response
    then goes to the others; after that the background grows while the Bayesian information
    criterion gains.
    """
    f, H, noise = test.frequency_hz[part.lines], test.H[:, :, part.lines], part.noise
    chosen, left_out = list(chosen), []
    terms, of_other_terms = options.terms[0], None

    # again without what carries no energy of its own
    while True:
        start = np.array([pole.pole for _, pole in chosen])
        L = np.array([pole.participation for _, pole in chosen])
        fit = modal_fit(f, H, 1 / noise, start, L, options.iterations, terms)
        droppable = [number not in accept for number, _ in chosen]
        drop = weakest_mode(fit, start, f, H, noise, droppable, options)
        if drop is None:
            # what modes beyond the band's end leave in it may need more terms
            further = [t for t in options.terms if t > terms and 8 * sum(t) < len(f)]
            other_terms = further[:1] or [t for t in options.terms if t < terms][-1:]
            if not other_terms:
                of_other_terms = None
                break
            of_other_terms = modal_fit(
                f, H, 1 / noise, fit.pole, fit.L, options.iterations, other_terms[0]
            )
            n_further = 2 * H[:, :, 0].size * (sum(other_terms[0]) - sum(terms))
            least = np.finfo(float).eps * np.sum(np.abs(H / noise[:, :, None]) ** 2)
            gain = 2 * H.size * np.log(max(fit.misfit, least) / max(of_other_terms.misfit, least))
            if not further or gain < n_further * np.log(2 * H.size):
                break
            terms = further[0]
            continue

        # without the weakest, again from where the others began
        _, i, reason = drop
        number, pole = chosen.pop(i)
        if number is not None:
            left_out.append(of_pole(number, pole.pole + test.shift, reason))
        if not chosen:
            return [], left_out, np.zeros_like(H)

    n = len(fit.pole)
    covariance, squares, spread = covariance_of(test, part, fit, terms)

    # the window's shift is taken off the poles; f = |lambda| / 2 pi, zeta = -Re lambda / |lambda|
    pole = fit.pole + test.shift
    size, sigma, omega = np.abs(pole), -pole.real, pole.imag
    # variances rr, ii and covariance ri of the pole's real and imaginary part
    rr, ii = np.diag(covariance)[:n], np.diag(covariance)[n : 2 * n]
    ri = np.diag(covariance[:n, n : 2 * n])
    widening = np.ones(n)
    if spread:
        # the variance of few hits is itself uncertain: two deviations hold 95 % by Student's t, at
        # the degrees of freedom of Welch and Satterthwaite
        total = sum(variance for _, variance in spread)
        freedom = total**2 / sum(variance**2 / count for count, variance in spread)
        freedom = np.minimum(freedom[:n], freedom[n:])
        widening = (stdtrit(freedom, 0.97725) / 2.0) ** 2
        rr, ii, ri = widening * rr, widening * ii, widening * ri
    # to first order d|lambda| = (-sigma dr + omega di) / |lambda|, and zeta = -Re lambda / |lambda|
    size_variance = (sigma**2 * rr + omega**2 * ii - 2 * sigma * omega * ri) / size**2
    d_real, d_imag = -(omega**2) / size**3, sigma * -omega / size**3
    zeta_variance = d_real**2 * rr + d_imag**2 * ii + 2 * d_real * d_imag * ri
    if of_other_terms is not None:
        # of another number of terms: an error of the background, which the scatter of hits is not
        moved = of_other_terms.pole + test.shift
        size_variance += (np.abs(moved) - size) ** 2
        zeta_variance += (-moved.real / np.abs(moved) - sigma / size) ** 2
    unit = fit.phi[np.abs(fit.phi).argmax(axis=0), np.arange(n)]
    phi_deviation = np.sqrt(widening * (squares[:, :n] + squares[:, n:])) / np.abs(unit)
    modes = [
        (
            number, size[i] / (2 * np.pi), sigma[i] / size[i], fit.phi[:, i] / unit[i],
            fit.L[i] * unit[i], np.sqrt(max(size_variance[i], 0)) / (2 * np.pi),
            np.sqrt(max(zeta_variance[i], 0)), phi_deviation[:, i], len(candidate.orders),
        )
        for i, (number, candidate) in enumerate(chosen)
        if number is not None
    ]  # fmt: skip
    return modes, left_out, fit.synthesis


def weakest_mode(
    fit: ResponseModes,
    start: NDArray[np.complex128],
    f: NDArray[np.float64],
    H: NDArray[np.complex128],
    noise: NDArray[np.float64],
    droppable: list[bool],
    options: Stability,
) -> tuple[float, int, str] | None:
    """Of the droppable modes with a fault the one that carries least: its share of the response at
    its frequency, its index and its fault; None where all are sound.

    Faults: the fit has left where it began (`start` (n,) [1/s]), damps too much, carries no energy
    of its own, or is a double of another. f (k,) [Hz], H (p, m, k), noise (p, m); droppable has n
    entries.
    """
    drop = None
    for i, pole in enumerate(fit.pole):
        line = int(np.abs(f - pole.imag / (2 * np.pi)).argmin())
        alone = np.outer(fit.phi[:, i], fit.L[i]) / (2j * np.pi * f[line] - pole)
        share = np.sum(np.abs(alone / noise) ** 2) / np.sum(np.abs(H[:, :, line] / noise) ** 2)
        moved = abs(abs(pole) / abs(start[i]) - 1) > 2 * options.halves
        reason = None
        if moved or -pole.real > options.largest_zeta * abs(pole):
            reason = "the fit of the responses does not hold it there"
        elif share < options.least_share:
            reason = f"it carries {100 * share:.2g} % of the response at its frequency"
        # a peak that is no resonance of a linear mode is fitted by several, all of one shape
        size = np.abs(fit.phi[:, i]).max() * np.abs(fit.L[i]).max() / -pole.real
        for j, rival_pole in enumerate(fit.pole):
            rival = np.abs(fit.phi[:, j]).max() * np.abs(fit.L[j]).max() / -rival_pole.real
            if i == j or rival < size or abs(abs(rival_pole / pole) - 1) > options.twin:
                continue
            pair = [i, j]
            alike = mac(fit.phi[:, pair], fit.phi[:, pair])[0, 1]
            if min(alike, mac(fit.L[pair].T, fit.L[pair].T)[0, 1]) > options.alike:
                share = 0.0
                reason = f"it is a double of {abs(rival_pole) / (2 * np.pi):.2f} Hz, of its shape"
        if reason and droppable[i] and (drop is None or share < drop[0]):
            drop = (share, i, reason)
    return drop


def covariance_of(
    test: FrequencyResponses, part: PoleCandidates, fit: ResponseModes, terms: tuple[int, int]
) -> tuple[NDArray[np.float64], NDArray[np.float64], list[tuple[int, NDArray[np.float64]]]]:
    """Covariance of poles and factors, squares (p, 2 n) of the deviations of shapes; and for each
    deletion of hits its degrees of freedom and the variance (2 n,) of poles, none without hits.

    Poles and factors are displaced by each deleted hit, or by the noise of each line.
    """
    f, noise = test.frequency_hz[part.lines], part.noise
    p, m = noise.shape
    n = len(fit.pole)
    inverse = np.linalg.pinv(fit.normal, rcond=1e-13, hermitian=True)
    local_inverse = [np.linalg.pinv(local) for local in fit.local]  # (2 n, m b)
    of_global = [-local_inverse[i] @ fit.J[i] for i in range(p)]  # shape by poles and factors
    # hits that are one another's multiples scatter by rounding, which is no noise
    covered = np.zeros((p, m), bool)
    for d in test.deletions:
        place = np.ix_(d.points, d.references)
        scatter = np.abs(d.change[..., part.lines]).max()
        covered[place] = scatter > 1e-12 * np.abs(test.H[place][..., part.lines]).max()
    squares, spread = np.zeros((p, 2 * n)), []
    if covered.all():
        covariance = 0.0
        for deleted in test.deletions:
            rows = compressed(deleted, part.lines, fit.q, 1 / noise)  # {point: (m b, hits)}
            gradient = sum(
                fit.J[i].T @ (x - fit.local[i] @ (local_inverse[i] @ x)) for i, x in rows.items()
            )
            displacement = inverse @ gradient
            covariance = covariance + displacement @ displacement.T
            spread.append((len(deleted.change) - 1, np.sum(displacement[: 2 * n] ** 2, axis=1)))
            for i in range(p):
                direct = local_inverse[i] @ rows[i] if i in rows else 0.0
                squares[i] += np.sum((of_global[i] @ displacement + direct) ** 2, axis=1)
    else:
        # responses without noise leave rounding, of either sign
        scatter = max(fit.misfit, 0.0) / (2 * p * m * (len(f) - 1 - sum(terms)))
        covariance = inverse * scatter
        for i in range(p):
            local = scatter * (local_inverse[i] @ local_inverse[i].T)
            squares[i] = np.diag(local + of_global[i] @ covariance @ of_global[i].T)
    return covariance, squares, spread


def compressed(
    deleted: Deletions,
    lines: NDArray[np.int64],
    q: NDArray[np.float64],
    weight: NDArray[np.float64],
) -> dict[int, NDArray[np.float64]]:
    """Weighted rows (m b, n_hits) by point, of what each deleted hit does to the responses there,
    in the columns q (2 f, b) of a fit; sums of their squares are jackknife variances. lines (f,)
    are those of the test that were fitted, weight (p, m) one over the noise."""
    hits, b, m = len(deleted.change), q.shape[1], weight.shape[1]
    rows = {}
    for i, point in enumerate(deleted.points.tolist()):
        x = np.zeros((m, b, hits))
        for j, reference in enumerate(deleted.references.tolist()):
            change = stacked(deleted.change[:, i, j, lines])
            x[reference] = weight[point, reference] * (q.T @ change.T)
        rows[point] = x.reshape(m * b, hits) * np.sqrt((hits - 1) / hits)
    return rows
